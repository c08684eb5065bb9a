"""Reads drives (MCAP: ROS 2 or Foxglove messages) and the lane lines of a Lanelet2 map into arrays.

Planes are metres east and north of the map's first node; yaws are counter-clockwise from east. Needs numpy,
pyproj, mcap, mcap-ros2-support and mcap-protobuf-support.
"""

import pathlib
import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass

import numpy as np
import pyproj
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory as Protobuf
from mcap_ros2.decoder import DecoderFactory as Ros2

LINE_TYPES = ("line_thin", "line_thick")


@dataclass
class Drive:
    name: str
    fixes: np.ndarray  # seconds, longitude, latitude
    yaws: np.ndarray  # seconds, radians
    frames: list  # (seconds, [points of a line: x forward, y left])


class Plane:
    """Transverse Mercator around a point: metres, true to scale there."""

    def __init__(self, longitude, latitude):
        plane = f"+proj=tmerc +lon_0={longitude} +lat_0={latitude} +ellps=WGS84"
        self.project = pyproj.Transformer.from_crs("EPSG:4326", plane, always_xy=True)

    def __call__(self, longitudes, latitudes):
        return np.stack(self.project.transform(longitudes, latitudes), axis=-1)


def read_map(path):
    """The plane, and lane lines by id."""
    root = ElementTree.parse(path).getroot()
    nodes = {n.get("id"): (float(n.get("lon")), float(n.get("lat"))) for n in root.iter("node")}
    plane, lines = Plane(*next(iter(nodes.values()))), {}
    for way in root.iter("way"):
        tags = {tag.get("k"): tag.get("v") for tag in way.iter("tag")}
        if tags.get("type") in LINE_TYPES:
            points = np.array([nodes[nd.get("ref")] for nd in way.iter("nd")])
            lines[int(way.get("id"))] = plane(points[:, 0], points[:, 1])
    return plane, lines


def seconds(stamp):
    """Of a ROS 2 or a Foxglove stamp."""
    nanoseconds = stamp.nanosec if hasattr(stamp, "nanosec") else stamp.nanos
    return (stamp.sec if hasattr(stamp, "sec") else stamp.seconds) + nanoseconds * 1e-9


def stamp_of(message):
    return seconds(message.header.stamp if hasattr(message, "header") else message.timestamp)


def yaw_of(q):
    return np.arctan2(2 * (q.w * q.z + q.x * q.y), 1 - 2 * (q.y**2 + q.z**2))


def is_lane_line(entity):
    known = {pair.key: pair.value for pair in entity.metadata}
    return known.get("class", "lane_marking") == "lane_marking"


def frame_of(scene):
    lines = [line for entity in scene.entities if is_lane_line(entity) for line in entity.lines]
    points = [np.array([(p.x, p.y) for p in line.points]).reshape(-1, 2) for line in lines]
    return seconds(scene.entities[0].timestamp), points


def read_drive(path):
    fixes, yaws, frames = [], [], []
    with open(path, "rb") as file:
        reader = make_reader(file, decoder_factories=[Ros2(), Protobuf()])
        for schema, _, _, message in reader.iter_decoded_messages():
            kind = schema.name.replace("/", ".").split(".")[-1]
            if kind in ("NavSatFix", "LocationFix"):
                fixes.append((stamp_of(message), message.longitude, message.latitude))
            elif kind == "Imu":
                yaws.append((stamp_of(message), yaw_of(message.orientation)))
            elif kind == "PoseInFrame":
                yaws.append((stamp_of(message), yaw_of(message.pose.orientation)))
            elif kind == "SceneUpdate" and message.entities:
                frames.append(frame_of(message))
    frames.sort(key=lambda frame: frame[0])
    in_order = [np.array(sorted(rows)).reshape(-1, width) for rows, width in ((fixes, 3), (yaws, 2))]
    return Drive(pathlib.Path(path).stem, *in_order, frames)


def read_drives(folder, limit=None):
    for path in sorted(pathlib.Path(folder).glob("*.mcap"))[:limit]:
        yield read_drive(path)
