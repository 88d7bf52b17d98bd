//! Stability and solvability of a scene at the step sizes it can be stepped with.

use super::{Compiled, Simulation};
use crate::settings::{Meridian, Scheme, Solver};
use crate::stability::{self, ContactDirections, Growth};
use crate::variables::Quantity;
use crate::{Error, Result};

/// Contact nodes up to this number are looked at in every combination; beyond, alone, in neighbouring pairs, and all.
const ALL_COMBINATIONS_UP_TO: usize = 3;

/// Parameters that decide stability.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Parameters {
    pub friction: f64,
    pub damping_ratio: f64,
    /// Of the structure that carries the surface.
    pub slave_damping_ratio: Option<f64>,
    /// Largest internal step (s).
    pub step: f64,
    pub scheme: Scheme,
    pub solver: Solver,
    /// Sign of the speed at the start; 0 for a rotor that starts at rest.
    pub sense: f64,
}

/// What is known about the limits with some parameters.
#[derive(Debug, Clone)]
pub struct Limits {
    parameters: Parameters,
    /// Warnings for the step expected, or why these parameters are refused.
    outcome: Result<Vec<String>>,
    /// Largest step of each range of step sizes, descending, and why it is refused, if it is.
    ranges: Vec<(f64, Option<Error>)>,
}

impl Simulation {
    pub(super) fn parameters(&self) -> Parameters {
        let chosen = |quantity| self.value_of(quantity);
        let scheme = match chosen(Quantity::SchemeChoice) {
            ..1.5 => Scheme::CentralDifference,
            1.5..2.5 => Scheme::ModalExact,
            _ => Scheme::MasslessBoundary,
        };
        let solver = match chosen(Quantity::SolverChoice) {
            ..1.5 => Solver::Film,
            1.5..2.5 => Solver::Lcp,
            _ => Solver::Coulomb,
        };
        let speed = self.inputs.speed.value;
        Parameters {
            friction: self.value_of(Quantity::Friction),
            damping_ratio: self.value_of(Quantity::DampingRatio),
            slave_damping_ratio: self.compiled.roles.carrier.map(|_| self.value_of(Quantity::SlaveDampingRatio)),
            step: self.value_of(Quantity::StepMax),
            scheme,
            solver,
            sense: if speed == 0.0 { 0.0 } else { speed.signum() },
        }
    }

    /// Check limits unless the same parameters were checked last.
    pub(super) fn check_limits(&mut self, parameters: Parameters) -> Result<()> {
        if self.limits.as_ref().is_none_or(|limits| limits.parameters != parameters) {
            self.limits = Some(self.compiled.limits(parameters));
        }
        self.warnings = match &self.limits {
            Some(limits) => limits.outcome.clone()?,
            None => Vec::new(),
        };
        Ok(())
    }

    /// Refuse a step size (s) whose range was found unstable. Only looks up, so that a step does not allocate.
    pub(super) fn check_step_size(&self, step: f64) -> Result<()> {
        let Some(limits) = &self.limits else { return Ok(()) };
        stability::check_step_allowed(&self.compiled.model, limits.parameters.scheme, step)?;
        // The range a step belongs to is that of the smallest entry not below it.
        let range = limits.ranges.iter().rev().find(|(largest, _)| step <= largest * (1.0 + super::SAME_STEP));
        match range {
            Some((_, Some(refusal))) => Err(refusal.clone()),
            _ => Ok(()),
        }
    }
}

impl Compiled {
    /// Internal step (s) to expect: what the proposed communication step is divided into.
    fn expected_step(&self, largest: f64) -> f64 {
        let length = self.scene.settings.experiment.communication_step;
        length / (length / largest * (1.0 - super::SAME_STEP)).ceil().max(1.0)
    }

    fn limits(&self, parameters: Parameters) -> Limits {
        let mut model = self.model.clone();
        model.damping_ratios.fill(parameters.damping_ratio);
        let at = Checking { compiled: self, model, parameters };
        let expected = self.expected_step(parameters.step);
        let outcome = at.expected(expected);
        let ranges = if parameters.friction == 0.0 {
            Vec::new()
        } else {
            let senses = at.senses();
            let steps = stability::growth_steps(&at.model, parameters.step);
            let refusal = |step| senses.iter().find_map(|sense| at.growth(step, *sense, false).err());
            steps.map(|step| (step, refusal(step))).collect()
        };
        Limits { parameters, outcome, ranges: at.with_expected(ranges, expected) }
    }
}

/// A scene with some parameters, about to be checked.
struct Checking<'a> {
    compiled: &'a Compiled,
    model: crate::dynamics::modal::ModalModel,
    parameters: Parameters,
}

impl Checking<'_> {
    /// Everything at the step to expect; returns warnings.
    fn expected(&self, step: f64) -> Result<Vec<String>> {
        let Parameters { friction, scheme, .. } = self.parameters;
        let mut warnings: Vec<String> = stability::check_step(&self.model, scheme, step)?.into_iter().collect();
        let directions = [1.0, -1.0].map(|sense| self.directions(sense));
        stability::check_solvable(&self.model, scheme, self.parameters.step, friction, &directions)?;
        if friction > 0.0 {
            let senses = self.senses();
            for sense in &senses {
                warnings.extend(self.growth(step, *sense, true)?);
            }
            if let [sense] = senses[..] {
                let reversed = self.growth(step, -sense, true).unwrap_or_else(|refusal| vec![refusal.to_string()]);
                warnings
                    .extend(reversed.into_iter().map(|text| format!("should the rotor turn the other way: {text}")));
            }
        }
        Ok(warnings)
    }

    /// Senses of slip to expect.
    fn senses(&self) -> Vec<f64> {
        if self.parameters.sense == 0.0 { vec![1.0, -1.0] } else { vec![self.parameters.sense] }
    }

    /// The step to expect was looked at by itself: it bounds a range of its own.
    fn with_expected(&self, mut ranges: Vec<(f64, Option<Error>)>, expected: f64) -> Vec<(f64, Option<Error>)> {
        ranges.retain(|(step, _)| (step - expected).abs() > super::SAME_STEP * expected);
        ranges.push((expected, None));
        ranges.sort_by(|a, b| b.0.total_cmp(&a.0));
        ranges
    }

    /// Normals and slip directions of the contact nodes on a round casing.
    fn directions(&self, sense: f64) -> ContactDirections {
        let meridian = self.compiled.contact().meridian;
        let nodes = self.compiled.master().1.contact_nodes.iter();
        nodes
            .map(|node| {
                let slope = if meridian == Meridian::Contour { node.meridional_slope } else { 0.0 };
                let length = (1.0 + slope * slope).sqrt();
                ([-1.0 / length, 0.0, slope / length], [0.0, sense, 0.0])
            })
            .collect()
    }

    /// Sets of closed contact nodes: all combinations of a few; of many every one alone, neighbours, and all.
    fn combinations(&self) -> Vec<Vec<usize>> {
        let nodes = self.compiled.master().1.contact_nodes.len();
        if nodes <= ALL_COMBINATIONS_UP_TO {
            let members = |set: usize| (0..nodes).filter(|node| set >> node & 1 == 1).collect();
            return (1..1 << nodes).map(members).collect();
        }
        let alone = (0..nodes).map(|node| vec![node]);
        let pairs = (1..nodes).map(|node| vec![node - 1, node]);
        alone.chain(pairs).chain([(0..nodes).collect()]).collect()
    }

    /// Growth of closed sliding contact at one step size and sense of slip; returns warnings of flutter.
    fn growth(&self, step: f64, sense: f64, warn: bool) -> Result<Vec<String>> {
        let Parameters { friction, scheme, .. } = self.parameters;
        let all = self.directions(sense);
        let mut warnings = Vec::new();
        for nodes in self.combinations() {
            let directions = nodes.iter().map(|node| all[*node]).collect();
            let model = self.model.with_nodes(&nodes);
            let Some(found) = stability::growth(&model, scheme, step, friction, &directions) else { continue };
            if found.is_added() {
                return Err(self.refusal(&nodes, sense, step, found));
            }
            if warn && found.is_flutter() {
                warnings.push(format!(
                    "{} is physically unstable (flutter), growth rate {:.3e} 1/s",
                    self.contact(&nodes, sense),
                    found.continuous
                ));
            }
        }
        Ok(warnings)
    }

    /// Which contact is meant.
    fn contact(&self, nodes: &[usize], sense: f64) -> String {
        let names: Vec<&str> =
            nodes.iter().map(|node| self.compiled.master().1.contact_nodes[*node].name.as_str()).collect();
        let direction = if sense > 0.0 { "+θ" } else { "−θ" };
        format!(
            "with µ = {}, contact closed at {} and sliding in {direction}",
            self.parameters.friction,
            names.join(", ")
        )
    }

    fn refusal(&self, nodes: &[usize], sense: f64, step: f64, found: Growth) -> Error {
        Error::Unstable {
            problem: format!(
                "{} grows by {:.3e} 1/s when stepped with h = {step:.3e} s, by {:.3e} 1/s without time discretisation",
                self.contact(nodes, sense),
                found.stepped,
                found.continuous
            ),
            remedy:
                "Use a smaller internal step (internal_step_max, or a shorter communication step), less friction or \
                     more damping"
                    .to_owned(),
        }
    }
}
