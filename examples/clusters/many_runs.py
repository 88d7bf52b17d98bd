"""Measure a sweep of 640 runs on this machine: with the program on one and two threads, and on Dask.

    python many_runs.py
    python many_runs.py --speeds 10 --offsets 4

It needs the program `tiprub` on PATH (or its path in the environment variable TIPRUB), the module `tiprub` and its extra `dask`.
"""

import argparse
import os
import shutil
import subprocess
import tempfile
import time
from pathlib import Path

import distributed
import pandas
import tiprub

#: A rub of rotor 37 over 4 ms. Its blade has three contact nodes.
PLAN = """
scene = "builtin:rotor37-paper"
stop = 4e-3
[[variable]]
name = "speed"
values = {{ from = 1500, to = 1800, count = {speeds} }}
[[variable]]
name = "gap_offset"
values = {{ from = 0.0, to = 1e-4, count = {offsets} }}
"""
#: Columns that differ between equal runs.
TIMES = ["seconds", "stepping_seconds"]


def seconds(work):
    """Wall time of `work` (s)."""
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def main():
    options = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    options.add_argument("--speeds", type=int, default=40)
    options.add_argument("--offsets", type=int, default=16)
    given = options.parse_args()
    program = os.environ.get("TIPRUB") or shutil.which("tiprub") or options.error("no program `tiprub` on PATH")
    runs = given.speeds * given.offsets
    with tempfile.TemporaryDirectory() as place:
        plan = Path(place, "plan.toml")
        plan.write_text(PLAN.format(speeds=given.speeds, offsets=given.offsets))

        def swept(threads):
            words = [program, "--quiet", "sweep", plan, "--threads", str(threads), "-o", f"{place}/{threads}.parquet"]
            subprocess.run(words, check=True, stdout=subprocess.DEVNULL)

        # The first run reduces the model and makes the slow checks.
        subprocess.run([program, "--quiet", "sweep", plan, "--part", f"1/{runs}", "-o", f"{place}/first.parquet"], check=True, stdout=subprocess.DEVNULL)
        found = {"tiprub sweep --threads 1": seconds(lambda: swept(1)), "tiprub sweep --threads 2": seconds(lambda: swept(2))}
        with distributed.Client(n_workers=1, threads_per_worker=2, processes=False, dashboard_address=None) as client:
            options = {"runs_per_task": max(1, runs // 8), "quiet": True}
            wall = seconds(lambda: tiprub.sweep(plan, client, f"{place}/client", **options))
            found["tiprub.sweep with a client, an eighth of the runs per task"] = wall
        found["tiprub.sweep that starts a LocalCluster"] = seconds(lambda: tiprub.sweep(plan, None, f"{place}/own", quiet=True))
        tables = [pandas.read_parquet(f"{place}/{name}") for name in ("1.parquet", "2.parquet", "client", "own")]
        rows = [table.sort_values("run", ignore_index=True).drop(columns=TIMES) for table in tables]
        assert len(rows[0]) == runs and all(rows[0].equals(other) for other in rows[1:]), "the tables differ"
        print(f"{runs} runs, equal tables; a run takes {tables[0]['seconds'].median():.4f} s")
        slowest = next(iter(found.values()))
        for name, wall in found.items():
            print(f"{name}: {wall:.1f} s, {slowest / wall:.2f} times as fast as the first")


if __name__ == "__main__":
    main()
