//! Which seen area is which area of the map, in one frame.

use tilefold_schemas::SignClass;

use super::Glimpse;
use super::mapped::LocalArea;
use super::seen::SeenArea;

/// How far off its map place an area may be seen, in metres along the way: receivers err by this much.
pub const ALONG_GATE_M: f64 = 4.5;
/// How far across, in metres: the way across is registered, and lanes are wider.
pub const ACROSS_GATE_M: f64 = 2.2;
/// A lane aside is nearer than this, in metres.
pub const LANE_GATE_M: f64 = 4.5;
/// Two lanes aside are: of two things seen a lane aside one may be paired with the other's element.
pub const LANES_GATE_M: f64 = 8.0;
/// Scales of the cost, in metres.
const ALONG_SCALE_M: f64 = 2.0;
const ACROSS_SCALE_M: f64 = 0.7;
/// Cost of a class that is not the mapped one.
const CLASS_COST: f64 = 0.5;

/// A seen area that is an area of the map.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pair {
    /// Index among the frame's areas.
    pub seen: usize,
    /// Index among the mapped ones.
    pub mapped: usize,
    /// Seen minus mapped place ahead, by the pose as it is, in metres.
    pub ahead_m: f64,
    /// Seen minus mapped place to the left, after registration, in metres.
    pub left_m: f64,
}

impl Pair {
    fn cost(&self, is_other_class: bool) -> f64 {
        let (along, across) = (self.ahead_m / ALONG_SCALE_M, self.left_m / ACROSS_SCALE_M);
        along * along + across * across + if is_other_class { CLASS_COST } else { 0.0 }
    }
}

/// Each seen area with at most one of the map's, the best pairs first. Ties go to the first seen and
/// the lower id.
#[must_use]
pub fn pair_areas(glimpse: &Glimpse<'_>, mapped: &[LocalArea<'_>]) -> Vec<Pair> {
    let mut costs: Vec<(f64, Pair)> = Vec::new();
    if glimpse.areas.is_empty() {
        return Vec::new();
    }
    for (index, local) in mapped.iter().enumerate() {
        let place = glimpse.look.pose.vehicle_from_local(local.centre_m);
        for (seen, area) in glimpse.areas.iter().enumerate() {
            let pair = Pair {
                seen,
                mapped: index,
                ahead_m: area.centre_m[0] - place[0],
                left_m: area.centre_m[1] + glimpse.registration.offset_m - place[1],
            };
            let is_near = pair.ahead_m.abs() <= ALONG_GATE_M && pair.left_m.abs() <= ACROSS_GATE_M;
            if area.kind == local.mapped.element.kind && is_near {
                let is_other = is_other_class(area.sign, local.mapped.element.sign);
                costs.push((pair.cost(is_other), pair));
            }
        }
    }
    costs.sort_by(|(a, one), (b, other)| {
        (a.total_cmp(b)).then((one.seen, one.mapped).cmp(&(other.seen, other.mapped)))
    });
    let mut pairs: Vec<Pair> = Vec::new();
    for (_, pair) in costs {
        let is_taken = |known: &Pair| known.seen == pair.seen || known.mapped == pair.mapped;
        if !pairs.iter().any(is_taken) {
            pairs.push(pair);
        }
    }
    pairs
}

/// Whether a seen and a mapped area that were left alone may be each other, `gate_m` aside: the
/// registration of a frame can be wrong by a lane, and then everything in it is.
#[must_use]
pub fn is_aside(
    glimpse: &Glimpse<'_>,
    area: &SeenArea,
    local: &LocalArea<'_>,
    gate_m: f64,
) -> bool {
    let [x, y] = glimpse.look.pose.vehicle_from_local(local.centre_m);
    let left_m = area.centre_m[1] + glimpse.registration.offset_m - y;
    area.kind == local.mapped.element.kind
        && (area.centre_m[0] - x).abs() <= ALONG_GATE_M
        && left_m.abs() <= gate_m
        && local.is_readable(glimpse.look.pose.yaw_rad)
}

/// Whether two classes are known and different.
#[must_use]
pub fn is_other_class(seen: SignClass, mapped: SignClass) -> bool {
    seen != SignClass::Unknown && mapped != SignClass::Unknown && seen != mapped
}
