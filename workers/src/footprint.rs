//! Footprints: where a chunk looked, so that what one vehicle saw can be held against all the
//! passes that looked there and saw nothing.

use tilefold_schemas::evidence::{METHOD_VERSION, to_window_ms};
use tilefold_schemas::{ChunkId, ElementKind, Footprint, fixed};
use tilefold_tiler::geodesy::LocalFrame;
use tilefold_tiler::side::FAR_SIDE_M;
use tilefold_tiler::tile::{TileError, tile_of};

use crate::cuts::RANGES_M;
use crate::hidden::Hidden;
use crate::testify::{Frame, MIN_CONFIDENCE};
use crate::visibility::Zone;

/// Way between samples, in metres.
const SAMPLE_M: f64 = 8.0;
/// Where vehicles are looked for before lines, to the left in metres.
const SIDES_M: [f64; 4] = [-5.0, -1.75, 1.75, 5.0];

/// Frames that one sample stands for.
#[derive(Debug, Clone, Copy)]
struct Sample {
    bin: i64,
    frames: i32,
    sum_v: f64,
    /// Of the first frame: time, registered place and heading.
    stamp_ns: i64,
    place_m: [f64; 2],
    yaw_rad: f64,
}

/// V_occ of the whole road ahead: the mean over lines that might be there.
pub(crate) fn open_road(hidden: &Hidden<'_>) -> f64 {
    let line = |left_m: f64| RANGES_M.iter().map(move |&ahead_m| [ahead_m, left_m, 0.0]);
    let shares = SIDES_M.map(|left_m| hidden.open_share(line(left_m)));
    shares.iter().sum::<f64>() / SIDES_M.len() as f64
}

/// Collects the footprints of a chunk.
#[derive(Debug, Default)]
pub struct Footprints {
    samples: Vec<Sample>,
}

impl Footprints {
    /// Adds a frame looked from after `way_m` metres of way.
    pub fn add(&mut self, frame: &Frame<'_>, way_m: f64) {
        let registration = frame.registration;
        if registration.confidence < MIN_CONFIDENCE {
            return;
        }
        let bin = (way_m / SAMPLE_M).floor() as i64;
        if self.samples.last().is_none_or(|last| last.bin != bin) {
            let pose = &frame.look.pose;
            self.samples.push(Sample {
                bin,
                frames: 0,
                sum_v: 0.0,
                stamp_ns: pose.stamp_ns,
                place_m: pose.local_from_vehicle([0.0, registration.offset_m]),
                yaw_rad: pose.yaw_rad,
            });
        }
        if let Some(sample) = self.samples.last_mut() {
            sample.frames += 1;
            sample.sum_v += registration.confidence * open_road(frame.hidden);
        }
    }

    /// The rows in capture order; none if the channel never saw anything.
    ///
    /// # Errors
    /// A place is on no tile of `tile_level`.
    pub fn into_rows(
        self,
        chunk: ChunkId,
        frame: &LocalFrame,
        zone: &Zone,
        tile_level: u32,
    ) -> Result<Vec<Footprint>, TileError> {
        let Some((from_m, to_m)) = zone.range_m() else {
            return Ok(Vec::new());
        };
        let row = |sample: Sample| {
            let [east_m, north_m] = sample.place_m;
            let [longitude_deg, latitude_deg, _] = frame.to_wgs84([east_m, north_m, 0.0]);
            Ok(Footprint {
                tile: tile_of(longitude_deg, latitude_deg, tile_level)?.0,
                vehicle: chunk.vehicle.0,
                channel: chunk.channel,
                window: chunk.window,
                method: METHOD_VERSION,
                model: 0,
                kinds: 1 << ElementKind::LaneMarking.code(),
                at_ms: to_window_ms(chunk.window, sample.stamp_ns),
                longitude_e6: (longitude_deg * 1e6).round() as i32,
                latitude_e6: (latitude_deg * 1e6).round() as i32,
                yaw_mrad: (sample.yaw_rad.rem_euclid(std::f64::consts::TAU) * 1e3).round() as i32,
                frames: sample.frames,
                range_from_mm: (from_m * 1e3) as i32,
                range_to_mm: (to_m * 1e3) as i32,
                left_mm: (FAR_SIDE_M * 1e3) as i32,
                right_mm: (-FAR_SIDE_M * 1e3) as i32,
                v_q8: fixed::to_q8(sample.sum_v / f64::from(sample.frames)),
            })
        };
        self.samples.into_iter().map(row).collect()
    }
}
