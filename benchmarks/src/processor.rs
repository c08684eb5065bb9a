//! Processor time of the calling thread: what a piece of work costs on a machine that does other work
//! as well.

use std::fs;
use std::time::{Duration, Instant};

/// A point in time, by the thread's processor time; by the clock where the system does not tell it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Moment {
    on_processor: Option<Duration>,
    by_clock: Instant,
}

impl Moment {
    /// Now.
    pub(crate) fn now() -> Self {
        Self {
            on_processor: on_processor(),
            by_clock: Instant::now(),
        }
    }

    /// Seconds since then, on the same thread.
    pub(crate) fn elapsed_s(self) -> f64 {
        let both = on_processor().zip(self.on_processor);
        let on_processor = both.map(|(now, then)| now.saturating_sub(then));
        on_processor
            .unwrap_or_else(|| self.by_clock.elapsed())
            .as_secs_f64()
    }
}

fn on_processor() -> Option<Duration> {
    let text = fs::read_to_string("/proc/thread-self/schedstat").ok()?;
    let nanos = text.split_whitespace().next()?.parse().ok()?;
    Some(Duration::from_nanos(nanos))
}
