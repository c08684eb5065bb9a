//! What is really in a picture, in pixels: the truth that a detector is measured against.
//!
//! Pixels: the centre of the first one is (0, 0); the picture covers -0.5 to its size - 0.5. Where a
//! rolling shutter reads rows at different times, everything is where it is in the middle of its own
//! row's exposure.

use serde::{Serialize, Serializer};
use tilefold_schemas::element::{Color, ElementKind, Marking, SignClass};

use super::camera::NEAR_M;
use super::eye::{Rays, Way};
use super::field::Field;
use super::picture::{FIRST_SOLID, Film, GROUND};
use super::solids::Solid;
use super::vector::v2;
use crate::world::{Paint, Point};

mod clip;
use clip::{boxed, lines_within, simplified};

/// Paint farther away than this is not in the truth, in metres.
const REACH_M: f64 = 120.0;
/// Metres between points of a line before it is projected.
const STEP_M: f64 = 0.5;
/// Half of a stop line's width, in metres.
const HALF_STOP_M: f64 = 0.2;
/// Points along each side of an area at which it is asked whether it is hidden.
const AREA_POINTS: u32 = 12;
/// Something nearer than the paint by this share of its distance, and this many metres, hides it.
const HIDES: (f32, f32) = (0.04, 0.25);
/// The same for the ground before it: far away, neighbouring pixels are far apart.
const CREST_HIDES: (f32, f32) = (0.25, 1.0);
/// What is seen of an element less than this is not worth a line, in pixels.
const LEAST_PX: f64 = 2.0;
/// Projected lines keep to this many pixels when points are left out.
const SIMPLE_PX: f64 = 0.05;

/// What is in one picture.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FrameTruth {
    /// When the first row's exposure began, in nanoseconds of the Unix epoch.
    pub time_ns: i64,
    /// Size of the picture in pixels.
    pub width_px: u32,
    /// Size of the picture in pixels.
    pub height_px: u32,
    /// The category of its conditions.
    pub category: &'static str,
    /// Paint that is in the picture or hidden in it, up to 120 m away, by id.
    pub paint: Vec<PaintTruth>,
    /// Vehicles of which at least a pixel is seen, in the order of the traffic.
    pub vehicles: Vec<VehicleTruth>,
}

/// Paint in a picture.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PaintTruth {
    /// The element's id in the maps of this city.
    pub id: i64,
    /// What it is.
    #[serde(serialize_with = "name")]
    pub kind: ElementKind,
    /// How a line is painted.
    #[serde(serialize_with = "name")]
    pub marking: Marking,
    /// Its colour.
    #[serde(serialize_with = "name")]
    pub color: Color,
    /// Which sign it is.
    #[serde(serialize_with = "name")]
    pub sign: SignClass,
    /// Its line, or its outline, in pixels `[x, y]`: the parts within the picture, whether or not
    /// something hides them. A line keeps the direction of its vertices.
    pub lines_px: Vec<Vec<[f64; 2]>>,
    /// Left, top, right, bottom of its outline in the picture; none for lane markings.
    pub box_px: Option<[f64; 4]>,
    /// Metres from the camera to its nearest point that is in the picture.
    pub nearest_m: f64,
    /// Share of it (of a line's length, an area's extent on the ground) that is in the picture and
    /// not hidden.
    pub visible_share: f64,
    /// Share of what lies in the picture (in pixels of length, or of extent on the ground) that
    /// something hides: a vehicle, a building, the ground itself.
    pub occluded_share: f64,
    /// Share of its paint that is worn off.
    pub wear: f64,
}

/// A vehicle in a picture.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct VehicleTruth {
    /// Its number in the traffic.
    pub number: usize,
    /// Left, top, right, bottom of the pixels in which it is seen.
    pub box_px: [f64; 4],
    /// Pixels in which it is seen.
    pub visible_px: u32,
    /// Metres to its nearest pixel.
    pub distance_m: f64,
}

fn name<T: ToString, S: Serializer>(value: &T, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(&value.to_string())
}

/// A place that was asked for: where it is seen, and whether something hides it.
#[derive(Debug, Clone, Copy)]
struct Sight {
    pixel: [f64; 2],
    distance_m: f64,
    is_hidden: bool,
}

/// Sums over the samples of one element.
#[derive(Debug, Default)]
struct Tally {
    all: f64,
    in_picture: f64,
    visible: f64,
    /// In pixels, for a line.
    long_px: f64,
    hidden_px: f64,
    nearest_m: Option<f64>,
}

/// What the truth of a picture is read from.
pub(super) struct Witness<'a> {
    pub(super) way: &'a Way<'a>,
    pub(super) rays: &'a Rays,
    pub(super) field: &'a Field,
    pub(super) film: &'a Film,
    pub(super) origin: Point,
}

impl Witness<'_> {
    /// The truth about one element; none if none of it is in the picture.
    pub(super) fn paint(&self, paint: &Paint) -> Option<PaintTruth> {
        let (tally, outline) = match paint.kind {
            ElementKind::LaneMarking => (self.along(&self.points(&paint.points)), Vec::new()),
            ElementKind::StopLine => {
                let points = self.points(&paint.points);
                (self.along(&points), self.points(&widened(&paint.points)))
            }
            ElementKind::Crosswalk | ElementKind::GroundSign => {
                let ring = self.points(&closed(&paint.points));
                (self.within(&paint.points), ring)
            }
        };
        let is_line = matches!(paint.kind, ElementKind::LaneMarking | ElementKind::StopLine);
        let line = if is_line {
            self.points(&paint.points)
        } else {
            outline.clone()
        };
        let lines_px = self.lines(&line);
        let long_px: f64 = lines_px.iter().map(|line| length_px(line)).sum();
        if long_px < LEAST_PX || tally.in_picture <= 0.0 {
            return None;
        }
        Some(PaintTruth {
            id: paint.id,
            kind: paint.kind,
            marking: paint.marking,
            color: paint.color,
            sign: paint.sign,
            lines_px,
            box_px: boxed(&self.polygon(&outline), self.size()),
            nearest_m: rounded(tally.nearest_m?),
            visible_share: rounded(tally.visible / tally.all),
            occluded_share: rounded(tally.hidden_px / tally.long_px.max(1e-9)),
            wear: rounded(paint.wear),
        })
    }

    /// Vehicles, by what the picture's pixels see.
    pub(super) fn vehicles(&self, solids: &[Solid]) -> Vec<VehicleTruth> {
        let mut vehicles: Vec<VehicleTruth> = Vec::new();
        let mut of_solid: Vec<Option<VehicleTruth>> = vec![None; solids.len()];
        for (at, &seen) in self.film.seen.iter().enumerate() {
            let Some(index) = seen.checked_sub(FIRST_SOLID) else {
                continue;
            };
            let Some(number) = solids[index as usize].vehicle else {
                continue;
            };
            let (x, y) = ((at % self.film.width) as f64, (at / self.film.width) as f64);
            let truth = of_solid[index as usize].get_or_insert(VehicleTruth {
                number,
                box_px: [x - 0.5, y - 0.5, x + 0.5, y + 0.5],
                visible_px: 0,
                distance_m: f64::INFINITY,
            });
            truth.add(x, y, f64::from(self.film.depth_m[at]));
        }
        vehicles.extend(of_solid.into_iter().flatten());
        vehicles.sort_by_key(|vehicle| vehicle.number);
        vehicles
    }

    fn size(&self) -> [f64; 2] {
        [self.film.width as f64, self.film.height as f64]
    }

    /// Points in the local frame, close together, on the ground.
    fn points(&self, points: &[Point]) -> Vec<[f64; 3]> {
        let mut dense = Vec::new();
        for pair in points.windows(2) {
            let length_m = (pair[1][0] - pair[0][0]).hypot(pair[1][1] - pair[0][1]);
            let steps = (length_m / STEP_M).ceil().max(1.0) as u32;
            for step in 0..steps {
                dense.push(self.grounded(between(
                    pair[0],
                    pair[1],
                    f64::from(step) / f64::from(steps),
                )));
            }
        }
        dense.extend(points.last().map(|&last| self.grounded(last)));
        dense
    }

    fn grounded(&self, point: Point) -> [f64; 3] {
        let [east_m, north_m] = [0, 1].map(|axis| point[axis] - self.origin[axis]);
        let up_m = self.field.height_m(v2(east_m as f32, north_m as f32));
        [east_m, north_m, f64::from(up_m)]
    }

    /// Metres along the axis in the middle of the picture's time.
    fn depth_m(&self, point: [f64; 3]) -> f64 {
        self.way
            .in_camera(point, f64::from(self.way.camera.height_px) / 2.0)[2]
    }

    fn sight(&self, point: [f64; 3]) -> Option<Sight> {
        let pixel = self.way.pixel(point, self.rays.limit)?;
        let [width, height] = self.size();
        let [x, y] = pixel.map(f64::round);
        if !(x >= 0.0 && y >= 0.0 && x < width && y < height) {
            return None;
        }
        let [cx, cy, cz] = self.way.in_camera(point, pixel[1]);
        let distance_m = (cx * cx + cy * cy + cz * cz).sqrt();
        let at = y as usize * self.film.width + x as usize;
        let (share, metres) = match self.film.seen[at] {
            seen if seen >= FIRST_SOLID => HIDES,
            GROUND => CREST_HIDES,
            _ => (1.0, 0.0),
        };
        let is_hidden = self.film.depth_m[at] < distance_m as f32 * (1.0 - share) - metres;
        (distance_m <= REACH_M).then_some(Sight {
            pixel,
            distance_m,
            is_hidden,
        })
    }

    fn along(&self, points: &[[f64; 3]]) -> Tally {
        let mut tally = Tally::default();
        let sights: Vec<Option<Sight>> = points.iter().map(|&point| self.sight(point)).collect();
        for (pair, sight) in points.windows(2).zip(sights.windows(2)) {
            let long_m = (pair[1][0] - pair[0][0]).hypot(pair[1][1] - pair[0][1]);
            tally.all += long_m;
            if let [Some(a), Some(b)] = sight {
                let long_px = (b.pixel[0] - a.pixel[0]).hypot(b.pixel[1] - a.pixel[1]);
                tally.add(long_m, long_px, a.is_hidden || b.is_hidden, a.distance_m);
            }
        }
        tally
    }

    /// Samples within an area's first four corners.
    fn within(&self, points: &[Point]) -> Tally {
        let mut tally = Tally::default();
        let &[a, b, c, d, ..] = points else {
            return self.along(&self.points(&closed(points)));
        };
        for step in 0..AREA_POINTS * AREA_POINTS {
            let share = |step: u32| (f64::from(step) + 0.5) / f64::from(AREA_POINTS);
            let (x, y) = (share(step % AREA_POINTS), share(step / AREA_POINTS));
            let place = between(between(a, b, y), between(d, c, y), x);
            tally.all += 1.0;
            if let Some(sight) = self.sight(self.grounded(place)) {
                tally.add(1.0, 1.0, sight.is_hidden, sight.distance_m);
            }
        }
        tally
    }

    /// The parts of a line that lie before the camera and within the picture.
    fn lines(&self, points: &[[f64; 3]]) -> Vec<Vec<[f64; 2]>> {
        let mut parts = Vec::new();
        let mut part: Vec<[f64; 2]> = Vec::new();
        for pair in points.windows(2) {
            let Some((from, to)) = self.before_camera(pair[0], pair[1]) else {
                parts.push(std::mem::take(&mut part));
                continue;
            };
            let pixels = [from, to].map(|point| self.way.pixel(point, self.rays.limit));
            let [Some(from), Some(to)] = pixels else {
                parts.push(std::mem::take(&mut part));
                continue;
            };
            if part.is_empty() {
                part.push(from);
            }
            part.push(to);
        }
        parts.push(part);
        let clipped = parts
            .iter()
            .flat_map(|part| lines_within(part, self.size()));
        clipped.map(|line| simplified(&line, SIMPLE_PX)).collect()
    }

    /// The part of a short line that lies before the near plane and within reach.
    fn before_camera(&self, from: [f64; 3], to: [f64; 3]) -> Option<([f64; 3], [f64; 3])> {
        let (a, b) = (self.depth_m(from), self.depth_m(to));
        let near_m = NEAR_M * 1.05;
        if a.max(b) < near_m || a.min(b) > REACH_M {
            return None;
        }
        let cut = |at: [f64; 3], other: [f64; 3], depth: f64, other_depth: f64| {
            if depth >= near_m {
                return at;
            }
            between(at, other, (near_m - depth) / (other_depth - depth))
        };
        Some((cut(from, to, a, b), cut(to, from, b, a)))
    }

    /// An outline's pixels, as far as it lies before the camera.
    fn polygon(&self, ring: &[[f64; 3]]) -> Vec<[f64; 2]> {
        let mut pixels = Vec::new();
        for pair in ring.windows(2) {
            if let Some((from, to)) = self.before_camera(pair[0], pair[1]) {
                let both = [from, to].map(|point| self.way.pixel(point, self.rays.limit));
                pixels.extend(both.into_iter().flatten());
            }
        }
        pixels
    }
}

impl Tally {
    fn add(&mut self, long_m: f64, long_px: f64, is_hidden: bool, distance_m: f64) {
        self.in_picture += long_m;
        self.long_px += long_px;
        if is_hidden {
            self.hidden_px += long_px;
        } else {
            self.visible += long_m;
        }
        self.nearest_m = Some(
            self.nearest_m
                .map_or(distance_m, |least| least.min(distance_m)),
        );
    }
}

impl VehicleTruth {
    fn add(&mut self, x: f64, y: f64, distance_m: f64) {
        let [left, top, right, bottom] = self.box_px;
        self.box_px = [
            left.min(x - 0.5),
            top.min(y - 0.5),
            right.max(x + 0.5),
            bottom.max(y + 0.5),
        ];
        self.visible_px += 1;
        self.distance_m = rounded(self.distance_m.min(distance_m));
    }
}

fn between(a: Point, b: Point, share: f64) -> Point {
    [0, 1, 2].map(|axis| a[axis] + (b[axis] - a[axis]) * share)
}

fn closed(points: &[Point]) -> Vec<Point> {
    points.iter().chain(points.first()).copied().collect()
}

/// The outline of a stop line: its line to both sides.
fn widened(points: &[Point]) -> Vec<Point> {
    let (Some(&first), Some(&last)) = (points.first(), points.last()) else {
        return Vec::new();
    };
    let (de, dn) = (last[0] - first[0], last[1] - first[1]);
    let scale = HALF_STOP_M / de.hypot(dn).max(1e-9);
    let moved = |point: &Point, side: f64| {
        [
            point[0] - dn * scale * side,
            point[1] + de * scale * side,
            point[2],
        ]
    };
    let left = points.iter().map(|point| moved(point, 1.0));
    let right = points.iter().rev().map(|point| moved(point, -1.0));
    closed(&left.chain(right).collect::<Vec<Point>>())
}

fn length_px(line: &[[f64; 2]]) -> f64 {
    let pairs = line.windows(2);
    pairs
        .map(|pair| (pair[1][0] - pair[0][0]).hypot(pair[1][1] - pair[0][1]))
        .sum()
}

/// Three decimals: files stay small.
fn rounded(value: f64) -> f64 {
    (value * 1e3).round() / 1e3
}
