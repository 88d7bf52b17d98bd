//! One communication step: begin, internal steps, end.

use tiprub_cosim::shown_time;
use tiprub_cosim::warning::Topic;

use super::Simulation;
use super::clock::{Communication, SimulationPhase, same_step};
use super::drive::Input;
use crate::contact::coating::Coating;
use crate::limits::finding::Subject;
use crate::system::small::CURVED_SHARE;
use crate::{Error, Result, Warning};

impl Simulation {
    pub(super) fn begin(&mut self, current_time: f64, step_size: f64, partial: bool) -> Result<()> {
        let limit = self.state.values[self.compiled.references.step_max];
        self.state.clock.check_ready()?;
        self.state.clock.check_step(current_time, step_size, limit)?;
        self.check_courses(step_size)?;
        let ratio = step_size / limit;
        let same = same_step(current_time, step_size);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "1 ≤ value ≤ 1e9")]
        let count = (ratio * (1.0 - same)).ceil().max(1.0) as u64;
        #[expect(clippy::cast_precision_loss, reason = "count ≤ 1e9")]
        let step = step_size / count as f64;
        let keeps = (step - self.system.step_size()).abs() <= same * step;
        let step = if keeps { self.system.step_size() } else { step };
        let hold = self.holds();
        self.check_motions(step, step_size)?;
        let most = self.max_internal_steps();
        if !partial && !self.is_marched() && most > 0 && count > most {
            return Err(self.exhausted(step_size, most));
        }
        if most > 0 {
            self.set_mark();
        }
        // No errors from here on.
        self.set_out_tangent();
        if !keeps {
            self.stepper.set_step(&mut self.system, step);
            if self.system.steps() == 0 {
                // Increments of the first step are the velocity times its length.
                self.launch();
            }
        }
        self.state.inputs.begin(step_size, hold);
        for body in (0..self.state.inputs.rotors.len()).filter(|body| hold && self.compiled.varies(*body)) {
            let rotor = &self.state.inputs.rotors[body];
            let speed = 0.5 * (rotor.speed.at(0.0) + rotor.speed.at(step_size));
            self.system.set_speed(body, speed, 0.5 * (rotor.temperature_at(0.0) + rotor.temperature_at(step_size)));
        }
        self.warn_of_step_and_speeds(step, step_size);
        self.state.previous.copy_from_slice(&self.state.values);
        let tried = self.system.steps_tried();
        let step = Communication { start: current_time, length: step_size, count, done: 0, tried, most, partial };
        self.state.clock.begin(step);
        self.state.window.open(self.system.structures());
        Ok(())
    }

    /// Checks that an internal step can follow the speeds and rotations of shapes over a communication step of length `step_size`.
    fn check_motions(&self, step: f64, step_size: f64) -> Result<()> {
        for (index, pair) in self.compiled.plan.pairs.iter().enumerate() {
            let mut rotation = self.state.inputs.pairs[index].shape_rotation;
            if !self.holds() {
                rotation.ramp(0.0, self.state.inputs.extrapolation_time(step_size));
            }
            let speed = &self.state.inputs.rotors[pair.body].speed;
            self.check_turning(index, step, step_size, speed, rotation.rate())?;
        }
        let now = |error: Error| error.at_time(self.state.clock.time);
        for (body, rotor) in self.state.inputs.rotors.iter().enumerate() {
            let (first, last) = (rotor.speed.at(0.0), rotor.speed.at(step_size));
            let reached = rotor.temperature_at(0.0);
            let until = rotor.temperature.first().map_or(0.0, |input| input.requested_value(step_size));
            if self.compiled.softens(body) {
                self.compiled.check_temperature(body, until).map_err(now)?;
            }
            let fastest = if first.abs() > last.abs() { first } else { last };
            if fastest.abs() > self.diagnostics.reported.fastest[body] {
                self.compiled.check_tip_speed(body, fastest).map_err(now)?;
            }
            self.check_step_size(body, step, [first, last, rotor.spin.at(0.0)], reached.min(until)).map_err(now)?;
            let phase = rotor.excitation.get(1).map_or(0.0, |phase| {
                let mut phase = *phase;
                if !self.holds() {
                    phase.ramp(0.0, self.state.inputs.extrapolation_time(step_size));
                }
                phase.rate()
            });
            self.check_excitation(body, step, [first, last], phase)?;
            if self.compiled.spins(body) {
                self.compiled.check_speed(body, fastest).map_err(now)?;
            }
        }
        Ok(())
    }

    /// Checks that the rotor does not skip features of the casing shape or cells of the coating. Inputs are linear in time, so the ends
    /// decide.
    pub(super) fn check_turning(
        &self,
        pair: usize,
        step: f64,
        step_size: f64,
        speed: &Input,
        rotation: f64,
    ) -> Result<()> {
        let scale = self.system.pairs()[pair].gap().angular_scale();
        let stride = self.system.coating(pair).map(Coating::stride);
        let relative = |offset: f64| (speed.at(offset) - rotation).abs();
        let turned = step * relative(0.0).max(relative(step_size));
        // The coating does not turn with the shape.
        let passed = step * speed.at(0.0).abs().max(speed.at(step_size).abs());
        if let Some(stride) = stride.filter(|stride| passed > *stride) {
            return Err(Error::invalid(
                format!("contact[{}].coating.cells_around", pair + 1),
                format!(
                    "the rotor turns {passed:.3e} rad in one internal step of {step:.3e} s at t = {} s, more than the \
                     width of its tips or coating cells, {stride:.3e} rad: the cells in between would not wear",
                    shown_time(self.state.clock.time)
                ),
                "Use fewer cells around the circumference, a lower speed or a smaller internal_step_max (time.step)",
            ));
        }
        if turned <= scale {
            return Ok(());
        }
        let (scene, plan) = (&self.compiled.scene, &self.compiled.plan);
        let (what, remedy) = if rotation != 0.0 && passed <= scale {
            let prefix = plan.pair_prefix(&scene.settings, pair);
            (format!("variable `{prefix}casing_shape_rotation`"), "Rotate the shape more slowly, or use")
        } else {
            let prefix = plan.body_prefix(scene, plan.pairs[pair].body);
            (format!("variable `{prefix}speed`"), "Use a lower speed or")
        };
        Err(Error::invalid(
            what,
            format!(
                "the rotor turns {turned:.3e} rad relative to the casing shape in one internal step of {step:.3e} s at t = {} s, and skips features \
                 of the casing shape that are {scale:.3e} rad wide",
                shown_time(self.state.clock.time)
            ),
            format!("{remedy} an internal_step_max (time.step) below {:.3e} s", step * scale / turned),
        ))
    }

    /// Applies loads other than contact, and stiffening, for the step that begins at `offset`: q⁺ = a q + b q⁻ + c f uses the force at the
    /// time of q.
    pub(super) fn load(&mut self, offset: f64) {
        let hold = self.holds();
        let (scheme, step) = (self.system.settings.scheme, self.system.step_size());
        for body in 0..self.compiled.bodies.len() {
            let rotor = &self.state.inputs.rotors[body];
            let (speed, temperature) = (rotor.spin.at(offset), rotor.temperature_at(offset));
            if !hold && self.compiled.varies(body) {
                self.system.set_speed(body, speed, temperature);
            }
            if self.compiled.loads_blades(body) {
                let modes = self.system.structures_mut()[body].modes_mut();
                self.compiled.fill_loads(body, speed, temperature, modes.loads_mut());
                modes.expand(temperature);
            }
            if let Some([amplitude, phase]) = self.excitation_at(body, offset) {
                let factor = scheme.harmonic_factor(step * self.excitation_rate(body, offset));
                self.system.structures_mut()[body].modes_mut().excite(factor * amplitude, phase);
            }
        }
        let carriers = self.system.structures_mut().iter_mut().skip(self.compiled.bodies.len());
        for ((carrier, inputs), structure) in
            self.compiled.carriers.iter().zip(&self.state.inputs.carriers).zip(carriers)
        {
            if carrier.loads.are_there() {
                carrier.loads.fill(inputs, offset, structure.modes_mut().loads_mut());
            }
        }
    }

    pub(super) fn finish(&mut self, offset: f64, time: f64) -> Result<()> {
        if let Err(failure) = self.system.check_state() {
            return Err(self.fail(failure, time));
        }
        if let Err(failure) = self.system.check_ledger() {
            return Err(self.fail(failure, time));
        }
        self.check_pulling(time)?;
        self.note_curved(time);
        self.note_curvature(time);
        self.note_missed(time);
        self.state.clock.most_tried =
            self.state.clock.most_tried.max(self.system.steps_tried() - self.state.clock.step.tried);
        if !self.system.steady_phase.active {
            self.state.inputs.rotors.iter_mut().for_each(|rotor| rotor.angle.rebase(&rotor.speed, offset));
        }
        self.compute_outputs();
        self.check_outputs(time).inspect_err(|_| self.state.clock.phase = SimulationPhase::Failed)?;
        self.check_energy(time)?;
        self.state.inputs.shift(offset);
        if self.system.steady_phase.active {
            self.correct_angle_times(time);
        }
        self.state.clock.finish(time);
        Ok(())
    }

    /// Warns of the first displacement of each structure that is too large for linear kinematics.
    fn note_curved(&mut self, time: f64) {
        for body in 0..self.state.inputs.rotors.len() {
            let Some(most) = self.system.most_curved_of(body).filter(|most| most.share() >= CURVED_SHARE) else {
                continue;
            };
            if !self.diagnostics.reported.is_first(Topic::LargeDisplacement, Subject::Body(body)) {
                continue;
            }
            let problem = format!(
                "at t = {} s, contact node {} of {} is displaced by {:.3e} m around the axis: gaps are linear in \
                 displacements, which neglects u²/2r = {:.2e} m, {:.0} % of the clearance",
                shown_time(time),
                self.compiled.node_name(most.structure, most.node),
                self.sector_name(most.structure, most.sector),
                most.moved,
                most.error,
                100.0 * most.share()
            );
            let remedy = "Check loads and clearance; the error grows with the square of the displacement, and the run ends at \
                 100 %";
            self.note(Warning::new(Topic::LargeDisplacement, problem, remedy));
        }
    }
}
