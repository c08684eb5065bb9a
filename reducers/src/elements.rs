//! Judging mapped elements: verdicts per section, merged into stretches and into one record an
//! element where it is of one piece.

use std::collections::{BTreeMap, BTreeSet};

use tilefold_schemas::{ChangeRecord, ElementKind, EvidenceRow, Verdict, fixed, wkb};
use tilefold_tiler::map_index::MappedElement;
use tilefold_tiler::station::{Polyline, section_count, section_range};

use crate::areas;
use crate::calibrated::{self, Claim, State};
use crate::chain;
use crate::fold::{Fold, FusionModel};
use crate::markings;
use crate::paper;
use crate::passes::{Pass, passes};
use crate::sensor::SensorModel;
use crate::traverse;

/// Section length in metres, as the map stage counts sections.
pub const SECTION_M: f64 = 10.0;
/// Prior of removed and of modified: half of 2 % churn each.
const PRIOR_CHANGE: [f64; 2] = [0.01, 0.01];
/// Affinity of sections that differ in how well they can be seen, relative to those that do not.
const OTHER_LEVEL: f64 = 0.1;
/// A vehicle of the quorum has looked with at least this much visibility, in fully visible frames.
const MIN_LOOK: f64 = 1.0;
/// Below this posterior no hypothesis is called.
const MIN_POSTERIOR: f64 = 0.5;

/// Posterior of one section: no change, added, removed, modified; and the mean shift.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Judged {
    pub(crate) posterior: [f64; 4],
    pub(crate) shift_m: f64,
    pub(crate) shift_sigma_m: f64,
}

/// Change records of one element: one if it is of one piece, else one per changed stretch.
#[must_use]
pub fn judge(
    mapped: &MappedElement,
    rows: &[&EvidenceRow],
    Fold { model, quorum }: Fold,
) -> Vec<ChangeRecord> {
    if mapped.element.kind != ElementKind::LaneMarking {
        return areas::judge(mapped, rows, Fold { model, quorum });
    }
    let length_m = mapped.length_m;
    let count = section_count(length_m, SECTION_M);
    let sections = by_section(rows, mapped, count);
    let judged = match model {
        FusionModel::Paper => sections.iter().map(judge_paper).collect(),
        FusionModel::Calibrated => {
            let sensor = SensorModel::default();
            let mut judged = judge_calibrated(&sections, &sensor);
            markings::retype(mapped.element.marking, &sections, &sensor, &mut judged);
            judged
        }
    };
    stretches(&judged, &sections, quorum)
        .into_iter()
        .map(|(verdict, range)| record(mapped, &sections, &judged, verdict, range, length_m, model))
        .collect()
}

/// The passes over each section of the element as it is now; rows about another content of the
/// element are of an older map and do not count.
fn by_section(rows: &[&EvidenceRow], mapped: &MappedElement, count: u32) -> Vec<Vec<Pass>> {
    let mut grouped: BTreeMap<i32, Vec<&EvidenceRow>> = BTreeMap::new();
    for row in rows.iter().filter(|row| row.content == mapped.content.0) {
        grouped.entry(row.section).or_default().push(row);
    }
    (0..count.cast_signed())
        .map(|section| {
            grouped
                .get(&section)
                .map(|rows| passes(rows))
                .unwrap_or_default()
        })
        .collect()
}

fn judge_paper(section: &Vec<Pass>) -> Judged {
    let residual = mean_residual(std::slice::from_ref(section));
    let (shift_m, shift_sigma_m) = residual.unwrap_or((0.0, 0.0));
    Judged {
        posterior: paper::posterior(section),
        shift_m,
        shift_sigma_m,
    }
}

fn judge_calibrated(sections: &[Vec<Pass>], sensor: &SensorModel) -> Vec<Judged> {
    let states = calibrated::states();
    let [removed, shifted] = PRIOR_CHANGE;
    let prior: Vec<f64> = states
        .iter()
        .map(|state| match state.claim {
            Claim::Removed => state.share * removed,
            Claim::InPlace { .. } => state.share * (1.0 - removed - shifted),
            Claim::Shifted { .. } => state.share * shifted,
        })
        .collect();
    let worths = traverse::worths(sections);
    let logs: Vec<Vec<f64>> = sections
        .iter()
        .zip(&worths)
        .map(|(passes, worths)| {
            let sums = calibrated::log_likelihoods(passes, worths, &states, sensor);
            sums.into_iter().map(fixed::to_f64).collect()
        })
        .collect();
    let posterior = chain::posterior(&logs, &prior, &kin(&states));
    posterior
        .iter()
        .map(|states_p| merge_states(states_p, &states))
        .collect()
}

/// Within a claim, offset and detectability may wander to the next ones from section to section.
fn kin(states: &[State]) -> Vec<Vec<f64>> {
    let near = |a: f64, b: f64, scale: f64| {
        let z = (a - b) / scale;
        libm::exp(-0.5 * z * z)
    };
    let affinity = |a: &State, b: &State| match (a.claim, b.claim) {
        (Claim::Removed, Claim::Removed) => 1.0,
        (Claim::InPlace { offset_m: p }, Claim::InPlace { offset_m: q })
        | (Claim::Shifted { offset_m: p }, Claim::Shifted { offset_m: q }) => {
            near(p, q, 0.1) * if a.level == b.level { 1.0 } else { OTHER_LEVEL }
        }
        _ => 0.0,
    };
    let row = |from: &State| {
        let row: Vec<f64> = states.iter().map(|to| affinity(from, to)).collect();
        let total: f64 = row.iter().sum();
        row.iter().map(|value| value / total).collect()
    };
    states.iter().map(row).collect()
}

fn merge_states(posterior: &[f64], states: &[State]) -> Judged {
    let mut merged = [0.0; 4];
    let (mut sum, mut square) = (0.0, 0.0);
    for (p, state) in posterior.iter().zip(states) {
        match state.claim {
            Claim::InPlace { .. } => merged[0] += p,
            Claim::Removed => merged[2] += p,
            Claim::Shifted { offset_m } => {
                merged[3] += p;
                sum += p * offset_m;
                square += p * offset_m * offset_m;
            }
        }
    }
    let shift_m = if merged[3] > 0.0 {
        sum / merged[3]
    } else {
        0.0
    };
    let variance = if merged[3] > 0.0 {
        square / merged[3] - shift_m * shift_m
    } else {
        0.0
    };
    Judged {
        posterior: merged,
        shift_m,
        // The grid itself is no finer than its step.
        shift_sigma_m: (variance.max(0.0) + 0.1 * 0.1 / 12.0).sqrt(),
    }
}

/// What a posterior says: the likelier of change and no change first, its type next, so that
/// disagreement on the type never reads as no change.
pub(crate) fn verdict(posterior: &[f64; 4]) -> Verdict {
    let [no_change, added, removed, modified] = *posterior;
    if no_change >= MIN_POSTERIOR {
        Verdict::NoChange
    } else if added + removed + modified < MIN_POSTERIOR {
        Verdict::Unknown
    } else if removed >= modified && removed >= added {
        Verdict::Removed
    } else if modified >= added {
        Verdict::Modified
    } else {
        Verdict::Added
    }
}

/// Sections `[from, to)` with their verdict.
type Stretch = (Verdict, (usize, usize));

/// Runs of changed sections; or the whole element, if nothing on it changed.
fn stretches(judged: &[Judged], sections: &[Vec<Pass>], quorum: usize) -> Vec<Stretch> {
    let whole = (0, judged.len());
    if vehicles(sections, whole).len() < quorum {
        return vec![(Verdict::Unknown, whole)];
    }
    let verdicts: Vec<Verdict> = judged.iter().map(|j| verdict(&j.posterior)).collect();
    let mut runs: Vec<Stretch> = Vec::new();
    for (index, &verdict) in verdicts.iter().enumerate() {
        match runs.last_mut() {
            Some((last, (_, to))) if *last == verdict => *to = index + 1,
            _ => runs.push((verdict, (index, index + 1))),
        }
    }
    // What nobody saw follows its neighbours, but no run is claimed without a look at it.
    runs.retain(|(verdict, range)| {
        verdict.is_change() && vehicles(sections, *range).len() >= quorum
    });
    if runs.is_empty() {
        let unchanged = verdicts.contains(&Verdict::NoChange);
        let verdict = if unchanged {
            Verdict::NoChange
        } else {
            Verdict::Unknown
        };
        runs.push((verdict, whole));
    }
    runs
}

/// Vehicles that looked at a range of sections well enough to count.
pub(crate) fn vehicles(sections: &[Vec<Pass>], (from, to): (usize, usize)) -> BTreeSet<i64> {
    let mut looks: BTreeMap<i64, i64> = BTreeMap::new();
    for pass in sections[from..to].iter().flatten() {
        *looks.entry(pass.vehicle).or_default() += pass.sum_v_fx;
    }
    let enough = fixed::from_f64(MIN_LOOK);
    looks.retain(|_, sum_v_fx| *sum_v_fx >= enough);
    looks.into_keys().collect()
}

/// Mean posterior over sections.
fn mean_posterior(judged: &[Judged]) -> [f64; 4] {
    let mut mean = [0.0; 4];
    for section in judged {
        for (sum, p) in mean.iter_mut().zip(section.posterior) {
            *sum += p / judged.len() as f64;
        }
    }
    mean
}

/// Mean residual of passes and its standard deviation, in metres.
fn mean_residual(sections: &[Vec<Pass>]) -> Option<(f64, f64)> {
    let residuals: Vec<f64> = sections
        .iter()
        .flatten()
        .filter_map(Pass::residual_m)
        .collect();
    let count = residuals.len() as f64;
    (!residuals.is_empty()).then(|| {
        let mean = residuals.iter().sum::<f64>() / count;
        (mean, SensorModel::default().pass_sigma_m / count.sqrt())
    })
}

/// The change record of a stretch of sections.
pub(crate) fn record(
    mapped: &MappedElement,
    sections: &[Vec<Pass>],
    judged: &[Judged],
    verdict: Verdict,
    range: (usize, usize),
    length_m: f64,
    model: FusionModel,
) -> ChangeRecord {
    let (from, to) = range;
    let stretch = &judged[from..to];
    let posterior = mean_posterior(stretch);
    let passes: Vec<&Pass> = sections[from..to].iter().flatten().collect();
    let best = passes.iter().max_by_key(|pass| {
        (
            pass.sum_v_fx,
            std::cmp::Reverse((pass.vehicle, pass.best_ns)),
        )
    });
    let of_sections = |section: usize| section_range(section as u32, length_m, SECTION_M);
    let (from_m, to_m) = if from == 0 && to == judged.len() {
        (0.0, length_m)
    } else {
        (of_sections(from)[0], of_sections(to - 1)[1])
    };
    let shift = (verdict == Verdict::Modified).then(|| mean_shift(stretch));
    let change = posterior[1] + posterior[2] + posterior[3];
    ChangeRecord {
        tile: mapped.tile.0,
        change: change_id(mapped.element.id.0, from_m, to_m),
        element: Some(mapped.element.id.0),
        content: mapped.content.0,
        kind: mapped.element.kind.code(),
        from_m: round_mm(from_m),
        to_m: round_mm(to_m),
        verdict: verdict.code(),
        p_no_change: posterior[0],
        p_added: posterior[1],
        p_removed: posterior[2],
        p_modified: posterior[3],
        log_odds: libm::log(change.max(1e-300)) - libm::log(posterior[0].max(1e-300)),
        vehicles: vehicles(sections, range).len() as i32,
        passes: passes_of_stretch(&passes),
        exposed: passes.iter().map(|pass| pass.exposed).sum(),
        hit: passes.iter().map(|pass| pass.hit).sum(),
        first_ns: passes.iter().map(|pass| pass.first_ns).min().unwrap_or(0),
        last_ns: passes.iter().map(|pass| pass.last_ns).max().unwrap_or(0),
        shift_m: shift.map(|(shift_m, _)| shift_m),
        shift_sigma_m: shift.map(|(_, sigma_m)| sigma_m),
        class_observed: observed_class(&passes),
        geometry_old: Some(old_geometry(mapped, from_m, to_m)),
        geometry_new: shift
            .and_then(|(shift_m, _)| shifted_geometry(mapped, from_m, to_m, shift_m)),
        best_vehicle: best.map_or(0, |pass| pass.vehicle),
        best_ns: best.map_or(0, |pass| pass.best_ns),
        fusion_model: model.name().to_owned(),
    }
}

/// Passes over a stretch: those of its most passed section.
fn passes_of_stretch(passes: &[&Pass]) -> i32 {
    let mut starts: BTreeMap<i64, BTreeSet<i64>> = BTreeMap::new();
    for pass in passes {
        // Sections of one traverse are seconds apart: half a minute tells traverses apart.
        let traverse = pass.first_ns.div_euclid(30_000_000_000);
        let windows = starts.entry(pass.vehicle).or_default();
        if !windows.contains(&(traverse - 1)) {
            windows.insert(traverse);
        }
    }
    starts.values().map(|windows| windows.len() as i32).sum()
}

fn mean_shift(stretch: &[Judged]) -> (f64, f64) {
    let weight: f64 = stretch
        .iter()
        .map(|j| j.posterior[3])
        .sum::<f64>()
        .max(1e-12);
    let mean = |value: fn(&Judged) -> f64| {
        stretch
            .iter()
            .map(|j| j.posterior[3] * value(j))
            .sum::<f64>()
            / weight
    };
    (mean(|j| j.shift_m), mean(|j| j.shift_sigma_m))
}

/// The class seen most, the lower code of equals; none if none was recognised.
fn observed_class(passes: &[&Pass]) -> Option<i16> {
    let bins = passes.first().map_or(0, |pass| pass.seen.len());
    let total = |bin: usize| {
        passes
            .iter()
            .map(|pass| i64::from(pass.seen[bin]))
            .sum::<i64>()
    };
    (1..bins)
        .map(|bin| (total(bin), std::cmp::Reverse(bin)))
        .max()
        .filter(|(count, _)| *count > 0)
        .map(|(_, std::cmp::Reverse(bin))| bin as i16)
}

fn old_geometry(mapped: &MappedElement, from_m: f64, to_m: f64) -> Vec<u8> {
    let points = &mapped.element.points;
    match mapped.element.kind {
        ElementKind::Crosswalk | ElementKind::GroundSign => wkb::polygon(points),
        ElementKind::LaneMarking | ElementKind::StopLine => {
            wkb::line(&shifted_line(mapped, from_m, to_m, 0.0).unwrap_or_else(|| points.clone()))
        }
    }
}

fn shifted_geometry(
    mapped: &MappedElement,
    from_m: f64,
    to_m: f64,
    shift_m: f64,
) -> Option<Vec<u8>> {
    shifted_line(mapped, from_m, to_m, shift_m).map(|points| wkb::line(&points))
}

/// A stretch of the element's line, moved to its left.
fn shifted_line(
    mapped: &MappedElement,
    from_m: f64,
    to_m: f64,
    shift_m: f64,
) -> Option<Vec<[f64; 3]>> {
    let (frame, line) = Polyline::of_element(&mapped.element.points).ok()?;
    let stretch = Polyline::new(line.between(from_m, to_m)).ok()?;
    let move_left = |(point, station_m): (&[f64; 3], &f64)| {
        let [east, north] = stretch.at(*station_m).tangent;
        let moved = [
            point[0] - shift_m * north,
            point[1] + shift_m * east,
            point[2],
        ];
        round_degrees(frame.to_wgs84(moved))
    };
    let stations = stretch.points().iter().zip(stretch.stations_m());
    Some(stations.map(move_left).collect())
}

/// Rounded to 1e-9 degrees and millimetres: geometry in layers is the same on every machine.
#[must_use]
pub fn round_degrees([longitude_deg, latitude_deg, elevation_m]: [f64; 3]) -> [f64; 3] {
    [
        (longitude_deg * 1e9).round() / 1e9,
        (latitude_deg * 1e9).round() / 1e9,
        round_mm(elevation_m),
    ]
}

fn round_mm(metres: f64) -> f64 {
    (metres * 1e3).round() / 1e3
}

/// The id of a change: of the element and its station range.
fn change_id(element: i64, from_m: f64, to_m: f64) -> i64 {
    let millimetres = |metres: f64| (metres * 1e3).round() as i64;
    tilefold_schemas::id::hash_text(&format!(
        "{element}:{}:{}",
        millimetres(from_m),
        millimetres(to_m)
    ))
}
