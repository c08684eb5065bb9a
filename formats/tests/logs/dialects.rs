//! Every message that is read, in its dialect, as a noun.

use foxglove::Encode;
use foxglove::messages as fg;
use tilefold_schemas::log::{CameraFrame, DetectionSpace, LogMessage, Payload};
use tilefold_schemas::{Color, ElementKind, Marking, SetAsideKind, SignClass};

use crate::maker::{CdrMaker, Made, fix_cdr, read_one};

const STAMP: (u32, u32) = (1_600_000_000, 250_000_000);
const STAMP_NS: i64 = 1_600_000_000_250_000_000;
const LOG_TIME_NS: i64 = 1_600_000_001_000_000_000;

fn made(
    topic: &'static str,
    schema: &'static str,
    encoding: &'static str,
    payload: Vec<u8>,
) -> Made {
    Made {
        topic,
        schema,
        encoding,
        log_time: LOG_TIME_NS as u64,
        payload,
    }
}

fn ros(schema: &'static str, payload: CdrMaker) -> LogMessage {
    only(made("/topic", schema, "cdr", payload.finish()))
}

fn foxglove<M: Encode>(schema: &'static str, message: &M) -> LogMessage {
    only(made("/topic", schema, "protobuf", encode(message)))
}

fn encode<M: Encode>(message: &M) -> Vec<u8> {
    let mut bytes = Vec::new();
    assert!(message.encode(&mut bytes).is_ok());
    bytes
}

fn only(made: Made) -> LogMessage {
    let (mut messages, report) = read_one(made);
    assert_eq!(report.set_aside, []);
    assert_eq!(messages.len(), 1);
    messages.remove(0)
}

/// Kind and reason of the only thing that was set aside.
fn refused(made: Made) -> (SetAsideKind, String) {
    let (messages, mut report) = read_one(made);
    assert_eq!(messages, []);
    assert_eq!(report.set_aside.len(), 1);
    let loss = report.set_aside.remove(0);
    assert_eq!(
        (loss.topic.as_deref(), loss.stamp_ns),
        (Some("/topic"), Some(LOG_TIME_NS))
    );
    (loss.kind, loss.reason)
}

fn timestamp() -> Option<fg::Timestamp> {
    Some(fg::Timestamp::new(STAMP.0, STAMP.1))
}

fn metadata(pairs: &[(&str, &str)]) -> Vec<fg::KeyValuePair> {
    let pair = |(key, value): &(&str, &str)| fg::KeyValuePair {
        key: (*key).to_owned(),
        value: (*value).to_owned(),
    };
    pairs.iter().map(pair).collect()
}

#[test]
fn nav_sat_fix() {
    let payload = fix_cdr(STAMP, [48.5, 9.25, 300.0]);
    let message = only(made("/topic", "sensor_msgs/msg/NavSatFix", "cdr", payload));
    assert_eq!(
        (message.stamp_ns, message.log_time_ns),
        (STAMP_NS, LOG_TIME_NS)
    );
    assert_eq!(message.frame_id, "gnss");
    let Payload::Gnss(fix) = message.payload else {
        panic!()
    };
    assert_eq!(
        [fix.latitude_deg, fix.longitude_deg, fix.altitude_m],
        [48.5, 9.25, 300.0]
    );
    assert_eq!(fix.covariance_enu_m2.unwrap()[8], 9.0);
    assert!(fix.has_fix);
}

#[test]
fn a_fix_without_altitude_is_at_zero_and_without_stamp_at_its_log_time() {
    let payload = fix_cdr((0, 0), [48.5, 9.25, f64::NAN]);
    let message = only(made("/topic", "sensor_msgs/NavSatFix", "cdr", payload));
    assert_eq!(message.stamp_ns, LOG_TIME_NS);
    let Payload::Gnss(fix) = message.payload else {
        panic!()
    };
    assert_eq!(fix.altitude_m, 0.0);
}

#[test]
fn location_fix() {
    let message = foxglove(
        "foxglove.LocationFix",
        &fg::LocationFix {
            timestamp: timestamp(),
            frame_id: "gnss".to_owned(),
            latitude: -12.5,
            longitude: 130.0,
            altitude: 8.0,
            position_covariance: vec![2.25, 0.0, 0.0, 0.0, 2.25, 0.0, 0.0, 0.0, 9.0],
            position_covariance_type: 1,
            ..Default::default()
        },
    );
    assert_eq!(
        (message.stamp_ns, message.frame_id.as_str()),
        (STAMP_NS, "gnss")
    );
    let Payload::Gnss(fix) = message.payload else {
        panic!()
    };
    assert_eq!(
        [fix.latitude_deg, fix.longitude_deg, fix.altitude_m],
        [-12.5, 130.0, 8.0]
    );
    assert_eq!(fix.covariance_enu_m2.unwrap()[0], 2.25);
}

#[test]
fn imu_states_only_what_was_measured() {
    let not_measured = [-1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    let stated = [0.01, 0.0, 0.0, 0.0, 0.01, 0.0, 0.0, 0.0, 0.25];
    let orientation = [0.0, 0.0, 0.6, 0.8];
    for is_little_endian in [true, false] {
        let imu = |first: &[f64; 9], second: &[f64; 9]| {
            let payload = CdrMaker::new(is_little_endian)
                .header(STAMP, "imu")
                .f64s(&orientation)
                .f64s(first)
                .f64s(&[0.1, 0.2, 0.3])
                .f64s(second)
                .f64s(&[0.0; 12]);
            let Payload::Imu(imu) = ros("sensor_msgs/msg/Imu", payload).payload else {
                panic!()
            };
            imu
        };
        let first = imu(&stated, &not_measured);
        assert_eq!(first.orientation, Some(orientation));
        assert_eq!(first.yaw_variance_rad2, Some(0.25));
        assert_eq!(first.angular_velocity_rad_s, None);
        let second = imu(&not_measured, &[0.0; 9]);
        assert_eq!(second.orientation, None);
        assert_eq!(second.angular_velocity_rad_s, Some([0.1, 0.2, 0.3]));
    }
}

#[test]
fn odometry_and_poses() {
    let pose = [1.0, 2.0, 3.0, 0.0, 0.0, 0.6, 0.8];
    let payload = CdrMaker::new(true)
        .header(STAMP, "odom")
        .text("base_link")
        .f64s(&pose)
        .f64s(&[0.0; 36])
        .f64s(&[5.0, 0.0, 0.0, 0.0, 0.0, 0.5])
        .f64s(&[0.0; 36]);
    let Payload::Odometry(odometry) = ros("nav_msgs/msg/Odometry", payload).payload else {
        panic!()
    };
    assert_eq!(odometry.pose.position_m, [1.0, 2.0, 3.0]);
    assert_eq!(odometry.linear_velocity_m_s, [5.0, 0.0, 0.0]);
    assert_eq!(odometry.angular_velocity_rad_s, [0.0, 0.0, 0.5]);
    let message = foxglove(
        "foxglove.Odometry",
        &fg::Odometry {
            timestamp: timestamp(),
            frame_id: "odom".to_owned(),
            body_frame_id: "base_link".to_owned(),
            pose: Some(fg::Pose {
                position: Some(fg::Vector3 {
                    x: 1.0,
                    y: 2.0,
                    z: 3.0,
                }),
                orientation: Some(fg::Quaternion {
                    x: 0.0,
                    y: 0.0,
                    z: 0.6,
                    w: 0.8,
                }),
            }),
            linear_velocity: Some(fg::Vector3 {
                x: 5.0,
                ..Default::default()
            }),
            angular_velocity: Some(fg::Vector3 {
                z: 0.5,
                ..Default::default()
            }),
            ..Default::default()
        },
    );
    assert_eq!(
        (message.stamp_ns, message.frame_id.as_str()),
        (STAMP_NS, "odom")
    );
    assert_eq!(message.payload, Payload::Odometry(odometry));
    for (schema, covariance) in [
        ("geometry_msgs/msg/PoseStamped", &[0.0; 0][..]),
        ("geometry_msgs/msg/PoseWithCovarianceStamped", &[0.0; 36]),
    ] {
        let payload = CdrMaker::new(false)
            .header(STAMP, "map")
            .f64s(&pose)
            .f64s(covariance);
        let message = ros(schema, payload);
        assert_eq!(
            (message.stamp_ns, message.frame_id.as_str()),
            (STAMP_NS, "map")
        );
        let Payload::Pose(read) = message.payload else {
            panic!()
        };
        assert_eq!(read.position_m, [1.0, 2.0, 3.0]);
        assert_eq!(read.orientation, [0.0, 0.0, 0.6, 0.8]);
    }
    let message = foxglove(
        "foxglove.PoseInFrame",
        &fg::PoseInFrame {
            timestamp: timestamp(),
            frame_id: "enu".to_owned(),
            pose: Some(fg::Pose {
                position: None,
                orientation: Some(fg::Quaternion {
                    x: 0.0,
                    y: 0.0,
                    z: 0.6,
                    w: 0.8,
                }),
            }),
        },
    );
    let Payload::Pose(read) = message.payload else {
        panic!()
    };
    assert_eq!(
        (read.position_m, read.orientation),
        ([0.0; 3], [0.0, 0.0, 0.6, 0.8])
    );
}

#[test]
fn transforms_by_stamp_and_static_by_topic() {
    let one = |maker: CdrMaker, stamp, child: &str| {
        maker
            .header(stamp, "base_link")
            .text(child)
            .f64s(&[1.0, 0.0, 2.0, 0.0, 0.0, 0.0, 1.0])
    };
    let later = (STAMP.0 + 1, 0);
    let maker = CdrMaker::new(true).u32(3);
    let maker = one(one(one(maker, STAMP, "a"), STAMP, "b"), later, "c");
    let payload = maker.finish();
    let (messages, _) = read_one(made(
        "/tf",
        "tf2_msgs/msg/TFMessage",
        "cdr",
        payload.clone(),
    ));
    assert_eq!(messages.len(), 2);
    assert_ne!(messages[0].digest, messages[1].digest);
    let Payload::Transforms {
        transforms,
        is_static,
    } = &messages[0].payload
    else {
        panic!()
    };
    assert_eq!((transforms.len(), *is_static), (2, false));
    assert_eq!(transforms[1].child_frame, "b");
    assert_eq!(transforms[1].translation_m, [1.0, 0.0, 2.0]);
    assert_eq!(messages[1].stamp_ns, i64::from(later.0) * 1_000_000_000);
    let (messages, _) = read_one(made(
        "/car/tf_static",
        "tf2_msgs/msg/TFMessage",
        "cdr",
        payload,
    ));
    assert!(matches!(
        messages[0].payload,
        Payload::Transforms {
            is_static: true,
            ..
        }
    ));

    let transform = fg::FrameTransform {
        timestamp: timestamp(),
        parent_frame_id: "base_link".to_owned(),
        child_frame_id: "camera".to_owned(),
        translation: Some(fg::Vector3 {
            x: 1.0,
            y: 2.0,
            z: 3.0,
        }),
        rotation: Some(fg::Quaternion {
            x: 0.0,
            y: 0.0,
            z: 0.0,
            w: 1.0,
        }),
    };
    let single = foxglove("foxglove.FrameTransform", &transform);
    let several = fg::FrameTransforms {
        transforms: vec![transform],
    };
    let several = foxglove("foxglove.FrameTransforms", &several);
    assert_eq!(single.payload, several.payload);
    let Payload::Transforms { transforms, .. } = single.payload else {
        panic!()
    };
    assert_eq!(transforms[0].translation_m, [1.0, 2.0, 3.0]);
}

#[test]
fn calibrations_and_images() {
    let k = [800.0, 0.0, 320.0, 0.0, 810.0, 240.0, 0.0, 0.0, 1.0];
    let payload = CdrMaker::new(true)
        .header(STAMP, "camera")
        .u32(480)
        .u32(640)
        .text("plumb_bob")
        .u32(2)
        .f64s(&[-0.4, 0.1])
        .f64s(&k)
        .f64s(&[0.0; 21]);
    let Payload::Calibration(from_ros) = ros("sensor_msgs/msg/CameraInfo", payload).payload else {
        panic!()
    };
    let message = fg::CameraCalibration {
        width: 640,
        height: 480,
        distortion_model: "plumb_bob".to_owned(),
        d: vec![-0.4, 0.1],
        k: k.to_vec(),
        ..Default::default()
    };
    let Payload::Calibration(from_foxglove) =
        foxglove("foxglove.CameraCalibration", &message).payload
    else {
        panic!()
    };
    assert_eq!(from_ros, from_foxglove);
    assert_eq!(
        (from_ros.width_px, from_ros.height_px, from_ros.k[4]),
        (640, 480, 810.0)
    );

    let payload = CdrMaker::new(true)
        .header(STAMP, "camera")
        .text("jpeg")
        .octets(&[1, 2, 3]);
    let Payload::Image(CameraFrame::Encoded(from_ros)) =
        ros("sensor_msgs/msg/CompressedImage", payload).payload
    else {
        panic!()
    };
    let message = fg::CompressedImage {
        format: "jpeg".to_owned(),
        data: vec![1, 2, 3].into(),
        ..Default::default()
    };
    let Payload::Image(CameraFrame::Encoded(from_foxglove)) =
        foxglove("foxglove.CompressedImage", &message).payload
    else {
        panic!()
    };
    assert_eq!(from_ros, from_foxglove);
    assert_eq!(
        (from_ros.format.as_str(), &from_ros.data[..]),
        ("jpeg", &[1, 2, 3][..])
    );
}

fn line(points: &[[f64; 3]]) -> fg::LinePrimitive {
    let point = |[x, y, z]: &[f64; 3]| fg::Point3 {
        x: *x,
        y: *y,
        z: *z,
    };
    fg::LinePrimitive {
        points: points.iter().map(point).collect(),
        ..Default::default()
    }
}

fn entity(pairs: &[(&str, &str)], lines: Vec<fg::LinePrimitive>) -> fg::SceneEntity {
    fg::SceneEntity {
        timestamp: timestamp(),
        frame_id: "base_link".to_owned(),
        metadata: metadata(pairs),
        lines,
        ..Default::default()
    }
}

fn scene(entities: Vec<fg::SceneEntity>) -> Made {
    let update = fg::SceneUpdate {
        entities,
        ..Default::default()
    };
    made(
        "/topic",
        "foxglove.SceneUpdate",
        "protobuf",
        encode(&update),
    )
}

#[test]
fn scene_lines_are_detections_in_metres() {
    let moved = fg::LinePrimitive {
        // A quarter turn to the left, then 10 m ahead.
        pose: Some(fg::Pose {
            position: Some(fg::Vector3 {
                x: 10.0,
                y: 0.0,
                z: 0.0,
            }),
            orientation: Some(fg::Quaternion {
                x: 0.0,
                y: 0.0,
                z: 1.0,
                w: 1.0,
            }),
        }),
        ..line(&[[1.0, 0.0, 0.5], [2.0, 0.0, 0.5]])
    };
    let indexed = fg::LinePrimitive {
        indices: vec![2, 0],
        ..line(&[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]])
    };
    let lane = [
        ("class", "lane_marking"),
        ("type", "dashed"),
        ("color", "yellow"),
        ("score", "0.5"),
    ];
    let sign = [("class", "ground_sign"), ("type", "left_arrow")];
    let outline = fg::LinePrimitive {
        r#type: fg::line_primitive::Type::LineLoop as i32,
        ..line(&[
            [0.0, 0.0, 0.0],
            [1.0, 0.0, 0.0],
            [1.0, 1.0, 0.0],
            [0.0, 0.0, 0.0],
        ])
    };
    let update = scene(vec![
        entity(&lane, vec![moved, indexed]),
        entity(&sign, vec![outline]),
    ]);
    let message = only(update);
    assert_eq!(
        (message.stamp_ns, message.frame_id.as_str()),
        (STAMP_NS, "base_link")
    );
    let Payload::Detections(frame) = message.payload else {
        panic!()
    };
    assert_eq!(frame.space, DetectionSpace::Metres);
    let [first, second, third] = &frame.detections[..] else {
        panic!()
    };
    assert_eq!(
        (first.kind, first.marking, first.color),
        (ElementKind::LaneMarking, Marking::Dashed, Color::Yellow)
    );
    assert_eq!(first.score, 0.5);
    for (point, expected) in first
        .points
        .iter()
        .zip([[10.0, 1.0, 0.5], [10.0, 2.0, 0.5]])
    {
        let far = point
            .iter()
            .zip(expected)
            .map(|(a, b)| (a - b).abs())
            .fold(0.0, f64::max);
        assert!(far < 1e-12, "{point:?}");
    }
    assert_eq!(second.points, [[2.0, 0.0, 0.0], [0.0, 0.0, 0.0]]);
    assert_eq!(
        (third.kind, third.sign, third.score),
        (ElementKind::GroundSign, SignClass::LeftArrow, 1.0)
    );
    assert_eq!(third.points.len(), 3);
}

#[test]
fn looked_and_saw_nothing_is_not_the_same_as_saw_something_else() {
    let (messages, report) = read_one(scene(vec![]));
    let Payload::Detections(frame) = &messages[0].payload else {
        panic!()
    };
    assert_eq!(
        (frame.detections.len(), messages[0].stamp_ns, report.ignored),
        (0, LOG_TIME_NS, 0)
    );
    let car = entity(&[("class", "car")], vec![line(&[[0.0; 3], [1.0; 3]])]);
    let (messages, report) = read_one(scene(vec![car]));
    assert_eq!(
        (messages.len(), report.ignored, report.set_aside.len()),
        (0, 1, 0)
    );
}

#[test]
fn boxes_of_vehicles_are_vehicles_beside_what_else_a_scene_says() {
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let cube = fg::CubePrimitive {
        pose: Some(fg::Pose {
            position: Some(fg::Vector3 {
                x: 10.0,
                y: 2.0,
                z: 0.75,
            }),
            // A quarter turn to the left: its length lies across.
            orientation: Some(fg::Quaternion {
                x: 0.0,
                y: 0.0,
                z: half,
                w: half,
            }),
        }),
        size: Some(fg::Vector3 {
            x: 4.0,
            y: 1.8,
            z: 1.5,
        }),
        ..Default::default()
    };
    let truck = fg::SceneEntity {
        cubes: vec![cube],
        ..entity(&[("class", "Truck")], vec![])
    };
    let lane = entity(
        &[("class", "lane_marking")],
        vec![line(&[[0.0; 3], [1.0; 3]])],
    );
    let (messages, report) = read_one(scene(vec![truck, lane]));
    assert_eq!((messages.len(), report.set_aside.len()), (2, 0));
    let Payload::Vehicles(frame) = &messages[0].payload else {
        panic!("{:?}", messages[0])
    };
    assert_eq!(
        (frame.space, frame.vehicles.len()),
        (DetectionSpace::Metres, 1)
    );
    let bounds = |axis: usize| {
        let values = frame.vehicles[0].iter().map(|corner| corner[axis]);
        let low = values.clone().fold(f64::INFINITY, f64::min);
        (low, values.fold(f64::NEG_INFINITY, f64::max))
    };
    for (axis, expected) in [(9.1, 10.9), (0.0, 4.0), (0.0, 1.5)]
        .into_iter()
        .enumerate()
    {
        let (low, high) = bounds(axis);
        assert!((low - expected.0).abs() < 1e-9 && (high - expected.1).abs() < 1e-9);
    }
    assert!(
        matches!(&messages[1].payload, Payload::Detections(frame) if frame.detections.len() == 1)
    );
}

#[test]
fn outlines_of_vehicles_in_an_image_are_vehicles() {
    use fg::points_annotation::Type;
    let corners = [[0.0, 0.0], [9.0, 0.0], [9.0, 9.0], [0.0, 9.0]];
    let car = annotation(&[("class", "car")], Type::LineLoop, &corners);
    let message = foxglove(
        "foxglove.ImageAnnotations",
        &fg::ImageAnnotations {
            points: vec![car],
            ..Default::default()
        },
    );
    let Payload::Vehicles(frame) = message.payload else {
        panic!()
    };
    assert_eq!(frame.space, DetectionSpace::Pixels);
    assert_eq!(frame.vehicles[0][2], [9.0, 9.0, 0.0]);
}

#[test]
fn entities_of_several_times_are_several_frames() {
    let lane = [("class", "lane_marking")];
    let lines = vec![line(&[[0.0; 3], [1.0; 3]])];
    let later = fg::SceneEntity {
        timestamp: Some(fg::Timestamp::new(STAMP.0 + 1, 0)),
        ..entity(&lane, lines.clone())
    };
    let (messages, _) = read_one(scene(vec![entity(&lane, lines), later]));
    assert_eq!(messages.len(), 2);
    assert_ne!(messages[0].digest, messages[1].digest);
}

#[test]
fn short_lines_are_counted_and_the_rest_is_used() {
    let lines = vec![line(&[[0.0; 3]]), line(&[[0.0; 3], [1.0; 3]])];
    let (messages, report) = read_one(scene(vec![entity(&[("class", "stop_line")], lines)]));
    let Payload::Detections(frame) = &messages[0].payload else {
        panic!()
    };
    assert_eq!(frame.detections.len(), 1);
    assert_eq!(
        (report.set_aside[0].kind, report.set_aside[0].count),
        (SetAsideKind::Message, 1)
    );
}

fn annotation(
    pairs: &[(&str, &str)],
    kind: fg::points_annotation::Type,
    points: &[[f64; 2]],
) -> fg::PointsAnnotation {
    fg::PointsAnnotation {
        timestamp: timestamp(),
        r#type: kind as i32,
        points: points
            .iter()
            .map(|[x, y]| fg::Point2 { x: *x, y: *y })
            .collect(),
        metadata: metadata(pairs),
        ..Default::default()
    }
}

#[test]
fn annotations_are_detections_in_pixels() {
    use fg::points_annotation::Type;
    let strip = annotation(
        &[("type", "solid"), ("color", "white")],
        Type::LineStrip,
        &[[1.5, 2.0], [3.0, 4.0]],
    );
    let outline = annotation(
        &[("class", "crosswalk")],
        Type::LineLoop,
        &[[0.0, 0.0], [9.0, 0.0], [9.0, 9.0]],
    );
    let message = foxglove(
        "foxglove.ImageAnnotations",
        &fg::ImageAnnotations {
            points: vec![strip, outline],
            metadata: metadata(&[("class", "lane_marking")]),
            ..Default::default()
        },
    );
    assert_eq!(
        (message.stamp_ns, message.frame_id.as_str()),
        (STAMP_NS, "")
    );
    let Payload::Detections(frame) = message.payload else {
        panic!()
    };
    assert_eq!(frame.space, DetectionSpace::Pixels);
    assert_eq!(
        frame.detections[0].points,
        [[1.5, 2.0, 0.0], [3.0, 4.0, 0.0]]
    );
    assert_eq!(frame.detections[0].marking, Marking::Solid);
    assert_eq!(frame.detections[1].kind, ElementKind::Crosswalk);
    assert_eq!(frame.detections[1].points.len(), 3);
    let empty = foxglove(
        "foxglove.ImageAnnotations",
        &fg::ImageAnnotations::default(),
    );
    assert!(matches!(empty.payload, Payload::Detections(frame) if frame.detections.is_empty()));
}

#[test]
fn what_cannot_be_true_is_set_aside() {
    let gnss = "sensor_msgs/msg/NavSatFix";
    for position in [
        [f64::NAN, 9.0, 0.0],
        [91.0, 9.0, 0.0],
        [48.0, f64::INFINITY, 0.0],
        [48.0, 9.0, 1e9],
    ] {
        let (kind, reason) = refused(made("/topic", gnss, "cdr", fix_cdr(STAMP, position)));
        assert_eq!(kind, SetAsideKind::Pose, "{reason}");
    }
    let pose = |values: [f64; 7]| {
        let payload = CdrMaker::new(true)
            .header(STAMP, "map")
            .f64s(&values)
            .finish();
        refused(made(
            "/topic",
            "geometry_msgs/msg/PoseStamped",
            "cdr",
            payload,
        ))
    };
    for values in [
        [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        [0.0, 0.0, 0.0, 0.0, 0.0, f64::NAN, 1.0],
        [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1e30],
        [1e9, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0],
    ] {
        assert_eq!(pose(values).0, SetAsideKind::Pose);
    }
    let lane = [("class", "lane_marking")];
    let point = scene(vec![entity(
        &lane,
        vec![line(&[[f64::NAN, 0.0, 0.0], [1.0; 3]])],
    )]);
    assert_eq!(refused(point).0, SetAsideKind::Message);
    let score = [("class", "lane_marking"), ("score", "nan")];
    let score = scene(vec![entity(&score, vec![line(&[[0.0; 3], [1.0; 3]])])]);
    assert_eq!(
        refused(score),
        (
            SetAsideKind::Message,
            "score cannot be true: NaN, expected 0 to 1".to_owned()
        )
    );
}

#[test]
fn messages_that_would_swell_are_refused_before_they_are_decoded() {
    let entities = [0x12, 0].repeat(1 << 20);
    let (kind, reason) = refused(made("/topic", "foxglove.SceneUpdate", "protobuf", entities));
    assert_eq!(kind, SetAsideKind::Message);
    assert_eq!(reason, "10001 entities and deletions, the limit is 10000");
    let count = CdrMaker::new(true).u32(u32::MAX).finish();
    let (kind, _) = refused(made("/topic", "tf2_msgs/msg/TFMessage", "cdr", count));
    assert_eq!(kind, SetAsideKind::Message);
}

#[test]
fn a_known_schema_in_an_encoding_that_is_not_read_is_set_aside_once() {
    let message = made("/topic", "foxglove.SceneUpdate", "json", b"{}".to_vec());
    let bytes = crate::maker::log_bytes(mcap::WriteOptions::new(), &[message.clone(), message]);
    let (index, messages, report) = crate::maker::LogFile::new(&bytes).read();
    assert_eq!((messages.len(), report.set_aside.len()), (0, 0));
    assert_eq!(
        (index.set_aside[0].kind, index.set_aside[0].count),
        (SetAsideKind::Message, 2)
    );
}
