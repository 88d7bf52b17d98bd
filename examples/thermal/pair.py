"""The rub and the casing it heats, as a pair of FMUs: stepped by a script, or as the two sides of a cycle jump."""

from dataclasses import dataclass

import numpy

HEAT, TEMPERATURE = "casing_friction_power", "casing_temperature"


class Rub:
    """The rub FMU: temperatures of the patches in, heat into them out (W, means over the step)."""

    def __init__(self, unit, share):
        """`share` is `slave_heat_fraction` of the scene: what of the friction goes into the casing."""
        self.unit, self.share = unit, share
        self._into, self._out = unit.names(TEMPERATURE), unit.names(HEAT)
        self.save, self.restore, self.drop = unit.save, unit.restore, unit.drop

    def step(self, length, values):
        self.unit.set(self._into, values)
        self.unit.step(length)
        return self.unit.get(self._out)

    def total(self):
        """Heat into the casing since the start (J) by the energy ledger of the rub, which knows no patches."""
        return self.share * float(self.unit.get(["friction_loss"])[0])


class Casing:
    """The thermal FMU: heat into the patches in (W), their temperatures out (K)."""

    def __init__(self, unit):
        self.unit = unit
        self._into, self._out = unit.names("casing_heat"), unit.names(TEMPERATURE)
        self.save, self.restore, self.drop = unit.save, unit.restore, unit.drop

    def step(self, length, fluxes):
        self.unit.set(self._into, fluxes)
        self.unit.step(length)

    def values(self):
        return self.unit.get(self._out)

    def supplied(self):
        """Return the heat received from the rub since the start (J), from the energy balance of the casing."""
        return float(self.unit.get(["supplied_heat"])[0])


@dataclass
class Course:
    """Values at the ends of the steps, from the start on. temperatures (K) and heat (W): shape (points, patches)."""

    times: numpy.ndarray
    temperatures: numpy.ndarray
    heat: numpy.ndarray
    supplied: float = numpy.nan
    friction: float = numpy.nan


def script(rub, casing, step, count, together=True, tell=lambda time: None):
    """`count` communication steps. `together`: both go with what the other one had at the start of the step, as SSP tools do (Jacobi).
    Else the rub goes first, and the casing takes the heat of that very step (Gauss-Seidel)."""
    values, heat = casing.values(), numpy.zeros_like(casing.values())
    temperatures, heats = [values], [heat]
    for index in range(count):
        new = rub.step(step, values)
        casing.step(step, heat if together else new)
        heat, values = new, casing.values()
        temperatures.append(values)
        heats.append(heat)
        tell((index + 1) * step)
    times = step * numpy.arange(count + 1)
    return Course(times, numpy.array(temperatures), numpy.array(heats), casing.supplied(), rub.total())
