//! Words for findings: problem and remedy, with the names and the possibilities of a scene.

use std::f64::consts::TAU;
use std::fmt::{Display, Formatter};

use super::finding::{ClosedContact, ErrorKind, Finding, SIGNIFICANT_GROWTH, StepGrowth, Subject, WarningKind};
use super::{Fastest, GROWTH_UP_TO, massless, unresolved};
use crate::scene::method::{Scheme, Solver};
use crate::{Error, Rom, Warning};
use tiprub_cosim::shown;
use tiprub_cosim::warning::Severity;

/// A motion whose frequency (rad/s) is below this fraction of its rate grows without oscillation while blades cut.
const SWINGS: f64 = 1e-3;
/// Smallest friction coefficient that messages propose: no real contact has less.
const LEAST_FRICTION: f64 = 1e-4;
/// Growth rates with and without the mass of the contact nodes that agree within this factor count as equal.
const ALIKE: f64 = 1.25;

/// Names and possibilities of a scene on which texts depend; none by default.
#[derive(Debug, Clone, Copy, Default)]
pub struct Context<'a> {
    /// Name before the problem, if there are several structures.
    pub name: Option<&'a str>,
    /// ROM with the names of the contact nodes.
    pub rom: Option<&'a Rom>,
    /// True if a preset fixes the scheme.
    pub preset: bool,
    /// Adaptive steps, if the scene supports them.
    pub adaptive: Option<AdaptiveSteps>,
}

/// Adaptive steps as a remedy.
#[derive(Debug, Clone, Copy)]
pub struct AdaptiveSteps {
    /// Solver that must replace that of the scene.
    pub solver: Option<Solver>,
}

impl Context<'_> {
    fn named(&self, problem: String) -> String {
        match self.name {
            Some(name) => format!("{name}: {problem}"),
            None => problem,
        }
    }

    fn node(&self, node: usize) -> String {
        let name = self.rom.and_then(|rom| Some(rom.contact_nodes.get(node)?.name.clone()));
        name.unwrap_or_else(|| format!("node {}", node + 1))
    }

    fn contact(&self, contact: &ClosedContact) -> String {
        let names = match contact.nodes.as_slice() {
            [first, .., last] if contact.nodes.len() > 3 => format!("{} to {}", self.node(*first), self.node(*last)),
            nodes => nodes.iter().map(|node| self.node(*node)).collect::<Vec<_>>().join(", "),
        };
        let sectors = if contact.all_sectors { " of all sectors" } else { "" };
        let sense = ["+θ", "−θ"][contact.sense];
        let frictions: Vec<String> = contact.frictions.iter().map(|friction| shown(*friction)).collect();
        format!("closed at {names}{sectors}, sliding in {sense} with µ = {}", frictions.join(" and "))
    }

    /// Returns the remedy of a step that is too long: adaptive steps, if the scene supports them, or one of the alternatives, written in
    /// lower case.
    fn remedy_of_step(&self, alternatives: impl IntoIterator<Item = String>) -> String {
        let adaptive = self.adaptive.map(|AdaptiveSteps { solver }| {
            let preset = if self.preset { "remove `preset`, " } else { "" };
            let solver =
                solver.map_or(String::new(), |solver| format!(" and `contact.solver = \"{}\"`", solver.name()));
            format!("use adaptive steps ({preset}set `time.scheme = \"{}\"`{solver})", Scheme::ADAPTIVE.name())
        });
        let joined = adaptive.into_iter().chain(alternatives).collect::<Vec<_>>().join(", or ");
        joined[..1].to_uppercase() + &joined[1..]
    }

    fn other_scheme(&self) -> String {
        if self.preset {
            "remove `preset`, which fixes the scheme".to_owned()
        } else {
            format!("use the scheme {}", Scheme::default().name())
        }
    }
}

/// Returns the remedy of a shorter step than this (s), with the names in the scene and in the FMU.
fn shorter(step: f64) -> String {
    format!("set `time.step` (in the FMU `internal_step_max`) below {step:.6e} s")
}

/// Rounds a step (s) to three digits.
fn rounded(step: f64) -> f64 {
    format!("{step:.2e}").parse().unwrap_or(step)
}

/// Rounds a step (s) down to three digits, so that following a proposal does not repeat its message.
fn rounded_down(step: f64) -> f64 {
    let near = rounded(step);
    if near <= step { near } else { rounded(0.995 * step) }
}

fn kilohertz(frequency: f64) -> f64 {
    1e-3 * frequency / TAU
}

/// Describes whether a motion that grows without the mass of the contact nodes also grows with it.
fn confirmed(found: &Fastest, with_mass: Option<&Fastest>) -> String {
    match with_mass {
        Some(other) if other.rate < ALIKE * found.rate && found.rate < ALIKE * other.rate => {
            " (the same with and without the mass of the contact nodes, so more modes will hardly change it)".to_owned()
        }
        Some(other) => format!(
            " (without the mass of the contact nodes; {:.2e} 1/s with it, so more modes may change it)",
            other.rate.max(0.0)
        ),
        None => String::new(),
    }
}

impl Finding {
    /// Returns the warning.
    pub fn warning(&self, context: &Context) -> Warning {
        let (topic, problem) = (self.kind.topic(), self.kind.problem(self.of, context));
        let remedy = self.kind.remedy().unwrap_or_else(|| topic.remedy().trim_end_matches('.').to_owned());
        let text = self.kind.explanation().map(|explanation| format!("{problem}. {explanation}. {remedy}"));
        let mut warning = Warning::new(topic, problem, remedy);
        if let Some(text) = text {
            warning = warning.with_text(text);
        }
        if matches!(self.kind, WarningKind::Flutter { opens_after: Some(_), .. }) {
            warning = warning.at_level(Severity::Note);
        }
        match context.name {
            Some(name) => warning.named(name),
            None => warning,
        }
    }
}

impl WarningKind {
    fn problem(&self, of: Subject, context: &Context) -> String {
        match self {
            Self::UnresolvedModes { scheme, step, .. } => format!(
                "modes above {:.4} kHz are not resolved by the internal step of {step:.3e} s: their free motion is \
                 exact, but their response to contact forces is not",
                kilohertz(scheme.properties().resolved_up_to / step)
            ),
            Self::UnresolvedFlexibility { scheme, step, .. } => format!(
                "{} with an internal step of {step:.3e} s leaves much of the contact flexibility unresolved: expect \
                 errors of a few per cent",
                scheme.name()
            ),
            Self::MasslessEnergy { step, .. } => format!(
                "with massless-boundary and an internal step of {step:.3e} s, contact that opens and closes may gain \
                 energy (visible as a decreasing `impact_loss`)"
            ),
            Self::MasslessBlades { stable, sectors } => format!(
                "massless-boundary is proven stable for up to {stable:.0} blades in simultaneous contact with the \
                 casing, not for all {sectors}"
            ),
            Self::LockUp { contact, friction, rate } => {
                let rate =
                    rate.map_or(String::new(), |rate| format!(", at a rate of {rate:.2e} 1/s without oscillation"));
                format!("sliding contact locks up above µ* = {friction:.3}{rate}: {}", context.contact(contact))
            }
            Self::Flutter { contact, motion: Fastest { rate, frequency }, .. } => format!(
                "friction makes vibration grow while contact stays closed: it grows at {rate:.2e} 1/s at {:.4} kHz with \
                 contact {}",
                kilohertz(*frequency),
                context.contact(contact)
            ),
            Self::StepGrowth(growth) => format!(
                "the time step destabilises sliding contact: {}, with vibration growing at {}; this may displace the \
                 tips by {:.0} % of the displacement caused by contact",
                context.contact(&growth.contact),
                growth.compared(growth.rates.continuous.max(0.0)),
                100.0 * growth.error
            ),
            Self::ReversedGrowth(growth) => {
                ErrorKind::StepGrowth(growth.clone()).of(of).error(&Context { name: None, ..*context }).to_string()
            }
            Self::CuttingGrowth(Fastest { rate, frequency }) => {
                // Growth without oscillation within the growth time is no vibration.
                let motion = if *frequency < SWINGS * rate {
                    "deflection in one direction".to_owned()
                } else {
                    format!("vibration at {:.4} kHz", kilohertz(*frequency))
                };
                format!(
                    "cutting is physically unstable: with all contact nodes of a blade in fresh coating, {motion} grows \
                     at {rate:.2e} 1/s"
                )
            }
            Self::GrowthUnchecked { modes, .. } => format!(
                "the growth of vibration in closed, sliding contact is not checked: the model has {modes} modes, and \
                 the check supports only {GROWTH_UP_TO}"
            ),
            Self::OtherSense => "the rotor now rotates opposite to its initial direction: the growth of vibration in \
                                 contact that slides in this direction was not checked, because the check takes a long \
                                 time with coupled sectors"
                .to_owned(),
            Self::CasingSolvability { friction, step, eigenvalue, angle } => format!(
                "with µ = {} and an internal step of {step:.3e} s, the contribution of the casing to the Delassus matrix \
                 is not positive semidefinite (lowest eigenvalue {eigenvalue:.2e} times the largest, at θ = {angle:.2} \
                 rad)",
                shown(*friction)
            ),
            Self::FlightSolvability { friction, eigenvalue } => format!(
                "with µ = {} the contact problem cannot be shown to have a unique solution for all contacts that the \
                 undeformed structure makes in free flight (the symmetric part of the Delassus matrix, scaled to unit \
                 diagonal, has the eigenvalue {eigenvalue:.2e})",
                shown(*friction)
            ),
            Self::RigidContact { scheme, modes, rigid, directions } => format!(
                "with {} the {modes} highest modes respond quasi-statically to contact, so {rigid} of {directions} \
                 directions of the contact nodes have no independent flexibility: contact that acts in one of these \
                 directions loses energy at any tolerance",
                scheme.name()
            ),
            Self::CoarseExcitation { scheme, turn, amplitude, frequency, .. } => format!(
                "the {} rotates by {turn:.2} rad in one internal step: {} makes a resonance {:.0} % too large and shifts \
                 its frequency by {:.1} %",
                if matches!(of, Subject::Carrier(_)) { "load" } else { "excitation" },
                scheme.name(),
                100.0 * amplitude,
                100.0 * frequency
            ),
        }
    }

    /// Returns the remedy if it is more specific than that of the topic.
    fn remedy(&self) -> Option<String> {
        Some(match self {
            Self::UnresolvedModes { scheme, frequency, .. } => {
                let step = rounded_down(scheme.properties().resolved_up_to / frequency);
                format!("Set `time.step` = {step:.2e} s to resolve all modes")
            }
            Self::UnresolvedFlexibility { limit, .. } => {
                format!("Set `time.step` below {:.2e} s", rounded_down(unresolved::NEAR * limit))
            }
            Self::MasslessEnergy { limit, .. } => {
                let step = rounded_down(massless::QUIET * limit.closed);
                format!("Set `time.step` below {step:.2e} s, or compare the energies with those of half the step")
            }
            Self::Flutter { opens_after: Some(time), .. } => {
                format!(
                    "No action is needed: contact opens after at most {time:.2e} s, before this vibration has grown by a \
                     factor of {SIGNIFICANT_GROWTH:.0}"
                )
            }
            Self::Flutter { tolerance, .. } => {
                let remedy =
                    "Use less friction or more damping, or let contact open sooner; a shorter step does not help";
                let unresolved = tolerance.map_or(String::new(), |tolerance| {
                    format!(
                        ". Vibration far below the tolerance of the adaptive steps ({}) is not resolved and may decay in \
                         the run: compare with a smaller `time.tolerance`",
                        shown(tolerance)
                    )
                });
                format!("{remedy}{unresolved}")
            }
            Self::StepGrowth(growth) => growth.silent.map_or_else(
                || "Use less friction or more damping".to_owned(),
                |step| format!("Set `time.step` to {} or less", shown(rounded_down(step))),
            ),
            Self::ReversedGrowth(_) => {
                "Change the speed before the next step, which would otherwise end the run".to_owned()
            }
            // Adaptive steps add no growth: any growth is a property of the equations.
            Self::GrowthUnchecked { scheme, .. } if scheme.properties().adaptive => {
                "Check a ROM with fewer modes for flutter and self-locking".to_owned()
            }
            Self::GrowthUnchecked { .. } => "Halve the internal step and compare the results".to_owned(),
            Self::CoarseExcitation { excess, .. } => {
                let scheme = Scheme::default().name();
                format!("Use {scheme}, or make internal_step_max (time.step) {excess:.1} times smaller")
            }
            _ => return None,
        })
    }

    /// Returns sentences for logs that explain the problem, without the last full stop.
    fn explanation(&self) -> Option<String> {
        match self {
            Self::LockUp { .. } => Some(
                "The tip is driven into the casing faster than the casing deflects, and the contact force grows without \
                 limit. This instability is a physical property of the model, so a shorter step does not help"
                    .to_owned(),
            ),
            Self::Flutter { motion, with_mass, share, .. } => Some(format!(
                "Sliding contact is physically unstable (flutter): this motion displaces the tips by up to {:.1} % of \
                 the displacement caused by contact{}. This instability is a physical property of the model",
                100.0 * share,
                confirmed(motion, with_mass.as_ref())
            )),
            _ => None,
        }
    }
}

impl StepGrowth {
    /// Compares the growth with that in continuous time (1/s).
    fn compared(&self, continuous: f64) -> String {
        format!(
            "{:.2e} 1/s in steps of {} s, but at {continuous:.2e} 1/s in continuous time",
            self.rates.stepped,
            shown(rounded(self.step))
        )
    }
}

impl Finding<ErrorKind> {
    /// Returns the error.
    pub fn error(&self, context: &Context) -> Error {
        let [problem, remedy] = self.kind.texts(context);
        match self.kind {
            ErrorKind::StiffContact { .. } | ErrorKind::RigidNormal => {
                Error::invalid("scheme massless-boundary", problem, remedy)
            }
            _ => Error::unstable(context.named(problem), remedy),
        }
    }
}

impl ErrorKind {
    /// Returns problem and remedy.
    fn texts(&self, context: &Context) -> [String; 2] {
        match self {
            Self::UnstableStep { scheme, frequency, step } => {
                let limit = scheme.properties().stable_below;
                [
                    format!(
                        "{} is unstable with an internal step of {step:.3e} s: ω_max·h = {:.4}, but the stability limit \
                         is {limit}",
                        scheme.name(),
                        frequency * step
                    ),
                    context.remedy_of_step([shorter(limit / frequency), context.other_scheme()]),
                ]
            }
            Self::UnresolvedContact { scheme, step, limit, frequency } => [
                format!(
                    "{} with an internal step of {step:.3e} s (ω_max·h = {:.4}) does not resolve modes above {:.4} \
                     kHz, which account for more than half of the contact flexibility: forces, friction work and \
                     energies would be wrong by ten per cent, and by far more with longer steps",
                    scheme.name(),
                    frequency * step,
                    kilohertz(scheme.properties().resolved_up_to / step)
                ),
                context.remedy_of_step([
                    format!(
                        "{}, preferably below {:.3e} s",
                        shorter(*limit),
                        scheme.properties().resolved_up_to / frequency
                    ),
                    "use massless-boundary".to_owned(),
                ]),
            ],
            Self::Unsolvable { friction, step, solvable_below, is_proven } => {
                let (what, why) = if *is_proven {
                    ("has no unique solution", "a principal minor of the Delassus matrix is not positive")
                } else {
                    (
                        "cannot be shown to have a unique solution",
                        "the symmetric part of the Delassus matrix is not positive definite",
                    )
                };
                [
                    format!(
                        "with friction_coefficient µ = {} and internal steps up to h = {step:.3e} s, the contact problem \
                         {what} ({why})",
                        shown(*friction)
                    ),
                    if *solvable_below >= LEAST_FRICTION {
                        format!("Use µ below {solvable_below:.4} for this structure, or another internal step")
                    } else {
                        "Use no friction, fewer contact nodes or more modes: with more contacts than modes, no friction \
                         coefficient is safe"
                            .to_owned()
                    },
                ]
            }
            Self::Jammed { friction, step, node } => [
                format!(
                    "with friction_coefficient µ = {} and an internal step of {step:.3e} s, the contact problem of {} \
                     alone has no unique solution in free flight: friction drives it into the surface",
                    shown(*friction),
                    context.node(*node)
                ),
                "Use less friction, another internal step, or the solver coulomb".to_owned(),
            ],
            Self::MasslessStep { step, limit } => [
                format!(
                    "the internal step of {step:.3e} s is too long for massless-boundary: closed contact on the residual \
                     flexibility of the contact nodes is stable only below {:.6e} s, and contact that opens and closes \
                     gains energy above {:.6e} s",
                    limit.closed, limit.usable
                ),
                context.remedy_of_step([shorter(limit.usable), context.other_scheme()]),
            ],
            Self::StiffContact { factor } => [
                format!(
                    "closed contact raises the square of the highest frequency of the modes with inertia by a factor of \
                     {factor:.3e}, so bouncing nodes gain energy with any internal step"
                ),
                "Use modal-exact, or a ROM with more modes or softer contact nodes".to_owned(),
            ],
            Self::RigidNormal => [
                "the quasi-static modes have no flexibility along the normal of a contact node".to_owned(),
                "Use modal-exact, or a ROM with the contact nodes as the interface of the reduction".to_owned(),
            ],
            Self::StepGrowth(growth) => [
                format!(
                    "`time.step` is too long for friction: vibration in contact ({}) grows at {}, and this alone may \
                     displace the tips by {:.0} % of the displacement caused by contact",
                    context.contact(&growth.contact),
                    growth.compared(growth.rates.continuous),
                    100.0 * growth.error
                ),
                context.remedy_of_step(
                    growth
                        .accepted
                        .map(|step| {
                            let step = shown(rounded_down(step));
                            format!("set `time.step` (in the FMU `internal_step_max`) to {step} or less")
                        })
                        .into_iter()
                        .chain(["use less friction or more damping".to_owned()]),
                ),
            ],
        }
    }
}

impl Display for ErrorKind {
    fn fmt(&self, out: &mut Formatter<'_>) -> std::fmt::Result {
        self.clone().of(Subject::Scene).error(&Context::default()).fmt(out)
    }
}

impl std::error::Error for ErrorKind {}
