"""Golden figures for `tilefold-formats`: an Argoverse 2 map as the `av2` package reads it, placed in
each of the six cities.

    pip install av2==0.3.6
    python argoverse2_map.py ../../formats/tests/maps/log_map_archive_made____PIT_city_1.json \
        > argoverse2_map.json

Per city: every boundary of every lane segment with its mark type, and the outline of every crossing,
as [longitude, latitude, elevation].
"""

import json
import pathlib
import sys

import numpy as np
from av2.geometry.utm import CityName, convert_city_coords_to_wgs84
from av2.map.map_api import ArgoverseStaticMap


def placed(points, city):
    lat_lon = convert_city_coords_to_wgs84(points[:, :2], city)
    return np.column_stack([lat_lon[:, 1], lat_lon[:, 0], points[:, 2]]).tolist()


def boundaries(loaded, city):
    for segment in loaded.get_scenario_lane_segments():
        for marking in (segment.left_lane_marking, segment.right_lane_marking):
            yield {
                "lane": f"{segment.id} {marking.bound_side}",
                "mark_type": marking.mark_type.value,
                "points": placed(marking.polyline, city),
            }


def crossings(loaded, city):
    for crossing in loaded.get_scenario_ped_crossings():
        yield {"id": crossing.id, "points": placed(crossing.polygon, city)}


def main():
    loaded = ArgoverseStaticMap.from_json(pathlib.Path(sys.argv[1]))
    rows = [
        {
            "city": city.value,
            "boundaries": list(boundaries(loaded, city)),
            "crossings": list(crossings(loaded, city)),
        }
        for city in CityName
    ]
    print("[\n" + ",\n".join(json.dumps(row) for row in rows) + "\n]")


if __name__ == "__main__":
    main()
