//! Fixed-point numbers in `i64` (method.md, section 7).
//!
//! Adding integers is associative, commutative and exactly reversible; adding floats is not. So every
//! sum is kept in this form, and floats appear only at its two ends. There are two units: the fold adds
//! log-evidence in 2^-24 nats (`*_fx`), and the ledger keeps what a frame contributes in 2^-8
//! (`*_q8`), as each bit of a ledger is stored for every pass of every vehicle (decision 0036).

/// Fraction bits of log-evidence.
pub const FRACTION_BITS: u32 = 24;
/// One nat.
pub const ONE: i64 = 1 << FRACTION_BITS;

/// Fraction bits of a ledger number.
pub const LEDGER_BITS: u32 = 8;
/// One, as a ledger number.
pub const ONE_Q8: i64 = 1 << LEDGER_BITS;

/// `value` nats as an integer, rounded to nearest (ties away from zero).
/// Not-a-number becomes 0 and what does not fit is clamped, so no float can poison a sum.
#[must_use]
pub fn from_f64(value: f64) -> i64 {
    rounded(value * ONE as f64)
}

/// Nats as `f64`; exact below 2^29 in magnitude.
#[must_use]
pub fn to_f64(value: i64) -> f64 {
    value as f64 / ONE as f64
}

/// `value` as a ledger number; rounds and clamps as [`from_f64`] does.
#[must_use]
pub fn to_q8(value: f64) -> i64 {
    rounded(value * ONE_Q8 as f64)
}

/// A ledger number as `f64`; exact below 2^45 in magnitude.
#[must_use]
pub fn from_q8(value: i64) -> f64 {
    value as f64 / ONE_Q8 as f64
}

fn rounded(value: f64) -> i64 {
    // `as` saturates and maps NaN to 0 (Rust reference, "Numeric cast").
    value.round() as i64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rounds_to_nearest_and_never_carries_nan() {
        assert_eq!(from_f64(1.0), ONE);
        assert_eq!(from_f64(-0.5), -ONE / 2);
        assert_eq!(from_f64(f64::NAN), 0);
        assert_eq!(from_f64(f64::INFINITY), i64::MAX);
        assert_eq!(to_q8(-0.25), -ONE_Q8 / 4);
        assert_eq!(to_q8(f64::NAN), 0);
        assert_eq!(from_q8(to_q8(0.1)), 26.0 / 256.0);
        assert_eq!(
            to_f64(from_f64(0.1)),
            (0.1_f64 * ONE as f64).round() / ONE as f64
        );
    }
}
