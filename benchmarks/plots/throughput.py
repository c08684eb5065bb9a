"""Draws what `tilefold-benchmarks throughput` measured: where the time goes, threads, growth over the input.

    python throughput.py throughput.json OUT.svg

The background is transparent and colours are of middle brightness: it can be read on light and on dark pages.
"""

import json
import sys
from statistics import median_low

import matplotlib

matplotlib.use("svg")
import matplotlib.pyplot as plt

GREY, BLUE, ORANGE = "#777777", "#3a82cf", "#c8741a"
plt.rcParams.update(
    {
        "text.color": GREY, "axes.labelcolor": GREY, "axes.edgecolor": GREY, "xtick.color": GREY, "ytick.color": GREY,
        "svg.fonttype": "none", "svg.hashsalt": "tilefold", "font.size": 10, "axes.spines.top": False, "axes.spines.right": False,
    }
)  # fmt: skip


def of(turns, figure):
    return median_low([figure(job) for job in turns])


def processor_s(job):
    return job["user_s"] + job["system_s"]


def frames(job):
    return next(stage["items"] for stage in job["report"]["stages"] if stage["stage"] == "map")


def stages(axes, turns):
    names = [stage["stage"] for stage in turns[0]["report"]["stages"]][::-1]
    busy = [of(turns, lambda job: next(s["busy_s"] for s in job["report"]["stages"] if s["stage"] == name)) for name in names]
    bars = axes.barh(names, busy, color=BLUE)
    axes.bar_label(bars, [f"{value:.2f}" for value in busy], color=GREY, padding=3)
    axes.set_xlim(0, max(busy) * 1.2)
    axes.set_xlabel("busy seconds on one thread")


def growth(axes, sizes, limited):
    """Processor time and peak memory of each size, over those of the smallest."""
    for runs, style, name in ((sizes, "-", ""), (limited, "--", " within the limit")):
        if not runs:
            continue
        count = [of(turns, frames) for turns in runs]
        time = [of(turns, processor_s) for turns in runs]
        peak = [of(turns, lambda job: job["peak_bytes"]) for turns in runs]
        axes.loglog([c / count[0] for c in count], [t / time[0] for t in time], style, marker="o", color=BLUE, label="processor time" + name)
        axes.loglog([c / count[0] for c in count], [p / peak[0] for p in peak], style, marker="s", color=ORANGE, label="peak memory" + name)
    most = max(of(turns, frames) for turns in sizes) / of(sizes[0], frames)
    axes.loglog([1, most], [1, most], ":", color=GREY, linewidth=0.8, label="as fast as the input")
    axes.set_xlabel("frames, times the smallest")
    axes.set_ylabel("times the smallest")
    axes.legend(frameon=False, labelcolor=GREY, fontsize=8)


def main():
    measured = json.load(open(sys.argv[1]))
    wide = bool(measured["growth"])
    figure, axes = plt.subplots(1, 2 if wide else 1, figsize=(9.5 if wide else 5, 3.6), squeeze=False)
    stages(axes[0][0], measured["scaling"][0])
    if wide:
        growth(axes[0][1], measured["growth"], measured["growth_limited"])
    figure.tight_layout()
    figure.savefig(sys.argv[2], transparent=True, metadata={"Date": None})


if __name__ == "__main__":
    main()
