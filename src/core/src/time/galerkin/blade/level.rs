//! Tables of a blade for one step length.

use super::rows::BladeRows;
use crate::math::octet::Eight;
use crate::math::vector::Vector3;
use crate::time::galerkin::basis::{MOST, POINTS, TimeBasis};
use crate::time::galerkin::level::StepTables;
use crate::time::galerkin::response::TERMS;
use crate::time::galerkin::trial::ForceInterpolation;

/// √(3/5), the distance of the outer two of three Gauss points from the middle of −1 … 1.
const GAUSS: f64 = 0.774_596_669_241_483_4;

/// Weights of integrals over a part of a step.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct PartWeights {
    /// Weights of the work of forces at the points: ∫L_i L_k′ dθ over the part.
    pub work: [[f64; POINTS]; POINTS],
    /// Durations of the impulses of these forces (s).
    pub durations: [f64; POINTS],
    /// Ends of the part, as fractions of the step.
    pub ends: [f64; 2],
}

/// Indices of a block of lanes, of its point (0 for the first one after the start of the step), and of its block of nodes.
#[derive(Debug, Clone, Copy)]
pub(super) struct Place {
    pub lane: usize,
    pub point: usize,
    pub block: usize,
}

/// Tables for one step length. A lane is one node at one point of the step. Lanes are stored point by point, in blocks
/// of eight nodes.
#[derive(Debug, Clone)]
pub(crate) struct BladeLevel {
    /// h (s), and its fraction of the span.
    pub step: f64,
    pub basis: TimeBasis,
    /// Number of blocks of lanes.
    pub blocks: usize,
    /// Coefficients of q and q̇ in the displacement at each point.
    pub free: [[Vec<Eight>; 2]; MOST],
    /// Weights of integrals over the whole step.
    pub whole: PartWeights,
    /// Coefficients of (q, q̇, p_a) in q and q̇ at the end, and in the damping loss.
    pub end: [[Vec<Eight>; TERMS]; 2],
    pub loss: Vec<Eight>,
    /// True if at least one mode is damped.
    pub damped: bool,
    /// Masks of the slow modes, which a cubic approximates over the step, and number of blocks that contain all of them.
    pub slow: Vec<u8>,
    pub slow_blocks: usize,
    /// Largest distance of each slow mode from its cubic, or of each fast mode from zero, relative to its amplitude.
    pub relative_errors: Vec<Eight>,
    /// Interpolation of the forces.
    pub kind: ForceInterpolation,
    /// Displacements of all lanes per unit force on each lane (point · nodes + node). For each of the two directions of
    /// the force, the closing displacements come first, then the circumferential ones.
    pub columns: Vec<Eight>,
    /// Displacements of all lanes per unit force on each node at the start of the step, in the same order.
    pub start_columns: Vec<Eight>,
    /// Meridional displacements of all lanes per unit force on each node at the start of the step, then on each lane, along the
    /// closing and the circumferential direction. Empty unless the shaft can move.
    meridional: Vec<Eight>,
}

impl BladeLevel {
    /// Allocates tables for steps of the given degree.
    pub fn new(rows: &BladeRows, degree: usize, kind: ForceInterpolation) -> Self {
        let basis = TimeBasis::new(degree);
        let points = if kind == ForceInterpolation::Constant { 1 } else { degree };
        let blocks = points * rows.blocks;
        let column = 4 * blocks;
        let of_modes = || vec![Eight::ZERO; rows.mode_blocks];
        Self {
            step: 0.0,
            blocks,
            free: std::array::from_fn(|_| [of_modes(), of_modes()]),
            whole: PartWeights {
                work: std::array::from_fn(|i| kind.work_weights(&basis, i)),
                durations: [0.0; POINTS],
                ends: [0.0, 1.0],
            },
            end: [0, 1].map(|_| std::array::from_fn(|_| of_modes())),
            loss: vec![Eight::ZERO; TERMS * (TERMS + 1) / 2 * rows.mode_blocks],
            damped: false,
            slow: vec![0; rows.mode_blocks],
            slow_blocks: 0,
            relative_errors: of_modes(),
            kind,
            basis,
            columns: vec![Eight::ZERO; points * rows.nodes * column],
            start_columns: vec![Eight::ZERO; rows.nodes * column],
            meridional: vec![
                Eight::ZERO;
                if rows.meridional.is_empty() { 0 } else { (points + 1) * rows.nodes * 2 * blocks }
            ],
        }
    }

    /// Returns the places of all blocks of lanes, in order.
    #[inline(always)]
    pub(super) fn places(&self, rows: &BladeRows) -> impl Iterator<Item = Place> + use<> {
        let blocks = rows.blocks;
        let (mut point, mut block) = (0, 0);
        (0..self.blocks).map(move |lane| {
            let place = Place { lane, point, block };
            block += 1;
            if block == blocks {
                (point, block) = (point + 1, 0);
            }
            place
        })
    }

    /// Fills the tables from the step tables of all contact rows, without allocating.
    pub fn fill(&mut self, rows: &BladeRows, tables: &StepTables) {
        (self.step, self.damped) = (tables.step, tables.damped);
        let (points, degree) = (self.points(), self.basis.degree);
        self.whole.durations = match self.kind {
            ForceInterpolation::Polynomial => self.basis.weights.map(|weight| weight * tables.step),
            ForceInterpolation::Constant => [0.0, tables.step, 0.0, 0.0],
        };
        for (free, point) in self.free.iter_mut().zip(&tables.modes.points[degree - points..degree]) {
            for (to, from) in free.iter_mut().zip(point) {
                Eight::spread(from.iter().copied(), 0.0, to);
            }
        }
        for (to, from) in self.end.as_flattened_mut().iter_mut().zip(tables.modes.end.as_flattened()) {
            Eight::spread(from.iter().copied(), 0.0, to);
        }
        let blocks = self.end[0][0].len();
        let pairs = (0..TERMS).flat_map(|row| (row..TERMS).map(move |term| (row, term)));
        for (to, (row, term)) in self.loss.chunks_exact_mut(blocks.max(1)).zip(pairs) {
            let twice = if row == term { 1.0 } else { 2.0 };
            Eight::spread(tables.modes.loss[row][term].iter().map(|value| twice * value), 0.0, to);
        }
        self.slow_blocks = 0;
        let frequencies = self.slow.iter_mut().zip(&mut self.relative_errors).zip(&rows.rates[3]);
        for (block, ((slow, errors), frequencies)) in frequencies.enumerate() {
            *errors = Eight(frequencies.0.map(|frequency| cubic_error(frequency * tables.step).min(1.0)));
            *slow = (0..8).fold(0, |mask, i| mask | u8::from(errors.0[i] < 1.0) << i);
            if *slow != 0 {
                self.slow_blocks = block + 1;
            }
        }
        let compliance = tables.compliance_of(self.kind);
        let (lanes, stride) = (compliance.lanes(), compliance.stride());
        for from in 0..=points {
            for node in 0..rows.nodes {
                let columns =
                    [0, 1, 2].map(|c| &compliance.columns()[(3 * (from * rows.nodes + node) + c) * stride..][..stride]);
                for (along, at, other) in (0..2).flat_map(|along| {
                    (1..=points).flat_map(move |at| (0..rows.nodes).map(move |other| (along, at, other)))
                }) {
                    let direction = rows.along(along, node);
                    let moved: Vector3 =
                        (0..3).map(|c| direction[c] * lanes.vector3(columns[c], lanes.at(at, other))).sum();
                    if !self.meridional.is_empty() {
                        let column = (2 * (from * rows.nodes + node) + along) * self.blocks;
                        self.meridional[column + (at - 1) * rows.blocks + other / 8].0[other % 8] =
                            rows.meridional_direction(other).dot(&moved);
                    }
                    for seen in [0, 1] {
                        let column = ((node * 2 + along) * 2 + seen) * self.blocks;
                        let target = match from {
                            0 => &mut self.start_columns[column..][..self.blocks],
                            _ => {
                                let lane = (from - 1) * rows.nodes * 4 * self.blocks;
                                &mut self.columns[lane + column..][..self.blocks]
                            }
                        };
                        target[(at - 1) * rows.blocks + other / 8].0[other % 8] = rows.along(seen, other).dot(&moved);
                    }
                }
            }
        }
    }

    /// Weights of integrals over the part of the step between two fractions of it.
    pub fn part(&self, ends: [f64; 2]) -> PartWeights {
        let (share, middle) = (ends[1] - ends[0], 0.5 * (ends[0] + ends[1]));
        let mut part = PartWeights { ends, ..PartWeights::default() };
        if self.kind == ForceInterpolation::Constant {
            (part.work[1][0], part.work[1][1]) = (-share, share);
            part.durations[1] = share * self.step;
            return part;
        }
        // Gauss points and weights, exact up to degree 5.
        for (place, weight) in [(-GAUSS, 5.0 / 18.0), (0.0, 4.0 / 9.0), (GAUSS, 5.0 / 18.0)] {
            let theta = middle + 0.5 * share * place;
            let (values, slopes) = (self.basis.weights_at(theta), self.basis.slopes_at(theta));
            for (i, value) in values.iter().enumerate() {
                let weighted = share * weight * value;
                part.durations[i] += weighted * self.step;
                part.work[i].iter_mut().zip(slopes).for_each(|(sum, slope)| *sum += weighted * slope);
            }
        }
        part
    }

    /// Number of points at which forces are unknown.
    #[inline(always)]
    pub fn points(&self) -> usize {
        if self.kind == ForceInterpolation::Constant { 1 } else { self.basis.degree }
    }

    /// Place of a point with unknown forces, by its number, as a fraction of the step.
    pub fn place(&self, point: usize) -> f64 {
        if self.kind == ForceInterpolation::Constant { 1.0 } else { self.basis.points[point + 1] }
    }

    /// Displacements of all lanes per unit force on one lane: closing and circumferential displacements for a force
    /// along the closing displacement, then both for a circumferential force.
    #[inline(always)]
    pub fn column(&self, lane: usize) -> [&[Eight]; 4] {
        let columns = &self.columns[4 * lane * self.blocks..][..4 * self.blocks];
        quarters(columns, self.blocks)
    }

    /// Returns the meridional displacements of all lanes per unit force on a node, along the closing and the circumferential
    /// direction. The force acts at the start of the step (`from` = 0) or at a point.
    #[inline(always)]
    pub(super) fn meridional(&self, from: usize, node: usize, nodes: usize) -> [&[Eight]; 2] {
        let columns = &self.meridional[2 * (from * nodes + node) * self.blocks..][..2 * self.blocks];
        columns.split_at(self.blocks).into()
    }

    /// Displacements of all lanes per unit force on a node at the start of the step, in the order of [`Self::column`].
    #[inline(always)]
    pub(crate) fn start_column(&self, node: usize) -> [&[Eight]; 4] {
        let columns = &self.start_columns[4 * node * self.blocks..][..4 * self.blocks];
        quarters(columns, self.blocks)
    }
}

/// Bounds the distance of a mode from the cubic through its values and rates at two times, relative to its amplitude.
/// `x` is the frequency of the mode times the time between them.
fn cubic_error(x: f64) -> f64 {
    x * x * x * x / 384.0
}

#[inline(always)]
fn quarters(columns: &[Eight], blocks: usize) -> [&[Eight]; 4] {
    let (first, second) = columns.split_at(2 * blocks);
    let ((a, b), (c, d)) = (first.split_at(blocks), second.split_at(blocks));
    [a, b, c, d]
}
