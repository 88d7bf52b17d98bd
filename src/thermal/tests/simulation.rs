//! Properties of the exact step: comparison with a Runge-Kutta method, composition, energy, derivatives and state.

use std::f64::consts::PI;

use nalgebra::{DMatrix, DVector};
use tiprub_cosim::{CoSimulation, ThermalPatch};
use tiprub_thermal::{ConductionModel, ThermalSimulation};

const ORDER: usize = 7;
const PATCHES: usize = 3;

/// Returns a reproducible number between −1 and 1.
fn number(seed: usize) -> f64 {
    (1.0 + seed as f64 * 12.9898).sin()
}

/// Returns a symmetric positive semidefinite matrix with rates from slow to fast.
fn positive(seed: usize, scale: f64) -> DMatrix<f64> {
    let factor =
        DMatrix::from_fn(ORDER, ORDER, |i, j| number(seed + 7 * i + j) * 4.0_f64.powi(i32::try_from(j).unwrap()));
    &factor * factor.transpose() * scale
}

/// Returns a model that does not stem from a mesh.
fn model() -> ConductionModel {
    let capacity = 50.0_f64;
    let share = 1.0 / capacity.sqrt();
    let mut conduction = positive(3, 1e-5);
    conduction.row_mut(0).fill(0.0);
    conduction.column_mut(0).fill(0.0);
    let rows = |count: usize, seed: usize| {
        DMatrix::from_fn(count, ORDER, |i, j| if j == 0 { share } else { 0.1 * number(seed + 3 * i + 11 * j) })
    };
    let angle = |k: usize| 2.0 * PI * k as f64 / PATCHES as f64;
    ConductionModel {
        name: "toy".into(),
        origin: "numbers".into(),
        heat_capacity: capacity,
        conduction,
        gas_convection: positive(101, 1e-7) + DMatrix::from_diagonal_element(ORDER, ORDER, 0.02),
        ambient_convection: positive(57, 1e-8) + DMatrix::from_diagonal_element(ORDER, ORDER, 0.004),
        heat_loads: rows(PATCHES, 5).transpose(),
        patch_means: rows(PATCHES, 19),
        wetted_means: rows(2, 31),
        places: rows(4, 41),
        patches: (0..PATCHES).map(|k| ThermalPatch { angle: [angle(k), angle(k + 1)], axial: [0.0, 0.1] }).collect(),
        element_time: 1e-6,
    }
}

#[track_caller]
fn reference(simulation: &ThermalSimulation, name: &str) -> u32 {
    simulation.table().find(name).unwrap_or_else(|| panic!("no {name}")).reference
}

fn set(simulation: &mut ThermalSimulation, name: &str, value: f64) {
    let reference = reference(simulation, name);
    simulation.set_real(reference, value).unwrap();
}

fn get(simulation: &ThermalSimulation, name: &str) -> f64 {
    simulation.real(reference(simulation, name)).unwrap()
}

/// Returns all real outputs.
fn outputs(simulation: &ThermalSimulation) -> Vec<f64> {
    let count = u32::try_from(simulation.table().references()).unwrap();
    (0..count).filter_map(|reference| simulation.real(reference).ok()).collect()
}

fn bits(simulation: &ThermalSimulation) -> Vec<u64> {
    outputs(simulation).into_iter().map(f64::to_bits).collect()
}

fn warm() -> ThermalSimulation {
    let mut simulation = ThermalSimulation::new(model()).unwrap();
    set(&mut simulation, "initial_temperature", 30.0);
    set(&mut simulation, "gas_temperature", 200.0);
    set(&mut simulation, "ambient_temperature", 15.0);
    simulation.initialise(0.0).unwrap();
    simulation
}

/// Integrates by the fourth-order Runge-Kutta method in the coordinates of the model, inputs linear over the step;
/// returns patch means at the end.
fn runge_kutta(
    model: &ConductionModel,
    start: f64,
    heat: [f64; PATCHES],
    films: [[f64; 2]; 2],
    factors: [f64; 2],
    length: f64,
) -> Vec<f64> {
    let root = model.heat_capacity.sqrt();
    let matrix = &model.conduction + &model.gas_convection * factors[0] + &model.ambient_convection * factors[1];
    let sides = [&model.gas_convection, &model.ambient_convection];
    let load = |share: f64| {
        let mut load = &model.heat_loads * DVector::from_row_slice(&heat);
        for side in 0..2 {
            let temperature = films[side][0] + (films[side][1] - films[side][0]) * share;
            load += sides[side].column(0) * (root * factors[side] * temperature);
        }
        load
    };
    let steps = 40_000;
    let h = length / f64::from(steps);
    let mut x = DVector::zeros(ORDER);
    x[0] = root * start;
    for step in 0..steps {
        let rate = |x: &DVector<f64>, part: f64| load((f64::from(step) + part) / f64::from(steps)) - &matrix * x;
        let one = rate(&x, 0.0);
        let two = rate(&(&x + &one * (0.5 * h)), 0.5);
        let three = rate(&(&x + &two * (0.5 * h)), 0.5);
        let four = rate(&(&x + &three * h), 1.0);
        x += (one + (two + three) * 2.0 + four) * (h / 6.0);
    }
    (&model.patch_means * x).as_slice().to_vec()
}

#[test]
fn one_long_step_matches_many_runge_kutta_steps() {
    let model = model();
    let mut simulation = warm();
    let heat = [5.0, -2.0, 40.0];
    let first = reference(&simulation, "casing_heat");
    for (reference, value) in (first..).zip(heat) {
        simulation.set_real(reference, value).unwrap();
    }
    set(&mut simulation, "gas_temperature", 260.0);
    set(&mut simulation, "gas_convection_factor", 0.3);
    simulation.do_step(0.0, 25.0).unwrap();
    let expected = runge_kutta(&model, 30.0, heat, [[200.0, 260.0], [15.0, 15.0]], [0.3, 1.0], 25.0);
    let first = reference(&simulation, "casing_temperature");
    for (reference, value) in (first..).zip(expected) {
        let found = simulation.real(reference).unwrap();
        assert!((found - value).abs() < 1e-8 * value.abs(), "{found} against {value}");
    }
}

/// Equal inputs over time with other step lengths give the same temperatures and heats, to rounding.
#[test]
fn result_is_independent_of_step_length() {
    let run = |count: u32| {
        let mut simulation = warm();
        set(&mut simulation, "casing_heat", 7.0);
        let h = 100.0 / f64::from(count);
        for step in 0..count {
            set(&mut simulation, "gas_temperature", 200.0 + 0.5 * h * f64::from(step + 1));
            simulation.do_step(h * f64::from(step), h).unwrap();
        }
        assert!(get(&simulation, "energy_residual_relative").abs() < 1e-13);
        outputs(&simulation)
    };
    let (one, many) = (run(1), run(10_000));
    let mut simulation = warm();
    simulation.do_step(0.0, 1.0).unwrap();
    // Means are over the last step, and the residual of the balance is rounding.
    let skipped = ["gas_power", "ambient_power", "energy_residual", "energy_residual_relative"];
    let skipped: Vec<usize> = skipped
        .iter()
        .map(|name| {
            let reference = reference(&simulation, name);
            (0..reference).filter(|reference| simulation.real(*reference).is_ok()).count()
        })
        .collect();
    for (index, (a, b)) in one.iter().zip(&many).enumerate() {
        assert!(
            skipped.contains(&index) || (a - b).abs() <= 1e-11 * (a.abs() + 1.0),
            "output {index}: {a} against {b}"
        );
    }
}

#[test]
fn input_derivative_gives_a_ramp_for_every_interpolation() {
    let run = |choice: i32| {
        let mut simulation = ThermalSimulation::new(model()).unwrap();
        let interpolation = reference(&simulation, "input_interpolation");
        simulation.set_integer(interpolation, choice).unwrap();
        simulation.initialise(0.0).unwrap();
        let gas = reference(&simulation, "gas_temperature");
        simulation.set_input_derivative(gas, 1, 3.0).unwrap();
        simulation.do_step(0.0, 10.0).unwrap();
        simulation.do_step(10.0, 10.0).unwrap();
        outputs(&simulation)[8..].to_vec()
    };
    let (ramp, hold) = (run(1), run(2));
    assert!(ramp.iter().zip(&hold).all(|(a, b)| (a - b).abs() <= 1e-12 * (1.0 + a.abs())), "{ramp:?} {hold:?}");
    // Heat with a derivative: its integral is the supplied heat.
    let mut simulation = warm();
    let heat = reference(&simulation, "casing_heat");
    simulation.set_real(heat, 10.0).unwrap();
    simulation.set_input_derivative(heat, 1, 2.0).unwrap();
    simulation.do_step(0.0, 4.0).unwrap();
    simulation.do_step(4.0, 1.0).unwrap();
    assert!((get(&simulation, "supplied_heat") - (10.0 * 5.0 + 2.0 * 12.5)).abs() < 1e-12);
}

/// Computes heat flows independently: film coefficient times the difference of temperatures, by Simpson's rule over
/// short steps.
#[test]
fn convective_heat_equals_film_conductance_times_difference() {
    let (model, mut simulation) = (model(), warm());
    let flow = |simulation: &ThermalSimulation| {
        ["gas_heat", "ambient_heat"].map(|name| simulation.output_derivative(reference(simulation, name), 1).unwrap())
    };
    // At the start the temperature is uniform: h A (T_gas − T), from the numbers of the model alone.
    let expected = [model.gas_conductance() * (200.0 - 30.0), model.ambient_conductance() * (15.0 - 30.0)];
    let found = flow(&simulation);
    assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-11 * b.abs()), "{found:?} against {expected:?}");
    // Fast transients have decayed after a while; Simpson's rule resolves the rest.
    simulation.do_step(0.0, 4.0).unwrap();
    let start = ["gas_heat", "ambient_heat"].map(|name| get(&simulation, name));
    let (h, mut sums) = (0.01, [0.0; 2]);
    let mut before = flow(&simulation);
    for step in 0..400 {
        let time = 4.0 + 2.0 * h * f64::from(step);
        simulation.do_step(time, h).unwrap();
        let middle = flow(&simulation);
        simulation.do_step(time + h, h).unwrap();
        let after = flow(&simulation);
        for side in 0..2 {
            sums[side] += h / 3.0 * (before[side] + 4.0 * middle[side] + after[side]);
        }
        before = after;
    }
    for ((sum, name), start) in sums.into_iter().zip(["gas_heat", "ambient_heat"]).zip(start) {
        let reported = get(&simulation, name) - start;
        assert!((sum - reported).abs() < 1e-8 * reported.abs(), "{name}: {reported} against {sum}");
    }
}

#[test]
fn step_derivatives_equal_finite_differences() {
    let mut simulation = warm();
    simulation.do_step(0.0, 3.0).unwrap();
    let mut state = vec![0; simulation.state_size()];
    simulation.save_state(&mut state).unwrap();
    let first = reference(&simulation, "casing_heat");
    let inputs =
        [first, first + 2, reference(&simulation, "gas_temperature"), reference(&simulation, "ambient_temperature")];
    let seed = [2.0, -1.0, 3.0, 0.5];
    let names = [
        "casing_temperature",
        "surface_temperature",
        "temperature_mean",
        "temperature_max",
        "gas_power",
        "stored_heat",
        "supplied_heat",
        "ambient_heat",
    ];
    let references = names.map(|name| reference(&simulation, name));
    let run = |simulation: &mut ThermalSimulation, scale: f64| {
        simulation.restore_state(&state).unwrap();
        for (input, seed) in inputs.iter().zip(seed) {
            let value = simulation.real(*input).unwrap() + scale * seed;
            simulation.set_real(*input, value).unwrap();
        }
        simulation.do_step(3.0, 5.0).unwrap();
        references.map(|reference| simulation.real(reference).unwrap())
    };
    // A small change, so that the hottest place stays the hottest.
    let [low, high] = [-1e-3, 1e-3].map(|scale| run(&mut simulation, scale));
    run(&mut simulation, 0.0);
    let mut sensitivity = [0.0; 8];
    simulation.step_derivative(&references, &inputs, &seed, &mut sensitivity).unwrap();
    for (index, name) in names.iter().enumerate() {
        let difference = (high[index] - low[index]) / 2e-3;
        assert!(
            (sensitivity[index] - difference).abs() < 1e-7 * (1.0 + difference.abs()),
            "{name}: {} against {difference}",
            sensitivity[index]
        );
    }
    let factor = reference(&simulation, "gas_convection_factor");
    let error = simulation.step_derivative(&references[..1], &[factor], &[1.0], &mut [0.0]).unwrap_err();
    assert!(error.to_string().contains("act linearly"), "{error}");
}

#[test]
fn output_derivatives_are_time_derivatives() {
    let mut simulation = warm();
    set(&mut simulation, "casing_heat", 30.0);
    simulation.do_step(0.0, 2.0).unwrap();
    for name in
        ["casing_temperature", "temperature_mean", "temperature_max", "stored_heat", "gas_heat", "supplied_heat"]
    {
        let reference = reference(&simulation, name);
        let rate = simulation.output_derivative(reference, 1).unwrap();
        let mut later = simulation.clone();
        later.do_step(2.0, 1e-6).unwrap();
        let difference = (later.real(reference).unwrap() - simulation.real(reference).unwrap()) / 1e-6;
        assert!((rate - difference).abs() < 1e-4 * (1.0 + rate.abs()), "{name}: {rate} against {difference}");
    }
}

#[test]
fn saved_states_and_resets_give_the_same_bits() {
    let mut simulation = warm();
    let fresh = bits(&simulation);
    set(&mut simulation, "ambient_convection_factor", 2.5);
    simulation.do_step(0.0, 2.0).unwrap();
    let mut state = vec![0; simulation.state_size()];
    simulation.save_state(&mut state).unwrap();
    let here = bits(&simulation);
    let onwards = |simulation: &mut ThermalSimulation| {
        set(simulation, "gas_convection_factor", 0.1);
        set(simulation, "casing_heat", 11.0);
        (0..20).for_each(|step| simulation.do_step(2.0 + 0.7 * f64::from(step), 0.7).unwrap());
        bits(simulation)
    };
    let first = onwards(&mut simulation);
    simulation.restore_state(&state).unwrap();
    assert_eq!(bits(&simulation), here);
    assert_eq!(onwards(&mut simulation), first);
    let mut other = ThermalSimulation::new(model()).unwrap();
    other.restore_state(&state).unwrap();
    assert_eq!(onwards(&mut other), first);
    simulation.reset();
    set(&mut simulation, "initial_temperature", 30.0);
    set(&mut simulation, "gas_temperature", 200.0);
    set(&mut simulation, "ambient_temperature", 15.0);
    simulation.initialise(0.0).unwrap();
    assert_eq!(bits(&simulation), fresh);
    // A damaged state is detected and changes nothing.
    let before = bits(&simulation);
    let mut nan = state.clone();
    let at = nan.len() - 8;
    nan[at..].copy_from_slice(&f64::NAN.to_le_bytes());
    let mut phase = state.clone();
    phase[8] = 9;
    let mut fingerprint = state.clone();
    fingerprint[0] ^= 1;
    for wrong in [&nan, &phase, &fingerprint, &state[..10].to_vec(), &Vec::new()] {
        assert!(simulation.restore_state(wrong).is_err());
        assert_eq!(bits(&simulation), before);
    }
}

#[test]
fn steady_start_stays_steady_and_requires_cooling() {
    let mut simulation = ThermalSimulation::new(model()).unwrap();
    let choice = reference(&simulation, "initial_state");
    simulation.set_integer(choice, 2).unwrap();
    set(&mut simulation, "casing_heat", 9.0);
    set(&mut simulation, "gas_temperature", 80.0);
    simulation.initialise(0.0).unwrap();
    let start = get(&simulation, "temperature_max");
    assert!(start > 80.0);
    simulation.do_step(0.0, 1000.0).unwrap();
    assert!((get(&simulation, "temperature_max") - start).abs() < 1e-10 * start);
    simulation.reset();
    simulation.set_integer(choice, 2).unwrap();
    set(&mut simulation, "gas_convection_factor", 0.0);
    set(&mut simulation, "ambient_convection_factor", 0.0);
    let error = simulation.initialise(0.0).unwrap_err().to_string();
    assert!(error.contains("no significant cooling") && error.contains("uniform"), "{error}");
}

/// Without films the supplied heat is stored.
#[test]
fn uncooled_casing_keeps_its_heat() {
    let mut simulation = ThermalSimulation::new(model()).unwrap();
    set(&mut simulation, "gas_convection_factor", 0.0);
    set(&mut simulation, "ambient_convection_factor", 0.0);
    set(&mut simulation, "casing_heat", 3.0);
    simulation.initialise(0.0).unwrap();
    (0..1000).for_each(|step| simulation.do_step(50.0 * f64::from(step), 50.0).unwrap());
    assert!((get(&simulation, "stored_heat") - 150_000.0).abs() < 1e-8, "{}", get(&simulation, "stored_heat"));
    assert!((get(&simulation, "temperature_mean") - 3000.0).abs() < 1e-9);
}

#[test]
fn rejects_invalid_inputs_and_steps() {
    let mut simulation = warm();
    let heat = reference(&simulation, "casing_heat");
    for (reference, value) in [
        (heat, f64::NAN),
        (heat, 1e12),
        (reference(&simulation, "gas_convection_factor"), -0.1),
        (reference(&simulation, "temperature_max"), 1.0),
        (reference(&simulation, "initial_temperature"), 1.0),
        (9999, 0.0),
    ] {
        assert!(simulation.set_real(reference, value).is_err(), "{reference} {value}");
    }
    for (time, step) in [(0.0, 0.0), (0.0, -1.0), (0.0, f64::NAN), (5.0, 1.0), (f64::NAN, 1.0), (0.0, 1e12)] {
        assert!(simulation.begin_step(time, step).is_err(), "{time} {step}");
    }
    simulation.set_input_derivative(heat, 1, 1e9).unwrap();
    let error = simulation.begin_step(0.0, 10.0).unwrap_err().to_string();
    assert!(error.contains("its derivative leads to"), "{error}");
    let text = |change: &dyn Fn(&mut ConductionModel)| {
        let mut model = model();
        change(&mut model);
        ThermalSimulation::new(model).map(drop).unwrap_err().to_string()
    };
    assert!(text(&|model| model.heat_capacity = 0.0).contains("heat_capacity"));
    assert!(text(&|model| model.conduction[(0, 1)] = 1.0).contains("conduction"));
    assert!(text(&|model| model.gas_convection[(2, 2)] = -9.0).contains("negative eigenvalue"));
    assert!(text(&|model| model.heat_loads[(0, 1)] *= 2.0).contains("heat_loads"));
    assert!(text(&|model| model.places[(1, 3)] = f64::NAN).contains("places"));
    assert!(text(&|model| model.patch_means = DMatrix::zeros(2, ORDER)).contains("shape"));
    assert!(text(&|model| model.patches.clear()).contains("patches"));
}
