"""Sums of evidence by section of an element: Tilefold's dense index beside DuckDB and Polars, on the same Parquet.

    python fold.py FOLDER --fold path/to/examples/fold [--rows 10000000] [--rounds 5] [--json FIGURES.json]

Makes ledger rows as the store keeps them (by tile, element, section, vehicle; 128 Ki rows a group, zstd), and once more
shuffled within ten parts; then each program folds them with two threads, by turns, in one run. All sums are compared.
"""

import argparse
import json
import os
import subprocess
import time
from pathlib import Path

THREADS = 2
os.environ["POLARS_MAX_THREADS"] = str(THREADS)

import duckdb
import numpy as np
import polars as pl
import pyarrow as pa
import pyarrow.parquet as pq

ROW_GROUP = 128 * 1024
PASSES, SECTIONS, IN_TILE = 25, 3, 500
SUMS = ["exposed", "hit", "sum_v_q8", "residual_eta_q8", "residual_lambda_q8"]


def block(first_element, elements, lot):
    """Rows of some elements, in the store's order. Ids are 40 random bits, ascending in a tile."""
    tiles = -(-elements // IN_TILE)
    ids = np.sort(lot.integers(0, 2**40, (tiles, IN_TILE)), axis=1).reshape(-1)[:elements]
    # Ids of two blocks never meet: a block has its own remainder.
    ids = ids * 64 + (first_element // elements) % 64
    rows = elements * SECTIONS * PASSES
    hit = lot.integers(0, 11, rows).astype(np.int32)
    visibility = lot.integers(2 << 24, 10 << 24, rows)
    columns = {
        "tile": np.repeat(np.arange(tiles, dtype=np.int32), IN_TILE)[:elements].repeat(SECTIONS * PASSES)
        + np.int32(first_element // IN_TILE),
        "element": np.repeat(ids, SECTIONS * PASSES),
        "section": np.tile(np.repeat(np.arange(SECTIONS, dtype=np.int32), PASSES), elements),
        "vehicle": lot.integers(-(2**62), 2**62, PASSES).repeat(1)[np.tile(np.arange(PASSES), elements * SECTIONS)],
        "exposed": np.full(rows, 10, np.int32),
        "hit": hit,
        "sum_v_q8": visibility,
        "residual_eta_q8": (lot.normal(0, 0.1, rows) * hit * 25 * 2**24).astype(np.int64),
        "residual_lambda_q8": hit.astype(np.int64) * (25 << 24),
    }
    table = pa.table(columns)
    # No column of the ledger has nulls.
    return table.cast(pa.schema([field.with_nullable(False) for field in table.schema]))


def make(path, rows, shuffled):
    lot = np.random.default_rng(1)
    parts = 10 if rows <= 10_000_000 else 50
    elements = rows // (SECTIONS * PASSES * parts)
    writer = None
    for part in range(parts):
        table = block(part * elements, elements, lot)
        if shuffled:
            table = table.take(lot.permutation(len(table)))
        writer = writer or pq.ParquetWriter(path, table.schema, compression="zstd", compression_level=1)
        writer.write_table(table, row_group_size=ROW_GROUP)
    writer.close()
    return pq.ParquetFile(path).metadata.num_rows


def checksum(elements, columns):
    total = 0
    share = elements.astype(np.int64) % 1009
    for number, column in enumerate(columns):
        # In two halves: products of whole sums would not fit into 64 bits.
        high, low = np.divmod(column.astype(np.int64), 1 << 20)
        total += (number + 1) * ((int((high * share).sum()) << 20) + int((low * share).sum()))
    return str(total)


def clocks():
    return time.perf_counter(), time.process_time()


def since(begun):
    return tuple(now - then for now, then in zip(clocks(), begun))


def of_duckdb(path):
    connection = duckdb.connect(config={"threads": THREADS})
    connection.execute("SET preserve_insertion_order = false")
    sums = ", ".join(f"sum({name})::BIGINT AS {name}" for name in SUMS)
    begun = clocks()
    table = connection.sql(
        f"SELECT element, section, {sums} FROM read_parquet('{path}') GROUP BY element, section"
    ).to_arrow_table()
    taken = since(begun)
    return taken, len(table), checksum(table["element"].to_numpy(), [table[name].to_numpy() for name in SUMS])


def of_polars(engine):
    def fold(path):
        begun = clocks()
        table = (
            pl.scan_parquet(path)
            .group_by("element", "section")
            .agg([pl.col(name).cast(pl.Int64).sum() for name in SUMS])
            .collect(engine=engine)
        )
        taken = since(begun)
        return taken, len(table), checksum(table["element"].to_numpy(), [table[name].to_numpy() for name in SUMS])

    return fold


def of_tilefold(program):
    def fold(path):
        said = json.loads(subprocess.run([program, path, str(THREADS)], check=True, capture_output=True).stdout)
        fold.index_seconds = said["index_seconds"]
        taken = said["seconds"], said["processor_seconds"]
        return taken, said["groups"], said["checksum"]

    return fold


def main():
    asked = argparse.ArgumentParser()
    asked.add_argument("folder", type=Path)
    asked.add_argument("--fold", required=True)
    asked.add_argument("--rows", type=int, default=10_000_000)
    asked.add_argument("--shuffled", action="store_true")
    asked.add_argument("--rounds", type=int, default=5)
    asked.add_argument("--json", type=Path)
    asked = asked.parse_args()
    path = str(asked.folder / f"ledger-{asked.rows}{'-shuffled' if asked.shuffled else ''}.parquet")
    rows = make(path, asked.rows, asked.shuffled)
    programs = {
        "tilefold": of_tilefold(asked.fold),
        "duckdb": of_duckdb,
        "polars": of_polars("in-memory"),
        "polars, streaming": of_polars("streaming"),
    }
    seconds = {name: [] for name in programs}
    processor_seconds = {name: [] for name in programs}
    results, index_seconds, load = set(), [], []
    for _ in range(asked.rounds):
        load.append(os.getloadavg()[0])
        for name, fold in programs.items():
            (taken, processor), groups, total = fold(path)
            seconds[name].append(taken)
            processor_seconds[name].append(processor)
            results.add((groups, total))
            print(f"{name:18} {taken:7.2f} s  {processor:7.2f} s of processors  {rows / taken / 1e6:7.1f} M rows/s  {groups} groups", flush=True)
        index_seconds.append(programs["tilefold"].index_seconds)
    figures = {
        "rows": rows,
        "bytes": os.path.getsize(path),
        "shuffled": asked.shuffled,
        "threads": THREADS,
        "groups": sorted(groups for groups, _ in results),
        "same_sums": len(results) == 1,
        "seconds": seconds,
        "processor_seconds": processor_seconds,
        "tilefold_index_seconds": index_seconds,
        "load_before_round": load,
        "duckdb": duckdb.__version__,
        "polars": pl.__version__,
    }
    os.remove(path)
    print(json.dumps(figures))
    if asked.json:
        asked.json.write_text(json.dumps(figures, indent=1) + "\n")


main()
