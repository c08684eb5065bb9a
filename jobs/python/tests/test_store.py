"""Reading stores: the same rows through every door, and errors that say what mends them."""

import datetime
import subprocess
import json
from pathlib import Path

import duckdb
import geopandas
import polars
import pyarrow
import pytest
import shapely

import tilefold
from conftest import City, program


def test_versions_tell_who_and_when(local: Path) -> None:
    versions = tilefold.open(local).versions()
    assert [one.operation for one in versions] == ["create", "init", "run"]
    assert all(one.timestamp.tzinfo is datetime.timezone.utc for one in versions)


def test_every_table_has_the_rows_that_duckdb_finds_in_its_files(local: Path) -> None:
    snapshot = tilefold.open(local).snapshot()
    for name in tilefold.TABLES:
        rows = snapshot.table(name).to_pyarrow()
        assert isinstance(rows, pyarrow.Table)
        found = list((local / name).glob("*.parquet"))
        if name in {"evidence", "sightings", "footprints", "elements"}:
            # One version has written into these, so all files on disk are live.
            count = duckdb.sql(f"select count(*) from read_parquet({[str(f) for f in found]})")
            assert rows.num_rows == count.fetchall()[0][0] > 0, name


def test_polars_pandas_and_pyarrow_see_the_same(local: Path) -> None:
    changes = tilefold.open(local).snapshot().changes()
    in_arrow = changes.to_pyarrow()
    in_polars = polars.DataFrame(changes)
    in_pandas = changes.to_pandas()
    assert in_arrow.column("p_removed").to_pylist() == in_polars["p_removed"].to_list()
    assert in_arrow.column("p_removed").to_pylist() == in_pandas["p_removed"].tolist()


def test_geometries_are_where_the_tiles_are(local: Path) -> None:
    snapshot = tilefold.open(local).snapshot()
    elements = snapshot.elements().to_geopandas()
    assert isinstance(elements, geopandas.GeoDataFrame)
    assert elements.crs == "OGC:CRS84"
    bounds = elements.geometry.bounds
    assert (bounds.minx - elements.xmin).abs().max() < 1e-12
    changes = snapshot.changes().to_geopandas()
    assert changes.geometry.notna().all()
    removed = changes[changes.verdict.map(tilefold.CODES["verdict"]) == "removed"]
    assert len(removed) > 0
    assert removed.geometry_new.isna().all()
    assert (removed.geometry == removed.geometry_old).all()
    assert all(isinstance(one, shapely.Geometry) for one in removed.geometry)


def test_rows_can_be_read_twice_and_by_tile(local: Path) -> None:
    snapshot = tilefold.open(local).snapshot()
    evidence = snapshot.evidence()
    everything = evidence.to_pyarrow()
    assert everything == evidence.to_pyarrow()
    tile = everything.column("tile")[0].as_py()
    some = snapshot.evidence([tile]).to_pyarrow()
    assert set(some.column("tile").to_pylist()) == {tile}
    assert some.num_rows == everything.column("tile").to_pylist().count(tile)


def test_digest_and_verify_say_what_the_command_line_says(local: Path) -> None:
    said = subprocess.run(
        [program(), "verify", local, "--format", "json"], check=True, capture_output=True
    )
    verification = tilefold.open(local).snapshot().verify()
    assert verification.ok
    assert verification.findings == []
    assert json.loads(said.stdout)["digest"] == verification.digest
    assert tilefold.open(local).snapshot().digest() == verification.digest


def test_a_flipped_byte_is_found(city: City, tmp_path: Path) -> None:
    store = city.store(tmp_path / "store")
    file = next((store / "elements").glob("*.parquet"))
    content = bytearray(file.read_bytes())
    content[len(content) // 2] ^= 1
    file.write_bytes(content)
    snapshot = tilefold.open(store).snapshot()
    verification = snapshot.verify()
    assert not verification.ok
    assert file.name in verification.findings[0]
    with pytest.raises(Exception, match="is damaged"):
        snapshot.elements().to_pyarrow()


def test_old_versions_stay_readable(local: Path) -> None:
    store = tilefold.open(local)
    assert store.snapshot(1).evidence().to_pyarrow().num_rows == 0
    assert store.snapshot().evidence().to_pyarrow().num_rows > 0
    first = store.versions()[0].timestamp
    assert store.snapshot(as_of=first).version == 0
    assert store.snapshot(as_of=datetime.datetime(2100, 1, 1)).version == 2


def test_errors_say_what_where_why_and_what_mends(tmp_path: Path, local: Path) -> None:
    with pytest.raises(tilefold.TilefoldError, match="tilefold init"):
        tilefold.open(tmp_path / "nowhere")
    with pytest.raises(tilefold.TilefoldError, match="version 99"):
        tilefold.open(local).snapshot(99)
    with pytest.raises(ValueError, match="changes"):
        tilefold.open(local).snapshot().table("verdicts")
    with pytest.raises(tilefold.TilefoldError, match="no geometry"):
        tilefold.open(local).snapshot().layers().to_geopandas()
