//! How far the lines of a log in pixels lie from a map's lane markings: with the mounting that the
//! log states or another one, by position alone, registered, and with the mounting refined.
//!
//! `cargo run -p tilefold-benchmarks --example mounting -- LOG MAP [ROLL PITCH YAW HEIGHT [CSV]]`:
//! radians about the vehicle's axes (pitch positive downwards) and metres above the road. CSV is
//! where the points go, in the plane of the first chunk.

use std::error::Error;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

use nalgebra::{Matrix3, UnitQuaternion};
use tilefold_formats::log::{LogIndex, LogReader};
use tilefold_schemas::ElementKind;
use tilefold_schemas::id::VehicleKey;
use tilefold_schemas::log::{Detection, DetectionSpace};
use tilefold_tiler::chunk::{self, Chunk};
use tilefold_tiler::geodesy::LocalFrame;
use tilefold_tiler::map_index::{MapIndex, MappedElement};
use tilefold_tiler::recording::Recording;
use tilefold_tiler::station::Polyline;
use tilefold_workers::frames::FrameTree;
use tilefold_workers::look::{Look, SeenFrames, place};
use tilefold_workers::pose::{Pose, Trajectory};
use tilefold_workers::{MapContext, map_chunk_traced};

const TILE_LEVEL: u32 = 15;
/// What was done to points.
const STATED: &str = "as stated";
const REGISTERED: &str = "registered and scaled to the side";
const REFINED: &str = "registered with the mounting refined";

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [log, map, rest @ ..] = arguments.as_slice() else {
        return Err("which log and which map?".into());
    };
    let mut recording = read(Path::new(log))?;
    if let [roll, pitch, yaw, height, ..] = rest {
        let angles = [roll, pitch, yaw].map(|text| text.parse::<f64>());
        let [roll, pitch, yaw] = angles;
        mount(&mut recording, [roll?, pitch?, yaw?], height.parse()?);
    }
    let elements = tilefold_formats::map::read(Path::new(map))?.elements;
    let mapped = elements
        .into_iter()
        .map(|element| MappedElement::new(element, TILE_LEVEL));
    let context = MapContext {
        map: MapIndex::new(mapped.collect::<Result<_, _>>()?),
        tile_level: TILE_LEVEL,
        registering: tilefold_workers::Registering::On,
    };
    let mut drive = Measured::new(&context, &recording)?;
    for window in chunk::windows(&recording) {
        let cut = chunk::cut(&recording, VehicleKey(1), "/lanes", window);
        drive.add(&cut.ok_or("a window without frames")?)?;
    }
    drive.show();
    match rest.get(4) {
        Some(csv) => drive.write(Path::new(csv)),
        None => Ok(()),
    }
}

fn read(log: &Path) -> Result<Recording, Box<dyn Error>> {
    let index = LogIndex::open(log)?;
    let mut recording = Recording::default();
    let mut sink = |message| recording.push(message);
    LogReader::new().read(&index, |_, _| true, i64::MIN..i64::MAX, &mut sink)?;
    recording.settle();
    Ok(recording)
}

/// States another mounting: the place ahead and to the left stays.
fn mount(recording: &mut Recording, [roll, pitch, yaw]: [f64; 3], height_m: f64) {
    // Optical z is the vehicle's x, optical x its right.
    let axes = Matrix3::new(0.0, 0.0, 1.0, -1.0, 0.0, 0.0, 0.0, -1.0, 0.0);
    let ahead = UnitQuaternion::from_matrix(&axes);
    let turned = UnitQuaternion::from_euler_angles(roll, pitch, yaw) * ahead;
    for transform in recording
        .static_transforms
        .iter_mut()
        .flat_map(|entry| &mut entry.value)
    {
        transform.translation_m[2] = height_m;
        transform.rotation = turned.coords.into();
    }
}

/// A chunk whose lines are in metres, by its stated mounting: what cannot be refined.
fn in_metres(chunk: &Chunk) -> Chunk {
    let mut metres = chunk.clone();
    let tree = FrameTree::new(&chunk.recording.static_transforms);
    let seen = SeenFrames::collect(&chunk.recording, &tree);
    for (entry, frame) in metres.recording.detections.iter_mut().zip(&seen.frames) {
        let markings = std::mem::take(&mut entry.value.detections);
        let laid = frame.lines.iter().filter_map(|line| {
            let points = line.points_m.iter().map(|&[x, y]| [x, y, 0.0]).collect();
            let marking = markings.get(line.detection)?.clone();
            Some(Detection { points, ..marking })
        });
        entry.value.detections = laid.collect();
        entry.value.space = DetectionSpace::Metres;
        entry.frame_id.clear();
    }
    metres
}

/// Points of the drive and their distances from the map.
struct Measured<'a> {
    context: &'a MapContext,
    frame: LocalFrame,
    lines: Vec<Polyline>,
    /// What was done to them, where they are, and how far from the map.
    points: Vec<(&'static str, [f64; 2], f64)>,
}

impl<'a> Measured<'a> {
    fn new(context: &'a MapContext, recording: &Recording) -> Result<Self, Box<dyn Error>> {
        let frame = Trajectory::anchor(recording)?;
        let elements = context.map.elements().iter();
        let markings = elements.filter(|mapped| mapped.element.kind == ElementKind::LaneMarking);
        let lines = markings.map(|mapped| {
            let points = mapped.element.points.iter();
            Polyline::new(points.map(|&[lon, lat, _]| frame.to_enu([lon, lat, 0.0])))
        });
        Ok(Self {
            context,
            frame,
            lines: lines.collect::<Result<_, _>>()?,
            points: Vec::new(),
        })
    }

    fn add(&mut self, chunk: &Chunk) -> Result<(), Box<dyn Error>> {
        let (from_ns, to_ns) = chunk.bounds_ns();
        let own = Trajectory::anchor(&chunk.recording)?;
        let tree = FrameTree::new(&chunk.recording.static_transforms);
        let trajectory = Trajectory::estimate(&chunk.recording, &own, &tree)?;
        let seen = SeenFrames::collect(&chunk.recording, &tree);
        let (looks, _) = place(seen.frames, &trajectory, 0);
        let is_own = |look: &&Look| (from_ns..to_ns).contains(&look.pose.stamp_ns);
        for look in looks.iter().filter(is_own) {
            self.add_look(STATED, look, &own, 0.0);
        }
        let metres = in_metres(chunk);
        for (how, chunk) in [(REGISTERED, &metres), (REFINED, chunk)] {
            let evidence = map_chunk_traced(chunk, self.context, |frame, _| {
                self.add_look(how, frame.look, &own, frame.registration.offset_m);
            })?;
            if let Some(mounting) = evidence.mounting {
                println!("window {}: {mounting:.5?}", chunk.id.window);
            }
        }
        Ok(())
    }

    fn add_look(&mut self, how: &'static str, look: &Look, own: &LocalFrame, offset_m: f64) {
        for &[x, y] in look.lines.iter().flat_map(|line| &line.points_m) {
            let pose: &Pose = &look.pose;
            let [east_m, north_m] = pose.local_from_vehicle([x, y + offset_m]);
            let degrees = own.to_wgs84([east_m, north_m, 0.0]);
            let [east_m, north_m, _] = self.frame.to_enu([degrees[0], degrees[1], 0.0]);
            let place = [east_m, north_m];
            let distances = self.lines.iter().map(|line| line.project(place).distance_m);
            let distance_m = distances.fold(f64::INFINITY, f64::min);
            self.points.push((how, place, distance_m));
        }
    }

    fn show(&self) {
        for how in [STATED, REGISTERED, REFINED] {
            let of = self.points.iter().filter(|(other, _, _)| *other == how);
            let mut distances: Vec<f64> = of.map(|(_, _, distance_m)| *distance_m).collect();
            distances.sort_by(f64::total_cmp);
            let quantile = |share: f64| distances[(share * (distances.len() - 1) as f64) as usize];
            println!(
                "{how}: {} points, quartiles {:.3} {:.3} {:.3} m, 90 % {:.3} m",
                distances.len(),
                quantile(0.25),
                quantile(0.5),
                quantile(0.75),
                quantile(0.9)
            );
        }
    }

    fn write(&self, csv: &Path) -> Result<(), Box<dyn Error>> {
        let mut out = BufWriter::new(File::create(csv)?);
        for (how, [east_m, north_m], distance_m) in &self.points {
            writeln!(out, "{how};{east_m:.3};{north_m:.3};{distance_m:.3}")?;
        }
        for line in &self.lines {
            for [east_m, north_m, _] in line.points() {
                writeln!(out, "map;{east_m:.3};{north_m:.3};0")?;
            }
            writeln!(out, "end;0;0;0")?;
        }
        Ok(out.flush()?)
    }
}
