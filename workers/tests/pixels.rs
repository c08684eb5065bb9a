//! Drives in pixels whose truth is known: a bend of a road with four lines, seen by a camera that is
//! mounted otherwise than the log says, and partly hidden by other vehicles.

#![allow(clippy::unwrap_used, clippy::panic)] // In a test, a panic is the report.

use nalgebra::{Isometry3, Matrix3, Point3, UnitQuaternion, Vector3};
use tilefold_schemas::id::VehicleKey;
use tilefold_schemas::log::{
    CameraCalibration, Detection, DetectionFrame, DetectionSpace, GnssFix, Imu, Transform,
    VehicleFrame,
};
use tilefold_schemas::{Color, Element, ElementId, ElementKind, Marking, SignClass, fixed};
use tilefold_tiler::chunk;
use tilefold_tiler::geodesy::LocalFrame;
use tilefold_tiler::map_index::{MapIndex, MappedElement};
use tilefold_tiler::recording::{Recording, Stamped};
use tilefold_workers::camera::Camera;
use tilefold_workers::mounting::Mounting;
use tilefold_workers::{MapContext, map_chunk};

const SPEED_M_S: f64 = 10.0;
const RADIUS_M: f64 = 400.0;
/// Frames of two per second.
const FRAMES: i64 = 120;
const FRAME_NS: i64 = 500_000_000;
const TILE_LEVEL: u32 = 15;
/// How the camera is really mounted: ahead and up in metres, then roll, pitch (down) and yaw.
const TRUE: ([f64; 3], [f64; 3]) = ([1.5, 0.1, 1.35], [0.004, 0.03, -0.02]);

/// Height of the road after `way_m`: a crest and a dip.
type Relief = fn(f64) -> f64;

fn flat(_: f64) -> f64 {
    0.0
}

fn hills(way_m: f64) -> f64 {
    3.0 * (way_m / 40.0).sin()
}

fn frame() -> LocalFrame {
    LocalFrame::new([8.4, 49.0, 0.0])
}

/// A place `left_m` beside the bend after `way_m`, east and north, and the heading there.
fn bend(way_m: f64, left_m: f64) -> ([f64; 2], f64) {
    let angle = way_m / RADIUS_M;
    let radius_m = RADIUS_M - left_m;
    let place = [radius_m * angle.sin(), RADIUS_M - radius_m * angle.cos()];
    (place, angle)
}

fn map(lines_m: &[f64], relief: Relief) -> MapIndex {
    let line = |(number, left_m): (i64, &f64)| {
        let ways = (-4..=75).map(|step| 10.0 * f64::from(step));
        let points = ways.map(|way_m| {
            let ([east_m, north_m], _) = bend(way_m, *left_m);
            let [longitude_deg, latitude_deg, _] = frame().to_wgs84([east_m, north_m, 0.0]);
            [longitude_deg, latitude_deg, 100.0 + relief(way_m)]
        });
        let element = Element {
            id: ElementId(number),
            kind: ElementKind::LaneMarking,
            marking: Marking::Solid,
            color: Color::White,
            sign: SignClass::default(),
            points: points.collect(),
            tags: std::collections::BTreeMap::new(),
        };
        MappedElement::new(element, TILE_LEVEL).unwrap()
    };
    MapIndex::new((0..).zip(lines_m).map(line).collect())
}

fn mounted(at_m: [f64; 3], [roll, pitch, yaw]: [f64; 3]) -> Isometry3<f64> {
    // Optical z is the vehicle's x, optical x its right.
    let axes = Matrix3::new(0.0, 0.0, 1.0, -1.0, 0.0, 0.0, 0.0, -1.0, 0.0);
    let turned = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
    Isometry3::from_parts(
        Vector3::from(at_m).into(),
        turned * UnitQuaternion::from_matrix(&axes),
    )
}

fn calibration() -> CameraCalibration {
    CameraCalibration {
        width_px: 1920,
        height_px: 1080,
        distortion_model: "equidistant".to_owned(),
        d: vec![-0.01, 0.003, -0.002, 0.0003],
        k: [900.0, 0.0, 960.0, 0.0, 900.0, 540.0, 0.0, 0.0, 1.0],
    }
}

/// What the true camera sees of a line in the frame after `way_m`.
fn seen(camera: &Camera, way_m: f64, left_m: f64, relief: Relief) -> Vec<[f64; 3]> {
    let ([east_m, north_m], heading) = bend(way_m, 0.0);
    let (sin, cos) = heading.sin_cos();
    let slope = (relief(way_m + 0.5) - relief(way_m - 0.5)).atan();
    let tilted = UnitQuaternion::from_euler_angles(0.0, -slope, 0.0);
    let points = (8..48).filter_map(|step| {
        let ahead = way_m + 0.5 * f64::from(step);
        let (place, _) = bend(ahead, left_m);
        let (dx, dy) = (place[0] - east_m, place[1] - north_m);
        let rise_m = relief(ahead) - relief(way_m);
        let level = Point3::new(cos * dx + sin * dy, -sin * dx + cos * dy, rise_m);
        let [u, v] = camera.pixel_from_vehicle((tilted.inverse() * level).coords.into())?;
        Some([u, v, 0.0])
    });
    points.collect()
}

fn stamped<T>(stamp_ns: i64, frame_id: &str, value: T) -> Stamped<T> {
    Stamped {
        stamp_ns,
        frame_id: frame_id.to_owned(),
        digest: stamp_ns,
        value,
    }
}

/// A drive along the bend that sees `lines_m` and states its mounting off by `off`.
fn drive(lines_m: &[f64], relief: Relief, off: [f64; 4]) -> Recording {
    let camera = Camera::new(&calibration(), mounted(TRUE.0, TRUE.1)).unwrap();
    let [roll, pitch, yaw, height_m] = off;
    let (at, turned) = TRUE;
    let stated = mounted(
        [at[0], at[1], at[2] - height_m],
        [turned[0] - roll, turned[1] - pitch, turned[2] - yaw],
    );
    let mut recording = Recording::default();
    recording
        .calibrations
        .push(stamped(0, "camera", calibration()));
    let transform = Transform {
        parent_frame: "base_link".to_owned(),
        child_frame: "camera".to_owned(),
        translation_m: stated.translation.vector.into(),
        rotation: stated.rotation.coords.into(),
    };
    recording
        .static_transforms
        .push(stamped(0, "", vec![transform]));
    for index in 0..FRAMES {
        let stamp_ns = index * FRAME_NS;
        let way_m = SPEED_M_S * stamp_ns as f64 * 1e-9;
        // Positions are off by 0.6 m to the right.
        let ([east_m, north_m], heading) = bend(way_m, -0.6);
        let [longitude_deg, latitude_deg, _] = frame().to_wgs84([east_m, north_m, 0.0]);
        let fix = GnssFix {
            latitude_deg,
            longitude_deg,
            altitude_m: 0.0,
            covariance_enu_m2: None,
            has_fix: true,
        };
        recording.fixes.push(stamped(stamp_ns, "base_link", fix));
        let imu = Imu {
            orientation: Some([0.0, 0.0, (0.5 * heading).sin(), (0.5 * heading).cos()]),
            yaw_variance_rad2: None,
            angular_velocity_rad_s: None,
        };
        recording.imu.push(stamped(stamp_ns, "base_link", imu));
        let detections = lines_m.iter().map(|left_m| Detection {
            kind: ElementKind::LaneMarking,
            marking: Marking::Solid,
            color: Color::White,
            sign: SignClass::default(),
            score: 1.0,
            points: seen(&camera, way_m, *left_m, relief),
        });
        let detections = DetectionFrame {
            space: DetectionSpace::Pixels,
            detections: detections.collect(),
        };
        recording.detections.push(stamped(stamp_ns, "", detections));
    }
    recording.settle();
    recording
}

fn refined(lines_m: &[f64], relief: Relief, off: [f64; 4]) -> Mounting {
    let context = MapContext {
        map: map(&[-5.25, -1.75, 1.75, 5.25], relief),
        tile_level: TILE_LEVEL,
        registering: tilefold_workers::Registering::On,
    };
    let recording = drive(lines_m, relief, off);
    let chunk = chunk::cut(&recording, VehicleKey(1), "/lanes", 0).unwrap();
    map_chunk(&chunk, &context).unwrap().mounting.unwrap()
}

#[track_caller]
fn assert_near(mounting: &Mounting, expected: [f64; 4], slack: [f64; 4]) {
    for k in 0..4 {
        let miss = (mounting.correction[k] - expected[k]).abs();
        assert!(miss < slack[k], "part {k}: {mounting:?}");
    }
}

const OWN_AND_NEXT_LANE: [f64; 3] = [-5.25, -1.75, 1.75];

#[test]
fn a_wrong_mounting_is_found_and_a_right_one_kept() {
    let slack = [0.004, 0.002, 0.004, 0.04];
    for off in [
        [0.0; 4],
        [0.0, 0.02, -0.03, 0.15],
        [0.01, -0.03, 0.02, -0.15],
    ] {
        let mounting = refined(&OWN_AND_NEXT_LANE, flat, off);
        assert_near(&mounting, off, slack);
        assert!(
            mounting.is_observed[1] && mounting.is_observed[2],
            "{mounting:?}"
        );
        assert!(mounting.refined_miss_m < 0.05, "{mounting:?}");
    }
}

#[test]
fn hills_of_the_map_are_no_pitch_of_the_camera() {
    let mounting = refined(&OWN_AND_NEXT_LANE, hills, [0.0; 4]);
    assert_near(&mounting, [0.0; 4], [0.005, 0.003, 0.005, 0.05]);
    assert!(mounting.refined_miss_m < 0.08, "{mounting:?}");
}

#[test]
fn one_line_tells_nothing_of_height() {
    let mounting = refined(&[1.75], flat, [0.0, 0.0, 0.0, 0.15]);
    assert!(!mounting.is_observed[3], "{mounting:?}");
    assert_eq!(mounting.correction[3], 0.0);
}

#[test]
fn a_drive_that_saw_nothing_keeps_its_mounting() {
    let mounting = refined(&[], flat, [0.0, 0.02, 0.0, 0.0]);
    assert_eq!(mounting.correction, [0.0; 4]);
    assert_eq!(mounting.is_observed, [false; 4]);
}

#[test]
fn frames_whose_camera_cannot_be_used_are_set_aside_with_the_reason() {
    let context = MapContext {
        map: map(&OWN_AND_NEXT_LANE, flat),
        tile_level: TILE_LEVEL,
        registering: tilefold_workers::Registering::On,
    };
    let mut recording = drive(&OWN_AND_NEXT_LANE, flat, [0.0; 4]);
    recording.calibrations[0].value.d.pop();
    let chunk = chunk::cut(&recording, VehicleKey(1), "/lanes", 0).unwrap();
    let evidence = map_chunk(&chunk, &context).unwrap();
    assert_eq!((evidence.frames, evidence.mounting), (0, None));
    assert_eq!(
        evidence.set_aside[0].reason,
        "detections cannot be brought into the vehicle frame: the distortion model `equidistant` \
         has 3 coefficients; it takes 4"
    );
}

/// Visibility of each line's misses, summed over a chunk: the mean of its looks for each that was missed.
fn missed(recording: &Recording) -> [f64; 4] {
    let context = MapContext {
        map: map(&[-5.25, -1.75, 1.75, 5.25], flat),
        tile_level: TILE_LEVEL,
        registering: tilefold_workers::Registering::On,
    };
    let chunk = chunk::cut(recording, VehicleKey(1), "/lanes", 0).unwrap();
    let mut missed = [0.0; 4];
    for row in map_chunk(&chunk, &context).unwrap().rows {
        let share = 1.0 - f64::from(row.hit) / f64::from(row.exposed);
        missed[row.element as usize] += share * fixed::from_q8(row.sum_v_q8);
    }
    missed
}

#[test]
fn a_line_behind_a_truck_is_not_missed() {
    let own_lane = [-1.75, 1.75];
    let mut recording = drive(&own_lane, flat, [0.0; 4]);
    let open = missed(&recording);
    assert!(open[0] > 1.0 && open[3] > 1.0, "{open:?}");
    assert!(open[1] < 0.1 && open[2] < 0.1, "{open:?}");
    // A truck drives along in the lane to the right.
    let corners = [2.0, 22.0].into_iter().flat_map(|x| {
        let sides = [-4.6, -2.2].into_iter();
        sides.flat_map(move |y| [[x, y, 0.0], [x, y, 3.5]])
    });
    let truck = VehicleFrame {
        space: DetectionSpace::Metres,
        vehicles: vec![corners.collect()],
    };
    for frame in recording.detections.clone() {
        let vehicles = stamped(frame.stamp_ns, "base_link", truck.clone());
        recording.vehicles.push(vehicles);
    }
    recording.settle();
    let hidden = missed(&recording);
    assert!(hidden[0] < 0.1 * open[0], "{hidden:?} {open:?}");
    assert!((hidden[3] - open[3]).abs() < 1e-9, "{hidden:?} {open:?}");
}
