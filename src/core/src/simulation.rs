//! A compiled scene with its state, which FMU instances, native runs and tests drive.

mod balance;
mod blades;
mod checks;
mod compile;
mod contour;
mod drive;
mod failures;
mod fast_rotation;
mod fingerprint;
mod inputs;
mod limits;
mod loads;
mod outputs;
mod patches;
mod plan;
mod pulling;
mod slave_surface;
mod sliding_speed;
mod state;
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

use crate::geometry::PrescribedMotion;
use crate::system::{ShapeGrowth, System};
use crate::time::TimeStepper;
use crate::{Result, Scene, Warning};
use compile::Compiled;
use drive::{Input, RotorAngle};
use inputs::{CarrierInputs, Inputs, PairInputs, RotorInputs};
use std::sync::Arc;
use tangent::StepReplay;
use watched::WatchedGaps;
use window::StepWindow;

/// Allowed difference between communication points and the simulation's own time as a fraction of H (rounding in the importer).
const TIME_TOLERANCE: f64 = 1e-3;
/// Step sizes within this fraction of each other are the same step (1/60 computed in several ways).
const SAME_STEP: f64 = 1e-9;
/// Rounding errors of a time that may be in the difference of two times, in units of its last place.
const TIME_ROUNDINGS: f64 = 4.0;

/// Tolerance for equal internal steps of a communication step of length `length` (s) at `time` (s): a length is not known better than
/// rounding of the times.
fn same_step(time: f64, length: f64) -> f64 {
    SAME_STEP.max(TIME_ROUNDINGS * f64::EPSILON * time.abs() / length)
}

/// Largest number of internal steps of one communication step.
const MOST_STEPS: f64 = 1e9;

/// Phase in the life cycle of the simulation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum SimulationPhase {
    /// Values can be set; nothing has been computed.
    Created,
    /// At a communication point.
    Ready,
    /// Between two communication points.
    Stepping,
    /// A step failed; only reset and restore are possible.
    Failed,
}

/// The current communication step (or the last one).
#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct Communication {
    /// Start (s).
    start: f64,
    /// Length H (s).
    length: f64,
    /// Number of internal steps N.
    count: u64,
    /// Number of finished internal steps.
    done: u64,
    /// Number of steps tried before ([`System::steps_tried`]).
    tried: u64,
    /// Largest number of steps to try, 0 for any number.
    most: u64,
}

impl Communication {
    /// Offset of the internal point `index` from the start, from integer counts (s).
    fn offset(&self, index: u64) -> f64 {
        #[expect(clippy::cast_precision_loss, reason = "step counts are below 2^52")]
        let fraction = index as f64 / self.count as f64;
        self.length * fraction
    }

    /// Time of the internal point `index` (s); the last one is start + H exactly.
    fn time(&self, index: u64) -> f64 {
        if index == self.count { self.start + self.length } else { self.start + self.offset(index) }
    }
}

/// A scene compiled into kernels, and its state.
///
/// Life cycle: [`Simulation::new`] → set parameters and inputs → [`Simulation::initialise`] → any number of [`Simulation::do_step`] →
/// ([`Simulation::reset`] and again). The caller (the FMU slave) enforces the order of calls; this type only rejects meaningless ones.
#[derive(Debug, Clone)]
pub struct Simulation {
    /// Functions that fill the outputs, in the order of the table.
    readers: Vec<outputs::OutputReader>,
    compiled: Compiled,
    system: System,
    stepper: TimeStepper,
    /// All variables with their current values.
    values: VariableValues,
    /// Real outputs at the previous communication point, for derivatives.
    previous: Vec<f64>,
    inputs: Inputs,
    /// Rotor angles of the masters.
    rotors: Vec<RotorAngle>,
    /// Prescribed motion at the end of the current internal step, per contact pair.
    drives: Vec<PrescribedMotion>,
    /// Rotation of the rotor relative to the shape in free flight, per contact pair (rad).
    turns: Vec<f64>,
    /// Fraction of the friction heat that flows into the surface carrier, per pair.
    slave_shares: Vec<f64>,
    window: StepWindow,
    watched_gaps: WatchedGaps,
    communication: Communication,
    /// Length of the step before the last (s), 0 if there was none.
    previous_length: f64,
    time: f64,
    initial_time: f64,
    phase: SimulationPhase,
    warnings: Vec<Warning>,
    /// Warnings since the last [`Simulation::take_notes`].
    notes: Vec<Warning>,
    /// Warnings reported since the start.
    warning_state: limits::WarningState,
    /// Parameters for which the system was prepared.
    prepared: Option<limits::Parameters>,
    /// Limits for the parameters that were checked last.
    limits: Option<limits::Limits>,
    /// Length of every saved state (bytes).
    state_size: usize,
    /// State that is restored if a communication step takes too many internal steps; empty without such a bound.
    mark: Vec<u8>,
    /// Data for derivatives of the last communication step.
    tangent: StepReplay,
    /// True if the current communication step may end early.
    partial: bool,
    /// Largest number of internal steps tried within a communication step since the start.
    most_tried: u64,
    /// Energies of each set of structures that influence each other, if the ledger is kept.
    energies: Vec<SetEnergy>,
    /// Kinetic plus strain energy of each set at the start (J).
    initial_energies: Vec<f64>,
}

/// Energies of structures that influence each other (J).
#[derive(Debug, Clone, Copy, Default)]
struct SetEnergy {
    /// Instantaneous kinetic plus strain energy.
    now: f64,
    /// Energy that the scheme conserves.
    conserved: f64,
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
        let stepper = TimeStepper::new(&mut system, 0.0, 0.0);
        let window = StepWindow::new(system.structures(), &compiled.patches, &compiled.scene.settings.outputs);
        let watched_gaps = WatchedGaps::new(&compiled)?;
        let sets = system.sets().count();
        let (energies, initial_energies) = (vec![SetEnergy::default(); sets], vec![0.0; sets]);
        let (bodies, pairs) = (compiled.bodies.len(), compiled.plan.pairs.len());
        let heated = |carrier: &compile::CarrierParts| CarrierInputs {
            temperatures: vec![Input::default(); carrier.loads.thermal.len()],
            ..CarrierInputs::default()
        };
        let inputs = Inputs {
            rotors: (0..bodies).map(|body| RotorInputs::of(compiled.body(body).0)).collect(),
            pairs: vec![PairInputs::default(); pairs],
            carriers: compiled.carriers.iter().map(heated).collect(),
            ..Inputs::default()
        };
        let mut simulation = Self {
            readers,
            previous: vec![0.0; table.references()],
            values: VariableValues::new(table),
            inputs,
            rotors: vec![RotorAngle::default(); bodies],
            drives: vec![PrescribedMotion::default(); pairs],
            turns: vec![0.0; pairs],
            slave_shares: vec![1.0; pairs],
            compiled,
            system,
            stepper,
            window,
            watched_gaps,
            communication: Communication::default(),
            previous_length: 0.0,
            time: 0.0,
            initial_time: 0.0,
            phase: SimulationPhase::Created,
            warnings: Vec::new(),
            notes: Vec::new(),
            warning_state: limits::WarningState::new(bodies),
            prepared: None,
            limits: None,
            state_size: 0,
            mark: Vec::new(),
            tangent: StepReplay::default(),
            partial: false,
            most_tried: 0,
            energies,
            initial_energies,
        };
        simulation.state_size = simulation.measured_state();
        simulation.reset();
        Ok(simulation)
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
        self.prepared = Some(parameters.clone());
        self.apply_friction(parameters);
    }

    /// Returns whether the tables of spans belong to the parameters.
    fn is_prepared(&self, parameters: &limits::Parameters) -> bool {
        let deciding = |from: &limits::Parameters| {
            let numbers = [from.step, from.tolerance].map(f64::to_bits);
            (numbers, from.scheme, from.solver, from.damping_ratios.clone(), from.mode_damping.clone())
        };
        self.prepared.as_ref().is_some_and(|prepared| deciding(prepared) == deciding(parameters))
    }

    fn apply_friction(&mut self, parameters: &limits::Parameters) {
        for (pair, friction) in parameters.friction.iter().enumerate() {
            self.system.set_friction(pair, *friction);
        }
    }

    /// Returns the speeds of all masters (rad/s).
    fn speeds(&self) -> Vec<f64> {
        self.inputs.rotors.iter().map(|rotor| rotor.speed.value).collect()
    }

    /// Applies the numbers of nodal diameters that the parameters give to loads.
    fn follow_load_orders(&mut self) -> Result<()> {
        (0..self.compiled.carriers.len()).try_for_each(|carrier| {
            let order = self.value_of(Quantity::LoadOrder, carrier);
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
        (self.limits, self.prepared) = (None, None);
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
            let velocity = [0, 1, 2].map(|axis| self.value_of(Quantity::InitialVelocity(axis), body));
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
            let rotor = &self.inputs.rotors[body];
            let (speed, temperature) = (rotor.speed.at(0.0), rotor.temperature_at(0.0));
            self.compiled.settle(body, speed, temperature, structures[body].modes_mut());
        }
        let under = structures.iter_mut().skip(self.compiled.bodies.len());
        for ((carrier, inputs), structure) in self.compiled.carriers.iter().zip(&self.inputs.carriers).zip(under) {
            if carrier.loads.are_there() {
                let mut load = vec![0.0; carrier.model.len()];
                carrier.loads.fill(inputs, 0.0, &mut load);
                structure.modes_mut().settle(&load);
            }
        }
    }

    fn offset_now(&self) -> f64 {
        match self.phase {
            SimulationPhase::Stepping => self.communication.offset(self.communication.done),
            _ => 0.0,
        }
    }

    fn value_of(&self, quantity: Quantity, of: usize) -> f64 {
        let variable = self.values.table().with_quantity_of(quantity, of);
        variable.map_or(0.0, |variable| self.values[variable.reference as usize])
    }

    /// Computes the prescribed motion at an offset from the start of the communication step, at the time `time`.
    fn find_drives(&mut self, offset: f64, time: f64) {
        for pair in 0..self.drives.len() {
            self.drives[pair] = self.drive(pair, offset, time);
        }
    }

    fn drive(&self, pair: usize, offset: f64, time: f64) -> PrescribedMotion {
        let body = self.compiled.plan.pairs[pair].body;
        let (rotor, surface) = (&self.inputs.rotors[body], &self.inputs.pairs[pair]);
        PrescribedMotion {
            rotor_angle: self.rotors[body].phase(&rotor.speed, offset),
            speed: rotor.speed.at(offset),
            gap_offset: surface.gap_offset.at(offset),
            shape_factor: surface.shape_factor.at(offset) * self.ramp(pair, time),
            // Exact, so that a rotation by many turns does not cancel the rotor's own.
            shape_rotation: surface.shape_rotation.at(offset) % std::f64::consts::TAU,
            radius_change: surface.radius_change.at(offset),
            shaft: rotor.shaft.map(|input| input.at(offset)).into(),
            shaft_velocity: rotor.shaft.map(|input| input.rate()).into(),
        }
    }

    /// Factor on the casing shape of the first pair at the internal time reached (-), with its ramp.
    ///
    /// # Examples
    /// ```
    /// # use tiprub_core::{CoSimulation, Simulation};
    /// # let scene = tiprub_test_models::rub(2);
    /// # let mut simulation = Simulation::new(&scene)?;
    /// # simulation.initialise(0.0)?;
    /// // The bumps of this casing grow in over the first millisecond.
    /// assert_eq!(simulation.shape_factor(), 0.0);
    /// simulation.do_step(0.0, 1e-3)?;
    /// assert_eq!(simulation.shape_factor(), 1.0);
    /// # Ok::<(), tiprub_core::Error>(())
    /// ```
    pub fn shape_factor(&self) -> f64 {
        let (offset, done) = (self.offset_now(), self.communication.done);
        self.inputs.pairs[0].shape_factor.at(offset) * self.ramp(0, self.communication.time(done))
    }

    /// Grown fraction of the casing shape: ½(1 − cos(πt/T)) until T.
    fn ramp(&self, pair: usize, time: f64) -> f64 {
        let Some(reference) = self.compiled.references.ramp_times[pair] else { return 1.0 };
        ShapeGrowth::share(time - self.initial_time, self.values[reference])
    }

    /// Returns the growth of the shape of a pair between two offsets and times (s).
    fn growth(&self, pair: usize, offsets: [f64; 2], times: [f64; 2]) -> ShapeGrowth {
        ShapeGrowth {
            factors: offsets.map(|offset| self.inputs.pairs[pair].shape_factor.at(offset)),
            elapsed: times.map(|time| time - self.initial_time),
            length: self.compiled.references.ramp_times[pair].map_or(0.0, |reference| self.values[reference]),
        }
    }
}
