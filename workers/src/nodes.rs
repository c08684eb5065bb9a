//! The times at which a trajectory is estimated: evenly spaced, whatever the rates of the sensors.

/// Evenly spaced times that enclose a stretch of time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Nodes {
    first_ns: i64,
    len: usize,
}

impl Nodes {
    const SPACING_NS: i64 = 200_000_000;
    /// Time between nodes in seconds: a car that brakes or turns hard leaves the straight line
    /// between two nodes by 2 cm.
    pub(crate) const SPACING_S: f64 = 0.2;

    /// Nodes around `[from_ns, to_ns]`, three at least.
    pub(crate) fn around(from_ns: i64, to_ns: i64) -> Self {
        let first_ns = from_ns.div_euclid(Self::SPACING_NS) * Self::SPACING_NS;
        let spans = (to_ns - first_ns).div_euclid(Self::SPACING_NS) + 1;
        Self {
            first_ns,
            len: usize::try_from(spans + 1).unwrap_or(0).max(3),
        }
    }

    pub(crate) fn len(&self) -> usize {
        self.len
    }

    pub(crate) fn stamp_ns(&self, node: usize) -> i64 {
        self.first_ns + node as i64 * Self::SPACING_NS
    }

    /// The node before a time, which has a next one, and the share of the way to it; none outside.
    pub(crate) fn between(&self, stamp_ns: i64) -> Option<(usize, f64)> {
        let since_ns = stamp_ns.checked_sub(self.first_ns)?;
        let node = usize::try_from(since_ns.div_euclid(Self::SPACING_NS)).ok()?;
        let share = since_ns.rem_euclid(Self::SPACING_NS) as f64 / Self::SPACING_NS as f64;
        match node + 1 {
            next if next < self.len => Some((node, share)),
            next if next == self.len && share == 0.0 => Some((node - 1, 1.0)),
            _ => None,
        }
    }
}
