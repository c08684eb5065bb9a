//! Verdicts that are too old to be held: the road goes on changing after the last look.
//!
//! Two in a hundred elements change in a month. Eight months after the last look, what was
//! certain then is no likelier than 0.85 to hold still: such a verdict is `stale`, whatever it said,
//! and its posterior is that of the last look.

use tilefold_schemas::{ChangeRecord, Verdict};

/// Churn: elements change at this rate in a month of 30 days.
const CHURN_A_MONTH: f64 = 0.02;
/// A verdict must be at least this likely to hold still.
const LEAST_HELD: f64 = 0.85;
const MONTH_NS: f64 = 30.0 * 86_400e9;

/// How long after the last look a verdict is held, in nanoseconds.
#[must_use]
pub fn horizon_ns() -> i64 {
    (-libm::log(LEAST_HELD) / CHURN_A_MONTH * MONTH_NS) as i64
}

/// Calls verdicts stale that nobody looked at for too long before a time, nanoseconds since the Unix
/// epoch. What is unknown stays so.
pub fn mark(records: &mut [ChangeRecord], as_of_ns: i64) {
    let horizon_ns = horizon_ns();
    for record in records {
        let is_called = record.verdict != Verdict::Unknown.code();
        if is_called && as_of_ns.saturating_sub(record.last_ns) > horizon_ns {
            record.verdict = Verdict::Stale.code();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_verdict_is_held_for_eight_months() {
        let days = horizon_ns() / 86_400_000_000_000;
        // ln(1 / 0.85) / 0.02 = 8.13 months of 30 days.
        assert_eq!(days, 243);
    }
}
