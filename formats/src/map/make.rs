//! What makes an element of any map: its shape, and an id where its map has none of 64 bits.

use std::collections::BTreeMap;

use tilefold_schemas::id::hash_text;
use tilefold_schemas::limits::{MAX_ELEMENT_LENGTH_M, MAX_TAG_BYTES};
use tilefold_schemas::{Color, Element, ElementId, ElementKind, Marking, SignClass};

use super::rough::{rough_length_m, run_alike};

/// What an element is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Kind {
    pub(super) kind: ElementKind,
    pub(super) marking: Marking,
    pub(super) color: Color,
    pub(super) sign: SignClass,
}

impl Kind {
    /// A lane marking.
    pub(super) fn line(marking: Marking, color: Color) -> Self {
        Self {
            kind: ElementKind::LaneMarking,
            marking,
            color,
            sign: SignClass::Unknown,
        }
    }
}

/// The id of what is called `source_id` in its map: 63 bits of the text's hash.
pub(super) fn id_of(source_id: &str) -> ElementId {
    ElementId(hash_text(source_id) & i64::MAX)
}

/// The element called `source_id`, with its points on WGS 84, or why there is none.
pub(super) fn checked(
    source_id: &str,
    kind: Kind,
    points: Vec<[f64; 3]>,
    tags: BTreeMap<String, String>,
) -> Result<Element, String> {
    let points = match is_outline(kind.kind) {
        true => open_ring(points),
        false => points,
    };
    check_shape(kind.kind, &points)?;
    if let Some(key) = tags.iter().find_map(|(key, value)| too_long(key, value)) {
        return Err(format!(
            "its {key} is over {MAX_TAG_BYTES} bytes (MAX_TAG_BYTES)"
        ));
    }
    Ok(Element {
        id: id_of(source_id),
        kind: kind.kind,
        marking: kind.marking,
        color: kind.color,
        sign: kind.sign,
        points,
        tags,
    })
}

fn too_long(key: &str, value: &str) -> Option<String> {
    (key.len().max(value.len()) > MAX_TAG_BYTES).then(|| key.chars().take(60).collect())
}

/// Whether elements of a kind are areas.
pub(super) fn is_outline(kind: ElementKind) -> bool {
    matches!(kind, ElementKind::Crosswalk | ElementKind::GroundSign)
}

/// Whether points can be an element's, or why not.
pub(super) fn check_shape(kind: ElementKind, points: &[[f64; 3]]) -> Result<(), String> {
    let needed = if is_outline(kind) { 3 } else { 2 };
    let distinct = distinct(points);
    if distinct < needed {
        return Err(format!(
            "{kind} needs {needed} different points, it has {distinct}"
        ));
    }
    let length_m = rough_length_m(points);
    if length_m > MAX_ELEMENT_LENGTH_M {
        return Err(format!(
            "it is {length_m:.0} m long, the limit is {MAX_ELEMENT_LENGTH_M} m (MAX_ELEMENT_LENGTH_M)"
        ));
    }
    Ok(())
}

/// A ring without its repeated first vertex.
pub(super) fn open_ring(mut ring: Vec<[f64; 3]>) -> Vec<[f64; 3]> {
    while ring.len() > 1 && ring.first() == ring.last() {
        ring.pop();
    }
    ring
}

/// The ring along one border and back along the other, whichever way that one is drawn.
pub(super) fn between(left: &[[f64; 3]], mut right: Vec<[f64; 3]>) -> Vec<[f64; 3]> {
    let mut ring = left.to_vec();
    if run_alike(left, &right) {
        right.reverse();
    }
    ring.append(&mut right);
    ring
}

/// How many vertices differ from the one before.
fn distinct(points: &[[f64; 3]]) -> usize {
    let steps = points
        .windows(2)
        .filter(|pair| pair[0][..2] != pair[1][..2]);
    steps.count() + usize::from(!points.is_empty())
}
