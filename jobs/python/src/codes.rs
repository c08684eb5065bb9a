//! The codes in the columns of tables, by name.

use pyo3::prelude::*;
use serde_json::{Map, Value, json};
use tilefold_schemas::{Color, ElementKind, Marking, SignClass, Verdict};

/// For every column with codes, what each of them means: a JSON object of objects.
#[pyfunction]
pub(crate) fn codes() -> String {
    let kinds = named(ElementKind::ALL.iter().map(|one| (one.code(), one.name())));
    let markings = named(Marking::ALL.iter().map(|one| (one.code(), one.name())));
    let colors = named(Color::ALL.iter().map(|one| (one.code(), one.name())));
    let signs = named(SignClass::ALL.iter().map(|one| (one.code(), one.name())));
    let verdicts = named(Verdict::ALL.iter().map(|one| (one.code(), one.name())));
    json!({
        "kind": kinds, "marking": markings, "color": colors, "sign": signs, "verdict": verdicts,
    })
    .to_string()
}

fn named(names: impl Iterator<Item = (i16, &'static str)>) -> Map<String, Value> {
    names
        .map(|(code, name)| (code.to_string(), name.into()))
        .collect()
}
