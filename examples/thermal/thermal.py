#!/usr/bin/env python3
"""Couple the FMU of a rub with a thermal FMU: the rub heats its casing, the casing grows, and the rub changes.

Creates both FMUs and an SSP package with them. Parts:
  couplings  coupling by a script (FMI 2.0 and 3.0), as an SSP package in FMPy and Ecos, and with a casing written in Python
  choice     friction heat and run time of a revolution for finer models of the blades and for adaptive steps
  step       errors against the communication step, for the parallel and the sequential scheme
  jump       error and speed-up of cycle jump for several tolerances, compared with the fully resolved run
  long       ten seconds with cycle jump, also with a finer model of the blades
Figures (SVG) and tables (CSV) are written to a directory.
"""

import argparse
import csv
import math
import os
import re
import shutil
import subprocess
import sys
import time
from pathlib import Path

import numpy

import figures
import ssp
from cycle_jump import Plan, cycle_jump, resolved
from pair import Casing, Rub, script
from units import Unit, UnitError

HERE = Path(__file__).resolve().parent
PARTS = ("couplings", "choice", "step", "jump", "long")
SPEED, SHARE, PATCHES = 1800.0, 0.5, 12
REVOLUTION = 2.0 * math.pi / SPEED
STEP, CYCLE = REVOLUTION / 10, 10
ROTOR = ["--contact-patches", "5", "--contact-rows", "1", "--modes", "12", "--mesh", "16x2x20"]
# Revolutions of `couplings`, `choice` and `step`; seconds of `jump`, of `long`; tolerances (K).
FULL = {"couplings": 10, "choice": 8, "step": 24, "jump": 1.0, "long": 10.0, "tolerances": (2.0, 0.5, 0.2, 0.1), "tolerance": 0.25}
QUICK = {"couplings": 3, "choice": 2, "step": 4, "jump": 0.12, "long": 0.3, "tolerances": (0.5, 0.1), "tolerance": 0.5}


class ExampleError(Exception):
    """What failed, and the remedy."""


def say(text):
    print(text, file=sys.stderr, flush=True)


def progress(what, stop):
    """Tell how far it is, every ten seconds of run time."""
    started = told = time.monotonic()
    say(f"  {what}")

    def tell(now):
        nonlocal told
        if time.monotonic() > told + 10.0:
            told = time.monotonic()
            say(f"    {min(now, stop):.3g} of {stop:.3g} s, {told - started:.0f} s of run time")

    return tell


class Files:
    """The units, made from the program `tiprub`."""

    def __init__(self, into):
        self.into = into
        self.program = os.environ.get("TIPRUB") or shutil.which("tiprub")
        if not self.program or not Path(self.program).is_file():
            raise ExampleError("the program tiprub is not found: set TIPRUB to it, or start by examples/run.sh thermal")
        into.mkdir(parents=True, exist_ok=True)

    def tiprub(self, *words):
        run = subprocess.run([self.program, "--quiet", *map(str, words)], capture_output=True, text=True)
        if run.returncode != 0:
            raise ExampleError(f"tiprub {' '.join(map(str, words))} failed: {run.stderr.strip()}")

    @staticmethod
    def _library(variable):
        return ["--library", os.environ[variable]] if os.environ.get(variable) else []

    def rub(self, name, rotor, time=None):
        """FMUs of the scene with this model of the rotor, and `[time]` in other words: {2: file, 3: file}."""
        place = self.into / name
        place.mkdir(exist_ok=True)
        say(f"models of the rub, {name}")
        text = (HERE / "rub.toml").read_text(encoding="utf-8")
        if time:
            text = re.sub(r"\[time\][^\[]*", f"[time]\n{time}\n\n", text)
        if rotor:
            self.tiprub("reduce", "rotor37", *rotor, "--force", "-o", place / "rotor.rom.safetensors")
        else:
            text = text.replace('"rotor.rom.safetensors"', '"builtin:rotor37-one-row"')
        (place / "rub.toml").write_text(text, encoding="utf-8")
        self.tiprub("package", place / "rub.toml", "--scalars", "-o", place, *self._library("TIPRUB_LIBRARY"))
        return {fmi: place / f"thermal_rub_fmi{fmi}.fmu" for fmi in (2, 3)}

    def casing(self):
        """The thermal unit that ships: {2: file, 3: file}."""
        say("thermal unit of the casing")
        place = self.into / "casing"
        self.tiprub("thermal", "--output", place, *self._library("TIPRUB_LIBRARY_THERMAL"))
        found = {fmi: sorted(place.glob(f"*_fmi{fmi}.fmu")) for fmi in (2, 3)}
        return {fmi: files[0] for fmi, files in found.items()}

    def casing_in_python(self):
        """The casing by PythonFMU, FMI 2.0, which needs this very Python to run in."""
        from pythonfmu.builder import FmuBuilder

        say("thermal unit of the casing, by PythonFMU")
        options = {"canGetAndSetFMUstate": True, "canSerializeFMUstate": True}
        return Path(FmuBuilder.build_FMU(HERE / "casing_slave.py", dest=self.into, project_files=[HERE / "conduction.py"], **options))

    def table(self, name, header, rows, show=True):
        """A CSV file, and the same as a table on stdout."""
        with (self.into / f"{name}.csv").open("w", encoding="utf-8", newline="") as file:
            csv.writer(file).writerows([header, *(["" if value != value else value for value in row] for row in rows)])
        if not show:
            return
        shown = [["" if value != value else f"{value:.3g}" if isinstance(value, float) else str(value) for value in row] for row in rows]
        print(f"\n{name}\n| " + " | ".join(header) + " |\n|" + "---|" * len(header))
        for row in shown:
            print("| " + " | ".join(row) + " |")
        sys.stdout.flush()


    def course(self, name, journey):
        """Temperatures and heat of a journey over time."""
        header = ["time (s)", *(f"temperature {k + 1} (K)" for k in range(PATCHES)), *(f"heat {k + 1} (W)" for k in range(PATCHES))]
        self.table(name, header, [[time, *map(float, values), *map(float, heat)] for time, values, heat in zip(journey.times, journey.values, journey.fluxes)], show=False)


class Pair:
    """Both units, open; used as a context."""

    def __init__(self, rub, casing):
        self.units = []
        try:
            self.units.append(Unit(rub, name="rub"))
            self.units.append(Unit(casing, name="casing"))
        except Exception:
            self.__exit__()
            raise
        self.rub, self.casing = Rub(self.units[0], SHARE), Casing(self.units[1])

    def __enter__(self):
        return self.rub, self.casing

    def __exit__(self, *_):
        for unit in self.units:
            unit.close()


def couplings(files, rub, casing, python, size):
    """Compare all couplings with one communication step."""
    count, stop = size["couplings"] * CYCLE, size["couplings"] * REVOLUTION
    package = files.into / "thermal_rub.ssp"
    ssp.write(package, rub[2], casing[2], PATCHES, stop)
    ssp.validate(package)
    ways, failed = {}, {}
    for fmi in (2, 3):
        with Pair(rub[fmi], casing[fmi]) as (one, other):
            ways[f"script, FMI {fmi}.0"] = script(one, other, STEP, count, tell=progress(f"script, FMI {fmi}.0", stop))
    for name, run in (("SSP, FMPy", ssp.run_fmpy), ("SSP, Ecos", ssp.run_ecos)):
        say(f"  {name}")
        try:
            ways[name] = run(package, STEP, count, PATCHES)
        except (RuntimeError, ImportError) as failure:
            failed[name] = str(failure)
    with Pair(rub[2], casing[2]) as (one, other):
        ways["script, sequential"] = script(one, other, STEP, count, together=False, tell=progress("script, sequential", stop))
    with Pair(rub[2], python) as (one, other):
        ways["script, casing in Python"] = script(one, other, STEP, count, tell=progress("casing in Python", stop))
    first = next(iter(ways.values()))
    rows = []
    for name, way in ways.items():
        apart = [float(numpy.abs(getattr(way, part) - getattr(first, part)).max()) for part in ("temperatures", "heat")]
        rows.append([name, *apart, way.friction, way.supplied, way.friction - way.supplied])
    files.table("couplings", ["coupling", "difference of temperatures (K)", "difference of heat (W)", "friction heat (J)", "received heat (J)", "difference (J)"], rows)
    for name, reason in failed.items():
        say(f"{name} did not run: {reason}")
    figures.couplings(files.into / "couplings.svg", ways)


def choice(files, rub, size):
    """Compare the friction heat into a cold casing over the second half of some revolutions, for several models."""
    half, rows = size["choice"] // 2, []
    finest = 'scheme = "galerkin"\nstep = 8.0e-5\ntolerance = 1.0e-3'
    cases = {
        "model of the example": rub,
        "24 modes": files.rub("more-modes", ["--contact-patches", "5", "--contact-rows", "1", "--modes", "24", "--mesh", "16x2x20"], "step = 1.66e-6"),
        "adaptive steps, tolerance 1e-3": files.rub("tolerance", ROTOR, finest),
        "9 patches, 80 modes": files.rub("finer", None),
        "9 patches, 80 modes, half the step": files.rub("finer-halved", None, "step = 1.039e-6"),
    }
    for name, units in cases.items():
        with Unit(units[2], name="rub") as unit:
            side, cold = Rub(unit, SHARE), numpy.zeros(PATCHES)
            tell, started, before = progress(name, 2 * half * REVOLUTION), time.process_time(), 0.0
            for index in range(2 * half):
                before = side.total() if index == half else before
                side.step(REVOLUTION, cold)
                tell((index + 1) * REVOLUTION)
            power = (side.total() - before) / (half * REVOLUTION)
            rows.append([name, power, power / rows[0][1] - 1.0 if rows else 0.0, (time.process_time() - started) / (2 * half)])
    files.table("choice", ["model", "heat into a cold casing (W)", "relative difference", "processor time per revolution (s)"], rows)


def step(files, rub, casing, size):
    """Compare the temperatures of the casing after the same time, for several communication steps."""
    stop, found = size["step"] * REVOLUTION, {}
    for parts in (40, 20, 10, 4, 2, 1):
        for together in (False, True):
            if parts == 40 and together:
                continue
            name = f"{'parallel' if together else 'sequential'}, {parts} in a revolution"
            with Pair(rub[2], casing[2]) as (one, other):
                found[together, parts] = script(one, other, REVOLUTION / parts, size["step"] * parts, together, progress(name, stop))
    limit, rows = found[False, 40], []
    for (together, parts), course in found.items():
        if course is limit:
            continue
        error = float(numpy.abs(course.temperatures[-1] - limit.temperatures[-1]).max())
        rows.append(
            ["parallel" if together else "sequential", REVOLUTION / parts, error, abs(course.friction / limit.friction - 1.0), (course.friction - course.supplied) / course.friction]
        )
    files.table("step", ["scheme", "H (s)", "error of temperatures (K)", "error of friction heat", "fraction of the heat that has not arrived"], rows)
    figures.step(files.into / "step.svg", rows)


def _plan(tolerance):
    return Plan(STEP, CYCLE, tolerance)


def _journey(rub, casing, run, plan, stop, what):
    """Return a run, its received heat in the energy balance of the casing, and its run time."""
    with Pair(rub, casing) as (one, other):
        started = time.monotonic()
        found = run(one, other, plan, stop, tell=progress(what, stop))
        return found, other.supplied(), time.monotonic() - started


def _apart(journey, truth):
    """Return the largest difference of temperatures at the ends of all steps of the casing (K)."""
    times, values = numpy.array(truth.times), numpy.array(truth.values)
    own = numpy.array(journey.values)
    columns = [numpy.interp(journey.times, times, values[:, k]) for k in range(values.shape[1])]
    return float(numpy.abs(own - numpy.array(columns).T).max())


def jump(files, rub, casing, size):
    """Compare cycle jump at several tolerances with a run in which every revolution is resolved."""
    stop = size["jump"]
    truth, supplied, seconds = _journey(rub[2], casing[2], resolved, _plan(1.0), stop, "fully resolved")
    files.course("jump-resolved", truth)
    rows = [["resolved", truth.fast_steps / CYCLE, 1.0, 0, 0, 0.0, 0.0, supplied, _residual(truth, supplied), seconds]]
    journeys = []
    for tolerance in size["tolerances"]:
        found, supplied, seconds = _journey(rub[2], casing[2], cycle_jump, _plan(tolerance), stop, f"cycle jump, {tolerance} K")
        journeys.append((tolerance, found))
        files.course(f"jump-{tolerance:g}", found)
        kept, tried = len(found.kept), len(found.jumps)
        speed_up = truth.fast_steps / found.fast_steps
        error = abs(found.handed / numpy.interp(found.times[-1], truth.times, _handed(truth)) - 1.0)
        rows.append([tolerance, found.fast_steps / CYCLE, speed_up, kept, tried - kept, _apart(found, truth), error, supplied, _residual(found, supplied), seconds])
    header = ["tolerance (K)", "revolutions of the rub", "speed-up", "accepted jumps", "rejected jumps", "error of temperatures (K)", "error of heat", "received heat (J)", "friction heat minus received heat (J)", "run time (s)"]
    files.table("jump", header, rows)
    figures.jump(files.into / "jump.svg", truth, journeys, rows[1:])


def _handed(truth):
    """Return the heat exchanged until each time of a resolved run (J)."""
    lengths = numpy.diff([0.0, *truth.times])
    return numpy.cumsum(numpy.array(truth.fluxes).sum(axis=1) * lengths)


def _residual(journey, supplied):
    """Return the heat in the energy ledger of the rub minus the heat that the casing received (J)."""
    return journey.given - supplied


def long(files, rub, finer, casing, size):
    """Simulate seconds with the model of the other parts and with the built-in model."""
    stop, rows, found = size["long"], [], {}
    for name, unit in (("5 patches, 12 modes", rub[2]), ("9 patches, 80 modes", finer[2])):
        journey, supplied, seconds = _journey(unit, casing[2], cycle_jump, _plan(size["tolerance"]), stop, f"long, {name}")
        found[name] = journey
        files.course(f"long-{len(found)}", journey)
        turns = journey.times[-1] / REVOLUTION
        share = journey.in_windows / journey.given
        rows.append([name, turns, journey.fast_steps / CYCLE, len(journey.kept), float(numpy.max(journey.values[-1])), supplied, share, _residual(journey, supplied), seconds])
    header = ["rotor", "revolutions", "simulated revolutions", "jumps", "hottest patch (K)", "received heat (J)", "fraction from windows", "friction heat minus received heat (J)", "run time (s)"]
    files.table("long", header, rows)
    figures.long(files.into / "long.svg", found, REVOLUTION)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--into", type=Path, default=Path("thermal"), help="directory for units, figures and tables [default: thermal]")
    parser.add_argument("--quick", action="store_true", help="a few revolutions of each: does it work?")
    parser.add_argument("--seconds", type=float, help="thermal time of `jump` and `long`, in place of 1 s and 10 s (quick: 0.12 s and 0.3 s)")
    parser.add_argument("--casing", choices=("unit", "python"), default="unit", help="partner of the rub: the thermal unit that ships, or the one by PythonFMU [default: unit]")
    parser.add_argument("--only", choices=PARTS, action="append", help="this part only; may be given several times")
    arguments = parser.parse_args()
    size, parts = dict(QUICK if arguments.quick else FULL), arguments.only or PARTS
    if arguments.seconds is not None:
        if not arguments.seconds >= 0.05:
            parser.error(f"--seconds {arguments.seconds:g} is less than a few windows take: give 0.05 or more")
        size["jump"] = size["long"] = arguments.seconds
    try:
        files = Files(arguments.into.resolve())
        rub, python = files.rub("rub", ROTOR), files.casing_in_python()
        casing = files.casing() if arguments.casing == "unit" else {2: python, 3: python}
        if "couplings" in parts:
            couplings(files, rub, casing, python, size)
        if "choice" in parts:
            choice(files, rub, size)
        if "step" in parts:
            step(files, rub, casing, size)
        if "jump" in parts:
            jump(files, rub, casing, size)
        if "long" in parts:
            long(files, rub, files.rub("finer", None), casing, size)
    except (ExampleError, UnitError) as failure:
        say(f"error: {failure}")
        return 1
    say(f"figures and tables: {files.into}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
