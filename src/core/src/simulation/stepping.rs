//! One communication step: begun, marched, ended.

use super::checks::{OUT_OF_REACH, OUT_OF_REACH_REMEDY};
use super::drive::Input;
use super::{Communication, MOST_STEPS, Phase, Progress, Simulation, TIME_TOLERANCE, same_step};
use crate::contact::coating::Coating;
use crate::settings::Scheme;
use crate::system::StepFailure;
use crate::{Error, Result, ranges, shown};

/// A run is warned of once u_θ²/2r is this share of the clearance.
const CURVED_SHARE: f64 = 0.05;
/// Energy of the instant may be so many times what was put in: that of modal-exact is cos²(ωh/2) of it, a fourth at ωh = 2π/3, the end of
/// what a step resolves; that of central differences at least 1 − (ωh/2)². What is beyond is in modes that the step passes over.
const ENERGY_FACTOR: f64 = 4.0;
/// And a share of all work exchanged, for rounding.
const ENERGY_SLACK: f64 = 0.01;

impl Simulation {
    /// Begin a communication step of length H from the current time, landing exactly on `current_time + step_size`.
    ///
    /// # Errors
    /// Step size not positive and finite, or `current_time` further than 1e-3·H from [`Simulation::time`].
    pub fn begin_step(&mut self, current_time: f64, step_size: f64) -> Result<()> {
        match self.phase {
            Phase::Ready => {}
            Phase::Failed => return Err(failed_before()),
            Phase::Created | Phase::Stepping => {
                return Err(Error::invalid(
                    "doStep",
                    "called outside a communication point",
                    "Initialise the instance first",
                ));
            }
        }
        self.check_step(current_time, step_size)?;
        self.check_courses(step_size)?;
        let limit = self.values[self.compiled.references.step_max];
        let ratio = step_size / limit;
        let same = same_step(current_time, step_size);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "1 ≤ value ≤ 1e9")]
        let count = (ratio * (1.0 - same)).ceil().max(1.0) as u64;
        #[expect(clippy::cast_precision_loss, reason = "count ≤ 1e9")]
        let step = step_size / count as f64;
        let keeps = (step - self.system.bank().step()).abs() <= same * step;
        let step = if keeps { self.system.bank().step() } else { step };
        let hold = self.holds();
        let mut rotation = self.inputs.shape_rotation;
        if !hold {
            rotation.aim(0.0, self.inputs.reach(step_size));
        }
        self.check_turning(step, step_size, &self.inputs.speed, rotation.rate())?;
        let (first, last) = (self.inputs.speed.at(0.0), self.inputs.speed.at(step_size));
        self.check_step_size(step, [first, last, self.inputs.spin.at(0.0)])?;
        if self.compiled.spins() {
            self.compiled.check_speed(if first.abs() > last.abs() { first } else { last })?;
        }
        // Nothing is refused from here on.
        if !keeps {
            self.system.set_step(step);
            if self.system.steps() == 0 {
                // Increments of the first step are the velocity times its length.
                self.launch();
            }
        }
        self.inputs.begin(step_size, hold);
        if self.compiled.spins() && hold {
            self.system.set_speed(0.5 * (first + last));
        }
        self.tell(step, [first, last]);
        self.previous.copy_from_slice(&self.values);
        self.previous_length = self.communication.length;
        self.communication = Communication { start: current_time, length: step_size, count, done: 0 };
        self.window.open(self.system.gaps());
        self.phase = Phase::Stepping;
        Ok(())
    }

    fn check_step(&self, current_time: f64, step_size: f64) -> Result<()> {
        if !(step_size.is_finite() && step_size > 0.0) {
            return Err(Error::invalid(
                "communicationStepSize",
                format!("{} s at t = {} s", shown(step_size), shown(self.time)),
                "Give a finite communication step > 0",
            ));
        }
        if !current_time.is_finite() || (current_time - self.time).abs() > TIME_TOLERANCE * step_size {
            return Err(Error::invalid(
                "currentCommunicationPoint",
                format!("{} s, but this instance is at t = {} s", shown(current_time), shown(self.time)),
                "Continue from the end of the last step, or restore a saved state",
            ));
        }
        if step_size < ranges::SHORTEST_STEP {
            return Err(Error::invalid(
                "communicationStepSize",
                format!(
                    "{} s at t = {} s is below {} s, where rounding of positions is taken for motion",
                    shown(step_size),
                    shown(self.time),
                    shown(ranges::SHORTEST_STEP)
                ),
                "Give a longer communication step; leave out what rounding leaves of a sum of steps",
            ));
        }
        // What rounding of the time leaves of the step.
        let rounded = (current_time + step_size) - current_time;
        if (rounded - step_size).abs() > TIME_TOLERANCE * step_size {
            return Err(Error::invalid(
                "communicationStepSize",
                format!(
                    "{} s does not change the time {} s by as much in double precision",
                    shown(step_size),
                    shown(current_time)
                ),
                "Use a longer communication step or a start time closer to 0",
            ));
        }
        let ratio = step_size / self.values[self.compiled.references.step_max];
        if ratio > MOST_STEPS {
            return Err(Error::invalid(
                "communicationStepSize",
                format!("{} s would need {ratio:.3e} internal steps", shown(step_size)),
                "Use a shorter communication step or a larger internal_step_max",
            ));
        }
        Ok(())
    }

    /// The rotor must not skip over features of the casing shape or cells of the coating. Inputs are linear in time: the ends decide.
    pub(super) fn check_turning(&self, step: f64, step_size: f64, speed: &Input, rotation: f64) -> Result<()> {
        let (scale, cell) = (self.system.law().angular_scale(), self.system.coating().map(Coating::width));
        let relative = |offset: f64| (speed.at(offset) - rotation).abs();
        let turned = step * relative(0.0).max(relative(step_size));
        // The coating does not turn with the shape.
        let passed = step * speed.at(0.0).abs().max(speed.at(step_size).abs());
        if let Some(cell) = cell.filter(|cell| passed > *cell) {
            return Err(Error::invalid(
                "contact.coating.cells_around",
                format!(
                    "the rotor turns {passed:.3e} rad in one internal step of {step:.3e} s at t = {} s, past cells of the \
                     coating {cell:.3e} rad wide, which would stay unworn",
                    shown(self.time)
                ),
                "Use fewer cells around, a lower speed or a smaller internal_step_max",
            ));
        }
        if turned <= scale {
            return Ok(());
        }
        let (what, remedy) = if rotation != 0.0 && passed <= scale {
            ("variable `casing_shape_rotation`", "Turn the shape more slowly, or use a smaller internal_step_max")
        } else {
            ("variable `speed`", "Use a lower speed or a smaller internal_step_max")
        };
        Err(Error::invalid(
            what,
            format!(
                "the rotor turns {turned:.3e} rad in one internal step of {step:.3e} s at t = {} s, past features of the casing \
                 shape {scale:.3e} rad wide",
                shown(self.time)
            ),
            remedy,
        ))
    }

    /// March one internal step of the communication step begun. Inputs may be set between calls.
    ///
    /// # Errors
    /// Non-finite state; the simulation must then be reset or restored.
    pub fn advance(&mut self) -> Result<Progress> {
        if self.phase != Phase::Stepping {
            return Err(Error::invalid("doStep", "no communication step is under way", "Begin a step first"));
        }
        let next = self.communication.done + 1;
        let (offset, time) = (self.communication.offset(next), self.communication.time(next));
        let drive = self.drive(offset, time);
        let before = self.communication.offset(self.communication.done);
        self.load(before);
        if self.compiled.spins() && !self.holds() {
            self.system.set_speed(self.inputs.spin.at(before));
        }
        if let Err(failure) = self.system.step(&drive) {
            return Err(self.fail(failure, time));
        }
        self.window.add(&self.system, self.compiled.patches.as_ref(), self.system.bank().step());
        self.communication.done = next;
        let finished = next == self.communication.count;
        if finished {
            self.finish(offset, time)?;
        }
        Ok(Progress { time, finished })
    }

    /// Loads beside contact for the step that begins at `offset`: q⁺ = a q + b q⁻ + c f takes the force at the time of q.
    fn load(&mut self, offset: f64) {
        let (loads, speed) = (&self.compiled.loads, self.inputs.spin.at(offset));
        if !loads.centrifugal.is_empty() {
            loads.fill_master(speed, self.system.bank_mut().loads_mut());
        }
        if let (true, [slave, ..]) = (loads.on_slave(), self.system.slaves_mut()) {
            loads.fill_slave(&self.inputs, offset, slave.bank.loads_mut());
        }
    }

    fn finish(&mut self, offset: f64, time: f64) -> Result<()> {
        if let Err(failure) = self.system.check_state() {
            return Err(self.fail(failure, time));
        }
        if let Err(failure) = self.system.check_books() {
            return Err(self.fail(failure, time));
        }
        self.note_curved(time);
        self.rotor.rebase(&self.inputs.speed, offset);
        self.update_outputs();
        self.check_outputs(time).inspect_err(|_| self.phase = Phase::Failed)?;
        self.check_energy(time)?;
        self.rotor.shift(offset);
        self.inputs.shift(offset);
        self.time = time;
        self.phase = Phase::Ready;
        Ok(())
    }

    /// Tell of the first displacement of the run that linear kinematics describes badly.
    fn note_curved(&mut self, time: f64) {
        if self.told.curved {
            return;
        }
        let Some(most) = self.system.most_curved().filter(|most| most.share() >= CURVED_SHARE) else { return };
        self.told.curved = true;
        self.notes.push(format!(
            "at t = {} s contact node {} of sector {} is displaced by {:.3e} m around the axis: gaps are linear in displacements, which \
             misses u²/2r = {:.2e} m, {:.0} % of the clearance; further on it grows with the square, and at 100 % the run ends",
            shown(time),
            self.node_name(most.node),
            most.sector + 1,
            most.moved,
            most.error,
            100.0 * most.share()
        ));
    }

    /// Vibration has no more energy than forces times speeds put in: what the scheme conserves leaves out what modes beyond the step
    /// hold. With massless-boundary quasi-static modes hold energy one step before its work is known; its own limit keeps it.
    fn check_energy(&mut self, time: f64) -> Result<()> {
        let (settings, ledger) = (self.system.settings(), self.system.ledger());
        let supplied = ledger.supplied().max(self.conserved - ledger.initial).max(0.0);
        let factor = match settings.scheme {
            Scheme::CentralDifference => {
                1.0 / (1.0 - self.compiled.largest_product(self.system.bank().step()).powi(2) / 4.0)
            }
            _ => ENERGY_FACTOR,
        };
        let bound = factor.max(ENERGY_FACTOR) * (self.initial_energy + supplied) + ENERGY_SLACK * ledger.scale();
        if !settings.ledger || settings.scheme == Scheme::MasslessBoundary || self.energy <= bound {
            return Ok(());
        }
        self.phase = Phase::Failed;
        Err(Error::Unstable {
            problem: format!(
                "at t = {} s (last good time {} s) the structures hold {:.4e} J of kinetic and strain energy, where they had {:.4e} J \
                 at the start and work less friction and damping supplied {:.4e} J: modes that the internal step of {:.3e} s does not \
                 resolve have taken energy that is not there",
                shown(time),
                shown(self.time),
                self.energy,
                self.initial_energy,
                supplied,
                self.system.bank().step()
            ),
            remedy: "Use a smaller internal step (internal_step_max). Restore a saved state or reset first".to_owned(),
        })
    }

    fn fail(&mut self, failure: StepFailure, time: f64) -> Error {
        self.phase = Phase::Failed;
        if let StepFailure::Unbalanced { work, exchanged } = failure {
            return self.unbalanced(work, exchanged, time);
        }
        if let Some(error) = self.free_failure(failure, time) {
            return error;
        }
        match failure {
            StepFailure::NonFinite => Error::NonFinite {
                last_good_time: self.time,
                time,
                remedy: "Restore a saved state or reset, and use a smaller internal step or smaller loads".to_owned(),
            },
            StepFailure::Implausible { sector } => Error::Unstable {
                problem: format!(
                    "at t = {} s (last good time {} s) a contact node of sector {} is displaced by more than a tenth of \
                     its radius, is as deep inside the casing, or meets a flank of the casing shape steeper than 45°{}",
                    shown(time),
                    shown(self.time),
                    sector + 1,
                    self.instability()
                ),
                remedy:
                    "Check gap, casing shape, loads and inputs; small displacements cannot describe this. Restore a \
                         saved state or reset first"
                        .to_owned(),
            },
            StepFailure::Curved(curved) => Error::Unstable {
                problem: format!(
                    "at t = {} s (last good time {} s) contact node {} of sector {} is displaced by {:.3e} m around the axis: gaps are \
                     linear in displacements, which misses u²/2r = {:.2e} m, as much as the clearance of {:.2e} m{}",
                    shown(time),
                    shown(self.time),
                    self.node_name(curved.node),
                    curved.sector + 1,
                    curved.moved,
                    curved.error,
                    curved.clearance,
                    self.instability()
                ),
                remedy: "Check casing shape, friction, loads and inputs: small displacements cannot describe this. Restore a saved \
                         state or reset first"
                    .to_owned(),
            },
            StepFailure::OutOfReach { node, sector } => Error::Unstable {
                problem: format!(
                    "at t = {} s (last good time {} s) contact node {} of sector {} has left the surface of the casing in z: it is \
                     beyond the first or last ring by more than {}",
                    shown(time),
                    shown(self.time),
                    self.node_name(node),
                    sector + 1,
                    OUT_OF_REACH
                ),
                remedy: format!("{OUT_OF_REACH_REMEDY}. Restore a saved state or reset first"),
            },
            StepFailure::Unexplained { node, sector, jump, explained } => {
                self.unexplained(node, sector, jump, explained, time)
            }
            // Of free masters only, dealt with above.
            StepFailure::TooFast | StepFailure::BehindEdge { .. } | StepFailure::Unbalanced { .. } => Error::Unstable {
                problem: format!("a contact node moves too far in one internal step at t = {} s", shown(time)),
                remedy: "Use a smaller internal step; restore a saved state or reset first".to_owned(),
            },
            StepFailure::CasingImplausible => Error::Unstable {
                problem: format!(
                    "at t = {} s (last good time {} s) the casing is displaced by more than a tenth of the radius",
                    shown(time),
                    shown(self.time)
                ),
                remedy:
                    "Check its loads and temperatures; small displacements cannot describe this. Restore a saved state \
                         or reset first"
                        .to_owned(),
            },
            StepFailure::Unsolved { sector } => Error::Unstable {
                problem: format!(
                    "the contact problem of sector {} has no solution at t = {} s (last good time {} s)",
                    sector + 1,
                    shown(time),
                    shown(self.time)
                ),
                remedy: "Use less friction or another internal step; restore a saved state or reset first".to_owned(),
            },
        }
    }

    /// Energy that no input brings.
    fn unbalanced(&self, work: f64, exchanged: f64, time: f64) -> Error {
        Error::Unstable {
            problem: format!(
                "by t = {} s (last good time {} s) contact forces have added {work:.3e} J that no input brings, of {exchanged:.3e} J \
                 exchanged: normals turn and surfaces curve too far within an internal step (curvature work)",
                shown(time),
                shown(self.time)
            ),
            remedy: "Use a smaller internal step; restore a saved state or reset first".to_owned(),
        }
    }

    fn node_name(&self, node: usize) -> &str {
        &self.compiled.master().1.contact_nodes[node].name
    }

    fn unexplained(&self, node: usize, sector: usize, jump: f64, explained: f64, time: f64) -> Error {
        Error::Unstable {
            problem: format!(
                "at t = {} s (last good time {} s) the gap of contact node {} of sector {} has changed by {jump:.3e} m in two steps, \
                 where motion of node and casing explains {explained:.3e} m: the work of this contact cannot be told",
                shown(time),
                shown(self.time),
                self.node_name(node),
                sector + 1
            ),
            remedy: "Use a smaller internal step; if that does not help, the surface is folded or has more than one closest point \
                     there. Restore a saved state or reset first"
                .to_owned(),
        }
    }

    /// What only means something else for a free master.
    fn free_failure(&self, failure: StepFailure, time: f64) -> Option<Error> {
        self.compiled.free.as_ref()?;
        let behind;
        let problem = match failure {
            StepFailure::NonFinite
            | StepFailure::Unbalanced { .. }
            | StepFailure::Unexplained { .. }
            | StepFailure::OutOfReach { .. }
            | StepFailure::Curved(_) => return None,
            StepFailure::TooFast => {
                "contact nodes of the free structure move by more than a tenth of the extent of the contact nodes in one internal \
                 step, and could pass a surface unseen"
            }
            StepFailure::BehindEdge { node } => {
                let name = &self.compiled.master().1.contact_nodes[node].name;
                behind = format!(
                    "the contact node {name} comes over the edge of a surface and is behind it already: what is at an edge \
                     is not described, and pushing the node out would be an impact of arbitrary strength"
                );
                &behind
            }
            StepFailure::Implausible { .. } => {
                "contact nodes of the free structure have moved against each other, or into a surface, by more than a tenth of \
                 the extent of the contact nodes"
            }
            StepFailure::CasingImplausible => {
                "a structure that carries a surface is displaced by more than a tenth of the extent of the contact nodes"
            }
            StepFailure::Unsolved { .. } => "the contact problem has no solution",
        };
        let remedy = match failure {
            StepFailure::Unsolved { .. } => "Use less friction, another internal step or the solver coulomb",
            StepFailure::TooFast => "Use a smaller internal step or a lower velocity",
            StepFailure::BehindEdge { .. } => {
                "Extend the contact grid to where nodes may come, or move one of the structures; check that S_t x S_s of each \
                 contact grid points to the master"
            }
            _ => "Check positions and velocity; small displacements beside rigid flight cannot describe this",
        };
        Some(Error::Unstable {
            problem: format!("at t = {} s (last good time {} s) {problem}", shown(time), shown(self.time)),
            remedy: format!("{remedy}. Restore a saved state or reset first"),
        })
    }

    /// Growth that the initialisation warned of, as the likely cause of a failure.
    fn instability(&self) -> String {
        let grows = |text: &&String| text.contains("physically unstable");
        self.warnings.iter().find(grows).map_or_else(String::new, |text| format!(". {text}"))
    }

    /// End the communication step here, before its end (early return): outputs cover the part done.
    ///
    /// # Errors
    /// No step under way, no internal step done yet, or a non-finite state.
    pub fn end_step_early(&mut self) -> Result<()> {
        if self.phase != Phase::Stepping || self.communication.done == 0 {
            return Err(Error::invalid("early return", "no internal step is done", "Return after an internal step"));
        }
        let done = self.communication.done;
        let (offset, time) = (self.communication.offset(done), self.communication.time(done));
        self.communication = Communication { length: offset, count: done, ..self.communication };
        self.finish(offset, time)
    }

    /// `begin_step`, then `advance` to the end.
    ///
    /// # Errors
    /// As those two.
    pub fn do_step(&mut self, current_time: f64, step_size: f64) -> Result<()> {
        self.begin_step(current_time, step_size)?;
        while !self.advance()?.finished {}
        Ok(())
    }
}

fn failed_before() -> Error {
    Error::invalid("doStep", "an earlier step of this instance failed", "Restore a saved state or reset the instance")
}
