//! From pictures to a version: the same bytes by any number of threads, every picture seen once, and
//! a sentence for everything that is wrong.
//!
//! ONNX Runtime must be there (`cargo xtask setup`). The network is one convolution that tells red
//! from grey, and the pictures are a simulated drive's detections, painted red.

#![allow(clippy::unwrap_used)] // What fails to be made ends its test.

use std::path::{Path, PathBuf};

use tempfile::TempDir;
use tilefold_city::{CitySpec, Site, write};
use tilefold_engine::explain::Frame;
use tilefold_engine::frames::{self, Outputs, Sources};
use tilefold_engine::{
    Device, InitOptions, Perception, RunOptions, RunReport, Silent, init, run, run_seeing,
};
use tilefold_formats::picture::decode;
use tilefold_schemas::log::{CameraFrame, EncodedImage};
use tilefold_schemas::{ChunkRow, EvidenceRow};
use tilefold_store::{Store, TileFilter};
use tilefold_tests::pictures::{Flaw, paint};

const SECONDS: i64 = 45;

fn card() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("data/red_mask/red_mask.toml")
}

fn perception(card: &Path) -> Perception {
    Perception::open(card, None, Device::Cpu).unwrap()
}

/// A small city and one drive through it.
struct Scene {
    folder: TempDir,
    map: PathBuf,
    drive: PathBuf,
}

impl Scene {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let spec = CitySpec {
            seed: 5,
            site: Site::Drawn { km: 1.0 },
            vehicles: 1,
            drives: 1,
            drive_km: 0.8,
            noise: "good_gnss".to_owned(),
            change_share: 0.0,
            ..CitySpec::default()
        };
        let mut files = write(&spec, folder.path()).unwrap();
        Self {
            map: files.before_map,
            drive: files.logs.remove(0),
            folder,
        }
    }

    fn log(&self, flaw: Flaw) -> PathBuf {
        let log = self.folder.path().join(format!("{flaw:?}.mcap"));
        paint(&self.drive, &log, SECONDS, flaw);
        log
    }

    fn store(&self, name: &str) -> PathBuf {
        let store = self.folder.path().join(name);
        let options = InitOptions {
            tile_level: 15,
            salt: None,
        };
        init(&store, std::slice::from_ref(&self.map), &options).unwrap();
        store
    }
}

fn see(store: &Path, log: &Path, perception: &Perception) -> RunReport {
    let logs = [log.to_owned()];
    run_seeing(
        store,
        &logs,
        RunOptions::default(),
        Some(perception),
        &Silent,
    )
    .unwrap()
}

fn rows(store: &Path) -> (Vec<ChunkRow>, Vec<EvidenceRow>) {
    let snapshot = Store::open(store.to_owned())
        .unwrap()
        .snapshot(None)
        .unwrap();
    (
        snapshot.read(TileFilter::All).unwrap(),
        snapshot.read(TileFilter::All).unwrap(),
    )
}

fn looked_at(report: &RunReport) -> u64 {
    let stage = report.stages.iter().find(|stage| stage.stage == "detect");
    stage.map_or(0, |stage| stage.items)
}

fn reasons(report: &RunReport) -> String {
    report
        .set_aside
        .iter()
        .map(|loss| format!("{loss}\n"))
        .collect()
}

/// Pixels of a PNG file that are of a colour.
fn colored(file: &Path, is_it: impl Fn([u8; 3]) -> bool) -> Vec<[i64; 2]> {
    let data = std::fs::read(file).unwrap().into();
    let frame = CameraFrame::Encoded(EncodedImage {
        format: "png".to_owned(),
        data,
    });
    let picture = decode(&frame).unwrap();
    let pixels = picture.rgb.chunks_exact(3).enumerate();
    let width = i64::from(picture.width_px);
    pixels
        .filter(|(_, pixel)| is_it([pixel[0], pixel[1], pixel[2]]))
        .map(|(at, _)| [at as i64 % width, at as i64 / width])
        .collect()
}

#[test]
fn the_map_is_drawn_on_the_paint() {
    let scene = Scene::new();
    let log = scene.log(Flaw::None);
    let red = perception(&card());
    let store = scene.store("store");
    see(&store, &log, &red);
    let (chunks, evidence) = rows(&store);
    let chunk = chunks.iter().max_by_key(|chunk| chunk.frames).unwrap();
    let clearest = evidence
        .iter()
        .max_by_key(|row| (row.best_v_q8, row.first_ms));
    let frame = Frame {
        stamp_ns: clearest.unwrap().best_ns(),
        log: Some(chunk.log.clone()),
        topic: Some(chunk.topic.clone()),
        vehicle: format!("{:016x}", chunk.vehicle),
        for_change: 0.0,
    };
    let snapshot = Store::open(store).unwrap().snapshot(None).unwrap();
    let sources = Sources {
        logs: &[],
        perception: Some(&red),
    };
    let folder = scene.folder.path().join("frames");
    let case = scene.folder.path().join("case.mcap");
    let outputs = Outputs {
        folder: Some(&folder),
        case: Some(&case),
    };
    let pictures =
        frames::write(&snapshot, std::slice::from_ref(&frame), sources, outputs).unwrap();
    assert_eq!(pictures.set_aside, []);
    let paint = colored(&pictures.written[0], |[r, g, b]| {
        r > 150 && g < 90 && b < 90
    });
    let map = colored(&pictures.written[0], |[r, g, b]| {
        b > 160 && r < 130 && g < 190
    });
    // The map goes on where nothing was painted.
    let has_map = |[x, y]: &&[i64; 2]| {
        map.iter()
            .any(|[u, v]| (x - u).abs() <= 6 && (y - v).abs() <= 3)
    };
    let beside_map = paint.iter().filter(has_map).count();
    assert!(
        paint.len() > 200 && beside_map * 10 > paint.len() * 8,
        "{beside_map} of {} pixels of paint are beside {} of the map",
        paint.len(),
        map.len()
    );

    // The case has the picture as it was, and the map as lines over it.
    let bytes = std::fs::read(&case).unwrap();
    let messages: Vec<mcap::Message<'_>> = mcap::MessageStream::new(&bytes)
        .unwrap()
        .map(Result::unwrap)
        .collect();
    let schemas = messages.iter().map(|message| {
        let schema = message.channel.schema.as_ref().unwrap();
        (message.channel.topic.as_str(), schema.name.as_str())
    });
    assert_eq!(
        schemas.collect::<Vec<_>>(),
        [
            ("/case/image", "foxglove.CompressedImage"),
            ("/case/annotations", "foxglove.ImageAnnotations"),
        ]
    );
    let has = |message: &mcap::Message<'_>, what: &[u8]| {
        message.data.windows(what.len()).any(|part| part == what)
    };
    assert!(has(&messages[0], b"\x89PNG"));
    assert!(has(&messages[1], b"map") && has(&messages[1], b"detected"));

    // Where the log is gone, the frame is set aside with a reason.
    let gone = Frame {
        log: Some("gone.mcap".to_owned()),
        ..frame
    };
    let outputs = Outputs {
        folder: Some(&folder),
        case: None,
    };
    let none = frames::write(&snapshot, &[gone], sources, outputs).unwrap();
    assert!(none.written.is_empty());
    assert!(
        none.set_aside[0].reason.contains("--logs"),
        "{:?}",
        none.set_aside
    );
}

#[test]
fn pictures_become_evidence_once_and_the_same_on_any_number_of_threads() {
    let scene = Scene::new();
    let log = scene.log(Flaw::None);
    let red = perception(&card());
    let by_threads = [1, 2].map(|threads| {
        let store = scene.store(&format!("store-{threads}"));
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        let report = pool.install(|| see(&store, &log, &red));
        (store, report)
    });
    let [(store, report), (other, _)] = &by_threads;
    let (chunks, evidence) = rows(store);
    assert_eq!((&chunks, &evidence), (&rows(other).0, &rows(other).1));
    // Each picture was looked at once, though chunks share their context.
    let pictures: i32 = chunks.iter().map(|chunk| chunk.frames).sum();
    assert!(chunks.len() >= 2 && pictures > 200, "{pictures}");
    assert_eq!(looked_at(report), pictures as u64);
    let sum = |of: &dyn Fn(&EvidenceRow) -> i32| evidence.iter().map(of).sum::<i32>();
    let (exposed, hit) = (sum(&|row| row.exposed), sum(&|row| row.hit));
    assert!(
        hit > 200 && f64::from(hit) > 0.5 * f64::from(exposed),
        "{hit} of {exposed}"
    );
    let model = red.model().digest;
    assert!(evidence.iter().all(|row| row.model == model));

    let again = see(store, &log, &red);
    assert_eq!(
        (again.is_new_version, again.chunks_mapped, looked_at(&again)),
        (false, 0, 0)
    );

    // Another network, which is this one with another threshold, sees everything anew.
    let folder = tempfile::tempdir().unwrap();
    let stricter = folder.path().join("stricter.toml");
    let text = std::fs::read_to_string(card()).unwrap();
    std::fs::write(
        &stricter,
        text.replace("channel = 1", "channel = 1\nthreshold = 0.8"),
    )
    .unwrap();
    std::fs::copy(
        card().with_extension("onnx"),
        folder.path().join("red_mask.onnx"),
    )
    .unwrap();
    let stricter = perception(&stricter);
    assert_ne!(stricter.model().digest, model);
    let report = see(store, &log, &stricter);
    assert_eq!(
        (report.chunks_mapped, looked_at(&report)),
        (chunks.len(), pictures as u64)
    );
    let (chunks, evidence) = rows(store);
    assert!(
        chunks
            .iter()
            .all(|chunk| chunk.model == stricter.model().digest)
    );
    assert!(
        evidence
            .iter()
            .all(|row| row.model == stricter.model().digest)
    );
}

#[test]
fn everything_that_is_wrong_with_a_camera_log_is_said() {
    let scene = Scene::new();
    let red = perception(&card());
    let store = scene.store("store");
    let blind = run(
        &store,
        &[scene.log(Flaw::None)],
        RunOptions::default(),
        &Silent,
    )
    .unwrap();
    assert!(
        reasons(&blind).contains("--detector CARD"),
        "{}",
        reasons(&blind)
    );
    assert_eq!(blind.chunks_mapped, 0);
    let said = |flaw: Flaw| {
        reasons(&see(
            &scene.store(&format!("{flaw:?}")),
            &scene.log(flaw),
            &red,
        ))
    };
    let uncalibrated = said(Flaw::Uncalibrated);
    assert!(
        uncalibrated.contains("no calibration; record CameraInfo"),
        "{uncalibrated}"
    );
    let other_size = said(Flaw::OtherSize);
    assert!(
        other_size.contains("pictures of 320 x 180 pixels, where the calibration is of 640 x 360"),
        "{other_size}"
    );
    let cut = said(Flaw::CutPicture);
    assert!(
        cut.contains("frame ") && cut.contains("the JPEG cannot be decoded"),
        "{cut}"
    );
    assert_eq!(cut.matches("cut off").count(), 1, "{cut}");
}

#[cfg(feature = "h264")]
#[test]
fn video_gives_the_evidence_that_pictures_give() {
    use tilefold_tests::pictures::{Coding, paint_as};

    let scene = Scene::new();
    let red = perception(&card());
    let stills = scene.store("stills");
    see(&stills, &scene.log(Flaw::None), &red);
    let video = |name: &str, flaw: Flaw| {
        let log = scene.folder.path().join(format!("{name}.mcap"));
        let coding = Coding::H264 { key_frame_each: 20 };
        paint_as(&scene.drive, &log, SECONDS, flaw, coding);
        let store = scene.store(name);
        let report = see(&store, &log, &red);
        (store, report)
    };
    let (store, report) = video("video", Flaw::None);
    assert_eq!(reasons(&report), "");
    let frames = |store: &Path| -> i32 { rows(store).0.iter().map(|chunk| chunk.frames).sum() };
    assert_eq!(frames(&store), frames(&stills));
    // Video is not as sharp as the JPEGs: a few lines less may be seen.
    let hits = |store: &Path| -> i32 { rows(store).1.iter().map(|row| row.hit).sum() };
    let (seen, of) = (hits(&store), hits(&stills));
    assert!(f64::from(seen) > 0.9 * f64::from(of), "{seen} of {of}");

    // A damaged picture takes those with it that build on it, and they are counted.
    let (_, report) = video("cut", Flaw::CutPicture);
    let said = reasons(&report);
    assert_eq!(
        said.matches("of H.264 video cannot be decoded").count(),
        11,
        "{said}"
    );
    assert_eq!(
        said.matches("key frame that it builds on").count(),
        10,
        "{said}"
    );
}
