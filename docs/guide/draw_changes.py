"""Draws the changes of a store: `python draw_changes.py STORE PICTURE`."""

import sys

import matplotlib

matplotlib.use("Agg")
from matplotlib import pyplot

import tilefold

COLOURS = {"removed": "tab:red", "added": "tab:green", "modified": "tab:blue"}


# ANCHOR: draw
def draw(store: str, picture: str, threshold: float = 0.85, vehicles: int = 3) -> None:
    snapshot = tilefold.open(store).snapshot()
    elements = snapshot.elements().to_geopandas()
    changes = snapshot.changes().to_geopandas()
    changes["verdict"] = changes["verdict"].map(tilefold.CODES["verdict"])
    changes["p"] = 1 - changes["p_no_change"]
    claims = changes[(changes.p >= threshold) & (changes.vehicles >= vehicles)]

    metres = elements.estimate_utm_crs()
    roads = elements.to_crs(metres)
    west_m, south_m, _, _ = roads.total_bounds
    axes = roads.translate(-west_m, -south_m).plot(color="silver", linewidth=0.6, figsize=(11, 7))
    for verdict, colour in COLOURS.items():
        some = claims[claims.verdict == verdict].to_crs(metres).translate(-west_m, -south_m)
        if len(some) == 0:
            continue
        some.plot(ax=axes, color=colour, linewidth=2.2)
        axes.plot([], [], color=colour, linewidth=2.2, label=f"{verdict} ({len(some)})")
        # Signs and stop lines are too small to see: a ring around each.
        small = some[some.length < 20]
        axes.plot(small.centroid.x, small.centroid.y, "o", color=colour, markersize=9, fillstyle="none")
    axes.set(xlabel="east, m", ylabel="north, m", title=f"Version {snapshot.version}: what is claimed")
    axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False)
    axes.figure.savefig(picture, dpi=110, bbox_inches="tight")
# ANCHOR_END: draw


if __name__ == "__main__":
    draw(*sys.argv[1:3])
