//! Cameras: lens models both ways, and where on the vehicle they are mounted.
//!
//! Camera frame: x right, y down, z along the axis. Pixels: the centre of the first one is (0, 0),
//! as in OpenCV, so that a picture covers -0.5 to `width_px` - 0.5.

use nalgebra::{Isometry3, Matrix2, Matrix3, Point3, Rotation3, UnitQuaternion, Vector2, Vector3};

/// Nothing nearer than this, along the axis, is projected.
pub(super) const NEAR_M: f64 = 0.1;
/// Newton steps of a lens model's inverse, and the step (normalised image units) at which it ends.
const INVERSE_STEPS: usize = 30;
const INVERSE_TOLERANCE: f64 = 1e-12;
/// How far off the axis a lens model is followed: tangent for the polynomial ones, angle for
/// fisheyes, and the step in which its turning point is looked for.
const MOST_TANGENT: f64 = 6.0;
const MOST_ANGLE_RAD: f64 = 1.65;
const TURN_STEP: f64 = 0.005;

/// How a lens bends rays: names and coefficients of OpenCV and ROS.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Lens {
    /// Not at all.
    Pinhole,
    /// Brown and Conrady, `plumb_bob`: k1, k2, p1, p2, k3.
    PlumbBob([f64; 5]),
    /// `rational_polynomial`: k1, k2, p1, p2, k3, k4, k5, k6.
    RationalPolynomial([f64; 8]),
    /// Fisheye, `equidistant` (Kannala and Brandt, 2006): k1, k2, k3, k4.
    KannalaBrandt([f64; 4]),
}

impl Lens {
    /// The name that logs have for it.
    #[must_use]
    pub fn name(&self) -> &'static str {
        match self {
            Self::Pinhole | Self::PlumbBob(_) => "plumb_bob",
            Self::RationalPolynomial(_) => "rational_polynomial",
            Self::KannalaBrandt(_) => "equidistant",
        }
    }

    /// The coefficients in the order in which logs carry them.
    #[must_use]
    pub fn coefficients(&self) -> Vec<f64> {
        match self {
            Self::Pinhole => vec![0.0; 5],
            Self::PlumbBob(d) => d.to_vec(),
            Self::RationalPolynomial(d) => d.to_vec(),
            Self::KannalaBrandt(d) => d.to_vec(),
        }
    }

    /// All polynomial models as the rational one.
    fn rational(&self) -> [f64; 8] {
        match *self {
            Self::RationalPolynomial(d) => d,
            Self::PlumbBob([k1, k2, p1, p2, k3]) => [k1, k2, p1, p2, k3, 0.0, 0.0, 0.0],
            Self::Pinhole | Self::KannalaBrandt(_) => [0.0; 8],
        }
    }
}

/// A camera on a vehicle.
#[derive(Debug, Clone, PartialEq)]
pub struct Camera {
    /// Size of its pictures in pixels.
    pub width_px: u32,
    /// Size of its pictures in pixels.
    pub height_px: u32,
    /// Focal lengths and centre in pixels: fx, fy, cx, cy.
    pub k: [f64; 4],
    /// Its lens.
    pub lens: Lens,
    /// Mounting. Vehicle frame: x ahead, y left, z up, origin on the ground.
    pub vehicle_from_camera: Isometry3<f64>,
    /// Seconds from the first row's read-out to the last one's; 0 for a global shutter.
    pub readout_s: f64,
}

impl Camera {
    /// A camera that looks ahead with a horizontal field of view, 1.4 m above the ground, a little
    /// downwards, with a global shutter.
    #[must_use]
    pub fn ahead(width_px: u32, height_px: u32, view_rad: f64) -> Self {
        let focal_px = f64::from(width_px) / 2.0 / (view_rad / 2.0).tan();
        let centre = |size_px: u32| (f64::from(size_px) - 1.0) / 2.0;
        Self {
            width_px,
            height_px,
            k: [focal_px, focal_px, centre(width_px), centre(height_px)],
            lens: Lens::Pinhole,
            vehicle_from_camera: mounting([1.6, 0.0, 1.4], [0.0, 0.05, 0.0]),
            readout_s: 0.0,
        }
    }

    /// The pixel at which a point of the camera frame is seen; none if it lies nearer than 0.1 m
    /// along the axis or where the lens model turns back.
    #[must_use]
    pub fn pixel(&self, point_m: [f64; 3]) -> Option<[f64; 2]> {
        self.pixel_within(point_m, self.limit())
    }

    /// As [`Self::pixel`], with the lens model's limit known.
    pub(super) fn pixel_within(&self, [x, y, z]: [f64; 3], limit: f64) -> Option<[f64; 2]> {
        if z < NEAR_M {
            return None;
        }
        let at = [x / z, y / z];
        let radius = at[0].hypot(at[1]);
        let off_axis = match self.lens {
            Lens::KannalaBrandt(_) => radius.atan(),
            _ => radius,
        };
        let [fx, fy, cx, cy] = self.k;
        let [dx, dy] = self.bend(at);
        (off_axis < limit).then_some([fx * dx + cx, fy * dy + cy])
    }

    /// The direction (camera frame, length 1) in which a pixel looks; none where the lens model has
    /// no inverse.
    #[must_use]
    pub fn ray(&self, pixel: [f64; 2]) -> Option<[f64; 3]> {
        let [fx, fy, cx, cy] = self.k;
        let bent = [(pixel[0] - cx) / fx, (pixel[1] - cy) / fy];
        let direction = match self.lens {
            Lens::KannalaBrandt(d) => fisheye_ray(d, bent)?,
            _ => {
                let [x, y] = self.straighten(bent)?;
                Vector3::new(x, y, 1.0)
            }
        };
        Some(direction.normalize().into())
    }

    /// How far off the axis the lens model is one-to-one: a tangent, or an angle for a fisheye.
    pub(super) fn limit(&self) -> f64 {
        let (most, radius): (f64, Box<dyn Fn(f64) -> f64>) = match self.lens {
            Lens::KannalaBrandt(d) => (MOST_ANGLE_RAD, Box::new(move |at| fisheye(d, at))),
            _ => {
                let d = self.lens.rational();
                (MOST_TANGENT, Box::new(move |at| at * radial(d, at * at)))
            }
        };
        let steps = (most / TURN_STEP) as u32;
        let turns = (1..=steps).find(|&step| {
            let at = TURN_STEP * f64::from(step);
            radius(at) <= radius(at - TURN_STEP)
        });
        turns.map_or(most, |step| TURN_STEP * f64::from(step - 1))
    }

    /// From a straight ray's tangents to the bent one's.
    fn bend(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        if let Lens::KannalaBrandt(d) = self.lens {
            let radius = x.hypot(y);
            let scale = if radius < 1e-12 {
                1.0
            } else {
                fisheye(d, radius.atan()) / radius
            };
            return [x * scale, y * scale];
        }
        let d = self.lens.rational();
        let [_, _, p1, p2, ..] = d;
        let r2 = x * x + y * y;
        let scale = radial(d, r2);
        [
            x * scale + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
            y * scale + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
        ]
    }

    /// Inverts [`Self::bend`] by Newton's method with a numerical Jacobian.
    fn straighten(&self, target: [f64; 2]) -> Option<[f64; 2]> {
        const H: f64 = 1e-6;
        if self.lens == Lens::Pinhole {
            return Some(target);
        }
        let mut at = [0.0, 0.0];
        for _ in 0..INVERSE_STEPS {
            let here = self.bend(at);
            let along_x = self.bend([at[0] + H, at[1]]);
            let along_y = self.bend([at[0], at[1] + H]);
            let slope = |along: [f64; 2], axis: usize| (along[axis] - here[axis]) / H;
            let jacobian = Matrix2::new(
                slope(along_x, 0),
                slope(along_y, 0),
                slope(along_x, 1),
                slope(along_y, 1),
            );
            // Where the polynomial turns back there is no inverse.
            if jacobian.determinant() <= 0.0 {
                return None;
            }
            let miss = Vector2::new(here[0] - target[0], here[1] - target[1]);
            let step = jacobian.try_inverse()? * miss;
            at = [at[0] - step.x, at[1] - step.y];
            if step.norm() < INVERSE_TOLERANCE {
                return Some(at);
            }
        }
        None
    }
}

/// Brown and Conrady's radial factor with OpenCV's denominator.
fn radial([k1, k2, _, _, k3, k4, k5, k6]: [f64; 8], r2: f64) -> f64 {
    (1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))) / (1.0 + r2 * (k4 + r2 * (k5 + r2 * k6)))
}

/// Distance from the centre, in focal lengths, of a ray at an angle off the axis.
fn fisheye([k1, k2, k3, k4]: [f64; 4], angle_rad: f64) -> f64 {
    let a2 = angle_rad * angle_rad;
    angle_rad * (1.0 + a2 * (k1 + a2 * (k2 + a2 * (k3 + a2 * k4))))
}

fn fisheye_ray(d: [f64; 4], [x, y]: [f64; 2]) -> Option<Vector3<f64>> {
    const H: f64 = 1e-6;
    let target = x.hypot(y);
    if target < 1e-12 {
        return Some(Vector3::z());
    }
    let mut angle_rad = target.min(MOST_ANGLE_RAD);
    for _ in 0..INVERSE_STEPS {
        let slope = (fisheye(d, angle_rad + H) - fisheye(d, angle_rad - H)) / (2.0 * H);
        if slope <= 0.0 || angle_rad > MOST_ANGLE_RAD + 0.5 {
            return None;
        }
        let step = (fisheye(d, angle_rad) - target) / slope;
        angle_rad -= step;
        if step.abs() < INVERSE_TOLERANCE {
            let (sin, cos) = angle_rad.sin_cos();
            let ray = Vector3::new(x / target * sin, y / target * sin, cos);
            return (angle_rad <= MOST_ANGLE_RAD).then_some(ray);
        }
    }
    None
}

/// A mounting (vehicle from camera): where the camera sits in the vehicle frame (metres), and how it
/// is turned from looking straight ahead: roll, pitch (positive looks down) and yaw, in radians.
#[must_use]
pub fn mounting(at_m: [f64; 3], [roll, pitch, yaw]: [f64; 3]) -> Isometry3<f64> {
    // Optical z is the vehicle's x, optical x its right.
    let axes = Matrix3::new(0.0, 0.0, 1.0, -1.0, 0.0, 0.0, 0.0, -1.0, 0.0);
    let ahead = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes));
    let turned = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
    Isometry3::from_parts(Point3::from(at_m).into(), turned * ahead)
}

#[cfg(test)]
mod tests;
