"""Makes assignment.txt: random frames with the greatest total gain of any assignment (scipy's Hungarian algorithm),
whether or not it keeps the order. Needs numpy and scipy. Run it here: `python assignment.py`.
"""

import numpy as np
from scipy.optimize import linear_sum_assignment

GATE_M, GAIN_SIGMA_M = 1.6, 0.9


def main():
    random = np.random.default_rng(11)
    lines = ["# Made by assignment.py: seen lateral positions; mapped ones; the greatest total gain; the number of pairs"]
    for _ in range(1000):
        mapped = np.sort(np.cumsum(random.uniform(1.0, 4.0, random.integers(1, 8))) - 8)
        here = mapped[random.random(len(mapped)) < 0.8]
        clutter = random.uniform(-8, 8, random.integers(0, 3))
        seen = np.round(np.concatenate([here + random.normal(0, 0.4, len(here)) + random.normal(0, 0.4), clutter]), 3)
        mapped = np.round(mapped, 3)
        off = seen[:, None] - mapped
        gain = np.where(np.abs(off) <= GATE_M, np.exp(-0.5 * (off / GAIN_SIGMA_M) ** 2), 0.0)
        rows, columns = linear_sum_assignment(-gain)
        best = gain[rows, columns]
        text = lambda values: " ".join(f"{value:.3f}" for value in values)
        lines.append(f"{text(seen)};{text(mapped)};{best.sum():.9f};{(best > 0).sum()}")
    open("assignment.txt", "w").write("\n".join(lines) + "\n")


main()
