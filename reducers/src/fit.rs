//! Fitting the sensor model to a ledger (method.md, section 9: fleet calibration).
//!
//! Most paint has not changed, and the fold knows rather well what has: so every section is judged
//! with the model at hand, each pass is a sample of "there" or "gone" as far as its section is
//! believed to be so, and the model is fitted to the samples; and again with the new model.
//! Expectation and maximisation, a few rounds of it. Where samples are few the built-in values
//! hold: every estimate is pulled towards them by as much as a few passes would.
//!
//! Estimates are sums and medians in the order of the elements, so a fit is a function of the
//! ledger.

use std::collections::BTreeMap;

use tilefold_schemas::{ElementKind, EvidenceRow};
use tilefold_tiler::map_index::MappedElement;

use crate::calibrated::{level_share, looks};
use crate::elements;
use crate::lines;
use crate::markings;
use crate::passes::Pass;
use crate::sensor::{ByVisibility, SensorModel, VehicleModel, beta_binomial};
use crate::space::{Claim, LEVELS, State};

/// Rounds of judging and fitting.
const ROUNDS: usize = 3;
/// Borders of the bins of visibility.
const BINS: [f64; 7] = [0.05, 0.2, 0.35, 0.5, 0.7, 0.9, 1.0];
/// The built-in value counts as so many passes, or elements.
const PRIOR_PASSES: f64 = 30.0;
const PRIOR_ELEMENTS: f64 = 8.0;
const PRIOR_LINES: f64 = 100.0;
/// A vehicle is like its fleet, with the weight of so many passes.
const PRIOR_OF_VEHICLE: f64 = 15.0;
/// A pass with fewer frames, or fewer matches, says too little to be a sample.
const LEAST_FRAMES: i64 = 4;
const LEAST_HITS: i64 = 3;
/// An element has a place if so many vehicles measured it.
const LEAST_VEHICLES: usize = 3;
/// An element counts as unchanged, or a section as gone, from here.
const SURE: f64 = 0.8;
/// Median absolute deviation of a normal distribution, as a share of its standard deviation.
const MAD: f64 = 0.6745;
/// Spreads of places are taken at flanks, since it is the ill placed that look like changes: at the
/// share of values that lie nearer, and where that is in standard deviations. Not far out for lines,
/// of which some are changes; far out for vehicles, of which some are badly placed.
const FLANK_OF_LINES: (f64, f64) = (0.75, 1.150);
const FLANK_OF_VEHICLES: (f64, f64) = (0.9, 1.645);
/// A residual this many standard deviations off is of another line.
const STRAY_SIGMAS: f64 = 4.0;
/// Bounds of what is fitted.
const CONCENTRATIONS: (f64, f64) = (0.3, 30.0);
const SIGMAS_M: (f64, f64) = (0.02, 1.0);
const OUTLIERS: (f64, f64) = (0.02, 0.3);
const CHURN: (f64, f64) = (0.003, 0.1);

/// One pass over one section, with what the section is believed to be.
struct Sample {
    vehicle: i64,
    visibility: f64,
    hits: f64,
    misses: f64,
    /// P(there), and what its level is expected to do to the rate of matches.
    there: f64,
    level: f64,
    /// P(gone).
    gone: f64,
    /// Off the place that the line is believed to have, in metres.
    residual_m: Option<f64>,
}

/// What a ledger says, believed as a model has it.
#[derive(Default)]
struct Samples {
    passes: Vec<Sample>,
    /// Of every unchanged element: the visibility it is matched from, its place, its vehicles.
    places: Vec<(f64, f64, usize)>,
    /// What vehicles are off the place of such an element, in metres.
    biases_m: Vec<f64>,
    /// P(moved) of every line that was looked at.
    shifted: Vec<f64>,
    /// Of every line that is there: how likely it is of which level.
    levels: Vec<[f64; LEVELS.len()]>,
    /// Readings that agree with the map, and all, of unchanged elements.
    read: (f64, f64),
}

/// A sensor model fitted to the ledger rows of elements, in the order of the elements.
#[must_use]
pub fn fit(elements: &[(&MappedElement, Vec<&EvidenceRow>)]) -> SensorModel {
    let lines: Vec<(&MappedElement, Vec<Vec<Pass>>)> = elements
        .iter()
        .filter(|(mapped, _)| mapped.element.kind == ElementKind::LaneMarking)
        .map(|(mapped, rows)| (*mapped, elements::by_section(rows, mapped)))
        .collect();
    let mut model = SensorModel::default();
    for _ in 0..ROUNDS {
        let mut samples = Samples::default();
        for (mapped, sections) in &lines {
            samples.add(mapped, sections, &model);
        }
        model = samples.model();
    }
    model
}

impl Samples {
    fn add(&mut self, mapped: &MappedElement, sections: &[Vec<Pass>], sensor: &SensorModel) {
        let space = lines::space(sections, sensor);
        let line = lines::judge(sections, sensor);
        let mut residuals: BTreeMap<i64, Vec<f64>> = BTreeMap::new();
        let mut levels = [0.0; LEVELS.len()];
        let mut shifted = 0.0;
        for (passes, states_p) in line.passes.iter().zip(&line.states) {
            let believed = Believed::new(states_p, &space.states);
            if !passes.is_empty() {
                for (sum, p) in levels.iter_mut().zip(believed.levels) {
                    *sum += p;
                }
                shifted += 1.0 - believed.gone - believed.in_place;
            }
            let place_m = median_of(passes.iter().filter_map(measured));
            for pass in passes.iter().filter(|pass| pass.exposed >= LEAST_FRAMES) {
                let visibility = pass.visibility().clamp(0.0, 1.0);
                let (hits, misses) = looks(pass);
                let off = |residual_m: f64| place_m.map(|place_m| residual_m - place_m);
                self.passes.push(Sample {
                    vehicle: pass.vehicle,
                    visibility,
                    hits,
                    misses,
                    there: 1.0 - believed.gone,
                    level: believed.level(visibility),
                    gone: believed.gone,
                    residual_m: measured(pass).and_then(off),
                });
                if believed.in_place >= SURE {
                    let of_vehicle = residuals.entry(pass.vehicle).or_default();
                    of_vehicle.extend(measured(pass));
                }
            }
        }
        let looked_at = line
            .passes
            .iter()
            .filter(|passes| !passes.is_empty())
            .count();
        if looked_at > 0 {
            self.levels.push(levels.map(|sum| sum / looked_at as f64));
            self.shifted.push(shifted / looked_at as f64);
        }
        let of_vehicles: Vec<f64> = residuals
            .into_values()
            .filter_map(|residuals| median_of(residuals.into_iter()))
            .collect();
        if of_vehicles.len() >= LEAST_VEHICLES {
            let from = lines::matched_from(&line.passes);
            if let Some(place_m) = median_of(of_vehicles.iter().copied()) {
                self.places.push((from, place_m, of_vehicles.len()));
                let biases = of_vehicles.iter().map(|bias_m| bias_m - place_m);
                self.biases_m.extend(biases);
            }
            let (same, all) = markings::agreement(mapped.element.marking, &line.passes);
            self.read.0 += same;
            self.read.1 += all;
        }
    }

    fn model(&self) -> SensorModel {
        let built_in = SensorModel::default();
        let present = self.present(&built_in);
        let pass_sigma_m = self.pass_sigma_m(&built_in);
        let there = |sample: &Sample| {
            let share = sample.level * present.at(sample.visibility);
            (sample.there, share.clamp(0.02, 0.98))
        };
        let absent = self.absent(built_in.absent);
        let gone = |sample: &Sample| (sample.gone, absent);
        let stray = self.stray(&pass_sigma_m);
        let vehicle_sigma_m = self.vehicle_sigma_m(built_in.vehicle_sigma_m);
        let (same, all) = self.read;
        let mut model = SensorModel {
            present_concentration: self.concentration(there, built_in.present_concentration),
            absent,
            absent_concentration: self.concentration(gone, built_in.absent_concentration),
            place_sigma_m: self.place_sigma_m(&built_in, vehicle_sigma_m),
            vehicle_sigma_m,
            // Not fitted: paint that is gone and paint that this fleet cannot see look alike, and a
            // fit would talk itself into one of them.
            removed: built_in.removed,
            shifted: self.shifted(built_in.shifted),
            levels: self.levels(&built_in),
            residual_outliers: stray.clamp(OUTLIERS.0, OUTLIERS.1),
            marking_read: (same + PRIOR_PASSES * built_in.marking_read) / (all + PRIOR_PASSES),
            present,
            pass_sigma_m,
            vehicles: BTreeMap::new(),
        };
        model.vehicles = self.vehicles(&model);
        model
    }

    fn bins<'a, T>(
        samples: &'a [T],
        visibility: impl Fn(&T) -> f64 + Copy + 'a,
    ) -> impl Iterator<Item = (f64, Vec<&'a T>)> {
        BINS.windows(2).map(move |border| {
            let last = border[1] >= 1.0;
            let within = |sample: &&T| {
                let at = visibility(sample);
                border[0] <= at && (at < border[1] || last)
            };
            let of: Vec<&T> = samples.iter().filter(within).collect();
            (0.5 * (border[0] + border[1]), of)
        })
    }

    fn present(&self, built_in: &SensorModel) -> ByVisibility {
        let bins = Self::bins(&self.passes, |sample| sample.visibility);
        let rate = |(middle, samples): (f64, Vec<&Sample>)| {
            let (mut seen, mut shown) = (0.0, 0.0);
            for sample in samples {
                // A pass is one draw of the rate, however many frames it has.
                let frames = sample.hits + sample.misses;
                seen += sample.there * sample.hits / frames;
                shown += sample.there * sample.level;
            }
            let rate = (seen + PRIOR_PASSES * built_in.present.at(middle)) / (shown + PRIOR_PASSES);
            [middle, rate.clamp(0.05, 0.97)]
        };
        ByVisibility(bins.map(rate).collect())
    }

    fn absent(&self, built_in: f64) -> f64 {
        let (mut seen, mut all) = (0.0, 0.0);
        for sample in self.passes.iter().filter(|sample| sample.gone >= SURE) {
            seen += sample.gone * sample.hits / (sample.hits + sample.misses);
            all += sample.gone;
        }
        (seen + PRIOR_PASSES * built_in) / (all + PRIOR_PASSES)
    }

    /// The likeliest concentration of a Beta-binomial whose mean is given for each sample, with a
    /// weight.
    fn concentration(&self, of: impl Fn(&Sample) -> (f64, f64), built_in: f64) -> f64 {
        let nats = |log_concentration: f64| -> f64 {
            let off = log_concentration - libm::log(built_in);
            let samples = self.passes.iter().map(|sample| {
                let (weight, mean) = of(sample);
                if weight < 0.1 {
                    return 0.0;
                }
                let concentration = libm::exp(log_concentration);
                weight * beta_binomial(sample.hits, sample.misses, mean, concentration)
            });
            samples.sum::<f64>() - 0.5 * off * off
        };
        let bounds = (libm::log(CONCENTRATIONS.0), libm::log(CONCENTRATIONS.1));
        libm::exp(maximum(nats, bounds))
    }

    fn pass_sigma_m(&self, built_in: &SensorModel) -> ByVisibility {
        let bins = Self::bins(&self.passes, |sample| sample.visibility);
        let sigma = |(middle, samples): (f64, Vec<&Sample>)| {
            let sure = samples.into_iter().filter(|sample| sample.there >= SURE);
            let off: Vec<f64> = sure
                .filter_map(|sample| sample.residual_m)
                .map(f64::abs)
                .collect();
            let (count, prior) = (off.len() as f64, built_in.pass_sigma_m.at(middle));
            let found = median_of(off.into_iter()).unwrap_or(0.0) / MAD;
            let squares = count * found * found + PRIOR_PASSES * prior * prior;
            let sigma_m = (squares / (count + PRIOR_PASSES)).sqrt();
            [middle, sigma_m.clamp(SIGMAS_M.0, SIGMAS_M.1)]
        };
        ByVisibility(bins.map(sigma).collect())
    }

    fn place_sigma_m(&self, built_in: &SensorModel, vehicle_sigma_m: f64) -> ByVisibility {
        let bins = Self::bins(&self.places, |(from, _, _)| *from);
        let sigma = |(middle, places): (f64, Vec<&(f64, f64, usize)>)| {
            let (count, prior) = (places.len() as f64, built_in.place_sigma_m.at(middle));
            let off = places.iter().map(|(_, place_m, _)| place_m.abs());
            let found = quantile_of(off, FLANK_OF_LINES.0).unwrap_or(0.0) / FLANK_OF_LINES.1;
            // What vehicles scatter is not the map's.
            let scatter = places
                .iter()
                .map(|(_, _, vehicles)| vehicle_sigma_m.powi(2) / *vehicles as f64);
            let scatter = scatter.sum::<f64>() / count.max(1.0);
            let variance = (found * found - scatter).max(0.0);
            let squares = count * variance + PRIOR_ELEMENTS * prior * prior;
            let sigma_m = (squares / (count + PRIOR_ELEMENTS)).sqrt();
            [middle, sigma_m.clamp(SIGMAS_M.0, SIGMAS_M.1)]
        };
        ByVisibility(bins.map(sigma).collect())
    }

    fn vehicle_sigma_m(&self, built_in: f64) -> f64 {
        let count = self.biases_m.len() as f64;
        let off = self.biases_m.iter().map(|bias_m| bias_m.abs());
        let (share, sigmas) = FLANK_OF_VEHICLES;
        let found = quantile_of(off, share).unwrap_or(0.0) / sigmas;
        let squares = count * found * found + PRIOR_PASSES * built_in * built_in;
        (squares / (count + PRIOR_PASSES)).sqrt()
    }

    /// Share of lines that were moved.
    fn shifted(&self, built_in: f64) -> f64 {
        let (sum, count) = (self.shifted.iter().sum::<f64>(), self.shifted.len() as f64);
        ((sum + PRIOR_LINES * built_in) / (count + PRIOR_LINES)).clamp(CHURN.0, CHURN.1)
    }

    fn levels(&self, built_in: &SensorModel) -> [f64; LEVELS.len()] {
        let mut sums = built_in.levels.map(|share| share * PRIOR_PASSES);
        for line in &self.levels {
            for (sum, p) in sums.iter_mut().zip(line) {
                *sum += p;
            }
        }
        let total: f64 = sums.iter().sum();
        sums.map(|sum| sum / total)
    }

    fn stray(&self, pass_sigma_m: &ByVisibility) -> f64 {
        let sure = self.passes.iter().filter(|sample| sample.there >= SURE);
        let (mut stray, mut all) = (0.0, 0.0);
        for sample in sure {
            if let Some(residual_m) = sample.residual_m {
                let far = residual_m.abs() > STRAY_SIGMAS * pass_sigma_m.at(sample.visibility);
                stray += f64::from(u8::from(far));
                all += 1.0;
            }
        }
        (stray + PRIOR_PASSES * 0.1) / (all + PRIOR_PASSES)
    }

    fn vehicles(&self, fleet: &SensorModel) -> BTreeMap<i64, VehicleModel> {
        let mut by_vehicle: BTreeMap<i64, Vec<&Sample>> = BTreeMap::new();
        for sample in &self.passes {
            by_vehicle.entry(sample.vehicle).or_default().push(sample);
        }
        by_vehicle
            .into_iter()
            .map(|(key, samples)| (key, of_vehicle(&samples, fleet)))
            .collect()
    }
}

fn of_vehicle(samples: &[&Sample], fleet: &SensorModel) -> VehicleModel {
    let (mut seen, mut expected, mut ghosts, mut gone) = (0.0, 0.0, 0.0, 0.0);
    let mut off: Vec<f64> = Vec::new();
    for sample in samples {
        let share = sample.hits / (sample.hits + sample.misses);
        let rate = sample.level * fleet.present.at(sample.visibility);
        seen += sample.there * share;
        expected += sample.there * rate;
        if sample.gone >= SURE {
            ghosts += share;
            gone += 1.0;
        }
        if let Some(residual_m) = sample.residual_m.filter(|_| sample.there >= SURE) {
            off.push(residual_m.abs() / fleet.pass_sigma_m.at(sample.visibility));
        }
    }
    let prior = PRIOR_OF_VEHICLE;
    let count = off.len() as f64;
    let found = median_of(off.into_iter()).unwrap_or(0.0) / MAD;
    VehicleModel {
        detection: ((seen + prior) / (expected + prior)).clamp(0.05, 1.3),
        absent: (ghosts + prior * fleet.absent) / (gone + prior),
        sigma: ((count * found * found + prior) / (count + prior))
            .sqrt()
            .clamp(0.5, 10.0),
    }
}

/// What a section is believed to be.
struct Believed {
    in_place: f64,
    gone: f64,
    levels: [f64; LEVELS.len()],
}

impl Believed {
    fn new(states_p: &[f64], states: &[State]) -> Self {
        let mut believed = Self {
            in_place: 0.0,
            gone: 0.0,
            levels: Default::default(),
        };
        for (p, state) in states_p.iter().zip(states) {
            match state.level {
                None => believed.gone += p,
                Some(level) => believed.levels[level] += p,
            }
            if state.claim == Claim::InPlace {
                believed.in_place += p;
            }
        }
        believed
    }

    /// What the level is expected to do to the rate of matches, given that the line is there.
    fn level(&self, visibility: f64) -> f64 {
        let there: f64 = self.levels.iter().sum::<f64>().max(f64::MIN_POSITIVE);
        let of = self.levels.iter().enumerate();
        of.map(|(level, p)| p * level_share(level, visibility))
            .sum::<f64>()
            / there
    }
}

/// The residual of a pass that matched often enough to have one.
fn measured(pass: &Pass) -> Option<f64> {
    pass.residual_m().filter(|_| pass.hit >= LEAST_HITS)
}

fn median_of(values: impl Iterator<Item = f64>) -> Option<f64> {
    quantile_of(values, 0.5)
}

fn quantile_of(values: impl Iterator<Item = f64>, share: f64) -> Option<f64> {
    let mut values: Vec<f64> = values.collect();
    let at = (values.len() as f64 * share) as usize;
    if at >= values.len() {
        return None;
    }
    let (_, quantile, _) = values.select_nth_unstable_by(at, f64::total_cmp);
    Some(*quantile)
}

/// Where a function of one hill is highest, by golden section.
fn maximum(of: impl Fn(f64) -> f64, (mut low, mut high): (f64, f64)) -> f64 {
    const GOLDEN: f64 = 0.618_033_988_749_894_9;
    for _ in 0..24 {
        let (left, right) = (high - GOLDEN * (high - low), low + GOLDEN * (high - low));
        match of(left) >= of(right) {
            true => high = right,
            false => low = left,
        }
    }
    0.5 * (low + high)
}
