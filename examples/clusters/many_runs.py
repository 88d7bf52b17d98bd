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

#: Plan of the sweep: a rub of rotor 37 over 4 ms, with three contact nodes per blade.
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
    """Return the wall time of a call of `work` (s)."""
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--speeds", type=int, default=40, help="number of speeds [default: 40]")
    parser.add_argument("--offsets", type=int, default=16, help="number of clearances [default: 16]")
    arguments = parser.parse_args()
    program = os.environ.get("TIPRUB") or shutil.which("tiprub")
    if not program:
        parser.error("no program `tiprub` on PATH. Install tiprub, or set TIPRUB to the path of the program")
    runs = arguments.speeds * arguments.offsets
    with tempfile.TemporaryDirectory() as place:
        plan = Path(place, "plan.toml")
        plan.write_text(PLAN.format(speeds=arguments.speeds, offsets=arguments.offsets))

        def run_sweep(threads):
            words = [program, "--quiet", "sweep", plan, "--threads", str(threads), "-o", f"{place}/{threads}.parquet"]
            subprocess.run(words, check=True, stdout=subprocess.DEVNULL)

        # This run reduces the model and does the slow checks, whose results are cached.
        subprocess.run([program, "--quiet", "sweep", plan, "--part", f"1/{runs}", "-o", f"{place}/first.parquet"], check=True, stdout=subprocess.DEVNULL)
        times = {"tiprub sweep --threads 1": seconds(lambda: run_sweep(1)), "tiprub sweep --threads 2": seconds(lambda: run_sweep(2))}
        with distributed.Client(n_workers=1, threads_per_worker=2, processes=False, dashboard_address=None) as client:
            options = {"runs_per_task": max(1, runs // 8), "quiet": True}
            wall = seconds(lambda: tiprub.sweep(plan, client, f"{place}/client", **options))
            times["tiprub.sweep with a client, an eighth of the runs per task"] = wall
        times["tiprub.sweep that starts a LocalCluster"] = seconds(lambda: tiprub.sweep(plan, None, f"{place}/own", quiet=True))
        tables = [pandas.read_parquet(f"{place}/{name}") for name in ("1.parquet", "2.parquet", "client", "own")]
        rows = [table.sort_values("run", ignore_index=True).drop(columns=TIMES) for table in tables]
        assert len(rows[0]) == runs and all(rows[0].equals(other) for other in rows[1:]), "the tables differ"
        print(f"{runs} runs, equal tables; a run takes {tables[0]['seconds'].median():.4f} s")
        first = next(iter(times.values()))
        for name, wall in times.items():
            print(f"{name}: {wall:.1f} s, {first / wall:.2f} times as fast as the first")


if __name__ == "__main__":
    main()
