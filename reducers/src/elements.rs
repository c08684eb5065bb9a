//! Judging mapped elements: verdicts per section, merged into stretches and into one record an
//! element where it is of one piece.

use std::collections::{BTreeMap, BTreeSet};

use tilefold_schemas::{ChangeRecord, ElementKind, EvidenceRow, Verdict, fixed, wkb};
use tilefold_tiler::map_index::MappedElement;
use tilefold_tiler::station::{Polyline, section_count, section_range};

use crate::areas;
use crate::explain::{Explained, Weight};
use crate::fold::{Fold, FusionModel};
use crate::lines;
use crate::markings;
use crate::paper;
use crate::passes::{Pass, passes};

/// Section length in metres, as the map stage counts sections.
pub const SECTION_M: f64 = 10.0;
/// Standard deviation of a pass's residual where no sensor model says so, in metres.
const PAPER_PASS_SIGMA_M: f64 = 0.25;
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
pub fn judge(mapped: &MappedElement, rows: &[&EvidenceRow], fold: &Fold) -> Vec<ChangeRecord> {
    let explained = explain(mapped, rows, fold).into_iter();
    explained.map(|explained| explained.record).collect()
}

/// As [`judge`], with what every pass adds to each record.
#[must_use]
pub fn explain(mapped: &MappedElement, rows: &[&EvidenceRow], fold: &Fold) -> Vec<Explained> {
    if mapped.element.kind != ElementKind::LaneMarking {
        return vec![areas::explain(mapped, rows, fold)];
    }
    let sections = by_section(rows, mapped);
    let mut votes = Vec::new();
    let (judged, sections, mut testimonies, since) = match fold.model {
        FusionModel::Paper => {
            let nats = |passes: &Vec<Pass>| passes.iter().map(paper::testimony).collect();
            let testimonies: Vec<Vec<[i64; 4]>> = sections.iter().map(nats).collect();
            let judged = sections.iter().map(judge_paper).collect();
            (judged, sections, testimonies, None)
        }
        FusionModel::Calibrated => {
            let line = lines::judge(&sections, &fold.sensor);
            let mut judged = line.sections;
            let marking = mapped.element.marking;
            votes = markings::retype(marking, &line.passes, &fold.sensor, &mut judged);
            (judged, line.passes, line.testimonies, line.since)
        }
    };
    if !votes.is_empty() {
        // It is in its place either way: what it was read as makes the difference.
        for nats_fx in testimonies.iter_mut().flatten() {
            nats_fx[3] = nats_fx[0];
        }
    }
    let weights = |(from, to): (usize, usize)| -> Vec<Weight> {
        let of = |(passes, nats): (&Vec<Pass>, &Vec<[i64; 4]>)| -> Vec<Weight> {
            let pairs = passes.iter().zip(nats);
            pairs
                .map(|(pass, nats_fx)| Weight::of(pass, *nats_fx))
                .collect()
        };
        let of_stretch = sections[from..to].iter().zip(&testimonies[from..to]);
        of_stretch
            .flat_map(of)
            .chain(votes.iter().cloned())
            .collect()
    };
    let explained = |(verdict, range): Stretch| {
        let length_m = mapped.length_m;
        let mut record = record(
            mapped, &sections, &judged, verdict, range, length_m, fold.model,
        );
        if verdict.is_change() {
            record.changed_after_ns = since.map(|since| since.after_ns);
            record.changed_before_ns = since.map(|since| since.before_ns);
        }
        Explained::new(record, weights(range))
    };
    stretches(&judged, &sections, fold.quorum)
        .into_iter()
        .map(explained)
        .collect()
}

/// The passes over each section of the element as it is now; rows about another content of the
/// element are of an older map and do not count.
pub(crate) fn by_section(rows: &[&EvidenceRow], mapped: &MappedElement) -> Vec<Vec<Pass>> {
    let count = section_count(mapped.length_m, SECTION_M);
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
        *looks.entry(pass.vehicle).or_default() += pass.sum_v_q8;
    }
    let enough = fixed::to_q8(MIN_LOOK);
    looks.retain(|_, sum_v_q8| *sum_v_q8 >= enough);
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
        (mean, PAPER_PASS_SIGMA_M / count.sqrt())
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
            pass.sum_v_q8,
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
        evidence_fx: 0,
        best_vehicle: best.map_or(0, |pass| pass.vehicle),
        best_ns: best.map_or(0, |pass| pass.best_ns),
        changed_after_ns: None,
        changed_before_ns: None,
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
