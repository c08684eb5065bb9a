//! Known errors: the true map with some of its ways taken out, moved, or added beside the paint.

use std::collections::BTreeMap;

use tilefold_schemas::element::{Element, Marking};

use crate::error::CityError;
use crate::random::Random;
use crate::road::{Line, Road, Street};
use crate::survey::{FIRST_WAY, Piece, Survey, cuts, pieces};

/// How far a line is moved in the map, in metres to either side.
const SHIFT_M: (f64, f64) = (0.9, 1.4);
/// How far from the middle of its lane a line that does not exist is drawn, in metres.
const PHANTOM_STRAY_M: f64 = 0.2;

/// What changed between the map with errors and the road.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum ChangeType {
    /// On the road, not in the map.
    Added,
    /// In the map, not on the road.
    Removed,
    /// On the road, but not where the map has it.
    Modified,
}

impl ChangeType {
    /// The name in files.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Added => "added",
            Self::Removed => "removed",
            Self::Modified => "modified",
        }
    }
}

/// One known change.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Change {
    /// What changed.
    pub(crate) change_type: ChangeType,
    /// The element: as it is on the road, or, if it was removed, as it is in the map.
    pub(crate) element: Element,
    /// How far to the left the map has it, in metres, if it was moved.
    pub(crate) shift_m: Option<f64>,
}

/// The maps of a city and what lies between them.
pub(crate) struct Maps {
    /// What is on the road, by id.
    pub(crate) after: Vec<Element>,
    /// The map with errors, by id.
    pub(crate) before: Vec<Element>,
    /// By element id.
    pub(crate) changes: Vec<Change>,
}

/// Draws the changes: at most one on each stretch of road, so that they do not touch.
pub(crate) fn draw(
    survey: &Survey<'_>,
    seed: u64,
    changes_per_kind: u32,
) -> Result<Maps, CityError> {
    let mut random = Random::new(seed, "changes", 0);
    let per_kind = changes_per_kind as usize;
    let mut stretches = stretches(survey.street);
    if stretches.len() < per_kind.saturating_mul(3) {
        return Err(CityError::Crowded {
            changes: per_kind.saturating_mul(3),
            stretches: stretches.len(),
        });
    }
    random.shuffle(&mut stretches);

    let pieces = pieces(survey.street);
    let after: BTreeMap<i64, Element> = (FIRST_WAY..)
        .zip(&pieces)
        .map(|(id, piece)| (id, survey.element(id, piece)))
        .collect();
    let mut maps = Editing {
        survey,
        before: after.clone(),
        changes: Vec::new(),
        next_id: FIRST_WAY + after.len() as i64,
    };
    for (nth, stretch) in stretches.iter().take(per_kind * 3).enumerate() {
        let index = random.index(stretch.road.lines.len());
        match nth % 3 {
            0 => maps.leave_out(stretch.first_id + index as i64),
            1 => maps.invent(stretch, &mut random),
            _ => {
                let shift_m = random.sign() * random.between(SHIFT_M.0, SHIFT_M.1);
                let piece = stretch.piece(stretch.road.lines[index]);
                maps.shift(stretch.first_id + index as i64, &piece, shift_m);
            }
        }
    }
    maps.changes.sort_by_key(|change| change.element.id);
    Ok(Maps {
        before: maps.before.into_values().collect(),
        changes: maps.changes,
        after: after.into_values().collect(),
    })
}

/// A road between two cuts, and the id of its rightmost way.
struct Stretch<'a> {
    road: &'a Road,
    from_m: f64,
    to_m: f64,
    first_id: i64,
}

impl Stretch<'_> {
    fn piece(&self, line: Line) -> Piece {
        Piece {
            line,
            from_m: self.from_m,
            to_m: self.to_m,
        }
    }
}

fn stretches(street: &Street) -> Vec<Stretch<'_>> {
    let mut stretches = Vec::new();
    let mut first_id = FIRST_WAY;
    for road in &street.roads {
        for cut in cuts(road).windows(2) {
            stretches.push(Stretch {
                road,
                from_m: cut[0],
                to_m: cut[1],
                first_id,
            });
            first_id += road.lines.len() as i64;
        }
    }
    stretches
}

/// A map while it is being falsified.
struct Editing<'a> {
    survey: &'a Survey<'a>,
    before: BTreeMap<i64, Element>,
    changes: Vec<Change>,
    next_id: i64,
}

impl Editing<'_> {
    /// The map lacks a way of the road.
    fn leave_out(&mut self, id: i64) {
        if let Some(element) = self.before.remove(&id) {
            self.changes.push(Change {
                change_type: ChangeType::Added,
                element,
                shift_m: None,
            });
        }
    }

    /// The map has a way, in the middle of a lane, that the road lacks.
    fn invent(&mut self, stretch: &Stretch<'_>, random: &mut Random) {
        let lane = random.index(stretch.road.lanes());
        let stray_m = random.between(-PHANTOM_STRAY_M, PHANTOM_STRAY_M);
        let piece = stretch.piece(Line {
            offset_m: stretch.road.lane_offset_m(lane) + stray_m,
            marking: Marking::Solid,
            color: stretch.road.lines[0].color,
        });
        let element = self.survey.element(self.next_id, &piece);
        self.before.insert(self.next_id, element.clone());
        self.next_id += 1;
        self.changes.push(Change {
            change_type: ChangeType::Removed,
            element,
            shift_m: None,
        });
    }

    /// The map has a way of the road `shift_m` to the left of where it is.
    fn shift(&mut self, id: i64, piece: &Piece, shift_m: f64) {
        let mut moved = *piece;
        moved.line.offset_m += shift_m;
        self.before.insert(id, self.survey.element(id, &moved));
        self.changes.push(Change {
            change_type: ChangeType::Modified,
            element: self.survey.element(id, piece),
            shift_m: Some(shift_m),
        });
    }
}
