//! Where a road runs: two arcs, tangent to each other and to the directions at its ends.

use std::f64::consts::TAU;

/// Below this a curve is straight, in 1/m.
const STRAIGHT: f64 = 1e-9;

/// A place on the plane with a direction: metres east and north, radians counter-clockwise from
/// east.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Place {
    pub(crate) east_m: f64,
    pub(crate) north_m: f64,
    pub(crate) yaw_rad: f64,
}

impl Place {
    /// `point` (east, north) as seen from here: metres forward and to the left.
    pub(crate) fn see(&self, [east_m, north_m]: [f64; 2]) -> [f64; 2] {
        let (sin, cos) = self.yaw_rad.sin_cos();
        let (de, dn) = (east_m - self.east_m, north_m - self.north_m);
        [de * cos + dn * sin, dn * cos - de * sin]
    }

    /// The point (east, north) that lies `forward_m` ahead and `left_m` to the left.
    pub(crate) fn point(&self, forward_m: f64, left_m: f64) -> [f64; 2] {
        let (sin, cos) = self.yaw_rad.sin_cos();
        [
            self.east_m + forward_m * cos - left_m * sin,
            self.north_m + forward_m * sin + left_m * cos,
        ]
    }

    /// The point (east, north) that lies `left_m` to the left.
    pub(crate) fn left(&self, left_m: f64) -> [f64; 2] {
        self.point(0.0, left_m)
    }

    /// The place `forward_m` ahead.
    pub(crate) fn ahead(&self, forward_m: f64) -> Self {
        let [east_m, north_m] = self.point(forward_m, 0.0);
        Self {
            east_m,
            north_m,
            ..*self
        }
    }
}

/// An arc from its first place on; straight if its curvature is 0.
#[derive(Debug, Clone, Copy)]
struct Arc {
    station_m: f64,
    start: Place,
    /// 1/m, positive to the left.
    curvature: f64,
}

impl Arc {
    fn at(&self, station_m: f64) -> Place {
        let along_m = station_m - self.station_m;
        let turn_rad = self.curvature * along_m;
        // The chord of an arc: its length is sinc of half of the turn, its direction half-way.
        let half = turn_rad / 2.0;
        let sinc = if half.abs() < 1e-9 {
            1.0
        } else {
            half.sin() / half
        };
        let (sin, cos) = (self.start.yaw_rad + half).sin_cos();
        Place {
            east_m: self.start.east_m + along_m * sinc * cos,
            north_m: self.start.north_m + along_m * sinc * sin,
            yaw_rad: self.start.yaw_rad + turn_rad,
        }
    }
}

/// A curve by station, metres from its begin.
#[derive(Debug, Clone)]
pub(crate) struct Curve {
    arcs: [Arc; 2],
    pub(crate) length_m: f64,
}

impl Curve {
    /// The two arcs from one place to another that have tangents of equal length (the biarc of
    /// Bolton, 1975). The places lie apart.
    pub(crate) fn between(from: Place, to: Place) -> Self {
        let joint = joint(from, to);
        let first = arc_to(from, joint);
        // The second arc ends with the direction of `to`: seen from there it runs backwards.
        let back = arc_to(reversed(to), joint);
        let second = Arc {
            station_m: first.1,
            start: first.0.at(first.1),
            curvature: -back.0.curvature,
        };
        Self {
            arcs: [first.0, second],
            length_m: first.1 + back.1,
        }
    }

    /// The curve's place at a station; its ends go on as arcs.
    pub(crate) fn at(&self, station_m: f64) -> Place {
        let is_second = station_m >= self.arcs[1].station_m;
        self.arcs[usize::from(is_second)].at(station_m)
    }

    /// The point (east, north) at a station and an offset to the left.
    pub(crate) fn point(&self, station_m: f64, offset_m: f64) -> [f64; 2] {
        self.at(station_m).left(offset_m)
    }
}

fn reversed(place: Place) -> Place {
    Place {
        yaw_rad: place.yaw_rad + TAU / 2.0,
        ..place
    }
}

/// Where the two arcs meet.
fn joint(from: Place, to: Place) -> [f64; 2] {
    let chord = [to.east_m - from.east_m, to.north_m - from.north_m];
    let (tangent_from, tangent_to) = (direction(from), direction(to));
    let sum = [
        tangent_from[0] + tangent_to[0],
        tangent_from[1] + tangent_to[1],
    ];
    // |chord - d sum| = 2 d, for the positive d; in the form that does not cancel.
    let along = dot(chord, sum);
    let square = dot(chord, chord);
    let spread = 2.0 * (1.0 - dot(tangent_from, tangent_to));
    let root = (along * along + spread * square).sqrt();
    let tangent_m = square / (along + root).max(1e-9);
    let middle = |axis: usize, start: f64, end: f64| {
        (start + end + tangent_m * (tangent_from[axis] - tangent_to[axis])) / 2.0
    };
    [
        middle(0, from.east_m, to.east_m),
        middle(1, from.north_m, to.north_m),
    ]
}

/// The arc from a place to a point, and its length.
fn arc_to(from: Place, point: [f64; 2]) -> (Arc, f64) {
    let [forward_m, left_m] = from.see(point);
    let square = forward_m * forward_m + left_m * left_m;
    let curvature = 2.0 * left_m / square.max(1e-9);
    let length_m = if curvature.abs() < STRAIGHT {
        forward_m
    } else {
        2.0 * left_m.atan2(forward_m) / curvature
    };
    let arc = Arc {
        station_m: 0.0,
        start: from,
        curvature,
    };
    (arc, length_m)
}

fn direction(place: Place) -> [f64; 2] {
    let (sin, cos) = place.yaw_rad.sin_cos();
    [cos, sin]
}

fn dot(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn place(east_m: f64, north_m: f64, yaw_rad: f64) -> Place {
        Place {
            east_m,
            north_m,
            yaw_rad,
        }
    }

    #[test]
    fn curves_end_where_they_should_and_stations_are_lengths() {
        let ends = [
            place(300.0, 0.0, 0.0),
            place(300.0, 40.0, 0.3),
            place(250.0, -90.0, -0.4),
            place(200.0, 200.0, TAU / 4.0),
            place(250.0, 30.0, -0.2),
        ];
        for end in ends {
            let curve = Curve::between(place(0.0, 0.0, 0.1), end);
            let reached = curve.at(curve.length_m);
            let off_m = (reached.east_m - end.east_m).hypot(reached.north_m - end.north_m);
            assert!(off_m < 1e-6, "{end:?}: {off_m}");
            let turned = (reached.yaw_rad - end.yaw_rad).sin().abs();
            assert!(turned < 1e-6, "{end:?}: {reached:?}");
            for step in 0..curve.length_m as i32 - 1 {
                let (here, next) = (curve.at(f64::from(step)), curve.at(f64::from(step) + 1.0));
                let moved_m = (next.east_m - here.east_m).hypot(next.north_m - here.north_m);
                assert!((moved_m - 1.0).abs() < 1e-4, "at {step}: {moved_m}");
            }
        }
    }

    #[test]
    fn left_is_left_and_seen_there() {
        let [x_m, y_m] = {
            let place = place(5.0, 1.0, 1.2);
            place.see(place.left(2.0))
        };
        assert!(x_m.abs() < 1e-12 && (y_m - 2.0).abs() < 1e-12);
    }
}
