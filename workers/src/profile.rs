//! Profiles: the cuts of a line laid out by range, for comparing a line with very many others.
//!
//! Registration compares every seen line with every map line around it, under every lag between
//! the clocks. All it asks is how far beside each other two lines lie on average.

use tilefold_schemas::Marking;

use crate::cuts::{CutLine, RANGES_M};
use crate::look::SeenLine;

/// A line by its lateral positions.
#[derive(Debug, Clone, PartialEq)]
pub struct Profile {
    /// Mean lateral position, in metres.
    pub lateral_m: f64,
    /// How it is painted, as far as is known.
    pub marking: Marking,
    /// Lateral positions by range, in metres; 0 where the line was not cut.
    laterals_m: [f64; RANGES_M.len()],
    /// Ranges at which the line was cut: bit `k` is range `k`.
    ranges: u16,
    /// The rightmost and the leftmost lateral position, in metres.
    bounds_m: [f64; 2],
}

impl Profile {
    /// The profile of a line.
    #[must_use]
    pub fn new(line: &CutLine, marking: Marking) -> Self {
        let mut profile = Self {
            lateral_m: line.lateral_m(),
            marking,
            laterals_m: [0.0; RANGES_M.len()],
            ranges: 0,
            bounds_m: [f64::INFINITY, f64::NEG_INFINITY],
        };
        for cut in &line.cuts {
            profile.laterals_m[cut.range] = cut.lateral_m;
            profile.ranges |= 1 << cut.range;
            let [low_m, high_m] = &mut profile.bounds_m;
            *low_m = low_m.min(cut.lateral_m);
            *high_m = high_m.max(cut.lateral_m);
        }
        profile
    }

    /// Mean of this line's minus the other's lateral position over common ranges, in metres; none
    /// without common ranges, or if it is more than `reach_m` at all of them.
    #[must_use]
    pub fn offset_from(&self, other: &Self, reach_m: f64) -> Option<f64> {
        let mut common = self.ranges & other.ranges;
        let is_near = self.bounds_m[0] - other.bounds_m[1] <= reach_m
            && other.bounds_m[0] - self.bounds_m[1] <= reach_m;
        if common == 0 || !is_near {
            return None;
        }
        let cuts = f64::from(common.count_ones());
        let mut sum_m = 0.0;
        while common != 0 {
            let range = common.trailing_zeros() as usize;
            sum_m += self.laterals_m[range] - other.laterals_m[range];
            common &= common - 1;
        }
        Some(sum_m / cuts)
    }
}

/// The profiles of cuts of `lines` that were seen.
#[must_use]
pub fn seen_profiles(cuts: &[CutLine], lines: &[SeenLine]) -> Vec<Profile> {
    profiles(cuts, |line| lines[line].marking)
}

/// The profiles of lines, in their order; `marking_of` knows how line `i` is painted.
#[must_use]
pub fn profiles(lines: &[CutLine], marking_of: impl Fn(usize) -> Marking) -> Vec<Profile> {
    let profile = |line: &CutLine| Profile::new(line, marking_of(line.line));
    lines.iter().map(profile).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cuts::{Against, Cut};
    use proptest::prelude::*;

    /// A line cut where the bits of `ranges` say.
    fn line(ranges: u16, lateral_m: f64, slope: f64) -> CutLine {
        let ranges = (0..RANGES_M.len()).filter(|range| ranges >> range & 1 == 1);
        let cut = |range: usize| Cut {
            range,
            lateral_m: lateral_m + slope * RANGES_M[range],
            station_m: 0.0,
        };
        CutLine {
            line: 0,
            ahead_m: [RANGES_M[0], RANGES_M[RANGES_M.len() - 1]],
            cuts: ranges.map(cut).collect(),
        }
    }

    proptest! {
        #[test]
        fn offsets_are_those_of_the_lines_to_the_bit(
            ranges in (1_u16..1 << 14, 1_u16..1 << 14),
            laterals_m in (-9.0..9.0_f64, -9.0..9.0_f64),
            slope in -0.3..0.3_f64,
        ) {
            let seen = line(ranges.0, laterals_m.0, 0.0);
            let mapped = line(ranges.1, laterals_m.1, slope);
            let expected = Against::new(&seen, &mapped).map(|against| against.offset_m);
            let [seen, mapped] = [seen, mapped].map(|line| Profile::new(&line, Marking::Unknown));
            prop_assert_eq!(seen.offset_from(&mapped, 100.0), expected);
            // What is left out for being far is far.
            let near = seen.offset_from(&mapped, 2.0);
            prop_assert!(near == expected || expected.is_some_and(|offset_m| offset_m.abs() > 2.0));
        }
    }
}
