"""What the network is asked to say of a picture, on its grid of cells (stride 8).

Lines: at every row of cells, the cell where a marking crosses the row's middle holds it: how far aside
it is, where it is one row up and down, marking, colour, and which line it is. Boxes: at the cell of
their middle.
"""

import numpy as np

from pictures import BOXES, UNKNOWN

STRIDE = 8
# A marking may leave its cell by this many cells within a row.
STEEP = 10.0
# Two lines nearer than this, in cells, are not told apart: nothing is learnt there.
TOGETHER = 1.3


def rows_px(count):
    return (np.arange(count) + 0.5) * STRIDE - 0.5


def crossings(points_px, rows):
    """Where a polyline crosses rows: (row number, x in pixels) of every crossing."""
    found_rows, found_x = [], []
    for (x0, y0), (x1, y1) in zip(points_px[:-1], points_px[1:]):
        low, high = (y0, y1) if y0 <= y1 else (y1, y0)
        first, last = np.searchsorted(rows, low), np.searchsorted(rows, high)
        if last > first:
            hit = np.arange(first, last)
            found_rows.append(hit)
            found_x.append(x0 + (rows[hit] - y0) / (y1 - y0) * (x1 - x0))
    if not found_rows:
        return np.zeros(0, int), np.zeros(0)
    return np.concatenate(found_rows), np.concatenate(found_x)


def line_targets(lines, inside, boxes, top_px, grid):
    """score, weight: [h, w]; place: [3, h, w]; marking, color, instance: [h, w] (-1: not asked)."""
    height, width = grid
    score, place = np.zeros(grid, np.float32), np.zeros((3, *grid), np.float32)
    marking, color, instance = (np.full(grid, UNKNOWN, np.int64) for _ in range(3))
    weight = inside[STRIDE // 2 :: STRIDE, STRIDE // 2 :: STRIDE][:height, :width].astype(np.float32)
    rows = rows_px(height)
    weight[rows < top_px] = 0.0
    cells = np.arange(width)
    taken = [[] for _ in range(height)]
    for number, line in enumerate(lines):
        hit, x_px = crossings(line.points_px, rows)
        at = (x_px + 0.5) / STRIDE - 0.5
        where = dict(zip(hit.tolist(), at.tolist()))
        for row, x in where.items():
            column = int(np.floor(x + 0.5))
            if not 0 <= column < width:
                continue
            up, down = where.get(row - 1), where.get(row + 1)
            up = up - x if up is not None else (x - down if down is not None else 0.0)
            down = down - x if down is not None else -up
            near = np.exp(-0.5 * ((cells - x) / 0.7) ** 2)
            if line.weight == 0.0 or abs(up) > STEEP or abs(down) > STEEP:
                weight[row, near > 0.2] = 0.0
                continue
            if any(abs(x - other) < TOGETHER for other in taken[row]):
                weight[row, near > 0.2] = 0.0
            taken[row].append(x)
            score[row] = np.maximum(score[row], near)
            score[row, column] = 1.0
            place[:, row, column] = x - column, up, down
            marking[row, column], color[row, column] = line.marking, line.color
            instance[row, column] = number
    for box in boxes:
        if box.kind == BOXES.index("vehicle"):
            left, top, right, bottom = np.round((box.ltrb_px + 0.5) / STRIDE).astype(int)
            weight[max(top, 0) : bottom, max(left, 0) : right] = 0.0
    instance[weight == 0.0] = UNKNOWN
    return score, weight, place, marking, color, instance


def box_targets(boxes, inside, grid):
    """heat, weight: [C, h, w]; sides: [4, h, w]; near: [h, w] (how much the sides count); instance."""
    height, width = grid
    heat = np.zeros((len(BOXES), *grid), np.float32)
    weight = np.ones((len(BOXES), *grid), np.float32)
    weight *= inside[STRIDE // 2 :: STRIDE, STRIDE // 2 :: STRIDE][:height, :width]
    sides, near = np.zeros((4, *grid), np.float32), np.zeros(grid, np.float32)
    instance = np.full(grid, UNKNOWN, np.int64)
    ys, xs = np.mgrid[:height, :width]
    # The largest first: what lies before it is the smaller.
    order = sorted(range(len(boxes)), key=lambda k: -np.prod(boxes[k].ltrb_px[2:] - boxes[k].ltrb_px[:2]))
    for number in order:
        box = boxes[number]
        left, top, right, bottom = (box.ltrb_px + 0.5) / STRIDE - 0.5
        x, y = (left + right) / 2, (top + bottom) / 2
        spread_x, spread_y = max((right - left) / 8, 0.45), max((bottom - top) / 8, 0.45)
        blob = np.exp(-0.5 * (((xs - x) / spread_x) ** 2 + ((ys - y) / spread_y) ** 2))
        kinds = slice(None) if box.kind == UNKNOWN else slice(box.kind, box.kind + 1)
        if box.weight == 0.0:
            within = (xs >= left - 1) & (xs <= right + 1) & (ys >= top - 1) & (ys <= bottom + 1)
            weight[kinds, within] = 0.0
            continue
        column, row = int(np.floor(x + 0.5)), int(np.floor(y + 0.5))
        if box.kind == UNKNOWN or not (0 <= column < width and 0 <= row < height):
            continue
        heat[box.kind] = np.maximum(heat[box.kind], blob)
        heat[box.kind, row, column] = 1.0
        weight[box.kind, row, column] = 1.0
        here = blob > 0.3
        here[row, column] = True
        sides[:, here] = np.stack([xs - left, ys - top, right - xs, bottom - ys])[:, here]
        near[here] = blob[here] / blob[here].sum()
        near[row, column] = max(near[row, column], 0.2)
        instance[row, column] = number
    return heat, weight, np.maximum(sides, 0.0), near, instance
