"""Packages built-in scenes, runs them without FMI, and writes a table with one line per test."""

import csv
import os
import subprocess
from pathlib import Path
from types import SimpleNamespace

import pytest

TARGET = Path(os.environ["TIPRUB_TARGET"])
LIBRARIES = Path(os.environ.get("TIPRUB_LIBRARIES", TARGET / "libraries"))
TIPRUB = os.environ["TIPRUB"]
STEP = 1e-5
STEPS = 200
OUTPUTS = ["torque", "clearance_minimum", "blade[1].clearance[2]", "blade[1].normal_force[2]", "friction_loss"]

found = []


@pytest.fixture
def record(request):
    """Add a line to the table: record(tool, version, fmi, result)."""

    def line(tool, version, fmi, result):
        found.append((tool, version, fmi, result))

    return line


def pytest_sessionfinish():
    if found:
        lines = ["| tool | version | FMI | result |", "|---|---|---|---|"]
        lines += ["| " + " | ".join(row) + " |" for row in sorted(found)]
        (TARGET / "importers.md").write_text("\n".join(lines) + "\n")


def tiprub(*arguments):
    subprocess.run([TIPRUB, *map(str, arguments)], check=True, capture_output=True)


@pytest.fixture(scope="session")
def paper(tmp_path_factory):
    """The paper's rotor 37 with three nodes: an FMI 2.0 FMU, FMI 3.0 FMUs with scalars and with arrays, and the run without FMI."""
    work = tmp_path_factory.mktemp("paper")
    files = SimpleNamespace(two=work / "two.fmu", three=work / "three.fmu", arrays=work / "arrays.fmu")
    for file, options in ((files.two, ["2"]), (files.three, ["3"]), (files.arrays, ["3", "--arrays"])):
        tiprub("package", "builtin:rotor37-paper", "--library", LIBRARIES, "-o", file, "--fmi", *options)
    table = work / "native.csv"
    stop = repr(STEP * STEPS)
    tiprub("run", "builtin:rotor37-paper", "--step", repr(STEP), "--stop", stop, "--csv", table)
    with table.open(newline="") as file:
        header, *rows = list(csv.reader(file))
    assert len(rows) == STEPS + 1
    last = dict(zip(header, map(float, rows[-1])))
    assert last["friction_loss"] > 0.0, "the blade rubs"
    files.native = {name: [float(row[header.index(name)]) for row in rows] for name in OUTPUTS}
    return files
