#!/usr/bin/env python3
"""Reads exports with programs that know nothing of Tilefold.

    python read_exports.py FOLDER

FOLDER holds `changes.geojson`, `.geoparquet`, `.flatgeobuf`, `.pmtiles` and `.mcap` of one version
(`tilefold export STORE --all`). GeoPandas, GDAL (through pyogrio), DuckDB, the Python libraries of
PMTiles and vector tiles, and that of MCAP must find the features of the GeoJSON, in their place.
With `before.osm`, `change.osc` and `patched.osm` in the folder, libosmium applies the OsmChange to
the first and must get the last. Exits with 1, and says where, if one differs.

Needs the PyPI packages geopandas, pyogrio, duckdb, pmtiles, mapbox-vector-tile, mcap,
mcap-protobuf-support and osmium.
"""

import collections
import gzip
import json
import math
import sys
from pathlib import Path

import duckdb
import geopandas
import mapbox_vector_tile
import osmium
import pmtiles.reader
import pyogrio
import shapely
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory
from shapely.geometry import shape

# Nine decimals of a degree.
NEAR_DEG = 2e-9


def same_features(rows, truth, what):
    assert len(rows) == len(truth), f"{what}: {len(rows)} features instead of {len(truth)}"
    for row in rows:
        feature = truth[row.change]
        for name in ("change_type", "kind", "vehicles"):
            assert getattr(row, name) == feature["properties"][name], f"{what}: {row.change} {name}"
        apart = shape(feature["geometry"]).hausdorff_distance(row.geometry)
        assert apart < NEAR_DEG, f"{what}: {row.change} is {apart} degrees off"


def western_half(bounds):
    return bounds[0], bounds[1], (bounds[0] + bounds[2]) / 2, bounds[3]


def tables(folder, truth):
    parquet = folder / "changes.geoparquet"
    rows = geopandas.read_parquet(parquet)
    assert rows.crs == "OGC:CRS84" and rows.geometry.is_valid.all()
    same_features(list(rows.itertuples()), truth, "GeoParquet")
    half = western_half(rows.total_bounds)
    expected = len(rows.cx[half[0] : half[2], half[1] : half[3]])
    assert len(geopandas.read_parquet(parquet, bbox=half)) >= expected
    database = duckdb.connect()
    database.execute("SET enable_geoparquet_conversion = false")
    counted = database.execute(
        f"SELECT change_type, count(*) FROM read_parquet('{parquet}') GROUP BY 1"
    ).fetchall()
    wanted = collections.Counter(f["properties"]["change_type"] for f in truth.values())
    assert dict(counted) == wanted, f"DuckDB: {counted}"

    flatgeobuf = folder / "changes.flatgeobuf"
    rows = pyogrio.read_dataframe(flatgeobuf)
    assert rows.crs == "EPSG:4326"
    assert pyogrio.read_info(flatgeobuf)["capabilities"]["fast_spatial_filter"]
    same_features(list(rows.itertuples()), truth, "FlatGeobuf")
    assert len(pyogrio.read_dataframe(flatgeobuf, bbox=half)) == expected
    print(f"{len(rows)} features by GeoPandas, DuckDB and GDAL")


def tiles(folder, truth):
    seen, farthest_m = collections.defaultdict(set), 0.0
    with open(folder / "changes.pmtiles", "rb") as file:
        source = pmtiles.reader.MmapSource(file)
        header = pmtiles.reader.Reader(source).header()
        for (zoom, column, row), data in pmtiles.reader.all_tiles(source):
            tile = mapbox_vector_tile.decode(
                gzip.decompress(data), default_options={"y_coord_down": True}
            )
            for feature in tile.get("changes", {"features": []})["features"]:
                change = feature["properties"]["change"]
                seen[zoom].add(change)
                true = shape(truth[change]["geometry"])
                if zoom < header["max_zoom"] or true.geom_type != "LineString":
                    continue
                for x, y in shapely.get_coordinates(shape(feature["geometry"])):
                    lon, lat = degrees(zoom, column + x / 4096, row + y / 4096)
                    east = math.cos(math.radians(lat))
                    near = true.interpolate(true.project(shapely.Point(lon, lat)))
                    off = math.hypot((near.x - lon) * east, near.y - lat) * 111_195
                    farthest_m = max(farthest_m, off)
    # From here on, even a sign of two metres has an area in tile units.
    for zoom in range(13, header["max_zoom"] + 1):
        assert seen[zoom] == set(truth), f"PMTiles, zoom {zoom}: {len(seen[zoom])} changes"
    # Half a unit of a tile, across, at the equator.
    assert farthest_m < 0.11, f"PMTiles: a vertex is {farthest_m} m off"
    print(f"{header['addressed_tiles_count']} tiles, no vertex over {farthest_m:.3f} m off")


def degrees(zoom, x, y):
    north = math.pi * (1 - 2 * y / 2**zoom)
    return x / 2**zoom * 360 - 180, math.degrees(math.atan(math.sinh(north)))


def scene(folder, truth):
    ids = set()
    with open(folder / "changes.mcap", "rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()], validate_crcs=True)
        for schema, channel, _, message in reader.iter_decoded_messages():
            if channel.topic == "/changes":
                assert schema.name == "foxglove.SceneUpdate"
                for entity in message.entities:
                    said = {pair.key: pair.value for pair in entity.metadata}
                    assert said["kind"] == truth[entity.id]["properties"]["kind"]
                    ids.add(entity.id)
            elif channel.topic == "/changes/geojson":
                assert len(json.loads(message.geojson)["features"]) == len(truth)
    assert ids == set(truth), f"MCAP: {len(ids)} changes"
    print(f"{len(ids)} changes in the scene")


class Osm(osmium.SimpleHandler):
    def __init__(self):
        super().__init__()
        self.nodes, self.ways, self.relations = {}, {}, {}

    def node(self, node):
        if node.deleted:
            return
        self.nodes[node.id] = (round(node.location.lon, 7), round(node.location.lat, 7), tags(node))

    def way(self, way):
        if way.deleted:
            return
        self.ways[way.id] = ([node.ref for node in way.nodes], tags(way))

    def relation(self, relation):
        members = tuple((m.type, m.ref, m.role) for m in relation.members)
        self.relations[relation.id] = (members, tags(relation))


def tags(thing):
    return tuple(sorted((tag.k, tag.v) for tag in thing.tags))


def osm(*files):
    merged, read = osmium.MergeInputReader(), Osm()
    for file in files:
        merged.add_file(str(file))
    merged.apply(read, simplify=True)
    # New things have other ids in a patched map than in an OsmChange: compare what they are.
    ways = collections.Counter(
        (tuple(read.nodes[node] for node in nodes), said) for nodes, said in read.ways.values()
    )
    return ways, read.relations, len(read.nodes)


def change(folder):
    applied = osm(folder / "before.osm", folder / "change.osc")
    patched = osm(folder / "patched.osm")
    assert applied == patched, "the OsmChange makes another map than the patch"
    assert applied != osm(folder / "before.osm"), "the OsmChange changes nothing"
    print(f"{sum(applied[0].values())} ways and {applied[2]} nodes after the OsmChange by libosmium")


def main():
    folder = Path(sys.argv[1])
    features = json.loads((folder / "changes.geojson").read_text())["features"]
    truth = {feature["properties"]["change"]: feature for feature in features}
    tables(folder, truth)
    tiles(folder, truth)
    scene(folder, truth)
    if (folder / "change.osc").exists():
        change(folder)


if __name__ == "__main__":
    main()
