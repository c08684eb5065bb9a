//! One vehicle's looks at a place where the map has nothing, and what they say of a candidate there.

use tilefold_schemas::{ChangeRecord, fixed};

use crate::calibrated::CONTAMINATION;
use crate::explain::Weight;

/// One vehicle's looks at a place.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Look {
    pub(crate) visibility: f64,
    pub(crate) frames: i64,
    pub(crate) first_ns: i64,
    pub(crate) last_ns: i64,
    /// Capture time of the clearest of them.
    pub(crate) best_ns: i64,
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
    /// Adds another look of the vehicle; the clearest is the earlier of equals, so that order does
    /// not matter.
    pub(crate) fn add(&mut self, other: &Self) {
        let is_clearer = |a: &Self, b: &Self| {
            a.visibility > b.visibility || (a.visibility == b.visibility && a.best_ns < b.best_ns)
        };
        if is_clearer(other, self) {
            (self.visibility, self.best_ns) = (other.visibility, other.best_ns);
        }
        self.frames += other.frames;
        self.first_ns = self.first_ns.min(other.first_ns);
        self.last_ns = self.last_ns.max(other.last_ns);
    }

    /// What a vehicle's look adds to a candidate.
    pub(crate) fn weight(&self, vehicle: i64, saw: bool, nats_fx: i64) -> Weight {
        Weight {
            vehicle,
            first_ns: self.first_ns,
            last_ns: self.last_ns,
            best_ns: self.best_ns,
            exposed: self.frames,
            hit: 0,
            visibility: self.visibility,
            residual_m: None,
            read: None,
            sighted: Some(saw),
            nats_fx: [0, nats_fx, 0, 0],
        }
    }

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

/// Vehicles that see nothing until an addition is no more believed, by what one of them says in nats.
pub(crate) fn misses(added: &ChangeRecord, prior: f64, nats_of_one: f64) -> u32 {
    let held = fixed::to_f64(added.evidence_fx) + libm::log(prior / (1.0 - prior));
    (held / -nats_of_one).floor().max(0.0) as u32 + 1
}
