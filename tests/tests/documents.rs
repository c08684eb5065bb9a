//! Pages of the book that are made from the source are fresh.

#![allow(clippy::unwrap_used, clippy::panic)] // In a test, a panic is the report.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use tilefold_schemas::layer::{ElementRow, SensorRow};
use tilefold_schemas::table::Table;
use tilefold_schemas::{ChangeRecord, ChunkRow, EvidenceRow, Footprint, LayerHeader, Sighting};
use tilefold_tests::documents::{Group, errors, errors_page, is_fresh, tables, tables_page};

/// Where what a person may read is written; in the order of the page.
const ERRORS: [&str; 12] = [
    "formats/store/src/error.rs",
    "formats/src/map/error.rs",
    "formats/src/log/error.rs",
    "jobs/engine/src/error.rs",
    "workers/onnx/src/error.rs",
    "jobs/engine/src/detect.rs",
    "formats/src/model.rs",
    "formats/src/geojson.rs",
    "formats/src/matching_truth.rs",
    "formats/src/map_patch.rs",
    "formats/src/export/error.rs",
    "jobs/review/src/error.rs",
];

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .parent()
        .unwrap()
        .to_owned()
}

fn read(path: &str) -> String {
    fs::read_to_string(root().join(path)).unwrap_or_else(|error| panic!("{path}: {error}"))
}

/// A table's name, and its columns with their types.
fn columns<T: Table>() -> (String, Vec<(String, String)>) {
    let schema = T::schema();
    let columns = schema.fields().iter().map(|field| {
        let may_lack = if field.is_nullable() {
            ", may be null"
        } else {
            ""
        };
        (
            field.name().clone(),
            format!("{}{may_lack}", field.data_type()),
        )
    });
    (T::NAME.to_owned(), columns.collect())
}

#[test]
fn the_page_of_the_tables_is_fresh() {
    let sources = ["schemas/src/layer.rs", "schemas/src/evidence.rs"];
    let groups: Vec<Group> = sources
        .iter()
        .flat_map(|path| tables(&read(path)))
        .collect();
    let columns = BTreeMap::from([
        columns::<ElementRow>(),
        columns::<EvidenceRow>(),
        columns::<Sighting>(),
        columns::<Footprint>(),
        columns::<ChunkRow>(),
        columns::<SensorRow>(),
        columns::<ChangeRecord>(),
        columns::<LayerHeader>(),
    ]);
    assert_eq!(groups.len(), columns.len());
    let page = tables_page(&groups, &columns);
    is_fresh(&root().join("docs/reference/tables.md"), &page).unwrap();
}

#[test]
fn every_message_is_in_troubleshooting() {
    let groups: Vec<Group> = ERRORS.iter().flat_map(|path| errors(&read(path))).collect();
    let count: usize = groups.iter().map(|group| group.items.len()).sum();
    // As many as the sources have, whatever the reading of them may miss.
    let declared: usize = ERRORS
        .iter()
        .map(|path| read(path).matches("#[error(").count())
        .sum();
    let handed_on: usize = ERRORS.iter().map(|path| silent(&read(path))).sum();
    assert_eq!(count + handed_on, declared);
    let path = root().join("docs/troubleshooting.md");
    let kept = fs::read_to_string(&path).unwrap();
    is_fresh(&path, &errors_page(&groups, &kept)).unwrap();
}

/// Errors that say only what another one says.
fn silent(source: &str) -> usize {
    source.matches("#[error(transparent)]").count() + source.matches("#[error(\"{0}\")]").count()
}
