//! Cross-cuts: at fixed ranges ahead of the vehicle, how far to the left each seen line and each
//! map line lies.
//!
//! Lane lines run along the road, so what a frame says about the map is one-dimensional at each
//! range: a set of lateral positions seen against a set of lateral positions mapped. Everything
//! after this (registration, matching, exposure) works on these numbers.

use crate::local_map::{LocalMap, Near, NearSegment};
use crate::look::{Look, SeenLine};
use crate::pose::Pose;

/// Ranges ahead at which lines are cut, in metres.
pub const RANGES_M: [f64; 14] = [
    3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0, 12.0, 14.0, 16.0, 18.0, 20.0, 24.0,
];
/// Map lines farther to the side are not cut, in metres.
const SIDE_M: f64 = 12.0;
/// Lines that cross the vehicle's direction more steeply are not lines along it (tangent of 20
/// degrees).
pub(crate) const MAX_SLOPE: f64 = 0.364;
/// Nor are seen lines, where they do so over this much to either side of a cut, in metres: less
/// strictly (26 degrees), as they are seen less well than mapped.
const SEEN_MAX_SLOPE: f64 = 0.488;
const SEEN_BASE_M: f64 = 2.0;

/// A line crossing one range ahead.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cut {
    /// Index into [`RANGES_M`].
    pub range: usize,
    /// Left of the vehicle's axis, in metres.
    pub lateral_m: f64,
    /// Station along a map line; 0 for a seen line.
    pub station_m: f64,
}

/// A line with its cuts, ascending in range.
#[derive(Debug, Clone, PartialEq)]
pub struct CutLine {
    /// Index of the line: into the local map's lines, or the look's.
    pub line: usize,
    /// From where to where ahead it runs along the vehicle's direction, in metres.
    pub ahead_m: [f64; 2],
    /// Where it crosses the ranges.
    pub cuts: Vec<Cut>,
}

impl CutLine {
    /// Mean lateral position over the cuts.
    #[must_use]
    pub fn lateral_m(&self) -> f64 {
        let sum: f64 = self.cuts.iter().map(|cut| cut.lateral_m).sum();
        sum / self.cuts.len() as f64
    }

    /// How long it runs beside another that is moved ahead by `along_m`, in metres.
    #[must_use]
    pub fn beside_m(&self, other: &Self, along_m: f64) -> f64 {
        let from_m = self.ahead_m[0].max(other.ahead_m[0] + along_m);
        let to_m = self.ahead_m[1].min(other.ahead_m[1] + along_m);
        (to_m - from_m).max(0.0)
    }
}

/// What a frame saw beside what the map has there.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct CrossCut {
    /// Seen lines that were cut at least once, in the order of the look.
    pub seen: Vec<CutLine>,
    /// Map lines that were cut at least once, by line.
    pub mapped: Vec<CutLine>,
}

impl CrossCut {
    /// Cuts the lines of a look and of the map around it.
    #[must_use]
    pub fn new(look: &Look, map: &LocalMap<'_>, near: &mut Near) -> Self {
        Self {
            seen: cut_seen(&look.lines),
            mapped: cut_map(&look.pose, map, near),
        }
    }
}

/// Cuts the lines that were seen.
#[must_use]
pub fn cut_seen(lines: &[SeenLine]) -> Vec<CutLine> {
    let cut_line = |(line, seen): (usize, &SeenLine)| {
        let mut cuts = Vec::with_capacity(RANGES_M.len());
        for (range, &range_m) in RANGES_M.iter().enumerate() {
            let lateral_m = seen.lateral_m(range_m);
            cuts.extend(
                lateral_m
                    .filter(|_| runs_along(seen, range_m))
                    .map(|lateral_m| Cut {
                        range,
                        lateral_m,
                        station_m: 0.0,
                    }),
            );
        }
        let ahead_m = [seen.points_m.first()?[0], seen.points_m.last()?[0]];
        (!cuts.is_empty()).then_some(CutLine {
            line,
            ahead_m,
            cuts,
        })
    };
    lines.iter().enumerate().filter_map(cut_line).collect()
}

/// Whether a seen line runs along the vehicle's direction at a range.
fn runs_along(seen: &SeenLine, range_m: f64) -> bool {
    let Some((first, last)) = seen.points_m.first().zip(seen.points_m.last()) else {
        return false;
    };
    let from_m = (range_m - SEEN_BASE_M).max(first[0]);
    let to_m = (range_m + SEEN_BASE_M).min(last[0]);
    let ends = seen.lateral_m(from_m).zip(seen.lateral_m(to_m));
    // Of a piece shorter than the base nothing can be said.
    ends.is_none_or(|(from, to)| {
        to_m - from_m < SEEN_BASE_M || (to - from).abs() <= SEEN_MAX_SLOPE * (to_m - from_m)
    })
}

/// Cuts the map lines around a pose.
#[must_use]
pub fn cut_map(pose: &Pose, map: &LocalMap<'_>, near: &mut Near) -> Vec<CutLine> {
    let (low, high) = box_ahead(pose);
    map.segments_within(low, high, near);
    let mut lines: Vec<CutLine> = Vec::new();
    let axes = pose.yaw_rad.sin_cos();
    for segment in near.found() {
        let Some(ahead) = Ahead::new(pose, axes, segment) else {
            continue;
        };
        if lines.last().is_none_or(|last| last.line != segment.line) {
            lines.push(CutLine {
                line: segment.line,
                ahead_m: ahead.span_m,
                cuts: Vec::with_capacity(RANGES_M.len()),
            });
        }
        if let Some(line) = lines.last_mut() {
            ahead.add_to(line);
        }
    }
    lines.retain(|line| !line.cuts.is_empty());
    for line in &mut lines {
        line.cuts.sort_by_key(|cut| cut.range);
    }
    lines
}

/// The box around what may be cut.
fn box_ahead(pose: &Pose) -> ([f64; 2], [f64; 2]) {
    let far_m = RANGES_M[RANGES_M.len() - 1];
    let corners = [
        [RANGES_M[0], SIDE_M],
        [RANGES_M[0], -SIDE_M],
        [far_m, SIDE_M],
        [far_m, -SIDE_M],
    ]
    .map(|corner| pose.local_from_vehicle(corner));
    let mut low = corners[0];
    let mut high = corners[0];
    for corner in corners {
        for axis in 0..2 {
            low[axis] = low[axis].min(corner[axis]);
            high[axis] = high[axis].max(corner[axis]);
        }
    }
    (low, high)
}

/// A map segment in the vehicle frame.
struct Ahead {
    from: [f64; 2],
    slope: f64,
    /// From where to where ahead, and the ranges between.
    span_m: [f64; 2],
    ranges: std::ops::Range<usize>,
    station_per_range: f64,
    from_station_m: f64,
}

impl Ahead {
    /// The segment from a pose whose yaw has these sine and cosine; none if it does not run along the
    /// vehicle's direction.
    fn new(pose: &Pose, (sin, cos): (f64, f64), segment: &NearSegment) -> Option<Self> {
        let vehicle_from_local = |[east, north]: [f64; 2]| {
            let (dx, dy) = (east - pose.east_m, north - pose.north_m);
            [cos * dx + sin * dy, -sin * dx + cos * dy]
        };
        let from = vehicle_from_local(segment.from);
        let to = vehicle_from_local(segment.to);
        let (near_m, far_m) = (from[0].min(to[0]), from[0].max(to[0]));
        let reached = |far_m: f64| RANGES_M.iter().take_while(|m| **m < far_m).count();
        let ranges = reached(near_m)..reached(far_m);
        let (dx, dy) = (to[0] - from[0], to[1] - from[1]);
        let slope = dy / dx;
        // A segment square to the vehicle has an infinite or undefined slope: refused here.
        (slope.abs() <= MAX_SLOPE).then(|| Self {
            from,
            slope,
            span_m: [near_m, far_m],
            ranges,
            station_per_range: dx.hypot(dy) / dx,
            from_station_m: segment.from_station_m,
        })
    }

    /// Adds the segment to the line that it is of.
    fn add_to(&self, line: &mut CutLine) {
        line.ahead_m = [
            line.ahead_m[0].min(self.span_m[0]),
            line.ahead_m[1].max(self.span_m[1]),
        ];
        for range in self.ranges.clone() {
            // A line that turns back is cut once, where it is reached first.
            let is_new = line.cuts.iter().all(|known| known.range != range);
            let cut = is_new.then(|| self.cut(RANGES_M[range])).flatten();
            line.cuts.extend(cut.map(|(lateral_m, station_m)| Cut {
                range,
                lateral_m,
                station_m,
            }));
        }
    }

    /// Lateral position and station at a range between its ends; none too far to the side.
    fn cut(&self, range_m: f64) -> Option<(f64, f64)> {
        let ahead_m = range_m - self.from[0];
        let lateral_m = self.from[1] + self.slope * ahead_m;
        (lateral_m.abs() <= SIDE_M).then_some((
            lateral_m,
            self.from_station_m + self.station_per_range * ahead_m,
        ))
    }
}

/// How a seen line lies against a map line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Against {
    /// Mean of seen minus mapped lateral position over common cuts, in metres.
    pub offset_m: f64,
    /// Mean of its square, in square metres.
    pub mean_square_m2: f64,
    /// Difference of their slopes (tangent), 0 with fewer than two common cuts.
    pub slope: f64,
}

impl Against {
    /// Compares at the ranges that both have; none if there is none.
    #[must_use]
    pub fn new(seen: &CutLine, mapped: &CutLine) -> Option<Self> {
        let (mut n, mut sum, mut square, mut sum_x, mut sum_xx, mut sum_xy) =
            (0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
        let mut others = mapped.cuts.iter().peekable();
        for cut in &seen.cuts {
            while others.next_if(|other| other.range < cut.range).is_some() {}
            let Some(other) = others.next_if(|other| other.range == cut.range) else {
                continue;
            };
            let offset = cut.lateral_m - other.lateral_m;
            let x = RANGES_M[cut.range];
            n += 1.0;
            sum += offset;
            square += offset * offset;
            sum_x += x;
            sum_xx += x * x;
            sum_xy += x * offset;
        }
        let spread = n * sum_xx - sum_x * sum_x;
        (n > 0.0).then(|| Self {
            offset_m: sum / n,
            mean_square_m2: square / n,
            slope: if spread > 1e-9 {
                (n * sum_xy - sum_x * sum) / spread
            } else {
                0.0
            },
        })
    }
}
