//! What counts as a claim: a change record with a verdict of change, enough posterior (T_s) and
//! enough vehicles (V).

use tilefold_schemas::wkb::{self, Geometry};
use tilefold_schemas::{ChangeRecord, Verdict};

/// What counts as a claim.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Criteria {
    /// Least posterior of the claimed type (T_s).
    pub threshold: f64,
    /// Least number of vehicles (V).
    pub min_vehicles: i32,
}

impl Default for Criteria {
    fn default() -> Self {
        Self {
            threshold: 0.85,
            min_vehicles: 5,
        }
    }
}

/// A record that claims a change.
#[derive(Debug, Clone, Copy)]
pub(super) struct Claim<'a> {
    pub(super) record: &'a ChangeRecord,
    pub(super) verdict: Verdict,
    /// Posterior of the claimed type.
    pub(super) posterior: f64,
}

impl<'a> Claim<'a> {
    /// The claim that a record makes, if it makes any.
    pub(super) fn of(record: &'a ChangeRecord, criteria: Criteria) -> Option<Self> {
        let verdict = Verdict::from_code(record.verdict)?;
        let posterior = match verdict {
            Verdict::Added => record.p_added,
            Verdict::Removed => record.p_removed,
            Verdict::Modified => record.p_modified,
            _ => return None,
        };
        criteria.admit(record).then_some(Self {
            record,
            verdict,
            posterior,
        })
    }

    /// Where the thing is on the road, or was in the map if it is gone.
    pub(super) fn geometry(&self) -> Option<Geometry> {
        let [old, new] = [&self.record.geometry_old, &self.record.geometry_new];
        let bytes = match self.verdict {
            Verdict::Removed => old.as_ref().or(new.as_ref()),
            _ => new.as_ref().or(old.as_ref()),
        };
        wkb::read(bytes?).ok()
    }

    /// Metres of line that are claimed.
    pub(super) fn length_m(&self) -> f64 {
        self.record.to_m - self.record.from_m
    }
}

/// All claims, the surest first: it finds a change before the others.
pub(super) fn claims(records: &[ChangeRecord], criteria: Criteria) -> Vec<Claim<'_>> {
    let mut claims: Vec<Claim<'_>> = records
        .iter()
        .filter_map(|record| Claim::of(record, criteria))
        .collect();
    claims.sort_by(|a, b| {
        (b.posterior.total_cmp(&a.posterior)).then(a.record.change.cmp(&b.record.change))
    });
    claims
}
