//! Every claim and every missed change by name: what a person looks at next.

use serde::Serialize;
use tilefold_schemas::{ChangeRecord, Verdict};

use super::change::Network;
use super::known::Known;
use super::pair::Fate;

/// A claim and what became of it, or a change that was missed.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Outcome {
    /// `right`, `wrong`, `wrong_again` (under the claims that are one wrong claim, not the first)
    /// or `missed`.
    pub outcome: &'static str,
    /// Type of change.
    pub change_type: &'static str,
    /// The truth's own word for a missed change.
    pub detail: Option<String>,
    /// Element id; null for an addition.
    pub element_id: Option<i64>,
    /// Station at which the stretch begins, metres.
    pub from_m: Option<f64>,
    /// Station at which it ends.
    pub to_m: Option<f64>,
    /// Change id, in hexadecimal; null for a missed change.
    pub change: Option<String>,
    /// Posterior of the claimed type; for a missed change, what its element got for its type.
    pub posterior: Option<f64>,
    /// Vehicles that looked.
    pub vehicles: Option<i32>,
    /// First vertex, `[longitude_deg, latitude_deg]`.
    pub at: Option<[f64; 2]>,
    /// What was said instead of a missed change.
    pub said: Option<String>,
}

/// The outcomes of one network: claims, the surest first, then missed changes in the order of the
/// truth.
pub(super) fn outcomes(
    network: &Network<'_>,
    threshold: f64,
    records: &[ChangeRecord],
) -> Vec<Outcome> {
    let paired = network.laid.pair(threshold);
    let fates = paired.fates.iter().enumerate();
    let claimed = fates.filter_map(|(index, fate)| {
        let outcome = match *fate {
            Fate::Right => "right",
            Fate::Wrong { head } if head == index => "wrong",
            Fate::Wrong { .. } => "wrong_again",
            Fate::Unsaid => return None,
        };
        Some(claimed(network, index, outcome))
    });
    let missed = network.known.iter().enumerate();
    let missed = missed
        .filter(|(index, _)| !paired.is_found(*index))
        .map(|(_, known)| missed_change(known, records));
    claimed.chain(missed).collect()
}

fn claimed(network: &Network<'_>, index: usize, outcome: &'static str) -> Outcome {
    let claim = &network.laid.claims[index];
    let record = claim.record;
    let geometry = claim.geometry();
    Outcome {
        outcome,
        change_type: claim.verdict.name(),
        detail: None,
        element_id: record.element,
        from_m: Some(record.from_m),
        to_m: Some(record.to_m),
        change: Some(format!("{:016x}", record.change)),
        posterior: Some(claim.posterior),
        vehicles: Some(record.vehicles),
        at: geometry.and_then(|geometry| geometry.points.first().map(|p| [p[0], p[1]])),
        said: None,
    }
}

fn missed_change(known: &Known<'_>, records: &[ChangeRecord]) -> Outcome {
    let change = known.change;
    let said = records
        .iter()
        .find(|record| record.element.is_some() && record.element == change.element_id);
    Outcome {
        outcome: "missed",
        change_type: change.change_type.name(),
        detail: change.detail.clone(),
        element_id: change.element_id,
        from_m: change.from_m,
        to_m: change.to_m,
        change: None,
        posterior: said.map(|record| match change.change_type {
            Verdict::Removed => record.p_removed,
            _ => record.p_modified,
        }),
        vehicles: said.map(|record| record.vehicles),
        at: change.points.first().map(|p| [p[0], p[1]]),
        said: said
            .and_then(|record| Verdict::from_code(record.verdict))
            .map(|verdict| verdict.name().to_owned()),
    }
}
