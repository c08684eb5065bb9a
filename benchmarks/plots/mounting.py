"""Draws one stretch of a drive in pixels over the map, before and after its mounting was refined.

    python mounting.py POINTS.csv OUT.png [FROM_M [LENGTH_M]]

POINTS.csv comes from `cargo run -p tilefold-benchmarks --example mounting`. FROM_M is along the road
from the first point.
"""

import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

HOW = [
    ("as stated", "as stated by the log"),
    ("registered and scaled to the side", "registered, scaled to the side"),
    ("registered with the mounting refined", "registered, mounting refined"),
]


def read(path):
    points, lines, line = {how: [] for how, _ in HOW}, [], []
    for row in open(path):
        how, east, north, distance = row.strip().split(";")
        if how == "map":
            line.append((float(east), float(north)))
        elif how == "end":
            lines.append(np.array(line))
            line = []
        else:
            points[how].append((float(east), float(north), float(distance)))
    return {how: np.array(values) for how, values in points.items()}, lines


def main(csv, out, from_m=150.0, length_m=70.0):
    points, lines = read(csv)
    stated = points["as stated"][:, :2]
    first = stated.mean(0)
    along = np.linalg.svd(stated - first, full_matrices=False)[2][0]
    if (stated[-1] - stated[0]) @ along < 0:
        along = -along
    axes = np.array([along, [-along[1], along[0]]]).T
    start = ((stated - first) @ axes)[:, 0].min() + from_m
    # Across the road, zero is what the stretch sees on average.
    places = (stated - first) @ axes
    inside = (places[:, 0] > start) & (places[:, 0] < start + length_m)
    middle = np.median(places[inside, 1])
    figure, plots = plt.subplots(3, 1, figsize=(11, 8.2), sharex=True, sharey=True)
    for plot, (how, title) in zip(plots, HOW):
        for line in lines:
            line = (line - first) @ axes
            plot.plot(line[:, 0] - start, line[:, 1] - middle, color="0.25", lw=1.2, zorder=3)
        values = points[how]
        place = (values[:, :2] - first) @ axes
        shown = plot.scatter(
            place[:, 0] - start, place[:, 1] - middle, c=values[:, 2], s=5, cmap="viridis_r", vmin=0, vmax=0.8
        )
        median = np.median(values[:, 2])
        plot.set_title(f"{title}: median of the whole drive {median:.2f} m", loc="left", fontsize=10)
        plot.set_ylabel("across, m")
        plot.set_xlim(0, length_m)
        plot.set_ylim(-9, 9)
    plots[-1].set_xlabel("along the road, m")
    figure.colorbar(shown, ax=plots, label="distance to the nearest map line, m", shrink=0.6)
    figure.savefig(out, dpi=110, bbox_inches="tight")


main(sys.argv[1], sys.argv[2], *map(float, sys.argv[3:]))
