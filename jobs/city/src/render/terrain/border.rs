//! How far a place lies beyond the road's border, from lanes and kerbs.

use crate::render::buckets::Buckets;
use crate::world::{Point, World};

/// Metres within which a kerb decides; beyond, the lanes alone do.
const KERB_REACH_M: f64 = 6.0;
/// Road beyond the outer lanes' widths where there is no kerb, in metres.
const SHOULDER_M: f64 = 0.3;
/// Kerbs take no more than this onto the road beyond the lanes, in metres.
const MOST_SHOULDER_M: f64 = 5.0;
/// Pieces are no longer than this, so that they are found from the square that they begin in.
const PIECE_M: f64 = 16.0;
/// Metres beside a kerb at which its road side is looked for.
const KERB_SIDE_M: f64 = 0.6;
/// Wheels run this far to both sides of a lane's middle, over this width, in metres.
const TRACK_M: f64 = 0.78;
const TRACK_WIDTH_M: f64 = 0.3;
/// Far from everything, in metres.
const FAR_M: f64 = 60.0;

/// A straight piece of a lane's middle or a kerb.
#[derive(Debug, Clone, Copy)]
struct Piece {
    from: [f64; 2],
    /// Unit vector, and how far along it the piece goes.
    along: [f64; 2],
    length_m: f64,
    /// Half of a lane's width; 0 for a kerb.
    half_m: f64,
    /// Which side of a kerb is road: 1 left, -1 right, 0 unknown or both.
    road_side: f64,
    /// Metres from a kerb to the lanes.
    gap_m: f64,
}

impl Piece {
    /// Distance to a place, and how far to the left of the piece it lies.
    fn see(&self, [east_m, north_m]: [f64; 2]) -> (f64, f64) {
        let (de, dn) = (east_m - self.from[0], north_m - self.from[1]);
        let along_m = de * self.along[0] + dn * self.along[1];
        let left_m = dn * self.along[0] - de * self.along[1];
        let beyond_m = (-along_m).max(along_m - self.length_m).max(0.0);
        ((left_m * left_m + beyond_m * beyond_m).sqrt(), left_m)
    }
}

fn pieces(points: &[Point], half_m: f64) -> Vec<Piece> {
    let mut pieces = Vec::new();
    for pair in points.windows(2) {
        let (de, dn) = (pair[1][0] - pair[0][0], pair[1][1] - pair[0][1]);
        let length_m = de.hypot(dn);
        if length_m < 1e-6 {
            continue;
        }
        let along = [de / length_m, dn / length_m];
        let parts = (length_m / PIECE_M).ceil();
        for part in 0..parts as u32 {
            let at_m = f64::from(part) * length_m / parts;
            pieces.push(Piece {
                from: [pair[0][0] + along[0] * at_m, pair[0][1] + along[1] * at_m],
                along,
                length_m: length_m / parts,
                half_m,
                road_side: 0.0,
                gap_m: 0.0,
            });
        }
    }
    pieces
}

/// All lanes and kerbs of a city.
pub(super) struct Borders {
    lanes: Vec<Piece>,
    kerbs: Vec<Piece>,
    lane_buckets: Buckets,
    kerb_buckets: Buckets,
}

impl Borders {
    pub(super) fn new(world: &World) -> Self {
        let lanes = world.lanes.iter();
        let lanes: Vec<Piece> = lanes
            .flat_map(|lane| pieces(&lane.centre, lane.width_m / 2.0))
            .collect();
        let kerbs = world.kerbs.iter().flat_map(|kerb| pieces(kerb, 0.0));
        let mut borders = Self {
            lane_buckets: bucketed(&lanes),
            lanes,
            kerbs: Vec::new(),
            kerb_buckets: Buckets::default(),
        };
        borders.kerbs = kerbs.map(|kerb| borders.sided(kerb)).collect();
        borders.kerb_buckets = bucketed(&borders.kerbs);
        borders
    }

    /// The kerb with its road side: the one on which lanes are nearer.
    fn sided(&self, kerb: Piece) -> Piece {
        let beside = |side: f64| {
            let along_m = kerb.length_m / 2.0;
            let place = [
                kerb.from[0] + kerb.along[0] * along_m - kerb.along[1] * side,
                kerb.from[1] + kerb.along[1] * along_m + kerb.along[0] * side,
            ];
            let near = self.lane_buckets.near(place, PIECE_M + MOST_SHOULDER_M);
            let beyond = near.iter().map(|&index| {
                let lane = &self.lanes[index as usize];
                lane.see(place).0 - lane.half_m
            });
            beyond.fold(FAR_M, f64::min)
        };
        let (left_m, right_m) = (beside(KERB_SIDE_M), beside(-KERB_SIDE_M));
        // Between two lanes of traffic a kerb is an island's: both sides are road.
        let road_side = if left_m.max(right_m) < 0.0 || left_m == right_m {
            0.0
        } else if left_m < right_m {
            1.0
        } else {
            -1.0
        };
        Piece {
            road_side,
            gap_m: left_m.min(right_m) + KERB_SIDE_M,
            ..kerb
        }
    }

    /// What lies near a square.
    pub(super) fn near(&self, corner: [f64; 2], side_m: f64) -> Near {
        let middle = corner.map(|metres| metres + side_m / 2.0);
        let reach_m = side_m / 2.0 + PIECE_M + FAR_M / 2.0;
        let take = |buckets: &Buckets, pieces: &[Piece]| {
            let near = buckets.near(middle, reach_m);
            near.iter().map(|&index| pieces[index as usize]).collect()
        };
        Near {
            lanes: take(&self.lane_buckets, &self.lanes),
            kerbs: take(&self.kerb_buckets, &self.kerbs),
            nearest: Vec::new(),
            nearest_kerbs: Vec::new(),
        }
    }
}

fn bucketed(pieces: &[Piece]) -> Buckets {
    let mut buckets = Buckets::default();
    for (index, piece) in (0..).zip(pieces) {
        buckets.add(index, piece.from);
    }
    buckets
}

/// The lanes and kerbs near a square, and those that can be the nearest within a block of it.
pub(super) struct Near {
    lanes: Vec<Piece>,
    kerbs: Vec<Piece>,
    nearest: Vec<Piece>,
    nearest_kerbs: Vec<Piece>,
}

impl Near {
    /// Keeps those that can be the nearest to a place within `radius_m` of `middle`.
    pub(super) fn narrow(&mut self, middle: [f64; 2], radius_m: f64) {
        narrow(&self.lanes, middle, radius_m, &mut self.nearest);
        narrow(&self.kerbs, middle, radius_m, &mut self.nearest_kerbs);
    }

    /// Metres beyond the road's border (negative on the road), and whether wheels run there (0 to 1).
    pub(super) fn at(&self, place: [f64; 2]) -> (f64, f64) {
        let (mut beyond_m, mut track) = (FAR_M, 0.0);
        let mut offset_m = f64::INFINITY;
        for lane in &self.nearest {
            let (distance_m, _) = lane.see(place);
            beyond_m = f64::min(beyond_m, distance_m - lane.half_m);
            offset_m = f64::min(offset_m, distance_m);
        }
        if offset_m.is_finite() {
            let side = (offset_m - TRACK_M) / TRACK_WIDTH_M;
            track = (-side * side).exp();
        }
        (self.off_road_m(place, beyond_m - SHOULDER_M), track)
    }

    fn off_road_m(&self, place: [f64; 2], beyond_lanes_m: f64) -> f64 {
        let seen = self
            .nearest_kerbs
            .iter()
            .map(|kerb| (kerb.see(place), kerb));
        let nearest = seen.min_by(|((a, _), _), ((b, _), _)| a.total_cmp(b));
        let Some(((distance_m, left_m), kerb)) = nearest else {
            return beyond_lanes_m;
        };
        if distance_m > KERB_REACH_M || kerb.road_side == 0.0 {
            return beyond_lanes_m;
        }
        let is_road = left_m * kerb.road_side > 0.0;
        // Across the lanes from a kerb there may be none.
        if is_road && distance_m > kerb.gap_m.max(0.0) + SHOULDER_M {
            return beyond_lanes_m;
        }
        let beyond_kerb_m = if is_road { -distance_m } else { distance_m };
        // Well within the lanes is road whatever the kerb says: the nearest may be round a corner.
        let lanes_m = beyond_lanes_m + SHOULDER_M;
        beyond_kerb_m
            .min(lanes_m + SHOULDER_M)
            .max(lanes_m - MOST_SHOULDER_M)
    }
}

fn narrow(pieces: &[Piece], middle: [f64; 2], radius_m: f64, into: &mut Vec<Piece>) {
    let beyond = |piece: &Piece| piece.see(middle).0 - piece.half_m;
    let least_m = pieces.iter().map(beyond).fold(f64::INFINITY, f64::min);
    // Two more metres, so that wheel tracks belong to the lane that they are in.
    let near = |piece: &&Piece| beyond(piece) <= least_m + 2.0 * radius_m + 2.0;
    into.clear();
    into.extend(pieces.iter().filter(near));
}
