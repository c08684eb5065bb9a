//! A job from plan to commit: what the command line and the wheel both call.
//!
//! [`init()`] makes a store from a base map, [`run()`] brings new logs in, [`retract()`] takes them
//! out, [`rebase()`] lays a new map under them, [`evaluate()`] scores the result. The engine owns memory, threads and progress; what is true is said by the map
//! stage and the reduce stage, and kept by the store.

mod accepted;
mod at_hand;
mod base_map;
pub mod calibrate;
pub mod cluster;
pub mod compare;
pub mod detect;
pub mod drives;
pub mod error;
pub mod evaluate;
pub mod explain;
pub mod export;
pub mod frames;
pub mod init;
pub mod inspect;
pub mod logs;
pub mod map_job;
pub mod meter;
pub mod notes;
pub mod perceive;
mod picture;
pub mod progress;
pub mod rebase;
pub mod reduce_job;
pub mod retract;
pub mod run;
mod same_place;
pub mod scope;
mod split;
mod succession;
pub mod throughput;
mod update;
pub mod verify;
mod within;

pub use accepted::Accepted;
pub use calibrate::{Calibration, calibrate};
pub use error::EngineError;
pub use evaluate::{Criteria, Evaluation, evaluate};
pub use explain::{Explainer, Explanation, explain};
pub use init::{InitOptions, InitReport, init};
pub use meter::{Meter, Stage, StageReport};
pub use perceive::Perception;
pub use progress::{Progress, Silent};
pub use rebase::{RebaseReport, rebase};
pub use retract::{Forget, RetractReport, retract};
pub use run::{Plan, RunOptions, RunReport, plan, run, run_seeing};
pub use tilefold_onnx::{Device, OnnxError};
pub use tilefold_reducers::FusionModel;
pub use tilefold_reducers::regions::regions;
pub use tilefold_workers::Registering;
pub use verify::{Verification, verify};
pub use within::{Limit, run_within};
