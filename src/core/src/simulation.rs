//! A compiled scene with its state, which FMU instances, native runs and tests drive.

mod balance;
mod blades;
mod checks;
mod clock;
mod compile;
mod contour;
mod diagnostics;
mod drive;
mod failures;
mod fingerprint;
mod inputs;
mod limits;
mod loads;
mod motions;
mod outputs;
mod patches;
mod plan;
mod pulling;
mod rotation_warnings;
mod spline_surface;
mod state;
mod steady_phase;
mod step_control;
mod stepping;
mod table;
mod tangent;
mod unit;
mod units;
mod watched;
mod window;

use tiprub_cosim::variables::Quantity;
use tiprub_cosim::{CoSimulation, VariableValues};

use crate::system::{Structure, System};
use crate::time::{Recurrence, TimeStepper};
use crate::{Result, Scene};
use clock::{Clock, SimulationPhase};
use compile::Compiled;
use diagnostics::Diagnostics;
use inputs::Inputs;
use motions::Motions;
use outputs::Outputs;
use state::SimulationState;
use std::sync::Arc;
use tangent::StepReplay;
use window::StepWindow;

/// A scene compiled into kernels, and its state.
///
/// Life cycle: [`Simulation::new`] → set parameters and inputs → [`Simulation::initialise`] → any number of [`Simulation::do_step`] →
/// ([`Simulation::reset`] and again). The caller (the FMU slave) enforces the order of calls; this type only rejects meaningless ones.
#[derive(Debug, Clone)]
pub struct Simulation {
    compiled: Compiled,
    system: System,
    /// Created by [`Simulation::initialise`] for its parameters, or for those of a restored state.
    stepper: TimeStepper,
    /// Everything beside the system that a run continues from.
    state: SimulationState,
    outputs: Outputs,
    motions: Motions,
    diagnostics: Diagnostics,
    /// Length of every saved state (bytes).
    state_size: usize,
    /// State that is restored if a communication step takes too many internal steps; empty without such a bound.
    mark: Vec<u8>,
    /// Data for derivatives of the last communication step.
    tangent: StepReplay,
}

impl Simulation {
    /// Compiles a scene, which is cloned if it is given by reference. Start values are set; nothing is computed yet.
    ///
    /// # Examples
    /// ```
    /// # use tiprub_core::{CoSimulation, Simulation};
    /// # let scene = tiprub_test_models::rub(2);
    /// let mut simulation = Simulation::new(&scene)?;
    /// simulation.initialise(0.0)?;
    /// simulation.do_step(0.0, 1e-4)?;
    /// assert_eq!(simulation.time(), 1e-4);
    /// # Ok::<(), tiprub_core::Error>(())
    /// ```
    ///
    /// # Errors
    /// Invalid settings or ROM; combinations that are not supported.
    pub fn new(scene: impl Into<Arc<Scene>>) -> Result<Self> {
        let (compiled, table, readers) = Compiled::new(scene.into())?;
        let mut system = compiled.system()?;
        let outputs = &compiled.scene.settings.outputs;
        system.structures.iter_mut().for_each(|one| one.need_minima(&outputs.watched_sectors, outputs.all_sectors));
        if compiled.scene.settings.time.scheme.properties().adaptive {
            system.structures.iter_mut().for_each(Structure::allocate_open_steps);
        }
        let sets = system.sets().count();
        let state = SimulationState {
            inputs: Inputs::new(&compiled),
            clock: Clock::default(),
            previous: vec![0.0; table.references()],
            values: VariableValues::new(table),
            references: compiled.references(),
            initial_energies: vec![0.0; sets],
            window: StepWindow::new(system.structures(), &compiled.patches, &compiled.scene.settings.outputs),
        };
        let mut simulation = Self {
            outputs: Outputs::new(&compiled, readers, sets)?,
            motions: Motions::new(compiled.plan.pairs.len()),
            diagnostics: Diagnostics::new(compiled.bodies.len()),
            compiled,
            system,
            stepper: TimeStepper::Recurrence(Recurrence),
            state,
            state_size: 0,
            mark: Vec::new(),
            tangent: StepReplay::default(),
        };
        simulation.state_size = simulation.measured_state();
        simulation.reset();
        Ok(simulation)
    }

    /// Skips the evaluation of sectors on which no output depends, which saves time at communication points. The values of
    /// variables do not change. For sectors that are not watched, [`Simulation::system`] and
    /// [`Simulation::watched_displacements`] then return old values, or the gap
    /// [`NO_CLEARANCE`](tiprub_cosim::variables::NO_CLEARANCE). A saved state does not contain this setting.
    ///
    /// # Examples
    /// ```
    /// # use tiprub_core::{CoSimulation, Simulation};
    /// # let scene = tiprub_test_models::rub(2);
    /// let mut simulation = Simulation::new(&scene)?;
    /// simulation.skip_unneeded_states();
    /// simulation.initialise(0.0)?;
    /// simulation.do_step(0.0, 1e-4)?;
    /// # Ok::<(), tiprub_core::Error>(())
    /// ```
    pub fn skip_unneeded_states(&mut self) {
        let outputs = &self.compiled.scene.settings.outputs;
        if outputs.nodal_diameters.is_none() {
            self.system.structures.iter_mut().for_each(|one| one.require_states_of(&outputs.watched_sectors));
        }
    }

    /// Searches the smallest gaps within spans for these sectors (1-based) only, although the scene may watch more: the
    /// steps then have the bits of a scene that watches these sectors. The clearances of other watched sectors may be
    /// too large.
    ///
    /// # Examples
    /// ```
    /// # use tiprub_core::{CoSimulation, Simulation};
    /// # let scene = tiprub_test_models::rub(2);
    /// let mut simulation = Simulation::new(&scene)?;
    /// simulation.search_minima_of(&[1]);
    /// simulation.initialise(0.0)?;
    /// simulation.do_step(0.0, 1e-4)?;
    /// # Ok::<(), tiprub_core::Error>(())
    /// ```
    pub fn search_minima_of(&mut self, sectors: &[usize]) {
        let by_sector = self.compiled.scene.settings.outputs.all_sectors;
        self.system.structures.iter_mut().for_each(|one| one.need_minima(sectors, by_sector));
    }

    /// Returns the stepped system, for studies that need more than the outputs.
    ///
    /// # Examples
    /// ```
    /// # use tiprub_core::{CoSimulation, Simulation};
    /// # let scene = tiprub_test_models::rub(2);
    /// # let mut simulation = Simulation::new(&scene)?;
    /// assert_eq!(simulation.system().structures()[0].modes().sectors(), 2);
    /// # Ok::<(), tiprub_core::Error>(())
    /// ```
    pub fn system(&self) -> &System {
        &self.system
    }

    /// Applies scheme, solver and friction of the parameters; the structures already have their damping.
    fn apply_methods(&mut self, parameters: &limits::Parameters) {
        self.system.set_methods(parameters.scheme, parameters.solver);
        self.stepper = TimeStepper::new(&mut self.system, parameters.step, parameters.tolerance);
        self.diagnostics.prepared = Some(parameters.clone());
        self.apply_friction(parameters);
    }

    fn apply_friction(&mut self, parameters: &limits::Parameters) {
        for (pair, friction) in parameters.friction.iter().enumerate() {
            self.system.set_friction(pair, *friction);
        }
    }

    /// Returns the speeds of all masters (rad/s).
    fn speeds(&self) -> Vec<f64> {
        self.state.inputs.rotors.iter().map(|rotor| rotor.speed.value).collect()
    }

    /// Applies the numbers of nodal diameters that the parameters give to loads.
    fn follow_load_orders(&mut self) -> Result<()> {
        (0..self.compiled.carriers.len()).try_for_each(|carrier| {
            let order = self.state.values.value_of(Quantity::LoadOrder, carrier);
            self.compiled.set_load_order(carrier, order)
        })
    }

    /// Computes the modes at the initial speeds and temperatures, one state per master, if there is stiffening or softening. If one is
    /// rejected, all stay unchanged.
    fn follow_reference_speeds(&mut self, states: &[[f64; 2]]) -> Result<()> {
        let before: Vec<[f64; 2]> = self.compiled.references();
        let differs = |body: &usize| {
            let [speed, temperature] = [0, 1].map(|i| before[*body][i].to_bits() != states[*body][i].to_bits());
            (self.compiled.spins(*body) && speed) || (self.compiled.softens(*body) && temperature)
        };
        let changed: Vec<usize> = (0..before.len()).filter(differs).collect();
        if changed.is_empty() {
            return Ok(());
        }
        let taken = changed.iter().try_for_each(|body| self.compiled.set_reference_speed(*body, states[*body]));
        self.system = taken.and_then(|()| self.compiled.system()).inspect_err(|_| {
            // The previous speeds were accepted before.
            changed.iter().for_each(|body| drop(self.compiled.set_reference_speed(*body, before[*body])));
        })?;
        (self.diagnostics.limits, self.diagnostics.prepared) = (None, None);
        self.state.references = self.compiled.references();
        Ok(())
    }

    /// Resets structures to rest, undeformed, with the damping of the parameters.
    fn rest(&mut self, parameters: &limits::Parameters) {
        let ratios = parameters.damping_ratios.iter().zip(&parameters.mode_damping);
        for (structure, (ratio, own)) in self.system.structures_mut().iter_mut().zip(ratios) {
            structure.modes_mut().rest();
            structure.modes_mut().set_damping_ratio(*ratio, own);
        }
        self.follow_engine_orders();
    }

    /// Gives free bodies their initial velocity; called again for another length of the first step.
    fn launch(&mut self) {
        for (body, parts) in self.compiled.bodies.iter().enumerate() {
            let Some(translations) = &parts.translations else { continue };
            let velocity = [0, 1, 2].map(|axis| self.state.values.value_of(Quantity::InitialVelocity(axis), body));
            for (mode, velocity) in translations.modal(velocity).into_iter().enumerate() {
                self.system.structures_mut()[body].modes_mut().set_modal_state(mode, 0, 0.0, velocity);
            }
            // Sets the contact nodes of the previous step according to this velocity and the length of the first step.
            self.system.structures_mut()[body].modes_mut().recover();
        }
        self.launch_blades();
    }

    /// Computes the static equilibrium under the initial loads.
    fn settle(&mut self) {
        let structures = self.system.structures_mut();
        for body in (0..self.compiled.bodies.len()).filter(|body| self.compiled.loads_blades(*body)) {
            let rotor = &self.state.inputs.rotors[body];
            let (speed, temperature) = (rotor.speed.at(0.0), rotor.temperature_at(0.0));
            self.compiled.settle(body, speed, temperature, structures[body].modes_mut());
        }
        let carriers = structures.iter_mut().skip(self.compiled.bodies.len());
        for ((carrier, inputs), structure) in
            self.compiled.carriers.iter().zip(&self.state.inputs.carriers).zip(carriers)
        {
            if carrier.loads.are_there() {
                let mut load = vec![0.0; carrier.model.len()];
                carrier.loads.fill(inputs, 0.0, &mut load);
                structure.modes_mut().settle(&load);
            }
        }
    }

    fn is_in_step(&self) -> bool {
        self.state.clock.is_stepping()
    }
}
