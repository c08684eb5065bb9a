"""Tilefold: finds where HD maps no longer match the road, from vehicle logs.

Open a store and read what changed:

    >>> import tilefold
    >>> store = tilefold.open("store")               # or "s3://bucket/store"
    >>> changes = store.snapshot().changes()         # an Arrow stream with a face
    >>> changes.to_geopandas()                       # or .to_pandas(), .to_polars(), .to_pyarrow()

Make one and bring logs in:

    >>> tilefold.init("store", ["map.osm"])
    >>> tilefold.run("store", ["logs/"])

On a cluster: `python -m tilefold.ray` and `python -m tilefold.spark`.

Whatever fails raises `TilefoldError`, whose text says what, where, why, and what mends it.
"""

from tilefold._tilefold import ConflictError, TilefoldError, __version__
from tilefold.jobs import detect, init, inspect, plan, run
from tilefold.store import (
    CODES,
    TABLES,
    Rows,
    Snapshot,
    Store,
    Verification,
    VersionInfo,
    open,
)

__all__ = [
    "CODES",
    "TABLES",
    "ConflictError",
    "Rows",
    "Snapshot",
    "Store",
    "TilefoldError",
    "Verification",
    "VersionInfo",
    "__version__",
    "detect",
    "init",
    "inspect",
    "open",
    "plan",
    "run",
]
