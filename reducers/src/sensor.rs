//! The sensor model: how often, and how well, a fleet's detectors match paint that is there and
//! paint that is not; and how far from the map unchanged paint usually lies.
//!
//! The defaults are a start. [`crate::fit`] fits a model to a ledger.

use std::collections::BTreeMap;

use crate::space::LEVELS;

mod rows;

/// A quantity over visibility: `[V, value]`, ascending; straight between the points.
#[derive(Debug, Clone, PartialEq)]
pub struct ByVisibility(pub Vec<[f64; 2]>);

impl ByVisibility {
    /// The value at a visibility; that of the nearest point outside of them.
    #[must_use]
    pub fn at(&self, visibility: f64) -> f64 {
        let after = self.0.partition_point(|[at, _]| *at <= visibility);
        let (Some(from), Some(to)) = (
            self.0.get(after.saturating_sub(1)),
            self.0.get(after.min(self.0.len().saturating_sub(1))),
        ) else {
            return 0.0;
        };
        if to[0] <= from[0] {
            return from[1];
        }
        let share = ((visibility - from[0]) / (to[0] - from[0])).clamp(0.0, 1.0);
        from[1] + share * (to[1] - from[1])
    }
}

/// What sets a vehicle apart from its fleet.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VehicleModel {
    /// Its rate of matches of paint that is there, as a share of the fleet's.
    pub detection: f64,
    /// P(match | absent) of it.
    pub absent: f64,
    /// Spread of its residuals, as a multiple of the fleet's.
    pub sigma: f64,
}

/// How often a fleet's detectors match a line, and where.
#[derive(Debug, Clone, PartialEq)]
pub struct SensorModel {
    /// P(match | present, exposed), mean over passes.
    pub present: ByVisibility,
    /// How alike passes over a line that is there are: a + b of the Beta that the share of matched
    /// frames is drawn from.
    pub present_concentration: f64,
    /// P(match | absent), mean over passes.
    pub absent: f64,
    /// How alike passes over a line that is gone are. Most match nothing; one that sees a trace of
    /// old paint, or a kerb, matches it in many frames.
    pub absent_concentration: f64,
    /// Standard deviation of a pass's mean residual about the line's place, in metres: registration
    /// and detector together.
    pub pass_sigma_m: ByVisibility,
    /// Standard deviation of the place of unchanged lines about the map, in metres, as all passes
    /// together see it: survey, and what is alike in all passes. By the visibility from which a line
    /// is mostly seen.
    pub place_sigma_m: ByVisibility,
    /// Standard deviation of what a vehicle adds to that in all of its passes, in metres.
    pub vehicle_sigma_m: f64,
    /// Share of lines that were removed, and that were moved, since the map was made.
    pub removed: f64,
    /// See [`Self::removed`].
    pub shifted: f64,
    /// Shares of lines by how well they can be seen: of each of [`LEVELS`].
    pub levels: [f64; LEVELS.len()],
    /// Share of passes whose residual says nothing (another line was matched).
    pub residual_outliers: f64,
    /// P(a pass reads the marking that is there), where it reads any.
    pub marking_read: f64,
    /// Vehicles that were told apart, by their keys.
    pub vehicles: BTreeMap<i64, VehicleModel>,
}

impl Default for SensorModel {
    /// From the ledgers of the deecamp road and of a simulated city: between the two.
    fn default() -> Self {
        let by_visibility = |points: &[[f64; 2]]| ByVisibility(points.to_vec());
        Self {
            present: by_visibility(&[
                [0.1, 0.27],
                [0.25, 0.32],
                [0.45, 0.6],
                [0.8, 0.74],
                [1.0, 0.84],
            ]),
            present_concentration: 1.5,
            absent: 0.1,
            absent_concentration: 0.8,
            pass_sigma_m: by_visibility(&[[0.2, 0.4], [0.45, 0.3], [0.6, 0.25], [1.0, 0.22]]),
            place_sigma_m: by_visibility(&[[0.2, 0.25], [0.45, 0.15], [0.6, 0.12], [0.85, 0.08]]),
            vehicle_sigma_m: 0.3,
            removed: 0.02,
            shifted: 0.025,
            levels: [0.72, 0.2, 0.08],
            residual_outliers: 0.1,
            marking_read: 0.8,
            vehicles: BTreeMap::new(),
        }
    }
}

impl SensorModel {
    /// What is known of a vehicle; one that nothing is known of is like its fleet.
    #[must_use]
    pub fn vehicle(&self, key: i64) -> VehicleModel {
        self.vehicles.get(&key).copied().unwrap_or(VehicleModel {
            detection: 1.0,
            absent: self.absent,
            sigma: 1.0,
        })
    }
}

/// Log-likelihood of one sequence of hits and misses whose rate is Beta-distributed with this mean
/// and concentration (a + b).
#[must_use]
pub fn beta_binomial(hits: f64, misses: f64, mean: f64, concentration: f64) -> f64 {
    let (a, b) = (mean * concentration, (1.0 - mean) * concentration);
    let log_beta = |a: f64, b: f64| libm::lgamma(a) + libm::lgamma(b) - libm::lgamma(a + b);
    log_beta(a + hits, b + misses) - log_beta(a, b)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn beta_binomials_by_hand() {
        // A flat Beta: every number of hits is as likely; one sequence of them 1 / ((n + 1) C(n, k)).
        let nats = beta_binomial(2.0, 3.0, 0.5, 2.0);
        assert!((nats - (1.0_f64 / 60.0).ln()).abs() < 1e-12, "{nats}");
        // A sharp Beta: independent frames.
        let nats = beta_binomial(2.0, 3.0, 0.3, 1e9);
        let independent = 2.0 * 0.3_f64.ln() + 3.0 * 0.7_f64.ln();
        assert!((nats - independent).abs() < 1e-5, "{nats}");
    }

    #[test]
    fn values_lie_straight_between_their_points() {
        let values = SensorModel::default().present;
        let rates: Vec<f64> = (0..=20).map(|v| values.at(f64::from(v) / 20.0)).collect();
        assert!(rates.is_sorted());
        assert_eq!((rates[0], rates[20]), (0.27, 0.84));
        assert!((values.at(0.9) - 0.79).abs() < 1e-12);
        assert_eq!(ByVisibility(Vec::new()).at(0.5), 0.0);
    }
}
