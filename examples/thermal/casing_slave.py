"""The casing's heat conduction as an FMU in Python: PythonFMU packs this file with conduction.py."""

from xml.etree.ElementTree import SubElement

import numpy
from conduction import Conduction
from pythonfmu import DefaultExperiment, Fmi2Causality, Fmi2Initial, Fmi2Slave, Fmi2Variability, Real


class CasingSlave(Fmi2Slave):
    """Names, units and signs of the unit that `tiprub thermal` makes. Heat is held over a step, temperatures are ramped."""

    author = "The tiprub developers"
    description = "Heat conduction in the casing around rotor 37, finite volumes, exact in time"
    default_experiment = DefaultExperiment(start_time=0.0, stop_time=10.0, step_size=1e-2)

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.model = Conduction()
        patches = self.model.casing.patches
        self.heat, self.sides = numpy.zeros(patches), numpy.zeros(2)
        for k in range(patches):
            self._input(f"casing_heat[{k + 1}]", self.heat, k)
        for k, name in enumerate(("gas_temperature", "ambient_temperature")):
            self._input(name, self.sides, k)
        for k in range(patches):
            self._output(f"casing_temperature[{k + 1}]", lambda k=k: self.now[k])
        self._output("temperature_max", lambda: self.model.temperature.max())
        for name, kept in (("stored_heat", "stored"), ("supplied_heat", "supplied"), ("gas_heat", "gas"), ("ambient_heat", "ambient"), ("energy_residual", "residual")):
            self._output(name, lambda kept=kept: getattr(self.model, kept))
        self.now = self.model.patch

    def _input(self, name, values, k):
        self.register_variable(
            Real(name, causality=Fmi2Causality.input, variability=Fmi2Variability.continuous, getter=lambda: values[k], setter=lambda value: values.__setitem__(k, value)),
            nested=False,
        )

    def _output(self, name, getter):
        self.register_variable(
            Real(name, causality=Fmi2Causality.output, variability=Fmi2Variability.continuous, initial=Fmi2Initial.calculated, getter=getter), nested=False
        )

    def to_xml(self, model_options=None):
        """PythonFMU leaves out the initial unknowns, which the standard wants: all outputs, here."""
        root = super().to_xml(model_options or {})
        structure = root.find("ModelStructure")
        initial = SubElement(structure, "InitialUnknowns")
        for unknown in structure.find("Outputs"):
            SubElement(initial, "Unknown", index=unknown.get("index"))
        return root

    def exit_initialization_mode(self):
        self.model.sides = self.sides.copy()

    def do_step(self, current_time, step_size):
        self.model.step(step_size, self.heat, self.sides)
        self.now = self.model.patch
        return True

    def _get_fmu_state(self):
        model = self.model
        sums = [model.supplied, model.gas, model.ambient]
        parts = [model.amplitudes.real, model.amplitudes.imag, model.sides, self.heat, self.sides]
        return {"sums": sums, "parts": [part.tolist() for part in parts]}

    def _set_fmu_state(self, state):
        model = self.model
        real, imaginary, sides, heat, given = map(numpy.array, state["parts"])
        model.amplitudes, model.sides = real + 1j * imaginary, sides
        self.heat[:], self.sides[:] = heat, given
        model.supplied, model.gas, model.ambient = state["sums"]
        self.now = model.patch
