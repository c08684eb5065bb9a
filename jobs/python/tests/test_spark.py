"""The job on a Spark cluster of two executors of their own (`local-cluster[2,1,1024]`)."""

import os
import shutil
import signal
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

import tilefold
from conftest import City, digests, files

if shutil.which("java") is None and "JAVA_HOME" not in os.environ:
    pytest.skip("no Java here (Debian: openjdk-17-jre-headless)", allow_module_level=True)

from pyspark.sql import SparkSession

import tilefold.spark
from tilefold.cluster import Options


@pytest.fixture(scope="module")
def spark() -> Iterator[SparkSession]:
    os.environ["PYSPARK_PYTHON"] = sys.executable
    session = (
        SparkSession.builder.master("local-cluster[2,1,1024]")
        .appName("tilefold-tests")
        .config("spark.ui.enabled", "false")
        .config("spark.executorEnv.PYTHONPATH", os.environ.get("PYTHONPATH", ""))
        .getOrCreate()
    )
    session.sparkContext.setLogLevel("OFF")
    yield session
    session.stop()


def test_two_executors_make_the_bytes_of_one_process(
    spark: SparkSession, city: City, local: Path, tmp_path: Path
) -> None:
    store = city.store(tmp_path / "store")
    report = tilefold.spark.run(store, [city.logs], spark=spark, options=Options(groups=8))
    assert report["is_new_version"]
    assert digests(store) == digests(local)
    assert files(store) == files(local)


def test_an_executor_dies(
    spark: SparkSession, city: City, local: Path, tmp_path: Path
) -> None:
    store = city.store(tmp_path / "store")
    killed = []

    def kill_one(stage: str, done: int, total: int, set_aside: int) -> None:
        if stage == "reduce" and not killed:
            # An executor, with the parts that it keeps.
            pid = next(executors())
            os.kill(pid, signal.SIGKILL)
            killed.append(pid)

    tilefold.spark.run(
        store, [city.logs], spark=spark, options=Options(tasks=6, groups=4), progress=kill_one
    )
    assert killed
    assert digests(store) == digests(local)


def executors() -> Iterator[int]:
    """Executors' processes among our descendants."""
    parents = {}
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = stat.read_text().rpartition(")")[2].split()
            command = stat.with_name("cmdline").read_bytes()
        except OSError:
            continue
        parents[int(stat.parent.name)] = (int(fields[1]), command)
    for pid, (parent, command) in parents.items():
        while parent in parents and parent != os.getpid():
            parent = parents[parent][0]
        if parent == os.getpid() and b"CoarseGrainedExecutorBackend" in command:
            yield pid


def test_an_error_of_a_task_is_told_whole(
    spark: SparkSession, city: City, tmp_path: Path
) -> None:
    folder = tmp_path / "logs"
    folder.mkdir()
    log = next(city.logs.glob("*.mcap"))
    (folder / log.name).write_bytes(log.read_bytes())
    store = city.store(tmp_path / "store")

    def lose_the_log(stage: str, done: int, total: int, set_aside: int) -> None:
        (folder / log.name).unlink(missing_ok=True)

    with pytest.raises(tilefold.TilefoldError, match="every machine must see the same logs"):
        tilefold.spark.run(store, [folder], spark=spark, progress=lose_the_log)
    assert tilefold.open(store).snapshot().version == 1
