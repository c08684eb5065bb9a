"""From the network's outputs to polylines: the same rules as the map stage's, for training and scoring."""

import numpy as np

from targets import STRIDE

# How far a cell's word of the next row may be off, in cells.
OFF = 1.0
LEAST_ROWS = 4


def cells(lines, threshold):
    """Per row, from the top: (x in cells, up, down, score) of the cells that hold a marking."""
    score = lines[0]
    beside = np.pad(score, ((0, 0), (1, 1)))
    is_peak = (score > threshold) & (score >= beside[:, :-2]) & (score > beside[:, 2:])
    for row in range(score.shape[0]):
        found = []
        for column in np.flatnonzero(is_peak[row]):
            dx, up, down = lines[1:4, row, column]
            found.append((column + dx, up, down, score[row, column], column))
        yield found


def joined(lines, threshold=0.4):
    """Chains of cells, each from the bottom up: lists of (row, x in cells, score, column)."""
    open_chains, done = [], []
    rows = list(cells(lines, threshold))
    for row in range(len(rows) - 1, -1, -1):
        pairs = sorted(
            (abs(x + down - chain[-1][1]) + abs(chain[-1][4] + chain[-1][1] - x), number, index)
            for number, chain in enumerate(open_chains)
            for index, (x, up, down, score, column) in enumerate(rows[row])
        )
        taken_chains, taken_cells = set(), set()
        for off, number, index in pairs:
            steep = 1.0 + 0.25 * abs(open_chains[number][-1][4])
            if off > 2 * OFF * steep or number in taken_chains or index in taken_cells:
                continue
            x, up, down, score, column = rows[row][index]
            open_chains[number].append((row, x, score, column, up))
            taken_chains.add(number)
            taken_cells.add(index)
        done += [chain for number, chain in enumerate(open_chains) if number not in taken_chains]
        open_chains = [chain for number, chain in enumerate(open_chains) if number in taken_chains]
        open_chains += [
            [(row, x, score, column, up)]
            for index, (x, up, down, score, column) in enumerate(rows[row])
            if index not in taken_cells
        ]
    return [chain for chain in done + open_chains if len(chain) >= LEAST_ROWS]


def polylines(lines, threshold=0.4):
    """[(points in pixels of the input, score)] of the markings."""
    found = []
    for chain in joined(lines, threshold):
        points = [((x + 0.5) * STRIDE - 0.5, (row + 0.5) * STRIDE - 0.5) for row, x, *_ in chain]
        found.append((np.array(points), float(np.mean([cell[2] for cell in chain]))))
    return found
