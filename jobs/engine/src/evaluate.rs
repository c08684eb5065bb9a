//! `evaluate`: claimed changes against known ones (method.md, section 11).
//!
//! [`Refold`] gives the change records of a version under either fusion model, of the fleet or of
//! one vehicle alone. `claim` says which of them claim anything, `known` which places of a true
//! change a claim covers, and `pair` what is counted as found and what as wrong. `change` makes
//! scores of the counts, with intervals that `bootstrap` takes over the `place`s; `calibration`,
//! `geometry` and `outcome` say how good the probabilities and the lines are, and name every
//! failure. [`plots`] and [`overview`] draw it. [`matching()`] is apart: it needs the logs.

mod bootstrap;
mod calibration;
mod change;
mod claim;
mod coverage;
mod geometry;
mod known;
mod matching;
mod outcome;
pub mod overview;
mod pair;
mod place;
pub mod plots;
mod refold;
mod score;
mod single;
#[cfg(test)]
mod tests;

use std::collections::BTreeSet;

use serde::Serialize;
use tilefold_formats::geojson::TruthChange;
use tilefold_reducers::FusionModel;
use tilefold_schemas::{ChangeRecord, wkb};

use crate::error::EngineError;

pub use calibration::{BINS, Bin, Calibration, Control};
pub use change::{ChangeScores, Metres, SWEEP, SweepPoint, TypeScores};
pub use claim::Criteria;
pub use geometry::GeometryErrors;
pub use matching::{Drives, Matching, matching};
pub use outcome::Outcome;
pub use refold::Refold;
pub use score::{Found, Interval, Score};
pub use single::SingleVehicle;

use bootstrap::{RESAMPLES, Resamples};
use change::Network;
use known::Known;
use pair::Laid;
use place::{Grid, Place};

/// How an evaluation is made.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Options {
    /// What counts as a claim.
    pub criteria: Criteria,
    /// Side of the places that are resampled for intervals, metres.
    pub place_m: f64,
    /// Vehicles that are also judged alone; 0 for none.
    pub single_vehicles: usize,
    /// Seed of the resampling and of the sample of vehicles.
    pub seed: u64,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            criteria: Criteria::default(),
            place_m: 500.0,
            single_vehicles: 20,
            seed: 1,
        }
    }
}

/// A road network that is evaluated: its evidence and its true changes.
#[derive(Debug, Clone, Copy)]
pub struct Subject<'a> {
    /// Layers and evidence of a version.
    pub refold: &'a Refold,
    /// What really changed.
    pub truth: &'a [TruthChange],
}

/// How intervals were made.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Resampling {
    /// Side of the places, metres.
    pub place_m: f64,
    /// Places.
    pub places: usize,
    /// Resamples.
    pub resamples: usize,
    /// Seed.
    pub seed: u64,
}

/// What one fusion model achieves.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Findings {
    /// Change detection.
    pub change: ChangeScores,
    /// Change detection among the changes that as many vehicles looked at as a claim takes: of the
    /// others nothing can be claimed, however good the fold.
    pub looked_at: ChangeScores,
    /// Calibration of P(change).
    pub calibration: Calibration,
    /// Geometry.
    pub geometry: GeometryErrors,
    /// Unchanged elements.
    pub control: Control,
    /// Single vehicles; null where none were asked for.
    pub single_vehicle: Option<SingleVehicle>,
}

/// The other fusion model on the same evidence.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct OtherModel {
    /// Its name.
    pub fusion_model: &'static str,
    /// What it achieves.
    #[serde(flatten)]
    pub findings: Findings,
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
    /// What it achieves.
    #[serde(flatten)]
    pub findings: Findings,
    /// Matching against truth ids, as [`matching()`] gives it; null where there are none.
    pub matching: Option<Matching>,
    /// The other fusion model.
    pub other_model: OtherModel,
    /// How intervals were made.
    pub resampling: Resampling,
    /// Every claim and every missed change.
    pub outcomes: Vec<Outcome>,
}

/// Scores road networks together, under `model` and under the other one.
///
/// # Errors
/// Evidence cannot be folded.
pub fn evaluate(
    subjects: &[Subject<'_>],
    model: FusionModel,
    options: &Options,
) -> Result<Evaluation, EngineError> {
    let other = match model {
        FusionModel::Paper => FusionModel::Calibrated,
        FusionModel::Calibrated => FusionModel::Paper,
    };
    let all_known: Vec<Vec<Known<'_>>> = subjects
        .iter()
        .map(|subject| subject.truth.iter().map(Known::new).collect())
        .collect();
    let trial = Trial {
        subjects,
        all_known: &all_known,
        options,
    };
    let (findings, resampling, outcomes) = trial.judge(model)?;
    let (others, _, _) = trial.judge(other)?;
    Ok(Evaluation {
        fusion_model: model.name(),
        threshold: options.criteria.threshold,
        min_vehicles: options.criteria.min_vehicles,
        findings,
        matching: None,
        other_model: OtherModel {
            fusion_model: other.name(),
            findings: others,
        },
        resampling,
        outcomes,
    })
}

/// Networks with their truth.
struct Trial<'a> {
    subjects: &'a [Subject<'a>],
    all_known: &'a [Vec<Known<'a>>],
    options: &'a Options,
}

impl Trial<'_> {
    fn grid(&self, network: usize) -> Grid {
        Grid {
            network,
            side_m: self.options.place_m,
        }
    }

    fn judge(
        &self,
        model: FusionModel,
    ) -> Result<(Findings, Resampling, Vec<Outcome>), EngineError> {
        let criteria = self.options.criteria;
        let folded = self
            .subjects
            .iter()
            .map(|subject| subject.refold.of_fleet(model));
        let records: Vec<Vec<ChangeRecord>> = folded.collect::<Result<_, _>>()?;
        let networks: Vec<Network<'_>> = (records.iter().zip(self.all_known).enumerate())
            .map(|(index, (records, known))| Network {
                grid: self.grid(index),
                known,
                in_view: vec![true; known.len()],
                laid: Laid::new(records, known, above_sweep(criteria)),
            })
            .collect();
        let places = change::places(&networks, &self.looked_at(&records));
        let resamples = Resamples::draw(&places, self.options.seed);
        let judged: Vec<calibration::Judged> = (records.iter().zip(self.subjects))
            .flat_map(|(records, subject)| calibration::judged(records, subject.truth, criteria))
            .collect();
        let looked_at: Vec<Network<'_>> = (records.iter().enumerate())
            .map(|(index, records)| Network {
                grid: self.grid(index),
                known: &self.all_known[index],
                in_view: self.looked_at_by_enough(index),
                laid: Laid::new(records, &self.all_known[index], above_sweep(criteria)),
            })
            .collect();
        let findings = Findings {
            change: change::score(&networks, criteria.threshold, &resamples),
            looked_at: change::score(&looked_at, criteria.threshold, &resamples),
            calibration: calibration::calibration(&judged),
            geometry: geometry::geometry(&networks, criteria.threshold),
            control: calibration::control(&judged),
            single_vehicle: self.single_vehicle(model, &resamples),
        };
        let resampling = Resampling {
            place_m: self.options.place_m,
            places: places.len(),
            resamples: RESAMPLES,
            seed: self.options.seed,
        };
        let outcomes = (networks.iter().zip(&records))
            .flat_map(|(network, records)| outcome::outcomes(network, criteria.threshold, records))
            .collect();
        Ok((findings, resampling, outcomes))
    }

    /// Which changes of a subject at least as many vehicles looked at as a claim takes.
    fn looked_at_by_enough(&self, index: usize) -> Vec<bool> {
        let known = &self.all_known[index];
        let mut vehicles = vec![0; known.len()];
        let refold = self.subjects[index].refold;
        for vehicle in refold.vehicles() {
            let looks = refold.looks_of(vehicle);
            for (count, known) in vehicles.iter_mut().zip(known) {
                *count += i32::from(single::is_in_view(known, &looks));
            }
        }
        let enough = self.options.criteria.min_vehicles;
        vehicles.into_iter().map(|count| count >= enough).collect()
    }

    /// Places with an element or a candidate.
    fn looked_at(&self, records: &[Vec<ChangeRecord>]) -> BTreeSet<Place> {
        let mut places = BTreeSet::new();
        for (index, records) in records.iter().enumerate() {
            let grid = self.grid(index);
            for record in records {
                let bytes = record
                    .geometry_old
                    .as_ref()
                    .or(record.geometry_new.as_ref());
                let geometry = bytes.and_then(|bytes| wkb::read(bytes).ok());
                places.extend(geometry.map(|geometry| grid.of_points(&geometry.points)));
            }
        }
        places
    }

    fn single_vehicle(&self, model: FusionModel, resamples: &Resamples) -> Option<SingleVehicle> {
        if self.options.single_vehicles == 0 {
            return None;
        }
        let criteria = Criteria {
            min_vehicles: 1,
            ..self.options.criteria
        };
        let mut alone = Vec::new();
        for (index, subject) in self.subjects.iter().enumerate() {
            let vehicles = single::sample(
                subject.refold.vehicles(),
                self.options.single_vehicles,
                self.options.seed,
            );
            for vehicle in vehicles {
                let looks = subject.refold.looks_of(vehicle);
                let known = self.all_known[index].iter();
                let in_view: Vec<bool> = known
                    .map(|known| single::is_in_view(known, &looks))
                    .collect();
                alone.push((index, in_view, subject.refold.of_one(model, vehicle)));
            }
        }
        let networks: Vec<Network<'_>> = alone
            .iter()
            .map(|(index, in_view, records)| Network {
                grid: self.grid(*index),
                known: &self.all_known[*index],
                in_view: in_view.clone(),
                laid: Laid::new(records, &self.all_known[*index], above_sweep(criteria)),
            })
            .collect();
        Some(SingleVehicle {
            vehicles: alone.len(),
            change: change::score(&networks, criteria.threshold, resamples),
        })
    }
}

/// The criteria under which everything counts that any threshold of the sweep lets through.
fn above_sweep(criteria: Criteria) -> Criteria {
    let least = SWEEP.into_iter().fold(criteria.threshold, f64::min);
    Criteria {
        threshold: least,
        ..criteria
    }
}
