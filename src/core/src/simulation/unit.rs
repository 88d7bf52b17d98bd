//! The simulation as a co-simulation unit.

use tiprub_cosim::persist::{Persist, StateReader, StateWriter, check_length, fingerprint, to_bytes};
use tiprub_cosim::variables::{Causality, Quantity, Value};
use tiprub_cosim::{CoSimulation, StepProgress, VariableValues, bounds};

use super::Simulation;
use super::clock::{Clock, Communication, SimulationPhase};
use super::drive::{Input, RotorAngle};
use super::state::CHECKSUM_BYTES;
use crate::system::StepFailure;
use crate::{Error, Result, Warning};

impl CoSimulation for Simulation {
    fn variables(&self) -> &VariableValues {
        &self.state.values
    }

    fn is_initialised(&self) -> bool {
        !self.state.clock.is_created()
    }

    fn set(&mut self, reference: u32, value: Value) -> Result<()> {
        let (variable, _) = self.check(reference, value)?;
        // Adding 0 turns −0 into 0, so replacing 0 by −0 does not count as a change.
        let value = if let Value::Real(value) = value { Value::Real(value + 0.0) } else { value };
        let changes = value.number().to_bits() != self.state.values[reference as usize].to_bits();
        if variable.quantity == Quantity::Friction && self.is_initialised() && changes {
            let before = std::mem::replace(&mut self.state.values[reference as usize], value.number());
            let parameters = self.parameters();
            let outcome = self.check_limits(&parameters);
            self.state.values[reference as usize] = before;
            outcome?;
            self.warn_of_friction(&parameters);
            if self.system.steady_phase.active {
                self.end_open_steps()?;
            }
            self.tangent.follow_anew();
            self.apply_friction(&parameters);
        }
        if let Value::Real(value) = value {
            let offset = self.state.clock.offset_now();
            self.change_input(reference, |input| input.request(value, offset))?;
        }
        self.state.values[reference as usize] = value.number();
        if let Value::Integer(_) = value {
            // A new bound on the number of steps applies from the next communication step on.
            self.make_room();
        }
        Ok(())
    }

    fn set_input_derivative(&mut self, reference: u32, order: i32, value: f64) -> Result<()> {
        self.check_input_derivative(reference, order, value)?;
        let offset = self.state.clock.offset_now();
        self.change_input(reference, |input| input.request_slope(value, offset))
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
        to_bytes(&[&self.state.inputs])
    }

    fn restore_courses(&mut self, courses: &[u8]) {
        self.state.inputs.restore(&mut StateReader::new(courses));
    }

    fn initialise(&mut self, start_time: f64) -> Result<()> {
        bounds::at_most("start time", start_time, bounds::TIME)?;
        let parameters = self.parameters();
        // After an error the instance must be initialised again.
        self.state.clock.phase = SimulationPhase::Created;
        self.diagnostics.clear();
        self.compiled.scene.check_methods(parameters.scheme, parameters.solver)?;
        self.check_slips()?;
        self.follow_load_orders()?;
        self.check_launch(parameters.scheme)?;
        self.follow_reference_speeds(&self.state.inputs.references())?;
        let findings = self.check_limits(&parameters)?;
        self.diagnostics.warnings = findings.iter().map(|finding| self.compiled.warning(finding)).collect();
        self.warn_of_fast_rotation();
        self.warn_of_sticking(&parameters);
        self.warn_of_tolerance(&parameters);
        self.begin_telling(&parameters, &findings);
        let settings = &self.compiled.scene.settings;
        self.diagnostics.warnings.retain(|warning| !settings.is_silenced(warning.topic()));
        self.rest(&parameters);
        self.apply_methods(&parameters);
        self.use_threads()?;
        self.make_room();
        self.make_room_for_tangent();
        self.state.clock = Clock::at(start_time);
        for (body, rotor) in self.state.inputs.rotors.iter_mut().enumerate() {
            rotor.angle = RotorAngle::new(self.state.values.value_of(Quantity::InitialAngle, body));
        }
        self.motions.find(&self.state, &self.compiled, [0.0, start_time]);
        self.stepper.set_first_step(&mut self.system, parameters.step);
        self.state.inputs.start();
        self.settle();
        self.launch();
        self.system.start(&self.motions.drives);
        self.prepare_steady_phase();
        self.check_initial_state()?;
        self.check_initial_gaps()?;
        self.state.window.open(self.system.structures());
        self.compute_outputs();
        for (initial, energy) in self.state.initial_energies.iter_mut().zip(&self.outputs.energies) {
            *initial = energy.now;
        }
        self.check_outputs(start_time)?;
        self.state.clock.phase = SimulationPhase::Ready;
        self.state.previous.copy_from_slice(&self.state.values);
        Ok(())
    }

    fn reset(&mut self) {
        self.state.values.reset();
        self.state.previous.fill(0.0);
        self.state.inputs.clear();
        for variable in self.state.values.table().variables().iter().filter(|variable| variable.is_settable()) {
            for element in 0..variable.len() {
                if let Some(input) = self.state.inputs.get_mut(variable.quantity, variable.of, element) {
                    input.request(self.state.values[variable.reference as usize + element], 0.0);
                    input.act_immediately();
                }
            }
        }
        self.system.structures_mut().iter_mut().for_each(|structure| structure.modes_mut().rest());
        self.state.clock = Clock::default();
        self.diagnostics.clear();
        self.tangent.renew();
        self.end_threads();
    }

    fn terminate(&mut self) {
        self.end_threads();
    }

    fn time(&self) -> f64 {
        self.state.clock.time
    }

    fn warnings(&self) -> &[Warning] {
        &self.diagnostics.warnings
    }

    fn take_notes(&mut self) -> Vec<Warning> {
        std::mem::take(&mut self.diagnostics.notes)
    }

    fn begin_step(&mut self, current_time: f64, step_size: f64) -> Result<()> {
        self.begin(current_time, step_size, false)
    }

    fn begin_partial_step(&mut self, current_time: f64, step_size: f64) -> Result<()> {
        self.begin(current_time, step_size, true)
    }

    /// Does nothing unless sectors take adaptive steps, inputs rest, and no contact can close.
    fn fly_ahead(&mut self) {
        let last = self.state.clock.step.count.saturating_sub(1);
        if self.stepper.supports_steady_phase()
            || !self.is_stepping()
            || !self.is_marched()
            || self.state.clock.step.done > 0
            || last < 2
        {
            return;
        }
        let point = self.state.clock.step.point(last);
        for pair in 0..self.motions.turns.len() {
            let growth = self.state.growth(&self.compiled, pair, [self.state.clock.step.point(0), point]);
            if growth.elapsed[0] < growth.length {
                return;
            }
            self.motions.turns[pair] = self.state.turn(&self.compiled, pair, point[0]);
        }
        self.motions.find(&self.state, &self.compiled, point);
        let offset = point[0];
        if self.stepper.fly(&mut self.system, &self.motions.drives, &self.motions.turns, offset) {
            self.state.window.add(&self.system, (&self.compiled.patches, &self.compiled.linings), offset);
            self.state.clock.step.done = last;
        }
    }

    fn advance(&mut self) -> Result<StepProgress> {
        if !self.is_in_step() {
            let problem = "no communication step is in progress";
            return Err(Error::invalid("doStep", problem, "Begin a communication step first"));
        }
        self.allow_steps()?;
        if self.state.clock.step.partial && self.state.clock.step.done > 0 && self.state.clock.step.most > 0 {
            // The mark includes the inputs set meanwhile.
            self.set_mark();
        }
        let (next, interval) = self.next_point()?;
        let (from, to) = (self.state.clock.step.reached(), self.state.clock.step.point(next));
        let ([before, _], [offset, time]) = (from, to);
        if self.is_marched() && interval.is_none() {
            let middle = [0, 1].map(|i| 0.5 * (from[i] + to[i]));
            for pair in 0..self.motions.drives.len() {
                let middle = self.state.drive(&self.compiled, pair, middle);
                self.system.set_middle(pair, &middle, self.state.growth(&self.compiled, pair, [from, to]));
            }
        }
        self.motions.find(&self.state, &self.compiled, to);
        self.load(before);
        if self.is_marched() {
            self.stepper.begin_loads(&mut self.system);
            self.load(offset);
        }
        let outcome = match interval {
            Some(interval) => self.stepper.step_in_steady_phase(&mut self.system, &self.motions.drives, interval),
            None => self.stepper.step(&mut self.system, &self.motions.drives),
        };
        match outcome {
            Ok(()) => {}
            Err(StepFailure::Exhausted) => return Err(self.abandon_step()),
            Err(failure) => return Err(self.fail(failure, time)),
        }
        let places = (&self.compiled.patches[..], &self.compiled.linings[..]);
        let length = interval.map_or_else(|| self.system.step_size(), |interval| interval.to - interval.from);
        self.state.window.add(&self.system, places, length);
        self.state.clock.step.done = next;
        let finished = next == self.state.clock.step.count;
        if finished {
            self.finish(offset, time)?;
        }
        Ok(StepProgress { time, finished })
    }

    fn is_stepping(&self) -> bool {
        self.state.clock.is_stepping()
    }

    fn end_step_early(&mut self) -> Result<()> {
        if !self.is_in_step() || self.state.clock.step.done == 0 {
            let problem = "no internal step has been completed";
            return Err(Error::invalid("early return", problem, "Return early only after an internal step"));
        }
        self.tangent.forget();
        let step = &mut self.state.clock.step;
        let [offset, time] = step.reached();
        *step = Communication { length: offset, count: step.done, ..*step };
        self.finish(offset, time)
    }

    fn update_outputs(&mut self) -> Result<()> {
        if !self.is_in_step() {
            return Ok(());
        }
        self.compute_outputs();
        self.check_outputs(self.state.clock.step.time(self.state.clock.step.done))
    }

    fn state_size(&self) -> usize {
        self.state_size
    }

    fn save_state(&self, buffer: &mut [u8]) -> Result<()> {
        check_length(buffer.len(), self.state_size, "this scene")?;
        let (content, checksum) = buffer.split_at_mut(buffer.len() - CHECKSUM_BYTES);
        self.write(&mut StateWriter::new(content));
        checksum.copy_from_slice(&fingerprint(content, 0).to_le_bytes());
        Ok(())
    }

    fn restore_state(&mut self, buffer: &[u8]) -> Result<()> {
        self.restore_checked(buffer)?;
        if self.is_initialised() {
            // Results do not depend on threads, so the run continues without them.
            return self.use_threads().or(Ok(()));
        }
        self.end_threads();
        Ok(())
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
        let (variable, element) = self.state.values.table().locate(reference)?;
        let (quantity, of) = (variable.quantity, variable.of);
        let (stepping, at_once) = (self.is_in_step(), self.acts_at_once(quantity));
        let Some(mut input) = self.state.inputs.get(quantity, of, element).copied() else { return Ok(()) };
        let (offset, length) = (self.state.clock.offset_now(), self.state.clock.step.length);
        let (rests, value) = (input.rests_from(offset), input.value);
        change(&mut input);
        if rests && input.slope == 0.0 && input.value.to_bits() == value.to_bits() {
            return Ok(());
        }
        if stepping {
            self.tangent.forget();
            self.check_course(variable, element, &input, at_once, [offset, length])?;
        }
        if at_once || self.state.clock.is_created() {
            input.act_immediately();
        } else if stepping {
            input.ramp(offset, self.state.inputs.until);
        }
        if stepping {
            self.check_motion(quantity, of, &input)?;
        }
        if quantity == Quantity::Speed {
            let rotor = &mut self.state.inputs.rotors[of];
            rotor.angle.rebase(&rotor.speed, offset);
        }
        if let Some(place) = self.state.inputs.get_mut(quantity, of, element) {
            *place = input;
        }
        if stepping && quantity == Quantity::Speed {
            let (until, hold) = (self.state.inputs.until, self.holds());
            self.state.inputs.rotors[of].lead_spin(offset, until, hold);
        }
        Ok(())
    }

    /// Checks that the current internal step can follow a new course of the speed or of the rotation of the shape.
    fn check_motion(&self, quantity: Quantity, of: usize, input: &Input) -> Result<()> {
        let (step, length) = (self.system.step_size(), self.state.clock.step.length);
        match quantity {
            Quantity::Speed => {
                for (pair, _) in self.compiled.plan.pairs_of(of) {
                    let rotation = self.state.inputs.pairs[pair].shape_rotation.rate();
                    self.check_turning(pair, step, length, input, rotation)?;
                }
                [0.0, length].into_iter().try_for_each(|offset| self.compiled.check_speed(of, input.at(offset)))
            }
            Quantity::ShapeRotation => {
                let body = self.compiled.plan.pairs[of].body;
                self.check_turning(of, step, length, &self.state.inputs.rotors[body].speed, input.rate())
            }
            _ => Ok(()),
        }
    }
}
