"""Holds simulated GNSS errors against recorded ones: a picture, and a table in Markdown.

    python noise.py RECORDED.csv SIMULATED.csv OUT.png

RECORDED has the columns t_s, lateral_error_m and longitudinal_error_m (and the speed, last): one drive. SIMULATED is what
the example `receiver_error` of tilefold-city makes of its speeds: many drives, whose 5 % to 95 % are shown. Needs numpy
and matplotlib.
"""

import argparse
import csv

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

# Fixes are compared by their number; their mean distance in time.
STEP_S = 0.1
GAPS_S = (0.1, 0.2, 0.5, 1, 2, 5, 10, 20)
SHARES = (5, 25, 50, 75, 95)
AXES = ("lateral", "longitudinal")
# Readable on light and on dark paper.
RECORDED, SIMULATED, INK = "#d97706", "#2f81c7", "#808080"


def read(path):
    """Errors by drive as they are: {axis: [drives, fixes]}, and the times of the fixes."""
    with open(path) as file:
        rows = list(csv.DictReader(file))
    drives = np.array([int(row.get("drive", 0)) for row in rows])
    times = np.array([float(row["t_s"]) for row in rows])
    errors = {}
    for axis in AXES:
        values = np.array([float(row[f"{axis}_error_m"]) for row in rows])
        errors[axis] = np.array([values[drives == d] for d in np.unique(drives)])
    return times[drives == drives[0]], errors


def correlation(errors, gap_s):
    """Of each drive, about its own mean."""
    lag, about = round(gap_s / STEP_S), errors - errors.mean(axis=1, keepdims=True)
    return (about[:, lag:] * about[:, :-lag]).mean(axis=1) / (about**2).mean(axis=1)


def change(errors, gap_s):
    """How much the error of a drive changes in a time (root of the semivariogram)."""
    lag = round(gap_s / STEP_S)
    return np.sqrt(0.5 * ((errors[:, lag:] - errors[:, :-lag]) ** 2).mean(axis=1))


def figures(errors):
    """Of each drive: name, values."""
    horizontal = np.hypot(errors["lateral"], errors["longitudinal"])
    yield "horizontal error, median, m", np.median(horizontal, axis=1)
    yield "horizontal error, 95 %, m", np.percentile(horizontal, 95, axis=1)
    for axis in AXES:
        about = errors[axis] - errors[axis].mean(axis=1, keepdims=True)
        yield f"{axis}, mean, m", errors[axis].mean(axis=1)
        for share in SHARES:
            yield f"{axis}, {share} % about the mean, m", np.percentile(about, share, axis=1)
        for gap_s in GAPS_S:
            yield f"{axis}, change in {gap_s:g} s, m", change(errors[axis], gap_s)
        for gap_s in GAPS_S:
            yield f"{axis}, correlation after {gap_s:g} s", correlation(errors[axis], gap_s)


def table(recorded, simulated):
    print("| figure of one drive | recorded | simulated: 5 %, median, 95 % | inside |\n| --- | --- | --- | --- |")
    inside = []
    for (name, one), (_, many) in zip(figures(recorded), figures(simulated)):
        low, middle, high = np.percentile(many, (5, 50, 95))
        inside.append(low <= one[0] <= high)
        mark = "yes" if inside[-1] else "**no**"
        print(f"| {name} | {one[0]:.3f} | {low:.3f}, {middle:.3f}, {high:.3f} | {mark} |")
    print(f"\n{sum(inside)} of {len(inside)} recorded figures lie inside the simulated 90 %.")


def draw(times, recorded, simulated, path):
    gaps = np.unique(np.round(np.geomspace(0.1, 20, 40) / STEP_S)) * STEP_S
    figure, rows = plt.subplots(2, 3, figsize=(13, 7))
    for axes, axis in zip(rows, AXES):
        one, many = recorded[axis], simulated[axis]
        for index, drive in enumerate(many[:8]):
            axes[0].plot(times, drive - drive.mean(), color=SIMULATED, lw=0.7, alpha=0.45, label="simulated" if index == 0 else None)
        axes[0].plot(times, one[0] - one[0].mean(), color=RECORDED, lw=1.3, label="recorded")
        low, high = axes[0].get_ylim()
        axes[0].set_ylim(low, high + 0.25 * (high - low))
        axes[0].set(title=f"{axis} error about its mean, m (8 drives)", xlabel="seconds")
        for plot, of, name in ((axes[1], change, "change of the error, m"), (axes[2], correlation, "autocorrelation")):
            drives = np.array([of(many, gap) for gap in gaps])
            low, middle, high = np.percentile(drives, (5, 50, 95), axis=1)
            plot.fill_between(gaps, low, high, color=SIMULATED, alpha=0.25, lw=0, label="simulated, 90 % of the drives")
            plot.plot(gaps, middle, color=SIMULATED, lw=1.3, label="simulated, median")
            plot.plot(gaps, [of(one, gap)[0] for gap in gaps], color=RECORDED, lw=1.8, label="recorded, one drive")
            plot.set(xscale="log", title=f"{axis}: {name}", xlabel="seconds between")
        axes[1].set_yscale("log")
    for axes in rows.flat:
        axes.set_facecolor("none")
        axes.tick_params(colors=INK, which="both")
        axes.xaxis.label.set_color(INK)
        axes.title.set(color=INK, fontsize=11)
        axes.grid(color=INK, alpha=0.2)
        for spine in axes.spines.values():
            spine.set_color(INK)
    rows[0][0].legend(frameon=False, labelcolor=INK, fontsize=9, loc="upper right", ncol=2)
    rows[0][1].legend(frameon=False, labelcolor=INK, fontsize=9)
    figure.tight_layout()
    figure.savefig(path, dpi=85, transparent=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("recorded")
    parser.add_argument("simulated")
    parser.add_argument("out")
    args = parser.parse_args()
    times, recorded = read(args.recorded)
    _, simulated = read(args.simulated)
    draw(times, recorded, simulated, args.out)
    table(recorded, simulated)


if __name__ == "__main__":
    main()
