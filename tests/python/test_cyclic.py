"""Coupled sectors in FMPy: the stage that ships (on coarse meshes), and a disk written from Python as the guide says."""

import csv
import os
import re
import time
from pathlib import Path
from types import SimpleNamespace

import numpy
import pytest
from fmpy import extract, read_model_description
from fmpy.validation import validate_fmu

from importers import Three, Two
from test_fmu import bits, march

ROOT = Path(__file__).resolve().parents[2]
H, STOP = 2.0e-5, 0.006
KINDS = {"two": Two, "three": Three}
LIBRARY = ["--library", os.environ["TIPRUB_LIBRARY"]] if "TIPRUB_LIBRARY" in os.environ else []


def coarse_scene():
    """The stage that ships, with coarse models, sooner in contact and sooner over."""
    text = (ROOT / "src" / "gallery" / "scenes" / "stage.toml").read_text()
    text = text.replace('"builtin:stage"', '"builtin:stage-nodes-coarse"').replace('"builtin:stage-casing"', '"builtin:stage-casing-coarse"')
    text = text.replace("ramp_time = 5.0e-3", "ramp_time = 1.0e-3").replace("stop = 0.05 ", f"stop = {STOP} ")
    assert re.findall('"builtin:(.*?)"', text) == ["stage-nodes-coarse", "stage-casing-coarse"]
    assert f"stop = {STOP}" in text and "1.0e-3" in text
    return text


def table(path):
    with path.open(newline="") as file:
        header, *rows = list(csv.reader(file))
    return header[1:], [[float(value) for value in row] for row in rows]


@pytest.fixture(scope="session")
def stage(tiprub, tmp_path_factory):
    """The stage, packaged for both versions and run without FMI."""
    directory = tmp_path_factory.mktemp("stage")
    scene = directory / "stage.toml"
    scene.write_text(coarse_scene())
    fmus = {}
    for kind, version in (("two", "2"), ("three", "3")):
        file = directory / f"{kind}.fmu"
        tiprub("package", scene, "--fmi", version, "--arrays", "-o", file, *LIBRARY)
        unpacked = extract(str(file), unzipdir=str(directory / kind))
        fmus[kind] = SimpleNamespace(path=file, directory=unpacked, description=read_model_description(str(file)))
    tiprub("run", scene, "--csv", directory / "native.csv")
    names, rows = table(directory / "native.csv")
    return SimpleNamespace(scene=scene, fmus=fmus, names=names, rows=rows)


def column(stage, name):
    index = stage.names.index(name)
    return [row[1 + index] for row in stage.rows]


@pytest.mark.parametrize("kind", KINDS)
def test_the_fmu_is_valid(stage, kind):
    assert validate_fmu(str(stage.fmus[kind].path)) == []


@pytest.mark.parametrize("kind", KINDS)
def test_every_output_is_the_native_one_bit_for_bit(stage, kind):
    clock = time.process_time()
    instance = KINDS[kind](stage.fmus[kind])
    try:
        instance.initialise()
        print(f"instantiated and initialised in {time.process_time() - clock:.2f} s of processor time")
        results = march(instance, stage.names, [row[0] for row in stage.rows])
    finally:
        instance.free()
    assert results == [bits(row[1:]) for row in stage.rows]


def test_the_oval_casing_touches_and_shakes_the_diameters_it_may(stage):
    assert max(column(stage, "contact_count")) > 0
    assert min(column(stage, "clearance_minimum")) > -1e-9
    # Output n + 1 is nodal diameter n. What has two waves around shakes even numbers only.
    amplitude = [max(column(stage, f"nodal_diameter_amplitude[{n + 1}]")) for n in range(7)]
    assert min(amplitude[0], amplitude[2], amplitude[4]) > 1e-7
    assert max(amplitude[1], amplitude[3], amplitude[5]) < 1e-6 * amplitude[2]
    assert abs(column(stage, "energy_residual_relative")[-1]) < 1e-9


def test_the_load_is_an_input(stage):
    """Without the load, what is out of round is not enough to touch a blade."""
    instance = Three(stage.fmus["three"])
    try:
        instance.put("casing_load_amplitude", [0.0])
        instance.initialise()
        results = march(instance, ["normal_impulse"], [row[0] for row in stage.rows])
    finally:
        instance.free()
    assert set(results) == {bits([0.0])}


def test_the_states_of_coupled_sectors_are_saved_whole(stage):
    times = [row[0] for row in stage.rows]
    instance = Two(stage.fmus["two"])
    try:
        instance.initialise()
        middle = next(index for index, count in enumerate(column(stage, "contact_count")) if count > 0) + 2
        for index in range(middle):
            instance.step(times[index], times[index + 1] - times[index])
        state = instance.fmu.getFMUState()
        runs = []
        for _ in range(2):
            for index in range(middle, middle + 20):
                instance.step(times[index], times[index + 1] - times[index])
            runs.append(bits(instance.read(stage.names)))
            instance.fmu.setFMUState(state)
        instance.fmu.freeFMUState(state)
    finally:
        instance.free()
    assert runs[0] == runs[1] == bits(stage.rows[middle + 20][1:])


def test_the_examples_of_the_rom_chapter_run_and_are_read(tiprub, tmp_path, monkeypatch):
    chapter = (ROOT / "docs" / "rom-file.md").read_text()
    examples = re.findall(r"```python\n(.*?)```", chapter, re.DOTALL)
    assert len(examples) == 3
    monkeypatch.chdir(tmp_path)
    for example in examples:
        exec(compile(example, "rom-file.md", "exec"), {})  # noqa: S102 - the guide's own words
    rom = tiprub("inspect", tmp_path / "disk.rom.safetensors")["rom"]
    assert rom["sectors"] == 24 and rom["nodal_diameters"]["total_order"] == 72
    first = numpy.array([frequencies[0] for frequencies in rom["nodal_diameters"]["frequencies_hz"]])
    assert len(first) == 13 and (numpy.diff(first) > 0).all()
