//! Roads: stretches of the street with lanes, and the lines painted on them.

use tilefold_schemas::element::{Color, Marking};

use crate::curve::Curve;
use crate::random::Random;
use crate::spec::CitySpec;

/// Widths of lanes, in metres.
const LANE_WIDTH_M: (f64, f64) = (3.25, 3.75);
/// Lanes of a road, least and most; from any lane most lines of the road can be seen.
const LANES: (usize, usize) = (2, 3);
/// Metres without paint between two roads: a junction.
const JUNCTION_M: f64 = 40.0;
/// Metres of street before the first road and behind the last.
const APPROACH_M: f64 = 60.0;

/// A line as it is painted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Line {
    /// Metres to the left of the street's middle.
    pub(crate) offset_m: f64,
    pub(crate) marking: Marking,
    pub(crate) color: Color,
}

/// A stretch of the street with the same lanes from `from_m` to `to_m`.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Road {
    pub(crate) from_m: f64,
    pub(crate) to_m: f64,
    pub(crate) lane_width_m: f64,
    /// From right to left; one more than there are lanes.
    pub(crate) lines: Vec<Line>,
}

impl Road {
    fn draw(from_m: f64, length_m: f64, random: &mut Random) -> Self {
        let lane_width_m = random.between(LANE_WIDTH_M.0, LANE_WIDTH_M.1);
        let lanes = LANES.0 + random.index(LANES.1 - LANES.0 + 1);
        let left_color = match random.chance(0.5) {
            true => Color::Yellow,
            false => Color::White,
        };
        let line = |index: usize| Line {
            offset_m: (index as f64 - lanes as f64 / 2.0) * lane_width_m,
            marking: match index {
                0 => Marking::Solid,
                last if last == lanes => Marking::Solid,
                _ => Marking::Dashed,
            },
            color: if index == lanes {
                left_color
            } else {
                Color::White
            },
        };
        Self {
            from_m,
            to_m: from_m + length_m,
            lane_width_m,
            lines: (0..=lanes).map(line).collect(),
        }
    }

    pub(crate) fn lanes(&self) -> usize {
        self.lines.len() - 1
    }

    /// Offset of the middle of a lane, counted from the right.
    pub(crate) fn lane_offset_m(&self, lane: usize) -> f64 {
        self.lines[0].offset_m + (lane as f64 + 0.5) * self.lane_width_m
    }
}

/// The street with its roads.
#[derive(Debug, Clone)]
pub(crate) struct Street {
    pub(crate) curve: Curve,
    /// By station, ascending.
    pub(crate) roads: Vec<Road>,
    pub(crate) length_m: f64,
}

impl Street {
    /// The street of a city.
    pub(crate) fn draw(spec: &CitySpec) -> Self {
        let mut random = Random::new(spec.seed, "street", 0);
        let mut roads = Vec::new();
        let mut station_m = APPROACH_M;
        for _ in 0..spec.roads {
            let length_m = spec.road_length_m * random.between(0.85, 1.15);
            roads.push(Road::draw(station_m, length_m, &mut random));
            station_m += length_m + JUNCTION_M;
        }
        let length_m = station_m - JUNCTION_M + APPROACH_M;
        Self {
            curve: Curve::draw(length_m, &mut random),
            roads,
            length_m,
        }
    }
}
