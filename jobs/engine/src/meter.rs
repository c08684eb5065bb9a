//! What each stage of a job did and how long it was busy: for progress, reports and benchmarks.
//!
//! Counters are atomics that any worker may add to. Times are for people; they enter no result.

use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

use serde::{Deserialize, Serialize};

/// The stages of a job, in the order of the data.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Stage {
    /// Reading the summaries of logs.
    Index,
    /// Reading and decoding the messages that are wanted.
    Read,
    /// Decoding pictures.
    Decode,
    /// Looking at pictures: bringing them to size, inference, reading the network's answer.
    Detect,
    /// The map stage: poses, registration, matching, testimony.
    Map,
    /// Writing evidence.
    Exchange,
    /// The reduce stage: fold, judge, candidates.
    Reduce,
    /// Writing layers.
    Commit,
}

impl Stage {
    /// All stages in order.
    pub const ALL: [Self; 8] = [
        Self::Index,
        Self::Read,
        Self::Decode,
        Self::Detect,
        Self::Map,
        Self::Exchange,
        Self::Reduce,
        Self::Commit,
    ];

    /// The name as printed.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Index => "index",
            Self::Read => "read",
            Self::Decode => "decode",
            Self::Detect => "detect",
            Self::Map => "map",
            Self::Exchange => "exchange",
            Self::Reduce => "reduce",
            Self::Commit => "commit",
        }
    }

    /// What [`StageReport::items`] counts.
    #[must_use]
    pub fn unit(self) -> &'static str {
        match self {
            Self::Index => "logs",
            Self::Read => "messages",
            Self::Decode | Self::Detect => "pictures",
            Self::Map => "frames",
            Self::Exchange => "rows",
            Self::Reduce | Self::Commit => "tiles",
        }
    }
}

impl Stage {
    /// What progress counts: the steps between which a stage tells how far it is.
    #[must_use]
    pub fn step(self) -> &'static str {
        match self {
            Self::Map => "units",
            Self::Exchange => "tables",
            other => other.unit(),
        }
    }
}

#[derive(Debug, Default)]
struct Counters {
    items: AtomicU64,
    bytes: AtomicU64,
    busy_nanos: AtomicU64,
}

/// Counters of all stages of one job.
#[derive(Debug)]
pub struct Meter {
    stages: [Counters; Stage::ALL.len()],
    started: Instant,
}

impl Default for Meter {
    fn default() -> Self {
        Self {
            stages: Default::default(),
            started: Instant::now(),
        }
    }
}

impl Meter {
    /// Runs `work`, counting its time as busy time of `stage` on this thread.
    pub fn time<T>(&self, stage: Stage, work: impl FnOnce() -> T) -> T {
        let started = Instant::now();
        let result = work();
        let nanos = u64::try_from(started.elapsed().as_nanos()).unwrap_or(u64::MAX);
        self.stages[stage as usize]
            .busy_nanos
            .fetch_add(nanos, Ordering::Relaxed);
        result
    }

    /// Counts `items` (and the bytes they took) of a stage as done.
    pub fn count(&self, stage: Stage, items: u64, bytes: u64) {
        let counters = &self.stages[stage as usize];
        counters.items.fetch_add(items, Ordering::Relaxed);
        counters.bytes.fetch_add(bytes, Ordering::Relaxed);
    }

    /// What was counted so far, in the order of [`Stage::ALL`].
    #[must_use]
    pub fn counts(&self) -> Vec<Count> {
        let read = |counters: &Counters| Count {
            items: counters.items.load(Ordering::Relaxed),
            bytes: counters.bytes.load(Ordering::Relaxed),
            busy_nanos: counters.busy_nanos.load(Ordering::Relaxed),
        };
        self.stages.iter().map(read).collect()
    }

    /// Adds what was counted elsewhere.
    pub fn add(&self, counts: &[Count]) {
        for (counters, count) in self.stages.iter().zip(counts) {
            counters.items.fetch_add(count.items, Ordering::Relaxed);
            counters.bytes.fetch_add(count.bytes, Ordering::Relaxed);
            let nanos = count.busy_nanos;
            counters.busy_nanos.fetch_add(nanos, Ordering::Relaxed);
        }
    }

    /// The figures so far; of stages that pictures alone go through, only where there were any.
    #[must_use]
    pub fn report(&self) -> Vec<StageReport> {
        Stage::ALL
            .iter()
            .filter(|&&stage| {
                let items = self.stages[stage as usize].items.load(Ordering::Relaxed);
                items > 0 || !matches!(stage, Stage::Decode | Stage::Detect)
            })
            .map(|&stage| {
                let counters = &self.stages[stage as usize];
                let items = counters.items.load(Ordering::Relaxed);
                let bytes = counters.bytes.load(Ordering::Relaxed);
                let busy_s = counters.busy_nanos.load(Ordering::Relaxed) as f64 * 1e-9;
                let per_busy_s = |amount: f64| if busy_s > 0.0 { amount / busy_s } else { 0.0 };
                StageReport {
                    stage: stage.name(),
                    unit: stage.unit(),
                    items,
                    bytes,
                    busy_s,
                    items_per_busy_s: per_busy_s(items as f64),
                    mb_per_busy_s: per_busy_s(bytes as f64 * 1e-6),
                }
            })
            .collect()
    }

    /// The stage that took most of the work so far, and its share of it; none before there was any.
    #[must_use]
    pub fn bottleneck(&self) -> Option<(Stage, f64)> {
        let busy = |stage: Stage| {
            let nanos = &self.stages[stage as usize].busy_nanos;
            nanos.load(Ordering::Relaxed)
        };
        let all: u64 = Stage::ALL.into_iter().map(busy).sum();
        let busiest = Stage::ALL.into_iter().max_by_key(|&stage| busy(stage))?;
        (all > 0).then(|| (busiest, busy(busiest) as f64 / all as f64))
    }

    /// Seconds since the job began.
    #[must_use]
    pub fn elapsed_s(&self) -> f64 {
        self.started.elapsed().as_secs_f64()
    }
}

/// What was counted of one stage, on its way from one machine to another.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Count {
    /// Items done.
    pub items: u64,
    /// Bytes read or written.
    pub bytes: u64,
    /// Nanoseconds of work, summed over threads.
    pub busy_nanos: u64,
}

/// What one stage did.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StageReport {
    /// Stage name.
    pub stage: &'static str,
    /// What `items` counts.
    pub unit: &'static str,
    /// Items done.
    pub items: u64,
    /// Bytes read or written.
    pub bytes: u64,
    /// Seconds of work, summed over threads.
    pub busy_s: f64,
    /// Items per busy second.
    pub items_per_busy_s: f64,
    /// Megabytes (10^6) per busy second.
    pub mb_per_busy_s: f64,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bottleneck_is_the_busiest_stage_with_its_share() {
        let meter = Meter::default();
        assert_eq!(meter.bottleneck(), None);
        let busy = |busy_nanos| Count {
            items: 1,
            bytes: 0,
            busy_nanos,
        };
        meter.add(&[busy(1), busy(2), busy(0), busy(0), busy(5)]);
        assert_eq!(meter.bottleneck(), Some((Stage::Map, 0.625)));
    }
}
