//! Geometry: how far right claims lie beside the true line, and whether their uncertainty is what
//! they say.

use serde::Serialize;
use tilefold_formats::geojson::Shape;
use tilefold_schemas::Verdict;

use super::change::Network;

/// Standard deviations to either side that hold 90 % of a normal distribution.
const SIGMAS_90: f64 = 1.645;

/// Errors of claimed geometry against the true one.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct GeometryErrors {
    /// Median lateral distance of right additions from the true line, metres.
    pub added_lateral_median_m: Option<f64>,
    /// Its 95th percentile.
    pub added_lateral_p95_m: Option<f64>,
    /// Lines that both are taken over.
    pub added_lines: u64,
    /// Median lateral distance of right modifications from the true line, metres.
    pub modified_lateral_median_m: Option<f64>,
    /// Its 95th percentile.
    pub modified_lateral_p95_m: Option<f64>,
    /// Lines that both are taken over.
    pub modified_lines: u64,
    /// Share of right modifications whose mean lateral error is within the 90 % interval that
    /// their own standard deviation gives; null where none of them says one.
    pub modified_within_90: Option<f64>,
    /// The same of additions; null: their records have no covariance.
    pub added_within_90: Option<f64>,
}

/// Lateral errors of one type.
#[derive(Debug, Default)]
struct Errors {
    distances_m: Vec<f64>,
    lines: u64,
    /// Lines that say how sure they are, and how many of these are within their interval.
    with_sigma: u64,
    within: u64,
}

impl Errors {
    fn of(networks: &[Network<'_>], threshold: f64, verdict: Verdict) -> Self {
        let mut errors = Self::default();
        for network in networks {
            let paired = network.laid.pair(threshold);
            for (known, finders) in network.known.iter().zip(&paired.finders) {
                // Beside the outline of an area there is no lateral.
                if known.change.change_type != verdict || known.change.shape != Shape::Line {
                    continue;
                }
                for &index in finders {
                    let claim = &network.laid.claims[index];
                    // A repainted line has not moved: its record has no new geometry.
                    if claim.record.geometry_new.is_some()
                        && let Some(geometry) = claim.geometry()
                    {
                        let offsets_m = known.lateral_offsets_m(&geometry);
                        errors.add(&offsets_m, claim.record.shift_sigma_m);
                    }
                }
            }
        }
        errors.distances_m.sort_by(f64::total_cmp);
        errors
    }

    fn add(&mut self, offsets_m: &[f64], sigma_m: Option<f64>) {
        if offsets_m.is_empty() {
            return;
        }
        let mean_m = offsets_m.iter().sum::<f64>() / offsets_m.len() as f64;
        self.lines += 1;
        if let Some(sigma_m) = sigma_m {
            self.with_sigma += 1;
            self.within += u64::from(mean_m.abs() <= SIGMAS_90 * sigma_m);
        }
        self.distances_m.extend(offsets_m.iter().map(|m| m.abs()));
    }

    fn quantile_m(&self, share: f64) -> Option<f64> {
        let last = self.distances_m.len().checked_sub(1)?;
        Some(self.distances_m[((last as f64 * share).round() as usize).min(last)])
    }

    fn within(&self) -> Option<f64> {
        (self.with_sigma > 0).then(|| self.within as f64 / self.with_sigma as f64)
    }
}

/// Errors over all right claims.
pub(super) fn geometry(networks: &[Network<'_>], threshold: f64) -> GeometryErrors {
    let added = Errors::of(networks, threshold, Verdict::Added);
    let modified = Errors::of(networks, threshold, Verdict::Modified);
    GeometryErrors {
        added_lateral_median_m: added.quantile_m(0.5),
        added_lateral_p95_m: added.quantile_m(0.95),
        added_lines: added.lines,
        modified_lateral_median_m: modified.quantile_m(0.5),
        modified_lateral_p95_m: modified.quantile_m(0.95),
        modified_lines: modified.lines,
        modified_within_90: modified.within(),
        added_within_90: added.within(),
    }
}
