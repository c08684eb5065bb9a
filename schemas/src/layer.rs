//! What the reduce stage says: change records and the header of a tile's layer (method.md,
//! section 10).

use crate::element::code_enum;
use crate::table;

code_enum! {
    /// What is said of an element or a candidate.
    Verdict {
        /// Too little exposure to say anything. Never "no change".
        #[default]
        Unknown = 0, "unknown";
        /// It is there, as mapped.
        NoChange = 1, "no_change";
        /// On the road, not in the map.
        Added = 2, "added";
        /// In the map, not on the road.
        Removed = 3, "removed";
        /// On the road, but not as mapped.
        Modified = 4, "modified";
        /// Judged once, not looked at since long.
        Stale = 5, "stale";
    }
}

impl Verdict {
    /// Whether this verdict claims a change.
    #[must_use]
    pub fn is_change(self) -> bool {
        matches!(self, Self::Added | Self::Removed | Self::Modified)
    }
}

table! {
    /// A verdict on an element, on a stretch of it, or on a candidate.
    ///
    /// The default says nothing of anything: tests begin with it.
    #[derive(Default)]
    pub struct ChangeRecord in "changes" {
        /// Owner tile.
        pub tile: i32,
        /// Id of the change: of the element and station range, or of the candidate's earliest sighting.
        pub change: i64,
        /// Element of the base map; null for an addition.
        pub element: Option<i64>,
        /// Content hash of the element; 0 for an addition.
        pub content: i64,
        /// Kind code of [`crate::ElementKind`].
        pub kind: i16,
        /// Station at which the stretch begins, in metres.
        pub from_m: f64,
        /// Station at which it ends.
        pub to_m: f64,
        /// Code of [`Verdict`].
        pub verdict: i16,
        /// Posterior of "no change" (for an addition: of "nothing there").
        pub p_no_change: f64,
        /// Posterior of "added".
        pub p_added: f64,
        /// Posterior of "removed".
        pub p_removed: f64,
        /// Posterior of "modified".
        pub p_modified: f64,
        /// Log-odds of change against no change, in nats.
        pub log_odds: f64,
        /// What the passes alone say for the likeliest change against no change: the sum of what
        /// each of them says, in 2^-24 nats. The prior and neighbouring stretches make the rest.
        pub evidence_fx: i64,
        /// Distinct vehicles that looked (V in the paper).
        pub vehicles: i32,
        /// Passes that looked.
        pub passes: i32,
        /// Exposed frames.
        pub exposed: i64,
        /// Matched frames.
        pub hit: i64,
        /// First exposure, nanoseconds since the Unix epoch.
        pub first_ns: i64,
        /// Last exposure.
        pub last_ns: i64,
        /// Last look at the state before the change, where it changed while it was observed.
        pub changed_after_ns: Option<i64>,
        /// First look at the state after it.
        pub changed_before_ns: Option<i64>,
        /// Lateral shift, positive to the left of the element's direction, in metres.
        pub shift_m: Option<f64>,
        /// Its standard deviation.
        pub shift_sigma_m: Option<f64>,
        /// Most observed marking or class code, where one was observed.
        pub class_observed: Option<i16>,
        /// Geometry in the base map (WKB, CRS84).
        pub geometry_old: Option<Vec<u8>>,
        /// Geometry on the road (WKB, CRS84).
        pub geometry_new: Option<Vec<u8>>,
        /// Vehicle whose pass speaks most for the verdict.
        pub best_vehicle: i64,
        /// Capture time of that pass's clearest frame.
        pub best_ns: i64,
        /// Fusion model: `paper` or `calibrated`.
        pub fusion_model: String,
    }
}

table! {
    /// Header of one tile's layer in one version.
    pub struct LayerHeader in "layers" {
        /// The tile.
        pub tile: i32,
        /// Digest of the canonical content of the tile's change records.
        pub digest: String,
        /// Digest of the tile's ledger rows that it was derived from.
        pub evidence_digest: String,
        /// Fusion model.
        pub fusion_model: String,
        /// Sensor model; 0 is the built-in one. See [`SensorRow`].
        pub sensor_model: i64,
        /// Instant up to which evidence counts, nanoseconds since the Unix epoch.
        pub as_of_ns: i64,
        /// Records with the verdict "no change".
        pub no_change: i32,
        /// Records with the verdict "added".
        pub added: i32,
        /// Records with the verdict "removed".
        pub removed: i32,
        /// Records with the verdict "modified".
        pub modified: i32,
        /// Records with the verdict "unknown".
        pub unknown: i32,
        /// Records with the verdict "stale".
        pub stale: i32,
    }
}

table! {
    /// One parameter of the sensor model in force: how often, and how well, the fleet's detectors
    /// match paint (method.md, section 9).
    pub struct SensorRow in "sensor_models" {
        /// Id of the model: a hash of all its parameters.
        pub model: i64,
        /// The vehicle that it is about; null for the fleet.
        pub vehicle: Option<i64>,
        /// Name of the parameter.
        pub parameter: String,
        /// Visibility at which the value holds; 0 where it does not depend on it.
        pub visibility: f64,
        /// The value.
        pub value: f64,
    }
}

table! {
    /// A base-map element as it is kept in the store.
    pub struct ElementRow in "elements" {
        /// Owner tile: that of the first vertex.
        pub tile: i32,
        /// Id in the base map.
        pub element: i64,
        /// Content hash.
        pub content: i64,
        /// Kind code of [`crate::ElementKind`].
        pub kind: i16,
        /// Code of [`crate::Marking`].
        pub marking: i16,
        /// Code of [`crate::Color`].
        pub color: i16,
        /// Code of [`crate::SignClass`].
        pub sign: i16,
        /// Geometry (WKB with z, CRS84).
        pub geometry: Vec<u8>,
        /// Bounding box, degrees.
        pub xmin: f64,
        /// Bounding box, degrees.
        pub ymin: f64,
        /// Bounding box, degrees.
        pub xmax: f64,
        /// Bounding box, degrees.
        pub ymax: f64,
        /// All tags of the source, as a JSON object with sorted keys.
        pub tags: String,
        /// Map file it came from.
        pub source: String,
    }
}
