"""Cycle jump: a fast unit that repeats itself cycle by cycle, coupled with a slow one, over times that are many cycles long.

A rub repeats from revolution to revolution, and what it heats takes seconds. So the two are stepped together for a window of a few
cycles; the slow unit then jumps ahead with fluxes extrapolated from the windows before; the fast one is brought to where the slow one
has arrived, and settles there; the next window tells which fluxes they should have been. With these the jump is done again, as a line
between the windows on both sides. Both ends of a jump that are too far apart send both units back, to a shorter jump.

Fluxes go from the fast unit to the slow one, values the other way. Units are any objects with what `Fast` and `Slow` say: this file knows
neither FMI nor heat, and needs numpy only.

Such schemes are known as projective integration (Gear, Kevrekidis, SIAM J. Sci. Comput. 24, 2003) and, of fatigue, as cycle jump
(Lemaitre, Doghri, Comput. Methods Appl. Mech. Eng. 115, 1994).
"""

from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy


class Fast(Protocol):
    """The FMU with short cycles. `total` is its own sum of all heat since the start, with which the energy balance is checked."""

    def step(self, length: float, values: numpy.ndarray) -> numpy.ndarray:
        """Simulate a communication step with ramps to these values, and return the mean fluxes."""

    def total(self) -> float: ...
    def save(self) -> Any: ...
    def restore(self, saved: Any) -> None: ...
    def drop(self, saved: Any) -> None: ...


class Slow(Protocol):
    """The slow FMU, which accepts steps of any length."""

    def step(self, length: float, fluxes: numpy.ndarray) -> None:
        """Simulate a step with constant fluxes."""

    def values(self) -> numpy.ndarray: ...
    def save(self) -> Any: ...
    def restore(self, saved: Any) -> None: ...
    def drop(self, saved: Any) -> None: ...


@dataclass(frozen=True)
class Plan:
    """How to jump.

    step: communication step (s); cycle: steps of it in a cycle. window, settling: cycles averaged, and cycles before them that are not.
    begin: cycles stepped together at first. tolerance: error allowed to a jump, in the unit of the values. longest, first: jumps (s).
    parts: steps of the slow unit in a jump.
    """

    step: float
    cycle: int
    tolerance: float
    window: int = 4
    settling: int = 4
    begin: int = 8
    longest: float = 1.0
    first: float = 0.05
    parts: int = 8

    def __post_init__(self):
        for name in ("step", "cycle", "tolerance", "window", "begin", "longest", "first", "parts"):
            if not getattr(self, name) > 0:
                raise ValueError(f"Plan.{name} = {getattr(self, name)!r} is not above 0")
        if self.settling < 0:
            raise ValueError(f"Plan.settling = {self.settling!r} is below 0: give 0 to average from the first cycle on")
        if self.begin < self.window:
            raise ValueError(f"Plan.begin = {self.begin} cycles are less than the window of {self.window}: the first mean needs that many")

    @property
    def window_time(self):
        return self.window * self.cycle * self.step


@dataclass
class Jump:
    """One jump that was tried: from `start` over `length` (s), its estimated error, and whether it was kept."""

    start: float
    length: float
    error: float
    kept: bool


@dataclass
class Journey:
    """What happened. times, values, fluxes: at the end of every step of the slow unit. handed, given: see `Books`."""

    times: list = field(default_factory=list)
    values: list = field(default_factory=list)
    fluxes: list = field(default_factory=list)
    jumps: list = field(default_factory=list)
    fast_steps: int = 0
    handed: float = 0.0  # flux times time that went into the slow unit, jumps included
    given: float = 0.0  # the same by the fast unit's own total, and over jumps by the line between its windows
    in_windows: float = 0.0  # part of `given` within windows

    @property
    def kept(self):
        return [jump for jump in self.jumps if jump.kept]


@dataclass
class _Window:
    """Steps of both FMUs: the fluxes of each step, and the total of the fast FMU."""

    start: float
    fluxes: list
    mean: numpy.ndarray
    total: float  # over the whole window
    rate: float  # of the part that is averaged
    centre: float


def resolved(fast, slow, plan, stop, tell=lambda time: None):
    """Simulate all cycles of both FMUs up to `stop` (s)."""
    journey = Journey()
    while len(journey.times) * plan.step < stop - 0.5 * plan.step:
        window = _together(fast, slow, plan, len(journey.times) * plan.step, 1, 1, journey)
        journey.handed += float(window.fluxes[0].sum()) * plan.step
        journey.given += window.total
        journey.in_windows = journey.given
        _note(journey, window, plan, slow)
        tell(journey.times[-1])
    return journey


def cycle_jump(fast, slow, plan, stop, tell=lambda time: None):
    """Windows and jumps, to `stop` (s) or the step next to it. The slow unit starts at time 0."""
    journey, length = Journey(), plan.first
    window = _together(fast, slow, plan, 0.0, plan.begin * plan.cycle, plan.window * plan.cycle, journey)
    _keep(journey, window, plan, slow)
    time, before = plan.begin * plan.cycle * plan.step, None
    while time < stop - 0.5 * plan.step:
        length = min(length, plan.longest, max(stop - time - plan.window_time, 0.0))
        if length < plan.window_time:
            # Jumps as short as a window save nothing.
            steps = min(plan.window * plan.cycle, max(1, round((stop - time) / plan.step)))
            before, window = window, _together(fast, slow, plan, time, steps, steps, journey)
            _keep(journey, window, plan, slow)
            time, length = time + steps * plan.step, 1.5 * plan.window_time
        else:
            arrived = _try(fast, slow, plan, journey, window, before, time, length)
            error = journey.jumps[-1].error
            if arrived is not None:
                time, before, window = time + length + plan.window_time, window, arrived
            length *= min(2.0, max(0.25, 0.9 * (plan.tolerance / max(error, 1e-12)) ** 0.5))
        tell(time)
    return journey


def _together(fast, slow, plan, start, steps, averaged, journey):
    """A window: both units step by step, the fast one first. Heat handed over is what the fast one gave in that very step."""
    fluxes, from_total, mean_from = [], fast.total(), None
    for index in range(steps):
        if index == steps - averaged:
            mean_from = fast.total()
        flux = fast.step(plan.step, slow.values())
        slow.step(plan.step, flux)
        fluxes.append(flux)
    journey.fast_steps += steps
    span, total = averaged * plan.step, fast.total()
    centre = start + steps * plan.step - 0.5 * span
    return _Window(start, fluxes, numpy.mean(fluxes[-averaged:], axis=0), total - from_total, (total - mean_from) / span, centre)


def _line(first, second):
    """Fluxes over time through two windows; the mean of one where there is no other."""
    if first is None:
        return lambda time: second.mean
    return lambda time: first.mean + (second.mean - first.mean) * ((time - first.centre) / (second.centre - first.centre))


def _leap(slow, plan, start, length, fluxes):
    """The slow unit alone, in parts: fluxes of a line are exact as means at the middle of each. Returns times, values, fluxes."""
    part, noted = length / plan.parts, []
    for index in range(plan.parts):
        flux = fluxes(start + (index + 0.5) * part)
        slow.step(part, flux)
        noted.append((start + (index + 1) * part, slow.values(), flux))
    return noted


def _try(fast, slow, plan, journey, window, before, start, length):
    """One jump with the window behind it, kept if its error is within the tolerance. Else both units are where they were."""
    saved_fast, saved_slow, old = fast.save(), slow.save(), slow.values()
    _leap(slow, plan, start, length, _line(before, window))
    there = slow.values()
    steps = plan.settling * plan.cycle
    for index in range(steps):
        fast.step(plan.step, old + (there - old) * min(1.0, 2.0 * (index + 1) / steps))
    journey.fast_steps += steps
    count = plan.window * plan.cycle
    arrived = _together(fast, slow, plan, start + length, count, count, journey)
    predicted = slow.values()
    # Again, now that the fluxes on both sides are known.
    slow.restore(saved_slow)
    leaps = _leap(slow, plan, start, length, _line(window, arrived))
    notes = []
    for index, flux in enumerate(arrived.fluxes):
        slow.step(plan.step, flux)
        notes.append((arrived.start + (index + 1) * plan.step, slow.values(), flux))
    error = float(numpy.abs(slow.values() - predicted).max())
    kept = error <= plan.tolerance
    journey.jumps.append(Jump(start, length, error, kept))
    if kept:
        middle = start + 0.5 * length
        share = (middle - window.centre) / (arrived.centre - window.centre)
        rate = window.rate + (arrived.rate - window.rate) * share
        journey.handed += length / plan.parts * float(sum(flux.sum() for _, _, flux in leaps)) + plan.step * float(sum(flux.sum() for flux in arrived.fluxes))
        journey.given += rate * length + arrived.total
        journey.in_windows += arrived.total
        _append(journey, leaps + notes)
    else:
        fast.restore(saved_fast)
        slow.restore(saved_slow)
    fast.drop(saved_fast)
    slow.drop(saved_slow)
    return arrived if kept else None


def _keep(journey, window, plan, slow):
    """Book a window that no jump led to. Its values within are those at its end: only that is noted."""
    journey.handed += plan.step * float(sum(flux.sum() for flux in window.fluxes))
    journey.given += window.total
    journey.in_windows += window.total
    _append(journey, [(window.start + len(window.fluxes) * plan.step, slow.values(), window.mean)])


def _note(journey, window, plan, slow):
    _append(journey, [(window.start + plan.step, slow.values(), window.fluxes[0])])


def _append(journey, notes):
    for time, values, flux in notes:
        journey.times.append(time)
        journey.values.append(values)
        journey.fluxes.append(flux)
