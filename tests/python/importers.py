"""FMPy's instances under one roof: values by FMI 2.0 scalar name, messages collected."""

from ctypes import byref

from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import (
    FMU2Slave,
    fmi2CallbackAllocateMemoryTYPE,
    fmi2CallbackFreeMemoryTYPE,
    fmi2CallbackFunctions,
    fmi2CallbackLoggerTYPE,
    fmi2StepFinishedTYPE,
)
from fmpy.fmi3 import FMU3Slave
from fmpy.logging import addLoggerProxy


class Importer:
    """What both versions share."""

    def __init__(self, fmu, token=None):
        description = fmu.description
        self.messages = []
        self.kinds = {}
        self.fmu = self.slave(
            guid=token or (description.guid if description.fmiVersion == "2.0" else description.instantiationToken),
            unzipDirectory=fmu.directory,
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName="rub",
        )

    @property
    def log(self):
        return "\n".join(self.messages)

    def refused(self, call, *arguments):
        """The messages of a call that must answer Error."""
        self.messages.clear()
        try:
            call(*arguments)
        except FMICallException as error:
            assert "(error)" in str(error), error
            assert self.messages, "an error without a message"
            return self.log
        raise AssertionError(f"{call.__name__}{arguments} was not refused")

    def initialise(self):
        self.enter()
        self.fmu.exitInitializationMode()

    def step(self, time, size):
        return self.fmu.doStep(currentCommunicationPoint=time, communicationStepSize=size)

    def reset(self):
        self.fmu.reset()

    def free(self):
        if self.fmu is not None:
            self.fmu.freeInstance()
            self.fmu = None

    def put(self, name, values):
        """Set a scalar or all elements of an array, in one call."""
        kind, reference, count = (*self.variables.get(name, (None, None)), 1)[:3]
        if kind is None:
            first = self.variables[f"{name}[1]"]
            kind, reference, count = first[0], first[1], 1
        # Elements have consecutive references; an array of FMI 3.0 has one for all of them.
        references = [reference] if count > 1 else [reference + index for index in range(len(values))]
        (self.fmu.setReal if kind == "Real" else self.fmu.setFloat64)(references, values)

    def get(self, *names):
        values = self.read(names)
        return values[0] if len(names) == 1 else values


# Callbacks of all instances.
ALIVE = []


class Two(Importer):
    """FMI 2.0."""

    slave = FMU2Slave

    def __init__(self, fmu, token=None):
        super().__init__(fmu, token)
        self.variables = {v.name: (v.type, v.valueReference) for v in fmu.description.modelVariables}
        logger = fmi2CallbackLoggerTYPE(self.collect)
        allocate, free = fmi2CallbackAllocateMemoryTYPE(0), fmi2CallbackFreeMemoryTYPE(0)
        self.callbacks = fmi2CallbackFunctions(logger, allocate, free, fmi2StepFinishedTYPE(0), None)
        # FMPy's own C function, which formats the variadic message before it comes here. It keeps one address for the
        # whole process, and messages of whoever logs later go there: what is behind it must stay.
        ALIVE.append(self.callbacks)
        addLoggerProxy(byref(self.callbacks))
        try:
            self.fmu.instantiate(callbacks=self.callbacks, loggingOn=False)
        except Exception as error:
            raise RuntimeError(self.log) from error

    def collect(self, _environment, _name, _status, _category, message):
        self.messages.append(message.decode())

    def enter(self, start=0.0, stop=None):
        self.fmu.setupExperiment(startTime=start, stopTime=stop)
        self.fmu.enterInitializationMode()

    def set(self, **values):
        for name, value in values.items():
            kind, reference = self.variables[name]
            {"Real": self.fmu.setReal, "Integer": self.fmu.setInteger, "Enumeration": self.fmu.setInteger}[kind](
                [reference], [value]
            )

    def read(self, names):
        groups = {}
        for name in names:
            kind, reference = self.variables[name]
            groups.setdefault(kind, {})[name] = reference
        getters = {
            "Real": self.fmu.getReal,
            "Integer": self.fmu.getInteger,
            "Enumeration": self.fmu.getInteger,
            "Boolean": self.fmu.getBoolean,
        }
        found = {}
        for kind, members in groups.items():
            found.update(zip(members, getters[kind](list(members.values()))))
        return [float(found[name]) for name in names]

    def reached(self):
        """The time that steps have reached: fmi2LastSuccessfulTime."""
        return self.fmu.getRealStatus(2)

    def derivative(self, name, value):
        self.fmu.setRealInputDerivatives([self.variables[name][1]], [1], [value])

    def save(self):
        return self.fmu.getFMUstate()

    def restore(self, state):
        self.fmu.setFMUstate(state)


class Three(Importer):
    """FMI 3.0; arrays are taken apart into the names FMI 2.0 has."""

    slave = FMU3Slave

    def __init__(self, fmu, token=None, **arguments):
        super().__init__(fmu, token)
        self.variables = {}
        for v in fmu.description.modelVariables:
            count = 1
            for dimension in v.dimensions:
                count *= dimension.start
            self.variables[v.name] = (v.type, v.valueReference, count)
        try:
            self.fmu.instantiate(logMessage=self.collect, loggingOn=False, **arguments)
        except Exception as error:
            raise RuntimeError(self.log) from error

    def collect(self, _environment, _status, _category, message):
        self.messages.append(message.decode())

    def enter(self, start=0.0, stop=None):
        self.fmu.enterInitializationMode(startTime=start, stopTime=stop)

    def set(self, **values):
        for name, value in values.items():
            kind, reference, _ = self.variables[name]
            setters = {"Float64": self.fmu.setFloat64, "Int64": self.fmu.setInt64, "Enumeration": self.fmu.setInt64}
            setters[kind]([reference], [value])

    def read(self, names):
        """One call per variable that is needed."""
        getters = {
            "Float64": self.fmu.getFloat64,
            "Int64": self.fmu.getInt64,
            "Enumeration": self.fmu.getInt64,
            "Boolean": self.fmu.getBoolean,
        }
        cache, values = {}, []
        for name in names:
            whole, index = name, 0
            if name not in self.variables:
                whole, _, rest = name.rpartition("[")
                index = int(rest.rstrip("]")) - 1
            if whole not in cache:
                kind, reference, count = self.variables[whole]
                cache[whole] = getters[kind]([reference], nValues=count)
            values.append(float(cache[whole][index]))
        return values

    def save(self):
        return self.fmu.getFMUState()

    def restore(self, state):
        self.fmu.setFMUState(state)


