"""Figures of real logs as the Python MCAP libraries read them: an oracle for `tilefold_formats::log`.

Usage: python tests/oracles/log_figures.py DATA_FOLDER > tests/oracles/log_figures.json
Needs: mcap, mcap-ros2-support, mcap-protobuf-support (PyPI).

Prints one object per log: what its summary says, and for every topic that Tilefold reads the
messages, the first and last stamp, and sums that change if a field is read from the wrong place.
"""

import json
import math
import sys
from pathlib import Path

from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory as Protobuf
from mcap_ros2.decoder import DecoderFactory as Ros2


def nanoseconds(stamp):
    if hasattr(stamp, "sec"):
        return stamp.sec * 10**9 + stamp.nanosec
    return stamp.seconds * 10**9 + stamp.nanos


def quaternion(q):
    return [q.x, q.y, q.z, q.w]


def vector(v):
    return [v.x, v.y, v.z]


def numbers(name, message):
    """Stamp (None: the log time), and the numbers of a message, in the order of its noun."""
    if name == "sensor_msgs/msg/NavSatFix":
        values = [message.latitude, message.longitude, message.altitude]
        return message.header.stamp, values + list(message.position_covariance)
    if name == "foxglove.LocationFix":
        values = [message.latitude, message.longitude, message.altitude]
        return message.timestamp, values + list(message.position_covariance)
    if name == "sensor_msgs/msg/Imu":
        return message.header.stamp, quaternion(message.orientation) + [message.orientation_covariance[8]]
    if name == "foxglove.PoseInFrame":
        return message.timestamp, vector(message.pose.position) + quaternion(message.pose.orientation)
    if name == "tf2_msgs/msg/TFMessage":
        values = []
        for one in message.transforms:
            values += vector(one.transform.translation) + quaternion(one.transform.rotation)
        return message.transforms[0].header.stamp, values
    if name == "sensor_msgs/msg/CameraInfo":
        return message.header.stamp, [message.width, message.height] + list(message.d) + list(message.k)
    if name == "sensor_msgs/msg/CompressedImage":
        return message.header.stamp, [len(message.data), sum(message.data)]
    if name == "foxglove.SceneUpdate":
        values = [p for e in message.entities for l in e.lines for q in l.points for p in vector(q)]
        return (message.entities[0].timestamp if message.entities else None), values
    if name == "foxglove.ImageAnnotations":
        values = [p for a in message.points for q in a.points for p in (q.x, q.y)]
        return (message.points[0].timestamp if message.points else None), values
    return None


def drawn(name, message, counts):
    """Counts the lines of a message by what their metadata says."""
    lines = []
    if name == "foxglove.SceneUpdate":
        lines = [(e.metadata, len(l.points)) for e in message.entities for l in e.lines]
    if name == "foxglove.ImageAnnotations":
        lines = [(a.metadata, len(a.points)) for a in message.points]
    for metadata, points in lines:
        said = {pair.key: pair.value for pair in metadata}
        kind = "/".join([said["class"], said.get("type", "unknown"), said.get("color", "unknown")])
        counts[kind] = counts.get(kind, 0) + 1
        counts["points"] = counts.get("points", 0) + points


def read_topics(reader, summary):
    topics = {}
    for channel in summary.channels.values():
        schema = summary.schemas[channel.schema_id].name if channel.schema_id else ""
        count = summary.statistics.channel_message_counts.get(channel.id, 0)
        topic = topics.setdefault(channel.topic, {"schema": schema, "encoding": channel.message_encoding, "messages": 0})
        topic["messages"] += count
    return topics


def decoder_for(schema, channel, known):
    key = (schema.id, channel.message_encoding)
    if key not in known:
        made = (factory.decoder_for(channel.message_encoding, schema) for factory in (Ros2(), Protobuf()))
        known[key] = next(filter(None, made), None)
    return known[key]


def read_messages(reader, topics):
    sums, known = {}, {}
    for schema, channel, record in reader.iter_messages():
        topic = topics[channel.topic]
        if not schema.name.startswith(("sensor_msgs/", "tf2_msgs/", "foxglove.")):
            continue
        message = decoder_for(schema, channel, known)(record.data)
        stamp, values = numbers(schema.name, message)
        stamp = record.log_time if stamp is None else nanoseconds(stamp)
        topic.setdefault("first_stamp_ns", stamp)
        topic["last_stamp_ns"] = stamp
        sums.setdefault(channel.topic, []).extend(values)
        drawn(schema.name, message, topic.setdefault("drawn", {}))
    for name, values in sums.items():
        topics[name]["sum"] = math.fsum(values)
        topics[name]["sum_of_squares"] = math.fsum(v * v for v in values)


def figures(path):
    with open(path, "rb") as file:
        reader = make_reader(file, validate_crcs=True)
        summary = reader.get_summary()
        topics = read_topics(reader, summary)
        read_messages(reader, topics)
        metadata = [record.metadata for record in reader.iter_metadata()]
    vehicle = next((m["vehicle_id"] for m in metadata if "vehicle_id" in m), None)
    return {
        "messages": summary.statistics.message_count,
        "start_ns": summary.statistics.message_start_time,
        "end_ns": summary.statistics.message_end_time,
        "vehicle": vehicle,
        "metadata": len(metadata),
        "topics": topics,
    }


def main():
    root = Path(sys.argv[1])
    logs = sorted(root.glob("deecamp/logs/*.mcap"))[::4] + sorted(root.glob("deecamp/*.mcap"))
    logs += sorted(root.glob("logs/rosbag2/*.mcap"))
    print("{")
    for at, path in enumerate(logs):
        end = "," if at + 1 < len(logs) else ""
        print(f"{json.dumps(str(path.relative_to(root)))}: {json.dumps(figures(path), sort_keys=True)}{end}")
    print("}")


if __name__ == "__main__":
    main()
