"""The job on a Ray cluster of three nodes on this machine, while workers and nodes die and come.

Each fault is shown to have fired: the process was alive, is dead, and tasks ran again.
"""

import json
import logging
import os
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import ray
from ray.cluster_utils import Cluster

import tilefold
import tilefold.ray
from conftest import City, digests, files
from tilefold.cluster import Options, run_on
from tilefold.ray import OnRay

NODE = {"num_cpus": 1, "object_store_memory": 100 * 2**20}
SLOW_S = 0.4
TASKS, GROUPS = 12, 8


@pytest.fixture(scope="module")
def cluster() -> Iterator[Cluster]:
    cluster = Cluster(initialize_head=True, head_node_args=NODE)
    for _ in range(2):
        cluster.add_node(**NODE)
    ray.init(address=cluster.address, log_to_driver=False, logging_level=logging.ERROR)
    cluster.wait_for_nodes()
    yield cluster
    ray.shutdown()
    cluster.shutdown()


class Noted:
    """Tasks that take long enough to be killed, and note when they begin."""

    def __init__(self, folder: Path) -> None:
        self.notes = folder / "notes"
        self.notes.mkdir()
        notes, slow_s = str(self.notes), SLOW_S

        # Nested, so that they travel by value: no worker knows this file.
        def note(name: str) -> None:
            import os
            import time
            import uuid

            with open(f"{notes}/{uuid.uuid4()}", "w") as file:
                file.write(f"{name} {os.getpid()}")
            time.sleep(slow_s)

        def map_task(order: Any, task: str) -> Any:
            import json

            note(f"map-{json.loads(task)['number']}")
            return tilefold.ray.map_task(order, task)

        def reduce_task(order: Any, reduction: str, *parts: Any) -> Any:
            import json

            note(f"reduce-{json.loads(reduction)['group']}")
            return tilefold.ray.reduce_task(order, reduction, *parts)

        self.runner = OnRay(map_task, reduce_task)

    def begun(self) -> Counter[str]:
        """How often each task began."""
        texts = [file.read_text() for file in self.notes.iterdir()]
        return Counter(text.split()[0] for text in texts if text)

    def again(self, stage: str) -> int:
        """How many times a task of a stage began that had begun before."""
        return sum(n - 1 for name, n in self.begun().items() if name.startswith(stage))


class Fault:
    """Does something once, when a stage has come so far."""

    def __init__(self, stage: str, done: int, act: Any) -> None:
        self.stage, self.done, self.act = stage, done, act
        self.fired = False

    def __call__(self, stage: str, done: int, total: int, set_aside: int) -> None:
        if not self.fired and stage == self.stage and done >= self.done:
            assert done < total, "too late to be in the middle"
            self.act()
            self.fired = True


def job(city: City, store: Path, noted: Noted, fault: Fault | None = None) -> dict[str, Any]:
    split = {"tasks": TASKS, "groups": GROUPS}
    return run_on(noted.runner, store, [city.logs], Options(), **split, progress=fault)


def kill_worker(noted: Noted, stage: str) -> None:
    """SIGKILL to a process in the middle of a task."""
    until = time.monotonic() + 30
    while time.monotonic() < until:
        # The youngest note is of a task that has just begun.
        notes = sorted(noted.notes.iterdir(), key=lambda file: file.stat().st_mtime_ns)
        name, _, pid = notes[-1].read_text().partition(" ") if notes else ("", "", "")
        age_s = time.time() - notes[-1].stat().st_mtime if notes else SLOW_S
        if name.startswith(stage) and pid and age_s < SLOW_S / 2:
            os.kill(int(pid), signal.SIGKILL)
            return
        time.sleep(0.02)
    pytest.fail(f"no worker in the middle of a {stage} task was found")


def kill_node(cluster: Cluster) -> None:
    """SIGKILL to the processes of a node that is not the head: its workers and its objects die."""
    node = next(iter(cluster.worker_nodes))
    before = sum(one["Alive"] for one in ray.nodes())
    for processes in node.all_processes.values():
        for one in processes:
            os.kill(one.process.pid, signal.SIGKILL)
    cluster.remove_node(node, allow_graceful=False)
    until = time.monotonic() + 60
    while sum(one["Alive"] for one in ray.nodes()) >= before:
        assert time.monotonic() < until, "the cluster never noticed that a node died"
        time.sleep(0.1)


def test_three_nodes_make_the_bytes_of_one(
    cluster: Cluster, city: City, local: Path, tmp_path: Path
) -> None:
    assert sum(node["Alive"] for node in ray.nodes()) == 3
    store = city.store(tmp_path / "store")
    report = tilefold.ray.run(store, [city.logs])
    assert report["is_new_version"]
    assert digests(store) == digests(local)
    assert files(store) == files(local)


@pytest.mark.parametrize("stage", ["map", "reduce"])
def test_a_worker_dies(
    cluster: Cluster, city: City, local: Path, tmp_path: Path, stage: str
) -> None:
    store = city.store(tmp_path / "store")
    noted = Noted(tmp_path)
    fault = Fault(stage, 1, lambda: kill_worker(noted, stage))
    job(city, store, noted, fault)
    assert fault.fired
    assert noted.again(stage) >= 1, "no task ran again: nothing was killed"
    assert digests(store) == digests(local)


@pytest.mark.parametrize("stage", ["map", "reduce"])
def test_a_node_dies_and_another_comes(
    cluster: Cluster, city: City, local: Path, tmp_path: Path, stage: str
) -> None:
    store = city.store(tmp_path / "store")
    noted = Noted(tmp_path)

    def one_goes_one_comes() -> None:
        kill_node(cluster)
        cluster.add_node(**NODE)

    fault = Fault(stage, 1, one_goes_one_comes)
    job(city, store, noted, fault)
    assert fault.fired
    # That the node died is seen by the cluster (`kill_node`); a task that it had not begun to note,
    # or parts that nobody needed any more, leave no other trace.
    assert digests(store) == digests(local)
    cluster.wait_for_nodes()
    assert sum(node["Alive"] for node in ray.nodes()) == 3


def test_a_node_comes_in_the_middle_and_works(
    cluster: Cluster, city: City, local: Path, tmp_path: Path
) -> None:
    store = city.store(tmp_path / "store")
    noted = Noted(tmp_path)
    added = []
    fault = Fault("map", 1, lambda: added.append(cluster.add_node(**NODE)))
    job(city, store, noted, fault)
    assert fault.fired
    assert digests(store) == digests(local)
    cluster.remove_node(added[0])


@pytest.mark.parametrize("stage", ["map", "reduce"])
def test_the_driver_dies_and_the_same_command_finishes(
    cluster: Cluster, city: City, local: Path, tmp_path: Path, stage: str
) -> None:
    store = city.store(tmp_path / "store")
    before = digests(store)
    command = [
        *(sys.executable, "-m", "tilefold.ray", "run", str(store), str(city.logs)),
        *("--address", cluster.address, "--progress", "json", "--format", "json"),
    ]
    driver = subprocess.Popen(
        command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
    )
    assert driver.stderr is not None
    for line in driver.stderr:
        if not line.startswith("{"):
            continue
        event = json.loads(line)
        if event["stage"] == stage and (stage == "reduce" or event["done"] >= 1):
            driver.send_signal(signal.SIGKILL)
            break
    driver.stderr.close()
    assert driver.wait() == -signal.SIGKILL, "it ended before it could be killed"
    assert digests(store) == before
    assert tilefold.open(store).snapshot().version == 1
    again = subprocess.run(command, capture_output=True, text=True, check=True)
    assert json.loads(again.stdout)["version"] == 2
    assert digests(store) == digests(local)


def test_an_error_of_a_task_is_told_whole(cluster: Cluster, city: City, tmp_path: Path) -> None:
    store = city.store(tmp_path / "store")
    noted = Noted(tmp_path)

    def fails(order: Any, reduction: str, *parts: Any) -> Any:
        return tilefold.ray.reduce_task(order, reduction, *parts[1:], parts[0])

    with pytest.raises(tilefold.TilefoldError, match="nothing was committed"):
        run_on(
            OnRay(tilefold.ray.map_task, fails), store, [city.logs], Options(), tasks=3, groups=2
        )
    assert noted.begun() == Counter()
    assert tilefold.open(store).snapshot().version == 1
