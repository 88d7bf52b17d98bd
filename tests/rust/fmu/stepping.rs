//! Steps through both C ABIs against the core driven directly: same bits, exact end times, inputs, intermediate
//! updates.

use std::ffi::c_void;

use tiprub_core::scene::method::Scheme;
use tiprub_core::{CoSimulation, Scene, Simulation};
use tiprub_fmi_host::api::Fmi3Api;
use tiprub_tests::scene::{UnpackedResources, scene};
use tiprub_tests::{DISCARD, ERROR, OK, WARNING, fmi2, fmi3, shipped};

/// Communication step (s), which is not a multiple of the internal step of 2 µs.
const H: f64 = 1.0137e-4;
/// Number of steps for more than two revolutions at 300 rad/s.
const STEPS: u32 = 450;

fn simulation() -> Simulation {
    let mut simulation = Simulation::new(scene()).expect("the scene is valid");
    simulation.initialise(0.0).expect("the scene can be initialised");
    simulation
}

fn reference_of(simulation: &Simulation, name: &str) -> u32 {
    simulation.table().find(name).unwrap_or_else(|| panic!("no variable {name}")).reference
}

/// Returns the references of all real elements.
fn all_reals(simulation: &Simulation) -> Vec<u32> {
    let count = u32::try_from(simulation.table().references()).expect("few variables");
    (0..count).filter(|reference| simulation.real(*reference).is_ok()).collect()
}

fn native(simulation: &Simulation, references: &[u32]) -> Vec<u64> {
    references.iter().map(|reference| simulation.real(*reference).expect("a real").to_bits()).collect()
}

fn bits(values: &[f64]) -> Vec<u64> {
    values.iter().map(|value| value.to_bits()).collect()
}

#[test]
fn fmi2_and_fmi3_match_the_core_with_contact() {
    let path = shipped();
    let (api2, api3) = (fmi2::load(&path), fmi3::load(&path));
    let resources = UnpackedResources::new(false);
    let (two, three) =
        (fmi2::Fmi2TestSlave::initialised(&api2, &resources), fmi3::Fmi3TestSlave::new(&api3, &resources));
    three.initialise();
    let mut core = simulation();
    let references = all_reals(&core);
    let impulse = reference_of(&core, "normal_impulse");
    let (mut time, mut touched) = (0.0, 0);
    for step in 0..=STEPS {
        let expected = native(&core, &references);
        assert_eq!(bits(&two.reals(&references)), expected, "FMI 2.0 at step {step}");
        assert_eq!(bits(&three.reals(&references, references.len())), expected, "FMI 3.0 at step {step}");
        touched += u32::from(core.real(impulse).expect("a real") > 0.0);
        core.do_step(time, H).expect("the step succeeds");
        two.expect(two.step(time, H));
        let answer = three.step(time, H);
        time += H;
        assert_eq!((answer.status, answer.event, answer.terminate, answer.early), (OK, false, false, false));
        assert_eq!(answer.time.to_bits(), time.to_bits(), "lands exactly");
    }
    assert!(touched > 20, "only {touched} steps with contact: the test shows nothing");
    println!(
        "{touched} of {STEPS} steps with contact, {} reals each, identical bits in both versions",
        references.len()
    );
}

#[test]
fn step_sizes_that_change_and_sixtieths_land_exactly() {
    let path = shipped();
    let (api, resources) = (fmi3::load(&path), UnpackedResources::new(true));
    let slave = fmi3::Fmi3TestSlave::new(&api, &resources);
    slave.initialise();
    let mut time = 0.0;
    for step in 1..200_u32 {
        let size = H * (1.0 + 0.9 * f64::from(step).sin());
        assert_eq!(slave.step(time, size).status, OK);
        time += size;
        assert_eq!(slave.reals(&[0], 1)[0].to_bits(), time.to_bits());
    }
    // 1/60 s as importers compute it: the quotient, a rounded literal, and the difference of accumulated times.
    let accumulated: f64 = (0..15).map(|_| 1.0 / 60.0).sum::<f64>();
    let difference = (accumulated + 1.0 / 60.0) - accumulated;
    let mut ends = Vec::new();
    for size in [1.0 / 60.0, 0.016_666_666_666_666_677, difference] {
        slave.expect(slave.reset());
        slave.initialise();
        let answer = slave.step(0.0, size);
        assert_eq!((answer.status, answer.time.to_bits()), (OK, size.to_bits()));
        let simulation = simulation();
        let values =
            slave.reals(&[reference_of(&simulation, "rotor_angle"), reference_of(&simulation, "internal_steps")], 2);
        ends.push(values);
    }
    assert!((ends[0][0] - ends[1][0]).abs() < 1e-12 && (ends[0][0] - ends[2][0]).abs() < 1e-12, "{ends:?}");
    assert!(ends.iter().all(|end| end[1].to_bits() == ends[0][1].to_bits()), "number of internal steps {ends:?}");
}

#[test]
fn a_derivative_of_the_speed_gives_the_exact_angle_of_a_ramp() {
    let path = shipped();
    let (api, resources) = (fmi2::load(&path), UnpackedResources::new(false));
    let core = simulation();
    let (speed, angle) = (reference_of(&core, "speed"), reference_of(&core, "rotor_angle"));
    let (start, ramp, size, steps) = (300.0, 4000.0, 2e-3, 10_u32);
    let mut errors = Vec::new();
    for with_derivative in [false, true] {
        let slave = fmi2::Fmi2TestSlave::initialised(&api, &resources);
        for step in 0..steps {
            let time = f64::from(step) * size;
            slave.expect(slave.set_reals(&[speed], &[start + ramp * time]));
            if with_derivative {
                slave.expect(slave.set_derivatives(&[speed], 1, &[ramp]));
            }
            slave.expect(slave.step(time, size));
        }
        let end = f64::from(steps) * size;
        let exact = start * end + 0.5 * ramp * end * end;
        errors.push((slave.reals(&[angle])[0] - exact).abs());
    }
    // Held inputs lag by half a step: ½·ramp·H per step in angle, H²·ramp/2 each.
    let lag = 0.5 * ramp * size * size * f64::from(steps);
    assert!((errors[0] - lag).abs() < 1e-9, "held: {} instead of {lag}", errors[0]);
    assert!(errors[1] < 1e-12, "with derivative: {}", errors[1]);
}

#[test]
fn derivatives_of_outputs_follow_the_outputs() {
    let path = shipped();
    let (api, resources) = (fmi3::load(&path), UnpackedResources::new(false));
    let slave = fmi3::Fmi3TestSlave::new(&api, &resources);
    slave.initialise();
    let angle = reference_of(&simulation(), "rotor_angle");
    assert_eq!(slave.step(0.0, H).status, OK);
    let (orders, mut value) = ([1, 2], [0.0]);
    // SAFETY: arrays of one element.
    let get = |order: *const i32, value: &mut [f64; 1]| unsafe {
        (api.fmi3GetOutputDerivatives)(slave.handle, &raw const angle, 1, order, value.as_mut_ptr(), 1)
    };
    assert_eq!(get(&raw const orders[0], &mut value), OK);
    assert!((value[0] - 300.0).abs() < 1e-9, "{value:?}");
    assert_eq!(get(&raw const orders[1], &mut value), ERROR);
    assert!(slave.log().contains("order 2"));
}

/// Records the time of each internal step, reads time and angle, and sets the speed to the wish if that is not zero.
unsafe extern "C" fn watch(
    environment: *mut c_void,
    time: f64,
    set_requested: bool,
    get_allowed: bool,
    finished: bool,
    can_return: bool,
    requested: *mut bool,
    at: *mut f64,
) {
    // SAFETY: the environment is the importer's context, which is not accessed elsewhere during a step.
    let context = unsafe { &mut *environment.cast::<fmi3::CallbackContext>() };
    assert!(get_allowed && finished);
    // SAFETY: the functions outlive the instance.
    let api: &Fmi3Api = unsafe { &*context.api };
    let (references, mut values) = ([0_u32], [0.0]);
    // SAFETY: arrays of one element, on the instance that is calling.
    let status = unsafe { (api.fmi3GetFloat64)(context.handle, references.as_ptr(), 1, values.as_mut_ptr(), 1) };
    assert_eq!((status, values[0].to_bits()), (OK, time.to_bits()), "the time inside a step");
    context.notes.push(time);
    if context.wish > 0.0 && can_return && time >= context.wish {
        // SAFETY: valid locations for the two outputs.
        unsafe { (*requested, *at) = (true, time) };
    }
    if context.wish < 0.0 && set_requested {
        let (reference, speed) = (tiprub_tests::scene::reference("speed"), -context.wish + 1000.0 * time);
        // SAFETY: arrays of one element.
        let status = unsafe { (api.fmi3SetFloat64)(context.handle, &raw const reference, 1, &raw const speed, 1) };
        assert_eq!(status, OK);
    }
}

fn watched(resources: &UnpackedResources, early_return: bool) -> fmi3::Fmi3Arguments {
    fmi3::Fmi3Arguments { update: Some(watch), early_return, ..fmi3::Fmi3Arguments::new(resources) }
}

#[test]
fn intermediate_updates_see_every_internal_step() {
    let path = shipped();
    let (api, resources) = (fmi3::load(&path), UnpackedResources::new(false));
    let core = simulation();
    // Damping loss is summed per communication step or per intermediate update, so the energies may differ in the last
    // bits.
    let energies =
        ["damping_loss", "energy_residual", "energy_residual_relative"].map(|name| reference_of(&core, name));
    let references: Vec<_> = all_reals(&core).into_iter().filter(|reference| !energies.contains(reference)).collect();
    let plain = fmi3::Fmi3TestSlave::new(&api, &resources);
    let looked = fmi3::Fmi3TestSlave::try_new(&api, &watched(&resources, true)).unwrap_or_else(|log| panic!("{log}"));
    plain.initialise();
    looked.initialise();
    for step in 0..100 {
        let time = f64::from(step) * 1e-4;
        assert_eq!(plain.step(time, 1e-4), looked.step(time, 1e-4));
        assert_eq!(looked.notes().len(), 50, "one update per internal step of 2 µs");
        let count = references.len();
        assert_eq!(bits(&plain.reals(&references, count)), bits(&looked.reals(&references, count)), "step {step}");
    }
}

#[test]
fn early_return_ends_the_step_at_the_requested_time() {
    let path = shipped();
    let (api, resources) = (fmi3::load(&path), UnpackedResources::new(true));
    let slave = fmi3::Fmi3TestSlave::try_new(&api, &watched(&resources, true)).unwrap_or_else(|log| panic!("{log}"));
    slave.initialise();
    slave.wish(4.1e-5);
    let answer = slave.step(0.0, 1e-4);
    assert_eq!((answer.status, answer.early, answer.terminate, answer.event), (OK, true, false, false));
    assert!((answer.time - 4.2e-5).abs() < 1e-15, "the first internal step at or after the wish: {}", answer.time);
    assert_eq!(slave.reals(&[0], 1)[0].to_bits(), answer.time.to_bits());
    // The rest of the step, then a whole one.
    slave.wish(0.0);
    let rest = slave.step(answer.time, 1e-4 - answer.time);
    assert_eq!((rest.status, rest.early), (OK, false));
    assert_eq!(slave.step(rest.time, 1e-4).status, OK);

    // Without the importer's consent at instantiation a request is not fulfilled, and a warning is returned.
    let strict = fmi3::Fmi3TestSlave::try_new(&api, &watched(&resources, false)).unwrap_or_else(|log| panic!("{log}"));
    strict.initialise();
    strict.wish(4.1e-5);
    let answer = strict.step(0.0, 1e-4);
    assert_eq!((answer.status, answer.early), (OK, false), "canReturnEarly was false, nothing was requested");
}

#[test]
fn inputs_set_during_intermediate_updates_act_from_then_on() {
    let path = shipped();
    let (api, resources) = (fmi3::load(&path), UnpackedResources::new(true));
    let core = simulation();
    let angle = reference_of(&core, "rotor_angle");
    let slave = fmi3::Fmi3TestSlave::try_new(&api, &watched(&resources, false)).unwrap_or_else(|log| panic!("{log}"));
    slave.initialise();
    slave.wish(-300.0);
    let (size, steps) = (1e-3, 5);
    for step in 0..steps {
        assert_eq!(slave.step(f64::from(step) * size, size).status, OK);
    }
    // 300 + 1000·t, held over internal steps of h = 2 µs: the angle lags the exact integral by ½·1000·h·T, and the
    // value at the end of each step, which is not requested, is missing once per step (another ½... of one h): bounded
    // by 2·1000·h·T.
    let end = f64::from(steps) * size;
    let exact = 300.0 * end + 500.0 * end * end;
    let error = exact - slave.reals(&[angle], 1)[0];
    let lag = 0.5 * 1000.0 * 2e-6 * end;
    assert!(error > 0.5 * lag && error < 2.0 * lag, "{error} against {lag}");
}

#[test]
fn stop_time_is_respected_up_to_rounding() {
    let path = shipped();
    let (api, resources) = (fmi2::load(&path), UnpackedResources::new(false));
    let slave = fmi2::Fmi2TestSlave::new(&api, &resources);
    slave.expect(slave.setup(0.0, Some(1e-3)));
    slave.initialise();
    let mut time = 0.0;
    for _ in 0..10 {
        slave.expect(slave.step(time, 1e-4));
        time += 1e-4;
    }
    assert_eq!(slave.step(time, 1e-4), ERROR);
    let log = slave.log();
    assert!(log.contains("after the stop time 0.001 s"), "{log}");
    slave.expect(slave.terminate());
    assert!((slave.reals(&[0])[0] - 1e-3).abs() < 1e-15, "terminate, then get");
}

#[test]
fn values_set_before_initialisation_are_start_values() {
    let path = shipped();
    let (api, resources) = (fmi2::load(&path), UnpackedResources::new(false));
    let core = simulation();
    let [speed, friction, angle, clearance] =
        ["speed", "friction_coefficient", "initial_rotor_angle", "blade[1].clearance"]
            .map(|name| reference_of(&core, name));
    let slave = fmi2::Fmi2TestSlave::new(&api, &resources);
    slave.expect(slave.set_reals(&[speed, friction], &[250.0, 0.1]));
    assert_eq!(slave.reals(&[speed, friction]), [250.0, 0.1], "start values can be read back");
    slave.expect(slave.enter());
    let before = slave.reals(&[clearance]);
    slave.expect(slave.set_reals(&[angle], &[1.0]));
    let after = slave.reals(&[clearance]);
    assert!(before != after, "outputs follow parameters during initialisation: {before:?}");
    // A fixed parameter can still be set after outputs were read.
    slave.expect(slave.set_reals(&[angle], &[0.0]));
    assert_eq!(slave.reals(&[clearance]), before);
    assert!([OK, WARNING].contains(&slave.exit()));
    assert_eq!(slave.set_reals(&[angle], &[0.5]), ERROR);
    assert!(slave.log().contains("fixed parameter"));
    slave.expect(slave.set_reals(&[friction], &[0.2]));
    slave.expect(slave.step(0.0, H));
    assert_eq!(slave.reals(&[speed, friction]), [250.0, 0.2]);
}

#[test]
fn steps_of_any_length_are_rejected_or_give_finite_outputs() {
    let path = shipped();
    let (api2, api3, resources) = (fmi2::load(&path), fmi3::load(&path), UnpackedResources::new(false));
    let references = all_reals(&simulation());
    let lengths = [0.0, 5e-324, 1e-310, 1e-300, 1e-160, 1e-17, 9e-13, 1e-12, 1e-9, 2e-6, 1e-3, 1e7, 1e154, 1e300];
    for start in [0.0, 1e-310, -0.37, 1e8] {
        let (two, three) = (fmi2::Fmi2TestSlave::new(&api2, &resources), fmi3::Fmi3TestSlave::new(&api3, &resources));
        [two.setup(start, None), two.enter(), two.exit()].into_iter().for_each(|status| two.expect(status));
        [three.enter(start, None), three.exit()].into_iter().for_each(|status| three.expect(status));
        let (mut times, mut taken) = ([start; 2], 0);
        for length in lengths {
            for (which, status) in
                [two.step(times[0], length), three.step(times[1], length).status].into_iter().enumerate()
            {
                assert!(status == OK || status == ERROR, "H = {length:e}: {status}");
                if status == OK {
                    assert!(length >= 1e-12, "H = {length:e} from {start:e} s");
                    times[which] += length;
                    taken += 1;
                }
            }
            let values = [two.reals(&references), three.reals(&references, references.len())].concat();
            assert!(values.iter().all(|value| value.is_finite()), "H = {length:e} from {start:e} s");
        }
        assert!(taken >= 2, "no step from {start:e} s: {}", two.log());
    }
}

/// There are as many modes as three contact nodes have directions, so massless-boundary keeps none.
#[test]
fn rejects_a_scheme_without_modes_reversibly() {
    let mut scene = scene();
    scene.settings.contacts[0].friction = 0.0;
    let rom = &mut scene.roms[0];
    rom.mass = rom.mass.view((0, 0), (9, 9)).into_owned();
    rom.stiffness = rom.stiffness.view((0, 0), (9, 9)).into_owned();
    rom.contact_map = rom.contact_map.view((0, 0), (9, 9)).into_owned();
    let resources = UnpackedResources::of(&scene, false);
    let core = Simulation::new(&scene).expect("the scene is valid");
    let (scheme, output) = (reference_of(&core, "scheme"), reference_of(&core, "clearance_minimum"));
    let api = fmi2::load(&shipped());
    let slave = fmi2::Fmi2TestSlave::new(&api, &resources);
    let choose = |choice: i32| {
        // SAFETY: arrays of one element.
        unsafe { (api.fmi2SetInteger)(slave.handle, &raw const scheme, 1, &raw const choice) }
    };
    let read = || {
        let mut value = 0.0;
        // SAFETY: arrays of one element.
        unsafe { (api.fmi2GetReal)(slave.handle, &raw const output, 1, &raw mut value) }
    };
    assert_eq!((slave.setup(0.0, None), slave.enter(), choose(3)), (OK, OK, OK));
    assert_eq!((read(), slave.exit(), read()), (ERROR, ERROR, ERROR));
    let log = slave.log();
    assert!(log.contains("at least one other mode must remain") && !log.contains("panic"), "{log}");
    let state = slave.save();
    assert_eq!((choose(2), read(), slave.restore(state), read()), (OK, OK, OK, ERROR), "{}", slave.log());
    assert_eq!((slave.reset(), slave.setup(0.0, None), slave.enter()), (OK, OK, OK));
    assert_eq!((choose(2), slave.exit(), slave.step(0.0, H)), (OK, OK, OK), "{}", slave.log());
    assert!(!slave.log().contains("panic"), "{}", slave.log());
}

#[test]
fn warnings_of_the_actual_step_are_logged_once() {
    let mut scene = scene();
    // ω_max·h = 2 lies near 6e-5 s.
    scene.settings.contacts[0].friction = 0.0;
    scene.settings.time.step = 1.5e-4;
    scene.settings.experiment.communication_step = 2e-5;
    let api = fmi2::load(&shipped());
    let resources = UnpackedResources::of(&scene, false);
    let slave = fmi2::Fmi2TestSlave::initialised(&api, &resources);
    let reported = || slave.log().matches("not resolved").count();
    assert_eq!(reported(), 0);
    let mut time = 0.0;
    let counts = [2e-5, 1.5e-4, 1.5e-4, 2e-5, 1.5e-4].map(|length| {
        assert_eq!(slave.step(time, length), OK, "{}", slave.log());
        time += length;
        reported()
    });
    assert_eq!(counts, [0, 1, 0, 0, 0]);
}

/// Tries, after every internal step, to set a valid value together with an impossible speed.
unsafe extern "C" fn overreach(
    environment: *mut c_void,
    _time: f64,
    set_requested: bool,
    _get_allowed: bool,
    _finished: bool,
    _can_return: bool,
    _requested: *mut bool,
    _at: *mut f64,
) {
    if !set_requested {
        return;
    }
    // SAFETY: the environment is the importer's context, which is not accessed elsewhere during a step.
    let context = unsafe { &mut *environment.cast::<fmi3::CallbackContext>() };
    // SAFETY: the functions outlive the instance.
    let api: &Fmi3Api = unsafe { &*context.api };
    let core = Simulation::new(whirling()).expect("the scene is valid");
    let (references, values) = ([reference_of(&core, "whirl_x"), reference_of(&core, "speed")], [1e-5, 1e9]);
    // SAFETY: arrays of two elements, on the instance that is calling.
    let status = unsafe { (api.fmi3SetFloat64)(context.handle, references.as_ptr(), 2, values.as_ptr(), 2) };
    assert_eq!(status, ERROR);
    context.notes.push(0.0);
}

fn whirling() -> tiprub_core::Scene {
    let mut scene = scene();
    scene.settings.structures[0].whirl = true;
    scene
}

#[test]
fn rejected_values_within_a_step_do_not_change_ramps() {
    let path = shipped();
    let (api, resources) = (fmi3::load(&path), UnpackedResources::of(&whirling(), true));
    let core = Simulation::new(whirling()).expect("the scene is valid");
    let whirl = [reference_of(&core, "whirl_x"), reference_of(&core, "whirl_y")];
    let clearance = reference_of(&core, "clearance_minimum");
    let plain = fmi3::Fmi3TestSlave::new(&api, &resources);
    let arguments = fmi3::Fmi3Arguments { update: Some(overreach), ..fmi3::Fmi3Arguments::new(&resources) };
    let asked = fmi3::Fmi3TestSlave::try_new(&api, &arguments).unwrap_or_else(|log| panic!("{log}"));
    for slave in [&plain, &asked] {
        slave.initialise();
        for step in 0..20_u32 {
            let angle = 0.1 * f64::from(step);
            slave.expect(slave.set_reals(&whirl, &[1e-4 * angle.sin(), 1e-4 * (1.0 - angle.cos())]));
            assert_eq!(slave.step(f64::from(step) * H, H).status, OK);
        }
    }
    assert!(asked.notes().len() > 20, "nothing was refused");
    assert_eq!(bits(&plain.reals(&[clearance], 1)), bits(&asked.reals(&[clearance], 1)));
    assert_eq!(plain.reals(&whirl, 2), asked.reals(&whirl, 2));
}

/// Returns the scene with a maximum number of internal steps, which an importer can change.
fn bounded() -> Scene {
    let mut scene = scene();
    scene.settings.time.max_internal_steps = Some(0);
    scene
}

/// Returns the scene with adaptive steps.
fn marched() -> Scene {
    let mut scene = scene();
    (scene.settings.time.scheme, scene.settings.time.step) = (Scheme::Galerkin, 8e-5);
    scene.settings.time.tolerance = Some(1e-4);
    scene
}

/// Communication step of these tests (s): five spans of the longest step.
const LONG: f64 = 4e-4;

/// Run of a scene with a maximum that is never reached: the communication step with the most internal steps, their number, and the values
/// there.
struct Free {
    scene: Scene,
    references: Vec<u32>,
    bound: u32,
    step: u32,
    needed: i32,
    before: Vec<u64>,
    after: Vec<u64>,
}

fn free(scene: Scene) -> Free {
    let mut core = Simulation::new(&scene).unwrap();
    core.initialise(0.0).unwrap();
    core.set_integer(reference_of(&core, "max_internal_steps"), 1_000_000).unwrap();
    let references = all_reals(&core);
    let mut found = (0, 0, Vec::new(), Vec::new());
    for step in 0..60 {
        let (tried, before) = (core.system().steps_tried(), native(&core, &references));
        core.do_step(f64::from(step) * LONG, LONG).unwrap();
        let needed = i32::try_from(core.system().steps_tried() - tried).unwrap();
        if needed > found.1 {
            found = (step, needed, before, native(&core, &references));
        }
    }
    let (step, needed, before, after) = found;
    Free { bound: reference_of(&core, "max_internal_steps"), scene, references, step, needed, before, after }
}

#[test]
fn fmi2_discards_too_many_steps_and_can_repeat() {
    let (path, scenes) = (shipped(), [bounded(), marched()]);
    let api = fmi2::load(&path);
    for found in scenes.map(free) {
        let resources = UnpackedResources::of(&found.scene, false);
        let slave = fmi2::Fmi2TestSlave::new(&api, &resources);
        // SAFETY: arrays of one element.
        let set = |most: i32| unsafe { (api.fmi2SetInteger)(slave.handle, &raw const found.bound, 1, &raw const most) };
        // Hostile values, in every mode.
        let refused =
            || [-1, i32::MIN, i32::MAX, 1_000_000_001].into_iter().for_each(|most| assert_eq!(set(most), ERROR));
        refused();
        slave.expect(set(1_000_000_000));
        slave.initialise();
        refused();
        for step in 0..found.step {
            slave.expect(slave.step(f64::from(step) * LONG, LONG));
        }
        let time = f64::from(found.step) * LONG;
        assert_eq!(bits(&slave.reals(&found.references)), found.before);
        for most in [found.needed - 1, 1, found.needed / 2] {
            slave.expect(set(most));
            let state = slave.serialise(slave.save());
            assert_eq!(slave.step(time, LONG), DISCARD, "{}", slave.log());
            let (mut last, mut terminated) = (0.0, 7);
            // SAFETY: valid locations for the outputs.
            unsafe {
                slave.expect((api.fmi2GetRealStatus)(slave.handle, 2, &raw mut last));
                slave.expect((api.fmi2GetBooleanStatus)(slave.handle, 3, &raw mut terminated));
            }
            assert!((last - time).abs() < 1e-12 && terminated == 0, "{last} {terminated}");
            assert!(slave.log().contains(&format!("max_internal_steps = {most}")), "{}", slave.log());
            assert_eq!(bits(&slave.reals(&found.references)), found.before);
            assert!(slave.serialise(slave.save()) == state, "as if it had not been tried");
        }
        // A shorter step from here, and back; then the whole step with exactly the internal steps it needs.
        let here = slave.save();
        slave.expect(slave.step(time, 1e-6));
        slave.expect(slave.restore(here));
        slave.expect(set(found.needed));
        slave.expect(slave.step(time, LONG));
        assert_eq!(bits(&slave.reals(&found.references)), found.after);
    }
}

#[test]
fn fmi3_returns_early_or_discards_too_many_steps() {
    let (path, scenes) = (shipped(), [bounded(), marched()]);
    let api = fmi3::load(&path);
    for found in scenes.map(free) {
        let (resources, count) = (UnpackedResources::of(&found.scene, false), found.references.len());
        let time = f64::from(found.step) * LONG;
        let arguments = fmi3::Fmi3Arguments::new(&resources);
        let all = [
            arguments.clone(),
            fmi3::Fmi3Arguments { early_return: true, ..arguments },
            watched(&resources, false),
            watched(&resources, true),
        ];
        for (early, arguments) in [false, true, false, true].into_iter().zip(all) {
            let slave = fmi3::Fmi3TestSlave::try_new(&api, &arguments).unwrap_or_else(|log| panic!("{log}"));
            let set = |most: i64| {
                // SAFETY: arrays of one element.
                let status = unsafe { (api.fmi3SetInt64)(slave.handle, &raw const found.bound, 1, &raw const most, 1) };
                slave.expect(status);
            };
            slave.initialise();
            set(1_000_000);
            for step in 0..found.step {
                assert_eq!(slave.step(f64::from(step) * LONG, LONG).status, OK);
            }
            set(i64::from(found.needed) - 1);
            let answer = slave.step(time, LONG);
            assert!(!answer.event && !answer.terminate);
            if !early {
                assert_eq!((answer.status, answer.early), (DISCARD, false), "{}", slave.log());
                assert!((answer.time - time).abs() < 1e-12, "{}", answer.time);
                assert_eq!(bits(&slave.reals(&found.references, count)), found.before);
                assert!(slave.log().contains("was discarded"), "{}", slave.log());
                set(1_000_000);
                assert_eq!(slave.step(time, LONG).status, OK);
                assert_eq!(bits(&slave.reals(&found.references, count)), found.after);
                continue;
            }
            assert_eq!((answer.status, answer.early), (OK, true), "{}", slave.log());
            assert!(answer.time > time && answer.time < time + LONG * (1.0 - 1e-6), "{}", answer.time);
            assert_eq!(slave.reals(&[0], 1)[0].to_bits(), answer.time.to_bits());
            // The rest needs only the remaining internal steps.
            let rest = slave.step(answer.time, time + LONG - answer.time);
            assert_eq!((rest.status, rest.early), (OK, false), "{}", slave.log());
            // Not even one internal step of a scene with adaptive steps.
            set(1);
            let answer = slave.step(rest.time, LONG);
            let marched = found.scene.settings.time.scheme == Scheme::Galerkin;
            let expected = if marched { (DISCARD, false, rest.time) } else { (OK, true, rest.time + 2e-6) };
            assert_eq!((answer.status, answer.early), (expected.0, expected.1), "{}", slave.log());
            assert!((answer.time - expected.2).abs() < 1e-12);
        }
    }
}
