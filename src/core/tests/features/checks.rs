//! Checks that every combination of features must pass.

use tiprub_core::{CoSimulation, Simulation};
use tiprub_test_models::{bits, go, real, reference, saved, set_element};

use crate::counting;

/// Changes the inputs of the scene from step to step.
pub fn disturb(simulation: &mut Simulation, index: u32) {
    let x = f64::from(index);
    let inputs: [(&str, f64); 6] = [
        ("speed", 1300.0 + 40.0 * (0.2 * x).sin()),
        ("whirl_x", 2e-5 * (0.3 * x).sin()),
        ("whirl_y", 2e-5 * (0.3 * x).cos()),
        ("axial_shift", 1e-5 * (0.1 * x).sin()),
        ("casing_load_amplitude", 3e3 * (0.05 * x).cos()),
        ("casing_load_phase", 0.05 * x),
    ];
    for (name, value) in inputs {
        let Some(reference) = simulation.table().find(name).map(|row| row.reference) else { continue };
        simulation.set_real(reference, value).unwrap();
        simulation.set_input_derivative(reference, 1, 0.1 * value).unwrap();
    }
    if simulation.table().find("casing_temperature").is_some() {
        for patch in 0..4 {
            set_element(simulation, "casing_temperature", patch, (0.1 * x + f64::from(patch)).sin());
        }
    }
}

/// Performs communication steps of two lengths, starting with number `from`.
fn steps(simulation: &mut Simulation, from: u32, count: u32) -> usize {
    let mut contacts = 0;
    for index in from..from + count {
        disturb(simulation, index);
        go(simulation, if index % 7 == 0 { 6.3e-5 } else { 5e-5 });
        contacts += simulation.system().events().len();
    }
    contacts
}

/// Checks that the ledger closes at every communication point, and that the work of all inputs is the external work.
pub fn ledger_closes(name: &str, mut simulation: Simulation, bound: f64) {
    let (mut contacts, mut worst) = (0, 0.0_f64);
    for index in 0..60 {
        contacts += steps(&mut simulation, index, 1);
        worst = worst.max(real(&simulation, "energy_residual_relative").abs());
    }
    println!("| {name} | {contacts} | {worst:.1e} |");
    assert!(contacts > 0, "{name} never touched");
    assert!(worst <= bound, "{name}: {worst:e}");
    for loss in ["friction_loss", "impact_loss", "wear_energy"] {
        // A missing feature has no variable.
        let Some(row) = simulation.table().find(loss) else { continue };
        assert!(loss == "impact_loss" || simulation.real(row.reference).unwrap() > 0.0, "{name}: {loss}");
    }
}

/// Checks that a state saved after contact, at a communication point and within a step, continues in another instance
/// with a different past.
pub fn state_continues(name: &str, start: &dyn Fn() -> Simulation) {
    let mut simulation = start();
    let mut contacts = steps(&mut simulation, 0, 30);
    for within in [0, 21] {
        if within > 0 {
            disturb(&mut simulation, 30);
            simulation.begin_step(simulation.time(), 5e-5).unwrap();
            for _ in 0..within {
                assert!(!simulation.advance().unwrap().finished);
            }
        }
        let (state, outputs) = (saved(&simulation), bits(&simulation));
        let mut other = start();
        other.set_real(reference(&other, "speed"), 900.0).unwrap();
        go(&mut other, 5e-5);
        other.restore_state(&state).unwrap();
        assert_eq!(bits(&other), outputs, "{name}, {within} internal steps in");
        let ends = [&mut simulation, &mut other].map(|simulation| {
            if within > 0 {
                while !simulation.advance().unwrap().finished {}
            }
            contacts += steps(simulation, 31, 10);
            saved(simulation)
        });
        assert!(ends[0] == ends[1], "{name}, {within} internal steps in");
        // The state is also restored into the same instance.
        simulation.restore_state(&state).unwrap();
        assert_eq!(bits(&simulation), outputs, "{name}, {within} internal steps in");
        if within > 0 {
            while !simulation.advance().unwrap().finished {}
        }
    }
    assert!(contacts > 0, "{name} never touched");
}

/// Checks that steps and saving allocate no memory.
pub fn allocates_nothing(name: &str, mut simulation: Simulation) {
    let mut state = saved(&simulation);
    let mut contacts = 0;
    let allocations = (0..40).map(|index| {
        disturb(&mut simulation, index);
        let length = if index % 7 == 0 { 6.3e-5 } else { 5e-5 };
        let count = counting::allocations_of(|| go(&mut simulation, length));
        contacts += simulation.system().events().len();
        count
    });
    let allocations: usize = allocations.sum();
    let saving = counting::allocations_of(|| simulation.save_state(&mut state).unwrap());
    assert!(contacts > 0, "{name} never touched");
    assert_eq!((allocations, saving), (0, 0), "{name}");
}
