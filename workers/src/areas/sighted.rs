//! Areas that the map lacks: unexplained outlines of many frames joined into one place each; and where
//! such would have been seen.

use tilefold_schemas::evidence::{CLASS_BINS, METHOD_VERSION, to_window_ms};
use tilefold_schemas::{ElementKind, Footprint, Sighting, fixed, wkb};
use tilefold_tiler::tile::{TileError, tile_of};

use super::along::{Drift, along_sigma_m};
use super::mapped::LocalArea;
use super::pair::{ACROSS_GATE_M, ALONG_GATE_M, LANES_GATE_M, Pair, is_aside};
use super::seen::SeenArea;
use super::zone::AreaZone;
use super::{Glimpse, Whose};
use crate::footprint::open_road;
use crate::sight::rounded_deg;

/// A sighting in this many frames is one.
const MIN_FRAMES: i32 = 3;
/// The same area lies within this in the next frames, in metres: pitch moves it along the way.
const SAME_AREA_M: f64 = 2.5;
/// Not seen for this long is over.
const GAP_NS: i64 = 10_000_000_000;
/// Way between footprints, in metres.
const SAMPLE_M: f64 = 10.0;

/// One area over the frames that saw it: weighted sums.
#[derive(Debug, Clone)]
struct Track {
    kind: ElementKind,
    frames: i32,
    sum_v_q8: i64,
    weight: f64,
    corners: Vec<[f64; 2]>,
    centre: [f64; 2],
    sum_variance: f64,
    seen: [i32; CLASS_BINS],
    first_ns: i64,
    last_ns: i64,
    best_ns: i64,
    best_weight: f64,
}

/// Gathers the unexplained areas of a chunk.
#[derive(Debug, Default)]
pub struct AreaSightings {
    tracks: Vec<Track>,
}

impl AreaSightings {
    /// Adds what no element of the map explains in a frame.
    pub fn add(
        &mut self,
        glimpse: &Glimpse<'_>,
        pairs: &[Pair],
        mapped: &[LocalArea<'_>],
        drift: &Drift,
    ) {
        let ahead = drift.at(glimpse.look.pose.stamp_ns, None);
        for (index, area) in glimpse.areas.iter().enumerate() {
            let is_paired = pairs.iter().any(|pair| pair.seen == index);
            if is_paired || is_explained(glimpse, area, pairs, mapped) {
                continue;
            }
            let pose = &glimpse.look.pose;
            let place = |[x, y]: [f64; 2]| {
                pose.local_from_vehicle([x + ahead.offset_m, y + glimpse.registration.offset_m])
            };
            let corners: Vec<[f64; 2]> = area.points_m.iter().map(|&point| place(point)).collect();
            let sigma_m = along_sigma_m(area.centre_m[0]);
            let variance = sigma_m * sigma_m + ahead.sigma_m * ahead.sigma_m;
            let track = self.track(glimpse, area, place(area.centre_m), corners.len());
            track.add(glimpse, area, &corners, place(area.centre_m), sigma_m);
            track.sum_variance += variance;
        }
    }

    /// The track that an area continues, or a new one.
    fn track(
        &mut self,
        glimpse: &Glimpse<'_>,
        area: &SeenArea,
        centre: [f64; 2],
        corners: usize,
    ) -> &mut Track {
        let stamp_ns = glimpse.look.pose.stamp_ns;
        let distance_m = |track: &Track| {
            let mean = track.mean(track.centre);
            (mean[0] - centre[0]).hypot(mean[1] - centre[1])
        };
        let is_open = |track: &Track| {
            track.kind == area.kind
                && track.corners.len() == corners
                && track.last_ns < stamp_ns
                && stamp_ns - track.last_ns <= GAP_NS
        };
        let nearest = (0..self.tracks.len())
            .filter(|&index| is_open(&self.tracks[index]))
            .map(|index| (distance_m(&self.tracks[index]), index))
            .filter(|(distance_m, _)| *distance_m <= SAME_AREA_M)
            .min_by(|a, b| a.0.total_cmp(&b.0));
        let index = nearest.map_or(self.tracks.len(), |(_, index)| index);
        if index == self.tracks.len() {
            self.tracks.push(Track::new(area.kind, corners, stamp_ns));
        }
        &mut self.tracks[index]
    }

    /// The rows, numbered in order of their first frame.
    ///
    /// # Errors
    /// A vertex is on no tile.
    pub fn into_rows(mut self, whose: Whose<'_>) -> Result<Vec<Sighting>, TileError> {
        self.tracks.retain(|track| track.frames >= MIN_FRAMES);
        // Tracks are begun in the order of frames, and within a frame in that of its message.
        let tracks = self.tracks.iter().zip(whose.first_track..);
        tracks
            .map(|(track, number)| track.row(number, whose))
            .collect()
    }
}

/// Whether a map element of the kind is so near that this is it, seen twice or moved; or was left alone
/// so near that this is it a lane or two aside.
fn is_explained(
    glimpse: &Glimpse<'_>,
    area: &SeenArea,
    pairs: &[Pair],
    mapped: &[LocalArea<'_>],
) -> bool {
    let of_kind = mapped
        .iter()
        .enumerate()
        .filter(|(_, local)| local.mapped.element.kind == area.kind);
    of_kind.into_iter().any(|(index, local)| {
        let is_alone = pairs.iter().all(|pair| pair.mapped != index);
        if is_alone && is_aside(glimpse, area, local, LANES_GATE_M) {
            return true;
        }
        let [x, y] = glimpse.look.pose.vehicle_from_local(local.centre_m);
        let left_m = area.centre_m[1] + glimpse.registration.offset_m - y;
        (area.centre_m[0] - x).abs() <= ALONG_GATE_M && left_m.abs() <= ACROSS_GATE_M
    })
}

impl Track {
    fn new(kind: ElementKind, corners: usize, stamp_ns: i64) -> Self {
        Self {
            kind,
            frames: 0,
            sum_v_q8: 0,
            weight: 0.0,
            corners: vec![[0.0; 2]; corners],
            centre: [0.0; 2],
            sum_variance: 0.0,
            seen: [0; CLASS_BINS],
            first_ns: stamp_ns,
            last_ns: stamp_ns,
            best_ns: stamp_ns,
            best_weight: 0.0,
        }
    }

    fn add(
        &mut self,
        glimpse: &Glimpse<'_>,
        area: &SeenArea,
        corners: &[[f64; 2]],
        centre: [f64; 2],
        sigma_m: f64,
    ) {
        let weight = sigma_m.powi(-2);
        let stamp_ns = glimpse.look.pose.stamp_ns;
        self.frames += 1;
        self.sum_v_q8 += fixed::to_q8(glimpse.registration.confidence);
        self.weight += weight;
        for (sum, corner) in self.corners.iter_mut().zip(corners) {
            *sum = [0, 1].map(|axis| sum[axis] + weight * corner[axis]);
        }
        self.centre = [0, 1].map(|axis| self.centre[axis] + weight * centre[axis]);
        if area.kind == ElementKind::GroundSign {
            self.seen[area.sign.code() as usize] += 1;
        }
        self.last_ns = stamp_ns;
        if weight > self.best_weight {
            self.best_weight = weight;
            self.best_ns = stamp_ns;
        }
    }

    fn mean(&self, sum: [f64; 2]) -> [f64; 2] {
        sum.map(|value| value / self.weight)
    }

    fn row(&self, number: i32, whose: Whose<'_>) -> Result<Sighting, TileError> {
        let vertices: Vec<[f64; 3]> = self
            .corners
            .iter()
            .map(|&corner| {
                let [east_m, north_m] = self.mean(corner);
                let [lon, lat, _] = whose.frame.to_wgs84([east_m, north_m, 0.0]);
                [rounded_deg(lon), rounded_deg(lat), 0.0]
            })
            .collect();
        let geometry = match self.kind {
            ElementKind::StopLine => wkb::line(&vertices),
            _ => wkb::polygon(&vertices),
        };
        let at_ms = |stamp_ns| to_window_ms(whose.chunk.window, stamp_ns);
        Ok(Sighting {
            tile: tile_of(vertices[0][0], vertices[0][1], whose.tile_level)?.0,
            vehicle: whose.chunk.vehicle.0,
            channel: whose.chunk.channel,
            window: whose.chunk.window,
            track: number,
            method: METHOD_VERSION,
            model: 0,
            kind: self.kind.code(),
            frames: self.frames,
            sum_v_q8: self.sum_v_q8,
            geometry,
            lambda_q8: fixed::to_q8(f64::from(self.frames) / self.sum_variance),
            seen: self.seen,
            first_ms: at_ms(self.first_ns),
            last_after_ms: at_ms(self.last_ns) - at_ms(self.first_ns),
            best_after_ms: at_ms(self.best_ns) - at_ms(self.first_ns),
        })
    }
}

/// Frames that one footprint stands for.
#[derive(Debug, Clone, Copy)]
struct Sample {
    bin: i64,
    frames: i32,
    sum_v: f64,
    stamp_ns: i64,
    place_m: [f64; 2],
    yaw_rad: f64,
}

/// Collects where a chunk looked for areas.
#[derive(Debug, Default)]
pub struct AreaFootprints {
    samples: Vec<Sample>,
}

impl AreaFootprints {
    /// Adds a frame.
    pub fn add(&mut self, glimpse: &Glimpse<'_>, drift: &Drift) {
        let bin = (glimpse.way_m / SAMPLE_M).floor() as i64;
        if self.samples.last().is_none_or(|last| last.bin != bin) {
            let pose = &glimpse.look.pose;
            let ahead = drift.at(pose.stamp_ns, None);
            self.samples.push(Sample {
                bin,
                frames: 0,
                sum_v: 0.0,
                stamp_ns: pose.stamp_ns,
                place_m: pose.local_from_vehicle([ahead.offset_m, glimpse.registration.offset_m]),
                yaw_rad: pose.yaw_rad,
            });
        }
        if let Some(sample) = self.samples.last_mut() {
            sample.frames += 1;
            sample.sum_v += glimpse.registration.confidence * open_road(glimpse.hidden);
        }
    }

    /// The rows in capture order.
    ///
    /// # Errors
    /// A place is on no tile.
    pub fn into_rows(self, whose: Whose<'_>, zone: &AreaZone) -> Result<Vec<Footprint>, TileError> {
        let row = |sample: Sample| {
            let [east_m, north_m] = sample.place_m;
            let [longitude_deg, latitude_deg, _] = whose.frame.to_wgs84([east_m, north_m, 0.0]);
            Ok(Footprint {
                tile: tile_of(longitude_deg, latitude_deg, whose.tile_level)?.0,
                vehicle: whose.chunk.vehicle.0,
                channel: whose.chunk.channel,
                window: whose.chunk.window,
                method: METHOD_VERSION,
                model: 0,
                kinds: zone.kinds,
                at_ms: to_window_ms(whose.chunk.window, sample.stamp_ns),
                longitude_e6: (longitude_deg * 1e6).round() as i32,
                latitude_e6: (latitude_deg * 1e6).round() as i32,
                yaw_mrad: (sample.yaw_rad.rem_euclid(std::f64::consts::TAU) * 1e3).round() as i32,
                frames: sample.frames,
                range_from_mm: (zone.range_m.0 * 1e3) as i32,
                range_to_mm: (zone.range_m.1 * 1e3) as i32,
                left_mm: (zone.side_m * 1e3) as i32,
                right_mm: (-zone.side_m * 1e3) as i32,
                v_q8: fixed::to_q8(sample.sum_v / f64::from(sample.frames)),
            })
        };
        self.samples.into_iter().map(row).collect()
    }
}
