//! `evaluate`: claimed changes against known ones (method.md, section 11).
//!
//! A claim is right if its type and kind agree with a true change, it lies within 1 m of it (or
//! on the same element), and it overlaps at least half of it. Each true change is found by at most
//! one claim; a second claim of the same change is wrong.

use std::collections::BTreeMap;

use serde::Serialize;
use tilefold_formats::geojson::TruthChange;
use tilefold_reducers::FusionModel;
use tilefold_schemas::{ChangeRecord, Verdict, wkb};
use tilefold_tiler::geodesy::LocalFrame;
use tilefold_tiler::station::Polyline;

/// A claim lies on a change if it is this near, in metres.
const NEAR_M: f64 = 1.0;
/// A claim finds a change if it covers at least this share of it.
const COVERED_SHARE: f64 = 0.5;
/// Places along a line at which nearness is tried.
const SAMPLES: usize = 40;
/// Bins of the expected calibration error.
const BINS: usize = 15;

/// What counts as a claim.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Criteria {
    /// Least posterior of the claimed type (T_s).
    pub threshold: f64,
    /// Least number of vehicles (V).
    pub min_vehicles: i32,
}

impl Default for Criteria {
    fn default() -> Self {
        Self {
            threshold: 0.85,
            min_vehicles: 5,
        }
    }
}

/// Precision and recall of one kind of change.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Score {
    /// True changes.
    pub truth: usize,
    /// Claims.
    pub claimed: usize,
    /// Claims that are right.
    pub right: usize,
    /// Share of claims that are right; null without claims.
    pub precision: Option<f64>,
    /// Share of true changes that were claimed; null without any.
    pub recall: Option<f64>,
    /// Harmonic mean of both; null where one of them is, or both are 0.
    pub f1: Option<f64>,
}

/// Scores over all types and by type.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ChangeScores {
    /// All types together.
    #[serde(flatten)]
    pub all: Score,
    /// By type of change.
    pub by_type: BTreeMap<&'static str, Score>,
}

/// How well probabilities are kept, over judged elements.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Calibration {
    /// Expected calibration error over 15 bins; null without judged elements.
    pub ece: Option<f64>,
    /// Mean squared error of P(change); null without judged elements.
    pub brier: Option<f64>,
}

/// Errors of claimed geometry against the true one.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct GeometryErrors {
    /// Median lateral distance of right additions from the true line, metres.
    pub added_lateral_median_m: Option<f64>,
    /// Its 95th percentile.
    pub added_lateral_p95_m: Option<f64>,
}

/// Claims on elements that the truth does not mention.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Control {
    /// Unchanged elements with enough vehicles to be judged.
    pub judged: usize,
    /// Of these, claimed as changed.
    pub claimed: usize,
}

/// A claim and what became of it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Outcome {
    /// `right`, `wrong` or `missed`.
    pub outcome: &'static str,
    /// Type of change.
    pub change_type: &'static str,
    /// Element id; null for an addition.
    pub element_id: Option<i64>,
    /// Change id, in hexadecimal; null for a missed change.
    pub change: Option<String>,
    /// Posterior of the claimed type; for a missed change, what its element got for its type.
    pub posterior: Option<f64>,
    /// Vehicles that looked.
    pub vehicles: Option<i32>,
    /// First vertex, `[longitude_deg, latitude_deg]`.
    pub at: Option<[f64; 2]>,
    /// What was said instead of a missed change.
    pub said: Option<String>,
}

/// An evaluation.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Evaluation {
    /// Fusion model.
    pub fusion_model: &'static str,
    /// T_s.
    pub threshold: f64,
    /// V.
    pub min_vehicles: i32,
    /// Change detection.
    pub change: ChangeScores,
    /// Matching against truth ids; null: the truth has none.
    pub matching: Option<()>,
    /// Calibration of P(change).
    pub calibration: Calibration,
    /// Geometry.
    pub geometry: GeometryErrors,
    /// Unchanged elements.
    pub control: Control,
    /// Every claim and every missed change.
    pub outcomes: Vec<Outcome>,
}

/// The verdict of a record and its posterior.
fn claim(record: &ChangeRecord) -> Option<(Verdict, f64)> {
    let verdict = Verdict::from_code(record.verdict)?;
    let posterior = match verdict {
        Verdict::Added => record.p_added,
        Verdict::Removed => record.p_removed,
        Verdict::Modified => record.p_modified,
        _ => return None,
    };
    Some((verdict, posterior))
}

fn is_claimed(record: &ChangeRecord, criteria: Criteria) -> bool {
    record.vehicles >= criteria.min_vehicles
        && claim(record).is_some_and(|(_, posterior)| posterior >= criteria.threshold)
}

/// Scores `records` against `truth`.
#[must_use]
pub fn evaluate(
    records: &[ChangeRecord],
    truth: &[TruthChange],
    model: FusionModel,
    criteria: Criteria,
) -> Evaluation {
    let mut claims: Vec<&ChangeRecord> = records
        .iter()
        .filter(|record| is_claimed(record, criteria))
        .collect();
    // The surest claim finds a change first.
    claims.sort_by(|a, b| {
        let sure = |record: &ChangeRecord| claim(record).map_or(0.0, |(_, posterior)| posterior);
        sure(b).total_cmp(&sure(a)).then(a.change.cmp(&b.change))
    });
    let found = assign(&claims, truth);
    let right = |index: usize| found.iter().any(|&(claim, _)| claim == index);
    let by_type = [Verdict::Added, Verdict::Removed, Verdict::Modified].map(|verdict| {
        let claimed = |index: &usize| claims[*index].verdict == verdict.code();
        let of_type: Vec<usize> = (0..claims.len()).filter(claimed).collect();
        let score = score(
            truth
                .iter()
                .filter(|change| change.change_type == verdict)
                .count(),
            of_type.len(),
            of_type.iter().filter(|&&index| right(index)).count(),
        );
        (verdict.name(), score)
    });
    let outcomes = outcomes(&claims, truth, &found, records);
    Evaluation {
        fusion_model: model.name(),
        threshold: criteria.threshold,
        min_vehicles: criteria.min_vehicles,
        change: ChangeScores {
            all: score(truth.len(), claims.len(), found.len()),
            by_type: by_type.into_iter().collect(),
        },
        matching: None,
        calibration: calibration(records, truth, criteria),
        geometry: geometry(&claims, truth, &found),
        control: control(records, truth, criteria),
        outcomes,
    }
}

fn score(truth: usize, claimed: usize, right: usize) -> Score {
    let share = |of: usize| (of > 0).then(|| right as f64 / of as f64);
    let (precision, recall) = (share(claimed), share(truth));
    let f1 = precision
        .zip(recall)
        .filter(|(p, r)| p + r > 0.0)
        .map(|(p, r)| 2.0 * p * r / (p + r));
    Score {
        truth,
        claimed,
        right,
        precision,
        recall,
        f1,
    }
}

/// Pairs of (claim, true change), each used once.
fn assign(claims: &[&ChangeRecord], truth: &[TruthChange]) -> Vec<(usize, usize)> {
    let mut is_found = vec![false; truth.len()];
    let mut pairs = Vec::new();
    for (index, claim) in claims.iter().enumerate() {
        let hit = (0..truth.len()).find(|&t| !is_found[t] && agrees(claim, &truth[t]));
        if let Some(hit) = hit {
            is_found[hit] = true;
            pairs.push((index, hit));
        }
    }
    pairs
}

fn agrees(claim: &ChangeRecord, change: &TruthChange) -> bool {
    if claim.verdict != change.change_type.code() || claim.kind != change.kind.code() {
        return false;
    }
    if claim.element.is_some() && claim.element == change.element_id {
        return overlap_of_stations(claim, change) >= COVERED_SHARE;
    }
    let geometry = match change.change_type {
        Verdict::Removed => &claim.geometry_old,
        _ => &claim.geometry_new,
    };
    let read = geometry.as_deref().and_then(|bytes| wkb::read(bytes).ok());
    read.is_some_and(|geometry| covered_share(&change.points, &geometry.points) >= COVERED_SHARE)
}

/// Share of the true stretch that the claim covers, by station.
fn overlap_of_stations(claim: &ChangeRecord, change: &TruthChange) -> f64 {
    let from = change.from_m.unwrap_or(0.0);
    let to = change
        .to_m
        .or_else(|| {
            Polyline::of_element(&change.points)
                .ok()
                .map(|(_, line)| line.length_m())
        })
        .unwrap_or(claim.to_m);
    let common = claim.to_m.min(to) - claim.from_m.max(from);
    if to > from {
        (common / (to - from)).max(0.0)
    } else {
        1.0
    }
}

/// Distances of places along `line` from `other`, in metres; none if either is no line.
fn distances_m(line: &[[f64; 3]], other: &[[f64; 3]]) -> Option<Vec<f64>> {
    let anchor = *line.first()?;
    let frame = LocalFrame::new([anchor[0], anchor[1], 0.0]);
    let plane = |points: &[[f64; 3]]| {
        let flat = points
            .iter()
            .map(|&[lon, lat, _]| frame.to_enu([lon, lat, 0.0]));
        Polyline::new(flat.collect::<Vec<_>>()).ok()
    };
    let (line, other) = (plane(line)?, plane(other)?);
    let step_m = line.length_m() / SAMPLES as f64;
    let places = (0..SAMPLES).map(|i| line.at((i as f64 + 0.5) * step_m).point);
    Some(
        places
            .map(|[east, north, _]| other.project([east, north]).distance_m)
            .collect(),
    )
}

fn covered_share(truth: &[[f64; 3]], claim: &[[f64; 3]]) -> f64 {
    distances_m(truth, claim).map_or(0.0, |distances| {
        let near = distances
            .iter()
            .filter(|distance| **distance <= NEAR_M)
            .count();
        near as f64 / distances.len() as f64
    })
}

fn is_true_of(element: i64, truth: &[TruthChange]) -> bool {
    truth
        .iter()
        .any(|change| change.element_id == Some(element) && change.change_type != Verdict::Added)
}

/// P(change) of every judged element with whether it changed.
fn judged<'a>(
    records: &'a [ChangeRecord],
    truth: &'a [TruthChange],
    criteria: Criteria,
) -> BTreeMap<i64, (f64, bool, bool)> {
    let mut elements: BTreeMap<i64, (f64, bool, bool)> = BTreeMap::new();
    for record in records {
        let Some(element) = record.element else {
            continue;
        };
        if record.vehicles < criteria.min_vehicles {
            continue;
        }
        let entry = elements
            .entry(element)
            .or_insert((0.0, is_true_of(element, truth), false));
        entry.0 = entry.0.max(1.0 - record.p_no_change);
        entry.2 |= is_claimed(record, criteria);
    }
    elements
}

fn control(records: &[ChangeRecord], truth: &[TruthChange], criteria: Criteria) -> Control {
    let judged = judged(records, truth, criteria);
    let unchanged = || judged.values().filter(|(_, changed, _)| !changed);
    Control {
        judged: unchanged().count(),
        claimed: unchanged().filter(|(_, _, claimed)| *claimed).count(),
    }
}

fn calibration(records: &[ChangeRecord], truth: &[TruthChange], criteria: Criteria) -> Calibration {
    let judged = judged(records, truth, criteria);
    let count = judged.len() as f64;
    if judged.is_empty() {
        return Calibration {
            ece: None,
            brier: None,
        };
    }
    let mut bins = [(0.0, 0.0, 0.0); BINS];
    let mut brier = 0.0;
    for (p, changed, _) in judged.values() {
        let label = f64::from(u8::from(*changed));
        let bin = &mut bins[((p * BINS as f64) as usize).min(BINS - 1)];
        *bin = (bin.0 + 1.0, bin.1 + p, bin.2 + label);
        brier += (p - label) * (p - label) / count;
    }
    let ece = bins
        .iter()
        .map(|(_, p, label)| (p - label).abs() / count)
        .sum();
    Calibration {
        ece: Some(ece),
        brier: Some(brier),
    }
}

fn geometry(
    claims: &[&ChangeRecord],
    truth: &[TruthChange],
    found: &[(usize, usize)],
) -> GeometryErrors {
    let mut errors: Vec<f64> = found
        .iter()
        .filter(|&&(_, change)| truth[change].change_type == Verdict::Added)
        .filter_map(|&(claim, change)| {
            let geometry = wkb::read(claims[claim].geometry_new.as_deref()?).ok()?;
            distances_m(&geometry.points, &truth[change].points)
        })
        .flatten()
        // Where the claim runs on beyond the true line, distance is not lateral.
        .filter(|distance| *distance <= NEAR_M)
        .collect();
    errors.sort_by(f64::total_cmp);
    let quantile = |q: f64| {
        errors
            .get(((errors.len() as f64 * q) as usize).min(errors.len().saturating_sub(1)))
            .copied()
    };
    GeometryErrors {
        added_lateral_median_m: quantile(0.5),
        added_lateral_p95_m: quantile(0.95),
    }
}

fn outcomes(
    claims: &[&ChangeRecord],
    truth: &[TruthChange],
    found: &[(usize, usize)],
    records: &[ChangeRecord],
) -> Vec<Outcome> {
    let claimed = claims.iter().enumerate().map(|(index, record)| {
        let (verdict, posterior) = claim(record).unwrap_or((Verdict::Unknown, 0.0));
        let is_right = found.iter().any(|&(claim, _)| claim == index);
        let geometry = record
            .geometry_new
            .as_ref()
            .or(record.geometry_old.as_ref());
        Outcome {
            outcome: if is_right { "right" } else { "wrong" },
            change_type: verdict.name(),
            element_id: record.element,
            change: Some(format!("{:016x}", record.change)),
            posterior: Some(posterior),
            vehicles: Some(record.vehicles),
            at: geometry
                .and_then(|bytes| wkb::read(bytes).ok())
                .and_then(|geometry| geometry.points.first().map(|p| [p[0], p[1]])),
            said: None,
        }
    });
    let missed = truth.iter().enumerate().filter_map(|(index, change)| {
        let is_found = found.iter().any(|&(_, found)| found == index);
        (!is_found).then(|| missed(change, records))
    });
    claimed.chain(missed).collect()
}

fn missed(change: &TruthChange, records: &[ChangeRecord]) -> Outcome {
    let said = records
        .iter()
        .find(|record| record.element.is_some() && record.element == change.element_id);
    Outcome {
        outcome: "missed",
        change_type: change.change_type.name(),
        element_id: change.element_id,
        change: None,
        posterior: said.map(|record| match change.change_type {
            Verdict::Removed => record.p_removed,
            _ => record.p_modified,
        }),
        vehicles: said.map(|record| record.vehicles),
        at: change.points.first().map(|p| [p[0], p[1]]),
        said: said
            .and_then(|record| Verdict::from_code(record.verdict))
            .map(|verdict| verdict.name().to_owned()),
    }
}
