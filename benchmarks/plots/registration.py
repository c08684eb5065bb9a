"""Places drives on a map: positions smoothed, clock offset and lateral offset found from the lane lines.

It is the prototype of decisions 0004 and 0005, kept apart from the program on purpose: what it measures on real and
simulated drives does not depend on what the program believes of them. Needs numpy and scipy.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import solveh_banded
from scipy.special import ndtr

# Where lines are compared: metres ahead, and the stretch that a detection's line is fitted to.
AHEAD_M, NEAR_M, FAR_M = 7.0, 3.5, 10.5
LEAST_LENGTH_M, MOST_SLOPE, MOST_RMS_M = 1.0, 1.0, 0.3
# Fixes this far from the smoothed path (metres) are not used; below this speed the course says nothing.
OUTLIER_M, LEAST_SPEED_M_S = 2.0, 3.0
GRID_M = np.arange(-6, 6.01, 0.1)
SCALES = np.arange(0.93, 1.231, 0.02)
SCALE_MEAN, SCALE_SIGMA = 1.05, 0.1
EVERY_S = 0.2
# Of the chain: time constant of the position's error, the weight of one frame (errors of frames 0.2 s apart are
# nearly the same), and the share of detections that no line explains.
OFFSET_S, TEMPER, STRAY = 52.0, 0.05, 0.3


@dataclass
class Track:
    """A drive's smoothed motion at the stamps of its fixes."""

    t: np.ndarray
    fix: np.ndarray
    at: np.ndarray
    yaw: np.ndarray
    speed: np.ndarray
    good: np.ndarray
    yaw_bias: float  # median of what was added to the measured yaw, radians

    def pose(self, t):
        """Position, yaw, speed; None where the motion is not known."""
        after = np.searchsorted(self.t, t)
        if not 0 < after < len(self.t) or not (self.good[after - 1] and self.good[after]):
            return None
        at = np.array([np.interp(t, self.t, self.at[:, axis]) for axis in (0, 1)])
        return at, np.interp(t, self.t, self.yaw), np.interp(t, self.t, self.speed)


def smooth(t, fix, fix_sigma_m=0.3, acceleration_m_s2=1.5):
    """Least squares of second differences, with Cauchy weights for the fixes."""
    step = np.median(np.diff(t))
    stiff = 1 / (acceleration_m_s2 * step * step) ** 2
    n, reach = len(t), int(0.5 / step) or 1
    diagonal, beside, second = np.zeros(n), np.zeros(n), np.zeros(n)
    diagonal[:-2] += 1
    diagonal[1:-1] += 4
    diagonal[2:] += 1
    beside[1:-1] -= 2
    beside[2:] -= 2
    second[2:] += 1
    window = np.clip(np.arange(n)[:, None] + np.arange(-reach, reach + 1), 0, n - 1)
    at = np.median(fix[window], axis=1)
    for _ in range(8):
        off = np.hypot(*(fix - at).T)
        weight = 1 / fix_sigma_m**2 / (1 + (off / (2 * fix_sigma_m)) ** 2)
        bands = np.stack([stiff * second, stiff * beside, stiff * diagonal + weight])
        at = solveh_banded(bands, fix * weight[:, None])
    return at


def track(drive, plane):
    """The motion of a drive: heading = measured yaw + what it slowly differs from the course."""
    if len(drive.fixes) < 30 or len(drive.yaws) < 30:
        return None
    keep = np.diff(drive.fixes[:, 0], prepend=-np.inf) > 0
    t, fix = drive.fixes[keep, 0], plane(*drive.fixes[keep, 1:].T)
    at, step = smooth(t, fix), np.median(np.diff(t))
    velocity = np.gradient(at, t, axis=0)
    speed, off = np.hypot(*velocity.T), np.hypot(*(fix - at).T)
    measured = np.interp(t, drive.yaws[:, 0], np.unwrap(drive.yaws[:, 1]))
    differs = np.angle(np.exp(1j * (np.arctan2(*velocity.T[::-1]) - measured)))
    usable, reach = (speed > LEAST_SPEED_M_S) & (off < OUTLIER_M), int(3 / step)
    knots, bias = [], []
    for i in range(0, len(t), 5):
        near = differs[max(0, i - reach) : i + reach + 1]
        near = near[usable[max(0, i - reach) : i + reach + 1]]
        if len(near) > reach // 3:
            centre = np.angle(np.exp(1j * near).mean())
            knots.append(i)
            bias.append(centre + np.median(np.angle(np.exp(1j * (near - centre)))))
    if not knots:
        return None
    index = np.arange(len(t))
    yaw = measured + np.interp(index, knots, np.unwrap(bias))
    lonely = np.abs(index[:, None] - np.array(knots)).min(axis=1) >= 2 * reach
    return Track(t, fix, at, yaw, speed, ~lonely & (off < 5.0), np.median(bias))


class Map:
    def __init__(self, lines):
        self.ids = np.concatenate([[i] * (len(line) - 1) for i, line in lines.items()])
        self.start = np.concatenate([line[:-1] for line in lines.values()])
        self.end = np.concatenate([line[1:] for line in lines.values()])

    def cut(self, at, yaw):
        """Lines that cross the transverse AHEAD_M ahead: y, slope, id."""
        forward = np.array([np.cos(yaw), np.sin(yaw)])
        left = np.array([-forward[1], forward[0]])
        start, end = self.start - at, self.end - at
        before, after = start @ forward - AHEAD_M, end @ forward - AHEAD_M
        m = np.flatnonzero((before * after <= 0) & (before != after) & (np.abs(before) < 60))
        ya, yb = start[m] @ left, end[m] @ left
        y = ya + before[m] / (before[m] - after[m]) * (yb - ya)
        slope = (yb - ya) / (after[m] - before[m])
        near = (np.abs(y) < 14) & (np.abs(slope) < 0.58)
        return np.stack([y[near], slope[near], self.ids[m][near]], axis=1)


def fit(points):
    """A detection as a line: x, y, slope, rms; None if there is too little of it. Weights undo dense spacing."""
    inside = points[(points[:, 0] > NEAR_M) & (points[:, 0] < FAR_M)]
    if len(inside) < 2 or np.ptp(inside[:, 0]) < LEAST_LENGTH_M:
        return None
    x, y = inside.T
    weight = np.abs(np.gradient(x)) + 1e-3
    x0, y0 = np.average(x, weights=weight), np.average(y, weights=weight)
    slope = np.sum(weight * (x - x0) * (y - y0)) / np.sum(weight * (x - x0) ** 2)
    rms = np.sqrt(np.average((y - y0 - slope * (x - x0)) ** 2, weights=weight))
    return (x0, y0, slope, rms) if abs(slope) < MOST_SLOPE and rms < MOST_RMS_M else None


def frame_evidence(cut, lines, scale):
    """Log likelihood of a frame's lines on GRID_M."""
    evidence = np.zeros(len(GRID_M))
    for x, y, slope, _ in lines:
        y = y * scale
        near = np.abs(cut[:, 1] - slope) < 0.15
        if abs(y) > 7:
            continue
        sigma = 0.07 + 0.04 * abs(y)
        votes = cut[near, 0] + cut[near, 1] * (x - AHEAD_M) - y
        bells = np.exp(-0.5 * ((GRID_M - votes[:, None]) / sigma) ** 2) / (sigma * 2.5066)
        evidence += np.log1p((1 - STRAY) * bells.sum(axis=0) / 3 / (STRAY / 12))
    return TEMPER * evidence


def kernel(step_s, offset_sigma_m):
    kept, wander = np.exp(-step_s / OFFSET_S), offset_sigma_m * np.sqrt(2 * step_s / OFFSET_S)
    moved = GRID_M[:, None] - kept * GRID_M
    moves = ndtr((moved + 0.05) / wander) - ndtr((moved - 0.05) / wander) + 1e-9
    return moves / moves.sum(axis=0)


def chain(t, cuts, lines, scale, offset_sigma_m):
    """Forward and backward over the lateral offset: log evidence, offset, and how sure it is."""
    evidence = np.array([frame_evidence(c, d, scale) for c, d in zip(cuts, lines)])
    top = evidence.max(axis=1)
    likelihood = np.exp(evidence - top[:, None])
    steps = np.round(np.clip(np.diff(t), 0.1, 30), 1)
    kernels = {step: kernel(step, offset_sigma_m) for step in np.unique(steps)}
    prior = np.exp(-0.5 * (GRID_M / offset_sigma_m) ** 2)
    n, total = len(t), top.sum()
    ahead, back = np.zeros_like(likelihood), np.ones_like(likelihood)
    for i in range(n):
        before = prior / prior.sum() if i == 0 else kernels[steps[i - 1]] @ ahead[i - 1]
        ahead[i] = likelihood[i] * before
        total += np.log(ahead[i].sum())
        ahead[i] /= ahead[i].sum()
    for i in range(n - 2, -1, -1):
        back[i] = kernels[steps[i]].T @ (likelihood[i + 1] * back[i + 1])
        back[i] /= back[i].sum()
    posterior = ahead * back
    posterior /= posterior.sum(axis=1, keepdims=True)
    masses = np.stack([np.convolve(row, np.ones(11), "same") for row in posterior])
    best = masses.argmax(axis=1)
    near = np.abs(np.arange(len(GRID_M)) - best[:, None]) <= 5
    offset = (posterior * near * GRID_M).sum(axis=1) / (posterior * near).sum(axis=1)
    return total, offset, masses.max(axis=1)


@dataclass
class Registered:
    lag_s: float
    lag_known: bool
    scale: float
    t: np.ndarray  # stamps of frames on the chain
    offset_m: np.ndarray
    sure: np.ndarray


def register(drive, motion, lane_map, lags, offset_sigma_m):
    """Clock offset, scale and lateral offsets of a drive; None if too little of it is placed."""
    stamps = np.array([frame[0] for frame in drive.frames])
    if len(stamps) < 2:
        return None
    stride = max(1, round(EVERY_S / np.median(np.diff(stamps))))
    picked = list(range(0, len(stamps), stride))
    fits = {i: [f for f in map(fit, drive.frames[i][1]) if f] for i in picked}

    def placed(lag, least_t=-np.inf):
        poses = ((i, motion.pose(stamps[i] - lag)) for i in picked if stamps[i] >= least_t)
        known = [(i, pose) for i, pose in poses if pose]
        return [i for i, _ in known], [lane_map.cut(at, yaw) for _, (at, yaw, _) in known]

    def evidence(lag, scale, least_t):
        frames, cuts = placed(lag, least_t)
        if len(frames) <= 15:
            return None
        return chain(stamps[frames], cuts, [fits[i] for i in frames], scale, offset_sigma_m)

    grid, mean, sigma = lags
    common_t = motion.t[0] + grid.max()
    trials = [evidence(lag, SCALE_MEAN, common_t) for lag in grid]
    logs = np.array([2 * trial[0] if trial else 0.0 for trial in trials])
    logs -= 0.5 * ((grid - mean) / sigma) ** 2
    lag, best = grid[logs.argmax()], None
    rivals = np.abs(grid - lag) > 2
    known = all(trials) and (not rivals.any() or logs.max() - logs[rivals].max() > 3)
    for scale in SCALES:
        trial = evidence(lag, scale, -np.inf)
        if trial:
            logged = trial[0] - 0.5 * ((scale - SCALE_MEAN) / SCALE_SIGMA) ** 2
            if not best or logged > best[0]:
                best = (logged, scale, *trial[1:])
    if not best:
        return None
    return Registered(lag, known, best[1], stamps[placed(lag)[0]], best[2], best[3])
