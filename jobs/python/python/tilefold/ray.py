"""The job on a Ray cluster: `python -m tilefold.ray run STORE LOG... --address A`.

Map and reduce tasks are Ray tasks; parts lie in Ray's object store, where a reduce task fetches those
of its group alone. Ray repeats tasks whose worker or node died, and remakes parts that died with them;
the guard of `tilefold.cluster` counts what comes of it.
"""

from __future__ import annotations

import json
import logging
import sys
from collections.abc import Callable, Iterable, Sequence
from os import PathLike
from typing import Any

import ray
from ray.exceptions import RayError, RayTaskError

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

RETRIES = 16
"""How often Ray repeats a task whose worker or node died, and remakes a part that died with it."""
TASKS_PER_CORE = 8
"""Map tasks for each core: many enough that none idles for long at the end."""


def map_task(order: Order, task: str) -> tuple[Any, ...]:
    """Maps the units of a task: its manifest, then a part for each group."""
    manifest, parts = worker(order).map(task)
    return (manifest, *parts)


def reduce_task(order: Order, reduction: str, *parts: Part) -> Reduced:
    """Reduces a group of tiles from the parts of the reduction's tasks, in their order."""
    tasks = json.loads(reduction)["tasks"]
    return worker(order).reduce(reduction, list(zip(tasks, parts, strict=True)))


class OnRay(Runner):
    """Carries tasks to the nodes of the cluster that this process is connected to."""

    def __init__(
        self,
        map_task: Callable[..., tuple[Any, ...]] = map_task,
        reduce_task: Callable[..., Reduced] = reduce_task,
    ) -> None:
        self._map_task = map_task
        self._reduce_task = reduce_task
        self._parts: dict[int, list[ray.ObjectRef[Part]]] = {}

    def map(self, order: Order, tasks: Sequence[str], groups: int) -> Iterable[Manifest]:
        order_ref = ray.put(order)
        # One object a group: a reduce task fetches its own and no other.
        objects = 1 + groups
        remote = ray.remote(num_cpus=1, max_retries=RETRIES, num_returns=objects)(self._map_task)
        pending = []
        for task in sorted(tasks, key=_units, reverse=True):
            manifest, *parts = remote.remote(order_ref, task)
            self._parts[json.loads(task)["number"]] = parts
            pending.append(manifest)
        yield from _as_they_come(pending)

    def reduce(self, order: Order, reductions: Sequence[str]) -> Iterable[Reduced]:
        order_ref = ray.put(order)
        remote = ray.remote(num_cpus=1, max_retries=RETRIES)(self._reduce_task)
        pending = []
        for reduction in reductions:
            asked = json.loads(reduction)
            parts = [self._parts[task][asked["group"]] for task in asked["tasks"]]
            pending.append(remote.remote(order_ref, reduction, *parts))
        yield from _as_they_come(pending)


def _units(task: str) -> int:
    return len(json.loads(task)["units"])


def _as_they_come(pending: list[Any]) -> Iterable[Any]:
    while pending:
        done, pending = ray.wait(pending, num_returns=1)
        try:
            yield from ray.get(done)
        except RayTaskError as error:
            raise error.cause if isinstance(error.cause, TilefoldError) else error
        except RayError as error:
            raise TilefoldError(
                f"Ray gave a task up: {error}; nothing was committed: mend the cluster and run the "
                "same command again"
            ) from error


def run(
    store: str | PathLike[str],
    logs: Sequence[AnyPath],
    *,
    options: Options | None = None,
    address: str | None = None,
    progress: Progress | None = None,
) -> Report:
    """Maps what is new in the logs, folds what it touches, commits a version; on a Ray cluster.

    Args:
        store: Folder or URL that every node knows the store by.
        logs: MCAP files, or folders of them, that every node sees under the same names.
        options: How the run is made.
        address: Address of the cluster (`ray://...`, `host:6379`, `auto`). Without one: the cluster
            that this process is connected to, or a new one on this machine.
        progress: Hears of tasks that are done.

    Returns:
        The report of `tilefold.run`.
    """
    if not ray.is_initialized():
        ray.init(address=address, log_to_driver=False, logging_level=logging.WARNING)
    resources: dict[str, float] = ray.cluster_resources()  # type: ignore[no-untyped-call]
    cores = int(resources.get("CPU", 1))
    return run_on(
        OnRay(),
        store,
        logs,
        options or Options(),
        tasks=TASKS_PER_CORE * cores,
        groups=cores,
        progress=progress,
    )


def main(argv: Sequence[str] | None = None) -> int:
    """The command line."""
    return command("python -m tilefold.ray", "address of the Ray cluster", run, argv)


if __name__ == "__main__":
    # By its importable name, so that workers find the tasks there.
    from tilefold.ray import main as named

    sys.exit(named())
