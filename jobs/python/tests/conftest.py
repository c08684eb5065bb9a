"""A small simulated city over the corner of four coarse tiles, and the store that a local run makes."""

import os
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

import pytest

import tilefold

# Tiles of level 15 share data files in squares of 16 by 16, each 180/2^11 degrees wide.
COARSE_DEG = 180 / 2**11


@dataclass(frozen=True)
class City:
    """Files of a simulated city."""

    map: Path
    logs: Path

    def store(self, folder: Path) -> Path:
        """A new store of the city's map."""
        tilefold.init(folder, [self.map])
        return folder


def program() -> str:
    found = os.environ.get("TILEFOLD_BIN") or shutil.which("tilefold")
    if not found:
        pytest.fail("no `tilefold` to simulate a city with: `cargo xtask cluster-test` builds one")
    return found


@pytest.fixture(scope="session")
def city(tmp_path_factory: pytest.TempPathFactory) -> City:
    out = tmp_path_factory.mktemp("city") / "city"
    corner = [str(steps * COARSE_DEG) for steps in (114, 569)]
    city = ["--at", *corner, "--km", "1.2", "--vehicles", "10", "--drives", "12"]
    city += ["--drive-km", "0.7", "--changes", "0.15"]
    simulate = [program(), "simulate", out, "--seed", "3", *city]
    subprocess.run(simulate, check=True, stdout=subprocess.DEVNULL)
    return City(map=out / "before.osm", logs=out / "logs")


@pytest.fixture(scope="session")
def local(city: City, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The store after a run on this machine."""
    store = city.store(tmp_path_factory.mktemp("local") / "store")
    tilefold.run(store, [city.logs])
    return store


def digests(store: Path | str) -> dict[str, str]:
    """The digest of every table of the latest version."""
    snapshot = tilefold.open(store).snapshot()
    return {table: snapshot.digest(table) for table in tilefold.TABLES}


def files(store: Path) -> set[str]:
    """Names of the data files in a store; they are named by the hash of their bytes."""
    return {str(file.relative_to(store)) for file in store.rglob("*.parquet")}
