//! Known changes: what happens to the paint of a world after its map was made.
//!
//! The map is the world's paint before anything happened to it, less what is added later. Every
//! event has a date; what was altered stays in the world until that date, what it became is there
//! from then on. Events keep their distance from each other, so that each can be told alone.

mod alter;
mod beside;

use std::collections::BTreeMap;

use tilefold_schemas::element::ElementKind;

use crate::random::Random;
use crate::world::{Paint, Point, World};

const DAY_NS: f64 = 86_400e9;
/// Events lie this far apart at least, in metres; nearer where there is no other place.
const APART_M: [f64; 3] = [90.0, 45.0, 20.0];
/// Tries to find a place for an event, at each distance.
const TRIES: usize = 200;
/// Paint farther than this from every lane is seen by nobody: nothing happens to it. In metres.
const SEEN_M: f64 = 8.0;
/// What happens where something else has no place.
const EASY: [Happening; 3] = [Happening::Added, Happening::Removed, Happening::Shifted];
/// Changes from before the campaign happened within this many days of it.
const DAYS_BEFORE: f64 = 60.0;
/// A construction site comes and goes at these shares of the campaign.
const SITE_COMES: (f64, f64) = (0.2, 0.4);
const SITE_GOES: (f64, f64) = (0.6, 0.8);

/// What happened.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Happening {
    /// New paint.
    Added,
    /// Ground off.
    Removed,
    /// A stretch of a line ground off.
    PartlyRemoved,
    /// Painted anew beside its old place.
    Shifted,
    /// A solid line became dashed, or an arrow another.
    Retyped,
    /// A lane more: a new edge, and the old one dashed.
    LaneAdded,
    /// A lane less: no edge, and the line inside of it solid.
    LaneDropped,
    /// Yellow lines beside the white ones' place, for some days.
    Construction,
    /// Painted anew as it was: no change.
    Repainted,
    /// Worn off by half or more: no change.
    Worn,
}

/// How often what happens.
const SHARES: [(Happening, f64); 10] = [
    (Happening::Added, 0.19),
    (Happening::Removed, 0.19),
    (Happening::PartlyRemoved, 0.10),
    (Happening::Shifted, 0.18),
    (Happening::Retyped, 0.10),
    (Happening::LaneAdded, 0.04),
    (Happening::LaneDropped, 0.04),
    (Happening::Construction, 0.04),
    (Happening::Repainted, 0.06),
    (Happening::Worn, 0.06),
];

/// Which kinds of paint are chosen, cumulative.
const KINDS: [(f64, ElementKind); 4] = [
    (0.68, ElementKind::LaneMarking),
    (0.88, ElementKind::GroundSign),
    (0.94, ElementKind::StopLine),
    (1.0, ElementKind::Crosswalk),
];

impl Happening {
    /// The name in truth files (`detail`).
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Added => "added",
            Self::Removed => "removed",
            Self::PartlyRemoved => "partly_removed",
            Self::Shifted => "shifted",
            Self::Retyped => "retyped",
            Self::LaneAdded => "lane_added",
            Self::LaneDropped => "lane_dropped",
            Self::Construction => "construction",
            Self::Repainted => "repainted",
            Self::Worn => "worn",
        }
    }
}

/// What a map team would have to do.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum ChangeType {
    /// On the road, not in the map.
    Added,
    /// In the map, not on the road.
    Removed,
    /// On the road, but not where or what the map has.
    Modified,
    /// As the map has it.
    NoChange,
}

impl ChangeType {
    /// The name in truth files (`change_type`).
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Added => "added",
            Self::Removed => "removed",
            Self::Modified => "modified",
            Self::NoChange => "no_change",
        }
    }
}

/// One known difference between the map and the road.
#[derive(Debug, Clone, PartialEq)]
pub struct Change {
    /// The type of change.
    pub change_type: ChangeType,
    /// What happened.
    pub happening: Happening,
    /// The paint as it is on the road, or, if it was removed, as the map has it. The id is that of
    /// the map's element; what was added has an id that the map does not know.
    pub paint: Paint,
    /// The stretch of a partly removed line, metres along the map's element.
    pub stretch_m: Option<[f64; 2]>,
    /// How far to the left it was shifted, in metres.
    pub shift_m: Option<f64>,
    /// From when until when the road is so.
    pub since_ns: i64,
    /// First nanosecond at which it is as in the map again; `i64::MAX` if it never is.
    pub until_ns: i64,
}

/// When things happen.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Campaign {
    pub(crate) begin_ns: i64,
    pub(crate) days: f64,
    /// Share of the changes that happen during the campaign, 0 to 1.
    pub(crate) during: f64,
}

impl Campaign {
    pub(crate) fn end_ns(&self) -> i64 {
        self.at(1.0)
    }

    fn at(&self, share: f64) -> i64 {
        self.begin_ns + (share * self.days * DAY_NS) as i64
    }

    fn draw_date_ns(&self, random: &mut Random) -> i64 {
        if random.chance(self.during) {
            return self.at(random.between(0.1, 0.9));
        }
        self.begin_ns - (random.between(0.0, DAYS_BEFORE) * DAY_NS) as i64
    }
}

/// The map of a world, and all that happened since.
#[derive(Debug, Clone)]
pub(crate) struct History {
    /// The map's elements, by id.
    pub(crate) map: Vec<Paint>,
    /// By date and id.
    pub(crate) changes: Vec<Change>,
}

/// Lets about `share` of the world's paint change.
pub(crate) fn draw(world: &mut World, seed: u64, share: f64, campaign: Campaign) -> History {
    let mut random = Random::new(seed, "changes", 0);
    let count = (share * world.paint.len() as f64).round();
    let happenings = happenings(count, &mut random);
    let mut editing = Editing::new(world);
    for happening in happenings {
        if !editing.find_place(happening, campaign, &mut random) {
            let easy = EASY[random.index(EASY.len())];
            editing.find_place(easy, campaign, &mut random);
        }
    }
    editing.finish()
}

/// What happens `count` times, in any order. What is rounded off from one kind is added to the next,
/// from a lot on: the sum is right, and no kind is always too rare to happen in a small world.
fn happenings(count: f64, random: &mut Random) -> Vec<Happening> {
    let mut happenings = Vec::new();
    let mut due = random.unit();
    for (happening, of_all) in SHARES {
        due += count * of_all;
        happenings.resize(due as usize, happening);
    }
    random.shuffle(&mut happenings);
    happenings
}

/// From when until when something that happens lasts.
fn dates(happening: Happening, campaign: Campaign, random: &mut Random) -> (i64, i64) {
    match happening {
        Happening::Construction => (
            campaign.at(random.between(SITE_COMES.0, SITE_COMES.1)),
            campaign.at(random.between(SITE_GOES.0, SITE_GOES.1)),
        ),
        _ => (campaign.draw_date_ns(random), i64::MAX),
    }
}

/// A world while it is changed.
struct Editing<'a> {
    world: &'a mut World,
    map: BTreeMap<i64, Paint>,
    /// Places in the world's paint of what vehicles come by, by kind.
    kinds: BTreeMap<ElementKind, Vec<usize>>,
    changes: Vec<Change>,
    /// Where something happened already, and how far from there the next may.
    taken: Vec<Point>,
    apart_m: f64,
    next_id: i64,
}

impl<'a> Editing<'a> {
    fn new(world: &'a mut World) -> Self {
        let mut kinds: BTreeMap<ElementKind, Vec<usize>> = BTreeMap::new();
        for index in beside::driven_past(world, SEEN_M) {
            kinds
                .entry(world.paint[index].kind)
                .or_default()
                .push(index);
        }
        let map: BTreeMap<i64, Paint> = world
            .paint
            .iter()
            .map(|paint| (paint.id, paint.clone()))
            .collect();
        let largest = map.last_key_value().map_or(0, |(id, _)| *id);
        Self {
            world,
            map,
            kinds,
            changes: Vec::new(),
            taken: Vec::new(),
            apart_m: APART_M[0],
            next_id: largest + 1,
        }
    }

    fn finish(self) -> History {
        self.world
            .paint
            .sort_by_key(|paint| (paint.id, paint.since_ns));
        let mut changes = self.changes;
        changes.sort_by_key(|change| (change.since_ns, change.paint.id));
        History {
            map: self.map.into_values().collect(),
            changes,
        }
    }

    /// Lets something happen somewhere; says whether there was a place for it.
    fn find_place(&mut self, what: Happening, campaign: Campaign, random: &mut Random) -> bool {
        APART_M.iter().any(|&apart_m| {
            self.apart_m = apart_m;
            (0..TRIES).any(|_| {
                let dates = dates(what, campaign, random);
                self.try_to(what, dates, random).is_some()
            })
        })
    }

    /// Lets something happen at a place drawn by lot; none if it cannot be there.
    fn try_to(
        &mut self,
        happening: Happening,
        dates: (i64, i64),
        random: &mut Random,
    ) -> Option<()> {
        match happening {
            Happening::LaneAdded | Happening::LaneDropped | Happening::Construction => {
                self.try_beside_a_lane(happening, dates, random)
            }
            _ => self.try_on_paint(happening, dates, random),
        }
    }

    fn try_on_paint(
        &mut self,
        happening: Happening,
        dates: (i64, i64),
        random: &mut Random,
    ) -> Option<()> {
        let kind = match happening {
            Happening::PartlyRemoved => ElementKind::LaneMarking,
            _ => draw_kind(random),
        };
        let of_kind = self.kinds.get(&kind)?;
        let index = of_kind[random.index(of_kind.len())];
        let paint = &self.world.paint[index];
        let middle = paint.points[paint.points.len() / 2];
        if paint.until_ns < i64::MAX || !self.is_free(middle) {
            return None;
        }
        self.alter(index, happening, dates, random)?;
        self.taken.push(middle);
        Some(())
    }

    fn is_free(&self, at: Point) -> bool {
        let far = |taken: &Point| (taken[0] - at[0]).hypot(taken[1] - at[1]) > self.apart_m;
        self.taken.iter().all(far)
    }

    fn new_id(&mut self) -> i64 {
        self.next_id += 1;
        self.next_id - 1
    }
}

fn draw_kind(random: &mut Random) -> ElementKind {
    let lot = random.unit();
    let kind = KINDS.iter().find(|(chance, _)| lot < *chance);
    kind.map_or(ElementKind::LaneMarking, |(_, kind)| *kind)
}

#[cfg(test)]
mod tests;
