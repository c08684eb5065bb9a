//! What can happen to one piece of paint.

use tilefold_schemas::element::{ElementKind, Marking, SignClass};

use super::{Change, ChangeType, Editing, Happening};
use crate::random::Random;
use crate::world::{Paint, Point};

/// How far paint is shifted, to either side, in metres.
const SHIFT_M: (f64, f64) = (0.2, 2.0);
/// Share of a line that is ground off, and the shortest line of which a part is, in metres.
const PART: (f64, f64) = (0.35, 0.65);
const LEAST_M: f64 = 50.0;
/// How much of worn paint is gone.
const WEAR: (f64, f64) = (0.5, 0.85);

impl Editing<'_> {
    /// Lets something happen to the paint at an index; none if it cannot.
    pub(super) fn alter(
        &mut self,
        index: usize,
        happening: Happening,
        dates: (i64, i64),
        random: &mut Random,
    ) -> Option<()> {
        let paint = self.world.paint[index].clone();
        match happening {
            Happening::Added => self.add(index, dates),
            Happening::Removed => self.remove(index, happening, dates),
            Happening::PartlyRemoved => self.remove_part(index, dates, random)?,
            Happening::Shifted => {
                let left_m = random.sign() * random.between(SHIFT_M.0, SHIFT_M.1);
                let becomes = Paint {
                    points: shifted(paint.kind, &paint.points, left_m),
                    ..paint
                };
                self.replace(index, happening, becomes, dates);
                self.last_change()?.shift_m = Some(left_m);
            }
            Happening::Retyped => {
                let becomes = retyped(&paint, random)?;
                self.replace(index, happening, becomes, dates);
            }
            Happening::Repainted => self.replace(index, happening, paint, dates),
            Happening::Worn => {
                let wear = random.between(WEAR.0, WEAR.1);
                self.replace(index, happening, Paint { wear, ..paint }, dates);
            }
            Happening::LaneAdded | Happening::LaneDropped | Happening::Construction => return None,
        }
        Some(())
    }

    /// What is there from a date on has not been in the map.
    fn add(&mut self, index: usize, (since_ns, _): (i64, i64)) {
        let paint = &mut self.world.paint[index];
        paint.since_ns = since_ns;
        let paint = paint.clone();
        self.map.remove(&paint.id);
        self.note(
            ChangeType::Added,
            Happening::Added,
            paint,
            (since_ns, i64::MAX),
        );
    }

    pub(super) fn remove(&mut self, index: usize, happening: Happening, dates: (i64, i64)) {
        let paint = &mut self.world.paint[index];
        let as_mapped = paint.clone();
        paint.until_ns = dates.0;
        self.come_back(as_mapped.clone(), dates.1);
        self.note(ChangeType::Removed, happening, as_mapped, dates);
    }

    /// The paint at an index becomes other paint.
    pub(super) fn replace(
        &mut self,
        index: usize,
        happening: Happening,
        becomes: Paint,
        dates: (i64, i64),
    ) {
        let paint = &mut self.world.paint[index];
        let as_mapped = paint.clone();
        paint.until_ns = dates.0;
        let becomes = Paint {
            since_ns: dates.0,
            until_ns: dates.1,
            ..becomes
        };
        self.come_back(as_mapped, dates.1);
        let change_type = match happening {
            Happening::Repainted | Happening::Worn => ChangeType::NoChange,
            _ => ChangeType::Modified,
        };
        self.note(change_type, happening, becomes.clone(), dates);
        self.world.paint.push(becomes);
    }

    /// Paint that no map has.
    pub(super) fn invent(&mut self, happening: Happening, paint: Paint, dates: (i64, i64)) {
        let paint = Paint {
            id: self.new_id(),
            since_ns: dates.0,
            until_ns: dates.1,
            ..paint
        };
        self.note(ChangeType::Added, happening, paint.clone(), dates);
        self.world.paint.push(paint);
    }

    fn remove_part(&mut self, index: usize, dates: (i64, i64), random: &mut Random) -> Option<()> {
        let paint = self.world.paint[index].clone();
        let length_m = length_m(&paint.points);
        if length_m < LEAST_M {
            return None;
        }
        let part_m = length_m * random.between(PART.0, PART.1);
        let from_m = random.between(0.0, length_m - part_m);
        let to_m = from_m + part_m;
        self.world.paint[index].until_ns = dates.0;
        for (begin_m, end_m) in [(0.0, from_m), (to_m, length_m)] {
            if end_m - begin_m > 0.5 {
                self.world.paint.push(Paint {
                    points: between(&paint.points, begin_m, end_m),
                    phase_m: paint.phase_m + begin_m,
                    since_ns: dates.0,
                    ..paint.clone()
                });
            }
        }
        let gone = Paint {
            points: between(&paint.points, from_m, to_m),
            ..paint
        };
        self.note(ChangeType::Removed, Happening::PartlyRemoved, gone, dates);
        self.last_change()?.stretch_m = Some([from_m, to_m]);
        Some(())
    }

    /// Paint that was away is there again from `since_ns` on.
    fn come_back(&mut self, paint: Paint, since_ns: i64) {
        if since_ns < i64::MAX {
            self.world.paint.push(Paint { since_ns, ..paint });
        }
    }

    fn note(
        &mut self,
        change_type: ChangeType,
        happening: Happening,
        paint: Paint,
        (since_ns, until_ns): (i64, i64),
    ) {
        self.changes.push(Change {
            change_type,
            happening,
            paint,
            stretch_m: None,
            shift_m: None,
            since_ns,
            until_ns,
        });
    }

    fn last_change(&mut self) -> Option<&mut Change> {
        self.changes.last_mut()
    }
}

/// Another marking or sign than it was; none for what has no type.
pub(super) fn retyped(paint: &Paint, random: &mut Random) -> Option<Paint> {
    const ARROWS: [SignClass; 5] = [
        SignClass::StraightArrow,
        SignClass::LeftArrow,
        SignClass::RightArrow,
        SignClass::StraightLeftArrow,
        SignClass::StraightRightArrow,
    ];
    let mut becomes = paint.clone();
    match (paint.kind, paint.marking) {
        (ElementKind::GroundSign, _) if ARROWS.contains(&paint.sign) => {
            let others = ARROWS.into_iter().filter(|sign| *sign != paint.sign);
            let others: Vec<SignClass> = others.collect();
            becomes.sign = others[random.index(others.len())];
        }
        (ElementKind::LaneMarking, Marking::Solid | Marking::SolidSolid) => {
            becomes.marking = Marking::Dashed;
        }
        (ElementKind::LaneMarking, Marking::Dashed) => becomes.marking = Marking::Solid,
        _ => return None,
    }
    Some(becomes)
}

/// The points moved to the left of their course (or right, if negative). Outlines are moved as a
/// whole, to the left of their first side.
pub(super) fn shifted(kind: ElementKind, points: &[Point], left_m: f64) -> Vec<Point> {
    let is_outline = matches!(kind, ElementKind::Crosswalk | ElementKind::GroundSign);
    let moved = |index: usize| {
        let (from, to) = match is_outline {
            true => (points[0], points[1.min(points.len() - 1)]),
            false => (
                points[index.saturating_sub(1)],
                points[(index + 1).min(points.len() - 1)],
            ),
        };
        let (east, north) = (to[0] - from[0], to[1] - from[1]);
        let scale = left_m / east.hypot(north).max(1e-9);
        let [east_m, north_m, up_m] = points[index];
        [east_m - north * scale, north_m + east * scale, up_m]
    };
    (0..points.len()).map(moved).collect()
}

/// Length over the plane, in metres.
pub(super) fn length_m(points: &[Point]) -> f64 {
    let step = |pair: &[Point]| (pair[1][0] - pair[0][0]).hypot(pair[1][1] - pair[0][1]);
    points.windows(2).map(step).sum()
}

/// The piece of a line between two lengths along it.
fn between(points: &[Point], from_m: f64, to_m: f64) -> Vec<Point> {
    let mut piece = vec![at(points, from_m)];
    let mut along_m = 0.0;
    for pair in points.windows(2) {
        along_m += length_m(pair);
        if along_m > from_m + 1e-6 && along_m < to_m - 1e-6 {
            piece.push(pair[1]);
        }
    }
    piece.push(at(points, to_m));
    piece
}

/// The point at a length along a line.
fn at(points: &[Point], along_m: f64) -> Point {
    let mut left_m = along_m;
    for pair in points.windows(2) {
        let step_m = length_m(pair);
        if left_m <= step_m {
            let share = left_m / step_m.max(1e-9);
            return [0, 1, 2].map(|axis| pair[0][axis] + share * (pair[1][axis] - pair[0][axis]));
        }
        left_m -= step_m;
    }
    points[points.len() - 1]
}
