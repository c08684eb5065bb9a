//! Tables for people.

use comfy_table::{Cell, CellAlignment, Table, TableStyle};
use tilefold_engine::{RunReport, StageReport};

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
        "{}\n\n{what} version {}: {} logs of {} vehicles, {} chunks mapped, {} known already, {} copies of messages ignored, {} tiles reduced, {:.1} s",
        stages(&report.stages),
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
