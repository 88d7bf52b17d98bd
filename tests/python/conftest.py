"""Fixtures: the command line, the reduced rotor 37, its FMUs, and the native run they are compared with.

The command line is `target/release/tiprub` of the workspace, or what the environment variable TIPRUB names.
"""

import csv
import json
import os
import re
import subprocess
from pathlib import Path
from types import SimpleNamespace

import pytest
from fmpy import extract, read_model_description

from importers import Two, Three

ROOT = Path(__file__).resolve().parents[2]
# Models that ship are kept where the tests in Rust keep them: each is reduced once for all tests, and the user's stay alone.
os.environ["TIPRUB_CACHE"] = str(ROOT / "target" / "tmp")


@pytest.fixture(scope="session")
def tiprub():
    """Run the command line; its JSON object."""
    program = Path(os.environ.get("TIPRUB", ROOT / "target" / "release" / "tiprub"))
    assert program.is_file(), f"{program} is missing: run `cargo build --release` first"

    def run(*arguments, fails=False):
        command = [str(program), "--json", "--quiet", *map(str, arguments)]
        result = subprocess.run(command, capture_output=True, text=True, check=False)
        assert (result.returncode != 0) == fails, f"{command}: {result.returncode}\n{result.stdout}\n{result.stderr}"
        return json.loads(result.stdout)

    return run


@pytest.fixture(scope="session")
def work(tmp_path_factory):
    return tmp_path_factory.mktemp("rotor37")


@pytest.fixture(scope="session")
def scene(tiprub, work):
    """The scene beside this file, with the ROM made once."""
    tiprub("reduce", "rotor37", "--contact-nodes", "3", "-o", work / "rotor37.rom.safetensors")
    path = work / "scene.toml"
    path.write_text((Path(__file__).parent / "rotor37.toml").read_text())
    return path


@pytest.fixture(scope="session")
def fmus(tiprub, scene, work):
    """The packaged FMUs: FMI 2.0, FMI 3.0 with arrays, FMI 3.0 with scalars."""
    library = ["--library", os.environ["TIPRUB_LIBRARY"]] if "TIPRUB_LIBRARY" in os.environ else []
    files = SimpleNamespace(two=work / "two.fmu", three=work / "three.fmu", scalars=work / "scalars.fmu")
    tiprub("package", scene, "--fmi", "2", "-o", files.two, *library)
    tiprub("package", scene, "--fmi", "3", "--arrays", "-o", files.three, *library)
    tiprub("package", scene, "--fmi", "3", "--scalars", "-o", files.scalars, *library)
    return files


@pytest.fixture(scope="session")
def whirling(tiprub, scene, work):
    """FMUs of the same rotor in a round casing, with a shaft that whirls."""
    library = ["--library", os.environ["TIPRUB_LIBRARY"]] if "TIPRUB_LIBRARY" in os.environ else []
    shape = re.compile(r"\[surface\.shape\][^\[]*")
    text = shape.sub("", scene.read_text()).replace('name = "rotor"', 'name = "rotor"\nwhirl = true')
    path = work / "whirling.toml"
    path.write_text(text)
    files = SimpleNamespace(two=work / "whirling2.fmu", three=work / "whirling3.fmu")
    tiprub("package", path, "--fmi", "2", "-o", files.two, *library)
    tiprub("package", path, "--fmi", "3", "--arrays", "-o", files.three, *library)
    return files


@pytest.fixture(scope="session")
def marched(tiprub, scene, work):
    """FMUs of the same rotor in a casing that moves, with a tolerance in place of a step, unpacked."""
    library = ["--library", os.environ["TIPRUB_LIBRARY"]] if "TIPRUB_LIBRARY" in os.environ else []
    text = scene.read_text().replace('scheme = "modal-exact"\nstep = 1.0e-6', 'scheme = "galerkin"\nstep = 8.0e-5\ntolerance = 1.0e-3')
    text = text.replace("ramp_time = 0.5e-3", "ramp_time = 0.5e-3\nmoving = true").replace("damping_ratio = 1.0e-3", "damping_ratio = 5.0e-3")
    path = work / "marched.toml"
    path.write_text(text)
    found = SimpleNamespace()
    for name, version in [("two", "2"), ("three", "3")]:
        file = work / f"marched{version}.fmu"
        tiprub("package", path, "--fmi", version, "--arrays", "-o", file, *library)
        directory = extract(str(file), unzipdir=str(work / file.stem))
        setattr(found, name, SimpleNamespace(directory=directory, description=read_model_description(str(file))))
    return found


@pytest.fixture(scope="session")
def native(tiprub, scene, work):
    """The native run: column names and rows, time first."""
    path = work / "native.csv"
    summary = tiprub("run", scene, "--csv", path)
    with path.open(newline="") as file:
        header, *rows = list(csv.reader(file))
    assert header[0] == "time"
    return SimpleNamespace(names=header[1:], rows=[[float(value) for value in row] for row in rows], summary=summary)


@pytest.fixture(scope="session")
def unpacked(fmus, work):
    """Unpacked FMUs with their descriptions."""

    def unpack(path):
        directory = extract(str(path), unzipdir=str(work / path.stem))
        return SimpleNamespace(path=path, directory=directory, description=read_model_description(str(path)))

    return SimpleNamespace(two=unpack(fmus.two), three=unpack(fmus.three), scalars=unpack(fmus.scalars))


@pytest.fixture
def two(unpacked):
    """Maker of FMI 2.0 instances; all are freed in the end."""
    made = []

    def make(**arguments):
        fmu = arguments.pop("fmu", unpacked.two)
        made.append(Two(fmu, **arguments))
        return made[-1]

    yield make
    for instance in made:
        instance.free()


@pytest.fixture
def three(unpacked):
    """Maker of FMI 3.0 instances; all are freed in the end."""
    made = []

    def make(fmu=None, **arguments):
        made.append(Three(fmu or unpacked.three, **arguments))
        return made[-1]

    yield make
    for instance in made:
        instance.free()
