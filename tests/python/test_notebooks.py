"""The notebooks of examples/notebooks, executed with smaller parameters, and their results."""

import os

import nbformat
import pytest
from nbclient import NotebookClient

from conftest import ROOT

NOTEBOOKS = ROOT / "examples" / "notebooks"
LIBRARY, THERMAL = os.environ.get("TIPRUB_LIBRARY"), os.environ.get("TIPRUB_LIBRARY_THERMAL")
#: Values of the parameters, and a last cell that checks the results.
QUICK = {
    "first_rub": (
        {"revolutions": 1, "frictions": [0.05, 0.15], "library": LIBRARY},
        """
        heats = heat["friction heat (J)"].to_numpy()
        assert 0.0 < heats[0] < heats[1] == result["friction_loss"].iloc[-1]
        assert (heat["residual of the energy balance"] < 1e-12).all()
        assert rows > 300 and set(difference.values()) == {0.0}, difference
        """,
    ),
    "sweep": (
        {"samples": 4, "stop": 0.003},
        """
        assert len(runs) == 24 and (runs["status"] == "finished").all()
        assert runs["largest_total_normal_force"].nunique() > 12
        assert total.shape == (4, 2) and total.notna().all(axis=None)
        """,
    ),
    "heat": (
        {"revolutions": 3, "seconds": 0.1, "library": LIBRARY, "thermal_library": THERMAL},
        """
        assert abs(lost) < 1e-9 * course.supplied and course.supplied > 10.0
        assert course.temperatures[-1].max() > 10.0 * abs(course.temperatures[-1].min())
        assert journey.kept and journey.fast_steps / 10 < 0.9 * times[-1] / revolution
        assert temperatures[-1].max() > course.temperatures[-1].max()
        """,
    ),
}


def test_every_notebook_is_run():
    assert {path.stem for path in NOTEBOOKS.glob("*.ipynb")} == set(QUICK)


@pytest.mark.parametrize("name", QUICK)
def test_notebook_runs(name, tmp_path, monkeypatch):
    monkeypatch.setenv("PYTHONPATH", str(ROOT / "packaging" / "python"))
    monkeypatch.setenv("IPYTHONDIR", str(tmp_path))
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.setenv("TIPRUB", os.environ.get("TIPRUB", str(ROOT / "target" / "release" / "tiprub")))
    notebook = nbformat.read(NOTEBOOKS / f"{name}.ipynb", as_version=4)
    cells = [cell for cell in notebook.cells if cell.cell_type == "code"]
    assert not any(cell.outputs or cell.execution_count for cell in cells), "notebooks are stored without outputs"
    (parameters,) = [cell for cell in cells if "parameters" in cell.metadata.get("tags", ())]
    values, checks = QUICK[name]
    assert {line.split(" = ")[0] for line in parameters.source.splitlines()} == set(values)
    parameters.source = "\n".join(f"{key} = {value!r}" for key, value in values.items())
    notebook.cells.append(nbformat.v4.new_code_cell("\n".join(line.strip() for line in checks.strip().splitlines())))
    before = sorted(path.name for path in NOTEBOOKS.iterdir())
    NotebookClient(notebook, timeout=120, resources={"metadata": {"path": str(NOTEBOOKS)}}).execute()
    assert sorted(path.name for path in NOTEBOOKS.iterdir()) == before, "a notebook writes beside itself"
    pictures = [output for cell in cells for output in cell.outputs if "image/png" in output.get("data", {})]
    assert pictures and all(len(picture["data"]["image/png"]) > 5000 for picture in pictures)
