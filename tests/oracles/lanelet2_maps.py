"""Golden figures for `tilefold-formats`: Lanelet2 maps as the Lanelet2 library reads them.

    pip install lanelet2==1.2.3
    python lanelet2_maps.py ../../../shared/data > lanelet2_maps.json

Per map: how many lanelets, areas and regulatory elements there are; and per type of line string
and polygon how many there are, their points, and the sums of their longitudes, latitudes and
elevations (from the library's UTM coordinates, projected back). `subtypes` counts both by type and
subtype.
"""

import json
import pathlib
import sys
import tempfile

import lanelet2
from lanelet2.core import GPSPoint
from lanelet2.io import Origin, loadRobust
from lanelet2.projection import UtmProjector

ORIGINS = {"deecamp": (22.68, 114.36), "karlsruhe": (49.0, 8.42), "kashiwanoha": (35.9, 139.93)}


def maps(data):
    yield data / "deecamp/before.osm"
    yield data / "deecamp/after.osm"
    yield from sorted((data / "maps/karlsruhe").glob("*.osm"))
    yield from sorted((data / "maps/kashiwanoha").glob("*.osm"))


def load(path, projector):
    """The library does not read a blank line before the declaration: hand it the rest."""
    with tempfile.NamedTemporaryFile(suffix=".osm") as file:
        file.write(path.read_bytes().lstrip())
        file.flush()
        return loadRobust(file.name, projector)


def shapes(layer, projector):
    by_type = {}
    for shape in layer:
        tags = shape.attributes
        name = tags["type"] if "type" in tags else ""
        row = by_type.setdefault(name, {"shapes": 0, "points": 0, "lon": 0.0, "lat": 0.0, "ele": 0.0})
        row["shapes"] += 1
        for point in shape:
            gps: GPSPoint = projector.reverse(lanelet2.core.BasicPoint3d(point.x, point.y, point.z))
            row["points"] += 1
            row["lon"] += gps.lon
            row["lat"] += gps.lat
            row["ele"] += gps.alt
    return dict(sorted(by_type.items()))


def subtypes(*layers):
    counts = {}
    for layer in layers:
        for shape in layer:
            tags = shape.attributes
            name = "/".join(tags[key] if key in tags else "" for key in ("type", "subtype"))
            counts[name] = counts.get(name, 0) + 1
    return dict(sorted(counts.items()))


def figures(path, root):
    projector = UtmProjector(Origin(*ORIGINS[path.relative_to(root).parts[-2]]))
    loaded, errors = load(path, projector)
    return {
        "map": str(path.relative_to(root)),
        "lanelets": len(loaded.laneletLayer),
        "areas": len(loaded.areaLayer),
        "regulatory_elements": len(loaded.regulatoryElementLayer),
        "errors": len(errors),
        "lines": shapes(loaded.lineStringLayer, projector),
        "polygons": shapes(loaded.polygonLayer, projector),
        "subtypes": subtypes(loaded.lineStringLayer, loaded.polygonLayer),
    }


def main():
    root = pathlib.Path(sys.argv[1])
    rows = [figures(path, root) for path in maps(root)]
    print("[\n" + ",\n".join(json.dumps(row) for row in rows) + "\n]")


if __name__ == "__main__":
    main()
