//! What must hold of any scene: energy, losses, penetration, finite outputs, messages.

use tiprub_core::settings::{Scheme, Solver};
use tiprub_core::{Error, Scene, Simulation};

use super::scenes::Trial;
use super::structures::largest_frequency;

/// Rounding of the energy ledger, as a fraction of all energy exchanged.
const ROUNDING: f64 = 1e-9;
/// Galerkin seeks the contact forces of a step by iterations: work that these leave, as a fraction of all energy exchanged.
const ITERATED: f64 = 1e-5;
/// Energy of the instant beyond its bound, as a fraction of all energy exchanged.
const INSTANT: f64 = 1e-2;
/// Kinetic plus strain energy of the instant may be so many times what was supplied, as `check_energy` of the core has it: that of a
/// step scheme equals what the scheme conserves up to the second order of the step only, and work on quasi-static modes is known a step late.
const FACTOR: f64 = 4.0;
/// Rounding of gaps, as a fraction of the clearance.
const GAP_ROUNDING: f64 = 1e-9;

/// Something that must not be.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Finding {
    /// Which oracle.
    pub oracle: &'static str,
    /// Figures.
    pub text: String,
}

/// Outputs that only grow, and their names.
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

/// A quantity that only grows.
#[derive(Debug, Clone)]
struct Growing {
    name: String,
    reference: u32,
    energy: bool,
    before: f64,
    /// Largest fall so far, and most negative value, as fractions of the scale.
    fall: f64,
    lowest: f64,
    when: f64,
}

/// Largest of everything that should be small, over a run.
#[derive(Debug, Clone)]
pub(crate) struct Watch {
    growing: Vec<Growing>,
    clearance: Option<u32>,
    /// Deepest penetration and what the law promises (m).
    deepest: [f64; 2],
    /// Energy of the instant may be so many times what the scheme conserves.
    factor: f64,
    residual: f64,
    /// Losses may fall by this fraction of all energy exchanged.
    rounding: f64,
    /// Largest energy beyond its bound: excess, energy, bound (J), time (s).
    excess: Option<[f64; 4]>,
    infinite: Option<String>,
    scale: f64,
}

impl Watch {
    /// Of a simulation that was not started yet.
    pub(crate) fn new(trial: &Trial, simulation: &Simulation) -> Self {
        let table = simulation.table();
        let grows = |row: &&tiprub_core::variables::Variable| {
            GROWING.contains(&row.name.rsplit('.').next().unwrap_or_default())
        };
        let growing = table.variables().iter().filter(grows).map(|row| Growing {
            name: row.name.clone(),
            reference: row.reference,
            energy: row.name.ends_with("_loss") || row.name.ends_with("_work") || row.name.ends_with("_energy"),
            before: 0.0,
            fall: 0.0,
            lowest: 0.0,
            when: 0.0,
        });
        Self {
            growing: growing.collect(),
            clearance: table.find("clearance_minimum").map(|row| row.reference),
            deepest: [0.0, promised(&trial.scene, trial.gap)],
            factor: factor(&trial.scene),
            residual: 0.0,
            rounding: if trial.scene.settings.time.scheme == Scheme::Galerkin { ITERATED } else { ROUNDING },
            excess: None,
            infinite: None,
            scale: 0.0,
        }
    }

    /// At a communication point.
    pub(crate) fn look(&mut self, simulation: &Simulation) {
        let time = simulation.time();
        let real = |reference: u32| simulation.real(reference).unwrap_or(f64::NAN);
        let ledger = simulation.system().ledger();
        self.scale = ledger.scale();
        for one in &mut self.growing {
            let now = real(one.reference);
            let scale = if one.energy { self.scale } else { one.before.abs() }.max(f64::MIN_POSITIVE);
            let fall = (one.before - now) / scale;
            if fall > one.fall {
                (one.fall, one.when) = (fall, time);
            }
            one.lowest = one.lowest.min(now / scale);
            one.before = now;
        }
        if let Some(clearance) = self.clearance {
            self.deepest[0] = self.deepest[0].min(real(clearance));
        }
        let (kinetic, strain) = ["kinetic_energy", "strain_energy"]
            .map(|name| simulation.table().find(name).map_or(f64::NAN, |row| real(row.reference)))
            .into();
        let (conserved_kinetic, conserved_strain) = simulation.system().energies();
        let conserved = conserved_kinetic + conserved_strain;
        if self.scale > 0.0 {
            self.residual = self.residual.max(ledger.residual(conserved).abs() / self.scale);
        }
        let supplied = ledger.initial + ledger.supplied() + ledger.curvature_work.value();
        let bound =
            self.factor * (supplied - ledger.impact_loss.value()).max(conserved).max(0.0) + INSTANT * self.scale;
        let excess = kinetic + strain - bound;
        if excess > self.excess.map_or(0.0, |[most, ..]| most) {
            self.excess = Some([excess, kinetic + strain, bound, time]);
        }
        if self.infinite.is_none() {
            self.infinite = infinite(simulation);
        }
    }

    /// What does not hold.
    pub(crate) fn findings(&self) -> Vec<Finding> {
        let mut findings = Vec::new();
        let mut add = |oracle: &'static str, text: String| findings.push(Finding { oracle, text });
        if let Some(name) = &self.infinite {
            add("finite", format!("output {name}"));
        }
        if self.residual.is_nan() || self.residual > ROUNDING {
            add("ledger", format!("the ledger is off by {:.1e} of {:.3e} J exchanged", self.residual, self.scale));
        }
        for one in &self.growing {
            if one.fall > self.rounding || one.lowest < -self.rounding {
                let oracle = match one.name.rsplit('.').next().unwrap_or_default() {
                    "friction_loss" => "friction_loss",
                    "impact_loss" => "impact_loss",
                    "damping_loss" => "damping_loss",
                    _ => "wear",
                };
                let text = format!(
                    "{} falls by {:.1e} in a step (t = {:.3e} s) and is {:.1e} at its lowest, of {:.3e} J exchanged; it ends at {:.3e}",
                    one.name, one.fall, one.when, one.lowest, self.scale, one.before
                );
                add(oracle, text);
            }
        }
        if let Some([excess, energy, bound, time]) = self.excess {
            let text = format!(
                "{energy:.4e} J at t = {time:.3e} s, {excess:.1e} J above {bound:.4e} J, of {:.3e} J exchanged",
                self.scale
            );
            add("energy", text);
        }
        let [deepest, promised] = self.deepest;
        if -deepest > promised {
            add("penetration", format!("{:.2e} m deep, {promised:.1e} m promised", -deepest));
        }
        findings
    }
}

/// How deep a contact node may be within a surface at the end of a step (m).
fn promised(scene: &Scene, gap: f64) -> f64 {
    let coated = scene.settings.contacts.iter().filter_map(|contact| contact.coating.as_ref());
    let thickness = coated.map(|coating| coating.thickness).fold(0.0, f64::max);
    let tolerance = match scene.settings.time.scheme {
        Scheme::Galerkin => scene.settings.time.tolerance.unwrap_or(tiprub_core::settings::TOLERANCE),
        _ => 0.0,
    };
    thickness + gap * (GAP_ROUNDING + tolerance)
}

/// Energy of the instant over what was supplied, at most.
fn factor(scene: &Scene) -> f64 {
    let fastest = scene.roms.iter().map(largest_frequency).fold(0.0, f64::max);
    let half = 0.5 * fastest * scene.settings.time.step;
    match scene.settings.time.scheme {
        Scheme::CentralDifference => FACTOR.max(1.0 / (1.0 - half * half).max(0.05)),
        Scheme::ModalExact | Scheme::MasslessBoundary => FACTOR,
        Scheme::Galerkin => 1.0,
    }
}

fn infinite(simulation: &Simulation) -> Option<String> {
    let rows = simulation.table().variables().iter();
    let real = |reference: u32| simulation.real(reference).map_or(true, f64::is_finite);
    rows.filter(|row| !(row.reference..).take(row.len()).all(real)).map(|row| row.name.clone()).next()
}

/// A rejection or an end must say what, where and what to do.
pub(crate) fn names(error: &Error) -> Option<Finding> {
    let finding = |problem: &str| Some(Finding { oracle: "message", text: format!("{problem}: {error}") });
    let (what, problem, remedy) = match error {
        Error::Invalid { what, problem, remedy } => (what.as_str(), problem, remedy),
        Error::Unstable { problem, remedy } | Error::Exhausted { problem, remedy } => ("run", problem, remedy),
        Error::NonFinite { .. } => return finding("the state became non-finite"),
        Error::UnknownReference { .. } | Error::State { .. } => return finding("it is no answer to a scene"),
    };
    if what.trim().is_empty() || problem.trim().is_empty() {
        return finding("it does not name what or where");
    }
    if what == "run" && !problem.contains(|letter: char| letter.is_ascii_digit()) {
        return finding("it has no figure");
    }
    if remedy.len() < 8 || !remedy.starts_with(|letter: char| letter.is_ascii_uppercase()) {
        return finding("it has no remedy");
    }
    None
}

/// The message of a step that was not done: when, why, and what to do.
pub(crate) fn ends(message: &str) -> Option<Finding> {
    let finding = |problem: &str| Some(Finding { oracle: "message", text: format!("{problem}: {message}") });
    if message.contains("non-finite") {
        return finding("the state became non-finite");
    }
    if !message.contains("t = ") {
        return finding("it does not say when");
    }
    let remedy = message.rsplit_once(". ").map_or("", |(_, remedy)| remedy);
    if !remedy.starts_with(|letter: char| letter.is_ascii_uppercase()) { finding("it has no remedy") } else { None }
}

/// The law that a scene is solved by.
pub(crate) fn solver(scene: &Scene) -> Solver {
    scene.settings.contacts.first().map_or(Solver::Lcp, |contact| contact.solver)
}
