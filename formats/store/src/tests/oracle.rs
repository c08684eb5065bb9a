//! The tables through other eyes: Python's `deltalake` and DuckDB must count and sum what we do.
//!
//! `cargo xtask readers-test`, or with another Python: `TILEFOLD_PYTHON=.../bin/python cargo test
//! --workspace --lib -- --ignored other_readers`

use std::collections::BTreeMap;
use std::process::Command;

use arrow_array::cast::AsArray;
use arrow_array::types::{Float64Type, Int16Type, Int32Type, Int64Type};
use arrow_array::{Array, ArrayRef};
use arrow_schema::DataType;
use serde_json::{Value, json};
use tilefold_schemas::layer::ElementRow;
use tilefold_schemas::{
    ChangeRecord, ChunkRow, EvidenceRow, Footprint, LayerHeader, SensorRow, Sighting,
};

use super::rows::{parameters, properties, rows, tile, tiles};
use crate::{Snapshot, Store, StoredTable, TileFilter, Transaction};

fn fill<R: StoredTable>(tx: &mut Transaction, seed: u64) {
    for number in [1, 2, 300, 5000] {
        tx.append::<R>(rows(seed + number as u64, tile(number), 50))
            .unwrap();
    }
}

fn fill_all(store: &Store, seed: u64) {
    let mut tx = store.begin().unwrap();
    fill::<ElementRow>(&mut tx, seed);
    fill::<EvidenceRow>(&mut tx, seed);
    fill::<Sighting>(&mut tx, seed);
    fill::<Footprint>(&mut tx, seed);
    fill::<ChunkRow>(&mut tx, seed);
    fill::<SensorRow>(&mut tx, seed);
    fill::<ChangeRecord>(&mut tx, seed);
    fill::<LayerHeader>(&mut tx, seed);
    tx.commit("run", parameters()).unwrap();
}

/// Sum of numbers, or of the lengths of texts and bytes; and the number of nulls.
fn figures(column: &ArrayRef) -> (f64, usize) {
    let sum = match column.data_type() {
        DataType::Int16 => column
            .as_primitive::<Int16Type>()
            .iter()
            .flatten()
            .map(f64::from)
            .sum(),
        DataType::Int32 => column
            .as_primitive::<Int32Type>()
            .iter()
            .flatten()
            .map(f64::from)
            .sum(),
        DataType::Int64 => {
            let exact: i128 = column
                .as_primitive::<Int64Type>()
                .iter()
                .flatten()
                .map(i128::from)
                .sum();
            exact as f64
        }
        DataType::Float64 => column.as_primitive::<Float64Type>().iter().flatten().sum(),
        DataType::Utf8 => column
            .as_string::<i32>()
            .iter()
            .flatten()
            .map(|v| v.len() as f64)
            .sum(),
        DataType::Binary => column
            .as_binary::<i32>()
            .iter()
            .flatten()
            .map(|v| v.len() as f64)
            .sum(),
        DataType::Boolean => column
            .as_boolean()
            .iter()
            .flatten()
            .map(|v| f64::from(u8::from(v)))
            .sum(),
        other => panic!("no figures for {other}"),
    };
    (sum, column.null_count())
}

fn table<R: StoredTable>(snapshot: &Snapshot, tables: &mut BTreeMap<String, Value>) {
    let mut columns: BTreeMap<String, (f64, usize)> = BTreeMap::new();
    let mut count = 0;
    for batch in snapshot.batches::<R>(TileFilter::All).unwrap() {
        let batch = batch.unwrap();
        count += batch.num_rows();
        for (field, column) in batch.schema().fields().iter().zip(batch.columns()) {
            let (sum, nulls) = figures(column);
            let entry = columns.entry(field.name().clone()).or_default();
            *entry = (entry.0 + sum, entry.1 + nulls);
        }
    }
    let pin = snapshot.info().pins[R::NAME].version;
    let geometry = R::GEOMETRY;
    let entry = json!({"pin": pin, "rows": count, "columns": columns, "geometry": geometry});
    tables.insert(R::NAME.to_owned(), entry);
}

fn expectation(store: &Store, version: i64) -> Value {
    let snapshot = store.snapshot(Some(version)).unwrap();
    let mut tables = BTreeMap::new();
    table::<ElementRow>(&snapshot, &mut tables);
    table::<EvidenceRow>(&snapshot, &mut tables);
    table::<Sighting>(&snapshot, &mut tables);
    table::<Footprint>(&snapshot, &mut tables);
    table::<ChunkRow>(&snapshot, &mut tables);
    table::<SensorRow>(&snapshot, &mut tables);
    table::<ChangeRecord>(&snapshot, &mut tables);
    table::<LayerHeader>(&snapshot, &mut tables);
    json!({"version": version, "tables": tables})
}

#[test]
#[ignore = "needs Python with deltalake, pyarrow and duckdb"]
fn other_readers_count_and_sum_the_same() {
    // No `%` in this folder's name: Python's deltalake takes it for the start of an escape.
    let folder = tempfile::TempDir::new().unwrap();
    let store = Store::create(folder.path().join("a store für #1"), properties()).unwrap();
    fill_all(&store, 10);
    let mut tx = store.begin().unwrap();
    tx.replace_tiles::<EvidenceRow>(&tiles([1, 2]), rows(77, tile(2), 9))
        .unwrap();
    tx.commit("run", parameters()).unwrap();
    fill_all(&store, 20);
    // Committed, but pinned by no version: other readers must not be led there.
    let mut tx = store.begin().unwrap();
    fill::<EvidenceRow>(&mut tx, 30);
    tx.commit_tables().unwrap();

    let mut expected: Vec<Value> = (0..=3)
        .map(|version| expectation(&store, version))
        .collect();
    let (agreed, said) = ask(&store, &expected);
    println!("{said}");
    assert!(agreed, "{said}");
    // The canary: a question with a wrong answer in it must be noticed.
    expected[2]["tables"]["evidence"]["columns"]["hit"][0] = json!(1);
    let (agreed, said) = ask(&store, &expected);
    assert!(
        !agreed && said.contains("version 2 evidence by duckdb: hit"),
        "{said}"
    );
}

/// Whether the script agrees, and what it says.
fn ask(store: &Store, expected: &[Value]) -> (bool, String) {
    let file = tempfile::NamedTempFile::new().unwrap();
    std::fs::write(&file, json!(expected).to_string()).unwrap();
    let script = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../tests/oracles/read_store.py"
    );
    let python = std::env::var("TILEFOLD_PYTHON").unwrap_or_else(|_| "python3".to_owned());
    let output = Command::new(python)
        .args([script, &store.location()])
        .arg(file.path())
        .output()
        .unwrap();
    let said = [output.stdout, output.stderr].concat();
    (
        output.status.success(),
        String::from_utf8_lossy(&said).into_owned(),
    )
}
