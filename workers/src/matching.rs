//! Matching of seen lines to map lines: Algorithm 1 of the paper with the decisions of method.md,
//! sections 5 and 8.
//!
//! Both sides are ordered from left to right, and paint does not overtake paint; so one global
//! assignment that keeps the order, with a dummy for every line that stays alone, is a sequence
//! alignment. It is found exactly by dynamic programming.

use crate::cuts::{Against, CrossCut, CutLine};

/// A seen line farther than this from a map line is not that line, in metres: half a narrow lane.
pub const GATE_M: f64 = 1.6;
/// A match this far off or nearer is the line in its place, in metres.
pub const IN_PLACE_M: f64 = 0.6;
/// Scales of the distance and shape terms, in metres and square metres.
const DISTANCE_SIGMA_M: f64 = 0.5;
const SHAPE_SIGMA_M2: f64 = 0.25;
/// Weights of distance, shape and direction in the complete case (Eq 7) and the incomplete (Eq 9).
const COMPLETE: [f64; 3] = [0.5, 0.5, 0.0];
const INCOMPLETE: [f64; 3] = [0.4, 0.4, 0.2];
/// A match is ambiguous if another one of the same seen line scores at least this share of it.
const AMBIGUOUS_SHARE: f64 = 0.9;
/// Scale of the gain that the alignment maximises, in metres: flat enough that a line shifted by
/// a metre still finds its map line.
const GAIN_SIGMA_M: f64 = 0.9;
/// Map lines of which one goes on where the other ends differ in their residuals by at most this,
/// in metres.
const CONTINUES_M: f64 = 0.3;

/// A seen line that was matched to a map line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Match {
    /// Index into [`CrossCut::seen`].
    pub seen: usize,
    /// Index into [`CrossCut::mapped`].
    pub mapped: usize,
    /// Seen minus mapped lateral position after registration, positive to the vehicle's left.
    pub residual_m: f64,
    /// Score of Eq 7 or Eq 9 in `[0, 1]`.
    pub score: f64,
    /// Whether another map line explains the seen line nearly as well.
    pub is_ambiguous: bool,
    /// Whether the seen line is longer beside no other map line: a detection that runs over the
    /// border of two ways is of both, and mainly of one.
    pub is_main: bool,
}

/// The assignment of one frame.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Matches {
    /// Pairs: those of the alignment from right to left, then pieces and parts.
    pub pairs: Vec<Match>,
    /// Whether every seen line and every map line in view found its partner (K_m = K_p).
    pub is_complete: bool,
}

/// A candidate pair.
#[derive(Debug, Clone, Copy)]
struct Candidate {
    residual_m: f64,
    mean_square_m2: f64,
    slope: f64,
    /// How long the seen line runs beside the map line, in metres.
    beside_m: f64,
}

/// Matches a frame whose vehicle really was `offset_m` to the left of its pose and `along_m` ahead of it.
#[must_use]
pub fn match_lines(cross_cut: &CrossCut, offset_m: f64, along_m: f64) -> Matches {
    let seen = by_lateral(&cross_cut.seen);
    let mapped = by_lateral(&cross_cut.mapped);
    let candidates: Vec<Vec<Option<Candidate>>> = seen
        .iter()
        .map(|&s| {
            let seen = &cross_cut.seen[s];
            let against = |&m: &usize| candidate(seen, &cross_cut.mapped[m], offset_m, along_m);
            mapped.iter().map(against).collect()
        })
        .collect();
    let goes_on = |a: usize, b: usize| {
        let [a, b] = [a, b].map(|column| &cross_cut.mapped[mapped[column]]);
        Against::new(a, b).is_none()
    };
    let follows = |a: usize, b: usize| {
        let [a, b] = [a, b].map(|row| &cross_cut.seen[seen[row]]);
        Against::new(a, b).is_none()
    };
    let mut assigned = align(&candidates);
    take_longer(&mut assigned, &candidates, goes_on);
    let is_complete = assigned.len() == seen.len() && assigned.len() == mapped.len();
    let weights = if is_complete { COMPLETE } else { INCOMPLETE };
    take_pieces(&mut assigned, &candidates, follows);
    let parts = parts(&assigned, &candidates, goes_on);
    let mains = assigned.into_iter().map(|pair| (pair, true));
    let pairs = mains
        .chain(parts.into_iter().map(|pair| (pair, false)))
        .filter_map(|((row, column), is_main)| {
            let chosen = candidates[row][column]?;
            let score_of = |candidate: &Candidate| score(candidate, weights);
            let best = score_of(&chosen);
            let rival = candidates[row]
                .iter()
                .enumerate()
                // What goes on where the other ends is no rival.
                .filter(|&(other, _)| other != column && !goes_on(other, column))
                .filter_map(|(_, candidate)| candidate.as_ref().map(score_of))
                .fold(0.0, f64::max);
            Some(Match {
                seen: seen[row],
                mapped: mapped[column],
                residual_m: chosen.residual_m,
                score: best,
                is_ambiguous: rival >= AMBIGUOUS_SHARE * best,
                is_main,
            })
        })
        .collect();
    Matches { pairs, is_complete }
}

/// Indices of lines from right to left.
fn by_lateral(lines: &[CutLine]) -> Vec<usize> {
    let laterals_m: Vec<f64> = lines.iter().map(CutLine::lateral_m).collect();
    let mut order: Vec<usize> = (0..lines.len()).collect();
    order.sort_by(|&a, &b| laterals_m[a].total_cmp(&laterals_m[b]));
    order
}

fn candidate(seen: &CutLine, mapped: &CutLine, offset_m: f64, along_m: f64) -> Option<Candidate> {
    let against = Against::new(seen, mapped)?;
    let residual_m = against.offset_m + offset_m;
    // E[(x + o)^2] = E[x^2] + 2 o E[x] + o^2.
    let mean_square_m2 = against.mean_square_m2 + offset_m * (2.0 * against.offset_m + offset_m);
    (residual_m.abs() <= GATE_M).then_some(Candidate {
        residual_m,
        mean_square_m2: mean_square_m2.max(0.0),
        slope: against.slope,
        beside_m: seen.beside_m(mapped, -along_m),
    })
}

/// Score of a pair on an absolute scale: the best of bad candidates stays bad.
fn score(candidate: &Candidate, [w1, w2, w3]: [f64; 3]) -> f64 {
    let distance = candidate.residual_m / DISTANCE_SIGMA_M;
    let near = (-0.5 * distance * distance).exp();
    let alike = (-0.5 * candidate.mean_square_m2 / SHAPE_SIGMA_M2).exp();
    let cos = 1.0 / (1.0 + candidate.slope * candidate.slope).sqrt();
    w1 * near + w2 * alike + w3 * 0.5 * (1.0 + cos)
}

/// The order-preserving assignment with the greatest total gain; pairs of (row, column).
fn align(candidates: &[Vec<Option<Candidate>>]) -> Vec<(usize, usize)> {
    let rows = candidates.len();
    let columns = candidates.first().map_or(0, Vec::len);
    let gain = |row: usize, column: usize| -> Option<f64> {
        let z = candidates[row][column]?.residual_m / GAIN_SIGMA_M;
        Some((-0.5 * z * z).exp())
    };
    // best[row][column]: greatest gain of the first `row` seen and `column` mapped lines.
    let mut best = vec![vec![0.0_f64; columns + 1]; rows + 1];
    for row in 1..=rows {
        for column in 1..=columns {
            let alone = best[row - 1][column].max(best[row][column - 1]);
            let paired = gain(row - 1, column - 1).map(|g| g + best[row - 1][column - 1]);
            best[row][column] = paired.map_or(alone, |paired| paired.max(alone));
        }
    }
    let mut pairs = Vec::new();
    let (mut row, mut column) = (rows, columns);
    while row > 0 && column > 0 {
        if best[row][column] == best[row - 1][column] {
            row -= 1;
        } else if best[row][column] == best[row][column - 1] {
            column -= 1;
        } else {
            row -= 1;
            column -= 1;
            pairs.push((row, column));
        }
    }
    pairs.reverse();
    pairs
}

/// Where a map line ends and the next begins, a seen line is the one that it runs beside for longer:
/// the alignment knows distances to the side only.
fn take_longer(
    assigned: &mut [(usize, usize)],
    candidates: &[Vec<Option<Candidate>>],
    goes_on: impl Fn(usize, usize) -> bool,
) {
    for index in 0..assigned.len() {
        let (row, column) = assigned[index];
        let Some(chosen) = candidates[row][column] else {
            continue;
        };
        let longer = (candidates[row].iter().enumerate())
            .filter_map(|(other, candidate)| Some((other, (*candidate)?)))
            .filter(|(other, candidate)| {
                candidate.beside_m > chosen.beside_m
                    && (candidate.residual_m - chosen.residual_m).abs() <= CONTINUES_M
                    && assigned.iter().all(|(_, taken)| taken != other)
                    && goes_on(*other, column)
            })
            .max_by(|a, b| a.1.beside_m.total_cmp(&b.1.beside_m));
        if let Some((other, _)) = longer {
            assigned[index].1 = other;
        }
    }
}

/// What stands before a line cuts it in pieces: a seen line that was left alone is a piece of the map
/// line that another one, farther on or nearer by, was matched to.
fn take_pieces(
    assigned: &mut Vec<(usize, usize)>,
    candidates: &[Vec<Option<Candidate>>],
    follows: impl Fn(usize, usize) -> bool,
) {
    let residual_m = |row: usize, column: usize| candidates[row][column].map(|c| c.residual_m);
    for (row, near) in candidates.iter().enumerate() {
        if assigned.iter().any(|pair| pair.0 == row) {
            continue;
        }
        let is_piece = |&(other, column): &(usize, usize)| {
            let apart_m = residual_m(row, column).zip(residual_m(other, column));
            apart_m.is_some_and(|(a, b)| (a - b).abs() <= CONTINUES_M)
                && assigned
                    .iter()
                    .all(|&(r, c)| c != column || follows(row, r))
        };
        let beside_m = |column: usize| near[column].map_or(0.0, |c| c.beside_m);
        let whole = (assigned.iter().copied().filter(is_piece))
            .max_by(|a, b| beside_m(a.1).total_cmp(&beside_m(b.1)).then(b.cmp(a)));
        assigned.extend(whole.map(|(_, column)| (row, column)));
    }
}

/// Seen lines with the map lines that go on from theirs and were left alone.
fn parts(
    assigned: &[(usize, usize)],
    candidates: &[Vec<Option<Candidate>>],
    goes_on: impl Fn(usize, usize) -> bool,
) -> Vec<(usize, usize)> {
    let mut parts: Vec<(usize, usize)> = Vec::new();
    for &(row, main) in assigned {
        let Some(chosen) = candidates[row][main] else {
            continue;
        };
        for (column, candidate) in candidates[row].iter().enumerate() {
            let is_near = candidate.is_some_and(|candidate| {
                (candidate.residual_m - chosen.residual_m).abs() <= CONTINUES_M
            });
            let mut taken = assigned.iter().chain(&parts);
            if is_near && goes_on(column, main) && taken.all(|pair| pair.1 != column) {
                parts.push((row, column));
            }
        }
    }
    parts
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cuts::{Cut, RANGES_M};
    use proptest::prelude::*;

    fn line(line: usize, lateral_m: f64) -> CutLine {
        let cuts = (2..6)
            .map(|range| Cut {
                range,
                lateral_m,
                station_m: 0.0,
            })
            .collect();
        CutLine {
            line,
            ahead_m: [5.0, 8.0],
            cuts,
        }
    }

    fn frame(seen: &[f64], mapped: &[f64]) -> CrossCut {
        let lines = |laterals: &[f64]| {
            let lines = laterals.iter().enumerate();
            lines
                .map(|(index, &lateral)| line(index, lateral))
                .collect()
        };
        CrossCut {
            seen: lines(seen),
            mapped: lines(mapped),
        }
    }

    #[test]
    fn a_complete_frame_scores_by_hand() {
        let matches = match_lines(&frame(&[1.9, -1.6], &[1.75, -1.75]), -0.05, 0.0);
        assert!(matches.is_complete);
        let found: Vec<_> = matches.pairs.iter().map(|m| (m.seen, m.mapped)).collect();
        assert_eq!(found, [(1, 1), (0, 0)]);
        // Residual 0.1: d~ = 1 - exp(-0.1^2 / (2 * 0.5^2)), v~ = 1 - exp(-0.01 / (2 * 0.25)).
        let expected = 0.5 * (-0.02_f64).exp() + 0.5 * (-0.02_f64).exp();
        for pair in matches.pairs {
            assert!((pair.residual_m - 0.1).abs() < 1e-12);
            assert!((pair.score - expected).abs() < 1e-12);
        }
    }

    #[test]
    fn order_is_kept_and_strangers_stay_alone() {
        // The right one of two seen lines belongs to the right map line, though the left is nearer.
        let matches = match_lines(&frame(&[0.2, 1.2], &[1.0, 5.0]), 0.0, 0.0);
        let found: Vec<_> = matches.pairs.iter().map(|m| (m.seen, m.mapped)).collect();
        assert_eq!(found, [(1, 0)]);
        assert!(!matches.is_complete);
    }

    #[test]
    fn halfway_between_two_map_lines_is_ambiguous() {
        let matches = match_lines(&frame(&[0.0], &[-0.5, 0.5]), 0.0, 0.0);
        assert_eq!(matches.pairs.len(), 1);
        assert!(matches.pairs[0].is_ambiguous);
    }

    proptest! {
        /// Against every assignment there is, one by one.
        #[test]
        fn no_other_ordered_assignment_gains_more(
            seen in prop::collection::vec(-4.0..4.0_f64, 0..5),
            mapped in prop::collection::vec(-4.0..4.0_f64, 0..5),
        ) {
            let cross_cut = frame(&seen, &mapped);
            let gain = |pairs: &[(usize, usize)]| -> f64 {
                pairs.iter().map(|&(s, m)| {
                    let z = (seen[s] - mapped[m]) / GAIN_SIGMA_M;
                    (-0.5 * z * z).exp()
                }).sum()
            };
            let found: Vec<_> = match_lines(&cross_cut, 0.0, 0.0)
                .pairs.iter().map(|m| (m.seen, m.mapped)).collect();
            let mut best = 0.0_f64;
            every_ordered(&seen, &mapped, &mut Vec::new(), &mut |pairs| best = best.max(gain(pairs)));
            prop_assert!((gain(&found) - best).abs() < 1e-9);
        }
    }

    fn every_ordered(
        seen: &[f64],
        mapped: &[f64],
        pairs: &mut Vec<(usize, usize)>,
        visit: &mut impl FnMut(&[(usize, usize)]),
    ) {
        visit(pairs);
        for s in 0..seen.len() {
            for m in 0..mapped.len() {
                let keeps_order = pairs.iter().all(|&(a, b)| {
                    (seen[a] < seen[s] && mapped[b] < mapped[m]) && a != s && b != m
                });
                if keeps_order && (seen[s] - mapped[m]).abs() <= GATE_M {
                    pairs.push((s, m));
                    every_ordered(seen, mapped, pairs, visit);
                    pairs.pop();
                }
            }
        }
    }

    /// Scipy's Hungarian algorithm may cross lines, and hardly ever gains by it.
    #[test]
    fn gains_what_an_assignment_without_order_gains() {
        let numbers = |text: &str| -> Vec<f64> {
            text.split_whitespace()
                .map(|word| word.parse().unwrap())
                .collect()
        };
        let (mut cases, mut equal) = (0, 0);
        for line in include_str!("../oracles/assignment.txt").lines().skip(1) {
            let [seen, mapped, best, pairs] = line.split(';').map(numbers).collect::<Vec<_>>()[..]
                .to_owned()
                .try_into()
                .unwrap();
            let matches = match_lines(&frame(&seen, &mapped), 0.0, 0.0);
            let gain = |pair: &Match| (-0.5 * (pair.residual_m / GAIN_SIGMA_M).powi(2)).exp();
            let found: f64 = matches.pairs.iter().map(gain).sum();
            assert!(found <= best[0] + 1e-6, "{line}: {found}");
            cases += 1;
            equal += usize::from(
                (found - best[0]).abs() < 1e-6 && matches.pairs.len() as f64 == pairs[0],
            );
        }
        assert_eq!(cases, 1_000);
        assert!(equal >= 990, "{equal} of {cases}");
    }

    #[test]
    fn of_two_lines_that_go_on_in_each_other_the_longer_is_taken() {
        let part = |line: usize, ranges: std::ops::Range<usize>, lateral_m: f64| CutLine {
            line,
            ahead_m: [RANGES_M[ranges.start], RANGES_M[ranges.end - 1]],
            cuts: ranges
                .map(|range| Cut {
                    range,
                    lateral_m,
                    station_m: 0.0,
                })
                .collect(),
        };
        let cross_cut = CrossCut {
            seen: vec![part(0, 0..10, 1.75)],
            mapped: vec![part(0, 0..3, 1.75), part(1, 3..10, 1.85)],
        };
        let matches = match_lines(&cross_cut, 0.0, 0.0);
        let found: Vec<_> = (matches.pairs.iter())
            .map(|m| (m.mapped, m.is_main, m.is_ambiguous))
            .collect();
        assert_eq!(found, [(1, true, false), (0, false, false)]);
        // A car stands before the middle of one line: both pieces are it.
        let cross_cut = CrossCut {
            seen: vec![part(0, 0..4, 1.75), part(1, 6..10, 1.8)],
            mapped: vec![part(0, 0..12, 1.75)],
        };
        let matches = match_lines(&cross_cut, 0.0, 0.0);
        let found: Vec<_> = matches.pairs.iter().map(|m| (m.seen, m.mapped)).collect();
        assert_eq!(found.len(), 2, "{found:?}");
        assert!(matches.pairs.iter().all(|m| m.is_main));
    }
}
