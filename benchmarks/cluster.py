"""The rates of a job on one machine beside those on a cluster on the same machine.

`python benchmarks/cluster.py MAP LOGS OUT.json TURNS` in the environment of `cargo xtask cluster-test`
(target/tools/cluster). Every run makes a new store of the map; digests must be equal.
"""

import json
import os
import shutil
import sys
import tempfile
import time
from pathlib import Path

import ray
import tilefold
import tilefold.ray
from ray.cluster_utils import Cluster
from tilefold.cluster import Options

NODE = {"num_cpus": 1, "object_store_memory": 200 * 2**20}


def timed(name: str, store: Path, run) -> dict:
    """One run, with what it says of itself."""
    shutil.rmtree(store, ignore_errors=True)
    tilefold.init(store, [sys.argv[1]])
    load, began = os.getloadavg()[0], time.monotonic()
    report = run(store, [sys.argv[2]])
    result = {
        "run": name,
        "wall_s": round(time.monotonic() - began, 2),
        "load_before": load,
        "chunks": report["chunks_mapped"],
        "tiles": report["tiles_reduced"],
        "set_aside": len(report["set_aside"]),
        "stages": report["stages"],
        "digest": tilefold.open(store).snapshot().digest(),
        "evidence_digest": tilefold.open(store).snapshot().digest("evidence"),
    }
    print(name, result["wall_s"], result["digest"][:12], file=sys.stderr, flush=True)
    return result


def start_ray(nodes: int) -> None:
    """A cluster of this many nodes of one core each."""
    cluster = Cluster(initialize_head=True, head_node_args=NODE)
    for _ in range(nodes - 1):
        cluster.add_node(**NODE)
    ray.init(address=cluster.address, log_to_driver=False)
    cluster.wait_for_nodes()


def spark_runner():
    """What runs a job on two executors of one core each."""
    os.environ["PYSPARK_PYTHON"] = sys.executable
    from pyspark.sql import SparkSession

    import tilefold.spark

    session = SparkSession.builder.master("local-cluster[2,1,1024]").getOrCreate()

    def run(store, logs):
        return tilefold.spark.run(store, logs, spark=session, options=Options(groups=2))

    return run


def main() -> None:
    start_ray(2)
    runs = {
        "local, 1 thread": lambda store, logs: tilefold.run(store, logs, threads=1),
        "local, 2 threads": lambda store, logs: tilefold.run(store, logs, threads=2),
        "ray, 2 nodes": tilefold.ray.run,
        "spark, 2 executors": spark_runner(),
    }
    results = []
    with tempfile.TemporaryDirectory() as folder:
        # In turns, so that whatever else the machine does falls on all of them. The first round
        # starts the workers.
        for turn in range(int(sys.argv[4])):
            for name, run in runs.items():
                results.append({"turn": turn} | timed(name, Path(folder) / "store", run))
    digests = {(one["digest"], one["evidence_digest"]) for one in results}
    assert len(digests) == 1, digests
    Path(sys.argv[3]).write_text(json.dumps(results, indent=1) + "\n")


if __name__ == "__main__":
    main()
