"""The Python module of packaging/python, with the program of the workspace."""

import inspect
import os
import pickle
import signal
import subprocess
import sys
import time
import traceback
from pathlib import Path

import numpy
import pandas
import pytest

from conftest import ROOT

sys.path.insert(0, str(ROOT / "packaging" / "python"))
os.environ.setdefault("TIPRUB", str(ROOT / "target" / "release" / "tiprub"))
import tiprub as module  # noqa: E402

# The blade of docs/rom-file.md.
MASS = numpy.diag([1e-3, 1e-3, 1e-3])
STIFFNESS = numpy.array([[9e5, 1e5, 0.0], [1e5, 4e4, 0.0], [0.0, 0.0, 2e5]])
MAP = numpy.eye(3).reshape(1, 3, 3)
POSITIONS = numpy.array([[0.25, 0.0, 0.02]])
BLADE = {"name": "blade", "origin": "three springs", "sectors": 12, "damping_ratio": 0.002, "contact_names": ["mid_chord"]}
SCENE = {
    "name": "springs",
    "structure": [{"name": "rotor", "rom": "blade.rom.safetensors", "speed": 500.0}],
    "surface": [{"name": "casing", "shape": {"kind": "lobes", "amplitude": 4e-4, "order": 3}, "ramp_time": 1e-3}],
    "contact": [{"master": "rotor", "slave": "casing", "gap": 3.56e-4, "friction": 0.05}],
    "time": {"scheme": "modal-exact", "step": 1e-6},
    "experiment": {"stop": 2e-3, "communication_step": 1e-5},
}


@pytest.fixture
def blade(tmp_path):
    return module.rom(tmp_path / "blade.rom.safetensors", MASS, STIFFNESS, MAP, POSITIONS, **BLADE)


def test_missing_rom_of_a_dict_has_no_hint_on_relative_paths(tmp_path):
    error = refused(module.run, SCENE, directory=tmp_path, quiet=True)
    assert error.what == str(tmp_path / "blade.rom.safetensors") and "structure[1].rom in scene" in error.remedy
    assert "relative" not in error.remedy


def test_a_dict_a_text_and_a_file_are_the_same_scene(blade, tmp_path, tiprub):
    result = module.run(SCENE, directory=tmp_path, quiet=True)
    assert isinstance(result, pandas.DataFrame) and result.index.name == "time"
    assert len(result) == 201 and result.index[-1] == pytest.approx(2e-3)
    assert result["friction_loss"].iloc[-1] > 0
    assert result.attrs["model"] == "springs" and result.attrs["extremes"]["most_contacts"]["value"] > 0
    assert result.warnings == result.attrs["warnings"]
    text = module._scene.toml(SCENE)
    (tmp_path / "scene.toml").write_text(text)
    assert module.run(text, directory=tmp_path, quiet=True).equals(result)
    for file in (tmp_path / "scene.toml", str(tmp_path / "scene.toml")):
        assert module.run(file, quiet=True).equals(result)
    tiprub("run", tmp_path / "scene.toml", "--csv", tmp_path / "native.csv")
    lines = (tmp_path / "native.csv").read_text().splitlines()
    assert [float(value) for value in lines[-1].split(",")[1:]] == list(result.iloc[-1])


def test_a_run_takes_times_and_start_values(blade, tmp_path):
    # A model by its path needs no directory.
    scene = {**SCENE, "structure": [{**SCENE["structure"][0], "rom": blade}]}
    usual = module.run(scene, quiet=True)
    other = module.run(scene, stop=1e-3, step=2e-5, set={"speed": numpy.float64(400), "friction_coefficient": 0}, quiet=True)
    assert list(other.index[[0, 1, -1]]) == pytest.approx([0, 2e-5, 1e-3])
    assert other["friction_loss"].iloc[-1] == 0 and other["rotor_angle"].iloc[-1] == pytest.approx(0.4)
    assert type(usual[["torque"]]) is pandas.DataFrame, "parts are plain"


def test_inputs_over_time_are_tables_or_files(blade, tmp_path):
    table = pandas.DataFrame({"time": [0.0, 1e-3], "speed": [500.0, 600.0]})
    (tmp_path / "inputs.csv").write_text("time,speed\n0,500\n0.001,600\n")
    forms = [table, table.set_index("time"), {"time": [0.0, 1e-3], "speed": [500.0, 600.0]}, tmp_path / "inputs.csv"]
    results = [module.run(SCENE, directory=tmp_path, quiet=True, inputs=form) for form in forms]
    assert all(result.equals(results[0]) for result in results[1:])
    # Half the change over the first millisecond, all of it after.
    assert results[0]["rotor_angle"].iloc[-1] == pytest.approx(0.55 + 0.6, rel=1e-12)
    with pytest.raises(module.Error, match="no such variable"):
        module.run(SCENE, directory=tmp_path, quiet=True, inputs={"time": [0.0], "spee": [1.0]})


def test_notebooks_get_tables(blade, tmp_path):
    result = module.run(SCENE, directory=tmp_path, quiet=True)
    page = result._repr_html_()
    assert "springs" in page and "friction_loss" in page and "largest_node_normal_force" in page
    facts = module.inspect(blade)
    assert str(blade) in facts._repr_html_() and "mid_chord" in facts._repr_html_()
    assert module._program.as_html({"<a>": [1, 2]}) == (
        "<table><tr><th style='text-align:left'>&lt;a&gt;</th><td style='text-align:left'>1, 2</td></tr></table>")


def test_a_rom_of_arrays_is_that_of_the_guide(blade, tmp_path):
    """The sample of docs/rom-file.md, run as it stands, and the same through the module."""
    samples = (ROOT / "docs" / "rom-file.md").read_text().split("```python\n")[1:3]
    (tmp_path / "guide").mkdir()
    before = os.getcwd()
    os.chdir(tmp_path / "guide")
    try:
        spaces = [{}, {}]
        for sample, space in zip(samples, spaces):
            exec(sample.split("```")[0], space)  # noqa: S102
    finally:
        os.chdir(before)
    runs = [module.run(SCENE, directory=place, quiet=True) for place in (tmp_path, tmp_path / "guide")]
    assert runs[0].equals(runs[1]) and runs[0].attrs["extremes"]["most_contacts"]["value"] > 0

    # Coupled sectors: complex arrays, and the last ones real.
    arrays = spaces[1]["arrays"]
    joined = {name: array[..., 0] + 1j * array[..., 1] for name, array in arrays.items() if name.rsplit("_")[-1].isdigit()}
    joined = {name: array.real if name.endswith("_12") else array for name, array in joined.items()}
    plain = [arrays[name] for name in ("mass", "stiffness", "contact_map", "contact_positions")]
    disk = module.rom(tmp_path / "disk.rom.safetensors", *plain, **{**BLADE, "name": "disk", "sectors": 24, "origin": "springs in a ring"}, **joined)
    scene = {**SCENE, "structure": [{"name": "rotor", "rom": "disk.rom.safetensors", "speed": 500.0}]}
    runs = [module.run(scene, stop=5e-4, directory=place, quiet=True) for place in (disk.parent, tmp_path / "guide")]
    assert runs[0].equals(runs[1])


def test_the_samples_of_the_guide_run(tmp_path, monkeypatch, capsys):
    _, arrays, scenes, errors = (ROOT / "docs" / "python.md").read_text().split("```python\n")[1:]
    space = {"tiprub": module, "numpy": numpy}
    exec(arrays.split("```")[0], space)  # noqa: S102
    assert len(space["result"]) > 1
    monkeypatch.chdir(tmp_path)
    exec(scenes.split("```")[0], {})  # noqa: S102
    losses = [float(line.split()[1]) for line in capsys.readouterr().out.splitlines()]
    assert len(losses) == 3 and 0 < losses[0] < losses[1] < losses[2]
    exec(errors.split("```")[0], {"tiprub": module})  # noqa: S102
    assert "Give the path of a scene file" in capsys.readouterr().out


def test_a_rom_has_every_entry_and_order_of_memory(tmp_path):
    from ring_rom import read_rom

    more = {"contact_areas": [1e-6], "contact_lengths": [1e-3], "basis": "craig-bampton"}
    path = module.rom(tmp_path / "a.safetensors", MASS, numpy.asfortranarray(STIFFNESS + numpy.diag([0, 1, 2.0])), MAP, POSITIONS, **BLADE, **more)
    arrays, entries = read_rom(path)
    assert (arrays["stiffness"] == STIFFNESS + numpy.diag([0, 1, 2.0])).all() and arrays["contact_areas"] == [1e-6]
    assert entries["format_version"] == "1" and entries["contact_names"] == "mid_chord" and entries["damping_ratio"] == "0.002"
    with pytest.raises(module.Error, match="symmetric"):
        module.rom(tmp_path / "b.safetensors", MASS, numpy.triu(STIFFNESS), MAP, POSITIONS, **BLADE)
    with pytest.raises(module.Error, match="contact_area"):
        module.rom(tmp_path / "b.safetensors", MASS, STIFFNESS, MAP, POSITIONS, **BLADE, contact_area=[1e-6])
    with pytest.raises(module.Error, match="`bases`.*numbers"):
        module.rom(tmp_path / "b.safetensors", MASS, STIFFNESS, MAP, POSITIONS, **BLADE, bases="craig-bampton")


def test_the_table_of_entries_is_that_of_the_guide():
    text = (ROOT / "docs" / "rom-file.md").read_text().split("<!-- generated: metadata -->")[1].split("<!-- end")[0]
    entries = {line.split("`")[1] for line in text.splitlines() if line.startswith("| `")}
    given = set(inspect.signature(module.rom).parameters) | {"format", "format_version", "checksum"}
    assert entries == module._rom.ENTRIES | (given & entries)


def test_packages_are_listed(blade, tmp_path):
    library = {"library": os.environ["TIPRUB_LIBRARY"]} if "TIPRUB_LIBRARY" in os.environ else {}
    scene = {**SCENE, "structure": [{**SCENE["structure"][0], "rom": module.inspect(blade)}]}
    files = module.package(scene, tmp_path / "out", quiet=True, **library)
    assert [file.name for file in files] == ["springs_fmi2.fmu", "springs_fmi3.fmu"]
    (one,) = module.package(scene, tmp_path / "one.fmu", fmi=3, arrays=True, platforms=["x86_64-linux"], quiet=True, **library)
    facts = module.inspect(one)
    assert facts["kind"] == "fmu" and facts["fmi_version"] == "3.0" and facts.path == one == Path(os.fspath(facts))
    assert facts.warnings == []
    with pytest.raises(module.Error) as caught:
        module.package(scene, tmp_path / "one.fmu", quiet=True, **library)
    assert caught.value.exit_code == 2 and "two FMUs" in caught.value.problem


def test_errors_have_what_problem_and_remedy(blade, tmp_path):
    with pytest.raises(module.Error) as caught:
        module.run(tmp_path / "none.toml", quiet=True)
    error = caught.value
    assert error.what.endswith("none.toml") and "cannot be read" in error.problem and error.remedy.startswith("Give the path")
    assert str(error).startswith(f"{error.what}: {error.problem}. Give the path")
    with pytest.raises(module.Error, match="^scene:.*`?fricton") as caught:
        module.run({**SCENE, "contact": [{**SCENE["contact"][0], "fricton": 0.1}]}, directory=tmp_path, quiet=True)
    with pytest.raises(module.Error) as caught:
        module.run(SCENE, directory=tmp_path, quiet=True, estimat=True)
    assert caught.value.exit_code == 2 and "keyword `estimat`" in str(caught.value)
    with pytest.raises(module.Error, match="no variable|speeed"):
        module.run(SCENE, directory=tmp_path, set={"speeed": 1.0}, quiet=True)
    assert module.inspect("builtin:rotor37-one-row").path is None
    with pytest.raises(TypeError):
        os.fspath(module.inspect(SCENE, directory=tmp_path))


def test_errors_are_shown_and_pickled_by_their_public_name():
    error = module.Error("plan.toml", "cannot be read", "Give a file", 2)
    assert "".join(traceback.format_exception_only(type(error), error)) == "tiprub.Error: plan.toml: cannot be read. Give a file.\n"
    again = pickle.loads(pickle.dumps(error))
    assert type(again) is module.Error and (str(again), again.exit_code) == (str(error), 2)


def test_the_program_is_found(monkeypatch, tmp_path):
    monkeypatch.setenv("TIPRUB", str(tmp_path / "nothing"))
    with pytest.raises(module.Error, match="cannot be started"):
        module.inspect("builtin:rotor37")
    monkeypatch.delenv("TIPRUB")
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(module.Error, match="not installed"):
        module.program()
    fake = tmp_path / ("tiprub.exe" if os.name == "nt" else "tiprub")
    fake.write_text("#!/bin/sh\necho half {\nexit 3\n")
    fake.chmod(0o755)
    assert module.program() == str(fake)
    with pytest.raises(module.Error, match="ended with 3"):
        module.inspect("builtin:rotor37")
    monkeypatch.setattr("sysconfig.get_path", lambda *_: str(tmp_path / "scripts"))
    (tmp_path / "scripts").mkdir()
    (tmp_path / "scripts" / fake.name).write_text("")
    assert module.program() == str(tmp_path / "scripts" / fake.name)


def test_progress_goes_to_stderr_unless_quiet(blade, tmp_path, capsys):
    module.run(SCENE, directory=tmp_path)
    assert "springs" in capsys.readouterr().err
    module.run(SCENE, directory=tmp_path, quiet=True)
    assert capsys.readouterr() == ("", "")


def test_caught_errors_print_nothing(tmp_path, capfd):
    for call in (module.run, module.package, module.inspect):
        with pytest.raises(module.Error, match="none.toml: cannot be read"):
            call("none.toml")
    with pytest.raises(module.Error, match="no such argument"):
        module.run(SCENE, directory=tmp_path, sett=1)
    assert capfd.readouterr() == ("", "")


def test_reductions_say_where_they_are(tmp_path):
    made = module.reduce("casing", output=tmp_path / "casing.rom.safetensors", element="hex8", mesh="24x1x6", contact_grid="12x3", patches="0x0", modes=12, quiet=True)
    assert made.path == tmp_path / "casing.rom.safetensors" and made.path.is_file() and made["rom"]["name"]
    with pytest.raises(module.Error, match="already exists.*--force"):
        module.reduce("casing", output=made, quiet=True)


def test_studies_are_read_back(blade, tmp_path):
    found = module.study("stability", SCENE, tmp_path / "study", friction="0:0.2:2", speeds="400:500:2", steps="1e-7:1e-6:2",
                         directory=tmp_path, set={"gap_offset": 1e-5}, quiet=True)
    assert found.path == tmp_path / "study" and (found.path / "index.html").is_file() and len(found) > 0


def test_the_demo_is_asked_for(tmp_path, monkeypatch):
    """Not run: it takes minutes."""
    asked = []
    monkeypatch.setattr(module, "call", lambda words, files=(), quiet=False: asked.append((words, quiet)) or {"model": "rotor37"})
    made = module.demo(tmp_path / "demo", revolutions=2, quiet=True, platform=["x86_64-linux"])
    assert asked == [(["demo", f"--out={tmp_path / 'demo'}", "--revolutions=2", "--platform=x86_64-linux"], True)]
    assert made.path == tmp_path / "demo" and made["model"] == "rotor37"
    monkeypatch.undo()
    with pytest.raises(module.Error, match="none.so"):
        module.demo(tmp_path / "demo", quiet=True, library=tmp_path / "none.so")


def test_words_of_the_command_line():
    words = module._program.options({"contact_nodes": 3, "force": True, "estimate": False, "csv": None, "clamp_set": ["A", "B"], "stop": numpy.float64(1e-5)})
    assert words == ["--contact-nodes=3", "--force", "--clamp-set=A", "--clamp-set=B", "--stop=1e-05"]
    assert module._program.assignments({"heat": numpy.array([1.5, 2.0]), "moving": True, "x": -0.1}) == [
        "--set=heat=[1.5,2.0]", "--set=moving=true", "--set=x=-0.1"]
    assert module._program.options({"platform": "x86_64-linux"}) == module._program.options({"platform": {"x86_64-linux"}}) == ["--platform=x86_64-linux"]


def refused(call, *arguments, **keywords):
    """The error of a call, which says what to do."""
    with pytest.raises(module.Error) as caught:
        call(*arguments, **keywords)
    assert caught.value.remedy, caught.value
    return caught.value


def nothing_is_asked(monkeypatch):
    """What is refused from here on is refused before the program runs."""
    def popen(*_, **__):
        raise AssertionError("the program was asked")
    monkeypatch.setattr(module._program.subprocess, "Popen", popen)


@pytest.mark.parametrize("value", [
    {"a": 1.0}, b"1", {1.0}, None, 1j, object(), (one for one in [1.0]), numpy.array(b"1"), [], numpy.zeros(0), numpy.eye(2), [[1.0], [1.0, 2.0]],
    ["1", "2"], [1.0, None], numpy.ma.array([1.0, 2.0], mask=[False, True]), numpy.datetime64("2020-01-01"),
], ids=repr)
def test_start_values_are_numbers_words_and_rows(value, monkeypatch):
    nothing_is_asked(monkeypatch)
    for ask in (module.run, lambda scene, **more: module.study("map", scene, **more)):
        error = refused(ask, SCENE, set={"speed": value}, quiet=True)
        assert error.exit_code == 2 and error.what == "keyword `set`, `speed`"


@pytest.mark.parametrize("value", [[("speed", 1.0)], "speed=1", 3, {"speed"}])
def test_start_values_have_names(value, monkeypatch):
    nothing_is_asked(monkeypatch)
    assert refused(module.run, SCENE, set=value, quiet=True).what == "keyword `set`"


def test_scalars_of_numpy_are_scalars(blade, tmp_path):
    def run(**start):
        return module.run(SCENE, directory=tmp_path, stop=1e-4, set=start, quiet=True)
    assert run(speed=numpy.array(400.0)).equals(run(speed=400)) and not run(speed=400).equals(run(speed=401))
    assert run(speed=numpy.float32(400.0), solver=numpy.str_("coulomb")).equals(run(speed="400", solver="coulomb"))


def test_arrays_are_as_long_as_their_variable():
    def run(value):
        return module.run("builtin:flexible-casing", stop=2e-5, set={"casing_temperature": value}, quiet=True)
    assert run(numpy.full(12, 20.5)).equals(run(20.5))
    assert not run(numpy.arange(12)).equals(run(0))
    for count in (1, 11, 13):
        error = refused(run, numpy.zeros(count))
        assert error.exit_code == 2 and "casing_temperature" in error.what and "array of 12" in error.problem and "12 values" in error.remedy
    assert "not finite" in str(refused(run, [numpy.nan] * 12))
    assert "one value" in str(refused(module.run, "builtin:flexible-casing", set={"speed": [1.0]}, quiet=True))


@pytest.mark.parametrize("keyword", ["csv", "help", "json", "version", "output"])
def test_keywords_of_the_module_are_refused_by_name(keyword, tmp_path, monkeypatch):
    nothing_is_asked(monkeypatch)
    calls = [(module.run, SCENE), (module.inspect, SCENE), (module.study, "map", SCENE), (module.demo,)]
    calls += [(module.package, SCENE), (module.reduce, "casing")] if keyword != "output" else []
    for call in calls:
        for value in (True, "x", None):
            error = refused(*call, **{keyword: value})
            assert error.exit_code == 2 and error.what == f"keyword `{keyword}`", call


def test_keywords_of_other_functions_are_refused_by_name(monkeypatch):
    nothing_is_asked(monkeypatch)
    for call, keyword in [((module.package, SCENE), "platform"), ((module.package, SCENE), "set"), ((module.run, SCENE), "out"),
                          ((module.package, SCENE), "out"), ((module.inspect, SCENE), "set")]:
        assert refused(*call, **{keyword: "x"}).what == f"keyword `{keyword}`"
    for value in ({"a": 1}, b"TIP", ["A", None], object()):
        assert refused(module.reduce, "blade", "mesh.inp", contact_set=value).what == "keyword `contact_set`"
    assert refused(module.package, SCENE, platforms={"x86_64-linux": True}).what == "keyword `platforms`"
    for kind in (None, 3, "", "--help"):
        for call in ((module.reduce, kind), (module.study, kind, SCENE)):
            assert refused(*call).what == "kind"
    assert refused(module.reduce, "blade", 3).what == "file"
    for call in ((module.demo, 3), (module.study, "map", SCENE, 3)):
        assert refused(*call).what == "keyword `out`"


def test_misspelled_keywords_are_reported_as_keywords():
    calls = {"run": (module.run, SCENE), "package": (module.package, SCENE), "reduce": (module.reduce, "blade", "mesh.inp"),
             "study": (module.study, "map", SCENE), "inspect": (module.inspect, SCENE), "demo": (module.demo,)}
    for function, wrong, value, similar in [
        ("run", "stopp", 1, "stop"), ("run", "sett", {"speed": 1.0}, "set"), ("run", "quite", True, "quiet"), ("run", "estimat", True, "estimate"),
        ("package", "platfrms", ["x86_64-linux"], "platforms"), ("package", "librarys", "a", "library"),
        ("reduce", "contact_sets", "TIP", "contact_set"), ("study", "sped", "1:2:3", "speeds"), ("demo", "revolution", 1, "revolutions"),
        ("inspect", "no_cash", True, "no_cache"), ("run", "csvv", "a.csv", None), ("run", "nonsense", 1, None),
    ]:
        call, *arguments = calls[function]
        error = refused(call, *arguments, **{wrong: value})
        command = f"{function} {arguments[0]}" if function in ("reduce", "study") else function
        proposal = f"Did you mean `{similar}`? " if similar else ""
        assert (error.what, error.exit_code) == (f"keyword `{wrong}`", 2) and error.problem == f"tiprub.{function} has no such argument"
        assert error.remedy == f"{proposal}See help(tiprub.{function}) and `tiprub {command} --help`"


def test_a_refused_rom_changes_no_file(blade, tmp_path):
    before = blade.read_bytes()
    for arrays in [(numpy.triu(STIFFNESS), STIFFNESS), (MASS * numpy.nan, STIFFNESS), (None, STIFFNESS), (MASS, "K"), (MASS, [[None]])]:
        error = refused(module.rom, blade, *arrays, MAP, POSITIONS, **BLADE)
        assert error.what.startswith(str(blade)) and ".tiprub-" not in str(error)
    for keywords in ({"name": ""}, {"name": None}, {"name": b"blade"}, {"origin": {"a": 1}}, {"contact_names": ["mid", None]}):
        error = refused(module.rom, blade, MASS, STIFFNESS, MAP, POSITIONS, **{**BLADE, **keywords})
        assert error.what == f"{blade}: `{next(iter(keywords))}`"
    assert blade.read_bytes() == before and list(tmp_path.iterdir()) == [blade]
    assert module.rom(blade, 2 * MASS, STIFFNESS, MAP, POSITIONS, **BLADE) == blade
    assert blade.read_bytes() != before and list(tmp_path.iterdir()) == [blade]


def test_a_rom_that_cannot_be_written_is_called_by_its_name(tmp_path):
    (tmp_path / "directory").mkdir()
    for name in ("directory", "none/a.rom.safetensors", "zero\0"):
        error = refused(module.rom, tmp_path / name, MASS, STIFFNESS, MAP, POSITIONS, **BLADE, check=False)
        assert error.what == str(tmp_path / name) and "cannot be written" in error.problem
    assert [path.name for path in tmp_path.rglob("*")] == ["directory"]
    assert refused(module.rom, None, MASS, STIFFNESS, MAP, POSITIONS, **BLADE).what == "path"


@pytest.mark.skipif(os.name == "nt", reason="links need rights there")
def test_a_rom_is_written_through_a_link_with_usual_rights(blade, tmp_path):
    (tmp_path / "other").mkdir()
    link = tmp_path / "other" / "link.rom.safetensors"
    link.symlink_to(blade)
    plain = tmp_path / "plain"
    plain.touch()
    before = blade.read_bytes()
    module.rom(link, 2 * MASS, STIFFNESS, MAP, POSITIONS, **BLADE)
    assert link.is_symlink() and blade.read_bytes() != before and blade.stat().st_mode == plain.stat().st_mode


def test_roms_of_a_text_are_found_and_nothing_else_is_changed():
    text = r'''
# rom = "comment"
name = "rom = 'a'" # 'rom = "b"
description = """
rom = "c" \""" rom = "d"
"""
other = @@@
rom = "e" @@@
"a rom" = "f"
from-rom = "g"
[[structure]]
rom="plain"
[[structure]]
"rom" = 'literal\x'
[[structure]]
'rom'	= "\U0001F600 \u00e9 \"quoted\""
[[structure]]
rom = @@@single@@@ # rom = "h"
[[structure]]
rom = """\
  long \
  name"""
[[structure]]
rom = "builtin:b"
[[structure]]
rom = "/absolute"
[more]
list = [{ name = "x", rom = "inline" }, {rom = "", wrong = 3}]
'''.replace("@@@", "'''")
    tomllib = module._scene.tomllib
    directory = Path("/d").absolute()
    before, found = tomllib.loads(text), module._scene.as_text(text, directory)
    after = tomllib.loads(found)
    names = ["plain", "literal\\x", '\U0001F600 \u00e9 "quoted"', "single", "long name"]
    assert [one["rom"] for one in after["structure"]] == [str(directory / name) for name in names] + ["builtin:b", str(directory / "/absolute")]
    assert after["more"]["list"][0] == {"name": "x", "rom": str(directory / "inline")}
    for key in ("name", "description", "other", "a rom", "from-rom"):
        assert after[key] == before[key]
    # Lines stay where they are, and comments what they are.
    assert found.count("\n") == text.count("\n")
    assert '\n# rom = "comment"\nname = ' in found and ' # rom = "h"\n' in found and """ # 'rom = "b"\n""" in found


def test_errors_of_a_text_have_its_lines(blade, tmp_path):
    text = module._scene.toml(SCENE).replace('"blade.rom.safetensors"', '"""\\\n  blade.rom\\\n  .safetensors"""')
    assert module.run(text, directory=tmp_path, stop=1e-4, quiet=True).equals(module.run(SCENE, directory=tmp_path, stop=1e-4, quiet=True))
    line = text.count("\n") + 1
    for wrong in ("gapp = 3\n", "gap = \n", 'rom = "\\q"\n'):
        assert refused(module.run, text + wrong, directory=tmp_path, quiet=True).what.startswith(f"scene:{line}:")


@pytest.mark.parametrize("scene", [None, 3, b"builtin:rotor37", ["builtin:rotor37"], object()], ids=repr)
def test_what_is_no_scene_is_refused(scene, monkeypatch):
    nothing_is_asked(monkeypatch)
    for call in ((module.run,), (module.package,), (module.inspect,), (module.study, "map")):
        assert refused(*call, scene).what == "scene"


def test_values_that_no_scene_holds_are_refused_with_their_place(blade, tmp_path, monkeypatch):
    def run(**changes):
        return refused(module.run, {**SCENE, **changes}, directory=tmp_path, quiet=True).what
    for changes in ({"structure": None}, {"structure": "rotor"}, {"structure": [3]}, {"structure": {"rom": "a"}}, {"time": 3}, {"a b": [{}]}):
        assert run(**changes).startswith("scene")
    nothing_is_asked(monkeypatch)
    rotor = SCENE["structure"][0]
    for wrong in (None, b"x", {1}, 1j, object()):
        assert run(name=wrong) == "scene: name"
        assert run(time={"step": wrong}) == "scene: time.step"
        assert run(structure=[{**rotor, "speed": [1.0, wrong]}]) == "scene: structure[1].speed[2]"
        assert run(surface=[{"shape": {"kind": wrong}}]) == "scene: surface[1].shape.kind"
        assert run(structure=[{**rotor, "rom": wrong}]) == "scene: structure[1].rom"
    # A report of what ships stands for no file.
    assert run(structure=[{**rotor, "rom": module.Report({})}]) == "scene: rom"
    assert refused(module.run, SCENE, directory=None).what == "keyword `directory`"
    assert "UTF-8" in refused(module.run, {**SCENE, "name": "\udc80"}, quiet=True).remedy
    assert refused(module.run, module.Report({})).what == "scene"


def test_odd_words_reach_the_program(blade, tmp_path):
    odd = tmp_path / 'a "b" \x7f é.safetensors'
    if os.name != "nt":
        scene = {**SCENE, "structure": [{**SCENE["structure"][0], "rom": blade.rename(odd)}]}
        assert len(module.run(scene, stop=1e-4, quiet=True)) == 11
    for call in ((module.inspect, "zero\0"), (module.reduce, "casing\0")):
        assert "zero byte" in refused(*call, quiet=True).remedy


@pytest.mark.skipif(os.name == "nt", reason="no such signals there")
@pytest.mark.parametrize("work", ["tiprub.run('name = 1\\n')", "tiprub.run({'name': 'a'})",
                                  "tiprub.rom('kept/a.rom.safetensors', [[1]], [[1]], [[[1]] * 3], [[1, 0, 0]], name='a')"])
def test_an_interrupt_leaves_nothing(work, tmp_path):
    fake = tmp_path / "tiprub"
    fake.write_text(f"#!/bin/sh\necho $$ > {tmp_path}/pid.new\nmv {tmp_path}/pid.new {tmp_path}/pid\nexec sleep 60\n")
    fake.chmod(0o755)
    for name in ("temporary", "kept"):
        (tmp_path / name).mkdir()
    # Where SIGINT is ignored, as in background jobs of a shell, it would be so here.
    code = f"import signal, tiprub\nsignal.signal(signal.SIGINT, signal.default_int_handler)\n{work}"
    environment = {**os.environ, "TIPRUB": str(fake), "TMPDIR": str(tmp_path / "temporary"), "PYTHONPATH": str(ROOT / "packaging" / "python")}
    with subprocess.Popen([sys.executable, "-c", code], cwd=tmp_path, env=environment, stderr=subprocess.PIPE) as process:
        deadline = time.monotonic() + 30
        while not (tmp_path / "pid").exists() and time.monotonic() < deadline:
            time.sleep(0.01)
        assert list((tmp_path / "temporary").iterdir()) or list((tmp_path / "kept").iterdir()), "there is something to leave"
        process.send_signal(signal.SIGINT)
        assert b"KeyboardInterrupt" in process.communicate(timeout=30)[1]
    assert not list((tmp_path / "temporary").iterdir()) and not list((tmp_path / "kept").iterdir())
    with pytest.raises(ProcessLookupError):
        os.kill(int((tmp_path / "pid").read_text()), 0)


@pytest.mark.skipif(os.name == "nt", reason="no such signals there")
def test_an_interrupt_while_the_program_starts_leaves_no_process(monkeypatch, tmp_path):
    fake = tmp_path / "tiprub"
    fake.write_text("#!/bin/sh\nexec sleep 60\n")
    fake.chmod(0o755)
    started = []

    class Interrupted(subprocess.Popen):
        def __init__(self, *words, **more):
            super().__init__(*words, **more)
            started.append(self.pid)
            signal.raise_signal(signal.SIGINT)

    monkeypatch.setenv("TIPRUB", str(fake))
    monkeypatch.setattr(subprocess, "Popen", Interrupted)
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt):
            module.inspect("scene.toml")
    finally:
        signal.signal(signal.SIGINT, before)
    with pytest.raises(ProcessLookupError):
        os.kill(started[0], 0)
