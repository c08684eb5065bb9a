//! Fixed-point numbers of the ledger: 2^-24 in `i64` (method.md, section 7).
//!
//! Adding integers is associative, commutative and exactly reversible; adding floats is not.
//! So every sum in the ledger is kept in this form, and floats appear only at its two ends.

/// Fraction bits of a ledger number.
pub const FRACTION_BITS: u32 = 24;
/// One, as a ledger number.
pub const ONE: i64 = 1 << FRACTION_BITS;

/// `value` as a ledger number, rounded to nearest (ties away from zero).
/// Not-a-number becomes 0 and what does not fit is clamped, so no float can poison a sum.
#[must_use]
pub fn from_f64(value: f64) -> i64 {
    // `as` saturates and maps NaN to 0 (Rust reference, "Numeric cast").
    (value * ONE as f64).round() as i64
}

/// A ledger number as `f64`; exact below 2^29 in magnitude.
#[must_use]
pub fn to_f64(value: i64) -> f64 {
    value as f64 / ONE as f64
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
        assert_eq!(
            to_f64(from_f64(0.1)),
            (0.1_f64 * ONE as f64).round() / ONE as f64
        );
    }
}
