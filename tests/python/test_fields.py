"""Fields over time in VTK: pyvista reads the series and renders it without a screen; values agree with the outputs."""

import csv

import numpy as np
import pytest
import pyvista

SECTORS = 36


@pytest.fixture(scope="module")
def series(tiprub, scene, work):
    """A run of the rotor with fields at every 20th communication point: its outputs and the reader."""
    result = tiprub("run", scene, "--stop", "0.002", "--csv", work / "fields.csv", "--vtk", work / "fields", "--vtk-every", "20")
    assert result["vtk"]["without_surface"] == []
    with open(work / "fields.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    return rows, pyvista.get_reader(work / "fields" / "fields.pvd")


def parts(reader, index):
    """The surface of the rotor, its contact nodes and the casing at one time."""
    reader.set_active_time_point(index)
    blocks = reader.read()
    return [blocks[number] for number in range(blocks.n_blocks)]


def test_series_has_the_times_of_the_run(series):
    rows, reader = series
    times = [float(row["time"]) for row in rows]
    expected = times[::20] + ([] if (len(times) - 1) % 20 == 0 else times[-1:])
    assert np.array_equal(reader.time_values, expected)


def test_clearance_and_forces_are_the_outputs(series):
    rows, reader = series
    touched = 0.0
    for index, time in enumerate(reader.time_values):
        row = next(row for row in rows if float(row["time"]) == time)
        contact = parts(reader, index)[1]
        first = contact.extract_cells(contact.cell_data["sector"] == 1)
        for field in ("clearance", "normal_force"):
            names = [name for name in row if name.startswith(f"blade[1].{field}[")]
            expected = np.array([float(row[name]) for name in names])
            assert len(expected) == first.n_points > 0
            assert np.allclose(first.point_data[field], expected, rtol=1e-6, atol=1e-12)
        touched += contact.point_data["normal_force"].sum()
    assert touched > 0


def test_sectors_are_copies_that_turn_with_the_rotor(series):
    rows, reader = series
    first, last = (parts(reader, index)[0] for index in (0, len(reader.time_values) - 1))
    points = first.points.reshape(SECTORS, -1, 3)
    turn = 2 * np.pi / SECTORS
    angle = float(rows[-1]["rotor_angle"])

    def turned(points, angle):
        cos, sin = np.cos(angle), np.sin(angle)
        return points @ np.array([[cos, sin, 0], [-sin, cos, 0], [0, 0, 1]])

    for sector in range(SECTORS):
        assert np.allclose(points[sector], turned(points[0], sector * turn), atol=1e-7)
    assert np.allclose(last.points, turned(first.points, angle), atol=1e-7)
    # The surface at the tip follows the contact nodes: the mean motion of a vibrating blade is largest there.
    moved = np.linalg.norm(last.point_data["displacement"], axis=1)
    radius = np.hypot(last.points[:, 0], last.points[:, 1])
    assert moved.max() > 1e-6 and moved[radius < radius.min() + 1e-3].max() < 0.1 * moved.max()


def test_pyvista_renders_without_a_screen(series, tmp_path):
    _, reader = series
    rotor, contact, casing = parts(reader, len(reader.time_values) - 1)
    plotter = pyvista.Plotter(off_screen=True, window_size=(320, 240))
    plotter.add_mesh(rotor.warp_by_vector("displacement", factor=20))
    plotter.add_mesh(contact, scalars="clearance", show_scalar_bar=False)
    plotter.add_mesh(casing.warp_by_vector("displacement", factor=20), opacity=0.3)
    plotter.view_xy()
    image = plotter.screenshot(tmp_path / "rotor.png", return_img=True)
    background = image[0, 0]
    drawn = (image != background).any(axis=2).mean()
    assert 0.02 < drawn < 0.9, drawn
