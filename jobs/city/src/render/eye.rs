//! Where every pixel looks: rays of a lens, made once, and the camera's pose for every row, since a
//! rolling shutter reads them one after the other while the vehicle moves.

use nalgebra::{Isometry3, Point3};
use rayon::prelude::*;

use super::camera::Camera;
use super::vector::{V3, v3};

/// Directions (camera frame, length 1) of all pixels, row by row; not a number where the lens model
/// has no inverse.
pub(super) struct Rays {
    pub(super) width: usize,
    pub(super) height: usize,
    directions: Vec<V3>,
    /// The camera's `limit`.
    pub(super) limit: f64,
}

impl Rays {
    pub(super) fn new(camera: &Camera) -> Self {
        let (width, height) = (camera.width_px as usize, camera.height_px as usize);
        let direction = |index: usize| {
            let pixel = [(index % width) as f64, (index / width) as f64];
            camera
                .ray(pixel)
                .map_or(v3(f32::NAN, f32::NAN, f32::NAN), |[x, y, z]| {
                    v3(x as f32, y as f32, z as f32)
                })
        };
        Self {
            width,
            height,
            directions: (0..width * height).into_par_iter().map(direction).collect(),
            limit: camera.limit(),
        }
    }

    pub(super) fn at(&self, x: usize, y: usize) -> V3 {
        self.directions[y * self.width + x]
    }

    /// How the direction changes from a pixel to its right and to its lower neighbour.
    pub(super) fn slopes(&self, x: usize, y: usize) -> (V3, V3) {
        let (x0, y0) = (x.min(self.width - 2), y.min(self.height - 2));
        (
            self.at(x0 + 1, y) - self.at(x0, y),
            self.at(x, y0 + 1) - self.at(x, y0),
        )
    }

    /// The largest angle between the axis and a pixel's ray, as a cosine.
    pub(super) fn widest_cos(&self) -> f32 {
        let known = self
            .directions
            .iter()
            .filter(|direction| direction.z.is_finite());
        known.fold(1.0, |least, direction| direction.z.min(least))
    }
}

/// The camera at one moment: where it is, and its axes, in the local frame.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pose {
    pub(super) at: V3,
    right: V3,
    down: V3,
    pub(super) ahead: V3,
}

impl Pose {
    fn new(local_from_camera: &Isometry3<f64>) -> Self {
        let axis = |column: usize| {
            let axes = local_from_camera.rotation.to_rotation_matrix();
            let axis = axes.matrix().column(column).into_owned();
            v3(axis.x as f32, axis.y as f32, axis.z as f32)
        };
        let at = local_from_camera.translation.vector;
        Self {
            at: v3(at.x as f32, at.y as f32, at.z as f32),
            right: axis(0),
            down: axis(1),
            ahead: axis(2),
        }
    }

    /// A direction of the camera frame in the local frame.
    pub(super) fn turn(&self, direction: V3) -> V3 {
        self.right * direction.x + self.down * direction.y + self.ahead * direction.z
    }

    /// The opposite of [`Self::turn`].
    pub(super) fn turn_back(&self, direction: V3) -> V3 {
        v3(
            direction.dot(self.right),
            direction.dot(self.down),
            direction.dot(self.ahead),
        )
    }
}

/// The camera's way while a picture is taken.
pub(super) struct Way<'a> {
    pub(super) camera: &'a Camera,
    /// The vehicle when the first row's exposure begins and when the last row's ends.
    pub(super) local_from_vehicle: [Isometry3<f64>; 2],
    pub(super) exposure_s: f64,
}

impl Way<'_> {
    /// The camera's pose at a share of the picture's time.
    pub(super) fn local_from_camera(&self, share: f64) -> Isometry3<f64> {
        let [begin, end] = &self.local_from_vehicle;
        // Poses that are half a turn apart have no middle.
        let vehicle = begin.try_lerp_slerp(end, share, 1e-9).unwrap_or(*begin);
        vehicle * self.camera.vehicle_from_camera
    }

    /// The pose of a row when `part` (0 to 1) of its exposure is over.
    pub(super) fn pose(&self, row: f64, part: f64) -> Pose {
        Pose::new(&self.local_from_camera(self.share(row, part)))
    }

    fn share(&self, row: f64, part: f64) -> f64 {
        let whole_s = self.camera.readout_s + self.exposure_s;
        if whole_s <= 0.0 {
            return 0.0;
        }
        let rows = f64::from(self.camera.height_px.max(2) - 1);
        let row_s = self.camera.readout_s * (row / rows).clamp(0.0, 1.0);
        (row_s + part * self.exposure_s) / whole_s
    }

    /// The pixel at which a point of the local frame is seen in the middle of its row's exposure.
    pub(super) fn pixel(&self, point: [f64; 3], limit: f64) -> Option<[f64; 2]> {
        let mut row = f64::from(self.camera.height_px) / 2.0;
        let mut pixel = None;
        // The row decides when it is seen, and that decides the row.
        let rounds = if self.camera.readout_s > 0.0 { 4 } else { 1 };
        for _ in 0..rounds {
            let seen = self.in_camera(point, row);
            let [u, v] = self.camera.pixel_within(seen, limit)?;
            row = v;
            pixel = Some([u, v]);
        }
        pixel
    }

    /// A point of the local frame in the camera frame, in the middle of a row's exposure.
    pub(super) fn in_camera(&self, point: [f64; 3], row: f64) -> [f64; 3] {
        let local_from_camera = self.local_from_camera(self.share(row, 0.5));
        let seen = local_from_camera.inverse_transform_point(&Point3::from(point));
        [seen.x, seen.y, seen.z]
    }
}
