//! Matching against truth ids: the map stage is run once more over the logs, and what it takes each
//! detection for is held against what the detection is of. Nothing is written.
//!
//! What is counted are the parts of detections that are of one element each: the map cuts lines into
//! ways where nobody sees it, and a detection over such a border is of both ways. A part is matched
//! to what the map stage takes its middle for.
//!
//! Only lane markings count: areas are confronted over a whole drive, not frame by frame.
//!
//! Eq 23 and 24 of the paper, as we read them: of what was matched, the share that was matched
//! rightly; and of what could be matched, the share that was. Paint that the base map lacks and
//! clutter cannot be matched; that they are left alone counts for the assignment accuracy only.

use std::collections::BTreeMap;
use std::path::PathBuf;

use rayon::prelude::*;
use serde::Serialize;
use tilefold_formats::matching_truth::{MatchingTruth, Part};
use tilefold_schemas::{ChunkRow, Element, ElementId, ElementKind, VehicleKey};
use tilefold_store::{Snapshot, TileFilter};
use tilefold_tiler::chunk;
use tilefold_tiler::map_index::MapIndex;
use tilefold_tiler::recording::between;
use tilefold_workers::trace::{Assignment, assignments};
use tilefold_workers::{MapContext, Registering, map_chunk_traced};

use crate::error::EngineError;
use crate::logs::{Catalogue, Unit};
use crate::meter::{Meter, Stage};
use crate::progress::Progress;
use crate::run::read_elements;

/// How well detections are matched to map elements.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Matching {
    /// Detections that the truth knows; those of several elements count for each.
    pub detections: u64,
    /// Share of the matched detections that were matched to their element (Eq 23).
    pub r_match: Option<f64>,
    /// Share of the detections of mapped elements that were matched to their element (Eq 24).
    pub r_recall: Option<f64>,
    /// Share of all detections that were matched to their element, or to none where it has none.
    pub assignment: Option<f64>,
}

/// Counts of detections.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
struct Counts {
    all: u64,
    /// Of elements that the base map has.
    mappable: u64,
    matched: u64,
    /// Matched to their element.
    right: u64,
    /// Neither matched nor of a mapped element.
    left_alone: u64,
}

impl Counts {
    fn count(&mut self, truth: Option<i64>, matched: Option<i64>) {
        self.all += 1;
        self.mappable += u64::from(truth.is_some());
        self.matched += u64::from(matched.is_some());
        self.right += u64::from(matched.is_some() && matched == truth);
        self.left_alone += u64::from(matched.is_none() && truth.is_none());
    }

    fn plus(self, other: Self) -> Self {
        Self {
            all: self.all + other.all,
            mappable: self.mappable + other.mappable,
            matched: self.matched + other.matched,
            right: self.right + other.right,
            left_alone: self.left_alone + other.left_alone,
        }
    }

    fn matching(self) -> Matching {
        let share = |part: u64, whole: u64| (whole > 0).then(|| part as f64 / whole as f64);
        Matching {
            detections: self.all,
            r_match: share(self.right, self.matched),
            r_recall: share(self.right, self.mappable),
            assignment: share(self.right + self.left_alone, self.all),
        }
    }
}

/// Drives whose matching is looked at.
#[derive(Debug, Clone, Copy)]
pub struct Drives<'a> {
    /// Version with the base map.
    pub snapshot: &'a Snapshot,
    /// Logs, or folders of them.
    pub logs: &'a [PathBuf],
    /// What their detections are of.
    pub truth: &'a MatchingTruth,
}

/// Maps logs against their base maps and compares with their truth, all together. Frames that the
/// truth does not know do not count, nor do logs that cannot be read.
///
/// # Errors
/// A store is damaged.
pub fn matching(
    all_drives: &[Drives<'_>],
    progress: &dyn Progress,
) -> Result<Matching, EngineError> {
    let mut all = Counts::default();
    for drives in all_drives {
        all = all.plus(compare(drives, progress)?);
    }
    Ok(all.matching())
}

fn compare(drives: &Drives<'_>, progress: &dyn Progress) -> Result<Counts, EngineError> {
    let Drives {
        snapshot,
        logs,
        truth,
    } = *drives;
    let properties = snapshot.store().properties();
    let tile_level = u32::from(properties.tile_level);
    let meter = Meter::default();
    let catalogue = Catalogue::open(logs, &meter, progress);
    let comparison = Comparison {
        context: MapContext {
            map: MapIndex::new(read_elements(snapshot, tile_level)?),
            tile_level,
            registering: registering(snapshot)?,
        },
        salt: &properties.salt,
        truth,
        catalogue: &catalogue,
        meter: &meter,
    };
    let units = catalogue.units();
    progress.begin(Stage::Map, units.len() as u64);
    let compare = |unit: &Unit| {
        let counts = comparison.unit(unit);
        progress.advance(Stage::Map, 1, 0);
        counts
    };
    let all = units
        .par_iter()
        .map(compare)
        .reduce(Counts::default, Counts::plus);
    progress.end(Stage::Map);
    Ok(all)
}

/// As the evidence of the version was made; registered if it has none.
fn registering(snapshot: &Snapshot) -> Result<Registering, EngineError> {
    let chunks: Vec<ChunkRow> = snapshot.read(TileFilter::All)?;
    let method = chunks.first().map(|chunk| chunk.method);
    Ok(method.and_then(Registering::of_method).unwrap_or_default())
}

/// What every unit is compared with.
struct Comparison<'a> {
    context: MapContext,
    salt: &'a [u8; 32],
    truth: &'a MatchingTruth,
    catalogue: &'a Catalogue,
    meter: &'a Meter,
}

impl Comparison<'_> {
    fn unit(&self, unit: &Unit) -> Counts {
        let read = unit.read(self.catalogue, self.meter);
        let vehicle = VehicleKey::new(self.salt, &unit.vehicle);
        let mut counts = Counts::default();
        for (topic, recording) in &read.channels {
            let own = |window: &i64| (unit.windows.0..unit.windows.1).contains(window);
            for window in chunk::windows(recording).into_iter().filter(own) {
                let Some(chunk) = chunk::cut(recording, vehicle, topic, window) else {
                    continue;
                };
                let mut matches: BTreeMap<(i64, usize), Vec<Assignment>> = BTreeMap::new();
                // A chunk without a trajectory matches nothing.
                let _ = map_chunk_traced(&chunk, &self.context, |frame, map| {
                    for assigned in assignments(frame, map) {
                        let of = (assigned.stamp_ns, assigned.detection);
                        matches.entry(of).or_default().push(assigned);
                    }
                });
                let (from_ns, to_ns) = chunk.bounds_ns();
                for frame in between(&chunk.recording.detections, from_ns, to_ns) {
                    let at = frame.stamp_ns;
                    let known = self.truth.frame(&unit.vehicle, topic, at);
                    let parts = known.into_iter().flatten();
                    let parts = parts.flat_map(|(of, parts)| parts.iter().map(move |p| (of, p)));
                    for (&detection, part) in parts {
                        let mapped = part.element.and_then(|element| self.mapped(element));
                        if mapped.is_some_and(|mapped| mapped.kind != ElementKind::LaneMarking) {
                            continue;
                        }
                        let mapped = mapped.map(|mapped| mapped.id.0);
                        let assigned = matches.get(&(at, detection)).map_or(&[][..], Vec::as_slice);
                        let matched = taken_for(assigned, part).map(|element| element.0);
                        counts.count(mapped, matched);
                    }
                }
            }
        }
        counts
    }

    fn mapped(&self, element: i64) -> Option<&Element> {
        let elements = self.context.map.elements();
        let found = elements.binary_search_by_key(&element, |mapped| mapped.element.id.0);
        Some(&elements[found.ok()?].element)
    }
}

/// What the middle of a part was taken for.
fn taken_for(assigned: &[Assignment], part: &Part) -> Option<ElementId> {
    let middle = 0.5 * (part.shares[0] + part.shares[1]);
    let is_there = |of: &&Assignment| (of.shares[0]..=of.shares[1]).contains(&middle);
    let there = assigned.iter().find(is_there);
    let taken = there.or_else(|| assigned.iter().find(|of| of.is_main));
    taken.map(|of| of.element)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn six_detections_by_hand() {
        let mut counts = Counts::default();
        for (truth, matched) in [
            (Some(1), Some(1)),
            (Some(2), Some(2)),
            // To the wrong line, and missed.
            (Some(3), Some(4)),
            (Some(5), None),
            // Clutter: taken for a line, and left alone.
            (None, Some(6)),
            (None, None),
        ] {
            counts.count(truth, matched);
        }
        let matching = counts.matching();
        assert_eq!(matching.detections, 6);
        assert_eq!(matching.r_match, Some(2.0 / 4.0));
        assert_eq!(matching.r_recall, Some(2.0 / 4.0));
        assert_eq!(matching.assignment, Some(3.0 / 6.0));
        assert_eq!(Counts::default().matching().r_match, None);
    }

    #[test]
    fn a_part_is_taken_for_what_its_middle_is_taken_for() {
        let assigned = |element, shares, is_main| Assignment {
            stamp_ns: 0,
            detection: 0,
            element: ElementId(element),
            shares,
            is_main,
        };
        let both = [
            assigned(1, [0.45, 1.0], true),
            assigned(2, [0.0, 0.45], false),
        ];
        let taken = |shares| {
            let part = Part {
                element: None,
                shares,
            };
            taken_for(&both, &part).map(|element| element.0)
        };
        assert_eq!(taken([0.0, 0.4]), Some(2));
        assert_eq!(taken([0.4, 1.0]), Some(1));
        assert_eq!(
            taken_for(
                &both[..1],
                &Part {
                    element: None,
                    shares: [0.0, 0.2]
                }
            ),
            Some(ElementId(1))
        );
        assert_eq!(
            taken_for(
                &[],
                &Part {
                    element: None,
                    shares: [0.0, 1.0]
                }
            ),
            None
        );
    }
}
