"""The cube between two rings in FMPy: the bits of the native run, and an independent method's history.

`cube_reference.csv` is the same flight by a method that shares no time stepping, no contact solver and no reduction with
the product; its first lines say how it was made.
"""

import csv
import os
from pathlib import Path
from types import SimpleNamespace

import numpy
import pytest
from fmpy import extract, read_model_description
from fmpy.validation import validate_fmu

from importers import Three, Two
from test_fmu import bits

H = 4e-6
POINTS = 251
SPEED = 100.0
SCENE = "builtin:cube-between-rings"
KINDS = {"two": Two, "three": Three}
NODE_1 = ["cube.node_displacement_x[1]", "cube.node_displacement_y[1]", "cube.node_displacement_z[1]"]
FORCE_1 = "cube.normal_force[1]"


@pytest.fixture(scope="module")
def flight(tiprub, tmp_path_factory):
    """Both FMUs, run by FMPy over one millisecond, and the native run."""
    work = tmp_path_factory.mktemp("cube")
    library = ["--library", os.environ["TIPRUB_LIBRARY"]] if "TIPRUB_LIBRARY" in os.environ else []
    table = work / "native.csv"
    tiprub("run", SCENE, "--step", H, "--stop", (POINTS - 1) * H, "--csv", table)
    with table.open(newline="") as file:
        header, *rows = list(csv.reader(file))
    names = header[1:]
    native = [[float(value) for value in row] for row in rows]
    fmus, runs = {}, {}
    for kind, importer in KINDS.items():
        path = work / f"{kind}.fmu"
        tiprub("package", SCENE, "--fmi", "2" if kind == "two" else "3", "--arrays", "-o", path, *library)
        directory = extract(str(path), unzipdir=str(work / kind))
        fmus[kind] = SimpleNamespace(path=path, directory=directory, description=read_model_description(str(path)))
        instance = importer(fmus[kind])
        instance.initialise()
        values = [instance.read(names)]
        for index in range(POINTS - 1):
            instance.step(native[index][0], native[index + 1][0] - native[index][0])
            values.append(instance.read(names))
        instance.free()
        runs[kind] = values
    return SimpleNamespace(names=names, native=native, fmus=fmus, runs=runs)


@pytest.fixture(scope="module")
def reference():
    """Columns of the independent history."""
    lines = (Path(__file__).parent / "cube_reference.csv").read_text().splitlines()
    rows = list(csv.DictReader(line for line in lines if not line.startswith("#")))
    return {name: numpy.array([float(row[name]) for row in rows]) for name in rows[0]}


def column(flight, name, kind="three"):
    return numpy.array([row[flight.names.index(name)] for row in flight.runs[kind]])


@pytest.mark.parametrize("kind", KINDS)
def test_fmpy_finds_no_problem(flight, kind):
    assert validate_fmu(str(flight.fmus[kind].path)) == []


@pytest.mark.parametrize("kind", KINDS)
def test_the_fmu_gives_the_bits_of_the_native_run(flight, kind):
    assert len(flight.native) == POINTS
    for row, values in zip(flight.native, flight.runs[kind]):
        different = [name for name, a, b in zip(flight.names, row[1:], values) if bits([a]) != bits([b])]
        assert not different, f"t = {row[0]}: {different[:5]}"
    assert max(column(flight, FORCE_1)) > 1e3, "node 1 touches"


def relative(found, expected):
    return numpy.linalg.norm(found - expected) / numpy.linalg.norm(expected)


def test_it_follows_an_independent_method(flight, reference):
    """u1x, slowing (u1y + vt) and u1z while node 1 touches; its force in windows of 20 µs; impulse; exit speed."""
    times = reference["t"]
    assert len(times) == POINTS and numpy.allclose(times, [row[0] for row in flight.native], rtol=0, atol=1e-12)
    touching = times <= times[numpy.nonzero(reference["lambda1"])[0].max()]
    assert 0.3e-3 < times[touching].max() < 0.45e-3
    u = [column(flight, name) for name in NODE_1]
    u[1] = u[1] + SPEED * times
    expected = [reference["u1x"], reference["u1y"] + SPEED * times, reference["u1z"]]
    apart = [relative(found[touching], wanted[touching]) for found, wanted in zip(u, expected)]
    # Records hold means since the one before.
    windows = [values[1:101].reshape(20, 5).mean(axis=1) for values in (column(flight, FORCE_1), reference["lambda1"])]
    force, impulse = relative(*windows), windows[0].sum() / windows[1].sum() - 1.0
    exit_speed = column(flight, "cube.velocity_y")[-1] / reference["vy"][-1] - 1.0
    print(f"u1x, slowing, u1z {apart}, windows {force}, impulse {impulse}, exit {exit_speed}")
    assert apart[0] < 0.002 and apart[1] < 0.006 and apart[2] < 0.002, apart
    assert force < 0.02 and abs(impulse) < 0.003, (force, impulse)
    assert abs(exit_speed) < 0.0015, exit_speed


def test_left_and_right_are_equal_and_the_books_close(flight):
    largest = max(abs(column(flight, NODE_1[0])))
    for left, right in zip((1, 6, 31, 36), (37, 42, 67, 72)):
        sides = [column(flight, f"cube.node_displacement_x[{node}]") for node in (left, right)]
        assert max(abs(sides[0] + sides[1])) < 1e-8 * largest
    assert max(abs(column(flight, "energy_residual_relative"))) < 1e-12
    assert max(abs(column(flight, "left.force_x") + column(flight, "right.force_x"))) < 1e-6 * max(
        abs(column(flight, "left.force_x"))
    )
