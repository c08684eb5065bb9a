//! The legs of the map stage, one by one, on one thread: how many messages or frames a second.
//!
//! `cargo bench -p tilefold-benchmarks [-- FILTER]`. Each leg gets what the leg before it makes, as
//! the map stage does, for the first chunk of a simulated drive and, where real data lies beside the
//! checkout, of a recorded one. Items are messages for `index` and `read`, and frames (context
//! included) for all others.

use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use divan::Bencher;
use divan::counter::ItemsCount;
use tilefold_city::{CitySpec, Site};
use tilefold_formats::log::{LogIndex, LogReader};
use tilefold_schemas::id::VehicleKey;
use tilefold_tiler::chunk::{self, Chunk};
use tilefold_tiler::geodesy::LocalFrame;
use tilefold_tiler::map_index::{MapIndex, MappedElement};
use tilefold_tiler::recording::Recording;
use tilefold_workers::cuts::CrossCut;
use tilefold_workers::frames::FrameTree;
use tilefold_workers::local_map::{LocalMap, Near};
use tilefold_workers::look::{Look, SeenFrames, place};
use tilefold_workers::matching::match_lines;
use tilefold_workers::pose::Trajectory;
use tilefold_workers::profile::{Profile, seen_profiles};
use tilefold_workers::register::{Glance, register};
use tilefold_workers::{MapContext, Registering, clock, map_chunk};

const TILE_LEVEL: u32 = 15;
/// How far around the trajectory the map is looked at, as the map stage does, in metres.
const MAP_REACH_M: f64 = 60.0;
/// Where drives come from.
const SOURCES: [&str; 2] = ["simulated", "recorded"];

fn main() {
    divan::main();
}

/// A drive, and the first of its chunks that has frames.
struct Drive {
    log: PathBuf,
    context: MapContext,
    chunk: Chunk,
}

impl Drive {
    fn new(map: &Path, log: PathBuf) -> Self {
        let elements = tilefold_formats::map::read(map).expect("a map").elements;
        let mapped = elements
            .into_iter()
            .map(|element| MappedElement::new(element, TILE_LEVEL).expect("an element on a tile"));
        let recording = read(&log);
        let windows = chunk::windows(&recording);
        let window = windows[windows.len() / 2];
        Self {
            context: MapContext {
                map: MapIndex::new(mapped.collect()),
                tile_level: TILE_LEVEL,
                registering: Registering::On,
            },
            chunk: chunk::cut(&recording, VehicleKey(1), "/lanes", window).expect("a chunk"),
            log,
        }
    }

    fn simulated() -> Self {
        let folder = std::env::temp_dir().join("tilefold-legs");
        let spec = CitySpec {
            site: Site::Drawn { km: 3.0 },
            vehicles: 1,
            drives: 1,
            drive_km: 2.0,
            ..CitySpec::default()
        };
        let files = tilefold_city::write(&spec, &folder).expect("a city");
        Self::new(&files.before_map, files.logs[0].clone())
    }

    fn recorded() -> Option<Self> {
        let beside = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data");
        let data = std::env::var_os("TILEFOLD_TEST_DATA").map_or(beside, PathBuf::from);
        let folder = data.join("deecamp");
        let log = folder.join("logs/trip_000.mcap");
        log.is_file()
            .then(|| Self::new(&folder.join("before.osm"), log))
    }

    fn named(source: &str) -> Option<&'static Self> {
        static SIMULATED: LazyLock<Drive> = LazyLock::new(Drive::simulated);
        static RECORDED: LazyLock<Option<Drive>> = LazyLock::new(Drive::recorded);
        match source {
            "simulated" => Some(&SIMULATED),
            _ => RECORDED.as_ref(),
        }
    }
}

fn read(log: &Path) -> Recording {
    let index = LogIndex::open(log).expect("a log");
    let mut recording = Recording::default();
    let mut sink = |message| recording.push(message);
    LogReader::new()
        .read(&index, |_, _| true, i64::MIN..i64::MAX, &mut sink)
        .expect("a readable log");
    recording.settle();
    recording
}

/// A chunk up to where its frames stand beside the map.
struct Placed<'a> {
    local: LocalFrame,
    tree: FrameTree,
    trajectory: Trajectory,
    map: LocalMap<'a>,
    looks: Vec<Look>,
}

impl<'a> Placed<'a> {
    fn new(drive: &'a Drive) -> Self {
        let recording = &drive.chunk.recording;
        let tree = FrameTree::new(&recording.static_transforms);
        let local = Trajectory::anchor(recording).expect("a fix");
        let trajectory = Trajectory::estimate(recording, &local, &tree).expect("a trajectory");
        let map = LocalMap::around(&drive.context.map, &local, trajectory.places(), MAP_REACH_M);
        let frames = SeenFrames::collect(recording, &tree).frames;
        let lag_ns = clock::estimate(&frames, &trajectory, &map).lag_ns;
        let (looks, _) = place(frames, &trajectory, lag_ns);
        Self {
            local,
            tree,
            trajectory,
            map,
            looks,
        }
    }

    fn cuts(&self) -> Vec<CrossCut> {
        let mut near = Near::default();
        let cut = |look| CrossCut::new(look, &self.map, &mut near);
        self.looks.iter().map(cut).collect()
    }
}

/// Runs a leg on every source that is there; `leg` gets the bencher with the number of frames.
fn on(bencher: Bencher<'_, '_>, source: &str, leg: impl FnOnce(Bencher<'_, '_>, &'static Drive)) {
    match Drive::named(source) {
        Some(drive) => leg(bencher, drive),
        None => eprintln!("no recorded drive: set TILEFOLD_TEST_DATA to the folder of real data"),
    }
}

fn frames(drive: &Drive) -> ItemsCount {
    ItemsCount::new(drive.chunk.recording.detections.len())
}

#[divan::bench(args = SOURCES)]
fn a_index(bencher: Bencher<'_, '_>, source: &str) {
    on(bencher, source, |bencher, drive| {
        let messages = LogIndex::open(&drive.log).expect("a log").message_count();
        bencher
            .counter(ItemsCount::new(messages))
            .bench(|| LogIndex::open(&drive.log));
    });
}

#[divan::bench(args = SOURCES)]
fn b_read(bencher: Bencher<'_, '_>, source: &str) {
    on(bencher, source, |bencher, drive| {
        let messages = LogIndex::open(&drive.log).expect("a log").message_count();
        bencher
            .counter(ItemsCount::new(messages))
            .bench(|| read(&drive.log));
    });
}

#[divan::bench(args = SOURCES)]
fn c_pose(bencher: Bencher<'_, '_>, source: &str) {
    on(bencher, source, |bencher, drive| {
        let placed = Placed::new(drive);
        let recording = &drive.chunk.recording;
        bencher
            .counter(frames(drive))
            .bench(|| Trajectory::estimate(recording, &placed.local, &placed.tree));
    });
}

#[divan::bench(args = SOURCES)]
fn d_clock(bencher: Bencher<'_, '_>, source: &str) {
    on(bencher, source, |bencher, drive| {
        let placed = Placed::new(drive);
        let seen = SeenFrames::collect(&drive.chunk.recording, &placed.tree).frames;
        bencher
            .counter(frames(drive))
            .bench(|| clock::estimate(&seen, &placed.trajectory, &placed.map));
    });
}

#[divan::bench(args = SOURCES)]
fn e_project(bencher: Bencher<'_, '_>, source: &str) {
    on(bencher, source, |bencher, drive| {
        let placed = Placed::new(drive);
        bencher.counter(frames(drive)).bench(|| placed.cuts());
    });
}

#[divan::bench(args = SOURCES)]
fn f_register(bencher: Bencher<'_, '_>, source: &str) {
    on(bencher, source, |bencher, drive| {
        let placed = Placed::new(drive);
        let cuts = placed.cuts();
        bencher.counter(frames(drive)).bench(|| {
            let profiles: Vec<[Vec<Profile>; 2]> = (placed.looks.iter().zip(&cuts))
                .map(|(look, cut)| {
                    [
                        seen_profiles(&cut.seen, &look.lines),
                        placed.map.profiles(&cut.mapped),
                    ]
                })
                .collect();
            let glances: Vec<Glance<'_>> = (placed.looks.iter().zip(&profiles))
                .map(|(look, [seen, mapped])| Glance {
                    stamp_ns: look.pose.stamp_ns,
                    place_m: [look.pose.east_m, look.pose.north_m],
                    seen,
                    mapped,
                })
                .collect();
            register(&glances)
        });
    });
}

#[divan::bench(args = SOURCES)]
fn g_match(bencher: Bencher<'_, '_>, source: &str) {
    on(bencher, source, |bencher, drive| {
        let placed = Placed::new(drive);
        let cuts = placed.cuts();
        bencher.counter(frames(drive)).bench(|| {
            for cut in &cuts {
                divan::black_box(match_lines(cut, 0.0, 0.0));
            }
        });
    });
}

#[divan::bench(args = SOURCES)]
fn h_whole_chunk(bencher: Bencher<'_, '_>, source: &str) {
    on(bencher, source, |bencher, drive| {
        bencher
            .counter(frames(drive))
            .bench(|| map_chunk(&drive.chunk, &drive.context));
    });
}
