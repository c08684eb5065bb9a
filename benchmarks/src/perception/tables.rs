//! The result as tables of the book.

use std::fmt::Write as _;

use super::RawResult;
use super::score::Score;

/// Tables in Markdown.
pub(super) fn page(result: &RawResult) -> String {
    let mut page = String::new();
    let _ = writeln!(
        page,
        "{} pictures of {} drives through {} cities (seeds {:?}), model `{}`.\n",
        result.pictures,
        result.drives as usize * result.seeds.len(),
        result.seeds.len(),
        result.seeds,
        result.model
    );
    classes(&mut page, result);
    conditions(&mut page, result);
    tracking(&mut page, result);
    changes(&mut page, result);
    page
}

fn classes(page: &mut String, result: &RawResult) {
    page.push_str("| class | there | seen | precision | recall | F1 |\n| --- | --- | --- | --- | --- | --- |\n");
    for (class, score) in &result.all {
        let _ = writeln!(
            page,
            "| {class} | {} | {} | {} |",
            score.wanted,
            score.found,
            three(score)
        );
    }
}

fn conditions(page: &mut String, result: &RawResult) {
    let classes = ["lane_marking", "crosswalk", "stop_line", "vehicle"];
    let _ = writeln!(
        page,
        "\n| F1 by condition | {} |\n| --- |{}",
        classes.join(" | "),
        " --- |".repeat(classes.len())
    );
    for (condition, scores) in &result.by_condition {
        let cells: Vec<String> = classes
            .iter()
            .map(|class| share(scores.get(*class).and_then(|score| score.f1)))
            .collect();
        let _ = writeln!(page, "| {condition} | {} |", cells.join(" | "));
    }
}

fn tracking(page: &mut String, result: &RawResult) {
    page.push_str(
        "\n| followed | by | IDF1 | if no track erred | switches | sightings |\n| --- | --- | --- | --- | --- | --- |\n",
    );
    for (way, by_kind) in &result.tracking {
        for (kind, identity) in by_kind {
            let _ = writeln!(
                page,
                "| {kind} | {way} | {:.3} | {:.3} | {} | {} |",
                identity.idf1, identity.ceiling, identity.switches, identity.sightings
            );
        }
    }
}

fn changes(page: &mut String, result: &RawResult) {
    page.push_str("\n| seed | from | precision | recall | precision where enough looked | recall there | ECE |\n| --- | --- | --- | --- | --- | --- | --- |\n");
    for city in &result.changes {
        for (from, found) in [
            ("pixels", &city.from_pixels),
            ("detections", &city.from_detections),
        ] {
            let (all, looked) = (&found.change.scores.all, &found.looked_at.scores.all);
            let _ = writeln!(
                page,
                "| {} | {from} | {} | {} | {} | {} | {} |",
                city.seed,
                share(all.precision),
                share(all.recall),
                share(looked.precision),
                share(looked.recall),
                share(found.calibration.ece)
            );
        }
    }
}

fn three(score: &Score) -> String {
    [score.precision, score.recall, score.f1]
        .map(share)
        .join(" | ")
}

fn share(value: Option<f64>) -> String {
    value.map_or_else(|| "–".to_owned(), |value| format!("{value:.3}"))
}
