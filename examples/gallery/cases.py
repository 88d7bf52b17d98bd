"""The cases of the gallery. Each function runs a scene of this directory, draws a picture, and returns the numbers of its text."""

import math
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy
import pandas
import pyvista
from matplotlib.colors import LogNorm
from scipy.signal import butter, hilbert, sosfiltfilt

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
# The Python module, and the code of the other examples.
sys.path[1:1] = [str(ROOT / "packaging" / "python"), str(HERE.parent / "thermal"), str(HERE.parent / "shaft")]

import drawing  # noqa: E402
import tiprub  # noqa: E402
from coupling import CouplingError  # noqa: E402
from cycle_jump import Plan, cycle_jump  # noqa: E402
from drawing import BLUE, DARK, GREEN, GREY, ORANGE, bar, panels, scale, view  # noqa: E402
from figures import power  # noqa: E402
from pair import Casing, Rub  # noqa: E402
from scenario import CLEARANCE, Shafts, package, silence  # noqa: E402
from studies import Way, coupled, place_of  # noqa: E402
from units import Unit, UnitError  # noqa: E402

#: Errors with a message for the user.
ERRORS = (tiprub.Error, CouplingError, UnitError)

REVOLUTION = 2.0 * math.pi / 1800.0  # s, of rotor 37 at design speed
MODELS = ROOT / "tests" / "data" / "models"


def command(*words):
    """Run a command of the program that has no function in the module, and return its output."""
    try:
        done = subprocess.run([tiprub.program(), *map(str, words)], capture_output=True, text=True, check=False)
    except OSError as error:
        raise tiprub.Error(tiprub.program(), f"cannot be started: {error}", "Set TIPRUB to the path of the program, or start with examples/run.sh gallery") from error
    if done.returncode != 0:
        raise tiprub.Error(f"tiprub {words[0]}", done.stderr.strip())
    return done.stdout


class Work:
    """Directory of a case, with a copy of its scene or plan."""

    def __init__(self, name, into):
        self.place, self.picture = Path(into).resolve() / name, Path(into) / "images" / f"gallery-{name}.png"
        shutil.rmtree(self.place, ignore_errors=True)
        self.place.mkdir(parents=True)
        self.picture.parent.mkdir(exist_ok=True)
        self.scene = self.copy(f"{name}.toml")

    def copy(self, name):
        return Path(shutil.copy(HERE / name, self.place))

    def reduce(self, kind, name, file=None, **more):
        return tiprub.reduce(kind, file, self.place / f"{name}.rom.safetensors", quiet=True, **more)

    def run(self, **more):
        return tiprub.run(self.scene, quiet=True, **more)

    def fields(self, **more):
        """Run the scene; return the outputs, and the meshes at the end of the run by the names of their parts."""
        result = self.run(vtk=self.place / "fields", vtk_every=10**6, **more)
        files = sorted((self.place / "fields").glob("*.vtu"), key=lambda file: int(file.stem.rsplit("_", 1)[1]))
        return result, {file.stem.rsplit("_", 1)[0]: pyvista.read(file) for file in files}

    def unit(self, words, library):
        """Package FMUs, with the library in the environment variable `library` if it is set; return the path of the FMU for FMI 2.0."""
        found, place = os.environ.get(library), self.place / words[0]
        command(*words, "--quiet", "--output", place, *(["--library", found] if found else []))
        return next(place.glob("*_fmi2.fmu"))

    def save(self, figure):
        drawing.save(figure, self.picture)


def family(result, stem):
    """Return the columns stem[1], stem[2], ... as an array (times, elements)."""
    return result[[name for name in result.columns if name.startswith(stem + "[")]].to_numpy()


def grown(mesh, factor):
    """Return the mesh, deformed by its displacements times a factor."""
    return mesh.warp_by_vector("displacement", factor=factor)


def sized(unit, *meshes):
    """Add the magnitude of the displacements, times `unit`, to meshes; return its range, for the colours."""
    for mesh in meshes:
        mesh["size"] = unit * numpy.linalg.norm(mesh["displacement"], axis=1)
    return 0.0, float(max(mesh["size"].max() for mesh in meshes))


def rub(work):
    result = work.run()
    forces = family(result, "sector_normal_force")
    peak = result.attrs["extremes"]["largest_total_normal_force"]
    _, parts = work.fields(stop=peak["time"])
    rotor, casing = parts["rotor"], parts["casing_surface"]
    limits = sized(1e6, rotor)
    figure, left, right = panels(1.0, 1.15)
    wall = grown(casing, 40.0)
    wall.points[:, :2] *= 1.04
    view(left, [(grown(rotor, 20.0), {"scalars": "size", "clim": limits}), (wall, {"color": GREY, "opacity": 0.5})], (0.5, -0.5, 1.0))
    scale(figure, left, limits, "displacement (µm)")
    image = right.imshow(forces.T / 1e3, aspect="auto", origin="lower", extent=(0.0, result.index[-1] / REVOLUTION, 0.5, 36.5), interpolation="none")
    right.set(xlabel="revolutions", ylabel="blade", title="Normal force")
    right.grid(False)
    bar(figure, image, right, "kN")
    work.save(figure)
    last = result.iloc[-1]
    return {
        "force": peak["value"],
        "time": 1e3 * peak["time"],
        "blade": forces.max(),
        "contacts": result.attrs["extremes"]["most_contacts"]["value"],
        "torque": -result.attrs["answer"]["torque"],
        "heat": last["friction_loss"],
        "residual": abs(last["energy_residual_relative"]),
        "displacement": limits[1],
    }


def wear(work):
    result = work.run()
    last = result.iloc[-1]
    depth = 1e6 * family(result, "wear_depth")[-1]
    around = 1e6 * family(result, "wear_profile_around")
    gap, angle = 356.0, numpy.linspace(0.0, 360.0, around.shape[1], endpoint=False) + 180.0 / around.shape[1]
    bump = 2.0 * gap * 0.6 * numpy.exp(-(((numpy.mod(angle, 180.0) / 180.0 - 0.5) / 0.15) ** 2)) - gap
    figure, left, right = panels(1.7, 1.0)
    left.fill_between(angle, numpy.maximum(bump, 0.0), color=GREY, alpha=0.6, linewidth=0.0, label="bump")
    for turn, colour in ((1, BLUE), (3, ORANGE)):
        row = numpy.searchsorted(result.index, turn * REVOLUTION) - 1
        left.plot(angle, around[row], color=colour, label=f"{turn} rev.", linewidth=1.2)
    left.set(xlabel="angle (°)", ylabel="mean wear depth (µm)", xticks=range(0, 361, 90), xlim=(0, 360), ylim=(0.0, None))
    left.legend(loc="center", title="casing", handlelength=1.0)
    right.plot(result.index / REVOLUTION, 1e9 * result["worn_volume"], color=BLUE)
    right.set(xlabel="revolutions", ylabel="worn volume (mm³)", ylim=(0.0, None), xticks=range(4))
    work.save(figure)
    return {
        "mean": depth.mean(),
        "deepest": depth.max(),
        "bump": bump.max(),
        "volume": 1e9 * last["worn_volume"],
        "first": 1e9 * result["worn_volume"].iloc[numpy.searchsorted(result.index, REVOLUTION) - 1],
        "work": last["cutting_work"],
        "specific": 1e-9 * last["cutting_work"] / last["worn_volume"],
        "shaft": last["shaft_work"],
    }


def thermal(work, stop=4.0, tolerance=0.5):
    rub = work.unit(["package", work.scene, "--scalars"], "TIPRUB_LIBRARY")
    casing = work.unit(["thermal"], "TIPRUB_LIBRARY_THERMAL")
    # The FMUs log known warnings: the rub does not resolve all modes, and the steps are too short for surface temperatures, which are not used.
    with silence(), Unit(rub, name="rub") as one, Unit(casing, name="casing") as other:
        received = Casing(other)
        journey = cycle_jump(Rub(one, share=0.5), received, Plan(REVOLUTION / 10, 10, tolerance), stop)
        supplied = received.supplied()
    times, values = numpy.array(journey.times), numpy.array(journey.values)
    middles, heat = power(journey, 0.1)
    figure, left, right = panels(1.0, 1.15)
    left.bar(middles, heat / 1e3, width=0.1, color=ORANGE, alpha=0.8)
    left.set(xlabel="time (s)", ylabel="heat into the casing (kW)", ylim=(0.0, None))
    angles = numpy.linspace(0.0, 360.0, values.shape[1] + 1)
    for time, colour in ((0.25, BLUE), (1.0, GREEN), (stop, ORANGE)):
        right.stairs(values[numpy.abs(times - time).argmin()], angles, color=colour, linewidth=1.6, label=f"{time:g} s")
    right.set(xlabel="angle (°)", ylabel="casing temperature (K)", xticks=range(0, 361, 90), ylim=(-1.0, None))
    right.legend(loc="center", handlelength=1.0)
    work.save(figure)
    return {
        "start": heat[0] / 1e3,
        "end": heat[-1] / 1e3,
        "hottest": values[-1].max(),
        "coldest": values[-1].min(),
        "mean": values[-1].mean(),
        "heat": supplied / 1e3,
        "lost": abs(journey.given - supplied) / supplied,
        "stop": times[-1],
        "turns": times[-1] / REVOLUTION,
        "simulated": journey.fast_steps / 10,
    }


def whirl(work, unbalance=3e-3, at=1e-3, step=5e-5, stop=0.06):
    def lose(index, partner, step):
        partner.unbalance = unbalance if (index + 0.5) * step > at else 0.0

    shafts = Shafts("disk")
    shaft, free, steady = shafts.whirling(), shafts.whirling(), shafts.whirling(inertia=numpy.inf)
    run = coupled(package(work.scene, work.place), shaft, Way.NEWTON, step, stop, before=lose, watch=["friction_loss"])
    orbit, alone = place_of(run, shaft), []
    for index in range(len(run.times)):
        lose(index, free, step)
        free.commit(numpy.zeros(5), None, step)
        alone.append(free.place[:2] / CLEARANCE)
    steady.unbalance = unbalance
    steady.turn_steadily()
    alone = numpy.array(alone)
    forces = numpy.hypot(*run.outputs[:, :2].T) / 1e3
    touching = 1e3 * run.times[forces > 0.0]
    figure, left, right = panels(1.0, 1.15)
    turn, reach = numpy.linspace(0.0, 2.0 * math.pi, 200), 1.1 * numpy.abs(alone).max()
    left.plot(*alone.T, color=GREY, linewidth=0.9, label="no casing")
    left.plot(*orbit.T, color=BLUE, linewidth=1.1, label="rub")
    left.plot(numpy.cos(turn), numpy.sin(turn), color=DARK, linestyle="dashed", linewidth=1.2, label="clearance")
    left.set(aspect="equal", xlabel="x / clearance", ylabel="y / clearance", xlim=(-reach, reach), ylim=(-reach, 1.5 * reach))
    left.legend(loc="upper center", ncols=2, columnspacing=0.8)
    right.plot(1e3 * run.times, forces, color=BLUE, linewidth=1.0)
    right.set(xlabel="time (ms)", ylabel="force on the casing (kN)", ylim=(0.0, None), xlim=(0.0, 20.0))
    work.save(figure)
    size = numpy.hypot(*orbit.T)
    return {
        "unbalance": 1e3 * unbalance,
        "rubbing": size.max(),
        "free": numpy.hypot(*alone.T).max(),
        "steady": numpy.hypot(*steady.place[:2]) / CLEARANCE,
        "end": size[-round(2.0 * REVOLUTION / step) :].mean(),
        "force": forces.max(),
        "first": touching[0],
        "last": touching[-1],
        "heat": run.watched[-1, 0],
        "slower": 1800.0 - shaft.speed,
    }


def vibration(result):
    """Return the amplitude (µm) of the vibration of blade 1 at 20 to 40 kHz over time (ms), and its growth rate (1/s) and frequency (kHz) from 5.5 to 7 ms."""
    time = result.index.to_numpy()
    band = butter(4, [20e3, 40e3], "band", fs=1.0 / (time[1] - time[0]), output="sos")
    motion = hilbert(sosfiltfilt(band, result["blade[1].tip_tangential_displacement[1]"]))
    size, window = 1e6 * numpy.abs(motion), (time > 5.5e-3) & (time < 7.0e-3)
    rate = numpy.polyfit(time[window], numpy.log(size[window]), 1)[0]
    angle = numpy.unwrap(numpy.angle(motion[window]))
    return pandas.Series(size, 1e3 * time), rate, numpy.polyfit(time[window], angle, 1)[0] / (2e3 * math.pi)


def flutter(work):
    work.reduce("blade", "blade", MODELS / "blade_hex20.inp", clamp_set="ROOT", sectors=36, units="mm-t-s", material="steel", contact_nodes=2)
    result = work.run()
    warning = next(text for text in result.warnings if "grows at" in text)
    predicted, frequency = (float(number) for number in re.search(r"grows at (\S+) 1/s at (\S+) kHz", warning).groups())
    size, measured, found = vibration(result)
    adaptive = re.sub("(?m)^time = .*", 'time = { scheme = "galerkin", tolerance = 1e-3 }', work.scene.read_text(encoding="utf-8"))
    adaptive = tiprub.run(adaptive, directory=work.place, quiet=True)
    forces = family(result, "blade[1].normal_force") / 1e3
    figure, left, right = panels(1.0, 1.15)
    for node, colour in enumerate((BLUE, ORANGE)):
        left.plot(size.index, forces[:, node], color=colour, linewidth=1.0, label=f"node {node + 1}")
    left.set(xlabel="time (ms)", ylabel="normal force (kN)", ylim=(0.0, 1.3 * forces.max()), xlim=(4.0, 7.2))
    left.legend(loc="upper left", ncols=2)
    shown, growing = size.loc[4.6:7.1], size.loc[5.5:7.0]
    right.semilogy(shown, color=BLUE, label=f"measured, {measured:.0f} 1/s")
    line = 1.8 * growing.iloc[0] * numpy.exp(1e-3 * predicted * (growing.index - growing.index[0]))
    right.semilogy(growing.index, line, color=ORANGE, linestyle="dashed", label=f"predicted, {predicted:.0f} 1/s")
    right.set(xlabel="time (ms)", ylabel="vibration at 29 kHz (µm)", ylim=(None, 20.0 * shown.max()))
    right.legend(loc="upper left", handlelength=1.0)
    work.save(figure)
    return {
        "predicted": predicted,
        "measured": measured,
        "frequency": frequency,
        "found": found,
        "times": growing.iloc[-1] / growing.iloc[0],
        "adaptive": vibration(adaptive)[1],
    }


def stage(work):
    result, parts = work.fields()
    disk, ring = parts["disk"], parts["ring"]
    limits = sized(1e6, disk, ring)
    waves = 1e6 * family(result, "nodal_diameter_amplitude")
    figure, left, right = panels(1.0, 1.15)
    shell = grown(ring, 50.0)
    shell.points[:, :2] *= 1.06
    view(left, [(grown(disk, 50.0), {"scalars": "size", "clim": limits}), (shell, {"scalars": "size", "clim": limits, "opacity": 0.75})], (0.5, -0.5, 1.0))
    scale(figure, left, limits, "displacement (µm)")
    order = numpy.argsort(waves[-500:].mean(axis=0))[::-1]
    for index, colour in zip(order[:3], (BLUE, ORANGE, GREEN)):
        right.plot(1e3 * result.index, waves[:, index], color=colour, linewidth=1.1, label=f"{index} nodal diameters")
    right.set(xlabel="time (ms)", ylabel="radial tip displacement (µm)", ylim=(0.0, 1.5 * waves.max()))
    right.legend(loc="upper left")
    work.save(figure)
    extremes, last = result.attrs["extremes"], result.iloc[-1]
    casing = 1e6 * family(result, "casing_displacement")[-1]
    return {
        "force": extremes["largest_total_normal_force"]["value"] / 1e3,
        "contacts": extremes["most_contacts"]["value"],
        "first": order[0],
        "first_size": waves[-500:, order[0]].mean(),
        "second": order[1],
        "second_size": waves[-500:, order[1]].mean(),
        "inward": -casing.min(),
        "outward": casing.max(),
        "heat": last["friction_loss"],
        "residual": abs(last["energy_residual_relative"]),
    }


def cube(work):
    result = work.run()
    speed = -result["cube.velocity_y"]
    widest = result.attrs["extremes"]["largest_total_normal_force"]
    _, parts = work.fields(stop=widest["time"])
    cube, rings = parts["cube"], [parts["ring_left"], parts["ring_right"]]
    limits = sized(1e3, cube, *rings)
    figure, left, right = panels(1.0, 1.15)
    surface = {"scalars": "size", "clim": limits, "show_edges": True, "edge_color": "#5b6168", "line_width": 0.6}
    view(left, [(grown(part, 5.0), surface) for part in (cube, *rings)], (0.25, -0.35, 1.0))
    scale(figure, left, limits, "displacement (mm)")
    right.plot(1e3 * result.index, speed, color=BLUE)
    right.axvspan(1e3 * result.index[result["contact_count"] > 0][0], 1e3 * result.index[result["contact_count"] > 0][-1], color=GREY, alpha=0.25, linewidth=0.0)
    right.text(0.5, 0.93, "in contact", transform=right.transAxes, ha="center", color=DARK)
    right.set(xlabel="time (ms)", ylabel="speed of the cube (m/s)", ylim=(80.0, 102.0))
    work.save(figure)
    last, start = result.iloc[-1], result["kinetic_energy"].iloc[0]
    return {
        "exit": speed.iloc[-1],
        "left": 1e3 * result.index[result["contact_count"] > 0][-1],
        "force": widest["value"] / 1e3,
        "time": 1e3 * widest["time"],
        "heat": last["friction_loss"],
        "impacts": last["impact_loss"],
        "before": start,
        "share": 100.0 * last["friction_loss"] / start,
        "displacement": limits[1],
    }


def mesh(work):
    report = work.reduce("blade", "blade", MODELS / "blade_hex20.inp", clamp_set="ROOT", sectors=36, units="mm-t-s", material="steel")
    result = work.run()
    forces = family(result, "blade[1].normal_force").sum(axis=1)
    widest, parts = work.fields(stop=result.index[forces.argmax()], vtk_sectors="1")
    blade, tip = parts["rotor"], parts["rotor_contact"]
    limits = sized(1e6, blade)
    figure, left, right = panels(1.0, 1.15)
    surface = {"scalars": "size", "clim": limits, "show_edges": True, "edge_color": "#5b6168", "line_width": 0.8}
    points = {"color": BLUE, "point_size": 36, "render_points_as_spheres": True}
    angle = widest["rotor_angle"].iloc[-1] - 0.4
    tip.points *= 1.001  # slightly in front of the faces of the tip
    view(left, [(grown(blade, 10.0), surface), (pyvista.PolyData(grown(tip, 10.0).points), points)], (math.cos(angle), math.sin(angle), 0.6))
    scale(figure, left, limits, "displacement (µm)")
    right.plot(1e3 * result.index, forces / 1e3, color=BLUE)
    right.set(xlabel="time (ms)", ylabel="normal force on blade 1 (kN)", ylim=(0.0, None))
    work.save(figure)
    known = pandas.read_csv(MODELS / "frequencies_calculix.csv", comment="#", index_col="mesh").loc["hex20"].to_numpy()
    found = numpy.array([check["full_hz"] for check in report["rom"]["checks"][: len(known)]])
    return {
        "nodes": report["model"]["nodes"],
        "elements": report["full_model"]["elements"],
        "order": report["rom"]["order"],
        "seconds": report["seconds"],
        "patches": len(report["rom"]["contact_nodes"]),
        "first": found[0],
        "known": known[0],
        "count": len(known),
        "deviation": 100.0 * numpy.abs(found / known - 1.0).max(),
        "locks": report["rom"]["locks_up_above"]["friction"],
        "force": forces.max() / 1e3,
        "displacement": limits[1],
        "heat": result["friction_loss"].iloc[-1],
    }


def sweep(work):
    work.copy("map.toml")
    work.reduce("rotor37", "rotor37", contact_nodes=3)
    command("sweep", work.scene, "--quiet", "--output", work.place / "sweep.parquet")
    rows = pandas.read_parquet(work.place / "sweep.parquet")
    if (rows["status"] != "finished").any():
        raise tiprub.Error("sweep", "some runs did not finish", f"See the column `reason` of {work.place / 'sweep.parquet'}")
    table = rows.pivot(index="gap_offset", columns="speed", values="largest_node_normal_force")
    speeds, gaps, forces = table.columns.to_numpy(), 1e6 * table.index.to_numpy(), table.to_numpy()
    limit, intrusion = 1000.0, 71.2
    needed = numpy.array([gaps[numpy.flatnonzero(column > limit)[-1] + 1] if (column > limit).any() else gaps[0] for column in forces.T])
    figure, axis = panels(1.0)
    colours = axis.pcolormesh(speeds, gaps, forces / 1e3, shading="nearest")
    bar(figure, colours, axis, "largest force on a node (kN)")
    axis.step(speeds, needed, where="mid", color=BLUE, linewidth=2.0, label="clearance that keeps it below 1 kN")
    axis.axhline(intrusion, color=DARK, linestyle="dashed", linewidth=1.2)
    axis.text(speeds[0], intrusion + 1.0, "no contact", va="bottom", color=DARK)
    axis.set(xlabel="speed (rad/s)", ylabel="added clearance (µm)", ylim=(gaps[0], gaps[-1]))
    axis.grid(False)
    axis.legend(loc="lower center", facecolor="white", framealpha=0.85, frameon=True, edgecolor="none")
    work.save(figure)
    return {
        "runs": len(rows),
        "limit": limit / 1e3,
        "needed": needed.max(),
        "worst_speed": speeds[needed.argmax()],
        "least": needed.min(),
        "least_speed": speeds[needed.argmin()],
        "largest": forces.max() / 1e3,
        "largest_speed": speeds[forces.max(axis=0).argmax()],
        "above": forces[gaps > intrusion].max(),
        "intrusion": intrusion,
    }


def interaction_map(work, count=41):
    work.reduce("rotor37", "rotor37", contact_nodes=3)
    report = tiprub.study("map", work.scene, work.place / "study", speeds=f"1087:2039:{count}", transient=40, revolutions=24, quiet=True)
    table = pandas.read_csv(report.path / "map.csv")
    # Frequencies are multiples of a fraction of each speed, at most 14 Hz apart.
    table["frequency (Hz)"] = 15.0 * (table["frequency (Hz)"] / 15.0).round()
    amplitudes = table.pivot_table(index="frequency (Hz)", columns="speed (rad/s)", values="leading edge; largest of all blades (m)", aggfunc="max").loc[:2000.0]
    crossings = pandas.read_csv(report.path / "coincidences.csv")
    speeds, frequencies, sizes = amplitudes.columns.to_numpy(), amplitudes.index.to_numpy(), 1e6 * amplitudes.to_numpy()
    crossing = crossings[(crossings["engine order"] == 4) & (crossings["mode"] == 1)].iloc[0]
    peaks = pandas.read_csv(report.path / "peaks.csv").sort_values("amplitude (m)").iloc[-1]
    figure, axis = panels(1.0)
    image = axis.pcolormesh(speeds, frequencies, sizes, norm=LogNorm(10.0, sizes.max()), shading="nearest")
    bar(figure, image, axis, "amplitude (µm)")
    for order in (2, 4, 6, 8):
        line = order * speeds / (2.0 * math.pi)
        inside = speeds[line < 1930.0]
        axis.plot(speeds, line, color=GREEN, linewidth=0.8, linestyle="dashed", alpha=0.7)
        axis.annotate(f"{order}Ω", (inside[-1], order * inside[-1] / (2.0 * math.pi)), ha="right", va="bottom", color=GREEN)
    axis.axhline(crossing["predicted frequency (Hz)"], color=BLUE, linewidth=1.0)
    axis.annotate("mode 1", (1765.0, crossing["predicted frequency (Hz)"] - 10.0), va="top", color=BLUE)
    hollow = {"color": BLUE, "markerfacecolor": "none", "markersize": 10, "markeredgewidth": 2.0}
    axis.plot(crossing["predicted speed (rad/s)"], crossing["predicted frequency (Hz)"], "o", **hollow, label="crossing of 4Ω and mode 1")
    axis.plot(peaks["speed (rad/s)"], peaks["frequency (Hz)"], "s", **hollow, label="largest response")
    axis.set(xlabel="speed (rad/s)", ylabel="frequency (Hz)", ylim=(0.0, 2000.0), xlim=(speeds[0], speeds[-1]))
    axis.grid(False)
    axis.legend(loc="lower right", facecolor="white", framealpha=0.85, frameon=True, edgecolor="none")
    work.save(figure)
    return {
        "speeds": len(speeds),
        "crossing": crossing["predicted speed (rad/s)"],
        "mode": crossing["predicted frequency (Hz)"],
        "speed": peaks["speed (rad/s)"],
        "frequency": peaks["frequency (Hz)"],
        "orders": peaks["frequency / rotational frequency"],
        "amplitude": 1e3 * peaks["amplitude (m)"],
        "shift": 100.0 * (peaks["speed (rad/s)"] / crossing["predicted speed (rad/s)"] - 1.0),
    }


CASES = {
    "rub": rub,
    "wear": wear,
    "thermal": thermal,
    "whirl": whirl,
    "flutter": flutter,
    "stage": stage,
    "cube": cube,
    "mesh": mesh,
    "sweep": sweep,
    "map": interaction_map,
}
