//! Stability and solvability of a scene for its possible step sizes.

mod checking;
mod closing;
mod delayed_contact;
mod free;
mod known;
mod sliding;
mod warning_state;

use std::cell::RefCell;

use tiprub_cosim::variables::Quantity;

use super::compile::complementary;
use super::table::has_one_friction;
use super::{Compiled, Simulation};
use crate::limits::finding::{Checked, ErrorKind, Finding, Subject, WarningKind};
use crate::limits::massless::MasslessLimit;
use crate::limits::wording::{AdaptiveSteps, Context};
use crate::limits::{self, massless};
use crate::modes::modal::{ModalModel, fill_ratios};
use crate::scene::method::{Scheme, Solver};
use crate::scene::settings::{Preset, TOLERANCE};
use crate::system::System;
use crate::{Error, Result, Warning};
use checking::Checking;
use closing::Closing;
use known::BodyChecks;
pub(super) use known::KnownChecks;
use sliding::Sense;
pub(super) use warning_state::WarningState;

/// Parameters that determine stability.
#[derive(Debug, Clone, PartialEq)]
pub struct Parameters {
    /// Friction coefficient of each contact pair.
    pub friction: Vec<f64>,
    /// Damping ratios of the masters, then of the surface carriers.
    pub damping_ratios: Vec<f64>,
    /// Damping ratios of their first modes, if given.
    pub mode_damping: Vec<Vec<f64>>,
    /// Largest internal step (s).
    pub step: f64,
    pub scheme: Scheme,
    /// Error of a step of `galerkin`, as a fraction of the smallest clearance.
    pub tolerance: f64,
    pub solver: Solver,
    /// Speed of each master at the start (rad/s), whose sign is the sense of slip; both senses if it is 0.
    pub speeds: Vec<f64>,
    /// Velocities of free bodies at the start (m/s).
    pub velocities: Vec<[f64; 3]>,
}

impl Parameters {
    /// Largest friction coefficient of a structure.
    pub(crate) fn friction_of(&self, compiled: &Compiled, body: usize) -> f64 {
        compiled.plan.pairs_of(body).map(|(pair, _)| self.friction[pair]).fold(0.0, f64::max)
    }
}

/// Limits for given parameters.
#[derive(Debug, Clone)]
pub struct Limits {
    /// Parameters, valid for any speeds.
    parameters: Parameters,
    /// Limits of each master.
    bodies: Vec<BodyLimits>,
}

/// Limits of one master and its surfaces.
#[derive(Debug, Clone)]
struct BodyLimits {
    /// The master.
    of: Subject,
    /// Warnings for the expected step, or the reason why these parameters are rejected, for any sense of slip.
    outcome: Checked<Vec<Finding>>,
    /// Slip in +θ and in −θ; for a disk, where the check is slow, only the requested senses.
    senses: [Option<Sense>; 2],
    /// Duration of closed contact.
    closing: Closing,
    /// Step limits of closed contact whose forces act a step late; infinite for other schemes.
    massless: MasslessLimit,
    /// Largest step of each range of step sizes, descending, and a warning if surface carriers make contact problems
    /// unsolvable in this range.
    carriers: Vec<(f64, Option<WarningKind>)>,
    /// Smallest step that does not resolve modes which contact excites; infinite for schemes that need no such limit.
    unresolved: f64,
    /// Warning of growth while blades cut.
    cutting: Option<WarningKind>,
}

/// Senses of slip for a speed or its sign: both if it is 0.
fn senses_of(sense: f64) -> impl Iterator<Item = usize> {
    [sense >= 0.0, sense <= 0.0].into_iter().enumerate().filter(|(_, slips)| *slips).map(|(index, _)| index)
}

/// Returns the result for a step from a list of ranges: that of the smallest entry that is not below it.
fn in_range<T>(ranges: &[(f64, Option<T>)], step: f64) -> Option<&T> {
    let range = ranges.iter().rev().find(|(largest, _)| step <= largest * (1.0 + super::clock::SAME_STEP));
    range.and_then(|(_, found)| found.as_ref())
}

/// Returns the item of an enumeration, whose items count from 1.
fn chosen<T: Copy>(all: &[T], value: f64) -> T {
    let found = all.iter().zip(1_u32..).find(|(_, number)| (value - f64::from(*number)).abs() < 0.5);
    found.map_or(all[0], |(item, _)| *item)
}

impl Simulation {
    pub(super) fn parameters(&self) -> Parameters {
        let (bodies, pairs) = (self.compiled.bodies.len(), self.compiled.plan.pairs.len());
        let one = has_one_friction(&self.compiled.scene.settings);
        let friction = |pair: usize| self.state.values.value_of(Quantity::Friction, if one { 0 } else { pair });
        let damping = (0..bodies).map(|body| self.state.values.value_of(Quantity::DampingRatio, body));
        let carriers = 0..self.compiled.carriers.len();
        let carried = carriers.map(|carrier| self.state.values.value_of(Quantity::CarrierDampingRatio, carrier));
        let velocity =
            |body: usize| [0, 1, 2].map(|axis| self.state.values.value_of(Quantity::InitialVelocity(axis), body));
        Parameters {
            friction: (0..pairs).map(friction).collect(),
            damping_ratios: damping.chain(carried).collect(),
            mode_damping: self.mode_damping(),
            step: self.state.values.value_of(Quantity::StepMax, 0),
            tolerance: self.state.values.elements(Quantity::Tolerance, 0).map_or(TOLERANCE, |tolerance| tolerance[0]),
            scheme: chosen(&Scheme::ALL, self.state.values.value_of(Quantity::SchemeChoice, 0)),
            solver: chosen(&Solver::ALL, self.state.values.value_of(Quantity::SolverChoice, 0)),
            speeds: self.speeds(),
            velocities: (0..bodies).map(velocity).collect(),
        }
    }

    /// Checks limits unless the same parameters were checked last; returns warnings. If the parameters are rejected, the previous limits
    /// stay.
    pub(super) fn check_limits(&mut self, parameters: &Parameters) -> Result<Vec<Finding>> {
        let is_known = self.diagnostics.limits.as_ref().is_some_and(|limits| limits.cover(parameters));
        let computed = (!is_known).then(|| self.computed_limits(parameters));
        let limits = computed.as_ref().or(self.diagnostics.limits.as_ref());
        let found = limits.map_or(Ok(Vec::new()), |limits| limits.warnings(&parameters.speeds));
        let warnings = found.map_err(|error| self.compiled.error(&error))?;
        self.diagnostics.limits = computed.or(self.diagnostics.limits.take());
        Ok(warnings)
    }

    fn computed_limits(&mut self, parameters: &Parameters) -> Limits {
        let known = RefCell::new(std::mem::take(&mut self.diagnostics.known));
        known.borrow_mut().begin();
        let limits = self.compiled.limits(parameters, &self.system, &known);
        self.diagnostics.known = known.into_inner();
        limits
    }

    /// Uses results of slow checks that [`Simulation::checks`] returned, possibly in another process. The next
    /// initialisation with the same scene and parameters does not repeat these checks. Bytes have no effect if they are
    /// damaged or belong to another scene, other parameters or another version.
    ///
    /// # Examples
    /// ```
    /// # use tiprub_core::{CoSimulation, Simulation};
    /// # let scene = tiprub_test_models::rub(2);
    /// let mut first = Simulation::new(&scene)?;
    /// first.initialise(0.0)?;
    /// let mut second = Simulation::new(&scene)?;
    /// second.use_checks(&first.checks());
    /// second.initialise(0.0)?;
    /// assert_eq!(first.warnings(), second.warnings());
    /// # Ok::<(), tiprub_core::Error>(())
    /// ```
    pub fn use_checks(&mut self, checks: &[u8]) {
        self.diagnostics.known = KnownChecks::from_bytes(checks);
    }

    /// Returns the results of slow checks of the last initialisation, for [`Simulation::use_checks`]; empty if there
    /// are none.
    ///
    /// # Examples
    /// ```
    /// # use tiprub_core::Simulation;
    /// # let scene = tiprub_test_models::rub(2);
    /// assert!(Simulation::new(&scene)?.checks().is_empty());
    /// # Ok::<(), tiprub_core::Error>(())
    /// ```
    pub fn checks(&self) -> Vec<u8> {
        self.diagnostics.known.to_bytes()
    }

    /// Merges results of slow checks for [`Simulation::use_checks`]: those of `newest`, followed by results of `older` for
    /// other parameters or scenes. At most `max_results` results are kept, the first ones, but always all of `newest`.
    ///
    /// # Examples
    /// ```
    /// # use tiprub_core::{CoSimulation, Simulation};
    /// # let scene = tiprub_test_models::rub(2);
    /// let mut simulation = Simulation::new(&scene)?;
    /// simulation.initialise(0.0)?;
    /// let checks = simulation.checks();
    /// assert_eq!(Simulation::merge_checks(&checks, &checks, 1000), checks);
    /// # Ok::<(), tiprub_core::Error>(())
    /// ```
    pub fn merge_checks(newest: &[u8], older: &[u8], max_results: usize) -> Vec<u8> {
        known::merge(newest, older, max_results)
    }

    /// Updates the limits after a state with other parameters was restored. Before initialisation nothing has been computed from
    /// parameters, and invalid ones are not rejected yet.
    pub(super) fn renew_limits(&mut self) {
        let parameters = self.parameters();
        let known = self.diagnostics.limits.as_ref().is_some_and(|limits| limits.are_of(&parameters));
        if !self.state.clock.is_created() && !known {
            self.diagnostics.limits = Some(self.computed_limits(&parameters));
        }
    }

    /// Rejects a step size (s) whose range was found unstable, or that stiffening at one of the `speeds` of a structure (rad/s) and at its
    /// `coldest` temperature (K) forbids. This is a lookup, so that a step does not allocate.
    pub(super) fn check_step_size(&self, body: usize, step: f64, speeds: [f64; 3], coldest: f64) -> Result<()> {
        self.is_step_allowed(body, step, speeds, coldest).map_err(|error| self.compiled.error(&error))
    }

    fn is_step_allowed(&self, body: usize, step: f64, speeds: [f64; 3], coldest: f64) -> Checked<()> {
        let Some(limits) = &self.diagnostics.limits else { return Ok(()) };
        let (scheme, own) = (limits.parameters.scheme, &limits.bodies[body]);
        let stiffened = |speed: f64| self.compiled.stiffened(body, speed, coldest);
        let stiffened = speeds.into_iter().fold(1.0, |most: f64, speed| most.max(stiffened(speed)));
        let largest = self.compiled.bodies[body].largest_frequency();
        let of_body = |error: ErrorKind| error.of(own.of);
        limits::check_step_allowed(largest * self.compiled.stiffest(body) * stiffened, scheme, step)
            .map_err(of_body)?;
        for carrier in self.compiled.carriers_of(body) {
            let frequency = self.compiled.carriers[carrier].model.largest_frequency();
            limits::check_step_allowed(frequency, scheme, step).map_err(|error| error.of(Subject::Carrier(carrier)))?;
        }
        limits::unresolved::check(scheme, step, own.unresolved, largest).map_err(of_body)?;
        massless::check(step, own.massless).map_err(of_body)?;
        for speed in speeds.into_iter().filter(|speed| *speed != 0.0) {
            let closed = own.closing.time(speed);
            let mut senses = senses_of(speed).filter_map(|sense| own.senses[sense].as_ref());
            senses.try_for_each(|sense| sense.check(step, closed)).map_err(of_body)?;
        }
        Ok(())
    }
}

impl Compiled {
    /// Expected internal step (s): the proposed communication step divided by the number of its internal steps.
    pub(super) fn expected_step(&self, largest: f64) -> f64 {
        let length = self.scene.settings.experiment.communication_step;
        length / (length / largest * (1.0 - super::clock::SAME_STEP)).ceil().max(1.0)
    }

    /// Returns the names and possibilities of the scene for texts about one of its parts.
    fn context(&self, of: Subject) -> Context<'_> {
        let (settings, several) = (&self.scene.settings, self.bodies.len() > 1);
        let (name, rom) = match of {
            Subject::Scene => (None, None),
            Subject::Body(body) | Subject::Slip { body, .. } => {
                let (structure, rom) = self.body(body);
                (several.then_some(structure.name.as_str()), Some(rom))
            }
            Subject::Carrier(carrier) => (Some(self.carrier_name(self.bodies.len() + carrier)), None),
        };
        let solver = complementary(settings);
        let other = (solver != settings.contacts[0].solver).then_some(solver);
        let adaptive = self.supports_adaptive.then_some(AdaptiveSteps { solver: other });
        Context { name, rom, preset: settings.preset == Preset::Paper, adaptive }
    }

    /// Returns a finding as a warning.
    pub(super) fn warning(&self, finding: &Finding) -> Warning {
        finding.warning(&self.context(finding.of))
    }

    /// Returns a finding as an error.
    fn error(&self, finding: &Finding<ErrorKind>) -> Error {
        finding.error(&self.context(finding.of))
    }

    /// Returns the warnings about carriers of the surfaces of a master whose modes a step (s) does not resolve.
    ///
    /// # Errors
    /// A carrier that is unstable with this step.
    fn unresolved_carriers(&self, body: usize, scheme: Scheme, step: f64) -> Checked<Vec<Finding>> {
        let checked = self.carriers_of(body).map(|carrier| {
            let frequency = self.carriers[carrier].model.largest_frequency();
            let found = limits::check_step(frequency, scheme, step);
            let of = Subject::Carrier(carrier);
            found.map(|kind| kind.map(|kind| kind.of(of))).map_err(|error| error.of(of))
        });
        checked.filter_map(Result::transpose).collect()
    }

    /// Largest factor on the frequencies of a structure.
    pub(super) fn stiffest(&self, body: usize) -> f64 {
        self.body(body).0.frequency_factors.iter().fold(1.0, |largest: f64, factor| largest.max(*factor))
    }

    /// Upper bound on the factor by which spin and cold raise the largest frequency above that at the reference speed and temperature.
    fn stiffened(&self, body: usize, speed: f64, coldest: f64) -> f64 {
        let structure = self.body(body).0;
        let body = &self.bodies[body];
        let [hot, cold] = [body.reference_temperature, coldest].map(|one| super::blades::softened(structure, one));
        let colder = if structure.softening == 0.0 { 1.0 } else { (cold / hot).max(1.0) };
        let Some([second, fourth]) = body.stiffness_range else { return colder.sqrt() };
        let (square, reference) = (speed * speed, body.reference_speed * body.reference_speed);
        let most = |factor: f64, range: [f64; 2]| factor * if factor > 0.0 { range[1] } else { range[0] };
        let added = most(square - reference, second) + most(square * square - reference * reference, fourth);
        let largest = body.model.largest_frequency();
        (colder + added.max(0.0) / (largest * largest)).sqrt()
    }

    /// Largest angular frequency of structures of the system without stiffening (rad/s).
    pub(super) fn largest_frequency(&self, structures: &[usize]) -> f64 {
        let frequency = |structure: &usize| match self.bodies.get(*structure) {
            Some(body) => body.largest_frequency() * self.stiffest(*structure),
            None => self.carriers[*structure - self.bodies.len()].model.largest_frequency(),
        };
        structures.iter().map(frequency).fold(0.0, f64::max)
    }

    /// Returns the carriers of the surfaces that a structure can touch.
    fn carriers_of(&self, body: usize) -> impl Iterator<Item = usize> {
        let pairs = self.plan.pairs_of(body);
        let carriers = pairs.enumerate().filter_map(move |(index, (_, pair))| Some((index, pair.carrier?)));
        // Each carrier counts once.
        carriers.filter_map(move |(index, carrier)| {
            let before = self.plan.pairs_of(body).take(index).any(|(_, pair)| pair.carrier == Some(carrier));
            (!before).then_some(carrier)
        })
    }

    fn limits(&self, parameters: &Parameters, system: &System, known: &RefCell<KnownChecks>) -> Limits {
        let of = |body: usize| match self.bodies[body].translations {
            Some(_) => self.free_limits(body, parameters, system),
            None => self.rotor_limits(body, parameters, system, BodyChecks::new(known, self, body, parameters)),
        };
        Limits { parameters: parameters.clone(), bodies: (0..self.bodies.len()).map(of).collect() }
    }

    fn rotor_limits(&self, body: usize, parameters: &Parameters, system: &System, known: BodyChecks<'_>) -> BodyLimits {
        let parts = &self.bodies[body];
        let mut models = match &parts.disk {
            Some(disk) => (0..disk.diameters.len()).map(|diameter| disk.paired(diameter)).collect(),
            None => vec![parts.model.clone()],
        };
        let copies = |diameter: usize| match &parts.disk {
            Some(disk) if !disk.is_real(diameter) => 2,
            _ => 1,
        };
        // The stiffest of mistuned blades has the tightest limits.
        let stiffest = self.stiffest(body);
        for (diameter, model) in models.iter_mut().enumerate() {
            let (ratio, own) = (parameters.damping_ratios[body], &parameters.mode_damping[body]);
            fill_ratios(&mut model.damping_ratios, ratio, own, copies(diameter));
            model.frequencies.iter_mut().for_each(|frequency| *frequency *= stiffest);
        }
        let at = Checking::new(self, system, models, parameters, known);
        let expected = self.expected_step(parameters.step);
        let of = at.subject();
        if parameters.scheme.properties().adaptive {
            // Adaptive steps are short enough for their contact problems and their energy: only physical effects are reported, and nothing
            // is rejected.
            return BodyLimits {
                outcome: Ok(at.not_looked_at().map(|kind| kind.of(of)).into_iter().collect()),
                senses: [0, 1].map(|sense| Some(at.sense(sense, expected))),
                ..BodyLimits::new(of, Closing::new(self, body))
            };
        }
        let carriers = at.carriers(expected);
        // Radially: along an inclined normal the bending of the blade would hide the compliance of the tip itself.
        let radial = |model: &ModalModel| vec![[-1.0, 0.0, 0.0]; model.contact_modes.nrows() / 3];
        let masters = at.models.iter().map(|model| limits::unresolved::limit(model, &radial(model)));
        let unresolved = self.unresolved(body, masters, parameters.scheme);
        let resolved = limits::unresolved::check(parameters.scheme, expected, unresolved, at.largest_frequency());
        let (outcome, massless) = match resolved.and_then(|()| at.delayed_contact(expected)) {
            Ok((mut more, limit)) => {
                more.extend(limits::unresolved::warning(parameters.scheme, expected, unresolved));
                (at.warnings(expected, in_range(&carriers, expected).cloned(), more), limit)
            }
            Err(error) => (Err(error.of(of)), MasslessLimit::NONE),
        };
        let mut senses = [None, None];
        // For a disk the other sense takes as long again; without friction the sense does not matter.
        let both = parts.disk.is_none() || at.friction == 0.0;
        if outcome.is_ok() {
            for sense in senses_of(if both { 0.0 } else { parameters.speeds[body] }) {
                senses[sense] = Some(at.sense(sense, expected));
            }
        }
        let (closing, cutting) = (Closing::new(self, body), at.cutting());
        BodyLimits { of, outcome, senses, closing, massless, carriers, unresolved, cutting }
    }

    /// Smallest step (s) that does not resolve modes which contact excites, of the master and of carriers.
    fn unresolved(&self, body: usize, touching: impl Iterator<Item = f64>, scheme: Scheme) -> f64 {
        if scheme.properties().resolved_up_to.is_infinite() {
            return f64::INFINITY;
        }
        let models = self.carriers_of(body).map(|carrier| &self.carriers[carrier].model);
        touching.chain(models.map(limits::unresolved::limit_along_axes)).fold(f64::INFINITY, f64::min)
    }
}

impl Limits {
    /// Returns whether these limits belong to the parameters, for any senses.
    fn are_of(&self, parameters: &Parameters) -> bool {
        Parameters { speeds: self.parameters.speeds.clone(), ..parameters.clone() } == self.parameters
    }

    /// Returns whether these limits belong to the parameters and the senses were checked.
    fn cover(&self, parameters: &Parameters) -> bool {
        let looked_at =
            |(body, speed): (&BodyLimits, &f64)| senses_of(*speed).all(|sense| body.senses[sense].is_some());
        self.are_of(parameters) && self.bodies.iter().zip(&parameters.speeds).all(looked_at)
    }

    /// Returns the warnings for the expected step at these speeds (rad/s).
    fn warnings(&self, speeds: &[f64]) -> Checked<Vec<Finding>> {
        let mut warnings: Vec<Finding> = Vec::new();
        for (body, speed) in self.bodies.iter().zip(speeds) {
            let found = body.warnings(*speed)?;
            // Masters may touch surfaces of the same carrier.
            warnings.extend(found.into_iter().filter(|finding| !warnings.contains(finding)).collect::<Vec<_>>());
        }
        Ok(warnings)
    }

    /// Returns the self-excited growth of a structure that turns at a speed of this sign.
    pub fn grows(&self, body: usize, speed: f64) -> Option<Finding> {
        let BodyLimits { of, cutting, senses, .. } = &self.bodies[body];
        // Contact is assumed to have stayed closed for any time.
        let mut sliding = senses_of(speed).filter_map(|sense| senses[sense].as_ref()?.grows(f64::INFINITY).next());
        Some(cutting.clone().or_else(|| sliding.next())?.of(*of))
    }
}

impl BodyLimits {
    /// Creates limits that reject and report nothing.
    fn new(of: Subject, closing: Closing) -> Self {
        Self {
            of,
            outcome: Ok(Vec::new()),
            senses: [Some(Sense::default()), Some(Sense::default())],
            closing,
            massless: MasslessLimit::NONE,
            carriers: Vec::new(),
            unresolved: f64::INFINITY,
            cutting: None,
        }
    }

    /// Returns the warnings for the expected step at this speed (rad/s).
    fn warnings(&self, speed: f64) -> Checked<Vec<Finding>> {
        let mut warnings = self.outcome.clone()?;
        warnings.extend(self.cutting.clone().map(|kind| kind.of(self.of)));
        let closed = self.closing.time(speed);
        // Both senses count for a rotor that starts at rest; growth in either is reported once.
        for sense in senses_of(speed).filter_map(|sense| self.senses[sense].as_ref()) {
            for kind in sense.warnings(closed).map_err(|error| error.of(self.of))? {
                if !warnings.iter().any(|known| known.of == self.of && known.kind.topic() == kind.topic()) {
                    warnings.push(kind.of(self.of));
                }
            }
        }
        Ok(warnings)
    }
}
