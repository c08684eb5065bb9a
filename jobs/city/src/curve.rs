//! Where the street runs: a chain of arcs, each tangent to the one before.

use crate::random::Random;

/// Lengths of arcs, and the tightest bend, in metres.
const ARC_LENGTH_M: (f64, f64) = (80.0, 220.0);
const LEAST_RADIUS_M: f64 = 300.0;
/// The street turns back towards its first direction where it has strayed further than this, so
/// that it never crosses itself.
const MOST_TURN_RAD: f64 = 0.8;

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

    /// The point (east, north) that lies `left_m` to the left.
    pub(crate) fn left(&self, left_m: f64) -> [f64; 2] {
        let (sin, cos) = self.yaw_rad.sin_cos();
        [self.east_m - left_m * sin, self.north_m + left_m * cos]
    }
}

/// An arc from its first place on; straight if its curvature is 0.
#[derive(Debug, Clone, Copy)]
struct Arc {
    station_m: f64,
    start: Place,
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

/// The middle of the street, by station.
#[derive(Debug, Clone)]
pub(crate) struct Curve {
    arcs: Vec<Arc>,
}

impl Curve {
    /// A street of at least `length_m`, from the origin on.
    pub(crate) fn draw(length_m: f64, random: &mut Random) -> Self {
        let first_yaw_rad = random.between(-0.3, 0.3);
        let mut end = Place {
            east_m: 0.0,
            north_m: 0.0,
            yaw_rad: first_yaw_rad,
        };
        let mut arcs = Vec::new();
        let mut station_m = 0.0;
        while station_m < length_m || arcs.is_empty() {
            let strayed_rad: f64 = end.yaw_rad - first_yaw_rad;
            let side = if strayed_rad.abs() > MOST_TURN_RAD {
                -strayed_rad.signum()
            } else {
                random.sign()
            };
            let arc = Arc {
                station_m,
                start: end,
                curvature: side * random.between(0.0, 1.0 / LEAST_RADIUS_M),
            };
            station_m += random.between(ARC_LENGTH_M.0, ARC_LENGTH_M.1);
            end = arc.at(station_m);
            arcs.push(arc);
        }
        Self { arcs }
    }

    /// The middle of the street at a station; the first and last arcs go on for ever.
    pub(crate) fn at(&self, station_m: f64) -> Place {
        let after = self.arcs.partition_point(|arc| arc.station_m <= station_m);
        self.arcs[after.saturating_sub(1)].at(station_m)
    }

    /// The point (east, north) at a station and an offset to the left.
    pub(crate) fn point(&self, station_m: f64, offset_m: f64) -> [f64; 2] {
        self.at(station_m).left(offset_m)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stations_are_lengths_and_arcs_meet_smoothly() {
        let curve = Curve::draw(2_000.0, &mut Random::new(3, "curve", 0));
        for step in 0..2_000 {
            let (here, next) = (curve.at(f64::from(step)), curve.at(f64::from(step) + 1.0));
            let moved_m = (next.east_m - here.east_m).hypot(next.north_m - here.north_m);
            assert!((moved_m - 1.0).abs() < 1e-5, "at {step}: {moved_m}");
            assert!((next.yaw_rad - here.yaw_rad).abs() < 1.01 / LEAST_RADIUS_M);
        }
    }

    #[test]
    fn left_is_left_and_seen_there() {
        let place = Place {
            east_m: 5.0,
            north_m: 1.0,
            yaw_rad: 1.2,
        };
        let [x_m, y_m] = place.see(place.left(2.0));
        assert!(x_m.abs() < 1e-12 && (y_m - 2.0).abs() < 1e-12);
    }
}
