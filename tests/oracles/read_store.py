#!/usr/bin/env python3
"""Reads a store with programs that know nothing of Tilefold.

    python read_store.py STORE [EXPECTED.json]

Without EXPECTED: prints rows per table of every version, as Python's `deltalake` and DuckDB see
them. With it (a list of {version, tables: {name: {pin, rows, columns: {name: [sum, nulls]},
geometry}}}): compares counts, sums (of lengths for texts and bytes) and nulls, and exits with 1
where one differs. The versions of the tables are found as any reader would find them: in the
commitInfo of the store's version in `layers`.

Needs the PyPI packages deltalake, pyarrow and duckdb.
"""

import json
import math
import sys
from pathlib import Path
from urllib.parse import unquote

import duckdb
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq
from deltalake import DeltaTable


def commit_info(store: Path, version: int) -> dict:
    """What the commit of a store version says of itself."""
    log = store / "layers" / "_delta_log" / f"{version:020d}.json"
    actions = [json.loads(line) for line in log.read_text().splitlines()]
    info = next(action["commitInfo"] for action in actions if "commitInfo" in action)
    return json.loads(info["tilefold"]["job"])


def latest(store: Path) -> int:
    return DeltaTable(str(store / "layers")).version()


def by_deltalake(table: DeltaTable) -> tuple[int, dict]:
    rows = table.to_pyarrow_table()
    columns = {}
    for name, column in zip(rows.column_names, rows.columns):
        if pa.types.is_struct(column.type):
            # The box of a row, made from its geometry: `read_geometry.py` looks at it.
            continue
        if pa.types.is_integer(column.type):
            total = sum(value for value in column.to_pylist() if value is not None)
        elif pa.types.is_floating(column.type):
            total = math.fsum(value for value in column.to_pylist() if value is not None)
        elif pa.types.is_boolean(column.type):
            total = sum(1 for value in column.to_pylist() if value)
        else:
            total = pc.sum(pc.binary_length(column)).as_py() or 0
        columns[name] = (float(total), column.null_count)
    return rows.num_rows, columns


def data_files(table: DeltaTable) -> list[str]:
    return [unquote(uri) for uri in table.file_uris()]


def by_duckdb(table: DeltaTable) -> tuple[int, dict]:
    """DuckDB over the files that the table's log names at this version."""
    files = data_files(table)
    if not files:
        return 0, {}
    # The connection reads WKB as bytes; the GeoParquet metadata is looked at by `geometry`.
    database = duckdb.connect()
    database.execute("SET enable_geoparquet_conversion = false")
    source = database.read_parquet(files)
    columns = {}
    for name, kind in zip(source.columns, source.types):
        kind = str(kind)
        if kind.startswith("STRUCT"):
            continue
        if kind == "BLOB":
            value = f'octet_length("{name}")'
        elif kind == "VARCHAR":
            value = f'strlen("{name}")'
        elif kind == "BOOLEAN":
            value = f'CAST("{name}" AS INTEGER)'
        else:
            value = f'"{name}"'
        row = source.aggregate(f'coalesce(sum({value}), 0), count(*) - count("{name}")').fetchall()[0]
        columns[name] = (float(row[0]), row[1])
    return source.aggregate("count(*)").fetchall()[0][0], columns


def geometry(table: DeltaTable) -> list[str]:
    """The geometry columns that the GeoParquet metadata of the data files names."""
    for uri in data_files(table):
        metadata = pq.read_metadata(uri).metadata or {}
        geo = json.loads(metadata.get(b"geo", b"{}"))
        columns = sorted(geo.get("columns", {}))
        if geo and geo["primary_column"] not in columns:
            raise ValueError(f"{uri}: the primary column is none")
        return columns
    return []


def differences(seen: tuple[int, dict], expected: dict) -> list[str]:
    count, columns = seen
    found = []
    if count != expected["rows"]:
        found.append(f"{count} rows instead of {expected['rows']}")
    if count:
        for name, (total, nulls) in expected["columns"].items():
            have = columns.get(name)
            if have is None:
                found.append(f"{name} is missing")
            elif not math.isclose(have[0], total, rel_tol=1e-12, abs_tol=1e-9) or have[1] != nulls:
                found.append(f"{name}: {have} instead of {(total, nulls)}")
    return found


def main() -> int:
    store = Path(sys.argv[1])
    expected = {}
    if len(sys.argv) > 2:
        expected = {one["version"]: one["tables"] for one in json.loads(Path(sys.argv[2]).read_text())}
    wrong, compared = 0, 0
    for version in range(latest(store) + 1):
        job = commit_info(store, version)
        for name, pin in sorted(job["pins"].items()):
            table = DeltaTable(str(store / name), version=pin["version"])
            for reader, read in (("deltalake", by_deltalake), ("duckdb", by_duckdb)):
                seen = read(table)
                if version not in expected:
                    print(f"version {version} {name} at {pin['version']}: {seen[0]} rows by {reader}")
                    continue
                compared += 1 + len(seen[1])
                for difference in differences(seen, expected[version][name]):
                    wrong += 1
                    print(f"version {version} {name} by {reader}: {difference}")
            if version in expected and data_files(table):
                want, have = sorted(expected[version][name]["geometry"]), geometry(table)
                if want != have:
                    wrong += 1
                    print(f"version {version} {name}: geometry {have} instead of {want}")
    if expected:
        print(f"{compared} figures compared, {wrong} differ")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
