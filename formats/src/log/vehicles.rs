//! Other vehicles, which hide lines: told by the `class` of scenes' entities and of annotations.

use tilefold_schemas::limits::{MAX_DETECTIONS_PER_FRAME, MAX_POINTS_PER_DETECTION};
use tilefold_schemas::log::{DetectionSpace, Payload, VehicleFrame};

use super::decode::Decoded;
use super::detection::check_count;
use super::error::DecodeError;

/// Classes that are vehicles, in lower case; detectors' own names for them.
const CLASSES: [&str; 10] = [
    "vehicle",
    "car",
    "truck",
    "bus",
    "van",
    "trailer",
    "motorcycle",
    "pickup",
    "taxi",
    "tram",
];

/// Whether metadata, of which the last of a key counts, is of a vehicle.
pub(crate) fn is_vehicle<'a>(metadata: impl Iterator<Item = (&'a str, &'a str)>) -> bool {
    let class = metadata.filter(|(key, _)| *key == "class").last();
    class.is_some_and(|(_, class)| {
        CLASSES
            .iter()
            .any(|known| class.trim().eq_ignore_ascii_case(known))
    })
}

/// Gathers the vehicles of one message, one frame for each stamp and frame name.
#[derive(Debug)]
pub(crate) struct Vehicles {
    space: DetectionSpace,
    frames: Vec<(Option<i64>, String, Vec<Vec<[f64; 3]>>)>,
    vehicles: usize,
}

impl Vehicles {
    /// None yet.
    pub(crate) fn new(space: DetectionSpace) -> Self {
        Self {
            space,
            frames: Vec::new(),
            vehicles: 0,
        }
    }

    /// Adds the corners of one.
    pub(crate) fn add(
        &mut self,
        stamp_ns: Option<i64>,
        frame_id: &str,
        corners: Vec<[f64; 3]>,
    ) -> Result<(), DecodeError> {
        self.vehicles += 1;
        check_count(
            "vehicles in a frame",
            self.vehicles,
            MAX_DETECTIONS_PER_FRAME,
        )?;
        check_count(
            "corners of a vehicle",
            corners.len(),
            MAX_POINTS_PER_DETECTION,
        )?;
        let is_it =
            |frame: &&mut (Option<i64>, String, _)| frame.0 == stamp_ns && frame.1 == frame_id;
        match self.frames.iter_mut().find(is_it) {
            Some((_, _, vehicles)) => vehicles.push(corners),
            None => self
                .frames
                .push((stamp_ns, frame_id.to_owned(), vec![corners])),
        }
        Ok(())
    }

    /// Hands the frames on.
    pub(crate) fn finish(self, decoded: &mut Vec<Decoded>) {
        let Self { space, frames, .. } = self;
        let frames = frames.into_iter();
        decoded.extend(frames.map(|(stamp_ns, frame_id, vehicles)| Decoded {
            stamp_ns,
            frame_id,
            payload: Payload::Vehicles(VehicleFrame { space, vehicles }),
        }));
    }
}
