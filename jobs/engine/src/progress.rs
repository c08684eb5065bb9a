//! How a job tells what it is doing, without knowing to whom.

use crate::meter::{Meter, Stage};

/// Listens to a job's progress. Calls come from any thread.
pub trait Progress: Sync {
    /// A stage begins and has `total` items to do.
    fn begin(&self, stage: Stage, total: u64);
    /// `done` more items of the stage are done; `set_aside` things were set aside meanwhile.
    fn advance(&self, stage: Stage, done: u64, set_aside: u64);
    /// The stage is over.
    fn end(&self, stage: Stage);
    /// What all stages did so far; told now and then while the longest of them goes on.
    fn measured(&self, _: &Meter) {}
}

/// Nobody listens.
#[derive(Debug, Clone, Copy, Default)]
pub struct Silent;

impl Progress for Silent {
    fn begin(&self, _: Stage, _: u64) {}
    fn advance(&self, _: Stage, _: u64, _: u64) {}
    fn end(&self, _: Stage) {}
}
