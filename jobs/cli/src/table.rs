//! Tables for people.

use comfy_table::{Cell, CellAlignment, Table, TableStyle};
use tilefold_engine::evaluate::{Evaluation, Score};
use tilefold_engine::{RunReport, StageReport};

fn table(header: &[&str]) -> Table {
    let mut table = Table::new();
    table
        .load_style(TableStyle::new())
        .set_header(header.to_vec());
    table
}

fn right(text: impl ToString) -> Cell {
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

fn share(value: Option<f64>) -> Cell {
    right(value.map_or("-".to_owned(), |value| format!("{value:.3}")))
}

/// An evaluation.
#[must_use]
pub(crate) fn evaluation(evaluation: &Evaluation) -> String {
    let mut scores = table(&[
        "change",
        "true",
        "claimed",
        "right",
        "precision",
        "recall",
        "F1",
    ]);
    let mut add = |name: &str, score: &Score| {
        scores.add_row([
            Cell::new(name),
            right(score.truth),
            right(score.claimed),
            right(score.right),
            share(score.precision),
            share(score.recall),
            share(score.f1),
        ]);
    };
    for (name, score) in &evaluation.change.by_type {
        add(name, score);
    }
    add("all", &evaluation.change.all);
    let others = evaluation
        .outcomes
        .iter()
        .filter(|outcome| outcome.outcome != "right");
    let others = rows(
        &["", "change", "element", "posterior", "vehicles", "said"],
        others.map(|outcome| {
            vec![
                outcome.outcome.to_owned(),
                outcome.change_type.to_owned(),
                outcome
                    .element_id
                    .map_or("-".to_owned(), |id| id.to_string()),
                outcome
                    .posterior
                    .map_or("-".to_owned(), |p| format!("{p:.3}")),
                outcome.vehicles.map_or("-".to_owned(), |v| v.to_string()),
                outcome.said.clone().unwrap_or_default(),
            ]
        }),
    );
    format!(
        "fold {} at T >= {}, V >= {}\n{scores}\n\nunchanged elements judged {}, claimed changed {}\nECE {}, Brier {}\n\n{others}",
        evaluation.fusion_model,
        evaluation.threshold,
        evaluation.min_vehicles,
        evaluation.control.judged,
        evaluation.control.claimed,
        evaluation
            .calibration
            .ece
            .map_or("-".to_owned(), |v| format!("{v:.3}")),
        evaluation
            .calibration
            .brier
            .map_or("-".to_owned(), |v| format!("{v:.3}")),
    )
}
