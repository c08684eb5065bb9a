"""A simulated city as somebody else's libraries read it: an oracle for `tilefold_formats::log_write` and the city.

Usage: python tests/oracles/read_logs.py CITY_FOLDER
Needs: mcap, mcap-ros2-support, mcap-protobuf-support, numpy, pyproj (PyPI).

Decodes every message of every log, and says what is in them: counts, sizes, the errors of the receivers against
the street, how often each changed line was passed, and whether the detections lie on the true map. Exits with 1 if
a number is not what the city promises.
"""

import json
import math
import re
import sys
from collections import Counter, defaultdict
from pathlib import Path

import numpy as np
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory as Protobuf
from mcap_ros2.decoder import DecoderFactory as Ros2
from pyproj import Transformer

NS = 10**9


def ways(path, to_plane):
    text = path.read_text()
    nodes = {m[0]: to_plane(float(m[2]), float(m[1])) for m in re.findall(r"<node id='(\d+)' lat='(\S+)' lon='(\S+)'", text)}
    return {
        int(m[0]): np.array([nodes[ref] for ref in re.findall(r"ref='(\d+)'", m[1])])
        for m in re.findall(r"<way id='(\d+)'(.*?)</way>", text)
    }


def stamp_ns(stamp):
    if hasattr(stamp, "sec"):
        return stamp.sec * NS + stamp.nanosec
    return stamp.seconds * NS + stamp.nanos


def read(path):
    """Vehicle, dialect, and rows of positions, yaws, detections and odometry by header stamp."""
    positions, yaws, frames, wheels, counts = [], [], [], [], Counter()
    with path.open("rb") as file:
        reader = make_reader(file, decoder_factories=[Ros2(), Protobuf()], validate_crcs=True)
        vehicle = [m.metadata["vehicle_id"] for m in reader.iter_metadata() if m.name == "vehicle"][0]
        profile = reader.get_header().profile
        for schema, _, message, decoded in reader.iter_decoded_messages():
            counts[schema.name] += 1
            if schema.name == "sensor_msgs/msg/NavSatFix":
                if decoded.status.status < 0:
                    continue
                assert decoded.position_covariance_type == 3
                positions.append((stamp_ns(decoded.header.stamp), decoded.longitude, decoded.latitude))
            elif schema.name == "foxglove.LocationFix":
                if decoded.position_covariance_type == 0:
                    continue
                positions.append((stamp_ns(decoded.timestamp), decoded.longitude, decoded.latitude))
            elif schema.name == "sensor_msgs/msg/Imu":
                q = decoded.orientation
                yaws.append((stamp_ns(decoded.header.stamp), 2 * math.atan2(q.z, q.w)))
            elif schema.name == "foxglove.PoseInFrame":
                q = decoded.pose.orientation
                yaws.append((stamp_ns(decoded.timestamp), 2 * math.atan2(q.z, q.w)))
            elif schema.name == "nav_msgs/msg/Odometry":
                assert (decoded.header.frame_id, decoded.child_frame_id) == ("odom", "base_link")
                twist, pose = decoded.twist.twist, decoded.pose.pose
                wheels.append(odometry(decoded.header.stamp, pose, twist.linear, twist.angular))
            elif schema.name == "foxglove.Odometry":
                assert (decoded.frame_id, decoded.body_frame_id) == ("odom", "base_link")
                wheels.append(odometry(decoded.timestamp, decoded.pose, decoded.linear_velocity, decoded.angular_velocity))
            elif schema.name == "foxglove.SceneUpdate":
                lines = [
                    (dict((pair.key, pair.value) for pair in entity.metadata), [(p.x, p.y) for p in entity.lines[0].points])
                    for entity in decoded.entities
                    if entity.lines
                ]
                frames.append((stamp_ns(decoded.entities[0].timestamp), lines))
    return vehicle, profile, positions, yaws, frames, wheels, counts


def odometry(stamp, pose, linear, angular):
    """Stamp, speed, yaw rate, x, y, yaw."""
    q = pose.orientation
    return (stamp_ns(stamp), linear.x, angular.z, pose.position.x, pose.position.y, 2 * math.atan2(q.z, q.w))


def shape_error(wheels, seconds, east, north):
    """How far the way by odometry is from that by positions after 20 s, both moved and turned onto each other."""
    at, x, y = wheels[:, 0], wheels[:, 3], wheels[:, 4]
    errors = []
    for begin in np.arange(at[0] + 1, at[-1] - 21, 20.0):
        t = np.arange(begin, begin + 20, 0.5)
        if np.diff(at[(at >= begin) & (at < begin + 20)]).max(initial=0) > 1:
            continue
        ours = np.interp(t, at, x) + 1j * np.interp(t, at, y)
        theirs = np.interp(t, seconds, east) + 1j * np.interp(t, seconds, north)
        ours, theirs = ours - ours.mean(), theirs - theirs.mean()
        turn = np.vdot(ours, theirs)
        if abs(turn) > 1:
            errors.append(np.abs(ours * turn / abs(turn) - theirs).mean())
    return errors


def offset_to(line, point, yaw):
    """Signed distance to a polyline (left is positive) if the point lies beside it and nearly along."""
    a, b = line[:-1], line[1:]
    along = b - a
    length = np.hypot(*along.T)
    t = np.einsum("ij,ij->i", point - a, along) / length**2
    beside = (t >= 0) & (t <= 1)
    if not beside.any():
        return None
    normal = np.stack([-along[:, 1], along[:, 0]], 1) / length[:, None]
    distance = np.einsum("ij,ij->i", point - a, normal)
    distance[~beside] = np.inf
    best = np.argmin(np.abs(distance))
    direction = math.atan2(along[best, 1], along[best, 0])
    return distance[best] if abs(math.remainder(direction - yaw, math.tau)) < 0.3 else None


def main(folder):
    truth = json.loads((folder / "truth.geojson").read_text())["features"]
    truth = [feature for feature in truth if feature["geometry"]["type"] == "LineString"]
    lon, lat = truth[0]["geometry"]["coordinates"][0][:2]
    to_plane = Transformer.from_crs("EPSG:4326", f"+proj=tmerc +lat_0={lat} +lon_0={lon} +ellps=WGS84", always_xy=True).transform
    before, after = ways(folder / "before.osm", to_plane), ways(folder / "after.osm", to_plane)

    passes, residuals, vehicles, total, size = Counter(), defaultdict(list), Counter(), Counter(), 0
    for path in sorted((folder / "logs").glob("*.mcap")):
        vehicle, profile, positions, yaws, frames, wheels, counts = read(path)
        size += path.stat().st_size
        vehicles[vehicle] += 1
        total += counts
        times, lons, lats = np.array(positions).T
        # Stamps in seconds from the first position: nanoseconds since 1970 do not fit into a double.
        zero = positions[0][0]
        seconds = np.array([(row[0] - zero) / NS for row in positions])
        east, north = to_plane(lons, lats)
        yaw_seconds, yaw = np.array([((row[0] - zero) / NS, row[1]) for row in yaws]).T
        yaw = np.unwrap(yaw)
        wheels = np.array([((row[0] - zero) / NS, *row[1:]) for row in wheels])
        residuals["shape"].extend(shape_error(wheels, seconds, east, north))
        seen = Counter()
        for stamp, lines in frames[::5]:
            at = (stamp - zero) / NS
            origin = np.array([np.interp(at, seconds, east), np.interp(at, seconds, north)])
            heading = np.interp(at, yaw_seconds, yaw)
            left = np.array([-math.sin(heading), math.cos(heading)])
            ahead = np.array([math.cos(heading), math.sin(heading)])
            offsets = []
            for _, points in lines:
                x, y = points[len(points) // 2]
                point = origin + x * ahead + y * left
                near = [offset_to(line, point, heading) for line in after.values() if abs(line[0] - point).max() < 120]
                near = [offset for offset in near if offset is not None]
                if near:
                    offsets.append(min(near, key=abs))
            if len(offsets) >= 2:
                residuals["position"].append(np.median(offsets))
                residuals["line"].extend(np.array(offsets) - np.median(offsets))
            for feature in truth:
                identity = feature["properties"]["element_id"]
                line = after.get(identity, before.get(identity))
                offset = offset_to(line, origin + 8 * ahead, heading)
                if offset is not None and abs(offset) < 6:
                    seen[identity] += 1
        passes.update(identity for identity, count in seen.items() if count >= 4)

    drives = sum(vehicles.values())
    passed = sorted(passes[feature["properties"]["element_id"]] for feature in truth)
    line = np.abs(residuals["line"])
    print(f"{drives} drives of {len(vehicles)} vehicles, {size / 1e6:.1f} MB, {dict(total)}")
    print(f"passes of each changed line: {passed}")
    print(f"lateral position error modulo aliases: median {np.median(np.abs(residuals['position'])):.2f} m")
    print(f"line beside its map line, after one shift per frame: median {np.median(line):.3f} m, 90 % {np.quantile(line, 0.9):.3f} m")
    shape = np.array(residuals["shape"])
    print(f"way of 20 s by odometry against positions: median {np.median(shape):.2f} m, 90 % {np.quantile(shape, 0.9):.2f} m")
    good = np.median(shape) < 0.5 and len(shape) > drives and np.median(passed) >= 5 and np.median(line) < 0.2 and size < 60e6
    print("as promised" if good else "NOT as promised")
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1])))
