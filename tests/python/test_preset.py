"""Both models of rotor 37 that ship, packaged and marched: refined, and with `preset = "paper"`."""

import os
from types import SimpleNamespace

import pytest
from fmpy import extract, read_model_description
from fmpy.validation import validate_fmu

from importers import Three, Two
from test_cyclic import table
from test_fmu import bits, march

LIBRARY = ["--library", os.environ["TIPRUB_LIBRARY"]] if "TIPRUB_LIBRARY" in os.environ else []
STOP = 2.0e-3


@pytest.fixture(scope="module", params=["rotor37", "rotor37-paper"])
def shipped(request, tiprub, tmp_path_factory):
    """One of the scenes, as FMU and run without FMI."""
    directory = tmp_path_factory.mktemp(request.param)
    scene = f"builtin:{request.param}"
    fmus = {}
    for kind, version in ((Two, "2"), (Three, "3")):
        file = directory / f"fmi{version}.fmu"
        tiprub("package", scene, "--fmi", version, "-o", file, *LIBRARY)
        unpacked = extract(str(file), unzipdir=str(directory / version))
        fmus[kind] = SimpleNamespace(path=file, directory=unpacked, description=read_model_description(str(file)))
    run = tiprub("run", scene, "--stop", STOP, "--csv", directory / "native.csv")
    names, rows = table(directory / "native.csv")
    return SimpleNamespace(name=request.param, fmus=fmus, names=names, rows=rows, last=run["last"])


@pytest.mark.parametrize("kind", [Two, Three])
def test_fmpy_gives_the_bits_of_the_native_run(shipped, kind):
    assert validate_fmu(str(shipped.fmus[kind].path)) == []
    instance = kind(shipped.fmus[kind])
    try:
        instance.initialise()
        results = march(instance, shipped.names, [row[0] for row in shipped.rows])
    finally:
        instance.free()
    assert results == [bits(row[1:]) for row in shipped.rows]


def test_patches_have_pressures_and_watched_points(shipped, tiprub):
    refined = shipped.name == "rotor37"
    assert ("blade[1].normal_pressure[9]" in shipped.last) == refined
    assert ("blade[1].radial_displacement[3]" in shipped.last) == refined
    assert ("blade[1].watched_clearance[3]" in shipped.last) == refined
    force = [name for name in shipped.names if name.startswith("blade[1].normal_force[")]
    assert len(force) == (18 if refined else 3)
    if not refined:
        return
    # At rest edges and middle are as far from the casing as the patches next to them; in the rub they tell what a patch does not.
    at = lambda row, name, index: row[1 + shipped.names.index(f"blade[1].{name}[{index}]")]
    for point, patch in ((1, 1), (2, 5), (3, 9)):
        assert at(shipped.rows[0], "watched_clearance", point) == pytest.approx(at(shipped.rows[0], "clearance", patch), rel=0.1)
    assert max(abs(at(row, "watched_clearance", 1) - at(row, "clearance", 1)) for row in shipped.rows) > 1e-6
    # A force over the area and over the length that the ROM says a patch stands for.
    [rom] = tiprub("inspect", f"builtin:{shipped.name}")["scene"]["roms"]
    hardest = max(range(18), key=lambda index: max(row[1 + shipped.names.index(force[index])] for row in shipped.rows))
    patch = rom["contact_nodes"][hardest]
    assert 0.0 < patch["area"] < patch["length"] ** 2
    touching = [row for row in shipped.rows if row[1 + shipped.names.index(force[hardest])] > 0.0]
    assert touching
    for row in touching:
        values = [row[1 + shipped.names.index(f"blade[1].{name}[{hardest + 1}]")] for name in ("normal_force", "normal_pressure", "normal_line_force")]
        assert values[0] / values[1] == pytest.approx(patch["area"], rel=1e-12)
        assert values[0] / values[2] == pytest.approx(patch["length"], rel=1e-12)
