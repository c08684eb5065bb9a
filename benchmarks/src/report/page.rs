//! The page itself: Markdown tables from raw results.

use std::fmt::Write as _;

use serde_json::Value;

use super::Raw;
use super::beside::beside;

const HEAD: &str = "\
# Accuracy in simulated cities

<!-- Made from benchmarks/runs/accuracy by `cargo run -p tilefold-benchmarks -- accuracy --report`. Do not edit. -->

Each suite is a set of cities that are drawn by lot, driven through, mapped and folded; what is claimed is held against what was edited. All cities of a suite are scored
together. The seeds of this page are not those that parameters are chosen on, but one (201) was looked at while registration was told to heed paint. A claim needs a posterior of T_s = 0.85 and V = 5 vehicles; in brackets are bootstrap 95 % intervals
over places of 500 m. What counts as right is said in [how evaluations count](../reference/evaluation.md).

The sensors are simulated, and by the people who wrote the method: figures of real data are in [the deecamp road](deecamp.md).

Published, for another simulation: Zhang et al. (*Machines* 2025, 13(12), 1080), all types, fused: precision 0.883, recall 0.782; matching: R_match 0.951, R_recall 0.852. Comparable are the
quantities: what is counted, the threshold, the number of vehicles, sensors as the paper states them. Not comparable are the cities, the detector and its false lines, how many passes a place has, and which changes there are and how large; and
their detector's output is not published. The figures stand beside each other and are no race.
";

/// The page.
pub(super) fn page(results: &[Raw]) -> String {
    let mut page = HEAD.to_owned();
    let mut section = |title: &str, body: String| {
        // Writing into a `String` cannot fail.
        let _ = write!(page, "\n## {title}\n\n{body}");
    };
    section("The suites", suites(results));
    section("Beside the paper", beside(results));
    section("Fused", fused(results));
    section("Where enough vehicles looked", looked_at(results));
    section("Where few vehicles drive", few(results));
    section("Single vehicles", single(results));
    section("By type", by_type(results));
    section("By detail", by_detail(results));
    section("Over T_s", sweep(results));
    section("Calibration", calibration(results));
    section("Geometry", geometry(results));
    section("Matching", matching(results));
    page
}

/// A Markdown table.
pub(crate) fn table(header: &[&str], rows: impl IntoIterator<Item = Vec<String>>) -> String {
    let line = |cells: &[String]| format!("| {} |\n", cells.join(" | "));
    let owned: Vec<String> = header.iter().map(|cell| (*cell).to_owned()).collect();
    let rules = vec!["---".to_owned(); header.len()];
    let mut text = line(&owned) + &line(&rules);
    for row in rows {
        text.push_str(&line(&row));
    }
    text
}

/// Both fusion models of a result: name and findings.
pub(super) fn models(raw: &Raw) -> [(&str, &Value); 2] {
    let own = &raw.value["evaluation"];
    [own, &own["other_model"]]
        .map(|findings| (findings["fusion_model"].as_str().unwrap_or("-"), findings))
}

fn number(value: &Value) -> String {
    value.as_u64().map_or("-".to_owned(), |n| n.to_string())
}

pub(super) fn share(value: &Value) -> String {
    value
        .as_f64()
        .map_or("-".to_owned(), |share| format!("{share:.3}"))
}

fn metres(value: &Value) -> String {
    value
        .as_f64()
        .map_or("-".to_owned(), |metres| format!("{metres:.2} m"))
}

/// A figure of a score with its interval.
pub(super) fn figure(score: &Value, name: &str) -> String {
    let interval = &score[format!("{name}_95")];
    let value = share(&score[name]);
    match (interval[0].as_f64(), interval[1].as_f64()) {
        (Some(low), Some(high)) => format!("{value} [{low:.2}, {high:.2}]"),
        _ => value,
    }
}

fn score_cells(score: &Value) -> Vec<String> {
    let mut cells: Vec<String> = ["truth", "claimed", "right"]
        .map(|name| number(&score[name]))
        .into();
    cells.extend(["precision", "recall", "f1"].map(|name| figure(score, name)));
    cells
}

const SCORE: [&str; 6] = ["true", "claims", "right", "precision", "recall", "F1"];

fn header<'a>(first: &[&'a str]) -> Vec<&'a str> {
    [first, &SCORE].concat()
}

/// A row for each suite and model.
fn by_model(results: &[Raw], cells: impl Fn(&Value) -> Vec<String>) -> Vec<Vec<String>> {
    let mut rows = Vec::new();
    for raw in results {
        for (model, findings) in models(raw) {
            let mut row = vec![raw.suite.name.to_owned(), model.to_owned()];
            row.extend(cells(findings));
            rows.push(row);
        }
    }
    rows
}

fn suites(results: &[Raw]) -> String {
    table(
        &[
            "suite", "what", "cities", "vehicles", "drives", "places", "method",
        ],
        results.iter().map(|raw| {
            vec![
                raw.suite.name.to_owned(),
                raw.suite.what.to_owned(),
                raw.value["seeds"]
                    .as_array()
                    .map_or(0, Vec::len)
                    .to_string(),
                raw.suite.vehicles.to_string(),
                raw.suite.drives.to_string(),
                number(&raw.value["evaluation"]["resampling"]["places"]),
                number(&raw.value["method"]),
            ]
        }),
    )
}

fn fused(results: &[Raw]) -> String {
    let rows = by_model(results, |findings| score_cells(&findings["change"]));
    table(&header(&["suite", "model"]), rows)
}

fn looked_at(results: &[Raw]) -> String {
    let words = "Drives are drawn by lot, so some places see few vehicles, and a claim takes five. Here only those changes count that five vehicles looked at: of the others nothing can be claimed, however good the fold.\n\n";
    let rows = by_model(results, |findings| score_cells(&findings["looked_at"]));
    words.to_owned() + &table(&header(&["suite", "model"]), rows)
}

fn few(results: &[Raw]) -> String {
    let words = "A small fleet, with fewer vehicles than five being enough for a claim (V): among all changes, and among those that V vehicles looked at.\n\n";
    let rows = results.iter().flat_map(|raw| {
        let points = raw.value["few_vehicles"].as_array();
        points.into_iter().flatten().flat_map(|point| {
            [("all", "change"), ("looked at by V", "looked_at")].map(|(what, name)| {
                let mut row = vec![raw.suite.name.to_owned(), number(&point["min_vehicles"])];
                row.push(what.to_owned());
                row.extend(score_cells(&point[name]));
                row
            })
        })
    });
    words.to_owned() + &table(&header(&["suite", "V", "changes"]), rows)
}

fn single(results: &[Raw]) -> String {
    let words = "A few vehicles of each city, each judged by its own evidence alone (V = 1), against the changes that it looked at; a change counts once for each vehicle.\n\n";
    let rows = by_model(results, |findings| {
        let single = &findings["single_vehicle"];
        let mut cells = vec![number(&single["vehicles"])];
        cells.extend(score_cells(&single["change"]));
        cells
    });
    words.to_owned() + &table(&header(&["suite", "model", "vehicles"]), rows)
}

fn by_type(results: &[Raw]) -> String {
    let mut rows = Vec::new();
    for change_type in ["added", "removed", "modified"] {
        let of_type = by_model(results, |findings| {
            score_cells(&findings["change"]["by_type"][change_type])
        });
        for mut row in of_type {
            row.insert(0, change_type.to_owned());
            rows.push(row);
        }
    }
    table(&header(&["change", "suite", "model"]), rows)
}

fn by_detail(results: &[Raw]) -> String {
    let mut rows = Vec::new();
    for raw in results {
        for (model, findings) in models(raw) {
            let details = findings["change"]["by_detail"].as_object();
            for (detail, found) in details.into_iter().flatten() {
                let counts = [number(&found["truth"]), number(&found["right"])];
                let [truth, right] = counts;
                let recall = figure(found, "recall");
                let (suite, model) = (raw.suite.name.to_owned(), model.to_owned());
                rows.push(vec![detail.clone(), suite, model, truth, right, recall]);
            }
        }
    }
    if rows.is_empty() {
        return "The truth of these cities has no details.\n".to_owned();
    }
    table(
        &["detail", "suite", "model", "true", "found", "recall"],
        rows,
    )
}

fn sweep(results: &[Raw]) -> String {
    let mut text = String::new();
    for raw in results {
        let name = raw.suite.name;
        let [(one, own), (two, other)] = models(raw);
        let points = |findings: &Value| {
            let sweep = findings["change"]["sweep"].as_array();
            sweep.cloned().unwrap_or_default()
        };
        let rows = points(own)
            .into_iter()
            .zip(points(other))
            .map(|(own, other)| {
                let mut row = vec![format!("{:.2}", own["threshold"].as_f64().unwrap_or(0.0))];
                for point in [&own, &other] {
                    row.extend(["precision", "recall"].map(|name| figure(point, name)));
                }
                row
            });
        let columns = [
            "T_s".to_owned(),
            format!("precision, {one}"),
            format!("recall, {one}"),
            format!("precision, {two}"),
            format!("recall, {two}"),
        ];
        let columns: Vec<&str> = columns.iter().map(String::as_str).collect();
        let _ = write!(
            text,
            "### {name}\n\n{}\n![Precision and recall over T_s](accuracy-{name}-sweep.svg)\n\n",
            table(&columns, rows)
        );
    }
    text.truncate(text.trim_end().len());
    text + "\n"
}

fn calibration(results: &[Raw]) -> String {
    let rows = by_model(results, |findings| {
        let (calibration, control) = (&findings["calibration"], &findings["control"]);
        vec![
            share(&calibration["ece"]),
            share(&calibration["brier"]),
            number(&control["judged"]),
            number(&control["claimed"]),
        ]
    });
    let header = [
        "suite",
        "model",
        "ECE",
        "Brier",
        "unchanged elements judged",
        "claimed changed",
    ];
    let mut text = table(&header, rows);
    text.push_str(&before_and_after(results));
    for raw in results {
        let name = raw.suite.name;
        let _ = write!(
            text,
            "\n### {name}\n\n![Share that changed against P(change)](accuracy-{name}-reliability.svg)\n"
        );
    }
    text
}

/// What fitting the sensor model to each city's own ledger, without its truth, is worth.
fn before_and_after(results: &[Raw]) -> String {
    let rows = results.iter().map(|raw| {
        let (before, after) = (&raw.value["before_calibration"], &raw.value["evaluation"]);
        let mut row = vec![raw.suite.name.to_owned()];
        for findings in [before, after] {
            let change = &findings["change"];
            row.push(share(&findings["calibration"]["ece"]));
            row.push(share(&change["precision"]));
            row.push(share(&change["recall"]));
        }
        row
    });
    let header = [
        "suite",
        "ECE, built in",
        "precision",
        "recall",
        "ECE, fitted",
        "precision",
        "recall",
    ];
    "\n### Before and after `calibrate`\n\nThe sensor model as built in, and fitted to each city's own ledger, which does not know the truth.\n\n".to_owned()
        + &table(&header, rows)
}

fn geometry(results: &[Raw]) -> String {
    let words = "Lateral distance of right claims from the true line, median and 95 %; and how often a shift's own 90 % interval holds the truth.\n\n";
    let rows = by_model(results, |findings| {
        let geometry = &findings["geometry"];
        let of = |name: &str| metres(&geometry[name]);
        vec![
            of("added_lateral_median_m"),
            of("added_lateral_p95_m"),
            of("modified_lateral_median_m"),
            of("modified_lateral_p95_m"),
            share(&geometry["modified_within_90"]),
        ]
    });
    let header = [
        "suite",
        "model",
        "added, median",
        "added, 95 %",
        "modified, median",
        "modified, 95 %",
        "within 90 %",
    ];
    words.to_owned() + &table(&header, rows)
}

fn matching(results: &[Raw]) -> String {
    let rows: Vec<Vec<String>> = results
        .iter()
        .filter(|raw| raw.value["evaluation"]["matching"].is_object())
        .map(|raw| {
            let matching = &raw.value["evaluation"]["matching"];
            let mut row = vec![raw.suite.name.to_owned(), number(&matching["detections"])];
            row.extend(["r_match", "r_recall", "assignment"].map(|name| share(&matching[name])));
            row
        })
        .collect();
    if rows.is_empty() {
        return "Not measured: the simulator does not write yet which element each detection is of.\n".to_owned();
    }
    table(
        &["suite", "detections", "R_match", "R_recall", "assignment"],
        rows,
    )
}
