//! The simulation as a co-simulation unit.

use tiprub_cosim::persist::{Persist, StateReader, to_bytes};
use tiprub_cosim::variables::{Causality, Quantity, Value};
use tiprub_cosim::{CoSimulation, StepProgress, VariableValues, bounds};

use super::drive::{Input, RotorAngle};
use super::{Communication, Simulation, SimulationPhase};
use crate::system::StepFailure;
use crate::{Error, Result, Warning};

impl CoSimulation for Simulation {
    fn variables(&self) -> &VariableValues {
        &self.values
    }

    fn is_initialised(&self) -> bool {
        self.phase != SimulationPhase::Created
    }

    fn set(&mut self, reference: u32, value: Value) -> Result<()> {
        let (variable, _) = self.check(reference, value)?;
        if variable.quantity == Quantity::Friction && self.is_initialised() {
            let before = std::mem::replace(&mut self.values[reference as usize], value.number());
            let parameters = self.parameters();
            let outcome = self.check_limits(&parameters);
            self.values[reference as usize] = before;
            outcome?;
            self.warn_of_friction(&parameters);
            self.tangent.follow_anew();
            self.apply_friction(&parameters);
        }
        if let Value::Real(value) = value {
            let offset = self.offset_now();
            self.change_input(reference, |input| input.ask(value, offset))?;
        }
        self.values[reference as usize] = value.number();
        if let Value::Integer(_) = value {
            // A new bound on the number of steps applies from the next communication step on.
            self.make_room();
        }
        Ok(())
    }

    fn set_input_derivative(&mut self, reference: u32, order: i32, value: f64) -> Result<()> {
        self.check_input_derivative(reference, order, value)?;
        let offset = self.offset_now();
        self.change_input(reference, |input| input.ask_slope(value, offset))
    }

    /// Clearances and the rotor angle have a rate of their own; the rate of other outputs is their change since the previous communication
    /// point (for means: between the middles of the last two steps), or 0 before there are two points.
    fn output_derivative(&self, reference: u32, order: i32) -> Result<f64> {
        let (variable, element) = self.table().locate(reference)?;
        variable.check_derivative(element, Causality::Output, order)?;
        let derivative = self.derivative_of(variable, element, reference);
        if derivative.is_finite() {
            return Ok(derivative);
        }
        let what = format!("derivative of `{}`", variable.element_name(element));
        let problem = "the rate of change over the communication step overflows double precision";
        Err(Error::invalid(what, problem, "Use longer communication steps, and check loads and inputs"))
    }

    fn courses(&self) -> Vec<u8> {
        to_bytes(&[&self.inputs, &self.rotors])
    }

    fn restore_courses(&mut self, courses: &[u8]) {
        let reader = &mut StateReader::new(courses);
        self.inputs.restore(reader);
        self.rotors.restore(reader);
    }

    fn initialise(&mut self, start_time: f64) -> Result<()> {
        bounds::at_most("start time", start_time, bounds::TIME)?;
        let parameters = self.parameters();
        // After an error the instance must be initialised again.
        self.phase = SimulationPhase::Created;
        self.warnings.clear();
        self.notes.clear();
        self.compiled.scene.check_methods(parameters.scheme, parameters.solver)?;
        self.check_slips()?;
        self.follow_load_orders()?;
        self.check_launch(parameters.scheme)?;
        self.follow_reference_speeds(&self.references())?;
        let findings = self.check_limits(&parameters)?;
        self.warnings = findings.iter().map(|finding| self.compiled.warning(finding)).collect();
        self.warn_of_fast_rotation();
        self.warn_of_sticking(&parameters);
        self.warn_of_tolerance(&parameters);
        self.begin_telling(&parameters, &findings);
        let settings = &self.compiled.scene.settings;
        self.warnings.retain(|warning| !settings.is_silenced(warning.topic()));
        self.rest(&parameters);
        self.apply_methods(&parameters);
        self.make_room();
        self.make_room_for_tangent();
        self.time = start_time;
        self.initial_time = start_time;
        self.communication = Communication { start: start_time, count: 1, done: 1, ..Communication::default() };
        self.previous_length = 0.0;
        self.most_tried = 0;
        for body in 0..self.rotors.len() {
            self.rotors[body] = RotorAngle::new(self.value_of(Quantity::InitialAngle, body));
        }
        self.find_drives(0.0, start_time);
        self.stepper.set_first_step(&mut self.system, parameters.step);
        self.inputs.start();
        self.settle();
        self.launch();
        self.system.start(&self.drives);
        self.check_initial_state()?;
        self.check_initial_gaps()?;
        self.window.open(self.system.structures());
        self.compute_outputs();
        for (initial, energy) in self.initial_energies.iter_mut().zip(&self.energies) {
            *initial = energy.now;
        }
        self.check_outputs(start_time)?;
        self.phase = SimulationPhase::Ready;
        self.previous.copy_from_slice(&self.values);
        Ok(())
    }

    fn reset(&mut self) {
        self.values.reset();
        self.previous.fill(0.0);
        self.inputs.clear();
        for variable in self.values.table().variables().iter().filter(|variable| variable.is_settable()) {
            for element in 0..variable.len() {
                if let Some(input) = self.inputs.get_mut(variable.quantity, variable.of, element) {
                    input.ask(self.values[variable.reference as usize + element], 0.0);
                    input.take();
                }
            }
        }
        self.system.structures_mut().iter_mut().for_each(|structure| structure.modes_mut().rest());
        self.rotors.fill(RotorAngle::default());
        self.communication = Communication::default();
        (self.previous_length, self.most_tried) = (0.0, 0);
        (self.time, self.initial_time) = (0.0, 0.0);
        self.warnings.clear();
        self.notes.clear();
        self.tangent.renew();
        self.phase = SimulationPhase::Created;
    }

    fn time(&self) -> f64 {
        self.time
    }

    fn warnings(&self) -> &[Warning] {
        &self.warnings
    }

    fn take_notes(&mut self) -> Vec<Warning> {
        std::mem::take(&mut self.notes)
    }

    fn begin_step(&mut self, current_time: f64, step_size: f64) -> Result<()> {
        self.begin(current_time, step_size, false)
    }

    fn begin_partial_step(&mut self, current_time: f64, step_size: f64) -> Result<()> {
        self.begin(current_time, step_size, true)
    }

    /// Does nothing unless sectors take adaptive steps, inputs rest, and no contact can close.
    fn fly_ahead(&mut self) {
        let last = self.communication.count.saturating_sub(1);
        if !self.is_stepping() || !self.is_marched() || self.communication.done > 0 || last < 2 {
            return;
        }
        let (offset, time) = (self.communication.offset(last), self.communication.time(last));
        for pair in 0..self.drives.len() {
            let growth = self.growth(pair, [0.0, offset], [self.communication.start, time]);
            if growth.elapsed[0] < growth.length {
                return;
            }
            let body = self.compiled.plan.pairs[pair].body;
            let (speed, angle) = (&self.inputs.rotors[body].speed, &self.rotors[body]);
            let shape = &self.inputs.pairs[pair].shape_rotation;
            self.turns[pair] =
                angle.total(speed, offset) - angle.total(speed, 0.0) - (shape.at(offset) - shape.at(0.0));
        }
        self.find_drives(offset, time);
        if self.stepper.fly(&mut self.system, &self.drives, &self.turns, offset) {
            self.window.add(&self.system, (&self.compiled.patches, &self.compiled.linings), offset);
            self.communication.done = last;
        }
    }

    fn advance(&mut self) -> Result<StepProgress> {
        if self.phase != SimulationPhase::Stepping {
            let problem = "no communication step is in progress";
            return Err(Error::invalid("doStep", problem, "Begin a communication step first"));
        }
        self.allow_steps()?;
        if self.partial && self.communication.done > 0 && self.communication.most > 0 {
            // The mark includes the inputs set meanwhile.
            self.set_mark();
        }
        let next = self.communication.done + 1;
        let (offset, time) = (self.communication.offset(next), self.communication.time(next));
        let before = self.communication.offset(self.communication.done);
        if self.is_marched() {
            let start = self.communication.time(self.communication.done);
            for pair in 0..self.drives.len() {
                let middle = self.drive(pair, 0.5 * (before + offset), 0.5 * (start + time));
                self.system.set_middle(pair, &middle, self.growth(pair, [before, offset], [start, time]));
            }
        }
        self.find_drives(offset, time);
        self.load(before);
        if self.is_marched() {
            self.stepper.begin_loads(&mut self.system);
            self.load(offset);
        }
        match self.stepper.step(&mut self.system, &self.drives) {
            Ok(()) => {}
            Err(StepFailure::Exhausted) => return Err(self.abandon_step()),
            Err(failure) => return Err(self.fail(failure, time)),
        }
        let places = (&self.compiled.patches[..], &self.compiled.linings[..]);
        self.window.add(&self.system, places, self.system.step_size());
        self.communication.done = next;
        let finished = next == self.communication.count;
        if finished {
            self.finish(offset, time)?;
        }
        Ok(StepProgress { time, finished })
    }

    fn is_stepping(&self) -> bool {
        self.phase == SimulationPhase::Stepping
    }

    fn end_step_early(&mut self) -> Result<()> {
        if self.phase != SimulationPhase::Stepping || self.communication.done == 0 {
            let problem = "no internal step has been completed";
            return Err(Error::invalid("early return", problem, "Return early only after an internal step"));
        }
        self.tangent.forget();
        let done = self.communication.done;
        let (offset, time) = (self.communication.offset(done), self.communication.time(done));
        self.communication = Communication { length: offset, count: done, ..self.communication };
        self.finish(offset, time)
    }

    fn update_outputs(&mut self) -> Result<()> {
        if self.phase != SimulationPhase::Stepping {
            return Ok(());
        }
        self.compute_outputs();
        self.check_outputs(self.communication.time(self.communication.done))
    }

    fn state_size(&self) -> usize {
        self.state_size
    }

    fn save_state(&self, buffer: &mut [u8]) -> Result<()> {
        self.save_to(buffer)
    }

    fn restore_state(&mut self, buffer: &[u8]) -> Result<()> {
        self.restore_checked(buffer)
    }

    fn no_derivatives(&self) -> Option<&'static str> {
        if self.is_differentiated() {
            return None;
        }
        Some(if self.table().find("step_derivatives").is_some() {
            "this FMU has no instantaneous derivatives: outputs do not depend on inputs at the same instant. For \
             derivatives of outputs at the end of the last step with respect to inputs over that step, set the \
             parameter step_derivatives to on (2) before initialisation"
        } else {
            "this FMU has no derivatives because it has no inputs that move or load a structure. Add such inputs to \
             the scene (whirl, moving, thermal), or do not request derivatives"
        })
    }

    fn step_derivative(
        &mut self,
        outputs: &[u32],
        inputs: &[u32],
        seed: &[f64],
        sensitivity: &mut [f64],
    ) -> Result<()> {
        self.differentiate_step(outputs, inputs, seed, sensitivity)
    }
}

impl Simulation {
    /// Changes an input. Within a communication step the input turns towards its new target immediately. The target must be allowed at the
    /// end of the step, and the internal step must be able to follow; nothing is changed otherwise.
    fn change_input(&mut self, reference: u32, change: impl FnOnce(&mut Input)) -> Result<()> {
        let (variable, element) = self.values.table().locate(reference)?;
        let (quantity, of) = (variable.quantity, variable.of);
        let (stepping, at_once) = (self.phase == SimulationPhase::Stepping, self.acts_at_once(quantity));
        if stepping {
            self.tangent.forget();
        }
        let Some(mut input) = self.inputs.get(quantity, of, element).copied() else { return Ok(()) };
        let (offset, length) = (self.offset_now(), self.communication.length);
        change(&mut input);
        if stepping {
            self.check_course(variable, element, &input, at_once, [offset, length])?;
        }
        if at_once || self.phase == SimulationPhase::Created {
            input.take();
        } else if stepping {
            input.aim(offset, self.inputs.until);
        }
        if stepping {
            self.check_motion(quantity, of, &input)?;
        }
        if quantity == Quantity::Speed {
            self.rotors[of].rebase(&self.inputs.rotors[of].speed, offset);
        }
        if let Some(place) = self.inputs.get_mut(quantity, of, element) {
            *place = input;
        }
        if stepping && quantity == Quantity::Speed {
            let (until, hold) = (self.inputs.until, self.holds());
            self.inputs.rotors[of].lead_spin(offset, until, hold);
        }
        Ok(())
    }

    /// Checks that the current internal step can follow a new course of the speed or of the rotation of the shape.
    fn check_motion(&self, quantity: Quantity, of: usize, input: &Input) -> Result<()> {
        let (step, length) = (self.system.step_size(), self.communication.length);
        match quantity {
            Quantity::Speed => {
                for (pair, _) in self.compiled.plan.pairs_of(of) {
                    let rotation = self.inputs.pairs[pair].shape_rotation.rate();
                    self.check_turning(pair, step, length, input, rotation)?;
                }
                [0.0, length].into_iter().try_for_each(|offset| self.compiled.check_speed(of, input.at(offset)))
            }
            Quantity::ShapeRotation => {
                let body = self.compiled.plan.pairs[of].body;
                self.check_turning(of, step, length, &self.inputs.rotors[body].speed, input.rate())
            }
            _ => Ok(()),
        }
    }
}
