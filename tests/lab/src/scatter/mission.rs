//! Long missions: communication steps far longer than those of a rub, most of them without contact.

use super::H;
use tiprub_core::scene::method::Scheme;
use tiprub_core::{CoSimulation, Simulation};
use tiprub_study::error::clock;
use tiprub_test_models::{bumps, rich_blade};

/// Length of a communication step (s), and opening of the casing (m): without contact, and in the rub.
const LONG: f64 = 0.1;
const WIDE: [f64; 2] = [5e-4, 5e-5];
/// Number of communication steps of an hour, and those of the rub in its middle.
const HOUR: u32 = 36_000;
const RUBBING: u32 = 100;

/// A machine of 36 blades, and the number of its communication steps so far.
struct Machine {
    simulation: Simulation,
    done: u32,
}

impl Machine {
    fn new() -> tiprub_core::Result<Self> {
        let mut scene = bumps(rich_blade(36));
        scene.settings.surfaces[0].ramp_time = 0.0;
        (scene.settings.time.scheme, scene.settings.time.step) = (Scheme::Galerkin, H);
        scene.settings.time.tolerance = Some(1e-3);
        let mut machine = Self { simulation: Simulation::new(&scene)?, done: 0 };
        machine.open(WIDE[0])?;
        machine.simulation.initialise(0.0)?;
        Ok(machine)
    }

    fn open(&mut self, wide: f64) -> tiprub_core::Result<()> {
        match self.simulation.table().find("casing_radius_change") {
            Some(row) => self.simulation.set_real(row.reference, wide),
            None => Ok(()),
        }
    }

    /// Returns the processor time (s) of `count` communication steps.
    fn go(&mut self, count: u32) -> tiprub_core::Result<f64> {
        let before = clock::now();
        for _ in 0..count {
            self.simulation.do_step(f64::from(self.done) * LONG, LONG)?;
            self.done += 1;
        }
        Ok((clock::now() - before).as_secs_f64())
    }
}

/// Returns the time of a communication step (ms): without contact, and with a rub.
pub(super) fn long_steps(steps: u32) -> tiprub_core::Result<[f64; 2]> {
    let mut machine = Machine::new()?;
    let mut taken = [0.0; 2];
    for (taken, (wide, count)) in taken.iter_mut().zip([(WIDE[0], 100 * steps), (WIDE[1], steps)]) {
        machine.open(wide)?;
        *taken = 1e3 * machine.go(count)? / f64::from(count);
    }
    Ok(taken)
}

/// Results of an hour with a rub in its middle.
#[derive(Debug, Clone, Copy)]
pub(super) struct Mission {
    /// Number of communication steps, and of those in the rub.
    pub(super) steps: u32,
    pub(super) rubbing: u32,
    /// Processor time (s) without the rub, and of the rub.
    pub(super) seconds: [f64; 2],
    /// Number of steps of all blades in the rub, including rejected ones.
    pub(super) internal: u64,
    pub(super) trials: u64,
    /// Friction heat (J).
    pub(super) friction: f64,
    /// Residual of the ledger, relative to the energy exchanged.
    pub(super) residual: f64,
}

/// Runs a `part`th of an hour.
pub(super) fn hour(part: u32) -> tiprub_core::Result<Mission> {
    let (steps, rubbing) = (HOUR / part, RUBBING / part);
    let mut machine = Machine::new()?;
    let quiet = (steps - rubbing) / 2;
    let before = machine.go(quiet)?;
    let effort = *machine.simulation.system().effort();
    machine.open(WIDE[1])?;
    let rub = machine.go(rubbing)?;
    let after = *machine.simulation.system().effort();
    machine.open(WIDE[0])?;
    let rest = machine.go(steps - rubbing - quiet)?;
    let system = machine.simulation.system();
    let (ledger, (kinetic, strain)) = (system.ledger(), system.energies());
    Ok(Mission {
        steps,
        rubbing,
        seconds: [before + rest, rub],
        internal: after.steps - effort.steps,
        trials: after.trials - effort.trials,
        friction: ledger.friction_loss.value(),
        residual: ledger.residual(kinetic + strain).abs() / ledger.scale(),
    })
}
