"""Two rotors in one elastic casing, and a tip and a seal on one blade: FMPy against the native run, energies, torques."""

import csv
import os
from pathlib import Path
from types import SimpleNamespace

import numpy
import pytest
from fmpy import read_model_description, simulate_fmu
from fmpy.validation import validate_fmu

from ring_rom import read_rom, write_ring, write_rom

HERE = Path(__file__).parent


@pytest.fixture(scope="module", params=["two_rotors", "tip_and_seal"])
def product(request, tiprub, scene, work):
    """One of the scenes: packaged twice, and run without FMI."""
    name = request.param
    arrays, metadata = read_rom(scene.parent / "rotor37.rom.safetensors")
    # Of the content as it was.
    metadata.pop("checksum")
    text = (HERE / f"{name}.toml").read_text()
    if name == "two_rotors":
        arrays["contact_positions"] = arrays["contact_positions"] + numpy.array([0.0, 0.0, 0.045])
        write_rom(scene.parent / "rear.rom.safetensors", arrays, metadata)
        write_ring(scene.parent / "long_ring.rom.safetensors", along=10, length=0.09)
    else:
        metadata["contact_names"] = "tip_leading,tip_middle,seal_trailing"
        write_rom(scene.parent / "named.rom.safetensors", arrays, metadata)
        text = text.replace("rotor37.rom", "named.rom")
    path = scene.parent / f"{name}.toml"
    path.write_text(text)
    library = ["--library", os.environ["TIPRUB_LIBRARY"]] if "TIPRUB_LIBRARY" in os.environ else []
    fmus = {}
    for version in ("2", "3"):
        fmus[version] = work / f"{name}_{version}.fmu"
        scalars = ["--scalars"] if version == "3" else []
        tiprub("package", path, "--fmi", version, *scalars, "-o", fmus[version], *library)
    table = work / f"{name}.csv"
    tiprub("run", path, "--csv", table)
    with table.open(newline="") as file:
        header, *rows = list(csv.reader(file))
    return SimpleNamespace(name=name, fmus=fmus, header=header, rows=numpy.array(rows, dtype=float))


def column(product, name):
    return product.rows[:, product.header.index(name)]


@pytest.mark.parametrize("version", ["2", "3"])
def test_fmpy_gives_the_bits_of_the_native_run(product, version):
    file = str(product.fmus[version])
    assert not validate_fmu(file)
    names = [v.name for v in read_model_description(file).modelVariables if v.causality == "output"]
    names = [name for name in names if name in product.header]
    assert len(names) > 40
    result = simulate_fmu(file, output=names, output_interval=2.5e-5, stop_time=1.5e-3)
    for name in names:
        assert list(result[name].astype(float)) == list(column(product, name)), name


def test_names_energies_and_torques(product):
    residual = numpy.abs(column(product, "energy_residual_relative")).max()
    assert residual < 1e-12
    assert column(product, "friction_loss")[-1] > 1.0
    if product.name == "two_rotors":
        turns = {"front": 1800.0, "rear": -1500.0}
        for rotor in turns:
            assert numpy.abs(column(product, f"{rotor}.torque")).max() > 1.0
            assert numpy.abs(column(product, f"{rotor}.blade[1].clearance[1]")).max() < 0.1
        work = sum(-speed * 2.5e-5 * column(product, f"{rotor}.torque")[1:].sum() for rotor, speed in turns.items())
    else:
        torque = column(product, "casing.moment_z") + column(product, "seal.moment_z")
        assert numpy.abs(torque - column(product, "torque")).max() <= 1e-12 * numpy.abs(torque).max()
        assert numpy.abs(column(product, "seal.moment_z")).max() > 1.0
        work = -1800.0 * 2.5e-5 * torque[1:].sum()
    assert work == pytest.approx(column(product, "shaft_work")[-1], rel=1e-11)
