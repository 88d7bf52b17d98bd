"""Sweeps on a cluster: `tiprub.sweep`, and the scripts of the guide for other engines."""

import asyncio
import contextlib
import math
import os
import shutil
import signal
import socket
import stat
import subprocess
import sys
import tempfile
import threading
import time
import warnings
from pathlib import Path

import dask
import distributed
import pandas
import pytest

from conftest import ROOT
from test_module import BLADE, MAP, MASS, POSITIONS, SCENE, STIFFNESS, module, refused

PROGRAM = os.environ["TIPRUB"]
PACKAGE = str(ROOT / "packaging" / "python")
#: Columns that differ between equal runs.
TIMES = ["seconds", "stepping_seconds"]
#: 40 runs, the last 20 of which are refused.
PLAN = """
scene = "scene.toml"
stop = {stop}
[[variable]]
name = "friction_coefficient"
values = [0.05, 3.0]
[[variable]]
name = "speed"
values = {{ from = 400, to = 500, count = 20 }}
"""


@pytest.fixture
def plan(tmp_path, monkeypatch):
    """The plan, with its scene and ROM, in the current directory."""
    monkeypatch.chdir(tmp_path)
    module.rom("blade.rom.safetensors", MASS, STIFFNESS, MAP, POSITIONS, **BLADE)
    Path("scene.toml").write_text(module._scene.toml(SCENE))
    return written(tmp_path / "plan.toml", 2e-3)


def written(path, stop):
    path.write_text(PLAN.format(stop=stop))
    return path


def whole(plan):
    """Results of the program without a cluster, without computing times."""
    file = plan.with_suffix(".whole.parquet")
    subprocess.run([PROGRAM, "--quiet", "sweep", plan, "-o", file], check=True, capture_output=True)
    return pandas.read_parquet(file).drop(columns=TIMES)


def journaled(directory):
    """Computing times of the runs in journals and files of parts, by digest. A running program may remove a file."""
    seconds = {}
    for journal in directory.glob("*.journal"):
        with contextlib.suppress(FileNotFoundError):
            for line in journal.read_text().split("\n")[1:-1]:
                cells = line.split("\t")
                seconds[cells[0]] = float(cells[cells.index("seconds") + 1][1:])
    for file in directory.glob("*-of-*[0-9].parquet"):
        with contextlib.suppress(FileNotFoundError):
            table = pandas.read_parquet(file)
            seconds.update(zip(table["digest"], table["seconds"]))
    return seconds


def wait_for_rows(directory, count, process=None):
    """Wait until so many runs are finished and a part is in progress."""
    deadline = time.monotonic() + 120
    while not (len(list(directory.glob("*.journal"))) > 0 and len(journaled(directory)) >= count):
        assert time.monotonic() < deadline and (process is None or process.poll() is None)
        time.sleep(0.01)


def kept_rows(known, report):
    """Check that rows that were finished before were not run again."""
    table = pandas.read_parquet(report)
    again = dict(zip(table["digest"], table["seconds"]))
    assert known and all(again[digest] == seconds for digest, seconds in known.items())


def test_cluster_gives_the_table_of_the_program(plan, capfd):
    report = module.sweep(plan, quiet=True, runs_per_task=6)
    assert capfd.readouterr() == ("", "")
    assert report.path == plan.with_suffix("") and (report["runs"], report["tasks"], report["finished_before"]) == (40, 7, 0)
    assert (report["finished"], report["refused"], report["failed"]) == (20, 20, 0)
    assert [(one["first_run"], one["runs"]) for one in report["reasons"]] == [(21, 20)] and "friction" in report["reasons"][0]["reason"]
    expected = whole(plan)
    results = pandas.read_parquet(report)
    warned = results["warnings"].dropna()
    assert report["runs_with_warnings"] == len(warned)
    counts = {one["id"]: one["runs"] for one in report["warning_counts"]}
    assert counts == warned.str.split(", ").explode().value_counts().to_dict()
    assert results.drop(columns=TIMES).equals(expected)
    # The last parts contain only refused runs, and have the same columns as the others.
    assert len(list(report.path.iterdir())) == 7

    import duckdb
    import polars
    assert polars.read_parquet(report.path)["digest"].to_list() == list(expected["digest"])
    forces = duckdb.sql(f"select largest_total_normal_force from '{report.path}/*.parquet' order by run").fetchall()
    assert [force for (force,) in forces if force is not None] == list(expected["largest_total_normal_force"].dropna())

    again = module.sweep(plan, quiet=True)
    assert (again["finished_before"], again["tasks"]) == (40, 7) and pandas.read_parquet(again).equals(results)
    # The plan becomes longer, and then has fewer runs than parts. No part replaces finished runs, and none begins.
    text, before = plan.read_text(), {file: file.read_bytes() for file in report.path.iterdir()}
    for changes, runs in ((("3.0]", "3.0, 4.0]"), 60), (("20 }", "2 }"), 4)):
        plan.write_text(text.replace(*changes))
        with pytest.raises(module.Error, match="runs that this part does not have"):
            module.sweep(plan, quiet=True)
        assert {file: file.read_bytes() for file in report.path.iterdir()} == before
        other = module.sweep(plan, output=f"{runs}_runs", quiet=True, runs_per_task=math.ceil(runs / 7))
        assert other["runs"] == runs and len(pandas.read_parquet(other)) == runs


def test_number_of_runs_of_a_task_is_measured(plan, monkeypatch):
    monkeypatch.setenv("TIPRUB_CACHE", str(plan.parent / "cache"))
    with distributed.Client(processes=False, n_workers=1, threads_per_worker=2, dashboard_address=None) as client:
        report = module.sweep(plan, client, "measured", quiet=True)
        with_histories = plan.with_name("with_histories.toml")
        with_histories.write_text(plan.read_text() + '[histories]\noutputs = ["torque"]\n')
        assert module.sweep(with_histories, client, quiet=True)["finished_before"] == 0
    # A quarter of the work of a thread.
    assert (report["runs"], report["tasks"], report["finished_before"]) == (40, 8, 0)
    assert list((plan.parent / "cache").glob("scene-*.checks")), "the next part starts with the slow checks of this one"
    assert pandas.read_parquet(report).drop(columns=TIMES).equals(whole(plan))


def test_histories_are_a_data_set_of_their_own(plan):
    plan.write_text(plan.read_text() + '[histories]\noutputs = ["torque"]\nevery = 10\n')
    for before in (0, 40):
        report = module.sweep(plan, quiet=True, runs_per_task=10)
        assert not list(report.path.glob("*histories*"))
        assert report["finished_before"] == before and len(pandas.read_parquet(report)) == 40
        histories = pandas.read_parquet(plan.with_name("plan-histories"))
        assert sorted(set(histories["run"])) == list(range(1, 21)) and list(histories.columns) == ["run", "time", "torque"]


def test_errors_and_interrupts_leave_only_rows_in_the_directory(plan, monkeypatch):
    plan.write_text(plan.read_text() + '[histories]\noutputs = ["torque"]\nevery = 10\n')
    report = module.sweep(plan, quiet=True, runs_per_task=10)
    both = [report.path, plan.with_name("plan-histories")]
    before = [pandas.read_parquet(directory) for directory in both]
    usual = module._sweep.call

    def failing(error):
        def call(words, files, quiet):
            if "--part=2/4" in words and "--check" not in words:
                raise error
            return usual(words, files, quiet)
        return call

    monkeypatch.setattr(module._sweep, "call", failing(module.Error("part 2", "fails", "Repair it")))
    assert refused(module.sweep, plan, quiet=True).what == "part 2"
    assert all(pandas.read_parquet(directory).equals(table) for directory, table in zip(both, before))
    monkeypatch.setattr(module._sweep, "call", usual)

    def interrupted(futures):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(distributed, "as_completed", interrupted)
        with pytest.raises(KeyboardInterrupt):
            module.sweep(plan, quiet=True)
    assert all(pandas.read_parquet(directory).equals(table) for directory, table in zip(both, before))
    # Files as an earlier release left them after a sweep was killed.
    for file in both[1].iterdir():
        os.replace(file, both[0] / file.name)
    assert module.sweep(plan, quiet=True)["finished_before"] == 40
    assert all(pandas.read_parquet(directory).equals(table) for directory, table in zip(both, before))
    assert not plan.with_name("plan-unfinished").exists()


@pytest.mark.skipif(os.name == "nt", reason="no such signals there")
def test_killed_driver_leaves_only_rows_in_the_directory(plan):
    written(plan, 0.1)
    plan.write_text(plan.read_text() + '[histories]\noutputs = ["torque"]\nevery = 100\n')
    directory, unfinished = plan.with_suffix(""), plan.with_name("plan-unfinished")
    code = f"import sys; sys.path.insert(0, {PACKAGE!r}); import tiprub; tiprub.sweep('plan.toml', runs_per_task=4)"
    with subprocess.Popen([sys.executable, "-c", code], stderr=subprocess.DEVNULL) as driver:
        while not list(directory.glob("*.parquet")):
            assert driver.poll() is None
            time.sleep(0.01)
        wait_for_rows(unfinished, 1, driver)
        driver.kill()
    rows = pandas.read_parquet(directory)
    assert 0 < len(rows) < 40 and rows["run"].is_unique and list(rows.columns)[:2] == ["run", "friction_coefficient"]
    known = {**journaled(directory), **journaled(unfinished)}
    report = module.sweep(plan, quiet=True)
    assert (report["runs"], report["tasks"]) == (40, 10) and report["finished_before"] >= len(known)
    kept_rows(known, report)
    histories = pandas.read_parquet(plan.with_name("plan-histories"))
    assert sorted(set(histories["run"])) == list(range(1, 21)) and list(histories.columns) == ["run", "time", "torque"]
    assert not unfinished.exists()


def test_parts_without_finished_runs_have_all_columns(plan):
    text = plan.read_text().replace("[0.05, 3.0]", "[3.0, 0.05]")
    plan.write_text(text + '[histories]\noutputs = ["torque"]\nevery = 10\n')
    for before in (0, 40):
        report = module.sweep(plan, quiet=True, runs_per_task=10)
        assert report["finished_before"] == before and (report["refused"], report["finished"]) == (20, 20)
        histories = pandas.read_parquet(plan.with_name("plan-histories"))
        assert sorted(set(histories["run"])) == list(range(21, 41)) and list(histories.columns) == ["run", "time", "torque"]
        assert histories["torque"].notna().all() and pandas.read_parquet(report)["largest_total_normal_force"].notna().sum() == 20


def test_directory_contains_one_plan(plan):
    report = module.sweep(plan, output="results", runs_per_task=20, quiet=True)
    other = written(plan.with_name("other.toml"), 1e-3)
    # Readers of Parquet also read the directories in a directory.
    for directory in (report.path, report.path.parent):
        error = refused(module.sweep, other, output=directory, runs_per_task=20)
        assert (error.what, error.exit_code) == (str(directory), 2) and "plan-1-of-2.parquet" in error.problem
    assert len(pandas.read_parquet(report)) == 40 and len(list(report.path.iterdir())) == 2
    # Another plan was interrupted.
    interrupted = plan.with_name("interrupted")
    interrupted.mkdir()
    (interrupted / "plan-1-of-2.parquet.journal").touch()
    assert "plan-1-of-2.parquet.journal" in refused(module.sweep, other, output=interrupted).problem
    assert module.sweep(plan, output=interrupted, quiet=True)["tasks"] == 2


def test_plan_of_the_same_name_keeps_its_results(plan, tmp_path):
    report = module.sweep(plan, output="results", runs_per_task=20, quiet=True)
    before = pandas.read_parquet(report)
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    for name in ("scene.toml", "blade.rom.safetensors"):
        shutil.copy(tmp_path / name, elsewhere)
    other = written(elsewhere / plan.name, 1e-3)
    error = refused(module.sweep, other, output=report.path)
    assert "results of another plan that is also named `plan`" in error.problem
    assert pandas.read_parquet(report).equals(before)


def test_histories_of_other_parts_are_not_mixed(plan):
    plan.write_text(plan.read_text() + '[histories]\noutputs = ["torque"]\nevery = 10\n')
    report = module.sweep(plan, quiet=True, runs_per_task=20)
    for file in report.path.iterdir():
        file.unlink()
    error = refused(module.sweep, plan, runs_per_task=10)
    assert "`plan-histories`" in error.problem and "2 parts" in error.problem
    assert module.sweep(plan, quiet=True)["finished_before"] == 0


def test_check_leaves_no_files(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("plan.toml").write_text("""
        scene = "builtin:rotor37-one-row"
        stop = 1e-4
        rom.rotor.reduce = "rotor37 --contact-nodes 3"
        [[variable]]
        name = "speed"
        values = [1600, 1700]
    """)
    # Files of an earlier release, and of runs that were measured and then killed.
    for name in ("check", "pilot"):
        models = tmp_path / "plan" / f"{name}.parquet.models"
        models.mkdir(parents=True)
        (models / "model-0.rom").touch()
    (tmp_path / "plan" / "check.parquet.journal").touch()
    report = module.sweep("plan.toml", quiet=True, runs_per_task=2)
    assert [file.name for file in report.path.iterdir()] == ["plan-1-of-1.parquet"]
    assert list(pandas.read_parquet(report)["status"]) == ["finished"] * 2

    def interrupted(words, *_, **__):
        (output,) = (word.removeprefix("--output=") for word in words if word.startswith("--output="))
        Path(f"{output}.journal").touch()
        raise KeyboardInterrupt

    monkeypatch.setattr(module._sweep, "call", interrupted)
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(temporary))
    with pytest.raises(KeyboardInterrupt):
        module.sweep("plan.toml", output=report)
    assert not list(temporary.iterdir()) and len(list(report.path.iterdir())) == 1


def test_wait_for_workers_is_reported(plan, capfd, monkeypatch):
    monkeypatch.setattr(module._sweep, "WORKER_SECONDS", 0.3)
    for quiet in (False, True):
        options = dict(n_workers=0, processes=False, dashboard_address=":0", silence_logs=50)
        with distributed.LocalCluster(**options) as cluster, distributed.Client(cluster) as client:
            later = threading.Timer(1.0, cluster.scale, [1])
            later.start()
            report = module.sweep(plan, client, output=f"results-{quiet}", quiet=quiet, runs_per_task=20)
            later.join()
        assert report["finished"] == 20
        lines = capfd.readouterr().err.splitlines()
        assert lines == ([] if quiet else ["plan: waiting for workers", "plan: 2 of 2 tasks are finished"])


def test_lost_scheduler_is_an_error(plan):
    with dask.config.set({"distributed.comm.timeouts.connect": "1s"}):
        with distributed.LocalCluster(n_workers=0, processes=False, protocol="tcp://", dashboard_address=":0", silence_logs=50) as cluster:
            client = distributed.Client(cluster.scheduler_address)
        with client:
            error = refused(module.sweep, plan, client, output="new/results")
    assert error.what == "keyword `client`" and not Path("new").exists()


@pytest.mark.parametrize("closed", ["client", "cluster"])
def test_client_that_is_closed_during_the_sweep_is_an_error(plan, closed):
    written(plan, 1.0)
    options = dict(n_workers=1, threads_per_worker=1, processes=False, dashboard_address=None, silence_logs=50)
    with distributed.LocalCluster(**options) as cluster, distributed.Client(cluster) as client:
        def close():
            wait_for_rows(plan.with_suffix(""), 1)
            (client if closed == "client" else cluster).close()

        closing = threading.Thread(target=close)
        closing.start()
        error = refused(module.sweep, plan, client if closed == "client" else cluster, runs_per_task=4, quiet=True)
        closing.join()
    assert error.what == "keyword `client`" and "was closed" in error.problem and "again" in error.remedy
    assert journaled(plan.with_suffix("")), "the rows are kept"


def test_asynchronous_clients_are_rejected(plan):
    async def sweep():
        options = dict(processes=False, n_workers=0, asynchronous=True, dashboard_address=None)
        async with distributed.LocalCluster(**options) as cluster, distributed.Client(cluster, asynchronous=True) as client:
            return [refused(module.sweep, plan, one, output="new/results") for one in (client, cluster)]

    with warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)
        errors = asyncio.run(sweep())
    assert all(error.what == "keyword `client`" and "asynchronous" in error.remedy for error in errors)
    assert not Path("new").exists()


def test_own_cluster_warns_of_no_port_in_use(plan):
    with socket.socket() as other, warnings.catch_warnings():
        other.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            other.bind(("", 8787))
            other.listen()
        except OSError:
            pass  # Another program uses the port.
        warnings.simplefilter("error", UserWarning)
        assert module.sweep(plan, quiet=True, runs_per_task=40)["finished"] == 20


@pytest.mark.skipif(os.name == "nt", reason="no such signals there")
def test_killed_worker_loses_no_run(plan):
    written(plan, 0.1)
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None, silence_logs=50) as cluster:
        with distributed.Client(cluster) as client:
            first, _ = client.run(os.getpid).values()
            directory = plan.with_suffix("")
            known = {}

            def kill():
                wait_for_rows(directory, 3)
                os.kill(first, signal.SIGKILL)
                known.update(journaled(directory))

            with distributed.worker.ThreadPoolExecutor(1) as pool:
                killing = pool.submit(kill)
                report = module.sweep(plan, client, runs_per_task=10, quiet=True)
                killing.result()
            assert first not in client.run(os.getpid).values()
    assert (report["runs"], report["finished"], report["refused"]) == (40, 20, 20)
    kept_rows(known, report)
    assert pandas.read_parquet(report).drop(columns=TIMES).equals(whole(plan))


@pytest.mark.skipif(os.name == "nt", reason="no such signals there")
def test_killed_driver_continues(plan):
    written(plan, 0.1)
    code = f"import sys; sys.path.insert(0, {PACKAGE!r}); import tiprub; tiprub.sweep('plan.toml', runs_per_task=4)"
    with subprocess.Popen([sys.executable, "-c", code], stderr=subprocess.DEVNULL) as driver:
        wait_for_rows(plan.with_suffix(""), 6, driver)
        driver.kill()
    known = journaled(plan.with_suffix(""))
    assert len(known) < 40, "there is work left"
    report = module.sweep(plan, quiet=True)
    assert (report["runs"], report["tasks"], report["finished"]) == (40, 10, 20) and report["finished_before"] >= len(known)
    kept_rows(known, report)
    assert pandas.read_parquet(report).drop(columns=TIMES).equals(whole(plan))


@pytest.mark.parametrize("options", [{"runs_per_task": 1}, {}])
def test_runs_that_a_killed_driver_measured_are_kept(plan, options):
    """The program that measures runs outlives the driver, and still computes them when the sweep continues."""
    written(plan, 0.1)
    directory = plan.with_suffix("")
    directory.mkdir()
    words = [PROGRAM, "--quiet", "sweep", plan, "--threads=1", "--part=1/13", "-o", directory / "pilot.parquet"]
    with subprocess.Popen(words, stdout=subprocess.DEVNULL) as measuring:
        while not list(directory.glob("pilot*")):
            assert measuring.poll() is None
            time.sleep(0.01)
        with distributed.Client(processes=False, n_workers=1, threads_per_worker=4, dashboard_address=None) as client:
            report = module.sweep(plan, client, quiet=True, **options)
        assert measuring.wait() == 0
    results = pandas.read_parquet(report)
    assert list(results["run"]) == list(range(1, 41)) and results.drop(columns=TIMES).equals(whole(plan))
    # No task is smaller than the part with the measured runs, so none of them is repeated.
    assert report["tasks"] == 13 if options else report["tasks"] <= 13
    assert not list(directory.glob("pilot*"))


def test_workers_reject_other_programs_and_files(plan, capfd, tmp_path):
    other = tmp_path / "other"
    other.write_bytes(Path(PROGRAM).read_bytes() + b"\n")
    other.chmod(other.stat().st_mode | stat.S_IEXEC)
    with distributed.Client(n_workers=1, threads_per_worker=1, dashboard_address=None, silence_logs=50) as client:
        client.run(use_program, str(other))
        error = refused(module.sweep, plan, client, runs_per_task=10)
        assert error.what == str(plan) and "differs" in error.problem and "same release" in error.remedy
        client.run(use_program, PROGRAM)
        assert not plan.with_suffix("").exists(), "nothing was run"
        gone = refused(lambda: client.submit(raised, client.submit(module._sweep.run_part, "/none/a", "1/1", "plan.toml", "")).result())
        assert "does not exist" in gone.problem
    for name in ("plan.toml", "scene.toml", "blade.rom.safetensors"):
        digest = module.call(["sweep", "--check"], [str(plan)], quiet=True)["digest"]
        before = Path(name).read_bytes()
        Path(name).write_bytes(before + b" ")
        answer = module._sweep.run_part(str(tmp_path / "a.parquet"), "1/4", str(plan), digest)
        assert isinstance(answer, module.Error) and "differs" in answer.problem, name
        Path(name).write_bytes(before)
        assert module._sweep.run_part(str(tmp_path / "a.parquet"), "1/4", str(plan), digest)["runs"] == 10
    assert capfd.readouterr().err == ""


def test_worker_without_the_module_is_an_error(plan, tmp_path):
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    options = dict(n_workers=0, processes=False, protocol="tcp://", dashboard_address=None)
    with distributed.LocalCluster(**options) as cluster, distributed.Client(cluster) as client:
        words = ["-m", "distributed.cli.dask_worker", cluster.scheduler_address, "--no-nanny", "--no-dashboard"]
        place = tmp_path / "elsewhere"
        place.mkdir()
        with subprocess.Popen([sys.executable, *words], env=environment, cwd=place, stderr=subprocess.DEVNULL) as worker:
            try:
                client.wait_for_workers(1, timeout=60)
                with pytest.raises(module.Error) as error:
                    module.sweep(plan, client, quiet=True)
                assert "cannot import the module" in error.value.problem
            finally:
                worker.terminate()
    assert not plan.with_suffix("").exists()


def use_program(path):
    os.environ["TIPRUB"] = path


def raised(error):
    raise error


def test_errors_are_reported_once_and_print_nothing(plan, capfd, monkeypatch):
    assert "none.toml" in refused(module.sweep, "none.toml").what
    assert refused(module.sweep, "").what == "plan" and refused(module.sweep, plan, output="").what == "keyword `output`"
    plan.write_text(plan.read_text().replace('"speed"', '"sped"'))
    assert "speed" in refused(module.sweep, plan).remedy
    written(plan, 2e-3)
    for wrong in (0, 1.5, True, "all"):
        assert refused(module.sweep, plan, runs_per_task=wrong).what == "keyword `runs_per_task`"
    options = dict(n_workers=0, processes=False, dashboard_address=":0", silence_logs=50)
    with distributed.LocalCluster(**options) as closed_cluster, distributed.Client(closed_cluster) as closed:
        pass
    before = set(plan.parent.iterdir())
    for wrong in ("nonsense", 3, closed, closed_cluster):
        assert refused(module.sweep, plan, wrong, output="new/results").what == "keyword `client`"
    assert set(plan.parent.iterdir()) == before, "no directory was created"
    module.sweep(plan, runs_per_task=10, quiet=True)
    error = refused(module.sweep, plan, runs_per_task=20)
    assert error.exit_code == 2 and "4 parts" in error.problem
    assert refused(module.sweep, plan, output="scene.toml").what.endswith("scene.toml")
    monkeypatch.setitem(sys.modules, "distributed", None)
    assert "pip install distributed pyarrow" in refused(module.sweep, plan).remedy
    assert capfd.readouterr() == ("", "")


def test_dask_is_imported_only_for_sweeps():
    code = f"import sys; sys.path.insert(0, {PACKAGE!r}); import tiprub; print({{'dask', 'distributed', 'pyarrow'}} & set(sys.modules))"
    answer = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "distributed" not in answer.stdout and "dask" not in answer.stdout


def samples(page, language):
    """Samples of a page of the guide in this language."""
    return [part.split("```")[0] for part in (ROOT / "docs" / page).read_text().split(f"```{language}\n")[1:]]


def test_plans_of_the_guide_run(tmp_path, monkeypatch):
    """The plan with a reduction uses the scene of the first plan. It has fewer runs and steps here."""
    monkeypatch.chdir(tmp_path)
    first, reduced = samples("sweeps.md", "toml")
    head = first.split("[set]")[0].replace("stop = 0.001 ", "stop = 0.0005 ")
    Path("first.toml").write_text(first.replace("stop = 0.001 ", "stop = 0.0005 "))
    Path("reduced.toml").write_text(head + reduced.replace("[20, 40, 80]", "[10, 20]"))
    for name, runs, finished in (("first", 12, 8), ("reduced", 2, 2)):
        subprocess.run([PROGRAM, "--quiet", "sweep", f"{name}.toml"], check=True, capture_output=True)
        results = pandas.read_parquet(f"{name}.parquet")
        assert len(results) == runs and sum(results["status"] == "finished") == finished, results["reason"].dropna().unique()


def test_values_with_only_refused_runs_can_be_removed(plan):
    assert module.sweep(plan, runs_per_task=40, quiet=True)["refused"] == 20
    text = plan.read_text()
    plan.write_text(text.replace("[0.05, 3.0]", "[0.05]"))
    report = module.sweep(plan, quiet=True)
    assert (report["runs"], report["finished"], report["finished_before"]) == (20, 20, 20) and len(pandas.read_parquet(report)) == 20
    plan.write_text(text.replace("[0.05, 3.0]", "[3.0]"))
    assert "20 runs" in refused(module.sweep, plan).problem


@pytest.fixture
def engines(plan, monkeypatch):
    """The plan, with the program on PATH and the digest in the environment, as the scripts of the guide expect it."""
    (plan.parent / "bin").mkdir()
    (plan.parent / "bin" / "tiprub").symlink_to(PROGRAM)
    monkeypatch.setenv("PATH", os.pathsep.join([str(plan.parent / "bin"), str(Path(sys.executable).parent), os.environ["PATH"]]))
    command = samples("clusters.md", "bash")[0] + 'printf %s "$DIGEST"'
    monkeypatch.setenv("DIGEST", subprocess.run(["bash", "-ec", command], check=True, capture_output=True, text=True).stdout)
    assert len(os.environ["DIGEST"]) == 64
    return plan


def joined(directory):
    return pandas.concat(map(pandas.read_parquet, sorted(directory.glob("*.parquet"))), ignore_index=True)


def same_rows(found, plan):
    """Parts without a finished run lack columns."""
    expected = whole(plan)
    assert found.reindex(columns=expected.columns).sort_values("run", ignore_index=True).equals(expected)


@pytest.mark.skipif(os.name == "nt", reason="no bash there")
def test_slurm_script_runs_a_part(engines):
    """Slurm is not here: the body of the script runs once for every element of the array."""
    Path("sweep.slurm").write_text(samples("clusters.md", "bash")[1].replace("PARTS=1000", "PARTS=4"))
    for number in range(1, 5):
        environment = {**os.environ, "SLURM_ARRAY_TASK_ID": str(number)}
        subprocess.run(["bash", "sweep.slurm"], env=environment, check=True, capture_output=True)
    same_rows(joined(Path("results")), engines)
    # A node with another scene does nothing.
    Path("scene.toml").write_text(Path("scene.toml").read_text() + "\n")
    environment = {**os.environ, "SLURM_ARRAY_TASK_ID": "1"}
    answer = subprocess.run(["bash", "sweep.slurm"], env=environment, capture_output=True, text=True)
    assert answer.returncode == 1 and "differs" in answer.stderr


@pytest.mark.skipif(os.name == "nt", reason="no bash there")
def test_snakefile_runs_all_parts(engines):
    (snakefile,) = samples("clusters.md", "python snakemake")
    Path("Snakefile").write_text(snakefile.replace("PARTS = 1000", "PARTS = 4"))
    command = ["snakemake", "--cores", "2", "--config", f"digest={os.environ['DIGEST']}"]
    subprocess.run(command, check=True, capture_output=True)
    same_rows(joined(Path("results")), engines)
    again = subprocess.run(command, check=True, capture_output=True, text=True)
    assert "Nothing to be done" in again.stdout + again.stderr


@pytest.mark.skipif(os.name == "nt", reason="no bash there")
def test_hyperqueue_script_runs_all_parts(engines):
    """The program `hq` is not on PyPI, but its server, its workers and their variables are."""
    script = samples("clusters.md", "bash")[2]
    Path("sweep.sh").write_text(script.replace("PARTS=1000", "PARTS=4"))
    code = """
import os
from hyperqueue import Job, LocalCluster
from hyperqueue.cluster import WorkerConfig
with LocalCluster(worker_config=WorkerConfig(cores=2)) as cluster:
    client, job = cluster.client(), Job()
    job.program(["true"])  # has the number 0
    for _ in range(4):
        job.program(["bash", "sweep.sh"], cwd=".", env={"DIGEST": os.environ["DIGEST"]})
    assert client.wait_for_jobs([client.submit(job)])
"""
    subprocess.run([sys.executable, "-c", code], check=True, capture_output=True)
    same_rows(joined(Path("results")), engines)


def test_empty_tasks_cost_little(tmp_path):
    answer = subprocess.run([sys.executable, ROOT / "examples" / "clusters" / "empty_tasks.py", "--tasks", "1000"],
                            capture_output=True, text=True, check=True)
    assert "1000 tasks" in answer.stdout


def test_script_measures_runs_with_equal_tables():
    script = [sys.executable, ROOT / "examples" / "clusters" / "many_runs.py", "--speeds", "3", "--offsets", "2"]
    answer = subprocess.run(script, env={**os.environ, "PYTHONPATH": PACKAGE}, capture_output=True, text=True, check=True)
    assert answer.stdout.startswith("6 runs, equal tables") and answer.stdout.count("times as fast") == 4


def test_designs_of_experiments_of_the_guide(tmp_path, monkeypatch):
    """The samples of the guide, with an eighth of the runs."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(sys.modules, "tiprub", module)
    space = {}
    for sample in samples("sweeps.md", "python"):
        exec(sample.replace("256", "32"), space)  # noqa: S102
    space["salib"] = space["indices"]["ST"]
    ranks, salib, openturns = (dict(zip(space["bounds"], space[name])) for name in ("ranks", "salib", "total_indices"))
    for found in (salib, openturns):
        assert found["gap_offset"] > found["friction_coefficient"] > 0.1 > found["damping_ratio"]
    assert ranks["gap_offset"] < ranks["friction_coefficient"] < -0.3 < ranks["damping_ratio"]
    assert len(pandas.read_parquet("salib")) == 32 * 6
