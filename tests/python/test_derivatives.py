"""Derivatives of outputs over the last step by FMPy: both versions, against differences by saved states, and what is refused."""

from types import SimpleNamespace

import numpy
import pytest
from fmpy import extract, read_model_description
from fmpy.fmi1 import FMICallException

from importers import Three, Two

H = 1e-4
# The rotor whirls into the round casing, whose clearance is 0.356 mm.
WHIRL = (3.7e-4, 0.8e-4)
KNOWNS = ["whirl_x", "whirl_y", "speed"]
UNKNOWNS = ["force_x", "force_y", "torque", "clearance_minimum"]


@pytest.fixture(params=["two", "three"])
def make(request, whirling, tmp_path):
    """Maker of instances of the whirling rotor."""
    file = getattr(whirling, request.param)
    fmu = SimpleNamespace(directory=extract(str(file), unzipdir=str(tmp_path)), description=read_model_description(str(file)))
    made = []

    def start(on=True):
        instance = (Two if request.param == "two" else Three)(fmu)
        made.append(instance)
        if on:
            instance.set(step_derivatives=2)
        instance.initialise()
        return instance

    yield start
    for instance in made:
        instance.free()


def references(instance, names):
    return [instance.variables[name][1] for name in names]


def directional(instance, unknowns, knowns, seed):
    return instance.fmu.getDirectionalDerivative(references(instance, unknowns), references(instance, knowns), seed)


def rub(instance, steps=40):
    """Whirl into the casing; the step after that is yet to be done."""
    for step in range(steps):
        grown = min(1.0, (step + 1) / 30)
        instance.set(whirl_x=grown * WHIRL[0], whirl_y=grown * WHIRL[1])
        instance.step(step * H, H)
    return steps * H


def test_derivatives_are_those_of_steps_repeated_from_a_saved_state(make):
    instance = make()
    time = rub(instance)
    state = instance.save()
    instance.step(time, H)
    assert abs(instance.get("force_x")) > 1.0
    found = numpy.array([directional(instance, UNKNOWNS, [known], [1.0]) for known in KNOWNS]).T
    moved = {"whirl_x": 1e-9, "whirl_y": 1e-9, "speed": 1e-3}
    expected = []
    for known in KNOWNS:
        ends = []
        for sign in (1.0, -1.0):
            instance.restore(state)
            instance.set(**{known: instance.get(known) + sign * moved[known]})
            instance.step(time, H)
            ends.append(instance.get(*UNKNOWNS))
        expected.append((numpy.array(ends[0]) - numpy.array(ends[1])) / (2.0 * moved[known]))
    expected = numpy.array(expected).T
    assert abs(expected[0, 0]) > 1e4, "N/m: there is a contact"
    # The least clearance is that of a closed contact: it stays 0.
    scale = abs(expected).max(axis=1, keepdims=True)
    assert (abs(found - expected) <= 1e-3 * scale).all(), (found, expected)
    # All at once, which FMI 3.0 can do backwards too.
    instance.restore(state)
    instance.step(time, H)
    seed = [1e-6, -2e-6, 0.5]
    together = numpy.array(directional(instance, UNKNOWNS, KNOWNS, seed))
    sums = found @ numpy.array(seed)
    assert (abs(together - sums) <= 1e-3 * (abs(found) @ abs(numpy.array(seed)))).all()
    if isinstance(instance, Three):
        weights = [1.0, 2.0, -0.5, 1e5]
        backwards = instance.fmu.getAdjointDerivative(
            references(instance, UNKNOWNS), references(instance, KNOWNS), weights, nSensitivity=len(KNOWNS)
        )
        assert backwards == pytest.approx(numpy.array(weights) @ found, rel=1e-12)


def test_the_run_is_the_same_with_and_without(make):
    plain, asked = make(on=False), make()
    for step in range(20):
        for instance in (plain, asked):
            instance.set(whirl_x=(step + 1) / 20 * WHIRL[0])
            instance.step(step * H, H)
        directional(asked, UNKNOWNS, KNOWNS, [1.0, 1.0, 1.0])
        names = [*UNKNOWNS, "rotor_angle", "internal_steps"]
        assert plain.get(*names) == asked.get(*names)


def test_what_is_refused(make):
    instance = make(on=False)
    instance.step(0.0, H)
    ask = lambda: directional(instance, ["torque"], ["speed"], [1.0])
    assert "set the parameter step_derivatives to on" in instance.refused(ask)
    instance = make()
    assert "none has been completed" in instance.refused(ask)
    state = instance.save()
    instance.step(0.0, H)
    assert ask()[0] == 0.0
    assert "not a continuous real output" in instance.refused(lambda: directional(instance, ["speed"], ["speed"], [1.0]))
    assert "not a continuous real input" in instance.refused(lambda: directional(instance, ["torque"], ["gap_offset"], [1.0]))
    assert "seed" in instance.refused(lambda: directional(instance, ["torque"], ["speed"], [float("nan")]))
    kind = "Real" if isinstance(instance, Two) else "Float64"
    assert f"not {kind}" in instance.refused(lambda: directional(instance, ["torque"], ["scheme"], [1.0]))
    if isinstance(instance, Three):
        with pytest.raises(FMICallException):
            instance.fmu.getDirectionalDerivative(references(instance, ["torque"]), references(instance, ["speed"]), [1.0, 2.0])
    instance.restore(state)
    assert "none has been completed" in instance.refused(ask)
