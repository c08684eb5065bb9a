//! What happens to a lane: its two lines together.

use tilefold_schemas::element::{Color, ElementKind, Marking};

use super::alter::{length_m, shifted};
use super::{Editing, Happening};
use crate::ground::Ground;
use crate::random::Random;
use crate::world::{Lane, Paint, Point, World};

/// A line is a lane's border if its middle lies this near to where the border should be, in metres.
const BORDER_M: f64 = 0.7;
const LINE: ElementKind = ElementKind::LaneMarking;
/// Shorter lines are left alone, in metres.
const LEAST_M: f64 = 40.0;
/// No line is longer than this from end to end, in metres: one that begins further off is not asked.
const LONGEST_M: f64 = 400.0;
/// How far a construction site moves a lane's lines, in metres.
const SITE_SHIFT_M: (f64, f64) = (0.7, 1.3);

impl Editing<'_> {
    /// Adds or drops a lane, or has it moved by a construction site.
    pub(super) fn try_beside_a_lane(
        &mut self,
        happening: Happening,
        dates: (i64, i64),
        random: &mut Random,
    ) -> Option<()> {
        let lane = self.world.lanes[random.index(self.world.lanes.len())].clone();
        if lane.is_junction || lane.centre.len() < 4 {
            return None;
        }
        let middle = lane.centre.len() / 2;
        let at = lane.centre[middle];
        if !self.is_free(at) {
            return None;
        }
        let [left, right] = self.borders(&lane, middle)?;
        match happening {
            Happening::LaneAdded if lane.right.is_none() => self.add_lane(right, &lane, dates)?,
            Happening::LaneDropped if lane.right.is_none() && lane.left.is_some() => {
                self.drop_lane([left, right], dates)?;
            }
            Happening::Construction => {
                let shift_m = random.sign() * random.between(SITE_SHIFT_M.0, SITE_SHIFT_M.1);
                self.build([left, right], &lane, shift_m, dates);
            }
            _ => return None,
        }
        self.taken.push(at);
        Some(())
    }

    /// The lane's left and right line, where nothing has happened to either.
    fn borders(&self, lane: &Lane, middle: usize) -> Option<[usize; 2]> {
        let from = lane.centre[middle - 1];
        let beside = |left_m| shifted(LINE, &[from, lane.centre[middle]], left_m)[1];
        let half_m = lane.width_m / 2.0;
        let left = self.line_at(beside(half_m))?;
        let right = self.line_at(beside(-half_m))?;
        (left != right).then_some([left, right])
    }

    fn line_at(&self, at: Point) -> Option<usize> {
        let lines = self.kinds.get(&ElementKind::LaneMarking)?;
        lines.iter().copied().find(|&index| {
            let paint = &self.world.paint[index];
            paint.until_ns == i64::MAX
                && paint.since_ns == i64::MIN
                && (paint.points[0][0] - at[0]).hypot(paint.points[0][1] - at[1]) < LONGEST_M
                && passes(&paint.points, at, BORDER_M)
                && length_m(&paint.points) >= LEAST_M
        })
    }

    /// A new edge a lane's width to the right; the old edge becomes a line between lanes.
    fn add_lane(&mut self, right: usize, lane: &Lane, dates: (i64, i64)) -> Option<()> {
        let edge = self.world.paint[right].clone();
        if edge.marking != Marking::Solid {
            return None;
        }
        let outwards_m = match is_along(&edge.points, lane) {
            true => -lane.width_m,
            false => lane.width_m,
        };
        let outer = Paint {
            points: shifted(LINE, &edge.points, outwards_m),
            ..edge.clone()
        };
        let becomes = Paint {
            marking: Marking::Dashed,
            ..edge
        };
        self.replace(right, Happening::LaneAdded, becomes, dates);
        self.invent(Happening::LaneAdded, outer, dates);
        Some(())
    }

    /// No edge any more; the line between the lanes becomes one.
    fn drop_lane(&mut self, [left, right]: [usize; 2], dates: (i64, i64)) -> Option<()> {
        let inner = self.world.paint[left].clone();
        if inner.marking != Marking::Dashed {
            return None;
        }
        let becomes = Paint {
            marking: Marking::Solid,
            ..inner
        };
        self.remove(right, Happening::LaneDropped, dates);
        self.replace(left, Happening::LaneDropped, becomes, dates);
        Some(())
    }

    /// The lane's lines are gone, and yellow ones lie beside their place.
    fn build(&mut self, lines: [usize; 2], lane: &Lane, left_m: f64, dates: (i64, i64)) {
        for index in lines {
            let line = self.world.paint[index].clone();
            let left_m = match is_along(&line.points, lane) {
                true => left_m,
                false => -left_m,
            };
            let becomes = Paint {
                points: shifted(LINE, &line.points, left_m),
                color: Color::Yellow,
                marking: Marking::Solid,
                ..line
            };
            self.replace(index, Happening::Construction, becomes, dates);
        }
    }
}

/// Paint of which a lane's middle passes the middle, by index.
pub(super) fn driven_past(world: &World, within_m: f64) -> Vec<usize> {
    let ground = Ground::new(world);
    let is_seen = |paint: &Paint| {
        let at = paint.points[paint.points.len() / 2];
        let mut lanes = ground.lanes_near([at[0], at[1]], within_m);
        lanes.any(|lane| passes(&lane.centre, at, within_m))
    };
    let paint = world.paint.iter().enumerate();
    let seen = paint.filter(|(_, paint)| is_seen(paint));
    seen.map(|(index, _)| index).collect()
}

/// Whether a line passes a point, at so many metres at most.
fn passes(points: &[Point], at: Point, within_m: f64) -> bool {
    points.windows(2).any(|pair| {
        let (east, north) = (pair[1][0] - pair[0][0], pair[1][1] - pair[0][1]);
        let (to_e, to_n) = (at[0] - pair[0][0], at[1] - pair[0][1]);
        let square = (east * east + north * north).max(1e-9);
        let share = ((to_e * east + to_n * north) / square).clamp(0.0, 1.0);
        (to_e - share * east).hypot(to_n - share * north) < within_m
    })
}

/// Whether a line runs in a lane's direction.
fn is_along(points: &[Point], lane: &Lane) -> bool {
    let course = |points: &[Point]| {
        let (first, last) = (points[0], points[points.len() - 1]);
        [last[0] - first[0], last[1] - first[1]]
    };
    let (line, lane) = (course(points), course(&lane.centre));
    line[0] * lane[0] + line[1] * lane[1] > 0.0
}
