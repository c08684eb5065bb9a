//! Lines that do not run along the vehicle's way: markings of crossing streets and of tight bends.
//!
//! Cross-cuts are of lines along the way. A seen line that these leave alone is held against the map
//! in the plane: by distances at right angles to it, where the map line runs in its direction. So it
//! is known for what it is, and taken neither for a sighting nor for clutter. It says nothing about
//! the map line: along the way, where a line that crosses it is told apart from the next, the
//! vehicle's place is less sure than to the side.

use crate::cuts::{CrossCut, MAX_SLOPE};
use crate::local_map::{LocalMap, Near, NearSegment};
use crate::look::{Look, SeenLine};
use crate::matching::{GATE_M, Matches};
use crate::pose::Pose;

/// Places along a seen line that are held against the map.
const PLACES: usize = 8;
/// Of which at least this share must lie beside a map line.
const MIN_SHARE: f64 = 0.5;
/// Two lines run in one direction if the cosine between them is greater: 20 degrees.
const ALIKE_COS: f64 = 0.94;
/// Scale of distances, in metres.
const SIGMA_M: f64 = 0.6;
/// A rival this near in gain leaves it open which line was seen.
const AMBIGUOUS_SHARE: f64 = 0.8;

/// A seen line aslant that was matched.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Aslant {
    /// Index into the look's lines.
    pub seen: usize,
    /// Index into the local map's lines.
    pub mapped: usize,
}

/// How a map line lies beside a seen one.
#[derive(Debug, Clone, Copy)]
struct Rival {
    line: usize,
    /// Distance at each place, in metres; infinite where it is not beside it.
    distances_m: [f64; PLACES],
}

impl Rival {
    fn gain(&self) -> f64 {
        let near = |distance_m: &f64| (-0.5 * (distance_m / SIGMA_M).powi(2)).exp();
        self.distances_m.iter().map(near).sum()
    }

    fn share(&self) -> f64 {
        let beside = self.distances_m.iter().filter(|d| d.is_finite());
        beside.count() as f64 / PLACES as f64
    }

    /// Whether both are beside the seen line at a place: else one goes on where the other ends.
    fn meets(&self, other: &Self) -> bool {
        let mut pairs = self.distances_m.iter().zip(&other.distances_m);
        pairs.any(|(a, b)| a.is_finite() && b.is_finite())
    }
}

/// Matches the seen lines that `matches` leaves alone, the vehicle really having been `moved_m` ahead
/// and to the left of its pose.
#[must_use]
pub fn match_aslant(
    look: &Look,
    (cross_cut, matches): (&CrossCut, &Matches),
    moved_m: [f64; 2],
    map: &LocalMap<'_>,
    near: &mut Near,
) -> Vec<Aslant> {
    let is_matched = |line: usize| {
        let mut pairs = matches.pairs.iter();
        pairs.any(|pair| cross_cut.seen[pair.seen].line == line)
    };
    let is_aslant = |line: usize| runs_aslant(&look.lines[line]);
    let alone = (0..look.lines.len()).filter(|&line| is_aslant(line) && !is_matched(line));
    let mut found: Vec<(f64, Aslant)> = alone
        .filter_map(|seen| {
            let places = places(&look.lines[seen], &look.pose, moved_m)?;
            let best = best(&places, map, near)?;
            let mapped = best.line;
            Some((best.gain(), Aslant { seen, mapped }))
        })
        .collect();
    found.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.seen.cmp(&b.1.seen)));
    let mut taken: Vec<Aslant> = Vec::new();
    for (_, aslant) in found {
        let overlaps = |other: &Aslant| {
            other.mapped == aslant.mapped && is_beside(look, other.seen, aslant.seen)
        };
        if !taken.iter().any(overlaps) {
            taken.push(aslant);
        }
    }
    taken
}

/// Whether a seen line runs otherwise than those that are matched by their cuts: of a line along the way
/// these have said what there is to say.
fn runs_aslant(line: &SeenLine) -> bool {
    let ends = line.points_m.first().zip(line.points_m.last());
    ends.is_some_and(|(from, to)| (to[1] - from[1]).abs() > MAX_SLOPE * (to[0] - from[0]).abs())
}

/// Whether two seen lines lie beside each other: then they are not pieces of one line.
fn is_beside(look: &Look, a: usize, b: usize) -> bool {
    let [a, b] = [a, b].map(|line| &look.lines[line].points_m);
    let (Some(from), Some(to)) = (a.first(), a.last()) else {
        return false;
    };
    let along = [to[0] - from[0], to[1] - from[1]];
    let length_2 = along[0] * along[0] + along[1] * along[1];
    let share = |p: &[f64; 2]| {
        ((p[0] - from[0]) * along[0] + (p[1] - from[1]) * along[1]) / length_2.max(1e-9)
    };
    let shares: Vec<f64> = b.iter().map(share).collect();
    let low = shares.iter().copied().fold(f64::INFINITY, f64::min);
    let high = shares.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    low < 1.0 && high > 0.0
}

/// A place of a seen line in the plane of the chunk, with the line's direction.
#[derive(Debug, Clone, Copy)]
struct Place {
    at: [f64; 2],
    along: [f64; 2],
}

/// Evenly spaced places along a seen line.
fn places(line: &SeenLine, pose: &Pose, moved_m: [f64; 2]) -> Option<[Place; PLACES]> {
    let moved = line.points_m.iter().map(|[x, y]| {
        let corrected = [x + moved_m[0], y + moved_m[1]];
        pose.local_from_vehicle(corrected)
    });
    let points: Vec<[f64; 2]> = moved.collect();
    let (first, last) = (*points.first()?, *points.last()?);
    let along = unit([last[0] - first[0], last[1] - first[1]])?;
    let steps: Vec<f64> = points
        .windows(2)
        .map(|pair| (pair[1][0] - pair[0][0]).hypot(pair[1][1] - pair[0][1]))
        .collect();
    let length_m: f64 = steps.iter().sum();
    let at = |way_m: f64| {
        let mut left_m = way_m;
        for (pair, &step_m) in points.windows(2).zip(&steps) {
            if left_m <= step_m && step_m > 0.0 {
                let share = left_m / step_m;
                return [0, 1].map(|axis| pair[0][axis] + share * (pair[1][axis] - pair[0][axis]));
            }
            left_m -= step_m;
        }
        last
    };
    // The middles of equal stretches.
    let middle = |place: usize| (place as f64 + 0.5) / PLACES as f64 * length_m;
    Some(std::array::from_fn(|place| Place {
        at: at(middle(place)),
        along,
    }))
}

/// The map line that is likeliest the one that was seen; none if none is, or two may be.
fn best(places: &[Place; PLACES], map: &LocalMap<'_>, near: &mut Near) -> Option<Rival> {
    let bound = |axis: usize, sign: f64| {
        let values = places.iter().map(|place| sign * place.at[axis] + GATE_M);
        sign * values.fold(f64::NEG_INFINITY, f64::max)
    };
    let (low, high) = (
        [bound(0, -1.0), bound(1, -1.0)],
        [bound(0, 1.0), bound(1, 1.0)],
    );
    map.segments_within(low, high, near);
    let mut rivals: Vec<Rival> = Vec::new();
    for segment in near.found() {
        if rivals.last().is_none_or(|last| last.line != segment.line) {
            rivals.push(Rival {
                line: segment.line,
                distances_m: [f64::INFINITY; PLACES],
            });
        }
        if let Some(rival) = rivals.last_mut() {
            for (known, place) in rival.distances_m.iter_mut().zip(places) {
                *known = known.min(distance_m(place, segment).unwrap_or(f64::INFINITY));
            }
        }
    }
    let best = *(rivals.iter()).max_by(|a, b| {
        let by_gain = a.gain().total_cmp(&b.gain());
        by_gain.then(b.line.cmp(&a.line))
    })?;
    let is_rival = |other: &&Rival| {
        let is_near = other.gain() >= AMBIGUOUS_SHARE * best.gain();
        other.line != best.line && is_near && other.meets(&best)
    };
    let is_open = rivals.iter().any(|other| is_rival(&other));
    (!is_open && best.share() >= MIN_SHARE).then_some(best)
}

/// Distance of a place to a segment at right angles; none beyond its ends or the gate, or if the two
/// run in different directions.
fn distance_m(place: &Place, segment: &NearSegment) -> Option<f64> {
    let (from, to) = (segment.from, segment.to);
    let along = unit([to[0] - from[0], to[1] - from[1]])?;
    let cos = along[0] * place.along[0] + along[1] * place.along[1];
    let offset = [place.at[0] - from[0], place.at[1] - from[1]];
    let way_m = offset[0] * along[0] + offset[1] * along[1];
    let length_m = (to[0] - from[0]).hypot(to[1] - from[1]);
    let distance_m = (along[0] * offset[1] - along[1] * offset[0]).abs();
    // Joints of a bend leave gaps on their outside.
    let is_beside = (-0.25..=length_m + 0.25).contains(&way_m);
    (is_beside && cos.abs() >= ALIKE_COS && distance_m <= GATE_M).then_some(distance_m)
}

fn unit([x, y]: [f64; 2]) -> Option<[f64; 2]> {
    let length = x.hypot(y);
    (length > 1e-6).then(|| [x / length, y / length])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A line seen across the way, 6 m ahead, and a map line `ahead_m` further on, of `from_m..to_m`.
    fn rival(line: usize, ahead_m: f64, from_m: f64, to_m: f64) -> Rival {
        let places: [Place; PLACES] = std::array::from_fn(|place| Place {
            at: [6.0, place as f64 - 3.5],
            along: [0.0, 1.0],
        });
        let segment = NearSegment {
            line,
            from: [6.0 + ahead_m, from_m],
            to: [6.0 + ahead_m, to_m],
            from_station_m: 0.0,
        };
        Rival {
            line,
            distances_m: places.map(|p| distance_m(&p, &segment).unwrap_or(f64::INFINITY)),
        }
    }

    #[test]
    fn what_lies_nearer_and_longer_beside_gains_more() {
        let near = rival(0, 0.2, -4.0, 4.0);
        assert!((near.share() - 1.0).abs() < 1e-12);
        assert!(near.gain() > rival(1, 0.8, -4.0, 4.0).gain());
        assert!(near.gain() > rival(1, 0.2, -4.0, 0.0).gain());
        assert_eq!(rival(1, GATE_M + 0.1, -4.0, 4.0).share(), 0.0);
    }

    #[test]
    fn what_goes_on_where_another_ends_does_not_meet_it() {
        let (first, second) = (rival(0, 0.0, -4.0, -0.3), rival(1, 0.0, 0.3, 4.0));
        assert!(!first.meets(&second) && first.meets(&rival(2, 0.5, -4.0, 4.0)));
    }

    #[test]
    fn a_line_along_the_way_is_not_aslant() {
        let line = |to| SeenLine {
            detection: 0,
            marking: tilefold_schemas::Marking::Unknown,
            color: tilefold_schemas::Color::Unknown,
            points_m: vec![[4.0, 0.0], to],
        };
        assert!(!runs_aslant(&line([14.0, 3.0])));
        assert!(runs_aslant(&line([14.0, 4.0])) && runs_aslant(&line([4.5, 5.0])));
    }
}
