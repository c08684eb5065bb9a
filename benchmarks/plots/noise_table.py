"""Prints what `detections.py` measured as a table (Markdown), a column for each file.

    python noise_table.py RECORDED.json [SIMULATED.json ...]

A column is named by its file. Where a cell has values between slashes, they are those of lines 0 to 2.2, 2.2 to 3.2, 3.2 to 4.5
and 4.5 to 6.2 m to the side; where it has three after commas, 5 %, median and 95 %.
"""

import argparse
import json
import pathlib

POSITIONS = {
    "positions: km": "km",
    "their delay wavers by, s": "delay_spread_s",
    "of that left at the next fix": "delay_next_correlation",
    "they waver to the side by, m": "side_spread_m",
    "stalls of more than 0.1 s, per minute": "stalls_per_minute",
    "of them late, not early": "stalls_late",
    "how late, s": "stall_s",
    "how long, s": "stall_lasts_s",
    "jumps to the side of more than 0.5 m, per minute": "side_jumps_per_minute",
    "how far, m": "side_jump_m",
    "heading against the course, degrees": "yaw_bias_deg",
}
LATERAL = {
    "lines: spread to the side, m": "spread_m",
    "their bias, m": "bias_m",
    "spread between passes, m": "pass_spread_m",
    "change to the next frame, m": "next_frame_spread_m",
    "change in 0.2 s, m": "after_spread_m.0.2 s",
    "change in 1 s, m": "after_spread_m.1 s",
    "change in 3 s, m": "after_spread_m.3 s",
    "farther off than 0.45 m": "beyond_45_cm",
    "direction, rad": "slope_spread",
}
MISSED = {
    "missed": "missed",
    "missed after a hit": "miss_after_hit",
    "missed after a miss": "miss_after_miss",
    "concentration of passes (Beta)": "beta_concentration",
    "passes that never see the line": "passes_never_seen",
}
OTHERS = {
    "frames placed": "frames",
    "seconds between frames": "period_s",
    "lines per frame": "lines_per_frame",
    "clock offset, s": "clock_offset_s.clear_s",
    "map over detected distances to the side": "lateral_scale",
    "width of the own lane against the map, bias, m": "lane_width.bias_m",
    "its spread, m": "lane_width.spread_m",
    "its spread between drives, m": "lane_width.drive_spread_m",
    "positions to the side between drives, m": "lateral_offset.between_drives_m",
    "and within a drive, m": "lateral_offset.within_m",
    "detections begin, m ahead": "extent.near_m",
    "and end": "extent.far_m",
    "their points": "extent.points",
    "distance of points, m": "extent.point_every_m",
    "points about a straight line, m": "extent.point_rms_m",
    "lines that are seen, seen at 4.5 m": "extent.covered_at_m.4.5",
    "at 6.5 m": "extent.covered_at_m.6.5",
    "at 8.5 m": "extent.covered_at_m.8.5",
    "at 9.5 m": "extent.covered_at_m.9.5",
    "clutter per frame": "clutter.per_frame",
    "within 1.5 m of a line of the map": "clutter.beside_a_line",
    "oblique": "clutter.oblique",
    "clutter followed for 5 frames and more, per km": "clutter.tracks_per_km",
    "how long, m": "clutter.track_m",
}


def pick(values, key):
    """A value by its path, whose first parts are separated by dots."""
    if values is None or key in values:
        return values and values[key]
    head, _, rest = key.partition(".")
    return pick(values.get(head), rest) if rest else None


def written(value):
    if value is None:
        return "-"
    if isinstance(value, list):
        return ", ".join(written(value[place]) for place in (0, 2, 4))
    return f"{value:.3g}" if isinstance(value, float) else str(value)


def rows(measured):
    """Names and cells of a file."""
    for name, key in POSITIONS.items():
        yield name, written(pick(measured.get("positions"), key))
    for part, keys in (("lateral", LATERAL), ("missed", MISSED)):
        for name, key in keys.items():
            classes = measured.get(part)
            cells = [written(pick(values, key)) for values in classes.values()] if classes else ["-"]
            yield name, " / ".join(cells)
    for name, key in OTHERS.items():
        yield name, written(pick(measured, key))


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("files", nargs="+", type=pathlib.Path)
    files = parser.parse_args().files
    columns = [list(rows(json.loads(file.read_text()))) for file in files]
    print("| " + " | ".join(["figure", *(file.stem for file in files)]) + " |")
    print("|" + " --- |" * (len(files) + 1))
    for cells in zip(*columns):
        print("| " + " | ".join([cells[0][0], *(cell for _, cell in cells)]) + " |")


if __name__ == "__main__":
    main()
