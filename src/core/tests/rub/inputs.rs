//! Inputs between communication points: inputs that move or load a structure never jump unless the scene requests it.

use tiprub_core::scene::settings::{BodyMotion, InputInterpolation, LoadSettings, Shape, StructureSettings};
use tiprub_core::{CoSimulation, Rom, Scene, Simulation};
use tiprub_test_models::{self as models, go, real, reference, saved, set, slope, started, started_at};

const STEP: f64 = 1e-6;

fn outputs(simulation: &Simulation) -> Vec<u64> {
    let rows = simulation.table().variables().iter().filter(|row| row.start.is_none());
    let references = rows.flat_map(|row| (row.reference..).take(row.len()));
    references.filter_map(|reference| simulation.real(reference).ok()).map(f64::to_bits).collect()
}

/// Checks the current factor on the shape, to the last bit.
#[track_caller]
fn acts(simulation: &Simulation, expected: f64) {
    let found = simulation.shape_factor();
    assert_eq!(found.to_bits(), expected.to_bits(), "{found} {expected}");
}

/// Returns blades in a casing with bumps whose size is an input without ramp; no contact as long as the factor is
/// small.
fn bumps() -> Scene {
    let mut scene = models::rub(6);
    (scene.settings.time.step, scene.settings.surfaces[0].ramp_time) = (STEP, 0.0);
    scene
}

pub fn held(mut scene: Scene) -> Scene {
    scene.settings.time.input_interpolation = InputInterpolation::Hold;
    scene
}

/// Returns a round casing around a whirling shaft.
pub fn whirling() -> Scene {
    let mut scene = bumps();
    scene.settings.surfaces[0].shape = Shape::Circular {};
    scene.settings.structures[0].whirl = true;
    scene
}

pub fn spinning_rom() -> Rom {
    let mut rom = models::rich_blade(6);
    rom.extras.spin = Some(models::spin(rom.order()));
    rom
}

/// Returns a whirling shaft with everything else that an importer can move: an elastic ring with patches and a load,
/// and spin.
fn rich() -> Scene {
    let mut scene = whirling();
    scene.roms[0] = spinning_rom();
    scene.settings.structures[0].axial_shift = true;
    (scene.settings.structures[0].spin.growth, scene.settings.structures[0].spin.stiffening) = (true, true);
    scene.settings.structures.push(StructureSettings {
        name: "ring".into(),
        rom: "ring.safetensors".into(),
        motion: BodyMotion::Still,
        damping_ratio: Some(0.03),
        thermal: true,
        load: Some(LoadSettings { order: 2, amplitude: 100.0, phase: 0.1 }),
        ..StructureSettings::default()
    });
    scene.roms.push(models::ring(24, 3));
    scene.settings.surfaces[0].structure = Some("ring".into());
    scene.settings.surfaces[0].shape = Shape::TwoLobe { depth: 0.3, width: 0.15, phase: 0.0 };
    scene
}

/// Returns a whirl whose radius grows smoothly to 0.39 mm, beyond the clearance of 0.356 mm.
fn whirl(time: f64) -> [f64; 2] {
    let radius = 0.195e-3 * (1.0 - (std::f64::consts::PI * (time / 1e-3).min(1.0)).cos());
    [radius * (600.0 * time).cos(), radius * (600.0 * time).sin()]
}

/// Sets a whirl at `now` (s) in one of three ways.
fn give(simulation: &mut Simulation, derivatives: bool, [now, next]: [f64; 2]) {
    let (from, to) = (whirl(now), whirl(next));
    for (axis, name) in ["whirl_x", "whirl_y"].into_iter().enumerate() {
        set(simulation, name, from[axis]);
        if derivatives {
            slope(simulation, name, if next > now { (to[axis] - from[axis]) / (next - now) } else { 0.0 });
        }
    }
}

/// Returns the largest node force over two milliseconds with steps of `length`, and the whirl delayed by `delay`.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "at most two thousand steps")]
fn peak(scene: &Scene, derivatives: bool, length: f64, delay: f64) -> f64 {
    let mut simulation = started(scene);
    let mut most = 0.0_f64;
    for index in 0..(2e-3 / length).round() as u32 {
        let times = [index, index + 1].map(|index| f64::from(index) * length);
        give(&mut simulation, derivatives, times.map(|time| (time - delay).max(0.0)));
        simulation.do_step(times[0], length).unwrap();
        most = most.max(real(&simulation, "normal_force_peak"));
    }
    most
}

#[test]
fn stepwise_whirl_input_causes_no_impact() {
    for length in [1e-5, 1e-4] {
        // Ramps are late by H, while the rotor has moved on.
        let [fine, late] = [0.0, length].map(|delay| peak(&whirling(), true, STEP, delay));
        let [ramp, line, hold] =
            [(whirling(), false), (whirling(), true), (held(whirling()), false)].map(|(s, d)| peak(&s, d, length, 0.0));
        println!(
            "H = {length:e}: ramp {ramp:.1} of {late:.1} N, derivatives {line:.1} of {fine:.1} N, hold {hold:.1} N"
        );
        // The chords turn by ΩH at every communication point.
        assert!(fine > 10.0 && ramp < 1.7 * late && line < 1.7 * fine, "{ramp} of {late}, {line} of {fine}");
        // The force of held values continues to grow as 1/h.
        assert!(hold > 2.0 * fine && hold > 2.0 * ramp, "what the ramp is for: {hold} {ramp} {fine}");
    }
}

#[test]
fn ramp_equals_derivatives_one_step_later() {
    let (mut ramp, mut line) = (started(&whirling()), started(&whirling()));
    let length = 2e-5;
    for index in 0..100 {
        let times = [index, index + 1].map(|index| f64::from(index) * length);
        give(&mut ramp, false, times);
        give(&mut line, true, [(times[0] - length).max(0.0), times[1] - length + f64::MIN_POSITIVE]);
        for simulation in [&mut ramp, &mut line] {
            simulation.do_step(times[0], length).unwrap();
        }
    }
    // Slip and ledger use the same velocity of the shaft.
    for name in ["friction_loss", "external_work", "force_x", "torque", "clearance_minimum", "kinetic_energy"] {
        let [a, b] = [real(&ramp, name), real(&line, name)];
        assert!((a - b).abs() <= 1e-6 * a.abs().max(b.abs()), "{name}: {a} {b}");
    }
    assert!(real(&ramp, "friction_loss") > 1e-3);
    assert!(real(&ramp, "energy_residual_relative").abs() < 1e-9);
}

#[test]
fn value_is_reached_exactly_at_the_end_of_the_step() {
    let mut simulation = started_at(&bumps(), 3.25);
    let factor = |simulation: &Simulation| simulation.shape_factor();
    // Start values are reached at the start.
    acts(&simulation, 1.0);
    let mut before = 1.0_f64;
    // Steps of various lengths, none shorter than half of the one before, the first a single internal step; one value
    // is repeated.
    for (value, length) in [(0.1, STEP), (0.3, 1e-5), (0.7, 5e-6), (0.7, 3.3e-5), (-1.0 / 3.0, 1e-4), (0.1, 5e-5)] {
        // If a value is set several times, the last one counts.
        for value in [9.0, -2.0, value] {
            set(&mut simulation, "casing_shape_factor", value);
        }
        assert_eq!(factor(&simulation).to_bits(), before.to_bits(), "nothing jumps");
        assert_eq!(real(&simulation, "casing_shape_factor").to_bits(), value.to_bits(), "read as set");
        simulation.begin_step(simulation.time(), length).unwrap();
        let (start, mut last): (f64, f64) = (simulation.time(), before);
        while let Ok(progress) = simulation.advance() {
            if progress.finished {
                break;
            }
            let expected = before + (value - before) * (progress.time - start) / length;
            assert!((factor(&simulation) - expected).abs() < 1e-9, "{} {expected}", factor(&simulation));
            assert!((factor(&simulation) - last).abs() <= (value - before).abs() * 1.001 * STEP / length + 1e-15);
            last = factor(&simulation);
        }
        assert_eq!(factor(&simulation).to_bits(), value.to_bits(), "reached to the bit");
        before = value;
    }
}

#[test]
fn held_inputs_act_immediately() {
    let mut simulation = started(&held(bumps()));
    set(&mut simulation, "casing_shape_factor", 0.25);
    acts(&simulation, 0.25);
    slope(&mut simulation, "casing_shape_factor", 1000.0);
    simulation.begin_step(0.0, 1e-5).unwrap();
    simulation.advance().unwrap();
    assert!((simulation.shape_factor() - 0.251).abs() < 1e-15);
    // The parameter also selects it, before the start but not after.
    let mut chosen = Simulation::new(bumps()).unwrap();
    let row = reference(&chosen, "input_interpolation");
    assert_eq!(chosen.integer(row).unwrap(), 1);
    chosen.set_integer(row, 2).unwrap();
    chosen.initialise(0.0).unwrap();
    assert!(chosen.set_integer(row, 1).unwrap_err().to_string().contains("fixed"));
    set(&mut chosen, "casing_shape_factor", 0.25);
    acts(&chosen, 0.25);
}

#[test]
fn input_derivatives_define_the_end_value_without_jumps() {
    let (mut simulation, length) = (started(&bumps()), 1e-5);
    // Consistent values give the line itself.
    for index in 0..5 {
        let value = 1.0 - 0.1 * f64::from(index);
        set(&mut simulation, "casing_shape_factor", value);
        slope(&mut simulation, "casing_shape_factor", -0.1 / length);
        simulation.begin_step(simulation.time(), length).unwrap();
        for part in 1..=10 {
            simulation.advance().unwrap();
            assert!((simulation.shape_factor() - (value - 0.01 * f64::from(part))).abs() < 1e-14);
        }
    }
    // Other values start from the value reached, and a step without new values continues along the line.
    set(&mut simulation, "casing_shape_factor", 0.2);
    slope(&mut simulation, "casing_shape_factor", 0.1 / length);
    assert!((simulation.shape_factor() - 0.5).abs() < 1e-14);
    for end in [0.3, 0.4, 0.5] {
        go(&mut simulation, length);
        assert!((simulation.shape_factor() - end).abs() < 1e-14, "{}", simulation.shape_factor());
    }
}

#[test]
fn value_set_within_a_step_redirects_the_ramp() {
    let mut simulation = started(&bumps());
    set(&mut simulation, "casing_shape_factor", 0.0);
    simulation.begin_step(0.0, 1e-5).unwrap();
    for _ in 0..5 {
        simulation.advance().unwrap();
    }
    assert!((simulation.shape_factor() - 0.5).abs() < 1e-14);
    set(&mut simulation, "casing_shape_factor", 1.0);
    assert!((simulation.shape_factor() - 0.5).abs() < 1e-14, "nothing jumps");
    simulation.advance().unwrap();
    assert!((simulation.shape_factor() - 0.6).abs() < 1e-14);
    simulation.end_step_early().unwrap();
    assert!((simulation.shape_factor() - 0.6).abs() < 1e-14, "the value reached is the state");
    // The remaining change takes the whole next step, or the remaining time.
    let mut twin = simulation.clone();
    simulation.begin_step(simulation.time(), 8e-6).unwrap();
    for _ in 0..4 {
        simulation.advance().unwrap();
    }
    assert!((simulation.shape_factor() - 0.8).abs() < 1e-14);
    while !simulation.advance().unwrap().finished {}
    acts(&simulation, 1.0);
    go(&mut twin, 2e-6);
    assert!((twin.shape_factor() - (0.6 + 0.4 * 2.0 / 7.0)).abs() < 1e-14, "{}", twin.shape_factor());
}

/// Moves everything; the elements of an array move equally.
fn disturb(simulation: &mut Simulation, index: u32) {
    let x = f64::from(index);
    let inputs = [
        ("speed", 1300.0 + 40.0 * x.sin()),
        ("gap_offset", 1e-5 * x.sin()),
        ("whirl_x", 2e-5 * x.cos()),
        ("whirl_y", 2e-5 * x.sin()),
        ("axial_shift", 1e-5 * (2.0 * x).sin()),
        ("casing_radius_change", 1e-5 * (3.0 * x).sin()),
        ("casing_shape_factor", 1.0 + 0.3 * x.sin()),
        ("casing_load_amplitude", 2e3 * x.cos()),
        ("casing_load_phase", 0.1 * x),
        ("casing_temperature", 3.0 * x.sin()),
    ];
    for (name, value) in inputs {
        let row = simulation.table().find(name).map(|row| (row.reference, row.len())).unwrap();
        for reference in (row.0..).take(row.1) {
            simulation.set_real(reference, value).unwrap();
        }
    }
}

#[test]
fn state_saved_within_a_ramp_continues_bit_identically() {
    let scene = rich();
    let mut simulation = started(&scene);
    for index in 0..5 {
        disturb(&mut simulation, index);
        go(&mut simulation, 1e-5);
    }
    let mut other = Simulation::new(&scene).unwrap();
    // At a communication point with values that wait for the next step, within the step, and with a ramp that turns
    // there.
    disturb(&mut simulation, 17);
    other.restore_state(&saved(&simulation)).unwrap();
    for part in 0..12 {
        for one in [&mut simulation, &mut other] {
            if part == 0 {
                one.begin_step(one.time(), 1.2e-5).unwrap();
            }
            if part == 6 {
                disturb(one, 3);
            }
            one.advance().unwrap();
        }
        assert_eq!(saved(&simulation), saved(&other), "{part}");
        other = Simulation::new(&scene).unwrap();
        other.restore_state(&saved(&simulation)).unwrap();
    }
    for one in [&mut simulation, &mut other] {
        go(one, 3e-5);
    }
    assert_eq!(outputs(&simulation), outputs(&other));
}

#[test]
fn a_thousand_resets_within_a_ramp_clear_all_state() {
    let mut scene = bumps();
    scene.settings.structures[0].whirl = true;
    let mut simulation = Simulation::new(&scene).unwrap();
    let mut first = None;
    for _ in 0..1000 {
        simulation.initialise(0.0).unwrap();
        set(&mut simulation, "whirl_x", 1e-4);
        set(&mut simulation, "casing_shape_factor", 0.5);
        simulation.do_step(0.0, 3e-6).unwrap();
        set(&mut simulation, "gap_offset", 1e-5);
        simulation.begin_step(simulation.time(), 4e-6).unwrap();
        simulation.advance().unwrap();
        let now = saved(&simulation);
        assert_eq!(*first.get_or_insert_with(|| now.clone()), now);
        simulation.reset();
    }
}

/// Checks that a rejected step changes nothing.
#[track_caller]
fn refused(simulation: &mut Simulation, length: f64, words: &[&str]) {
    let before = saved(simulation);
    let message = simulation.begin_step(simulation.time(), length).unwrap_err().to_string();
    assert!(words.iter().all(|word| message.contains(word)), "{message}");
    assert_eq!(saved(simulation), before, "a refused step changes something");
}

#[test]
fn rejected_steps_name_the_input_and_change_nothing() {
    let mut simulation = started(&bumps());
    set(&mut simulation, "casing_radius_change", 0.02);
    slope(&mut simulation, "casing_radius_change", 100.0);
    refused(&mut simulation, 1e-4, &["`casing_radius_change`", "it reaches 0.03", "outside"]);
    // The value may differ from the one that the derivative alone would reach.
    slope(&mut simulation, "casing_radius_change", 1.0);
    set(&mut simulation, "casing_radius_change", 0.0);
    // The rotation of the shape counts: the rotor is next to it.
    set(&mut simulation, "casing_shape_rotation", 3.0);
    refused(&mut simulation, 3e-6, &["`casing_shape_rotation`", "features of the casing shape"]);
    // An angle wrapped to one turn.
    set(&mut simulation, "casing_shape_rotation", 0.1);
    simulation.do_step(0.0, 1e-4).unwrap();
    set(&mut simulation, "casing_shape_rotation", 0.2 - std::f64::consts::TAU);
    refused(&mut simulation, 1e-2, &["`casing_shape_rotation`", "half a turn", "without wrapping"]);
    set(&mut simulation, "casing_shape_rotation", 0.2);
    // A fast turn is not treated as wrapped if the derivative confirms it.
    slope(&mut simulation, "casing_shape_rotation", 1300.0);
    go(&mut simulation, 1e-2);
}

#[test]
fn rejected_values_within_a_step_change_nothing() {
    let mut simulation = started(&bumps());
    set(&mut simulation, "casing_shape_rotation", 0.001);
    simulation.begin_step(0.0, 3e-6).unwrap();
    simulation.advance().unwrap();
    let before = saved(&simulation);
    let rotation = reference(&simulation, "casing_shape_rotation");
    let radius = reference(&simulation, "casing_radius_change");
    let wrapped = simulation.set_real(rotation, -6.2).unwrap_err().to_string();
    let fast = simulation.set_real(rotation, 3.0).unwrap_err().to_string();
    let beyond = simulation.set_input_derivative(radius, 1, 1e6).unwrap_err().to_string();
    assert!(wrapped.contains("half a turn") && fast.contains("`casing_shape_rotation`") && beyond.contains("outside"));
    assert_eq!(saved(&simulation), before);
}

#[test]
fn interpolation_choice_exists_only_with_ramped_inputs() {
    let mut scene = models::rub(6);
    let has = |scene: &Scene| Simulation::new(scene).unwrap().table().find("input_interpolation").is_some();
    assert!(has(&scene) && has(&whirling()));
    // Only gap_offset remains, which is ramped.
    scene.settings.surfaces[0].moving = false;
    assert!(!has(&scene));
    // The choice of the scene file can be read and selected again.
    assert!(has(&held(scene)));
    for row in Simulation::new(rich()).unwrap().table().variables() {
        let moves = row.causality == tiprub_cosim::variables::Causality::Input || row.name == "gap_offset";
        let says = row.description.contains("reached at the end of the communication step")
            || row.description.contains("constant over a");
        assert_eq!(moves, says, "{}: {}", row.name, row.description);
    }
}

#[test]
fn single_short_step_causes_no_impact() {
    let whirl = |short: Option<f64>| {
        let mut simulation = started(&whirling());
        let mut most = 0.0_f64;
        for index in 0..150_u32 {
            let time = simulation.time();
            set(&mut simulation, "whirl_x", 3.9e-4 * (time / 1e-3).min(1.0));
            let length = short.filter(|_| index == 96).unwrap_or(1e-5);
            simulation.do_step(time, length).unwrap();
            most = most.max(real(&simulation, "normal_force_peak"));
        }
        most
    };
    let even = whirl(None);
    for short in [1e-7, 1e-9] {
        let found = whirl(Some(short));
        println!("H = {short:e} once: {found:.1} N, of {even:.1} N");
        // A short step that receives the accumulated change of the step before would cause a force hundreds of times as
        // large.
        assert!(even > 10.0 && found < 2.0 * even, "{found} of {even}");
    }
}

#[test]
fn the_angle_is_the_integral_of_the_speed_with_whole_turns() {
    let mut simulation = started(&whirling());
    let (length, slope) = (1e-3, 4e4);
    for index in 1..=20 {
        let speed = 1300.0 + slope * simulation.time();
        set(&mut simulation, "speed", speed);
        self::slope(&mut simulation, "speed", slope);
        let start = simulation.time();
        simulation.do_step(start, length).unwrap();
        let time = f64::from(index) * length;
        let exact = 1300.0 * time + 0.5 * slope * time * time;
        assert!((real(&simulation, "rotor_angle") - exact).abs() < 1e-12 * exact, "{time}");
    }
    assert!(real(&simulation, "rotor_angle") > 5.0 * std::f64::consts::TAU);
}

#[test]
fn early_return_equals_a_shorter_communication_step() {
    let mut scene = bumps();
    scene.settings.outputs.energies = true;
    let mut simulation = started(&scene);
    go(&mut simulation, 1e-5);
    simulation.begin_step(simulation.time(), 1e-5).unwrap();
    for _ in 0..6 {
        simulation.advance().unwrap();
    }
    simulation.end_step_early().unwrap();
    // The same six steps as one communication step.
    let mut twin = started(&scene);
    go(&mut twin, 1e-5);
    go(&mut twin, 6e-6);
    let derivatives = |simulation: &Simulation| {
        ["rotor_angle", "kinetic_energy", "torque"]
            .map(|name| simulation.output_derivative(reference(simulation, name), 1).unwrap())
    };
    for (early, whole) in derivatives(&simulation).into_iter().zip(derivatives(&twin)) {
        assert!((early - whole).abs() <= 1e-9 * whole.abs(), "{early} {whole}");
    }
    // Means cover the completed part, however often they are read.
    let before = outputs(&simulation);
    simulation.update_outputs().unwrap();
    assert_eq!(before, outputs(&simulation));
}
