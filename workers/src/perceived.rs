//! From observations to detections: what was seen in pictures is tracked, named, and laid out as if
//! it had been detected on the vehicle, so that all that follows is the same.
//!
//! Only what belongs to a believed track is handed on, but for vehicles: what one picture alone takes
//! for a vehicle may hide the road, and what is not seen behind it must not speak against the map.
//! Boxes of paint become outlines on the road, vehicles become outlines that hide it.

use std::borrow::Cow;
use std::collections::BTreeMap;

use tilefold_schemas::log::{Detection, DetectionFrame, DetectionSpace, VehicleFrame};
use tilefold_schemas::observation::{Observation, ObservationFrame, Place, Seen};
use tilefold_schemas::{Color, Marking};
use tilefold_tiler::recording::{Recording, Stamped};

use crate::areas::outline;
use crate::camera::Camera;
use crate::frames::FrameTree;
use crate::look;
use crate::track::identity::{Confusions, Reading, class, color, marking};
use crate::track::{Track, Tracker};

/// Marking and colour are read from what was seen so long before and after a frame, in nanoseconds.
const AROUND_NS: i64 = 1_000_000_000;

/// What an observation turned out to be.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tracked {
    /// Which track it belongs to, counted from 0 in the order in which they began.
    pub track: usize,
    /// What the track is.
    pub seen: Seen,
    /// How it is painted there, if it is a line and that was recognised.
    pub marking: Marking,
    /// Its colour there.
    pub color: Color,
}

/// Observations of settled frames that belong to a believed track, by frame and index.
#[must_use]
pub fn tracked(frames: &[Stamped<ObservationFrame>]) -> BTreeMap<(usize, usize), Tracked> {
    let confusions = Confusions::default();
    let tracks = Tracker::default().follow(frames);
    let believed = tracks.iter().filter(|track| track.is_believed);
    let named = believed.enumerate().flat_map(|(number, track)| {
        let names = names(track, number, frames, &confusions);
        track.hits.iter().copied().zip(names)
    });
    named.collect()
}

fn names(
    track: &Track,
    number: usize,
    frames: &[Stamped<ObservationFrame>],
    confusions: &Confusions,
) -> Vec<Tracked> {
    let observed =
        (track.hits.iter()).map(|&(frame, index)| &frames[frame].value.observations[index]);
    let seen = class(observed.clone()).unwrap_or(Seen::LaneMarking);
    let readings: Vec<Reading> = observed
        .map(|observation| confusions.reading(observation))
        .collect();
    let stamps_ns: Vec<i64> = track
        .hits
        .iter()
        .map(|hit| frames[hit.0].stamp_ns)
        .collect();
    let name = |&stamp_ns: &i64| {
        let from = stamps_ns.partition_point(|ns| *ns < stamp_ns - AROUND_NS);
        let to = stamps_ns.partition_point(|ns| *ns <= stamp_ns + AROUND_NS);
        Tracked {
            track: number,
            seen,
            marking: marking(&readings[from..to]),
            color: color(&readings[from..to]),
        }
    };
    stamps_ns.iter().map(name).collect()
}

/// A recording whose observations have become detections, and the frames for which that failed.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Perceived<'a> {
    pub(crate) recording: Cow<'a, Recording>,
    /// Capture times of pictures that are not of the calibrated size.
    pub(crate) other_size_ns: Vec<i64>,
    /// What their size is, and should be.
    pub(crate) sizes_px: [[u32; 2]; 2],
}

/// The recording as if its detections had been made on the vehicle.
pub(crate) fn perceived<'a>(recording: &'a Recording, tree: &FrameTree) -> Perceived<'a> {
    let mut perceived = Perceived {
        recording: Cow::Borrowed(recording),
        other_size_ns: Vec::new(),
        sizes_px: [[0; 2]; 2],
    };
    if recording.observations.is_empty() {
        return perceived;
    }
    let camera = look::camera(recording, tree).ok();
    let stated_px = recording
        .calibrations
        .last()
        .map(|entry| [entry.value.width_px, entry.value.height_px]);
    let is_calibrated = |frame: &Stamped<ObservationFrame>| {
        stated_px.is_none_or(|stated| stated.contains(&0) || stated == frame.value.size_px)
    };
    let (frames, others): (Vec<_>, Vec<_>) = recording
        .observations
        .iter()
        .cloned()
        .partition(is_calibrated);
    perceived.other_size_ns = others.iter().map(|frame| frame.stamp_ns).collect();
    if let Some(other) = others.last() {
        perceived.sizes_px = [other.value.size_px, stated_px.unwrap_or_default()];
    }
    let tracked = tracked(&frames);
    let mut seen = recording.clone();
    seen.observations.clear();
    for (number, frame) in frames.iter().enumerate() {
        let named = tracked.range((number, 0)..(number + 1, 0));
        let named: Vec<(&Observation, &Tracked)> = named
            .map(|((_, index), tracked)| (&frame.value.observations[*index], tracked))
            .collect();
        let detections = named
            .iter()
            .filter_map(|(o, t)| detection(o, t, camera.as_ref()));
        seen.detections.push(frame.with(DetectionFrame {
            space: DetectionSpace::Pixels,
            detections: detections.collect(),
        }));
        let observations = frame.value.observations.iter();
        let vehicles = observations.filter(|observation| observation.seen == Seen::Vehicle);
        seen.vehicles.push(frame.with(VehicleFrame {
            space: DetectionSpace::Pixels,
            vehicles: vehicles.map(corners).collect(),
        }));
    }
    seen.settle();
    perceived.recording = Cow::Owned(seen);
    perceived
}

/// An observation as a detection of what its track is; none for vehicles.
fn detection(
    observation: &Observation,
    tracked: &Tracked,
    camera: Option<&Camera>,
) -> Option<Detection> {
    let kind = tracked.seen.kind()?;
    let points = match &observation.place {
        Place::Line(points) => points.iter().map(|&[x, y]| [x, y, 0.0]).collect(),
        Place::Box(edges) => outline::of(kind, *edges, camera)?,
    };
    Some(Detection {
        kind,
        marking: tracked.marking,
        color: tracked.color,
        sign: tracked.seen.sign(),
        score: observation.score,
        points,
    })
}

fn corners(observation: &Observation) -> Vec<[f64; 3]> {
    match &observation.place {
        Place::Box([left, top, right, bottom]) => {
            let corner = |x: &f64, y: &f64| [*x, *y, 0.0];
            vec![
                corner(left, top),
                corner(right, top),
                corner(right, bottom),
                corner(left, bottom),
            ]
        }
        Place::Line(points) => points.iter().map(|&[x, y]| [x, y, 0.0]).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn observation(seen: Seen, place: Place) -> Observation {
        Observation {
            seen,
            place,
            score: 0.7,
            marking: Vec::new(),
            color: Vec::new(),
            appearance: Vec::new(),
        }
    }

    #[test]
    fn one_picture_is_enough_for_a_vehicle_but_not_for_a_line() {
        let edges = [300.0, 150.0, 380.0, 230.0];
        let frame = |number: i64| {
            let mut observations = Vec::new();
            if number == 4 {
                let line = Place::Line(vec![[200.0, 350.0], [260.0, 220.0]]);
                observations.push(observation(Seen::LaneMarking, line));
                observations.push(observation(Seen::Vehicle, Place::Box(edges)));
            }
            Stamped {
                stamp_ns: number * 100_000_000,
                frame_id: String::new(),
                digest: 0,
                value: ObservationFrame {
                    size_px: [640, 360],
                    observations,
                },
            }
        };
        let mut recording = Recording::default();
        recording.observations.extend((0..9).map(frame));
        let perceived = perceived(&recording, &FrameTree::default());
        let hidden = |frame: &Stamped<VehicleFrame>| frame.value.vehicles.len();
        let vehicles: Vec<usize> = perceived.recording.vehicles.iter().map(hidden).collect();
        assert_eq!(vehicles, [0, 0, 0, 0, 1, 0, 0, 0, 0]);
        let [left, top, right, bottom] = edges;
        let corners = [[left, top], [right, top], [right, bottom], [left, bottom]];
        let seen = &perceived.recording.vehicles[4].value.vehicles[0];
        assert_eq!(*seen, corners.map(|[x, y]| [x, y, 0.0]));
        let lines = perceived.recording.detections.iter();
        assert_eq!(
            lines
                .map(|frame| frame.value.detections.len())
                .sum::<usize>(),
            0
        );
    }
}
