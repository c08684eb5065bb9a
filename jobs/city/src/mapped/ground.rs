//! The plane of a map and the height of the ground over it.

use std::sync::Arc;

use tilefold_formats::map::{Border, Lanelet, Roads};
use tilefold_tiler::geodesy::LocalFrame;

use super::course::{between, length_m, resampled, steps};
use super::{MOST_LANES_M, within};
use crate::error::CityError;
use crate::relief::Relief;
use crate::world::Point;

/// Where the ground is known across a lanelet, as shares of its width.
const ACROSS: [f64; 4] = [0.0, 1.0 / 3.0, 2.0 / 3.0, 1.0];

/// The plane and the height of the ground over it.
pub(super) struct Ground {
    pub(super) frame: LocalFrame,
    pub(super) relief: Arc<Relief>,
}

impl Ground {
    /// The ground under lanelets; none without one.
    pub(super) fn under(roads: &Roads) -> Result<Option<Self>, CityError> {
        let lanelets = &roads.lanelets;
        let surveyed = || lanelets.iter().filter(|lanelet| lanelet.has_elevations);
        let is_flat = 2 * surveyed().count() <= lanelets.len();
        let Some(anchor) = anchor(lanelets, is_flat) else {
            return Ok(None);
        };
        let mut ground = Self {
            frame: LocalFrame::new(anchor),
            relief: Arc::new(Relief::flat()),
        };
        if !is_flat {
            let mut points = Vec::new();
            let mut passed_m = 0.0;
            for lanelet in surveyed() {
                passed_m += ground.cover(lanelet, &mut points);
                within(
                    "length of all borders together, in metres,",
                    passed_m,
                    2.0 * MOST_LANES_M,
                )?;
            }
            ground.relief = Arc::new(Relief::through(&points));
        }
        Ok(Some(ground))
    }

    /// Adds the ground between the borders of a lanelet; gives the length of both.
    fn cover(&self, lanelet: &Lanelet, points: &mut Vec<Point>) -> f64 {
        let lines = borders(lanelet).map(|border| -> Vec<Point> {
            let surveyed = |point| self.as_surveyed(point);
            border.points.iter().map(surveyed).collect()
        });
        let steps = steps([&lines[0], &lines[1]]);
        let [lefts, rights] = [&lines[0], &lines[1]].map(|line| resampled(line, steps));
        for (left, right) in lefts.into_iter().zip(rights) {
            points.extend(ACROSS.map(|share| between(left, right, share)));
        }
        lines.iter().map(|line| length_m(line)).sum()
    }

    /// A point of the map at its own height.
    fn as_surveyed(&self, &[longitude_deg, latitude_deg, elevation_m]: &Point) -> Point {
        let anchor_m = self.frame.anchor()[2];
        let [east_m, north_m, _] = self.frame.to_enu([longitude_deg, latitude_deg, anchor_m]);
        [east_m, north_m, elevation_m - anchor_m]
    }

    /// A point of the map, on the plane: metres east and north.
    pub(super) fn place(&self, point: &Point) -> [f64; 2] {
        let [east_m, north_m, _] = self.as_surveyed(point);
        [east_m, north_m]
    }

    /// A place of the plane, on the ground.
    pub(super) fn lay(&self, place: [f64; 2]) -> Point {
        [place[0], place[1], self.relief.height_m(place)]
    }
}

fn borders(lanelet: &Lanelet) -> [&Border; 2] {
    [&lanelet.left, &lanelet.right]
}

/// The middle of the box around all borders, at 0 m where elevations are not heard.
fn anchor(lanelets: &[Lanelet], is_flat: bool) -> Option<Point> {
    let mut corners: Option<[Point; 2]> = None;
    for point in lanelets
        .iter()
        .flat_map(borders)
        .flat_map(|border| &border.points)
    {
        let [low, high] = corners.get_or_insert([*point; 2]);
        for axis in 0..3 {
            low[axis] = low[axis].min(point[axis]);
            high[axis] = high[axis].max(point[axis]);
        }
    }
    let [low, high] = corners?;
    let middle = |axis: usize| (low[axis] + high[axis]) / 2.0;
    Some([middle(0), middle(1), if is_flat { 0.0 } else { middle(2) }])
}
