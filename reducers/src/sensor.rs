//! The sensor model: how often, and how well, a fleet's detectors match paint that is there and
//! paint that is not.

/// How often a fleet's detectors match a line, and where.
#[derive(Debug, Clone, PartialEq)]
pub struct SensorModel {
    /// P(match | present, exposed), mean over passes, by visibility: `[V, probability]`, ascending.
    pub present: [[f64; 2]; 5],
    /// How alike passes over a line that is there are: a + b of the Beta that the share of matched
    /// frames is drawn from.
    pub present_concentration: f64,
    /// P(match | absent), mean over passes.
    pub absent: f64,
    /// How alike passes over a line that is gone are. Most match nothing; one that sees a trace of
    /// old paint, or a kerb, matches it in many frames.
    pub absent_concentration: f64,
    /// Standard deviation of a pass's mean residual about the line's true place, in metres:
    /// registration and detector together.
    pub pass_sigma_m: f64,
    /// Share of passes whose residual says nothing (another line was matched).
    pub residual_outliers: f64,
    /// P(a pass reads the marking that is there), where it reads any.
    pub marking_read: f64,
}

impl Default for SensorModel {
    /// From the ledgers of the deecamp road and of a simulated city: between the two.
    fn default() -> Self {
        Self {
            present: [
                [0.1, 0.27],
                [0.25, 0.32],
                [0.45, 0.6],
                [0.8, 0.74],
                [1.0, 0.84],
            ],
            present_concentration: 1.5,
            absent: 0.1,
            absent_concentration: 0.8,
            pass_sigma_m: 0.25,
            residual_outliers: 0.1,
            marking_read: 0.8,
        }
    }
}

impl SensorModel {
    /// P(match | present, exposed) at a visibility: straight between the points given.
    #[must_use]
    pub fn present_at(&self, visibility: f64) -> f64 {
        let after = self.present.partition_point(|[at, _]| *at <= visibility);
        let last = self.present.len() - 1;
        let (from, to) = (
            self.present[after.saturating_sub(1)],
            self.present[after.min(last)],
        );
        if to[0] <= from[0] {
            return from[1];
        }
        let share = ((visibility - from[0]) / (to[0] - from[0])).clamp(0.0, 1.0);
        from[1] + share * (to[1] - from[1])
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
    fn what_is_seen_better_is_matched_more_often() {
        let model = SensorModel::default();
        let rates: Vec<f64> = (0..=20)
            .map(|v| model.present_at(f64::from(v) / 20.0))
            .collect();
        assert!(rates.is_sorted());
        assert_eq!((rates[0], rates[20]), (0.27, 0.84));
        assert!((model.present_at(0.9) - 0.79).abs() < 1e-12);
    }
}
