//! What is written is read back as it was given.

use std::io::Cursor;

use bytes::Bytes;
use tilefold_schemas::element::{Color, ElementKind, Marking, SignClass};
use tilefold_schemas::log::*;

use super::{Dialect, Entry, LogWriteError, LogWriter};
use crate::log::{ALL_TIME, LogIndex, LogReader};

const STAMP_NS: i64 = 1_772_409_600_123_456_789;
const TURNED: Quaternion = [0.0, 0.0, 0.6, 0.8];

fn fix() -> Payload {
    Payload::Gnss(GnssFix {
        latitude_deg: 50.000_012_345_678,
        longitude_deg: 9.999_987_654_321,
        altitude_m: 301.25,
        covariance_enu_m2: Some([2.25, 0.1, 0.0, 0.1, 2.0, 0.0, 0.0, 0.0, 9.0]),
        has_fix: true,
    })
}

fn imu() -> Payload {
    Payload::Imu(Imu {
        orientation: Some(TURNED),
        yaw_variance_rad2: Some(1e-4),
        angular_velocity_rad_s: Some([0.0, 0.0, 0.02]),
    })
}

fn pose() -> FramePose {
    FramePose {
        position_m: [1.5, -2.5, 0.25],
        orientation: TURNED,
    }
}

fn odometry() -> Payload {
    Payload::Odometry(Odometry {
        pose: pose(),
        linear_velocity_m_s: [13.0, 0.1, 0.0],
        angular_velocity_rad_s: [0.0, 0.0, -0.1],
    })
}

fn transforms() -> Payload {
    let transform = |child: &str| Transform {
        parent_frame: "base_link".to_owned(),
        child_frame: child.to_owned(),
        translation_m: [1.6, 0.0, 1.4],
        rotation: [-0.5, 0.5, -0.5, 0.5],
    };
    Payload::Transforms {
        transforms: vec![transform("camera"), transform("lidar_top")],
        is_static: true,
    }
}

fn calibration() -> Payload {
    Payload::Calibration(CameraCalibration {
        width_px: 1_920,
        height_px: 1_080,
        distortion_model: "plumb_bob".to_owned(),
        d: vec![-0.3, 0.1, 0.001, -0.002, 0.01],
        k: [1_000.0, 0.0, 960.0, 0.0, 1_001.0, 540.0, 0.0, 0.0, 1.0],
    })
}

fn image() -> Payload {
    Payload::Image(CameraFrame::Encoded(EncodedImage {
        format: "jpeg".to_owned(),
        data: Bytes::from_static(&[0xff, 0xd8, 0xff, 0xd9, 1, 2, 3]),
    }))
}

fn video() -> Payload {
    Payload::Image(CameraFrame::Video(EncodedImage {
        format: "h264".to_owned(),
        data: Bytes::from_static(&[0, 0, 0, 1, 0x65, 1, 2, 3]),
    }))
}

fn detection(kind: ElementKind, marking: Marking, sign: SignClass) -> Detection {
    Detection {
        kind,
        marking,
        color: Color::Yellow,
        sign,
        score: 0.87,
        points: vec![[4.0, 1.75, 0.0], [5.0, 1.5, 0.0], [6.0, 1.25, 0.0]],
    }
}

fn detections(space: DetectionSpace, empty: bool) -> Payload {
    let line = detection(
        ElementKind::LaneMarking,
        Marking::SolidDashed,
        SignClass::Unknown,
    );
    let arrow = detection(
        ElementKind::GroundSign,
        Marking::Unknown,
        SignClass::LeftArrow,
    );
    Payload::Detections(DetectionFrame {
        space,
        detections: if empty { vec![] } else { vec![line, arrow] },
    })
}

fn entry<'a>(topic: &'a str, frame_id: &'a str, payload: &'a Payload) -> Entry<'a> {
    Entry {
        topic,
        stamp_ns: STAMP_NS,
        log_time_ns: STAMP_NS + 40_000_000,
        frame_id,
        payload,
    }
}

fn written(dialect: Dialect, entries: &[Entry<'_>]) -> Vec<u8> {
    let sink = Cursor::new(Vec::new());
    let mut log = LogWriter::create(sink, dialect, "vehicle 7", [("site", "here")]).unwrap();
    for entry in entries {
        log.write(*entry).unwrap();
    }
    log.finish().unwrap().into_inner()
}

fn read(bytes: &[u8]) -> (LogIndex, Vec<LogMessage>) {
    let file = tempfile::NamedTempFile::new().unwrap();
    std::fs::write(file.path(), bytes).unwrap();
    let index = LogIndex::open(file.path()).unwrap();
    let mut messages = Vec::new();
    LogReader::new()
        .read(
            &index,
            |_, _| true,
            ALL_TIME,
            |message| messages.push(message),
        )
        .unwrap();
    (index, messages)
}

/// Writes one message of each payload, and wants the same ones back.
fn holds(dialect: Dialect, payloads: &[(&str, &str, Payload)]) {
    let entries: Vec<Entry<'_>> = payloads
        .iter()
        .map(|(topic, frame_id, payload)| entry(topic, frame_id, payload))
        .collect();
    let (index, messages) = read(&written(dialect, &entries));
    assert_eq!(messages.len(), entries.len(), "{messages:#?}");
    for (message, entry) in messages.iter().zip(&entries) {
        assert_eq!(index.topics[message.topic].name, entry.topic);
        assert_eq!(&message.payload, entry.payload, "{}", entry.topic);
        assert_eq!(message.stamp_ns, entry.stamp_ns, "{}", entry.topic);
        assert_eq!(message.log_time_ns, entry.log_time_ns);
        let names_its_own_frames = matches!(message.payload, Payload::Transforms { .. });
        assert!(names_its_own_frames || message.frame_id == entry.frame_id);
    }
}

#[test]
fn ros_2_messages_come_back() {
    let payloads = [
        ("/gnss", "antenna", fix()),
        ("/imu", "imu_link", imu()),
        ("/pose", "map", Payload::Pose(pose())),
        ("/odom", "odom", odometry()),
        ("/tf_static", "", transforms()),
        ("/camera_info", "camera", calibration()),
        ("/image", "camera", image()),
        ("/video", "camera", video()),
        (
            "/lanes",
            "base_link",
            detections(DetectionSpace::Metres, false),
        ),
    ];
    holds(Dialect::Ros2, &payloads);
}

#[test]
fn foxglove_messages_come_back() {
    let payloads = [
        ("/gnss", "antenna", fix()),
        ("/heading", "enu", Payload::Pose(pose())),
        ("/odom", "odom", odometry()),
        ("/tf_static", "", transforms()),
        ("/calibration", "camera", calibration()),
        ("/image", "camera", image()),
        ("/video", "camera", video()),
        (
            "/lanes",
            "base_link",
            detections(DetectionSpace::Metres, false),
        ),
    ];
    holds(Dialect::Foxglove, &payloads);
}

#[test]
fn a_frame_in_which_nothing_was_seen_comes_back_with_its_stamp() {
    let nothing = detections(DetectionSpace::Metres, true);
    holds(Dialect::Ros2, &[("/lanes", "base_link", nothing)]);
}

#[test]
fn detections_in_pixels_come_back() {
    for empty in [false, true] {
        let payload = detections(DetectionSpace::Pixels, empty);
        holds(Dialect::Foxglove, &[("/annotations", "", payload)]);
    }
}

#[test]
fn the_vehicle_is_named() {
    let payload = fix();
    let (index, _) = read(&written(Dialect::Ros2, &[entry("/gnss", "", &payload)]));
    let vehicle = index
        .metadata
        .iter()
        .find(|record| record.name == "vehicle");
    let entries = &vehicle.unwrap().entries;
    assert_eq!(entries["vehicle_id"], "vehicle 7");
    assert_eq!(entries["site"], "here");
}

#[test]
fn the_same_calls_give_the_same_bytes() {
    let (fix, lanes) = (fix(), detections(DetectionSpace::Metres, false));
    let entries = [entry("/gnss", "a", &fix), entry("/lanes", "b", &lanes)];
    for dialect in [Dialect::Ros2, Dialect::Foxglove] {
        assert_eq!(written(dialect, &entries), written(dialect, &entries));
    }
}

#[test]
fn what_cannot_be_written_is_said() {
    let log = || LogWriter::create(Cursor::new(Vec::new()), Dialect::Foxglove, "v", []).unwrap();
    let (fix, imu) = (fix(), imu());
    let said = |error: LogWriteError| error.to_string();

    let error = said(log().write(entry("/imu", "", &imu)).unwrap_err());
    assert_eq!(
        error,
        "Foxglove has no message for an inertial measurement; write it in the other dialect"
    );

    let mut two = log();
    two.write(entry("/a", "", &fix)).unwrap();
    let lanes = detections(DetectionSpace::Metres, true);
    let error = said(two.write(entry("/a", "", &lanes)).unwrap_err());
    assert_eq!(
        error,
        "topic \"/a\" carries foxglove.LocationFix, but was given foxglove.SceneUpdate; give each kind of message a topic of its own"
    );

    let mut early = entry("/gnss", "", &fix);
    early.stamp_ns = -1;
    assert!(matches!(log().write(early), Err(LogWriteError::Time(-1))));
}
