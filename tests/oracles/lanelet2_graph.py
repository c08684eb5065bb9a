"""Golden figures for `tilefold-formats` and `tilefold-city`: the lane graph as the Lanelet2 library
sees it for a car in Germany.

    pip install lanelet2==1.2.3
    python lanelet2_graph.py ../../../shared/data > lanelet2_graph.json

Per map, a lane is a lanelet that a car may pass; a lanelet of both directions is two lanes, the one
against its borders with a negative id. Listed are the lanes with their speeds (km/h) and the lengths
of their middles, which lane follows which, which lies to the left of which where a car may change
to it (`left`) and where it may not (`adjacent_left`), and which lanes overlap others (`conflicting`).

Maps of the scheme before Lanelet2's release say `normal`, `vehicle=yes|no` and `city`: they are
handed to the library with the words of today.
"""

import json
import pathlib
import sys
import tempfile
import xml.etree.ElementTree as ET

import lanelet2
from lanelet2 import traffic_rules
from lanelet2.geometry import length
from lanelet2.io import Origin, loadRobust
from lanelet2.projection import UtmProjector

ORIGINS = {"karlsruhe": (49.0, 8.42), "kashiwanoha": (35.9, 139.93)}


def retag(thing):
    tags = {tag.get("k"): tag for tag in thing.findall("tag")}
    value = {key: tag.get("v") for key, tag in tags.items()}
    if value.get("type") == "lanelet" and "vehicle" in value:
        if value.get("subtype", "normal") == "normal":
            if "subtype" not in tags:
                tags["subtype"] = ET.SubElement(thing, "tag", k="subtype")
            drives = value["vehicle"] == "yes"
            tags["subtype"].set("v", "road" if drives else "walkway")
    if value.get("location") == "city":
        tags["location"].set("v", "urban")
    if "subtype" in value and value.get("type", "").startswith("line_"):
        tags["subtype"].set("v", value["subtype"].replace("straight", "solid"))


def load(path):
    root = ET.fromstring(path.read_bytes().lstrip())
    for thing in root:
        retag(thing)
    with tempfile.NamedTemporaryFile(suffix=".osm") as file:
        ET.ElementTree(root).write(file.name)
        loaded, errors = loadRobust(file.name, UtmProjector(Origin(*ORIGINS[path.parent.name])))
    assert not errors, errors
    return loaded


def number(lane):
    return -lane.id if lane.inverted() else lane.id


def lanes(loaded, rules):
    for lanelet in loaded.laneletLayer:
        if rules.canPass(lanelet):
            yield lanelet
            if not rules.isOneWay(lanelet):
                yield lanelet.invert()


def figures(path, root):
    loaded = load(path)
    rules = traffic_rules.create(
        traffic_rules.Locations.Germany, traffic_rules.Participants.VehicleCar
    )
    graph = lanelet2.routing.RoutingGraph(loaded, rules)
    row = {"map": str(path.relative_to(root)), "lanelets": 0, "lanes": [], "following": [],
           "left": [], "adjacent_left": [], "conflicting": []}
    row["lanelets"] = sum(rules.canPass(lanelet) for lanelet in loaded.laneletLayer)
    for lane in sorted(lanes(loaded, rules), key=number):
        speed = rules.speedLimit(lane).speedLimit
        row["lanes"].append([number(lane), round(speed, 2), round(length(lane.centerline), 2)])
        for after in graph.following(lane):
            row["following"].append([number(lane), number(after)])
        for name, beside in [("left", graph.left(lane)), ("adjacent_left", graph.adjacentLeft(lane))]:
            if beside is not None:
                row[name].append([number(lane), number(beside)])
        if any(abs(number(other)) != lane.id for other in graph.conflicting(lane)):
            row["conflicting"].append(number(lane))
    return row


def main():
    root = pathlib.Path(sys.argv[1])
    paths = [path for name in ORIGINS for path in sorted((root / "maps" / name).glob("*.osm"))]
    print("[\n" + ",\n".join(json.dumps(figures(path, root), separators=(",", ":")) for path in paths) + "\n]")


if __name__ == "__main__":
    main()
