"""What any cluster does with a job: plan, map, guard, reduce, commit.

    driver    plans: which units of which vehicles, from which logs
    workers   map each task: one part a group of tiles, and a manifest of what was counted
    driver    counts: each task, chunk and row once
    workers   reduce each group: its ledgers into data files, its elements judged
    driver    counts again, judges what was added, commits once

A runner carries text and bytes between these; `tilefold.ray` and `tilefold.spark` are two. What they
call is compiled, and the same as in a run on one machine: so are the bytes in the store.
"""

from __future__ import annotations

import argparse
import datetime
import functools
import json
import sys
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from os import PathLike, fspath
from typing import Any, TypeVar

from tilefold import _tilefold
from tilefold._tilefold import ConflictError, TilefoldError
from tilefold.jobs import AnyPath, Report, find_onnxruntime, nanoseconds

Manifest = tuple[str, bytes]
"""What a map task says of its work: its text, and the rows of its chunks (Arrow IPC)."""
Part = tuple[bytes, bytes, bytes]
"""Rows of one map task in one group of tiles: evidence, sightings, footprints (Arrow IPC)."""
Reduced = tuple[str, Part]
"""What a reduce task made: its text; verdicts, sightings, footprints (Arrow IPC)."""
Progress = Callable[[str, int, int, int], None]
"""Hears of `(stage, done, total, set_aside)`: tasks done, and what was set aside so far."""

Made = TypeVar("Made", bound=tuple[str, Any])

EXIT_DONE, EXIT_FAILED, EXIT_USAGE, EXIT_SET_ASIDE = 0, 1, 2, 3


@dataclass(frozen=True)
class Eyes:
    """The network that looks at pictures; every machine needs it under the same path."""

    detector: str | None = None
    onnxruntime: str | None = None
    cuda: int | None = None


@dataclass(frozen=True)
class Order:
    """What every task is told: the job, the network, and the version of this package."""

    job: str
    eyes: Eyes
    version: str
    threads: int = 1


@dataclass(frozen=True)
class Options:
    """How a run is made; as in `tilefold.run`."""

    model: str = "calibrated"
    registration: bool = True
    as_of: datetime.datetime | int | None = None
    detector: AnyPath | None = None
    onnxruntime: AnyPath | None = None
    cuda: int | None = None
    tasks: int | None = None
    """About how many map tasks; without it, a few for each core."""
    groups: int | None = None
    """Into how many groups tiles are split; without it, one for each core."""

    def eyes(self) -> Eyes:
        """The network, with the library of ONNX Runtime."""
        if self.detector is None:
            return Eyes()
        library = self.onnxruntime or find_onnxruntime()
        return Eyes(fspath(self.detector), None if library is None else fspath(library), self.cuda)


class Runner(ABC):
    """Carries tasks to machines, and brings back what they made."""

    @abstractmethod
    def map(self, order: Order, tasks: Sequence[str], groups: int) -> Iterable[Manifest]:
        """Runs the map tasks, and keeps their parts. Yields manifests as they come."""

    @abstractmethod
    def reduce(self, order: Order, reductions: Sequence[str]) -> Iterable[Reduced]:
        """Runs the reduce tasks on the parts that were kept. Yields what they made as it comes."""


@functools.lru_cache(maxsize=1)
def worker(order: Order) -> _tilefold.Worker:
    """This process's side of a job, opened once for all of its tasks."""
    if order.version != _tilefold.__version__:
        raise TilefoldError(
            f"this machine has tilefold {_tilefold.__version__}, and the driver {order.version}; "
            "install the same wheel everywhere"
        )
    eyes = order.eyes
    return _tilefold.Worker(
        order.job, eyes.detector, eyes.onnxruntime, eyes.cuda, order.threads
    )


def run_on(
    runner: Runner,
    store: str | PathLike[str],
    logs: Sequence[AnyPath],
    options: Options,
    *,
    tasks: int,
    groups: int,
    progress: Progress | None = None,
) -> Report:
    """Runs a job through a runner; the report is that of a run on one machine.

    Raises:
        TilefoldError: What failed. Nothing was committed; the same job may be run again.
    """
    hear = progress or (lambda stage, done, total, set_aside: None)
    driver = _tilefold.Driver(
        store,
        list(logs),
        options.model,
        options.registration,
        nanoseconds(options.as_of),
        options.detector,
        options.eyes().onnxruntime,
        options.tasks or tasks,
        options.groups or groups,
    )
    order = Order(driver.job(), options.eyes(), _tilefold.__version__)
    counted = Counted(hear)
    words = driver.tasks()
    group_count = json.loads(order.job)["groups"]
    driver.mapped(counted.all("map", runner.map(order, words, group_count), len(words)))
    for attempt in range(1, driver.ATTEMPTS + 1):
        reductions = driver.reductions()
        made = runner.reduce(order, reductions)
        reduced = counted.all("reduce", made, len(reductions))
        hear("commit", 0, 1, counted.set_aside)
        try:
            report: Report = json.loads(driver.commit(reduced))
        except ConflictError:
            # What was mapped is folded onto the version that another writer made meanwhile.
            if attempt == driver.ATTEMPTS:
                raise
            driver.catch_up()
            continue
        hear("commit", 1, 1, counted.set_aside)
        return report
    raise AssertionError("a loop that returns or raises has ended")


class Counted:
    """Collects what tasks made, and tells of it."""

    def __init__(self, hear: Progress) -> None:
        self._hear = hear
        self.set_aside = 0

    def all(self, stage: str, made: Iterable[Made], total: int) -> list[Made]:
        """All of them, in the order in which they come."""
        collected: list[Made] = []
        self._hear(stage, 0, total, self.set_aside)
        for one in made:
            losses = json.loads(one[0]).get("set_aside", [])
            self.set_aside += sum(loss["count"] for loss in losses)
            collected.append(one)
            self._hear(stage, len(collected), total, self.set_aside)
        return collected


def arguments(program: str, address_help: str) -> argparse.ArgumentParser:
    """The command line that all runners have."""
    parser = argparse.ArgumentParser(prog=program, description="Tilefold's `run`, on a cluster.")
    commands = parser.add_subparsers(dest="command", required=True)
    run = commands.add_parser("run", help="maps new logs, folds what they touch, commits a version")
    run.add_argument("store", help="folder or URL that every machine knows the store by")
    run.add_argument("logs", nargs="+", help="MCAP files or folders that every machine sees")
    run.add_argument("--address", help=address_help)
    run.add_argument("--model", default="calibrated", choices=["calibrated", "paper"])
    run.add_argument("--registration", default="on", choices=["on", "off"])
    run.add_argument("--as-of", type=int, metavar="NS", help="only what was seen until then counts")
    run.add_argument("--detector", metavar="CARD", help="network that looks at pictures")
    run.add_argument("--onnxruntime", metavar="LIBRARY", help="the library of ONNX Runtime")
    run.add_argument("--cuda", type=int, metavar="NUMBER", help="graphics card of the network")
    run.add_argument("--tasks", type=int, help="about how many map tasks (a few for each core)")
    run.add_argument("--groups", type=int, help="groups of tiles to reduce (one for each core)")
    run.add_argument("--format", default="words", choices=["words", "json"])
    run.add_argument("--progress", default="auto", choices=["auto", "json", "off"])
    return parser


def command(
    program: str,
    address_help: str,
    run: Callable[..., Report],
    argv: Sequence[str] | None = None,
) -> int:
    """Runs a command line; gives the exit code of the process."""
    given = arguments(program, address_help).parse_args(argv)
    options = Options(
        model=given.model,
        registration=given.registration == "on",
        as_of=given.as_of,
        detector=given.detector,
        onnxruntime=given.onnxruntime,
        cuda=given.cuda,
        tasks=given.tasks,
        groups=given.groups,
    )
    try:
        report = run(
            given.store,
            given.logs,
            options=options,
            address=given.address,
            progress=listener(given.progress),
        )
    except TilefoldError as error:
        if given.format == "json":
            print(json.dumps({"error": str(error)}))
        print(f"error: {error}", file=sys.stderr)
        return EXIT_FAILED
    print(json.dumps(report, indent=2) if given.format == "json" else in_words(report))
    return tell_set_aside(report)


def in_words(report: Report) -> str:
    """The report in a few lines."""
    new = "committed" if report["is_new_version"] else "nothing new; still at"
    return (
        f"{new} version {report['version']}: {report['logs']} logs of {report['vehicles']} vehicles, "
        f"{report['chunks_mapped']} chunks mapped, {report['chunks_known']} known, "
        f"{report['tiles_reduced']} tiles reduced, in {report['wall_s']:.1f} s"
    )


def tell_set_aside(report: Report, listed: int = 20) -> int:
    """Lists on standard error what was set aside; gives the exit code."""
    losses = report["set_aside"]
    if losses:
        print(f"set aside: {sum(loss['count'] for loss in losses)} (the rest was used)", file=sys.stderr)
    for loss in losses[:listed]:
        line = f"  {loss['kind']} {loss['file']} ({loss['count']}): {loss['reason']}"
        print("".join(c if c.isprintable() else "\ufffd" for c in line), file=sys.stderr)
    if len(losses) > listed:
        print(f"  and {len(losses) - listed} more", file=sys.stderr)
    # Frames without a position are in every drive, and are no damage.
    damaged = any(loss["kind"] != "uncovered" for loss in losses)
    return EXIT_SET_ASIDE if damaged else EXIT_DONE


def listener(form: str) -> Progress | None:
    """Tells of progress on standard error, as the form and the terminal ask for."""
    if form == "off" or (form == "auto" and not sys.stderr.isatty()):
        return None
    began: dict[str, float] = {}

    def hear(stage: str, done: int, total: int, set_aside: int) -> None:
        now = time.monotonic()
        if form == "json":
            event = "begin" if done == 0 else "advance"
            line = {"event": event, "stage": stage, "unit": "tasks", "done": done}
            print(json.dumps(line | {"total": total, "set_aside": set_aside}), file=sys.stderr)
            return
        took = now - began.setdefault(stage, now)
        left = f", eta {took / done * (total - done):.0f} s" if done else ""
        losses = f", set aside {set_aside}" if set_aside else ""
        end = "\n" if done == total else ""
        print(f"\r{stage:>9} {done}/{total}{left}{losses}   ", end=end, file=sys.stderr, flush=True)

    return hear
