//! Independent computation of the friction heat: ∫ µ λ |v| dt from recorded normal forces and positions of the tips,
//! without the ledger.
//!
//! The work of a force that acts between t − h and t + h is that over (x(t + h) − x(t − h))/2, including Ωrh.

use std::f64::consts::TAU;

use tiprub_core::scene::method::Solver;
use tiprub_core::{CoSimulation, Result, Simulation};

use super::super::{
    Cases, Check, Expected, StabilityCase,
    models::{GAP, RADIUS, StabilityMethod, Tower, round},
    observe::{real, set, steps, worse},
};

/// Internal step (s).
const STEP: f64 = 1e-6;

/// Blades that a casing touches twice.
#[derive(Debug, Clone, Copy)]
pub(crate) struct HeatedBlades {
    /// Method.
    pub method: StabilityMethod,
    /// Coefficient µ.
    pub friction: f64,
    /// Speed (rad/s).
    pub speed: f64,
    /// Fraction of µ in the integral: a value other than 1 must be detected.
    pub share: f64,
}

/// Returns all cases of this family.
pub(crate) fn cases() -> Vec<StabilityCase> {
    let mut cases = Vec::new();
    for method in StabilityMethod::all() {
        for friction in [1e-6, 0.15, 1.0, 2.0] {
            for speed in [300.0, 1300.0, -1300.0, 1e5] {
                let heat = HeatedBlades { method, friction, speed, share: 1.0 };
                let expected = Expected::right("∫ µ λ |v| dt from forces and positions, the integral of the power");
                let name = format!("friction/heat/µ={friction}/Ω={speed}/{}", method.name());
                let quick = method.solver == Solver::Lcp && (friction - 0.15).abs() < 0.1;
                cases.add(quick && speed.abs() > 500.0 && speed < 1e4, name, expected, move || heat.run());
            }
        }
    }
    cases
}

impl HeatedBlades {
    /// Runs the rub and sums the heat.
    ///
    /// # Errors
    /// A rejected scene.
    pub(crate) fn run(self) -> Result<Vec<Check>> {
        let tower = Tower { slope: 0.0, ..Tower::default() };
        let mut scene = self.method.stepping(round(tower.rom()), STEP);
        scene.settings.contacts[0].friction = self.friction;
        scene.settings.structures[0].speed = self.speed;
        scene.settings.structures[0].damping_ratio = Some(0.02);
        // Ten times as long if the tolerance chooses the step.
        let length = if self.method.is_adaptive() { 10.0 * STEP } else { STEP };
        let mut simulation = Simulation::new(&scene)?;
        simulation.initialise(0.0)?;
        let tips = |simulation: &Simulation| -> [f64; 12] {
            std::array::from_fn(|sector| simulation.system().bank().row(1, sector))
        };
        let (late, galerkin) = (self.method.is_massless(), self.method.is_galerkin());
        let (mut before, mut oldest, mut forces) = ([0.0; 12], [0.0; 12], [0.0; 12]);
        let (mut heat, mut power, mut reversed, mut touched) = (0.0, 0.0, f64::NEG_INFINITY, 0);
        let travel = RADIUS * self.speed * length;
        for index in 0..steps(3.2e-3, length) {
            // Twice onto the blades, and away at the end.
            let swing = 0.5 - 0.5 * (TAU * (f64::from(index) * length).min(3e-3) / 1.5e-3).cos();
            set(&mut simulation, "casing_radius_change", -(GAP + 3e-5) * swing)?;
            simulation.do_step(simulation.time(), length)?;
            let now = tips(&simulation);
            let mut found: [f64; 12] = std::array::from_fn(|sector| simulation.system().multiplier(0, sector));
            if galerkin {
                // Means over the step.
                found = [0.0; 12];
                simulation.system().events().iter().for_each(|event| found[event.sector] = event.normal);
            }
            // Massless-boundary: forces computed in one step act over the next.
            let acting = if late { forces } else { found };
            for sector in 0..12 {
                let moved = if galerkin { now[sector] - before[sector] } else { 0.5 * (now[sector] - oldest[sector]) };
                let slip = travel + moved;
                heat += self.share * self.friction * acting[sector] * slip.abs();
                if acting[sector] > 0.0 {
                    reversed = worse(reversed, -slip / travel);
                }
            }
            touched += simulation.system().events().len();
            power += length * real(&simulation, "friction_power");
            (oldest, before, forces) = (before, now, found);
        }
        let booked = real(&simulation, "friction_loss");
        // The product of two means is not the mean of the product: second order in the communication step.
        let bound = if galerkin { 1e-5 * (length / STEP).powi(2) } else { 1e-9 };
        Ok(vec![
            Check::so("the tips touched, and all slide in one direction", touched > 100 && reversed < 0.0),
            Check::relative("deviation of the friction loss from ∫ µ λ |v| dt", booked, heat, bound),
            Check::relative(
                "deviation of the integral of the friction power from the friction heat",
                power,
                if galerkin { booked } else { heat },
                1e-9,
            ),
        ])
    }
}
