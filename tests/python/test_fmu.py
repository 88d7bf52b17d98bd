"""The packaged FMUs of rotor 37 in FMPy."""

import math
import re
import struct
import subprocess
import sys
import threading
from pathlib import Path

import fmpy
import numpy
import pytest
from fmpy import simulate_fmu
from fmpy.fmi1 import FMICallException
from fmpy.validation import validate_fmu
from lxml import etree

H = 1.17e-5


def bits(values):
    return struct.pack(f"<{len(values)}d", *values)


def march(instance, names, times):
    """Values at all communication points, as bytes."""
    rows = [bits(instance.read(names))]
    for time, following in zip(times, times[1:]):
        instance.step(time, following - time)
        rows.append(bits(instance.read(names)))
    return rows


def points(count, size=H, start=0.0):
    return [start + index * size for index in range(count + 1)]


@pytest.mark.parametrize("kind", ["two", "three", "scalars"])
def test_fmpy_finds_no_problem(fmus, kind):
    assert validate_fmu(str(getattr(fmus, kind))) == []


def test_terminals_and_related_files_are_as_their_schemas_want(unpacked):
    schema = Path(fmpy.__file__).parent / "schema" / "fmi3" / "fmi3TerminalsAndIcons.xsd"
    for fmu in (unpacked.three, unpacked.scalars):
        root = Path(fmu.directory)
        terminals = etree.parse(root / "terminalsAndIcons" / "terminalsAndIcons.xml")
        etree.XMLSchema(etree.parse(schema)).assertValid(terminals)
        members = {member.get("variableName") for member in terminals.iter("TerminalMemberVariable")}
        assert members <= {variable.name for variable in fmu.description.modelVariables} and "torque" in members
    for fmu in (unpacked.two, unpacked.three):
        extra = Path(fmu.directory) / "extra" / "org.fmi-standard.fmi-ls-ref"
        related = list(etree.parse(extra / "fmi-ls-manifest.xml").iter("Related"))
        assert [file.get("role") for file in related] == ["result", "document", "model"]
        assert all((extra / file.get("source")).is_file() for file in related)
    assert not (Path(unpacked.two.directory) / "terminalsAndIcons").exists()


def test_both_fmus_agree_with_the_native_run_bit_for_bit(native, two, three, unpacked):
    times = [row[0] for row in native.rows]
    turns = native.rows[-1][native.names.index("rotor_angle") + 1] / (2 * math.pi)
    touching = sum(row[native.names.index("normal_impulse") + 1] > 0 for row in native.rows)
    assert turns >= 2 and touching > len(times) / 10, (turns, touching)
    expected = [bits(row[1:]) for row in native.rows]
    for name, instance in [("FMI 2.0", two()), ("FMI 3.0", three()), ("FMI 3.0 scalars", three(unpacked.scalars))]:
        instance.initialise()
        rows = march(instance, native.names, times)
        wrong = [index for index, (row, other) in enumerate(zip(rows, expected)) if row != other]
        assert not wrong and len(rows) == len(expected), f"{name}: first difference at point {wrong[:1]}"
    print(f"{len(times)} points, {len(native.names)} outputs, {touching} with contact, {turns:.2f} revolutions: same bits")


@pytest.mark.parametrize("kind", ["two", "three"])
def test_simulated_by_fmpy_itself(fmus, native, kind):
    # FMPy computes its own communication points, so the sums of time may differ in the last bits from the native ones;
    # until the first contact nothing amplifies that.
    result = simulate_fmu(
        str(getattr(fmus, kind)),
        stop_time=40 * H,
        output_interval=H,
        output=["rotor_angle", "clearance_minimum"],
        start_values={"speed": 1800.0},
    )
    angle, clearance = (native.names.index(name) + 1 for name in ["rotor_angle", "clearance_minimum"])
    expected = numpy.array([[row[angle], row[clearance]] for row in native.rows[: len(result)]])
    assert len(result) == 41
    assert numpy.allclose(result["rotor_angle"], expected[:, 0], rtol=0, atol=1e-12)
    assert numpy.allclose(result["clearance_minimum"], expected[:, 1], rtol=1e-9)


def contact_point(native, first=100):
    """A communication point from `first` on at which blades touch."""
    column = native.names.index("contact_count") + 1
    return next(index for index in range(first, len(native.rows)) if native.rows[index][column] > 0)


@pytest.mark.parametrize("make", ["two", "three"])
def test_save_in_contact_run_restore_run(native, request, make):
    instance = request.getfixturevalue(make)()
    instance.initialise()
    times = points(contact_point(native) + 150)
    begin = contact_point(native)
    march(instance, native.names[:1], times[: begin + 1])
    assert instance.get("contact_count") > 0
    state = instance.save()
    first = march(instance, native.names, times[begin:])
    instance.restore(state)
    assert march(instance, native.names, times[begin:]) == first


CHILD = """
import sys
from pathlib import Path
from types import SimpleNamespace
sys.path.insert(0, sys.argv[1])
from fmpy import read_model_description
from importers import Three
from test_fmu import march, points
directory = Path(sys.argv[3])
fmu = SimpleNamespace(directory=sys.argv[2], description=read_model_description(sys.argv[2]))
instance = Three(fmu)
instance.restore(instance.fmu.deserializeFMUState((directory / "state").read_bytes()))
names = (directory / "names").read_text().splitlines()
begin, end = map(int, (directory / "range").read_text().split())
(directory / "rows").write_bytes(b"".join(march(instance, names, points(end)[begin:])))
instance.free()
"""


def test_serialise_and_go_on_in_another_process(native, three, unpacked, tmp_path):
    instance = three()
    instance.initialise()
    begin = contact_point(native)
    end = begin + 100
    march(instance, native.names[:1], points(begin))
    (tmp_path / "state").write_bytes(instance.fmu.serializeFMUState(instance.save()))
    (tmp_path / "names").write_text("\n".join(native.names))
    (tmp_path / "range").write_text(f"{begin} {end}")
    expected = b"".join(march(instance, native.names, points(end)[begin:]))
    here = str(Path(__file__).parent)
    command = [sys.executable, "-c", CHILD, here, str(unpacked.three.directory), str(tmp_path)]
    subprocess.run(command, check=True, capture_output=True, text=True)
    assert (tmp_path / "rows").read_bytes() == expected


def test_a_thousand_resets(native, two):
    instance = two()

    def run():
        instance.initialise()
        rows = march(instance, native.names, points(3))
        instance.reset()
        return rows

    first = run()
    assert all(run() == first for _ in range(1000))
    # And in contact: a run after all that is the run of a fresh instance.
    instance.initialise()
    fresh = two()
    fresh.initialise()
    times = points(contact_point(native) + 20)
    assert march(instance, native.names, times) == march(fresh, native.names, times)


def test_communication_steps_of_any_length(three, native):
    instance = three()
    instance.initialise()
    time = 0.0
    for index in range(150):
        size = 1e-5 * (1.0 + 0.9 * math.sin(index))
        _, terminate, early, reached = instance.step(time, size)
        time += size
        assert (reached, terminate, early) == (time, False, False)
        assert instance.get("time") == time
    # Free flight is exact for any step: the angle is the integral of the speed.
    assert instance.get("rotor_angle") == pytest.approx(1800.0 * time, rel=1e-13)


def test_a_step_size_that_is_no_multiple_converges_to_the_fine_run(tiprub, scene, work, native):
    """H = 11.7 us against H = 1 us, whose internal steps differ by 2.5 %: the difference is that of the scheme."""
    stop = 0.6e-3
    coarse = next(row for row in native.rows if row[0] >= stop)
    results = [
        tiprub("run", scene, "--stop", coarse[0], "--step", step, "--set", "internal_step_max=2.5e-7")["last"]
        for step in ("1.17e-5", "1e-6")
    ]
    for name in ("rotor_angle", "blade[1].clearance[1]", "blade[19].clearance[3]"):
        fine, other = results[1][name], coarse[native.names.index(name) + 1]
        scale = 1.0 if name == "rotor_angle" else 3.56e-4
        assert abs(results[0][name] - fine) < 2e-3 * scale, name
        assert abs(other - fine) < 2e-2 * scale, name


def test_a_sixtieth_computed_three_ways(two):
    accumulated = sum([1 / 60] * 15)
    sizes = [1 / 60, 0.016666666666666677, (accumulated + 1 / 60) - accumulated]
    assert len(set(sizes)) == 3
    ends = []
    for size in sizes:
        instance = two()
        instance.initialise()
        instance.step(0.0, size)
        assert instance.reached() == size
        ends.append(instance.get("rotor_angle", "internal_steps"))
        instance.free()
    assert ends[0][1] == ends[1][1] == ends[2][1] == 16667
    assert max(abs(end[0] - 30.0) for end in ends) < 1e-11


@pytest.mark.parametrize("make", ["two", "three"])
def test_inputs_set_before_initialisation(request, make):
    instance = request.getfixturevalue(make)()
    instance.set(speed=1234.5)
    instance.initialise()
    assert instance.get("speed") == 1234.5
    instance.step(0.0, 1e-4)
    assert instance.get("rotor_angle") == pytest.approx(0.12345, abs=1e-15)


@pytest.mark.parametrize("make", ["two", "three"])
@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_values_that_are_not_finite_are_refused(request, make, value):
    instance = request.getfixturevalue(make)()
    before = instance.get("speed", "friction_coefficient")
    for name in ("speed", "friction_coefficient"):
        log = instance.refused(lambda: instance.set(**{name: value}))
        assert name in log and "not finite" in log
    assert instance.get("speed", "friction_coefficient") == before
    instance.initialise()
    instance.step(0.0, 1e-5)


def test_a_start_value_that_is_not_a_number_is_refused_by_the_command_line(tiprub, scene):
    answer = tiprub("run", scene, "--set", "speed=nan", fails=True)
    assert "speed" in str(answer)


def test_a_wrong_token_is_refused(unpacked, three, two):
    with pytest.raises(RuntimeError) as refusal:
        three(token="{00000000-0000-0000-0000-000000000000}")
    assert unpacked.three.description.instantiationToken in str(refusal.value)
    assert "{00000000-0000-0000-0000-000000000000}" in str(refusal.value)
    with pytest.raises(RuntimeError) as refusal:
        two(token="{wrong}")
    assert unpacked.two.description.guid in str(refusal.value) and "{wrong}" in str(refusal.value)


def test_derivatives_of_the_speed_make_a_ramp_exact(two):
    size, ramp, errors = 5e-5, 2e5, []
    for given in (False, True):
        instance = two()
        instance.initialise()
        for index, time in enumerate(points(20, size)[:-1]):
            instance.set(speed=1800.0 + ramp * time)
            if given:
                instance.derivative("speed", ramp)
            instance.step(time, size)
        end = 20 * size
        errors.append(abs(instance.get("rotor_angle") - (1800.0 * end + 0.5 * ramp * end * end)))
        instance.free()
    held, linear = errors
    assert held == pytest.approx(0.5 * ramp * size * size * 20, rel=1e-6)
    assert linear < 1e-12


def test_early_return_after_an_intermediate_update(three):
    seen = []

    def update(_environment, time, set_requested, get_allowed, finished, can_return, requested, at):
        seen.append((time, bool(set_requested), bool(get_allowed), bool(finished), bool(can_return)))
        if can_return and time >= 4.5e-6:
            requested[0] = True
            at[0] = time

    instance = three(intermediateUpdate=update, earlyReturnAllowed=True)
    instance.initialise()
    event, terminate, early, reached = instance.step(0.0, 1e-5)
    assert (event, terminate, early) == (False, False, True)
    assert reached == pytest.approx(5e-6, abs=1e-18) and len(seen) == 5
    assert all(flags[1:] == (True, True, True, True) for flags in seen)
    assert instance.get("time") == reached
    instance.step(reached, 1e-5)


LONG = 4e-4
WIDE = 3e-4


def into_the_rub(instance, count):
    """A casing that closes over so many long steps."""
    instance.set(casing_radius_change=WIDE)
    instance.initialise()
    for step in range(count):
        instance.set(casing_radius_change=WIDE * (1 - (step + 1) / count))
        instance.step(step * LONG, LONG)


@pytest.mark.parametrize("make", ["two", "three"])
def test_a_step_that_takes_too_many_internal_steps_is_discarded_and_can_be_repeated(request, make, marched):
    def instance(**arguments):
        return request.getfixturevalue(make)(fmu=getattr(marched, make), **arguments)

    outputs = ["clearance_minimum", "normal_impulse", "torque", "internal_steps", "internal_trials", "missed_steps"]
    # With a limit, also one that is never reached, all steps end at communication points.
    free, bounded = instance(), instance()
    for one in (free, bounded):
        one.set(max_internal_steps=10**9)
        into_the_rub(one, 12)
    time, before = 12 * LONG, free.get("internal_trials")
    free.step(time, LONG)
    needed = int(free.get("internal_trials") - before)
    assert needed > 100 and free.get("normal_impulse") > 0 and free.get("internal_steps_max") >= needed
    unchanged = bounded.read(outputs)
    for most in (needed - 1, 1):
        bounded.set(max_internal_steps=most)
        with pytest.raises(FMICallException) as caught:
            bounded.step(time, LONG)
        assert caught.value.status == 2 and f"max_internal_steps = {most}" in bounded.log
        assert bounded.read(outputs) == unchanged
        if make == "two":
            assert bounded.fmu.getRealStatus(2) == pytest.approx(time, abs=1e-12)
            assert not bounded.fmu.getBooleanStatus(3)
    for wrong in (-1, 2**31 - 1):
        assert "max_internal_steps" in bounded.refused(lambda value: bounded.set(max_internal_steps=value), wrong)
    bounded.set(max_internal_steps=needed)
    bounded.step(time, LONG)
    assert bits(bounded.read(outputs)) == bits(free.read(outputs))
    if make == "three":
        early = instance(earlyReturnAllowed=True)
        early.set(max_internal_steps=10**9)
        into_the_rub(early, 12)
        early.set(max_internal_steps=needed - 1)
        event, terminate, returned, reached = early.step(time, LONG)
        assert (event, terminate, returned) == (False, False, True) and time < reached < time + LONG
        assert early.get("time") == reached
        assert not early.step(reached, time + LONG - reached)[2]


@pytest.mark.parametrize("make", ["two", "three"])
def test_a_long_mission_takes_no_steps_without_contact(request, make, marched):
    instance = request.getfixturevalue(make)(fmu=getattr(marched, make))
    instance.set(casing_radius_change=WIDE)
    instance.initialise()
    size, steps, taken, lowest = 0.1, 30, [], []
    for step in range(steps):
        # Closed at the end of one step, open at that of the next.
        instance.set(casing_radius_change=WIDE - (2.6e-4 if step == 9 else 0.0))
        before = instance.get("internal_steps")
        instance.step(step * size, size)
        taken.append(instance.get("internal_steps") - before)
        lowest.append(instance.get("clearance_minimum"))
    flown = [step for step, count in enumerate(taken) if count == 0]
    assert set(range(1, 9)) <= set(flown) and set(range(20, 30)) <= set(flown), taken
    assert instance.get("friction_loss") > 0 and min(taken[9], taken[10]) > 1000, taken
    # The bumps' tops, wherever the blades are at communication points.
    open_casing = WIDE + 3.56e-4 * (1 - 2 * 0.6)
    assert all(abs(lowest[step] / open_casing - 1) < 0.05 for step in range(25, 30)), lowest
    assert lowest[9] < 1e-7


def test_both_fmus_in_two_threads(two, three, native):
    times = points(contact_point(native) + 100)
    instances = [two(), three()]
    alone = []
    for instance in instances:
        instance.initialise()
        alone.append(march(instance, native.names, times))
        instance.reset()
    results = [None, None]

    def run(index):
        instances[index].initialise()
        results[index] = march(instances[index], native.names, times)

    threads = [threading.Thread(target=run, args=(index,)) for index in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert results[0] == alone[0] == alone[1] == results[1]


def test_terminate_then_get(two, three):
    for instance in (two(), three()):
        instance.initialise()
        instance.step(0.0, H)
        before = instance.get("rotor_angle", "clearance_minimum")
        instance.fmu.terminate()
        assert instance.get("rotor_angle", "clearance_minimum") == before


def test_messages_name_variable_value_and_remedy(three):
    instance = three()
    instance.initialise()
    log = instance.refused(lambda: instance.set(friction_coefficient=-1.0))
    for part in ("fmi3SetFloat64", "t = 0 s", "friction_coefficient", "-1", "Set a value within"):
        assert part in log, (part, log)
    log = instance.refused(lambda: instance.step(1.0, 1e-5))
    for part in ("currentCommunicationPoint", "1 s", "t = 0 s", "Continue from"):
        assert part in log, (part, log)


def declared(version):
    """Names of the functions that a version's header declares, as FMPy ships it."""
    header = Path(fmpy.__file__).parent / "c-code" / f"fmi{version}FunctionTypes.h"
    pattern = rf"typedef\s+[\w* ]+?\s*\*?(fmi{version}[A-Z]\w*)TYPE\s*\("
    return set(re.findall(pattern, header.read_text()))


def test_the_binary_exports_what_the_headers_declare_and_nothing_else(unpacked):
    two, three = declared(2), declared(3)
    assert (len(two), len(three)) == (44, 75)
    for fmu in (unpacked.two, unpacked.three):
        folder = "linux64" if fmu.description.fmiVersion == "2.0" else "x86_64-linux"
        binary = Path(fmu.directory) / "binaries" / folder / "tiprub.so"
        listing = subprocess.run(["nm", "-D", "--defined-only", binary], check=True, capture_output=True, text=True)
        assert {line.split()[-1] for line in listing.stdout.splitlines()} == two | three


def test_fmpy_drives_the_speed_with_a_signal(fmus):
    """FMPy sets inputs before initialisation already, and holds them over each communication step."""
    end, ramp, size = 1e-3, 1e5, 5e-5
    signal = numpy.array([(0.0, 1800.0), (end, 1800.0 + ramp * end)], dtype=[("time", float), ("speed", float)])
    for file in (fmus.two, fmus.three):
        result = simulate_fmu(
            str(file), stop_time=end, output_interval=size, input=signal, output=["speed", "rotor_angle"]
        )
        lag = 0.5 * ramp * size * end
        assert result["speed"][0] == 1800.0
        assert result["rotor_angle"][-1] == pytest.approx(1800.0 * end + 0.5 * ramp * end * end - lag, abs=1e-9)


def whirl(times):
    """A circle of 0.39 mm at 600 rad/s that grows in 2 ms, in a clearance of 0.356 mm."""
    radius = 0.195e-3 * (1.0 - numpy.cos(numpy.pi * numpy.minimum(times / 2e-3, 1.0)))
    return radius * numpy.cos(600.0 * times), radius * numpy.sin(600.0 * times)


@pytest.mark.parametrize("kind", ["two", "three"])
def test_a_staircase_of_fmpy_does_not_hit(whirling, kind):
    """FMPy holds its signal over each communication step; the FMU makes ramps of that."""
    end = 3e-3
    times = numpy.linspace(0.0, end, 3001)
    signal = numpy.array(
        list(zip(times, *whirl(times))), dtype=[("time", float), ("whirl_x", float), ("whirl_y", float)]
    )

    # Derivatives of FMPy 0.3.32 (set_input_derivatives) fail unless there are nine inputs.
    def peak(size, **options):
        result = simulate_fmu(
            str(getattr(whirling, kind)),
            stop_time=end,
            output_interval=size,
            input=signal,
            output=["normal_force_peak", "energy_residual_relative"],
            **options,
        )
        assert numpy.abs(result["energy_residual_relative"]).max() < 1e-9
        return result["normal_force_peak"].max()

    fine = peak(1e-6)
    ramp, hold = peak(1e-4), peak(1e-4, start_values={"input_interpolation": 2})
    print(f"largest node force: H = 1 us {fine:.0f} N, 0.1 ms ramped {ramp:.0f} N, held {hold:.0f} N")
    assert fine > 10.0 and ramp < 2.0 * fine and hold > 3.0 * ramp
