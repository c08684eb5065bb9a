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
    axes = elements.to_crs(metres).plot(color="lightgrey", linewidth=0.6, figsize=(10, 7))
    for verdict, colour in COLOURS.items():
        some = claims[claims.verdict == verdict].to_crs(metres)
        if len(some) > 0:
            # Areas as their outlines: a claim is a thing to look at, whatever its size.
            label = f"{verdict} ({len(some)})"
            some.boundary.where(some.geom_type == "Polygon", some.geometry).plot(
                ax=axes, color=colour, linewidth=2.2, label=label
            )
    axes.set(xlabel="east, m", ylabel="north, m", title=f"Version {snapshot.version}")
    axes.ticklabel_format(useOffset=False, style="plain")
    axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False)
    axes.figure.savefig(picture, dpi=110, bbox_inches="tight")
# ANCHOR_END: draw


if __name__ == "__main__":
    draw(*sys.argv[1:3])
