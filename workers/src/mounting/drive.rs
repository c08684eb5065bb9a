//! The frames of a drive that a mounting is told from, and the Gauss-Newton rounds over them.

use nalgebra::{Matrix4, Vector4};

use super::{Mounting, PRIOR_SIGMA, corrected};
use crate::cuts::{CrossCut, CutLine, cut_seen};
use crate::local_map::LocalMap;
use crate::look::{Look, SeenLine};
use crate::matching::{GATE_M, match_lines};
use crate::median::median;
use crate::pixels::{Casting, Pixels};
use crate::profile::{Profile, seen_profiles};
use crate::register::{Glance, Registration, register};
use crate::testify::MIN_CONFIDENCE;

/// No mounting is farther off than this.
const BOUNDS: [f64; 4] = [0.10, 0.14, 0.14, 0.6];
/// Steps of the numerical derivatives: large, for where a line's last point comes into range or
/// leaves it, the line jumps a little.
const STEPS: [f64; 4] = [2e-3, 2e-3, 2e-3, 1e-2];
/// No line in range moves faster to the side, in metres per radian or metre: this one has jumped.
const MAX_SLOPE: f64 = 200.0;
/// A correction that is known to less than this share of the prior's spread was not observed.
const OBSERVED_SHARE: f64 = 0.7;
/// Noise of a lateral residual apart from mounting and place, in metres: detector and map.
const RESIDUAL_SIGMA_M: f64 = 0.15;
/// Scale of the robust loss by round, in metres: at first all matches pull, in the end only those
/// in place. The last one is kept.
const ROBUST_SCALES_M: [f64; 4] = [0.8, 0.5, 0.3, 0.2];
/// Corrections that the search begins at: the stated mounting, and if nothing that fits is found
/// from it, far up and down.
const STARTS: [[f64; 4]; 3] = [[0.0; 4], [0.0, 0.05, 0.0, 0.0], [0.0, -0.05, 0.0, 0.0]];
/// A mounting does not fit if its lines are off by this in the median, in metres.
const WIDE_MISS_M: f64 = 0.2;
/// Rounds of registration, matching and a Gauss-Newton step.
const ROUNDS: usize = 12;
/// A round that moves nothing by more than this share of the prior's spread is the last.
const SETTLED_SHARE: f64 = 0.01;
/// Frames are used this far apart, in nanoseconds: those between see the same paint.
const FRAME_NS: i64 = 500_000_000;
/// Way over which paint is one witness, in metres.
const WITNESS_M: f64 = 5.0;
/// Fewer pairs of lines tell nothing.
const MIN_PAIRS: usize = 20;

/// A correction, which parts of it were observed, and their standard deviations.
type Settled = ([f64; 4], [bool; 4], [f64; 4]);

/// The frames that are used.
pub(super) struct Drive<'a> {
    pixels: &'a Pixels,
    casting: &'a Casting,
    frames: Vec<Used<'a>>,
}

struct Used<'a> {
    look: &'a Look,
    mapped: &'a [CutLine],
    mapped_profiles: Vec<Profile>,
    /// Witnesses that a line of this frame is worth.
    worth: f64,
}

impl<'a> Drive<'a> {
    pub(super) fn new(
        pixels: &'a Pixels,
        casting: &'a Casting,
        looks: &'a [Look],
        cross_cuts: &'a [CrossCut],
        map: &LocalMap<'_>,
    ) -> Self {
        let mut frames: Vec<Used<'a>> = Vec::new();
        for (look, cross_cut) in looks.iter().zip(cross_cuts) {
            let before = frames.last().map(|used| &used.look.pose);
            if before.is_some_and(|before| look.pose.stamp_ns - before.stamp_ns < FRAME_NS) {
                continue;
            }
            let way_m = before.map_or(0.0, |before| {
                let east_m = look.pose.east_m - before.east_m;
                east_m.hypot(look.pose.north_m - before.north_m)
            });
            frames.push(Used {
                look,
                mapped: &cross_cut.mapped,
                mapped_profiles: map.profiles(&cross_cut.mapped),
                worth: (way_m / WITNESS_M).min(1.0),
            });
        }
        Self {
            pixels,
            casting,
            frames,
        }
    }

    /// The mounting that lays the drive on the map; the stated one if none does it better.
    pub(super) fn mounting(&self) -> Mounting {
        let laid = self.lay([0.0; 4]);
        let stated = Mounting::stated(laid.pairs.len(), laid.miss_m());
        let mut best = (laid.gain(), stated);
        for start in STARTS {
            let fits = best.1.correction != [0.0; 4] && best.1.refined_miss_m < WIDE_MISS_M;
            let found = (!fits).then(|| self.from(start, stated)).flatten();
            best = found.filter(|found| found.0 > best.0).unwrap_or(best);
        }
        best.1
    }

    /// What is found from one start, and its score; none if that is nothing.
    fn from(&self, start: [f64; 4], stated: Mounting) -> Option<(f64, Mounting)> {
        let mut settled = self.settle(start, [true; 4])?;
        // What is not observed must not take part in what is.
        if settled.1 != [true; 4] {
            settled = self.settle(start, settled.1)?;
        }
        let (correction, is_observed, sigma) = settled;
        let laid = self.lay(correction);
        let is_within = (0..4).all(|k| correction[k].abs() < BOUNDS[k]);
        let mounting = Mounting {
            correction,
            sigma,
            is_observed,
            pairs: laid.pairs.len(),
            refined_miss_m: laid.miss_m(),
            ..stated
        };
        let score = laid.gain() - prior_nats(correction);
        (is_within && laid.pairs.len() >= MIN_PAIRS).then_some((score, mounting))
    }

    /// Rounds of registration and Gauss-Newton over the parts of the correction that are `free`.
    fn settle(&self, start: [f64; 4], free: [bool; 4]) -> Option<Settled> {
        let mut at = [0, 1, 2, 3].map(|k| if free[k] { start[k] } else { 0.0 });
        let mut covariance = Matrix4::zeros();
        let mut slopes = Slopes::new(self, at);
        for round in 0..ROUNDS {
            let scale_m = ROBUST_SCALES_M[round.min(ROBUST_SCALES_M.len() - 1)];
            // In the rounds of the last scale it moves too little for the slopes to change.
            if (1..ROBUST_SCALES_M.len()).contains(&round) {
                slopes = Slopes::new(self, at);
            }
            let (mut normal, mut downhill) = self.normal_equations(at, &slopes, scale_m);
            for k in 0..4 {
                hold(k, free[k], at[k], &mut normal, &mut downhill);
            }
            let solver = normal.cholesky()?;
            covariance = solver.inverse();
            let step = solver.solve(&downhill);
            for k in 0..4 {
                at[k] = (at[k] + step[k]).clamp(-BOUNDS[k], BOUNDS[k]);
            }
            let is_small = (0..4).all(|k| step[k].abs() < SETTLED_SHARE * PRIOR_SIGMA[k]);
            if is_small && round >= ROBUST_SCALES_M.len() {
                break;
            }
        }
        let sigma = [0, 1, 2, 3].map(|k| covariance[(k, k)].sqrt());
        let is_told = |k: usize| free[k] && sigma[k] < OBSERVED_SHARE * PRIOR_SIGMA[k];
        Some((at, [0, 1, 2, 3].map(is_told), sigma))
    }

    /// Seen lines of every frame under a correction.
    fn lines(&self, correction: [f64; 4]) -> Vec<Vec<SeenLine>> {
        let camera = corrected(&self.casting.camera, correction);
        let lines = self.frames.iter().map(|used| {
            let stamp_ns = used.look.pose.stamp_ns;
            let surface = self.casting.surface(stamp_ns);
            self.pixels.lines(stamp_ns, &camera, surface)
        });
        lines.collect()
    }

    /// The cuts of them.
    fn seen(&self, correction: [f64; 4]) -> Vec<Vec<CutLine>> {
        let lines = self.lines(correction);
        lines.iter().map(|lines| cut_seen(lines)).collect()
    }

    /// Lays all frames on the map under a correction.
    fn lay(&self, correction: [f64; 4]) -> Laid {
        let cut = |lines: &Vec<SeenLine>| {
            let cuts = cut_seen(lines);
            let profiles = seen_profiles(&cuts, lines);
            (cuts, profiles)
        };
        let lines = self.lines(correction);
        let (seen, seen_profiles): (Vec<_>, Vec<_>) = lines.iter().map(cut).unzip();
        let frames = self.frames.iter().zip(&seen_profiles);
        let glances: Vec<Glance<'_>> = frames
            .map(|(used, seen)| Glance {
                stamp_ns: used.look.pose.stamp_ns,
                place_m: [used.look.pose.east_m, used.look.pose.north_m],
                seen,
                mapped: &used.mapped_profiles,
            })
            .collect();
        let registrations = register(&glances);
        let mut laid = Laid::default();
        for (frame, (seen, registration)) in seen.into_iter().zip(registrations).enumerate() {
            self.pair(frame, seen, registration, &mut laid);
        }
        laid
    }

    fn pair(&self, frame: usize, seen: Vec<CutLine>, registration: Registration, laid: &mut Laid) {
        let used = &self.frames[frame];
        if registration.confidence < MIN_CONFIDENCE {
            return;
        }
        let cross_cut = CrossCut {
            seen,
            mapped: used.mapped.to_vec(),
        };
        let matches = match_lines(&cross_cut, registration.offset_m, 0.0);
        for pair in matches.pairs.iter().filter(|pair| !pair.is_ambiguous) {
            let seen = &cross_cut.seen[pair.seen];
            let mapped = &cross_cut.mapped[pair.mapped];
            let misses =
                common(seen, mapped).map(|(range, miss_m)| (range, miss_m + registration.offset_m));
            laid.pairs.push(Paired {
                frame,
                line: seen.line,
                misses_m: misses.collect(),
                worth: used.worth * registration.confidence,
            });
        }
    }

    /// Information about the correction at `at`, and which way is downhill.
    fn normal_equations(
        &self,
        at: [f64; 4],
        slopes: &Slopes,
        scale_m: f64,
    ) -> (Matrix4<f64>, Vector4<f64>) {
        let mut normal = Matrix4::zeros();
        let mut downhill = Vector4::zeros();
        for pairs in self.lay(at).pairs.chunk_by(|a, b| a.frame == b.frame) {
            let mut sums = FrameSums::default();
            for pair in pairs {
                let weight = pair.worth / (pair.misses_m.len() as f64 * RESIDUAL_SIGMA_M.powi(2));
                for &(range, miss_m) in &pair.misses_m {
                    if let Some(slope) = slopes.at(pair, range) {
                        let z = miss_m / scale_m;
                        sums.add(slope, miss_m, weight / (1.0 + z * z));
                    }
                }
            }
            let (information, gradient) = sums.without_place();
            normal += information;
            downhill -= gradient;
        }
        (normal, downhill)
    }
}

/// The prior of a correction against that of none.
fn prior_nats(correction: [f64; 4]) -> f64 {
    let nats = |k: usize| (0.5 * (correction[k] / PRIOR_SIGMA[k]).powi(2)).ln_1p();
    (0..4).map(nats).sum()
}

/// Adds the prior of one part of the correction, which is at `at`, or holds it where it is.
fn hold(k: usize, is_free: bool, at: f64, normal: &mut Matrix4<f64>, downhill: &mut Vector4<f64>) {
    if is_free {
        // A Cauchy prior as a weight: tight near the stated mounting, slack far off.
        let weight = 2.0 / (2.0 * PRIOR_SIGMA[k].powi(2) + at * at);
        downhill[k] -= weight * at;
        normal[(k, k)] += weight;
    } else {
        normal.row_mut(k).fill(0.0);
        normal.column_mut(k).fill(0.0);
        normal[(k, k)] = PRIOR_SIGMA[k].powi(-2);
        downhill[k] = 0.0;
    }
}

/// How seen lines move with the parts of the correction, by finite differences.
struct Slopes {
    here: Vec<Vec<CutLine>>,
    moved: [Vec<Vec<CutLine>>; 4],
}

impl Slopes {
    fn new(drive: &Drive<'_>, at: [f64; 4]) -> Self {
        let moved = |k: usize| {
            let mut moved = at;
            moved[k] += STEPS[k];
            drive.seen(moved)
        };
        Self {
            here: drive.seen(at),
            moved: [0, 1, 2, 3].map(moved),
        }
    }

    /// Metres to the left per unit of every part; none where a line ends at this range.
    fn at(&self, pair: &Paired, range: usize) -> Option<Vector4<f64>> {
        let here_m = lateral_m(&self.here[pair.frame], pair.line, range)?;
        let mut slopes = Vector4::zeros();
        for (k, moved) in self.moved.iter().enumerate() {
            slopes[k] = (lateral_m(&moved[pair.frame], pair.line, range)? - here_m) / STEPS[k];
        }
        (slopes.amax() < MAX_SLOPE).then_some(slopes)
    }
}

fn lateral_m(lines: &[CutLine], line: usize, range: usize) -> Option<f64> {
    let line = lines.iter().find(|seen| seen.line == line)?;
    let cut = line.cuts.iter().find(|cut| cut.range == range)?;
    Some(cut.lateral_m)
}

/// Sums over one frame's residuals.
#[derive(Default)]
struct FrameSums {
    slopes2: Matrix4<f64>,
    slopes: Vector4<f64>,
    slopes_miss: Vector4<f64>,
    miss: f64,
    weight: f64,
}

impl FrameSums {
    fn add(&mut self, slopes: Vector4<f64>, miss_m: f64, weight: f64) {
        self.slopes2 += weight * slopes * slopes.transpose();
        self.slopes += weight * slopes;
        self.slopes_miss += weight * miss_m * slopes;
        self.miss += weight * miss_m;
        self.weight += weight;
    }

    /// Information and gradient, with what is common to all of the frame's residuals taken out.
    fn without_place(&self) -> (Matrix4<f64>, Vector4<f64>) {
        let share = 1.0 / self.weight.max(f64::MIN_POSITIVE);
        (
            self.slopes2 - share * self.slopes * self.slopes.transpose(),
            self.slopes_miss - share * self.miss * self.slopes,
        )
    }
}

/// A seen line with its map line.
struct Paired {
    frame: usize,
    line: usize,
    /// Range, and how far left of the map's the seen line lies there after registration.
    misses_m: Vec<(usize, f64)>,
    worth: f64,
}

#[derive(Default)]
struct Laid {
    pairs: Vec<Paired>,
}

impl Laid {
    /// Median distance from the map, in metres.
    fn miss_m(&self) -> f64 {
        let misses = self.pairs.iter().flat_map(|pair| &pair.misses_m);
        median(misses.map(|(_, miss_m)| miss_m.abs()).collect())
    }

    /// Log-likelihood of the witnesses against lines that lie just anywhere within the gate, in nats.
    fn gain(&self) -> f64 {
        let scale_m = ROBUST_SCALES_M[ROBUST_SCALES_M.len() - 1];
        let loss = |miss_m: f64| (miss_m / scale_m).powi(2).ln_1p();
        let of = |pair: &Paired| {
            let sum: f64 = pair.misses_m.iter().map(|(_, miss_m)| loss(*miss_m)).sum();
            pair.worth * (loss(GATE_M) - sum / pair.misses_m.len() as f64)
        };
        self.pairs.iter().map(of).sum()
    }
}

/// Ranges that both lines have, and seen minus mapped lateral position there.
fn common<'a>(seen: &'a CutLine, mapped: &'a CutLine) -> impl Iterator<Item = (usize, f64)> + 'a {
    seen.cuts.iter().filter_map(|cut| {
        let other = mapped.cuts.iter().find(|other| other.range == cut.range)?;
        Some((cut.range, cut.lateral_m - other.lateral_m))
    })
}
