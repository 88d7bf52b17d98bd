"""The figure of each part, as SVG. The same numbers give the same bytes."""

import matplotlib

matplotlib.use("Agg")
matplotlib.rcParams["svg.hashsalt"] = "tiprub"
from matplotlib import pyplot  # noqa: E402
import numpy  # noqa: E402


def _save(figure, file):
    figure.savefig(file, metadata={"Date": None})
    pyplot.close(figure)


def _axes(count, size):
    figure, axes = pyplot.subplots(1, count, figsize=size, layout="constrained")
    for axis in numpy.atleast_1d(axes):
        axis.grid(True, which="both", alpha=0.3)
    return figure, axes


def couplings(file, ways):
    """The hottest patch, and how far the others are from the first one; what is equal to the last bit lies on the axis."""
    figure, (left, right) = _axes(2, (9.0, 3.6))
    first = next(iter(ways.values()))
    hottest = int(first.temperatures[-1].argmax())
    for name, way in ways.items():
        left.plot(way.times, way.temperatures[:, hottest], label=name, linewidth=1.0)
        apart = numpy.abs(way.temperatures - first.temperatures).max(axis=1)
        right.plot(way.times, apart, label=f"{name}: {apart.max():.2g} K", linewidth=1.0)
    right.set_yscale("symlog", linthresh=1e-13)
    right.set_ylim(bottom=0.0)
    left.set(xlabel="time (s)", ylabel=f"temperature of patch {hottest + 1} (K)")
    right.set(xlabel="time (s)", ylabel="largest difference from the first (K)")
    right.legend(fontsize="small")
    _save(figure, file)


def step(file, rows):
    figure, axis = _axes(1, (5.5, 3.8))
    for way, marker in (("parallel", "o"), ("sequential", "s")):
        points = sorted((row[1], row[2]) for row in rows if row[0] == way)
        axis.loglog(*zip(*points), marker=marker, label=f"units stepped {way}")
    axis.set(xlabel="communication step H (s)", ylabel="error of temperatures (K)")
    axis.legend()
    _save(figure, file)


def power(journey, cycle):
    """Heat into the casing, averaged over a cycle where steps are shorter than one."""
    times, power = numpy.array(journey.times), numpy.array(journey.fluxes).sum(axis=1)
    lengths = numpy.diff([0.0, *times])
    totals = numpy.concatenate([[0.0], numpy.cumsum(power * lengths)])
    edges = cycle * numpy.arange(int(times[-1] / cycle + 1e-6) + 1)
    return 0.5 * (edges[1:] + edges[:-1]), numpy.diff(numpy.interp(edges, [0.0, *times], totals)) / cycle


def jump(file, truth, journeys, rows):
    figure, (left, right) = _axes(2, (9.0, 3.8))
    cycle = truth.times[0] * 40
    left.plot(*power(truth, cycle), color="black", label="every revolution resolved")
    for tolerance, journey in (journeys[0], journeys[-1]):
        left.plot(*power(journey, cycle), linewidth=1.0, label=f"cycle jump, {tolerance} K")
    left.set(xlabel="time (s)", ylabel="heat into the casing (W)", ylim=(0.0, None))
    left.legend()
    right.loglog([row[2] for row in rows], [row[5] for row in rows], marker="o")
    for row in rows:
        right.annotate(f"{row[0]} K", (row[2], row[5]), xytext=(5, 3), textcoords="offset points", fontsize="small")
    right.set(xlabel="speed-up (revolutions resolved / simulated)", ylabel="largest error of a temperature (K)")
    _save(figure, file)


def long(file, journeys, revolution):
    figure, (left, right) = _axes(2, (9.0, 3.8))
    for (name, journey), colour in zip(journeys.items(), ("tab:blue", "tab:orange")):
        left.plot(*power(journey, 16 * revolution), color=colour, label=name)
        values = numpy.array(journey.values)
        right.plot(journey.times, values.max(axis=1), color=colour, label="hottest patch")
        right.plot(journey.times, values.mean(axis=1), color=colour, linestyle="dashed", label="mean of the casing")
        ends = [jump.start + jump.length for jump in journey.kept]
        right.plot(ends, numpy.interp(ends, journey.times, values.max(axis=1)), ".", color=colour, label="ends of jumps")
    left.set(xlabel="time (s)", ylabel="heat into the casing (W)", yscale="log")
    left.legend()
    right.set(xlabel="time (s)", ylabel="temperature (K)")
    right.legend(fontsize="small")
    _save(figure, file)
