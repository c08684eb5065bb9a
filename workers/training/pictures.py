"""Rendered pictures with their truth, read from the logs of simulated cities.

A picture is kept as its JPEG bytes with what is in it, in pixels (centre of the first pixel: 0, 0):
lines (polyline, marking, colour, weight) and boxes (left, top, right, bottom, class, weight). A weight
of 0 says that nothing is to be learnt there, for or against.
"""

import json
import pickle
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory as Protobuf
from mcap_ros2.decoder import DecoderFactory as Ros2

MARKINGS = ["solid", "dashed", "solid_solid", "solid_dashed", "dashed_solid", "dashed_dashed", "other"]
COLORS = ["white", "yellow", "other"]
BOXES = [
    "straight_arrow", "left_arrow", "right_arrow", "straight_left_arrow", "straight_right_arrow",
    "diamond", "speed_limit", "bus_lane", "cycle_lane", "slow", "box_junction",
    "crosswalk", "stop_line", "vehicle",
]
UNKNOWN = -1

# Paint that is worn more than this is neither asked for nor forbidden.
WORN = 0.7
# Lines are asked for up to this many metres.
FAR_M = 60.0
AREA_FAR_M = 40.0
# What is seen of an area, or of a vehicle, to be asked for.
AREA_SHARE = 0.4
VEHICLE_PX = 60
# Rows this close to the farthest paint are left out: lines run together there.
HORIZON_PX = 10.0


@dataclass
class Line:
    points_px: np.ndarray
    marking: int
    color: int
    weight: float


@dataclass
class Box:
    ltrb_px: np.ndarray
    kind: int
    weight: float


@dataclass
class Picture:
    jpeg: bytes
    category: str
    lines: list = field(default_factory=list)
    boxes: list = field(default_factory=list)
    top_px: float = 0.0
    # Whether the truth knows boxes (that of real pictures does not).
    has_boxes: bool = True


def index(names, name):
    return names.index(name) if name in names else UNKNOWN


def line_of(paint):
    seen = paint["visible_share"] > 0.0 and paint["occluded_share"] < 0.9
    asked = seen and paint["nearest_m"] < FAR_M and paint["wear"] < WORN
    for points in paint["lines_px"]:
        if len(points) > 1:
            yield Line(
                np.asarray(points, np.float32),
                index(MARKINGS, paint["marking"]),
                index(COLORS, paint["color"]),
                float(asked),
            )


def area_of(paint):
    kind = paint["sign"] if paint["kind"] == "ground_sign" else paint["kind"]
    left, top, right, bottom = paint["box_px"]
    asked = (
        paint["visible_share"] >= AREA_SHARE
        and paint["nearest_m"] < AREA_FAR_M
        and paint["wear"] < WORN
        and bottom - top >= 4
    )
    return Box(np.array([left, top, right, bottom], np.float32), index(BOXES, kind), float(asked))


def picture_of(jpeg, truth):
    picture = Picture(jpeg, truth["category"])
    top = [y for paint in truth["paint"] for points in paint["lines_px"] for _, y in points]
    picture.top_px = min(top, default=0.0) + HORIZON_PX
    for paint in truth["paint"]:
        if paint["kind"] == "lane_marking":
            picture.lines.extend(line_of(paint))
        elif paint["box_px"] is not None:
            picture.boxes.append(area_of(paint))
    for vehicle in truth["vehicles"]:
        box = np.array(vehicle["box_px"], np.float32)
        asked = vehicle["visible_px"] >= VEHICLE_PX and (box[2:] - box[:2]).min() >= 6
        picture.boxes.append(Box(box, BOXES.index("vehicle"), float(asked)))
    return picture


def time_ns_of(image):
    if hasattr(image, "header"):
        return image.header.stamp.sec * 1_000_000_000 + image.header.stamp.nanosec
    return image.timestamp.seconds * 1_000_000_000 + image.timestamp.nanos


def read_log(path):
    """The pictures of a log; the truth stands beside it, a line per picture."""
    truths = {}
    for line in path.with_suffix(".frames.jsonl").read_text().splitlines():
        truth = json.loads(line)
        truths[truth["time_ns"]] = truth
    with path.open("rb") as file:
        reader = make_reader(file, decoder_factories=[Ros2(), Protobuf()])
        for _, _, _, image in reader.iter_decoded_messages(topics=["/camera/image/compressed"]):
            yield picture_of(bytes(image.data), truths[time_ns_of(image)])


def read_city(folder):
    """The pictures of a simulated city, kept beside it for the next time."""
    kept = Path(folder) / "pictures.pickle"
    if not kept.exists():
        pictures = [p for log in sorted(Path(folder).glob("logs/*.mcap")) for p in read_log(log)]
        kept.write_bytes(pickle.dumps(pictures))
    return pickle.loads(kept.read_bytes())
