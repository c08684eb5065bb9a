//! Values along a road: cubic polynomials, each from its station to the next one's.

use super::tree::Node;

/// Polynomials by the station where each begins.
#[derive(Debug, Default)]
pub(super) struct Profile {
    pieces: Vec<(f64, [f64; 4])>,
}

/// A station that differs by less is the same: files round.
const SAME_STATION_M: f64 = 1e-9;

impl Profile {
    /// The polynomials of `nodes`, which say where they begin in `station`.
    pub(super) fn read<'a>(
        nodes: impl Iterator<Item = &'a Node>,
        station: &str,
    ) -> Result<Self, String> {
        let mut pieces = Vec::new();
        for node in nodes {
            pieces.push((node.number(station)?, node.numbers(["a", "b", "c", "d"])?));
        }
        pieces.sort_by(|one, other| one.0.total_cmp(&other.0));
        Ok(Self { pieces })
    }

    pub(super) fn is_empty(&self) -> bool {
        self.pieces.is_empty()
    }

    /// The value at a station; 0 before the first polynomial begins.
    pub(super) fn at(&self, s: f64) -> f64 {
        let begun = self
            .pieces
            .partition_point(|piece| piece.0 <= s + SAME_STATION_M);
        let Some((start, [a, b, c, d])) = begun.checked_sub(1).and_then(|at| self.pieces.get(at))
        else {
            return 0.0;
        };
        let ds = s - start;
        a + ds * (b + ds * (c + ds * d))
    }

    /// The stations between `from` and `to` at which a polynomial begins, moved by `shift`.
    pub(super) fn breaks(&self, shift: f64, from: f64, to: f64) -> impl Iterator<Item = f64> {
        let first = self.pieces.partition_point(|piece| piece.0 + shift <= from);
        let begun = self.pieces[first..]
            .iter()
            .map(move |piece| piece.0 + shift);
        begun.take_while(move |station| *station < to)
    }
}
