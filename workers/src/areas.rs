//! Stop lines, crosswalks and ground signs: what a chunk says of those that the map has, and of
//! those that it lacks.
//!
//! They have a place in two dimensions where a lane line has one. Across the road the registration
//! against lane lines holds for them too; along the road the vehicle's position is as far off as its
//! receiver has it, and what tells is that all areas passed within seconds are off by the same.
//! [`seen`] brings detections into metres, [`mapped`] lays the map beside them, [`zone`] learns what
//! can be seen at all, [`pair`] says which is which, [`along`] takes out what the vehicle is off along
//! its way, [`testimony`] and [`sighted`] write it down; this file joins them.

pub mod along;
pub mod mapped;
pub mod outline;
pub mod pair;
pub mod seen;
pub mod shape;
pub mod sighted;
pub mod testimony;
pub mod zone;

use tilefold_schemas::{ChunkId, EvidenceRow, Footprint, Sighting};
use tilefold_tiler::geodesy::LocalFrame;
use tilefold_tiler::tile::TileError;

use crate::hidden::Hidden;
use crate::look::Look;
use crate::register::Registration;
use crate::testify::MIN_CONFIDENCE;
use along::Drift;
use mapped::LocalArea;
use pair::{Pair, pair_areas};
use seen::SeenArea;
use sighted::{AreaFootprints, AreaSightings};
use testimony::AreaLedger;
use zone::AreaZone;

/// One frame as areas are worked on.
#[derive(Debug, Clone, Copy)]
pub struct Glimpse<'a> {
    /// Pose.
    pub look: &'a Look,
    /// Lateral correction.
    pub registration: Registration,
    /// Metres of way since the first frame.
    pub way_m: f64,
    /// Whether the frame is of the chunk's own window.
    pub is_own: bool,
    /// Whether a map line was seen in its place.
    pub is_anchored: bool,
    /// Areas seen.
    pub areas: &'a [SeenArea],
    /// What could not be seen.
    pub hidden: &'a Hidden<'a>,
}

impl Glimpse<'_> {
    /// Whether its registration is sure enough to say anything.
    fn is_sure(&self) -> bool {
        self.registration.confidence >= MIN_CONFIDENCE
    }
}

/// What a chunk is, wherever it is said.
#[derive(Debug, Clone, Copy)]
pub struct Whose<'a> {
    /// The chunk.
    pub chunk: ChunkId,
    /// Its plane.
    pub frame: &'a LocalFrame,
    /// Level of tiles.
    pub tile_level: u32,
    /// Number of its first free track.
    pub first_track: i32,
}

/// What a chunk says about areas.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct AreaEvidence {
    /// Ledger rows, by element.
    pub rows: Vec<EvidenceRow>,
    /// Areas that the map lacks.
    pub sightings: Vec<Sighting>,
    /// Where such would have been seen.
    pub footprints: Vec<Footprint>,
}

/// The areas that were passed: which is which, and how far along its way the vehicle really was.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Passed {
    /// By glimpse; none where the registration is not sure.
    pairs: Vec<Vec<Pair>>,
    /// The error along the way.
    pub drift: Drift,
}

impl Passed {
    /// Pairs what was seen in each glimpse (capture order, context included) with `mapped`.
    #[must_use]
    pub fn new(mapped: &[LocalArea<'_>], glimpses: &[Glimpse<'_>]) -> Self {
        let pairs_of = |glimpse: &Glimpse<'_>| match glimpse.is_sure() {
            true => pair_areas(glimpse, mapped),
            false => Vec::new(),
        };
        let pairs: Vec<Vec<Pair>> = glimpses.iter().map(pairs_of).collect();
        let drift = Drift::measure(glimpses, &pairs);
        Self { pairs, drift }
    }
}

/// Confronts what was seen with `mapped`; glimpses are in capture order, context included. Nothing
/// is said where nothing of the kind was ever seen.
///
/// # Errors
/// A place is on no tile.
pub fn confront(
    whose: Whose<'_>,
    mapped: &[LocalArea<'_>],
    glimpses: &[Glimpse<'_>],
    Passed { pairs, drift }: &Passed,
) -> Result<AreaEvidence, TileError> {
    let Some(zone) = AreaZone::learn(glimpses.iter().flat_map(|glimpse| glimpse.areas)) else {
        return Ok(AreaEvidence::default());
    };
    let mut ledger = AreaLedger::new(whose.chunk, mapped, &zone, drift);
    let mut sightings = AreaSightings::default();
    let mut footprints = AreaFootprints::default();
    for (glimpse, pairs) in glimpses.iter().zip(pairs) {
        if !glimpse.is_own || !glimpse.is_sure() {
            continue;
        }
        ledger.add(glimpse, pairs);
        if glimpse.is_anchored {
            sightings.add(glimpse, pairs, mapped, drift);
            footprints.add(glimpse, drift);
        }
    }
    Ok(AreaEvidence {
        rows: ledger.into_rows(),
        sightings: sightings.into_rows(whose)?,
        footprints: footprints.into_rows(whose, &zone)?,
    })
}
