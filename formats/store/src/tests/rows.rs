//! Rows and stores to test with. Rows are made from a table's schema, so they need no care when a
//! field is added.

use std::collections::BTreeSet;
use std::sync::Arc;

use arrow_array::{
    ArrayRef, BinaryArray, BooleanArray, Float64Array, Int16Array, Int32Array, Int64Array,
    RecordBatch, StringArray,
};
use arrow_schema::{DataType, Field};
use tempfile::TempDir;
use tilefold_schemas::TileId;

use crate::{Parameters, Store, StoreProperties, StoredTable};

/// A tile at level 13; neighbours in Morton order share a coarse tile with it up to `number` 255.
pub(super) fn tile(number: i32) -> TileId {
    TileId((1 << 29) + (1 << 20) + number)
}

pub(super) fn tiles(numbers: impl IntoIterator<Item = i32>) -> BTreeSet<TileId> {
    numbers.into_iter().map(tile).collect()
}

pub(super) fn properties() -> StoreProperties {
    let mut parameters = Parameters::new();
    parameters.insert("section_m".to_owned(), 10.1.into());
    StoreProperties {
        salt: [7; 32],
        tile_level: 13,
        parameters,
    }
}

/// An empty store in a folder whose name asks for escaping.
pub(super) fn store() -> (TempDir, Store) {
    let folder = TempDir::new().unwrap();
    let store = Store::create(folder.path().join("a store, %20 für #1"), properties()).unwrap();
    (folder, store)
}

pub(super) fn parameters() -> Parameters {
    Parameters::from([(
        "logs".to_owned(),
        serde_json::json!(["a.mcap", 0.1, {"z": 1, "a": 2}]),
    )])
}

/// `count` rows of one tile, different for each seed.
pub(super) fn rows<R: StoredTable>(seed: u64, tile: TileId, count: usize) -> Vec<R> {
    let schema = R::schema();
    let columns = schema
        .fields()
        .iter()
        .enumerate()
        .map(|(index, field)| column(field, seed.wrapping_mul(1009) + index as u64, tile, count))
        .collect();
    R::from_batch(&RecordBatch::try_new(schema, columns).unwrap()).unwrap()
}

fn column(field: &Field, seed: u64, tile: TileId, count: usize) -> ArrayRef {
    let numbers: Vec<Option<u64>> = (0..count as u64)
        .map(|row| mix(seed, row))
        .map(|number| (!field.is_nullable() || number % 3 != 0).then_some(number))
        .collect();
    if field.name() == "tile" {
        return Arc::new(Int32Array::from(vec![tile.0; count]));
    }
    let real = |number: u64| (number % 1_000_000) as f64 / 4096.0;
    match field.data_type() {
        DataType::Int16 => Arc::new(Int16Array::from_iter(
            numbers.iter().map(|number| number.map(|n| (n % 7) as i16)),
        )),
        DataType::Int32 => Arc::new(Int32Array::from_iter(
            numbers.iter().map(|number| number.map(|n| n as i32 % 1000)),
        )),
        DataType::Int64 => Arc::new(Int64Array::from_iter(
            numbers.iter().map(|number| number.map(|n| n as i64 >> 16)),
        )),
        DataType::Float64 => Arc::new(Float64Array::from_iter(
            numbers.iter().map(|number| number.map(real)),
        )),
        DataType::Utf8 => Arc::new(StringArray::from_iter(
            numbers
                .iter()
                .map(|number| number.map(|n| format!("text {}", n % 11))),
        )),
        DataType::Binary => Arc::new(BinaryArray::from_iter(
            numbers.iter().map(|number| number.map(|n| wkb(real(n)))),
        )),
        DataType::Boolean => Arc::new(BooleanArray::from_iter(
            numbers.iter().map(|number| number.map(|n| n % 2 == 0)),
        )),
        other => panic!("no test values of type {other}"),
    }
}

/// A line of two points near (8, 48).
fn wkb(offset: f64) -> Vec<u8> {
    let mut bytes = vec![1, 2, 0, 0, 0, 2, 0, 0, 0];
    for value in [8.0, 48.0, 8.0 + offset * 1e-6, 48.0 + offset * 1e-6] {
        bytes.extend(f64::to_le_bytes(value));
    }
    bytes
}

/// SplitMix64.
fn mix(seed: u64, row: u64) -> u64 {
    let mut z = seed
        .wrapping_mul(0x9e37_79b9_7f4a_7c15)
        .wrapping_add(row.wrapping_mul(0xd1b5_4a32_d192_ed03));
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}
