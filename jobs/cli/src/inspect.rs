//! `inspect`: what a file is and holds, in words.

use std::collections::BTreeMap;
use std::error::Error;
use std::fmt::Display;
use std::path::Path;

use tilefold_engine::inspect::{
    Content, Inspection, LogContent, MapContent, ModelContent, StoreContent, inspect,
};

use crate::args::Args;
use crate::command::utc;
use crate::report::{Outcome, print, print_set_aside};
use crate::table;

/// Looks into a file.
///
/// # Errors
/// It is nothing that is known, or damaged as a whole.
pub(crate) fn look_into(args: &Args, file: &Path) -> Result<Outcome, Box<dyn Error>> {
    if !file.exists() && !file.to_string_lossy().contains("://") {
        return Err(format!("there is nothing at {}; check the path", file.display()).into());
    }
    let inspection = inspect(file)?;
    print(args, &inspection, words)?;
    print_set_aside(&inspection.set_aside);
    Ok(Outcome::with(&inspection.set_aside))
}

fn words(inspection: &Inspection) -> String {
    let mut words = match &inspection.content {
        Content::Log(log) => of_log(log),
        Content::Map(map) => of_map(map),
        Content::Store(store) => of_store(store),
        Content::Model(model) => of_model(model),
    };
    if inspection.set_aside.is_empty() {
        words.push_str("\nno damage\n");
    }
    for mend in &inspection.mend {
        words.push_str(&format!("\nto mend: {mend}\n"));
    }
    clean(&words)
}

fn of_log(log: &LogContent) -> String {
    let ms = |ns: i64| utc(ns.div_euclid(1_000_000));
    let topics = log.topics.iter().map(|topic| {
        vec![
            topic.topic.clone(),
            topic.schema.clone(),
            topic.encoding.clone(),
            topic.read_as.to_owned(),
            topic.messages.to_string(),
            topic.decoded.to_string(),
        ]
    });
    let head = [
        "topic", "schema", "encoding", "read as", "messages", "decoded",
    ];
    format!(
        "log (MCAP), {:.1} MB, {} to {} UTC, vehicle {}{}\n\n{}\n",
        log.bytes as f64 * 1e-6,
        ms(log.start_ns),
        ms(log.end_ns),
        log.vehicle.as_deref().unwrap_or("not named"),
        if log.has_summary {
            ""
        } else {
            ", without a usable summary"
        },
        table::rows(&head, topics)
    )
}

fn of_map(map: &MapContent) -> String {
    let bounds = map
        .bounds_deg
        .map_or(String::new(), |[west, south, east, north]| {
            format!("\nfrom {west:.6}, {south:.6} to {east:.6}, {north:.6} (longitude, latitude)")
        });
    format!(
        "map ({}){}{bounds}\nelements: {}\nnot paint: {}\nin the file: {}\n",
        map.format,
        listed(&map.about, ", "),
        or_none(&listed(&map.elements, "")),
        or_none(&listed(&map.not_paint, "")),
        listed(&map.counts, "")
    )
}

fn of_store(store: &StoreContent) -> String {
    let rows = store.tables.iter().map(|(name, rows)| {
        let rows = rows.map_or_else(|| "DAMAGED".to_owned(), |rows| rows.to_string());
        vec![(*name).to_owned(), rows]
    });
    format!(
        "store at version {} ({}, {} UTC), tiles of level {}\n\n{}\n",
        store.version,
        store.operation,
        utc(store.timestamp_ms),
        store.tile_level,
        table::rows(&["table", "rows"], rows)
    )
}

fn of_model(model: &ModelContent) -> String {
    format!(
        "model (ONNX, format {}, operators {}), by {}\nin: {}\nout: {}\n{} operators, {} tensors of \
         weights, {:.1} MB\n",
        model.ir_version,
        listed(&model.opsets, ""),
        or_none(&model.producer),
        listed(&model.inputs, ""),
        listed(&model.outputs, ""),
        model.nodes,
        model.weights,
        model.weight_bytes as f64 * 1e-6
    )
}

/// `name 1, other 2`, after `before` if there is anything.
fn listed<K: Display, V: Display>(counted: &BTreeMap<K, V>, before: &str) -> String {
    let parts: Vec<String> = counted
        .iter()
        .map(|(name, value)| format!("{name} {value}").trim().to_owned())
        .collect();
    match parts.is_empty() {
        true => String::new(),
        false => format!("{before}{}", parts.join(", ")),
    }
}

fn or_none(text: &str) -> &str {
    if text.is_empty() { "none" } else { text }
}

/// Text from files, without what would steer a terminal.
fn clean(text: &str) -> String {
    let shown = text.chars();
    let shown = shown.map(|c| {
        if c.is_control() && c != '\n' {
            '\u{fffd}'
        } else {
            c
        }
    });
    shown.collect()
}
