"""A rub and the casing it heats as an SSP package, run by Ecos and by FMPy, against the script of the example."""

import csv
import importlib.metadata
import os
import subprocess
import sys
from pathlib import Path

import numpy
import pytest
from conftest import LIBRARIES, TIPRUB, tiprub

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "examples" / "thermal"))
pytest.importorskip("fmpy")
import ssp  # noqa: E402
from pair import Casing, Rub, script  # noqa: E402
from units import Unit  # noqa: E402

STEP, COUNT, PATCHES = 3.490658503988659e-4, 20, 12


@pytest.fixture(scope="module")
def package(tmp_path_factory):
    """The package, and what the script makes of its units."""
    work = tmp_path_factory.mktemp("thermal")
    tiprub("reduce", "rotor37", "--contact-nodes", "3", "-o", work / "rotor.rom.safetensors")
    (work / "rub.toml").write_text((ROOT / "examples" / "thermal" / "rub.toml").read_text(encoding="utf-8"), encoding="utf-8")
    tiprub("package", work / "rub.toml", "--scalars", "--library", LIBRARIES, "-o", work)
    made = subprocess.run([TIPRUB, "--quiet", "thermal", "--output", work / "casing"], capture_output=True, text=True)
    assert made.returncode == 0, made.stderr
    (casing,) = (work / "casing").glob("*_fmi2.fmu")
    rub, file = work / "thermal_rub_fmi2.fmu", work / "pair.ssp"
    ssp.write(file, rub, casing, PATCHES, STEP * COUNT)
    ssp.validate(file)
    with Unit(rub) as one, Unit(casing) as other:
        course = script(Rub(one, 0.5), Casing(other), STEP, COUNT)
    assert course.temperatures[-1].max() > 0.05, "it rubs"
    return file, course


def judged(found, course):
    apart = max(numpy.abs(found.temperatures - course.temperatures).max(), numpy.abs(found.heat - course.heat).max())
    assert apart <= 1e-9 * course.heat.max(), apart
    return "SSP 1.0, rub and casing: " + ("bits equal to a script" if apart == 0.0 else f"{apart:.0e} apart from a script")


def test_ssp_by_ecos(package, record):
    if not ssp.tbb():
        pytest.skip("Ecos needs libtbb.so.12: pip install tbb")
    file, course = package
    record("Ecos (ecospy)", importlib.metadata.version("ecospy"), "2.0", judged(ssp.run_ecos(file, STEP, COUNT, PATCHES), course))


def test_ssp_by_fmpy(package, record):
    file, course = package
    record("FMPy", importlib.metadata.version("fmpy"), "2.0", judged(ssp.run_fmpy(file, STEP, COUNT, PATCHES), course))


def test_the_example_from_nothing():
    """Its quick form, in an environment of its own: what it writes, by what it claims."""
    environment = {**os.environ, "TIPRUB": str(Path(TIPRUB).resolve()), "TIPRUB_LIBRARY": str(LIBRARIES.resolve())}
    command = [ROOT / "examples" / "run.sh", "thermal", "--quick", "--only", "couplings", "--only", "jump"]
    run = subprocess.run(command, env=environment, capture_output=True, text=True)
    assert run.returncode == 0, run.stderr[-2000:]
    into = ROOT / "target" / "examples" / "thermal"
    tables = {}
    for name in ("couplings", "jump"):
        assert (into / f"{name}.svg").stat().st_size > 1000
        with (into / f"{name}.csv").open(newline="") as file:
            tables[name] = list(csv.DictReader(file))
    same = [row for row in tables["couplings"] if "FMI" in row["coupling"] or "SSP" in row["coupling"]]
    assert len(same) >= 3 and all(float(row["temperatures apart (K)"]) == 0.0 for row in same), same
    (turn,) = (row for row in tables["couplings"] if row["coupling"] == "script, in turn")
    assert abs(float(turn["apart (J)"])) < 1e-12 * float(turn["received (J)"])
    for row in tables["jump"]:
        assert abs(float(row["friction less received (J)"])) < 1e-12 * float(row["heat received (J)"])
        if row["tolerance (K)"] != "resolved":
            assert float(row["error of temperatures (K)"]) < float(row["tolerance (K)"])
