"""The thermal example: cycle jump on units whose answer is known, conduction against closed forms, and the pair with a rub FMU."""

import os
import sys
from pathlib import Path

import numpy
import pytest

EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "thermal"
sys.path.insert(0, str(EXAMPLE))

import ssp  # noqa: E402
from conduction import Casing as Ring  # noqa: E402
from conduction import Conduction  # noqa: E402
from cycle_jump import Plan, cycle_jump, resolved  # noqa: E402
from pair import Casing, Rub, script  # noqa: E402
from units import Unit, UnitError  # noqa: E402

STEP, CYCLE = 1e-3, 8


class Pulses:
    """Fluxes gain (limit − value) in pulses, once per cycle, of values that are followed with a lag: it settles in a cycle or two."""

    def __init__(self, gains, limits, kink=None):
        self.gains, self.limits, self.kink = numpy.array(gains), numpy.array(limits), kink
        self.felt, self.count, self.account = numpy.zeros(len(gains)), 0, 0.0

    def step(self, length, values):
        self.felt = self.felt + (values - self.felt) * 0.5
        pulse = 1.0 + numpy.cos(2.0 * numpy.pi * (self.count + 0.5) / CYCLE)
        limits = self.limits if self.kink is None else numpy.where(self.felt < self.kink, self.limits, 0.0)
        flux = self.gains * (limits - self.felt) * pulse
        self.count += 1
        self.account += float(flux.sum()) * length
        return flux

    def total(self):
        return self.account

    def save(self):
        return self.felt.copy(), self.count, self.account

    def restore(self, saved):
        self.felt, self.count, self.account = saved[0].copy(), saved[1], saved[2]

    def drop(self, saved):
        pass


class Stores:
    """Capacities that keep what they receive."""

    def __init__(self, capacities):
        self.capacities, self.now, self.received, self.time = numpy.array(capacities), numpy.zeros(len(capacities)), 0.0, 0.0

    def step(self, length, fluxes):
        self.now = self.now + fluxes * length / self.capacities
        self.received += float(fluxes.sum()) * length
        self.time += length

    def values(self):
        return self.now.copy()

    def save(self):
        return self.now.copy(), self.received, self.time

    def restore(self, saved):
        self.now, self.received, self.time = saved[0].copy(), saved[1], saved[2]

    def drop(self, saved):
        pass


GAINS, LIMITS, CAPACITIES, STOP = (3.0, 1.0), (20.0, 40.0), (2.0, 1.0), 2.0


def exact(times):
    """C v' = gain (limit − v)."""
    rates = numpy.array(GAINS) / numpy.array(CAPACITIES)
    return numpy.array(LIMITS) * -numpy.expm1(-rates * numpy.array(times)[:, None])


def journey(run, **plan):
    fast, slow = Pulses(GAINS, LIMITS), Stores(CAPACITIES)
    found = run(fast, slow, Plan(STEP, CYCLE, **plan), STOP)
    assert found.times[-1] == pytest.approx(slow.time, rel=1e-12)
    return found, fast, slow


def error(found):
    return numpy.abs(numpy.array(found.values) - exact(found.times)).max()


def test_jumps_come_nearer_with_their_tolerance_and_save_cycles():
    truth, _, _ = journey(resolved, tolerance=1.0)
    # What is left resolved is the lag of the pulses, some steps.
    lag = error(truth)
    assert lag < 0.4
    errors, steps = [], []
    for tolerance in (1.0, 0.1, 0.01):
        found, _, _ = journey(cycle_jump, tolerance=tolerance)
        assert all(jump.error <= tolerance for jump in found.kept)
        columns = [numpy.interp(found.times, truth.times, numpy.array(truth.values)[:, k]) for k in range(2)]
        apart = numpy.abs(numpy.array(found.values) - numpy.array(columns).T)
        errors.append(apart[-1].max())
        steps.append(found.fast_steps)
    assert errors[0] > 3.0 * errors[1] and errors[2] < 0.02, errors
    assert steps[0] < steps[1] < steps[2] < truth.fast_steps, steps
    assert steps[1] < 0.5 * truth.fast_steps


def test_jumps_of_one_length_are_of_second_order():
    errors = []
    truth, _, _ = journey(resolved, tolerance=1.0)
    for length in (0.32, 0.16, 0.08):
        found, _, _ = journey(cycle_jump, tolerance=1e9, first=length, longest=length, window=1, settling=3, begin=2)
        at = numpy.interp(found.times[-1], truth.times, numpy.array(truth.values)[:, 0])
        errors.append(abs(found.values[-1][0] - at))
    assert errors[0] > 3.3 * errors[1] > 3.3 * 3.3 * errors[2], errors


@pytest.mark.parametrize("run", [resolved, cycle_jump])
def test_books_close_over_jumps(run):
    found, fast, slow = journey(run, tolerance=0.1)
    assert found.handed == pytest.approx(slow.received, rel=1e-12)
    assert found.given == pytest.approx(slow.received, rel=1e-12)
    # What the fast unit gave itself is what was stepped together, and what it took to settle.
    assert 0.0 < found.in_windows <= fast.account * (1.0 + 1e-12)
    if run is cycle_jump:
        assert found.in_windows < 0.7 * found.given


def test_a_jump_over_a_kink_is_taken_back():
    """The flux stops at a value. Jumps that leap over that are too far, and both units go back to where they were."""
    fast, slow = Pulses((3.0,), (40.0,), kink=15.0), Stores((1.0,))
    found = cycle_jump(fast, slow, Plan(STEP, CYCLE, tolerance=0.3, first=0.2), 1.0)
    back = [jump for jump in found.jumps if not jump.kept]
    assert back and all(jump.error > 0.3 for jump in back)
    assert found.given == pytest.approx(slow.received, rel=1e-12)
    # The pulse that crosses it is a step long; jumps add the tolerance at most.
    truth = Stores((1.0,))
    resolved(Pulses((3.0,), (40.0,), kink=15.0), truth, Plan(STEP, CYCLE, tolerance=1.0), 1.0)
    at_kink = [value[0] for time, value in zip(found.times, found.values) if time < back[-1].start + back[-1].length]
    assert max(at_kink) < truth.now[0] + 1.0


def test_a_plan_says_what_is_wrong():
    with pytest.raises(ValueError, match="tolerance"):
        Plan(STEP, CYCLE, tolerance=0.0)
    with pytest.raises(ValueError, match="window"):
        Plan(STEP, CYCLE, tolerance=1.0, window=9)


def test_conduction_keeps_heat_and_takes_any_step():
    heat = numpy.zeros(12)
    heat[2], heat[8] = 1e4, 8e3
    many, once = Conduction(), Conduction()
    for _ in range(200):
        many.step(0.05, heat, (5.0, 1.0))
        once.sides = many.sides  # ramped once, held since
    once.sides = numpy.zeros(2)
    once.step(0.05, heat, (5.0, 1.0))
    once.step(9.95, heat, (5.0, 1.0))
    assert numpy.abs(many.patch - once.patch).max() < 1e-10 * many.patch.max()
    for model in (many, once):
        assert abs(model.residual) < 1e-12 * model.supplied
        assert model.supplied == pytest.approx(1.8e5, rel=1e-12)
        assert model.gas < 0.0 and model.ambient < 0.0


def test_conduction_without_films_warms_by_heat_over_capacity():
    model = Conduction(Ring(films=(0.0, 0.0)))
    model.step(100.0, numpy.full(12, 1000.0))
    assert model.patch == pytest.approx(numpy.full(12, 1.2e6 / model.capacity), rel=1e-10)
    assert model.stored == pytest.approx(1.2e6, rel=1e-10)


def test_a_thin_ring_levels_out_around_as_it_should():
    """cos θ decays with κ/R², κ = k/(ρc): the error of finite volumes is of second order in the angle."""
    errors = []
    for around in (24, 48):
        ring = Ring(radii=(0.25, 0.25, 0.25), thickness=1e-4, flanges=((5e-3, 1e-7), (4e-3, 1e-7)), films=(0.0, 0.0))
        model = Conduction(ring, around=around, layers=1)
        radius = 0.25 + 0.5e-4
        rate = 53.3 / (7850.0 * 439.8) / radius**2
        slowest = numpy.sort(model._rates[1])[0]
        errors.append(abs(slowest / rate - 1.0))
    assert errors[0] == pytest.approx(4.0 * errors[1], rel=0.05) and errors[1] < 2e-3, errors


class Wall:
    """The conduction of this example as the slow side, without FMI."""

    def __init__(self):
        self.model = Conduction()

    def step(self, length, fluxes):
        self.model.step(length, fluxes)

    def values(self):
        return self.model.patch

    def supplied(self):
        return self.model.supplied

    def save(self):
        model = self.model
        return model.amplitudes.copy(), model.supplied, model.gas, model.ambient

    def restore(self, saved):
        amplitudes, self.model.supplied, self.model.gas, self.model.ambient = saved
        self.model.amplitudes = amplitudes.copy()

    def drop(self, saved):
        pass


REVOLUTION = 2.0 * numpy.pi / 1800.0


@pytest.fixture(scope="module")
def rubs(tiprub, scene, tmp_path_factory):
    """FMUs of the example's scene, with three contact nodes to a blade."""
    work = tmp_path_factory.mktemp("thermal")
    text = (EXAMPLE / "rub.toml").read_text(encoding="utf-8").replace("rotor.rom.safetensors", str(scene.parent / "rotor37.rom.safetensors"))
    (work / "rub.toml").write_text(text, encoding="utf-8")
    library = ["--library", os.environ["TIPRUB_LIBRARY"]] if "TIPRUB_LIBRARY" in os.environ else []
    tiprub("package", work / "rub.toml", "--scalars", "-o", work, *library)
    return {fmi: work / f"thermal_rub_fmi{fmi}.fmu" for fmi in (2, 3)}


@pytest.fixture(scope="module")
def casings(tiprub, tmp_path_factory):
    """The thermal unit of the casing."""
    work = tmp_path_factory.mktemp("casing")
    library = ["--library", os.environ["TIPRUB_LIBRARY_THERMAL"]] if "TIPRUB_LIBRARY_THERMAL" in os.environ else []
    tiprub("thermal", "--output", work, *library)
    return {fmi: next(work.glob(f"*_fmi{fmi}.fmu")) for fmi in (2, 3)}


def test_finite_volumes_stand_beside_the_finite_elements(casings):
    """Two discretisations of one casing that share no line: heat in two patches, a second long and ten."""
    heat = numpy.zeros(12)
    heat[2], heat[3], heat[8] = 5e3, 1e3, 4e3
    model = Conduction(around=144, along=2.5e-3, layers=8)
    with Unit(casings[2]) as unit:
        casing = Casing(unit)
        for length in (1.0, 9.0):
            casing.step(length, heat)
            model.step(length, heat)
            apart = numpy.abs(casing.values() - model.patch).max()
            assert apart < 0.02 * model.patch.max(), (length, apart, model.patch.max())
        stored, gas, ambient = unit.get(["stored_heat", "gas_heat", "ambient_heat"])
    assert (stored, gas, ambient) == (pytest.approx(model.stored, rel=3e-3), pytest.approx(model.gas, rel=0.02), pytest.approx(model.ambient, rel=0.03))


def test_a_script_and_the_package_in_fmpy_give_the_same_bits(rubs, casings, tmp_path):
    file, count = tmp_path / "pair.ssp", 10
    ssp.write(file, rubs[2], casings[2], 12, count * REVOLUTION / 10)
    found = ssp.run_fmpy(file, REVOLUTION / 10, count, 12)
    for fmi in (2, 3):
        with Unit(rubs[fmi]) as rub, Unit(casings[fmi]) as casing:
            course = script(Rub(rub, 0.5), Casing(casing), REVOLUTION / 10, count)
        assert course.temperatures[-1].max() > 0.02, "it rubs"
        assert (course.temperatures == found.temperatures).all() and (course.heat == found.heat).all()


def test_both_versions_heat_the_casing_alike_and_hand_over_all_friction(rubs):
    found = {}
    for fmi, file in rubs.items():
        with Unit(file) as unit:
            found[fmi] = script(Rub(unit, 0.5), Wall(), REVOLUTION / 10, 20, together=False)
    two, three = found[2], found[3]
    assert two.temperatures[-1].max() > 0.05, "it rubs"
    assert (two.temperatures == three.temperatures).all() and (two.heat == three.heat).all()
    assert two.supplied == pytest.approx(two.friction, rel=1e-12)


def test_a_jump_of_the_pair_that_is_taken_back_leaves_no_trace(rubs):
    """A tolerance nobody meets: all jumps are taken back, and the run is the resolved one to the last bit."""
    count = 8
    found = []
    for run, plan in ((resolved, {}), (cycle_jump, {"first": 1.2 * REVOLUTION, "longest": 1.2 * REVOLUTION})):
        with Unit(rubs[2]) as unit:
            rub, wall = Rub(unit, 0.5), Wall()
            made = run(rub, wall, Plan(REVOLUTION / 10, 10, 1e-12, window=1, settling=1, begin=2, **plan), count * REVOLUTION)
            found.append((made, wall.values(), rub.total(), unit.time))
    (truth, values, total, _), (jumped, same, again, time) = found
    assert jumped.jumps and not jumped.kept
    assert (values == same).all() and total == again
    assert time == pytest.approx(count * REVOLUTION)
    assert jumped.given == pytest.approx(truth.given, rel=1e-12)


def test_a_unit_names_what_it_lacks(rubs):
    with Unit(rubs[2]) as unit:
        with pytest.raises(UnitError, match="no variable casing_heat"):
            unit.names("casing_heat")
        with pytest.raises(UnitError, match="no variable nothing"):
            unit.get(["nothing"])


def test_the_package_is_ssp(rubs, tmp_path):
    """Valid by the schema of SSP 1.0; each connector is a variable of its FMU."""
    from fmpy import read_model_description
    from fmpy.ssp.ssd import get_connections

    file = tmp_path / "pair.ssp"
    ssp.write(file, rubs[2], rubs[2], 12, 1.0)
    system = ssp.validate(file).system
    assert len(get_connections(system)) == 24
    known = {variable.name for variable in read_model_description(str(rubs[2])).modelVariables}
    rub = next(element for element in system.elements if element.name == "rub")
    assert {connector.name for connector in rub.connectors} <= known
