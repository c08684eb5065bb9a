//! The tables as `docs/reference/store.md` describes them: every column, in order, with its type.

use arrow_schema::{DataType, Field};

use crate::layout::Layout;

const REFERENCE: &str = include_str!(concat!(
    env!("CARGO_MANIFEST_DIR"),
    "/../../docs/reference/store.md"
));

fn type_name(field: &Field) -> String {
    let name = match field.data_type() {
        DataType::Int16 => "int16",
        DataType::Int32 => "int32",
        DataType::Int64 => "int64",
        DataType::Float64 => "double",
        DataType::Utf8 => "string",
        DataType::Binary => "binary",
        DataType::Struct(_) => "struct",
        other => panic!("{other}"),
    };
    let null = if field.is_nullable() { " or null" } else { "" };
    format!("{name}{null}")
}

/// Columns of a table with their types; of histograms, only the first bin and the last.
fn described(table: &str) -> Vec<(String, String)> {
    let heading = format!("\n## `{table}`\n");
    let section = REFERENCE.split(&heading).nth(1).expect("a heading");
    let section = section.split("\n## ").next().expect("a section");
    let cells = section
        .lines()
        .filter_map(|line| line.strip_prefix("| `")?.split_once(" | "));
    cells
        .map(|(name, rest)| {
            let kind = rest.split(" | ").next().expect("a type");
            (name.trim_end_matches('`').to_owned(), kind.to_owned())
        })
        .collect()
}

fn stored(layout: &Layout) -> Vec<(String, String)> {
    let schema = layout.stored_schema();
    let fields = schema.fields().iter();
    let (mut columns, mut bins) = (Vec::new(), Vec::new());
    for field in fields {
        match field.name().strip_prefix("seen_") {
            Some(bin) => bins.push(bin),
            None => columns.push((field.name().clone(), type_name(field))),
        }
        if let (Some(first), Some(last @ "12")) = (bins.first().copied(), bins.last().copied()) {
            columns.push((format!("seen_{first}` to `seen_{last}"), "int32".to_owned()));
            bins.clear();
        }
    }
    assert!(bins.is_empty(), "{bins:?}");
    columns
}

#[test]
fn every_column_is_in_the_reference() {
    for layout in Layout::known() {
        assert_eq!(described(layout.name), stored(&layout), "{}", layout.name);
    }
    assert!(REFERENCE.contains(&format!("**format {}**", crate::FORMAT_VERSION)));
}
