//! GNSS fixes that can be true, in the chunk's plane.

use tilefold_schemas::log::GnssFix;
use tilefold_tiler::geodesy::LocalFrame;
use tilefold_tiler::recording::Series;

/// Standard deviation of a fix whose receiver states none, in metres.
const DEFAULT_SIGMA_M: f64 = 1.5;
/// Bounds of a stated standard deviation that is believed, in metres.
const SIGMA_M: (f64, f64) = (0.05, 50.0);
/// No car is faster, in m/s: what would need more is a teleport.
const MAX_SPEED_M_S: f64 = 100.0;

/// Usable fixes, one a stamp.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Fixes {
    pub(crate) stamps_ns: Vec<i64>,
    /// East and north.
    pub(crate) positions_m: Vec<[f64; 2]>,
    /// Stated standard deviation of an axis.
    pub(crate) sigmas_m: Vec<f64>,
    /// Fixes that are not used: the receiver claims none, the stamp was there before, or no car
    /// can have been there.
    pub(crate) set_aside: u64,
}

impl Fixes {
    pub(crate) fn new(series: &Series<GnssFix>, frame: &LocalFrame) -> Self {
        let mut fixes = Self::default();
        for fix in series {
            let last = fixes.stamps_ns.last();
            let is_new = last.is_none_or(|&last| fix.stamp_ns > last);
            let degrees = [fix.value.longitude_deg, fix.value.latitude_deg];
            if !fix.value.has_fix || !is_new || degrees.iter().any(|value| !value.is_finite()) {
                fixes.set_aside += 1;
                continue;
            }
            let [east_m, north_m, _] = frame.to_enu([degrees[0], degrees[1], 0.0]);
            fixes.stamps_ns.push(fix.stamp_ns);
            fixes.positions_m.push([east_m, north_m]);
            fixes.sigmas_m.push(sigma_m(&fix.value));
        }
        fixes.drop_teleports();
        fixes
    }

    /// Drops fixes that no car can reach from either neighbour.
    fn drop_teleports(&mut self) {
        let size = self.stamps_ns.len();
        let reachable = |a: usize, b: usize| {
            let seconds = (self.stamps_ns[b] - self.stamps_ns[a]) as f64 * 1e-9;
            let [p, q] = [self.positions_m[a], self.positions_m[b]];
            (q[0] - p[0]).hypot(q[1] - p[1]) <= MAX_SPEED_M_S * seconds.max(0.1)
        };
        let keep: Vec<bool> = (0..size)
            .map(|i| (i > 0 && reachable(i - 1, i)) || (i + 1 < size && reachable(i, i + 1)))
            .collect();
        retain(&mut self.stamps_ns, &keep);
        retain(&mut self.positions_m, &keep);
        retain(&mut self.sigmas_m, &keep);
        self.set_aside += (size - self.stamps_ns.len()) as u64;
    }
}

fn retain<T>(values: &mut Vec<T>, keep: &[bool]) {
    let mut kept = keep.iter();
    values.retain(|_| kept.next() == Some(&true));
}

fn sigma_m(fix: &GnssFix) -> f64 {
    fix.covariance_enu_m2
        .map(|covariance| (0.5 * (covariance[0] + covariance[4])).sqrt())
        .filter(|sigma| sigma.is_finite() && *sigma > 0.0)
        .map_or(DEFAULT_SIGMA_M, |sigma| sigma.clamp(SIGMA_M.0, SIGMA_M.1))
}
