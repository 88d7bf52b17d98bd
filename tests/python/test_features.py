"""Flexible, heated, coated casings and moving shafts in FMPy: both versions against the native run, states, arrays."""

import csv
import math
import os
from pathlib import Path
from types import SimpleNamespace

import numpy
import pytest
from fmpy import extract, read_model_description
from fmpy.validation import validate_fmu

from importers import Three, Two
from ring_rom import ALONG, AROUND, PATCHES, write_ring
from test_fmu import bits, march

H = 1.17e-5
SECTORS = 36
# Set before initialisation, in the FMUs and in the native run.
STARTS = {
    "flexible": {"casing_temperature": [10.0, -5.0, 20.0, 0.0], "casing_load_phase": [0.3]},
    "spinning": {"casing_temperature": [0.5 * patch for patch in range(12)]},
    "coated": {"whirl_x": [4e-5], "whirl_y": [-2e-5], "axial_shift": [1e-5]},
}
KINDS = {"two": Two, "three": Three, "scalars": Three}


@pytest.fixture(scope="session", params=["flexible", "spinning", "coated"])
def product(request, tiprub, scene, work):
    """One of the scenes: packaged three ways, and run without FMI."""
    name = request.param
    factors = ", ".join(f"{1.0 + 0.02 * math.sin(2.4 * sector):.4f}" for sector in range(SECTORS))
    text = (Path(__file__).parent / f"{name}.toml").read_text().replace("FACTORS", factors)
    path = scene.parent / f"{name}.toml"
    path.write_text(text)
    if name == "flexible":
        write_ring(scene.parent / "ring.rom.safetensors")
    if name == "spinning":
        # On coarse meshes: what is held here is one model against itself.
        blade = ["--contact-nodes", "3", "--spin", "1800", "--mesh", "8x1x10"]
        tiprub("reduce", "rotor37", *blade, "-o", scene.parent / "rotor37-spin.rom.safetensors")
        ring = ["--mesh", "24x1x8", "--fixed-interface-modes", "48", "--modes", "36"]
        tiprub("reduce", "casing", *ring, "-o", scene.parent / "casing37.rom.safetensors")
    library = ["--library", os.environ["TIPRUB_LIBRARY"]] if "TIPRUB_LIBRARY" in os.environ else []
    fmus = {}
    for kind in KINDS:
        file = work / f"{name}_{kind}.fmu"
        options = ["--fmi", "2" if kind == "two" else "3"] + ["--scalars" if kind == "scalars" else "--arrays"]
        tiprub("package", path, *options, "-o", file, *library)
        directory = extract(str(file), unzipdir=str(work / file.stem))
        fmus[kind] = SimpleNamespace(path=file, directory=directory, description=read_model_description(str(file)))
    table = work / f"{name}.csv"
    values = [
        ("--set", f"{variable}[{index}]={value}" if len(elements) > 1 else f"{variable}={value}")
        for variable, elements in STARTS[name].items()
        for index, value in enumerate(elements, 1)
    ]
    tiprub("run", path, "--csv", table, *[word for pair in values for word in pair])
    with table.open(newline="") as file:
        header, *rows = list(csv.reader(file))
    return SimpleNamespace(name=name, fmus=fmus, names=header[1:], rows=[[float(v) for v in row] for row in rows])


@pytest.fixture
def start(product):
    """Maker of initialised instances; all are freed in the end."""
    made = []

    def make(kind, initialise=True):
        instance = KINDS[kind](product.fmus[kind])
        made.append(instance)
        for name, values in STARTS[product.name].items():
            instance.put(name, values)
        if initialise:
            instance.initialise()
        return instance

    yield make
    for instance in made:
        instance.free()


def column(product, name):
    return [row[product.names.index(name) + 1] for row in product.rows]


def wear_names(product):
    return [name for name in product.names if name.startswith("wear_depth[")]


@pytest.mark.parametrize("kind", KINDS)
def test_fmpy_finds_no_problem(product, kind):
    assert validate_fmu(str(product.fmus[kind].path)) == []


def test_every_fmu_agrees_with_the_native_run_bit_for_bit(product, start):
    times = [row[0] for row in product.rows]
    expected = [bits(row[1:]) for row in product.rows]
    touching = sum(impulse > 0 for impulse in column(product, "normal_impulse"))
    assert touching > len(times) / 10, touching
    for kind in KINDS:
        rows = march(start(kind), product.names, times)
        wrong = [index for index, (row, other) in enumerate(zip(rows, expected)) if row != other]
        assert not wrong and len(rows) == len(expected), f"{kind}: first difference at point {wrong[:1]}"
    print(f"{product.name}: {len(times)} points, {len(product.names)} outputs, {touching} with contact: same bits")


def test_what_was_asked_for_happens(product):
    last = dict(zip(product.names, product.rows[-1][1:]))
    assert abs(last["energy_residual_relative"]) < 1e-9
    if product.name == "flexible":
        moved = [abs(last[f"casing_displacement[{node}]"]) for node in range(1, AROUND * ALONG + 1)]
        assert 1e-6 < max(moved) < 1e-3, max(moved)
        for row in product.rows:
            values = dict(zip(product.names, row[1:]))
            into_casing = sum(values[f"casing_friction_power[{patch}]"] for patch in range(1, 17))
            assert into_casing == pytest.approx(0.4 * values["friction_power"], rel=1e-12, abs=1e-9)
            assert into_casing + values["blade_friction_power"] == pytest.approx(
                values["friction_power"], rel=1e-12, abs=1e-9
            )
        assert max(column(product, "friction_power")) > 10.0 and last["load_work"] != 0.0
    elif product.name == "spinning":
        # Twelve heated patches of the casing's own; growth and heat are there at the start, and rest.
        first = dict(zip(product.names, product.rows[0][1:]))
        assert max(abs(first[f"casing_displacement[{node}]"]) for node in range(1, 73)) > 1e-6
        assert first["strain_energy"] > 0.1 and last["load_work"] != 0.0
        into_casing = sum(last[f"casing_friction_power[{patch}]"] for patch in range(1, 13))
        assert into_casing == pytest.approx(last["friction_power"], rel=1e-12, abs=1e-9)
    else:
        cells = [last[name] for name in wear_names(product)]
        assert len(cells) == 360 * 4 and max(cells) == last["wear_depth_maximum"] > 1e-6
        depths = numpy.array([[row[product.names.index(name) + 1] for name in wear_names(product)] for row in product.rows])
        assert (numpy.diff(depths, axis=0) >= 0.0).all(), "a coating does not heal"
        assert 0.0 < last["worn_volume"] < 2 * math.pi * 0.26 * 0.04 * last["wear_depth_maximum"]
        assert last["wear_work"] > 0.0


@pytest.mark.parametrize("kind", ["two", "three"])
def test_a_state_saved_mid_way_continues_with_the_same_bits(product, start, kind):
    times = [row[0] for row in product.rows]
    impulses = column(product, "normal_impulse")
    begin = next(index for index in range(100, len(times)) if impulses[index] > 0)
    end = begin + 100
    instance = start(kind)
    march(instance, product.names[:1], times[: begin + 1])
    wear = wear_names(product)
    worn = instance.read(wear) if wear else []
    assert not wear or max(worn) > 0.0
    state = instance.save()
    first = march(instance, product.names, times[begin:end])
    assert not wear or max(instance.read(wear)) > max(worn)
    instance.restore(state)
    assert not wear or bits(instance.read(wear)) == bits(worn), "the wear map of the saved state"
    assert march(instance, product.names, times[begin:end]) == first
    # The same from bytes, in an instance that has worn elsewhere.
    other = start(kind)
    other.step(0.0, 20 * H)
    if kind == "two":
        content = instance.fmu.serializeFMUstate(state)
        other.restore(other.fmu.deSerializeFMUstate(content))
    else:
        other.restore(other.fmu.deserializeFMUState(instance.fmu.serializeFMUState(state)))
    assert march(other, product.names, times[begin:end]) == first


def test_a_reset_forgets_wear_and_inputs(product, start):
    instance = start("two")
    fresh = march(instance, product.names, [0.0, 150 * H, 170 * H])
    instance.reset()
    for name, values in STARTS[product.name].items():
        instance.put(name, values)
    instance.initialise()
    assert march(instance, product.names, [0.0, 150 * H, 170 * H]) == fresh


def test_inputs_that_change_mean_the_same_in_every_fmu(product, start):
    ends = []
    for kind in KINDS:
        instance = start(kind)
        for index in range(120):
            x = 0.05 * index
            if product.name == "flexible":
                instance.put("casing_temperature", [50.0 * math.sin(x + patch) for patch in range(PATCHES)])
                instance.put("casing_load_phase", [x])
            elif product.name == "spinning":
                instance.put("casing_temperature", [50.0 * math.sin(x + patch) for patch in range(12)])
                instance.put("speed", [1800.0 + 20.0 * math.sin(x)])
            else:
                instance.put("whirl_x", [4e-5 * math.cos(x)])
                instance.put("axial_shift", [1e-5 * math.sin(x)])
            instance.step(index * H, H)
        ends.append(bits(instance.read(product.names)))
    assert ends[0] == ends[1] == ends[2]
    same = start("two")
    same.step(0.0, 120 * H)
    assert bits(same.read(product.names)) != ends[0]


def test_elements_of_array_inputs_are_set_one_by_one(product, start):
    if product.name != "flexible":
        for kind in KINDS if product.name == "coated" else []:
            assert "casing_temperature" not in str(start(kind).variables), "no heat in this scene"
        return
    names = [f"casing_temperature[{patch}]" for patch in range(1, PATCHES + 1)]
    for kind in KINDS:
        instance = start(kind, initialise=False)
        assert instance.get(*names) == [10.0, -5.0, 20.0, 0.0]
        if kind != "three":
            instance.set(**{names[2]: 77.0})
            assert instance.get(*names) == [10.0, -5.0, 77.0, 0.0]
        # One value is out of range or not a number: nothing is taken over.
        before = instance.get(*names)
        for wrong, told in [(math.nan, "not finite"), (3001.0, "Set a value within")]:
            log = instance.refused(lambda: instance.put("casing_temperature", [1.0, 2.0, wrong, 3.0]))
            assert "casing_temperature[3]" in log and told in log, log
        assert instance.get(*names) == before


def test_the_number_of_nodal_diameters_is_a_parameter(product, start):
    if product.name != "flexible":
        assert not any("casing_load" in name for name in start("two").variables)
        return
    names = [f"casing_displacement[{node}]" for node in range(1, AROUND + 1)]
    found = {}
    for order in (2, 3):
        for kind in KINDS:
            instance = start(kind, initialise=False)
            instance.set(casing_load_order=order)
            instance.put("casing_temperature", [0.0] * PATCHES)
            instance.initialise()
            found[order, kind] = instance.read(names)
        assert bits(found[order, "two"]) == bits(found[order, "three"]) == bits(found[order, "scalars"])
        largest = numpy.argmax(numpy.abs(numpy.fft.rfft(found[order, "two"])))
        assert largest == order, f"{largest} nodal diameters"
    instance = start("three", initialise=False)
    instance.set(casing_load_order=AROUND // 2)
    log = instance.refused(instance.initialise)
    assert "casing_load_order" in log and "0 to 11" in log, log


def test_derivatives_of_array_inputs(product, start):
    """A ramp of the temperature with derivatives is the same for one long step and for two halves."""
    if product.name == "spinning":
        return
    if product.name == "coated":
        instance = start("two")
        instance.derivative("whirl_x", 1.0)
        held = start("two")
        for each in (instance, held):
            each.step(0.0, 100 * H)
        assert instance.get("force_x") != held.get("force_x")
        return
    ends = []
    for parts in (1, 2, 0):
        instance = start("two")
        rate, length = 2e4, 20 * H
        for part in range(max(parts, 1)):
            size = length / max(parts, 1)
            for patch, first in enumerate(STARTS["flexible"]["casing_temperature"], 1):
                # Values that fit the derivatives, so that the ramp is the line itself.
                instance.set(**{f"casing_temperature[{patch}]": first + rate * part * size})
                if parts:
                    instance.derivative(f"casing_temperature[{patch}]", rate)
            instance.step(part * size, size)
        ends.append(instance.get("casing_displacement[1]"))
    # The internal steps of one and of two differ in rounding only; a held value is half the ramp behind.
    assert ends[0] == pytest.approx(ends[1], rel=1e-6) and ends[0] != pytest.approx(ends[2], rel=1e-2)
