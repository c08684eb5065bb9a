//! Lens models: how a lens bends the rays that enter a camera, and back.
//!
//! Coordinates behind the lens are in focal lengths. Three models are known, under the names that
//! ROS and Foxglove have for them; the polynomials are those of OpenCV. Every model is followed
//! only as far off the axis as its polynomial grows: beyond its turning point two rays share a
//! pixel, and nothing there is projected or undistorted.

use nalgebra::{Matrix2, Vector2, Vector3};

/// Newton steps of undistortion; it converges quadratically, 30 is far more than it takes.
const STEPS: usize = 30;
/// Undistortion has converged when a step is shorter than this, in focal lengths.
const TOLERANCE: f64 = 1e-13;
/// What is left of an undistortion that has not converged by then may be this, in focal lengths.
const MISS: f64 = 1e-10;
/// No polynomial model is followed beyond this tangent (80 degrees off the axis)...
const MOST_TANGENT: f64 = 6.0;
/// ... and no fisheye beyond this angle, a little behind the camera.
const MOST_ANGLE_RAD: f64 = 1.8;
/// The turning point of a polynomial is looked for in steps of this size, then halved down to.
const TURN_STEP: f64 = 0.005;

/// Why a lens cannot be used.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum LensError {
    /// A lens model that is not known here.
    #[error(
        "the distortion model `{0}` is not supported; known are plumb_bob, rational_polynomial, \
         equidistant, fisheye and kannala_brandt, and none with coefficients of 0"
    )]
    Model(String),
    /// Another number of coefficients than the model has.
    #[error("the distortion model `{model}` has {got} coefficients; it takes {wanted}")]
    Coefficients {
        /// The model.
        model: String,
        /// Coefficients that the log gives.
        got: usize,
        /// What the model takes.
        wanted: &'static str,
    },
    /// A coefficient that is not a number.
    #[error("coefficient {index} of the distortion is not finite")]
    NotFinite {
        /// Which, counted from 0.
        index: usize,
    },
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Model {
    /// Brown and Conrady with OpenCV's rational radial term: k1, k2, p1, p2, k3, k4, k5, k6.
    Polynomial([f64; 8]),
    /// Kannala and Brandt (2006), symmetric: k1, k2, k3, k4.
    Fisheye([f64; 4]),
}

/// A lens.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lens {
    model: Model,
    /// How far off the axis the model is one-to-one: a tangent, or an angle for a fisheye.
    limit: f64,
}

impl Lens {
    /// The lens of a log's calibration. No coefficients, or only zeros, are a lens that bends
    /// nothing, under any of the polynomial names.
    ///
    /// # Errors
    /// An unknown model, or another number of coefficients than it has.
    pub fn new(name: &str, d: &[f64]) -> Result<Self, LensError> {
        if let Some(index) = d.iter().position(|value| !value.is_finite()) {
            return Err(LensError::NotFinite { index });
        }
        let model = match name {
            "plumb_bob" => Model::Polynomial(coefficients(
                name,
                d,
                &[0, 4, 5],
                "4 or 5, or none for an image without distortion",
            )?),
            "rational_polynomial" => Model::Polynomial(rational(name, d)?),
            "equidistant" | "fisheye" | "kannala_brandt" => {
                Model::Fisheye(coefficients(name, d, &[4], "4")?)
            }
            "" | "none" if d.iter().all(|&value| value == 0.0) => Model::Polynomial([0.0; 8]),
            other => return Err(LensError::Model(other.to_owned())),
        };
        Ok(Self {
            model,
            limit: limit(&model),
        })
    }

    /// Where a ray (camera frame, before the camera, any length) is behind the lens; none beyond
    /// the trusted range.
    #[must_use]
    pub fn bend(&self, ray: Vector3<f64>) -> Option<[f64; 2]> {
        let side = ray.x.hypot(ray.y);
        match self.model {
            Model::Polynomial(d) => {
                let at = Vector2::new(ray.x / ray.z, ray.y / ray.z);
                // Written so that NaN is beyond any limit.
                (ray.z > 0.0 && at.norm() < self.limit).then(|| polynomial(d, at).0.into())
            }
            Model::Fisheye(k) => {
                let angle_rad = side.atan2(ray.z);
                let bent = fisheye(k, angle_rad).0;
                let scale = if side > 0.0 { bent / side } else { 0.0 };
                (angle_rad < self.limit).then_some([ray.x * scale, ray.y * scale])
            }
        }
    }

    /// The ray (camera frame) that comes to this place behind the lens; none beyond the trusted
    /// range.
    #[must_use]
    pub fn straighten(&self, [x, y]: [f64; 2]) -> Option<Vector3<f64>> {
        let target = Vector2::new(x, y);
        match self.model {
            Model::Polynomial(d) => {
                let at = straighten_polynomial(d, target, self.limit)?;
                Some(Vector3::new(at.x, at.y, 1.0))
            }
            Model::Fisheye(k) => {
                let radius = target.norm();
                let (sin, cos) = straighten_fisheye(k, radius, self.limit)?.sin_cos();
                let scale = if radius > 0.0 { sin / radius } else { 0.0 };
                Some(Vector3::new(x * scale, y * scale, cos))
            }
        }
    }

    /// How far off the axis the lens is trusted, in radians.
    #[must_use]
    pub fn trusted_rad(&self) -> f64 {
        match self.model {
            Model::Polynomial(_) => self.limit.atan(),
            Model::Fisheye(_) => self.limit,
        }
    }
}

/// The first coefficients of a model, if their number is one of `counts`; the rest are 0.
fn coefficients<const N: usize>(
    model: &str,
    d: &[f64],
    counts: &[usize],
    wanted: &'static str,
) -> Result<[f64; N], LensError> {
    if !counts.contains(&d.len()) {
        return Err(LensError::Coefficients {
            model: model.to_owned(),
            got: d.len(),
            wanted,
        });
    }
    let mut all = [0.0; N];
    for (to, from) in all.iter_mut().zip(d) {
        *to = *from;
    }
    Ok(all)
}

/// OpenCV also writes 12 or 14 coefficients, of which those past the eighth (thin prism, tilted
/// sensor) are 0 unless they were asked for.
fn rational(model: &str, d: &[f64]) -> Result<[f64; 8], LensError> {
    let has_no_more = d.iter().skip(8).all(|&value| value == 0.0);
    let kept = if has_no_more && [12, 14].contains(&d.len()) {
        &d[..8]
    } else {
        d
    };
    let wanted = "8, or none for an image without distortion; further ones must be 0";
    coefficients(model, kept, &[0, 8], wanted)
}

/// The bent place of a tangent, and the symmetric matrix of its derivatives.
fn polynomial(d: [f64; 8], at: Vector2<f64>) -> (Vector2<f64>, Matrix2<f64>) {
    let [_, _, p1, p2, ..] = d;
    let (x, y) = (at.x, at.y);
    let r2 = at.norm_squared();
    let (radial, slope) = radial(d, r2);
    let bent = Vector2::new(
        x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
        y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
    );
    let mixed = 2.0 * (x * y * slope + p1 * x + p2 * y);
    let derivative = Matrix2::new(
        radial + 2.0 * (x * x * slope + p1 * y + 3.0 * p2 * x),
        mixed,
        mixed,
        radial + 2.0 * (y * y * slope + 3.0 * p1 * y + p2 * x),
    );
    (bent, derivative)
}

/// The radial factor, and its derivative by the squared radius.
fn radial([k1, k2, _, _, k3, k4, k5, k6]: [f64; 8], r2: f64) -> (f64, f64) {
    let over = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
    let under = 1.0 + r2 * (k4 + r2 * (k5 + r2 * k6));
    let over_slope = k1 + r2 * (2.0 * k2 + r2 * 3.0 * k3);
    let under_slope = k4 + r2 * (2.0 * k5 + r2 * 3.0 * k6);
    let slope = (over_slope * under - over * under_slope) / (under * under);
    (over / under, slope)
}

/// Distance from the centre of a ray at an angle off the axis, and its derivative.
fn fisheye([k1, k2, k3, k4]: [f64; 4], angle_rad: f64) -> (f64, f64) {
    let a2 = angle_rad * angle_rad;
    (
        angle_rad * (1.0 + a2 * (k1 + a2 * (k2 + a2 * (k3 + a2 * k4)))),
        1.0 + a2 * (3.0 * k1 + a2 * (5.0 * k2 + a2 * (7.0 * k3 + a2 * 9.0 * k4))),
    )
}

/// Where the radius behind the lens stops growing, or where the model is no longer followed.
fn limit(model: &Model) -> f64 {
    let (most, grows): (f64, &dyn Fn(f64) -> bool) = match model {
        Model::Fisheye(k) => (MOST_ANGLE_RAD, &|at| fisheye(*k, at).1 > 0.0),
        Model::Polynomial(d) => (MOST_TANGENT, &|at| {
            let r2 = at * at;
            let (factor, slope) = radial(*d, r2);
            // The factor turns negative behind a pole of the rational term.
            factor > 0.0 && factor + 2.0 * r2 * slope > 0.0
        }),
    };
    let steps = (most / TURN_STEP) as u32;
    let turn = (1..=steps).find(|&step| !grows(TURN_STEP * f64::from(step)));
    let Some(turn) = turn else {
        return most;
    };
    let (mut low, mut high) = (TURN_STEP * f64::from(turn - 1), TURN_STEP * f64::from(turn));
    for _ in 0..40 {
        let middle = 0.5 * (low + high);
        if grows(middle) {
            low = middle;
        } else {
            high = middle;
        }
    }
    low
}

/// Inverts [`polynomial`] by Newton's method within the trusted range.
fn straighten_polynomial(d: [f64; 8], target: Vector2<f64>, limit: f64) -> Option<Vector2<f64>> {
    let mut at = within(target, limit);
    for _ in 0..STEPS {
        let (bent, derivative) = polynomial(d, at);
        if derivative.determinant() <= 0.0 {
            return None;
        }
        let next = within(at - derivative.try_inverse()? * (bent - target), limit);
        let moved = (next - at).norm();
        at = next;
        if moved < TOLERANCE {
            break;
        }
    }
    let miss = (polynomial(d, at).0 - target).norm();
    (miss < MISS && at.norm() < limit).then_some(at)
}

/// A tangent, drawn back to the limit if it lies beyond.
fn within(at: Vector2<f64>, limit: f64) -> Vector2<f64> {
    let radius = at.norm();
    if radius > limit {
        at * (limit / radius)
    } else {
        at
    }
}

/// Inverts [`fisheye`] by Newton's method, halving where it would leave the bracket.
fn straighten_fisheye(k: [f64; 4], radius: f64, limit: f64) -> Option<f64> {
    let (mut low, mut high) = (0.0, limit);
    if radius.is_nan() || radius >= fisheye(k, limit).0 {
        return None;
    }
    let mut angle_rad = radius.min(limit);
    for _ in 0..2 * STEPS {
        let (bent, slope) = fisheye(k, angle_rad);
        if bent > radius {
            high = angle_rad;
        } else {
            low = angle_rad;
        }
        let newton = angle_rad - (bent - radius) / slope;
        let next = if low <= newton && newton <= high {
            newton
        } else {
            0.5 * (low + high)
        };
        let moved = (next - angle_rad).abs();
        angle_rad = next;
        if moved < TOLERANCE {
            break;
        }
    }
    Some(angle_rad)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn lenses_without_coefficients_bend_nothing() {
        let ray = Vector3::new(0.6, -0.2, 2.0);
        for name in ["", "none", "plumb_bob", "rational_polynomial"] {
            let bent = Lens::new(name, &[]).unwrap().bend(ray).unwrap();
            assert!(
                (bent[0] - 0.3).abs() < 1e-15 && (bent[1] + 0.1).abs() < 1e-15,
                "{name}"
            );
        }
        assert!(Lens::new("none", &[0.0; 5]).is_ok());
    }

    #[test]
    fn wrong_numbers_of_coefficients_are_named() {
        let message =
            |name: &str, count: usize| Lens::new(name, &vec![0.1; count]).unwrap_err().to_string();
        assert_eq!(
            message("plumb_bob", 3),
            "the distortion model `plumb_bob` has 3 coefficients; it takes 4 or 5, or none for an \
             image without distortion"
        );
        assert!(message("equidistant", 5).ends_with("it takes 4"));
        assert!(message("rational_polynomial", 12).contains("has 12 coefficients"));
        assert!(message("fisheye62", 8).contains("`fisheye62` is not supported"));
        assert!(message("", 1).contains("is not supported"));
        let mut thin_prism = vec![0.1; 8];
        thin_prism.extend([0.0; 4]);
        assert!(Lens::new("rational_polynomial", &thin_prism).is_ok());
        let not_finite = Lens::new("plumb_bob", &[0.0, f64::NAN, 0.0, 0.0]);
        assert_eq!(not_finite, Err(LensError::NotFinite { index: 1 }));
    }

    #[test]
    fn a_polynomial_is_trusted_up_to_where_it_turns_back() {
        // r (1 - 0.3 r^2) turns at r = sqrt(1 / 0.9).
        let lens = Lens::new("plumb_bob", &[-0.3, 0.0, 0.0, 0.0]).unwrap();
        let turn = (1.0_f64 / 0.9).sqrt();
        assert!((lens.trusted_rad() - turn.atan()).abs() < 1e-9);
        assert!(lens.bend(Vector3::new(turn - 1e-3, 0.0, 1.0)).is_some());
        assert_eq!(lens.bend(Vector3::new(turn + 1e-3, 0.0, 1.0)), None);
        let farthest = turn * (1.0 - 0.3 * turn * turn);
        assert!(lens.straighten([farthest - 1e-3, 0.0]).is_some());
        assert_eq!(lens.straighten([farthest + 1e-3, 0.0]), None);
        assert_eq!(lens.straighten([f64::NAN, 0.0]), None);
    }

    #[test]
    fn a_fisheye_is_trusted_up_to_where_it_turns_back() {
        // a (1 - 0.2 a^2) turns at a = sqrt(1 / 0.6).
        let lens = Lens::new("fisheye", &[-0.2, 0.0, 0.0, 0.0]).unwrap();
        let turn = (1.0_f64 / 0.6).sqrt();
        assert!((lens.trusted_rad() - turn).abs() < 1e-9);
        let ray = |angle: f64| Vector3::new(0.0, angle.sin(), angle.cos());
        assert!(lens.bend(ray(turn - 1e-3)).is_some());
        assert_eq!(lens.bend(ray(turn + 1e-3)), None);
        assert_eq!(
            lens.straighten([0.0, turn * (1.0 - 0.2 * turn * turn) + 1e-3]),
            None
        );
        assert_eq!(lens.straighten([f64::NAN, 0.0]), None);
    }

    #[test]
    fn a_fisheye_sees_to_the_side() {
        let lens = Lens::new("equidistant", &[0.0; 4]).unwrap();
        let bent = lens.bend(Vector3::new(1.0, 0.0, 0.0)).unwrap();
        assert!((bent[0] - std::f64::consts::FRAC_PI_2).abs() < 1e-15);
        assert_eq!(lens.bend(Vector3::new(0.0, 0.0, -1.0)), None);
    }

    fn lenses() -> impl Strategy<Value = Lens> {
        let small = || -0.4..0.3_f64;
        prop_oneof![
            [
                small(),
                -0.1..0.1,
                -0.003..0.003,
                -0.003..0.003,
                -0.05..0.05
            ]
            .prop_map(|d| Lens::new("plumb_bob", &d).unwrap()),
            (small(), small(), small(), -0.002..0.002, -0.002..0.002).prop_map(
                |(a, b, c, p, q)| {
                    Lens::new(
                        "rational_polynomial",
                        &[a, 0.1, p, q, 0.02, b, 0.1 * c, 0.01],
                    )
                    .unwrap()
                }
            ),
            [-0.1..0.1, -0.05..0.05, -0.02..0.02, -0.01..0.01_f64].prop_map(|d| Lens::new(
                "kannala_brandt",
                &d
            )
            .unwrap()),
        ]
    }

    proptest! {
        #[test]
        fn straightening_undoes_bending(
            lens in lenses(), share in 0.0..0.95_f64, around in 0.0..6.3_f64,
        ) {
            let angle = share * lens.trusted_rad();
            let side = angle.sin();
            let ray = Vector3::new(side * around.cos(), side * around.sin(), angle.cos());
            let again = lens.straighten(lens.bend(ray).unwrap());
            // Decentring may turn back earlier than the radius does; then nothing is said.
            if let Some(again) = again {
                prop_assert!(again.angle(&ray) < 1e-7, "{ray:?} {again:?}");
            } else {
                prop_assert!(share > 0.6, "{share}");
            }
        }
    }
}
