//! Perception alone: pictures, folders of them, or the pictures of a log, to what is seen in them.
//!
//! The pictures of a log are tracked, as the map stage does it; those of a folder stand for
//! themselves.

mod overlay;

use std::collections::BTreeSet;
use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};

use rayon::prelude::*;
use serde::Serialize;
use tilefold_formats::log::{ALL_TIME, LogIndex, LogReader, TopicKind};
use tilefold_formats::log_write::{Dialect, Entry, LogWriter};
use tilefold_formats::picture::{self, Sequence};
use tilefold_schemas::log::{
    CameraFrame, Detection, DetectionFrame, DetectionSpace, EncodedImage, LogMessage, Payload,
    VehicleFrame,
};
use tilefold_schemas::observation::{Observation, ObservationFrame, Place, Seen};
use tilefold_schemas::{Color, Marking, SetAside, SetAsideKind};
use tilefold_tiler::recording::{Series, Stamped};
use tilefold_workers::perceived::{Tracked, tracked};

use crate::meter::{Meter, Stage, StageReport};
use crate::perceive::Perception;
use crate::progress::Progress;

/// Pictures of a log that are held at once.
const PICTURES_AT_ONCE: usize = 64;
/// Endings of picture files.
const ENDINGS: [&str; 3] = ["jpg", "jpeg", "png"];
/// Topics of an MCAP file with what was seen.
const IMAGE_TOPIC: &str = "/image";
const DETECTIONS_TOPIC: &str = "/detections";
const VEHICLES_TOPIC: &str = "/vehicles";

/// Why nothing could be detected at all.
#[derive(Debug, thiserror::Error)]
pub enum DetectError {
    /// No pictures.
    #[error("{}: {what}; give a picture (JPEG, PNG), a folder of pictures, or a log with camera images", path.display())]
    NoPictures {
        /// What was given.
        path: PathBuf,
        /// What it is instead.
        what: String,
    },
    /// A file or folder that cannot be read or written.
    #[error("{}: {source}; check the path and its rights", path.display())]
    File {
        /// Which.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// The log with what was seen could not be written.
    #[error(transparent)]
    Write(#[from] tilefold_formats::log_write::LogWriteError),
}

/// Where what was seen goes besides the report.
#[derive(Debug, Clone, Copy, Default)]
pub struct Outputs<'a> {
    /// Folder for each picture with what was seen drawn into it.
    pub overlay: Option<&'a Path>,
    /// MCAP file with the pictures and what was seen as annotations.
    pub annotations: Option<&'a Path>,
}

/// What was seen in all pictures.
#[derive(Debug, Serialize)]
pub struct Detected {
    /// Name of the model.
    pub model: String,
    /// By picture, in the order of their names or times.
    pub pictures: Vec<DetectedPicture>,
    /// Stages with their rates.
    pub stages: Vec<StageReport>,
    /// Seconds that it took.
    pub wall_s: f64,
    /// What could not be looked at.
    pub set_aside: Vec<SetAside>,
}

/// What was seen in one picture.
#[derive(Debug, Serialize)]
pub struct DetectedPicture {
    /// The file it is from.
    pub file: String,
    /// Nanoseconds since the Unix epoch, of a log's.
    pub stamp_ns: Option<i64>,
    /// Pixels in a row.
    pub width_px: u32,
    /// Rows.
    pub height_px: u32,
    /// What was seen.
    pub detections: Vec<Item>,
}

/// One thing that was seen.
#[derive(Debug, Serialize)]
pub struct Item {
    /// What it is.
    pub class: &'static str,
    /// In `[0, 1]`.
    pub score: f64,
    /// How it is painted, if recognised.
    #[serde(rename = "type", skip_serializing_if = "Option::is_none")]
    pub marking: Option<&'static str>,
    /// Its colour, if recognised.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub color: Option<&'static str>,
    /// Number of its track, in a log; none if it was not seen often enough to be believed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub track: Option<usize>,
    /// Points of a line in pixels, from the nearest to the farthest.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub points: Option<Vec<[f64; 2]>>,
    /// Left, top, right and bottom edge of a box, in pixels.
    #[serde(rename = "box", skip_serializing_if = "Option::is_none")]
    pub edges: Option<[f64; 4]>,
}

impl Item {
    fn new(observation: &Observation, tracked: Option<&Tracked>) -> Self {
        let seen = tracked.map_or(observation.seen, |tracked| tracked.seen);
        let (points, edges) = match &observation.place {
            Place::Line(points) => (Some(points.clone()), None),
            Place::Box(edges) => (None, Some(*edges)),
        };
        let marking = tracked.map(|tracked| tracked.marking);
        let color = tracked.map(|tracked| tracked.color);
        Self {
            class: seen.name(),
            score: observation.score,
            marking: marking
                .filter(|m| *m != Marking::Unknown)
                .map(Marking::name),
            color: color.filter(|c| *c != Color::Unknown).map(Color::name),
            track: tracked.map(|tracked| tracked.track),
            points,
            edges,
        }
    }
}

/// What is seen in a picture, a folder of pictures, or a log.
///
/// # Errors
/// There are no pictures, or an output cannot be written. Single pictures that cannot be decoded are
/// set aside.
pub fn detect(
    input: &Path,
    perception: &Perception,
    outputs: Outputs<'_>,
    progress: &dyn Progress,
) -> Result<Detected, DetectError> {
    let meter = Meter::default();
    let job = Job {
        perception,
        outputs,
        meter: &meter,
        progress,
    };
    if let Some(folder) = outputs.overlay {
        std::fs::create_dir_all(folder).map_err(|source| file_error(folder, source))?;
    }
    let (pictures, set_aside) = match files(input)? {
        Some(files) => job.files(&files)?,
        None => job.log(input)?,
    };
    Ok(Detected {
        model: perception.model().card.name.clone(),
        pictures,
        stages: stages(&meter),
        wall_s: meter.elapsed_s(),
        set_aside,
    })
}

/// The stages that perception alone goes through.
fn stages(meter: &Meter) -> Vec<StageReport> {
    let mut stages = meter.report();
    stages.retain(|stage| stage.items > 0);
    stages
}

fn file_error(path: &Path, source: std::io::Error) -> DetectError {
    DetectError::File {
        path: path.to_owned(),
        source,
    }
}

/// The picture files that are meant, by name; none for a log.
fn files(input: &Path) -> Result<Option<Vec<PathBuf>>, DetectError> {
    let is_picture = |path: &PathBuf| {
        let ending = path
            .extension()
            .map(|ending| ending.to_string_lossy().to_ascii_lowercase());
        ending.is_some_and(|ending| ENDINGS.contains(&ending.as_str()))
    };
    if !input.is_dir() {
        let picture = Some(input.to_owned()).filter(is_picture);
        return Ok(picture.map(|picture| vec![picture]));
    }
    let entries = std::fs::read_dir(input).map_err(|source| file_error(input, source))?;
    let found: BTreeSet<PathBuf> = entries
        .flatten()
        .map(|entry| entry.path())
        .filter(is_picture)
        .collect();
    if found.is_empty() {
        return Err(DetectError::NoPictures {
            path: input.to_owned(),
            what: "a folder without .jpg and .png files".to_owned(),
        });
    }
    Ok(Some(found.into_iter().collect()))
}

struct Job<'a> {
    perception: &'a Perception,
    outputs: Outputs<'a>,
    meter: &'a Meter,
    progress: &'a dyn Progress,
}

type Looked = (Vec<DetectedPicture>, Vec<SetAside>);

impl Job<'_> {
    fn files(&self, files: &[PathBuf]) -> Result<Looked, DetectError> {
        self.progress.begin(Stage::Detect, files.len() as u64);
        let looks: Vec<Result<DetectedPicture, SetAside>> = files
            .par_iter()
            .map(|file| {
                let look = self.file(file);
                self.progress
                    .advance(Stage::Detect, 1, u64::from(look.is_err()));
                look
            })
            .collect();
        self.progress.end(Stage::Detect);
        let (mut pictures, mut set_aside) = (Vec::new(), Vec::new());
        for look in looks {
            match look {
                Ok(picture) => pictures.push(picture),
                Err(loss) => set_aside.push(loss),
            }
        }
        Ok((pictures, set_aside))
    }

    fn file(&self, file: &Path) -> Result<DetectedPicture, SetAside> {
        let name = file.display().to_string();
        let refuse = |reason: String| SetAside::new(SetAsideKind::File, &name, reason);
        let bytes = std::fs::read(file).map_err(|error| refuse(error.to_string()))?;
        let frame = CameraFrame::Encoded(EncodedImage {
            format: file
                .extension()
                .unwrap_or_default()
                .to_string_lossy()
                .into_owned(),
            data: bytes.into(),
        });
        let seen = self.perception.look(&frame, self.meter).map_err(refuse)?;
        let picture = describe(&name, None, &seen, |_| None);
        self.draw(
            &frame,
            &picture,
            &file.file_stem().unwrap_or_default().to_string_lossy(),
        )
        .map_err(|error| refuse(error.to_string()))?;
        Ok(picture)
    }

    fn draw(
        &self,
        frame: &CameraFrame,
        seen: &DetectedPicture,
        name: &str,
    ) -> Result<(), DetectError> {
        let Some(folder) = self.outputs.overlay else {
            return Ok(());
        };
        let path = folder.join(format!("{name}.png"));
        // It was decoded before, to be looked at.
        let Ok(picture) = picture::decode(frame) else {
            return Ok(());
        };
        let png =
            overlay::png(&picture, &seen.detections).map_err(|source| file_error(&path, source))?;
        std::fs::write(&path, png).map_err(|source| file_error(&path, source))
    }

    /// Looks at the pictures of a log, then tracks them, then writes them.
    fn log(&self, path: &Path) -> Result<Looked, DetectError> {
        let none = |what: String| DetectError::NoPictures {
            path: path.to_owned(),
            what,
        };
        let index = LogIndex::open(path).map_err(|error| none(error.to_string()))?;
        let topics = index
            .topics_of(TopicKind::Image)
            .filter(|(_, topic)| topic.messages > 0);
        let topic = topics.max_by_key(|(at, topic)| (topic.messages, std::cmp::Reverse(*at)));
        let (topic, count) = topic
            .map(|(at, topic)| (at, topic.messages))
            .ok_or_else(|| none("a log without pictures".to_owned()))?;
        let mut set_aside = index.set_aside.clone();
        let mut frames: Series<ObservationFrame> = Vec::new();
        self.progress.begin(Stage::Detect, count);
        self.each(&index, topic, &mut set_aside, |messages, set_aside| {
            let looks: Vec<_> = messages
                .par_iter()
                .map(|(message, frame)| (message, self.perception.look(frame, self.meter)))
                .collect();
            for (message, look) in looks {
                match look {
                    Ok(seen) => frames.push(Stamped {
                        stamp_ns: message.stamp_ns,
                        frame_id: message.frame_id.clone(),
                        digest: message.digest,
                        value: seen,
                    }),
                    Err(reason) => set_aside.push(loss(
                        path,
                        &index.topics[topic].name,
                        message.stamp_ns,
                        reason,
                    )),
                }
                self.progress.advance(Stage::Detect, 1, 0);
            }
            Ok(())
        })?;
        self.progress.end(Stage::Detect);
        frames.sort_by_key(|frame| (frame.stamp_ns, frame.digest));
        frames.dedup_by_key(|frame| (frame.stamp_ns, frame.digest));
        let tracked = tracked(&frames);
        let name = path.display().to_string();
        let pictures: Vec<DetectedPicture> = (frames.iter().enumerate())
            .map(|(at, frame)| {
                let of = |index: usize| tracked.get(&(at, index));
                describe(&name, Some(frame.stamp_ns), &frame.value, of)
            })
            .collect();
        if self.outputs.overlay.is_some() || self.outputs.annotations.is_some() {
            self.write(&index, topic, &pictures)?;
        }
        Ok((pictures, set_aside))
    }

    /// Hands on the pictures of a log, some at a time.
    fn each(
        &self,
        index: &LogIndex,
        wanted: usize,
        set_aside: &mut Vec<SetAside>,
        mut act: impl FnMut(&[(LogMessage, CameraFrame)], &mut Vec<SetAside>) -> Result<(), DetectError>,
    ) -> Result<(), DetectError> {
        let mut held: Vec<(LogMessage, CameraFrame)> = Vec::new();
        let mut acted = Ok(());
        let mut losses = Vec::new();
        let mut sequence = Sequence::default();
        let sink = |message: LogMessage| {
            let Payload::Image(frame) = message.payload.clone() else {
                return;
            };
            match sequence.still(frame) {
                Ok(frame) => held.push((message, frame)),
                Err(error) => {
                    let topic = &index.topics[wanted].name;
                    losses.push(loss(
                        &index.path,
                        topic,
                        message.stamp_ns,
                        error.to_string(),
                    ));
                }
            }
            if held.len() == PICTURES_AT_ONCE && acted.is_ok() {
                acted = act(&held, &mut losses);
                held.clear();
            }
        };
        let read = LogReader::new().read(index, |at, _| at == wanted, ALL_TIME, sink);
        acted?;
        act(&held, &mut losses)?;
        set_aside.extend(losses);
        match read {
            Ok(report) => set_aside.extend(report.set_aside),
            Err(error) => set_aside.push(SetAside::new(
                SetAsideKind::File,
                index.path.display().to_string(),
                error.to_string(),
            )),
        }
        Ok(())
    }

    /// Writes the overlays and the annotated log: a second way through the pictures.
    fn write(
        &self,
        index: &LogIndex,
        topic: usize,
        pictures: &[DetectedPicture],
    ) -> Result<(), DetectError> {
        let vehicle = index.vehicle.clone().unwrap_or_default();
        let mut log = match self.outputs.annotations {
            None => None,
            Some(path) => {
                let file = File::create(path).map_err(|source| file_error(path, source))?;
                Some(LogWriter::create(
                    BufWriter::new(file),
                    Dialect::Foxglove,
                    &vehicle,
                    [],
                )?)
            }
        };
        let mut ignored = Vec::new();
        self.each(index, topic, &mut ignored, |messages, _| {
            for (message, frame) in messages {
                let at =
                    pictures.partition_point(|picture| picture.stamp_ns < Some(message.stamp_ns));
                let Some(seen) = pictures
                    .get(at)
                    .filter(|p| p.stamp_ns == Some(message.stamp_ns))
                else {
                    continue;
                };
                self.draw(frame, seen, &format!("{}", message.stamp_ns))?;
                if let Some(log) = &mut log {
                    annotate(log, message, seen)?;
                }
            }
            Ok(())
        })?;
        if let Some(log) = log {
            log.finish()?;
        }
        Ok(())
    }
}

fn loss(path: &Path, topic: &str, stamp_ns: i64, reason: String) -> SetAside {
    let loss = SetAside::new(SetAsideKind::Frame, path.display().to_string(), reason);
    loss.on(topic).when(stamp_ns)
}

fn describe<'a>(
    file: &str,
    stamp_ns: Option<i64>,
    seen: &ObservationFrame,
    tracked: impl Fn(usize) -> Option<&'a Tracked>,
) -> DetectedPicture {
    let items = seen.observations.iter().enumerate();
    DetectedPicture {
        file: file.to_owned(),
        stamp_ns,
        width_px: seen.size_px[0],
        height_px: seen.size_px[1],
        detections: items
            .map(|(index, observation)| Item::new(observation, tracked(index)))
            .collect(),
    }
}

/// Writes one picture and what is believed of it. Viewers lay annotations over the picture of the
/// same stamp.
fn annotate(
    log: &mut LogWriter<BufWriter<File>>,
    message: &LogMessage,
    seen: &DetectedPicture,
) -> Result<(), DetectError> {
    let mut write = |topic: &str, payload: &Payload| {
        log.write(Entry {
            topic,
            stamp_ns: message.stamp_ns,
            log_time_ns: message.log_time_ns,
            frame_id: &message.frame_id,
            payload,
        })
    };
    // Raw images and video stay where they are: the annotations fit over them as well.
    if matches!(message.payload, Payload::Image(CameraFrame::Encoded(_))) {
        write(IMAGE_TOPIC, &message.payload)?;
    }
    let believed = seen.detections.iter().filter(|item| item.track.is_some());
    let (vehicles, paint): (Vec<&Item>, Vec<&Item>) =
        believed.partition(|item| item.class == Seen::Vehicle.name());
    let frame = DetectionFrame {
        space: DetectionSpace::Pixels,
        detections: paint.iter().filter_map(|item| detection(item)).collect(),
    };
    write(DETECTIONS_TOPIC, &Payload::Detections(frame))?;
    // Annotations without any would say that nothing of ours was seen.
    if !vehicles.is_empty() {
        let frame = VehicleFrame {
            space: DetectionSpace::Pixels,
            vehicles: vehicles.iter().map(|item| points(item)).collect(),
        };
        write(VEHICLES_TOPIC, &Payload::Vehicles(frame))?;
    }
    Ok(())
}

fn detection(item: &Item) -> Option<Detection> {
    let seen = Seen::from_name(item.class)?;
    Some(Detection {
        kind: seen.kind()?,
        marking: item
            .marking
            .and_then(Marking::from_name)
            .unwrap_or_default(),
        color: item.color.and_then(Color::from_name).unwrap_or_default(),
        sign: seen.sign(),
        score: item.score,
        points: points(item),
    })
}

fn points(item: &Item) -> Vec<[f64; 3]> {
    let of_box = |[left, top, right, bottom]: [f64; 4]| {
        vec![[left, top], [right, top], [right, bottom], [left, bottom]]
    };
    let points = item
        .points
        .clone()
        .or(item.edges.map(of_box))
        .unwrap_or_default();
    points.into_iter().map(|[x, y]| [x, y, 0.0]).collect()
}
