//! Passes: one vehicle's uninterrupted traverses of an element section, formed from ledger rows.
//!
//! Frames within a pass are correlated, passes are not: a pass is the unit that counts.

use tilefold_schemas::evidence::CLASS_BINS;
use tilefold_schemas::{EvidenceRow, fixed};

/// A gap longer than this starts a new pass.
const GAP_NS: i64 = 30_000_000_000;

/// What one pass says about one section: sums of ledger rows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pass {
    /// Keyed hash of the vehicle.
    pub vehicle: i64,
    /// Frames in which the section was exposed.
    pub exposed: i64,
    /// Exposed frames with a match.
    pub hit: i64,
    /// Sum of visibility, fixed point.
    pub sum_v_q8: i64,
    /// The paper's sums for no change, added, deleted, modified; together the weight.
    pub paper_q8: [i64; 4],
    /// Information-weighted sum of residuals (1/m), their information (1/m^2), fixed point.
    pub residual_eta_q8: i64,
    /// Information of the residuals, fixed point.
    pub residual_lambda_q8: i64,
    /// The same of residuals along the element: sum (1/m), information (1/m^2), fixed point.
    pub along_eta_q8: i64,
    /// Information of the residuals along the element, fixed point.
    pub along_lambda_q8: i64,
    /// Observed classes.
    pub seen: [i32; CLASS_BINS],
    /// First exposure.
    pub first_ns: i64,
    /// Last exposure.
    pub last_ns: i64,
    /// Clearest frame.
    pub best_ns: i64,
    best_v_q8: i64,
}

impl Pass {
    fn new(row: &EvidenceRow) -> Self {
        Self {
            vehicle: row.vehicle,
            exposed: i64::from(row.exposed),
            hit: i64::from(row.hit),
            sum_v_q8: row.sum_v_q8,
            paper_q8: row.paper_q8(),
            residual_eta_q8: row.residual_eta_q8,
            residual_lambda_q8: row.residual_lambda_q8,
            along_eta_q8: row.along_eta_q8,
            along_lambda_q8: row.along_lambda_q8,
            seen: row.seen,
            first_ns: row.first_ns(),
            last_ns: row.last_ns(),
            best_ns: row.best_ns(),
            best_v_q8: row.best_v_q8,
        }
    }

    /// Adds what a neighbouring row or section says of the same pass.
    pub fn merge(&mut self, other: &Self) {
        self.exposed += other.exposed;
        self.hit += other.hit;
        self.sum_v_q8 = self.sum_v_q8.saturating_add(other.sum_v_q8);
        for (sum, value) in self.paper_q8.iter_mut().zip(other.paper_q8) {
            *sum = sum.saturating_add(value);
        }
        self.residual_eta_q8 = self.residual_eta_q8.saturating_add(other.residual_eta_q8);
        self.residual_lambda_q8 = self
            .residual_lambda_q8
            .saturating_add(other.residual_lambda_q8);
        self.along_eta_q8 = self.along_eta_q8.saturating_add(other.along_eta_q8);
        self.along_lambda_q8 = self.along_lambda_q8.saturating_add(other.along_lambda_q8);
        for (sum, value) in self.seen.iter_mut().zip(other.seen) {
            *sum = sum.saturating_add(value);
        }
        self.first_ns = self.first_ns.min(other.first_ns);
        self.last_ns = self.last_ns.max(other.last_ns);
        // Clearest frame; the earlier of equals, so that order does not matter.
        if (other.best_v_q8, -other.best_ns) > (self.best_v_q8, -self.best_ns) {
            self.best_v_q8 = other.best_v_q8;
            self.best_ns = other.best_ns;
        }
    }

    /// Mean visibility in `[0, 1]`.
    #[must_use]
    pub fn visibility(&self) -> f64 {
        fixed::from_q8(self.sum_v_q8) / self.exposed.max(1) as f64
    }

    /// The class or marking read most, the lower code of equals; none if none was recognised.
    #[must_use]
    pub fn read(&self) -> Option<i16> {
        let most = (1..CLASS_BINS).max_by_key(|&bin| (self.seen[bin], std::cmp::Reverse(bin)))?;
        (self.seen[most] > 0).then_some(most as i16)
    }

    /// Mean lateral residual in metres, positive to the left of the element; none without a hit.
    #[must_use]
    pub fn residual_m(&self) -> Option<f64> {
        (self.residual_lambda_q8 > 0)
            .then(|| self.residual_eta_q8 as f64 / self.residual_lambda_q8 as f64)
    }
}

/// The passes of rows that all speak of one section, by vehicle and time.
#[must_use]
pub fn passes(rows: &[&EvidenceRow]) -> Vec<Pass> {
    let mut ordered: Vec<&&EvidenceRow> = rows.iter().filter(|row| row.exposed > 0).collect();
    ordered.sort_by_key(|row| (row.vehicle, row.first_ns(), row.channel, row.window));
    let mut passes: Vec<Pass> = Vec::new();
    for row in ordered {
        let next = Pass::new(row);
        match passes.last_mut() {
            Some(last)
                if last.vehicle == next.vehicle
                    && next.first_ns.saturating_sub(last.last_ns) <= GAP_NS =>
            {
                last.merge(&next);
            }
            _ => passes.push(next),
        }
    }
    passes
}
