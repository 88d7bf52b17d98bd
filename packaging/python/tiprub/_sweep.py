"""Sweeps on a cluster of dask.distributed."""

from __future__ import annotations

import asyncio
import contextlib
import glob
import importlib
import logging
import math
import os
import re
import shutil
import socket
import sys
import tempfile
import threading
import time
from concurrent.futures import CancelledError
from pathlib import Path
from typing import Any, Iterator, Optional, Sequence, Union

from ._program import Error, Report, call, place

#: Computing time of a task (s), unless the caller gives the number of its runs.
TASK_SECONDS = 10.0
#: Number of tasks per thread of the cluster that are made in any case, so that the threads finish at about the same time.
TASKS_PER_THREAD = 4
#: Number of runs that are measured to choose the number of runs of a task.
PILOT_RUNS = 3
#: Problem of a part that another process is working on, and the time (s) between two attempts to start it.
LOCKED, RETRY_SECONDS = "another process is working on this part", 0.5
#: Time (s) between two lines of progress.
PROGRESS_SECONDS = 5.0
#: Time (s) that a cluster without workers has to start one, before a line reports it.
WORKER_SECONDS = 3.0
#: File with the rows of the measured runs.
PILOT = "pilot.parquet"
#: Expression that is true if this module can be imported.
HAS_MODULE = "__import__('importlib.util').util.find_spec('tiprub') is not None"
#: Part that contains the last run of every plan and few others.
LAST_PART = "1000000/1000000"


def sweep(
    plan: Union[str, "os.PathLike[str]"],
    client: Any = None,
    output: Union[None, str, "os.PathLike[str]"] = None,
    *,
    runs_per_task: Optional[int] = None,
    quiet: bool = False,
) -> Report:
    """Run the plan of a sweep on a cluster of dask.distributed.

    Every task runs a part of the plan with `tiprub sweep --part` and writes one Parquet file. A task whose worker was killed is repeated
    on another worker, and continues with the runs that have no row yet. Call the function again to continue after the driver was killed.
    It requires `pip install distributed pyarrow`.

    Parameters
    ----------
    plan : path
        Plan (TOML). All workers need it and the files that it names under the same path.
    client : distributed.Client, distributed cluster or str
        Client, cluster, or address of a scheduler. By default, a LocalCluster with one thread per processor.
    output : path
        Directory for the results of this plan alone, shared by all workers. By default, it has the name of the plan without `.toml`, and is
        in the current directory even if the plan is in another one.
    runs_per_task : int
        Runs of a task. By default, a few runs are measured, and a task takes about ten seconds or a quarter of a thread's work.
    quiet : bool
        Suppress progress on stderr.

    Returns
    -------
    Report
        Numbers of `runs`, `finished`, `refused` and `failed` runs, `finished_before`, `runs_with_warnings`, `tasks`, `reasons`,
        `warning_counts`, `seconds`. Its `path` is the directory, a Parquet data set: `pandas.read_parquet(report)`. Outputs over time are in
        the directory `NAME-histories` beside it. A plan with `[histories]` keeps its unfinished parts in `NAME-unfinished` until they are
        complete.

    Raises
    ------
    Error
        The plan is wrong, a worker has another program or other files, or a file cannot be written. Rejected and failed runs are rows.
    """
    distributed, parquet = _package("distributed"), _package("pyarrow.parquet")
    if runs_per_task is not None and (not isinstance(runs_per_task, int) or isinstance(runs_per_task, bool) or runs_per_task < 1):
        raise Error("keyword `runs_per_task`", f"{runs_per_task!r} is not a number of runs", "Give 1 or more", 2)
    for what, path in (("plan", plan), ("keyword `output`", output)):
        if path is not None and not place(what, path):
            raise Error(what, "is an empty path", "Give the path of a file (`plan`) or directory (`output`)", 2)
    clock = time.monotonic()
    file = Path(place("plan", plan)).absolute()
    directory = Path(place("keyword `output`", output) if output is not None else file.stem).absolute()
    histories = directory.with_name(f"{directory.name}-histories")
    # The check writes a journal and reduced models beside its output.
    with tempfile.TemporaryDirectory() as elsewhere:
        check = call(["sweep", "--check", f"--part={LAST_PART}", f"--output={Path(elsewhere) / 'check.parquet'}"], [str(file)], quiet=True)
    task: dict[str, Any] = {"plan": str(file), "digest": check["digest"]}
    # The program writes outputs over time beside the rows, where Parquet readers would read them as rows. Both are therefore written to a third
    # directory, and moved when a part is complete. A plan without outputs over time may also use this directory, so finding the word suffices.
    unfinished = directory.with_name(f"{directory.name}-unfinished")
    uses_unfinished = unfinished.exists() or b"histories" in file.read_bytes()
    work = unfinished if uses_unfinished else directory
    new = [directory, histories, unfinished] if uses_unfinished else [directory]
    if uses_unfinished:
        task["targets"] = [str(directory), str(histories)]
    with _connected(distributed, client) as cluster, _created(*new):
        count = _known_parts([directory, histories, unfinished], file.stem)
        if uses_unfinished:
            _move_unfinished(directory, unfinished, file.stem)
        _check_workers(cluster, file.stem, quiet)
        threads = sum(cluster.nthreads().values())
        runs = check["plan_runs"]
        shared = max(1, runs // (TASKS_PER_THREAD * max(1, threads)))
        # A driver that was killed may leave measured runs, and the program that computes them.
        is_left = any(work.glob("pilot.parquet*"))
        pilot = None
        if is_left or (count is None and runs_per_task is None and shared > PILOT_RUNS):
            pilot, seconds = _pilot(cluster, task, work, runs, parquet)
            shared = min(shared, max(1, math.ceil(TASK_SECONDS / max(seconds, 1e-6))))
        if count is None and runs_per_task is None:
            runs_per_task = shared
        part_count = count if runs_per_task is None else math.ceil(runs / runs_per_task)
        if pilot is not None and count is None:
            # The first part contains all runs that were measured.
            part_count = max(1, min(part_count, runs // pilot["runs"]))
        if count not in (None, part_count):
            problem = f"contains, with {_beside(directory)}, results of this plan in {count} parts, but these runs per task give {part_count}"
            raise Error(str(directory), problem, "Leave out `runs_per_task`, or give another directory with `output`", 2)
        digits = len(str(part_count))
        parts = [f"{number}/{part_count}" for number in range(1, part_count + 1)]
        names = [f"{file.stem}-{number:0{digits}}-of-{part_count}.parquet" for number in range(1, part_count + 1)]
        files, outputs = ([str(parent / name) for name in names] for parent in (directory, work))
        for known in {directory: files, work: outputs}.values():
            _check_known_parts(known, parts, str(file), check["facts"], parquet)
        _adopt_pilot(work, outputs[0])
        answers = _gather(distributed, cluster, outputs, parts, task, file.stem, quiet)
        if uses_unfinished:
            # The directory is not empty while another driver runs the same plan.
            with contextlib.suppress(OSError):
                unfinished.rmdir()
    report = _sums(answers)
    if pilot is not None and count is None:
        # There were no other results. The first part may repeat these runs to store their outputs over time.
        report["finished_before"] = pilot["finished_before"]
    _equal_columns(files, parquet)
    _equal_columns(sorted(histories.glob(f"{glob.escape(file.stem)}-[0-9]*-of-*.histories.parquet")), parquet)
    report.update(plan=str(file), output=str(directory), tasks=part_count, seconds=time.monotonic() - clock)
    return Report(report, directory)


def _package(name: str) -> Any:
    """Import a package of the extra `dask`."""
    try:
        return importlib.import_module(name)
    except ImportError as error:
        raise Error("tiprub.sweep", f"needs a package that is missing: {error}", "Install it: pip install distributed pyarrow") from None


@contextlib.contextmanager
def _created(*directories: Path) -> Iterator[None]:
    """Create directories. At the end, remove those that are new and empty."""
    new = []
    try:
        for directory in directories:
            new += [path for path in (directory, *directory.parents) if not path.exists()][::-1]
            directory.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise Error(str(directory), f"cannot be written: {error}", "Give another directory with `output`") from None
    try:
        yield
    finally:
        for path in reversed(new):
            with contextlib.suppress(OSError):
                path.rmdir()


def _beside(directory: Path) -> str:
    """Return the names of the directories beside the results of a sweep, for messages."""
    return f"`{directory.name}-histories` and `{directory.name}-unfinished`"


def _move_unfinished(directory: Path, work: Path, stem: str) -> None:
    """Move journals and outputs over time that an earlier release, or an earlier form of the plan, wrote beside the rows."""
    try:
        for path in directory.glob(f"{glob.escape(stem)}-[0-9]*-of-*.parquet*"):
            if not re.fullmatch(r"-\d+-of-\d+\.parquet", path.name[len(stem):]):
                os.replace(path, work / path.name)
    except OSError as error:
        raise Error(str(work), f"cannot be written: {error}", "Give another directory with `output`") from None


@contextlib.contextmanager
def _connected(distributed: Any, client: Any) -> Iterator[Any]:
    """Return a client of the cluster; one that is created here is closed at the end."""
    remedy = "Give an open distributed.Client, a cluster, or the address of a scheduler"
    if getattr(client, "asynchronous", False):
        remedy = "Give a client or cluster that was created without `asynchronous=True`, or the address of its scheduler"
        raise Error("keyword `client`", f"{client!r} is asynchronous", remedy, 2)
    if isinstance(client, distributed.Client):
        if client.status not in ("running", "connecting"):
            raise Error("keyword `client`", f"{client!r} is {client.status}", remedy)
        with _report_closed_client(client):
            yield client
        return
    # The work takes place in processes of the program, so threads suffice for the workers.
    local: dict[str, Any] = {}
    if client is None:
        # Without an address, Dask would open port 8787, and warn if it is in use.
        address = {"dashboard_address": "127.0.0.1:0", "scheduler_kwargs": {"dashboard": False}}
        local = {"processes": False, "silence_logs": logging.CRITICAL, **address}
    try:
        own = distributed.Client(client, **local)
    except (OSError, RuntimeError, TypeError, ValueError) as error:
        raise Error("keyword `client`", f"there is no connection to {client!r}: {error}", remedy) from None
    with own, _report_closed_client(own):
        yield own


@contextlib.contextmanager
def _report_closed_client(cluster: Any) -> Iterator[None]:
    """Raise one error in place of those of Dask, if the client was closed or tasks were cancelled."""
    try:
        yield
    except Error:
        raise
    except Exception as error:
        if cluster.status == "running" and not isinstance(error, CancelledError):
            raise
        problem = "the client was closed, or lost its scheduler or its tasks, during the sweep"
        raise Error("keyword `client`", problem, "Keep the client and its cluster open, and call the function again to continue") from None


def _check_workers(cluster: Any, title: str, quiet: bool) -> None:
    """Check that the scheduler and the current workers can import this module. Without the module, tasks would wait forever."""
    try:
        # This is an expression, because workers without the module cannot receive its functions.
        places = {"scheduler": cluster.run_on_scheduler(eval, HAS_MODULE)}
        try:
            cluster.wait_for_workers(1, timeout=WORKER_SECONDS)
        except asyncio.TimeoutError:
            # This is no error: an adaptive cluster starts workers only for tasks.
            _print_progress(f"{title}: waiting for workers", quiet)
        places.update(cluster.run(eval, HAS_MODULE, on_error="return"))
    except OSError as error:
        raise Error("keyword `client`", f"the scheduler of {cluster!r} does not answer: {error}", "Start it again") from None
    lacking = [name for name, has_module in places.items() if has_module is not True]
    if lacking:
        more = f" and {len(lacking) - 1} more" if len(lacking) > 1 else ""
        remedy = "Install the same release of tiprub on the scheduler and all workers"
        raise Error(f"Dask, {lacking[0]}{more}", "cannot import the module `tiprub`", remedy)


def _print_progress(line: str, quiet: bool) -> None:
    if not quiet and sys.stderr is not None:
        print(line, file=sys.stderr)


def _known_parts(directories: Sequence[Path], stem: str) -> Optional[int]:
    """Return the number of parts of the results in directories; None if there are none. Other results in the first one are an error."""
    directory = directories[0]
    # Left by the check of an earlier release.
    for path in list(directory.glob("check.parquet.*")):
        _remove(path)
    own = re.compile(rf"(pilot|{re.escape(stem)}-\d+-of-(\d+))(\.histories)?\.parquet(\..+)?")
    for path in directory.rglob("*.parquet*"):
        name = path.relative_to(directory)
        # Readers of Parquet skip names with these first letters.
        is_hidden = any(part.startswith((".", "_")) for part in name.parts)
        if not is_hidden and not own.fullmatch(str(name)):
            problem = f"contains `{name}`, which is not a part of the plan `{stem}`"
            raise Error(str(directory), problem, "Give each plan a directory of its own with `output`", 2)
    names = (path.name for parent in directories for path in parent.glob("*.parquet*"))
    counts = {int(match[2]) for match in map(own.fullmatch, names) if match and match[2]}
    if len(counts) > 1:
        problem = f"contains, with {_beside(directory)}, results of this plan in {' and in '.join(map(str, sorted(counts)))} parts"
        raise Error(str(directory), problem, "Remove one of them, or give another directory with `output`", 2)
    return min(counts, default=None)


def _remove(path: Path) -> None:
    """Remove a file or directory, if it exists."""
    shutil.rmtree(path) if path.is_dir() else path.unlink(missing_ok=True)


def _pilot(cluster: Any, task: dict[str, str], directory: Path, runs: int, parquet: Any) -> tuple[dict[str, Any], float]:
    """Run and measure a few runs, whose results are in a file of their own. Return the answer, and the time of a run (s)."""
    output = str(directory / PILOT)
    future = cluster.submit(run_part, output, f"1/{max(1, runs // PILOT_RUNS)}", **task, pure=False)
    answer = _answer(future, output)
    # The first run may have made the slow checks at the start, which the others share.
    seconds = sorted(parquet.ParquetFile(output).read(["seconds"])["seconds"].to_pylist())
    return answer, seconds[len(seconds) // 2]


def _check_known_parts(files: Sequence[str], parts: Sequence[str], plan: str, facts: dict[str, str], parquet: Any) -> None:
    """Check that no part of an edited plan would replace finished runs, before the first part begins."""
    for path, part in zip(files, parts):
        if Path(path).exists():
            known = parquet.read_metadata(path).metadata or {}
            has_changed = any(known.get(name.encode()) != value.encode() for name, value in facts.items())
        else:
            has_changed = Path(f"{path}.journal").exists()
        if not has_changed:
            continue
        try:
            call(["sweep", "--check", f"--part={part}", f"--output={path}"], [plan], quiet=True)
        except Error as error:
            # The program of a worker that was killed completes its part.
            if error.problem != LOCKED:
                raise


def _adopt_pilot(directory: Path, first: str) -> None:
    """Make the runs that were measured, or begun, rows of the first part. Rows that the part already has are the same."""
    for end in (".parquet", ".parquet.journal", ".histories.parquet", ".parquet.histories-journal", ".parquet.models"):
        found, target = directory / f"pilot{end}", Path(first.removesuffix(".parquet") + end)
        if found.exists() and not target.exists() and end != ".histories.parquet":
            os.replace(found, target)
        _remove(found)


def run_part(output: str, part: str, plan: str, digest: str, targets: Optional[Sequence[str]] = None) -> Union[dict[str, Any], Error]:
    """Run a part of a plan on a worker. Returns an error instead of raising it: Dask would also print it.

    The files are moved to `targets`, the directories for rows and for outputs over time, when the part is complete.
    """
    for directory in (os.path.dirname(output), *(targets or ())):
        if not Path(directory).is_dir():
            problem = f"does not exist on the worker {socket.gethostname()}"
            return Error(directory, problem, "Give a directory with `output` that all workers share")
    words = ["sweep", "--threads=1", f"--part={part}", f"--digest={digest}", f"--output={output}"]
    while True:
        try:
            with _linked_results(output, targets):
                return call(words, [plan], quiet=True)
        except Error as error:
            # The program of a worker that was killed completes its part.
            if error.problem != LOCKED:
                return error
        time.sleep(RETRY_SECONDS)


@contextlib.contextmanager
def _linked_results(output: str, targets: Optional[Sequence[str]]) -> Iterator[None]:
    """Link the earlier results of a part from `targets` to `output`, where the program continues them; move the new files to `targets` if it succeeds.

    Readers of `targets` always find complete files.
    """
    if targets is None or Path(output).name == PILOT:
        yield
        return
    histories = Path(output).with_suffix(".histories.parquet")
    # Outputs over time come first: if it finds only rows, the program repeats their runs.
    pairs = [(Path(targets[1]) / histories.name, histories), (Path(targets[0]) / Path(output).name, Path(output))]
    try:
        for kept, file in pairs:
            if kept.exists() and not file.exists():
                _link(kept, file)
        try:
            yield
        except Error as error:
            if error.problem != LOCKED:
                for kept, file in pairs:
                    if kept.exists() and file.exists() and _is_copy(file, kept):
                        file.unlink()
            raise
        for kept, file in pairs:
            # Another driver may have moved the file.
            with contextlib.suppress(FileNotFoundError):
                file.unlink() if kept.exists() and _is_copy(file, kept) else os.replace(file, kept)
    except OSError as error:
        raise Error(output, f"cannot be moved: {error}", "Give another directory with `output`") from None


def _link(file: Path, link: Path) -> None:
    """Make a link to a file, or a copy if links are not supported."""
    try:
        os.link(file, link)
    except FileExistsError:
        # Another driver has made the link.
        pass
    except OSError:
        new = link.with_name(f".{link.name}.{os.getpid()}-{threading.get_ident()}")
        shutil.copy2(file, new)
        os.replace(new, link)


def _is_copy(file: Path, other: Path) -> bool:
    """Return whether a file is a link to another file, or an unchanged copy of it."""
    found, expected = file.stat(), other.stat()
    return (found.st_size, found.st_mtime_ns) == (expected.st_size, expected.st_mtime_ns)


def _answer(future: Any, output: str) -> dict[str, Any]:
    """Return the answer of a task that writes `output`."""
    try:
        answer = future.result()
    except CancelledError:
        raise
    except Exception as error:
        problem = f"a task failed: {type(error).__name__}: {error}"
        raise Error(output, problem, "Install the same release of tiprub on the scheduler and all workers, and see their logs") from None
    if isinstance(answer, Error):
        raise answer
    return answer


def _gather(
    distributed: Any, cluster: Any, files: Sequence[str], parts: Sequence[str], task: dict[str, str], title: str, quiet: bool
) -> list[dict[str, Any]]:
    """Run all parts and return their answers. After an error, no other task begins."""
    futures, answers, shown = [], [], time.monotonic()
    try:
        futures = cluster.map(run_part, files, parts, **task, pure=False)
        outputs = dict(zip(futures, files))
        for future in distributed.as_completed(futures):
            answers.append(_answer(future, outputs[future]))
            future.release()
            if time.monotonic() - shown >= PROGRESS_SECONDS or len(answers) == len(files):
                shown = time.monotonic()
                _print_progress(f"{title}: {len(answers)} of {len(files)} tasks are finished", quiet)
        return answers
    finally:
        if len(answers) < len(futures):
            # With a closed client, cancelling fails and would hide the first error.
            with contextlib.suppress(Exception):
                cluster.cancel(futures)


def _sums(answers: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Combine the answers of all parts."""
    numbers = ("runs", "finished", "refused", "failed", "finished_before", "runs_with_warnings")
    sums: dict[str, Any] = {key: sum(answer[key] for answer in answers) for key in numbers}
    for key, name in (("reasons", "reason"), ("warning_counts", "id")):
        counts: dict[str, dict[str, Any]] = {}
        for found in sorted((one for answer in answers for one in answer[key]), key=lambda one: one["first_run"]):
            counts.setdefault(found[name], {**found, "runs": 0})["runs"] += found["runs"]
        sums[key] = list(counts.values())
    return sums


def _equal_columns(files: Sequence[Union[str, Path]], parquet: Any) -> None:
    """Give all files the same columns: parts whose runs were all refused lack some."""
    arrow = _package("pyarrow")
    try:
        schemas = [parquet.read_schema(file) for file in files]
        plain = [schema.remove_metadata() for schema in schemas]
        common = arrow.unify_schemas(plain, promote_options="permissive") if plain else None
        for file, schema in zip(files, schemas):
            if not schema.equals(common):
                table = parquet.ParquetFile(file).read()
                columns = [table[field.name].cast(field.type) if field.name in schema.names else arrow.nulls(len(table), field.type)
                           for field in common]
                whole = arrow.Table.from_arrays(columns, schema=common.with_metadata(schema.metadata))
                # Parquet readers skip files whose names begin with a dot.
                new = Path(file).with_name(f".{Path(file).name}.new")
                parquet.write_table(whole, new)
                os.replace(new, file)
    except (OSError, ValueError) as error:
        raise Error(str(Path(files[0]).parent), f"results cannot be read: {error}", "Give a directory with `output` that all workers share") from None
