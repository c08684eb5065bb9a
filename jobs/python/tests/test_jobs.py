"""Jobs on this machine."""

import importlib.util
from pathlib import Path

import pytest

import tilefold
from conftest import City, digests

ROOT = Path(__file__).parents[3]


def test_the_same_run_again_changes_nothing(city: City, local: Path) -> None:
    before = digests(local)
    report = tilefold.run(local, [city.logs])
    assert not report["is_new_version"]
    assert report["chunks_known"] > 0
    assert digests(local) == before


def test_threads_do_not_matter(city: City, local: Path, tmp_path: Path) -> None:
    store = city.store(tmp_path / "store")
    tilefold.run(store, [city.logs], threads=1)
    assert digests(store) == digests(local)


def test_plan_reads_summaries(city: City) -> None:
    plan = tilefold.plan([city.logs])
    assert plan["vehicles"] == 10
    assert plan["logs"] == len(list(city.logs.glob("*.mcap")))


def test_inspect_says_what_a_log_is(city: City) -> None:
    log = next(iter(sorted(city.logs.glob("*.mcap"))))
    found = tilefold.inspect(log)
    assert found["kind"] == "log"
    assert found["set_aside"] == []
    assert any(topic["read_as"] == "gnss" for topic in found["topics"])


def test_what_cannot_be_read_is_set_aside_and_said(city: City, tmp_path: Path) -> None:
    store = city.store(tmp_path / "store")
    report = tilefold.run(store, [tmp_path / "lost.mcap"])
    assert [loss["kind"] for loss in report["set_aside"]] == ["file"]
    assert "lost.mcap" in report["set_aside"][0]["file"]


def test_an_unknown_model_is_refused(city: City, local: Path) -> None:
    with pytest.raises(tilefold.TilefoldError, match="paper and calibrated"):
        tilefold.run(local, [city.logs], model="guess")


@pytest.mark.skipif(importlib.util.find_spec("onnxruntime") is None, reason="no onnxruntime here")
def test_detect_sees_paint_in_a_picture(tmp_path: Path) -> None:
    cards = sorted((ROOT / "workers").rglob("*.toml"))
    card = next(one for one in cards if one.with_suffix(".onnx").is_file())
    picture = next(iter(sorted(ROOT.rglob("tests/**/*.jpg"))), None)
    if picture is None:
        pytest.skip("no picture in the checkout")
    detected = tilefold.detect(picture, card, overlay=tmp_path)
    assert len(detected["pictures"]) == 1
    assert detected["pictures"][0]["width_px"] > 0
