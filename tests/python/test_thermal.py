"""The FMUs of heat conduction in FMPy: valid, the same in both versions, in balance, exact at any step, and back to any state."""

import math
import os
from types import SimpleNamespace

import numpy
import pytest
from fmpy import read_model_description, simulate_fmu
from fmpy.validation import validate_fmu

# A coarse casing: what is held here is one model against itself, and its balance.
CASING = ["--mesh", "24x1x8", "--modes", "15", "--name", "coarse"]
PATCHES = 12


@pytest.fixture(scope="session")
def conduction(tiprub, tmp_path_factory):
    """FMUs of both versions, and what the command told of them."""
    directory = tmp_path_factory.mktemp("thermal")
    library = ["--library", os.environ["TIPRUB_LIBRARY_THERMAL"]] if "TIPRUB_LIBRARY_THERMAL" in os.environ else []
    told = tiprub("thermal", *CASING, "-o", directory, *library)
    arrays = directory / "arrays.fmu"
    tiprub("thermal", *CASING, "--fmi", "3", "--arrays", "-o", arrays, *library)
    return SimpleNamespace(two=directory / "coarse_fmi2.fmu", three=directory / "coarse_fmi3.fmu", arrays=arrays, told=told)


@pytest.mark.parametrize("kind", ["two", "three", "arrays"])
def test_fmpy_finds_nothing_wrong(conduction, kind):
    assert validate_fmu(str(getattr(conduction, kind))) == []
    description = read_model_description(str(getattr(conduction, kind)))
    assert description.coSimulation.modelIdentifier == "tiprub_thermal"
    assert description.coSimulation.canGetAndSetFMUstate and description.coSimulation.canSerializeFMUstate
    # No output depends on an input of the same instant: importers find no algebraic loop.
    assert all(unknown.dependencies == [] for unknown in description.outputs)


def rub(step, stop):
    """Heat of a rub that runs around, hot gas, and shutdown after half of the time."""
    names = [f"casing_heat[{patch + 1}]" for patch in range(PATCHES)]
    names += ["gas_temperature", "ambient_temperature", "gas_convection_factor"]
    kinds = [("time", float)] + [(name, float) for name in names]
    rows = []
    for number in range(round(stop / step)):
        time = number * step
        hot = time < 0.5 * stop
        heat = [300.0 * max(0.0, math.cos(2.0 * math.pi * (patch / PATCHES - time / 7.0))) if hot else 0.0 for patch in range(PATCHES)]
        rows.append((time, *heat, 150.0, 10.0, 1.0 if hot else 0.05))
    return numpy.array(rows, dtype=kinds)


def run(file, signals, stop, step, **options):
    description = read_model_description(str(file))
    outputs = [variable.name for variable in description.modelVariables if variable.causality == "output"]
    return simulate_fmu(str(file), stop_time=stop, output_interval=step, step_size=step, input=signals, output=outputs, **options)


def test_both_versions_are_one_and_heat_is_conserved(conduction):
    step, stop = 0.25, 40.0
    results = [run(file, rub(step, stop), stop, step) for file in (conduction.two, conduction.three)]
    assert results[0].dtype.names == results[1].dtype.names
    for name in results[0].dtype.names:
        assert numpy.array_equal(results[0][name], results[1][name]), name
    last = results[0][-1]
    came = last["supplied_heat"] + last["gas_heat"] + last["ambient_heat"]
    assert abs(last["stored_heat"] - came) < 1e-10 * last["supplied_heat"]
    assert abs(last["energy_residual_relative"]) < 1e-12
    # The rub heats, the soak cools: the largest temperature lies between.
    hottest = results[0]["temperature_max"]
    assert 0 < numpy.argmax(hottest) <= round(0.5 * stop / step) + 1 and hottest[-1] < hottest.max()
    # Heat flows as stated: means over steps add up to totals.
    assert math.isclose(results[0]["gas_power"][1:].sum() * step, last["gas_heat"], rel_tol=1e-9)


def test_a_long_step_is_many_short_ones(conduction):
    held = numpy.array([(0.0, 250.0)], dtype=[("time", float), ("casing_heat[3]", float)])
    fine, coarse = (run(conduction.three, held, 20.0, step)[-1] for step in (0.01, 20.0))
    for name in ("casing_temperature[3]", "casing_temperature[9]", "surface_temperature[3]", "stored_heat", "gas_heat"):
        assert math.isclose(fine[name], coarse[name], rel_tol=1e-10), name


def test_steady_state_is_what_films_carry_away(conduction):
    """All patches alike for a long time: heat in is heat out, by conductances that the description tells."""
    heat = 100.0
    signals = numpy.array([(0.0, *[heat] * PATCHES)], dtype=[("time", float)] + [(f"casing_heat[{k + 1}]", float) for k in range(PATCHES)])
    last = run(conduction.two, signals, 4000.0, 400.0)[-1]
    gas, ambient = conduction.told["model"]["conductances"]
    out = gas * last["gas_surface_temperature"] + ambient * last["ambient_surface_temperature"]
    assert math.isclose(out, PATCHES * heat, rel_tol=1e-9)
    assert math.isclose(-last["gas_power"] - last["ambient_power"], PATCHES * heat, rel_tol=1e-9)
    patches = [last[f"casing_temperature[{k + 1}]"] for k in range(PATCHES)]
    assert max(patches) - min(patches) < 1e-6 * max(patches)


def test_the_command_checks_what_it_made(conduction):
    model = conduction.told["model"]
    nominal = next(check for check in model["steady_states"] if check["factors"] == [1.0, 1.0])
    assert nominal["patches"] < 1e-9 and nominal["surfaces"] < 1e-9
    assert all(check["patches"] < 5e-3 for check in model["steady_states"])
    assert model["time_constants"] == sorted(model["time_constants"], reverse=True)


def test_wrong_ones_are_refused_by_name(tiprub, conduction, tmp_path):
    for options, expected in [
        (["--gas-film", "0", "--ambient-film", "0"], "film"),
        (["--patches", "0x0"], "patch"),
        (["--heated", "1:2"], "heated"),
        (["--material", "maraging-steel"], "conduct"),
    ]:
        error = tiprub("thermal", *CASING, "-o", tmp_path, *options, fails=True)
        assert expected in str(error), (options, error)
    scenes = os.environ.get("TIPRUB_LIBRARY")
    if scenes:
        error = tiprub("thermal", *CASING, "-o", tmp_path, "--library", scenes, fails=True)
        assert "the other kind of FMU" in str(error)
