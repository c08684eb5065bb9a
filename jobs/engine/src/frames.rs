//! The frames that an explanation names, as pictures: what the camera saw, what was detected in it,
//! and the map where the frame was placed, with what is said of it.
//!
//! A frame is mapped once more, with the chunk that it belongs to, by the functions that made the
//! evidence: the map is drawn through the camera as it was found to be mounted.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use serde::Serialize;
use tilefold_formats::export::{CaseFrame, CaseLine, write_case};
use tilefold_formats::log::{LogReader, TopicKind};
use tilefold_formats::picture::{self, Sequence};
use tilefold_schemas::evidence::is_same_frame;
use tilefold_schemas::log::{LogMessage, Payload};
use tilefold_schemas::{
    ChangeRecord, ElementKind, Picture, SetAside, SetAsideKind, VehicleKey, Verdict, wkb,
};
use tilefold_store::{Snapshot, TileFilter};
use tilefold_tiler::chunk::{self, Chunk, window_bounds_ns, window_of};
use tilefold_tiler::geodesy::LocalFrame;
use tilefold_tiler::map_index::MapIndex;
use tilefold_workers::pose::Trajectory;
use tilefold_workers::testify::Frame as MappedFrame;
use tilefold_workers::{MapContext, Registering, map_chunk_traced};

use crate::error::EngineError;
use crate::explain::Frame;
use crate::logs::{Catalogue, MAX_CLOCK_GAP_NS, Unit};
use crate::meter::Meter;
use crate::perceive::{self, Eye, Perception, Sights};
use crate::picture::{Rgb, Shape, over};
use crate::progress::Silent;
use crate::run::read_elements;

/// How far around a frame the map is drawn, in degrees of latitude: some 110 m.
const AROUND_DEG: f64 = 0.001;
/// Lines follow the bend of the road from vertex to vertex; so far apart, in metres.
const STEP_M: f64 = 2.0;
/// The map as it is, what was detected, and the three kinds of change.
const MAPPED: Rgb = [0x40, 0x90, 0xff];
const SEEN: Rgb = [0xff, 0xe0, 0x30];
const ADDED: Rgb = [0x30, 0xd8, 0x50];
const REMOVED: Rgb = [0xf0, 0x38, 0x30];
const MODIFIED: Rgb = [0xff, 0x80, 0x10];
/// What is drawn in which colour.
const CLASSES: [(Rgb, &str); 5] = [
    (MAPPED, "map"),
    (SEEN, "detected"),
    (ADDED, "added"),
    (REMOVED, "removed"),
    (MODIFIED, "modified"),
];
/// Widths of lines, in pixels of a picture of this width.
const OF_WIDTH_PX: f64 = 640.0;
const THIN_PX: f64 = 1.2;
const THICK_PX: f64 = 2.6;
/// Thinner ones fade, in pixels.
const LEAST_PX: f64 = 1.0;

/// Where pictures are found, and what looks at them.
#[derive(Clone, Copy)]
pub struct Sources<'a> {
    /// Logs, or folders of them; where none is given, those that the store names.
    pub logs: &'a [PathBuf],
    /// The network that looked at pictures without detections.
    pub perception: Option<&'a Perception>,
}

/// What was written of the frames.
#[derive(Debug, Default, Serialize)]
pub struct FramePictures {
    /// Files, in the order of the frames.
    pub written: Vec<PathBuf>,
    /// Frames without a picture, and why.
    pub set_aside: Vec<SetAside>,
}

/// Where frames are written.
#[derive(Debug, Clone, Copy, Default)]
pub struct Outputs<'a> {
    /// Folder for pictures with everything drawn into them, `frame_STAMP.png`.
    pub folder: Option<&'a Path>,
    /// MCAP file of pictures and annotations, for Foxglove.
    pub case: Option<&'a Path>,
}

/// Writes the frames of an explanation.
///
/// # Errors
/// The store is damaged, or a file cannot be written.
pub fn write(
    snapshot: &Snapshot,
    frames: &[Frame],
    sources: Sources<'_>,
    outputs: Outputs<'_>,
) -> Result<FramePictures, EngineError> {
    let studio = Studio::open(snapshot, sources)?;
    let mut pictures = FramePictures::default();
    let mut case = Vec::new();
    if let Some(folder) = outputs.folder {
        fs::create_dir_all(folder).map_err(|source| unwritten(folder, source))?;
    }
    for frame in frames {
        match studio.seen(frame) {
            Ok(seen) => {
                if let Some(folder) = outputs.folder {
                    let path = folder.join(format!("frame_{}.png", frame.stamp_ns));
                    let png = over(&seen.photograph, &seen.shapes);
                    let written = png.and_then(|png| fs::write(&path, png));
                    written.map_err(|source| unwritten(&path, source))?;
                    pictures.written.push(path);
                }
                if let Some(path) = outputs.case {
                    let of_case = seen.case_frame(frame);
                    let of_case = of_case.map_err(|source| unwritten(path, source))?;
                    case.push(of_case);
                }
            }
            Err(reason) => {
                let log = frame.log.clone().unwrap_or_default();
                let loss = SetAside::new(SetAsideKind::Frame, log, reason);
                pictures.set_aside.push(loss.when(frame.stamp_ns));
            }
        }
    }
    if let Some(path) = outputs.case {
        let mut file = fs::File::create(path).map_err(|source| unwritten(path, source))?;
        // Two vehicles may have looked in the same millisecond: both are shown.
        case.sort_by_key(|frame| frame.stamp_ns);
        write_case(case, &mut file)?;
        pictures.written.push(path.to_owned());
    }
    Ok(pictures)
}

fn unwritten(path: &Path, source: std::io::Error) -> EngineError {
    EngineError::Picture {
        path: path.to_owned(),
        source,
    }
}

/// A frame: what the camera saw, and what is drawn over it.
struct Seen {
    photograph: Picture,
    shapes: Vec<Shape>,
}

impl Seen {
    fn case_frame(&self, frame: &Frame) -> std::io::Result<CaseFrame> {
        let lines = self.shapes.iter().filter_map(|shape| match shape {
            Shape::Line {
                points,
                color,
                width,
                ..
            } => Some(CaseLine {
                class: CLASSES.iter().find(|(of, _)| of == color)?.1,
                points_px: points.clone(),
                color: *color,
                width_px: *width,
            }),
            _ => None,
        });
        Ok(CaseFrame {
            stamp_ns: frame.stamp_ns,
            png: over(&self.photograph, &[])?,
            caption: format!("{:+.2} nats for a change", frame.for_change),
            lines: lines.collect(),
        })
    }
}

/// Everything that is needed to draw any frame of a store.
pub struct Studio<'a> {
    sources: Sources<'a>,
    salt: [u8; 32],
    context: MapContext,
    changes: Vec<ChangeRecord>,
}

impl<'a> Studio<'a> {
    /// Reads the map and what is said of it.
    ///
    /// # Errors
    /// The store is damaged.
    pub fn open(snapshot: &Snapshot, sources: Sources<'a>) -> Result<Self, EngineError> {
        let properties = snapshot.store().properties();
        let tile_level = u32::from(properties.tile_level);
        Ok(Self {
            sources,
            salt: properties.salt,
            context: MapContext {
                map: MapIndex::new(read_elements(snapshot, tile_level)?),
                tile_level,
                registering: Registering::On,
            },
            changes: snapshot.read(TileFilter::All)?,
        })
    }

    /// A frame as PNG.
    ///
    /// # Errors
    /// Why there is no picture of it, and what would give one.
    pub fn picture(&self, frame: &Frame) -> Result<Vec<u8>, String> {
        let seen = self.seen(frame)?;
        over(&seen.photograph, &seen.shapes).map_err(|error| error.to_string())
    }

    fn seen(&self, frame: &Frame) -> Result<Seen, String> {
        let meter = Meter::default();
        let catalogue = self.catalogue(frame, &meter)?;
        let unit = self.unit(&catalogue, frame)?;
        let chunk = self.chunk(&catalogue, &unit, frame, &meter)?;
        let shapes = self.shapes(&chunk, frame.stamp_ns)?;
        let photograph = photograph(&catalogue, &unit, frame)?;
        let scale = f64::from(photograph.width_px) / OF_WIDTH_PX;
        let shapes = shapes.into_iter().map(|shape| widened(shape, scale));
        Ok(Seen {
            shapes: shapes.collect(),
            photograph,
        })
    }

    fn catalogue(&self, frame: &Frame, meter: &Meter) -> Result<Catalogue, String> {
        let named: Vec<PathBuf> = match self.sources.logs {
            [] => frame
                .log
                .iter()
                .flat_map(|logs| logs.lines())
                .map(PathBuf::from)
                .collect(),
            logs => logs.to_vec(),
        };
        let there: Vec<PathBuf> = named.into_iter().filter(|path| path.exists()).collect();
        if there.is_empty() {
            return Err("its log is not where it was; name logs with `--logs`".to_owned());
        }
        let model = self
            .sources
            .perception
            .map(|perception| perception.model().digest);
        Ok(Catalogue::open_seeing(&there, model, meter, &Silent))
    }

    fn vehicle(&self, name: &str) -> VehicleKey {
        VehicleKey::new(&self.salt, name)
    }

    fn unit(&self, catalogue: &Catalogue, frame: &Frame) -> Result<Unit, String> {
        let window = window_of(frame.stamp_ns);
        let is_it = |unit: &Unit| {
            (unit.windows.0..unit.windows.1).contains(&window)
                && format!("{:016x}", self.vehicle(&unit.vehicle).0) == frame.vehicle
        };
        let found = catalogue.units().into_iter().find(is_it);
        found.ok_or_else(|| match catalogue.set_aside.first() {
            Some(loss) => format!("{}: {}", loss.file, loss.reason),
            None => "no log that was named is of its vehicle and time; name logs with `--logs`"
                .to_owned(),
        })
    }

    /// The chunk of a frame, its pictures looked at.
    fn chunk(
        &self,
        catalogue: &Catalogue,
        unit: &Unit,
        frame: &Frame,
        meter: &Meter,
    ) -> Result<Chunk, String> {
        let read = unit.read(catalogue, meter);
        let window = window_of(frame.stamp_ns);
        let mut channels = read.channels.iter();
        let found = channels.find(|(topic, _)| frame.topic.as_ref().is_none_or(|of| of == *topic));
        let (topic, recording) = found.ok_or("its log has no such topic any more")?;
        let mut chunk = chunk::cut(recording, self.vehicle(&unit.vehicle), topic, window)
            .ok_or("its log holds nothing of that time any more")?;
        if let Some(perception) = self
            .sources
            .perception
            .filter(|_| !chunk.recording.observations.is_empty())
        {
            let eye: Eye = (unit.vehicle.clone(), topic.clone());
            let there: BTreeSet<i64> = chunk::windows(recording).into_iter().collect();
            let windows = there
                .range(chunk::around(window))
                .map(|window| (eye.clone(), *window));
            let sights: Sights =
                perceive::look(perception, catalogue, &windows.collect(), meter, &Silent);
            sights.fill(&eye, &mut chunk.recording);
        }
        Ok(chunk)
    }

    /// What is drawn over the frame of a chunk.
    fn shapes(&self, chunk: &Chunk, stamp_ns: i64) -> Result<Vec<Shape>, String> {
        let local = Trajectory::anchor(&chunk.recording).map_err(|error| error.to_string())?;
        let mut shapes = None;
        let traced = map_chunk_traced(chunk, &self.context, |frame, _| {
            if is_same_frame(frame.look.pose.stamp_ns, stamp_ns) {
                shapes = frame.casting.map(|_| self.laid_on(frame, &local));
            }
        });
        traced.map_err(|error| error.to_string())?;
        let mut shapes = shapes
            .ok_or("its detections are in metres: there is no camera to draw the map through")?;
        shapes.extend(seen(chunk, stamp_ns));
        Ok(shapes)
    }

    /// The map, and above it what is said to have changed.
    fn laid_on(&self, frame: &MappedFrame<'_>, local: &LocalFrame) -> Vec<Shape> {
        let pose = &frame.look.pose;
        let [longitude, latitude, _] = local.to_wgs84([pose.east_m, pose.north_m, 0.0]);
        let reach = [
            AROUND_DEG / latitude.to_radians().cos().max(0.01),
            AROUND_DEG,
        ];
        let (low, high) = (
            [longitude - reach[0], latitude - reach[1]],
            [longitude + reach[0], latitude + reach[1]],
        );
        let draw = |points: &[[f64; 3]], is_area: bool, color: Rgb, width: f64| {
            let plane =
                |&[longitude, latitude, _]: &[f64; 3]| local.to_enu([longitude, latitude, 0.0]);
            let first = points.first().filter(|_| is_area);
            let line: Vec<[f64; 3]> = points.iter().chain(first).map(plane).collect();
            let parts = frame.in_picture(&dense(&line)).into_iter();
            parts.map(move |points| Shape::Line {
                points,
                color,
                width,
                is_dashed: false,
            })
        };
        let mut shapes = Vec::new();
        for mapped in self.context.map.within(low, high) {
            let is_area = matches!(
                mapped.element.kind,
                ElementKind::GroundSign | ElementKind::Crosswalk
            );
            shapes.extend(draw(&mapped.element.points, is_area, MAPPED, THIN_PX));
        }
        for record in &self.changes {
            let Some((bytes, color)) = changed(record) else {
                continue;
            };
            if let Ok(geometry) = wkb::read(bytes) {
                let is_near = |[x, y, _]: &[f64; 3]| {
                    (low[0]..=high[0]).contains(x) && (low[1]..=high[1]).contains(y)
                };
                if geometry.points.iter().any(is_near) {
                    shapes.extend(draw(&geometry.points, geometry.is_area, color, THICK_PX));
                }
            }
        }
        shapes
    }
}

/// What a record says to have changed, and its colour.
fn changed(record: &ChangeRecord) -> Option<(&[u8], Rgb)> {
    let (geometry, color) = match Verdict::from_code(record.verdict)? {
        Verdict::Added => (&record.geometry_new, ADDED),
        Verdict::Removed => (&record.geometry_old, REMOVED),
        Verdict::Modified => (&record.geometry_new, MODIFIED),
        _ => return None,
    };
    Some((geometry.as_deref()?, color))
}

/// The line with vertices so close that it follows the road's bend.
fn dense(line: &[[f64; 3]]) -> Vec<[f64; 3]> {
    let mut points = Vec::new();
    for pair in line.windows(2) {
        let length_m = (pair[1][0] - pair[0][0]).hypot(pair[1][1] - pair[0][1]);
        let steps = (length_m / STEP_M).ceil().max(1.0) as u32;
        let at = |step: u32| {
            let share = f64::from(step) / f64::from(steps);
            [0, 1, 2].map(|axis| pair[0][axis] + share * (pair[1][axis] - pair[0][axis]))
        };
        points.extend((0..steps).map(at));
    }
    points.extend(line.last());
    points
}

/// What was detected in the frame.
fn seen(chunk: &Chunk, stamp_ns: i64) -> Vec<Shape> {
    let recording = &chunk.recording;
    let outline = |points: Vec<[f64; 2]>| Shape::Line {
        points,
        color: SEEN,
        width: THIN_PX,
        is_dashed: true,
    };
    let at = |stamp: i64| is_same_frame(stamp, stamp_ns);
    let detections = recording
        .detections
        .iter()
        .filter(|frame| at(frame.stamp_ns));
    let given = detections.flat_map(|frame| &frame.value.detections);
    let given = given.map(|detection| detection.points.iter().map(|&[x, y, _]| [x, y]).collect());
    let observations = recording
        .observations
        .iter()
        .filter(|frame| at(frame.stamp_ns));
    let observed = observations.flat_map(|frame| &frame.value.observations);
    let observed = observed.map(|observation| observation.place.outline());
    given.chain(observed).map(outline).collect()
}

fn widened(shape: Shape, scale: f64) -> Shape {
    match shape {
        Shape::Line {
            points,
            color,
            width,
            is_dashed,
        } => Shape::Line {
            points,
            color,
            width: (width * scale).max(LEAST_PX),
            is_dashed,
        },
        other => other,
    }
}

/// The picture of a frame: of its own topic, or of the only camera's.
fn photograph(catalogue: &Catalogue, unit: &Unit, frame: &Frame) -> Result<Picture, String> {
    let bounds = window_bounds_ns(window_of(frame.stamp_ns));
    let range =
        bounds.0.saturating_sub(MAX_CLOCK_GAP_NS)..bounds.1.saturating_add(MAX_CLOCK_GAP_NS);
    for log in unit.logs.iter().map(|&log| &catalogue.logs[log]) {
        let cameras: Vec<usize> = log
            .topics_of(TopicKind::Image)
            .map(|(index, _)| index)
            .collect();
        let mut found = None;
        let mut sequence = Sequence::default();
        let own = |index: usize, name: &str| match frame.topic.as_deref() == Some(name) {
            true => cameras.contains(&index),
            false => cameras == [index],
        };
        let sink = |message: LogMessage| {
            let Payload::Image(image) = message.payload else {
                return;
            };
            let still = sequence.still(image);
            if is_same_frame(message.stamp_ns, frame.stamp_ns) {
                found = Some(still);
            }
        };
        let times = perceive::from_key_frame(log, &range);
        let read = LogReader::new().read(log, |index, topic| own(index, &topic.name), times, sink);
        read.map_err(|error| error.to_string())?;
        if let Some(still) = found {
            let decoded = still.and_then(|still| picture::decode(&still));
            return decoded.map_err(|error| error.to_string());
        }
    }
    Err("its logs hold no picture of that time".to_owned())
}
