"""The way from logs to verdicts on lane lines the straightforward way, with mcap, shapely, scipy and pandas.

What an engineer writes who wants the result and not the speed: GNSS smoothed by sparse least squares, the map in an
STRtree, each line that was seen cut against the map lines near it at the same ranges, one Hungarian assignment a frame,
and a robust rigid correction to the side for each window of 40 m by a search over offsets. The clock offset is told by
--lag, or searched for as the map stage does: the drive is laid on the map with each of 25 lags, and the one whose lines
fit best is taken. What was seen and matched is summed by element, section of 10 m and drive, and judged by a sum of
log odds. No drift model, no visibility, no clusters of what is not on the map, no store: it does less than Tilefold.

    python match_and_register.py MAP.osm LOGS... [--lag SECONDS | --search-lag] [--by-one] [--json FIGURES.json]

One process, one thread (set OMP_NUM_THREADS=1); seconds are of processor time.
"""

import argparse
import json
import sys
import time
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pandas as pd
import shapely
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory as Protobuf
from mcap_ros2.decoder import DecoderFactory as Ros2
from pyproj import Transformer
from scipy.optimize import linear_sum_assignment
from scipy.sparse import diags
from scipy.sparse.linalg import spsolve
from shapely import STRtree
from shapely.geometry import LineString, box

RANGES_M = np.array([3, 4, 5, 6, 7, 8, 9, 10, 12, 14, 16, 18, 20, 24.0])
SIDE_M, GATE_M, SIGMA_M = 12.0, 1.6, 0.3
WINDOW_M, OFFSETS_M = 40.0, np.arange(-3, 3.01, 0.1)
NEAR_M = 3 * SIGMA_M
LAGS_S = np.linspace(-2, 16, 25)
# Log odds of a line that is there against one that is gone: of a look with a match, and of one without.
SECTION_M, LOOK_M, HIT, MISS = 10.0, 10.0, 2.0, -1.5


def read_map(path):
    root = ET.parse(path).getroot()
    nodes = {n.get("id"): (float(n.get("lon")), float(n.get("lat"))) for n in root.iter("node")}
    ways = {}
    for way in root.iter("way"):
        tags = {tag.get("k"): tag.get("v") for tag in way.findall("tag")}
        if tags.get("type") in ("line_thin", "line_thick"):
            ways[int(way.get("id"))] = np.array([nodes[nd.get("ref")] for nd in way.findall("nd")])
    return ways


def read_log(path):
    """Fixes (s, lon, lat), yaws (s, rad), frames (s, list of points)."""
    fixes, yaws, frames = [], [], []
    with open(path, "rb") as file:
        for schema, _, _, message in make_reader(file, decoder_factories=[Ros2(), Protobuf()]).iter_decoded_messages():
            if schema.name == "sensor_msgs/msg/NavSatFix":
                stamp = message.header.stamp
                fixes.append((stamp.sec + stamp.nanosec * 1e-9, message.longitude, message.latitude))
            elif schema.name == "foxglove.LocationFix":
                fixes.append((message.timestamp.ToNanoseconds() * 1e-9, message.longitude, message.latitude))
            elif schema.name == "sensor_msgs/msg/Imu":
                stamp = message.header.stamp
                yaws.append((stamp.sec + stamp.nanosec * 1e-9, yaw_of(message.orientation)))
            elif schema.name == "foxglove.PoseInFrame":
                yaws.append((message.timestamp.ToNanoseconds() * 1e-9, yaw_of(message.pose.orientation)))
            elif schema.name == "foxglove.SceneUpdate" and message.entities:
                stamp = message.entities[0].timestamp.ToNanoseconds() * 1e-9
                lines = [np.array([(p.x, p.y) for p in line.points]) for entity in message.entities for line in entity.lines]
                frames.append((stamp, [line for line in lines if len(line) >= 2]))
    return np.array(fixes), np.array(yaws), frames


def yaw_of(q):
    return np.arctan2(2 * (q.w * q.z + q.x * q.y), 1 - 2 * (q.y * q.y + q.z * q.z))


def smooth(t, z, rounds=8):
    """White-noise acceleration and a Cauchy loss."""
    n, step = len(t), np.median(np.diff(t))
    bend = diags([1.0, -2.0, 1.0], [0, 1, 2], shape=(n - 2, n))
    stiff = bend.T @ bend / (2.0 * step**3)
    at = z.copy()
    for _ in range(rounds):
        off = np.hypot(*(z - at).T)
        weight = 1 / 0.3**2 / (1 + (off / 0.6) ** 2)
        at = np.column_stack([spsolve((stiff + diags(weight)).tocsc(), weight * z[:, axis]) for axis in (0, 1)])
    return at


def poses(fixes, yaws, times, plane):
    keep = np.diff(fixes[:, 0], prepend=-np.inf) > 0
    t = fixes[keep, 0]
    at = smooth(t, np.column_stack(plane.transform(*fixes[keep, 1:].T)))
    yaw = np.interp(t, yaws[:, 0], np.unwrap(yaws[:, 1]))
    velocity = np.gradient(at, t, axis=0)
    moving = np.hypot(*velocity.T) > 2
    bias = np.angle(np.exp(1j * (np.arctan2(velocity[:, 1], velocity[:, 0]) - yaw)))[moving]
    yaw = yaw + (np.median(bias) if len(bias) else 0.0)
    inside = (times >= t[0]) & (times <= t[-1])
    return inside, np.column_stack([np.interp(times, t, at[:, 0]), np.interp(times, t, at[:, 1]), np.interp(times, t, yaw)])


def cut(line):
    """Lateral position of a line in the vehicle frame at each range; nan outside of it."""
    order = np.argsort(line[:, 0])
    return np.interp(RANGES_M, line[order, 0], line[order, 1], left=np.nan, right=np.nan)


def project(pose, tree, geometries, by_one):
    """Lateral positions of the map lines around a pose, by index."""
    x, y, yaw = pose
    forward, left = np.array([np.cos(yaw), np.sin(yaw)]), np.array([-np.sin(yaw), np.cos(yaw)])
    centre = np.array([x, y]) + 13 * forward
    middles = np.array([x, y]) + RANGES_M[:, None] * forward
    across = shapely.linestrings(np.stack([middles - SIDE_M * left, middles + SIDE_M * left], axis=1))
    near = tree.query(box(*(centre - 20), *(centre + 20)))
    if by_one:
        crossings = np.array([[geometries[index].intersection(line) for line in across] for index in near])
        crossings = crossings.reshape(len(near), len(RANGES_M))
    else:
        crossings = shapely.intersection(geometries[near][:, None], across)
    # Lines that cross twice, or run along, are left out.
    x = np.where(shapely.get_type_id(crossings) == 0, shapely.get_x(crossings), np.nan)
    y = np.where(shapely.get_type_id(crossings) == 0, shapely.get_y(crossings), np.nan)
    laterals = (x - middles[:, 0]) * left[0] + (y - middles[:, 1]) * left[1]
    return {index: line for index, line in zip(near, laterals) if np.isfinite(line).any()}


def match(seen, mapped, offset):
    """Pairs of one frame and their residuals, by one assignment with gating."""
    if not seen or not mapped:
        return []
    names = list(mapped)
    with np.errstate(invalid="ignore"):
        off = np.array([[mean(line - mapped[name]) for name in names] for line in seen]) + offset
    gain = np.where(np.abs(off) <= GATE_M, np.exp(-0.5 * (off / 0.9) ** 2), 0.0)
    rows, columns = linear_sum_assignment(-np.nan_to_num(gain))
    return [(row, names[column], off[row, column]) for row, column in zip(rows, columns) if gain[row, column] > 0]


def mean(values):
    values = values[np.isfinite(values)]
    return values.mean() if len(values) else np.nan


def register(window):
    """The offset to the side that lays most of the lines of a window of frames on map lines, and how well it does."""
    votes = np.zeros(len(OFFSETS_M))
    for seen, mapped in window:
        for line in seen:
            offs = np.array([mean(line - laterals) for laterals in mapped.values()])
            offs = offs[np.isfinite(offs) & (np.abs(offs) < 6)]
            if len(offs):
                nearest = np.abs(offs[:, None] + OFFSETS_M).min(axis=0)
                votes += np.exp(-0.5 * (np.minimum(nearest, NEAR_M) / SIGMA_M) ** 2)
    votes -= 0.02 * OFFSETS_M**2 * len(window)
    return OFFSETS_M[np.argmax(votes)], votes.max()


def lay(log, seen, lag, plane, tree, geometries, by_one, seconds):
    """Which frames have a pose, their map lines and offsets under a lag of the clock, and how well all of that fits."""
    fixes, yaws, frames = log
    clock = time.process_time()
    inside, at = poses(fixes, yaws, np.array([stamp for stamp, _ in frames]) - lag, plane)
    seconds["pose"] += time.process_time() - clock
    clock = time.process_time()
    mapped = [project(pose, tree, geometries, by_one) if ok else {} for ok, pose in zip(inside, at)]
    seconds["project"] += time.process_time() - clock
    clock = time.process_time()
    way = np.concatenate([[0], np.cumsum(np.hypot(*np.diff(at[:, :2], axis=0).T))])
    offset, fit = np.zeros(len(frames)), 0.0
    for window in np.unique(way // WINDOW_M):
        rows = np.flatnonzero(way // WINDOW_M == window)
        offset[rows], votes = register([(seen[row], mapped[row]) for row in rows])
        fit += votes
    seconds["register"] += time.process_time() - clock
    return inside, mapped, offset, fit, at


def drive(log, lags, plane, tree, geometries, by_one, seconds):
    clock = time.process_time()
    seen = [[cut(line) for line in lines] for _, lines in log[2]]
    seconds["project"] += time.process_time() - clock
    laid = [lay(log, seen, lag, plane, tree, geometries, by_one, seconds) for lag in lags]
    inside, mapped, offset, _, at = max(laid, key=lambda result: result[3])
    clock = time.process_time()
    pairs = [match(*both, shift) for *both, shift in zip(seen, mapped, offset)]
    seconds["match"] += time.process_time() - clock
    clock = time.process_time()
    rows = testimony(at, mapped, pairs, geometries)
    seconds["fold"] += time.process_time() - clock
    return int(inside.sum()), [residual for frame in pairs for *_, residual in frame], rows


def testimony(at, mapped, pairs, geometries):
    """Looks at sections of elements, with what was matched: one row an element and section."""
    looks = []
    for pose, lines, frame in zip(at, mapped, pairs):
        hits = {name: residual for _, name, residual in frame}
        for name in lines:
            ahead = pose[:2] + LOOK_M * np.array([np.cos(pose[2]), np.sin(pose[2])])
            looks.append((name, *ahead, name in hits, hits.get(name, np.nan)))
    rows = pd.DataFrame(looks, columns=["element", "x", "y", "hit", "residual"])
    if len(rows):
        places = shapely.points(rows["x"], rows["y"])
        rows["section"] = shapely.line_locate_point(geometries[rows["element"]], places) // SECTION_M
    else:
        rows["section"] = 0.0
    by_section = rows.groupby(["element", "section"])
    return by_section.agg(exposed=("hit", "size"), hit=("hit", "sum"), residual=("residual", "mean")).reset_index()


def verdicts(passes):
    """A sum over drives for every section, and what it says."""
    share = passes["hit"] / passes["exposed"]
    passes = passes.assign(odds=share * HIT + (1 - share) * MISS)
    sections = passes.groupby(["element", "section"]).agg(odds=("odds", "sum"), shift=("residual", "median"), drives=("odds", "size"))
    gone, moved = sections["odds"] < 0, sections["shift"].abs() > 0.5
    return sections.assign(verdict=np.select([gone, moved], ["removed", "modified"], "no change"))


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("map", type=Path)
    parser.add_argument("logs", nargs="+", type=Path)
    parser.add_argument("--lag", type=float, default=0.0)
    parser.add_argument("--search-lag", action="store_true", help="take the best of LAGS_S instead")
    parser.add_argument("--by-one", action="store_true", help="one shapely call for each line and range")
    parser.add_argument("--json", type=Path)
    args = parser.parse_args()
    ways = read_map(args.map)
    longitude, latitude = np.mean(np.vstack(list(ways.values())), axis=0)
    plane = Transformer.from_crs(4326, f"+proj=tmerc +lon_0={longitude} +lat_0={latitude} +ellps=WGS84", always_xy=True)
    geometries = np.array([LineString(np.column_stack(plane.transform(*way.T))) for way in ways.values()])
    tree = STRtree(geometries)
    seconds = {"read": 0.0, "pose": 0.0, "project": 0.0, "register": 0.0, "match": 0.0, "fold": 0.0}
    frames, residuals, testimonies = 0, [], []
    for path in args.logs:
        clock = time.process_time()
        log = read_log(path)
        seconds["read"] += time.process_time() - clock
        if len(log[0]) >= 30 and len(log[1]) >= 2 and log[2]:
            lags = LAGS_S if args.search_lag else [args.lag]
            placed, found, rows = drive(log, lags, plane, tree, geometries, args.by_one, seconds)
            frames += placed
            residuals += found
            testimonies.append(rows)
    clock = time.process_time()
    sections = verdicts(pd.concat(testimonies))
    seconds["fold"] += time.process_time() - clock
    total = sum(seconds.values())
    figures = {
        "logs": len(args.logs),
        "frames": frames,
        "seconds": {name: round(value, 2) for name, value in seconds.items()},
        "frames_per_second": round(frames / total, 1),
        "frames_per_second_without_reading": round(frames / (total - seconds["read"]), 1),
        "sections": sections["verdict"].value_counts().to_dict(),
        "matched": len(residuals),
        "median_residual_m": round(float(np.median(np.abs(residuals))), 3) if residuals else None,
    }
    print(json.dumps(figures, indent=2))
    if args.json:
        args.json.write_text(json.dumps(figures, indent=2) + "\n")


if __name__ == "__main__":
    sys.exit(main())
