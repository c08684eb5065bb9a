//! The road around a vehicle: a plane under its wheels that bends up or down ahead.
//!
//! The vehicle frame tilts with the road under the wheels, so a slope that goes on is flat in it;
//! what moves a projected line is the change of the slope. It is taken from the map's heights,
//! relative to each other: neither GNSS altitude nor the map's datum matters. A map without heights
//! is flat.

use nalgebra::{Matrix4, Vector3, Vector4};
use rstar::primitives::GeomWithData;
use rstar::{AABB, RTree};
use tilefold_tiler::geodesy::LocalFrame;
use tilefold_tiler::station::Polyline;

use crate::local_map::LocalMap;
use crate::pose::Pose;

/// Heights of the map are sampled this far from each other along its lines, in metres.
const SAMPLE_M: f64 = 4.0;
/// The road from this far behind the vehicle to this far ahead is looked at, in metres.
const AHEAD_M: (f64, f64) = (-20.0, 35.0);
/// ... and this far to either side.
const SIDE_M: f64 = 12.0;
/// The samples must span at least this much behind and ahead of the vehicle, in metres.
const SPAN_M: (f64, f64) = (-8.0, 20.0);
/// Fewer samples make no surface.
const MIN_SAMPLES: usize = 10;
/// Roads are not steeper; what is, is another level of the map.
const MAX_GRADE: f64 = 0.2;
/// Heights of neighbouring lines differ by this much for kerbs and noise, in metres.
const STEP_M: f64 = 0.4;
/// A road bends no more than this, per metre: a crest with a radius of 100 m.
const MAX_BEND_PER_M: f64 = 0.01;
/// A fit that misses its samples by more than this has no surface, in metres.
const MAX_MISS_M: f64 = 0.2;

/// The road in the vehicle frame: `z = bend / 2 * x^2`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Surface {
    /// Change of the slope per metre ahead; positive before a rise.
    pub bend_per_m: f64,
}

impl Surface {
    /// The plane z = 0.
    pub const FLAT: Self = Self { bend_per_m: 0.0 };

    /// Height at a range ahead, in metres.
    #[must_use]
    pub fn height_m(&self, ahead_m: f64) -> f64 {
        0.5 * self.bend_per_m * ahead_m * ahead_m
    }

    /// Where a ray from `origin` first meets the road from above (vehicle frame, metres).
    #[must_use]
    pub fn meet(&self, origin: Vector3<f64>, ray: Vector3<f64>) -> Option<Vector3<f64>> {
        // a s^2 + b s - c = 0, in the form of the root that stays good as a goes to 0.
        let a = 0.5 * self.bend_per_m * ray.x * ray.x;
        let b = self.bend_per_m * origin.x * ray.x - ray.z;
        let c = origin.z - self.height_m(origin.x);
        let square = b * b + 4.0 * a * c;
        let under = b + square.sqrt();
        let hit = origin + ray * (2.0 * c / under);
        (c > 0.0 && under > 1e-6 && hit.iter().all(|value| value.is_finite())).then_some(hit)
    }
}

/// Heights along the lines of a map.
#[derive(Debug)]
pub struct Heights {
    samples: RTree<GeomWithData<[f64; 2], f64>>,
}

impl Heights {
    /// The heights of the lines around a chunk; none if the map has none, or all the same.
    #[must_use]
    pub fn of(map: &LocalMap<'_>, frame: &LocalFrame) -> Option<Self> {
        let mut samples = Vec::new();
        for local in &map.lines {
            let points = local.mapped.element.points.iter();
            let raised = points.map(|&[longitude_deg, latitude_deg, height_m]| {
                let [east_m, north_m, _] = frame.to_enu([longitude_deg, latitude_deg, 0.0]);
                [east_m, north_m, height_m]
            });
            if let Ok(line) = Polyline::new(raised) {
                samples.extend(along(&line));
            }
        }
        let first = samples.first()?.data;
        let is_level = samples.iter().all(|sample| sample.data == first);
        (!is_level).then(|| Self {
            samples: RTree::bulk_load(samples),
        })
    }

    /// The road around a pose.
    #[must_use]
    pub fn around(&self, pose: &Pose) -> Surface {
        let place = [pose.east_m, pose.north_m];
        let Some(own) = self.samples.nearest_neighbor(place) else {
            return Surface::FLAT;
        };
        let far_m = AHEAD_M.1.hypot(SIDE_M);
        let low = place.map(|metres| metres - far_m);
        let high = place.map(|metres| metres + far_m);
        let near = self
            .samples
            .locate_in_envelope(AABB::from_corners(low, high));
        let mut samples: Vec<[f64; 3]> = near
            .map(|sample| {
                let [ahead_m, left_m] = pose.vehicle_from_local(*sample.geom());
                [ahead_m, left_m, sample.data - own.data]
            })
            .filter(|&[ahead_m, left_m, height_m]| {
                (AHEAD_M.0..=AHEAD_M.1).contains(&ahead_m)
                    && left_m.abs() <= SIDE_M
                    && height_m.abs() <= STEP_M + MAX_GRADE * ahead_m.hypot(left_m)
            })
            .collect();
        // The tree's order is its own; sums must not depend on it.
        samples.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
        fit(&samples).unwrap_or(Surface::FLAT)
    }
}

/// Samples of a line, of which the third coordinate is the height.
fn along(line: &Polyline) -> impl Iterator<Item = GeomWithData<[f64; 2], f64>> + '_ {
    let steps = (line.length_m() / SAMPLE_M).ceil().max(1.0);
    (0..=steps as u32).map(move |step| {
        let [east_m, north_m, height_m] = line.at(line.length_m() * f64::from(step) / steps).point;
        GeomWithData::new([east_m, north_m], height_m)
    })
}

/// Least squares of `z = c + x grade + y tilt + x^2 bend / 2`; what is left of height, grade and
/// tilt under the wheels is the vehicle's own.
fn fit(samples: &[[f64; 3]]) -> Option<Surface> {
    let (first, last) = (samples.first()?, samples.last()?);
    if samples.len() < MIN_SAMPLES || first[0] > SPAN_M.0 || last[0] < SPAN_M.1 {
        return None;
    }
    let mut normal = Matrix4::zeros();
    let mut right = Vector4::zeros();
    for &sample in samples {
        let row = row(sample);
        normal += row * row.transpose();
        right += row * sample[2];
    }
    let solved = normal.cholesky()?.solve(&right);
    let square_m2 = |sample: &[f64; 3]| (row(*sample).dot(&solved) - sample[2]).powi(2);
    let miss_m2 = samples.iter().map(square_m2).sum::<f64>() / samples.len() as f64;
    let bend_per_m = solved[3];
    // Written so that NaN is no surface.
    (miss_m2 <= MAX_MISS_M * MAX_MISS_M && bend_per_m.abs() <= MAX_BEND_PER_M)
        .then_some(Surface { bend_per_m })
}

fn row([ahead_m, left_m, _]: [f64; 3]) -> Vector4<f64> {
    Vector4::new(1.0, ahead_m, left_m, 0.5 * ahead_m * ahead_m)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Points every 5 m on both sides of a way with this height.
    fn road(height_m: impl Fn(f64, f64) -> f64) -> Vec<[f64; 3]> {
        let ahead = (-4..=6).map(|step| 5.0 * f64::from(step));
        let both = ahead.flat_map(|x| [[x, -1.8], [x, 1.8]]);
        both.map(|[x, y]| [x, y, height_m(x, y)]).collect()
    }

    #[test]
    fn a_steady_slope_is_flat_for_the_vehicle_on_it() {
        let surface = fit(&road(|x, y| 7.0 + 0.08 * x - 0.02 * y)).unwrap();
        assert!(surface.bend_per_m.abs() < 1e-12);
    }

    #[test]
    fn a_crest_bends_down() {
        let surface = fit(&road(|x, _| -x * x / (2.0 * 500.0))).unwrap();
        assert!((surface.bend_per_m + 1.0 / 500.0).abs() < 1e-12);
        assert!((surface.height_m(20.0) + 0.4).abs() < 1e-9);
    }

    #[test]
    fn heights_that_make_no_surface_are_not_believed() {
        assert_eq!(fit(&road(|x, _| 0.5 * (x / 3.0).sin())), None, "waves");
        assert_eq!(fit(&road(|x, _| 0.02 * x * x)), None, "a wall");
        let ahead: Vec<_> = road(|_, _| 0.0).split_off(12);
        assert_eq!(fit(&ahead), None, "only ahead");
        assert_eq!(fit(&[]), None);
    }

    #[test]
    fn rays_that_miss_the_road_have_no_place() {
        let origin = Vector3::new(1.0, 0.0, 1.4);
        assert_eq!(
            Surface::FLAT.meet(origin, Vector3::new(1.0, 0.0, 0.0)),
            None
        );
        assert_eq!(
            Surface::FLAT.meet(origin, Vector3::new(1.0, 0.0, 0.1)),
            None
        );
        let crest = Surface { bend_per_m: -0.01 };
        assert_eq!(
            crest.meet(origin, Vector3::new(1.0, 0.0, -0.01)),
            None,
            "over the crest"
        );
        let rise = Surface { bend_per_m: 0.01 };
        assert!(
            rise.meet(origin, Vector3::new(1.0, 0.0, 0.01)).is_some(),
            "against the rise"
        );
    }

    proptest! {
        #[test]
        fn where_a_ray_meets_the_road_is_on_both(
            bend_per_m in -0.005..0.005_f64,
            at in (-2.0..2.0_f64, -1.0..1.0_f64, 0.8..2.5_f64),
            to in (3.0..25.0_f64, -8.0..8.0_f64),
        ) {
            let surface = Surface { bend_per_m };
            let origin = Vector3::new(at.0, at.1, at.2 + 0.1);
            let target = Vector3::new(to.0, to.1, surface.height_m(to.0));
            let hit = surface.meet(origin, 0.37 * (target - origin)).unwrap();
            // A crest may hide the target behind itself.
            prop_assert!((hit - target).norm() < 1e-6 || hit.x < target.x);
            prop_assert!((hit.z - surface.height_m(hit.x)).abs() < 1e-9);
            if bend_per_m >= 0.0 {
                prop_assert!((hit - target).norm() < 1e-6);
            }
        }
    }
}
