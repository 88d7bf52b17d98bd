//! Warnings that depend on the step: reported at the start for the expected step, and again if a run takes a longer step, turns the other
//! way, or becomes implausibly fast.

use super::{Parameters, in_range, senses_of};
use crate::limits::finding::{Finding, Subject, WarningKind};
use crate::limits::plausibility::{self, Slip};
use crate::limits::{self, massless};
use crate::simulation::Simulation;
use std::collections::BTreeMap;
use tiprub_cosim::warning::{Topic, Warning};

/// A step that is longer by this factor than the reported one is reported again.
const MATERIAL: f64 = 1.5;

/// Warnings reported since the start.
#[derive(Debug, Clone, Default)]
pub(crate) struct WarningState {
    /// Topic, part of the scene, and magnitude: the length of a step (s), an angle (rad) or a fraction.
    reported: BTreeMap<(Topic, Subject), f64>,
    /// Speed above which the tips of each master are implausibly fast (rad/s); infinite once it was reported.
    pub(in crate::simulation) fastest: Vec<f64>,
}

impl WarningState {
    /// Creates the state without warnings, for a number of masters.
    pub(in crate::simulation) fn new(bodies: usize) -> Self {
        Self { reported: BTreeMap::new(), fastest: vec![0.0; bodies] }
    }

    /// Returns the magnitude at which a warning was last reported; 0 if it was not.
    fn magnitude(&self, topic: Topic, of: Subject) -> f64 {
        self.reported.get(&(topic, of)).copied().unwrap_or(0.0)
    }

    /// Marks a warning of this magnitude as reported, if it exceeds the reported one by a factor; returns whether it does. Allocates
    /// only in this case.
    pub(in crate::simulation) fn exceeds(&mut self, topic: Topic, of: Subject, magnitude: f64, factor: f64) -> bool {
        let is_new = magnitude > factor * self.magnitude(topic, of);
        if is_new {
            self.reported.insert((topic, of), magnitude);
        }
        is_new
    }

    /// Marks a warning as reported; returns whether it was not.
    pub(in crate::simulation) fn is_first(&mut self, topic: Topic, of: Subject) -> bool {
        self.exceeds(topic, of, f64::INFINITY, 1.0)
    }
}

impl Simulation {
    /// Marks the warnings of the start as reported, with those for the expected step.
    pub(in crate::simulation) fn begin_telling(&mut self, parameters: &Parameters, warnings: &[Finding]) {
        let expected = self.compiled.expected_step(parameters.step);
        self.diagnostics.reported = WarningState::new(self.state.inputs.rotors.len());
        for finding in warnings {
            self.diagnostics.reported.exceeds(finding.kind.topic(), finding.of, expected, 1.0);
        }
        let mut uncertain_warnings: Vec<Warning> = self.compiled.slips().iter().map(Slip::warning).collect();
        uncertain_warnings.extend(self.compiled.idle_patches());
        for (body, speed) in self.speeds().into_iter().enumerate() {
            for sense in senses_of(parameters.speeds[body]) {
                self.diagnostics.reported.is_first(Topic::OtherSense, Subject::Slip { body, sense });
            }
            let fast = self.compiled.slip_of_speed(body, speed);
            let fastest = plausibility::fastest(self.compiled.body(body).1);
            self.diagnostics.reported.fastest[body] = if fast.is_some() { f64::INFINITY } else { fastest };
            uncertain_warnings.extend(fast.iter().map(Slip::warning));
        }
        self.diagnostics.warnings.extend(uncertain_warnings);
    }

    /// Reports the warnings for changed friction coefficients that were not reported before.
    pub(in crate::simulation) fn warn_of_friction(&mut self, parameters: &Parameters) {
        let found = |limits: &super::Limits| {
            let bodies = limits.bodies.iter().zip(&parameters.speeds);
            bodies.flat_map(|(body, speed)| body.warnings(*speed).unwrap_or_default()).collect::<Vec<_>>()
        };
        let step = self.compiled.expected_step(parameters.step);
        for finding in self.diagnostics.limits.as_ref().map(found).unwrap_or_default() {
            let (topic, of) = (finding.kind.topic(), finding.of);
            if self.diagnostics.reported.magnitude(topic, of) == 0.0
                && self.diagnostics.reported.exceeds(topic, of, step, 1.0)
            {
                self.note(self.compiled.warning(&finding));
            }
        }
    }

    /// Reports unreported warnings for an internal step (s) and for the speeds of a communication step of length `length` (s). Allocates
    /// only to report.
    pub(in crate::simulation) fn warn_of_step_and_speeds(&mut self, step: f64, length: f64) {
        for body in 0..self.state.inputs.rotors.len() {
            for kind in self.warnings_of_step(body, step) {
                self.report(kind, Subject::Body(body), step);
            }
            for offset in [0.0, length] {
                self.warn_of_speed(body, self.state.inputs.rotors[body].speed.at(offset));
                self.warn_of_turn(Subject::Body(body), step * self.excitation_rate(body, offset).abs());
            }
        }
        for carrier in 0..self.compiled.carriers.len() {
            let of = Subject::Carrier(carrier);
            let frequency = self.compiled.carriers[carrier].model.largest_frequency();
            self.report(limits::unresolved_modes(frequency, self.system.settings.scheme, step), of, step);
            if self.compiled.carriers[carrier].loads.nodal.is_some() {
                self.warn_of_turn(of, step * self.state.inputs.carriers[carrier].load_phase.rate().abs());
            }
        }
    }

    /// Reports a finding, unless it was reported with nearly this magnitude.
    fn report(&mut self, kind: Option<WarningKind>, of: Subject, magnitude: f64) {
        if let Some(kind) = kind
            && self.diagnostics.reported.exceeds(kind.topic(), of, magnitude, MATERIAL)
        {
            self.note(self.compiled.warning(&kind.of(of)));
        }
    }

    /// Warns of a scheme that makes resonances too large if the load turns far in one internal step (rad).
    fn warn_of_turn(&mut self, of: Subject, turn: f64) {
        let scheme = self.system.settings.scheme;
        let coarse = scheme.properties().resonance_error.filter(|error| turn > error.resolved_turn);
        let kind = coarse.map(|error| WarningKind::CoarseExcitation {
            scheme,
            turn,
            excess: turn / error.resolved_turn,
            amplitude: (error.amplitude)(turn),
            frequency: (error.frequency)(turn),
        });
        self.report(kind, of, turn);
    }

    fn warn_of_speed(&mut self, body: usize, speed: f64) {
        if speed.abs() > self.diagnostics.reported.fastest[body]
            && let Some(slip) = self.compiled.slip_of_speed(body, speed)
        {
            self.diagnostics.reported.fastest[body] = f64::INFINITY;
            self.note(slip.warning());
        }
        for sense in senses_of(speed).filter(|_| speed != 0.0) {
            if self.diagnostics.reported.is_first(Topic::OtherSense, Subject::Slip { body, sense }) {
                for finding in self.of_sense(body, sense, speed) {
                    self.note(self.compiled.warning(&finding));
                }
            }
        }
    }

    /// Returns the warnings about a master that depend on the step (s).
    fn warnings_of_step(&self, body: usize, step: f64) -> [Option<WarningKind>; 4] {
        let Some(limits) = &self.diagnostics.limits else { return [const { None }; 4] };
        let (scheme, own) = (limits.parameters.scheme, &limits.bodies[body]);
        let highest = self.compiled.bodies[body].largest_frequency() * self.compiled.stiffest(body);
        [
            limits::unresolved_modes(highest, scheme, step),
            massless::warning(step, own.massless),
            limits::unresolved::warning(scheme, step, own.unresolved),
            in_range(&own.carriers, step).cloned(),
        ]
    }

    /// Adds a warning for the next [`Simulation::take_notes`], unless it is silenced.
    pub(in crate::simulation) fn note(&mut self, warning: Warning) {
        self.diagnostics.note(warning, &self.compiled.scene.settings);
    }

    /// Returns the warnings of sliding contact in the opposite sense of rotation, which the warnings of the start omit. Empty before
    /// [`CoSimulation::initialise`](tiprub_cosim::CoSimulation::initialise), and for coupled sectors, where the search takes as long again.
    ///
    /// # Examples
    /// ```
    /// # use tiprub_core::{CoSimulation, Simulation};
    /// # let scene = tiprub_test_models::rub(2);
    /// # let mut simulation = Simulation::new(&scene)?;
    /// assert!(simulation.if_reversed().is_empty());
    /// simulation.initialise(0.0)?;
    /// for warning in simulation.if_reversed() {
    ///     println!("if reversed: {warning}");
    /// }
    /// # Ok::<(), tiprub_core::Error>(())
    /// ```
    pub fn if_reversed(&self) -> Vec<Warning> {
        let Some(limits) = &self.diagnostics.limits else { return Vec::new() };
        let mut found = Vec::new();
        for (body, own) in limits.bodies.iter().enumerate() {
            let is_other = |sense: &usize| {
                let of = Subject::Slip { body, sense: *sense };
                self.diagnostics.reported.magnitude(Topic::OtherSense, of) == 0.0 && own.senses[*sense].is_some()
            };
            let speed = limits.parameters.speeds[body];
            found.extend([0, 1].into_iter().filter(is_other).flat_map(|sense| self.of_sense(body, sense, speed)));
        }
        found.iter().map(|finding| self.compiled.warning(finding)).collect()
    }

    /// Returns the warnings for contact of a master that slides in a sense at the expected step and at a speed (rad/s).
    fn of_sense(&self, body: usize, sense: usize, speed: f64) -> Vec<Finding> {
        let Some(own) = self.diagnostics.limits.as_ref().map(|limits| &limits.bodies[body]) else { return Vec::new() };
        let kinds = match &own.senses[sense] {
            Some(sense) => sense.warnings_after_reversal(own.closing.time(speed)),
            None => vec![WarningKind::OtherSense],
        };
        kinds.into_iter().map(|kind| kind.of(own.of)).collect()
    }
}
