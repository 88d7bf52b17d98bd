//! A body that several sectors move or touch, a disk or a casing: all of its modes over one step, under forces at the points of the step.

use super::advance::Advance;
use super::basis::{MOST, POINTS, TimeBasis};
use super::kernels::to_f32;
use super::level::Influence;
use super::span::SpanStep;
use super::state::SectorState;
use super::tables::{HALVINGS, Tables};
use super::trial::ForceInterpolation;
use crate::math::simd::{InstructionSet, Kernel};
use crate::modes::coordinates::Coordinates;
use nalgebra::DMatrix;

/// State, tables and scratch memory of a body; allocates only on creation.
#[derive(Debug, Clone)]
pub struct SharedBody {
    /// Modes of the body.
    pub coordinates: Coordinates,
    /// Tables of the modes with inertia.
    pub tables: Tables,
    /// Current q and q̇; the caller sets them for modes with inertia.
    pub state: SectorState,
    advance: Advance,
    /// Modal forces at points 0 … s.
    pub forces: [Vec<f64>; POINTS],
    /// Coefficients of θᵃ of the forces on modes with inertia.
    polynomial: [Vec<f64>; MOST],
    /// Coordinates at points 1 … s of the tried step without forces.
    free: [Vec<f64>; MOST],
    /// Coordinates at points 0 … s with the forces there.
    pub at: [Vec<f64>; POINTS],
    /// Modal loads of modes with inertia, without contact forces: at the start and the end of the span, with linear
    /// interpolation, and at the points of the step. Empty without loads.
    pub loads: [Vec<f64>; 2],
    loads_at: [Vec<f64>; POINTS],
    /// Damping loss since it was last collected (J).
    pub loss: f64,
    /// Work of loads since it was last collected (J).
    pub load_work: f64,
    /// Displacements of all modes per modal force, for each level.
    responses: Vec<BodyResponse>,
    instructions: InstructionSet,
}

/// Displacements of all modes per modal force in a step of a level.
#[derive(Debug, Clone, PartialEq)]
struct BodyResponse {
    /// `[i - 1][k]`: at point i, for a force at point k; empty for points that the step does not have.
    points: [[Vec<f64>; POINTS]; MOST],
    /// Displacement at the end of the step, for a constant force.
    constant: Vec<f64>,
}

impl BodyResponse {
    fn new(modes: usize, degree: usize) -> Self {
        let length = |i: usize, k: usize| if i < degree && k <= degree { modes } else { 0 };
        let points = std::array::from_fn(|i| std::array::from_fn(|k| vec![0.0; length(i, k)]));
        Self { points, constant: vec![0.0; modes] }
    }

    fn fill(&mut self, influence: &[Influence], coordinates: &Coordinates) {
        let Coordinates { inertia, softness, .. } = coordinates;
        for (i, points) in self.points.iter_mut().enumerate() {
            for (k, points) in points.iter_mut().enumerate() {
                for (mode, point) in points.iter_mut().enumerate() {
                    let soft = if k == i + 1 { softness[mode] } else { 0.0 };
                    *point = inertia[mode] * influence[mode].points[i][k] + soft;
                }
            }
        }
        for (mode, constant) in self.constant.iter_mut().enumerate() {
            *constant = inertia[mode] * influence[mode].constant + softness[mode];
        }
    }
}

/// Computes `to` = `free` + Σ response · force, where `terms` lists pairs of response and force.
struct Push<'a, const N: usize> {
    free: &'a [f64],
    terms: [[&'a [f64]; 2]; N],
    to: &'a mut [f64],
}

impl<const N: usize> Kernel for Push<'_, N> {
    #[inline(always)]
    fn run(self) {
        let count = self.to.len();
        let (free, terms) = (&self.free[..count], self.terms.map(|pair| pair.map(|values| &values[..count])));
        for mode in 0..count {
            let pushed = terms.iter().fold(free[mode], |sum, [response, force]| sum + response[mode] * force[mode]);
            self.to[mode] = pushed;
        }
    }
}

/// Computes `to` = Σ weight · (force + load) over the points; `loads` are empty for a body without loads.
struct WeighForces<'a> {
    weights: &'a [f64],
    forces: &'a [Vec<f64>],
    loads: &'a [Vec<f64>],
    to: &'a mut [f64],
}

impl Kernel for WeighForces<'_> {
    #[inline(always)]
    fn run(self) {
        self.to.fill(0.0);
        for ((weight, forces), loads) in self.weights.iter().zip(self.forces).zip(self.loads) {
            if loads.is_empty() {
                self.to.iter_mut().zip(forces).for_each(|(to, force)| *to += weight * force);
            } else {
                let forces = forces.iter().zip(loads).map(|(force, load)| force + load);
                self.to.iter_mut().zip(forces).for_each(|(to, force)| *to += weight * force);
            }
        }
    }
}

/// Adds response · force to `to`, in single precision.
struct AddResponse<'a> {
    response: &'a [f64],
    force: &'a [f64],
    to: &'a mut [f32],
}

impl Kernel for AddResponse<'_> {
    #[inline(always)]
    fn run(self) {
        for (to, (response, force)) in self.to.iter_mut().zip(self.response.iter().zip(self.force)) {
            *to += to_f32(response * force);
        }
    }
}

impl SharedBody {
    /// Creates a body with polynomials of degree `degree`; call [`SharedBody::set_span_length`] before the first step, and
    /// [`SharedBody::fill`] before the first step of a level.
    pub fn new(coordinates: Coordinates, degree: usize) -> Self {
        let count = coordinates.inertia.len();
        let zeros = || vec![0.0; count];
        let tables = Tables::of_degree(coordinates.seen_at(&DMatrix::zeros(0, count)), degree);
        Self {
            tables,
            coordinates,
            state: SectorState::new(count, 0),
            advance: Advance::new(count, 0),
            forces: std::array::from_fn(|_| zeros()),
            polynomial: std::array::from_fn(|_| zeros()),
            free: std::array::from_fn(|_| zeros()),
            at: std::array::from_fn(|_| zeros()),
            loads: [Vec::new(), Vec::new()],
            loads_at: std::array::from_fn(|_| Vec::new()),
            loss: 0.0,
            load_work: 0.0,
            responses: (0..=HALVINGS).map(|_| BodyResponse::new(count, degree)).collect(),
            instructions: InstructionSet::detect(),
        }
    }

    /// Enables modal loads in addition to contact forces.
    #[must_use]
    pub fn loaded(mut self) -> Self {
        let count = self.coordinates.inertia.len();
        let [start, end] = &mut self.loads;
        [start, end].into_iter().chain(&mut self.loads_at).for_each(|loads| loads.resize(count, 0.0));
        self
    }

    /// Sets the length of the spans (s).
    pub fn set_span_length(&mut self, span: f64) {
        self.tables.set_span_length(span);
    }

    /// Fills the tables of a level, unless they are filled.
    pub fn fill(&mut self, level: usize) {
        if self.tables.fill(level) {
            self.responses[level].fill(&self.tables.levels[level].influence, &self.coordinates);
        }
    }

    /// Returns the displacements of the modes at point i per modal force at point k.
    pub(crate) fn response(&self, level: usize, kind: ForceInterpolation, i: usize, k: usize) -> &[f64] {
        match kind {
            ForceInterpolation::Constant => &self.responses[level].constant,
            ForceInterpolation::Polynomial => &self.responses[level].points[i - 1][k],
        }
    }

    /// Sets the state of modes without inertia to zero.
    pub(crate) fn keep_inertia(&mut self) {
        for (mode, inertia) in self.coordinates.inertia.iter().enumerate() {
            self.state.position[mode] *= inertia;
            self.state.velocity[mode] *= inertia;
        }
    }

    /// Computes the current coordinates under the forces at point 0.
    pub fn settle(&mut self) {
        for (mode, at) in self.at[0].iter_mut().enumerate() {
            *at = self.state.position[mode] + self.coordinates.softness[mode] * self.forces[0][mode];
        }
    }

    /// Starts a step: computes the coordinates without contact forces after its start, but with loads.
    pub fn begin(&mut self, step: SpanStep, kind: ForceInterpolation) {
        self.find_loads(step, kind);
        let Self { coordinates, tables, state, free, loads_at, .. } = self;
        let table = &tables.levels[step.level];
        let points = kind.last_points(&table.basis);
        for (point, (free, [a, b])) in free.iter_mut().zip(&table.modes.points[points]).enumerate() {
            let modes = a.iter().zip(b).zip(state.position.iter().zip(&state.velocity));
            free.iter_mut().zip(modes).for_each(|(free, ((a, b), (q, v)))| *free = a * q + b * v);
            for mode in 0..loads_at[0].len() {
                let load = |k: usize| loads_at[k][mode];
                let pushed = table.influence[mode].displacement(kind, point + 1, table.basis.degree, load);
                free[mode] += coordinates.inertia[mode] * pushed;
            }
        }
    }

    /// Finds the loads at the points of a step; for a constant force, their mean.
    fn find_loads(&mut self, step: SpanStep, kind: ForceInterpolation) {
        let Self { coordinates, tables, loads: [start, end], loads_at, .. } = self;
        let basis = &tables.levels[step.level].basis;
        for (point, loads) in loads_at[..basis.count()].iter_mut().enumerate() {
            let within = if kind == ForceInterpolation::Constant { 0.5 } else { basis.points[point] };
            let theta = step.from + step.length * within;
            for (mode, load) in loads.iter_mut().enumerate() {
                *load = coordinates.inertia[mode] * (start[mode] + theta * (end[mode] - start[mode]));
            }
        }
    }

    /// Work of the loads over a step (J).
    fn work_of_loads(&self, basis: &TimeBasis, kind: ForceInterpolation) -> f64 {
        let of = |mode: usize| -> f64 {
            if kind == ForceInterpolation::Constant {
                return self.loads_at[0][mode] * (self.at[1][mode] - self.at[0][mode]);
            }
            let moved = |i: usize| (0..basis.count()).map(|k| basis.work[i][k] * self.at[k][mode]).sum::<f64>();
            (0..basis.count()).map(|i| self.loads_at[i][mode] * moved(i)).sum()
        };
        (0..self.loads[0].len()).map(of).sum()
    }

    /// Computes the coordinates at the points under the forces there.
    pub fn push(&mut self, level: usize, kind: ForceInterpolation) {
        let Self { tables, forces, free, at, responses, instructions, .. } = self;
        let points = kind.points(&tables.levels[level].basis);
        for i in 1..=points {
            let (free, to, BodyResponse { points: rows, constant }) = (&free[i - 1], &mut at[i], &responses[level]);
            match kind {
                ForceInterpolation::Constant => instructions.run(Push { free, terms: [[constant, &forces[1]]], to }),
                ForceInterpolation::Polynomial => {
                    let [a, b, c, d]: [[&[f64]; 2]; POINTS] =
                        std::array::from_fn(|k| [&rows[i - 1][k][..], &forces[k]]);
                    match points {
                        1 => instructions.run(Push { free, terms: [a, b], to }),
                        2 => instructions.run(Push { free, terms: [a, b, c], to }),
                        _ => instructions.run(Push { free, terms: [a, b, c, d], to }),
                    }
                }
            }
        }
    }

    /// Computes the modal displacements at point i caused only by the modal `forces` at the points 1, 2, …, in single
    /// precision. Entries beyond the modes are 0.
    pub(crate) fn displace(
        &self,
        level: usize,
        kind: ForceInterpolation,
        i: usize,
        forces: &[Vec<f64>],
        to: &mut [f32],
    ) {
        to.fill(0.0);
        for (k, force) in forces.iter().enumerate() {
            let response = self.response(level, kind, i, k + 1);
            self.instructions.run(AddResponse { response, force, to: &mut *to });
        }
    }

    /// Accepts the step: advances the state to its end, whose forces become those at the start.
    pub fn take(&mut self, level: usize, kind: ForceInterpolation) {
        self.load_work += self.work_of_loads(&self.tables.levels[level].basis, kind);
        let Self { coordinates, tables, state, forces, polynomial, advance, loads_at, instructions, .. } = self;
        let table = &tables.levels[level];
        let basis = &table.basis;
        let points = kind.points(basis);
        for (a, polynomial) in polynomial.iter_mut().enumerate() {
            let weights: &[f64] = match kind {
                ForceInterpolation::Constant if a == 0 => &[0.0, 1.0],
                ForceInterpolation::Constant => &[],
                ForceInterpolation::Polynomial => &basis.projection[a][..=points],
            };
            instructions.run(WeighForces { weights, forces, loads: loads_at, to: polynomial });
            polynomial.iter_mut().zip(&coordinates.inertia).for_each(|(value, inertia)| *value *= inertia);
        }
        let [first, rest @ ..] = forces;
        first.copy_from_slice(&rest[points - 1]);
        self.loss += advance.driven(table, state, polynomial);
    }

    /// Takes a step without contact forces.
    pub fn fly(&mut self, level: usize) {
        self.loss += self.advance.freely(&self.tables.levels[level], &mut self.state);
    }

    /// ½ΔpᵀGΔp of the quasi-static coordinates, the energy lost by the change to a constant force (J).
    pub fn dropped(&self) -> f64 {
        let change = self.forces[1].iter().zip(&self.forces[0]).map(|(new, old)| new - old);
        0.5 * change.zip(&self.coordinates.softness).map(|(change, softness)| change * change * softness).sum::<f64>()
    }

    /// Kinetic and strain energy under the forces at the start of the step (J).
    pub fn energy(&self) -> f64 {
        let mode = |mode: usize| {
            let (q, v, p) = (self.state.position[mode], self.state.velocity[mode], self.forces[0][mode]);
            let w = self.coordinates.frequencies[mode];
            self.coordinates.inertia[mode] * (v * v + (w * q) * (w * q)) + self.coordinates.softness[mode] * p * p
        };
        0.5 * (0..self.state.position.len()).map(mode).sum::<f64>()
    }

    /// Largest amplitude of each coordinate in the future motion without forces.
    pub fn amplitudes(&self, to: &mut [f64]) {
        for (mode, to) in to.iter_mut().enumerate() {
            let (w, ratio) = (self.coordinates.frequencies[mode], self.coordinates.damping_ratios[mode]);
            let (q, v) = (self.state.position[mode], self.state.velocity[mode]);
            let turned =
                if v == 0.0 && q == 0.0 { 0.0 } else { (v + ratio * w * q) / (w * (1.0 - ratio * ratio).sqrt()) };
            *to = (q * q + turned * turned).sqrt();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tiprub_test_models::SeededRandom;

    /// The work Σ p_i S_ik q_k of forces at the points equals the change of energy plus the damping loss, to rounding. And for
    /// polynomial forces, a step gives the same result as two steps of half the length.
    #[test]
    fn work_on_body_equals_stored_plus_damped_energy() {
        let mut random = SeededRandom(11);
        for case in 0..120 {
            let degree = 1 + case % MOST;
            let frequencies: Vec<f64> = (0..7).map(|_| random.scale(1e3, 3e5)).collect();
            let ratios: Vec<f64> = (0..7).map(|_| random.of(&[0.0, 0.01, 0.2])).collect();
            let mut whole = SharedBody::new(Coordinates::new(&frequencies, &ratios, 5), degree).loaded();
            whole.set_span_length(4e-5);
            (0..4).for_each(|level| whole.fill(level));
            whole.state.position[..5].iter_mut().for_each(|q| *q = 1e-5 * random.signed());
            whole.state.velocity[..5].iter_mut().for_each(|v| *v = random.signed());
            let energy = |whole: &SharedBody| -> f64 {
                let (q, v) = (&whole.state.position, &whole.state.velocity);
                let of = |m: usize| v[m] * v[m] + (frequencies[m] * q[m]).powi(2);
                let held = |m: usize| whole.coordinates.softness[m] * whole.forces[0][m].powi(2);
                0.5 * (0..7).map(|m| of(m) + held(m)).sum::<f64>()
            };
            for _ in 0..4 {
                let level = random.below(4);
                let kind =
                    if random.below(4) == 0 { ForceInterpolation::Constant } else { ForceInterpolation::Polynomial };
                let before = energy(&whole);
                whole.settle();
                let [from, length] = [0.25, 0.5_f64.powi(i32::try_from(level).unwrap())];
                whole.loads.iter_mut().flatten().for_each(|load| *load = 1e4 * random.signed());
                whole.begin(SpanStep { level, from, length }, kind);
                let points = if kind == ForceInterpolation::Constant { 1 } else { degree };
                for point in 1..=points {
                    whole.forces[point].iter_mut().for_each(|p| *p = 1e4 * random.signed());
                }
                whole.push(level, kind);
                let basis = whole.tables.levels[level].basis.clone();
                let mut work = 0.0;
                for m in 0..7 {
                    for i in 0..=points {
                        for k in 0..=points {
                            let weight = match kind {
                                ForceInterpolation::Polynomial => basis.work[i][k],
                                ForceInterpolation::Constant if i == 1 => [-1.0, 1.0][k],
                                ForceInterpolation::Constant => 0.0,
                            };
                            work += whole.forces[i][m] * weight * whole.at[k][m];
                        }
                    }
                }
                if kind == ForceInterpolation::Constant {
                    work -= whole.dropped();
                }
                let end = whole.at[points].clone();
                whole.take(level, kind);
                let loss = std::mem::take(&mut whole.loss);
                work += std::mem::take(&mut whole.load_work);
                let after = energy(&whole);
                let scale = before + after + work.abs();
                assert!(
                    (after - before - work + loss).abs() < 1e-11 * scale,
                    "case {case} {kind:?}: {work:e} {loss:e}"
                );
                assert!(loss >= -1e-13 * scale);
                for (m, end) in end.iter().enumerate() {
                    let found = whole.state.position[m] + whole.coordinates.softness[m] * whole.forces[0][m];
                    assert!((found - end).abs() < 1e-12 * (end.abs() + 1e-6), "case {case}: {found:e} {end:e}");
                }
            }
        }
    }
}
