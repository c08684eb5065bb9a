//! `explain`: why a verdict, as tables or JSON.

use std::error::Error;
use std::path::Path;

use tilefold_engine::explain;
use tilefold_engine::explain::{Explanation, Frame, PassSays, WouldFlip};
use tilefold_store::Store;

use crate::args::Args;
use crate::report::{Outcome, print};
use crate::table;

/// Explains a change, or all that is said of an element.
///
/// # Errors
/// As [`tilefold_engine::explain()`].
pub(crate) fn explain_verdict(
    args: &Args,
    store: &Path,
    id: &str,
    version: Option<i64>,
) -> Result<Outcome, Box<dyn Error>> {
    let snapshot = Store::open(store.to_path_buf())?.snapshot(version)?;
    let explained = explain(&snapshot, id)?;
    print(args, &explained, |explained| {
        let texts: Vec<String> = explained.iter().map(text).collect();
        texts.join("\n\n")
    })?;
    Ok(Outcome::Done)
}

fn text(told: &Explanation) -> String {
    let parts = [
        Some(title(told)),
        Some(sums(told)),
        since(told),
        (!told.passes.is_empty()).then(|| passes(&told.passes)),
        believed_less(told),
        Some(flip(told)),
        (!told.frames.is_empty()).then(|| frames(&told.frames)),
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
            let see = if *see_it {
                "see it as mapped"
            } else {
                "see nothing there"
            };
            format!("{passes} more vehicles that {see} would make it {verdict}")
        }
    }
}

fn frames(frames: &[Frame]) -> String {
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
