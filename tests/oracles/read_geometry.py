#!/usr/bin/env python3
"""Reads the geometry of a store with programs that know nothing of Tilefold.

    python read_geometry.py STORE EXPORT.geoparquet

Python's `deltalake`, DuckDB and GeoPandas open the latest version of every table with geometry:
they must find the same rows, the same CRS (OGC:CRS84) and the same bounds; the column `bbox` must be
that of the geometry, Delta Lake's statistics that of the column, and a query by box must find what
lies in it. `changes` is compared with EXPORT (`tilefold export STORE --all --format geoparquet`).
Exits with 1, and says where, if one differs.

Needs the PyPI packages deltalake, duckdb, duckdb-extension-spatial and geopandas.
"""

import sys
from pathlib import Path
from urllib.parse import unquote

import duckdb
import duckdb_extension_spatial
import geopandas
import numpy
import pyarrow as pa
import shapely
from deltalake import DeltaTable

CORNERS = ("xmin", "ymin", "xmax", "ymax")
NOTHING = float("nan")
# Geometry columns by table, the primary one first.
TABLES = {
    "elements": ["geometry"],
    "sightings": ["geometry"],
    "changes": ["geometry_new", "geometry_old"],
}


def boxes_of_geometry(rows, columns):
    """The box around all geometries of each row; NaN without one."""
    read = [shapely.from_wkb(rows[name].to_pylist()) for name in columns]
    each = numpy.stack([shapely.bounds(shapes) for shapes in read])
    low = numpy.fmin.reduce(each[:, :, :2])
    high = numpy.fmax.reduce(each[:, :, 2:])
    return numpy.hstack([low, high])


def boxes_of_column(column):
    values = [[NOTHING if box is None else box[name] for name in CORNERS] for box in column.to_pylist()]
    return numpy.array(values, dtype=float).reshape(-1, 4)


def whole(boxes):
    return numpy.concatenate([numpy.nanmin(boxes[:, :2], 0), numpy.nanmax(boxes[:, 2:], 0)])


def statistics(table, name, rows):
    """The least and the most of each corner, as the log of the table names them for its files."""
    actions = pa.table(table.get_add_actions(flatten=True)).to_pydict()
    assert sum(actions["num_records"]) == rows, f"{name}: rows by statistics"
    low = [min(actions[f"min.bbox.{corner}"]) for corner in CORNERS[:2]]
    high = [max(actions[f"max.bbox.{corner}"]) for corner in CORNERS[2:]]
    return numpy.array(low + high)


def by_duckdb(files, primary, west_half):
    database = duckdb.connect()
    extension = next(Path(duckdb_extension_spatial.__file__).parent.rglob("*.duckdb_extension"))
    database.execute(f"LOAD '{extension}'")
    source = database.read_parquet(files)
    shapes = database.sql(
        f"SELECT count(*), count({primary}), min(ST_XMin({primary})), min(ST_YMin({primary})),"
        f" max(ST_XMax({primary})), max(ST_YMax({primary})) FROM source"
    ).fetchone()
    west, south, east, north = west_half
    inside = database.sql(
        f"SELECT count(*) FROM source WHERE bbox.xmin <= {east} AND bbox.xmax >= {west}"
        f" AND bbox.ymin <= {north} AND bbox.ymax >= {south}"
    ).fetchone()[0]
    return shapes[0], shapes[1], numpy.array(shapes[2:]), inside


def look_at(store, name, columns):
    table = DeltaTable(str(store / name))
    files = [unquote(uri) for uri in table.file_uris()]
    assert files, f"{name}: it has no rows, so nothing is tested"
    rows = table.to_pyarrow_table()
    count, primary = rows.num_rows, columns[0]
    boxes, drawn = boxes_of_column(rows["bbox"]), boxes_of_geometry(rows, columns)
    assert numpy.array_equal(boxes, drawn, equal_nan=True), f"{name}: bbox is not that of the geometry"
    around = whole(boxes)
    assert numpy.array_equal(statistics(table, name, count), around), f"{name}: statistics"

    middle = (around[0] + around[2]) / 2
    west_half = (around[0], around[1], middle, around[3])
    wanted = int((boxes[:, 0] <= middle).sum())
    of_primary = boxes_of_geometry(rows, [primary])
    shapes = int((~numpy.isnan(of_primary[:, 0])).sum())
    seen, with_shape, bounds, inside = by_duckdb(files, primary, west_half)
    assert (seen, with_shape, inside) == (count, shapes, wanted), f"{name} by DuckDB: {seen} rows"
    assert not shapes or numpy.array_equal(bounds, whole(of_primary)), f"{name} by DuckDB: {bounds}"

    frames = [geopandas.read_parquet(file) for file in files]
    assert all(frame.crs == "OGC:CRS84" for frame in frames), f"{name} by GeoPandas: CRS"
    assert sum(map(len, frames)) == count, f"{name} by GeoPandas: rows"
    bounds = numpy.array([frame.total_bounds for frame in frames if frame.geometry.notna().any()])
    assert not shapes or numpy.array_equal(whole(bounds), whole(of_primary)), f"{name}: {bounds}"
    found = sum(len(geopandas.read_parquet(file, bbox=west_half)) for file in files)
    assert found == wanted, f"{name} by GeoPandas: {found} rows in a box instead of {wanted}"
    print(f"{name}: {count} rows, {shapes} with {primary}, {wanted} in the western half, by three readers")
    return count, around


def main():
    store = Path(sys.argv[1])
    seen = {name: look_at(store, name, columns) for name, columns in TABLES.items()}
    export = geopandas.read_parquet(sys.argv[2])
    count, around = seen["changes"]
    assert export.crs == "OGC:CRS84" and len(export) == count, f"changes: {len(export)} exported"
    bounds = export.total_bounds
    # An export draws a change where it is on the road, and a row's box is around both of its places.
    assert (bounds[:2] >= around[:2]).all() and (bounds[2:] <= around[2:]).all(), f"{bounds}, {around}"
    print(f"{count} changes, as exported")


if __name__ == "__main__":
    main()
