//! A lanelet as it is driven in one direction, on the plane.

use tilefold_formats::map::{Border, Lanelet};

use super::ground::Ground;
use super::{MOST_REACH_M, within};
use crate::error::CityError;

/// Most metres between two points of a middle.
pub(super) const STEP_M: f64 = 1.0;

/// A lanelet in one of its directions.
pub(super) struct Course<'a> {
    pub(super) lanelet: &'a Lanelet,
    /// Whether it runs against the lanelet.
    pub(super) is_reversed: bool,
    pub(super) left: Border,
    pub(super) right: Border,
    /// The left and right ends of its begin and of its end, metres east and north.
    pub(super) begin: [[f64; 2]; 2],
    pub(super) end: [[f64; 2]; 2],
    /// Its middle: the mean of both borders at equal shares of their lengths.
    pub(super) middle: Vec<[f64; 2]>,
    pub(super) length_m: f64,
    /// Mean distance of the borders.
    pub(super) width_m: f64,
}

impl<'a> Course<'a> {
    pub(super) fn new(
        lanelet: &'a Lanelet,
        is_reversed: bool,
        ground: &Ground,
    ) -> Result<Self, CityError> {
        let (left, right) = match is_reversed {
            false => (lanelet.left.clone(), lanelet.right.clone()),
            true => (lanelet.right.reversed(), lanelet.left.reversed()),
        };
        let lines = [&left, &right].map(|border| line(border, ground));
        for [east_m, north_m] in lines.iter().flatten() {
            let reach_m = east_m.abs().max(north_m.abs());
            within(
                "distance of a lanelet from the map's middle, in metres,",
                reach_m,
                MOST_REACH_M,
            )?;
        }
        let steps = steps([&lines[0], &lines[1]]);
        let [lefts, rights] = lines.map(|line| resampled(&line, steps));
        let middle: Vec<_> = lefts
            .iter()
            .zip(&rights)
            .map(|(l, r)| between(*l, *r, 0.5))
            .collect();
        let widths = lefts.iter().zip(&rights).map(|(l, r)| distance_m(*l, *r));
        let last = steps as usize;
        Ok(Self {
            lanelet,
            is_reversed,
            left,
            right,
            begin: [lefts[0], rights[0]],
            end: [lefts[last], rights[last]],
            length_m: length_m(&middle),
            width_m: widths.sum::<f64>() / f64::from(steps + 1),
            middle,
        })
    }
}

/// A border on the plane.
pub(super) fn line(border: &Border, ground: &Ground) -> Vec<[f64; 2]> {
    let place = |point| ground.place(point);
    border.points.iter().map(place).collect()
}

/// `steps + 1` points at equal distances along a line, its ends included. Distances are those on the
/// plane, also of points that have a height.
pub(super) fn resampled<const N: usize>(line: &[[f64; N]], steps: u32) -> Vec<[f64; N]> {
    let step_m = length_m(line) / f64::from(steps);
    let mut points = Vec::with_capacity(steps as usize + 1);
    let mut passed_m = 0.0;
    for pair in line.windows(2) {
        let side_m = distance_m(pair[0], pair[1]);
        while points.len() < steps as usize && points.len() as f64 * step_m <= passed_m + side_m {
            let share = (points.len() as f64 * step_m - passed_m) / side_m.max(f64::MIN_POSITIVE);
            points.push(between(pair[0], pair[1], share));
        }
        passed_m += side_m;
    }
    let last = line.last().copied().unwrap_or([0.0; N]);
    points.resize(steps as usize + 1, last);
    points
}

/// How many steps of at most [`STEP_M`] lead along the longest of some lines.
pub(super) fn steps<const N: usize>(lines: [&[[f64; N]]; 2]) -> u32 {
    let longest_m = lines.map(length_m).into_iter().fold(0.0, f64::max);
    (longest_m / STEP_M).ceil().max(1.0) as u32
}

pub(super) fn length_m<const N: usize>(line: &[[f64; N]]) -> f64 {
    line.windows(2)
        .map(|pair| distance_m(pair[0], pair[1]))
        .sum()
}

pub(super) fn distance_m<const N: usize>(a: [f64; N], b: [f64; N]) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

pub(super) fn between<const N: usize>(a: [f64; N], b: [f64; N], share: f64) -> [f64; N] {
    std::array::from_fn(|axis| a[axis] + share * (b[axis] - a[axis]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_lie_at_equal_distances() {
        let line = [[0.0, 0.0], [0.0, 0.0], [3.0, 0.0], [3.0, 0.5], [3.0, 1.0]];
        let points = resampled(&line, 4);
        assert_eq!(
            points,
            [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [3.0, 0.0], [3.0, 1.0]]
        );
        assert_eq!(resampled(&line, 1), [[0.0, 0.0], [3.0, 1.0]]);
    }
}
