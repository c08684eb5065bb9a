//! Changes that the new base map has accepted: what was claimed of the old one, and is so now.

use serde::Serialize;
use tilefold_schemas::{ChangeRecord, ElementKind, Verdict, wkb};
use tilefold_tiler::geodesy::LocalFrame;
use tilefold_tiler::map_index::{MapIndex, MappedElement, bounds};

use crate::same_place::{line, place, plane};

/// Paint is where it was claimed to be if it is within this, in metres.
const THERE_M: f64 = 1.0;
/// It is no more where it was if nothing of its kind is within this, in metres.
const GONE_M: f64 = 0.3;
/// Share of the claimed geometry for which that must hold.
const SHARE: f64 = 0.5;
/// Elements this near are looked at, in degrees (1 m and more wherever there are roads).
const AROUND_DEG: f64 = 5e-5;

/// A claim that the new map confirms.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Accepted {
    /// Id of the change record.
    pub change: i64,
    /// What it claimed.
    pub verdict: &'static str,
    /// The element of the old map; none for an addition.
    pub element: Option<i64>,
    /// The element of the new map that is there now; none for a removal.
    pub now: Option<i64>,
}

/// The claims among `records` that hold in the new map. `is_new` tells the elements of the new map
/// that do not go on from an old one.
pub(crate) fn accepted(
    records: &[ChangeRecord],
    map: &MapIndex,
    is_new: &dyn Fn(&MappedElement) -> bool,
) -> Vec<Accepted> {
    let judge = |record: &ChangeRecord| {
        let verdict = Verdict::from_code(record.verdict)?;
        let now = match verdict {
            Verdict::Added => Some(new_at(record, &record.geometry_new, map, is_new)?),
            Verdict::Modified => {
                let drawn = record
                    .geometry_new
                    .as_ref()
                    .or(record.geometry_old.as_ref());
                Some(new_at(record, &drawn.cloned(), map, is_new)?)
            }
            Verdict::Removed => {
                is_gone(record, map)?;
                None
            }
            _ => return None,
        };
        Some(Accepted {
            change: record.change,
            verdict: verdict.name(),
            element: record.element,
            now,
        })
    };
    records.iter().filter_map(judge).collect()
}

/// The new element along which most of the geometry lies, if that is enough of it.
fn new_at(
    record: &ChangeRecord,
    geometry: &Option<Vec<u8>>,
    map: &MapIndex,
    is_new: &dyn Fn(&MappedElement) -> bool,
) -> Option<i64> {
    let claim = Claim::new(record, geometry.as_ref()?)?;
    let around = claim
        .elements(map)
        .into_iter()
        .filter(|mapped| is_new(mapped));
    let shares = around.map(|mapped| (claim.share_within(THERE_M, &[mapped]), mapped.element.id.0));
    let best = shares.max_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1)))?;
    (best.0 >= SHARE).then_some(best.1)
}

/// Whether nothing of the kind is left where the record's stretch was.
fn is_gone(record: &ChangeRecord, map: &MapIndex) -> Option<()> {
    let claim = Claim::new(record, record.geometry_old.as_ref()?)?;
    let left = claim.share_within(GONE_M, &claim.elements(map));
    (left <= 1.0 - SHARE).then_some(())
}

/// The geometry of a record, in a plane of its own.
struct Claim {
    kind: ElementKind,
    frame: LocalFrame,
    degrees: Vec<[f64; 3]>,
}

impl Claim {
    fn new(record: &ChangeRecord, geometry: &[u8]) -> Option<Self> {
        let degrees = wkb::read(geometry).ok()?.points;
        let &[lon, lat, _] = degrees.first()?;
        Some(Self {
            kind: ElementKind::from_code(record.kind)?,
            frame: LocalFrame::new([lon, lat, 0.0]),
            degrees,
        })
    }

    /// Elements of the kind around it.
    fn elements<'a>(&self, map: &'a MapIndex) -> Vec<&'a MappedElement> {
        let (low, high) = bounds(&self.degrees);
        let around = map.within(
            low.map(|value| value - AROUND_DEG),
            high.map(|value| value + AROUND_DEG),
        );
        let of_kind = |mapped: &&MappedElement| mapped.element.kind == self.kind;
        around.into_iter().filter(of_kind).collect()
    }

    /// Share of the vertices that lie within a distance of one of the elements.
    fn share_within(&self, reach_m: f64, elements: &[&MappedElement]) -> f64 {
        let lines: Vec<_> = elements
            .iter()
            .filter_map(|mapped| line(&plane(&self.frame, &mapped.element)))
            .collect();
        let is_near = |&&[lon, lat, _]: &&[f64; 3]| {
            let at = place(&self.frame, lon, lat);
            lines
                .iter()
                .any(|line| line.project(at).distance_m <= reach_m)
        };
        let near = self.degrees.iter().filter(is_near).count();
        near as f64 / self.degrees.len().max(1) as f64
    }
}
