"""A rub FMU (FMI 3.0) and a partner that answers it linearly, stepped together: by turns, or with steps repeated until both agree.

A partner is what is at the other end: a shaft in its bearings, spools that turn. Over one communication step it answers mean outputs u of
the rub (forces, moments, torques) with values z for the inputs of the rub (whirl, speed) by

    z = free + compliance u

`rotor.py` and `spools.py` have partners for which this is exact. Nothing here knows what z and u are.
"""

import struct
from ctypes import byref
from dataclasses import dataclass, field
from enum import Enum
from tempfile import TemporaryDirectory
from typing import Protocol

import numpy
from fmpy import extract, read_model_description
from fmpy.fmi1 import FMICallException
from fmpy.fmi3 import FMU3Slave

# Iterations of one step at most, and the least share of its way that Newton's method goes.
MOST, SHORTEST = 25, 0.1


class CouplingError(Exception):
    """A rub that fails, or an FMU that has not what the partner needs; the message says what, when and the remedy."""


class Way(Enum):
    """How one step of both is done."""

    JACOBI = "Jacobi"
    PARTNER_FIRST = "Gauss-Seidel, shaft first"
    RUB_FIRST = "Gauss-Seidel, rub first"
    FIXED_POINT = "fixed point"
    NEWTON = "Newton"

    @property
    def implicit(self):
        return self in (Way.FIXED_POINT, Way.NEWTON)


class Partner(Protocol):
    """What is coupled to a rub. `scale` (n,) says which differences of each value count as one."""

    inputs: list[str]
    outputs: list[str]
    scale: numpy.ndarray

    def known(self):
        """z that holds now, (n,)."""

    def law(self, step):
        """free (n,) and compliance (n, m) over a step of this length (s)."""

    def commit(self, outputs, values, step):
        """Go a step under the mean outputs u, (m,), of a rub that was given the values z, (n,)."""

    def save(self):
        """All that changes with time, as an array of floats."""

    def restore(self, state):
        """Go back to what `save` gave."""


class Rub:
    """An instance of the FMU as a partner sees it: values in, a step, mean outputs back; a saved state to go back to."""

    def __init__(self, file, inputs, outputs, parameters=None, derivatives=False, start=0.0):
        """Parameters, by name, are set before initialisation; integers to parameters that are not Float64."""
        self.messages, self.time, self.steps, self.derivatives = [], start, 0, 0
        self._directory = TemporaryDirectory()
        description = read_model_description(str(file))
        self._variables = {variable.name: variable for variable in description.modelVariables}
        self.inputs, self.outputs = self._references(inputs, file), self._references(outputs, file)
        self._fmu = FMU3Slave(
            guid=description.instantiationToken,
            unzipDirectory=extract(str(file), unzipdir=self._directory.name),
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName="rub",
        )
        self._fmu.instantiate(logMessage=lambda _environment, _status, _category, message: self.messages.append(message.decode()))
        for name, value in {**(parameters or {}), **({"step_derivatives": 2} if derivatives else {})}.items():
            (reference,) = self._references([name], file)
            real = self._variables[name].type == "Float64"
            (self._fmu.setFloat64 if real else self._fmu.setInt64)([reference], [value])
        self._call(self._fmu.enterInitializationMode, startTime=start)
        self._call(self._fmu.exitInitializationMode)
        # One slot to go back to, whose memory the FMU uses again.
        self._state, self._state_time = self._fmu.getFMUState(), start

    def _references(self, names, file):
        missing = [name for name in names if name not in self._variables]
        if missing:
            raise CouplingError(f"{file} has no variable {', '.join(missing)}: its scene does not ask for it (docs/variables.md says what does)")
        return [self._variables[name].valueReference for name in names]

    def _call(self, function, *arguments, **keywords):
        try:
            return function(*arguments, **keywords)
        except FMICallException as error:
            said = self.messages[-1] if self.messages else str(error)
            raise CouplingError(f"the rub failed at {self.time:.6g} s: {said}") from error

    def start(self, values):
        """Values at the start, which are not ramped to: before the first step only."""
        self._fmu.setFloat64(self.inputs, list(values))

    def step(self, values, step):
        """Mean outputs over a step at whose end the values are reached."""
        self._fmu.setFloat64(self.inputs, [float(value) for value in values])
        self.steps += 1
        self._call(self._fmu.doStep, self.time, step, noSetFMUStatePriorToCurrentPoint=False)
        self.time += step
        return numpy.array(self._fmu.getFloat64(self.outputs))

    def read(self, *names):
        """Current values of variables of type Float64."""
        found = [self._fmu.getFloat64([self._variables[name].valueReference])[0] for name in names]
        return found[0] if len(names) == 1 else numpy.array(found)

    def slope(self):
        """∂outputs/∂inputs over the step done last, (m, n): derivatives over the step, which the FMU gives from what it kept."""
        self.derivatives += len(self.inputs)
        columns = [self._call(self._fmu.getDirectionalDerivative, self.outputs, [known], [1.0]) for known in self.inputs]
        return numpy.array(columns).T

    def keep(self):
        """Keep the state of now to go back to."""
        self._fmu.fmi3GetFMUState(self._fmu.component, byref(self._state))
        self._state_time = self.time

    def back(self):
        """Go back to the state that was kept."""
        self._fmu.setFMUState(self._state)
        self.time = self._state_time

    def to_bytes(self):
        """The state of now, for a file or another process."""
        self.keep()
        return struct.pack("<d", self.time) + self._fmu.serializeFMUState(self._state)

    def from_bytes(self, content):
        """Take the state of another instance of the same FMU."""
        (self.time,) = struct.unpack("<d", content[:8])
        state = self._fmu.deserializeFMUState(content[8:])
        self._fmu.setFMUState(state)
        self._fmu.freeFMUState(state)

    def close(self):
        self._fmu.freeFMUState(self._state)
        self._fmu.freeInstance()
        self._directory.cleanup()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()


@dataclass
class Coupled:
    """One step that is done: what the rub was given and answered, how far from the partner's answer, in how many steps of the rub."""

    values: numpy.ndarray
    outputs: numpy.ndarray
    left: float
    tried: int = 1


def advance(rub, partner, way, last, step, precision=1e-5):
    """Take both a step on. `last` are the outputs of the step before; `precision` is a share of `partner.scale`."""
    free, compliance = partner.law(step)
    guess = free + compliance @ last
    if way is Way.JACOBI:
        # Neither knows what the other does in this step.
        values = partner.known()
        outputs = rub.step(values, step)
        partner.commit(last, values, step)
        return Coupled(values, outputs, _norm(free + compliance @ outputs - values, partner))
    if way.implicit:
        done = _solve(rub, partner, way, (free, compliance, guess), step, precision)
    else:
        outputs = rub.step(guess, step)
        done = Coupled(guess, outputs, _norm(free + compliance @ outputs - guess, partner))
    partner.commit(last if way is Way.PARTNER_FIRST else done.outputs, done.values, step)
    return done


def _norm(left, partner):
    return float(numpy.abs(left / partner.scale).max())


def _solve(rub, partner, way, law, step, precision):
    """Repeat the step from where it starts until the rub is given what the partner answers."""
    free, compliance, values = law
    rub.keep()
    outputs = rub.step(values, step)
    left = free + compliance @ outputs - values
    tried = 1
    while _norm(left, partner) > precision and tried < MOST:
        change = left
        if way is Way.NEWTON:
            change = numpy.linalg.solve(numpy.eye(len(left)) - compliance @ rub.slope(), left)
        # Forces have kinks, across which Newton's method may go to and fro, and a place beyond the casing may fail: shorter then.
        came_from, before, share = values, _norm(left, partner), 1.0
        while True:
            rub.back()
            values, tried = came_from + share * change, tried + 1
            try:
                outputs = rub.step(values, step)
                left = free + compliance @ outputs - values
                done = way is Way.FIXED_POINT or _norm(left, partner) < before
            except CouplingError:
                if way is Way.FIXED_POINT or share < SHORTEST:
                    raise
                done = False
            share *= 0.5
            if done or tried >= MOST or share < SHORTEST:
                break
    return Coupled(values, outputs, _norm(left, partner), tried)


@dataclass
class Run:
    """A coupled run: one row per communication step in each array."""

    step: float
    values: numpy.ndarray = field(default=None)
    outputs: numpy.ndarray = field(default=None)
    states: numpy.ndarray = field(default=None)
    watched: numpy.ndarray = field(default=None)
    unsolved: int = 0
    tried: float = 0.0
    derivatives: float = 0.0

    @property
    def times(self):
        """Ends of the steps (s), from the start of the run."""
        return self.step * numpy.arange(1, len(self.values) + 1)


def march(rub, partner, way, step, count, *, last=None, precision=1e-5, watch=(), before=None, progress=None, slopes=None):
    """Couple for `count` steps. `watch` names variables of the rub to keep; `before(index, partner)` may change the partner; to `slopes`
    the derivatives over each step are appended."""
    last = numpy.zeros(len(partner.outputs)) if last is None else numpy.array(last, dtype=float)
    run, rows = Run(step), ([], [], [], [])
    begun = rub.steps, rub.derivatives
    for index in range(count):
        if before:
            before(index, partner)
        done = advance(rub, partner, way, last, step, precision)
        last = done.outputs
        if slopes is not None:
            slopes.append(rub.slope())
        run.unsolved += way.implicit and done.left > precision
        for row, value in zip(rows, (done.values, done.outputs, partner.save(), [rub.read(name) for name in watch])):
            row.append(value)
        if progress:
            progress(index + 1, count)
    run.values, run.outputs, run.states, run.watched = (numpy.array(row) for row in rows)
    run.tried, run.derivatives = (rub.steps - begun[0]) / count, (rub.derivatives - begun[1]) / count
    return run
