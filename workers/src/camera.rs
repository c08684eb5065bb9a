//! A mounted camera: from points of the vehicle frame to pixels of the raw image, and from a pixel
//! to the road (method.md, section 4; Eq 1 to 3).
//!
//! Camera coordinates follow the optical convention: x right, y down, z forward along the axis; a
//! point's depth is its z. Pixels follow OpenCV: the centre of the first one is (0, 0), so an image
//! covers -0.5 to `width_px` - 0.5. The skew of a camera matrix is not used, as in OpenCV.

use nalgebra::{Isometry3, Point3, Vector3};
use tilefold_schemas::log::CameraCalibration;

use crate::lens::{Lens, LensError};
use crate::surface::Surface;

/// What lies nearer than this along the optical axis is not projected, in metres.
pub const NEAR_M: f64 = 0.1;

/// Why a camera cannot be used.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum CameraError {
    /// Its lens.
    #[error(transparent)]
    Lens(#[from] LensError),
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

/// A camera on a vehicle.
#[derive(Debug, Clone, PartialEq)]
pub struct Camera {
    /// Width and height of its images; 0 where the log does not say.
    size_px: [u32; 2],
    focal_px: [f64; 2],
    centre_px: [f64; 2],
    lens: Lens,
    /// Its mounting.
    pub vehicle_from_camera: Isometry3<f64>,
}

impl Camera {
    /// The camera with the log's calibration, mounted at `vehicle_from_camera`.
    ///
    /// # Errors
    /// A lens that cannot be used, or a camera matrix without focal lengths.
    pub fn new(
        calibration: &CameraCalibration,
        vehicle_from_camera: Isometry3<f64>,
    ) -> Result<Self, CameraError> {
        let [fx, _, cx, _, fy, cy, ..] = calibration.k;
        if !(fx > 0.0 && fy > 0.0) {
            return Err(CameraError::Focal { fx, fy });
        }
        Ok(Self {
            size_px: [calibration.width_px, calibration.height_px],
            focal_px: [fx, fy],
            centre_px: [cx, cy],
            lens: Lens::new(&calibration.distortion_model, &calibration.d)?,
            vehicle_from_camera,
        })
    }

    /// The ray (camera frame) that a pixel sees; none beyond the lens model's trusted range.
    #[must_use]
    pub fn ray(&self, pixel: [f64; 2]) -> Option<Vector3<f64>> {
        self.lens.straighten([
            (pixel[0] - self.centre_px[0]) / self.focal_px[0],
            (pixel[1] - self.centre_px[1]) / self.focal_px[1],
        ])
    }

    /// Where a ray of the camera meets the road, in the vehicle frame, in metres; none if it does
    /// not.
    #[must_use]
    pub fn road_from_ray(&self, ray: Vector3<f64>, surface: &Surface) -> Option<[f64; 3]> {
        let origin = self.vehicle_from_camera.translation.vector;
        let hit = surface.meet(origin, self.vehicle_from_camera.rotation * ray)?;
        Some(hit.into())
    }

    /// Where a pixel's ray meets the road, in the vehicle frame, in metres; none if it does not or
    /// the lens model is not trusted there.
    #[must_use]
    pub fn road_from_pixel(&self, pixel: [f64; 2], surface: &Surface) -> Option<[f64; 3]> {
        self.road_from_ray(self.ray(pixel)?, surface)
    }

    /// The pixel at which a point of the camera frame is seen; none if it is nearer than
    /// [`NEAR_M`] or beyond the lens model's trusted range. It may lie outside the image.
    #[must_use]
    pub fn pixel_from_camera(&self, point_in_camera: Vector3<f64>) -> Option<[f64; 2]> {
        // Before the division: what is behind would come out mirrored.
        if point_in_camera.z < NEAR_M {
            return None;
        }
        let [x, y] = self.lens.bend(point_in_camera)?;
        Some([
            self.focal_px[0] * x + self.centre_px[0],
            self.focal_px[1] * y + self.centre_px[1],
        ])
    }

    /// As [`Self::pixel_from_camera`], of a point of the vehicle frame in metres.
    #[must_use]
    pub fn pixel_from_vehicle(&self, point_m: [f64; 3]) -> Option<[f64; 2]> {
        self.pixel_from_camera(self.camera_from_vehicle(point_m))
    }

    /// A point of the vehicle frame in the camera frame, in metres.
    pub(crate) fn camera_from_vehicle(&self, point_m: [f64; 3]) -> Vector3<f64> {
        let moved = self
            .vehicle_from_camera
            .inverse_transform_point(&Point3::from(point_m));
        moved.coords
    }

    /// Whether a pixel lies in the image.
    #[must_use]
    pub fn shows(&self, pixel: [f64; 2]) -> bool {
        let (low, high) = self.bounds_px();
        (0..2).all(|axis| (low[axis]..=high[axis]).contains(&pixel[axis]))
    }

    /// Column at which the optical axis is seen.
    pub(crate) fn axis_px(&self) -> f64 {
        self.centre_px[0]
    }

    /// First and last pixel coordinates of the image; without end where its size is not known.
    pub(crate) fn bounds_px(&self) -> ([f64; 2], [f64; 2]) {
        if self.size_px.contains(&0) {
            return ([f64::NEG_INFINITY; 2], [f64::INFINITY; 2]);
        }
        ([-0.5; 2], self.size_px.map(|size| f64::from(size) - 0.5))
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use nalgebra::{Matrix3, UnitQuaternion};

    /// Looking ahead, 1.4 m up, two degrees down.
    pub(crate) fn camera() -> Camera {
        let calibration = CameraCalibration {
            width_px: 1920,
            height_px: 1080,
            distortion_model: "plumb_bob".to_owned(),
            d: vec![-0.404, 0.149, 0.00106, 0.0005, 0.0],
            k: [1261.5, 0.0, 976.2, 0.0, 1147.0, 530.6, 0.0, 0.0, 1.0],
        };
        // Optical z is vehicle x.
        let axes = Matrix3::new(0.0, 0.0, 1.0, -1.0, 0.0, 0.0, 0.0, -1.0, 0.0);
        let level = UnitQuaternion::from_matrix(&axes);
        let down = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), 0.035);
        let mounting = Isometry3::from_parts(Vector3::new(1.5, 0.1, 1.4).into(), down * level);
        Camera::new(&calibration, mounting).unwrap()
    }

    #[test]
    fn the_road_point_of_a_pixel_is_seen_at_that_pixel() {
        let camera = camera();
        for surface in [Surface::FLAT, Surface { bend_per_m: 1e-3 }] {
            for pixel in [[976.0, 700.0], [300.0, 800.0], [1700.0, 900.0]] {
                let road = camera.road_from_pixel(pixel, &surface).unwrap();
                assert!((road[2] - surface.height_m(road[0])).abs() < 1e-9);
                let again = camera.pixel_from_vehicle(road).unwrap();
                assert!((again[0] - pixel[0]).hypot(again[1] - pixel[1]) < 1e-6);
            }
        }
    }

    #[test]
    fn the_sky_is_not_road_and_what_is_behind_is_not_seen() {
        let camera = camera();
        assert_eq!(camera.road_from_pixel([976.0, 200.0], &Surface::FLAT), None);
        assert_eq!(camera.pixel_from_vehicle([-5.0, 0.0, 0.0]), None);
        // A hand's breadth behind the lens would come out near the middle, mirrored.
        assert_eq!(camera.pixel_from_vehicle([1.45, 0.1, 1.4]), None);
    }
}
