"""The code of examples/shaft: shafts against closed forms and another integrator, couplings against linear theory and the FMU's own books."""

import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy
import pytest
from scipy.integrate import solve_ivp

EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "shaft"
sys.path.insert(0, str(EXAMPLE))

import studies  # noqa: E402
from coupling import CouplingError, Rub, Way, march  # noqa: E402
from rotor import Rotor, jeffcott  # noqa: E402
from scenario import CLEARANCE, SPEED, Shafts, pressed  # noqa: E402
from spools import Spools  # noqa: E402
from stability import contraction, growth  # noqa: E402

H = 5e-5


def gyroscopic(**keywords):
    """A disk that tilts, with damping in both motions and turns coupled to displacements, as on an overhung shaft."""
    mass, polar, coupling = numpy.diag([12.0, 12.0, 0.08, 0.08]), 0.15, 3e5
    damping = numpy.diag([1.5e3, 1.5e3, 10.0, 10.0])
    turning = numpy.zeros((4, 4))
    turning[2, 3], turning[3, 2] = polar, -polar
    stiffness = numpy.diag([7e6, 7e6, 9e4, 9e4])
    stiffness[0, 3] = stiffness[3, 0] = coupling
    stiffness[1, 2] = stiffness[2, 1] = -coupling
    matrices = mass, damping, turning, stiffness
    return Rotor(matrices, range(4), **{"speed": SPEED, "clearance": CLEARANCE, **keywords}), matrices


def test_a_shaft_is_marched_exactly_and_its_works_add_up():
    shaft, (mass, damping, turning, stiffness) = gyroscopic()
    shaft.unbalance = 2e-3 - 1e-3j
    generator, outputs, state, angle = numpy.random.default_rng(1), [], numpy.zeros(8), 0.0
    for _ in range(12):
        outputs.append(generator.normal(size=5) * [1e4, 1e4, 300.0, 300.0, 0.0])
        shaft.commit(outputs[-1], None, 20 * H)

    def rate(time, state, force):
        turned = shaft.unbalance * SPEED**2 * numpy.exp(1j * (angle + SPEED * time))
        pushed = force + [turned.real, turned.imag, 0.0, 0.0] - (damping + SPEED * turning) @ state[4:] - stiffness @ state[:4]
        return numpy.concatenate([state[4:], numpy.linalg.solve(mass, pushed)])

    for force in outputs:
        state = solve_ivp(rate, (0.0, 20 * H), state, args=(force[:4],), method="DOP853", rtol=1e-12, atol=1e-16).y[:, -1]
        angle += 20 * H * SPEED
    assert shaft.place == pytest.approx(state[:4], rel=1e-8, abs=1e-12)
    assert shaft.velocity == pytest.approx(state[4:], rel=1e-8, abs=1e-9)
    work = shaft.energies
    added = work["force"] + work["moment"] + work["unbalance"] - work["damping"]
    assert min(abs(work[name]) for name in ("force", "moment", "unbalance", "damping")) > 0.1, "every work counts"
    assert shaft.lateral_energy() == pytest.approx(added, rel=1e-11)


def test_whirl_of_a_disk_is_that_of_closed_forms():
    mass, damping, stiffness, diametral, polar, tilting = 12.0, 2e3, 8e6, 0.08, 0.15, 2e5
    shaft = jeffcott(mass, damping, stiffness, diametral=diametral, polar=polar, tilting=tilting, speed=SPEED, clearance=CLEARANCE)
    # Tilting: I_d s² − i I_p Ω s + k = 0 for s = iω, forwards and backwards.
    half = polar * SPEED / (2.0 * diametral)
    expected = half + numpy.array([-1.0, 1.0]) * numpy.sqrt(half**2 + tilting / diametral)
    found = numpy.linalg.eigvals(shaft.dynamics(SPEED)[:8, :8])
    for frequency in numpy.abs(expected):
        assert numpy.abs(found - 1j * frequency).min() < 1e-9 * frequency
    shaft.unbalance = 1e-3
    shaft.turn_steadily()
    whirl = 1e-3 * SPEED**2 / (stiffness - mass * SPEED**2 + 1j * damping * SPEED)
    for _ in range(200):
        at = whirl * numpy.exp(1j * shaft.angle)
        assert shaft.place[:2] == pytest.approx([at.real, at.imag], abs=1e-11 * abs(whirl))
        shaft.commit(numpy.zeros(5), None, H)


def test_a_shaft_that_slows_down_pays_for_its_whirl():
    shaft, _ = gyroscopic(inertia=0.05, drive=20.0)
    shaft.unbalance = 3e-3
    start = shaft.turning_energy()
    for step in range(400):
        shaft.commit(numpy.array([100.0, 0.0, 5.0, 0.0, -200.0 if step < 300 else 0.0]), None, H)
    work, owed = shaft.energies, shaft.state[2 * shaft.size + 2]
    assert shaft.speed < SPEED - 10.0 and work["unbalance"] > 1.0
    paid = work["torque"] + work["drive"] - (work["unbalance"] - owed)
    assert shaft.turning_energy() - start == pytest.approx(paid, rel=1e-9)


class Spring:
    """A rub that is a spring in x and y, with friction across: what the linear theory is about, with the calls of an FMU."""

    def __init__(self, stiffness):
        self.stiffness, self.at, self.steps, self.derivatives = stiffness, numpy.zeros(2), 0, 0

    def step(self, values, _step):
        self.steps += 1
        mean, self.at = 0.5 * (self.at + values[:2]), numpy.array(values[:2])
        return numpy.array([*(-self.stiffness @ mean), 0.0, 0.0, 0.0])

    def keep(self):
        self.kept = self.at

    def back(self):
        self.at = self.kept

    def slope(self):
        found = numpy.zeros((5, 3))
        found[:2, :2] = -0.5 * self.stiffness
        return found


STIFF = numpy.array([[3e7, 3e6], [-3e6, 3e7]])


def leaning(way, step, length, mass=12.0, damping=0.2):
    """A disk that leans on the spring, let go out of its middle."""
    disk = jeffcott(mass, damping * numpy.sqrt(2e7 * mass), 2e7, speed=SPEED, clearance=CLEARANCE)
    disk.rest(numpy.array([1e4, 0.0, 0.0, 0.0, 0.0]))
    spring = Spring(STIFF)
    spring.at = disk.place[:2]
    first = -STIFF @ spring.at
    run = march(spring, disk, way, step, round(length / step), last=[*first, 0.0, 0.0, 0.0], precision=1e-12)
    return disk.place[:2], run


def test_ways_converge_at_their_order():
    mass, damping = 12.0, 0.2 * numpy.sqrt(2e7 * 12.0)
    whole = numpy.block([[numpy.zeros((2, 2)), numpy.eye(2)], [-(2e7 * numpy.eye(2) + STIFF) / mass, -damping / mass * numpy.eye(2)]])
    exact = solve_ivp(lambda _t, state: whole @ state, (0.0, 8e-3), [5e-4, 0.0, 0.0, 0.0], method="DOP853", rtol=1e-11, atol=1e-15).y[:2, -1]
    for way in Way:
        error = [numpy.hypot(*(leaning(way, step, 8e-3)[0] - exact)) for step in (8e-6, 4e-6)]
        order = 1.0 if way in (Way.JACOBI, Way.PARTNER_FIRST) else 2.0
        assert numpy.log2(error[0] / error[1]) == pytest.approx(order, abs=0.15), way
    assert leaning(Way.NEWTON, 4e-5, 8e-3)[1].tried <= 2.0 < leaning(Way.FIXED_POINT, 4e-5, 8e-3)[1].tried


@pytest.mark.parametrize("way", list(Way))
def test_growth_tells_which_steps_are_stable(way):
    disk = jeffcott(0.5, 0.5 * numpy.sqrt(2e7 * 0.5), 2e7, speed=SPEED, clearance=CLEARANCE)
    stiff = numpy.vstack([STIFF, numpy.zeros((2, 2))])
    seen = set()
    for step in 1e-6 * 2.0 ** numpy.arange(10):
        judged = growth(disk, stiff, way, step)
        # As many steps as it takes to see; near the limit that is too many, as is an iteration that hardly comes nearer.
        count = round(6.0 / abs(numpy.log(judged))) + 60
        if count > 3000 or (way is Way.FIXED_POINT and contraction(disk, stiff, step) > 0.8):
            continue
        _, run = leaning(way, step, count * step, mass=0.5, damping=0.5)
        grown = numpy.abs(run.values[-20:, :2]).max() / numpy.abs(run.values[:20, :2]).max()
        assert (grown < 1.0) == (judged < 1.0), (step, judged, grown)
        seen.add(judged < 1.0)
    assert seen == ({True} if way.implicit else {True, False}), "both sides of the limit are seen"


def test_a_disk_that_touches_nothing_whirls_as_without_the_fmu(whirling):
    disk = jeffcott(12.0, 2e3, 8e6, diametral=0.08, polar=0.15, tilting=2e5, speed=SPEED, clearance=CLEARANCE)
    disk.unbalance = 2e-3
    disk.turn_steadily()
    whirl = 2e-3 * SPEED**2 / (8e6 - 12.0 * SPEED**2 + 2e3j * SPEED)
    assert abs(whirl) < 0.8 * CLEARANCE
    for way in (Way.RUB_FIRST, Way.NEWTON):
        disk.turn_steadily()
        begun = disk.angle
        with Rub(whirling.three, disk.inputs, disk.outputs, derivatives=way is Way.NEWTON) as rub:
            rub.start(disk.known())
            run = march(rub, disk, way, H, 80)
        at = whirl * numpy.exp(1j * (begun + SPEED * run.times))
        assert run.values[:, :2].T == pytest.approx(numpy.array([at.real, at.imag]), abs=1e-11 * abs(whirl))
        assert not run.outputs.any()


@pytest.fixture(scope="module")
def after(whirling):
    """The FMU coupled in each way, for 2.5 ms after a blade is lost."""
    found = {}
    for way in Way:
        disk = Shafts("disk").whirling()
        start = disk.turning_energy()
        run = studies.coupled(whirling.three, disk, way, H, 2.5e-3, before=lambda _index, partner, _step: setattr(partner, "unbalance", 1.2e-2),
                              parameters={"internal_step_max": 1e-6}, watch=studies.TOLD)  # fmt: skip
        found[way] = SimpleNamespace(run=run, books=studies.balance(disk, run, start), disk=disk)
    return found


def test_both_sides_book_the_same_energy_where_they_agree(after):
    for way, found in after.items():
        books, run = found.books, found.run
        assert numpy.abs(run.outputs).max(axis=0).min() > 10.0, "forces, both moments and the torque are there"
        scale, turned = abs(books["whirl work, ledger of the rub"]), abs(books["shaft work, ledger of the rub"])
        assert scale > 1.0 and turned > 100.0
        assert abs(books["torque × speed input, minus this ledger"]) < 1e-11 * turned
        assert abs(books["lateral energy of the shaft, minus all work on it"]) < 1e-10 * scale
        assert abs(books["work of moments on the tilt"]) > 1e-3 * scale
        # The ledger of this scheme takes displacements as means of two internal steps: a share of about h times the frequency.
        assert abs(books["forces × whirl input, minus this ledger"]) < 1e-2 * scale
        gap = books["forces × whirl of the shaft, minus this ledger"] - books["forces × whirl input, minus this ledger"]
        if way.implicit:
            assert run.unsolved == 0
            assert abs(gap) < 1e-4 * scale and abs(books["torque × speed of the shaft, minus this ledger"]) < 1e-6 * turned
            whole = books["total energy, minus work of moments and curvature work"] + books["forces × whirl input, minus this ledger"]
            assert abs(whole) < 1e-5 * scale, whole
        elif way in (Way.JACOBI, Way.PARTNER_FIRST):
            assert abs(gap) > 0.05 * scale, "what is told late is work that nobody did"


def test_implicit_ways_agree_and_turns_come_near_them(after):
    places = {way: studies.place_of(found.run, found.disk) for way, found in after.items()}
    distance = lambda one, other: numpy.hypot(*(places[one] - places[other]).T).max()
    assert distance(Way.NEWTON, Way.FIXED_POINT) < 1e-3
    assert distance(Way.NEWTON, Way.RUB_FIRST) < 0.1 * distance(Way.NEWTON, Way.JACOBI)


def test_impulse_handed_over_is_that_of_all_internal_steps(whirling, after):
    fixed = {"internal_step_max": 1e-6}
    found = after[Way.RUB_FIRST]
    handed, summed = studies.replayed(whirling.three, found.disk, found.run, fixed)
    assert numpy.hypot(*handed) > 1.0
    assert numpy.hypot(*(handed - summed)) < 1e-11 * numpy.hypot(*handed)


def test_a_light_disk_needs_newton(whirling):
    def pressing(way):
        disk, before = pressed(0.1)
        return studies.coupled(whirling.three, disk, way, 1e-4, 1e-2, before=before), disk

    found, _ = pressing(Way.NEWTON)
    place, swing = studies.steadiness(found)
    assert found.unsolved <= 1 and place[0] == pytest.approx(1.2, abs=0.1) and swing < 0.2
    for way in (Way.JACOBI, Way.PARTNER_FIRST, Way.RUB_FIRST, Way.FIXED_POINT):
        try:
            other, _ = pressing(way)
        except CouplingError as error:
            assert "the rub failed at" in str(error)
        else:
            assert other.unsolved > 5 or studies.steadiness(other)[1] > 2.0 * swing, way


def test_going_back_gives_the_same_bits_here_and_in_another_process(whirling, tmp_path):
    (table,) = studies.rollback(whirling.three, Shafts("disk"), tmp_path, True, lambda _what: None)
    assert len(table.rows) == 4 and all(row[-2] > 500 and row[-1] == 0 for row in table.rows), table.rows


def test_spools_are_those_of_closed_forms_and_a_rub_brakes_them(tiprub, scene, work):
    # One spool without drag: Ω = Ω_free + (Ω₀ − Ω_free) exp(−t/τ), τ = J Ω_free / drive.
    pair = Spools(["low", "high"], [0.1, 0.2], [500.0, -300.0], [2000.0, -1000.0], [2000.0, -900.0], 0.0)
    for _ in range(50):
        pair.commit(numpy.zeros(2), None, 1e-3)
    expected = [2000.0 - 1500.0 * numpy.exp(-0.05 / 0.1), -900.0 + 600.0 * numpy.exp(-0.05 / 0.18)]
    assert pair.speed == pytest.approx(expected, rel=1e-12)
    path = work / "spools.toml"
    path.write_text((EXAMPLE / "two_spools.toml").read_text().replace("builtin:rotor37-one-row", "rotor37.rom.safetensors"))
    tiprub("package", path, "--fmi", "3", "--scalars", "-o", work / "spools.fmu", *library())
    taken = {}
    for way in (Way.JACOBI, Way.RUB_FIRST, Way.FIXED_POINT):
        pair = studies.spools()
        with Rub(work / "spools.fmu", pair.inputs, pair.outputs) as rub:
            rub.start(pair.known())
            before = pair.turning_energy()
            run = march(rub, pair, way, 1e-4, 60, watch=["shaft_work"], precision=1e-12)
        brake, supplied = pair.state[2:]
        assert run.watched[-1][0] > 50.0 and run.outputs[:, 0].min() < -1.0 and run.outputs[:, 1].max() > 1.0
        assert pair.turning_energy() - before == pytest.approx(brake + supplied, rel=1e-9)
        assert -(run.outputs * run.values).sum() * 1e-4 == pytest.approx(run.watched[-1][0], rel=1e-11)
        taken[way] = abs(brake + run.watched[-1][0]) / run.watched[-1][0]
    assert taken[Way.FIXED_POINT] < 1e-9 < taken[Way.RUB_FIRST] < 1e-4 < taken[Way.JACOBI]


def library():
    return ["--library", os.environ["TIPRUB_LIBRARY"]] if "TIPRUB_LIBRARY" in os.environ else []


def test_what_is_missing_is_said(whirling, monkeypatch):
    with pytest.raises(CouplingError, match="no variable axial_shift: its scene does not ask for it"):
        Rub(whirling.three, ["whirl_x", "axial_shift"], ["force_x"])
    with pytest.raises(ValueError, match="can move without force"):
        jeffcott(1.0, 0.0, 0.0, speed=1.0, clearance=1.0)
    ask = lambda *more: subprocess.run([sys.executable, str(EXAMPLE / "shaft.py"), *more], capture_output=True, text=True, check=False)
    assert "no study eror: there are response, errors, stability" in ask("eror").stderr
    assert "--quick" in ask("--help").stdout
    monkeypatch.setenv("TIPRUB", "/nowhere/tiprub")
    refused = ask("energy", "--into", str(Path(whirling.three).parent / "none"))
    assert refused.returncode == 1 and refused.stderr.splitlines()[-1].startswith("error: no tiprub program at /nowhere/tiprub")


def test_a_beam_shaft_whirls_as_ross_says():
    pytest.importorskip("ross", reason="ROSS is in the environment of examples/shaft only")
    (table,) = studies.response(Shafts("ross"), lambda _what: None)
    assert len(table.rows) == 5
    for _, whirl, displaced, tilt, tilted in table.rows:
        assert whirl > 1e-6 and tilt > 1e-6 and displaced < 1e-9 and tilted < 1e-9, table.rows
