//! Inputs that are arrays, over the C ABI and against callers that break the rules; and features that are off, which
//! leave no trace.

#![allow(clippy::float_cmp, reason = "values are compared for being untouched")]

use tiprub_core::scene::rom::Spin;
use tiprub_core::{CoSimulation, Scene, Simulation};
use tiprub_tests::scene::{PATCHES, UnpackedResources, ring, rom, scene, warm_scene};
use tiprub_tests::{ERROR, OK, fmi2, fmi3, shipped};

/// Returns the first reference of a variable of a scene.
#[track_caller]
fn of(scene: &Scene, name: &str) -> u32 {
    let simulation = Simulation::new(scene).unwrap();
    simulation.table().find(name).unwrap_or_else(|| panic!("no variable {name}")).reference
}

#[track_caller]
fn refused(status: i32, log: &str, reason: &str) {
    assert!(status == ERROR && log.contains(reason), "status {status}, not \"{reason}\": {log}");
}

const START: [f64; PATCHES] = [3.0, -2.0, 0.5, 7.0];

#[test]
fn array_input_is_set_completely_or_not_at_all() {
    let (path, scene) = (shipped(), warm_scene());
    let (array, speed) = (of(&scene, "casing_temperature"), of(&scene, "speed"));
    let (api, resources) = (fmi3::load(&path), UnpackedResources::of(&scene, true));
    let slave = fmi3::Fmi3TestSlave::new(&api, &resources);
    assert_eq!(slave.reals(&[array], PATCHES), [0.0; PATCHES], "start values");
    slave.initialise();
    slave.expect(slave.set_reals(&[array], &START));
    let (nan, infinity) = (f64::NAN, f64::INFINITY);
    for (references, values, reason) in [
        (vec![array], vec![1.0; 3], "cover 4 values"),
        (vec![array], vec![1.0; 5], "cover 4 values"),
        (vec![array], vec![], "cover 4 values"),
        (vec![array, speed], vec![1.0; 4], "cover 5 values"),
        (vec![array, array], vec![1.0; 4], "cover 8 values"),
        (vec![array + 1], vec![1.0; 4], "lies inside the array"),
        (vec![array], vec![1.0, 1.0, nan, 1.0], "casing_temperature[3]"),
        (vec![array], vec![1.0, infinity, 1.0, 1.0], "not finite"),
        (vec![array], vec![1.0, 1.0, 1.0, 3000.1], "casing_temperature[4]"),
        (vec![array], vec![-3000.1, 1.0, 1.0, 1.0], "outside the range -3000 to 3000"),
        (vec![speed, array], vec![200.0, 1.0, 1.0, 1.0, nan], "casing_temperature[4]"),
        (vec![array, speed], vec![1.0, 1.0, 1.0, 1.0, nan], "speed"),
    ] {
        refused(slave.set_reals(&references, &values), &slave.log(), reason);
        assert_eq!(slave.reals(&[array], PATCHES), START, "{references:?} {values:?}");
        assert_eq!(slave.reals(&[speed], 1), [300.0]);
    }
    // The values set are returned, and a step succeeds.
    slave.expect(slave.set_reals(&[speed, array], &[310.0, 1.0, 2.0, 3.0, -4.0]));
    assert_eq!(slave.reals(&[array, speed], 5), [1.0, 2.0, 3.0, -4.0, 310.0]);
    assert_eq!(slave.step(0.0, 1e-4).status, OK);
    assert_eq!(slave.reals(&[array], PATCHES), [1.0, 2.0, 3.0, -4.0]);
    // Saved, changed, restored.
    let state = slave.save();
    slave.expect(slave.set_reals(&[array], &START));
    slave.expect(slave.restore(state));
    assert_eq!(slave.reals(&[array], PATCHES), [1.0, 2.0, 3.0, -4.0], "inputs are part of a state");
}

#[test]
fn array_elements_are_scalars_in_fmi2_and_on_request_in_fmi3() {
    let (path, scene) = (shipped(), warm_scene());
    let array = of(&scene, "casing_temperature");
    let references: Vec<u32> = (array..array + 4).collect();
    let resources = UnpackedResources::of(&scene, false);
    let (api2, api3) = (fmi2::load(&path), fmi3::load(&path));
    let two = fmi2::Fmi2TestSlave::initialised(&api2, &resources);
    let three = fmi3::Fmi3TestSlave::new(&api3, &resources);
    three.initialise();
    two.expect(two.set_reals(&references, &START));
    three.expect(three.set_reals(&references, &START));
    refused(two.set_reals(&references[1..3], &[1.0, f64::NAN]), &two.log(), "casing_temperature[3]");
    refused(three.set_reals(&references[1..3], &[1.0, f64::NAN]), &three.log(), "casing_temperature[3]");
    refused(three.set_reals(&[array], &START), &three.log(), "cover 1 values");
    assert_eq!(two.reals(&references), START);
    assert_eq!(three.reals(&references, PATCHES), START);
    two.expect(two.set_reals(&references[2..3], &[11.0]));
    assert_eq!(two.reals(&references), [3.0, -2.0, 11.0, 7.0]);
}

#[test]
fn each_element_of_an_array_input_has_its_derivative() {
    let (path, mut scene) = (shipped(), warm_scene());
    scene.settings.outputs.slave_displacement = true;
    let (array, moved) = (of(&scene, "casing_temperature"), of(&scene, "casing_displacement"));
    let (api, resources) = (fmi2::load(&path), UnpackedResources::of(&scene, true));
    let slave = fmi2::Fmi2TestSlave::initialised(&api, &resources);
    for (order, value, reason) in [(2, 1.0, "order"), (0, 1.0, "order"), (1, f64::NAN, "not finite")] {
        refused(slave.set_derivatives(&[array + 3], order, &[value]), &slave.log(), reason);
    }
    refused(slave.set_derivatives(&[array + 4], 1, &[1.0]), &slave.log(), "not a continuous real input");
    refused(slave.set_derivatives(&[moved], 1, &[1.0]), &slave.log(), "not a continuous real input");
    // One valid and one invalid value together: neither is accepted.
    refused(slave.set_derivatives(&[array, array + 1], 1, &[1e6, f64::INFINITY]), &slave.log(), "not finite");
    slave.expect(slave.step(0.0, 1e-4));
    assert_eq!(slave.reals(&[moved]), [0.0], "nothing warms up");
    // Only the last patch warms up, and the ring grows.
    slave.expect(slave.set_derivatives(&[array + 3], 1, &[1e4]));
    slave.expect(slave.step(1e-4, 1e-4));
    let grown = slave.reals(&[moved])[0];
    assert!(grown > 1e-9, "{grown}");
}

/// Names that exist only in some scenes.
const OF_FEATURES: [&str; 25] = [
    "whirl_x",
    "whirl_y",
    "axial_shift",
    "casing_temperature",
    "casing_load_amplitude",
    "casing_load_phase",
    "casing_friction_power",
    "casing_displacement",
    "casing_damping_ratio",
    "casing_heat_fraction",
    "blade_friction_power",
    "wear_depth",
    "wear_depth_maximum",
    "worn_volume",
    "wear_work",
    "load_work",
    "casing_radius_change",
    "casing_shape_factor",
    "casing_shape_rotation",
    "moment_x",
    "moment_y",
    "stiffening_work",
    "whirl_work",
    "shift_work",
    "casing_motion_work",
];

#[test]
fn disabled_features_have_no_variables_or_data() {
    let plain = scene();
    let simulation = Simulation::new(&plain).unwrap();
    for name in OF_FEATURES {
        assert!(simulation.table().find(name).is_none(), "{name}");
    }
    // Adding or removing a feature does not change the names of others.
    let warm = Simulation::new(warm_scene()).unwrap();
    for variable in simulation.table().variables() {
        assert!(warm.table().find(&variable.name).is_some(), "{}", variable.name);
    }
    // A ROM with unused optional data gives the same files, bytes and token as one without them.
    let order = rom().order();
    let mut able = plain.clone();
    able.roms[0].extras.spin = Some(Spin {
        stiffness_speed2: nalgebra::DMatrix::identity(order, order),
        stiffness_speed4: nalgebra::DMatrix::zeros(order, order),
        coriolis: nalgebra::DMatrix::zeros(order, order),
        centrifugal_load: vec![1e-3; order],
        centrifugal_load_speed4: vec![0.0; order],
        largest_speed: 1000.0,
    });
    able.roms[0].extras.thermal = ring().extras.thermal.map(|mut thermal| {
        thermal.loads = nalgebra::DMatrix::from_element(order, PATCHES, 1.0);
        thermal
    });
    let files = tiprub_format::resource_files(&plain, true);
    let names: Vec<&str> = files.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!(names, ["scene.toml", "rotor.rom.safetensors", "package.toml"]);
    assert_eq!(tiprub_format::resource_files(&able, true), files);
    // A casing that carries a surface but is not heated keeps its grid and loses its thermal data.
    let mut cold = warm_scene();
    cold.settings.structures[1].thermal = false;
    let warm_size = |scene: &Scene| tiprub_format::resource_files(scene, true)[2].1.len();
    let (with, without) = (warm_size(&warm_scene()), warm_size(&cold));
    // Two arrays of 4 x 4 and 3 x 4 numbers, and their entries in the header.
    assert!(with - without > (16 + 12) * 8, "{with} bytes with heat, {without} without");
    let ring_file = String::from_utf8_lossy(&tiprub_format::resource_files(&cold, true)[2].1).into_owned();
    assert!(ring_file.contains("contact_grid") && !ring_file.contains("thermal"));
}

#[test]
fn packaged_scene_runs_as_unpackaged() {
    let (path, scene) = (shipped(), warm_scene());
    let array = of(&scene, "casing_temperature");
    let (api, resources) = (fmi3::load(&path), UnpackedResources::of(&scene, true));
    let slave = fmi3::Fmi3TestSlave::new(&api, &resources);
    let slightly = START.map(|value| 0.1 * value);
    slave.expect(slave.set_reals(&[array], &slightly));
    slave.initialise();
    let mut simulation = Simulation::new(&scene).unwrap();
    for (element, value) in (array..).zip(slightly) {
        simulation.set_real(element, value).unwrap();
    }
    simulation.initialise(0.0).unwrap();
    let (minimum, impulse) = (of(&scene, "sector_clearance_minimum"), of(&scene, "normal_impulse"));
    let mut touching = 0;
    for index in 0..100 {
        let time = f64::from(index) * 1e-4;
        assert_eq!(slave.step(time, 1e-4).status, OK, "{}", slave.log());
        simulation.do_step(time, 1e-4).unwrap();
        let expected: Vec<f64> = (minimum..minimum + 6).map(|r| simulation.real(r).unwrap()).collect();
        assert_eq!(slave.reals(&[minimum], 6), expected);
        touching += usize::from(simulation.real(impulse).unwrap() > 0.0);
    }
    assert!(touching > 5, "{touching} steps with contact");
}

/// An importer multiplies mean torque and speed, step by step, while the rotor slows down.
#[test]
fn mean_torque_times_speed_equals_shaft_work() {
    let (path, mut scene) = (shipped(), scene());
    scene.settings.outputs.energies = true;
    let [speed, torque, work] = ["speed", "torque", "shaft_work"].map(|name| of(&scene, name));
    let (api, resources) = (fmi2::load(&path), UnpackedResources::of(&scene, true));
    let slave = fmi2::Fmi2TestSlave::initialised(&api, &resources);
    let (mut supplied, mut step) = (0.0, 0.0);
    for index in 0..400 {
        let now = 300.0 - 0.2 * f64::from(index);
        slave.expect(slave.set_reals(&[speed], &[now]));
        slave.expect(slave.step(step, 1e-4));
        step += 1e-4;
        supplied += slave.reals(&[torque])[0] * now * 1e-4;
    }
    let booked = slave.reals(&[work])[0];
    assert!(booked.abs() > 1e-6 && (supplied + booked).abs() < 1e-10 * booked.abs(), "{supplied} and {booked}");
}
