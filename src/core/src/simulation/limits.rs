//! Stability and solvability of a scene at the step sizes it can be stepped with.

mod free;
mod told;

use super::plan::PairPlan;
use super::table::has_one_friction;
use super::{Compiled, Simulation};
use crate::dynamics::cyclic::CyclicModel;
use crate::dynamics::modal::ModalModel;
use crate::gaps::spline::{Frame, SplineGap};
use crate::gaps::{GapLaw, dot};
use crate::settings::{Meridian, Scheme, Solver};
use crate::stability::massless::MasslessLimit;
use crate::stability::{self, ContactDirections, Growth, massless};
use crate::system::System;
use crate::variables::Quantity;
use crate::{Error, Result, shown};
use nalgebra::DMatrix;
pub(super) use told::Told;

/// Contact nodes up to this number are looked at in every combination; beyond, alone, in neighbouring pairs, and all.
const ALL_COMBINATIONS_UP_TO: usize = 3;

/// Parameters that decide stability.
#[derive(Debug, Clone, PartialEq)]
pub struct Parameters {
    /// Of each contact pair.
    pub friction: Vec<f64>,
    /// Of the structures that touch, then of those that carry surfaces.
    pub damping_ratios: Vec<f64>,
    /// Largest internal step (s).
    pub step: f64,
    pub scheme: Scheme,
    pub solver: Solver,
    /// Sign of the speed of each structure that touches at the start; 0 for a rotor that starts at rest.
    pub senses: Vec<f64>,
    /// Velocities of structures that fly freely at the start (m/s).
    pub velocities: Vec<[f64; 3]>,
}

impl Parameters {
    /// Largest friction coefficient of a structure.
    pub fn friction_of(&self, compiled: &Compiled, body: usize) -> f64 {
        compiled.plan.pairs_of(body).map(|(pair, _)| self.friction[pair]).fold(0.0, f64::max)
    }
}

/// What is known about the limits with some parameters.
#[derive(Debug, Clone)]
pub struct Limits {
    /// Without the senses.
    parameters: Parameters,
    /// Of each structure that touches.
    bodies: Vec<BodyLimits>,
}

/// Of one structure and what it touches.
#[derive(Debug, Clone)]
struct BodyLimits {
    /// Warnings for the step expected, or why these parameters are refused, whatever the sense of slip.
    outcome: Result<Vec<String>>,
    /// Slip in +θ and in −θ; of a disk, for which it takes long, only what was asked for.
    senses: [Option<Sense>; 2],
    /// Steps of massless-boundary; infinite for other schemes.
    massless: MasslessLimit,
    /// Largest step of each range of step sizes, descending, and what the casing does to solvability there.
    casing: Vec<(f64, Option<String>)>,
    /// Smallest step of modal-exact that passes over what contact acts on; infinite for other schemes.
    unresolved: f64,
}

/// Growth of sliding contact in one sense.
#[derive(Debug, Clone)]
struct Sense {
    /// Warnings for the step expected, or why it is refused.
    outcome: Result<Vec<String>>,
    /// Largest step of each range of step sizes, descending, and why it is refused, if it is.
    ranges: Vec<(f64, Option<Error>)>,
}

/// Senses of slip of a speed or of its sign: both where it is 0.
fn senses_of(sense: f64) -> impl Iterator<Item = usize> {
    [sense >= 0.0, sense <= 0.0].into_iter().enumerate().filter(|(_, slips)| *slips).map(|(index, _)| index)
}

/// What a range found says about a step: that of the smallest entry not below it.
fn in_range<T>(ranges: &[(f64, Option<T>)], step: f64) -> Option<&T> {
    let range = ranges.iter().rev().find(|(largest, _)| step <= largest * (1.0 + super::SAME_STEP));
    range.and_then(|(_, found)| found.as_ref())
}

/// The item of an enumeration, whose items count from 1.
fn chosen<T: Copy>(all: &[T], value: f64) -> T {
    let found = all.iter().zip(1_u32..).find(|(_, number)| (value - f64::from(*number)).abs() < 0.5);
    found.map_or(all[0], |(item, _)| *item)
}

impl Simulation {
    pub(super) fn parameters(&self) -> Parameters {
        let (bodies, pairs) = (self.compiled.bodies.len(), self.compiled.plan.pairs.len());
        let one = has_one_friction(&self.compiled.scene.settings);
        let friction = |pair: usize| self.value_of(Quantity::Friction, if one { 0 } else { pair });
        let damping = (0..bodies).map(|body| self.value_of(Quantity::DampingRatio, body));
        let carriers = 0..self.compiled.carriers.len();
        let carried = carriers.map(|carrier| self.value_of(Quantity::CarrierDampingRatio, carrier));
        let sense = |speed: f64| if speed == 0.0 { 0.0 } else { speed.signum() };
        let velocity = |body: usize| [0, 1, 2].map(|axis| self.value_of(Quantity::InitialVelocity(axis), body));
        Parameters {
            friction: (0..pairs).map(friction).collect(),
            damping_ratios: damping.chain(carried).collect(),
            step: self.value_of(Quantity::StepMax, 0),
            scheme: chosen(&Scheme::ALL, self.value_of(Quantity::SchemeChoice, 0)),
            solver: chosen(&Solver::ALL, self.value_of(Quantity::SolverChoice, 0)),
            senses: self.speeds().into_iter().map(sense).collect(),
            velocities: (0..bodies).map(velocity).collect(),
        }
    }

    /// Check limits unless the same parameters were checked last; returns warnings. A refusal leaves what was known before.
    pub(super) fn check_limits(&mut self, parameters: &Parameters) -> Result<Vec<String>> {
        if let Some(limits) = self.limits.as_ref().filter(|limits| limits.cover(parameters)) {
            return limits.warnings(&parameters.senses);
        }
        let limits = self.compiled.limits(parameters, &self.system);
        let warnings = limits.warnings(&parameters.senses)?;
        self.limits = Some(limits);
        Ok(warnings)
    }

    /// After a state of other parameters was restored: what holds for these. Before initialisation nothing has been
    /// computed from parameters, and those that will be refused are not yet.
    pub(super) fn renew_limits(&mut self) {
        let parameters = self.parameters();
        let known = self.limits.as_ref().is_some_and(|limits| limits.are_of(&parameters));
        if self.phase != super::Phase::Created && !known {
            self.limits = Some(self.compiled.limits(&parameters, &self.system));
        }
    }

    /// Refuse a step size (s) whose range was found unstable, or that stiffening at one of the `speeds` of a structure (rad/s)
    /// forbids. Only looks up, so that a step does not allocate.
    pub(super) fn check_step_size(&self, body: usize, step: f64, speeds: [f64; 3]) -> Result<()> {
        let Some(limits) = &self.limits else { return Ok(()) };
        let (scheme, own) = (limits.parameters.scheme, &limits.bodies[body]);
        let stiffened = speeds.into_iter().fold(1.0, |most: f64, speed| most.max(self.compiled.stiffened(body, speed)));
        let largest = self.compiled.bodies[body].largest_frequency();
        stability::check_step_allowed(largest * self.compiled.stiffest(body) * stiffened, scheme, step)?;
        for carrier in self.compiled.carriers_of(body) {
            stability::check_step_allowed(self.compiled.carriers[carrier].model.largest_frequency(), scheme, step)?;
        }
        stability::unresolved::check(step, own.unresolved, largest)?;
        if step >= own.massless.usable {
            return Err(massless::refusal(step, own.massless));
        }
        for sense in speeds.into_iter().filter(|speed| *speed != 0.0).flat_map(senses_of) {
            let refusal = own.senses[sense].as_ref().and_then(|sense| in_range(&sense.ranges, step));
            refusal.map_or(Ok(()), |refusal| Err(refusal.clone()))?;
        }
        Ok(())
    }
}

impl Compiled {
    /// Internal step (s) to expect: what the proposed communication step is divided into.
    pub(super) fn expected_step(&self, largest: f64) -> f64 {
        let length = self.scene.settings.experiment.communication_step;
        length / (length / largest * (1.0 - super::SAME_STEP)).ceil().max(1.0)
    }

    /// Largest factor on the frequencies of a structure.
    fn stiffest(&self, body: usize) -> f64 {
        self.body(body).0.frequency_factors.iter().fold(1.0, |largest: f64, factor| largest.max(*factor))
    }

    /// Bound on the factor by which spin raises the largest frequency from that of the reference speed.
    fn stiffened(&self, body: usize, speed: f64) -> f64 {
        let body = &self.bodies[body];
        let Some([second, fourth]) = body.stiffness_range else { return 1.0 };
        let (square, reference) = (speed * speed, body.reference_speed * body.reference_speed);
        let most = |factor: f64, range: [f64; 2]| factor * if factor > 0.0 { range[1] } else { range[0] };
        let added = most(square - reference, second) + most(square * square - reference * reference, fourth);
        let largest = body.model.largest_frequency();
        (1.0 + added.max(0.0) / (largest * largest)).sqrt()
    }

    /// Largest ω h of all structures, stiffening aside, below 2.
    pub(super) fn largest_product(&self, step: f64) -> f64 {
        let touching = self.bodies.iter().enumerate();
        let touching = touching.map(|(index, body)| body.largest_frequency() * self.stiffest(index));
        let carriers = self.carriers.iter().map(|carrier| carrier.model.largest_frequency());
        let largest = touching.chain(carriers).fold(0.0, f64::max);
        (largest * step).min(2.0 * (1.0 - 1e-9))
    }

    /// Structures that carry the surfaces which a structure touches.
    fn carriers_of(&self, body: usize) -> impl Iterator<Item = usize> {
        let pairs = self.plan.pairs_of(body);
        let carriers = pairs.enumerate().filter_map(move |(index, (_, pair))| Some((index, pair.carrier?)));
        // Each once.
        carriers.filter_map(move |(index, carrier)| {
            let before = self.plan.pairs_of(body).take(index).any(|(_, pair)| pair.carrier == Some(carrier));
            (!before).then_some(carrier)
        })
    }

    fn limits(&self, parameters: &Parameters, system: &System) -> Limits {
        let of = |body: usize| match self.bodies[body].translations {
            Some(_) => self.free_limits(body, parameters, system),
            None => self.rotor_limits(body, parameters, system),
        };
        let named = |body: usize| match self.bodies.len() {
            1 => of(body),
            _ => of(body).named(&self.body(body).0.name),
        };
        Limits { parameters: parameters.clone(), bodies: (0..self.bodies.len()).map(named).collect() }
    }

    fn rotor_limits(&self, body: usize, parameters: &Parameters, system: &System) -> BodyLimits {
        let parts = &self.bodies[body];
        let mut models = match &parts.disk {
            Some(disk) => (0..disk.diameters.len()).map(|diameter| disk.paired(diameter)).collect(),
            None => vec![parts.model.clone()],
        };
        // Of mistuned blades the stiffest has the tightest limits.
        let stiffest = self.stiffest(body);
        for model in &mut models {
            model.damping_ratios.fill(parameters.damping_ratios[body]);
            model.frequencies.iter_mut().for_each(|frequency| *frequency *= stiffest);
        }
        let mut at = Checking::new(self, system, body, models, parameters);
        let expected = self.expected_step(parameters.step);
        let casing = at.casing(expected);
        // Radially: along an inclined normal the bending of the blade would hide what the tip itself yields.
        let radial = |model: &ModalModel| vec![[-1.0, 0.0, 0.0]; model.contact_modes.nrows() / 3];
        let masters = at.models.iter().map(|model| stability::unresolved::limit(model, &radial(model)));
        let unresolved = self.unresolved(body, masters, parameters.scheme);
        let resolved = stability::unresolved::check(expected, unresolved, at.largest_frequency());
        let (outcome, massless) = match resolved.and_then(|()| at.massless(expected)) {
            Ok((more, limit)) => (at.warnings(expected, in_range(&casing, expected).cloned(), more), limit),
            Err(error) => (Err(error), MasslessLimit::NONE),
        };
        let mut senses = [None, None];
        // Of a disk the other sense takes as long again; without friction nothing slides.
        let both = parts.disk.is_none() || at.friction == 0.0;
        if outcome.is_ok() {
            for sense in senses_of(if both { 0.0 } else { parameters.senses[body] }) {
                senses[sense] = Some(at.sense(sense, expected));
            }
        }
        BodyLimits { outcome, senses, massless, casing, unresolved }
    }

    /// Smallest step of modal-exact that passes over what contact acts on: of what touches, and of carriers.
    fn unresolved(&self, body: usize, touching: impl Iterator<Item = f64>, scheme: Scheme) -> f64 {
        if scheme != Scheme::ModalExact {
            return f64::INFINITY;
        }
        let models = self.carriers_of(body).map(|carrier| &self.carriers[carrier].model);
        touching.chain(models.map(stability::unresolved::limit_along_axes)).fold(f64::INFINITY, f64::min)
    }
}

impl Limits {
    /// Whether they are those of the parameters, whatever the senses.
    fn are_of(&self, parameters: &Parameters) -> bool {
        Parameters { senses: self.parameters.senses.clone(), ..parameters.clone() } == self.parameters
    }

    /// Whether they are, and the senses were looked at.
    fn cover(&self, parameters: &Parameters) -> bool {
        let looked_at =
            |(body, sense): (&BodyLimits, &f64)| senses_of(*sense).all(|sense| body.senses[sense].is_some());
        self.are_of(parameters) && self.bodies.iter().zip(&parameters.senses).all(looked_at)
    }

    /// Warnings for the step expected where contact slides in the senses of these signs.
    fn warnings(&self, senses: &[f64]) -> Result<Vec<String>> {
        let mut warnings = Vec::new();
        for (body, sense) in self.bodies.iter().zip(senses) {
            let own = body.outcome.clone()?;
            warnings.extend(own);
            for sense in senses_of(*sense).filter_map(|sense| body.senses[sense].as_ref()) {
                warnings.extend(sense.outcome.clone()?);
            }
        }
        Ok(warnings)
    }
}

impl BodyLimits {
    /// Texts with the name of the structure.
    fn named(mut self, name: &str) -> Self {
        let texts = |texts: Vec<String>| texts.into_iter().map(|text| format!("{name}: {text}")).collect();
        let refusal = |error: Error| match error {
            Error::Unstable { problem, remedy } => Error::Unstable { problem: format!("{name}: {problem}"), remedy },
            other => other,
        };
        self.outcome = self.outcome.map(texts).map_err(refusal);
        for sense in self.senses.iter_mut().flatten() {
            sense.outcome = std::mem::replace(&mut sense.outcome, Ok(Vec::new())).map(texts).map_err(refusal);
        }
        for (_, text) in &mut self.casing {
            *text = text.take().map(|text| format!("{name}: {text}"));
        }
        self
    }
}

/// Angles at which the flexible slave is looked at.
const SLAVE_ANGLES: u32 = 48;

fn slave_angle(place: u32) -> f64 {
    std::f64::consts::TAU * f64::from(place) / f64::from(SLAVE_ANGLES)
}

/// The slave's modes along normals and tangents of `nodes` of a blade at `angle` (rad), nodes × modes; 0 for nodes that do not face
/// it.
fn slave_at(law: &SplineGap, modes: &ModalModel, nodes: &[usize], angle: f64) -> (DMatrix<f64>, DMatrix<f64>) {
    let zeros = || DMatrix::zeros(nodes.len(), modes.len());
    let mut seen = (zeros(), zeros());
    for (row, &node) in nodes.iter().enumerate().filter(|(_, node)| law.nodes.contains(node)) {
        let turned = angle + law.layout.angles[node * law.layout.lanes];
        let frame = Frame::new(turned);
        let place = law.surface.locate(frame.fixed([law.layout.radii[node], 0.0, law.layout.axial[node]]));
        for (index, weight) in law.surface.weights(place).iter() {
            for mode in 0..modes.len() {
                let shape = frame.local(std::array::from_fn(|i| modes.contact_modes[(3 * index + i, mode)]));
                seen.0[(row, mode)] -= weight * dot([1.0, 0.0, 0.0], shape);
                seen.1[(row, mode)] += weight * dot([0.0, 1.0, 0.0], shape);
            }
        }
    }
    seen
}

/// Lowest eigenvalue of the symmetric part of the slave's Delassus matrix relative to the largest.
fn lowest_ratio(
    (normals, tangents): &(DMatrix<f64>, DMatrix<f64>),
    modes: &ModalModel,
    scheme: Scheme,
    step: f64,
    friction: f64,
) -> f64 {
    let scheme = if scheme == Scheme::MasslessBoundary { Scheme::ModalExact } else { scheme };
    let compliance: Vec<f64> = modes.coefficients(scheme, step).iter().map(|mode| mode.compliance).collect();
    let forces = normals - tangents * friction;
    let weighted = DMatrix::from_fn(forces.nrows(), forces.ncols(), |i, mode| forces[(i, mode)] * compliance[mode]);
    let matrix = normals * weighted.transpose();
    let eigenvalues = ((&matrix + matrix.transpose()) * 0.5).symmetric_eigenvalues();
    if eigenvalues.max() > 0.0 { eigenvalues.min() / eigenvalues.max() } else { 0.0 }
}

/// A casing need not be alike all around: the check at the place where it yields most.
fn yielding_most<'a>(
    check: massless::MasslessCheck<'a>,
    places: impl Iterator<Item = DMatrix<f64>>,
    modes: &'a ModalModel,
    step: f64,
) -> massless::MasslessCheck<'a> {
    let (mut most, mut chosen) = (f64::NEG_INFINITY, check.clone());
    for seen in places {
        let tried = massless::MasslessCheck { slave: Some((seen, modes)), ..check.clone() };
        if let Some((_, found)) = tried.eigenvalues(step).filter(|(_, found)| *found > most) {
            (most, chosen) = (found, tried);
        }
    }
    chosen
}

/// The step to expect was looked at by itself: it bounds a range of its own.
fn with_expected<T>(mut ranges: Vec<(f64, Option<T>)>, expected: f64, found: Option<T>) -> Vec<(f64, Option<T>)> {
    ranges.retain(|(step, _)| (step - expected).abs() > super::SAME_STEP * expected);
    ranges.push((expected, found));
    ranges.sort_by(|a, b| b.0.total_cmp(&a.0));
    ranges
}

/// What a look at growth is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Telling {
    /// Refusals and warnings of flutter.
    Flutter,
    /// Refusals alone.
    Refusals,
}

/// A structure of a scene with some parameters, about to be checked with all it touches.
struct Checking<'a> {
    compiled: &'a Compiled,
    system: &'a System,
    body: usize,
    /// Contact nodes that meet a surface.
    nodes: Vec<usize>,
    /// What the contact problem with all sectors closed decouples into: one uncoupled sector, or the nodal diameters as
    /// real structures; seen at these nodes.
    models: Vec<ModalModel>,
    parameters: &'a Parameters,
    /// Largest friction coefficient.
    friction: f64,
    /// Per sense of slip (+, −) and combination of nodes the model that grows most at the step to expect. At other steps
    /// only this one is looked at: with all nodal diameters of a disk at all steps the check would take a minute.
    watched: [Vec<usize>; 2],
}

impl<'a> Checking<'a> {
    fn new(
        compiled: &'a Compiled,
        system: &'a System,
        body: usize,
        models: Vec<ModalModel>,
        parameters: &'a Parameters,
    ) -> Self {
        let own = compiled.body(body).1.contact_nodes.len();
        let meets = |node: &usize| compiled.plan.pairs_of(body).any(|(_, pair)| pair.nodes.contains(node));
        let nodes: Vec<usize> = (0..own).filter(meets).collect();
        let seen = |model: ModalModel| {
            let parts = model.contact_modes.nrows() / (3 * own);
            let places = (0..parts).flat_map(|part| nodes.iter().map(move |node| part * own + node));
            if nodes.len() == own { model } else { model.with_nodes(&places.collect::<Vec<_>>()) }
        };
        Self {
            models: models.into_iter().map(seen).collect(),
            friction: parameters.friction_of(compiled, body),
            watched: [Vec::new(), Vec::new()],
            compiled,
            system,
            body,
            nodes,
            parameters,
        }
    }

    fn disk(&self) -> Option<&CyclicModel> {
        self.compiled.bodies[self.body].disk.as_ref()
    }

    /// Surfaces that carriers deform: their gap functions, and the carriers' modes at their control points.
    fn carried(&self) -> Vec<(&SplineGap, usize, ModalModel)> {
        let carried = |(index, pair): (usize, &PairPlan)| {
            let (gap, carrier) = (self.system.pairs()[index].gap(), pair.carrier?);
            let GapLaw::Spline(spline) = gap else { return None };
            Some((&**spline, carrier, self.compiled.control_modes_of(carrier, gap)?))
        };
        self.compiled.plan.pairs_of(self.body).filter_map(carried).collect()
    }

    /// All warnings at the step to expect, whatever the sense of slip; `casing` and `more` come last.
    fn warnings(&self, step: f64, casing: Option<String>, more: Vec<String>) -> Result<Vec<String>> {
        let mut warnings = self.expected(step)?;
        for carrier in self.compiled.carriers_of(self.body) {
            let frequency = self.compiled.carriers[carrier].model.largest_frequency();
            let warning = stability::check_step(frequency, self.parameters.scheme, step)?;
            let name = self.compiled.carrier_name(self.compiled.bodies.len() + carrier);
            warnings.extend(warning.map(|warning| format!("{name}: {warning}")));
        }
        warnings.extend(casing);
        warnings.extend(more);
        Ok(warnings)
    }

    /// Growth of sliding contact at the step to expect and at all others, in one sense.
    fn sense(&mut self, sense: usize, expected: f64) -> Sense {
        if self.friction == 0.0 {
            return Sense { outcome: Ok(Vec::new()), ranges: Vec::new() };
        }
        let sign = [1.0, -1.0][sense];
        let outcome = self.growth(expected, sign, Telling::Flutter);
        let steps = stability::growth_steps(self.largest_frequency(), self.parameters.step);
        let ranges = steps.map(|step| (step, self.growth(step, sign, Telling::Refusals).err())).collect();
        Sense { ranges: with_expected(ranges, expected, outcome.as_ref().err().cloned()), outcome }
    }

    /// Everything about the rotor at the step to expect; returns warnings.
    fn expected(&self, step: f64) -> Result<Vec<String>> {
        let Parameters { scheme, step: largest, .. } = *self.parameters;
        let warnings = stability::check_step(self.largest_frequency(), scheme, step)?.into_iter().collect();
        let senses: Vec<Vec<ContactDirections>> =
            self.models.iter().map(|model| [1.0, -1.0].map(|sense| self.directions(model, sense)).into()).collect();
        if self.disk().is_some() {
            stability::check_solvable_together(&self.models, scheme, largest, self.friction, &senses)?;
        } else {
            stability::check_solvable(&self.models[0], scheme, largest, self.friction, &senses[0])?;
        }
        Ok(warnings)
    }

    /// Whether the part that the structures under the surfaces have in the contact problem can spoil solvability, at the step to
    /// expect and at all others.
    fn casing(&self, expected: f64) -> Vec<(f64, Option<String>)> {
        let carried = self.carried();
        if self.friction == 0.0 || carried.is_empty() || self.parameters.solver == Solver::Coulomb {
            return Vec::new();
        }
        let places = |(gap, _, modes): &(&SplineGap, usize, ModalModel)| {
            (0..SLAVE_ANGLES).map(|place| slave_at(gap, modes, &gap.nodes, slave_angle(place))).collect()
        };
        let places: Vec<Vec<_>> = carried.iter().map(places).collect();
        let worst_at = |step: f64| {
            let (mut worst, mut at) = (0.0, 0.0);
            for ((_, _, modes), places) in carried.iter().zip(&places) {
                for (place, seen) in (0..).zip(places) {
                    for sense in [1.0, -1.0] {
                        let ratio = lowest_ratio(seen, modes, self.parameters.scheme, step, sense * self.friction);
                        if ratio < worst {
                            (worst, at) = (ratio, slave_angle(place));
                        }
                    }
                }
            }
            (worst < -1e-9).then(|| {
                format!(
                    "with µ = {friction} and an internal step of {step:.3e} s the casing's part of the Delassus matrix is not \
                     positive semidefinite (lowest eigenvalue {worst:.2e} of the largest, at θ = {at:.2} rad): where the blades \
                     add less flexibility than that, a step may have no unique solution and is then refused",
                    friction = shown(self.friction)
                )
            })
        };
        let largest = carried.iter().map(|(_, _, modes)| modes.largest_frequency()).fold(0.0, f64::max);
        let steps = stability::growth_steps(largest, self.parameters.step);
        let ranges = steps.map(|step| (step, worst_at(step))).collect();
        with_expected(ranges, expected, worst_at(expected))
    }

    /// Largest step of massless-boundary, and a warning where many blades in contact at once may lower it.
    fn massless(&self, step: f64) -> Result<(Vec<String>, MasslessLimit)> {
        if self.parameters.scheme != Scheme::MasslessBoundary {
            return Ok((Vec::new(), MasslessLimit::NONE));
        }
        // One at most: more are refused.
        let carried = self.carried();
        let largest = 1.01 * self.parameters.step.max(step) / massless::USABLE_STIFF;
        let (mut limit, mut worst) = (MasslessLimit::NONE, (0.0, 0.0));
        for (diameter, model) in self.models.iter().enumerate() {
            let normals = self.normals(model);
            let mut check = massless::MasslessCheck { model, normals, slave: None };
            if let Some((gap, _, modes)) = carried.first() {
                let at = |place| slave_at(gap, modes, &self.nodes, slave_angle(place)).0;
                check =
                    yielding_most(check, (0..SLAVE_ANGLES).map(|place| self.seen_by(diameter, at(place))), modes, step);
            }
            // Of several only the tightest counts.
            let own = check.limit(largest.min(limit.closed))?;
            limit = MasslessLimit { closed: limit.closed.min(own.closed), usable: limit.usable.min(own.usable) };
            let found = check.eigenvalues(step).unwrap_or(worst);
            worst = (found.0.max(worst.0), found.1.max(worst.1));
        }
        if step >= limit.usable {
            return Err(massless::refusal(step, limit));
        }
        let mut warnings: Vec<String> = massless::warning(step, limit).into_iter().collect();
        let sectors = self.compiled.body(self.body).1.sectors;
        let sectors = f64::from(u32::try_from(sectors).unwrap_or(u32::MAX));
        let (master, slave) = worst;
        if master + sectors * slave >= 4.0 {
            warnings.push(format!(
                "massless-boundary is shown stable for up to {:.0} blades in contact with the casing at once, not for all \
                 {sectors}",
                ((4.0 - master) / slave).floor()
            ));
        }
        Ok((warnings, limit))
    }

    /// The slave's modes as the real part of a nodal diameter sees them. One blade in contact has an equal share of all
    /// nodal diameters, so that the softest of them bounds what the slave adds.
    fn seen_by(&self, diameter: usize, seen: DMatrix<f64>) -> DMatrix<f64> {
        let Some(disk) = self.disk() else { return seen };
        let rows = self.models[diameter].contact_modes.nrows() / 3;
        let weight = disk.weight(diameter);
        DMatrix::from_fn(rows, seen.ncols(), |i, j| if i < seen.nrows() { weight * seen[(i, j)] } else { 0.0 })
    }

    fn largest_frequency(&self) -> f64 {
        self.models.iter().fold(0.0, |largest, model| f64::max(largest, model.largest_frequency()))
    }

    /// Normals and slip directions of the contact nodes of one of the models on a round casing, as long as friction there is against
    /// the largest; both parts of a nodal diameter have the same.
    fn directions(&self, model: &ModalModel, sense: f64) -> ContactDirections {
        let rom = self.compiled.body(self.body).1;
        let nodes = self.nodes.iter().cycle().take(model.contact_modes.nrows() / 3);
        nodes
            .map(|node| {
                let contour = self.compiled.contact(self.pair_at(*node)).meridian == Meridian::Contour;
                let slope = if contour { rom.contact_nodes[*node].meridional_slope } else { 0.0 };
                let length = (1.0 + slope * slope).sqrt();
                let friction = self.friction_at(*node);
                let share = if friction < self.friction { friction / self.friction } else { 1.0 };
                ([-1.0 / length, 0.0, slope / length], [0.0, share * sense, 0.0])
            })
            .collect()
    }

    /// The pair of a contact node.
    fn pair_at(&self, node: usize) -> usize {
        let pair = self.compiled.plan.pairs_of(self.body).find(|(_, pair)| pair.nodes.contains(&node));
        pair.map_or(0, |(pair, _)| pair)
    }

    fn friction_at(&self, node: usize) -> f64 {
        self.parameters.friction[self.pair_at(node)]
    }

    fn normals(&self, model: &ModalModel) -> Vec<[f64; 3]> {
        self.directions(model, 1.0).into_iter().map(|(normal, _)| normal).collect()
    }

    /// Sets of closed contact nodes: all combinations of a few; of many every one alone, neighbours, and all; of a disk,
    /// on all sectors, every one alone and all.
    fn combinations(&self) -> Vec<Vec<usize>> {
        let nodes = self.nodes.len();
        if self.disk().is_some() {
            return (0..nodes).map(|node| vec![node]).chain([(0..nodes).collect()]).collect();
        }
        if nodes <= ALL_COMBINATIONS_UP_TO {
            let members = |set: usize| (0..nodes).filter(|node| set >> node & 1 == 1).collect();
            return (1..1 << nodes).map(members).collect();
        }
        let alone = (0..nodes).map(|node| vec![node]);
        let pairs = (1..nodes).map(|node| vec![node - 1, node]);
        alone.chain(pairs).chain([(0..nodes).collect()]).collect()
    }

    /// Growth of closed sliding contact at one step size and sense of slip; returns warnings of flutter.
    fn growth(&mut self, step: f64, sense: f64, telling: Telling) -> Result<Vec<String>> {
        let mut warnings = Vec::new();
        for (combination, nodes) in self.combinations().iter().enumerate() {
            let watched = self.watched[usize::from(sense < 0.0)].get(combination).copied();
            let models = watched.map_or(0..self.models.len(), |model| model..model + 1);
            let (mut flutter, mut most) = (0.0_f64, (0, f64::NEG_INFINITY));
            for model in models {
                let Some(found) = self.growth_of(model, nodes, step, sense) else { continue };
                if found.is_added() {
                    return Err(self.refusal(nodes, sense, step, found));
                }
                if found.is_flutter() {
                    flutter = flutter.max(found.continuous);
                }
                if found.stepped > most.1 {
                    most = (model, found.stepped);
                }
            }
            if watched.is_none() {
                self.watched[usize::from(sense < 0.0)].push(most.0);
            }
            if telling == Telling::Flutter && flutter > 0.0 {
                warnings.push(format!(
                    "{} is physically unstable (flutter), growth rate {flutter:.3e} 1/s",
                    self.contact(nodes, sense)
                ));
            }
        }
        Ok(warnings)
    }

    /// Growth of one of the models with contact closed at some nodes (of both parts of a nodal diameter).
    fn growth_of(&self, model: usize, nodes: &[usize], step: f64, sense: f64) -> Option<Growth> {
        let model = &self.models[model];
        let all = self.directions(model, sense);
        let own = self.nodes.len();
        let places = (0..all.len() / own).flat_map(|part| nodes.iter().map(move |node| part * own + node));
        let places: Vec<usize> = places.collect();
        let directions = places.iter().map(|place| all[*place]).collect();
        stability::growth(&model.with_nodes(&places), self.parameters.scheme, step, self.friction, &directions)
    }

    /// Which contact is meant.
    fn contact(&self, nodes: &[usize], sense: f64) -> String {
        let all = &self.compiled.body(self.body).1.contact_nodes;
        let names: Vec<&str> = nodes.iter().map(|node| all[self.nodes[*node]].name.as_str()).collect();
        let direction = if sense > 0.0 { "+θ" } else { "−θ" };
        let where_closed = if self.disk().is_some() { " of all sectors" } else { "" };
        let mut frictions: Vec<f64> = nodes.iter().map(|node| self.friction_at(self.nodes[*node])).collect();
        frictions.sort_by(f64::total_cmp);
        frictions.dedup();
        let frictions: Vec<String> = frictions.into_iter().map(|friction| shown(friction).to_string()).collect();
        format!(
            "with µ = {}, contact closed at {}{where_closed} and sliding in {direction}",
            frictions.join(" and "),
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
