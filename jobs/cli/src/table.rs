//! Tables for people.

use comfy_table::{Cell, CellAlignment, Table, TableStyle};
use tilefold_engine::notes::MountingNote;
use tilefold_engine::{RunReport, StageReport};

/// Cameras that the end of a run lists.
const MAX_MOUNTINGS: usize = 12;

/// An empty table under a header.
#[must_use]
pub(crate) fn table(header: &[&str]) -> Table {
    let mut table = Table::new();
    table
        .load_style(TableStyle::new())
        .set_header(header.to_vec());
    table
}

/// A cell set to the right, for numbers.
#[must_use]
pub(crate) fn right(text: impl ToString) -> Cell {
    Cell::new(text.to_string()).set_alignment(CellAlignment::Right)
}

/// Rows of texts under a header.
#[must_use]
pub(crate) fn rows(header: &[&str], rows: impl IntoIterator<Item = Vec<String>>) -> String {
    let mut table = table(header);
    for row in rows {
        table.add_row(row);
    }
    table.to_string()
}

/// The stages of a job.
#[must_use]
pub(crate) fn stages(stages: &[StageReport]) -> String {
    let mut table = table(&[
        "stage",
        "done",
        "",
        "MB",
        "busy s",
        "per busy s",
        "MB per busy s",
    ]);
    for stage in stages {
        table.add_row([
            Cell::new(stage.stage),
            right(stage.items),
            Cell::new(stage.unit),
            right(format!("{:.1}", stage.bytes as f64 * 1e-6)),
            right(format!("{:.2}", stage.busy_s)),
            right(format!("{:.0}", stage.items_per_busy_s)),
            right(format!("{:.1}", stage.mb_per_busy_s)),
        ]);
    }
    table.to_string()
}

/// The end of a run.
#[must_use]
pub(crate) fn run(report: &RunReport) -> String {
    let what = if report.is_new_version {
        "committed"
    } else {
        "nothing new; still at"
    };
    format!(
        "{}\n\n{}{what} version {}: {} logs of {} vehicles, {} chunks mapped, {} known already, {} copies of messages ignored, {} tiles reduced, {:.1} s",
        stages(&report.stages),
        notes(report),
        report.version,
        report.logs,
        report.vehicles,
        report.chunks_mapped,
        report.chunks_known,
        report.duplicate_messages,
        report.tiles_reduced,
        report.wall_s,
    )
}

/// What a run found out about the drives, for people; empty if there is nothing to say.
#[must_use]
pub(crate) fn notes(report: &RunReport) -> String {
    let mut text = String::new();
    if !report.done_without.is_empty() {
        let lines = report
            .done_without
            .iter()
            .map(|without| vec![without.chunks.to_string(), without.what.to_string()]);
        text += &rows(&["chunks", "poses had to do without"], lines);
        text += "\n\n";
    }
    if !report.mountings.is_empty() {
        text += &mountings(&report.mountings);
        text += "\n\n";
    }
    text
}

/// Mountings as refined; a dash where the drive could not tell.
fn mountings(notes: &[MountingNote]) -> String {
    let header = [
        "camera of",
        "roll °",
        "pitch °",
        "yaw °",
        "height m",
        "lines from the map, m",
        "refined",
    ];
    let lines = notes.iter().take(MAX_MOUNTINGS).map(|note| {
        let mut cells = vec![format!("{} {}", note.log, note.topic)];
        cells.extend((0..4).map(|axis| correction(note, axis)));
        cells.push(format!("{:.2}", note.stated_miss_m));
        cells.push(format!("{:.2}", note.refined_miss_m));
        cells
    });
    let more = match notes.len().checked_sub(MAX_MOUNTINGS) {
        None | Some(0) => String::new(),
        Some(more) => format!("\nand {more} more cameras (all of them by --format json)"),
    };
    rows(&header, lines) + &more
}

/// What is added to the stated roll, pitch, yaw (degrees) or height (metres).
fn correction(note: &MountingNote, axis: usize) -> String {
    let scale = if axis < 3 { 1.0_f64.to_degrees() } else { 1.0 };
    match (note.correction[axis], note.sigma[axis]) {
        (Some(value), Some(sigma)) => {
            format!("{:+.2} ± {:.2}", value * scale, sigma * scale)
        }
        _ => "-".to_owned(),
    }
}
