"""Stores, their versions, and the rows of their tables as Arrow."""

from __future__ import annotations

import datetime
import json
from collections.abc import Iterable
from dataclasses import dataclass
from os import PathLike
from typing import TYPE_CHECKING, Any

from tilefold import _tilefold

if TYPE_CHECKING:
    import geopandas
    import pandas
    import polars
    import pyarrow

TABLES = (
    "elements",
    "evidence",
    "sightings",
    "footprints",
    "chunks",
    "sensor_models",
    "changes",
    "layers",
)
"""The tables of a store. The reference describes their columns."""


def _codes() -> dict[str, dict[int, str]]:
    read: dict[str, dict[str, str]] = json.loads(_tilefold.codes())
    return {
        column: {int(code): name for code, name in names.items()}
        for column, names in read.items()
    }


CODES: dict[str, dict[int, str]] = _codes()
"""What the codes in columns mean: `CODES["verdict"][3] == "removed"`. Columns: `verdict`, `kind`,
`marking`, `color`, `sign`."""


@dataclass(frozen=True)
class VersionInfo:
    """Who committed a version, and when."""

    version: int
    """Number of the version."""
    timestamp: datetime.datetime
    """When it was committed (UTC)."""
    operation: str
    """What the job was: `init`, `run`, `retract`, ..."""
    parameters: dict[str, Any]
    """The job's parameters."""


@dataclass(frozen=True)
class Verification:
    """What the check of a version found."""

    ok: bool
    """Whether nothing is wrong."""
    digest: str | None
    """Digest of the layers; `None` where they are damaged."""
    findings: list[str]
    """What is wrong, a sentence each."""


class Rows:
    """Rows of a table, on their way out; a file at a time, checked against its hash.

    Anything that speaks the Arrow PyCapsule interface takes them directly: `pyarrow.table(rows)`,
    `polars.DataFrame(rows)`, `duckdb.from_arrow(rows)`. They can be read more than once.
    """

    def __init__(
        self, snapshot: _tilefold.Snapshot, table: str, tiles: list[int] | None
    ) -> None:
        self._snapshot = snapshot
        self._table = table
        self._tiles = tiles

    def __arrow_c_stream__(self, requested_schema: object = None) -> object:
        rows = self._snapshot.rows(self._table, self._tiles)
        return rows.__arrow_c_stream__(requested_schema)

    def to_pyarrow(self) -> pyarrow.Table:
        """All of them as a `pyarrow.Table`."""
        import pyarrow

        return pyarrow.table(self)

    def to_pandas(self) -> pandas.DataFrame:
        """All of them as a `pandas.DataFrame`; geometries stay WKB."""
        return self.to_pyarrow().to_pandas()

    def to_polars(self) -> polars.DataFrame:
        """All of them as a `polars.DataFrame`; geometries stay WKB."""
        import polars

        return polars.DataFrame(self)

    def to_geopandas(self, geometry: str | None = None) -> geopandas.GeoDataFrame:
        """All of them as a `geopandas.GeoDataFrame` in degrees (OGC:CRS84).

        Args:
            geometry: The active geometry column. Without one, it is the table's first; of changes
                the new geometry and, where nothing is there any more, the old one, in a column
                `geometry`.

        Raises:
            TilefoldError: The table has no geometry.
        """
        import geopandas

        table = self.to_pyarrow()
        columns = [
            field.name
            for field in table.schema
            if b"ARROW:extension:name" in (field.metadata or {})
            or str(field.type).startswith("extension<geoarrow.wkb")
        ]
        if not columns:
            raise _tilefold.TilefoldError(
                f"the table {self._table} has no geometry; elements, sightings and changes have"
            )
        frame = table.to_pandas()
        for column in columns:
            frame[column] = geopandas.GeoSeries.from_wkb(frame[column], crs="OGC:CRS84")
        if geometry is None and self._table == "changes":
            geometry = "geometry"
            frame[geometry] = frame["geometry_new"].fillna(frame["geometry_old"])
        return geopandas.GeoDataFrame(frame, geometry=geometry or columns[0], crs="OGC:CRS84")


class Snapshot:
    """One version of a store."""

    def __init__(self, snapshot: _tilefold.Snapshot) -> None:
        self._snapshot = snapshot

    @property
    def version(self) -> int:
        """Its number."""
        return self._snapshot.version()

    def table(self, name: str, tiles: Iterable[int] | None = None) -> Rows:
        """Rows of the table `name` (one of `TABLES`).

        Args:
            name: The table.
            tiles: Only the rows of these tiles (packed tile ids, as in the column `tile`); other
                data files are not read.
        """
        if name not in TABLES:
            raise ValueError(f"there is no table {name!r}; there are {', '.join(TABLES)}")
        return Rows(self._snapshot, name, None if tiles is None else list(tiles))

    def changes(self, tiles: Iterable[int] | None = None) -> Rows:
        """The verdicts: one or more rows an element, and one for each addition."""
        return self.table("changes", tiles)

    def elements(self, tiles: Iterable[int] | None = None) -> Rows:
        """The base map."""
        return self.table("elements", tiles)

    def evidence(self, tiles: Iterable[int] | None = None) -> Rows:
        """The ledger: what each pass testified of each section of each element."""
        return self.table("evidence", tiles)

    def sightings(self, tiles: Iterable[int] | None = None) -> Rows:
        """What was seen that is not in the map."""
        return self.table("sightings", tiles)

    def layers(self, tiles: Iterable[int] | None = None) -> Rows:
        """The headers of the tiles' change layers."""
        return self.table("layers", tiles)

    def digest(self, table: str = "layers") -> str:
        """Digest of a table's rows, the same wherever and however they were made.

        That of `layers` is what `tilefold verify` prints. All of the table's files are read and
        checked on the way.
        """
        return self._snapshot.digest(table)

    def verify(self) -> Verification:
        """Reads the version as a whole and says whether it is what it was when it was written."""
        return Verification(*self._snapshot.verify())

    def __repr__(self) -> str:
        return f"<tilefold.Snapshot {self.version}>"


class Store:
    """A store that is open. Opening reads a few small files."""

    def __init__(self, location: str | PathLike[str]) -> None:
        self._store = _tilefold.Store(location)

    @property
    def location(self) -> str:
        """Where it is."""
        return self._store.location()

    @property
    def tile_level(self) -> int:
        """Level of the tiles that rows lie in."""
        return self._store.tile_level()

    def versions(self) -> list[VersionInfo]:
        """All versions, oldest first."""
        return [
            VersionInfo(
                version=one["version"],
                timestamp=datetime.datetime.fromtimestamp(
                    one["timestamp_ms"] / 1000, tz=datetime.timezone.utc
                ),
                operation=one["operation"],
                parameters=one["parameters"],
            )
            for one in json.loads(self._store.versions())
        ]

    def snapshot(
        self, version: int | None = None, *, as_of: datetime.datetime | None = None
    ) -> Snapshot:
        """A version by its number, or the one that was the latest at an instant, or the latest.

        Args:
            version: Its number.
            as_of: An instant; one without a time zone is taken as UTC.
        """
        if as_of is None:
            return Snapshot(self._store.snapshot(version))
        if version is not None:
            raise ValueError("give a version or an instant, not both")
        if as_of.tzinfo is None:
            as_of = as_of.replace(tzinfo=datetime.timezone.utc)
        return Snapshot(self._store.snapshot_as_of(int(as_of.timestamp() * 1000)))

    def __repr__(self) -> str:
        return f"<tilefold.Store {self.location}>"


def open(location: str | PathLike[str]) -> Store:
    """Opens the store in a folder or at a URL (`s3://bucket/store`).

    Raises:
        TilefoldError: There is none, or it is damaged.
    """
    return Store(location)
