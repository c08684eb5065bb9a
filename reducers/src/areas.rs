//! Judging mapped stop lines, crosswalks and ground signs.
//!
//! A pass says three things: in how many of the frames that should have shown the thing it was matched,
//! where its match lay in two dimensions, and what it was read as. Claims are weighed against each
//! other with these: gone; in its place; in its place, but another class; beside its place. Passes
//! count once each and move the odds by a bounded amount; all log-likelihoods are quantised once a
//! pass and summed as integers, so their order does not matter.

use tilefold_schemas::{ElementKind, EvidenceRow, SignClass, Verdict, fixed, wkb};
use tilefold_tiler::map_index::MappedElement;
use tilefold_tiler::station::Polyline;

use crate::elements::{self, Judged, round_degrees};
use crate::explain::{Explained, Weight};
use crate::fold::{Fold, FusionModel};
use crate::paper::{self, softmax};
use crate::passes::{Pass, passes};

/// Prior of removed, of another class and of shifted: 2 % churn in all.
const PRIOR_REMOVED: f64 = 0.01;
const PRIOR_RETYPED: f64 = 0.005;
const PRIOR_SHIFTED: f64 = 0.005;
/// Share of passes that do not see what is there in any frame: another vehicle stands on it.
const HIDDEN: f64 = 0.12;
/// P(match in a frame | there, not hidden): mean and concentration over passes.
const MATCHED: (f64, f64) = (0.7, 3.0);
/// P(match in a frame | not there), likewise.
const FALSELY_MATCHED: (f64, f64) = (0.03, 3.0);
/// A pass's likelihood is mixed with this much of the mean over claims.
const CONTAMINATION: f64 = 0.03;
/// Standard deviation of a pass's place apart from what its rows state, in metres.
const PASS_SIGMA_M: f64 = 0.1;
/// Share of matches that are of something else, anywhere in the gate.
const STRAY: f64 = 0.1;
/// Density of such in one dimension, per metre.
const STRAY_DENSITY: f64 = 0.2;
/// Places that are considered, to either side, in steps.
const STEP_M: f64 = 0.1;
const STEPS: usize = 30;
/// How far off its mapped place a thing still is in its place (standard deviation, metres); and, as a
/// share of the noise of a pass, what of it is alike in all passes: along the way all of them go by the
/// same neighbours.
const TOLERANCE_M: f64 = 0.15;
const COMMON_SHARE: f64 = 0.45;
/// Shifts begin at this many tolerances, and are this long (standard deviation, metres).
const SHIFT_FROM: f64 = 2.5;
const SHIFT_SIGMA_M: f64 = 1.2;
/// P(a frame reads the true class) among recognised ones; the rest are spread over the others.
const READ_RIGHT: f64 = 0.85;
/// Frames of a pass read alike: a pass is worth at most this many readings.
const READINGS: f64 = 1.5;
/// Square root of the full circle.
const SQRT_TAU: f64 = 2.506_628_274_631_000_5;

/// Posterior over claims: in place, removed, retyped, shifted; and where it lies.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Claims {
    in_place: f64,
    removed: f64,
    retyped: f64,
    shifted: f64,
    /// Best place to the left and along, with standard deviations, in metres.
    left: (f64, f64),
    along: (f64, f64),
}

/// The change record of one element, with what every pass adds to it; rows are those of its present content, in any order.
#[must_use]
pub fn explain(mapped: &MappedElement, rows: &[&EvidenceRow], fold: &Fold) -> Explained {
    let rows: Vec<&EvidenceRow> = rows
        .iter()
        .filter(|row| row.content == mapped.content.0)
        .copied()
        .collect();
    let sections = [passes(&rows)];
    let (claims, testimonies) = weigh(&sections[0], mapped.element.kind, mapped.element.sign);
    let testimonies = match fold.model {
        FusionModel::Paper => sections[0].iter().map(paper::testimony).collect(),
        FusionModel::Calibrated => testimonies,
    };
    let posterior = match fold.model {
        FusionModel::Paper => paper::posterior(&sections[0]),
        FusionModel::Calibrated => [
            claims.in_place,
            0.0,
            claims.removed,
            claims.retyped + claims.shifted,
        ],
    };
    let judged = [Judged {
        posterior,
        shift_m: claims.left.0,
        shift_sigma_m: claims.left.1,
    }];
    let verdict = if elements::vehicles(&sections, (0, 1)).len() < fold.quorum {
        Verdict::Unknown
    } else {
        elements::verdict(&posterior)
    };
    let whole = (0, 1);
    let length_m = mapped.length_m;
    let mut record = elements::record(
        mapped, &sections, &judged, verdict, whole, length_m, fold.model,
    );
    // `elements` takes what has one section for as long as that; an area is judged as a whole.
    record.geometry_old = Some(outline(mapped, [0.0; 2]));
    record.geometry_new = None;
    if mapped.element.kind != ElementKind::GroundSign {
        record.class_observed = None;
    }
    if verdict == Verdict::Modified {
        let is_shifted = claims.shifted >= claims.retyped;
        let place = if is_shifted {
            [claims.along.0, claims.left.0]
        } else {
            record.shift_m = None;
            record.shift_sigma_m = None;
            [0.0; 2]
        };
        record.geometry_new = Some(outline(mapped, place));
    }
    let pairs = sections[0].iter().zip(testimonies);
    let weights = pairs.map(|(pass, nats_fx)| Weight::of(pass, nats_fx));
    Explained::new(record, weights.collect())
}

/// The element's outline moved along and to the left of its direction, in metres.
fn outline(mapped: &MappedElement, [along_m, left_m]: [f64; 2]) -> Vec<u8> {
    let is_line = mapped.element.kind == ElementKind::StopLine;
    let points = &mapped.element.points;
    let moved = Polyline::of_element(points).map_or_else(
        |_| points.clone(),
        |(frame, line)| {
            let [east, north] = direction(&line, is_line);
            let (de, dn) = (
                along_m * east - left_m * north,
                along_m * north + left_m * east,
            );
            points
                .iter()
                .map(|&point| {
                    let [e, n, up] = frame.to_enu(point);
                    round_degrees(frame.to_wgs84([e + de, n + dn, up]))
                })
                .collect()
        },
    );
    if is_line {
        wkb::line(&moved)
    } else {
        wkb::polygon(&moved)
    }
}

/// Along the first side of an outline, or from end to end of a line, as the map stage has it.
fn direction(line: &Polyline, is_line: bool) -> [f64; 2] {
    let points = line.points();
    let to = if is_line {
        points[points.len() - 1]
    } else {
        points[1]
    };
    let (east, north) = (to[0] - points[0][0], to[1] - points[0][1]);
    let length = east.hypot(north).max(1e-9);
    [east / length, north / length]
}

/// The claims, and what each pass says of no change, added, removed and modified.
fn weigh(passes: &[Pass], kind: ElementKind, class: SignClass) -> (Claims, Vec<[i64; 4]>) {
    let seen: Vec<[i64; 2]> = passes.iter().map(presence).collect();
    let sum = |of: usize| fixed::to_f64(seen.iter().map(|nats_fx| nats_fx[of]).sum());
    let [gone, there] = [sum(0), sum(1)];
    let left = Place::new(passes, |pass| {
        residual(pass, pass.residual_eta_q8, pass.residual_lambda_q8)
    });
    let along = Place::new(passes, |pass| {
        residual(pass, pass.along_eta_q8, pass.along_lambda_q8)
    });
    let mapped_class = Some(class).filter(|_| kind == ElementKind::GroundSign);
    let read = Readings::new(passes, mapped_class);
    let (same, other) = (read.same, read.other);
    // A shift is to the side, along, or both; each as likely.
    let shifts = [
        left.off + along.near,
        left.near + along.off,
        left.off + along.off,
    ];
    let mut logs = vec![
        there
            + left.near
            + along.near
            + same
            + libm::log(1.0 - PRIOR_REMOVED - PRIOR_RETYPED - PRIOR_SHIFTED),
        gone + libm::log(PRIOR_REMOVED),
        there + left.near + along.near + other + libm::log(PRIOR_RETYPED),
    ];
    for shift in shifts {
        // What was painted anew beside its place may be of another class too.
        let either = libm::log(0.9 * libm::exp(same) + 0.1 * libm::exp(other));
        logs.push(there + shift + either + libm::log(PRIOR_SHIFTED / 3.0));
    }
    let logs: [f64; 6] = std::array::from_fn(|index| logs[index]);
    let [in_place, removed, retyped, aside, ahead, both] = softmax(logs);
    let place = |p: f64, place: &Place| if p > 0.0 { place.best } else { (0.0, 0.0) };
    // The likeliest of what may have been modified stands for it.
    let is_retyped = retyped > aside + ahead + both;
    let is_off = |p: f64| !is_retyped && p > 0.0;
    let (off_left, off_along) = (is_off(aside + both - ahead), is_off(ahead + both - aside));
    let of_pass = |index: usize| {
        let [gone, there] = seen[index];
        let in_place = there + left.nats_fx(index, false) + along.nats_fx(index, false);
        let aside = there + left.nats_fx(index, off_left) + along.nats_fx(index, off_along);
        let [same, other] = read.nats_fx(index);
        let modified = if is_retyped {
            aside + other
        } else {
            aside + same
        };
        [in_place + same, 0, gone, modified]
    };
    let testimonies = (0..passes.len()).map(of_pass).collect();
    let claims = Claims {
        in_place,
        removed,
        retyped,
        shifted: aside + ahead + both,
        left: place(aside + both - ahead, &left),
        along: place(ahead + both - aside, &along),
    };
    (claims, testimonies)
}

/// Log-likelihoods of gone and of there, by how often a pass matched.
fn presence(pass: &Pass) -> [i64; 2] {
    let frames = pass.exposed.max(1) as f64;
    let hits = (pass.hit as f64).min(frames);
    let gone = beta_binomial(hits, frames, FALSELY_MATCHED);
    let visible = beta_binomial(hits, frames, MATCHED);
    // Matches where nothing is are matches of something else: they lie anywhere.
    let sure = pass.visibility().clamp(0.0, 1.0);
    let there = sure * ((1.0 - HIDDEN) * visible + HIDDEN * gone) + (1.0 - sure) * gone;
    let mean = 0.5 * (gone + there);
    [gone, there].map(|likelihood| {
        let mixed = (1.0 - CONTAMINATION) * likelihood + CONTAMINATION * mean;
        fixed::from_f64(libm::log(mixed / mean))
    })
}

/// P(this sequence of hits and misses), the chance of a hit being drawn once a pass from a beta
/// distribution of this mean and concentration.
fn beta_binomial(hits: f64, frames: f64, (mean, concentration): (f64, f64)) -> f64 {
    let (a, b) = (mean * concentration, (1.0 - mean) * concentration);
    let log_beta = |a: f64, b: f64| libm::lgamma(a) + libm::lgamma(b) - libm::lgamma(a + b);
    libm::exp(log_beta(a + hits, b + frames - hits) - log_beta(a, b))
}

/// Mean residual of a pass and its standard deviation. A pass's errors are the same in all of its
/// frames: its information is that of one.
fn residual(pass: &Pass, eta_q8: i64, lambda_q8: i64) -> Option<(f64, f64)> {
    (pass.hit > 0 && lambda_q8 > 0).then(|| {
        let variance = pass.hit as f64 / fixed::from_q8(lambda_q8);
        (
            eta_q8 as f64 / lambda_q8 as f64,
            variance.sqrt().hypot(PASS_SIGMA_M),
        )
    })
}

/// What residuals say of the place in one dimension.
struct Place {
    /// Log-likelihood of being in place and of being off, each averaged over its prior.
    near: f64,
    off: f64,
    /// Mean place and its standard deviation, if off.
    best: (f64, f64),
    /// What each pass says of the likeliest place, near and off.
    testimonies: Vec<[i64; 2]>,
}

impl Place {
    fn new(passes: &[Pass], of: impl Fn(&Pass) -> Option<(f64, f64)>) -> Self {
        let places = 2 * STEPS + 1;
        let offset_m = |index: usize| (index as f64 - STEPS as f64) * STEP_M;
        let mut sums_fx = vec![0_i64; places];
        let residuals: Vec<Option<(f64, f64)>> = passes.iter().map(of).collect();
        let tolerance_m = tolerance_m(&residuals.iter().copied().flatten().collect::<Vec<_>>());
        let nats_fx = |residual: Option<(f64, f64)>, index: usize| {
            let Some((residual_m, sigma_m)) = residual else {
                return 0;
            };
            let z = (residual_m - offset_m(index)) / sigma_m;
            let at = libm::exp(-0.5 * z * z) / (sigma_m * SQRT_TAU);
            let mixed = (1.0 - STRAY) * at + STRAY * STRAY_DENSITY;
            fixed::from_f64(libm::log(mixed))
        };
        for (index, sum) in sums_fx.iter_mut().enumerate() {
            *sum = residuals
                .iter()
                .map(|&residual| nats_fx(residual, index))
                .sum();
        }
        let logs: Vec<f64> = sums_fx.iter().copied().map(fixed::to_f64).collect();
        let most = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let normal = |offset_m: f64, sigma_m: f64| {
            let z = offset_m / sigma_m;
            libm::exp(-0.5 * z * z)
        };
        let weigh = |prior: &dyn Fn(f64) -> f64| {
            let (mut total, mut sum, mut mean, mut square) = (0.0, 0.0, 0.0, 0.0);
            let mut likeliest = (0.0, 0);
            for (index, log) in logs.iter().enumerate() {
                let offset_m = offset_m(index);
                let prior = prior(offset_m);
                let weight = prior * libm::exp(log - most);
                total += prior;
                sum += weight;
                mean += weight * offset_m;
                square += weight * offset_m * offset_m;
                if weight > likeliest.0 {
                    likeliest = (weight, index);
                }
            }
            let sum_or_one = sum.max(f64::MIN_POSITIVE);
            let mean = mean / sum_or_one;
            let variance = (square / sum_or_one - mean * mean).max(0.0);
            (
                libm::log(sum_or_one / total),
                (mean, (variance + STEP_M * STEP_M / 12.0).sqrt()),
                likeliest.1,
            )
        };
        let (near, _, here) = weigh(&|offset_m| normal(offset_m, tolerance_m));
        let (off, best, there) = weigh(&|offset_m| {
            if offset_m.abs() < SHIFT_FROM * tolerance_m {
                0.0
            } else {
                normal(offset_m, SHIFT_SIGMA_M)
            }
        });
        let of_pass = |&residual: &_| [nats_fx(residual, here), nats_fx(residual, there)];
        Self {
            near,
            off,
            best,
            testimonies: residuals.iter().map(of_pass).collect(),
        }
    }

    fn nats_fx(&self, pass: usize, is_off: bool) -> i64 {
        self.testimonies[pass][usize::from(is_off)]
    }
}

/// Standard deviation of what is in its place, by how well passes can tell.
fn tolerance_m(residuals: &[(f64, f64)]) -> f64 {
    let information_fx = residuals
        .iter()
        .map(|(_, sigma_m)| fixed::from_f64(sigma_m.powi(-2)));
    let mean = fixed::to_f64(information_fx.sum()) / residuals.len().max(1) as f64;
    if mean > 0.0 {
        TOLERANCE_M.max(COMMON_SHARE / mean.sqrt())
    } else {
        TOLERANCE_M
    }
}

/// Classes that can be read.
const CLASSES: usize = SignClass::ALL.len() - 1;

/// What was read.
struct Readings {
    /// Log-likelihoods of being of the mapped class and of any other. Alike where the map does not
    /// say a class that can be read wrongly.
    same: f64,
    other: f64,
    /// What each pass says of the mapped class, and of the likeliest other.
    testimonies: Vec<[i64; 2]>,
}

impl Readings {
    fn new(passes: &[Pass], class: Option<SignClass>) -> Self {
        let is_known = |class: &SignClass| !matches!(class, SignClass::Unknown | SignClass::Other);
        let Some(class) = class.filter(is_known) else {
            return Self {
                same: 0.0,
                other: f64::NEG_INFINITY,
                testimonies: vec![[0; 2]; passes.len()],
            };
        };
        let of_passes: Vec<[i64; CLASSES]> = passes.iter().map(read_as).collect();
        let sum_fx = |code: usize| of_passes.iter().map(|nats_fx| nats_fx[code]).sum();
        let logs: [f64; CLASSES] = std::array::from_fn(|code| fixed::to_f64(sum_fx(code)));
        let own = class.code() as usize - 1;
        let others = || (0..CLASSES).filter(|&code| code != own);
        let most = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let sum: f64 = others().map(|code| libm::exp(logs[code] - most)).sum();
        let now = others().max_by(|&a, &b| logs[a].total_cmp(&logs[b]).then(b.cmp(&a)));
        let now = now.unwrap_or(own);
        Self {
            same: logs[own],
            other: most + libm::log((sum / (CLASSES - 1) as f64).max(f64::MIN_POSITIVE)),
            testimonies: of_passes
                .iter()
                .map(|nats_fx| [nats_fx[own], nats_fx[now]])
                .collect(),
        }
    }

    fn nats_fx(&self, pass: usize) -> [i64; 2] {
        self.testimonies[pass]
    }
}

/// Log-likelihoods of all classes by what a pass read.
fn read_as(pass: &Pass) -> [i64; CLASSES] {
    let read: i32 = pass.seen[1..].iter().sum();
    if read == 0 {
        return [0; CLASSES];
    }
    let wrong = libm::log((1.0 - READ_RIGHT) / (CLASSES - 1) as f64);
    let worth = READINGS.min(f64::from(read)) / f64::from(read);
    let likelihoods: [f64; CLASSES] = std::array::from_fn(|code| {
        let right = f64::from(pass.seen[code + 1]);
        let log = right * libm::log(READ_RIGHT) + (f64::from(read) - right) * wrong;
        libm::exp(worth * log)
    });
    let mean = likelihoods.iter().sum::<f64>() / CLASSES as f64;
    likelihoods.map(|likelihood| {
        let mixed = (1.0 - CONTAMINATION) * likelihood + CONTAMINATION * mean;
        fixed::from_f64(libm::log(mixed / mean))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sensor::SensorModel;
    use std::collections::BTreeMap;
    use tilefold_schemas::ElementId;
    use tilefold_schemas::evidence::CLASS_BINS;

    fn arrow() -> MappedElement {
        let corner = |east: f64, north: f64| [8.0 + east / 71_700.0, 50.0 + north / 111_200.0, 0.0];
        let element = tilefold_schemas::Element {
            id: ElementId(7),
            kind: ElementKind::GroundSign,
            marking: tilefold_schemas::Marking::Unknown,
            color: tilefold_schemas::Color::White,
            sign: SignClass::LeftArrow,
            points: vec![
                corner(0.0, 0.0),
                corner(5.0, 0.0),
                corner(5.0, 1.2),
                corner(0.0, 1.2),
            ],
            tags: BTreeMap::new(),
        };
        MappedElement::new(element, 15).unwrap()
    }

    /// A pass of ten frames: matches, their place to the left and along, and what they were read as.
    fn row(vehicle: i64, hits: i32, left_m: f64, along_m: f64, class: SignClass) -> EvidenceRow {
        let mapped = arrow();
        let mut seen = [0; CLASS_BINS];
        seen[class.code() as usize] = hits;
        let information = |sigma_m: f64| f64::from(hits) / (sigma_m * sigma_m);
        EvidenceRow {
            tile: mapped.tile.0,
            element: 7,
            content: mapped.content.0,
            section: 0,
            vehicle,
            channel: 0,
            window: 0,
            method: 2,
            model: 0,
            exposed: 10,
            hit: hits,
            sum_v_q8: fixed::to_q8(9.5),
            sum_w_no_q8: 0,
            sum_w_add_q8: 0,
            sum_w_del_q8: 0,
            sum_w_mod_q8: 0,
            residual_eta_q8: fixed::to_q8(left_m * information(0.25)),
            residual_lambda_q8: fixed::to_q8(information(0.25)),
            along_eta_q8: fixed::to_q8(along_m * information(0.7)),
            along_lambda_q8: fixed::to_q8(information(0.7)),
            seen,
            first_ms: vehicle as i32 * 100_000,
            last_after_ms: 1_000,
            best_after_ms: 0,
            best_v_q8: 0,
        }
    }

    fn judged(rows: &[EvidenceRow]) -> tilefold_schemas::ChangeRecord {
        let rows: Vec<&EvidenceRow> = rows.iter().collect();
        let fold = Fold::of_fleet(FusionModel::Calibrated, SensorModel::default());
        explain(&arrow(), &rows, &fold).record
    }

    fn five(hits: i32, left_m: f64, along_m: f64, class: SignClass) -> Vec<EvidenceRow> {
        (1..=5)
            .map(|v| row(v, hits, left_m, along_m, class))
            .collect()
    }

    #[test]
    fn each_claim_by_five_clear_passes() {
        let own = SignClass::LeftArrow;
        let no_change = judged(&five(8, 0.05, 0.2, own));
        assert_eq!(no_change.verdict, Verdict::NoChange.code());
        assert!(no_change.p_no_change > 0.99);
        let removed = judged(&five(0, 0.0, 0.0, own));
        assert_eq!(removed.verdict, Verdict::Removed.code());
        let retyped = judged(&five(8, 0.0, 0.0, SignClass::RightArrow));
        assert_eq!(retyped.verdict, Verdict::Modified.code());
        assert_eq!(retyped.class_observed, Some(SignClass::RightArrow.code()));
        assert_eq!(
            (retyped.shift_m, retyped.geometry_new.is_some()),
            (None, true)
        );
        let shifted = judged(&five(8, 1.0, 0.0, own));
        assert_eq!(shifted.verdict, Verdict::Modified.code());
        assert!((shifted.shift_m.unwrap() - 1.0).abs() < 0.15, "{shifted:?}");
        assert!(shifted.geometry_new != shifted.geometry_old);
    }

    #[test]
    fn half_a_metre_along_the_way_is_no_shift() {
        let found = judged(&five(8, 0.0, 0.5, SignClass::LeftArrow));
        assert_eq!(found.verdict, Verdict::NoChange.code());
    }

    #[test]
    fn hidden_passes_do_not_remove_what_others_see() {
        let mut rows = five(8, 0.0, 0.0, SignClass::LeftArrow);
        rows.extend((6..9).map(|v| row(v, 0, 0.0, 0.0, SignClass::Unknown)));
        assert!(judged(&rows).p_removed < 0.01);
    }

    #[test]
    fn the_order_of_rows_does_not_matter() {
        let mut rows = five(6, 0.4, -0.3, SignClass::LeftArrow);
        rows.extend((6..10).map(|v| row(v, v as i32 % 3, 0.1, 0.9, SignClass::RightArrow)));
        let forward = judged(&rows);
        rows.reverse();
        assert_eq!(judged(&rows), forward);
        rows.rotate_left(3);
        assert_eq!(judged(&rows), forward);
    }

    #[test]
    fn nobody_looked_is_unknown() {
        assert_eq!(judged(&[]).verdict, Verdict::Unknown.code());
    }

    #[test]
    fn chances_of_a_pass_sum_to_one() {
        let total: f64 = (0..=3)
            .map(|hits| {
                let ways = [1.0, 3.0, 3.0, 1.0][hits];
                ways * beta_binomial(hits as f64, 3.0, MATCHED)
            })
            .sum();
        assert!((total - 1.0).abs() < 1e-9, "{total}");
    }
}
