//! Why a record says what it says: what every pass adds to it.
//!
//! The folds make these as they judge: the evidence of a record is the sum of its weights, in
//! integers. What lies between that sum and the record's log-odds is the prior, what neighbouring
//! stretches say, and how many ways there are to be in or out of place.

use tilefold_schemas::ChangeRecord;

use crate::passes::Pass;

/// What one pass over one section says of a record's hypotheses.
#[derive(Debug, Clone, PartialEq)]
pub struct Weight {
    /// Keyed hash of the vehicle.
    pub vehicle: i64,
    /// First and last look, nanoseconds since the Unix epoch.
    pub first_ns: i64,
    /// See [`Self::first_ns`].
    pub last_ns: i64,
    /// Capture time of the clearest frame.
    pub best_ns: i64,
    /// Frames that looked.
    pub exposed: i64,
    /// Frames that matched the element; 0 where the map has none.
    pub hit: i64,
    /// Mean visibility, in `[0, 1]`.
    pub visibility: f64,
    /// Lateral residual of the matches, positive to the left of the element, in metres.
    pub residual_m: Option<f64>,
    /// What the pass read: a code of markings, or of sign classes.
    pub read: Option<i16>,
    /// Whether it sighted what the map lacks; none for mapped elements.
    pub sighted: Option<bool>,
    /// Log-likelihoods of no change, added, removed and modified, each at its best place: 2^-24
    /// nats, relative to what a pass says that tells nothing.
    pub nats_fx: [i64; 4],
}

impl Weight {
    pub(crate) fn of(pass: &Pass, nats_fx: [i64; 4]) -> Self {
        Self {
            vehicle: pass.vehicle,
            first_ns: pass.first_ns,
            last_ns: pass.last_ns,
            best_ns: pass.best_ns,
            exposed: pass.exposed,
            hit: pass.hit,
            visibility: pass.visibility(),
            residual_m: pass.residual_m(),
            read: pass.read(),
            sighted: None,
            nats_fx,
        }
    }
}

/// A record, and what every pass adds to it.
#[derive(Debug, Clone, PartialEq)]
pub struct Explained {
    /// The record; its `evidence_fx` is [`Self::evidence_fx`] over all weights.
    pub record: ChangeRecord,
    /// By section, then by vehicle and time.
    pub weights: Vec<Weight>,
}

impl Explained {
    pub(crate) fn new(mut record: ChangeRecord, weights: Vec<Weight>) -> Self {
        let change = likeliest_change(&record);
        let for_change = weights.iter().map(|weight| evidence_fx(weight, change));
        record.evidence_fx = for_change.sum();
        Self { record, weights }
    }

    /// What a weight adds to the record's evidence for change, in 2^-24 nats.
    #[must_use]
    pub fn evidence_fx(&self, weight: &Weight) -> i64 {
        evidence_fx(weight, likeliest_change(&self.record))
    }

    /// Takes in what explains the new line that a record was linked with; see [`crate::moved`].
    pub fn link(&mut self, linked: ChangeRecord, added: Self) {
        // Gone here and there beside it: both speak for one change, whatever it is called.
        let change = likeliest_change(&self.record);
        for weight in self.weights.iter_mut() {
            weight.nats_fx[MODIFIED] = weight.nats_fx[change];
        }
        let of_added = added.weights.into_iter().map(|mut weight| {
            weight.nats_fx[MODIFIED] = weight.nats_fx[ADDED];
            weight
        });
        self.weights.extend(of_added);
        self.record = linked;
    }
}

const ADDED: usize = 1;
const MODIFIED: usize = 3;

fn evidence_fx(weight: &Weight, change: usize) -> i64 {
    weight.nats_fx[change] - weight.nats_fx[0]
}

/// Index of the likeliest change among a record's hypotheses: the one that its evidence is for.
fn likeliest_change(record: &ChangeRecord) -> usize {
    let changes = [record.p_added, record.p_removed, record.p_modified];
    let mut most = 0;
    for (index, p) in changes.iter().enumerate() {
        if *p > changes[most] {
            most = index;
        }
    }
    most + 1
}
