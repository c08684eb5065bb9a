//! An evaluation as tables for people.

use comfy_table::Cell;
use tilefold_engine::evaluate::{
    ChangeScores, Evaluation, Findings, Interval, Matching, Outcome, Score, SweepPoint,
};

use crate::table::{right, rows, table};

/// All of it.
#[must_use]
pub(crate) fn words(evaluation: &Evaluation) -> String {
    let criteria = format!(
        "fold {} at T >= {}, V >= {}",
        evaluation.fusion_model, evaluation.threshold, evaluation.min_vehicles
    );
    let resampling = &evaluation.resampling;
    let parts = [
        Some(criteria),
        Some(scores(evaluation)),
        Some(format!(
            "in brackets: 95 % of {} resamples of {} places of {} m",
            resampling.resamples, resampling.places, resampling.place_m
        )),
        by_detail(&evaluation.findings.change),
        Some(sweep(evaluation)),
        Some(models(evaluation)),
        evaluation.matching.as_ref().map(matching),
        others(&evaluation.outcomes),
    ];
    parts.into_iter().flatten().collect::<Vec<_>>().join("\n\n")
}

fn scores(evaluation: &Evaluation) -> String {
    let mut table = table(&[
        "change",
        "true",
        "claimed",
        "right",
        "precision",
        "recall",
        "F1",
    ]);
    let mut add = |name: &str, score: &Score| {
        table.add_row([
            Cell::new(name),
            right(score.truth),
            right(score.claimed),
            right(score.right),
            right(with_interval(score.precision, score.precision_95)),
            right(with_interval(score.recall, score.recall_95)),
            right(share(score.f1)),
        ]);
    };
    let change = &evaluation.findings.change.scores;
    for (name, score) in &change.by_type {
        add(name, score);
    }
    add("all", &change.all);
    let other = &evaluation.other_model;
    add(
        &format!("all, {}", other.fusion_model),
        &other.findings.change.scores.all,
    );
    for (name, findings) in both(evaluation) {
        if let Some(single) = &findings.single_vehicle {
            let name = format!("{} vehicles alone, {name}", single.vehicles);
            add(&name, &single.change.scores.all);
        }
    }
    table.to_string()
}

fn both(evaluation: &Evaluation) -> [(&'static str, &Findings); 2] {
    let other = &evaluation.other_model;
    [
        (evaluation.fusion_model, &evaluation.findings),
        (other.fusion_model, &other.findings),
    ]
}

fn share(value: Option<f64>) -> String {
    value.map_or("-".to_owned(), |value| format!("{value:.3}"))
}

fn with_interval(value: Option<f64>, interval: Option<Interval>) -> String {
    let interval = interval.map_or(String::new(), |[low, high]| {
        format!(" [{low:.2}, {high:.2}]")
    });
    format!("{}{interval}", share(value))
}

fn by_detail(change: &ChangeScores) -> Option<String> {
    if change.by_detail.is_empty() {
        return None;
    }
    let details = change.by_detail.iter().map(|(detail, found)| {
        vec![
            printable(detail),
            found.truth.to_string(),
            found.right.to_string(),
            with_interval(found.recall, found.recall_95),
        ]
    });
    Some(rows(&["detail", "true", "found", "recall"], details))
}

/// Words from a truth file may hold anything; control characters do not reach the terminal.
fn printable(text: &str) -> String {
    let visible = |c: char| if c.is_control() { '\u{fffd}' } else { c };
    text.chars().map(visible).collect()
}

fn sweep(evaluation: &Evaluation) -> String {
    let [(one, own), (two, other)] = both(evaluation);
    let figures = |point: &SweepPoint| {
        let score = &point.scores.all;
        [share(score.precision), share(score.recall)]
    };
    let pairs = own.change.sweep.iter().zip(&other.change.sweep);
    let lines = pairs.map(|(own, other)| {
        let mut row = vec![format!("{:.2}", own.threshold)];
        row.extend(figures(own).into_iter().chain(figures(other)));
        row
    });
    rows(
        &[
            "T",
            &format!("precision, {one}"),
            "recall",
            &format!("precision, {two}"),
            "recall",
        ],
        lines,
    )
}

/// What is no score: calibration, control, geometry and metres of both models.
fn models(evaluation: &Evaluation) -> String {
    let [(one, own), (two, other)] = both(evaluation);
    let metres = |value: Option<f64>| value.map_or("-".to_owned(), |m| format!("{m:.2} m"));
    type Figure<'a> = (&'a str, &'a dyn Fn(&Findings) -> String);
    let figures: [Figure<'_>; 8] = [
        ("ECE", &|f| share(f.calibration.ece)),
        ("Brier score", &|f| share(f.calibration.brier)),
        ("unchanged elements judged", &|f| {
            f.control.judged.to_string()
        }),
        ("  of these claimed changed", &|f| {
            f.control.claimed.to_string()
        }),
        ("added lines, lateral error, median and 95 %", &|f| {
            let g = &f.geometry;
            format!(
                "{}, {}",
                metres(g.added_lateral_median_m),
                metres(g.added_lateral_p95_m)
            )
        }),
        ("modified lines, lateral error, median and 95 %", &|f| {
            let g = &f.geometry;
            format!(
                "{}, {}",
                metres(g.modified_lateral_median_m),
                metres(g.modified_lateral_p95_m)
            )
        }),
        ("  within their own 90 % interval", &|f| {
            share(f.geometry.modified_within_90)
        }),
        ("metres changed, claimed, rightly claimed", &|f| {
            let m = &f.change.metres;
            format!("{:.0}, {:.0}, {:.0}", m.truth, m.claimed, m.right)
        }),
    ];
    let lines = figures.map(|(name, figure)| vec![name.to_owned(), figure(own), figure(other)]);
    rows(&["", one, two], lines)
}

fn matching(matching: &Matching) -> String {
    format!(
        "matching of {} detections: R_match {}, R_recall {}, assignment {}",
        matching.detections,
        share(matching.r_match),
        share(matching.r_recall),
        share(matching.assignment)
    )
}

/// Claims that are not right, and changes that were missed.
fn others(outcomes: &[Outcome]) -> Option<String> {
    let others: Vec<Vec<String>> = outcomes
        .iter()
        .filter(|outcome| outcome.outcome != "right")
        .map(outcome)
        .collect();
    (!others.is_empty()).then(|| {
        let header = [
            "",
            "change",
            "element",
            "metres",
            "posterior",
            "vehicles",
            "said",
        ];
        rows(&header, others)
    })
}

fn outcome(outcome: &Outcome) -> Vec<String> {
    let or_dash = |text: Option<String>| text.unwrap_or("-".to_owned());
    let range = outcome.from_m.zip(outcome.to_m);
    vec![
        outcome.outcome.replace('_', " "),
        match &outcome.detail {
            Some(detail) => format!("{}, {}", outcome.change_type, printable(detail)),
            None => outcome.change_type.to_owned(),
        },
        or_dash(outcome.element_id.map(|id| id.to_string())),
        or_dash(range.map(|(from_m, to_m)| format!("{from_m:.0} to {to_m:.0}"))),
        share(outcome.posterior),
        or_dash(outcome.vehicles.map(|vehicles| vehicles.to_string())),
        outcome.said.clone().unwrap_or_default(),
    ]
}
