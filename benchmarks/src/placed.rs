//! Where every frame was placed on the map, and how each line that it saw lies beside the map before
//! and after registration: what `benchmarks/plots` draws and counts.

use std::collections::BTreeMap;
use std::error::Error;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use tilefold_engine::logs::Catalogue;
use tilefold_engine::run::read_elements;
use tilefold_engine::{Meter, Silent};
use tilefold_schemas::VehicleKey;
use tilefold_store::Store;
use tilefold_tiler::chunk::{self, Chunk};
use tilefold_tiler::geodesy::LocalFrame;
use tilefold_tiler::map_index::MapIndex;
use tilefold_workers::cuts::Against;
use tilefold_workers::frames::FrameTree;
use tilefold_workers::local_map::LocalMap;
use tilefold_workers::pose::Trajectory;
use tilefold_workers::testify::Frame;
use tilefold_workers::{MapContext, Registering, map_chunk_traced};

const FRAMES_HEADER: &str = "vehicle,stamp_ns,longitude_deg,latitude_deg,yaw_rad,sigma_east_m,sigma_north_m,sigma_yaw_rad,offset_m,offset_sigma_m,confidence\n";
const LINES_HEADER: &str = "vehicle,stamp_ns,detection,lateral_m,element_id,residual_m,is_ambiguous,nearest_before_m,nearest_after_m\n";

/// The two tables.
#[derive(Default)]
struct Tables {
    frames: String,
    lines: String,
    /// What poses were made without, in how many chunks.
    fallbacks: BTreeMap<&'static str, u64>,
}

/// Maps all `logs` against the latest version of `store` and writes the tables into `out`.
pub(crate) fn write(store: &Path, logs: &[PathBuf], out: &Path) -> Result<(), Box<dyn Error>> {
    let snapshot = Store::open(store.to_path_buf())?.snapshot(None)?;
    let properties = snapshot.store().properties();
    let tile_level = u32::from(properties.tile_level);
    let context = MapContext {
        map: MapIndex::new(read_elements(&snapshot, tile_level)?),
        tile_level,
        registering: Registering::On,
    };
    let meter = Meter::default();
    let catalogue = Catalogue::open(logs, &meter, &Silent);
    let mut tables = Tables {
        frames: FRAMES_HEADER.to_owned(),
        lines: LINES_HEADER.to_owned(),
        ..Tables::default()
    };
    for unit in catalogue.units() {
        let read = unit.read(&catalogue, &meter);
        let vehicle = VehicleKey::new(&properties.salt, &unit.vehicle);
        for (topic, recording) in &read.channels {
            let own = |window: &i64| (unit.windows.0..unit.windows.1).contains(window);
            for window in chunk::windows(recording).into_iter().filter(own) {
                if let Some(chunk) = chunk::cut(recording, vehicle, topic, window) {
                    tables.add(&chunk, &unit.vehicle, &context)?;
                }
            }
        }
    }
    for (why, chunks) in &tables.fallbacks {
        eprintln!("{chunks} chunks: {why}");
    }
    fs::create_dir_all(out)?;
    fs::write(out.join("frames.csv"), tables.frames)?;
    fs::write(out.join("lines.csv"), tables.lines)?;
    Ok(())
}

impl Tables {
    /// Adds the frames of a chunk; none if it has no trajectory.
    fn add(
        &mut self,
        chunk: &Chunk,
        vehicle: &str,
        context: &MapContext,
    ) -> Result<(), Box<dyn Error>> {
        let tree = FrameTree::new(&chunk.recording.static_transforms);
        let Ok(local) = Trajectory::anchor(&chunk.recording) else {
            return Ok(());
        };
        let Ok(trajectory) = Trajectory::estimate(&chunk.recording, &local, &tree) else {
            return Ok(());
        };
        for why in trajectory.sources.fallbacks() {
            *self.fallbacks.entry(why).or_default() += 1;
        }
        let mut result = Ok(());
        let placed = map_chunk_traced(chunk, context, |frame, map| {
            let row = self.frame(vehicle, frame, &local, &trajectory);
            let lines = self.lines(vehicle, frame, map);
            result = result.and(row).and(lines);
        });
        placed.map(|_| ())?;
        Ok(result?)
    }

    fn frame(
        &mut self,
        vehicle: &str,
        frame: &Frame<'_>,
        local: &LocalFrame,
        trajectory: &Trajectory,
    ) -> std::fmt::Result {
        let pose = &frame.look.pose;
        let [longitude_deg, latitude_deg, _] = local.to_wgs84([pose.east_m, pose.north_m, 0.0]);
        // Of the time by the detections' clock: near enough for a standard deviation.
        let covariance = trajectory.covariance(pose.stamp_ns).unwrap_or_default();
        let [east, north, yaw] = [0, 1, 2].map(|axis| covariance[axis][axis].sqrt());
        let registration = frame.registration;
        writeln!(
            self.frames,
            "{vehicle},{},{longitude_deg:.9},{latitude_deg:.9},{:.5},{east:.3},{north:.3},{yaw:.5},{:.3},{:.3},{:.4}",
            pose.stamp_ns,
            pose.yaw_rad,
            registration.offset_m,
            registration.sigma_m,
            registration.confidence,
        )
    }

    fn lines(&mut self, vehicle: &str, frame: &Frame<'_>, map: &LocalMap<'_>) -> std::fmt::Result {
        for (index, seen) in frame.cross_cut.seen.iter().enumerate() {
            let nearest_m = |offset_m: f64| {
                let mapped = frame.cross_cut.mapped.iter();
                let distances = mapped.filter_map(|mapped| Against::new(seen, mapped));
                distances
                    .map(|against| against.offset_m + offset_m)
                    .min_by(|a, b| a.abs().total_cmp(&b.abs()))
                    .map_or_else(String::new, |nearest| format!("{nearest:.3}"))
            };
            let mut pairs = frame.matches.pairs.iter();
            let pair = pairs.find(|pair| pair.seen == index && pair.is_main);
            let matched = pair.map_or_else(
                || ",,".to_owned(),
                |pair| {
                    let line = frame.cross_cut.mapped[pair.mapped].line;
                    let element = map.lines[line].mapped.element.id;
                    format!("{element},{:.3},{}", pair.residual_m, pair.is_ambiguous)
                },
            );
            writeln!(
                self.lines,
                "{vehicle},{},{},{:.3},{matched},{},{}",
                frame.look.pose.stamp_ns,
                frame.look.lines[seen.line].detection,
                seen.lateral_m(),
                nearest_m(0.0),
                nearest_m(frame.registration.offset_m),
            )?;
        }
        Ok(())
    }
}
