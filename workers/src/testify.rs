//! Testimony: what a chunk's frames say about the sections of map elements, as ledger rows in
//! integers (method.md, section 7).

use std::collections::BTreeMap;

use tilefold_schemas::evidence::{CLASS_BINS, METHOD_VERSION, to_window_ms};
use tilefold_schemas::{ChunkId, EvidenceRow, fixed};
use tilefold_tiler::map_index::MappedElement;
use tilefold_tiler::station::section_of;

use crate::aslant::Aslant;
use crate::cuts::{CrossCut, Cut, CutLine};
use crate::hidden::Hidden;
use crate::local_map::{LocalLine, LocalMap};
use crate::look::Look;
use crate::matching::{IN_PLACE_M, Match, Matches};
use crate::pixels::Casting;
use crate::register::Registration;
use crate::visibility::{Visibility, Zone};

/// Length of a section in metres (S in method.md, section 1).
pub const SECTION_M: f64 = 10.0;
/// Frames whose registration is less sure than this testify nothing.
pub const MIN_CONFIDENCE: f64 = 0.3;
/// A section less visible than this was not exposed.
pub(crate) const MIN_VISIBILITY: f64 = 0.05;
/// The paper's v_min: exposures below it enter none of its sums.
const PAPER_MIN_VISIBILITY: f64 = 0.7;
/// Noise of one lateral residual apart from registration, in metres.
const RESIDUAL_SIGMA_M: f64 = 0.15;

/// A frame with everything that was found out about it.
#[derive(Debug, Clone, Copy)]
pub struct Frame<'a> {
    /// Pose and seen lines.
    pub look: &'a Look,
    /// Lateral positions.
    pub cross_cut: &'a CrossCut,
    /// Lateral correction.
    pub registration: Registration,
    /// How far ahead of its pose the vehicle really was, in metres.
    pub ahead_m: f64,
    /// Which seen line is which map line.
    pub matches: &'a Matches,
    /// And those of the others that run across the vehicle's way.
    pub aslant: &'a [Aslant],
    /// What it could not see.
    pub hidden: &'a Hidden<'a>,
    /// Its camera and road, where it was seen in pixels.
    pub casting: Option<&'a Casting>,
}

impl Frame<'_> {
    /// Where its picture shows a line of the chunk's plane (east, north; metres), in pixels; nothing
    /// where detections are in metres.
    #[must_use]
    pub fn in_picture(&self, line_m: &[[f64; 3]]) -> Vec<Vec<[f64; 2]>> {
        let Some(casting) = self.casting else {
            return Vec::new();
        };
        let surface = casting.surface(self.look.pose.stamp_ns);
        let in_vehicle = |point: [f64; 3]| {
            let [ahead_m, left_m] = self.look.pose.vehicle_from_local([point[0], point[1]]);
            let ahead_m = ahead_m - self.ahead_m;
            [
                ahead_m,
                left_m - self.registration.offset_m,
                surface.height_m(ahead_m),
            ]
        };
        let line_m: Vec<[f64; 3]> = line_m.iter().map(|&point| in_vehicle(point)).collect();
        casting.camera.view(&line_m)
    }

    /// Whether a map line was seen in its place: only beside paint that the map has can anything
    /// be said of paint that it lacks. Where the map ends, nothing is missing from it.
    #[must_use]
    pub fn is_anchored(&self) -> bool {
        let mut pairs = self.matches.pairs.iter();
        pairs.any(|pair| pair.residual_m.abs() <= IN_PLACE_M && !pair.is_ambiguous)
    }
}

/// Collects the ledger rows of one chunk.
#[derive(Debug)]
pub struct Ledger<'a> {
    chunk: ChunkId,
    map: &'a LocalMap<'a>,
    zone: &'a Zone,
    rows: BTreeMap<(usize, u32), EvidenceRow>,
}

impl<'a> Ledger<'a> {
    /// An empty ledger of a chunk.
    #[must_use]
    pub fn new(chunk: ChunkId, map: &'a LocalMap<'a>, zone: &'a Zone) -> Self {
        Self {
            chunk,
            map,
            zone,
            rows: BTreeMap::new(),
        }
    }

    /// Adds what a frame says.
    pub fn add(&mut self, frame: &Frame<'_>) {
        if frame.registration.confidence < MIN_CONFIDENCE {
            return;
        }
        for (index, mapped) in frame.cross_cut.mapped.iter().enumerate() {
            let offset_m = frame.registration.offset_m;
            let seen = Visibility::of(mapped, offset_m, self.zone, frame.hidden);
            let visibility = seen.product() * frame.registration.confidence;
            if visibility < MIN_VISIBILITY {
                continue;
            }
            let Some(spot) = self.spot(mapped) else {
                continue;
            };
            // A line that was seen farther on, or nearer by, says nothing of this section.
            let is_on = |pair: &&Match| spot.is_on(&frame.cross_cut.seen[pair.seen]);
            let mut pairs = frame.matches.pairs.iter();
            let matched = pairs.find(|pair| pair.mapped == index && is_on(pair));
            let row = self.row(mapped, &spot);
            expose(row.row, frame.look.pose.stamp_ns, visibility);
            paper_sums(row.row, visibility, opinion(matched));
            if let Some(pair) = matched {
                hit(row, frame, pair);
            }
        }
    }

    /// The rows, by element and section.
    #[must_use]
    pub fn into_rows(self) -> Vec<EvidenceRow> {
        self.rows.into_values().collect()
    }

    /// Where a map line crosses the middle of the zone, and the section there.
    fn spot(&self, mapped: &CutLine) -> Option<Spot> {
        let length_m = self.map.lines[mapped.line].mapped.length_m;
        let section_of = |station_m| section_of(station_m, length_m, SECTION_M);
        let cuts: Vec<&Cut> = self.zone.cuts(mapped).collect();
        let station_m = cuts.get(cuts.len() / 2)?.station_m;
        let section = section_of(station_m);
        let within = cuts
            .iter()
            .filter(|cut| section_of(cut.station_m) == section);
        Some(Spot {
            section,
            station_m,
            ranges: within.map(|cut| cut.range).collect(),
        })
    }

    fn row(&mut self, mapped: &CutLine, spot: &Spot) -> Row<'_> {
        let local = &self.map.lines[mapped.line];
        let chunk = self.chunk;
        let row = self
            .rows
            .entry((mapped.line, spot.section))
            .or_insert_with(|| empty_row(chunk, local.mapped, spot.section));
        Row {
            row,
            local,
            station_m: spot.station_m,
        }
    }
}

/// What a frame looks at on a map line.
struct Spot {
    section: u32,
    station_m: f64,
    /// Ranges at which the line crosses the section.
    ranges: Vec<usize>,
}

impl Spot {
    /// Whether a seen line passes over the section.
    fn is_on(&self, seen: &CutLine) -> bool {
        let passes = |cut: &Cut| self.ranges.contains(&cut.range);
        seen.cuts.iter().any(passes)
    }
}

/// A row with the line that it speaks of.
struct Row<'r> {
    row: &'r mut EvidenceRow,
    local: &'r LocalLine<'r>,
    station_m: f64,
}

/// A row that says nothing yet.
pub(crate) fn empty_row(chunk: ChunkId, mapped: &MappedElement, section: u32) -> EvidenceRow {
    EvidenceRow {
        tile: mapped.tile.0,
        element: mapped.element.id.0,
        content: mapped.content.0,
        section: section.cast_signed(),
        vehicle: chunk.vehicle.0,
        channel: chunk.channel,
        window: chunk.window,
        method: METHOD_VERSION,
        model: 0,
        exposed: 0,
        hit: 0,
        sum_v_q8: 0,
        sum_w_no_q8: 0,
        sum_w_add_q8: 0,
        sum_w_del_q8: 0,
        sum_w_mod_q8: 0,
        residual_eta_q8: 0,
        residual_lambda_q8: 0,
        along_eta_q8: 0,
        along_lambda_q8: 0,
        seen: [0; CLASS_BINS],
        first_ms: 0,
        last_after_ms: 0,
        best_after_ms: 0,
        best_v_q8: -1,
    }
}

/// Counts an exposure; frames come in the order of time.
pub(crate) fn expose(row: &mut EvidenceRow, stamp_ns: i64, visibility: f64) {
    let v_q8 = fixed::to_q8(visibility);
    row.exposed += 1;
    row.sum_v_q8 += v_q8;
    let at_ms = to_window_ms(row.window, stamp_ns);
    if row.exposed == 1 {
        row.first_ms = at_ms;
    }
    let after_ms = at_ms - row.first_ms;
    row.last_after_ms = after_ms;
    if v_q8 > row.best_v_q8 {
        row.best_v_q8 = v_q8;
        row.best_after_ms = after_ms;
    }
}

/// A frame's opinion of an exposed section, as the paper has it: how well it matches, and what the
/// rest speaks for: added, deleted, modified.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Opinion {
    pub(crate) score: f64,
    pub(crate) shares: [f64; 3],
}

impl Opinion {
    pub(crate) const UNMATCHED: Self = Self {
        score: 0.0,
        shares: [0.0, 1.0, 0.0],
    };

    pub(crate) fn modified(score: f64) -> Self {
        Self {
            score,
            shares: [0.0, 0.0, 1.0],
        }
    }

    pub(crate) fn matched(score: f64) -> Self {
        Self {
            score,
            shares: [1.0 / 3.0; 3],
        }
    }
}

fn opinion(matched: Option<&Match>) -> Opinion {
    match matched {
        None => Opinion::UNMATCHED,
        Some(pair) if pair.is_ambiguous => Opinion::matched(pair.score),
        Some(pair) if pair.residual_m.abs() > IN_PLACE_M => Opinion::modified(pair.score),
        Some(pair) => Opinion::matched(pair.score),
    }
}

/// Eq 14 to 18 with the decisions of method.md, section 8.
pub(crate) fn paper_sums(row: &mut EvidenceRow, visibility: f64, opinion: Opinion) {
    if visibility < PAPER_MIN_VISIBILITY {
        return;
    }
    let Opinion {
        score,
        shares: [add, del, modified],
    } = opinion;
    let weight = |share: f64| fixed::to_q8(visibility * share);
    row.sum_w_no_q8 += weight(score);
    row.sum_w_add_q8 += weight((1.0 - score) * add);
    row.sum_w_del_q8 += weight((1.0 - score) * del);
    row.sum_w_mod_q8 += weight((1.0 - score) * modified);
}

fn hit(
    Row {
        row,
        local,
        station_m,
    }: Row<'_>,
    frame: &Frame<'_>,
    pair: &Match,
) {
    row.hit += 1;
    // A line is read as a whole: where it runs over the border of two ways, or may be either of two,
    // the reading is that of the other as well.
    if pair.is_main && !pair.is_ambiguous {
        let seen = &frame.look.lines[frame.cross_cut.seen[pair.seen].line];
        row.seen[seen.marking.code() as usize] += 1;
    }
    // Left of the vehicle is right of an element that runs against it.
    let tangent = local.line.at(station_m).tangent;
    let (sin, cos) = frame.look.pose.yaw_rad.sin_cos();
    let along = (tangent[0] * cos + tangent[1] * sin).signum();
    let residual_m = pair.residual_m * along;
    let variance = RESIDUAL_SIGMA_M.powi(2) + frame.registration.sigma_m.powi(2);
    row.residual_eta_q8 += fixed::to_q8(residual_m / variance);
    row.residual_lambda_q8 += fixed::to_q8(1.0 / variance);
}
