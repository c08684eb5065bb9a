"""Draws what a run found on the deecamp road, beside what was edited.

    python deecamp.py MAP.osm FOUND.geojson TRUTH.geojson OUT.png [--claims EVALUATE.json]

The road is shown straightened: the plane is turned by its main direction, and a smooth road centre
is taken away, so that a metre to the side can be seen on a kilometre of road. With --claims, findings
that `tilefold evaluate --format json` did not count as claims are dotted, wrong claims dashed. Needs numpy and matplotlib.
"""

import argparse
import json
import xml.etree.ElementTree as ElementTree

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.lines import Line2D

# A plane that touches the earth in the middle of the road, in metres.
LAT0, LON0 = 22.6815, 114.3665
METRES_PER_DEG = np.array([111_320 * np.cos(np.radians(LAT0)), 110_574])
# Main direction of the road against east, and the degree of its centre line.
ROAD_DEG, CENTRE_DEGREE = 14.0, 12
ROWS, SHOWN_M, HALF_WIDTH_M = 4, 1040.0, 20.0
COLOURS = {"added": "#1b8a3a", "removed": "#c62828", "modified": "#1557b0"}


def plane(lon_lat):
    return (np.array([c[:2] for c in lon_lat]) - [LON0, LAT0]) * METRES_PER_DEG


def read_map(path):
    """Lane markings of a Lanelet2 file: id and points in the plane."""
    root = ElementTree.parse(path).getroot()
    nodes = {n.get("id"): (float(n.get("lon")), float(n.get("lat"))) for n in root.iter("node")}
    for way in root.iter("way"):
        if any(tag.get("v") == "line_thin" for tag in way.iter("tag")):
            yield int(way.get("id")), plane([nodes[nd.get("ref")] for nd in way.iter("nd")])


def read_features(path):
    """Lines of a GeoJSON file: properties and points in the plane."""
    with open(path) as file:
        features = json.load(file)["features"]
    for feature in features:
        if feature["geometry"]["type"] == "LineString":
            yield feature["properties"], plane(feature["geometry"]["coordinates"])


class Straightened:
    def __init__(self, lines):
        turn = np.radians(ROAD_DEG)
        cos, sin = np.cos(turn), np.sin(turn)
        self.turn = np.array([[cos, sin], [-sin, cos]])
        points = np.vstack(lines) @ self.turn.T
        self.start_m = points[:, 0].min()
        self.centre = np.polynomial.Polynomial.fit(points[:, 0], points[:, 1], CENTRE_DEGREE)

    def __call__(self, points):
        turned = points @ self.turn.T
        along, across = turned[:, 0], turned[:, 1]
        return along - self.start_m, across - self.centre(along)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("map")
    parser.add_argument("found")
    parser.add_argument("truth")
    parser.add_argument("out")
    parser.add_argument("--claims", help="output of `tilefold evaluate --format json`")
    args = parser.parse_args()

    lines = dict(read_map(args.map))
    straight = Straightened(list(lines.values()))
    found, truth = list(read_features(args.found)), list(read_features(args.truth))
    claimed, missed, wrong = {p["change"] for p, _ in found}, set(), set()
    if args.claims:
        with open(args.claims) as file:
            outcomes = json.load(file)["outcomes"]
        claimed = {o["change"] for o in outcomes if o["outcome"] != "missed"}
        wrong = {o["change"] for o in outcomes if o["outcome"].startswith("wrong")}
        missed = {o["element_id"] for o in outcomes if o["outcome"] == "missed"}

    figure, rows = plt.subplots(ROWS, 1, figsize=(15, 19))
    row_m = SHOWN_M / ROWS
    for row, axes in enumerate(rows):
        from_m, to_m = row * row_m, (row + 1) * row_m

        def note(along, across, text, colour, lift, weight="normal"):
            middle = along.mean()
            if from_m <= middle < to_m:
                at = across[np.abs(along - middle).argmin()] + lift
                axes.text(middle, at, text, color=colour, fontsize=9, ha="center", weight=weight)

        for points in lines.values():
            axes.plot(*straight(points), color="0.55", lw=0.7)
        for props, points in truth:
            along, across = straight(points)
            axes.plot(along, across, color=COLOURS[props["change_type"]], lw=9, alpha=0.22)
            if props["element_id"] in missed:
                note(along, across, f"missed {props['element_id']}", "black", -1.2, "bold")
        for props, points in found:
            along, across = straight(points)
            kind, is_wrong = props["change_type"], props["change"] in wrong
            style = "--" if is_wrong else "-" if props["change"] in claimed else ":"
            axes.plot(along, across, color=COLOURS[kind], lw=2.2, ls=style)
            name = props["element_id"] or ""
            text = f"wrong {name}" if is_wrong else f"{name} ({props['vehicles']})"
            note(along, across, text, COLOURS[kind], 0.35, "bold" if is_wrong else "normal")
        axes.set_xlim(from_m, to_m)
        axes.set_ylim(-HALF_WIDTH_M, HALF_WIDTH_M)
        axes.set_ylabel("across the road, m")
    rows[-1].set_xlabel("along the road, m")
    entries = [Line2D([], [], color="0.55", lw=0.7, label="map given")]
    for kind, colour in COLOURS.items():
        entries.append(Line2D([], [], color=colour, lw=9, alpha=0.22, label=f"truth: {kind}"))
        entries.append(Line2D([], [], color=colour, lw=2.2, label=f"claimed: {kind} (vehicles)"))
    entries.append(Line2D([], [], color="0.2", lw=2.2, ls="--", label="claimed wrongly"))
    entries.append(Line2D([], [], color="0.2", lw=2.2, ls=":", label="found, below the limits"))
    figure.legend(handles=entries, loc="upper center", ncol=4, frameon=False)
    figure.tight_layout(rect=(0, 0, 1, 0.96))
    figure.savefig(args.out, dpi=75)


if __name__ == "__main__":
    main()
