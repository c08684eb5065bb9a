"""From logs to verdicts: Tilefold beside match_and_register.py, and reading beside python's mcap, in one run, by turns.

    python whole.py MAP.osm LOGS... --tilefold PATH [--benchmarks PATH] [--turns 3] [--json FIGURES.json]

One thread each. `--benchmarks` is the program tilefold-benchmarks: the bare mcap crate, the file, the memory.
"""

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from statistics import median

from mcap.reader import make_reader

PEER = Path(__file__).with_name("match_and_register.py")


def processor_s():
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def timed(command):
    before, clock = processor_s(), time.perf_counter()
    done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, env=os.environ | {"OMP_NUM_THREADS": "1"})
    if done.returncode not in (0, 3):
        sys.exit(f"{command[0]} ended with exit code {done.returncode}")
    return json.loads(done.stdout), {"wall_s": time.perf_counter() - clock, "processor_s": processor_s() - before}


def tilefold(program, map_file, logs):
    with tempfile.TemporaryDirectory() as folder:
        store = f"{folder}/store"
        subprocess.run([program, "init", store, "--map", map_file], check=True, stdout=subprocess.DEVNULL)
        return timed([program, "--threads", "1", "--format", "json", "run", store, *logs])


def python_mcap(logs):
    """Messages a processor second, decompressed, but not decoded."""
    count, clock = 0, time.process_time()
    for log in logs:
        with open(log, "rb") as file:
            count += sum(1 for _ in make_reader(file).iter_messages(log_time_order=False))
    return count / (time.process_time() - clock)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("map")
    parser.add_argument("logs", nargs="+")
    parser.add_argument("--tilefold", required=True)
    parser.add_argument("--benchmarks")
    parser.add_argument("--turns", type=int, default=3)
    parser.add_argument("--json", type=Path)
    args = parser.parse_args()
    peers = {
        "peer": ["--search-lag"],
        "peer, told the clock offset": ["--lag", "12"],
        "peer, told, one call for each line and range": ["--lag", "12", "--by-one"],
    }
    turns = {"tilefold": [], **{name: [] for name in peers}}
    reports = {}
    for _ in range(args.turns):
        reports["tilefold"], used = tilefold(args.tilefold, args.map, args.logs)
        turns["tilefold"].append(used)
        for name, arguments in peers.items():
            reports[name], used = timed([sys.executable, str(PEER), args.map, *args.logs, *arguments])
            turns[name].append(used)
    frames = next(stage["items"] for stage in reports["tilefold"]["stages"] if stage["stage"] == "map")
    figures = {"logs": len(args.logs), "frames": frames, "load": os.getloadavg()[0], "turns": turns, "reports": reports, "rates": {}}
    for name, used in turns.items():
        count = frames if name == "tilefold" else reports[name]["frames"]
        figures["rates"][name] = {
            "frames": count,
            "frames_per_processor_s": count / median(one["processor_s"] for one in used),
            "frames_per_wall_s": count / median(one["wall_s"] for one in used),
        }
    own = figures["rates"]["tilefold"]
    for name in peers:
        rate = figures["rates"][name]
        rate["ratio_by_processor"] = own["frames_per_processor_s"] / rate["frames_per_processor_s"]
        rate["ratio_by_wall"] = own["frames_per_wall_s"] / rate["frames_per_wall_s"]
    figures["python_mcap_messages_per_processor_s"] = python_mcap(args.logs)
    if args.benchmarks:
        figures["reading"], _ = timed([args.benchmarks, "reading", *args.logs])
    text = json.dumps(figures, indent=2)
    print(json.dumps(figures["rates"], indent=2))
    if args.json:
        args.json.write_text(text + "\n")


if __name__ == "__main__":
    main()
