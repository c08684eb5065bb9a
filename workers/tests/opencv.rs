//! Projection and undistortion against OpenCV, which `opencv/opencv.py` asked: 200 points a model
//! that lie beside it, or those of the file that `TILEFOLD_OPENCV_POINTS` names.

#![allow(clippy::unwrap_used, clippy::panic)] // In a test, a panic is the report.

use std::collections::BTreeMap;
use std::path::PathBuf;

use nalgebra::{Isometry3, Vector3};
use tilefold_schemas::log::CameraCalibration;
use tilefold_workers::camera::Camera;

const K: [f64; 9] = [1261.5, 0.0, 976.2, 0.0, 1147.0, 530.6, 0.0, 0.0, 1.0];
/// What double precision leaves of a pixel after OpenCV's ways and ours, in pixels.
const PROJECTION_PX: f64 = 1e-9;
/// OpenCV stops undistorting at steps of about 1e-8 whatever it is asked for.
const UNDISTORTION_PX: f64 = 1e-5;

/// Greatest differences of a model, in pixels.
#[derive(Default)]
struct Worst {
    points: usize,
    projection_px: f64,
    undistortion_px: f64,
    /// Of our own way there and back.
    round_trip_px: f64,
}

#[test]
fn pixels_are_those_of_opencv() {
    let beside = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/opencv/points.txt");
    let path = std::env::var_os("TILEFOLD_OPENCV_POINTS").map_or(beside, PathBuf::from);
    let text = std::fs::read_to_string(&path).unwrap();
    let mut models: BTreeMap<&str, Worst> = BTreeMap::new();
    for line in text.lines().filter(|line| !line.starts_with('#')) {
        let (model, numbers) = line.split_once(' ').unwrap();
        let numbers: Vec<f64> = numbers.split(' ').map(|n| n.parse().unwrap()).collect();
        compare(model, &numbers, models.entry(model).or_default());
    }
    assert_eq!(models.len(), 3);
    for (model, worst) in &models {
        println!(
            "{model}: {} points, projection {:.1e} px, undistortion {:.1e} px, there and back {:.1e} px",
            worst.points, worst.projection_px, worst.undistortion_px, worst.round_trip_px
        );
        assert!(worst.points >= 200, "{model}");
        assert!(worst.projection_px < PROJECTION_PX, "{model}");
        assert!(worst.undistortion_px < UNDISTORTION_PX, "{model}");
        assert!(worst.round_trip_px < PROJECTION_PX, "{model}");
    }
}

fn compare(model: &str, numbers: &[f64], worst: &mut Worst) {
    let (d, rest) = numbers.split_at(numbers.len() - 7);
    let [x, y, z, u, v, back_x, back_y] = *rest else {
        panic!("{rest:?}")
    };
    let calibration = CameraCalibration {
        width_px: 1920,
        height_px: 1080,
        distortion_model: model.to_owned(),
        d: d.to_vec(),
        k: K,
    };
    let camera = Camera::new(&calibration, Isometry3::identity()).unwrap();
    let point = Vector3::new(x, y, z);
    let pixel = camera.pixel_from_camera(point);
    let [our_u, our_v] = pixel.unwrap_or_else(|| panic!("{model} {d:?}: no pixel of {point:?}"));
    let ray = camera.ray([u, v]);
    let ray = ray.unwrap_or_else(|| panic!("{model} {d:?}: no ray of {u}, {v}"));
    // Directions are compared at the pixel they are projected to.
    let ours = camera.pixel_from_camera(ray).unwrap();
    let theirs = camera
        .pixel_from_camera(Vector3::new(back_x, back_y, 1.0))
        .unwrap();
    worst.points += 1;
    let far = |a: [f64; 2], b: [f64; 2]| (a[0] - b[0]).hypot(a[1] - b[1]);
    worst.projection_px = worst.projection_px.max(far([our_u, our_v], [u, v]));
    worst.undistortion_px = worst.undistortion_px.max(far(ours, theirs));
    worst.round_trip_px = worst.round_trip_px.max(far(ours, [u, v]));
}
