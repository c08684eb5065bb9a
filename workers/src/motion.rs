//! Positions and the slow bias of the heading at the nodes of a trajectory, by robust least squares.
//!
//! The unknowns of a node are its place, the slow error of GNSS there and the bias of its heading:
//!
//! * a fix is place plus slow error plus a little white noise; the loss is Geman-McClure's, so what
//!   no motion explains ends up with no weight;
//! * the slow error is a Gauss-Markov process with the receiver's stated variance, so that many
//!   fixes do not add up to a certainty that they do not have: what the fixes leave open stays in
//!   the covariance of the place;
//! * acceleration is white noise; wheels measure the way between two nodes;
//! * vehicles move where they head: what goes to the side is the heading's bias, or a jump.
//!
//! The last is linear given the way between two nodes, which the round before has found.

use crate::banded::{Banded, Inverse};
use crate::fixes::Fixes;
use crate::median::median;
use crate::nodes::Nodes;

/// Power spectral density of acceleration, m^2/s^3: a car brakes or turns with about 2 m/s^2 for
/// about a second.
const ACCELERATION_PSD: f64 = 2.0;
/// Share of a fix's stated standard deviation that is white, and its least, in metres.
const WHITE_SHARE: f64 = 0.2;
const MIN_WHITE_M: f64 = 0.05;
/// Memory of the slow error of GNSS, in seconds: real receivers drift by 4 % of what they state
/// within a second (0.03 to 0.06 m), which over a minute is still less than what they state.
const GNSS_MEMORY_S: f64 = 1_250.0;
/// Scale below which residuals of neighbouring fixes are not jumps, in metres.
const JUMP_FLOOR_M: f64 = 0.1;
/// Speed to the side of a point of the vehicle, in m/s: what every vehicle has, and what a turn
/// adds for each rad/s, the origin being some way before the axle that does not steer.
const SIDEWAYS_M_S: f64 = 0.1;
const SIDEWAYS_M: f64 = 1.0;
/// How far a heading may be off at first, in radians, and how much its bias moves in a second.
const HEADING_BIAS: f64 = 0.2;
const HEADING_DRIFT: f64 = 0.003;
/// Error of a wheel's speed in m/s, and as a share of it.
const WHEEL_SIGMA_M_S: f64 = 0.05;
const WHEEL_SHARE: f64 = 0.01;
/// A vehicle whose wheels stand moves no faster, in m/s.
const STANDING_M_S: f64 = 0.01;
/// Rounds of re-weighting; they end earlier when the weights have settled.
const ROUNDS: usize = 8;
const SETTLED: f64 = 0.02;

/// Unknowns of a node: east, north, slow error of each, bias of the heading.
const UNKNOWNS: usize = 5;
/// Acceleration couples a node with the two before it.
const BAND: usize = 2 * UNKNOWNS + 1;

/// What is known beside the fixes.
#[derive(Debug, Default)]
pub(crate) struct Guides<'a> {
    /// Yaws at the nodes; none where places follow from fixes alone.
    pub(crate) yaws_rad: Option<&'a [f64]>,
    /// Whether the yaws are news to the fixes: their course over ground is not.
    pub(crate) is_independent: bool,
    /// Where the antenna is in the vehicle frame, in metres.
    pub(crate) antenna_m: [f64; 2],
    /// Way between a node and the next by the wheels, in metres; empty without wheels.
    pub(crate) ways_m: &'a [Option<f64>],
}

/// Places at the nodes.
#[derive(Debug, Clone)]
pub(crate) struct Motion {
    /// East and north of the vehicle's origin.
    pub(crate) places_m: Vec<[f64; 2]>,
    /// What is to be added to the yaws, in radians.
    pub(crate) turns_rad: Vec<f64>,
    /// Covariances of east, north and yaw bias.
    pub(crate) covariances: Vec<[[f64; 3]; 3]>,
}

/// Solves for the motion from a first one on; none if fixes do not determine it.
pub(crate) fn solve(
    nodes: &Nodes,
    fixes: &Fixes,
    guides: &Guides<'_>,
    first: Option<&Motion>,
) -> Option<Motion> {
    let mut weights = vec![1.0; fixes.stamps_ns.len()];
    let mut motion = first.cloned();
    for _ in 0..ROUNDS {
        let rows = Rows::new(nodes, fixes, guides, &weights, motion.as_ref());
        let solved = Solved::new(rows)?;
        let settled = reweigh(&mut weights, &solved.residuals_m(nodes, fixes, guides));
        motion = Some(solved.motion);
        if settled {
            break;
        }
    }
    let rows = Rows::new(nodes, fixes, guides, &weights, motion.as_ref());
    Solved::new(rows)?.with_covariances()
}

/// Gives fixes the weights that their residuals deserve; whether these are nearly the old ones.
fn reweigh(weights: &mut [f64], residuals_m: &[f64]) -> bool {
    let scale_m = 3.0 * median(residuals_m.to_vec()).max(JUMP_FLOOR_M);
    let mut settled = true;
    for (weight, residual_m) in weights.iter_mut().zip(residuals_m) {
        let ratio = residual_m / scale_m;
        let new = 1.0 / (1.0 + ratio * ratio).powi(2);
        settled &= (new - *weight).abs() < SETTLED;
        *weight = new;
    }
    settled
}

/// Weighted rows of the normal equations.
struct Rows {
    normal: Banded<BAND>,
    rhs: Vec<f64>,
}

const EAST: usize = 0;
const NORTH: usize = 1;
const SLOW: usize = 2;
const TURN: usize = 4;

fn index(node: usize, unknown: usize) -> usize {
    UNKNOWNS * node + unknown
}

impl Rows {
    fn new(
        nodes: &Nodes,
        fixes: &Fixes,
        guides: &Guides<'_>,
        weights: &[f64],
        before: Option<&Motion>,
    ) -> Self {
        let mut rows = Self {
            normal: Banded::zero(UNKNOWNS * nodes.len()),
            rhs: vec![0.0; UNKNOWNS * nodes.len()],
        };
        rows.fixes(nodes, fixes, guides, weights);
        rows.processes(nodes, median(fixes.sigmas_m.clone()), guides.is_independent);
        if let (Some(yaws_rad), Some(before)) = (guides.yaws_rad, before) {
            for k in 1..nodes.len() {
                let step = Step::new(k, yaws_rad, before);
                rows.step(&step, guides);
            }
        }
        rows
    }

    fn fixes(&mut self, nodes: &Nodes, fixes: &Fixes, guides: &Guides<'_>, weights: &[f64]) {
        for (i, &stamp_ns) in fixes.stamps_ns.iter().enumerate() {
            let Some((k, share)) = nodes.between(stamp_ns) else {
                continue;
            };
            let arm_m = arm_m(guides, k, share);
            let sigma_m = (WHITE_SHARE * fixes.sigmas_m[i]).max(MIN_WHITE_M) / weights[i].sqrt();
            for axis in [EAST, NORTH] {
                let entries = [
                    (index(k, axis), 1.0 - share),
                    (index(k, SLOW + axis), 1.0 - share),
                    (index(k + 1, axis), share),
                    (index(k + 1, SLOW + axis), share),
                ];
                self.measure(&entries, fixes.positions_m[i][axis] - arm_m[axis], sigma_m);
            }
        }
    }

    /// How everything goes on by itself.
    fn processes(&mut self, nodes: &Nodes, gnss_sigma_m: f64, has_bias: bool) {
        let seconds = Nodes::SPACING_S;
        let kept = (-seconds / GNSS_MEMORY_S).exp();
        let slow_m = gnss_sigma_m * (1.0 - kept * kept).sqrt();
        let bend_m = (ACCELERATION_PSD * seconds.powi(3)).sqrt();
        let first_bias = if has_bias {
            HEADING_BIAS
        } else {
            HEADING_DRIFT
        };
        self.measure(&[(index(0, TURN), 1.0)], 0.0, first_bias);
        for axis in [EAST, NORTH] {
            self.measure(&[(index(0, SLOW + axis), 1.0)], 0.0, gnss_sigma_m);
        }
        for k in 1..nodes.len() {
            for slow in [SLOW, SLOW + 1] {
                let entries = [(index(k - 1, slow), -kept), (index(k, slow), 1.0)];
                self.measure(&entries, 0.0, slow_m);
            }
            let entries = [(index(k - 1, TURN), -1.0), (index(k, TURN), 1.0)];
            self.measure(&entries, 0.0, HEADING_DRIFT * seconds.sqrt());
        }
        for k in 2..nodes.len() {
            for axis in [EAST, NORTH] {
                let entries = [
                    (index(k - 2, axis), 1.0),
                    (index(k - 1, axis), -2.0),
                    (index(k, axis), 1.0),
                ];
                self.measure(&entries, 0.0, bend_m);
            }
        }
    }

    /// What heading and wheels say of the way between two nodes.
    fn step(&mut self, step: &Step, guides: &Guides<'_>) {
        let seconds = Nodes::SPACING_S;
        let (sin, cos) = step.yaw_rad.sin_cos();
        let along = step.displacement(cos, sin);
        let way_m = guides.ways_m.get(step.to - 1).copied().flatten();
        if let Some(way_m) = way_m {
            let sigma_m = match way_m == 0.0 {
                true => STANDING_M_S * seconds,
                false => WHEEL_SIGMA_M_S * seconds + WHEEL_SHARE * way_m.abs(),
            };
            self.measure(&along, way_m, sigma_m);
        }
        if guides.is_independent {
            let [a, b, c, d] = step.displacement(-sin, cos);
            let way_m = way_m.unwrap_or(step.way_m(cos, sin));
            let half_m = -0.5 * way_m;
            let turns = [
                (index(step.to - 1, TURN), half_m),
                (index(step.to, TURN), half_m),
            ];
            let sideways_m_s = SIDEWAYS_M_S + SIDEWAYS_M * step.turn_rad.abs() / seconds;
            self.measure(
                &[a, b, turns[0], c, d, turns[1]],
                -way_m * step.bias_rad,
                sideways_m_s * seconds,
            );
        }
    }

    fn measure(&mut self, entries: &[(usize, f64)], value: f64, sigma: f64) {
        let weight = sigma.powi(-2);
        self.normal.add_row(entries, weight);
        for &(index, entry) in entries {
            self.rhs[index] += weight * entry * value;
        }
    }
}

/// The way from a node to the next, as the round before has it.
struct Step {
    to: usize,
    /// Mean yaw, bias included, and the bias.
    yaw_rad: f64,
    bias_rad: f64,
    turn_rad: f64,
    moved_m: [f64; 2],
}

impl Step {
    fn new(to: usize, yaws_rad: &[f64], before: &Motion) -> Self {
        let bias_rad = 0.5 * (before.turns_rad[to - 1] + before.turns_rad[to]);
        let (a, b) = (before.places_m[to - 1], before.places_m[to]);
        Self {
            to,
            yaw_rad: 0.5 * (yaws_rad[to - 1] + yaws_rad[to]) + bias_rad,
            bias_rad,
            turn_rad: yaws_rad[to] - yaws_rad[to - 1],
            moved_m: [b[0] - a[0], b[1] - a[1]],
        }
    }

    /// Entries of the displacement in a direction.
    fn displacement(&self, east: f64, north: f64) -> [(usize, f64); 4] {
        [
            (index(self.to - 1, EAST), -east),
            (index(self.to - 1, NORTH), -north),
            (index(self.to, EAST), east),
            (index(self.to, NORTH), north),
        ]
    }

    fn way_m(&self, east: f64, north: f64) -> f64 {
        east * self.moved_m[0] + north * self.moved_m[1]
    }
}

/// Where the antenna is from the vehicle's origin, east and north.
fn arm_m(guides: &Guides<'_>, k: usize, share: f64) -> [f64; 2] {
    let Some(yaws_rad) = guides.yaws_rad else {
        return [0.0; 2];
    };
    let [x, y] = guides.antenna_m;
    let (sin, cos) = (yaws_rad[k] + share * (yaws_rad[k + 1] - yaws_rad[k])).sin_cos();
    [cos * x - sin * y, sin * x + cos * y]
}

/// A solution with the factors that it came of.
struct Solved {
    motion: Motion,
    slow_m: Vec<[f64; 2]>,
    factor: crate::banded::Factor<BAND>,
}

impl Solved {
    fn new(rows: Rows) -> Option<Self> {
        let factor = rows.normal.factorise()?;
        let solution = factor.solve(rows.rhs);
        let pair = |state: &[f64], first: usize| [state[first], state[first + 1]];
        let states = solution.chunks_exact(UNKNOWNS);
        Some(Self {
            motion: Motion {
                places_m: states.clone().map(|state| pair(state, EAST)).collect(),
                turns_rad: states.clone().map(|state| state[TURN]).collect(),
                covariances: Vec::new(),
            },
            slow_m: states.map(|state| pair(state, SLOW)).collect(),
            factor,
        })
    }

    /// Distances of the fixes from where they would be without white noise.
    fn residuals_m(&self, nodes: &Nodes, fixes: &Fixes, guides: &Guides<'_>) -> Vec<f64> {
        let expected = |k: usize, axis: usize| self.motion.places_m[k][axis] + self.slow_m[k][axis];
        let residual = |(&stamp_ns, position_m): (&i64, &[f64; 2])| {
            let (k, share) = nodes.between(stamp_ns)?;
            let arm_m = arm_m(guides, k, share);
            let [east, north] = [EAST, NORTH].map(|axis| {
                let here = (1.0 - share) * expected(k, axis) + share * expected(k + 1, axis);
                position_m[axis] - arm_m[axis] - here
            });
            Some(east.hypot(north))
        };
        let fixes = fixes.stamps_ns.iter().zip(&fixes.positions_m);
        fixes.map(|fix| residual(fix).unwrap_or(0.0)).collect()
    }

    fn with_covariances(mut self) -> Option<Motion> {
        let inverse: Inverse<BAND> = self.factor.inverse();
        let unknowns = [EAST, NORTH, TURN];
        let of_node =
            |k: usize| unknowns.map(|a| unknowns.map(|b| inverse.entry(index(k, a), index(k, b))));
        let nodes = self.motion.places_m.len();
        self.motion.covariances = (0..nodes).map(of_node).collect();
        Some(self.motion)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A case of `oracles/smoother.txt`, which dense least squares solved.
    #[derive(Default)]
    struct Case {
        fixes: Fixes,
        yaws_rad: Vec<f64>,
        ways_m: Vec<Option<f64>>,
        /// East, north, turn and their covariance.
        nodes: Vec<Vec<f64>>,
    }

    fn cases() -> Vec<Case> {
        let mut cases: Vec<Case> = Vec::new();
        for line in include_str!("../oracles/smoother.txt").lines().skip(1) {
            let mut words = line.split(' ');
            let kind = words.next().unwrap();
            let values: Vec<f64> = words.map(|word| word.parse().unwrap()).collect();
            if kind == "case" {
                cases.push(Case::default());
                continue;
            }
            let case = cases.last_mut().unwrap();
            match kind {
                "fix" => {
                    case.fixes.stamps_ns.push((values[0] * 1e9).round() as i64);
                    case.fixes.positions_m.push([values[1], values[2]]);
                    case.fixes.sigmas_m.push(values[3]);
                }
                "yaw" => case.yaws_rad.push(values[0]),
                "way" => case.ways_m.push(Some(values[0])),
                _ => case.nodes.push(values),
            }
        }
        cases
    }

    #[test]
    fn agrees_with_dense_least_squares() {
        let cases = cases();
        assert_eq!(cases.len(), 3);
        for case in cases {
            let nodes = Nodes::around(0, 200_000_000 * (case.nodes.len() as i64 - 2));
            assert_eq!(nodes.len(), case.nodes.len());
            let mut motion = solve(&nodes, &case.fixes, &Guides::default(), None).unwrap();
            if !case.yaws_rad.is_empty() {
                let guides = Guides {
                    yaws_rad: Some(&case.yaws_rad),
                    is_independent: true,
                    antenna_m: [0.0; 2],
                    ways_m: &case.ways_m,
                };
                motion = solve(&nodes, &case.fixes, &guides, Some(&motion)).unwrap();
            }
            for (k, expected) in case.nodes.iter().enumerate() {
                let [east, north] = motion.places_m[k];
                let covariance = motion.covariances[k].iter().flatten();
                let found = [east, north, motion.turns_rad[k]];
                for (found, expected) in found.iter().chain(covariance).zip(expected) {
                    assert!((found - expected).abs() < 1e-6, "{k}: {found} {expected}");
                }
            }
        }
    }

    #[test]
    fn a_heading_holds_through_what_positions_alone_follow() {
        // Straight on at 10 m/s; for 1.5 s the positions are 3 m aside.
        let aside = |k: i64| if (50..60).contains(&k) { 3.0 } else { 0.0 };
        let fixes = Fixes {
            stamps_ns: (0..150).map(|k| k * 150_000_000).collect(),
            positions_m: (0..150).map(|k| [1.5 * k as f64, aside(k)]).collect(),
            sigmas_m: vec![1.5; 150],
            set_aside: 0,
        };
        let nodes = Nodes::around(0, 149 * 150_000_000);
        let alone = solve(&nodes, &fixes, &Guides::default(), None).unwrap();
        let yaws_rad = vec![0.0; nodes.len()];
        let guides = Guides {
            yaws_rad: Some(&yaws_rad),
            is_independent: true,
            ..Guides::default()
        };
        let guided = solve(&nodes, &fixes, &guides, Some(&alone)).unwrap();
        let farthest_m = |motion: &Motion| {
            let aside = motion.places_m.iter().map(|place| place[1].abs());
            aside.fold(0.0, f64::max)
        };
        assert!(farthest_m(&alone) > 2.0, "{}", farthest_m(&alone));
        assert!(farthest_m(&guided) < 0.3, "{}", farthest_m(&guided));
    }
}
