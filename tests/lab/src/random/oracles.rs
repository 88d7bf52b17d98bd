//! Properties of any scene: energy, losses, penetration, finite outputs, messages.

use tiprub_core::scene::method::{Scheme, Solver};
use tiprub_core::scene::rom::DisplacementFrame;
use tiprub_core::scene::settings::ContactSettings;
use tiprub_core::{CoSimulation, Error, Ledger, Rom, Scene, Simulation};
use tiprub_cosim::Diagnostic;
use tiprub_cosim::warning::Topic;

use super::scenes::RandomScene;
use super::structures::largest_frequency;

/// Rounding of the energy ledger, as a fraction of all energy exchanged.
const ROUNDING: f64 = 1e-9;
/// Work caused by the iterations with which galerkin computes the contact forces of a step, as a fraction of all energy
/// exchanged.
const ITERATED: f64 = 1e-5;
/// Excess of the instantaneous energy over its bound, as a fraction of all energy exchanged.
const INSTANT: f64 = 1e-2;
/// Limit of the instantaneous kinetic plus strain energy, as a multiple of the energy supplied, as in `check_energy` of
/// the core: for a fixed-step scheme it equals the conserved energy only up to the second order of the step, and work
/// on quasi-static modes is known one step late.
const FACTOR: f64 = 4.0;
/// Additional multiple for a scheme whose forces act one internal step later: quasi-static modes hold the strain energy
/// of a force whose work is not counted yet.
const INSTANT_LATER: f64 = 1.0;
/// Rounding of gaps, as a fraction of the clearance.
const GAP_ROUNDING: f64 = 1e-9;
/// Limits of the guide (chapter 12, "Losses only grow"): impacts may return this fraction of the work of contact forces
/// for methods where this is known, and friction of free bodies this fraction of all energy exchanged. A larger value
/// ends a run.
const RETURNED: f64 = 0.02;
const STOPPED: f64 = 0.01;
/// Limit of the guide for `film` (chapter 5): the penetration of nodes without a warning is less than this fraction of
/// the clearance, for a free body less than this fraction of a thousandth of its extent; warnings follow at twice the
/// depth.
const FILM_INSIDE: f64 = 0.05;
const FILM_INSIDE_FREE: f64 = 0.2e-3;
const FILM_DEEPER: f64 = 2.0;

/// A violated property.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Finding {
    /// Name of the oracle.
    pub oracle: &'static str,
    /// Description with figures.
    pub text: String,
}

/// Names of outputs that only grow.
const GROWING: [&str; 8] = [
    "damping_loss",
    "friction_loss",
    "impact_loss",
    "cutting_work",
    "wear_energy",
    "worn_volume",
    "wear_depth_maximum",
    "internal_steps",
];

/// Allowed decrease of a quantity, as documented in the guide.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Fall {
    /// By this fraction of its scale.
    Rounding(f64),
    /// By rounding, and by [`RETURNED`] of the work of contact forces; if `steps`, only after the internal step has
    /// changed.
    Returned { steps: bool },
    /// Unlimited, but not below zero by more than rounding.
    Spent,
}

/// A quantity that only grows.
#[derive(Debug, Clone)]
struct Growing {
    name: String,
    reference: u32,
    energy: bool,
    may: Fall,
    /// Largest value so far, and the current value.
    most: f64,
    now: f64,
    /// Largest decrease above the documented limit so far: excess, decrease (both as fractions of the scale), time (s).
    worst: Option<[f64; 3]>,
}

impl Growing {
    /// Updates the record at a communication point.
    fn look(&mut self, now: f64, ledger: &Ledger, another_step: bool, time: f64) {
        let scale = if self.energy { ledger.scale() } else { self.most.abs() }.max(f64::MIN_POSITIVE);
        let returned = RETURNED * (ledger.initial.abs() + ledger.contact_work.value());
        let (most, allowed) = match self.may {
            Fall::Rounding(share) => (self.most, share * scale),
            Fall::Returned { steps } if steps && !another_step => (self.most, ROUNDING * scale),
            Fall::Returned { .. } => (self.most, ROUNDING * scale + returned),
            Fall::Spent => (0.0, ROUNDING * scale + returned),
        };
        let beyond = (most - now - allowed) / scale;
        // NaN is found by another oracle.
        if beyond > self.worst.map_or(0.0, |[worst, ..]| worst) {
            self.worst = Some([beyond, (most - now) / scale, time]);
        }
        (self.most, self.now) = (self.most.max(now), now);
    }
}

/// Largest values over a run of everything that should be small.
#[derive(Debug, Clone)]
pub(crate) struct OracleWatch {
    growing: Vec<Growing>,
    /// Initial length of the internal step (s), and whether it has changed.
    step: f64,
    another_step: bool,
    clearance: Option<u32>,
    /// Deepest penetration and the limit of the contact law (m).
    deepest: [f64; 2],
    /// Limit of the instantaneous energy, as a multiple of the conserved energy.
    factor: f64,
    residual: f64,
    /// True if contact forces act, and their work is counted, one internal step after their computation.
    acts_later: bool,
    /// The losses of a step are counted before the instantaneous energy, a mean over two steps, has decreased.
    loses_later: bool,
    /// Fixed steps: the instantaneous energy is a mean over two steps, so that the loss of an impact is counted before the energy has decreased.
    averages: bool,
    /// Bound of the instantaneous energy, and impact losses, at the last communication point (J).
    bound_before: f64,
    loss_before: f64,
    /// Excess of instantaneous energy that the next communication point must explain: excess, energy, bound (J), time
    /// (s).
    pending: Option<[f64; 4]>,
    /// Largest energy beyond its bound: excess, energy, bound (J), time (s).
    excess: Option<[f64; 4]>,
    infinite: Option<String>,
    scale: f64,
}

impl OracleWatch {
    /// Creates the watch of a simulation that has not started.
    pub(crate) fn new(trial: &RandomScene, simulation: &Simulation) -> Self {
        let table = simulation.table();
        let grows = |row: &&tiprub_cosim::variables::Variable| {
            GROWING.contains(&row.name.rsplit('.').next().unwrap_or_default())
        };
        let growing = table.variables().iter().filter(grows).map(|row| Growing {
            name: row.name.clone(),
            reference: row.reference,
            energy: row.name.ends_with("_loss") || row.name.ends_with("_work") || row.name.ends_with("_energy"),
            may: announced(row.name.rsplit('.').next().unwrap_or_default(), &trial.scene),
            most: 0.0,
            now: 0.0,
            worst: None,
        });
        Self {
            growing: growing.collect(),
            step: 0.0,
            another_step: false,
            clearance: table.find("clearance_minimum").map(|row| row.reference),
            deepest: [0.0, promised(&trial.scene, trial.gap)],
            factor: factor(&trial.scene),
            residual: 0.0,
            acts_later: trial.scene.settings.time.scheme == Scheme::MasslessBoundary,
            loses_later: trial.scene.settings.time.scheme == Scheme::CentralDifference,
            averages: trial.scene.settings.time.scheme != Scheme::Galerkin,
            bound_before: 0.0,
            loss_before: 0.0,
            pending: None,
            excess: None,
            infinite: None,
            scale: 0.0,
        }
    }

    /// Begins with a simulation that has started.
    pub(crate) fn begin(&mut self, simulation: &Simulation) {
        self.step = simulation.system().step_size();
        self.bound_before = self.factor * simulation.system().ledger().initial;
    }

    /// Updates the watch at a communication point.
    pub(crate) fn look(&mut self, simulation: &Simulation) {
        let time = simulation.time();
        let real = |reference: u32| simulation.real(reference).unwrap_or(f64::NAN);
        let ledger = simulation.system().ledger();
        self.scale = ledger.scale();
        // Lengths of internal steps differ by rounding where communication steps do.
        self.another_step |= (simulation.system().step_size() / self.step - 1.0).abs() > 1e-9;
        for one in &mut self.growing {
            one.look(real(one.reference), &ledger, self.another_step, time);
        }
        if let Some(clearance) = self.clearance {
            self.deepest[0] = self.deepest[0].min(real(clearance));
        }
        self.deepest[1] = self.deepest[1].max(FILM_DEEPER * warned_depth(simulation));
        let (kinetic, strain) = ["kinetic_energy", "strain_energy"]
            .map(|name| simulation.table().find(name).map_or(f64::NAN, |row| real(row.reference)))
            .into();
        let (conserved_kinetic, conserved_strain) = simulation.system().energies();
        let conserved = conserved_kinetic + conserved_strain;
        if self.scale > 0.0 {
            self.residual = self.residual.max(ledger.residual(conserved).abs() / self.scale);
        }
        let supplied = ledger.initial + ledger.supplied() + ledger.curvature_work.value();
        let loss = ledger.impact_loss.value();
        let loss_before = std::mem::replace(&mut self.loss_before, loss);
        let counted = if self.averages { loss.min(loss_before) } else { loss };
        let bound = self.factor * (supplied - counted).max(conserved).max(0.0)
            + if self.acts_later { INSTANT_LATER } else { INSTANT } * self.scale;
        let last = std::mem::replace(&mut self.bound_before, bound);
        let bound = if self.loses_later { bound.max(last) } else { bound };
        // Work that is counted one internal step later appears in the bound of the next communication point.
        if let Some([_, energy, before, when]) = self.pending.take() {
            self.exceeds([energy - bound.max(before), energy, bound.max(before), when]);
        }
        let found = [kinetic + strain - bound, kinetic + strain, bound, time];
        if self.acts_later {
            self.pending = Some(found).filter(|[excess, ..]| *excess > 0.0);
        } else {
            self.exceeds(found);
        }
        if self.infinite.is_none() {
            self.infinite = infinite(simulation);
        }
    }

    fn exceeds(&mut self, found: [f64; 4]) {
        if found[0] > self.excess.map_or(0.0, |[most, ..]| most) {
            self.excess = Some(found);
        }
    }

    /// Returns the violated properties.
    pub(crate) fn findings(&self) -> Vec<Finding> {
        let mut findings = Vec::new();
        let mut add = |oracle: &'static str, text: String| findings.push(Finding { oracle, text });
        if let Some(name) = &self.infinite {
            add("finite", format!("output {name} is not finite"));
        }
        if self.residual.is_nan() || self.residual > ROUNDING {
            add("ledger", format!("the energy residual is {:.1e} of {:.3e} J exchanged", self.residual, self.scale));
        }
        for one in &self.growing {
            if let Some([beyond, fall, when]) = one.worst {
                let oracle = match one.name.rsplit('.').next().unwrap_or_default() {
                    "friction_loss" => "friction_loss",
                    "impact_loss" => "impact_loss",
                    "damping_loss" => "damping_loss",
                    _ => "wear",
                };
                let text = format!(
                    "{} has decreased by {fall:.1e} at t = {when:.3e} s, {beyond:.1e} more than documented, with \
                     {:.3e} J exchanged; its final value is {:.3e}",
                    one.name, self.scale, one.now
                );
                add(oracle, text);
            }
        }
        if let Some([excess, energy, bound, time]) = self.excess {
            let text = format!(
                "{energy:.4e} J at t = {time:.3e} s, {excess:.1e} J above the bound of {bound:.4e} J, with {:.3e} J \
                 exchanged",
                self.scale
            );
            add("energy", text);
        }
        let [deepest, promised] = self.deepest;
        if -deepest > promised {
            add("penetration", format!("penetration of {:.2e} m, {promised:.1e} m allowed", -deepest));
        }
        findings
    }
}

/// Returns the allowed depth of a contact node within a surface at the end of a step (m).
fn promised(scene: &Scene, gap: f64) -> f64 {
    let coated = scene.settings.contacts.iter().filter_map(|contact| contact.coating.as_ref());
    let thickness = coated.map(|coating| coating.thickness).fold(0.0, f64::max);
    let tolerance = scene.settings.time.step_tolerance().unwrap_or(0.0);
    let film = if solver(scene) == Solver::Film { film_inside(scene) } else { 0.0 };
    thickness + gap * GAP_ROUNDING + loosest_gap(scene, gap) * tolerance + film
}

/// Returns the clearance that the tolerance is a fraction of (m): the smallest one of each structure, and the largest
/// of these.
fn loosest_gap(scene: &Scene, gap: f64) -> f64 {
    let contacts = &scene.settings.contacts;
    let of = |master: &str| {
        let own = contacts.iter().filter(|contact| contact.master == master);
        own.map(ContactSettings::nominal_gap).fold(f64::INFINITY, f64::min)
    };
    contacts.iter().map(|contact| of(&contact.master)).filter(|gap| gap.is_finite()).fold(gap, f64::max)
}

/// Returns the depth up to which the penetration with `film` causes no warning (m).
fn film_inside(scene: &Scene) -> f64 {
    if scene.roms.iter().any(|rom| rom.frame == DisplacementFrame::Cartesian) {
        return FILM_INSIDE_FREE * scene.roms.iter().map(extent).fold(f64::INFINITY, f64::min);
    }
    FILM_INSIDE * scene.settings.contacts.iter().map(ContactSettings::nominal_gap).fold(0.0, f64::max)
}

/// Returns the longest side of the box around the contact nodes of a structure described in fixed directions (m).
fn extent(rom: &Rom) -> f64 {
    let side = |axis: usize| {
        let values = || rom.contact_nodes.iter().map(|node| node.position[axis]);
        values().fold(f64::NEG_INFINITY, f64::max) - values().fold(f64::INFINITY, f64::min)
    };
    (0..3).map(side).fold(0.0, f64::max)
}

/// Returns the depth in the last warning about penetration with `film` (m).
fn warned_depth(simulation: &Simulation) -> f64 {
    let warned = simulation.warnings().iter().filter(|warning| warning.topic() == Topic::FilmInside);
    let depth = |text: &str| text.split_once(" by ")?.1.split_once(" m")?.0.parse().ok();
    warned.map(|warning| depth(&warning.lines()[0]).unwrap_or(f64::NAN)).fold(0.0, f64::max)
}

/// Returns the allowed decrease of a quantity that should only grow, as documented in the guide.
fn announced(name: &str, scene: &Scene) -> Fall {
    let scheme = scene.settings.time.scheme;
    let is_free = scene.roms.iter().any(|rom| rom.frame == DisplacementFrame::Cartesian);
    match name {
        "impact_loss" if scheme == Scheme::Galerkin => Fall::Spent,
        "impact_loss" => Fall::Returned { steps: scheme != Scheme::MasslessBoundary && solver(scene) != Solver::Film },
        "friction_loss" if is_free => Fall::Rounding(STOPPED),
        _ if scheme == Scheme::Galerkin => Fall::Rounding(ITERATED),
        _ => Fall::Rounding(ROUNDING),
    }
}

/// Returns the maximum of the instantaneous energy divided by the energy supplied.
fn factor(scene: &Scene) -> f64 {
    let fastest = scene.roms.iter().map(largest_frequency).fold(0.0, f64::max);
    let half = 0.5 * fastest * scene.settings.time.step;
    let properties = scene.settings.time.scheme.properties();
    if properties.adaptive {
        1.0
    } else if properties.stable_below.is_finite() {
        FACTOR.max(1.0 / (1.0 - half * half).max(0.05))
    } else {
        FACTOR
    }
}

fn infinite(simulation: &Simulation) -> Option<String> {
    let rows = simulation.table().variables().iter();
    let real = |reference: u32| simulation.real(reference).map_or(true, f64::is_finite);
    rows.filter(|row| !(row.reference..).take(row.len()).all(real)).map(|row| row.name.clone()).next()
}

/// Checks that a rejection or an end states the problem, its place and the remedy.
pub(crate) fn names(error: &Error) -> Option<Finding> {
    let finding = |problem: &str| Some(Finding { oracle: "message", text: format!("{problem}: {error}") });
    let (what, problem, remedy) = match error {
        Error::Invalid(Diagnostic { what, problem, remedy, .. }) => (what.as_str(), problem, remedy),
        Error::Unstable(diagnostic) | Error::Exhausted(diagnostic) => ("run", &diagnostic.problem, &diagnostic.remedy),
        Error::NonFinite(_) => return finding("the state became non-finite"),
        Error::State(_) => return finding("it is an unexpected kind of error for a scene"),
    };
    if what.trim().is_empty() || problem.trim().is_empty() {
        return finding("it does not name the place or the problem");
    }
    if what == "run" && !problem.contains(|letter: char| letter.is_ascii_digit()) {
        return finding("it contains no number");
    }
    if remedy.len() < 8 || !remedy.starts_with(|letter: char| letter.is_ascii_uppercase()) {
        return finding("it contains no remedy");
    }
    None
}

/// Checks the message of a failed step: time, reason and remedy.
pub(crate) fn ends(message: &str) -> Option<Finding> {
    let finding = |problem: &str| Some(Finding { oracle: "message", text: format!("{problem}: {message}") });
    if message.contains("non-finite") {
        return finding("the state became non-finite");
    }
    if !message.contains("t = ") {
        return finding("it does not contain the time");
    }
    let remedy = message.rsplit_once(". ").map_or("", |(_, remedy)| remedy);
    if !remedy.starts_with(|letter: char| letter.is_ascii_uppercase()) {
        finding("it contains no remedy")
    } else {
        None
    }
}

/// Returns the solver of a scene.
pub(crate) fn solver(scene: &Scene) -> Solver {
    scene.settings.contacts.first().map_or(Solver::Lcp, |contact| contact.solver)
}
