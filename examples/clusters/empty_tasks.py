"""Measure the time that Dask needs for tasks that do nothing, on this machine.

    python empty_tasks.py --tasks 100000
    python empty_tasks.py --tasks 1000 --runs-per-task 1000
"""

import argparse
import time

import distributed


def empty(number, runs):
    """Do nothing for each run, and return a number like that of a task of `tiprub.sweep`."""
    return sum(1 for _ in range(runs)) + number


def main():
    options = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    options.add_argument("--tasks", type=int, default=100_000)
    options.add_argument("--runs-per-task", type=int, default=1)
    options.add_argument("--workers", type=int, default=2)
    given = options.parse_args()
    local = {"n_workers": given.workers, "threads_per_worker": 1, "dashboard_address": None}
    with distributed.Client(**local) as client:
        client.wait_for_workers(given.workers)
        # The scheduler and this client share a process; the workers have their own.
        wall, processor = time.perf_counter(), time.process_time()
        futures = client.map(empty, range(given.tasks), runs=given.runs_per_task, pure=False)
        total = 0
        for future, answer in distributed.as_completed(futures, with_results=True):
            total += answer
            future.release()
        wall, processor = time.perf_counter() - wall, time.process_time() - processor
    assert total == given.tasks * given.runs_per_task + given.tasks * (given.tasks - 1) // 2
    print(f"{given.tasks} tasks of {given.runs_per_task} empty runs: {wall:.2f} s, {wall / given.tasks * 1e3:.3f} ms per task,")
    print(f"of which {processor / given.tasks * 1e3:.3f} ms are processor time of the scheduler and the client")


if __name__ == "__main__":
    main()
