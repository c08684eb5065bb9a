//! The figures of the suite that is like the paper's, in the form of the paper's tables 1 to 3.

use serde_json::Value;

use super::Raw;
use super::page::{figure, models, share, table};

/// The suite that stands beside the paper.
const SUITE: &str = "paper-like";
/// What the paper says of its fused results, all types, at this T_s.
const PUBLISHED_T_S: f64 = 0.85;
const PUBLISHED: [&str; 3] = ["0.883", "0.782", "0.829"];
const PAPER: &str = "Zhang et al.";

const WORDS: &str = "\
The suite `paper-like`, in the form of the paper's tables 1 to 3. Of the paper's own figures those are repeated that were at hand: its totals.
`paper` is our reading of its equations, on our evidence: what it differs in from the row above it is the simulation, the map stage and the decisions that the equations leave open.\n\n";

/// The three tables; nothing without the suite.
pub(super) fn beside(results: &[Raw]) -> String {
    let Some(raw) = results.iter().find(|raw| raw.suite.name == SUITE) else {
        return format!("The suite {SUITE} was not run.\n");
    };
    [
        WORDS.to_owned(),
        format!("### Matching (table 1)\n\n{}\n", matching(raw)),
        format!("### A single vehicle (table 2)\n\n{}\n", single(raw)),
        format!("### Fused, over T_s (table 3)\n\n{}", fused(raw)),
    ]
    .concat()
}

fn matching(raw: &Raw) -> String {
    let matching = &raw.value["evaluation"]["matching"];
    let own = ["r_match", "r_recall", "assignment"].map(|name| share(&matching[name]));
    table(
        &["", "R_match", "R_recall", "assignment"],
        [
            cells(PAPER, ["0.951", "0.852", "-"].map(str::to_owned)),
            cells("Tilefold", own),
        ],
    )
}

fn single(raw: &Raw) -> String {
    let rows = models(raw).into_iter().flat_map(|(model, findings)| {
        let change = &findings["single_vehicle"]["change"];
        let types = ["added", "removed", "modified"]
            .map(|change_type| (change_type, &change["by_type"][change_type]));
        (types.into_iter().chain([("all", change)]))
            .map(move |(what, score)| {
                let mut row = cells(model, scores(score));
                row.insert(1, what.to_owned());
                row
            })
            .collect::<Vec<_>>()
    });
    table(&["model", "change", "precision", "recall", "F1"], rows)
}

fn fused(raw: &Raw) -> String {
    let mut rows = vec![cells(PAPER, PUBLISHED.map(str::to_owned))];
    rows[0].insert(1, format!("{PUBLISHED_T_S:.2}"));
    for (model, findings) in models(raw) {
        let sweep = findings["change"]["sweep"].as_array();
        rows.extend(sweep.into_iter().flatten().map(|point| {
            let mut row = cells(model, scores(point));
            let threshold = point["threshold"].as_f64().unwrap_or(0.0);
            row.insert(1, format!("{threshold:.2}"));
            row
        }));
    }
    table(&["", "T_s", "precision", "recall", "F1"], rows)
}

fn scores(score: &Value) -> [String; 3] {
    ["precision", "recall", "f1"].map(|name| figure(score, name))
}

fn cells(first: &str, rest: [String; 3]) -> Vec<String> {
    [vec![first.to_owned()], rest.to_vec()].concat()
}
