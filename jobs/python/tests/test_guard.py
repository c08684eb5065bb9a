"""The split without a cluster: equal bytes, and a guard that really refuses."""

import functools
import json
import shutil
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

import pytest

import tilefold
from conftest import City, digests, files
from tilefold import cluster
from tilefold.cluster import Manifest, Options, Order, Part, Reduced, Runner

Spoil = Callable[[list], list]


@functools.cache
def mapped(order: Order, task: str) -> tuple[Manifest, list[Part]]:
    """What a task makes, once for all tests that ask the same of the same store."""
    return cluster.worker(order).map(task)


class Here(Runner):
    """Runs tasks in this process, last ones first; and spoils what comes of them where asked."""

    def __init__(self, **spoil: Spoil) -> None:
        self._spoil = spoil
        self._parts: dict[int, list[Part]] = {}
        self.reductions: list[int] = []

    def spoilt(self, what: str, all: list) -> list:
        return self._spoil.get(what, list)(all)

    def map(self, order: Order, tasks: Sequence[str], groups: int) -> Iterable[Manifest]:
        manifests = []
        for task in reversed(self.spoilt("tasks", list(tasks))):
            manifest, parts = mapped(order, task)
            self._parts[json.loads(task)["number"]] = parts
            manifests.append(manifest)
        return self.spoilt("manifests", manifests)

    def reduce(self, order: Order, reductions: Sequence[str]) -> Iterable[Reduced]:
        self.reductions.append(len(reductions))
        made = []
        for reduction in reductions:
            asked = json.loads(reduction)
            parts = [(task, self._parts[task][asked["group"]]) for task in asked["tasks"]]
            made.append(cluster.worker(order).reduce(reduction, self.spoilt("parts", parts)))
        return self.spoilt("reduced", made)


def run(runner: Runner, city: City, store: Path, **how: int) -> dict:
    split = {"tasks": 12, "groups": 8} | how
    return cluster.run_on(runner, store, [city.logs], Options(), **split)


@pytest.mark.parametrize(("tasks", "groups"), [(1, 1), (7, 3), (1000, 16)])
def test_bytes_are_equal_however_a_job_is_cut(
    city: City, local: Path, tmp_path: Path, tasks: int, groups: int
) -> None:
    store = city.store(tmp_path / "store")
    runner = Here()
    report = run(runner, city, store, tasks=tasks, groups=groups)
    assert digests(store) == digests(local)
    assert files(store) == files(local)
    assert report["set_aside"] == []
    if groups == 16:
        assert runner.reductions[0] > 1, "the city lies over several groups of tiles"


def test_the_report_is_that_of_a_local_run(city: City, tmp_path: Path) -> None:
    stores = [city.store(tmp_path / name) for name in ("there", "here")]
    reports = [run(Here(), city, stores[0]), tilefold.run(stores[1], [city.logs])]
    for report in reports:
        report.pop("wall_s")
        for stage in report["stages"]:
            for timed in ("busy_s", "items_per_busy_s", "mb_per_busy_s"):
                stage.pop(timed)
    by_stage = [{stage["stage"]: stage for stage in report.pop("stages")} for report in reports]
    assert reports[0] == reports[1]
    for stage in ("index", "read", "map", "exchange"):
        assert by_stage[0][stage] == by_stage[1][stage], stage


def test_logs_in_two_jobs_come_to_the_same(city: City, local: Path, tmp_path: Path) -> None:
    store = city.store(tmp_path / "store")
    logs = sorted(city.logs.glob("*.mcap"))
    for some in (logs[: len(logs) // 2], logs):
        cluster.run_on(Here(), store, some, Options(), tasks=5, groups=4)
    assert digests(store) == digests(local)


def test_another_model_folds_everything_anew(city: City, tmp_path: Path) -> None:
    stores = [city.store(tmp_path / name) for name in ("there", "here")]
    for model in ("calibrated", "paper"):
        cluster.run_on(Here(), stores[0], [city.logs], Options(model=model), tasks=5, groups=4)
        tilefold.run(stores[1], [city.logs], model=model)
    assert digests(stores[0]) == digests(stores[1])


def test_set_aside_counts_are_those_of_a_local_run(city: City, tmp_path: Path) -> None:
    folder = tmp_path / "logs"
    folder.mkdir()
    logs = sorted(city.logs.glob("*.mcap"))
    for log in logs[:3]:
        (folder / log.name).write_bytes(log.read_bytes())
    cut = folder / logs[0].name
    cut.write_bytes(cut.read_bytes()[: cut.stat().st_size // 2])
    (folder / "none.mcap").write_bytes(b"no log at all")
    stores = [city.store(tmp_path / name) for name in ("there", "here")]
    heard = []
    there = cluster.run_on(
        Here(), stores[0], [folder], Options(), tasks=9, groups=3,
        progress=lambda stage, done, total, set_aside: heard.append((stage, done, total)),
    )
    here = tilefold.run(stores[1], [folder])
    assert there["set_aside"] == here["set_aside"]
    assert len(there["set_aside"]) >= 2
    assert digests(stores[0]) == digests(stores[1])
    assert heard[0] == ("map", 0, heard[0][2])
    assert heard[-1] == ("commit", 1, 1)


SPOILT = {
    "a lost task": ("tasks", lambda all: all[1:], "did not come back"),
    "a doubled task": ("tasks", lambda all: all + all[-1:], "came back twice|mapped twice"),
    "a lost manifest": ("manifests", lambda all: all[:-1], "did not come back"),
    "a doubled manifest": ("manifests", lambda all: all + all[:1], "came back twice|mapped twice"),
    "a lost part": ("parts", lambda all: all[1:], "nothing came"),
    "a doubled part": ("parts", lambda all: all + all[:1], "came twice"),
    "a part of another group": (
        "parts",
        lambda all: [(all[0][0], all[1][1]), *all[1:]],
        "rows for group",
    ),
    "an empty part": ("parts", lambda all: [(all[0][0], EMPTY), *all[1:]], "rows for group|cannot"),
    "a lost group": ("reduced", lambda all: all[1:], "did not come back"),
    "a doubled group": ("reduced", lambda all: all + all[:1], "came back twice"),
}
EMPTY = (b"", b"", b"")


@pytest.mark.parametrize("fault", SPOILT)
def test_whatever_is_lost_or_doubled_fails_the_job(city: City, tmp_path: Path, fault: str) -> None:
    where, spoil, said = SPOILT[fault]
    # In one place, one after the other: what was mapped for one fault serves the next.
    store = tmp_path.parent / "spoilt"
    shutil.rmtree(store, ignore_errors=True)
    city.store(store)
    before = digests(store)
    with pytest.raises(tilefold.TilefoldError, match=said):
        run(Here(**{where: spoil}), city, store)
    assert tilefold.open(store).snapshot().version == 1
    assert digests(store) == before
    # What the failed job left behind is in nobody's way.
    run(Here(), city, store)
    assert tilefold.open(store).snapshot().verify().ok


def test_a_log_that_differs_between_machines_is_refused(city: City, tmp_path: Path) -> None:
    folder = tmp_path / "logs"
    folder.mkdir()
    for log in sorted(city.logs.glob("*.mcap"))[:2]:
        (folder / log.name).write_bytes(log.read_bytes())

    def without_last_log(tasks: list) -> list:
        sorted(folder.glob("*.mcap"))[-1].unlink()
        return tasks

    store = city.store(tmp_path / "store")
    with pytest.raises(tilefold.TilefoldError, match="every machine must see the same logs"):
        cluster.run_on(
            Here(tasks=without_last_log), store, [folder], Options(), tasks=4, groups=2
        )


def test_another_writer_meanwhile_is_folded_upon(city: City, local: Path, tmp_path: Path) -> None:
    store = city.store(tmp_path / "store")
    logs = sorted(city.logs.glob("*.mcap"))

    def write_meanwhile(reduced: list) -> list:
        if tilefold.open(store).snapshot().version == 1:
            tilefold.run(store, logs[:4])
        return reduced

    runner = Here(reduced=write_meanwhile)
    report = run(runner, city, store)
    assert report["version"] == 3
    assert len(runner.reductions) == 2, "the first try met the other writer"
    assert digests(store) == digests(local)


def test_another_wheel_is_refused(city: City, tmp_path: Path) -> None:
    store = city.store(tmp_path / "store")
    driver = tilefold._tilefold.Driver(
        store, [city.logs], "calibrated", True, None, None, None, 4, 2
    )
    with pytest.raises(tilefold.TilefoldError, match="install the same wheel"):
        cluster.worker(Order(driver.job(), cluster.Eyes(), "0.0.0"))
