"""The job on a Spark cluster, through mapInArrow: `python -m tilefold.spark run STORE LOG...`.

Map tasks are partitions of a frame that is kept (in memory and on disk); Spark's shuffle brings the
parts of a group of tiles together, and a second mapInArrow reduces them. Spark repeats what dies; the
guard of `tilefold.cluster` counts what comes of it.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Iterable, Iterator, Sequence
from os import PathLike
from typing import TYPE_CHECKING, Any

from pyspark import StorageLevel
from pyspark.sql import DataFrame, SparkSession
from pyspark.sql import functions as sql

from tilefold._tilefold import TilefoldError
from tilefold.cluster import (
    Manifest,
    Options,
    Order,
    Part,
    Progress,
    Reduced,
    Runner,
    command,
    run_on,
    worker,
)
from tilefold.jobs import AnyPath, Report

if TYPE_CHECKING:
    import pyarrow

TASKS_PER_CORE = 8
"""Map tasks for each core: many enough that none idles for long at the end."""

COLUMNS = "task int, group int, words string, chunks binary, a binary, b binary, c binary"
"""What travels: a manifest (group -1), a part of a group, or what is asked of a group (task -1)."""
TO_DRIVER, ASKED = -1, -1


def row(task: int, group: int, words: str, chunks: bytes, bytes: Part) -> pyarrow.RecordBatch:
    """One row of `COLUMNS`."""
    import pyarrow

    types = [pyarrow.int32()] * 2 + [pyarrow.string()] + [pyarrow.binary()] * 4
    names = [column.split()[0] for column in COLUMNS.split(", ")]
    values = (task, group, words, chunks, *bytes)
    arrays = [pyarrow.array([value], type) for value, type in zip(values, types, strict=True)]
    return pyarrow.RecordBatch.from_arrays(arrays, names)


def map_rows(
    order: Order, tasks: Sequence[str], batches: Iterable[pyarrow.RecordBatch]
) -> Iterator[pyarrow.RecordBatch]:
    """Maps the tasks whose places in `tasks` come, to a manifest and parts each."""
    for batch in batches:
        for place in batch.column("id").to_pylist():
            number = json.loads(tasks[place])["number"]
            (words, chunks), parts = worker(order).map(tasks[place])
            yield row(number, TO_DRIVER, words, chunks, (b"", b"", b""))
            for group, part in enumerate(parts):
                yield row(number, group, "", b"", part)


def reduce_rows(
    order: Order, batches: Iterable[pyarrow.RecordBatch]
) -> Iterator[pyarrow.RecordBatch]:
    """Reduces the groups that come, each from all of its parts."""
    asked: dict[int, str] = {}
    parts: dict[int, list[tuple[int, Part]]] = {}
    for batch in batches:
        for one in batch.to_pylist():
            if one["task"] == ASKED:
                asked[one["group"]] = one["words"]
            else:
                part = (one["task"], (one["a"], one["b"], one["c"]))
                parts.setdefault(one["group"], []).append(part)
    for group, reduction in sorted(asked.items()):
        wanted = set(json.loads(reduction)["tasks"])
        own = sorted(part for part in parts.get(group, []) if part[0] in wanted)
        words, made = worker(order).reduce(reduction, own)
        yield row(ASKED, group, words, b"", made)


class OnSpark(Runner):
    """Carries tasks to the executors of a Spark session."""

    def __init__(self, spark: SparkSession) -> None:
        self._spark = spark
        self._made: DataFrame | None = None

    def map(self, order: Order, tasks: Sequence[str], groups: int) -> Iterable[Manifest]:
        if not tasks:
            return
        words = list(tasks)

        def mapped(batches: Iterable[pyarrow.RecordBatch]) -> Iterator[pyarrow.RecordBatch]:
            return map_rows(order, words, batches)

        places = self._spark.range(0, len(words), 1, len(words))
        made = places.mapInArrow(mapped, COLUMNS).persist(StorageLevel.MEMORY_AND_DISK)
        self._made = made
        manifests = made.filter(sql.col("group") == TO_DRIVER).select("words", "chunks")
        for one in _collected(manifests):
            yield one["words"], bytes(one["chunks"])

    def reduce(self, order: Order, reductions: Sequence[str]) -> Iterable[Reduced]:
        if not reductions:
            return

        def reduced(batches: Iterable[pyarrow.RecordBatch]) -> Iterator[pyarrow.RecordBatch]:
            return reduce_rows(order, batches)

        asks = [
            (ASKED, json.loads(words)["group"], words, None, None, None, None)
            for words in reductions
        ]
        all = self._spark.createDataFrame(asks, COLUMNS)
        if self._made is not None:
            all = all.union(self._made.filter(sql.col("group") != TO_DRIVER))
        together = all.repartition(len(asks), "group")
        for one in _collected(together.mapInArrow(reduced, COLUMNS)):
            yield one["words"], (bytes(one["a"]), bytes(one["b"]), bytes(one["c"]))

    def forget(self) -> None:
        """Lets go of the parts."""
        if self._made is not None:
            self._made.unpersist()


def _collected(frame: DataFrame) -> list[Any]:
    try:
        return frame.collect()
    except Exception as error:
        # Spark wraps what a task says into pages of its own; the sentence is in one of their lines.
        lines = str(error).splitlines()
        ours = [line for line in lines if "TilefoldError: " in line or "ConflictError: " in line]
        said = ours[-1].split("Error: ", 1)[1] if ours else lines[0] if lines else repr(error)
        raise TilefoldError(said) from error


def run(
    store: str | PathLike[str],
    logs: Sequence[AnyPath],
    *,
    options: Options | None = None,
    address: str | None = None,
    progress: Progress | None = None,
    spark: SparkSession | None = None,
) -> Report:
    """Maps what is new in the logs, folds what it touches, commits a version; on a Spark cluster.

    Args:
        store: Folder or URL that every executor knows the store by.
        logs: MCAP files, or folders of them, that every executor sees under the same names.
        options: How the run is made.
        address: Spark's master (`spark://host:7077`, `local[4]`), where no session is given.
        progress: Hears of tasks that are done; Spark tells of a stage's when all of them are.
        spark: The session; without one, one is made.

    Returns:
        The report of `tilefold.run`.
    """
    session = spark or _session(address)
    cores = session.sparkContext.defaultParallelism
    runner = OnSpark(session)
    try:
        return run_on(
            runner,
            store,
            logs,
            options or Options(),
            tasks=TASKS_PER_CORE * cores,
            groups=cores,
            progress=progress,
        )
    finally:
        runner.forget()


def _session(master: str | None) -> SparkSession:
    # The executors of a master on this machine run what we run.
    os.environ.setdefault("PYSPARK_PYTHON", sys.executable)
    builder = SparkSession.builder.appName("tilefold")
    return (builder.master(master) if master else builder).getOrCreate()


def main(argv: Sequence[str] | None = None) -> int:
    """The command line."""
    return command("python -m tilefold.spark", "Spark's master", run, argv)


if __name__ == "__main__":
    # By its importable name, so that executors find the tasks there.
    from tilefold.spark import main as named

    sys.exit(named())
