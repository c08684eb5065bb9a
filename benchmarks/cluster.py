"""The rates of a job on one machine beside those on a cluster on the same machine.

`python benchmarks/cluster.py MAP LOGS OUT.json` in the environment of `cargo xtask cluster-test`
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


def on_ray(nodes: int, store: Path, repeats: int) -> list[dict]:
    """Runs on a cluster of this many nodes of one core each; the first one starts the workers."""
    cluster = Cluster(initialize_head=True, head_node_args=NODE)
    for _ in range(nodes - 1):
        cluster.add_node(**NODE)
    ray.init(address=cluster.address, log_to_driver=False)
    cluster.wait_for_nodes()
    names = ["cold", *["warm"] * (repeats - 1)]
    results = [timed(f"ray, {nodes} nodes, {name}", store, tilefold.ray.run) for name in names]
    ray.shutdown()
    cluster.shutdown()
    return results


def on_spark(store: Path, repeats: int) -> list[dict]:
    """Runs on two executors of one core each."""
    os.environ["PYSPARK_PYTHON"] = sys.executable
    from pyspark.sql import SparkSession

    import tilefold.spark

    session = SparkSession.builder.master("local-cluster[2,1,1024]").getOrCreate()

    def run(store, logs):
        return tilefold.spark.run(store, logs, spark=session, options=Options(groups=2))

    names = ["cold", *["warm"] * (repeats - 1)]
    results = [timed(f"spark, 2 executors, {name}", store, run) for name in names]
    session.stop()
    return results


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        store = Path(folder) / "store"
        local = lambda threads: lambda store, logs: tilefold.run(store, logs, threads=threads)
        results = [timed("local, 1 thread", store, local(1))]
        results += [timed("local, 2 threads", store, local(2)) for _ in range(2)]
        results += on_ray(1, store, 2) + on_ray(2, store, 3)
        results += on_spark(store, 2)
    digests = {(one["digest"], one["evidence_digest"]) for one in results}
    assert len(digests) == 1, digests
    Path(sys.argv[3]).write_text(json.dumps(results, indent=1) + "\n")


if __name__ == "__main__":
    main()
