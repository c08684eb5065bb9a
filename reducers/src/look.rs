//! One vehicle's looks at a place where the map has nothing, and what they say of a candidate there.

use crate::calibrated::CONTAMINATION;

/// One vehicle's looks at a place.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Look {
    pub(crate) visibility: f64,
    pub(crate) frames: i64,
    pub(crate) first_ns: i64,
    pub(crate) last_ns: i64,
}

/// How often what is looked at is sighted.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Sighted {
    /// P(sighting | there, fully visible).
    pub(crate) there: f64,
    /// P(sighting | nothing there).
    pub(crate) nothing: f64,
}

impl Look {
    /// Log-likelihood ratio of "there" against "nothing there", bounded.
    pub(crate) fn nats(&self, saw: bool, sighted: Sighted) -> f64 {
        let seen_if_there =
            self.visibility * sighted.there + (1.0 - self.visibility) * sighted.nothing;
        let (there, nothing) = if saw {
            (seen_if_there, sighted.nothing)
        } else {
            (1.0 - seen_if_there, 1.0 - sighted.nothing)
        };
        let mean = 0.5 * (there + nothing);
        let mixed = |likelihood: f64| (1.0 - CONTAMINATION) * likelihood + CONTAMINATION * mean;
        libm::log(mixed(there) / mixed(nothing))
    }
}
