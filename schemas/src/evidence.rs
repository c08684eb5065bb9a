//! The evidence ledger: what the map stage testifies and the reduce stage folds (method.md,
//! section 7). Every number that is ever summed is an integer; see [`crate::fixed`].

use crate::table;

/// Version of the map stage's method. Rows of different versions are never added up.
pub const METHOD_VERSION: i32 = 7;

/// The same method without registration: what poses alone are worth.
pub const UNREGISTERED_METHOD: i32 = METHOD_VERSION + 1_000;

/// Length of a chunk's window of time in nanoseconds (W in method.md, section 1).
pub const WINDOW_NS: i64 = 60_000_000_000;

const MILLISECOND_NS: i64 = 1_000_000;

/// A capture time as the ledger has it: the whole milliseconds since a window began.
#[must_use]
pub fn to_window_ms(window: i64, stamp_ns: i64) -> i32 {
    let since_ns = stamp_ns.saturating_sub(window.saturating_mul(WINDOW_NS));
    let since_ms = since_ns.div_euclid(MILLISECOND_NS);
    since_ms.clamp(i32::MIN.into(), i32::MAX.into()) as i32
}

/// The time at which a window's millisecond begins, nanoseconds since the Unix epoch.
#[must_use]
pub fn from_window_ms(window: i64, at_ms: i32) -> i64 {
    let from_ns = window.saturating_mul(WINDOW_NS);
    from_ns.saturating_add(i64::from(at_ms) * MILLISECOND_NS)
}

/// Whether two capture times are one for the ledger, which tells milliseconds apart.
#[must_use]
pub fn is_same_frame(one_ns: i64, other_ns: i64) -> bool {
    one_ns.div_euclid(MILLISECOND_NS) == other_ns.div_euclid(MILLISECOND_NS)
}

/// Bins of [`EvidenceRow::seen`]: codes of [`crate::Marking`] for lines, of [`crate::SignClass`]
/// for ground signs.
pub const CLASS_BINS: usize = 13;

table! {
    /// What one chunk of one vehicle's drive says about one section of one element.
    ///
    /// Fixed-point fields (`*_q8`) are in units of 2^-8; see [`crate::fixed`].
    #[derive(Eq, PartialOrd, Ord)]
    pub struct EvidenceRow in "evidence" {
        /// Owner tile of the element.
        pub tile: i32,
        /// Element id.
        pub element: i64,
        /// Content hash of the element that was looked at.
        pub content: i64,
        /// Station interval `[section * S, (section + 1) * S)` along the element.
        pub section: i32,
        /// Keyed hash of the vehicle.
        pub vehicle: i64,
        /// Hash of the camera's or detection channel's name.
        pub channel: i64,
        /// Time window of the chunk.
        pub window: i64,
        /// [`METHOD_VERSION`].
        pub method: i32,
        /// Hash of the perception model; 0 for detections made on the vehicle.
        pub model: i64,
        /// Frames in which the section was exposed.
        pub exposed: i32,
        /// Exposed frames in which it was matched.
        pub hit: i32,
        /// Sum of the visibility over exposed frames.
        pub sum_v_q8: i64,
        /// Paper Eq 14 to 18: weighted sum for "no change".
        pub sum_w_no_q8: i64,
        /// Weighted sum for "added".
        pub sum_w_add_q8: i64,
        /// Weighted sum for "deleted".
        pub sum_w_del_q8: i64,
        /// Weighted sum for "modified".
        pub sum_w_mod_q8: i64,
        /// Information-weighted sum of lateral residuals (positive to the left of the element's
        /// direction), in 1/m.
        pub residual_eta_q8: i64,
        /// Sum of the information of lateral residuals, in 1/m^2.
        pub residual_lambda_q8: i64,
        /// Information-weighted sum of residuals along the element's direction, in 1/m; 0 for
        /// lane markings, which have no place along themselves.
        pub along_eta_q8: i64,
        /// Sum of the information of residuals along it, in 1/m^2.
        pub along_lambda_q8: i64,
        /// How often each marking type or sign class was observed.
        pub seen: [i32; CLASS_BINS],
        /// First exposure, in milliseconds since the window began (`window * 60_000` after the Unix epoch).
        pub first_ms: i32,
        /// From the first exposure to the last, in milliseconds.
        pub last_after_ms: i32,
        /// From the first exposure to the clearest frame; file and topic are found through the chunk.
        pub best_after_ms: i32,
        /// Visibility in the clearest frame.
        pub best_v_q8: i64,
    }
}

table! {
    /// Paint that no map element explains, as one chunk saw it.
    #[derive(Eq, PartialOrd, Ord)]
    pub struct Sighting in "sightings" {
        /// Tile of its first vertex.
        pub tile: i32,
        /// Keyed hash of the vehicle.
        pub vehicle: i64,
        /// Hash of the channel's name.
        pub channel: i64,
        /// Time window of the chunk.
        pub window: i64,
        /// Number of the track within the chunk.
        pub track: i32,
        /// [`METHOD_VERSION`].
        pub method: i32,
        /// Hash of the perception model.
        pub model: i64,
        /// Kind code of [`crate::ElementKind`].
        pub kind: i16,
        /// Frames that saw it.
        pub frames: i32,
        /// Sum of the visibility over these frames.
        pub sum_v_q8: i64,
        /// A line's vertices about every 2 m, or the outline of an area (WKB `LineString` or
        /// `Polygon` with z 0, CRS84, rounded to 2^-26 degrees, 1.7 mm).
        pub geometry: Vec<u8>,
        /// Lateral information per vertex, 1/m^2, averaged over vertices; of an area, that of its
        /// place along the road.
        pub lambda_q8: i64,
        /// How often each marking type or sign class was observed.
        pub seen: [i32; CLASS_BINS],
        /// First frame, in milliseconds since the window began.
        pub first_ms: i32,
        /// From the first frame to the last, in milliseconds.
        pub last_after_ms: i32,
        /// From the first frame to the clearest, in milliseconds.
        pub best_after_ms: i32,
    }
}

table! {
    /// Where one chunk looked, sampled along the trajectory: what confronts candidates.
    #[derive(Eq, PartialOrd, Ord)]
    pub struct Footprint in "footprints" {
        /// Tile of the registered vehicle position.
        pub tile: i32,
        /// Keyed hash of the vehicle.
        pub vehicle: i64,
        /// Hash of the channel's name.
        pub channel: i64,
        /// Time window of the chunk.
        pub window: i64,
        /// [`METHOD_VERSION`].
        pub method: i32,
        /// Hash of the perception model.
        pub model: i64,
        /// What could be seen: bit `1 << code` for every [`crate::ElementKind`].
        pub kinds: i16,
        /// Capture time of the sample, in milliseconds since the window began.
        pub at_ms: i32,
        /// Registered position, longitude in 1e-6 degrees.
        pub longitude_e6: i32,
        /// Registered position, latitude in 1e-6 degrees.
        pub latitude_e6: i32,
        /// Heading, counter-clockwise from east, in milliradians.
        pub yaw_mrad: i32,
        /// Frames that this sample stands for.
        pub frames: i32,
        /// Nearest and farthest trusted range ahead, in millimetres.
        pub range_from_mm: i32,
        /// Farthest trusted range ahead, in millimetres.
        pub range_to_mm: i32,
        /// Left and right reach of the looks, in millimetres (left positive).
        pub left_mm: i32,
        /// Right reach, in millimetres (right is negative).
        pub right_mm: i32,
        /// Mean visibility.
        pub v_q8: i64,
    }
}

table! {
    /// A chunk that was mapped: what makes `run` idempotent.
    pub struct ChunkRow in "chunks" {
        /// Keyed hash of the vehicle.
        pub vehicle: i64,
        /// Hash of the channel's name.
        pub channel: i64,
        /// Time window.
        pub window: i64,
        /// Digest of the frames (stamp and payload) that the map stage was given.
        pub digest: i64,
        /// [`METHOD_VERSION`].
        pub method: i32,
        /// Hash of the perception model.
        pub model: i64,
        /// Channel name.
        pub topic: String,
        /// Logs it was made from, context included, one a line, ascending. Not part of any digest.
        pub log: String,
        /// Messages that the map stage was given, context included.
        pub messages: i32,
        /// Tiles in which the chunk has rows, ascending, separated by commas.
        pub tiles: String,
        /// Frames in the window.
        pub frames: i32,
        /// Frames that were set aside.
        pub frames_set_aside: i32,
        /// First frame.
        pub first_ns: i64,
        /// Last frame.
        pub last_ns: i64,
        /// First capture time of what it was made from, context included; latched messages aside.
        pub given_from_ns: i64,
        /// Last capture time of it.
        pub given_to_ns: i64,
        /// The piece of the map that the chunk was confronted with: westernmost longitude.
        pub xmin: f64,
        /// Southernmost latitude.
        pub ymin: f64,
        /// Easternmost longitude.
        pub xmax: f64,
        /// Northernmost latitude.
        pub ymax: f64,
        /// Digest of the map elements in that piece. 0: the base map has changed there since, and the
        /// chunk is mapped again as soon as its logs are given again.
        pub map: i64,
    }
}

/// Capture times of a row, in nanoseconds since the Unix epoch, to the millisecond.
macro_rules! seen_at {
    ($row:ident) => {
        impl $row {
            /// First frame.
            #[must_use]
            pub fn first_ns(&self) -> i64 {
                from_window_ms(self.window, self.first_ms)
            }

            /// Last frame.
            #[must_use]
            pub fn last_ns(&self) -> i64 {
                from_window_ms(
                    self.window,
                    self.first_ms.saturating_add(self.last_after_ms),
                )
            }

            /// Clearest frame.
            #[must_use]
            pub fn best_ns(&self) -> i64 {
                from_window_ms(
                    self.window,
                    self.first_ms.saturating_add(self.best_after_ms),
                )
            }
        }
    };
}

impl EvidenceRow {
    /// The paper's sums for no change, added, deleted, modified; together the weight.
    #[must_use]
    pub fn paper_q8(&self) -> [i64; 4] {
        [
            self.sum_w_no_q8,
            self.sum_w_add_q8,
            self.sum_w_del_q8,
            self.sum_w_mod_q8,
        ]
    }
}

seen_at!(EvidenceRow);
seen_at!(Sighting);

impl Footprint {
    /// Capture time of the sample, in nanoseconds since the Unix epoch, to the millisecond.
    #[must_use]
    pub fn at_ns(&self) -> i64 {
        from_window_ms(self.window, self.at_ms)
    }

    /// Registered position: longitude and latitude in degrees.
    #[must_use]
    pub fn place_deg(&self) -> [f64; 2] {
        [self.longitude_e6, self.latitude_e6].map(|e6| f64::from(e6) * 1e-6)
    }

    /// Heading in radians, counter-clockwise from east.
    #[must_use]
    pub fn yaw_rad(&self) -> f64 {
        f64::from(self.yaw_mrad) * 1e-3
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_keep_their_millisecond() {
        for stamp_ns in [0, 1, 1_773_437_855_498_666_644, -1, i64::MIN, i64::MAX] {
            let window = stamp_ns.div_euclid(WINDOW_NS);
            let at_ms = to_window_ms(window, stamp_ns);
            assert!((0..60_000).contains(&at_ms), "{stamp_ns}");
            let kept_ns = from_window_ms(window, at_ms);
            assert!(
                kept_ns == i64::MIN || is_same_frame(kept_ns, stamp_ns),
                "{stamp_ns}"
            );
        }
        assert!(!is_same_frame(-1, 0));
    }
}
