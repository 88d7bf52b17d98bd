//! Stability and solvability of a scene at the step sizes it can be stepped with.

mod free;
mod told;

use super::{Compiled, Simulation};
use crate::contact::gap::{GapLaw, dot};
use crate::contact::spline_gap::{Frame, SplineGap};
use crate::dynamics::modal::ModalModel;
use crate::settings::{Meridian, Scheme, Solver};
use crate::stability::massless::MasslessLimit;
use crate::stability::{self, ContactDirections, Growth, massless};
use crate::variables::Quantity;
use crate::{Error, Result, shown};
use nalgebra::DMatrix;
pub(super) use told::Told;

/// Contact nodes up to this number are looked at in every combination; beyond, alone, in neighbouring pairs, and all.
const ALL_COMBINATIONS_UP_TO: usize = 3;

/// Parameters that decide stability.
#[derive(Debug, Clone, PartialEq)]
pub struct Parameters {
    pub friction: f64,
    pub damping_ratio: f64,
    /// Of the structures that carry surfaces.
    pub slave_damping_ratios: Vec<f64>,
    /// Largest internal step (s).
    pub step: f64,
    pub scheme: Scheme,
    pub solver: Solver,
    /// Sign of the speed at the start; 0 for a rotor that starts at rest.
    pub sense: f64,
    /// Velocity of a free master at the start (m/s).
    pub velocity: [f64; 3],
}

/// What is known about the limits with some parameters.
#[derive(Debug, Clone)]
pub struct Limits {
    /// Without the sense.
    parameters: Parameters,
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
        let speed = self.inputs.speed.value;
        Parameters {
            friction: self.value_of(Quantity::Friction),
            damping_ratio: self.value_of(Quantity::DampingRatio),
            slave_damping_ratios: self.slave_damping_ratios(),
            step: self.value_of(Quantity::StepMax),
            scheme: chosen(&Scheme::ALL, self.value_of(Quantity::SchemeChoice)),
            solver: chosen(&Solver::ALL, self.value_of(Quantity::SolverChoice)),
            sense: if speed == 0.0 { 0.0 } else { speed.signum() },
            velocity: [0, 1, 2].map(|axis| self.value_of(Quantity::InitialVelocity(axis))),
        }
    }

    fn slave_damping_ratios(&self) -> Vec<f64> {
        let slaves = 0..self.system.slaves().len();
        slaves.map(|slave| self.value_of(Quantity::SlaveDampingRatio(slave))).collect()
    }

    /// Check limits unless the same parameters were checked last; returns warnings. A refusal leaves what was known before.
    pub(super) fn check_limits(&mut self, parameters: &Parameters) -> Result<Vec<String>> {
        if let Some(limits) = self.limits.as_ref().filter(|limits| limits.cover(parameters)) {
            return limits.warnings(parameters.sense);
        }
        let limits = self.compiled.limits(parameters, self.system.law());
        let warnings = limits.warnings(parameters.sense)?;
        self.limits = Some(limits);
        Ok(warnings)
    }

    /// After a state of other parameters was restored: what holds for these. Before initialisation nothing has been
    /// computed from parameters, and those that will be refused are not yet.
    pub(super) fn renew_limits(&mut self) {
        let parameters = self.parameters();
        let known = self.limits.as_ref().is_some_and(|limits| limits.are_of(&parameters));
        if self.phase != super::Phase::Created && !known {
            self.limits = Some(self.compiled.limits(&parameters, self.system.law()));
        }
    }

    /// Refuse a step size (s) whose range was found unstable, or that stiffening at one of the `speeds` (rad/s) forbids. Only looks up, so that a step does not allocate.
    pub(super) fn check_step_size(&self, step: f64, speeds: [f64; 3]) -> Result<()> {
        let Some(limits) = &self.limits else { return Ok(()) };
        let scheme = limits.parameters.scheme;
        let stiffened = speeds.into_iter().fold(1.0, |most: f64, speed| most.max(self.compiled.stiffened(speed)));
        let frequency = self.compiled.largest_frequency() * self.compiled.stiffest() * stiffened;
        stability::check_step_allowed(frequency, scheme, step)?;
        for carrier in self.compiled.carriers() {
            stability::check_step_allowed(carrier.largest_frequency(), scheme, step)?;
        }
        stability::unresolved::check(step, limits.unresolved, self.compiled.largest_frequency())?;
        if step >= limits.massless.usable {
            return Err(massless::refusal(step, limits.massless));
        }
        for sense in speeds.into_iter().filter(|speed| *speed != 0.0).flat_map(senses_of) {
            let refusal = limits.senses[sense].as_ref().and_then(|sense| in_range(&sense.ranges, step));
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

    /// Largest factor on the frequencies of the master.
    fn stiffest(&self) -> f64 {
        self.master().0.frequency_factors.iter().fold(1.0, |largest: f64, factor| largest.max(*factor))
    }

    /// Bound on the factor by which spin raises the largest frequency from that of the reference speed.
    fn stiffened(&self, speed: f64) -> f64 {
        let Some([second, fourth]) = self.stiffness_range else { return 1.0 };
        let (square, reference) = (speed * speed, self.reference_speed * self.reference_speed);
        let most = |factor: f64, range: [f64; 2]| factor * if factor > 0.0 { range[1] } else { range[0] };
        let added = most(square - reference, second) + most(square * square - reference * reference, fourth);
        let largest = self.model.largest_frequency();
        (1.0 + added.max(0.0) / (largest * largest)).sqrt()
    }

    /// Largest ω h of all structures, stiffening aside, below 2.
    pub(super) fn largest_product(&self, step: f64) -> f64 {
        let carriers = self.carriers().map(ModalModel::largest_frequency);
        let largest = carriers.fold(self.largest_frequency() * self.stiffest(), f64::max);
        (largest * step).min(2.0 * (1.0 - 1e-9))
    }

    /// Modes of the structures that carry surfaces.
    fn carriers(&self) -> impl Iterator<Item = &ModalModel> {
        self.carrier.iter().chain(self.free.iter().flat_map(|free| &free.carriers))
    }

    fn limits(&self, parameters: &Parameters, law: &GapLaw) -> Limits {
        if let (Some(free), GapLaw::Free(law)) = (&self.free, law) {
            return self.free_limits(parameters, free, law);
        }
        let parameters = parameters.clone();
        let mut models = match &self.disk {
            Some(disk) => (0..disk.diameters.len()).map(|diameter| disk.paired(diameter)).collect(),
            None => vec![self.model.clone()],
        };
        // Of mistuned blades the stiffest has the tightest limits.
        let stiffest = self.stiffest();
        for model in &mut models {
            model.damping_ratios.fill(parameters.damping_ratio);
            model.frequencies.iter_mut().for_each(|frequency| *frequency *= stiffest);
        }
        let mut at =
            Checking { compiled: self, models, parameters: parameters.clone(), watched: [Vec::new(), Vec::new()] };
        let expected = self.expected_step(parameters.step);
        let casing = at.casing(expected, law);
        // Radially: along an inclined normal the bending of the blade would hide what the tip itself yields.
        let radial = |model: &ModalModel| vec![[-1.0, 0.0, 0.0]; model.contact_modes.nrows() / 3];
        let unresolved = self.unresolved(&at.models, parameters.scheme, radial);
        let resolved = stability::unresolved::check(expected, unresolved, at.largest_frequency());
        let (outcome, massless) = match resolved.and_then(|()| at.massless(expected, law)) {
            Ok((more, limit)) => (at.warnings(expected, in_range(&casing, expected).cloned(), more), limit),
            Err(error) => (Err(error), MasslessLimit::NONE),
        };
        let mut senses = [None, None];
        // Of a disk the other sense takes as long again; without friction nothing slides.
        let both = self.disk.is_none() || parameters.friction == 0.0;
        if outcome.is_ok() {
            for sense in senses_of(if both { 0.0 } else { parameters.sense }) {
                senses[sense] = Some(at.sense(sense, expected));
            }
        }
        Limits { parameters, outcome, senses, massless, casing, unresolved }
    }

    /// Smallest step of modal-exact that passes over what contact acts on, of the master as `models` and of carriers.
    fn unresolved(
        &self,
        models: &[ModalModel],
        scheme: Scheme,
        directions: impl Fn(&ModalModel) -> Vec<[f64; 3]>,
    ) -> f64 {
        if scheme != Scheme::ModalExact {
            return f64::INFINITY;
        }
        let masters = models.iter().map(|model| stability::unresolved::limit(model, &directions(model)));
        masters.chain(self.carriers().map(stability::unresolved::limit_along_axes)).fold(f64::INFINITY, f64::min)
    }
}

impl Limits {
    /// Whether they are those of the parameters, whatever the sense.
    fn are_of(&self, parameters: &Parameters) -> bool {
        Parameters { sense: self.parameters.sense, ..parameters.clone() } == self.parameters
    }

    /// Whether they are, and the sense was looked at.
    fn cover(&self, parameters: &Parameters) -> bool {
        self.are_of(parameters) && senses_of(parameters.sense).all(|sense| self.senses[sense].is_some())
    }

    /// Warnings for the step expected where contact slides in the sense of this sign.
    fn warnings(&self, sense: f64) -> Result<Vec<String>> {
        let mut warnings = self.outcome.clone()?;
        for sense in senses_of(sense).filter_map(|sense| self.senses[sense].as_ref()) {
            warnings.extend(sense.outcome.clone()?);
        }
        Ok(warnings)
    }
}

/// Angles at which the flexible slave is looked at.
const SLAVE_ANGLES: u32 = 48;

fn slave_angle(place: u32) -> f64 {
    std::f64::consts::TAU * f64::from(place) / f64::from(SLAVE_ANGLES)
}

/// The slave's modes along normals and tangents of the contact nodes of a blade at `angle` (rad), nodes × modes.
fn slave_at(law: &SplineGap, modes: &ModalModel, angle: f64) -> (DMatrix<f64>, DMatrix<f64>) {
    let nodes = law.layout.nodes();
    let mut seen = (DMatrix::zeros(nodes, modes.len()), DMatrix::zeros(nodes, modes.len()));
    for node in 0..nodes {
        let turned = angle + law.layout.angles[node * law.layout.lanes];
        let frame = Frame::new(turned);
        let place = law.surface.locate(frame.fixed([law.layout.radii[node], 0.0, law.layout.axial[node]]));
        for (index, weight) in law.surface.weights(place).iter() {
            for mode in 0..modes.len() {
                let shape = frame.local(std::array::from_fn(|i| modes.contact_modes[(3 * index + i, mode)]));
                seen.0[(node, mode)] -= weight * dot([1.0, 0.0, 0.0], shape);
                seen.1[(node, mode)] += weight * dot([0.0, 1.0, 0.0], shape);
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

/// A scene with some parameters, about to be checked.
struct Checking<'a> {
    compiled: &'a Compiled,
    /// What the contact problem with all sectors closed decouples into: one uncoupled sector, or the nodal diameters as
    /// real structures.
    models: Vec<ModalModel>,
    parameters: Parameters,
    /// Per sense of slip (+, −) and combination of nodes the model that grows most at the step to expect. At other steps
    /// only this one is looked at: with all nodal diameters of a disk at all steps the check would take a minute.
    watched: [Vec<usize>; 2],
}

impl Checking<'_> {
    /// All warnings at the step to expect, whatever the sense of slip; `casing` and `more` come last.
    fn warnings(&self, step: f64, casing: Option<String>, more: Vec<String>) -> Result<Vec<String>> {
        let mut warnings = self.expected(step)?;
        if let Some(model) = &self.compiled.carrier {
            let warning = stability::check_step(model.largest_frequency(), self.parameters.scheme, step)?;
            warnings.extend(warning.map(|warning| format!("casing: {warning}")));
        }
        warnings.extend(casing);
        warnings.extend(more);
        Ok(warnings)
    }

    /// Growth of sliding contact at the step to expect and at all others, in one sense.
    fn sense(&mut self, sense: usize, expected: f64) -> Sense {
        if self.parameters.friction == 0.0 {
            return Sense { outcome: Ok(Vec::new()), ranges: Vec::new() };
        }
        let sign = [1.0, -1.0][sense];
        let outcome = self.growth(expected, sign, true);
        let steps = stability::growth_steps(self.largest_frequency(), self.parameters.step);
        let ranges = steps.map(|step| (step, self.growth(step, sign, false).err())).collect();
        Sense { ranges: with_expected(ranges, expected, outcome.as_ref().err().cloned()), outcome }
    }

    /// Everything about the rotor at the step to expect; returns warnings.
    fn expected(&self, step: f64) -> Result<Vec<String>> {
        let Parameters { friction, scheme, .. } = self.parameters;
        let warnings = stability::check_step(self.largest_frequency(), scheme, step)?.into_iter().collect();
        let senses: Vec<Vec<ContactDirections>> =
            self.models.iter().map(|model| [1.0, -1.0].map(|sense| self.directions(model, sense)).into()).collect();
        let largest = self.parameters.step;
        if self.compiled.disk.is_some() {
            stability::check_solvable_together(&self.models, scheme, largest, friction, &senses)?;
        } else {
            stability::check_solvable(&self.models[0], scheme, largest, friction, &senses[0])?;
        }
        Ok(warnings)
    }

    /// Whether the part that the structure under the surface has in the contact problem can spoil solvability, at the step to
    /// expect and at all others.
    fn casing(&self, expected: f64, law: &GapLaw) -> Vec<(f64, Option<String>)> {
        let (Some(model), GapLaw::Spline(spline)) = (&self.compiled.carrier, law) else { return Vec::new() };
        let Parameters { friction, scheme, .. } = self.parameters;
        if friction == 0.0 || self.parameters.solver == Solver::Coulomb {
            return Vec::new();
        }
        let modes = self.compiled.slave_modes(spline);
        let places: Vec<_> = (0..SLAVE_ANGLES).map(|place| slave_at(spline, &modes, slave_angle(place))).collect();
        let worst_at = |step: f64| {
            let (mut worst, mut at) = (0.0, 0.0);
            for (place, seen) in (0..).zip(&places) {
                for sense in [1.0, -1.0] {
                    let ratio = lowest_ratio(seen, &modes, scheme, step, sense * friction);
                    if ratio < worst {
                        (worst, at) = (ratio, slave_angle(place));
                    }
                }
            }
            (worst < -1e-9).then(|| {
                format!(
                    "with µ = {friction} and an internal step of {step:.3e} s the casing's part of the Delassus matrix is not \
                     positive semidefinite (lowest eigenvalue {worst:.2e} of the largest, at θ = {at:.2} rad): where the blades \
                     add less flexibility than that, a step may have no unique solution and is then refused",
                    friction = shown(friction)
                )
            })
        };
        let steps = stability::growth_steps(model.largest_frequency(), self.parameters.step);
        let ranges = steps.map(|step| (step, worst_at(step))).collect();
        with_expected(ranges, expected, worst_at(expected))
    }

    /// Largest step of massless-boundary, and a warning where many blades in contact at once may lower it.
    fn massless(&self, step: f64, law: &GapLaw) -> Result<(Vec<String>, MasslessLimit)> {
        if self.parameters.scheme != Scheme::MasslessBoundary {
            return Ok((Vec::new(), MasslessLimit::NONE));
        }
        let modes = match (&self.compiled.carrier, law) {
            (Some(_), GapLaw::Spline(spline)) => Some((self.compiled.slave_modes(spline), spline)),
            _ => None,
        };
        let largest = 1.01 * self.parameters.step.max(step) / massless::USABLE_STIFF;
        let (mut limit, mut worst) = (MasslessLimit::NONE, (0.0, 0.0));
        for (diameter, model) in self.models.iter().enumerate() {
            let normals = self.normals(model);
            let mut check = massless::MasslessCheck { model, normals, slave: None };
            if let Some((modes, spline)) = &modes {
                let place = |place| self.seen_by(diameter, slave_at(spline, modes, slave_angle(place)).0);
                check = yielding_most(check, (0..SLAVE_ANGLES).map(place), modes, step);
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
        let sectors = f64::from(u32::try_from(self.compiled.master().1.sectors).unwrap_or(u32::MAX));
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
        let Some(disk) = &self.compiled.disk else { return seen };
        let rows = self.models[diameter].contact_modes.nrows() / 3;
        let weight = disk.weight(diameter);
        DMatrix::from_fn(rows, seen.ncols(), |i, j| if i < seen.nrows() { weight * seen[(i, j)] } else { 0.0 })
    }

    fn largest_frequency(&self) -> f64 {
        self.models.iter().fold(0.0, |largest, model| f64::max(largest, model.largest_frequency()))
    }

    /// Normals and slip directions of the contact nodes of one of the models on a round casing; both parts of a nodal
    /// diameter have the same.
    fn directions(&self, model: &ModalModel, sense: f64) -> ContactDirections {
        let meridian = self.compiled.contact().meridian;
        let nodes = self.compiled.master().1.contact_nodes.iter();
        nodes
            .cycle()
            .take(model.contact_modes.nrows() / 3)
            .map(|node| {
                let slope = if meridian == Meridian::Contour { node.meridional_slope } else { 0.0 };
                let length = (1.0 + slope * slope).sqrt();
                ([-1.0 / length, 0.0, slope / length], [0.0, sense, 0.0])
            })
            .collect()
    }

    fn normals(&self, model: &ModalModel) -> Vec<[f64; 3]> {
        self.directions(model, 1.0).into_iter().map(|(normal, _)| normal).collect()
    }

    /// Sets of closed contact nodes: all combinations of a few; of many every one alone, neighbours, and all; of a disk,
    /// on all sectors, every one alone and all.
    fn combinations(&self) -> Vec<Vec<usize>> {
        let nodes = self.compiled.master().1.contact_nodes.len();
        if self.compiled.disk.is_some() {
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
    fn growth(&mut self, step: f64, sense: f64, warn: bool) -> Result<Vec<String>> {
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
            if warn && flutter > 0.0 {
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
        let Parameters { friction, scheme, .. } = self.parameters;
        let model = &self.models[model];
        let all = self.directions(model, sense);
        let own = self.compiled.master().1.contact_nodes.len();
        let places = (0..all.len() / own).flat_map(|part| nodes.iter().map(move |node| part * own + node));
        let places: Vec<usize> = places.collect();
        let directions = places.iter().map(|place| all[*place]).collect();
        stability::growth(&model.with_nodes(&places), scheme, step, friction, &directions)
    }

    /// Which contact is meant.
    fn contact(&self, nodes: &[usize], sense: f64) -> String {
        let names: Vec<&str> =
            nodes.iter().map(|node| self.compiled.master().1.contact_nodes[*node].name.as_str()).collect();
        let direction = if sense > 0.0 { "+θ" } else { "−θ" };
        let where_closed = if self.compiled.disk.is_some() { " of all sectors" } else { "" };
        format!(
            "with µ = {}, contact closed at {}{where_closed} and sliding in {direction}",
            shown(self.parameters.friction),
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
