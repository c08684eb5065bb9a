//! Pictures to observations, before chunks are mapped: which pictures are still to be looked at, and
//! looking at them on all threads.
//!
//! The unit is one window of one camera: each picture is decoded once and seen once, whatever chunks
//! it is context of. A worker decodes, brings to size, infers and reads its picture with a session of
//! its own, so that of several workers some always decode while others infer.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::path::Path;
use std::sync::{Mutex, PoisonError};

use rayon::prelude::*;
use tilefold_formats::log::{LogIndex, LogReader, Topic, TopicKind};
use tilefold_formats::picture::{self, KEY_FRAME_NS, Sequence};
use tilefold_onnx::{Device, Library, Model, Network, OnnxError};
use tilefold_schemas::log::{CameraFrame, LogMessage, Payload};
use tilefold_schemas::observation::ObservationFrame;
use tilefold_schemas::{SetAside, SetAsideKind};
use tilefold_tiler::chunk::{window_bounds_ns, window_of};
use tilefold_tiler::recording::{Recording, Series};
use tilefold_workers::detector::Detector;

use crate::logs::{Catalogue, MAX_CLOCK_GAP_NS, vehicle_of};
use crate::meter::{Meter, Stage};
use crate::progress::Progress;

/// A network that looks at pictures, with a session for each worker.
#[derive(Debug)]
pub struct Perception {
    model: Model,
    idle: Mutex<Vec<Network>>,
}

impl Perception {
    /// The network of a model card.
    ///
    /// # Errors
    /// The card, its model or ONNX Runtime cannot be used.
    pub fn open(card: &Path, library: Option<&Path>, device: Device) -> Result<Self, OnnxError> {
        Ok(Self {
            model: Model::open(card, library, device)?,
            idle: Mutex::new(Vec::new()),
        })
    }

    /// The model.
    #[must_use]
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// What is seen in a camera frame.
    ///
    /// # Errors
    /// Why it cannot be decoded, or looked at.
    pub fn look(&self, frame: &CameraFrame, meter: &Meter) -> Result<ObservationFrame, String> {
        let bytes = match frame {
            CameraFrame::Encoded(image) | CameraFrame::Video(image) => image.data.len(),
            CameraFrame::Raw(image) => image.data.len(),
        };
        let decoded = meter.time(Stage::Decode, || picture::decode(frame));
        meter.count(Stage::Decode, 1, bytes as u64);
        let picture = decoded.map_err(|error| error.to_string())?;
        let taken = self
            .idle
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .pop();
        let mut network = match taken {
            Some(network) => network,
            None => self.model.network().map_err(|error| error.to_string())?,
        };
        let observations = meter.time(Stage::Detect, || network.detect(&picture));
        meter.count(Stage::Detect, 1, 0);
        self.idle
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .push(network);
        Ok(ObservationFrame {
            size_px: [picture.width_px, picture.height_px],
            observations: observations.map_err(|error| format!("the network failed: {error}"))?,
        })
    }
}

/// ONNX Runtime as it was found.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Runtime {
    /// The library.
    pub path: std::path::PathBuf,
    /// Its version.
    pub version: String,
    /// What it can run networks on.
    pub providers: Vec<&'static str>,
}

/// Loads ONNX Runtime and says what it is.
///
/// # Errors
/// It is nowhere, or cannot be loaded.
pub fn runtime(named: Option<&Path>) -> Result<Runtime, OnnxError> {
    let library = Library::load(named)?;
    Ok(Runtime {
        version: library.version(),
        providers: library.providers(),
        path: library.path,
    })
}

/// A camera: its vehicle, as the logs name it, and its topic.
pub(crate) type Eye = (String, String);

/// What was seen, by camera, capture time and digest.
#[derive(Debug, Default)]
pub(crate) struct Sights {
    seen: BTreeMap<Eye, BTreeMap<(i64, i64), ObservationFrame>>,
    /// Pictures that could not be decoded, and the like.
    pub(crate) set_aside: Vec<SetAside>,
}

impl Sights {
    /// Puts what was seen into a recording of which only stamps and digests are known so far.
    /// Pictures that could not be looked at leave it.
    pub(crate) fn fill(&self, eye: &Eye, recording: &mut Recording) {
        let Some(seen) = self.seen.get(eye) else {
            recording.observations.clear();
            return;
        };
        let frames: Series<ObservationFrame> = std::mem::take(&mut recording.observations);
        let filled = frames.into_iter().filter_map(|frame| {
            let value = seen.get(&(frame.stamp_ns, frame.digest))?;
            Some(frame.with(value.clone()))
        });
        recording.observations = filled.collect();
    }
}

/// Looks at all pictures of these windows.
pub(crate) fn look(
    perception: &Perception,
    catalogue: &Catalogue,
    windows: &BTreeSet<(Eye, i64)>,
    meter: &Meter,
    progress: &dyn Progress,
) -> Sights {
    progress.begin(Stage::Detect, windows.len() as u64);
    let windows: Vec<&(Eye, i64)> = windows.iter().collect();
    let looks: Vec<Sights> = windows
        .into_par_iter()
        .map(|(eye, window)| {
            let sights = look_at(perception, catalogue, eye, *window, meter);
            let losses = sights.set_aside.iter().map(|loss| loss.count).sum();
            progress.advance(Stage::Detect, 1, losses);
            sights
        })
        .collect();
    progress.end(Stage::Detect);
    let mut all = Sights::default();
    for sights in looks {
        for (eye, seen) in sights.seen {
            all.seen.entry(eye).or_default().extend(seen);
        }
        all.set_aside.extend(sights.set_aside);
    }
    all
}

/// The times to read of a log so that the pictures of a range can be decoded.
pub(crate) fn from_key_frame(log: &LogIndex, range: &Range<i64>) -> Range<i64> {
    let is_video = |(_, topic): (usize, &Topic)| topic.schema_name.ends_with("CompressedVideo");
    let before_ns = match log.topics_of(TopicKind::Image).any(is_video) {
        true => KEY_FRAME_NS,
        false => 0,
    };
    range.start.saturating_sub(before_ns)..range.end
}

/// Looks at the pictures of one window of one camera.
fn look_at(
    perception: &Perception,
    catalogue: &Catalogue,
    eye: &Eye,
    window: i64,
    meter: &Meter,
) -> Sights {
    let (from_ns, to_ns) = window_bounds_ns(window);
    let range = from_ns.saturating_sub(MAX_CLOCK_GAP_NS)..to_ns.saturating_add(MAX_CLOCK_GAP_NS);
    let mut seen: BTreeMap<(i64, i64), Result<ObservationFrame, ()>> = BTreeMap::new();
    let mut set_aside = Vec::new();
    let is_theirs = |log: &&LogIndex| {
        vehicle_of(log) == eye.0 && log.start_ns < range.end && log.end_ns >= range.start
    };
    for log in catalogue.logs.iter().filter(is_theirs) {
        let file = log.path.display().to_string();
        let mut losses = Vec::new();
        let mut sequence = Sequence::default();
        let sink = |message: LogMessage| {
            let key = (message.stamp_ns, catalogue.seen_digest(message.digest));
            let is_new = window_of(message.stamp_ns) == window && !seen.contains_key(&key);
            let Payload::Image(frame) = message.payload else {
                return;
            };
            // Later frames of a video build on this one, wanted or not.
            let is_needed = is_new || matches!(frame, CameraFrame::Video(_));
            if !is_needed {
                return;
            }
            let still = sequence.still(frame).map_err(|error| error.to_string());
            if !is_new {
                return;
            }
            let look = still
                .and_then(|still| perception.look(&still, meter))
                .map_err(|reason| {
                    let loss = SetAside::new(SetAsideKind::Frame, &file, reason);
                    losses.push(loss.on(&eye.1).when(message.stamp_ns));
                });
            seen.insert(key, look);
        };
        // What is lost of the log itself was said when it was read for its stamps.
        let is_theirs = |_, topic: &Topic| topic.name == eye.1;
        let read = LogReader::new().read(log, is_theirs, from_key_frame(log, &range), sink);
        if let Err(error) = read {
            losses.push(SetAside::new(SetAsideKind::File, &file, error.to_string()));
        }
        set_aside.extend(losses);
    }
    let seen = seen
        .into_iter()
        .filter_map(|(key, look)| Some((key, look.ok()?)));
    Sights {
        seen: BTreeMap::from([(eye.clone(), seen.collect())]),
        set_aside,
    }
}
