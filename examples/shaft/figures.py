"""Tables as CSV and Markdown, and the figure of each study."""

import csv
from pathlib import Path

import numpy


def shown(value):
    """A number as the guide shows it."""
    if value is None:
        return ""
    if isinstance(value, str):
        return value
    if isinstance(value, (int, numpy.integer)):
        return str(value)
    size = abs(value)
    return f"{value:.2e}" if value and (size < 1e-2 or size >= 1e5) else f"{value:.4g}"


def markdown(table):
    rows = ["| " + " | ".join(shown(value) for value in row) + " |" for row in table.rows]
    return "\n".join(["| " + " | ".join(table.header) + " |", "|" + "---|" * len(table.header), *rows])


def write(table, into):
    with (Path(into) / f"{table.name}.csv").open("w", newline="") as file:
        csv.writer(file).writerows([table.header, *table.rows])


def _axes(count, size):
    import matplotlib

    matplotlib.use("Agg")
    matplotlib.rcParams["svg.hashsalt"] = "tiprub"
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(1, count, figsize=size, layout="constrained")
    return figure, axes if count > 1 else [axes]


def _save(figure, into, name):
    from matplotlib import pyplot

    figure.savefig(Path(into) / f"{name}.svg", metadata={"Date": None})
    pyplot.close(figure)


def errors(tables, into):
    figure, (axis,) = _axes(1, (6.5, 4.0))
    for way, points in tables[0].series.items():
        axis.loglog(*zip(*points), marker="o", label=way)
    axis.set(xlabel="communication step H (s)", ylabel="largest error of the orbit / clearance")
    axis.grid(True, which="both", alpha=0.3)
    axis.legend()
    _save(figure, into, "errors")


def blade_off(tables, into, clearance):
    history, free, _ = (numpy.array(table.rows, dtype=object) for table in tables)
    figure, (orbit, radius, forces) = _axes(3, (13.0, 4.0))
    around = numpy.linspace(0.0, 2.0 * numpy.pi, 200)
    time = history[:, 0].astype(float) * 1e3
    orbit.plot(*(history[:, 1:3].astype(float).T / clearance), linewidth=0.8)
    orbit.plot(numpy.cos(around), numpy.sin(around), "k--", linewidth=0.8)
    orbit.set(xlabel="whirl_x / clearance", ylabel="whirl_y / clearance", aspect="equal")
    for table, name in ((free, "without rub"), (history, "with rub")):
        radius.plot(table[:, 0].astype(float) * 1e3, numpy.hypot(*table[:, 1:3].astype(float).T) / clearance, label=name, linewidth=0.9)
    radius.axhline(1.0, color="k", linestyle="--", linewidth=0.8)
    radius.set(xlabel="time (ms)", ylabel="whirl / clearance")
    radius.legend()
    forces.plot(time, numpy.hypot(*history[:, 4:6].astype(float).T) / 1e3, linewidth=0.9, color="C3")
    forces.set(xlabel="time (ms)", ylabel="force on the rotor, mean over H (kN)")
    speed = forces.twinx()
    speed.plot(time, history[:, 3].astype(float), color="C0", linewidth=0.9)
    speed.set_ylabel("speed (rad/s)", color="C0")
    _save(figure, into, "blade_off")


def run_up(tables, into):
    history = numpy.array(tables[1].rows)
    figure, (speeds, torques) = _axes(2, (10.0, 4.0))
    time = 1e3 * history[:, 0]
    width = max(1, len(history) // 120)
    for place, name in ((1, "low"), (2, "high")):
        speeds.plot(time, numpy.abs(history[:, place]), label=name)
        mean = numpy.convolve(history[:, place + 2], numpy.ones(width) / width, mode="same")
        torques.plot(time, mean, label=name, linewidth=0.9)
    speeds.set(xlabel="time (ms)", ylabel="|speed| (rad/s)")
    torques.set(xlabel="time (ms)", ylabel="torque of the rub, running mean (N m)")
    speeds.legend()
    torques.legend()
    _save(figure, into, "run_up")
