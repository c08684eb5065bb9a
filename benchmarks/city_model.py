"""What a fleet costs a day, from measured rates: makes docs/results/city-model.md.

    python city_model.py CITY/throughput.json DEECAMP/throughput.json > docs/results/city-model.md

Nothing on that page is typed in but the assumptions below. Rates are of one thread and of processor time, because the
machine that measured them did other work as well.
"""

import json
import sys
from statistics import median_low

FLEETS = [1_000, 100_000]
# Assumptions. Prices are list prices of large clouds, rounded; change them and run again.
KM_A_DAY = 50
ROADS_KM = {1_000: 1_000, 100_000: 50_000}
CORE_HOUR = 0.04
GB_MONTH_LEDGER, GB_MONTH_LOGS = 0.023, 0.004
LEDGER_DAYS, LOG_DAYS = 90, 30
NIGHT_H = 6
CORES_A_MACHINE, MEMORY_A_MACHINE_GB = 32, 128
# What rows are in memory while their data file is rewritten, bytes a row: columns, rows, and both once more.
BYTES_A_ROW = 1_200
# A look as the driver holds it, bytes.
BYTES_A_LOOK = 120
TILES_A_FILE_KM2 = 400


def rates(path):
    measured = json.load(open(path))
    turns, km = measured["scaling"][0], measured["km"]
    of = lambda figure: median_low([figure(job) for job in turns])
    stage = lambda name, what: of(lambda job: next(s[what] for s in job["report"]["stages"] if s["stage"] == name))
    tables = dict(turns[0]["table_bytes"])
    rows = stage("exchange", "items")
    shares = {s["stage"]: stage(s["stage"], "busy_s") for s in turns[0]["report"]["stages"]}
    processor_s = of(lambda job: job["user_s"] + job["system_s"])
    folding = shares["exchange"] + shares["reduce"] + shares["commit"]
    return {
        "km": km,
        "core_s_km": processor_s / km,
        "log_mb_km": turns[0]["log_bytes"] * 1e-6 / km,
        "ledger_kb_km": sum(tables.get(name, 0) for name in ("evidence", "sightings", "footprints", "chunks")) * 1e-3 / km,
        "rows_km": rows / km,
        "frames_km": stage("map", "items") / km,
        # Busy time includes waiting for the processor: only its shares are taken.
        "serial_s_km": processor_s * shares["commit"] / sum(shares.values()) / km,
        "fold_s_row": processor_s * folding / sum(shares.values()) / rows,
        "fold_us_row": 1e6 * processor_s * folding / sum(shares.values()) / rows,
        "reduce_share": folding / sum(shares.values()),
    }


def row(*cells):
    return "| " + " | ".join(cells) + " |"


def number(value):
    return f"{value:,.0f}" if value >= 100 else f"{value:.3g}"


def fleet(vehicles, rate):
    km = vehicles * KM_A_DAY
    map_h = km * rate["core_s_km"] / 3600
    kept_rows = km * rate["rows_km"] * LEDGER_DAYS
    fold_h = kept_rows * rate["fold_s_row"] / 3600
    core_h = map_h + fold_h
    ledger_gb = km * rate["ledger_kb_km"] * 1e-6
    logs_gb = km * rate["log_mb_km"] * 1e-3
    files = ROADS_KM[vehicles] / 150
    return {
        "kilometres": number(km),
        "passes over a kilometre of road": number(km / ROADS_KM[vehicles]),
        "core hours for the day's logs": number(map_h),
        "core hours to fold all kept rows again": number(fold_h),
        f"cores for a night of {NIGHT_H} h": number(core_h / NIGHT_H),
        f"machines of {CORES_A_MACHINE} cores": number(-(-core_h / NIGHT_H // CORES_A_MACHINE)),
        "logs, GB a day": number(logs_gb),
        "ledger, GB a day": number(ledger_gb),
        f"ledger, GB kept ({LEDGER_DAYS} days)": number(ledger_gb * LEDGER_DAYS),
        "$ a day for cores": number(core_h * CORE_HOUR),
        "$ a day for the ledger": number(ledger_gb * LEDGER_DAYS * GB_MONTH_LEDGER / 30),
        f"$ a day for logs ({LOG_DAYS} days)": number(logs_gb * LOG_DAYS * GB_MONTH_LOGS / 30),
        "$ a day for a vehicle": number(
            (core_h * CORE_HOUR + ledger_gb * LEDGER_DAYS * GB_MONTH_LEDGER / 30 + logs_gb * LOG_DAYS * GB_MONTH_LOGS / 30) / vehicles
        ),
        "rows kept in one data file, million": number(kept_rows / files * 1e-6),
        "memory to rewrite it, GB": number(kept_rows / files * BYTES_A_ROW * 1e-9),
    }


def limits(rate):
    """Where one thing after the other no longer scales, in passes over each kilometre of road that are kept."""
    memory = MEMORY_A_MACHINE_GB * 1e9
    rows_a_road_km = rate["rows_km"]
    passes_file = memory / BYTES_A_ROW / (150 * rows_a_road_km)
    return passes_file


def main():
    city, road = rates(sys.argv[1]), rates(sys.argv[2])
    print("# What a fleet costs\n")
    print("<!-- Made by benchmarks/city_model.py from raw figures in benchmarks/runs. Do not edit. -->\n")
    print(
        "A model, not a measurement: rates that were measured on one thread, times what a fleet drives. Logs carry detections that were made on the vehicle; "
        "a network that looks at pictures costs far more and is not in it.\n"
    )
    print("## Measured\n")
    print(row("", "simulated city", "DeeCamp road"))
    print(row("---", "---", "---"))
    for name, key in [
        ("kilometres driven", "km"),
        ("frames a kilometre", "frames_km"),
        ("processor seconds a kilometre", "core_s_km"),
        ("logs, MB a kilometre", "log_mb_km"),
        ("ledger, kB a kilometre and pass", "ledger_kb_km"),
        ("ledger rows a kilometre and pass", "rows_km"),
        ("processor microseconds a ledger row in exchange, reduce and commit", "fold_us_row"),
        ("share of exchange, reduce and commit in busy time", "reduce_share"),
    ]:
        print(row(name, number(city[key]), number(road[key])))
    print("\n## Assumed\n")
    print(f"- A vehicle drives {KM_A_DAY} km a day, all of it mapped; the day's logs are worked through in a night of {NIGHT_H} h.")
    for vehicles in FLEETS:
        print(f"- {vehicles:,} vehicles drive on {ROADS_KM[vehicles]:,} km of road.")
    print(f"- A core costs ${CORE_HOUR} an hour; storage ${GB_MONTH_LEDGER} a GB and month, for logs ${GB_MONTH_LOGS} (cold).")
    print(f"- The ledger is kept for {LEDGER_DAYS} days, logs for {LOG_DAYS}. A data file (16 x 16 tiles) holds 150 km of road.")
    print(f"- A ledger row takes {BYTES_A_ROW:,} bytes of memory while its data file is rewritten (estimated from its layout, four copies).")
    print("\n## A day of the fleet, at the rates of the simulated city\n")
    fleets = [fleet(vehicles, city) for vehicles in FLEETS]
    print(row("", *(f"{vehicles:,} vehicles" for vehicles in FLEETS)))
    print(row("---", *("---" for _ in FLEETS)))
    for name in fleets[0]:
        print(row(name, *(one[name] for one in fleets)))
    print("\n## Where it stops scaling\n")
    passes = limits(city)
    print(
        f"- **One data file.** A job holds all rows of a data file that it rewrites. A machine of {MEMORY_A_MACHINE_GB} GB holds a file with "
        f"{number(passes)} kept passes over each of its kilometres: beyond that, keep fewer days, or store at a finer level of tiles. "
        + " ".join(f"{vehicles:,} vehicles get there in {number(passes * ROADS_KM[vehicles] / vehicles / KM_A_DAY)} nights." for vehicles in FLEETS)
        + " This is the first limit that a dense fleet meets."
    )
    print(
        "- **The driver.** It holds the sightings and footprints of the whole store, because what was added does not end at a tile's border. "
        "Both grow with kilometres kept, and are not split over machines."
    )
    print(
        "- **One commit.** A job ends in one commit by one machine; its layers are written one file of tiles after the other. "
        f"It took {number(1000 * city['serial_s_km'])} ms of processor time a kilometre, which a cluster does not divide; many small jobs meet each other as conflicts and fold again."
    )
    print(
        "- **Old rows.** A fleet that touches every tile every night folds every row that is kept again, every night: the second line of core hours, "
        "which grows with the days that are kept while the first does not. Sums per section that are kept beside the rows would end that; there are none."
    )
    print("- **Mapping has no such limit**: chunks know nothing of each other. Cores buy time one for one until the above takes over.")
    print("\nThe prices move with the market, the rates with the processor; the ratio of cores to storage is the part to trust.")


if __name__ == "__main__":
    main()
