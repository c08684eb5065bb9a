"""Jobs on this machine."""

import importlib.util
import struct
import zlib
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
def test_detect_sees_the_line_in_a_picture(tmp_path: Path) -> None:
    # The network of the engine's own tests, which sees what is red.
    card = ROOT / "tests/data/red_mask/red_mask.toml"
    width_px, height_px, line_px = 160, 96, 80
    picture = tmp_path / "line.png"
    rows = [bytes(ink(x - line_px) for x in range(width_px) for ink in INKS)] * height_px
    picture.write_bytes(png(width_px, height_px, rows))
    detected = tilefold.detect(picture, card, overlay=tmp_path / "seen")
    assert [one["width_px"] for one in detected["pictures"]] == [width_px]
    lines = [one["points"] for one in detected["pictures"][0]["detections"]]
    assert len(lines) == 1
    assert all(abs(x - line_px) < 4 for x, _ in lines[0])
    assert len(list((tmp_path / "seen").iterdir())) == 1


INKS = (lambda aside: 255 if abs(aside) <= 3 else 40, lambda aside: 40, lambda aside: 40)
"""Red, green and blue of a red line on grey, by the distance from its middle."""


def png(width: int, height: int, rows: list[bytes]) -> bytes:
    """A PNG file of rows of RGB."""

    def chunk(kind: bytes, content: bytes) -> bytes:
        whole = kind + content
        return struct.pack(">I", len(content)) + whole + struct.pack(">I", zlib.crc32(whole))

    head = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    pixels = zlib.compress(b"".join(b"\0" + row for row in rows))
    return b"".join(
        [b"\x89PNG\r\n\x1a\n", chunk(b"IHDR", head), chunk(b"IDAT", pixels), chunk(b"IEND", b"")]
    )
