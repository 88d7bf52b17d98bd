"""Independent importers run the packaged FMUs and get the results of a run without FMI."""

import importlib.metadata
import os
import re
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import numpy
import pytest
from conftest import OUTPUTS, STEP, STEPS

fmpy = pytest.importorskip("fmpy")
from fmpy import read_model_description, simulate_fmu, supported_platforms  # noqa: E402
from fmpy.validation import validate_fmu  # noqa: E402

KINDS = [("two", "2.0"), ("three", "3.0"), ("arrays", "3.0 arrays")]


def difference(native, found, name):
    """Return the largest difference as a fraction of the largest value without FMI."""
    native, found = numpy.array(native), numpy.array(found)
    assert native.shape == found.shape, (name, native.shape, found.shape)
    return numpy.abs(native - found).max() / numpy.abs(native).max()


def judged(paper, columns):
    """Compare all columns. Fail if they differ by more than rounding."""
    worst = max(difference(paper.native[name], column, name) for name, column in columns.items())
    assert worst < 1e-9, worst
    return "bits equal" if worst == 0.0 else f"{worst:.0e} apart"


def version_of(package):
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        pytest.skip(f"{package} is not installed")


@pytest.mark.parametrize("kind, fmi", KINDS)
def test_fmpy(paper, record, kind, fmi):
    file = str(getattr(paper, kind))
    assert validate_fmu(file) == []
    outputs = sorted({name.split("[2]")[0] if fmi == "3.0 arrays" else name for name in OUTPUTS})
    result = simulate_fmu(file, stop_time=STEP * STEPS, output_interval=STEP, output=outputs)
    columns = {}
    for name in OUTPUTS:
        columns[name] = result[name] if name in result.dtype.names else result[name.removesuffix("[2]")][:, 1]
    record("FMPy", version_of("fmpy"), fmi, f"validated without errors; {judged(paper, columns)}")


def references(file):
    return {variable.name: variable.valueReference for variable in read_model_description(str(file)).modelVariables}


@pytest.mark.parametrize("kind, fmi", KINDS[:2])
def test_fmuloader(paper, record, kind, fmi):
    version = version_of("fmuloader")
    file = getattr(paper, kind)
    description = read_model_description(str(file))
    wanted = [references(file)[name] for name in OUTPUTS]
    if kind == "two":
        from fmuloader.fmi2 import Fmi2Slave, Fmi2Type

        unit = Fmi2Slave(file, model_identifier="tiprub")
        unit.instantiate("unit", Fmi2Type.CO_SIMULATION, guid=description.guid)
        unit.setup_experiment(start_time=0.0)
        unit.enter_initialization_mode()
        read = unit.get_real
    else:
        from fmuloader.fmi3 import Fmi3Slave

        unit = Fmi3Slave(file, model_identifier="tiprub")
        unit.instantiate_co_simulation("unit", instantiation_token=description.guid)
        unit.enter_initialization_mode(start_time=0.0)
        read = unit.get_float64
    unit.exit_initialization_mode()
    rows = [list(read(wanted))]
    for step in range(STEPS):
        unit.do_step(step * STEP, (step + 1) * STEP - step * STEP)
        rows.append(list(read(wanted)))
    unit.terminate()
    unit.free_instance()
    record("fmuloader", version, fmi, judged(paper, dict(zip(OUTPUTS, zip(*rows)))))


# Ecos ends the process on errors of its own. It wants libtbb.so.12, which the package tbb brings.
ECOS = """
import ctypes, pathlib, sys
for library in pathlib.Path(sys.prefix).glob("lib/libtbb.so.12"):
    ctypes.CDLL(str(library), mode=ctypes.RTLD_GLOBAL)
from ecospy import EcosSimulation, EcosSimulationStructure
file, step, steps, *names = sys.argv[1:]
with EcosSimulationStructure() as structure:
    structure.add_model("unit", file)
    with EcosSimulation(structure=structure, step_size=float(step)) as simulation:
        simulation.init()
        for index in range(int(steps) + 1):
            print(*(repr(simulation.get_real("unit::" + name)) for name in names))
            simulation.step()
"""


@pytest.mark.parametrize("kind, fmi", KINDS[:2])
def test_ecos(paper, record, kind, fmi):
    version = version_of("ecospy")
    command = [sys.executable, "-c", ECOS, getattr(paper, kind), repr(STEP), str(STEPS), *OUTPUTS]
    run = subprocess.run(command, capture_output=True, text=True)
    if "libtbb" in run.stderr:
        pytest.skip("ecospy needs libtbb.so.12: pip install tbb")
    assert run.returncode == 0, run.stderr
    rows = [line.split() for line in run.stdout.splitlines() if line[:1] in "-0123456789"]
    columns = {name: [float(row[index]) for row in rows] for index, name in enumerate(OUTPUTS)}
    record("Ecos (ecospy)", version, fmi, judged(paper, columns))


LIBCOSIM = """
import sys
from libcosimpy.CosimExecution import CosimExecution
from libcosimpy.CosimObserver import CosimObserver
from libcosimpy.CosimSlave import CosimLocalSlave
file, step, steps, *references = sys.argv[1:]
execution = CosimExecution.from_step_size(step_size=round(1e9 * float(step)))
unit = CosimLocalSlave(fmu_path=file, instance_name="unit")
slave = execution.add_local_slave(local_slave=unit)
observer = CosimObserver.create_last_value()
execution.add_observer(observer=observer)
for index in range(int(steps)):
    execution.step()
    print(*map(repr, observer.last_real_values(slave, [int(reference) for reference in references])))
"""


def test_libcosim(paper, record):
    version = version_of("libcosimpy")
    wanted = [references(paper.two)[name] for name in OUTPUTS]
    command = [sys.executable, "-c", LIBCOSIM, paper.two, repr(STEP), STEPS, *wanted]
    run = subprocess.run(list(map(str, command)), capture_output=True, text=True)
    assert run.returncode == 0, run.stderr[-2000:]
    assert "error" not in run.stderr, run.stderr
    # Among lines of its log; read after steps only.
    rows = [line.split() for line in run.stdout.splitlines() if line[:1] in "-0123456789"]
    columns = {name: paper.native[name][:1] + [float(row[index]) for row in rows] for index, name in enumerate(OUTPUTS)}
    record("libcosim (libcosimpy)", version, "2.0", judged(paper, columns))


@pytest.mark.parametrize("kind, fmi", KINDS[:2])
def test_container(paper, record, tmp_path, kind, fmi):
    """A container of the toolbox with two of our units, run by FMPy."""
    version = version_of("fmu-manipulation-toolbox")
    tool = Path(sys.executable).parent / "fmucontainer"
    shutil.copy(getattr(paper, kind), tmp_path / "unit.fmu")
    (tmp_path / "pair.csv").write_text(
        "rule;from_fmu;from_port;to_fmu;to_port\nFMU;unit.fmu;;;\nINPUT;;speed;unit.fmu;speed\n"
        + "".join(f"OUTPUT;unit.fmu;{name};;{name}\n" for name in OUTPUTS)
    )
    command = [tool, "-container", f"pair.csv:{STEP}", "-fmi", fmi[0], "-no-auto-output", "-no-auto-input", "-fmu-directory", "."]
    made = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    container = tmp_path / "pair.fmu"
    assert container.exists(), made.stdout + made.stderr
    speed = {"speed": read_start(paper, kind)}
    result = simulate_fmu(str(container), stop_time=STEP * STEPS, output_interval=STEP, start_values=speed, output=OUTPUTS)
    record("FMU Manipulation Toolbox", version, f"{fmi} in {fmi}", judged(paper, {name: result[name] for name in OUTPUTS}))


def read_start(paper, kind):
    variables = read_model_description(str(getattr(paper, kind))).modelVariables
    return float(next(variable.start for variable in variables if variable.name == "speed"))


@pytest.mark.parametrize("kind, fmi", KINDS)
def test_fmi_sim(paper, record, tmp_path, kind, fmi):
    tool = shutil.which("fmi-sim")
    if tool is None:
        pytest.skip("fmi-sim is not on the PATH (cargo install fmi-sim)")
    # It calls the version an error, with a trace behind it.
    version = subprocess.run([tool, "--version"], capture_output=True, text=True).stderr.split()[2]
    out = tmp_path / "out.csv"
    command = [tool, "--model", getattr(paper, kind), "--output-file", out, "co-simulation"]
    command += ["-s", "0", "-f", repr(STEP * STEPS), "--output-interval", repr(STEP)]
    run = subprocess.run(command, capture_output=True, text=True)
    if version == "0.7.0" and 'unknown field "quantity"' in run.stderr:
        record("fmi-sim (rust-fmi)", version, fmi, "rejected: its reader does not support quantities and units of variables")
        pytest.skip("fmi-sim 0.7.0 does not support quantities and units of variables of FMI 3.0")
    assert run.returncode == 0, run.stderr[-2000:]
    header, *rows = [line.split(",") for line in out.read_text().splitlines()]
    header = [name.strip('"') for name in header]
    columns = {name: [float(row[header.index(name)]) for row in rows] for name in OUTPUTS if name in header}
    assert set(columns) == {name for name in OUTPUTS if fmi != "3.0 arrays" or "[" not in name}, header
    record("fmi-sim (rust-fmi)", version, fmi, judged(paper, columns))


# Level 3 of its log are warnings and worse, which it writes to stderr.
FMI_LIBRARY = """
import sys
from ctypes import CDLL, c_char_p, c_int, c_void_p
library, file, directory, name = sys.argv[1:]
fmil = CDLL(library)
def function(name, answer, *arguments):
    found = getattr(fmil, name)
    found.restype, found.argtypes = answer, arguments
    return found
callbacks = function("jm_get_default_callbacks", c_void_p)()
c_int.from_address(callbacks + 5 * 8).value = 3
context = function("fmi_import_allocate_context", c_void_p, c_void_p)(callbacks)
function("fmi_import_get_fmi_version", c_int, c_void_p, c_char_p, c_char_p)(context, file.encode(), directory.encode())
unit = function(name + "_import_parse_xml", c_void_p, c_void_p, c_char_p, c_void_p)(context, directory.encode(), None)
print(function(name + "_import_get_model_name", c_char_p, c_void_p)(unit).decode() if unit else None)
"""


@pytest.mark.parametrize("kind, fmi", KINDS)
def test_fmi_library(paper, record, tmp_path, kind, fmi):
    library = os.environ.get("FMI_LIBRARY")
    if library is None:
        pytest.skip("the environment variable FMI_LIBRARY names no libfmilib_shared.so")
    command = [sys.executable, "-c", FMI_LIBRARY, library, getattr(paper, kind), tmp_path, f"fmi{fmi[0]}"]
    run = subprocess.run(command, capture_output=True, text=True)
    assert run.returncode == 0 and run.stdout.split() == ["rotor37_rub_paper"], run.stdout + run.stderr
    # Version 3.0 reads terminals without the attributes that the standard requires of them.
    words = [line for line in run.stderr.splitlines() if not re.search("matchingRule|variableName|variableKind|memberName|'Terminal", line)]
    assert words == [] and (fmi != "2.0" or run.stderr == ""), run.stderr
    # The file name of the library contains the version.
    version = Path(library).resolve().name.split(".so.")[-1]
    record("FMI Library", version, fmi, "read without a warning" + (", except about terminals" if run.stderr else ""))


def test_fmpy_sees_the_platforms(paper):
    """Those that FMPy has names for: 64-bit Arm it takes for none on Linux."""
    with zipfile.ZipFile(paper.three) as archive:
        names = {name.split("/")[1] for name in archive.namelist() if name.startswith("binaries/")}
    known = {"x86_64-linux": "linux64", "x86_64-windows": "win64", "x86_64-darwin": "darwin64"}
    assert set(supported_platforms(str(paper.three))) >= {known[name] for name in names if name in known}
