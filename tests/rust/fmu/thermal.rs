//! The library of heat conduction through both interfaces: bits of the native simulation, saved states, derivatives,
//! errors. The call order is tested with that of the contact unit.

use nalgebra::DMatrix;
use tiprub_cosim::{CoSimulation, ThermalPatch};
use tiprub_tests::scene::UnpackedResources;
use tiprub_tests::{ERROR, fmi2, fmi3, shipped, thermal};
use tiprub_thermal::{ConductionModel, ThermalSimulation};

const PATCHES: usize = 3;
const ORDER: usize = 5;

/// Returns a model without a mesh.
pub fn model() -> ConductionModel {
    let capacity = 50.0_f64;
    let share = 1.0 / capacity.sqrt();
    let number = |seed: usize| (1.0 + seed as f64 * 12.9898).sin();
    let diagonal = |scale: f64| {
        let rates = (0..ORDER).map(|k| scale * 3.0_f64.powi(i32::try_from(k).expect("few")));
        DMatrix::from_diagonal(&nalgebra::DVector::from_iterator(ORDER, rates))
    };
    let mut conduction = diagonal(0.1);
    conduction[(0, 0)] = 0.0;
    let rows = |count: usize, seed: usize| {
        DMatrix::from_fn(count, ORDER, |i, j| if j == 0 { share } else { 0.1 * number(seed + 3 * i + 11 * j) })
    };
    let coupled = |scale: f64| DMatrix::from_element(ORDER, ORDER, scale) + diagonal(scale);
    let angle = |k: usize| std::f64::consts::TAU * k as f64 / PATCHES as f64;
    ConductionModel {
        name: "toy_thermal".into(),
        origin: "numbers".into(),
        heat_capacity: capacity,
        conduction,
        gas_convection: coupled(0.02),
        ambient_convection: coupled(0.004),
        heat_loads: rows(PATCHES, 5).transpose(),
        patch_means: rows(PATCHES, 19),
        wetted_means: rows(2, 31),
        places: rows(4, 41),
        patches: (0..PATCHES).map(|k| ThermalPatch { angle: [angle(k), angle(k + 1)], axial: [0.0, 0.1] }).collect(),
        element_time: 1e-6,
    }
}

/// Returns the references of inputs, and of all reals.
fn references() -> (u32, u32, Vec<u32>) {
    let simulation = ThermalSimulation::new(model()).expect("valid");
    let find = |name: &str| simulation.table().find(name).unwrap_or_else(|| panic!("no {name}")).reference;
    let count = u32::try_from(simulation.table().references()).expect("few variables");
    // The time belongs to the instance in every phase: the others are reals.
    let reals = (1..count).filter(|reference| simulation.real(*reference).is_ok()).collect();
    (find("casing_heat"), find("gas_convection_factor"), reals)
}

/// Returns heat, factor and length of a step.
fn inputs(step: u32) -> ([f64; PATCHES], f64, f64) {
    let wave = |k: u32| 50.0 * f64::from(step + 3 * k).sin();
    ([0, 1, 2].map(wave), if step % 7 < 3 { 1.0 } else { 0.25 }, 0.1 * f64::from(1 + step % 4))
}

#[test]
fn fmi2_and_fmi3_match_the_native_simulation() {
    let path = thermal();
    let (two, three) = (fmi2::load(&path), fmi3::load(&path));
    let (heat, factor, reals) = references();
    let mut native = ThermalSimulation::new(model()).expect("valid");
    native.initialise(0.0).expect("valid");
    let (flat, whole) = (UnpackedResources::of_thermal(&model(), false), UnpackedResources::of_thermal(&model(), true));
    let old = fmi2::Fmi2TestSlave::initialised(&two, &flat);
    let new = fmi3::Fmi3TestSlave::new(&three, &flat);
    new.initialise();
    let arrays = fmi3::Fmi3TestSlave::new(&three, &whole);
    arrays.initialise();
    let mut time = 0.0;
    for step in 0..60 {
        let (watts, share, length) = inputs(step);
        let places: Vec<u32> = (heat..).take(PATCHES).chain([factor]).collect();
        let values: Vec<f64> = watts.into_iter().chain([share]).collect();
        for (place, value) in places.iter().zip(&values) {
            native.set_real(*place, *value).expect("in range");
        }
        old.expect(old.set_reals(&places, &values));
        new.expect(new.set_reals(&places, &values));
        arrays.expect(arrays.set_reals(&[heat, factor], &values));
        native.do_step(time, length).expect("a step");
        old.expect(old.step(time, length));
        assert_eq!((new.step(time, length).status, arrays.step(time, length).status), (0, 0));
        time += length;
        let expected: Vec<u64> = reals.iter().map(|place| native.real(*place).expect("a real").to_bits()).collect();
        let bits = |values: Vec<f64>| values.into_iter().map(f64::to_bits).collect::<Vec<_>>();
        assert_eq!(bits(old.reals(&reals)), expected, "FMI 2.0, step {step}");
        assert_eq!(bits(new.reals(&reals, reals.len())), expected, "FMI 3.0, step {step}");
    }
}

#[test]
fn states_restore_continue_and_transfer_between_instances() {
    let api = fmi2::load(&thermal());
    let (heat, factor, reals) = references();
    let resources = UnpackedResources::of_thermal(&model(), false);
    let slave = fmi2::Fmi2TestSlave::initialised(&api, &resources);
    let march = |slave: &fmi2::Fmi2TestSlave<'_>, first: u32, mut time: f64| -> Vec<u64> {
        for step in first..first + 30 {
            let (watts, share, length) = inputs(step);
            slave.expect(slave.set_reals(&[heat, heat + 1, heat + 2, factor], &[watts[0], watts[1], watts[2], share]));
            slave.expect(slave.step(time, length));
            time += length;
        }
        slave.reals(&reals).into_iter().map(f64::to_bits).collect()
    };
    march(&slave, 0, 0.0);
    let time = (0..30).fold(0.0, |time, step| time + inputs(step).2);
    let state = slave.save();
    let bytes = slave.serialise(state);
    let expected = march(&slave, 30, time);
    slave.expect(slave.restore(state));
    assert_eq!(march(&slave, 30, time), expected);
    let other = fmi2::Fmi2TestSlave::new(&api, &resources);
    let (status, copy) = other.deserialise(&bytes);
    assert_eq!(status, 0);
    other.expect(other.restore(copy));
    assert_eq!(march(&other, 30, time), expected);
    let mut damaged = bytes.clone();
    damaged[200] ^= 4;
    assert_eq!(other.deserialise(&damaged).0, ERROR);
    assert!(other.log().contains("checksum"));
}

/// Steps in which heat does not cross an element cause one message per instance, with the remedy.
#[test]
fn short_steps_are_warned_of_once_in_fmi2_and_fmi3() {
    let path = thermal();
    let (two, three) = (fmi2::load(&path), fmi3::load(&path));
    let resources = UnpackedResources::of_thermal(&ConductionModel { element_time: 0.5, ..model() }, false);
    let reported =
        |log: String| log.matches("shorter than the 0.500 s that heat needs to diffuse through an element").count();
    for _instance in 0..2 {
        let (old, new) =
            (fmi2::Fmi2TestSlave::initialised(&two, &resources), fmi3::Fmi3TestSlave::new(&three, &resources));
        new.initialise();
        old.expect(old.step(0.0, 0.6));
        new.expect(new.step(0.0, 0.6).status);
        assert_eq!((reported(old.log()), reported(new.log())), (0, 0));
        for (step, expected) in [(0, 1), (1, 0)] {
            let time = 0.6 + 0.1 * f64::from(step);
            old.expect(old.step(time, 0.1));
            new.expect(new.step(time, 0.1).status);
            assert_eq!((reported(old.log()), reported(new.log())), (expected, expected), "step {step}");
        }
    }
}

/// Both libraries in one process, each with the resources of the other.
#[test]
fn library_rejects_the_model_of_the_other_library() {
    let (contact, conduction) = (fmi2::load(&shipped()), fmi2::load(&thermal()));
    let (scene, model) = (UnpackedResources::new(false), UnpackedResources::of_thermal(&model(), false));
    let refused = |api, resources: &UnpackedResources| {
        fmi2::Fmi2TestSlave::try_new(api, &fmi2::Fmi2Arguments::new(resources)).expect_err("must be refused")
    };
    assert!(refused(&contact, &model).contains("scene.toml"));
    assert!(refused(&conduction, &scene).contains("casing.thermal.safetensors"));
    let (one, other) =
        (fmi2::Fmi2TestSlave::initialised(&contact, &scene), fmi2::Fmi2TestSlave::initialised(&conduction, &model));
    one.expect(one.step(0.0, 1e-4));
    other.expect(other.step(0.0, 1e-4));
    // The state of one is invalid for the other.
    let bytes = one.serialise(one.save());
    assert_eq!(other.deserialise(&bytes).0, ERROR);
}

#[test]
fn derivatives_match_the_native_simulation() {
    let api = fmi2::load(&thermal());
    let (heat, factor, _) = references();
    let resources = UnpackedResources::of_thermal(&model(), false);
    let slave = fmi2::Fmi2TestSlave::initialised(&api, &resources);
    let mut native = ThermalSimulation::new(model()).expect("valid");
    native.initialise(0.0).expect("valid");
    let output = native.table().find("casing_temperature").expect("there is one").reference;
    let (seed, mut value) = (3.0, 0.0);
    // SAFETY: arrays of one element.
    let ask = |input: u32, value: &mut f64| unsafe {
        (api.fmi2GetDirectionalDerivative)(
            slave.handle,
            &raw const output,
            1,
            &raw const input,
            1,
            &raw const seed,
            &raw mut *value,
        )
    };
    assert_eq!(ask(heat, &mut value), ERROR);
    assert!(slave.log().contains("no communication step"));
    slave.expect(slave.step(0.0, 2.0));
    native.do_step(0.0, 2.0).expect("a step");
    slave.expect(ask(heat, &mut value));
    let mut expected = [0.0];
    native.step_derivative(&[output], &[heat], &[seed], &mut expected).expect("there was a step");
    assert_eq!(value.to_bits(), expected[0].to_bits());
    assert!(value != 0.0);
    assert_eq!(ask(factor, &mut value), ERROR);
    assert!(slave.log().contains("act linearly"));
}
