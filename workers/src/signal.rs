//! What a sensor said over time, and its mean over an interval: yaw rates, speeds.

/// Readings farther apart than this leave a gap, in nanoseconds.
const MAX_GAP_NS: i64 = 500_000_000;
/// With fewer readings in an interval, its mean is taken between readings.
const ENOUGH: usize = 3;

/// Readings in capture order, one a stamp.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Signal {
    readings: Vec<(i64, f64)>,
}

impl Signal {
    /// The finite ones of readings in capture order; of equal stamps the first stands.
    pub(crate) fn new(readings: impl Iterator<Item = (i64, f64)>) -> Self {
        let mut readings: Vec<(i64, f64)> =
            readings.filter(|(_, value)| value.is_finite()).collect();
        readings.dedup_by_key(|(stamp_ns, _)| *stamp_ns);
        Self { readings }
    }

    /// Whether it never says anything but one value, as fields that nobody filled in do.
    pub(crate) fn is_flat(&self) -> bool {
        self.readings.windows(2).all(|pair| pair[0].1 == pair[1].1)
    }

    /// The value at a time, between readings; none in a gap.
    pub(crate) fn at(&self, stamp_ns: i64) -> Option<f64> {
        let after = self.readings.partition_point(|(at, _)| *at < stamp_ns);
        let &(after_ns, next) = self.readings.get(after)?;
        if after_ns == stamp_ns {
            return Some(next);
        }
        let (before_ns, last) = self.readings[after.checked_sub(1)?];
        let share = (stamp_ns - before_ns) as f64 / (after_ns - before_ns) as f64;
        (after_ns - before_ns <= MAX_GAP_NS).then_some(last + share * (next - last))
    }

    /// The mean over an interval; none if it begins or ends in a gap.
    pub(crate) fn mean(&self, from_ns: i64, to_ns: i64) -> Option<f64> {
        let (first, last) = (self.at(from_ns)?, self.at(to_ns)?);
        let index = |stamp_ns: i64| self.readings.partition_point(|(at, _)| *at < stamp_ns);
        let within = &self.readings[index(from_ns)..index(to_ns)];
        if within.len() >= ENOUGH {
            let sum: f64 = within.iter().map(|(_, value)| value).sum();
            return Some(sum / within.len() as f64);
        }
        let middle = self.at(from_ns + (to_ns - from_ns) / 2)?;
        Some((first + 4.0 * middle + last) / 6.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const S: i64 = 1_000_000_000;

    fn ramp(stamps_s: &[f64]) -> Signal {
        Signal::new(stamps_s.iter().map(|s| ((s * 1e9) as i64, 3.0 * s)))
    }

    #[test]
    fn means_of_a_ramp_are_its_middle() {
        let sparse = ramp(&[0.0, 0.4, 0.8, 1.2]);
        assert!((sparse.mean(S / 10, S / 2).unwrap() - 0.9).abs() < 1e-9);
        let dense = ramp(&[0.0, 0.1, 0.2, 0.3, 0.4]);
        assert!((dense.mean(S / 10, 4 * S / 10).unwrap() - 0.6).abs() < 1e-9);
    }

    #[test]
    fn gaps_say_nothing() {
        let signal = ramp(&[0.0, 0.4, 2.0]);
        assert_eq!(signal.at(S), None);
        assert_eq!(signal.mean(S / 10, S), None);
        assert_eq!(signal.at(3 * S), None);
        assert_eq!(signal.at(-1), None);
    }

    #[test]
    fn a_field_that_nobody_filled_in_is_flat() {
        assert!(Signal::new([(0, 0.0), (1, 0.0)].into_iter()).is_flat());
        assert!(Signal::default().is_flat());
        assert!(!ramp(&[0.0, 0.1]).is_flat());
    }
}
