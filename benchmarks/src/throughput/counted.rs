//! What a job takes from the allocator, and what each leg of the map stage costs: measured inside a
//! process of this program, because the command line counts no allocations and the map stage knows
//! no clock.

use std::error::Error;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use stats_alloc::{Region, Stats};
use tilefold_engine::logs::Catalogue;
use tilefold_engine::run::read_elements;
use tilefold_engine::{FusionModel, Meter, Silent, run};
use tilefold_schemas::VehicleKey;
use tilefold_store::Store;
use tilefold_tiler::chunk::{self, Chunk};
use tilefold_tiler::map_index::MapIndex;
use tilefold_workers::clock;
use tilefold_workers::cuts::CrossCut;
use tilefold_workers::frames::FrameTree;
use tilefold_workers::local_map::{LocalMap, Near};
use tilefold_workers::look::{SeenFrames, place};
use tilefold_workers::matching::match_lines;
use tilefold_workers::pose::{PoseError, Trajectory};
use tilefold_workers::profile::{Profile, seen_profiles};
use tilefold_workers::register::{Glance, register};
use tilefold_workers::{MapContext, Registering, map_chunk};

use crate::ALLOCATOR;
use crate::processor::Moment;

/// How far around the trajectory the map is looked at, as the map stage does, in metres.
const MAP_REACH_M: f64 = 60.0;

/// What some work cost.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct Cost {
    /// The work.
    pub(crate) name: String,
    /// Frames that it was done on, context included.
    pub(crate) frames: u64,
    /// Seconds of processor time on one thread.
    pub(crate) seconds: f64,
    /// Calls of the allocator, growing ones included.
    pub(crate) allocations: u64,
    /// Bytes that were asked for, one after the other.
    pub(crate) bytes: u64,
}

/// The costs of a job as a whole, and of the legs of its map stage.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct Costs {
    /// The whole job.
    pub(crate) job: Cost,
    /// The legs, in their order; `map_chunk` is all of them and what lies between.
    pub(crate) legs: Vec<Cost>,
    /// How many chunks the legs were measured on.
    pub(crate) chunks: usize,
}

/// Runs the job on a store without evidence, then the legs one by one on some of its chunks.
pub(crate) fn costs(store: &Path, logs: &[PathBuf]) -> Result<Costs, Box<dyn Error>> {
    let snapshot = Store::open(store.to_path_buf())?.snapshot(None)?;
    let tile_level = u32::from(snapshot.store().properties().tile_level);
    let context = MapContext {
        map: MapIndex::new(read_elements(&snapshot, tile_level)?),
        tile_level,
        registering: Registering::On,
    };
    let mut meter = Legs::default();
    for chunk in sample(logs) {
        meter.add(&chunk, &context)?;
    }
    let mut job = Cost::new("job");
    let report = job.during(|| run(store, logs, FusionModel::Calibrated, &Silent))?;
    let map = report.stages.iter().find(|stage| stage.stage == "map");
    job.frames = map.map_or(0, |stage| stage.items);
    Ok(Costs {
        job,
        chunks: meter.chunks,
        legs: meter.costs,
    })
}

/// Chunks of units spread over the logs, one of each.
fn sample(logs: &[PathBuf]) -> Vec<Chunk> {
    const UNITS: usize = 40;
    let meter = Meter::default();
    let catalogue = Catalogue::open(logs, &meter, &Silent);
    let units = catalogue.units();
    let step = units.len().div_ceil(UNITS).max(1);
    let chunk = |unit: &tilefold_engine::logs::Unit| {
        let read = unit.read(&catalogue, &meter);
        let (topic, recording) = read.channels.into_iter().next()?;
        let windows = chunk::windows(&recording);
        let middle = *windows.get(windows.len() / 2)?;
        chunk::cut(&recording, VehicleKey(1), &topic, middle)
    };
    units.iter().step_by(step).filter_map(chunk).collect()
}

impl Cost {
    fn new(name: &str) -> Self {
        Self {
            name: name.to_owned(),
            frames: 0,
            seconds: 0.0,
            allocations: 0,
            bytes: 0,
        }
    }

    fn during<T>(&mut self, work: impl FnOnce() -> T) -> T {
        let region = Region::new(ALLOCATOR);
        let started = Moment::now();
        let result = work();
        self.seconds += started.elapsed_s();
        let Stats {
            allocations,
            reallocations,
            bytes_allocated,
            ..
        } = region.change();
        self.allocations += (allocations + reallocations) as u64;
        self.bytes += bytes_allocated as u64;
        result
    }
}

/// The legs of the map stage so far.
#[derive(Default)]
struct Legs {
    costs: Vec<Cost>,
    chunks: usize,
}

impl Legs {
    fn during<T>(&mut self, name: &str, frames: u64, work: impl FnOnce() -> T) -> T {
        if !self.costs.iter().any(|cost| cost.name == name) {
            self.costs.push(Cost::new(name));
        }
        let cost = self.costs.iter_mut().find(|cost| cost.name == name);
        match cost {
            Some(cost) => {
                cost.frames += frames;
                cost.during(work)
            }
            None => work(),
        }
    }

    /// Each leg gets what the leg before it makes, as in the map stage.
    fn add(&mut self, chunk: &Chunk, context: &MapContext) -> Result<(), PoseError> {
        let recording = &chunk.recording;
        let frames = recording.detections.len() as u64;
        self.chunks += 1;
        let tree = FrameTree::new(&recording.static_transforms);
        let local = Trajectory::anchor(recording)?;
        let estimate = || Trajectory::estimate(recording, &local, &tree);
        let trajectory = self.during("pose", frames, estimate)?;
        let around = || LocalMap::around(&context.map, &local, trajectory.places(), MAP_REACH_M);
        let map = self.during("local map", frames, around);
        let seen = SeenFrames::collect(recording, &tree).frames;
        let lag_ns = self.during("clock", frames, || {
            clock::estimate(&seen, &trajectory, &map).lag_ns
        });
        let (looks, _) = place(seen, &trajectory, lag_ns);
        let mut near = Near::default();
        let cuts: Vec<CrossCut> = self.during("project", frames, || {
            let cut = |look| CrossCut::new(look, &map, &mut near);
            looks.iter().map(cut).collect()
        });
        self.during("register", frames, || {
            let profiles: Vec<[Vec<Profile>; 2]> = (looks.iter().zip(&cuts))
                .map(|(look, cut)| {
                    [
                        seen_profiles(&cut.seen, &look.lines),
                        map.profiles(&cut.mapped),
                    ]
                })
                .collect();
            let glances: Vec<Glance<'_>> = (looks.iter().zip(&profiles))
                .map(|(look, [seen, mapped])| Glance {
                    stamp_ns: look.pose.stamp_ns,
                    place_m: [look.pose.east_m, look.pose.north_m],
                    seen,
                    mapped,
                })
                .collect();
            register(&glances)
        });
        self.during("match", frames, || {
            for cut in &cuts {
                std::hint::black_box(match_lines(cut, 0.0, 0.0));
            }
        });
        self.during("map_chunk", frames, || map_chunk(chunk, context))?;
        Ok(())
    }
}
