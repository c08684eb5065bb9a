//! Cutting a recording into chunks: absolute windows of time, the unit of map-stage work.
//!
//! A chunk is cut by the data, never by file, thread or executor. It is worked on together with
//! the 40 s before it and after it, so that registration has settled when it begins
//! and still has support where it ends; what it testifies is only of its own window.

use std::ops::RangeInclusive;

use tilefold_schemas::id::{ChunkId, VehicleKey, hash_text};

use crate::recording::Recording;

pub use tilefold_schemas::evidence::WINDOW_NS;

/// Context to either side, in nanoseconds: half of it is for registration to settle; the rest lets the clock
/// offset between channels, which may take many seconds, be told.
pub const CONTEXT_NS: i64 = 40_000_000_000;

/// Windows that the context of a window reaches into.
#[must_use]
pub fn around(window: i64) -> RangeInclusive<i64> {
    let (from_ns, to_ns) = window_bounds_ns(window);
    let first = window_of(from_ns.saturating_sub(CONTEXT_NS));
    first..=window_of(to_ns.saturating_add(CONTEXT_NS) - 1)
}

/// The window that a capture time falls into.
#[must_use]
pub fn window_of(stamp_ns: i64) -> i64 {
    stamp_ns.div_euclid(WINDOW_NS)
}

/// Capture times `[from_ns, to_ns)` of a window.
#[must_use]
pub fn window_bounds_ns(window: i64) -> (i64, i64) {
    let from_ns = window.saturating_mul(WINDOW_NS);
    (from_ns, from_ns.saturating_add(WINDOW_NS))
}

/// One chunk with its context: all that the map stage is given of a vehicle.
#[derive(Debug, Clone, PartialEq)]
pub struct Chunk {
    /// Whose, which channel, when.
    pub id: ChunkId,
    /// Digest of everything in `recording`, context included.
    pub digest: i64,
    /// What was recorded in the window and in its neighbours.
    pub recording: Recording,
}

impl Chunk {
    /// Capture times `[from_ns, to_ns)` of which this chunk testifies.
    #[must_use]
    pub fn bounds_ns(&self) -> (i64, i64) {
        window_bounds_ns(self.id.window)
    }
}

/// The windows of a settled recording that hold frames of its channel, ascending.
#[must_use]
pub fn windows(recording: &Recording) -> Vec<i64> {
    let mut windows: Vec<i64> = recording.frames_ns().map(window_of).collect();
    windows.dedup();
    windows
}

/// The chunk of a settled recording for one window; none if it holds no frames.
#[must_use]
pub fn cut(recording: &Recording, vehicle: VehicleKey, topic: &str, window: i64) -> Option<Chunk> {
    let (from_ns, to_ns) = window_bounds_ns(window);
    if !recording
        .frames_ns()
        .any(|stamp_ns| (from_ns..to_ns).contains(&stamp_ns))
    {
        return None;
    }
    let recording = recording.slice(
        from_ns.saturating_sub(CONTEXT_NS),
        to_ns.saturating_add(CONTEXT_NS),
    );
    Some(Chunk {
        id: ChunkId {
            vehicle,
            channel: hash_text(topic),
            window,
        },
        digest: recording.digest(),
        recording,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use tilefold_schemas::log::{DetectionFrame, DetectionSpace, LogMessage, Payload};

    fn frame(stamp_ns: i64) -> LogMessage {
        LogMessage {
            topic: 0,
            stamp_ns,
            log_time_ns: stamp_ns + 5,
            frame_id: "base_link".to_owned(),
            payload: Payload::Detections(DetectionFrame {
                space: DetectionSpace::Metres,
                detections: Vec::new(),
            }),
            digest: stamp_ns * 31,
        }
    }

    fn recording(stamps: impl IntoIterator<Item = i64>) -> Recording {
        let mut recording = Recording::default();
        stamps
            .into_iter()
            .for_each(|stamp| recording.push(frame(stamp)));
        recording.settle();
        recording
    }

    #[test]
    fn copies_and_order_do_not_change_a_chunk() {
        let stamps: Vec<i64> = (0..50).map(|i| i * 1_000_000_000).collect();
        let once = recording(stamps.iter().copied());
        let twice = recording(stamps.iter().rev().chain(&stamps).copied());
        assert_eq!(twice.duplicates, 50);
        let cut = |recording| cut(recording, VehicleKey(7), "/lanes", 1);
        assert_eq!(cut(&once), cut(&twice));
    }

    #[test]
    fn a_chunk_has_its_neighbours_as_context_and_no_more() {
        let all = recording((0..400).map(|i| i * 1_000_000_000));
        let chunk = cut(&all, VehicleKey(7), "/lanes", 3).unwrap();
        let stamps = chunk.recording.detections.iter().map(|f| f.stamp_ns);
        assert_eq!(stamps.clone().min(), Some(140_000_000_000));
        assert_eq!(stamps.max(), Some(279_000_000_000));
        assert_eq!(around(3), 2..=4);
    }

    #[test]
    fn windows_before_the_epoch_are_cut_downwards() {
        assert_eq!(window_of(-1), -1);
        assert_eq!(windows(&recording([-1, 0, 1])), [-1, 0]);
    }
}
