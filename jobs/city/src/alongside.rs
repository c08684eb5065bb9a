//! The lanes of the world that run beside a course: where other vehicles drive.

use crate::course::Course;
use crate::ground::Ground;
use crate::world::Point;

/// Distance between the places of a course that are looked at, in metres.
const EVERY_M: f64 = 6.0;
/// What lies nearer to the course is the own lane, in metres to the side.
const OWN_M: f64 = 2.0;
/// The next lane of the own direction lies within this, and oncoming ones within that.
const NEXT_M: f64 = 5.5;
const ONCOMING_M: f64 = 14.0;
/// Lanes nearer to each other are one, in metres.
const ONE_LANE_M: f64 = 2.0;
/// Cosine of the angle within which a lane runs beside: 20 degrees.
const PARALLEL: f64 = 0.94;

/// A lane as seen from the course.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Beside {
    /// The next one to the left, in the own direction.
    Left,
    /// The next one to the right.
    Right,
    /// One of the other direction; 0 is the nearest.
    Oncoming(usize),
}

/// Metres to the left at which lanes lie, at one station.
#[derive(Debug, Clone, Copy, Default)]
struct Offsets {
    left_m: Option<f64>,
    right_m: Option<f64>,
    oncoming_m: [Option<f64>; 2],
}

/// The lanes beside a course, at even stations.
pub(crate) struct Alongside {
    stations: Vec<Offsets>,
}

impl Alongside {
    pub(crate) fn new(ground: &Ground<'_>, course: &Course) -> Self {
        let count = (course.length_m() / EVERY_M) as usize + 2;
        let offsets = |index: usize| {
            let place = course.place(index as f64 * EVERY_M);
            let at = [place.east_m, place.north_m];
            let near = ground.lanes_near(at, ONCOMING_M);
            Offsets::of(near.map(|lane| lane.centre.as_slice()), at, place.yaw_rad)
        };
        Self {
            stations: (0..count).map(offsets).collect(),
        }
    }

    /// Metres to the left of the course at which a lane lies; none where there is no such lane.
    pub(crate) fn left_m(&self, lane: Beside, station_m: f64) -> Option<f64> {
        let at = (station_m / EVERY_M).max(0.0);
        let before = (at as usize).min(self.stations.len().saturating_sub(2));
        let from_m = self.stations.get(before)?.get(lane)?;
        let to_m = self.stations.get(before + 1)?.get(lane)?;
        Some(from_m + (at - before as f64).min(1.0) * (to_m - from_m))
    }
}

impl Offsets {
    fn of<'a>(lines: impl Iterator<Item = &'a [Point]>, at: [f64; 2], yaw_rad: f64) -> Self {
        let (mut along_m, mut against_m) = (Vec::new(), Vec::new());
        for (left_m, is_along) in lines.filter_map(|line| crossing(line, at, yaw_rad)) {
            match is_along {
                true => along_m.push(left_m),
                false => against_m.push(left_m),
            }
        }
        against_m.retain(|left_m: &f64| (OWN_M..ONCOMING_M).contains(&left_m.abs()));
        against_m.sort_by(|a, b| a.abs().total_cmp(&b.abs()));
        against_m.dedup_by(|b, a| (*b - *a).abs() < ONE_LANE_M);
        let next_m = |sign: f64| {
            let aside_m = along_m.iter().map(|left_m| sign * left_m);
            let aside_m = aside_m.filter(|aside_m| (OWN_M..NEXT_M).contains(aside_m));
            aside_m.min_by(f64::total_cmp).map(|aside_m| sign * aside_m)
        };
        Self {
            left_m: next_m(1.0),
            right_m: next_m(-1.0),
            oncoming_m: [against_m.first().copied(), against_m.get(1).copied()],
        }
    }

    fn get(&self, lane: Beside) -> Option<f64> {
        match lane {
            Beside::Left => self.left_m,
            Beside::Right => self.right_m,
            Beside::Oncoming(number) => self.oncoming_m.get(number).copied().flatten(),
        }
    }
}

/// Where a line crosses the transverse of a place, in metres to the left, and whether it runs in the
/// place's direction; none if it does not, or not nearly at right angles.
fn crossing(line: &[Point], at: [f64; 2], yaw_rad: f64) -> Option<(f64, bool)> {
    let (sin, cos) = yaw_rad.sin_cos();
    let ahead_m = |p: Point| (p[0] - at[0]) * cos + (p[1] - at[1]) * sin;
    let left_m = |p: Point| (p[1] - at[1]) * cos - (p[0] - at[0]) * sin;
    line.windows(2).find_map(|pair| {
        let (from_m, to_m) = (ahead_m(pair[0]), ahead_m(pair[1]));
        let step_m = to_m - from_m;
        let crosses = (from_m <= 0.0) != (to_m <= 0.0);
        let length_m = (pair[1][0] - pair[0][0]).hypot(pair[1][1] - pair[0][1]);
        (crosses && step_m.abs() > PARALLEL * length_m).then(|| {
            let share = -from_m / step_m;
            let aside_m = left_m(pair[0]) + share * (left_m(pair[1]) - left_m(pair[0]));
            (aside_m, step_m > 0.0)
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A lane along the x axis, or against it, so far to the left.
    fn lane(left_m: f64, is_along: bool) -> Vec<Point> {
        let ends = [[-30.0, left_m, 0.0], [30.0, left_m, 0.0]];
        match is_along {
            true => ends.to_vec(),
            false => ends.into_iter().rev().collect(),
        }
    }

    #[test]
    fn lanes_are_told_by_direction_and_side() {
        let lanes = [
            lane(0.1, true),
            lane(-3.4, true),
            lane(7.0, false),
            lane(3.6, false),
            lane(7.5, false),
            vec![[0.0, -20.0, 0.0], [0.0, 20.0, 0.0]],
        ];
        let offsets = Offsets::of(lanes.iter().map(Vec::as_slice), [0.0, 0.0], 0.0);
        assert_eq!(offsets.get(Beside::Left), None);
        assert_eq!(offsets.get(Beside::Right), Some(-3.4));
        assert_eq!(offsets.get(Beside::Oncoming(0)), Some(3.6));
        assert_eq!(offsets.get(Beside::Oncoming(1)), Some(7.0));
    }
}
