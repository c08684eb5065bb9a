"""Measures how drives err: positions against their smoothed path, lane lines against a map.

    python detections.py LOGS MAP.osm OUT.json [--lag MEAN SIGMA] [--offset-sigma M] [--limit N]
    python detections.py --receiver ERRORS.csv OUT.json

LOGS is a folder of MCAP files. The first form works on any drives and map, real or simulated; the second measures the
positions alone, of what the example `receiver_error` of tilefold-city wrote. `noise_table.py` makes a table of the results.
The map must be right: what is not in it counts as clutter.
"""

import argparse
import json
import math

import numpy as np
from drives import read_drives, read_map
from registration import AHEAD_M, LEAST_SPEED_M_S, Map, Track, fit, register, smooth, track

SIDE_M, SURE, GATE_M, PARALLEL = 6.2, 0.8, 0.8, 0.2
CLASSES_M = ((0.0, 2.2), (2.2, 3.2), (3.2, 4.5), (4.5, 6.2))
AFTER_S = (0.2, 1.0, 3.0)
RANGES_M = np.arange(2.5, 20.5, 1.0)
STALL_S, JUMP_M, LAG_STEP_S = 0.1, 0.5, 0.5


def spread(values):
    """Standard deviation from the median absolute deviation."""
    values = np.asarray(values)
    return float(1.4826 * np.median(np.abs(values - np.median(values)))) if len(values) else None


def quantiles(values, shares=(5, 25, 50, 75, 95)):
    return [round(float(q), 4) for q in np.percentile(values, shares)] if len(values) else None


def runs(mask):
    edges = np.flatnonzero(np.diff(np.r_[0, mask.astype(int), 0]))
    return list(zip(edges[::2], edges[1::2]))


# ---- positions


def no_positions():
    raw = {"moving_s": 0.0, "km": 0.0, "repeated": 0}
    lists = ("periods_s", "yaw_biases", "delays_s", "sides_m", "delay_pairs", "stalls", "jumps")
    return raw | {name: [] for name in lists}


def receiver_alone(path):
    """Position noise of drives along a straight road, of which a CSV gives errors and speeds."""
    rows, raw = np.genfromtxt(path, delimiter=",", skip_header=1), no_positions()
    for number in np.unique(rows[:, 0]):
        _, t, lateral, longitudinal, speed = rows[rows[:, 0] == number].T
        along = np.concatenate([[0], np.cumsum(np.diff(t) * speed[1:])])
        fix = np.stack([along + longitudinal, lateral], axis=1)
        at = smooth(t, fix)
        moved = np.hypot(*np.gradient(at, t, axis=0).T)
        position_noise(Track(t, fix, at, 0 * t, moved, moved > 0, 0.0), raw)
    raw["yaw_biases"].clear()  # It has no heading.
    return {"positions": positions(raw)}


def position_noise(motion, into):
    """What a drive's fixes differ from its smoothed path: along it, as a delay in seconds, and to the side."""
    moving = motion.speed > LEAST_SPEED_M_S
    away = motion.fix - motion.at
    forward = np.gradient(motion.at, motion.t, axis=0) / np.maximum(motion.speed, 0.1)[:, None]
    delay = -(away * forward).sum(axis=1) / np.maximum(motion.speed, LEAST_SPEED_M_S)
    side = away[:, 1] * forward[:, 0] - away[:, 0] * forward[:, 1]
    step = np.median(np.diff(motion.t))
    quiet = moving & (np.abs(delay) < STALL_S) & (np.abs(side) < JUMP_M)
    moved = np.hypot(*np.diff(motion.fix, axis=0).T)
    into["moving_s"] += moving.sum() * step
    into["periods_s"] += list(np.diff(motion.t))
    into["yaw_biases"].append(np.angle(np.exp(1j * motion.yaw_bias)))
    into["km"] += float((motion.speed * step).sum() / 1000)
    into["repeated"] += int(((moved == 0) & moving[1:]).sum())
    into["delays_s"] += list(delay[quiet])
    into["sides_m"] += list(side[quiet])
    into["delay_pairs"] += [(a, b) for a, b, q in zip(delay, delay[1:], quiet[:-1] & quiet[1:]) if q]
    for a, b in runs(moving & (np.abs(delay) > STALL_S)):
        into["stalls"].append((delay[a:b][np.abs(delay[a:b]).argmax()], (b - a) * step))
    for a, b in runs(moving & (np.abs(side) > JUMP_M)):
        into["jumps"].append((np.abs(side[a:b]).max(), (b - a) * step))


def positions(raw):
    delays, stalls, jumps = np.array(raw["delays_s"]), np.array(raw["stalls"]), np.array(raw["jumps"])
    pairs, minutes = np.array(raw["delay_pairs"]), raw["moving_s"] / 60
    return {
        "period_s": float(np.median(raw["periods_s"])),
        "km": raw["km"],
        "repeated_per_minute": raw["repeated"] / minutes,
        "delay_spread_s": float(delays.std()),
        "delay_next_correlation": float(np.corrcoef(pairs.T)[0, 1]) if len(pairs) > 2 else None,
        "yaw_bias_deg": quantiles(np.degrees(raw["yaw_biases"])),
        "side_spread_m": float(np.std(raw["sides_m"])),
        "stalls_per_minute": len(stalls) / minutes,
        "stalls_late": float((stalls[:, 0] > 0).mean()) if len(stalls) else None,
        "stall_s": quantiles(np.abs(stalls[:, 0])) if len(stalls) else None,
        "stall_lasts_s": quantiles(stalls[:, 1]) if len(stalls) else None,
        "side_jumps_per_minute": len(jumps) / minutes,
        "side_jump_m": quantiles(jumps[:, 0]) if len(jumps) else None,
    }


# ---- lane lines


def observe(drive, motion, placed, lane_map, number, into):
    """Rows of what each line of the map looked like in each frame, and what no line explains."""
    keep = placed.sure >= SURE
    if keep.sum() < 2:
        return
    last_at = None
    for index, (stamp, lines) in enumerate(drive.frames):
        nearest = np.abs(placed.t - stamp).argmin()
        pose = motion.pose(stamp - placed.lag_s)
        if not keep[nearest] or abs(placed.t[nearest] - stamp) > 0.3 or not pose or pose[2] < LEAST_SPEED_M_S:
            continue
        at, yaw, speed = pose
        cut = lane_map.cut(at, yaw)
        if len(cut) == 0:
            continue
        offset = np.interp(stamp, placed.t, placed.offset_m)
        into["looks"].append((number, index, stamp, speed, offset, len(lines)))
        if last_at is not None:
            into["km"] += min(np.hypot(*(at - last_at)), 50.0) / 1000
        last_at = at
        match(cut, cut[:, 0] - offset, lines, placed.scale, (number, index, stamp), into)


def match(cut, mapped_y, lines, scale, look, into):
    fits = [(points, fit(points)) for points in lines]
    fits = [(points, f) for points, f in fits if f]
    shown = np.array([f for _, f in fits]).reshape(-1, 4)
    y = shown[:, 1] * scale
    off = y[:, None] - (mapped_y + cut[:, 1] * (shown[:, :1] - AHEAD_M))
    parallel = np.abs(shown[:, 2:3] * scale - cut[:, 1]) < PARALLEL
    far = np.where(parallel & (np.abs(off) < GATE_M), np.abs(off), np.inf)
    free_lines, free_shown = set(range(len(cut))), set(range(len(fits)))
    found = {}
    for a, b in sorted(zip(*np.nonzero(np.isfinite(far))), key=lambda pair: far[pair]):
        if a in free_shown and b in free_lines:
            found[b] = a
            free_shown.discard(a)
            free_lines.discard(b)
    for b in np.flatnonzero(np.abs(mapped_y) < SIDE_M):
        a = found.get(b)
        row = (*look, cut[b, 2], mapped_y[b], a is not None)
        if a is None:
            into["lines"].append((*row, *[np.nan] * 7))
            continue
        points, (_, _, slope, rms) = fits[a]
        gaps = np.hypot(*np.diff(points, axis=0).T)
        reach = (points[:, 0].min(), points[:, 0].max())
        into["lines"].append((*row, off[a, b], slope * scale - cut[b, 1], rms, *reach, len(points), np.median(gaps)))
    for a in free_shown:
        if abs(y[a]) < SIDE_M:
            beside = np.abs(off[a]).min()
            x = fits[a][0][:, 0]
            into["clutter"].append((*look, y[a], shown[a, 2] * scale, beside, np.ptp(x)))


LINE = dict(drive=0, frame=1, t=2, line=3, y=4, hit=5, off=6, slope=7, rms=8, near=9, far=10, points=11, gap=12)


def passes(rows, least=10):
    """Rows by drive and line, where a line is seen for long enough."""
    order = np.lexsort((rows[:, LINE["frame"]], rows[:, LINE["line"]], rows[:, LINE["drive"]]))
    rows = rows[order]
    ends = np.flatnonzero(np.any(np.diff(rows[:, [LINE["drive"], LINE["line"]]], axis=0) != 0, axis=1)) + 1
    return [part for part in np.split(rows, ends) if len(part) >= least]


def lateral(rows):
    """Lateral differences of hits: overall, what a pass keeps, and what changes after a time."""
    hits = rows[rows[:, LINE["hit"]] == 1]
    if len(hits) < 50:
        return None
    groups = passes(hits)
    medians = [np.median(g[:, LINE["off"]]) for g in groups]
    after = {}
    for gap in AFTER_S:
        differences = []
        for g in groups:
            t, off = g[:, LINE["t"]], g[:, LINE["off"]]
            to = np.clip(np.searchsorted(t, t + gap - 1e-3), 0, len(t) - 1)
            good = np.abs(t[to] - t - gap) < 0.06
            differences += list((off[to] - off)[good])
        after[f"{gap:g} s"] = spread(differences) / np.sqrt(2) if len(differences) > 50 else None
    steps = np.concatenate([np.diff(g[:, LINE["off"]])[np.diff(g[:, LINE["frame"]]) == 1] for g in groups]) if groups else []
    off = hits[:, LINE["off"]]
    return {
        "hits": len(hits),
        "bias_m": float(np.median(off)),
        "spread_m": spread(off),
        "beyond_45_cm": float((np.abs(off) > 0.45).mean()),
        "pass_spread_m": spread(medians) if len(medians) > 5 else None,
        "next_frame_spread_m": spread(steps) / np.sqrt(2) if len(steps) > 50 else None,
        "after_spread_m": after,
        "slope_spread": spread(hits[:, LINE["slope"]]),
    }


def misses(rows):
    """How often lines are missed, how that differs between passes, and how long it lasts."""
    if len(rows) < 50:
        return None
    hit, groups = rows[:, LINE["hit"]], passes(rows)
    shares = np.array([g[:, LINE["hit"]].mean() for g in groups])
    numbers = np.array([len(g) for g in groups])
    mean = float(np.average(shares, weights=numbers)) if len(groups) else float(hit.mean())
    # Spread between passes beyond what lots of that size give: Beta(mean * n, (1 - mean) * n).
    variance = np.average((shares - mean) ** 2, weights=numbers) if len(groups) else np.nan
    concentration = mean * (1 - mean) / variance - 1 if variance > 0 else np.nan
    pairs = [np.stack([g[:-1, LINE["hit"]], g[1:, LINE["hit"]]]).T[np.diff(g[:, LINE["frame"]]) == 1] for g in groups]
    pairs = np.concatenate(pairs) if pairs else np.zeros((0, 2))
    after_hit, after_miss = pairs[pairs[:, 0] == 1, 1], pairs[pairs[:, 0] == 0, 1]
    return {
        "frames": len(rows),
        "missed": float(1 - hit.mean()),
        "beta_concentration": float(concentration),
        "passes_never_seen": float((shares == 0).mean()) if len(groups) else None,
        "miss_after_hit": float(1 - after_hit.mean()) if len(after_hit) else None,
        "miss_after_miss": float(1 - after_miss.mean()) if len(after_miss) else None,
    }


def lane_width(rows):
    """The distance of the two lines beside the vehicle against the map: free of where the vehicle is."""
    hits = rows[(rows[:, LINE["hit"]] == 1) & (np.abs(rows[:, LINE["y"]]) < 3.0)]
    looks = {}
    for row in hits:
        side = "left" if row[LINE["y"]] > 0 else "right"
        look = looks.setdefault((row[LINE["drive"]], row[LINE["frame"]]), {})
        if side not in look or abs(row[LINE["y"]]) < abs(look[side][LINE["y"]]):
            look[side] = row
    both = [(key[0], look["left"][LINE["off"]] - look["right"][LINE["off"]]) for key, look in looks.items() if len(look) == 2]
    drives, wide = np.array(both).reshape(-1, 2).T
    medians = [np.median(wide[drives == d]) for d in np.unique(drives) if (drives == d).sum() >= 10]
    return {"frames": len(wide), "bias_m": float(np.median(wide)), "spread_m": spread(wide), "drive_spread_m": spread(medians)}


def extent(rows):
    hits = rows[rows[:, LINE["hit"]] == 1]
    covered = [((hits[:, LINE["near"]] <= x) & (hits[:, LINE["far"]] >= x)).mean() for x in RANGES_M]
    return {
        "near_m": quantiles(hits[:, LINE["near"]]),
        "far_m": quantiles(hits[:, LINE["far"]]),
        "points": quantiles(hits[:, LINE["points"]]),
        "point_every_m": quantiles(hits[:, LINE["gap"]]),
        "point_rms_m": quantiles(hits[:, LINE["rms"]]),
        "covered_at_m": {f"{x:g}": round(float(c), 3) for x, c in zip(RANGES_M, covered)},
    }


def clutter(raw):
    """Detections that no line of the map explains: by frame, and followed from frame to frame by kilometre."""
    looks, rows = len(raw["looks"]), np.array(raw["clutter"]).reshape(-1, 7)
    tracks, lengths = follow(rows, {(l[0], l[1]): l[3] for l in raw["looks"]})
    return {
        "per_frame": len(rows) / looks,
        "beside_a_line": float((rows[:, 5] < 1.5).mean()) if len(rows) else None,
        "oblique": float((np.abs(rows[:, 4]) > PARALLEL).mean()) if len(rows) else None,
        "side_m": quantiles(np.abs(rows[:, 3])),
        "length_m": quantiles(rows[:, 6]),
        "tracks_per_km": tracks / raw["km"] if raw["km"] else None,
        "track_m": quantiles(lengths),
    }


def follow(rows, speeds, gate_m=0.4, gap_s=0.5, least=5):
    """Clutter that stays beside the vehicle for at least a few frames: number and lengths in metres."""
    open_tracks, lengths = [], []

    def close(track):
        if track["n"] >= least:
            lengths.append((track["t"] - track["from"]) * track["speed"])

    for row in rows[np.lexsort((rows[:, 1], rows[:, 0]))] if len(rows) else []:
        drive, frame, t, y = row[:4]
        for track in [k for k in open_tracks if k["drive"] != drive or t - k["t"] > gap_s]:
            open_tracks.remove(track)
            close(track)
        near = [k for k in open_tracks if k["t"] < t and abs(k["y"] - y) < gate_m]
        if near:
            best = min(near, key=lambda k: abs(k["y"] - y))
            best.update(t=t, y=y, n=best["n"] + 1)
        else:
            speed = speeds[(drive, frame)]
            open_tracks.append({"drive": drive, "from": t, "t": t, "y": y, "n": 1, "speed": speed})
    for track in open_tracks:
        close(track)
    return len(lengths), lengths


def offset_noise(looks):
    """The position's lateral error as the chain found it: over all, between drives, and within."""
    drives, offset = looks[:, 0], looks[:, 4]
    means = [offset[drives == d].mean() for d in np.unique(drives)]
    within = [offset[drives == d].std() for d in np.unique(drives) if (drives == d).sum() > 100]
    return {"all_m": quantiles(offset), "between_drives_m": float(np.std(means)), "within_m": quantiles(within)}


def measure(args):
    plane, lines = read_map(args.map)
    lane_map, mean_sigma = Map(lines), args.lag
    step = min(LAG_STEP_S, mean_sigma[1])
    reach = math.ceil(3.5 * mean_sigma[1] / step)
    grid = mean_sigma[0] + step * np.arange(-reach, reach + 1)
    raw_positions = no_positions()
    raw = dict(looks=[], lines=[], clutter=[], km=0.0)
    placements = []
    for number, drive in enumerate(read_drives(args.logs, args.limit)):
        motion = track(drive, plane)
        if motion is None:
            continue
        position_noise(motion, raw_positions)
        placed = register(drive, motion, lane_map, (grid, *mean_sigma), args.offset_sigma)
        if placed is not None:
            placements.append((placed.lag_s, placed.lag_known, placed.scale))
            observe(drive, motion, placed, lane_map, number, raw)
    return summary(raw_positions, raw, np.array(placements).reshape(-1, 3))


def summary(raw_positions, raw, placements):
    rows, looks = np.array(raw["lines"]), np.array(raw["looks"])
    side = np.abs(rows[:, LINE["y"]])
    by_side = {f"{a:g} to {b:g} m": rows[(side >= a) & (side < b)] for a, b in CLASSES_M}
    known = placements[placements[:, 1] == 1]
    return {
        "positions": positions(raw_positions),
        "clock_offset_s": {"drives": len(placements), "clear": len(known), "clear_s": quantiles(known[:, 0])},
        "lateral_scale": quantiles(placements[:, 2]),
        "lateral_offset": offset_noise(looks),
        "frames": len(looks),
        "km": raw["km"],
        "period_s": float(np.median([b[2] - a[2] for a, b in zip(looks, looks[1:]) if b[1] - a[1] == 1])),
        "lines_per_frame": float(looks[:, 5].mean()),
        "lateral": {name: lateral(part) for name, part in by_side.items()},
        "lane_width": lane_width(rows),
        "missed": {name: misses(part) for name, part in by_side.items()},
        "extent": extent(rows),
        "clutter": clutter(raw),
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("files", nargs="+")
    parser.add_argument("--receiver", action="store_true", help="positions alone, of a CSV of errors")
    parser.add_argument("--lag", nargs=2, type=float, default=(0.0, 0.2), help="clock offset expected, s")
    parser.add_argument("--offset-sigma", type=float, default=1.5, help="lateral error of positions expected, m")
    parser.add_argument("--limit", type=int, help="read only so many drives")
    args = parser.parse_args()
    if args.receiver:
        errors, out = args.files
        measured = receiver_alone(errors)
    else:
        args.logs, args.map, out = args.files
        measured = measure(args)
    with open(out, "w") as file:
        json.dump(measured, file, indent=1)
        file.write("\n")


if __name__ == "__main__":
    main()
