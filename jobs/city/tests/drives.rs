//! A city's drives, read back: who drove, what was measured, and how well it fits the road.

#![allow(clippy::unwrap_used, clippy::panic)] // In a test, a panic is the report.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use tilefold_city::{CitySpec, LogProfile, Site, write};
use tilefold_formats::log::{ALL_TIME, LogIndex, LogReader, TopicKind};
use tilefold_schemas::element::ElementKind;
use tilefold_schemas::log::{CameraFrame, DetectionSpace, LogMessage, Payload};
use tilefold_tiler::geodesy::LocalFrame;

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

/// The yaw of a turn about the up axis.
fn yaw_rad([x, y, z, w]: [f64; 4]) -> f64 {
    assert_eq!([x, y], [0.0; 2]);
    2.0 * z.atan2(w)
}

/// The way along the positions of every second.
fn way_by_positions_m(messages: &[LogMessage]) -> f64 {
    let frame = LocalFrame::new(CitySpec::default().anchor);
    let positions = messages
        .iter()
        .filter_map(|message| match &message.payload {
            Payload::Gnss(fix) => Some(frame.to_enu([fix.longitude_deg, fix.latitude_deg, 0.0])),
            _ => None,
        });
    let positions: Vec<[f64; 3]> = positions.step_by(5).collect();
    let steps = positions.windows(2);
    steps
        .map(|pair| (pair[1][0] - pair[0][0]).hypot(pair[1][1] - pair[0][1]))
        .sum()
}

#[test]
fn wheels_count_the_way_in_both_dialects() {
    let folder = tempfile::tempdir().unwrap();
    let files = write(&spec(), folder.path()).unwrap();
    let mut stood = 0;
    for path in &files.logs {
        let (index, messages) = read(path);
        assert_eq!(index.topics_of(TopicKind::Odometry).count(), 1);
        let said = messages
            .iter()
            .filter_map(|message| match &message.payload {
                Payload::Odometry(odometry) => Some((message, odometry)),
                _ => None,
            });
        let said: Vec<_> = said.collect();
        assert_eq!(said[0].1.pose.position_m, [0.0; 3]);
        let mut way_m = 0.0;
        for pair in said.windows(2) {
            let [(before, a), (now, b)] = [pair[0], pair[1]];
            assert_eq!(now.frame_id, "odom");
            let seconds = (now.stamp_ns - before.stamp_ns) as f64 * 1e-9;
            assert!((seconds - 0.1).abs() < 1e-9);
            let [v, w] = [a, b].map(|o| o.linear_velocity_m_s[0]);
            let [from, to] = [a, b].map(|o| o.pose.position_m);
            let moved_m = (to[0] - from[0]).hypot(to[1] - from[1]);
            assert!((moved_m - 0.5 * (v + w).abs() * seconds).abs() < 1e-9);
            let forward = (to[1] - from[1]).atan2(to[0] - from[0]);
            let off_rad = forward - yaw_rad(b.pose.orientation);
            // At walking pace, noise may roll it back.
            assert!(moved_m < 0.02 || off_rad.cos() > 0.99, "{off_rad}");
            stood += usize::from(v == 0.0 && w == 0.0);
            way_m += moved_m;
        }
        let by_positions_m = way_by_positions_m(&messages);
        let ratio = way_m / by_positions_m;
        assert!((ratio - 1.0).abs() < 0.06, "{way_m} m, {by_positions_m} m");
    }
    assert!(stood > 10, "{stood}");
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
    let (mut in_tree, mut measured) = (Vec::new(), Vec::new());
    for message in &messages {
        match &message.payload {
            Payload::Image(CameraFrame::Encoded(image)) => {
                assert_eq!(image.format, "jpeg");
                assert!(image.data.starts_with(&[0xff, 0xd8]), "no JPEG");
                pictures.push(message.stamp_ns);
            }
            Payload::Calibration(calibration) => {
                assert_eq!((calibration.width_px, calibration.height_px), (640, 360));
                calibrations += 1;
            }
            Payload::Transforms {
                transforms,
                is_static: false,
            } => {
                assert_eq!(transforms[0].parent_frame, "odom");
                assert_eq!(transforms[0].child_frame, "base_link");
                in_tree.push(transforms[0].translation_m);
            }
            Payload::Odometry(odometry) => measured.push(odometry.pose.position_m),
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
    assert!(measured.len() > pictures.len() && in_tree == measured);
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
