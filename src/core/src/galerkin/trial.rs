//! One step of one sector, tried: contact forces at the points, gaps there, and how good they are.

use super::basis::{MOST, POINTS};
use super::level::Level;
use super::rows::Rows;
use super::state::SectorState;
use crate::dynamics::bank::LANES;
use crate::dynamics::dispatch::{InstructionSet, Kernel};
use crate::gaps::dot;
use crate::laws::active_set::ContactSolver;
use nalgebra::DMatrix;

/// Most evaluations of the gaps of one trial.
const PASSES: usize = 6;
/// Largest change of slope of a force within a step counts by this share of it: what the highest divided difference does not see of a
/// contact that opens or closes. Measured on forty random sectors: with 0.02 errors are up to six times the tolerance, with 0.1 five in a
/// hundred are beyond 0.9 of it.
const KINK: f64 = 0.1;
/// Gap of a node between points may be so many times what the polynomial leaves out, or the step is shortened.
const NEAR: f64 = 4.0;

/// What the nodes of a sector may touch, at the points of the step that is tried.
pub trait Obstacle {
    /// Gap (m; infinite where there is nothing to touch) and unit normal to the node displaced by `moved` (m), at a point of the step.
    fn gap(&mut self, node: usize, point: usize, moved: [f64; 3]) -> (f64, [f64; 3]);

    /// Force per unit of λ on the node, friction included, at velocity `velocity` of its vibration (m/s).
    fn direction(
        &mut self,
        node: usize,
        point: usize,
        moved: [f64; 3],
        velocity: [f64; 3],
        normal: [f64; 3],
    ) -> [f64; 3];
}

/// How a trial came out.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Verdict {
    /// The contact problem has been solved.
    pub solved: bool,
    /// Estimate of the error it makes in displacements (m).
    pub error: f64,
    /// A contact opens or closes.
    pub switches: bool,
    /// Σ λ_i S_ik g_k of those nodes (J): energy that this adds.
    pub switched: f64,
    /// A node may have touched between the points.
    pub near: bool,
    /// Linear systems factorised.
    pub factorisations: usize,
}

/// Scratch of a trial and what it found, for one number of contact nodes.
#[derive(Debug, Clone)]
pub struct Trial {
    /// Number of points at which forces are sought: s, or 1 where the force is constant.
    pub points: usize,
    /// λ at the points 0 … s (N), `[point][node]`.
    pub multipliers: [Vec<f64>; POINTS],
    /// Forces on the rows (N).
    pub forces: [Vec<f64>; POINTS],
    /// Gaps (m).
    pub gaps: [Vec<f64>; POINTS],
    /// Displacements of the rows (m).
    pub displacements: [Vec<f64>; POINTS],
    /// Unit normals, three per node.
    pub normals: [Vec<f64>; POINTS],
    /// Forces per λ, three per node.
    directions: [Vec<f64>; POINTS],
    /// Displacements without forces at points 1 … s.
    free: [Vec<f64>; POINTS],
    /// Velocities of the rows at the start (m/s).
    velocities: Vec<f64>,
    /// How far the rows can be from where they rest (m).
    reach: Vec<f64>,
    solver: ContactSolver,
    instructions: InstructionSet,
    /// Unknowns of the problem: (point, node).
    members: Vec<(usize, usize)>,
    chosen: [Vec<bool>; POINTS],
    /// Impulses left out (N·s), and what the error makes of them (m²/(N·s)).
    impulses: Vec<f64>,
    left: Vec<f64>,
}

/// What is used to step: all points, or a constant force and the end alone.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// The force is a polynomial of degree s.
    Polynomial,
    /// The force is what it is at the end: dissipative whatever opens or closes.
    Constant,
}

/// Three values of a node.
pub fn three(values: &[f64], node: usize) -> [f64; 3] {
    [values[3 * node], values[3 * node + 1], values[3 * node + 2]]
}

/// y += A x for the entries of x that are not 0.
struct AddProduct<'a> {
    matrix: &'a DMatrix<f64>,
    x: &'a [f64],
    y: &'a mut [f64],
}

impl Kernel for AddProduct<'_> {
    #[inline(always)]
    fn run(self) {
        let rows = self.matrix.nrows();
        for (column, value) in self.matrix.as_slice().chunks_exact(rows).zip(self.x) {
            if *value != 0.0 {
                for (y, entry) in self.y[..rows].iter_mut().zip(column) {
                    *y += entry * value;
                }
            }
        }
    }
}

impl Trial {
    /// Room for `nodes` contact nodes.
    pub fn new(nodes: usize) -> Self {
        let per = |len: usize| -> [Vec<f64>; POINTS] { std::array::from_fn(|_| vec![0.0; len]) };
        let stride = (3 * nodes).next_multiple_of(LANES);
        Self {
            points: 0,
            multipliers: per(nodes),
            forces: per(3 * nodes),
            gaps: per(nodes),
            displacements: per(stride),
            normals: per(3 * nodes),
            directions: per(3 * nodes),
            free: per(stride),
            velocities: vec![0.0; stride],
            reach: vec![0.0; stride],
            solver: ContactSolver::new(MOST * nodes),
            instructions: InstructionSet::detect(),
            members: Vec::with_capacity(MOST * nodes),
            chosen: std::array::from_fn(|_| vec![false; nodes]),
            impulses: vec![0.0; 3 * nodes],
            left: vec![0.0; 3 * nodes],
        }
    }

    /// Try a step from `state`; `precision`: gaps of contacts that count as closed (m).
    pub fn run(
        &mut self,
        (level, kind): (&Level, Kind),
        rows: &Rows,
        state: &SectorState,
        obstacle: &mut impl Obstacle,
        precision: f64,
    ) -> Verdict {
        self.points = if kind == Kind::Constant { 1 } else { level.basis.degree };
        self.begin(level, kind, rows, state);
        if !state.looked {
            for node in 0..self.gaps[0].len() {
                (self.gaps[0][node], _) = obstacle.gap(node, 0, three(&self.displacements[0], node));
            }
        }
        let mut verdict = Verdict::default();
        for pass in 0..PASSES {
            let (lowest, largest) = self.find_gaps((level, kind), obstacle);
            let rests = self.multipliers[1..=self.points].iter().all(|point| point.iter().all(|value| *value == 0.0));
            if lowest.is_nan() {
                return verdict;
            }
            // Nothing pushes and nothing is pushed; or what was solved holds on the curved gaps as well.
            if (rests && lowest >= 0.0) || (pass > 0 && lowest >= -precision && largest <= precision) {
                verdict.solved = true;
                break;
            }
            if pass + 1 == PASSES || !self.solve((level, kind), obstacle, &mut verdict) {
                return verdict;
            }
        }
        if kind == Kind::Polynomial {
            self.judge(level, rows, &mut verdict);
        }
        verdict
    }

    /// Displacements and velocities of the rows at the start.
    pub fn find_start(&mut self, rows: &Rows, state: &SectorState) {
        rows.now(state, &mut [&mut self.displacements[0], &mut self.velocities]);
        let (matrix, y) = (rows.residual(), &mut self.displacements[0]);
        self.instructions.run(AddProduct { matrix, x: &state.forces, y });
    }

    /// How far each row can be from where it rests while nothing pushes (m).
    pub fn reach(&mut self, rows: &Rows, state: &SectorState) -> &[f64] {
        rows.reach(state, &mut [&mut self.reach]);
        &self.reach
    }

    /// Where the rows go without forces at points 1 … s, and a guess of these: as at the start.
    fn begin(&mut self, level: &Level, kind: Kind, rows: &Rows, state: &SectorState) {
        self.find_start(rows, state);
        let [_, first, second, third] = &mut self.free;
        match (kind, level.basis.degree) {
            (Kind::Polynomial, 3) => rows.free(&level.modes, state, [0, 1, 2], &mut [first, second, third]),
            (Kind::Polynomial, 2) => rows.free(&level.modes, state, [0, 1], &mut [first, second]),
            (_, degree) => rows.free(&level.modes, state, [degree - 1], &mut [first]),
        }
        self.forces[0].copy_from_slice(&state.forces);
        self.multipliers[0].copy_from_slice(&state.multipliers);
        self.gaps[0].copy_from_slice(&state.gaps);
        self.normals[0].copy_from_slice(&state.normals);
        for point in 1..=self.points {
            if kind == Kind::Polynomial {
                let (matrix, y) = (level.compliance_of(point, 0), &mut self.free[point]);
                self.instructions.run(AddProduct { matrix, x: &state.forces, y });
            }
            self.forces[point].copy_from_slice(&state.forces);
            self.multipliers[point].copy_from_slice(&state.multipliers);
        }
    }

    /// Compliance of point i per force at point k.
    fn compliance((level, kind): (&Level, Kind), i: usize, k: usize) -> &DMatrix<f64> {
        if kind == Kind::Constant { &level.constant } else { level.compliance_of(i, k) }
    }

    /// Displacements under the forces of now, gaps and directions there: the smallest gap, and the largest of a contact that pushes.
    fn find_gaps(&mut self, how: (&Level, Kind), obstacle: &mut impl Obstacle) -> (f64, f64) {
        let (mut lowest, mut largest) = (f64::INFINITY, 0.0_f64);
        for i in 1..=self.points {
            let Self { displacements, free, forces, instructions, .. } = self;
            displacements[i].copy_from_slice(&free[i]);
            for k in 1..=self.points {
                let (matrix, y) = (Self::compliance(how, i, k), &mut displacements[i]);
                instructions.run(AddProduct { matrix, x: &forces[k], y });
            }
            for node in 0..self.gaps[i].len() {
                let moved = three(&self.displacements[i], node);
                let (gap, normal) = obstacle.gap(node, i, moved);
                self.gaps[i][node] = gap;
                self.normals[i][3 * node..3 * node + 3].copy_from_slice(&normal);
                lowest = if gap.is_nan() || lowest.is_nan() { f64::NAN } else { lowest.min(gap) };
                if self.multipliers[i][node] > 0.0 {
                    largest = largest.max(gap.abs());
                }
            }
        }
        (lowest, largest)
    }

    /// Gap of a node at a point as it would be without the forces, linear from where it is.
    fn gap_without(&self, point: usize, node: usize) -> f64 {
        let (moved, free) = (three(&self.displacements[point], node), three(&self.free[point], node));
        let normal = three(&self.normals[point], node);
        self.gaps[point][node] - dot(normal, [0, 1, 2].map(|i| moved[i] - free[i]))
    }

    /// 0 ≤ λ ⟂ g ≥ 0 at all points and nodes: of those that penetrate or push first, then of those that these make penetrate.
    fn solve(&mut self, how: (&Level, Kind), obstacle: &mut impl Obstacle, verdict: &mut Verdict) -> bool {
        for point in 1..=self.points {
            for node in 0..self.gaps[point].len() {
                let touches = self.gaps[point][node] <= 0.0 || self.multipliers[point][node] > 0.0;
                self.chosen[point][node] = touches || self.gap_without(point, node) < 0.0;
            }
        }
        loop {
            self.members.clear();
            for point in 1..=self.points {
                let chosen = self.chosen[point].iter().enumerate().filter(|(_, chosen)| **chosen);
                self.members.extend(chosen.map(|(node, _)| (point, node)));
            }
            self.find_directions(obstacle);
            self.fill(how);
            let outcome = self.solver.lcp();
            verdict.factorisations += outcome.factorisations;
            if !outcome.solved || self.solver.multipliers.iter().any(|value| !value.is_finite()) {
                return false;
            }
            self.take_forces();
            if !self.add_violated(how) {
                return true;
            }
        }
    }

    fn find_directions(&mut self, obstacle: &mut impl Obstacle) {
        for &(point, node) in &self.members {
            let (moved, normal) = (three(&self.displacements[point], node), three(&self.normals[point], node));
            let direction = obstacle.direction(node, point, moved, three(&self.velocities, node), normal);
            self.directions[point][3 * node..3 * node + 3].copy_from_slice(&direction);
        }
    }

    fn fill(&mut self, how: (&Level, Kind)) {
        self.solver.set_size(self.members.len());
        for (column, (k, other)) in self.members.iter().enumerate() {
            let direction = three(&self.directions[*k], *other);
            for (row, (i, node)) in self.members.iter().enumerate() {
                let block = Self::compliance(how, *i, *k).fixed_view::<3, 3>(3 * node, 3 * other);
                let normal = three(&self.normals[*i], *node);
                let along = |c: usize| dot(normal, [block[(0, c)], block[(1, c)], block[(2, c)]]);
                self.solver.delassus[(row, column)] = dot([along(0), along(1), along(2)], direction);
            }
        }
        for index in 0..self.members.len() {
            let (point, node) = self.members[index];
            self.solver.gaps[index] = self.gap_without(point, node);
            self.solver.active[index] = self.multipliers[point][node] > 0.0;
        }
    }

    fn take_forces(&mut self) {
        for point in 1..=self.points {
            self.multipliers[point].fill(0.0);
            self.forces[point].fill(0.0);
        }
        for (index, (point, node)) in self.members.iter().enumerate() {
            let value = self.solver.multipliers[index];
            self.multipliers[*point][*node] = value;
            for i in 3 * node..3 * node + 3 {
                self.forces[*point][i] = value * self.directions[*point][i];
            }
        }
    }

    /// Choose nodes that the forces found push into what they may touch.
    fn add_violated(&mut self, how: (&Level, Kind)) -> bool {
        let scale = self.members.iter().fold(0.0_f64, |most, (point, node)| most.max(self.gaps[*point][*node].abs()));
        let mut found = false;
        for i in 1..=self.points {
            for node in 0..self.gaps[i].len() {
                if self.chosen[i][node] || self.gaps[i][node].is_infinite() {
                    continue;
                }
                let mut moved = [0.0; 3];
                for k in 1..=self.points {
                    let matrix = Self::compliance(how, i, k);
                    for (column, force) in self.forces[k].iter().enumerate().filter(|(_, force)| **force != 0.0) {
                        moved = [0, 1, 2].map(|c| moved[c] + matrix[(3 * node + c, column)] * force);
                    }
                }
                let after = self.gap_without(i, node) + dot(three(&self.normals[i], node), moved);
                if after < -1e-13 * scale {
                    self.chosen[i][node] = true;
                    found = true;
                }
            }
        }
        found
    }

    /// Error, switches, and near misses of a step that is solved.
    fn judge(&mut self, level: &Level, rows: &Rows, verdict: &mut Verdict) {
        let (basis, count) = (&level.basis, level.basis.count());
        self.impulses.fill(0.0);
        let mut pushed = false;
        for node in 0..self.gaps[0].len() {
            let pushes = |point: usize| self.multipliers[point][node] > 0.0;
            let (any, all) = ((0..count).any(pushes), (0..count).all(pushes));
            if !any {
                verdict.near |= self.comes_near(basis, node);
                continue;
            }
            pushed = true;
            for row in 3 * node..3 * node + 3 {
                let force = |point: usize| self.forces[point][row];
                let left = (0..count).map(|point| basis.left_out[point] * force(point)).sum::<f64>() * level.step;
                self.impulses[row] = if all { left } else { left.abs().max(KINK * level.step * kink(basis, force)) };
            }
            if !all {
                verdict.switches = true;
                let gap = |k: usize| self.gaps[k][node];
                let terms = (0..count).flat_map(|i| (0..count).map(move |k| (i, k)));
                verdict.switched +=
                    terms.map(|(i, k)| self.multipliers[i][node] * basis.work[i][k] * gap(k)).sum::<f64>();
            }
        }
        if pushed {
            self.left.fill(0.0);
            self.instructions.run(AddProduct { matrix: rows.error_form(), x: &self.impulses, y: &mut self.left });
            let square: f64 = self.left.iter().zip(&self.impulses).map(|(a, b)| a * b).sum();
            verdict.error = square.max(0.0).sqrt();
        }
    }

    /// Whether the gap of an open node comes near zero between the points.
    fn comes_near(&self, basis: &super::basis::Basis, node: usize) -> bool {
        let gap = |point: usize| self.gaps[point][node];
        if !gap(0).is_finite() || !gap(1).is_finite() {
            return false;
        }
        // Between its points a cubic leaves their range by less than half of it, and what it leaves out is less than all of it.
        let gaps = (0..basis.count()).map(gap);
        let (low, high) =
            gaps.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), gap| (gap.min(low), gap.max(high)));
        if low > (0.5 + NEAR) * (high - low) {
            return false;
        }
        let sum = |weights: &[f64; POINTS]| (0..basis.count()).map(|i| weights[i] * gap(i)).sum::<f64>();
        let left = NEAR * sum(&basis.left_out).abs();
        basis.between.iter().any(|weights| sum(weights) < left)
    }
}

/// Largest change of slope of values at the points, over the step.
fn kink(basis: &super::basis::Basis, value: impl Fn(usize) -> f64) -> f64 {
    if basis.degree == 1 {
        return (value(1) - value(0)).abs();
    }
    let slope = |i: usize| (value(i + 1) - value(i)) / (basis.points[i + 1] - basis.points[i]);
    (1..basis.degree).map(|i| (slope(i) - slope(i - 1)).abs()).fold(0.0, f64::max)
}
