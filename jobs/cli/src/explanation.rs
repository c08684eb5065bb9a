//! `explain`: why a verdict, as tables or JSON.

use std::error::Error;
use std::path::Path;

use tilefold_engine::explain;
use tilefold_engine::explain::{Explanation, Frame, PassSays, WouldFlip};
use tilefold_engine::frames::{self, Outputs, Sources};

use crate::args::{Args, Frames};
use crate::at::{At, open};
use crate::command::perception;
use crate::report::{Outcome, print, print_set_aside};
use crate::table;

/// Explains a change, or all that is said of an element.
///
/// # Errors
/// As [`tilefold_engine::explain()`].
pub(crate) fn explain_verdict(
    args: &Args,
    (store, id, version): (&Path, &str, Option<At>),
    asked: &Frames,
) -> Result<Outcome, Box<dyn Error>> {
    let snapshot = open(store, version)?;
    let explained = explain(&snapshot, id)?;
    print(args, &explained, |explained| {
        let texts: Vec<String> = explained.iter().map(text).collect();
        texts.join("\n\n")
    })?;
    let outputs = Outputs {
        folder: asked.frames.as_deref(),
        case: asked.case.as_deref(),
    };
    if outputs.folder.or(outputs.case).is_none() {
        return Ok(Outcome::Done);
    }
    let perception = perception(asked.detector.as_deref(), &asked.runtime)?;
    let sources = Sources {
        logs: &asked.logs,
        perception: perception.as_ref(),
    };
    let frames: Vec<Frame> = explained
        .iter()
        .flat_map(|told| told.frames.clone())
        .collect();
    let pictures = frames::write(&snapshot, &frames, sources, outputs)?;
    let count = frames.len() - pictures.set_aside.len();
    for place in [outputs.folder, outputs.case].into_iter().flatten() {
        tell!(
            "{count} of {} frames are in {}",
            frames.len(),
            place.display()
        );
    }
    print_set_aside(&pictures.set_aside);
    Ok(Outcome::with(&pictures.set_aside))
}

fn text(told: &Explanation) -> String {
    let parts = [
        Some(title(told)),
        Some(sums(told)),
        since(told),
        (!told.passes.is_empty()).then(|| passes(&told.passes)),
        believed_less(told),
        Some(flip(told)),
        (!told.frames.is_empty()).then(|| frame_rows(&told.frames)),
        (!told.agrees).then(|| {
            "note: folding this evidence now gives another record than the layer holds; it was made by another version of the program".to_owned()
        }),
    ];
    parts.into_iter().flatten().collect::<Vec<_>>().join("\n\n")
}

fn title(told: &Explanation) -> String {
    let what = match told.element {
        Some(element) => format!("element {element}, {}", told.kind),
        None => format!("a {} that the map lacks", told.kind),
    };
    format!(
        "change {} (version {}): {what}, {:.0} to {:.0} m: {}",
        told.change, told.version, told.from_m, told.to_m, told.verdict
    )
}

fn sums(told: &Explanation) -> String {
    let [no_change, added, removed, modified] = told.posterior;
    format!(
        "no change {no_change:.3}, added {added:.3}, removed {removed:.3}, modified {modified:.3} (fusion model {}, sensor model {})\n\
         {:+.2} nats of {} against no change = {:+.2} from {} passes {:+.2} from the prior, neighbouring stretches and possible places",
        told.fusion_model,
        told.sensor_model,
        told.log_odds,
        told.likeliest_change,
        told.evidence,
        told.passes.len(),
        told.rest,
    )
}

fn since(told: &Explanation) -> Option<String> {
    let (after, before) = (told.changed_after_ns?, told.changed_before_ns?);
    Some(format!(
        "it changed between {} and {}; only looks since then count",
        utc(after),
        utc(before)
    ))
}

fn passes(passes: &[PassSays]) -> String {
    let row = |pass: &PassSays| {
        vec![
            pass.vehicle.clone(),
            utc(pass.first_ns),
            format!("{:+.2}", pass.for_change),
            pass.why.clone(),
            pass.log.clone().unwrap_or_else(|| "-".to_owned()),
        ]
    };
    table::rows(
        &["vehicle", "time (UTC)", "nats for it", "why", "log"],
        passes.iter().map(row),
    )
}

fn believed_less(told: &Explanation) -> Option<String> {
    let row = |vehicle: &tilefold_engine::explain::BelievedLess| {
        format!("{} is believed less: it {}", vehicle.vehicle, vehicle.why)
    };
    let lines: Vec<String> = told.believed_less.iter().map(row).collect();
    (!lines.is_empty()).then(|| lines.join("\n"))
}

fn flip(told: &Explanation) -> String {
    match &told.flip {
        None => "no number of further passes that was tried would change the verdict".to_owned(),
        Some(WouldFlip {
            passes,
            see_it,
            verdict,
        }) => {
            let one = *passes == 1;
            let who = if one {
                "vehicle that sees"
            } else {
                "vehicles that see"
            };
            let what = if *see_it {
                "it as mapped"
            } else {
                "nothing there"
            };
            format!("{passes} more {who} {what} would make it {verdict}")
        }
    }
}

fn frame_rows(frames: &[Frame]) -> String {
    let row = |frame: &Frame| {
        vec![
            if frame.for_change > 0.0 {
                "for"
            } else {
                "against"
            }
            .to_owned(),
            utc(frame.stamp_ns),
            frame.stamp_ns.to_string(),
            frame.topic.clone().unwrap_or_else(|| "-".to_owned()),
            frame.log.clone().unwrap_or_else(|| "-".to_owned()),
        ]
    };
    let header = ["frames", "time (UTC)", "stamp (ns)", "topic", "log"];
    table::rows(&header, frames.iter().map(row))
}

fn utc(stamp_ns: i64) -> String {
    chrono::DateTime::from_timestamp_nanos(stamp_ns)
        .format("%Y-%m-%d %H:%M:%S")
        .to_string()
}

#[cfg(test)]
mod tests {
    use super::*;
    use tilefold_engine::explain::BelievedLess;

    fn pass(vehicle: &str, first_ns: i64, for_change: f64, why: &str) -> PassSays {
        PassSays {
            vehicle: vehicle.to_owned(),
            log: Some("logs/monday.mcap".to_owned()),
            topic: Some("/perception/lanes".to_owned()),
            first_ns,
            last_ns: first_ns + 1_000_000_000,
            best_ns: first_ns + 500_000_000,
            exposed: 24,
            hit: 0,
            residual_m: None,
            read: None,
            sighted: None,
            nats: [0.0, 0.0, for_change, 0.0],
            for_change,
            for_change_fx: 0,
            why: why.to_owned(),
        }
    }

    fn told() -> Explanation {
        let missed = "missed in all of 24 looks";
        let matched = "matched in 7 of 28 looks, 0.37 m to the right";
        let passes = vec![
            pass("a87098a9473960ee", 1_774_371_364_000_000_000, 5.0, missed),
            pass(
                "069f7106d3783554",
                1_773_305_319_000_000_000,
                -0.91,
                matched,
            ),
        ];
        let frame = Frame {
            stamp_ns: passes[0].best_ns,
            log: passes[0].log.clone(),
            topic: None,
            vehicle: passes[0].vehicle.clone(),
            for_change: 5.0,
        };
        Explanation {
            version: 3,
            change: "1f7e38ee9f65765e".to_owned(),
            element: Some(1154),
            kind: "lane_marking",
            verdict: "removed",
            from_m: 30.0,
            to_m: 60.0,
            fusion_model: "calibrated".to_owned(),
            sensor_model: "56c3c30bcee61829".to_owned(),
            posterior: [0.3, 0.0, 0.6, 0.1],
            likeliest_change: "removed",
            log_odds: 0.85,
            evidence: 4.09,
            evidence_fx: 0,
            rest: -3.24,
            agrees: true,
            changed_after_ns: Some(1_772_000_000_000_000_000),
            changed_before_ns: Some(1_772_100_000_000_000_000),
            passes,
            believed_less: vec![BelievedLess {
                vehicle: "069f7106d3783554".to_owned(),
                why: "sees 0.31 of what its fleet sees".to_owned(),
            }],
            flip: Some(WouldFlip {
                passes: 1,
                see_it: true,
                verdict: "no_change",
            }),
            frames: vec![frame],
        }
    }

    #[test]
    fn an_explanation_reads_like_this() {
        let text = text(&told());
        let lines: Vec<&str> = text.lines().map(str::trim_end).collect();
        let expected = include_str!("explanation.txt");
        assert_eq!(lines, expected.lines().collect::<Vec<_>>(), "{text}");
    }
}
