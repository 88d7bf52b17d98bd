"""FMUs by the names of their variables: FMI 2.0 and 3.0 alike, by FMPy. Scalars of type Real or Float64 only."""

from tempfile import TemporaryDirectory

import numpy
from fmpy import extract, read_model_description
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import FMU2Slave
from fmpy.fmi3 import FMU3Slave


class UnitError(Exception):
    """An FMU lacks a variable or refuses a step; the message says which and when."""


class Unit:
    """One instance of an FMU for co-simulation, initialised at time 0.

    `time` (s) is its own: units that are coupled need not agree on it. States from `save` are freed with the unit.
    """

    def __init__(self, file, start=None, name="unit"):
        self.file, self.time, self.steps = str(file), 0.0, 0
        description = read_model_description(self.file, validate=False)
        self._three = description.fmiVersion.startswith("3")
        self._references = {variable.name: variable.valueReference for variable in description.modelVariables}
        self._types = {variable.name: variable.type for variable in description.modelVariables}
        self._directory = TemporaryDirectory(prefix="tiprub-unit-")
        self._states = []
        self._fmu = (FMU3Slave if self._three else FMU2Slave)(
            guid=description.guid,
            unzipDirectory=extract(self.file, unzipdir=self._directory.name),
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName=name,
        )
        self._fmu.instantiate()
        if not self._three:
            self._fmu.setupExperiment(startTime=0.0)
        for variable, value in (start or {}).items():
            self.set([variable], [value])
        self._fmu.enterInitializationMode(**({"startTime": 0.0} if self._three else {}))
        self._fmu.exitInitializationMode()

    def names(self, stem):
        """Names of an array's elements, stem[1], stem[2], ..."""
        found = [name for name in self._references if name.startswith(stem + "[")]
        if not found:
            raise UnitError(f"{self.file} has no variable {stem}[1]: package a scene that asks for it")
        return sorted(found, key=lambda name: int(name[len(stem) + 1 : -1]))

    def _found(self, names):
        missing = [name for name in names if name not in self._references]
        if missing:
            raise UnitError(f"{self.file} has no variable {missing[0]}: package a scene that asks for it")
        return [self._references[name] for name in names]

    def set(self, names, values):
        references, values = self._found(names), [float(value) for value in values]
        (self._fmu.setFloat64 if self._three else self._fmu.setReal)(references, values)

    def get(self, names):
        references = self._found(names)
        return numpy.array((self._fmu.getFloat64 if self._three else self._fmu.getReal)(references))

    def step(self, length):
        """One communication step of this length (s)."""
        try:
            self._fmu.doStep(currentCommunicationPoint=self.time, communicationStepSize=length)
        except FMICallException as failure:
            raise UnitError(f"{self.file} refuses the step from {self.time:.6g} s by {length:.3g} s ({failure}): see its log above") from failure
        self.time += length
        self.steps += 1

    def save(self):
        """The whole state, with the time. Give it to `restore` any number of times, then to `drop`."""
        state = self._fmu.getFMUState()
        self._states.append(state)
        return self.time, state

    def restore(self, saved):
        time, state = saved
        self._fmu.setFMUState(state)
        self.time = time

    def drop(self, saved):
        """Free a saved state."""
        self._states.remove(saved[1])
        self._fmu.freeFMUState(saved[1])

    def close(self):
        if self._fmu is not None:
            for state in self._states:
                self._fmu.freeFMUState(state)
            self._states.clear()
            self._fmu.terminate()
            self._fmu.freeInstance()
            self._fmu = None
            self._directory.cleanup()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()
