//! Which lanes and lines a road has, at each station.
//!
//! Offsets are metres to the left of the line between the two directions; traffic keeps right, so
//! the lanes along the road have negative offsets, those against it positive ones. Lanes count from
//! the inside. A side may lose its outermost lane on the way, or gain one: the outer edge then
//! slides by a lane's width.

use tilefold_schemas::element::{Color, Marking};

use super::Style;
use crate::random::Random;

/// Widths of lanes, in metres.
const LANE_WIDTH_M: (f64, f64) = (2.8, 3.75);
/// Chance of one, two and three lanes for a direction, cumulative.
const LANES: [(f64, usize); 3] = [(0.2, 1), (0.75, 2), (1.0, 3)];
/// Chance that a side with two lanes or more loses one, and that it gains one.
const DROP: f64 = 0.15;
const GAIN: f64 = 0.15;
/// Length over which an edge slides, and where along the road it begins to (share of its length).
const TAPER_M: f64 = 50.0;
const TAPER_AT: (f64, f64) = (0.35, 0.6);
/// Least length of a road on which lanes come and go, in metres.
const LEAST_TAPERED_M: f64 = 220.0;
/// Distance of the stop line from the road's end, and of the lines' begin from it, in metres.
pub(super) const STOP_M: f64 = 6.0;
/// From the edge line to the kerb, in metres.
pub(super) const KERB_M: f64 = 0.6;
/// Speeds in metres per second.
const SPEED_M_S: (f64, f64) = (11.0, 17.0);

/// How a side's number of lanes changes on the way, seen in its direction of travel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Taper {
    Drop,
    Gain,
}

/// The lanes of one direction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Side {
    /// Lanes where there are most.
    pub(super) lanes: usize,
    pub(super) taper: Option<Taper>,
    /// Stations of the road between which the edge slides; ascending.
    pub(super) taper_from_m: f64,
    pub(super) taper_to_m: f64,
}

/// A road's cross-section.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Section {
    pub(super) lane_width_m: f64,
    /// Along the road, and against it.
    pub(super) sides: [Side; 2],
    /// The line between the directions.
    pub(super) middle: Style,
    pub(super) edge: Style,
    /// Whether the begin and the end have stop lines.
    pub(super) has_stop: [bool; 2],
    /// Whether the begin and the end have crosswalks.
    pub(super) has_crosswalk: [bool; 2],
    pub(super) speed_m_s: f64,
}

/// Which side of a road: along it, or against it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Heading {
    Along,
    Against,
}

impl Heading {
    pub(super) const BOTH: [Self; 2] = [Self::Along, Self::Against];

    /// The sign of the side's offsets.
    pub(super) fn sign(self) -> f64 {
        match self {
            Self::Along => -1.0,
            Self::Against => 1.0,
        }
    }

    /// Which of a road's ends the side's traffic leaves it by: 0 the begin, 1 the end.
    pub(super) fn exit(self) -> usize {
        match self {
            Self::Along => 1,
            Self::Against => 0,
        }
    }
}

impl Section {
    pub(super) fn draw(random: &mut Random) -> Self {
        let side = |random: &mut Random| {
            let lot = random.unit();
            let lanes = LANES.iter().find(|(chance, _)| lot < *chance);
            Side {
                lanes: lanes.map_or(1, |(_, lanes)| *lanes),
                taper: None,
                taper_from_m: 0.0,
                taper_to_m: 0.0,
            }
        };
        let sides = [side(random), side(random)];
        let narrow = sides.iter().all(|side| side.lanes == 1);
        Self {
            lane_width_m: random.between(LANE_WIDTH_M.0, LANE_WIDTH_M.1),
            sides,
            middle: middle(narrow, random),
            edge: Style {
                marking: Marking::Solid,
                color: Color::White,
            },
            has_stop: [false; 2],
            has_crosswalk: [false; 2],
            speed_m_s: random.between(SPEED_M_S.0, SPEED_M_S.1),
        }
    }

    /// Fits the section to a road of a length whose ends are junctions of these degrees.
    pub(super) fn fit(&mut self, length_m: f64, degrees: [usize; 2], random: &mut Random) {
        for (end, degree) in degrees.into_iter().enumerate() {
            self.has_stop[end] = degree > 2;
            self.has_crosswalk[end] = degree > 2 && random.chance(0.6);
        }
        for side in &mut self.sides {
            let (lot, at) = (random.unit(), random.between(TAPER_AT.0, TAPER_AT.1));
            side.taper = match lot {
                _ if length_m < LEAST_TAPERED_M || side.lanes < 2 => None,
                lot if lot < DROP => Some(Taper::Drop),
                lot if lot < DROP + GAIN => Some(Taper::Gain),
                _ => None,
            };
            side.taper_from_m = at * length_m;
            side.taper_to_m = side.taper_from_m + TAPER_M;
        }
    }

    pub(super) fn side(&self, heading: Heading) -> &Side {
        match heading {
            Heading::Along => &self.sides[0],
            Heading::Against => &self.sides[1],
        }
    }

    /// Share of the outermost lane that there is at a station, 0 to 1.
    pub(super) fn outer_share(&self, heading: Heading, station_m: f64) -> f64 {
        let side = self.side(heading);
        let Some(taper) = side.taper else {
            return 1.0;
        };
        let done = (station_m - side.taper_from_m) / (side.taper_to_m - side.taper_from_m);
        let done = done.clamp(0.0, 1.0);
        let smooth = done * done * (3.0 - 2.0 * done);
        let shrinks = (taper == Taper::Drop) == (heading == Heading::Along);
        if shrinks { 1.0 - smooth } else { smooth }
    }

    /// Offset of the outer edge at a station.
    pub(super) fn edge_m(&self, heading: Heading, station_m: f64) -> f64 {
        let lanes = self.side(heading).lanes as f64 - 1.0 + self.outer_share(heading, station_m);
        heading.sign() * lanes * self.lane_width_m
    }

    /// Offset of the middle of a lane, counted from the inside, at a station. The outermost lane
    /// moves with its edge, into its neighbour.
    pub(super) fn lane_m(&self, heading: Heading, lane: usize, station_m: f64) -> f64 {
        let outermost = lane + 1 == self.side(heading).lanes;
        let missing = if outermost {
            1.0 - self.outer_share(heading, station_m)
        } else {
            0.0
        };
        heading.sign() * (lane as f64 + 0.5 - missing) * self.lane_width_m
    }

    /// The stations between which lines run on a road of a length.
    pub(super) fn painted(&self, length_m: f64) -> (f64, f64) {
        (STOP_M, length_m - STOP_M)
    }

    /// The stations between which the line on the inside of the outermost lane runs: it ends where
    /// the edge begins to slide.
    pub(super) fn outer_divider(&self, heading: Heading, length_m: f64) -> (f64, f64) {
        let (from_m, to_m) = self.painted(length_m);
        let side = self.side(heading);
        match side.taper {
            None => (from_m, to_m),
            Some(_) if self.outer_share(heading, 0.0) > 0.5 => (from_m, side.taper_from_m),
            Some(_) => (side.taper_to_m, to_m),
        }
    }
}

fn middle(narrow: bool, random: &mut Random) -> Style {
    let lot = random.unit();
    let marking = match lot {
        lot if narrow && lot < 0.6 => Marking::Dashed,
        lot if narrow && lot < 0.75 => Marking::SolidDashed,
        lot if lot < 0.55 => Marking::SolidSolid,
        _ => Marking::Solid,
    };
    let color = if random.chance(0.5) {
        Color::Yellow
    } else {
        Color::White
    };
    Style { marking, color }
}
