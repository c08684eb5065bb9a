//! Lines of the vehicle frame as a camera shows them: cut off at the near plane, at the edge of the
//! lens model's trusted range, and at the borders of the image.

use nalgebra::Vector3;

use crate::camera::{Camera, NEAR_M};

/// A lens bends straight lines: they are followed in steps of this share of the depth, so that none
/// crosses much of the image, and in steps no longer than this, in metres.
const STEP_PER_DEPTH: f64 = 0.1;
const STEP_M: f64 = 0.5;
/// Halvings that find where a line leaves the trusted range: to a thousandth of a millimetre.
const HALVINGS: usize = 20;

impl Camera {
    /// The pieces of a polyline (vehicle frame, metres) that are in the image, in pixels, in the
    /// order of the line.
    #[must_use]
    pub fn view(&self, line_m: &[[f64; 3]]) -> Vec<Vec<[f64; 2]>> {
        let mut pieces = Pieces::default();
        for pair in line_m.windows(2) {
            let ends = [pair[0], pair[1]].map(|point| self.camera_from_vehicle(point));
            match before_the_camera(ends) {
                Some(ends) => self.follow(ends, &mut pieces),
                None => pieces.end(),
            }
        }
        pieces.end();
        pieces.done
    }

    /// Follows a segment that lies before the near plane.
    fn follow(&self, [from, to]: [Vector3<f64>; 2], pieces: &mut Pieces) {
        let length_m = (to - from).norm();
        let mut way_m = 0.0;
        while way_m < length_m {
            let here = from.lerp(&to, way_m / length_m);
            way_m += (STEP_PER_DEPTH * here.z).min(STEP_M);
            let (from, to) = (here, from.lerp(&to, (way_m / length_m).min(1.0)));
            let trusted = self.trusted([from, to]);
            let clipped = trusted.and_then(|ends| clip(ends, self.bounds_px()));
            match clipped {
                Some(ends) => pieces.add(ends),
                None => pieces.end(),
            }
        }
    }

    /// The pixels of the ends of a short segment, of which one may be moved to the edge of the
    /// trusted range; none if both are beyond.
    fn trusted(&self, [from, to]: [Vector3<f64>; 2]) -> Option<[[f64; 2]; 2]> {
        match [from, to].map(|point| self.pixel_from_camera(point)) {
            [Some(from), Some(to)] => Some([from, to]),
            [Some(seen), None] => Some([seen, self.edge(from, to)?]),
            [None, Some(seen)] => Some([self.edge(to, from)?, seen]),
            [None, None] => None,
        }
    }

    /// The last pixel on the way from a point in the trusted range to one beyond it.
    fn edge(&self, mut inside: Vector3<f64>, mut beyond: Vector3<f64>) -> Option<[f64; 2]> {
        for _ in 0..HALVINGS {
            let middle = inside.lerp(&beyond, 0.5);
            if self.pixel_from_camera(middle).is_some() {
                inside = middle;
            } else {
                beyond = middle;
            }
        }
        self.pixel_from_camera(inside)
    }
}

/// The part of a segment (camera frame) that lies before the near plane.
fn before_the_camera([from, to]: [Vector3<f64>; 2]) -> Option<[Vector3<f64>; 2]> {
    let on_plane = || {
        let mut point = from.lerp(&to, (NEAR_M - from.z) / (to.z - from.z));
        // Rounding must not put it behind again.
        point.z = NEAR_M;
        point
    };
    match [from, to].map(|point| point.z >= NEAR_M) {
        [true, true] => Some([from, to]),
        [true, false] => Some([from, on_plane()]),
        [false, true] => Some([on_plane(), to]),
        [false, false] => None,
    }
}

/// The part of a segment in the box from `low` to `high` (Liang and Barsky, 1984).
fn clip([from, to]: [[f64; 2]; 2], (low, high): ([f64; 2], [f64; 2])) -> Option<[[f64; 2]; 2]> {
    let (mut enters, mut leaves) = (0.0_f64, 1.0_f64);
    for axis in 0..2 {
        let along = to[axis] - from[axis];
        if along == 0.0 && !(low[axis] <= from[axis] && from[axis] <= high[axis]) {
            return None;
        }
        if along != 0.0 {
            let ends = [low[axis], high[axis]].map(|border| (border - from[axis]) / along);
            enters = enters.max(ends[0].min(ends[1]));
            leaves = leaves.min(ends[0].max(ends[1]));
        }
    }
    let at = |share: f64| [0, 1].map(|axis| from[axis] + share * (to[axis] - from[axis]));
    let start = if enters > 0.0 { at(enters) } else { from };
    let end = if leaves < 1.0 { at(leaves) } else { to };
    (enters <= leaves).then_some([start, end])
}

/// Pieces of a line, joined where one begins at the end of the last.
#[derive(Debug, Default)]
struct Pieces {
    done: Vec<Vec<[f64; 2]>>,
    open: Vec<[f64; 2]>,
}

impl Pieces {
    fn add(&mut self, [from, to]: [[f64; 2]; 2]) {
        if self.open.last() != Some(&from) {
            self.end();
            self.open.push(from);
        }
        self.open.push(to);
    }

    fn end(&mut self) {
        let piece = std::mem::take(&mut self.open);
        if piece.len() >= 2 {
            self.done.push(piece);
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::camera::tests::camera;
    use proptest::prelude::*;

    #[test]
    fn a_line_from_behind_comes_in_at_the_border() {
        let camera = camera();
        let pieces = camera.view(&[[-20.0, 1.8, 0.0], [60.0, 1.8, 0.0]]);
        assert_eq!(pieces.len(), 1, "{pieces:?}");
        let (first, last) = (pieces[0][0], pieces[0][pieces[0].len() - 1]);
        // It enters at the lower border or the left one, and ends below the horizon.
        assert!(first[1] > 1079.0 || first[0] < 0.0, "{first:?}");
        let end = camera.pixel_from_vehicle([60.0, 1.8, 0.0]).unwrap();
        assert!((last[0] - end[0]).hypot(last[1] - end[1]) < 1e-9);
        assert!(pieces[0].windows(2).all(|pair| pair[1][1] < pair[0][1]));
    }

    #[test]
    fn a_line_beside_or_behind_the_vehicle_is_not_seen() {
        assert!(
            camera()
                .view(&[[-20.0, 0.0, 0.0], [-1.0, 0.0, 0.0]])
                .is_empty()
        );
        assert!(
            camera()
                .view(&[[1.5, 9.0, 0.0], [1.5, -9.0, 0.0]])
                .is_empty()
        );
        assert!(camera().view(&[[9.0, 0.0, 0.0]]).is_empty());
    }

    #[test]
    fn a_line_that_leaves_and_comes_back_is_in_two_pieces() {
        let line = [
            [10.0, 0.0, 0.0],
            [10.0, 40.0, 0.0],
            [20.0, 40.0, 0.0],
            [20.0, 0.0, 0.0],
        ];
        assert_eq!(camera().view(&line).len(), 2);
    }

    fn point() -> impl Strategy<Value = [f64; 3]> {
        [-10.0..40.0_f64, -15.0..15.0, -1.0..4.0]
    }

    proptest! {
        /// Against very many points of the line, one by one.
        #[test]
        fn shows_just_what_its_points_show(from in point(), to in point()) {
            let camera = camera();
            let pieces = camera.view(&[from, to]);
            let outside = |[u, v]: [f64; 2]| {
                let beyond = |value: f64, high: f64| (value - high).max(-0.5 - value);
                beyond(u, 1919.5).max(beyond(v, 1079.5))
            };
            let farthest = pieces.iter().flatten().map(|pixel| outside(*pixel)).fold(-1.0, f64::max);
            prop_assert!(farthest < 1e-6, "{farthest} px outside");
            for share in 0..=300 {
                let share = f64::from(share) / 300.0;
                let at: [f64; 3] = std::array::from_fn(|k| from[k] + share * (to[k] - from[k]));
                let Some([u, v]) = camera.pixel_from_vehicle(at) else { continue };
                if outside([u, v]) <= 0.0 {
                    let near = pieces.iter().flat_map(|piece| piece.windows(2));
                    let distance = near.map(|pair| distance_px([u, v], pair)).fold(f64::MAX, f64::min);
                    // Half a metre at arm's length bends by some pixels.
                    let depth_m = camera.camera_from_vehicle(at).z;
                    prop_assert!(distance < 1.0 + 40.0 / depth_m, "{distance} px at {u}, {v}");
                }
            }
        }
    }

    fn distance_px([u, v]: [f64; 2], pair: &[[f64; 2]]) -> f64 {
        let (du, dv) = (pair[1][0] - pair[0][0], pair[1][1] - pair[0][1]);
        let along = (u - pair[0][0]) * du + (v - pair[0][1]) * dv;
        let share = (along / (du * du + dv * dv).max(1e-12)).clamp(0.0, 1.0);
        (pair[0][0] + share * du - u).hypot(pair[0][1] + share * dv - v)
    }
}
