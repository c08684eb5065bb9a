//! Stations along a line: how far along it a point is, and how far beside it.
//!
//! Lengths, tangents and offsets are taken in the horizontal plane of a local frame (east, north);
//! heights ride along. Station 0 is the first vertex. Offsets are **positive to the left** of the
//! direction of the line.
//!
//! The plane of a frame that is anchored 50 km away is 0.03 per mille shorter than the ground, so
//! stations that are *stored* (sections, `from_m`, `to_m`) come from [`Polyline::of_element`],
//! whose frame is anchored at the line's own first vertex and therefore the same for every chunk.

use crate::geodesy::LocalFrame;

/// A last section shorter than this is no section: it is rounding.
pub const SECTION_SLACK_M: f64 = 1e-3;

/// Points that make no line.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum StationError {
    /// Nothing to measure along.
    #[error(
        "a line needs two vertices at different places, this one has {distinct} (of {points} vertices)"
    )]
    TooFewPoints {
        /// Vertices given.
        points: usize,
        /// Of these, at different places.
        distinct: usize,
    },
    /// A vertex that is not a number.
    #[error("vertex {index} is not finite")]
    NotFinite {
        /// Which vertex, counted from 0.
        index: usize,
    },
}

/// A polyline with its stations. Vertices at the place of the one before are dropped.
#[derive(Debug, Clone, PartialEq)]
pub struct Polyline {
    points: Vec<[f64; 3]>,
    stations_m: Vec<f64>,
}

/// A place on a line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OnLine {
    /// Metres from the first vertex.
    pub station_m: f64,
    /// `[east_m, north_m, up_m]`.
    pub point: [f64; 3],
    /// Unit vector along the line, `[east, north]`.
    pub tangent: [f64; 2],
}

/// The place on a line that is nearest to a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Projection {
    /// Station of the nearest place, `0..=length`.
    pub station_m: f64,
    /// Signed distance beside the line, positive to the left. Before the first and after the last
    /// vertex the line is thought to go on straight.
    pub offset_m: f64,
    /// Distance to the nearest place in the plane; at least `|offset_m|`.
    pub distance_m: f64,
    /// Unit vector along the line there, `[east, north]`.
    pub tangent: [f64; 2],
}

impl Polyline {
    /// The line through `[east_m, north_m, up_m]` vertices.
    ///
    /// # Errors
    /// If a vertex is not finite or fewer than two are at different places in the plane.
    pub fn new(points: impl IntoIterator<Item = [f64; 3]>) -> Result<Self, StationError> {
        let mut line = Self {
            points: Vec::new(),
            stations_m: Vec::new(),
        };
        let mut given = 0;
        for point in points {
            if !point.iter().all(|value| value.is_finite()) {
                return Err(StationError::NotFinite { index: given });
            }
            given += 1;
            line.push(point);
        }
        if line.points.len() < 2 {
            return Err(StationError::TooFewPoints {
                points: given,
                distinct: line.points.len(),
            });
        }
        Ok(line)
    }

    /// The line through `[longitude_deg, latitude_deg, height_m]` vertices, in the frame anchored at
    /// the first of them: stations that every chunk agrees on.
    ///
    /// # Errors
    /// As [`Polyline::new`].
    pub fn of_element(wgs84: &[[f64; 3]]) -> Result<(LocalFrame, Self), StationError> {
        let anchor = *wgs84.first().ok_or(StationError::TooFewPoints {
            points: 0,
            distinct: 0,
        })?;
        let frame = LocalFrame::new(anchor);
        let line = Self::new(wgs84.iter().map(|point| frame.to_enu(*point)))?;
        Ok((frame, line))
    }

    fn push(&mut self, point: [f64; 3]) {
        let (Some(last), Some(station_m)) = (self.points.last(), self.stations_m.last()) else {
            self.points.push(point);
            self.stations_m.push(0.0);
            return;
        };
        let length_m = (point[0] - last[0]).hypot(point[1] - last[1]);
        let next_m = station_m + length_m;
        // Also drops steps too short to move the station.
        if next_m > *station_m {
            self.points.push(point);
            self.stations_m.push(next_m);
        }
    }

    /// The vertices that were kept, `[east_m, north_m, up_m]`.
    #[must_use]
    pub fn points(&self) -> &[[f64; 3]] {
        &self.points
    }

    /// The stations of the vertices, strictly increasing from 0.
    #[must_use]
    pub fn stations_m(&self) -> &[f64] {
        &self.stations_m
    }

    /// Metres from the first vertex to the last.
    #[must_use]
    pub fn length_m(&self) -> f64 {
        self.stations_m.last().copied().unwrap_or(0.0)
    }

    /// The place at a station; stations beyond the ends are taken to the ends.
    #[must_use]
    pub fn at(&self, station_m: f64) -> OnLine {
        let station_m = station_m.max(0.0).min(self.length_m());
        let segment = self.segment_at(station_m);
        let [from, to] = self.ends(segment);
        let [from_m, to_m] = [self.stations_m[segment], self.stations_m[segment + 1]];
        let share = (station_m - from_m) / (to_m - from_m);
        OnLine {
            station_m,
            point: [0, 1, 2].map(|i| from[i] + share * (to[i] - from[i])),
            tangent: tangent(from, to),
        }
    }

    /// The stretch between two stations, with the vertices inside of it:
    /// `[east_m, north_m, up_m]`. Empty if it has no length.
    #[must_use]
    pub fn between(&self, from_m: f64, to_m: f64) -> Vec<[f64; 3]> {
        let [from_m, to_m] = [from_m, to_m].map(|m| m.max(0.0).min(self.length_m()));
        if from_m >= to_m {
            return Vec::new();
        }
        let inside = self
            .points
            .iter()
            .zip(&self.stations_m)
            .filter(|(_, station_m)| from_m < **station_m && **station_m < to_m)
            .map(|(point, _)| *point);
        let mut stretch = vec![self.at(from_m).point];
        stretch.extend(inside);
        stretch.push(self.at(to_m).point);
        stretch
    }

    /// The place nearest to `[east_m, north_m]`; of several, the one that comes first.
    #[must_use]
    pub fn project(&self, point: [f64; 2]) -> Projection {
        let (mut best, mut best_segment) = (Foot::NOWHERE, 0);
        for segment in 0..self.points.len() - 1 {
            let [from, to] = self.ends(segment);
            let foot = Foot::of(point, from, to);
            if foot.distance2_m2 < best.distance2_m2 {
                (best, best_segment) = (foot, segment);
            }
        }
        self.projection(point, best, best_segment)
    }

    fn projection(&self, point: [f64; 2], foot: Foot, segment: usize) -> Projection {
        let [from, to] = self.ends(segment);
        let [from_m, to_m] = [self.stations_m[segment], self.stations_m[segment + 1]];
        let along = tangent(from, to);
        let distance_m = foot.distance2_m2.sqrt();
        let inner_vertex = foot.share >= 1.0 && segment + 2 < self.points.len();
        let (side_m, tangent) = if inner_vertex {
            let [next_from, next_to] = self.ends(segment + 1);
            let bisector = halfway(along, tangent(next_from, next_to));
            (beside(point, to, bisector), bisector)
        } else {
            (beside(point, from, along), along)
        };
        Projection {
            station_m: from_m + foot.share * (to_m - from_m),
            offset_m: if inner_vertex {
                distance_m.copysign(side_m)
            } else {
                side_m.clamp(-distance_m, distance_m)
            },
            distance_m,
            tangent,
        }
    }

    fn segment_at(&self, station_m: f64) -> usize {
        let after = self.stations_m.partition_point(|m| *m <= station_m);
        after.clamp(1, self.points.len() - 1) - 1
    }

    fn ends(&self, segment: usize) -> [[f64; 3]; 2] {
        [self.points[segment], self.points[segment + 1]]
    }
}

/// The nearest place on one segment.
#[derive(Clone, Copy)]
struct Foot {
    share: f64,
    distance2_m2: f64,
}

impl Foot {
    const NOWHERE: Self = Self {
        share: 0.0,
        distance2_m2: f64::INFINITY,
    };

    fn of(point: [f64; 2], from: [f64; 3], to: [f64; 3]) -> Self {
        let [dx, dy] = [to[0] - from[0], to[1] - from[1]];
        let [px, py] = [point[0] - from[0], point[1] - from[1]];
        let share = ((px * dx + py * dy) / (dx * dx + dy * dy)).clamp(0.0, 1.0);
        let [rx, ry] = [px - share * dx, py - share * dy];
        Self {
            share,
            distance2_m2: rx * rx + ry * ry,
        }
    }
}

/// Signed distance from the straight line through `origin` along `tangent`, positive to the left.
fn beside(point: [f64; 2], origin: [f64; 3], tangent: [f64; 2]) -> f64 {
    tangent[0] * (point[1] - origin[1]) - tangent[1] * (point[0] - origin[0])
}

fn tangent(from: [f64; 3], to: [f64; 3]) -> [f64; 2] {
    unit([to[0] - from[0], to[1] - from[1]]).unwrap_or([1.0, 0.0])
}

/// The direction between two; where they are opposite, the second.
fn halfway(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    unit([a[0] + b[0], a[1] + b[1]]).unwrap_or(b)
}

fn unit([x, y]: [f64; 2]) -> Option<[f64; 2]> {
    let length = x.hypot(y);
    (length > 1e-12).then(|| [x / length, y / length])
}

/// How many sections a line has: `[k * S, (k + 1) * S)` for `k` from 0, the last one short
/// (method.md, section 1). A remainder below [`SECTION_SLACK_M`] is not a section, so that a line
/// cut to 80 m has eight sections of 10 m however its length was rounded. At least 1.
///
/// `section_m` must be positive; the count saturates at `u32::MAX`.
#[must_use]
pub fn section_count(length_m: f64, section_m: f64) -> u32 {
    // `as` saturates and takes NaN to 0.
    (((length_m - SECTION_SLACK_M) / section_m).ceil() as u32).max(1)
}

/// The section that a station lies in; stations beyond the ends lie in the first and last one.
#[must_use]
pub fn section_of(station_m: f64, length_m: f64, section_m: f64) -> u32 {
    ((station_m / section_m).floor() as u32).min(section_count(length_m, section_m) - 1)
}

/// The stations `[from_m, to_m]` of a section, the last one ending with the line.
#[must_use]
pub fn section_range(section: u32, length_m: f64, section_m: f64) -> [f64; 2] {
    let from_m = f64::from(section) * section_m;
    if section + 1 >= section_count(length_m, section_m) {
        return [from_m.min(length_m), length_m];
    }
    [from_m, from_m + section_m]
}
