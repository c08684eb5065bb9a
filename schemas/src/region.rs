//! Regions: changes that lie beside each other, as one thing to look at.

use crate::{ElementKind, Verdict};

/// How many changes of one kind a region has.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct RegionCount {
    /// What changed.
    pub kind: ElementKind,
    /// How: `added`, `removed` or `modified`.
    pub verdict: Verdict,
    /// How many of them.
    pub count: usize,
}

/// A polygon around changes that lie beside each other.
#[derive(Debug, Clone, PartialEq)]
pub struct Region {
    /// Id of the region: made from that of its first change.
    pub id: i64,
    /// Owner: the tile of its first change.
    pub tile: i32,
    /// The changes, ascending by tile and id.
    pub changes: Vec<i64>,
    /// How many of each kind, by kind and verdict.
    pub counts: Vec<RegionCount>,
    /// Earliest first look at a new state, nanoseconds since the Unix epoch, where one was observed
    /// to change.
    pub since_ns: Option<i64>,
    /// Corners `[longitude_deg, latitude_deg]`, counter-clockwise, not closed.
    pub outline: Vec<[f64; 2]>,
}

impl Region {
    /// What happened, in words: `construction site: 4 lines removed, 5 added`.
    #[must_use]
    pub fn summary(&self) -> String {
        let mut parts: Vec<String> = Vec::new();
        let mut last = None;
        for of in &self.counts {
            let name = match (last == Some(of.kind), of.count) {
                (true, _) => String::new(),
                (false, 1) => format!(" {}", name(of.kind)),
                (false, _) => format!(" {}s", name(of.kind)),
            };
            parts.push(format!("{}{name} {}", of.count, of.verdict.name()));
            last = Some(of.kind);
        }
        let what = parts.join(", ");
        match self.is_site() {
            true => format!("construction site: {what}"),
            false => what,
        }
    }

    /// Whether several lines gave way to several others.
    fn is_site(&self) -> bool {
        let lines = |verdict: Verdict| {
            let of = self.counts.iter();
            of.filter(|of| of.kind == ElementKind::LaneMarking && of.verdict == verdict)
                .map(|of| of.count)
                .sum::<usize>()
        };
        lines(Verdict::Removed) >= 2 && lines(Verdict::Added) >= 2
    }
}

fn name(kind: ElementKind) -> &'static str {
    match kind {
        ElementKind::LaneMarking => "line",
        ElementKind::StopLine => "stop line",
        ElementKind::Crosswalk => "crosswalk",
        ElementKind::GroundSign => "ground sign",
    }
}
