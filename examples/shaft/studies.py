"""Studies: error, stability, energy and impulse, bits after restoring a state, a lost blade, two spools. Each returns tables and data for figures."""

import json
import subprocess
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path

import numpy

from coupling import CouplingError, Rub, Run, Way, march
from scenario import CLEARANCE, blade_off, place_of, pressed, response_of
from spools import Spools
from stability import contraction, growth

HERE = Path(__file__).resolve().parent
TOLD = ["whirl_work", "shaft_work", "scheme_energy", "friction_loss", "damping_loss", "impact_loss", "curvature_work"]
# Unbalance of the run that goes back (kg m).
TURNING = 2e-3 + 1e-3j


@dataclass
class Table:
    """Rows of a table with their header; series to draw by name."""

    name: str
    header: list
    rows: list = field(default_factory=list)
    series: dict = field(default_factory=dict)


def coupled(file, rotor, way, step, length, *, before=None, parameters=None, watch=(), progress=None, slopes=None):
    """A run of a shaft and a rub, with the instance of the rub ended."""
    hook = None if before is None else lambda index, partner: before(index, partner, step)
    derivatives = way is Way.NEWTON or slopes is not None
    with Rub(file, rotor.inputs, rotor.outputs, parameters=parameters, derivatives=derivatives) as rub:
        rub.start(rotor.known())
        return march(rub, rotor, way, step, round(length / step), before=hook, watch=watch, progress=progress, slopes=slopes)


def response(shafts, say):
    """Compare the integrated whirl under unbalance, without rub, with the steady response of ROSS: displacement and tilt of the disk."""
    header = ["speed (rad/s)", "whirl of ROSS for 1e-3 kg m (m)", "largest difference / whirl", "tilt of ROSS (rad)", "difference / tilt"]
    table = Table("response", header)
    for speed in (400.0, 750.0, 1200.0, 1800.0, 2600.0):
        say(f"response: {speed:g} rad/s")
        shaft = shafts.whirling(speed=speed, inertia=numpy.inf)
        shaft.unbalance = 1e-3
        shaft.turn_steadily()
        whirl = response_of(shafts.ross, speed)
        size, worst = numpy.abs(whirl), numpy.zeros(4)
        for _ in range(200):
            shaft.commit(numpy.zeros(5), None, 5e-5)
            worst = numpy.maximum(worst, numpy.abs(shaft.place - (whirl * numpy.exp(1j * shaft.angle)).real))
        table.rows.append([speed, size[0], worst[:2].max() / size[0], size[2], worst[2:].max() / size[2]])
    return [table]


def errors(file, shafts, quick, say):
    """Orbit after a lost blade against that of a fine run, over H and way."""
    length, at = (2.4e-3 if quick else 4e-3), 0.2e-3
    steps = [1e-4, 5e-5] if quick else [2e-4, 1e-4, 5e-5, 2.5e-5]
    fine = 2.5e-5 if quick else 1.25e-5

    def orbit(way, step, tolerance):
        rotor = shafts.whirling()
        run = coupled(file, rotor, way, step, length, before=blade_off(at), parameters={"tolerance": tolerance})
        every = round(steps[0] / step)
        return place_of(run, rotor)[every - 1 :: every], run

    def distance(one, other):
        return float(numpy.hypot(*(one - other).T).max())

    table = Table("errors", ["method", "H (s)", "error / clearance", "steps of the rub per H", "derivatives per H", "not solved", "processor time (s)"])
    say(f"errors: the fine run, H = {fine:g} s")
    reference, _ = orbit(Way.NEWTON, fine, 1e-4)
    for what, step, tolerance in [("H twice as long", 2.0 * fine, 1e-4), ("tolerance ten times as large", fine, 1e-3)]:
        say(f"errors: reference, {what}")
        found, run = orbit(Way.NEWTON, step, tolerance)
        table.rows.append([f"reference, {what}", step, distance(found, reference), run.tried, run.derivatives, run.unsolved, None])
    for way in Way:
        for step in steps:
            say(f"errors: {way.value}, H = {step:g} s")
            begun = time.process_time()
            try:
                found, run = orbit(way, step, 1e-4)
                row = [distance(found, reference), run.tried, run.derivatives, run.unsolved, time.process_time() - begun]
                table.series.setdefault(way.value, []).append((step, row[0]))
            except CouplingError:
                row = ["run failed", None, None, None, None]
            table.rows.append([way.value, step, *row])
    return [table]


def steadiness(run, clearance=CLEARANCE):
    """Return the mean position and the largest deviation from it in the last quarter, as fractions of the clearance."""
    last = run.values[-len(run.values) // 4 :, :2] / clearance
    mean = last.mean(axis=0)
    return mean, float(numpy.hypot(*(last - mean).T).max())


def stability(file, quick, say, masses=None):
    """Find the longest communication step with which a disk that is pressed against the casing comes to rest, for each mass and method."""
    masses = masses or ([1.0] if quick else [12.0, 1.0, 0.1])
    steps = [2e-4, 1e-4, 5e-5] if quick else [8e-4, 4e-4, 2e-4, 1e-4, 5e-5, 2.5e-5, 1.25e-5]
    length, fine = 1.2e-2, 5e-5
    table = Table("stability", ["mass (kg)", "method", "longest stable H (s)", "linear theory (s)", "behaviour at the next H"])
    stiff = Table("stiffness", ["mass (kg)", "H (s)", "stiffness over a step, x (N/m)", "y (N/m)", "contraction factor of the fixed point"])
    for mass in masses:
        disk, before = pressed(mass)
        say(f"stability: {mass:g} kg, the fine run")
        place, departure = steadiness(coupled(file, disk, Way.NEWTON, fine, length, before=before))
        matrices = {}
        for step in steps:
            disk, before = pressed(mass)
            say(f"stability: {mass:g} kg, stiffness over H = {step:g} s")
            slopes = []
            coupled(file, disk, Way.NEWTON, step, 8e-3, before=before, slopes=slopes)
            # The force is a mean over the step, the whirl that of its end: twice the derivative is what a spring would have.
            matrices[step] = -2.0 * numpy.mean(slopes[-len(slopes) // 3 :], axis=0)[:2, :2]
            stiff.rows.append([mass, step, matrices[step][0, 0], matrices[step][1, 1], contraction(disk, pad(matrices[step]), step)])
        for way in Way:
            measured, refused = longest(steps[::-1], lambda step: comes_to_rest(file, mass, way, step, length, (place, departure), say))
            theory, _ = longest(steps[::-1], lambda step: ("" if expected(disk, matrices[step], way, step) else "grows"))
            table.rows.append([mass, way.value, measured, theory, refused or "none in the table"])
    return [table, stiff]


def longest(steps, told):
    """Return the longest of the rising steps below the first one that fails, and the report of that one. Return no step if the first one fails."""
    found = None
    for step in steps:
        said = told(step)
        if said:
            return found, said
        found = step
    return found, ""


def comes_to_rest(file, mass, way, step, length, wanted, say):
    """Return an empty text if the disk comes to rest at the expected position. Otherwise describe its motion."""
    say(f"stability: {mass:g} kg, {way.value}, H = {step:g} s")
    disk, before = pressed(mass)
    try:
        found, swing = steadiness(coupled(file, disk, way, step, length, before=before))
    except CouplingError:
        return "run failed"
    if swing >= wanted[1] + 0.1:
        return f"oscillates by {swing:.2f}"
    off = numpy.hypot(*(found - wanted[0]))
    return f"is off by {off:.2f}" if off >= 0.1 else ""


def pad(matrix):
    """Stiffness of forces to whirl, without moments."""
    return numpy.vstack([matrix, numpy.zeros((2, 2))])


def expected(disk, matrix, way, step):
    """Return whether a step is stable in the linear theory. Implicit methods are stable if their iteration converges."""
    if way is Way.FIXED_POINT:
        return contraction(disk, pad(matrix), step) < 1.0
    return growth(disk, pad(matrix), way, step) < 1.0


def energy(file, shafts, quick, say):
    """Compare energy and impulse on both sides of the coupling, for each method."""
    step, length = 5e-5, 2e-3 if quick else 1e-2
    table = Table("energy", ["energy (J)", *[way.value for way in Way]])
    columns = []
    for way in Way:
        say(f"energy: {way.value}")
        rotor = shafts.whirling()
        start = rotor.turning_energy()
        run = coupled(file, rotor, way, step, length, before=blade_off(0.5e-3), watch=TOLD)
        columns.append(balance(rotor, run, start))
    table.rows = [[name, *[column[name] for column in columns]] for name in columns[0]]
    header = ["internal step (s)", "exchanged impulse (N s)", "minus the sum over internal steps", "forces × whirl (J)", "minus whirl work of the ledger"]
    impulse = Table("impulse", header)
    for inner in (1e-6, 5e-7):
        say(f"impulse: internal step {inner:g} s")
        rotor, fixed = shafts.whirling(), {"scheme": 2, "internal_step_max": inner}
        run = coupled(file, rotor, Way.NEWTON, step, 2e-3, before=blade_off(0.0), parameters=fixed, watch=TOLD)
        handed, again = replayed(file, rotor, run, fixed)
        whirl = whirl_work(run)
        impulse.rows.append([inner, float(numpy.hypot(*handed)), float(numpy.hypot(*(handed - again))), whirl, whirl - run.watched[-1][0]])
    return [table, impulse]


def whirl_work(run):
    """Return minus the forces times the whirl input of the rub (J)."""
    given = numpy.diff(numpy.vstack([[0.0, 0.0], run.values[:, :2]]), axis=0)
    return -float((run.outputs[:, :2] * given).sum())


def balance(rotor, run, start):
    """Return the energies of one run (J)."""
    work, told = rotor.energies, dict(zip(TOLD, run.watched[-1]))
    shaft = -float(run.outputs[:, 4] @ run.values[:, 2]) * run.step
    lateral, turning = rotor.lateral_energy(), rotor.turning_energy() - start
    # The work of the unbalance in the last step reduces the rotational energy in the next step only.
    owed = float(rotor.state[2 * rotor.size + 2])
    stored = told["scheme_energy"] + told["friction_loss"] + told["damping_loss"] + told["impact_loss"] - told["curvature_work"]
    return {
        "whirl work, ledger of the rub": told["whirl_work"],
        "forces × whirl input, minus this ledger": whirl_work(run) - told["whirl_work"],
        "forces × whirl of the shaft, minus this ledger": -work["force"] - told["whirl_work"],
        "shaft work, ledger of the rub": told["shaft_work"],
        "torque × speed input, minus this ledger": shaft - told["shaft_work"],
        "torque × speed of the shaft, minus this ledger": -work["torque"] - told["shaft_work"],
        "work of moments on the tilt": work["moment"],
        "lateral energy of the shaft, minus all work on it": lateral
        - (work["force"] + work["moment"] + work["load"] + work["unbalance"] - work["damping"]),
        "total energy, minus work of moments and curvature work": lateral + work["damping"] + turning - owed + stored - work["moment"],
    }


def replayed(file, rotor, run, fixed):
    """Return the exchanged impulse (N s), and the sum over the internal steps of an instance with the same whirl."""
    inner = fixed["internal_step_max"]
    parts = round(run.step / inner)
    with Rub(file, rotor.inputs, rotor.outputs, parameters=fixed) as rub:
        before = run.values[0] * [0.0, 0.0, 1.0]
        rub.start(before)
        total = numpy.zeros(2)
        for end in run.values:
            for part in range(1, parts + 1):
                # Whirl is linear over the step, and the speed is constant.
                values = before + (end - before) * part / parts
                values[2] = end[2]
                total += inner * rub.step(values, inner)[:2]
            before = end
    return run.step * run.outputs[:, :2].sum(axis=0), total


def rollback(file, shafts, into, quick, say):
    """Restore a run in the same instance and in another process, repeat it, and compare the bits."""
    step, count = 5e-5, 60 if quick else 120
    half = count // 2
    table = Table("rollback", ["method", "restored in", "repeated communication steps", "values compared", "different bits"])
    for way in (Way.RUB_FIRST, Way.NEWTON) if quick else (Way.RUB_FIRST, Way.FIXED_POINT, Way.NEWTON):
        say(f"bits: {way.value}")
        rotor = shafts.whirling()
        rotor.unbalance = TURNING
        rotor.turn_steadily()
        # Enough to be in contact in the middle of the run.
        rotor.state[: 2 * rotor.size] *= 3.0
        with Rub(file, rotor.inputs, rotor.outputs, derivatives=way is Way.NEWTON) as rub:
            rub.start(rotor.known())
            first = march(rub, rotor, way, step, half)
            kept = rub.to_bytes(), rotor.save(), first.outputs[-1]
            whole = march(rub, rotor, way, step, half, last=kept[2])
            rub.from_bytes(kept[0])
            rotor.restore(kept[1])
            again = march(rub, rotor, way, step, half, last=kept[2])
        table.rows.append([way.value, "same instance", half, *compare(whole, again)])
        other = elsewhere(file, shafts.kind, way, step, half, kept, into)
        table.rows.append([way.value, "another process", half, *compare(whole, other)])
        if not (numpy.abs(whole.outputs[:, 0]) > 1.0).any():
            raise CouplingError("the restored run has no contact, so it does not test the bits")
    return [table]


def compare(one, other):
    """Return how many numbers are compared, and how many of them differ in a bit."""
    pairs = [(getattr(one, name), getattr(other, name)) for name in ("values", "outputs", "states")]
    return sum(first.size for first, _ in pairs), sum(int((first.view(numpy.uint64) != second.view(numpy.uint64)).sum()) for first, second in pairs)


def elsewhere(file, kind, way, step, count, kept, into):
    """Run the second half in another process, which gets its data from files."""
    rub, rotor, last = kept
    state, answer = Path(into) / "rollback.state", Path(into) / "rollback.npz"
    state.write_bytes(rub)
    numpy.savez(answer, rotor=rotor, last=last)
    asked = {"file": str(file), "kind": kind, "way": way.value, "step": step, "count": count, "state": str(state), "answer": str(answer)}
    command = [sys.executable, str(HERE / "shaft.py"), "--resume", json.dumps(asked)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise CouplingError(f"the other process failed:\n{done.stderr.strip()}")
    found = numpy.load(answer)
    state.unlink()
    answer.unlink()
    return Run(step, values=found["values"], outputs=found["outputs"], states=found["states"])


def resume(asked, shafts_of):
    """Run the second half on behalf of `elsewhere`."""
    asked, way = dict(asked), Way(asked["way"])
    answer = Path(asked["answer"])
    kept = numpy.load(answer)
    rotor = shafts_of(asked["kind"]).whirling()
    rotor.unbalance = TURNING
    with Rub(asked["file"], rotor.inputs, rotor.outputs, derivatives=way is Way.NEWTON) as rub:
        rub.from_bytes(Path(asked["state"]).read_bytes())
        rotor.restore(kept["rotor"])
        run = march(rub, rotor, way, asked["step"], asked["count"], last=kept["last"])
    numpy.savez(answer, values=run.values, outputs=run.outputs, states=run.states)


def lost_blade(file, shafts, quick, say):
    """Lose a blade at speed: orbit, forces, moments, the deceleration of the rotor, and the energy balance."""
    step, length, at = 5e-5, 6e-3 if quick else 4e-2, 1e-3
    rotor = shafts.whirling()
    start = rotor.turning_energy()
    say(f"blade off: {length:g} s")
    begun = time.perf_counter()
    run = coupled(file, rotor, Way.NEWTON, step, length, before=blade_off(at), watch=TOLD)
    seconds = time.perf_counter() - begun
    units = [f"{name} ({'N' if 'force' in name else 'N m'})" for name in rotor.outputs]
    history = Table("blade_off", ["time (s)", "whirl_x (m)", "whirl_y (m)", "speed (rad/s)", *units])
    for time_, values, outputs in zip(run.times, run.values, run.outputs):
        history.rows.append([time_, *values, *outputs])
    bare = shafts.whirling()
    free = Table("blade_off_without_rub", ["time (s)", "whirl_x (m)", "whirl_y (m)"])
    for index in range(round(length / step)):
        blade_off(at)(index, bare, step)
        bare.commit(numpy.zeros(5), None, step)
        free.rows.append([(index + 1) * step, *bare.place[:2]])
    told, work = dict(zip(TOLD, run.watched[-1])), rotor.energies
    radius = numpy.hypot(*place_of(run, rotor).T)
    facts = Table("blade_off_facts", ["quantity", "unit", "value"])
    forces = numpy.hypot(run.outputs[:, 0], run.outputs[:, 1])
    facts.rows = [
        ["largest whirl", "× clearance", radius.max()],
        ["largest whirl without rub", "× clearance", max(numpy.hypot(*row[1:]) for row in free.rows) / CLEARANCE],
        ["largest force, mean over H", "N", forces.max()],
        ["largest moment, mean over H", "N m", numpy.hypot(run.outputs[:, 2], run.outputs[:, 3]).max()],
        ["largest braking torque, mean over H", "N m", -run.outputs[:, 4].min()],
        ["loss of speed", "rad/s", run.states[0][2 * rotor.size + 1] - rotor.speed],
        ["loss of rotational energy", "J", start - rotor.turning_energy()],
        ["part that goes to the rub (shaft work)", "J", told["shaft_work"]],
        ["part that goes to the whirl (unbalance)", "J", work["unbalance"]],
        ["friction heat", "J", told["friction_loss"]],
        ["loss in bearings", "J", work["damping"]],
        ["whirl work, shaft to rub", "J", told["whirl_work"]],
        ["work of moments on the tilt", "J", work["moment"]],
        ["steps of the rub per H", "", run.tried],
        ["derivatives per H", "", run.derivatives],
        ["time", "s", seconds],
    ]
    return [history, free, facts]


def spools():
    """Return two counter-rotating spools. Each drive accelerates its spool through the resonance of its blades."""
    return Spools(["low", "high"], [0.1, 0.08], [1700.0, -1600.0], [2400.0, -1900.0], [2000.0, -1950.0], 0.05)


def run_up(file, quick, say):
    """Run two spools up through the resonances of their blades, and compare torque with shaft work for each method and H."""
    length = 1e-2 if quick else 1.2e-1
    header = ["method", "H (s)", "shaft work (J)", "torque × speed of the spools, minus shaft work (J)", "rotational energy, minus all work (J)", "error of the speeds (rad/s)"]
    table = Table("run_up", header)

    def one(way, step, length):
        pair = spools()
        with Rub(file, pair.inputs, pair.outputs) as rub:
            rub.start(pair.known())
            before = pair.turning_energy()
            run = march(rub, pair, way, step, round(length / step), watch=["shaft_work"], precision=1e-10)
        work, supplied = pair.state[2:]
        return run, work + run.watched[-1][0], pair.turning_energy() - before - work - supplied

    say("run-up: the fine run")
    fine, _, _ = one(Way.FIXED_POINT, 1e-5, 1e-2)
    # Speed is the only input, and there are no step derivatives with respect to it.
    for way in (way for way in Way if way is not Way.NEWTON):
        for step in (1e-4,) if quick else (2e-4, 1e-4, 5e-5):
            say(f"run-up: {way.value}, H = {step:g} s")
            run, told, closed = one(way, step, 1e-2)
            error = float(numpy.abs(run.states[-1][:2] - fine.states[-1][:2]).max())
            table.rows.append([way.value, step, run.watched[-1][0], told, closed, error])
    say(f"run-up: {length:g} s")
    run, *_ = one(Way.RUB_FIRST, 5e-5, length)
    header = ["time (s)", "low.speed (rad/s)", "high.speed (rad/s)", "low.torque (N m)", "high.torque (N m)", "shaft work (J)"]
    history = Table("run_up_history", header)
    history.rows = [[time_, *state[:2], *outputs, work[0]] for time_, state, outputs, work in zip(run.times, run.states, run.outputs, run.watched)]
    return [table, history]
