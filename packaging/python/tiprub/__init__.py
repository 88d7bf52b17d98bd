"""Blade-tip/casing contact (rub) in a compressor or turbine stage, as an FMU.

Every function runs a command of the program `tiprub`, which is installed with this module. All values are in SI units. A scene is
a file, a built-in scene (`"builtin:rotor37"`), TOML text, or a dict of the same form. Failures raise an `Error`.
"""

from __future__ import annotations

import csv as _csv
import json
import os
import tempfile
from importlib import metadata as _metadata
from pathlib import Path
from typing import Any, Iterable, Mapping, Optional, Union

import numpy
import pandas

from ._program import Error, Report, as_html, assignments, call, kind_of, options, place, program
from ._rom import rom
from ._scene import BUILTIN, Scene, scene_file
from ._sweep import sweep

__all__ = ["Error", "Report", "Result", "Scene", "demo", "inspect", "package", "program", "reduce", "rom", "run", "study", "sweep"]
try:
    __version__ = _metadata.version("tiprub")
except _metadata.PackageNotFoundError:
    __version__ = "unknown"

Place = Union[str, "os.PathLike[str]"]


class Result(pandas.DataFrame):
    """Outputs of a run over time: a pandas.DataFrame.

    The index is the time (s) of each communication point, the columns are the FMI 2.0 names of the outputs in the units of the
    model description. `attrs` contains the results of `tiprub run --json` without `last` and `csv`: `model`, `extremes`, `warnings`,
    `seconds`, `internal_steps`, ... Parts of a result are plain DataFrames.
    """

    @property
    def _constructor(self) -> type:
        return pandas.DataFrame

    @property
    def warnings(self) -> list[str]:
        """Warnings of the run."""
        return self.attrs.get("warnings", [])

    def _repr_html_(self) -> str:
        keys = ("model", "start", "stop", "communication_steps", "internal_steps", "extremes", "warnings")
        return as_html({key: self.attrs[key] for key in keys if key in self.attrs}) + (super()._repr_html_() or "")


def run(
    scene: Scene,
    stop: Optional[float] = None,
    step: Optional[float] = None,
    set: Optional[Mapping[str, Any]] = None,
    inputs: Union[None, Place, pandas.DataFrame, Mapping[str, Any]] = None,
    *,
    directory: Place = ".",
    quiet: bool = False,
    **more: Any,
) -> Result:
    """Run a scene without FMI.

    Parameters
    ----------
    scene : str, path or dict
        File, `builtin:NAME`, TOML text of several lines, or dict.
    stop : float, s
        Stop time, instead of the scene's.
    step : float, s
        Communication step H, instead of the scene's.
    set : dict
        Start values of inputs and parameters by name, such as `{"speed": 1700.0}`. An array takes a number for all of its
        elements, or an array_like of shape (elements,).
    inputs : pandas.DataFrame, dict or path
        Inputs and tunable parameters over time: columns by name, with `time` (s) as a column or as the index; or a CSV file. Values are
        linear between the rows and are applied without delay.
    directory : path
        Directory of ROM files that a dict or text names with a relative path.
    quiet : bool
        Suppress progress on stderr; warnings are in the result.
    **more
        Other options of `tiprub run`: `estimate=True`, `no_cache=True`.

    Returns
    -------
    Result
        A pandas.DataFrame with a row per communication point. The numbers equal those of the program to the last bit.

    Raises
    ------
    Error
        The scene, a start value or a keyword is rejected, or the run fails.
    """
    with scene_file(scene, directory) as file, tempfile.TemporaryDirectory(prefix="tiprub-") as own:
        csv = Path(own) / "result.csv"
        given = _history(inputs, Path(own) / "inputs.csv")
        words = ["run", *options({"csv": csv, "stop": stop, "step": step, "inputs": given}, more, "run"), *assignments(set)]
        answer = call(words, [file], quiet)
        with csv.open(encoding="utf-8", newline="") as table:
            names = next(_csv.reader(table))
            values = numpy.loadtxt(table, delimiter=",", ndmin=2)
    result = Result(values[:, 1:], index=pandas.Index(values[:, 0], name=names[0]), columns=names[1:])
    result.attrs.update((key, item) for key, item in answer.items() if key not in ("csv", "last"))
    return result


def _history(inputs: Union[None, Place, pandas.DataFrame, Mapping[str, Any]], file: Path) -> Optional[Place]:
    """Return the CSV file of inputs over time; a table is written to `file` first."""
    if inputs is None or isinstance(inputs, (str, os.PathLike)):
        return inputs
    table = pandas.DataFrame(inputs)
    table = table.set_index("time") if "time" in table.columns else table
    table.to_csv(file, index_label="time")
    return file


def package(
    scene: Scene,
    output: Place = ".",
    *,
    fmi: Union[int, str] = "both",
    arrays: bool = False,
    scalars: bool = False,
    platforms: Union[str, Iterable[str]] = (),
    directory: Place = ".",
    quiet: bool = False,
    **more: Any,
) -> list[Path]:
    """Pack a scene as FMUs.

    Parameters
    ----------
    scene, directory, quiet
        As for `run`.
    output : path
        Directory for NAME_fmi2.fmu and NAME_fmi3.fmu, or with one `fmi` a file.
    fmi : {"both", 2, 3}
        FMI version.
    arrays, scalars : bool
        FMI 3.0: keep whole arrays, or always use scalars. By default, arrays are used if there would be more than 300 scalars.
    platforms : str or iterable of str
        Include only these platforms, such as `["x86_64-windows"]`.
    **more
        Other options of `tiprub package`: `library=FILE_OR_DIRECTORY`, `no_cache=True`.

    Returns
    -------
    list of pathlib.Path
        Paths of the FMUs.

    Raises
    ------
    Error
        The scene is rejected, there is no library, or files cannot be written.
    """
    asked = {"output": output, "fmi": fmi, "arrays": arrays, "scalars": scalars, "platform": platforms}
    with scene_file(scene, directory) as file:
        answer = call(["package", *options(asked, more, "package")], [file], quiet)
    return [Path(fmu["file"]) for fmu in answer["fmus"]]


def reduce(kind: str, file: Optional[Place] = None, output: Optional[Place] = None, *, quiet: bool = False, **more: Any) -> Report:
    """Make a reduced-order model (ROM) from a mesh, from matrices, or of a built-in structure.

    Parameters
    ----------
    kind : str
        `"blade"`, `"sector"`, `"casing-mesh"`, `"casing"`, `"rotor37"`, ...: see `tiprub reduce --help`.
    file : path
        Mesh file, if the kind accepts one.
    output : path
        ROM file, by default NAME.rom.safetensors.
    quiet : bool
        Suppress progress on stderr.
    **more
        Options of `tiprub reduce KIND`: `contact_set="TIP"`, `clamp_set=["A", "B"]`, `contact_patches=9`, `force=True`, ...

    Returns
    -------
    Report
        Description of the ROM with its checks; its `path` is the file, and a dict scene accepts the report as `rom`.

    Raises
    ------
    Error
        Files or options are wrong, or the file already exists (`force=True` replaces it).
    """
    words = ["reduce", kind_of(kind), *options({"output": output}, more, "reduce")]
    answer = call(words, [place("file", file)] if file is not None else [], quiet)
    return Report(answer, Path(answer["files"]["rom"]))


def inspect(path: Scene, *, directory: Place = ".", quiet: bool = True, **more: Any) -> Report:
    """Inspect and validate an FMU, ROM or scene.

    Parameters
    ----------
    path : path, str or dict
        FMU, ROM, or scene as for `run`.
    directory, quiet
        As for `run`.
    **more
        Other options of `tiprub inspect`: `no_cache=True`.

    Returns
    -------
    Report
        A dict with `kind` and the results of `tiprub inspect --json`; a table in notebooks.

    Raises
    ------
    Error
        The file is missing, of an unknown kind, damaged or rejected.
    """
    with scene_file(path, directory) as file:
        answer = call(["inspect", *options({}, more, "inspect")], [file], quiet)
    named = isinstance(path, (str, os.PathLike)) and file == place("path", path) and not file.startswith(BUILTIN)
    return Report(answer, Path(file) if named else None)


def study(
    kind: str,
    scene: Scene,
    out: Optional[Place] = None,
    *,
    set: Optional[Mapping[str, Any]] = None,
    directory: Place = ".",
    quiet: bool = False,
    **more: Any,
) -> Report:
    """Study a scene, with pictures and numbers.

    Parameters
    ----------
    kind : {"stability", "convergence", "error", "map"}
        Kind of study.
    scene, set, directory, quiet
        As for `run`.
    out : path
        Directory for index.html, figures and results.json, by default study-KIND.
    **more
        Options of `tiprub study KIND`: `quick=True`, `speeds="1200:1500:61"`, `window=2e-3`, ...

    Returns
    -------
    Report
        Content of results.json; its `path` is the directory.

    Raises
    ------
    Error
        The scene is rejected, a run fails, or files cannot be written.
    """
    kept = Path(place("keyword `out`", out) if out is not None else f"study-{kind_of(kind)}")
    with scene_file(scene, directory) as file:
        call(["study", kind_of(kind), *options({"out": kept}, more, "study"), *assignments(set)], [file], quiet)
    return Report(json.loads((kept / "results.json").read_text(encoding="utf-8")), kept)


def demo(out: Place = "demo", *, revolutions: Optional[float] = None, quiet: bool = False, **more: Any) -> Report:
    """Run all steps on NASA rotor 37: ROM, FMUs, import and run, report.html.

    Parameters
    ----------
    out : path
        Directory for all files; created if missing.
    revolutions : float
        Revolutions to simulate, by default those of the scene.
    quiet : bool
        Suppress progress on stderr.
    **more
        Other options of `tiprub demo`: `library=FILE_OR_DIRECTORY`, `platform=[...]`.

    Returns
    -------
    Report
        Files, agreement of the FMUs with the native run, times; its `path` is the directory.

    Raises
    ------
    Error
        A step failed, or the runs do not agree bit for bit.
    """
    kept = Path(place("keyword `out`", out))
    return Report(call(["demo", *options({"out": kept, "revolutions": revolutions}, more, "demo")], quiet=quiet), kept)
