//! From a pixel of the raw image to the road: lens model, mounting, flat ground.
//!
//! Camera coordinates follow the optical convention: x right, y down, z forward along the axis.

use nalgebra::{Isometry3, Point3, Vector3};
use tilefold_schemas::log::CameraCalibration;

/// Newton steps of undistortion; it converges quadratically, 20 is far more than it takes.
const UNDISTORT_STEPS: usize = 20;
/// Undistortion has converged when a step is shorter than this, in normalised image units.
const UNDISTORT_TOLERANCE: f64 = 1e-12;

/// Why a camera cannot be used.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum CameraError {
    /// A lens model that is not known here.
    #[error(
        "the distortion model `{0}` is not supported; known are plumb_bob, rational_polynomial and none"
    )]
    Model(String),
    /// A camera matrix that cannot be inverted.
    #[error(
        "the camera matrix has the focal lengths fx = {fx}, fy = {fy} pixels; both must be positive"
    )]
    Focal {
        /// Horizontal focal length in pixels.
        fx: f64,
        /// Vertical focal length in pixels.
        fy: f64,
    },
}

/// A camera whose pixels can be cast onto the road.
#[derive(Debug, Clone, PartialEq)]
pub struct Camera {
    focal_px: [f64; 2],
    centre_px: [f64; 2],
    /// k1, k2, p1, p2, k3, k4, k5, k6 (OpenCV's order).
    distortion: [f64; 8],
    vehicle_from_camera: Isometry3<f64>,
}

impl Camera {
    /// The camera with the log's calibration, mounted at `vehicle_from_camera`.
    ///
    /// # Errors
    /// An unknown lens model or a camera matrix without focal lengths.
    pub fn new(
        calibration: &CameraCalibration,
        vehicle_from_camera: Isometry3<f64>,
    ) -> Result<Self, CameraError> {
        let d = &calibration.d;
        let known = match calibration.distortion_model.as_str() {
            "plumb_bob" => 5,
            "rational_polynomial" => 8,
            "" if d.iter().all(|&value| value == 0.0) => 0,
            other => return Err(CameraError::Model(other.to_owned())),
        };
        let mut distortion = [0.0; 8];
        for (to, from) in distortion.iter_mut().zip(d.iter().take(known)) {
            *to = *from;
        }
        let [fx, _, cx, _, fy, cy, ..] = calibration.k;
        if !(fx > 0.0 && fy > 0.0) {
            return Err(CameraError::Focal { fx, fy });
        }
        Ok(Self {
            focal_px: [fx, fy],
            centre_px: [cx, cy],
            distortion,
            vehicle_from_camera,
        })
    }

    /// Where the pixel's ray meets the plane z = 0 of the vehicle frame, in metres; none if it
    /// does not go down or the lens model has no inverse there.
    #[must_use]
    pub fn road_from_pixel(&self, pixel: [f64; 2]) -> Option<[f64; 3]> {
        let distorted = [
            (pixel[0] - self.centre_px[0]) / self.focal_px[0],
            (pixel[1] - self.centre_px[1]) / self.focal_px[1],
        ];
        let [x, y] = self.undistort(distorted)?;
        let ray = self.vehicle_from_camera.rotation * Vector3::new(x, y, 1.0);
        let origin = self.vehicle_from_camera.translation.vector;
        if ray.z >= -1e-6 {
            return None;
        }
        let depth_m = -origin.z / ray.z;
        let hit = origin + ray * depth_m;
        (depth_m > 0.0 && hit.x.is_finite() && hit.y.is_finite()).then_some([hit.x, hit.y, 0.0])
    }

    /// The pixel that a point of the vehicle frame is seen at; none if it is not in front of the
    /// camera (nearer than 0.1 m along the optical axis).
    #[must_use]
    pub fn pixel_from_vehicle(&self, point_m: [f64; 3]) -> Option<[f64; 2]> {
        let point = self
            .vehicle_from_camera
            .inverse_transform_point(&Point3::from(point_m));
        if point.z < 0.1 {
            return None;
        }
        let [x, y] = self.distort([point.x / point.z, point.y / point.z]);
        Some([
            self.focal_px[0] * x + self.centre_px[0],
            self.focal_px[1] * y + self.centre_px[1],
        ])
    }

    /// Brown-Conrady with OpenCV's rational radial term.
    fn distort(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let [k1, k2, p1, p2, k3, k4, k5, k6] = self.distortion;
        let r2 = x * x + y * y;
        let radial =
            (1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))) / (1.0 + r2 * (k4 + r2 * (k5 + r2 * k6)));
        [
            x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
            y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
        ]
    }

    /// Inverts [`Self::distort`] by Newton's method with a numerical Jacobian.
    fn undistort(&self, target: [f64; 2]) -> Option<[f64; 2]> {
        const H: f64 = 1e-6;
        let mut at = target;
        for _ in 0..UNDISTORT_STEPS {
            let here = self.distort(at);
            let along_x = self.distort([at[0] + H, at[1]]);
            let along_y = self.distort([at[0], at[1] + H]);
            let jacobian = nalgebra::Matrix2::new(
                (along_x[0] - here[0]) / H,
                (along_y[0] - here[0]) / H,
                (along_x[1] - here[1]) / H,
                (along_y[1] - here[1]) / H,
            );
            // Where the radial polynomial turns back, the lens model is not invertible.
            if jacobian.determinant() <= 0.0 {
                return None;
            }
            let error = nalgebra::Vector2::new(here[0] - target[0], here[1] - target[1]);
            let step = jacobian.try_inverse()? * error;
            at = [at[0] - step.x, at[1] - step.y];
            if step.norm() < UNDISTORT_TOLERANCE {
                return Some(at);
            }
        }
        let here = self.distort(at);
        let miss = (here[0] - target[0]).hypot(here[1] - target[1]);
        (miss < 1e-9).then_some(at)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera() -> Camera {
        let calibration = CameraCalibration {
            width_px: 1920,
            height_px: 1080,
            distortion_model: "plumb_bob".to_owned(),
            d: vec![-0.404, 0.149, 0.00106, 0.0005, 0.0],
            k: [1261.5, 0.0, 976.2, 0.0, 1147.0, 530.6, 0.0, 0.0, 1.0],
        };
        // Looking ahead, 1.4 m up, two degrees down: optical z is vehicle x.
        let axes = nalgebra::Matrix3::new(0.0, 0.0, 1.0, -1.0, 0.0, 0.0, 0.0, -1.0, 0.0);
        let level = nalgebra::UnitQuaternion::from_matrix(&axes);
        let down = nalgebra::UnitQuaternion::from_axis_angle(&Vector3::y_axis(), 0.035);
        let mounting = Isometry3::from_parts(Vector3::new(1.5, 0.1, 1.4).into(), down * level);
        Camera::new(&calibration, mounting).unwrap()
    }

    #[test]
    fn the_road_point_of_a_pixel_is_seen_at_that_pixel() {
        let camera = camera();
        for pixel in [
            [976.0, 700.0],
            [300.0, 800.0],
            [1700.0, 900.0],
            [976.0, 590.0],
        ] {
            let road = camera.road_from_pixel(pixel).unwrap();
            assert_eq!(road[2], 0.0);
            let again = camera.pixel_from_vehicle(road).unwrap();
            assert!((again[0] - pixel[0]).abs() < 1e-6 && (again[1] - pixel[1]).abs() < 1e-6);
        }
    }

    #[test]
    fn the_sky_is_not_road_and_what_is_behind_is_not_seen() {
        assert_eq!(camera().road_from_pixel([976.0, 200.0]), None);
        assert_eq!(camera().pixel_from_vehicle([-5.0, 0.0, 0.0]), None);
    }
}
