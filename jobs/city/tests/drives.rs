//! A city's drives, read back: who drove, what was measured, and how well it fits the road.

#![allow(clippy::unwrap_used, clippy::panic)] // In a test, a panic is the report.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use tilefold_city::{CitySpec, LogProfile, Site, write};
use tilefold_formats::log::{ALL_TIME, LogIndex, LogReader, TopicKind};
use tilefold_schemas::element::ElementKind;
use tilefold_schemas::log::{DetectionSpace, LogMessage, Payload};

fn read(path: &Path) -> (LogIndex, Vec<LogMessage>) {
    let index = LogIndex::open(path).unwrap();
    let mut messages = Vec::new();
    let report = LogReader::new()
        .read(
            &index,
            |_, _| true,
            ALL_TIME,
            |message| messages.push(message),
        )
        .unwrap();
    assert_eq!(report.ignored, 0, "{report:?}");
    (index, messages)
}

fn spec() -> CitySpec {
    CitySpec {
        site: Site::Drawn { km: 2.0 },
        drive_km: 1.0,
        vehicles: 3,
        drives: 4,
        ..CitySpec::default()
    }
}

#[test]
fn logs_name_their_vehicle_and_do_not_overlap() {
    let folder = tempfile::tempdir().unwrap();
    let files = write(&spec(), folder.path()).unwrap();
    let mut vehicles = BTreeSet::new();
    let mut last_end_ns = BTreeMap::new();
    for path in &files.logs {
        let (index, messages) = read(path);
        let vehicle = index
            .metadata
            .iter()
            .find(|record| record.name == "vehicle");
        let vehicle = vehicle.unwrap().entries["vehicle_id"].clone();
        vehicles.insert(vehicle.clone());
        for kind in [
            TopicKind::Gnss,
            TopicKind::Detections(DetectionSpace::Metres),
        ] {
            assert_eq!(index.topics_of(kind).count(), 1);
        }
        let stamps = messages.iter().map(|message| message.stamp_ns);
        let (first, last) = (stamps.clone().min().unwrap(), stamps.max().unwrap());
        let before_ns = last_end_ns.insert(vehicle, last).unwrap_or(0);
        assert!(
            first > before_ns,
            "{path:?} begins before the vehicle's last drive ends"
        );
        assert!(messages.is_sorted_by_key(|message| message.log_time_ns));
        assert!(
            messages
                .iter()
                .all(|message| message.log_time_ns > message.stamp_ns)
        );
    }
    assert_eq!(vehicles.len(), 3);
}

#[test]
fn detections_lie_before_the_vehicle_and_some_frames_are_empty() {
    let folder = tempfile::tempdir().unwrap();
    let files = write(&spec(), folder.path()).unwrap();
    let (mut frames, mut empty, mut lines) = (0, 0, 0);
    for path in &files.logs {
        for message in read(path).1 {
            let Payload::Detections(frame) = message.payload else {
                continue;
            };
            assert_eq!(message.frame_id, "base_link");
            frames += 1;
            empty += usize::from(frame.detections.is_empty());
            lines += frame.detections.len();
            for detection in &frame.detections {
                let least = match detection.kind {
                    ElementKind::LaneMarking => 3,
                    ElementKind::StopLine => 2,
                    ElementKind::Crosswalk | ElementKind::GroundSign => 4,
                };
                assert!(detection.points.len() >= least);
                assert!((0.0..=1.0).contains(&detection.score));
                for [x_m, y_m, _] in &detection.points {
                    assert!(
                        (2.0..=45.0).contains(x_m) && y_m.abs() < 15.0,
                        "{x_m}, {y_m}"
                    );
                }
            }
        }
    }
    assert!(frames > 4 * 500, "{frames} frames");
    // Junctions have no paint.
    assert!(
        (frames / 50..frames / 2).contains(&empty),
        "{empty} of {frames} empty"
    );
    let per_frame = f64::from(lines as u32) / f64::from((frames - empty) as u32);
    assert!((2.0..7.0).contains(&per_frame), "{per_frame} lines a frame");
}

#[test]
fn camera_logs_hold_pictures_calibration_mounting_and_truth() {
    let folder = tempfile::tempdir().unwrap();
    let spec = CitySpec {
        profile: LogProfile::Camera,
        drives: 1,
        drive_km: 0.2,
        ..spec()
    };
    let files = write(&spec, folder.path()).unwrap();
    let (index, messages) = read(&files.logs[0]);
    assert_eq!(index.topics_of(TopicKind::Gnss).count(), 1);
    let (mut pictures, mut calibrations, mut mountings) = (Vec::new(), 0, 0);
    for message in &messages {
        match &message.payload {
            Payload::Image(image) => {
                assert_eq!(image.format, "jpeg");
                assert!(image.data.starts_with(&[0xff, 0xd8]), "no JPEG");
                pictures.push(message.stamp_ns);
            }
            Payload::Calibration(calibration) => {
                assert_eq!((calibration.width_px, calibration.height_px), (640, 360));
                calibrations += 1;
            }
            Payload::Transforms { transforms, .. } => {
                assert_eq!(transforms[0].parent_frame, "base_link");
                assert_eq!(transforms[0].child_frame, "camera_optical_frame");
                mountings += 1;
            }
            _ => {}
        }
    }
    assert!(pictures.len() > 50, "{} pictures", pictures.len());
    assert!(calibrations >= pictures.len() / 5 && mountings == 1);
    let truth = std::fs::read_to_string(files.logs[0].with_extension("frames.jsonl")).unwrap();
    let stamps: Vec<i64> = truth
        .lines()
        .map(|line| {
            let frame: serde_json::Value = serde_json::from_str(line).unwrap();
            frame["time_ns"].as_i64().unwrap()
        })
        .collect();
    assert_eq!(stamps, pictures);
    assert!(truth.contains("\"lane_marking\""));
}
