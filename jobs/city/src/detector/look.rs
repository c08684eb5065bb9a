//! Which stretches of paint a camera has before it: in range, within its angle, not hidden.

use tilefold_schemas::element::{ElementKind, SignClass};

use super::phantom::Phantoms;
use super::{LEAST_POINTS, Piece, Sight};
use crate::course::Motion;
use crate::noise::DetectorNoise;
use crate::traffic::Vehicle;
use crate::world::{Paint, Point};

/// Tangent of half of the camera's angle.
const HALF_ANGLE_TAN: f64 = 0.8;
/// Height of the camera, in metres.
pub(super) const CAMERA_M: f64 = 1.4;
/// Pieces of lines that lie this near to each other are one line, in metres.
const JOIN_M: f64 = 0.3;

/// A look from one place.
pub(super) struct Look<'a> {
    noise: &'a DetectorNoise,
    motion: &'a Motion,
    /// Corners of the vehicles around, in the vehicle frame.
    boxes: Vec<[[f64; 2]; 4]>,
}

impl<'a> Look<'a> {
    pub(super) fn new(noise: &'a DetectorNoise, motion: &'a Motion, traffic: &[Vehicle]) -> Self {
        let corners = |vehicle: &Vehicle| {
            let (sin, cos) = vehicle.yaw_rad.sin_cos();
            let [half_length_m, half_width_m] = [vehicle.size_m[0] / 2.0, vehicle.size_m[1] / 2.0];
            [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(forward, left)| {
                let (x_m, y_m) = (forward * half_length_m, left * half_width_m);
                motion.place.see([
                    vehicle.at[0] + x_m * cos - y_m * sin,
                    vehicle.at[1] + x_m * sin + y_m * cos,
                ])
            })
        };
        Self {
            noise,
            motion,
            boxes: traffic.iter().map(corners).collect(),
        }
    }

    /// The stretches of paint that are before the camera.
    pub(super) fn paint(&self, near: &[(usize, &Paint)]) -> Vec<Sight> {
        let mut sights: Vec<Sight> = Vec::new();
        for &(index, paint) in near {
            match paint.kind {
                ElementKind::LaneMarking => {
                    let stretches = self.stretches(&paint.points);
                    sights.extend(stretches.map(|points| sight(index, paint, points)));
                }
                ElementKind::StopLine => sights.extend(self.across(index, paint)),
                ElementKind::Crosswalk | ElementKind::GroundSign => {
                    sights.extend(self.outline(index, paint));
                }
            }
        }
        let mut sights = joined(sights);
        sights.retain(|sight| {
            sight.kind != ElementKind::LaneMarking || sight.points.len() >= LEAST_POINTS
        });
        sights
    }

    /// Lines that are gone, where something of them is still taken for paint.
    pub(super) fn ghosts(
        &self,
        gone: &[(usize, &Paint)],
        phantoms: &mut Phantoms,
        first_key: usize,
    ) -> Vec<Sight> {
        let mut sights = Vec::new();
        for &(index, paint) in gone {
            let key = first_key + index;
            if paint.kind == ElementKind::LaneMarking && phantoms.haunts(key, self.noise.miss.ghost)
            {
                sights.extend(self.line(&paint.points).map(|points| Sight {
                    pieces: vec![Piece {
                        element: None,
                        points: points.len(),
                    }],
                    ..sight(key, paint, points)
                }));
            }
        }
        sights
    }

    /// The first stretch of a line that can be seen, if it is long enough.
    pub(super) fn line(&self, points: &[Point]) -> Option<Vec<[f64; 2]>> {
        self.stretches(points)
            .find(|stretch| stretch.len() >= LEAST_POINTS)
    }

    /// The stretches of a line that can be seen, at even distances.
    fn stretches(&self, points: &[Point]) -> impl Iterator<Item = Vec<[f64; 2]>> + use<> {
        let mut stretches = Vec::new();
        let mut stretch = Vec::new();
        for point in resampled(points, self.noise.view.point_every_m) {
            let seen = self.motion.place.see([point[0], point[1]]);
            if self.sees(seen) {
                stretch.push(seen);
            } else if !stretch.is_empty() {
                stretches.push(std::mem::take(&mut stretch));
            }
        }
        if !stretch.is_empty() {
            stretches.push(stretch);
        }
        stretches.into_iter()
    }

    fn across(&self, index: usize, paint: &Paint) -> Option<Sight> {
        let points = self.whole(paint)?;
        Some(sight(index, paint, points))
    }

    fn outline(&self, index: usize, paint: &Paint) -> Option<Sight> {
        let points = self.whole(paint)?;
        // Signs of the other direction are read by nobody: the first side points ahead.
        let is_ahead = points.get(1).is_some_and(|second| second[0] > points[0][0]);
        let is_readable = paint.kind == ElementKind::Crosswalk
            || paint.sign == SignClass::BoxJunction
            || is_ahead;
        is_readable.then(|| sight(index, paint, points))
    }

    /// All vertices, if each can be seen.
    fn whole(&self, paint: &Paint) -> Option<Vec<[f64; 2]>> {
        let seen = paint
            .points
            .iter()
            .map(|p| self.motion.place.see([p[0], p[1]]));
        let seen: Vec<[f64; 2]> = seen.collect();
        let all = seen.iter().all(|&point| self.sees(point));
        all.then_some(seen)
    }

    /// Whether a place on the ground is before the camera and not hidden.
    pub(super) fn sees(&self, [x_m, y_m]: [f64; 2]) -> bool {
        (self.noise.view.near_m..=self.noise.view.far_m).contains(&x_m)
            && y_m.abs() <= self.noise.view.side_m
            && y_m.abs() <= HALF_ANGLE_TAN * x_m
            && !self.boxes.iter().any(|corners| hides(corners, [x_m, y_m]))
    }

    /// Metres that the ground at a point of the vehicle frame lies above the vehicle's own plane.
    pub(super) fn rise_m(&self, [x_m, y_m]: [f64; 2], relief: &crate::relief::Relief) -> f64 {
        let there = relief.height_m(self.motion.place.point(x_m, y_m));
        there - self.motion.up_m - x_m * self.motion.slope_rad.tan()
    }
}

fn sight(key: usize, paint: &Paint, points: Vec<[f64; 2]>) -> Sight {
    Sight {
        key,
        pieces: vec![Piece {
            element: Some(paint.id),
            points: points.len(),
        }],
        kind: paint.kind,
        marking: paint.marking,
        color: paint.color,
        sign: paint.sign,
        wear: paint.wear,
        points,
    }
}

/// Whether the way from the camera, over the origin, to a point on the ground leads through a box.
fn hides(corners: &[[f64; 2]; 4], to: [f64; 2]) -> bool {
    let crosses = |a: [f64; 2], b: [f64; 2]| {
        let side = |p: [f64; 2]| to[0] * p[1] - to[1] * p[0];
        let along = |p: [f64; 2]| (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]);
        side(a) * side(b) < 0.0 && along([0.0, 0.0]) * along(to) < 0.0
    };
    (0..4).any(|corner| crosses(corners[corner], corners[(corner + 1) % 4]))
}

/// Map ways end where nobody sees it: pieces of the same paint that touch are one line.
fn joined(mut sights: Vec<Sight>) -> Vec<Sight> {
    let mut first = 0;
    while first < sights.len() {
        match partner(&sights, first) {
            Some(second) => {
                let tail = sights.remove(second);
                let at = if second < first { first - 1 } else { first };
                join(&mut sights[at], tail);
                first = at;
            }
            None => first += 1,
        }
    }
    sights
}

/// The line that goes on where the one at `first` ends.
fn partner(sights: &[Sight], first: usize) -> Option<usize> {
    let here = &sights[first];
    if here.kind != ElementKind::LaneMarking {
        return None;
    }
    let end = here.points[here.points.len() - 1];
    (0..sights.len()).find(|&other| {
        let there = &sights[other];
        let [x_m, y_m] = there.points[0];
        other != first
            && there.kind == here.kind
            && there.marking == here.marking
            && there.color == here.color
            && (x_m - end[0]).hypot(y_m - end[1]) < JOIN_M
    })
}

/// The longer piece says how the line is remembered and worn. Where the two touch, the head's last
/// point stands.
fn join(head: &mut Sight, tail: Sight) {
    if tail.points.len() > head.points.len() {
        head.key = tail.key;
        head.wear = tail.wear;
    }
    head.points.extend(tail.points.into_iter().skip(1));
    let mut pieces = tail.pieces;
    if let Some(first) = pieces.first_mut() {
        first.points -= 1;
    }
    head.pieces.extend(pieces);
}

/// Points at even distances along a line, from its first to its last.
fn resampled(points: &[Point], every_m: f64) -> Vec<Point> {
    let mut even = Vec::new();
    let mut left_m = 0.0;
    for pair in points.windows(2) {
        let length_m = (pair[1][0] - pair[0][0]).hypot(pair[1][1] - pair[0][1]);
        while left_m < length_m {
            let share = left_m / length_m;
            even.push(
                [0, 1, 2].map(|axis| pair[0][axis] + share * (pair[1][axis] - pair[0][axis])),
            );
            left_m += every_m;
        }
        left_m -= length_m;
    }
    even.extend(points.last());
    even
}
