//! Warnings that depend on the step: reported at the start for the expected step, and again if a run takes a longer step, turns the other
//! way, or becomes implausibly fast.

use tiprub_cosim::warning::{Topic, Warning};

use super::{BodyLimits, Parameters, in_range, senses_of};
use crate::limits::plausibility::{self, Slip};
use crate::limits::{self, massless};
use crate::scene::method::Scheme;
use crate::simulation::Simulation;

/// A step that is longer by this factor than the reported one is reported again.
const MATERIAL: f64 = 1.5;

/// Turn of the excitation per internal step (rad) above which central differences make a resonance more than 1 % too large: √0.06.
const RESOLVED_TURN: f64 = 0.245;

/// Number of kinds of warnings that depend on the step: unresolved modes of the master and of carriers, contact of massless-boundary that gains
/// energy, neglected flexibility, casings that spoil solvability.
const KINDS: usize = 5;

/// Warnings reported since the start.
#[derive(Debug, Clone)]
pub struct WarningState {
    /// Longest reported step (s), per kind and structure: four kinds for masters, and one for surface carriers.
    steps: [Vec<f64>; KINDS],
    /// Reported senses of slip, + and −, of each master.
    senses: Vec<[bool; 2]>,
    /// Speed above which the tips are implausibly fast (rad/s); infinite once it was reported.
    pub(in crate::simulation) fastest: Vec<f64>,
    /// Largest number of warnings for one friction coefficient, of each master.
    friction: Vec<usize>,
    /// True if a displacement was too large for linear kinematics, of each master.
    pub(in crate::simulation) curved: Vec<bool>,
    /// True if `film` pulls at contact nodes, of each master.
    pub(in crate::simulation) pulls: Vec<bool>,
    /// Reported turn of the excitation per internal step (rad), of each master.
    turned: Vec<f64>,
    /// Reported turn of the load per internal step (rad), of each surface carrier.
    load_turned: Vec<f64>,
    /// Depth of contact nodes inside a surface at the last warning, of each master, as a fraction of the clearance.
    pub(in crate::simulation) inside: Vec<f64>,
    /// True if curvature work was large compared with the net work of inputs.
    pub(in crate::simulation) curvature: bool,
    /// True if a tolerance was missed.
    pub(in crate::simulation) missed: bool,
}

impl WarningState {
    /// Creates the state without warnings, for numbers of masters and surface carriers.
    pub(in crate::simulation) fn new(bodies: usize, carriers: usize) -> Self {
        Self {
            steps: [bodies, carriers, bodies, bodies, bodies].map(|count| vec![0.0; count]),
            senses: vec![[false; 2]; bodies],
            fastest: vec![0.0; bodies],
            friction: vec![0; bodies],
            curved: vec![false; bodies],
            pulls: vec![false; bodies],
            turned: vec![RESOLVED_TURN / MATERIAL; bodies],
            load_turned: vec![RESOLVED_TURN / MATERIAL; carriers],
            inside: vec![0.0; bodies],
            curvature: false,
            missed: false,
        }
    }
}

impl Simulation {
    /// Marks the warnings of the start as reported, with those for the expected step.
    pub(in crate::simulation) fn begin_telling(&mut self, parameters: &Parameters) {
        let expected = self.compiled.expected_step(parameters.step);
        self.warning_state = WarningState::new(self.rotors.len(), self.compiled.carriers.len());
        for kind in 0..KINDS {
            for of in 0..self.warning_state.steps[kind].len() {
                self.warning_state.steps[kind][of] =
                    if self.warning_of_step(kind, of, expected).is_some() { expected } else { 0.0 };
            }
        }
        let mut uncertain_warnings: Vec<Warning> = self.compiled.slips().iter().map(Slip::warning).collect();
        uncertain_warnings.extend(self.compiled.idle_patches());
        for (body, speed) in self.speeds().into_iter().enumerate() {
            let mut warned = [false; 2];
            senses_of(parameters.speeds[body]).for_each(|sense| warned[sense] = true);
            self.warning_state.senses[body] = warned;
            self.warning_state.friction[body] = self.warnings_of(body, parameters.speeds[body]).len();
            let fast = self.compiled.slip_of_speed(body, speed);
            let fastest = plausibility::fastest(self.compiled.body(body).1);
            self.warning_state.fastest[body] = if fast.is_some() { f64::INFINITY } else { fastest };
            uncertain_warnings.extend(fast.iter().map(Slip::warning));
        }
        self.warnings.extend(uncertain_warnings);
    }

    /// Returns the warnings for a structure whose contact slides in the sense of this sign.
    fn warnings_of(&self, body: usize, sense: f64) -> Vec<Warning> {
        self.limits.as_ref().and_then(|limits| limits.bodies[body].warnings(sense).ok()).unwrap_or_default()
    }

    /// Reports the warnings for changed friction coefficients, of each structure unless as many were reported before.
    pub(in crate::simulation) fn warn_of_friction(&mut self, parameters: &Parameters) {
        for (body, sense) in parameters.speeds.iter().enumerate() {
            let warnings = self.warnings_of(body, *sense);
            if warnings.len() > self.warning_state.friction[body] {
                self.warning_state.friction[body] = warnings.len();
                warnings.into_iter().for_each(|text| self.note(text));
            }
        }
    }

    /// Reports unreported warnings for an internal step (s) and for the speeds of a communication step of length `length` (s). Allocates
    /// only to report.
    pub(in crate::simulation) fn warn_of_step_and_speeds(&mut self, step: f64, length: f64) {
        for kind in 0..KINDS {
            for of in 0..self.warning_state.steps[kind].len() {
                if step > MATERIAL * self.warning_state.steps[kind][of]
                    && let Some(text) = self.warning_of_step(kind, of, step)
                {
                    self.warning_state.steps[kind][of] = step;
                    self.note(text);
                }
            }
        }
        for body in 0..self.rotors.len() {
            for offset in [0.0, length] {
                self.warn_of_speed(body, self.inputs.rotors[body].speed.at(offset));
                self.warn_of_excitation(body, step * self.excitation_rate(body, offset).abs());
            }
        }
        for carrier in 0..self.compiled.carriers.len() {
            self.warn_of_load(carrier, step * self.inputs.carriers[carrier].load_phase.rate().abs());
        }
    }

    /// Warns if the load on a casing turns far in one internal step (rad).
    fn warn_of_load(&mut self, carrier: usize, turn: f64) {
        let coarse = self.system.scheme() == Scheme::CentralDifference
            && turn > MATERIAL * self.warning_state.load_turned[carrier];
        if coarse && self.compiled.carriers[carrier].loads.nodal.is_some() {
            self.warning_state.load_turned[carrier] = turn;
            let name = self.compiled.carrier_name(self.compiled.bodies.len() + carrier);
            self.note(coarse_excitation(&format!("the load on the {name}"), turn));
        }
    }

    /// Warns that central differences make a resonance too large if the excitation turns far in one internal step (rad).
    fn warn_of_excitation(&mut self, body: usize, turn: f64) {
        if self.system.scheme() != Scheme::CentralDifference || turn <= MATERIAL * self.warning_state.turned[body] {
            return;
        }
        self.warning_state.turned[body] = turn;
        self.note(self.compiled.warning_of(body, coarse_excitation("the excitation", turn)));
    }

    fn warn_of_speed(&mut self, body: usize, speed: f64) {
        if speed.abs() > self.warning_state.fastest[body]
            && let Some(slip) = self.compiled.slip_of_speed(body, speed)
        {
            self.warning_state.fastest[body] = f64::INFINITY;
            self.note(slip.warning());
        }
        for sense in senses_of(speed).filter(|_| speed != 0.0) {
            if !std::mem::replace(&mut self.warning_state.senses[body][sense], true) {
                let found = self.limits.as_ref().map_or(Vec::new(), |limits| {
                    limits.bodies[body].of_sense(sense, speed, &self.compiled.rotor_name(body))
                });
                found.into_iter().for_each(|text| self.note(text));
            }
        }
    }

    /// Returns a warning of one kind about a structure at a step (s).
    fn warning_of_step(&self, kind: usize, of: usize, step: f64) -> Option<Warning> {
        let limits = self.limits.as_ref()?;
        let scheme = limits.parameters.scheme;
        let unresolved = |frequency: f64| limits::check_step(frequency, scheme, step).ok().flatten();
        match kind {
            0 => {
                let highest = self.compiled.bodies[of].largest_frequency() * self.compiled.stiffest(of);
                unresolved(highest).map(|text| self.compiled.warning_of(of, text))
            }
            1 => {
                let name = self.compiled.carrier_name(self.compiled.bodies.len() + of);
                let highest = self.compiled.carriers[of].model.largest_frequency();
                unresolved(highest).map(|text| text.named(name))
            }
            2 => massless::warning(step, limits.bodies[of].massless).map(|text| self.compiled.warning_of(of, text)),
            3 => limits::unresolved::warning(step, limits.bodies[of].unresolved)
                .map(|text| self.compiled.warning_of(of, text)),
            _ => in_range(&limits.bodies[of].casing, step).cloned(),
        }
    }

    /// Adds a warning for the next [`Simulation::take_notes`], unless it was reported.
    pub(in crate::simulation) fn note(&mut self, warning: Warning) {
        let silenced = self.compiled.scene.settings.is_silenced(warning.topic());
        if !silenced && !self.warnings.contains(&warning) {
            self.warnings.push(warning.clone());
            self.notes.push(warning);
        }
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
        let Some(limits) = &self.limits else { return Vec::new() };
        let mut found = Vec::new();
        for (index, (body, warned)) in limits.bodies.iter().zip(&self.warning_state.senses).enumerate() {
            let other = [0, 1].into_iter().filter(|sense| !warned[*sense] && body.senses[*sense].is_some());
            let rotor = self.compiled.rotor_name(index);
            let speed = limits.parameters.speeds[index];
            found.extend(other.flat_map(|sense| body.of_sense(sense, speed, &rotor)));
        }
        found
    }
}

/// Returns the warning of central differences that distort a resonance because `what` turns by this angle (rad) in one internal step.
fn coarse_excitation(what: &str, turn: f64) -> Warning {
    let error = turn / libm::sin(turn) - 1.0;
    let problem = format!(
        "{what} rotates by {turn:.2} rad in one internal step: central differences make a resonance {:.0} % too large \
         and shift its frequency by {:.1} %",
        100.0 * error,
        100.0 * turn * turn / 24.0
    );
    let remedy =
        format!("Use modal-exact, or make internal_step_max (time.step) {:.1} times smaller", turn / RESOLVED_TURN);
    Warning::new(Topic::CoarseExcitation, problem, remedy)
}

impl BodyLimits {
    /// Returns the warnings for contact of a `rotor` that slides in a sense at the expected step and at a speed (rad/s).
    fn of_sense(&self, sense: usize, speed: f64, rotor: &str) -> Vec<Warning> {
        let closed = self.closing.time(speed);
        match self.senses[sense].as_ref().map(|sense| sense.warnings(closed)) {
            Some(Ok(warnings)) => warnings,
            Some(Err(refusal)) => vec![
                Warning::new(
                    Topic::StepGrowth,
                    refusal.to_string(),
                    "Change the speed before the next step, which would otherwise end the run",
                )
                .with_text(refusal.to_string()),
            ],
            None => vec![Warning::new(
                Topic::OtherSense,
                format!(
                    "{rotor} now rotates opposite to its initial direction: the growth of vibration in contact that slides in this \
                     direction was not checked, because the check takes a long time with coupled sectors"
                ),
                "Start a run with a speed of this sign to perform the check",
            )],
        }
    }
}
