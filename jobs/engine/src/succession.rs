//! Which elements of a new base map are those of the old one.

use std::collections::{BTreeMap, BTreeSet};

use tilefold_schemas::{ContentHash, ElementId, EvidenceRow, TileId};
use tilefold_tiler::map_index::{MapIndex, MappedElement};

use crate::same_place::is_same;
use crate::update::Rekey;

/// Around the first vertex of an element its successor is looked for, in degrees (more than 5 cm
/// wherever there are roads).
const AROUND_DEG: f64 = 5e-6;

/// The old elements that go on, and as what.
#[derive(Debug, Default)]
pub(crate) struct Succession {
    /// By old id and content: what the new map calls it.
    heirs: BTreeMap<(ElementId, ContentHash), Heir>,
    /// Elements with id and content as before.
    pub(crate) unchanged: usize,
    /// Elements at the same place under another id or content.
    pub(crate) same_place: usize,
    /// Ids of new elements that go on from an old one.
    pub(crate) inherited: BTreeSet<ElementId>,
}

#[derive(Debug, Clone, Copy)]
struct Heir {
    id: ElementId,
    content: ContentHash,
    tile: TileId,
}

impl Heir {
    fn of(mapped: &MappedElement) -> Self {
        Self {
            id: mapped.element.id,
            content: mapped.content,
            tile: mapped.tile,
        }
    }
}

impl Succession {
    /// Equal ids and contents first; then, by id, what lies at the same place: under the same id if
    /// there is such a one, and else under the least. No element is two heirs.
    pub(crate) fn of(old: &MapIndex, new: &MapIndex) -> Self {
        let mut succession = Self::default();
        let contents: BTreeMap<ElementId, &MappedElement> = new
            .elements()
            .iter()
            .map(|mapped| (mapped.element.id, mapped))
            .collect();
        let mut rest = Vec::new();
        for mapped in old.elements() {
            match contents.get(&mapped.element.id) {
                Some(same) if same.content == mapped.content => {
                    succession.inherit(mapped, same);
                    succession.unchanged += 1;
                }
                _ => rest.push(mapped),
            }
        }
        for mapped in rest {
            if let Some(heir) = succession.heir_at(mapped, new) {
                succession.inherit(mapped, heir);
                succession.same_place += 1;
            }
        }
        succession
    }

    fn inherit(&mut self, old: &MappedElement, new: &MappedElement) {
        self.heirs
            .insert((old.element.id, old.content), Heir::of(new));
        self.inherited.insert(new.element.id);
    }

    fn heir_at<'a>(&self, old: &MappedElement, new: &'a MapIndex) -> Option<&'a MappedElement> {
        let &[lon, lat, _] = old.element.points.first()?;
        let corner = |sign: f64| [lon + sign * AROUND_DEG, lat + sign * AROUND_DEG];
        let is_heir = |other: &&MappedElement| {
            !self.inherited.contains(&other.element.id) && is_same(&old.element, &other.element)
        };
        let around = new.within(corner(-1.0), corner(1.0)).into_iter();
        around
            .filter(is_heir)
            .min_by_key(|other| (other.element.id != old.element.id, other.element.id))
    }
}

impl Rekey for Succession {
    fn rekeyed(&self, row: EvidenceRow) -> Option<EvidenceRow> {
        let heir = self
            .heirs
            .get(&(ElementId(row.element), ContentHash(row.content)))?;
        Some(EvidenceRow {
            tile: heir.tile.0,
            element: heir.id.0,
            content: heir.content.0,
            ..row
        })
    }
}
