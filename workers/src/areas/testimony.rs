//! Testimony on mapped areas: exposures, matches, residuals in two dimensions and classes, as ledger
//! rows in integers.

use std::collections::BTreeMap;

use tilefold_schemas::{ChunkId, ElementKind, EvidenceRow, fixed};

use super::Glimpse;
use super::along::{Ahead, Drift, along_sigma_m};
use super::mapped::LocalArea;
use super::pair::{LANE_GATE_M, Pair, is_aside, is_other_class};
use super::zone::AreaZone;
use crate::matching::IN_PLACE_M;
use crate::testify::{MIN_VISIBILITY, Opinion, empty_row, expose, paper_sums};

/// Noise of a place across the way, in metres, and its growth per metre ahead: yaw.
const NEAR_SIGMA_M: f64 = 0.1;
const SIGMA_GROWTH: f64 = 0.006;
/// Scale of the paper's distance term, in metres.
const DISTANCE_SIGMA_M: f64 = 0.5;
/// Areas farther than this are not looked for, in metres.
const FAR_M: f64 = 60.0;

/// Collects the rows of one chunk.
#[derive(Debug)]
pub struct AreaLedger<'a> {
    chunk: ChunkId,
    mapped: &'a [LocalArea<'a>],
    zone: &'a AreaZone,
    drift: &'a Drift,
    rows: BTreeMap<usize, EvidenceRow>,
}

/// Where an area was seen against where the map has it, in metres in the vehicle's directions.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Residual {
    ahead_m: f64,
    ahead_sigma_m: f64,
    left_m: f64,
    left_sigma_m: f64,
}

impl Residual {
    fn new(glimpse: &Glimpse<'_>, pair: &Pair, ahead: Ahead) -> Self {
        let range_m = glimpse.areas[pair.seen].centre_m[0];
        let left = NEAR_SIGMA_M + SIGMA_GROWTH * range_m;
        Self {
            ahead_m: pair.ahead_m + ahead.offset_m,
            ahead_sigma_m: along_sigma_m(range_m).hypot(ahead.sigma_m),
            left_m: pair.left_m,
            left_sigma_m: left.hypot(glimpse.registration.sigma_m),
        }
    }

    /// The part in a direction given in the vehicle frame, with its variance.
    fn towards(&self, [x, y]: [f64; 2]) -> (f64, f64) {
        let spread = (x * self.ahead_sigma_m).hypot(y * self.left_sigma_m);
        (x * self.ahead_m + y * self.left_m, spread * spread)
    }
}

impl<'a> AreaLedger<'a> {
    /// An empty ledger of a chunk.
    #[must_use]
    pub fn new(
        chunk: ChunkId,
        mapped: &'a [LocalArea<'a>],
        zone: &'a AreaZone,
        drift: &'a Drift,
    ) -> Self {
        Self {
            chunk,
            mapped,
            zone,
            drift,
            rows: BTreeMap::new(),
        }
    }

    /// Adds what a frame says.
    pub fn add(&mut self, glimpse: &Glimpse<'_>, pairs: &[Pair]) {
        for (index, local) in self.mapped.iter().enumerate() {
            if !self.zone.tells_of(local.mapped.element.kind) || is_far(glimpse, local) {
                continue;
            }
            let stamp_ns = glimpse.look.pose.stamp_ns;
            let ahead = self.drift.at(stamp_ns, Some(index));
            if !self.is_exposed(glimpse, local, ahead) {
                continue;
            }
            let outline = corners(glimpse, local, ahead).map(|[x, y]| [x, y, 0.0]);
            let open_share = glimpse.hidden.open_share(outline);
            let visibility = glimpse.registration.confidence * open_share;
            if visibility < MIN_VISIBILITY {
                continue;
            }
            let pair = pairs.iter().find(|pair| pair.mapped == index);
            if pair.is_none() && is_perhaps_aside(glimpse, local, pairs) {
                continue;
            }
            let residual = pair.map(|pair| Residual::new(glimpse, pair, ahead));
            let chunk = self.chunk;
            let row = self.rows.entry(index);
            let row = row.or_insert_with(|| empty_row(chunk, local.mapped, 0));
            expose(row, stamp_ns, visibility);
            paper_sums(row, visibility, opinion(glimpse, local, pair, residual));
            if let Some((pair, residual)) = pair.zip(residual) {
                hit(row, glimpse, local, pair, residual);
            }
        }
    }

    fn is_exposed(&self, glimpse: &Glimpse<'_>, local: &LocalArea<'_>, ahead: Ahead) -> bool {
        let corners = corners(glimpse, local, ahead);
        local.is_readable(glimpse.look.pose.yaw_rad) && self.zone.shows(corners, ahead.sigma_m)
    }

    /// The rows, by element.
    #[must_use]
    pub fn into_rows(self) -> Vec<EvidenceRow> {
        self.rows.into_values().collect()
    }
}

/// The outline of an area where the frame has it, in the vehicle frame.
fn corners<'a>(
    glimpse: &'a Glimpse<'_>,
    local: &'a LocalArea<'_>,
    ahead: Ahead,
) -> impl Iterator<Item = [f64; 2]> + 'a {
    local.points_m.iter().map(move |&point| {
        let [x, y] = glimpse.look.pose.vehicle_from_local(point);
        [x - ahead.offset_m, y - glimpse.registration.offset_m]
    })
}

/// Whether something unexplained was seen where a registration wrong by a lane would put this.
fn is_perhaps_aside(glimpse: &Glimpse<'_>, local: &LocalArea<'_>, pairs: &[Pair]) -> bool {
    let mut areas = glimpse.areas.iter().enumerate();
    areas.any(|(seen, area)| {
        pairs.iter().all(|pair| pair.seen != seen) && is_aside(glimpse, area, local, LANE_GATE_M)
    })
}

fn is_far(glimpse: &Glimpse<'_>, local: &LocalArea<'_>) -> bool {
    let pose = &glimpse.look.pose;
    let [east, north] = local.centre_m;
    (east - pose.east_m).hypot(north - pose.north_m) > FAR_M
}

/// The paper's opinion: of another class or aside of its place is modified. Along the way a single
/// vehicle cannot tell.
fn opinion(
    glimpse: &Glimpse<'_>,
    local: &LocalArea<'_>,
    pair: Option<&Pair>,
    residual: Option<Residual>,
) -> Opinion {
    let Some((pair, residual)) = pair.zip(residual) else {
        return Opinion::UNMATCHED;
    };
    let distance = residual.left_m / DISTANCE_SIGMA_M;
    let score = (-0.5 * distance * distance).exp();
    let seen = glimpse.areas[pair.seen].sign;
    if is_other_class(seen, local.mapped.element.sign) {
        Opinion::modified(0.0)
    } else if residual.left_m.abs() > IN_PLACE_M {
        Opinion::modified(score)
    } else {
        Opinion::matched(score)
    }
}

fn hit(
    row: &mut EvidenceRow,
    glimpse: &Glimpse<'_>,
    local: &LocalArea<'_>,
    pair: &Pair,
    residual: Residual,
) {
    row.hit += 1;
    if local.mapped.element.kind == ElementKind::GroundSign {
        row.seen[glimpse.areas[pair.seen].sign.code() as usize] += 1;
    }
    let (sin, cos) = glimpse.look.pose.yaw_rad.sin_cos();
    let [east, north] = local.along;
    let along = [east * cos + north * sin, -east * sin + north * cos];
    let left = [-along[1], along[0]];
    let (left_m, left_variance) = residual.towards(left);
    let (along_m, along_variance) = residual.towards(along);
    row.residual_eta_q8 += fixed::to_q8(left_m / left_variance);
    row.residual_lambda_q8 += fixed::to_q8(1.0 / left_variance);
    row.along_eta_q8 += fixed::to_q8(along_m / along_variance);
    row.along_lambda_q8 += fixed::to_q8(1.0 / along_variance);
}
