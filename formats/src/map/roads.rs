//! The road network of a Lanelet2 map: the lanelets that cars drive through, as a map says them.
//! How they join into a graph is for whoever drives there to decide.

use std::collections::BTreeMap;

use tilefold_schemas::SetAside;

/// The lanelets of a map that are open to motor vehicles.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Roads {
    /// Sorted by id; ids are unique.
    pub lanelets: Vec<Lanelet>,
    /// Lanelets for vehicles that could not be used; `offset` is the line in the file.
    pub set_aside: Vec<SetAside>,
    /// Lanelets for others (`crosswalk`, `walkway`, `bicycle_lane`, ...), by subtype.
    pub not_roads: BTreeMap<String, u64>,
}

/// A stretch of one lane between two borders.
#[derive(Debug, Clone, PartialEq)]
pub struct Lanelet {
    /// The relation's id.
    pub id: i64,
    /// `road`, `highway`, `bus_lane`, ...; empty if the map says none.
    pub subtype: String,
    /// The border on the left of who drives along it.
    pub left: Border,
    /// The border on the right.
    pub right: Border,
    /// Whether it may not be driven from its end to its beginning.
    pub is_one_way: bool,
    /// The speed limit in metres per second, where the lanelet itself says one.
    pub speed_limit_m_s: Option<f64>,
    /// Whether every vertex of its borders has an elevation.
    pub has_elevations: bool,
    /// Every tag, as read.
    pub tags: BTreeMap<String, String>,
}

/// A border of a lanelet, in the lanelet's direction.
#[derive(Debug, Clone, PartialEq)]
pub struct Border {
    /// The ways it is made of, one behind the other.
    pub ways: Vec<BorderWay>,
    /// Vertices on WGS 84: longitude and latitude in degrees, elevation in metres as the map says it,
    /// 0 where it does not.
    pub points: Vec<[f64; 3]>,
}

/// A way as a part of a border.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BorderWay {
    /// The way's id.
    pub id: i64,
    /// Whether the border runs against the way.
    pub is_reversed: bool,
    /// What it is.
    pub kind: BorderKind,
    /// Which lane changes over it are allowed; none if the map does not say.
    pub crossing: Option<Crossing>,
}

/// What stands or is painted between two lanes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BorderKind {
    /// Paint.
    Paint,
    /// The edge of the road: a kerbstone, a guard rail, a wall, grass.
    Edge,
    /// Nothing: a line that was drawn to close the lanelet.
    Virtual,
    /// The map does not say.
    Unstated,
    /// Something else.
    Other,
}

/// In which directions a border may be crossed, as seen along it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Crossing {
    /// From its right to its left.
    pub to_left: bool,
    /// From its left to its right.
    pub to_right: bool,
}

impl Border {
    /// The same border as seen by who drives the other way.
    #[must_use]
    pub fn reversed(&self) -> Self {
        Self {
            ways: self.ways.iter().rev().map(BorderWay::reversed).collect(),
            points: self.points.iter().rev().copied().collect(),
        }
    }
}

impl BorderWay {
    pub(super) fn reversed(&self) -> Self {
        let turn = |crossing: Crossing| Crossing {
            to_left: crossing.to_right,
            to_right: crossing.to_left,
        };
        Self {
            is_reversed: !self.is_reversed,
            crossing: self.crossing.map(turn),
            ..*self
        }
    }
}
