"""Golden figures for `tilefold-tiler`: local frames, UTM, MGRS, geodesics and tiles.

    pip install pyproj==3.7.2 mgrs==1.6.0 ndslive-math==1.1.0
    python geodesy.py > geodesy.json

Frames, UTM and geodesics come from PROJ, MGRS from GEOTRANS, tiles from the Python reference of
the NDS.Live math library. Seeded: the same versions print the same bytes.
"""

import json
import math
import random

import mgrs
import pyproj
from ndslive.math import PackedTileId, Wgs84

ANCHORS = [
    [8.4243, 49.0035, 115.0],
    [114.3624, 22.6804, 0.0],
    [139.7774, 35.9022, 19.5],
    [-73.9853, 40.7483, 10.0],
    [-58.3816, -34.6037, 25.0],
    [179.9995, -16.5, 3.0],
    [-0.0005, 0.0005, -20.0],
    [15.65, 78.22, 500.0],
    [30.0, 89.999, 2800.0],
    [-120.0, -89.9, 2800.0],
]
TO_ECEF = pyproj.Transformer.from_crs("EPSG:4979", "EPSG:4978", always_xy=True)
GEOD = pyproj.Geod(ellps="WGS84")


def local(anchor):
    lon, lat, h = anchor
    return pyproj.Transformer.from_pipeline(
        "+proj=pipeline +step +proj=unitconvert +xy_in=deg +xy_out=rad +step +proj=cart +ellps=WGS84 "
        f"+step +proj=topocentric +ellps=WGS84 +lon_0={lon!r} +lat_0={lat!r} +h_0={h!r}"
    )


def around(anchor, rng, count):
    """Points up to 100 km away, half of them within 200 m."""
    for i in range(count):
        reach = 200.0 if i % 2 else 100_000.0
        lon, lat, _ = GEOD.fwd(anchor[0], anchor[1], rng.uniform(0, 360), rng.uniform(0, reach))
        yield [lon, lat, anchor[2] + rng.uniform(-50, 300)]


def frames(rng):
    for anchor in ANCHORS:
        to_enu = local(anchor)
        points = [{"wgs84": p, "enu": list(to_enu.transform(*p))} for p in around(anchor, rng, 20)]
        yield {"anchor": anchor, "ecef": list(TO_ECEF.transform(*anchor)), "points": points}


def convergence(rng):
    """Where a point's north lies in another frame: two points on its meridian, seen by PROJ."""
    for anchor in ANCHORS[:6]:
        to_enu = local(anchor)
        for lon, lat, _ in around(anchor, rng, 4):
            step = 1e-5
            low = to_enu.transform(lon, lat - step, anchor[2])
            high = to_enu.transform(lon, lat + step, anchor[2])
            yaw = math.atan2(high[1] - low[1], high[0] - low[0])
            yield {"anchor": anchor, "at": [lon, lat, anchor[2]], "north_yaw_rad": yaw}


def utm(rng):
    grid = mgrs.MGRS()
    for anchor in ANCHORS[:6]:
        for lon, lat, _ in around(anchor, rng, 6):
            zone = int((lon + 180) // 6) + 1
            crs = f"EPSG:{32600 + zone if lat >= 0 else 32700 + zone}"
            to_utm = pyproj.Transformer.from_crs("EPSG:4326", crs, always_xy=True)
            easting, northing = to_utm.transform(lon, lat)
            yield {
                "at": [lon, lat],
                "zone": zone,
                "north": lat >= 0,
                "utm": [easting, northing],
                "mgrs": [grid.toMGRS(lat, lon, MGRSPrecision=d) for d in (0, 3, 5)],
            }


def geodesics(rng):
    for anchor in ANCHORS:
        for lon, lat, _ in around(anchor, rng, 3):
            yield {"from": anchor[:2], "to": [lon, lat], "m": GEOD.inv(*anchor[:2], lon, lat)[2]}


def tiles(rng):
    for i in range(400):
        lon, lat = rng.uniform(-180, 180), rng.uniform(-90, 90)
        level = i % 16
        tile = PackedTileId.from_wgs84(lon, lat, level)
        yield {
            "at": [lon, lat],
            "level": level,
            "id": tile.value,
            # Level 0 has one row; the reference places it north of the equator.
            "south_west": list(tile.south_west_wgs84()) if level else None,
        }


def main():
    rng = random.Random(20261122)
    figures = {
        "frames": list(frames(rng)),
        "convergence": list(convergence(rng)),
        "utm": list(utm(rng)),
        "geodesics": list(geodesics(rng)),
        "tiles": list(tiles(rng)),
    }
    body = ",\n".join(
        f'"{name}": [\n' + ",\n".join(json.dumps(row) for row in rows) + "\n]"
        for name, rows in figures.items()
    )
    print("{\n" + body + "\n}")


if __name__ == "__main__":
    main()
