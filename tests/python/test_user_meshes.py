"""A mesh that Gmsh wrote, reduced, packaged and run in FMPy as the guide tells: the same bits as the native run."""

import csv
import os
import re
from pathlib import Path
from types import SimpleNamespace

import pytest
from fmpy import extract, read_model_description
from fmpy.validation import validate_fmu

from importers import Three, Two
from test_fmu import bits, march

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def product(tiprub, tmp_path_factory):
    work = tmp_path_factory.mktemp("blade")
    guide = (ROOT / "docs" / "models.md").read_text()
    scene = re.search(r"```toml\n(.*?)```", guide, re.S).group(1)
    (work / "blade.toml").write_text(scene)
    mesh = ROOT / "tests" / "data" / "models" / "blade_hex20.inp"
    sets = ["--clamp-set", "ROOT", "--sectors", "36", "--units", "mm-t-s", "--material", "steel"]
    tiprub("reduce", "blade", mesh, *sets, "-o", work / "blade.rom.safetensors")
    tiprub("run", work / "blade.toml", "--csv", work / "native.csv")
    library = ["--library", os.environ["TIPRUB_LIBRARY"]] if "TIPRUB_LIBRARY" in os.environ else []
    tiprub("package", work / "blade.toml", "-o", work, *library)
    return work


@pytest.mark.parametrize("version, importer", [(2, Two), (3, Three)])
def test_an_fmu_of_a_users_mesh_runs_with_the_bits_of_the_native_run(product, version, importer):
    path = product / f"blade_rub_fmi{version}.fmu"
    assert validate_fmu(str(path)) == []
    with (product / "native.csv").open(newline="") as file:
        header, *rows = list(csv.reader(file))
    fmu = SimpleNamespace(
        directory=extract(str(path), unzipdir=str(product / path.stem)), description=read_model_description(str(path))
    )
    times, names = [float(row[0]) for row in rows], header[1:]
    touching = sum(float(row[header.index("normal_impulse")]) > 0 for row in rows)
    assert touching > len(rows) / 10, f"contact at {touching} of {len(rows)} points"
    instance = importer(fmu)
    instance.initialise()
    marched = march(instance, names, times)
    instance.free()
    assert marched == [bits([float(value) for value in row[1:]]) for row in rows]


def test_the_scene_and_the_loop_of_the_first_pages_run(tiprub, tmp_path, monkeypatch, capsys):
    scene = re.search(r"```toml\n(.*?)```", (ROOT / "docs" / "first-scene.md").read_text(), re.S).group(1)
    loop = re.search(r"```python\n(.*?)```", (ROOT / "docs" / "coupling.md").read_text(), re.S).group(1)
    monkeypatch.chdir(tmp_path)
    Path("my_scene.toml").write_text(scene)
    library = ["--library", os.environ["TIPRUB_LIBRARY"]] if "TIPRUB_LIBRARY" in os.environ else []
    tiprub("package", "my_scene.toml", *library)
    exec(compile(loop, "coupling.md", "exec"), {})  # noqa: S102 - the guide's own words
    shown = float(re.search(r"print\(speed\)  # ([\d.]+) rad/s", loop).group(1))
    assert abs(float(capsys.readouterr().out.split()[-1]) - shown) <= 0.005
