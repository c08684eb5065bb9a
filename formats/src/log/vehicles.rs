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
    frames: Vec<Decoded>,
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
        let mut frames = self.frames.iter_mut();
        let known = frames.find(|frame| frame.stamp_ns == stamp_ns && frame.frame_id == frame_id);
        if let Some(Payload::Vehicles(frame)) = known.map(|known| &mut known.payload) {
            frame.vehicles.push(corners);
            return Ok(());
        }
        self.frames.push(Decoded {
            stamp_ns,
            frame_id: frame_id.to_owned(),
            payload: Payload::Vehicles(VehicleFrame {
                space: self.space,
                vehicles: vec![corners],
            }),
        });
        Ok(())
    }

    /// Hands the frames on.
    pub(crate) fn finish(self, decoded: &mut Vec<Decoded>) {
        decoded.extend(self.frames);
    }
}
