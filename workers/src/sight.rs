//! Sightings: lines that were seen where the map has none, gathered over the frames of a chunk
//! into stretches of paint in map coordinates.
//!
//! Place is kept by the way the vehicle went: a point seen `r` metres ahead after `s` metres of
//! way belongs to bin `(s + r) / 2 m`. Frames that see the same stretch fall into the same bins,
//! where they are averaged.

use std::collections::BTreeMap;

use tilefold_schemas::evidence::{CLASS_BINS, METHOD_VERSION, to_window_ms};
use tilefold_schemas::{ChunkId, ElementKind, Sighting, fixed, wkb};
use tilefold_tiler::geodesy::LocalFrame;
use tilefold_tiler::side::side_visibility;
use tilefold_tiler::tile::{TileError, tile_of};

use crate::cuts::{CutLine, RANGES_M};
use crate::matching::IN_PLACE_M;
use crate::testify::{Frame, MIN_CONFIDENCE};

/// Length of a bin along the way, in metres.
const BIN_M: f64 = 2.0;
/// A seen line continues a track if it is this near to it, in metres.
const SAME_LINE_M: f64 = 0.7;
/// A track without a frame for this long along the way is over, in metres.
const TRACK_GAP_M: f64 = 20.0;
/// A track must have been seen in this many frames...
const MIN_FRAMES: i32 = 3;
/// ... and in this many bins.
const MIN_BINS: usize = 3;

/// Points of one bin, summed.
#[derive(Debug, Clone, Copy, Default)]
struct Bin {
    points: f64,
    east_m: f64,
    north_m: f64,
}

impl Bin {
    fn mean(&self) -> [f64; 2] {
        [self.east_m / self.points, self.north_m / self.points]
    }
}

#[derive(Debug, Clone)]
struct Track {
    bins: BTreeMap<i64, Bin>,
    frames: i32,
    sum_v_q8: i64,
    lambda: f64,
    seen: [i32; CLASS_BINS],
    first_ns: i64,
    last_ns: i64,
    best_ns: i64,
    best_v: f64,
}

/// Gathers the unexplained lines of a chunk.
#[derive(Debug, Default)]
pub struct Sightings {
    open: Vec<Track>,
    closed: Vec<Track>,
}

/// A point seen in a frame: its bin and its place in the plane of the chunk.
type Seen = (i64, [f64; 2]);

impl Sightings {
    /// Adds the unexplained lines of a frame seen after `way_m` metres of way.
    pub fn add(&mut self, frame: &Frame<'_>, way_m: f64) {
        if frame.registration.confidence < MIN_CONFIDENCE {
            return;
        }
        self.close_behind(way_m);
        for (index, seen) in frame.cross_cut.seen.iter().enumerate() {
            let is_aslant = frame.aslant.iter().any(|aslant| aslant.seen == seen.line);
            let is_matched = is_aslant || frame.matches.pairs.iter().any(|pair| pair.seen == index);
            if !is_matched && !is_double(frame, seen) {
                self.add_line(frame, seen, way_m);
            }
        }
    }

    fn add_line(&mut self, frame: &Frame<'_>, seen: &CutLine, way_m: f64) {
        let points: Vec<Seen> = points(frame, seen, way_m);
        let visibility = side_visibility(seen.lateral_m()) * frame.registration.confidence;
        if visibility <= 0.0 || points.is_empty() {
            return;
        }
        let nearest = (0..self.open.len())
            .filter_map(|index| Some((distance_m(&self.open[index], &points)?, index)))
            .filter(|(distance_m, _)| *distance_m <= SAME_LINE_M)
            .min_by(|a, b| a.0.total_cmp(&b.0));
        let stamp_ns = frame.look.pose.stamp_ns;
        let index = nearest.map_or_else(
            || {
                self.open.push(Track::new(stamp_ns));
                self.open.len() - 1
            },
            |(_, index)| index,
        );
        let marking = frame.look.lines[seen.line].marking.code() as usize;
        let variance = 0.15_f64.powi(2) + frame.registration.sigma_m.powi(2);
        self.open[index].add(&points, stamp_ns, visibility, marking, 1.0 / variance);
    }

    fn close_behind(&mut self, way_m: f64) {
        let limit = ((way_m + RANGES_M[0] - TRACK_GAP_M) / BIN_M).floor() as i64;
        let is_open = |track: &Track| {
            track
                .bins
                .keys()
                .next_back()
                .is_some_and(|&bin| bin >= limit)
        };
        let (open, closed) = std::mem::take(&mut self.open)
            .into_iter()
            .partition(is_open);
        self.open = open;
        self.closed.extend::<Vec<Track>>(closed);
    }

    /// The rows, numbered in order of their first frame and place.
    ///
    /// # Errors
    /// A vertex is on no tile of `tile_level`.
    pub fn into_rows(
        mut self,
        chunk: ChunkId,
        frame: &LocalFrame,
        tile_level: u32,
    ) -> Result<Vec<Sighting>, TileError> {
        self.closed.append(&mut self.open);
        self.closed
            .retain(|track| track.frames >= MIN_FRAMES && track.bins.len() >= MIN_BINS);
        self.closed.sort_by_key(Track::order);
        let tracks = self.closed.into_iter().zip(0..);
        tracks
            .map(|(track, number)| track.into_row(number, chunk, frame, tile_level))
            .collect()
    }
}

/// Whether an unmatched line is a second detection of a line that the map has.
fn is_double(frame: &Frame<'_>, seen: &CutLine) -> bool {
    frame.cross_cut.mapped.iter().any(|mapped| {
        crate::cuts::Against::new(seen, mapped).is_some_and(|against| {
            (against.offset_m + frame.registration.offset_m).abs() <= IN_PLACE_M
        })
    })
}

/// Places of a seen line, at the ranges at which the map has a line that was seen too.
fn points(frame: &Frame<'_>, seen: &CutLine, way_m: f64) -> Vec<Seen> {
    let is_mapped = |range: usize| {
        let matched = frame
            .matches
            .pairs
            .iter()
            .map(|pair| &frame.cross_cut.mapped[pair.mapped]);
        matched
            .flat_map(|line| &line.cuts)
            .any(|cut| cut.range == range)
    };
    seen.cuts
        .iter()
        .filter(|cut| is_mapped(cut.range))
        .map(|cut| {
            let range_m = RANGES_M[cut.range];
            let corrected = [range_m, cut.lateral_m + frame.registration.offset_m];
            let bin = ((way_m + range_m) / BIN_M).floor() as i64;
            (bin, frame.look.pose.local_from_vehicle(corrected))
        })
        .collect()
}

/// Mean distance between a track and points in common bins; none without common bins nearby.
fn distance_m(track: &Track, points: &[Seen]) -> Option<f64> {
    let near = |bin: i64| {
        track
            .bins
            .range(bin - 1..=bin + 1)
            .map(|(_, bin)| bin.mean())
    };
    let across: Vec<f64> = points
        .iter()
        .filter_map(|&(bin, point)| {
            near(bin)
                .map(|mean| (mean[0] - point[0]).hypot(mean[1] - point[1]))
                .min_by(f64::total_cmp)
        })
        .collect();
    // Means lie anywhere along their bins: half a bin of distance is none.
    let mean = across.iter().sum::<f64>() / across.len() as f64;
    (!across.is_empty()).then(|| (mean - 0.25 * BIN_M).max(0.0))
}

const GRAINS_PER_DEGREE: f64 = (1_u32 << 26) as f64;

impl Track {
    fn new(stamp_ns: i64) -> Self {
        Self {
            bins: BTreeMap::new(),
            frames: 0,
            sum_v_q8: 0,
            lambda: 0.0,
            seen: [0; CLASS_BINS],
            first_ns: stamp_ns,
            last_ns: stamp_ns,
            best_ns: stamp_ns,
            best_v: -1.0,
        }
    }

    fn add(
        &mut self,
        points: &[Seen],
        stamp_ns: i64,
        visibility: f64,
        marking: usize,
        lambda: f64,
    ) {
        for &(bin, [east_m, north_m]) in points {
            let bin = self.bins.entry(bin).or_default();
            bin.points += 1.0;
            bin.east_m += east_m;
            bin.north_m += north_m;
        }
        self.frames += 1;
        self.sum_v_q8 += fixed::to_q8(visibility);
        self.lambda += lambda;
        self.seen[marking] += 1;
        self.last_ns = stamp_ns;
        if visibility > self.best_v {
            self.best_v = visibility;
            self.best_ns = stamp_ns;
        }
    }

    /// First frame, then place: two tracks never share both.
    fn order(&self) -> (i64, i64, i64) {
        let place = self.bins.values().next().map_or([0.0; 2], Bin::mean);
        let millimetres = place.map(|metres| (metres * 1e3).round() as i64);
        (self.first_ns, millimetres[0], millimetres[1])
    }

    fn into_row(
        self,
        number: i32,
        chunk: ChunkId,
        frame: &LocalFrame,
        tile_level: u32,
    ) -> Result<Sighting, TileError> {
        let vertices: Vec<[f64; 3]> = self
            .bins
            .values()
            .map(Bin::mean)
            .map(|[east_m, north_m]| {
                let [longitude_deg, latitude_deg, _] = frame.to_wgs84([east_m, north_m, 0.0]);
                [rounded_deg(longitude_deg), rounded_deg(latitude_deg), 0.0]
            })
            .collect();
        let at_ms = |stamp_ns| to_window_ms(chunk.window, stamp_ns);
        Ok(Sighting {
            tile: tile_of(vertices[0][0], vertices[0][1], tile_level)?.0,
            vehicle: chunk.vehicle.0,
            channel: chunk.channel,
            window: chunk.window,
            track: number,
            method: METHOD_VERSION,
            model: 0,
            kind: ElementKind::LaneMarking.code(),
            frames: self.frames,
            sum_v_q8: self.sum_v_q8,
            geometry: wkb::line(&vertices),
            lambda_q8: fixed::to_q8(self.lambda / f64::from(self.frames)),
            seen: self.seen,
            first_ms: at_ms(self.first_ns),
            last_after_ms: at_ms(self.last_ns) - at_ms(self.first_ns),
            best_after_ms: at_ms(self.best_ns) - at_ms(self.first_ns),
        })
    }
}

/// Degrees rounded to 2^-26, at most 1.7 mm: the same on every machine, and of few bits.
pub(crate) fn rounded_deg(degrees: f64) -> f64 {
    (degrees * GRAINS_PER_DEGREE).round() / GRAINS_PER_DEGREE
}
