"""Figures and a picture of registration, from what `tilefold-benchmarks placed` wrote.

    python placed.py FOLDER MAP.osm FIGURES.json PICTURE.png

Needs numpy, matplotlib and pyproj.
"""

import csv
import json
import sys
import xml.etree.ElementTree as ET
from collections import defaultdict
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from pyproj import Transformer

# A frame whose registration is surer than this counts as registered; the program's own limit for testimony.
SURE = 0.3
# More than this to the side between two frames less than a second apart is a step to another lane.
LANE_STEP_M = 2.0
# The positions of this road are good to 0.3 m to the side: a registration this far off is a lane off.
LANE_OFF_M = 1.75
# The two lines of the own lane are nearer than this.
BESIDE_M = 2.5
# Lines are seen 3.5 to 10 m ahead.
AHEAD_M = 7.0


def table(path, kinds):
    columns = defaultdict(list)
    with open(path) as file:
        for row in csv.DictReader(file):
            for name, kind in kinds.items():
                columns[name].append(kind(row[name] or "nan"))
    return {name: np.array(values) for name, values in columns.items()}


def quantiles(values):
    values = np.abs(values[np.isfinite(values)])
    named = {f"p{q}": round(float(np.percentile(values, q)), 3) for q in (25, 50, 75, 90)}
    return {"lines": len(values), **named, "within_0.3_m": round(float((values < 0.3).mean()), 3)}


def figures(frames, lines, confidence):
    sure = frames["confidence"] >= SURE
    by_vehicle = [np.flatnonzero(frames["vehicle"] == vehicle) for vehicle in np.unique(frames["vehicle"])]
    steps = 0
    for rows in by_vehicle:
        offset, stamp = frames["offset_m"][rows], frames["stamp_ns"][rows]
        both = sure[rows][1:] & sure[rows][:-1]
        steps += int((both & (np.abs(np.diff(offset)) > LANE_STEP_M) & (np.diff(stamp) < 1_000_000_000)).sum())
    off = sure & (np.abs(frames["offset_m"]) > LANE_OFF_M)
    said = confidence >= SURE
    beside = said & (np.abs(lines["lateral_m"]) < BESIDE_M)
    return {
        "drives": len(by_vehicle),
        "frames": len(sure),
        "registered": {str(limit): round(float((frames["confidence"] >= limit).mean()), 3) for limit in (0.3, 0.5, 0.9)},
        "drives_registered_half": int(sum(sure[rows].mean() >= 0.5 for rows in by_vehicle)),
        "lane_steps": steps,
        "lane_off_share": round(float(off.sum() / sure.sum()), 4),
        "lane_off_share_surest": round(float((off & (frames["confidence"] >= 0.9)).sum() / (frames["confidence"] >= 0.9).sum()), 4),
        "drives_with_lane_off": int(sum(off[rows].any() for rows in by_vehicle)),
        "nearest_line_before": quantiles(lines["nearest_before_m"][said]),
        "nearest_line_after": quantiles(lines["nearest_after_m"][said]),
        "matched_residual": quantiles(lines["residual_m"][said]),
        "beside_before": quantiles(lines["nearest_before_m"][beside]),
        "beside_after": quantiles(lines["nearest_after_m"][beside]),
    }


def draw(frames, lines, of_line, map_path, picture):
    root = ET.parse(map_path).getroot()
    nodes = {n.get("id"): (float(n.get("lon")), float(n.get("lat"))) for n in root.iter("node")}
    markings = [w for w in root.iter("way") if {"line_thin", "line_thick", "lane_marking"} & {t.get("v") for t in w.findall("tag")}]
    ways = [np.array([nodes[r.get("ref")] for r in w.findall("nd")]) for w in markings]
    longitude, latitude = np.mean(np.vstack(ways), axis=0)
    plane = Transformer.from_crs(4326, f"+proj=tmerc +lon_0={longitude} +lat_0={latitude} +ellps=WGS84", always_xy=True)
    flat = [np.stack(plane.transform(*way.T), axis=1) for way in ways]
    x, y = plane.transform(frames["longitude_deg"], frames["latitude_deg"])
    yaw, offset = frames["yaw_rad"], frames["offset_m"]
    # The road's direction and a busy stretch of it.
    start, end = flat[0][0], flat[0][-1]
    along = (end - start) / np.hypot(*(end - start))
    across = np.array([-along[1], along[0]])
    forward = np.stack([np.cos(yaw), np.sin(yaw)], axis=1)
    left = np.stack([-np.sin(yaw), np.cos(yaw)], axis=1)
    place = np.stack([x, y], axis=1)
    sure = frames["confidence"][of_line] >= 0.9
    figure, axes = plt.subplots(2, 1, figsize=(11, 6.4), sharex=True, sharey=True)
    for axis, shift, title in ((axes[0], 0.0, "as positions have it"), (axes[1], 1.0, "registered")):
        at = place + AHEAD_M * forward + shift * offset[:, None] * left
        seen = at[of_line] + lines["lateral_m"][:, None] * left[of_line]
        seen = seen[sure] - start
        axis.plot(seen @ along, seen @ across, ".", ms=1.2, alpha=0.35, color="tab:orange", rasterized=True)
        for way in flat:
            axis.plot((way - start) @ along, (way - start) @ across, "-", lw=0.9, color="black")
        axis.set_title(title, loc="left", fontsize=10)
        axis.set_ylabel("across, m")
    spot = np.median((seen @ along)[np.abs(seen @ along) < 300])
    middle = np.median((seen @ across)[np.abs(seen @ along - spot) < 40])
    axes[1].set_xlim(spot - 60, spot + 60)
    axes[1].set_ylim(middle - 6, middle + 6)
    axes[1].set_xlabel("along the road, m")
    figure.suptitle("Lines seen by all drives (orange) on the surveyed map (black)", fontsize=11)
    figure.tight_layout()
    figure.savefig(picture, dpi=130)


def main(folder, map_path, out, picture):
    frames = table(Path(folder) / "frames.csv", {"vehicle": str, "stamp_ns": int, "longitude_deg": float, "latitude_deg": float, "yaw_rad": float, "offset_m": float, "confidence": float})
    lines = table(Path(folder) / "lines.csv", {"vehicle": str, "stamp_ns": int, "lateral_m": float, "residual_m": float, "nearest_before_m": float, "nearest_after_m": float})
    row = {key: index for index, key in enumerate(zip(frames["vehicle"], frames["stamp_ns"]))}
    of_line = np.array([row[key] for key in zip(lines["vehicle"], lines["stamp_ns"])])
    found = figures(frames, lines, frames["confidence"][of_line])
    Path(out).write_text(json.dumps(found, indent=2) + "\n")
    print(json.dumps(found, indent=2))
    draw(frames, lines, of_line, map_path, picture)


main(*sys.argv[1:])
