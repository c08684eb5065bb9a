"""Refines the mounting of a log from many wrong ones: a table of where each ends.

    python mounting_starts.py EXAMPLE LOG MAP COUNT SEED ANGLE_RAD HEIGHT_M PITCH YAW HEIGHT

EXAMPLE is the program of `cargo build -p tilefold-benchmarks --example mounting`; starts are drawn evenly
within ANGLE_RAD and HEIGHT_M of roll 0, PITCH, YAW and HEIGHT.
"""

import re
import subprocess
import sys

import numpy as np

example, log, base, count, seed = sys.argv[1:6]
angle, height, *centre = map(float, sys.argv[6:])
generator = np.random.default_rng(int(seed))
reach = np.array([angle, angle, angle, height])
ends, medians, stated = [], [], []
print("start: roll, pitch, yaw, height   end                                as stated  refined")
for _ in range(int(count)):
    start = np.array([0.0, *centre]) + reach * generator.uniform(-1, 1, 4)
    start = np.round(start, 4)
    out = subprocess.run([example, log, base, *map(str, start)], capture_output=True, text=True, check=True).stdout
    correction = np.array(eval(re.findall(r"correction: (\[.*?\])", out)[-1]))
    found = [float(re.search(how + r".*quartiles \S+ (\S+)", out)[1]) for how in ("as stated", "refined")]
    stated.append(found[0])
    medians.append(found[1])
    ends.append(start + correction)
    print("%7.3f %7.3f %7.3f %6.2f    %7.3f %7.3f %7.3f %6.2f    %.3f      %.3f" % (*start, *ends[-1], *found))
print("median of medians: as stated %.3f, refined %.3f; worst refined %.3f" % (np.median(stated), np.median(medians), max(medians)))
print("below 0.16 m: %d of %d" % (sum(m < 0.16 for m in medians), len(medians)))
