"""Jobs on this machine. Reports are what `tilefold --format json` prints, as dictionaries."""

from __future__ import annotations

import datetime
import importlib.util
import json
from collections.abc import Sequence
from os import PathLike
from pathlib import Path
from typing import Any

from tilefold import _tilefold

AnyPath = str | PathLike[str]
"""A path of this machine."""
Report = dict[str, Any]
"""What a job did, as `tilefold --format json` prints it."""

DEFAULT_TILE_LEVEL = 15


def init(
    store: AnyPath,
    maps: Sequence[AnyPath],
    *,
    tile_level: int = DEFAULT_TILE_LEVEL,
    salt: bytes | None = None,
) -> Report:
    """Creates a store from a base map.

    Args:
        store: A folder, or a URL (`s3://bucket/store`).
        maps: Lanelet2, Argoverse 2 or OpenDRIVE files that belong together.
        tile_level: Level of the tiles (0 to 15).
        salt: 32 bytes that vehicle ids are hashed with; without them they follow from the map.
    """
    return _report(_tilefold.init(store, maps, tile_level, salt))


def run(
    store: AnyPath,
    logs: Sequence[AnyPath],
    *,
    model: str = "calibrated",
    registration: bool = True,
    as_of: datetime.datetime | int | None = None,
    detector: AnyPath | None = None,
    onnxruntime: AnyPath | None = None,
    cuda: int | None = None,
    threads: int = 0,
) -> Report:
    """Maps what is new in the logs, folds what it touches, commits a version.

    Args:
        store: The store.
        logs: MCAP files, or folders of them.
        model: The fusion model, `calibrated` or `paper`.
        registration: Whether poses are laid on the map.
        as_of: Only what was seen until then counts; an integer is in nanoseconds since the epoch.
        detector: Card of a network that looks at the pictures of logs without detections.
        onnxruntime: The library of ONNX Runtime; without it that of the package `onnxruntime`.
        cuda: Number of the graphics card that the network runs on; without it the processor.
        threads: How many threads work; 0 is one a core.

    Returns:
        What was done; `set_aside` lists what could not be used, and why.
    """
    library = onnxruntime or (find_onnxruntime() if detector else None)
    return _report(
        _tilefold.run(
            store,
            logs,
            model,
            registration,
            nanoseconds(as_of),
            detector,
            library,
            cuda,
            threads,
        )
    )


def plan(
    logs: Sequence[AnyPath],
    *,
    detector: AnyPath | None = None,
    onnxruntime: AnyPath | None = None,
) -> Report:
    """What a run would read, by the summaries of the logs alone."""
    library = onnxruntime or (find_onnxruntime() if detector else None)
    return _report(_tilefold.plan(logs, detector, library))


def inspect(file: AnyPath) -> Report:
    """What a log, a map, a model or a store is and holds, what is damaged, and what mends it."""
    return _report(_tilefold.inspect(file))


def detect(
    input: AnyPath,
    card: AnyPath,
    *,
    onnxruntime: AnyPath | None = None,
    cuda: int | None = None,
    overlay: AnyPath | None = None,
    annotations: AnyPath | None = None,
    threads: int = 0,
) -> Report:
    """Perception alone: what is seen in a picture, in a folder of them, or in the pictures of a log.

    Args:
        input: A JPEG or PNG file, a folder of them, or an MCAP file.
        card: Card of the network.
        onnxruntime: The library of ONNX Runtime; without it that of the package `onnxruntime`.
        cuda: Number of the graphics card that the network runs on; without it the processor.
        overlay: A folder for the pictures with what was seen drawn into them.
        annotations: An MCAP file for the pictures with what was seen as annotations.
        threads: How many threads work; 0 is one a core.
    """
    library = onnxruntime or find_onnxruntime()
    return _report(
        _tilefold.detect(input, card, library, cuda, overlay, annotations, threads)
    )


def find_onnxruntime() -> Path | None:
    """The library of ONNX Runtime in the package `onnxruntime`, which is not imported for it."""
    found = importlib.util.find_spec("onnxruntime")
    if found is None or not found.submodule_search_locations:
        return None
    folder = Path(found.submodule_search_locations[0]) / "capi"
    names = ("libonnxruntime.so.*", "libonnxruntime.*.dylib", "onnxruntime.dll")
    return next((file for name in names for file in sorted(folder.glob(name))), None)


def nanoseconds(as_of: datetime.datetime | int | None) -> int | None:
    """An instant in nanoseconds since the Unix epoch; one without a time zone is in UTC."""
    if not isinstance(as_of, datetime.datetime):
        return as_of
    if as_of.tzinfo is None:
        as_of = as_of.replace(tzinfo=datetime.timezone.utc)
    since = as_of - datetime.datetime.fromtimestamp(0, tz=datetime.timezone.utc)
    return (since // datetime.timedelta(microseconds=1)) * 1000


def _report(text: str) -> Report:
    read: Report = json.loads(text)
    return read
