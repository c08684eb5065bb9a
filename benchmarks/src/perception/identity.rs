//! How well tracks keep to one thing: IDF1 (Ristani et al., 2016) and switches of identity.
//!
//! Things are lines, boxes of paint, and vehicles. Map elements whose lines share an end in a picture
//! are one line to the eye: they are one thing here.

use std::collections::BTreeMap;

use serde::Serialize;
use tilefold_schemas::observation::{ObservationFrame, Place, Seen};
use tilefold_tiler::recording::Stamped;
use tilefold_workers::track::Track;
use tilefold_workers::track::assign::assign;

use super::boxes;
use super::lines::{Asked, crossings};
use super::truth::Picture;

/// Share of a seen line's points that have to lie on a thing to be it.
const LEAST_SHARE: f64 = 0.5;
/// Points of a line by which it is there at all.
const LEAST_POINTS: usize = 3;
/// Ends of lines that are nearer than this are one point, in pixels.
const SAME_PX: f64 = 0.75;

/// What is counted of one kind of thing.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
struct Counts {
    /// Pictures in which a thing was where its track says; pictures of things; pictures of tracks.
    together: u64,
    things: u64,
    tracks: u64,
    switches: u64,
    /// Pictures in which any track has the thing: no choice of tracks has more together.
    found: u64,
}

/// How well things are kept apart.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(super) struct Identity {
    pub(super) idf1: f64,
    /// What it would be if tracks never took one thing for another: what is left is not seen.
    pub(super) ceiling: f64,
    /// How often a thing went from a track to another that did not have it before.
    pub(super) switches: u64,
    /// Sightings of things: thing times picture.
    pub(super) sightings: u64,
}

/// Counts by kind of thing.
#[derive(Debug, Default)]
pub(super) struct Lives(BTreeMap<&'static str, Counts>);

/// A thing of one log.
type Thing = (&'static str, i64);

impl Lives {
    /// Of the tracks of one log.
    pub(super) fn of(
        pictures: &[&Picture],
        frames: &[Stamped<ObservationFrame>],
        tracks: &[Track],
    ) -> Self {
        let strands = Strands::of(pictures);
        let present = present(pictures, &strands);
        let mut thing_of: Vec<Vec<Option<Thing>>> = Vec::new();
        for (picture, frame) in pictures.iter().zip(frames) {
            thing_of.push(things(picture, &frame.value, &strands));
        }
        let believed: Vec<&Track> = tracks.iter().filter(|track| track.is_believed).collect();
        let mut lives = Self::default();
        for kind in ["lines", "paint", "vehicles"] {
            lives
                .0
                .insert(kind, count(kind, &present, &believed, &thing_of, frames));
        }
        lives
    }

    pub(super) fn add(&mut self, other: &Self) {
        for (kind, counts) in &other.0 {
            let own = self.0.entry(kind).or_default();
            own.together += counts.together;
            own.things += counts.things;
            own.tracks += counts.tracks;
            own.switches += counts.switches;
            own.found += counts.found;
        }
    }

    pub(super) fn identities(&self) -> BTreeMap<&'static str, Identity> {
        let identity = |(kind, counts): (&&'static str, &Counts)| {
            let of = (counts.things + counts.tracks).max(1) as f64;
            let identity = Identity {
                idf1: 2.0 * counts.together as f64 / of,
                ceiling: 2.0 * counts.found as f64 / of,
                switches: counts.switches,
                sightings: counts.things,
            };
            (*kind, identity)
        };
        self.0.iter().map(identity).collect()
    }
}

/// Elements that are one line to the eye: each leads to the least of its strand.
#[derive(Default)]
struct Strands(BTreeMap<i64, i64>);

impl Strands {
    fn of(pictures: &[&Picture]) -> Self {
        let mut strands = Self::default();
        for picture in pictures {
            for (at, line) in picture.lines.iter().enumerate() {
                for other in &picture.lines[at + 1..] {
                    if line.id != other.id && meet(&line.parts, &other.parts) {
                        strands.join(line.id, other.id);
                    }
                }
            }
        }
        strands
    }

    fn join(&mut self, a: i64, b: i64) {
        let (a, b) = (self.first(a), self.first(b));
        if a != b {
            self.0.insert(a.max(b), a.min(b));
        }
    }

    fn first(&self, mut id: i64) -> i64 {
        while let Some(&less) = self.0.get(&id) {
            id = less;
        }
        id
    }
}

fn meet(a: &[Vec<[f64; 2]>], b: &[Vec<[f64; 2]>]) -> bool {
    let ends = |parts: &[Vec<[f64; 2]>]| -> Vec<[f64; 2]> {
        parts
            .iter()
            .flat_map(|part| [part.first(), part.last()])
            .flatten()
            .copied()
            .collect()
    };
    let (a, b) = (ends(a), ends(b));
    a.iter()
        .any(|p| b.iter().any(|q| (p[0] - q[0]).hypot(p[1] - q[1]) < SAME_PX))
}

/// In how many pictures each thing is asked for.
fn present(pictures: &[&Picture], strands: &Strands) -> BTreeMap<Thing, u64> {
    let mut present: BTreeMap<Thing, u64> = BTreeMap::new();
    for picture in pictures {
        let mut points: BTreeMap<Thing, usize> = BTreeMap::new();
        for (number, _) in Asked::of(picture).points {
            let thing = ("lines", strands.first(picture.lines[number].id));
            *points.entry(thing).or_default() += 1;
        }
        let lines = points
            .into_iter()
            .filter(|(_, count)| *count >= LEAST_POINTS)
            .map(|(thing, _)| thing);
        let boxes = picture
            .boxes
            .iter()
            .filter(|item| item.is_asked)
            .map(|item| (kind(item.seen), item.id));
        lines
            .chain(boxes)
            .for_each(|thing| *present.entry(thing).or_default() += 1);
    }
    present
}

fn kind(seen: Option<Seen>) -> &'static str {
    if seen == Some(Seen::Vehicle) {
        "vehicles"
    } else {
        "paint"
    }
}

/// The thing that each observation of a picture is of.
fn things(picture: &Picture, frame: &ObservationFrame, strands: &Strands) -> Vec<Option<Thing>> {
    let asked = Asked::of(picture);
    let of_box = boxes::matched(picture, frame);
    let thing = |(observation, of_box): (&_, &Option<usize>)| {
        let observation: &tilefold_schemas::observation::Observation = observation;
        match &observation.place {
            Place::Box(_) => {
                let item = of_box
                    .map(|at| &picture.boxes[at])
                    .filter(|item| item.is_asked)?;
                Some((kind(item.seen), item.id))
            }
            Place::Line(points) => line_thing(picture, &asked, points, strands),
        }
    };
    frame.observations.iter().zip(&of_box).map(thing).collect()
}

fn line_thing(
    picture: &Picture,
    asked: &Asked,
    points: &[[f64; 2]],
    strands: &Strands,
) -> Option<Thing> {
    let judged: Vec<_> = crossings(points)
        .into_iter()
        .filter(|point| asked.judges(picture, point))
        .collect();
    let mut on: BTreeMap<i64, usize> = BTreeMap::new();
    for point in &judged {
        let mut ids: Vec<i64> = asked
            .lines_at(point)
            .map(|number| strands.first(picture.lines[number].id))
            .collect();
        ids.sort_unstable();
        ids.dedup();
        ids.into_iter()
            .for_each(|id| *on.entry(id).or_default() += 1);
    }
    let (id, count) = on.into_iter().max_by_key(|(id, count)| (*count, -id))?;
    (count as f64 >= LEAST_SHARE * judged.len() as f64).then_some(("lines", id))
}

/// Observations that cannot be judged are no pictures of their track.
fn count(
    kind: &'static str,
    present: &BTreeMap<Thing, u64>,
    tracks: &[&Track],
    thing_of: &[Vec<Option<Thing>>],
    frames: &[Stamped<ObservationFrame>],
) -> Counts {
    let is_kind = |track: &&&Track| {
        let (frame, index) = track.hits[0];
        let observation = &frames[frame].value.observations[index];
        kind == match (&observation.place, observation.seen) {
            (Place::Line(_), _) => "lines",
            (_, Seen::Vehicle) => "vehicles",
            _ => "paint",
        }
    };
    let mut counts = Counts {
        things: present
            .iter()
            .filter(|((of, _), _)| *of == kind)
            .map(|(_, count)| count)
            .sum(),
        ..Counts::default()
    };
    // Hits that tracks and things have in common.
    let mut numbers: BTreeMap<Thing, usize> = BTreeMap::new();
    let mut common: Vec<BTreeMap<usize, u64>> = Vec::new();
    let mut hits: Vec<(Thing, usize, usize)> = Vec::new();
    for (number, track) in tracks.iter().filter(is_kind).enumerate() {
        counts.tracks += track.hits.len() as u64;
        let mut of_track: BTreeMap<usize, u64> = BTreeMap::new();
        for &(frame, index) in &track.hits {
            if let Some(thing) = thing_of[frame][index] {
                let next = numbers.len();
                *of_track
                    .entry(*numbers.entry(thing).or_insert(next))
                    .or_default() += 1;
                hits.push((thing, frame, number));
            }
        }
        common.push(of_track);
    }
    hits.sort_unstable();
    (counts.found, counts.switches) = found_and_switched(&hits);
    counts.together = most_in_common(&common, numbers.len());
    counts
}

/// Pictures of things with a track, and how often none of a thing's tracks in a picture was among
/// those of the picture before: a line may be seen in two pieces. Hits are in order.
fn found_and_switched(hits: &[(Thing, usize, usize)]) -> (u64, u64) {
    let pictures: Vec<_> = hits.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)).collect();
    let is_switch = |pair: &&[&[(Thing, usize, usize)]]| {
        let is_same = |(thing, _, track): &(Thing, usize, usize)| {
            let before = pair[0].iter();
            before.clone().any(|hit| (hit.0, hit.2) == (*thing, *track))
        };
        pair[0][0].0 == pair[1][0].0 && !pair[1].iter().any(is_same)
    };
    let switches = pictures.windows(2).filter(is_switch).count();
    (pictures.len() as u64, switches as u64)
}

/// The most hits that tracks and things have in common when each has at most one partner.
fn most_in_common(common: &[BTreeMap<usize, u64>], things: usize) -> u64 {
    let most = common
        .iter()
        .flat_map(BTreeMap::values)
        .max()
        .copied()
        .unwrap_or(0) as f64;
    let cost: Vec<Vec<Option<f64>>> = (common.iter())
        .map(|row| {
            (0..things)
                .map(|thing| row.get(&thing).map(|hits| most - *hits as f64))
                .collect()
        })
        .collect();
    // Alone, both cost what a pair without a common hit would.
    let assigned = assign(&cost, things, most / 2.0);
    let pairs = assigned.iter().zip(common);
    pairs.filter_map(|(thing, row)| row.get(&(*thing)?)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn partners_share_the_most_hits() {
        // A track that changes over, and one that takes the rest.
        let common = [BTreeMap::from([(0, 6), (1, 4)]), BTreeMap::from([(0, 5)])];
        // 4 with 1 and 5 with 0 are more than 6 alone.
        assert_eq!(most_in_common(&common, 2), 9);
        assert_eq!(most_in_common(&[], 0), 0);
    }

    #[test]
    fn a_line_in_two_pieces_is_no_switch() {
        let line = ("lines", 1);
        // Tracks 4 and 5 in the first picture, 5 in the next, 6 in the one after; another line.
        let hits = [(line, 0, 4), (line, 0, 5), (line, 1, 5), (line, 2, 6)];
        assert_eq!(found_and_switched(&hits), (3, 1));
        assert_eq!(
            found_and_switched(&[(line, 0, 4), (("lines", 2), 1, 5)]),
            (2, 0)
        );
    }

    #[test]
    fn elements_end_to_end_are_one_strand() {
        let mut strands = Strands::default();
        strands.join(5, 3);
        strands.join(5, 9);
        assert_eq!([3, 5, 9, 4].map(|id| strands.first(id)), [3, 3, 3, 4]);
    }
}
