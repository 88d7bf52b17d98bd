//! Smallest gaps within a step of a single sector on rigid surfaces, for nodes that stay open.
//!
//! At the fraction θ of the step, the gap of a node is b(θ) + n(θ)·u(θ). Its displacement u is computed exactly from all modes. The normal n and b
//! are polynomials through their values at the points of the step, so the error is of second order in the distance between u and the displacements
//! at the points. In a step without a trial, n is constant, and b is a line between both ends of a part, where the gap to the surface is evaluated.
//!
//! A cubic connects the gaps and their rates at both ends of a part of the step. Parts are halved, starting with the whole step, until the cubic
//! shows that the smallest gap is not needed, or is accurate enough. At its minimum, the gap to the surface is evaluated.

use super::judgement::NEAR;
use super::{Obstacle, Trial};
use crate::math::cubic::{evaluate, interior_minimum};
use crate::math::vector::{Vector3, vector3_at};
use crate::time::galerkin::advance::Advance;
use crate::time::galerkin::basis::{MOST, POINTS, TimeBasis, real};
use crate::time::galerkin::level::StepTables;
use crate::time::galerkin::parts::{
    FOLLOW_FRACTION, MAX_HALVINGS, MINIMUM_FRACTION, Part, PartSearch, STORED_TIMES, search_parts,
};
use crate::time::galerkin::rows::ContactRows;
use crate::time::galerkin::state::SectorState;
use crate::time::galerkin::surroundings::Witness;
use crate::time::galerkin::tables::{HALVINGS, Tables};
use std::mem::{replace, take};

/// Largest number of followed nodes whose displacements are computed node by node.
const FEW_NODES: usize = 3;

/// Scratch memory, and the smallest gaps found.
#[derive(Debug, Clone, Default)]
pub(super) struct Followed {
    nodes: Vec<FollowedNode>,
    /// Motion at the ends of the step, and in the middle of one part of each length.
    instants: Vec<Instant>,
    /// Smallest gap of each contact node within the step (m); NaN if the node was not followed.
    lowest: Vec<f64>,
}

/// A followed node, with polynomials as coefficients of θᵃ.
#[derive(Debug, Clone)]
struct FollowedNode {
    node: usize,
    /// b (m) and n.
    base: [f64; POINTS],
    normal: [Vector3; POINTS],
    /// Displacement due to the residual flexibility (m).
    residual: [Vector3; POINTS],
    /// Error of b over the whole step (m). The error of a line has parts that are proportional to the length of an interval and to its square.
    /// The error of a polynomial is in the second place.
    errors: [f64; 2],
    /// True if b is a line between the values at both ends of each part, which follow from gaps to the surface.
    is_line: bool,
    /// Gap below which the smallest gap is needed (m).
    threshold: f64,
}

/// Motion of the followed nodes at a fraction of the step.
#[derive(Debug, Clone)]
struct Instant {
    modes: SectorState,
    nodes: Vec<NodeMotion>,
}

/// Displacement (m) and gap (m) of a node, their rates per step (m), b (m), and the rate of n·u per step (m).
#[derive(Debug, Clone, Copy, Default)]
struct NodeMotion {
    moved: Vector3,
    change: Vector3,
    gap: f64,
    rate: f64,
    base: f64,
    approach: f64,
}

/// The step whose nodes are followed.
#[derive(Debug, Clone, Copy)]
pub(crate) struct StepToFollow<'a> {
    pub tables: &'a Tables,
    /// Number of halvings of the span, and tables of the step.
    pub level: usize,
    pub step: &'a StepTables,
    /// Largest displacement error of a step (m).
    pub tolerance: f64,
    /// Modes at the start of the step.
    pub state: &'a SectorState,
}

impl Followed {
    /// Allocates memory for `modes` modes and `nodes` contact nodes.
    pub(super) fn new(modes: usize, nodes: usize) -> Self {
        let instant = || Instant { modes: SectorState::new(modes, 0), nodes: vec![NodeMotion::default(); nodes] };
        Self {
            nodes: Vec::with_capacity(nodes),
            instants: (0..STORED_TIMES).map(|_| instant()).collect(),
            lowest: vec![f64::NAN; nodes],
        }
    }
}

impl NodeMotion {
    /// Returns the displacement (m) at the fraction `t` of the way to `end`; both are `length` steps apart.
    fn displacement_towards(&self, end: &Self, length: f64, t: f64) -> Vector3 {
        let (start, stop, rise) = (length * self.change, length * end.change, end.moved - self.moved);
        let (bend, twist) = (3.0 * rise - 2.0 * start - stop, start + stop - 2.0 * rise);
        self.moved + t * (start + t * (bend + t * twist))
    }
}

impl Trial {
    /// Forgets which nodes were followed.
    pub(crate) fn forget_followed(&mut self) {
        self.followed.lowest.fill(f64::NAN);
    }

    /// Returns the smallest gap of a node within the tried step (m), except for its end; `None` if the node was not followed.
    pub(crate) fn followed_minimum(&self, node: usize) -> Option<f64> {
        Some(self.followed.lowest[node]).filter(|gap| !gap.is_nan())
    }

    /// Finds the smallest gaps of the nodes that are open at all points of the step and may come closer in between, if their smallest gap is
    /// needed or may be below zero by about the tolerance. Returns the smallest of these gaps (m). The modal forces of the step must be set in
    /// `advance`. Nodes whose surface has jumped by more than the tolerance at the start of the step are not followed.
    pub(crate) fn follow(&mut self, of: &StepToFollow, advance: &mut Advance, surfaces: &impl Witness) -> f64 {
        let StepToFollow { tables, step, state, tolerance, .. } = *of;
        let (rows, basis) = (&tables.rows, &step.basis);
        let largest_error = advance.find_amplitudes(rows, state, step.step, basis.degree);
        let depth_threshold = (MINIMUM_FRACTION + FOLLOW_FRACTION - 1.0) * tolerance;
        let threshold = |node: usize| surfaces.needed_below(node).max(depth_threshold);
        let mut followed = take(&mut self.followed);
        followed.nodes.clear();
        let mut errors_known = basis.degree == 1;
        if basis.degree == 1 {
            self.find_start(rows, state);
        }
        for node in 0..self.nodes() {
            let threshold = threshold(node);
            let Some([bound, ends]) = self.gap_bound(basis, node, surfaces, threshold + largest_error) else {
                continue;
            };
            let may_matter =
                |error: f64| bound - error < threshold && ends - bound + error > FOLLOW_FRACTION * tolerance;
            if !may_matter(largest_error) {
                continue;
            }
            if !replace(&mut errors_known, true) {
                advance.interpolation_errors(rows, step.step, &mut self.reach.0);
            }
            let error = if basis.degree == 1 { largest_error } else { self.interpolation_error(node) };
            if may_matter(error) {
                self.find_start(rows, state);
                followed.nodes.push(self.followed_node(step, rows, node, threshold, surfaces));
            }
        }
        followed.nodes.retain(|followed| !self.has_jumped(followed.node, surfaces, tolerance));
        if !followed.nodes.is_empty() {
            followed.nodes.iter().for_each(|of| followed.lowest[of.node] = f64::INFINITY);
            self.search(&mut followed, of, advance, surfaces);
        }
        let lowest = followed.lowest.iter().copied().fold(f64::INFINITY, f64::min);
        self.followed = followed;
        lowest
    }

    /// Returns whether no node touches during the step without forces, and finds the smallest gaps that are needed. Gaps at the end of the step
    /// must be known as those of point 1. The gap of a fixed node differs from a straight line in time by at most the sum of `bends` (m); see
    /// [`Witness::largest_bends`].
    pub(crate) fn stays_open(
        &mut self,
        of: &StepToFollow,
        advance: &mut Advance,
        surfaces: &impl Witness,
        bends: [f64; 2],
    ) -> bool {
        let StepToFollow { tables, level, step, tolerance, state } = *of;
        let (rows, length) = (&tables.rows, step.step);
        advance.set_forces(rows, |_| None);
        let largest_error = advance.find_amplitudes(rows, state, length, MOST);
        self.find_start(rows, state);
        rows.end_velocities(&tables.levels[level], state, &mut self.free_motion.end_velocities);
        self.forget_followed();
        let mut followed = take(&mut self.followed);
        followed.nodes.clear();
        let (mut errors_known, mut is_open, bend) = (false, true, bends[0] + bends[1]);
        for node in 0..self.nodes() {
            let (normal, threshold) = (self.normal(1, node), surfaces.needed_below(node).max(0.0));
            let gaps = [self.gap(0, node), self.gap(1, node)];
            if gaps.iter().all(|gap| *gap == f64::INFINITY) {
                continue;
            }
            if !gaps.iter().all(|gap| gap.is_finite()) {
                is_open = false;
                break;
            }
            let moved = [vector3_at(&self.start, node), self.displacement(1, node)];
            let base = [0, 1].map(|end| gaps[end] - normal.dot(&moved[end]));
            let of_base = base[1] - base[0];
            let slope = |velocity: Vector3| of_base + length * normal.dot(&velocity);
            let [first, last] = [
                slope(vector3_at(&self.velocities, node)),
                slope(self.free_motion.end_velocities.vector3(0, node, self.nodes())),
            ];
            let (ends, between) = (gaps[0].min(gaps[1]), (gaps[0] + first / 3.0).min(gaps[1] - last / 3.0));
            let may_matter = |error: f64| between < ends + error * (4.0 / 3.0) && between.min(ends) - error < threshold;
            if !may_matter(largest_error + bend) {
                continue;
            }
            if !replace(&mut errors_known, true) {
                advance.interpolation_errors(rows, length, &mut self.reach.0);
            }
            if may_matter(self.interpolation_error(node) + bend) {
                let (mut line, mut normals) = ([0.0; POINTS], [Vector3::zeros(); POINTS]);
                (line[0], line[1], normals[0]) = (base[0], of_base, normal);
                followed.nodes.push(FollowedNode {
                    node,
                    base: line,
                    normal: normals,
                    residual: [Vector3::zeros(); POINTS],
                    errors: bends,
                    is_line: true,
                    threshold,
                });
            }
        }
        if is_open && !followed.nodes.is_empty() {
            followed.nodes.iter().for_each(|of| followed.lowest[of.node] = f64::INFINITY);
            self.search(&mut followed, of, advance, surfaces);
            let lowest = followed.nodes.iter().map(|of| followed.lowest[of.node]).fold(f64::INFINITY, f64::min);
            is_open = lowest > MINIMUM_FRACTION * tolerance;
        }
        self.followed = followed;
        is_open
    }

    /// Returns the bound on the interpolation error of the gap of a node (m) from those of its rows.
    fn interpolation_error(&self, node: usize) -> f64 {
        self.normal(self.points(), node).abs().dot(&self.reach.0.vector3(0, node, self.nodes()))
    }

    /// Returns a lower bound (m) of the gap of a node within the step, as far as its polynomials and the surface determine it, and the smallest
    /// of its gaps at the points. Returns `None` if the node touches, or if the bound certainly exceeds `needed_below` (m).
    fn gap_bound(
        &self,
        basis: &TimeBasis,
        node: usize,
        surfaces: &impl Obstacle,
        needed_below: f64,
    ) -> Option<[f64; 2]> {
        let mut gaps = [0.0; POINTS];
        for (point, gap) in gaps[..basis.count()].iter_mut().enumerate() {
            *gap = self.gap(point, node);
            if self.multiplier(point, node) != 0.0 || !gap.is_finite() {
                return None;
            }
        }
        let values = || gaps[..basis.count()].iter();
        let lowest = values().copied().fold(f64::INFINITY, f64::min);
        let sum = |weights: &[f64; POINTS]| values().zip(weights).map(|(gap, weight)| gap * weight).sum::<f64>();
        let left = NEAR * sum(&basis.left_out).abs();
        if basis.degree > 1 {
            return Some([basis.inner.iter().map(sum).fold(lowest, f64::min) - left, lowest]);
        }
        if lowest - 2.0 * left >= needed_below {
            return None;
        }
        let middle = 0.5 * (self.displacement(0, node) + self.displacement(1, node));
        let line = 0.5 * (gaps[0] + gaps[1]);
        let bend = surfaces.gap_within(node, 0.5, middle).map_or(left, |gap| (gap - line).abs());
        Some([lowest - 2.0 * bend, lowest])
    }

    /// Finds the polynomials of a node.
    fn followed_node(
        &self,
        step: &StepTables,
        rows: &ContactRows,
        node: usize,
        threshold: f64,
        surfaces: &impl Obstacle,
    ) -> FollowedNode {
        let basis = &step.basis;
        let mut normals = [Vector3::zeros(); POINTS];
        for point in 1..basis.count() {
            normals[point] = self.normal(point, node);
        }
        let weights = basis.weights_before();
        normals[0] = (1..basis.count()).map(|point| weights[point] * normals[point]).sum();
        let base = |point: usize| self.gap(point, node) - normals[point].dot(&self.displacement(point, node));
        let mut values = [0.0; POINTS];
        values[..basis.count()].iter_mut().enumerate().for_each(|(point, value)| *value = base(point));
        let mut coefficients = basis.coefficients(&values);
        let mut error =
            NEAR * values.iter().zip(&basis.left_out).map(|(value, weight)| value * weight).sum::<f64>().abs();
        if basis.degree == 1 {
            // A third value in the middle shows how the surface curves.
            let moved = 0.5 * (self.displacement(0, node) + self.displacement(1, node));
            let line = 0.5 * (values[0] + values[1]);
            let middle = surfaces.gap_within(node, 0.5, moved).map_or(line, |gap| gap - normals[1].dot(&moved));
            let bend = 4.0 * (middle - line);
            (coefficients[1], coefficients[2]) = (coefficients[1] + bend, -bend);
            error = 0.1 * bend.abs();
        }
        FollowedNode {
            node,
            base: coefficients,
            normal: polynomial(basis, &normals),
            residual: self.residual_displacement(basis, rows, node),
            errors: [0.0, error],
            is_line: false,
            threshold,
        }
    }

    /// Halves parts of the step until the smallest gaps of all followed nodes are known.
    fn search(&mut self, followed: &mut Followed, of: &StepToFollow, advance: &mut Advance, surfaces: &impl Witness) {
        let StepToFollow { tables, level, step, state, .. } = *of;
        let first = &mut followed.instants[0].modes;
        first.position.copy_from_slice(&state.position);
        first.velocity.copy_from_slice(&state.velocity);
        self.find_motion(followed, step, &tables.rows, 0, 0.0);
        advance_between(followed, [0, 1], |modes| advance.advance_part(&tables.levels[level], modes, 0, 1));
        self.find_motion(followed, step, &tables.rows, 1, 1.0);
        search_parts(&mut TrialPartSearch { trial: self, followed, followed_step: of, advance, surfaces });
    }

    /// Finds the displacements, gaps and rates of the followed nodes from the modes at an instant.
    fn find_motion(
        &mut self,
        followed: &mut Followed,
        step: &StepTables,
        rows: &ContactRows,
        instant: usize,
        theta: f64,
    ) {
        let Followed { nodes, instants, .. } = followed;
        let Instant { modes, nodes: motions } = &mut instants[instant];
        let few = nodes.len() <= FEW_NODES;
        if !few {
            rows.now(modes, &mut self.now);
        }
        for (of, motion) in nodes.iter().zip(motions) {
            let [moved, velocity] = if few {
                [&modes.position, &modes.velocity].map(|modes| rows.at_node(of.node, modes))
            } else {
                [0, 1].map(|set| self.now.vector3(set, of.node, self.lanes.nodes))
            };
            let (held, held_rate) = at(&of.residual, theta);
            let (normal, normal_rate) = at(&of.normal, theta);
            let [_, b, c, d] = of.base;
            let (moved, change) = (moved + held, step.step * velocity + held_rate);
            let base = evaluate(&of.base, theta);
            let base_rate = b + theta * (2.0 * c + 3.0 * theta * d);
            *motion = NodeMotion {
                moved,
                change,
                gap: base + normal.dot(&moved),
                base,
                rate: base_rate + normal_rate.dot(&moved) + normal.dot(&change),
                approach: normal.dot(&change),
            };
        }
    }

    /// Returns the displacement of a node due to the residual flexibility (m), as coefficients of θᵃ.
    fn residual_displacement(&self, basis: &TimeBasis, rows: &ContactRows, node: usize) -> [Vector3; POINTS] {
        let mut at_points = [Vector3::zeros(); POINTS];
        for other in 0..self.nodes() {
            for (point, moved) in at_points[..basis.count()].iter_mut().enumerate() {
                if self.multiplier(point, other) > 0.0 {
                    let block = rows.residual().fixed_view::<3, 3>(3 * node, 3 * other);
                    *moved += block * self.force(point, other);
                }
            }
        }
        polynomial(basis, &at_points)
    }
}

/// The search for smallest gaps in parts of a step.
struct TrialPartSearch<'a, 'b, W> {
    trial: &'a mut Trial,
    followed: &'a mut Followed,
    followed_step: &'a StepToFollow<'b>,
    advance: &'a mut Advance,
    surfaces: &'a W,
}

impl<W: Witness> PartSearch for TrialPartSearch<'_, '_, W> {
    fn interpolation_error(&mut self, halvings: usize) -> f64 {
        let StepToFollow { tables, step, .. } = self.followed_step;
        self.advance.interpolation_error(&tables.rows, step.step / real(1 << halvings))
    }

    fn needs_halving(&mut self, part: Part, error: f64) -> bool {
        let StepToFollow { level, tolerance, .. } = *self.followed_step;
        let is_last = part.halvings == MAX_HALVINGS.min(HALVINGS - level);
        let allowed = if is_last { f64::INFINITY } else { MINIMUM_FRACTION * tolerance };
        self.followed.needs_halving(part, error, allowed, self.surfaces)
    }

    fn find_middle(&mut self, part: Part, middle: usize) {
        let StepToFollow { tables, level, step, .. } = *self.followed_step;
        let (index, halved) = (2 * part.index, part.halvings + 1);
        let table = &tables.levels[level + halved];
        advance_between(self.followed, [part.ends[0], middle], |modes| {
            self.advance.advance_part(table, modes, index, 1 << halved);
        });
        let theta = real(index + 1) / real(1 << halved);
        self.trial.find_motion(self.followed, step, &tables.rows, middle, theta);
        self.followed.record_instant(middle, theta, self.surfaces);
    }
}

impl Followed {
    /// Records the smallest gaps within a part if the cubics are accurate enough. Returns whether the part must be halved instead. `error` bounds
    /// the error of the displacements (m), and `allowed` is the largest error of a gap that is accurate (m).
    fn needs_halving(&mut self, part: Part, error: f64, allowed: f64, surfaces: &impl Obstacle) -> bool {
        let Self { nodes, instants, lowest } = self;
        let length = part.length();
        let [before, after] = part.ends.map(|end| &instants[end].nodes);
        for (of, (first, last)) in nodes.iter().zip(before.iter().zip(after)) {
            let (slopes, of_surface) = if of.is_line {
                let line = last.base - first.base;
                let slopes = [first, last].map(|end| line + length * end.approach);
                (slopes, length * (of.errors[0] + length * of.errors[1]))
            } else {
                ([first, last].map(|end| length * end.rate), of.errors[1])
            };
            let inner = [first.gap + slopes[0] / 3.0, last.gap - slopes[1] / 3.0];
            let (ends, between) = (first.gap.min(last.gap), inner[0].min(inner[1]));
            let (threshold, bound) = (of.threshold.min(lowest[of.node]), error + of_surface);
            // At θ, the error is at most 4θ(1 − θ) times the largest error, and the inner coefficients have the weight 3θ(1 − θ).
            if between >= ends + bound * (4.0 / 3.0) || between.min(ends) - bound >= threshold {
                continue;
            }
            if error > allowed || of.is_line && of_surface > allowed {
                return true;
            }
            let rise = last.gap - first.gap;
            let (bend, twist) = (3.0 * rise - 2.0 * slopes[0] - slopes[1], slopes[0] + slopes[1] - 2.0 * rise);
            let cubic = [first.gap, slopes[0], bend, twist];
            if let Some(t) = interior_minimum(&cubic) {
                let theta = (real(part.index) + t) * length;
                let moved = first.displacement_towards(last, length, t);
                let gap = surfaces.gap_within(of.node, theta, moved).unwrap_or_else(|| evaluate(&cubic, t));
                lowest[of.node] = lowest[of.node].min(gap);
            }
        }
        false
    }

    /// Records the gaps at an instant that may be smaller than needed, and sets those of nodes with a line.
    fn record_instant(&mut self, instant: usize, theta: f64, surfaces: &impl Obstacle) {
        let Self { nodes, instants, lowest } = self;
        for (of, motion) in nodes.iter().zip(&mut instants[instant].nodes) {
            if of.is_line || motion.gap - of.errors[1] < of.threshold.min(lowest[of.node]) {
                let gap = surfaces.gap_within(of.node, theta, motion.moved).unwrap_or(motion.gap);
                motion.base += gap - motion.gap;
                motion.gap = gap;
                lowest[of.node] = lowest[of.node].min(gap);
            }
        }
    }
}

/// Copies the modes at an instant to a later one in the list, and advances them there.
fn advance_between(followed: &mut Followed, [from, to]: [usize; 2], advance: impl FnOnce(&mut SectorState)) {
    let (low, high) = followed.instants.split_at_mut(to);
    let (from, to) = (&low[from].modes, &mut high[0].modes);
    to.position.copy_from_slice(&from.position);
    to.velocity.copy_from_slice(&from.velocity);
    advance(to);
}

/// Coefficients of θᵃ of the polynomial with the given vectors at the points.
fn polynomial(basis: &TimeBasis, values: &[Vector3; POINTS]) -> [Vector3; POINTS] {
    let mut coefficients = [Vector3::zeros(); POINTS];
    for component in 0..3 {
        let polynomial = basis.coefficients(&values.map(|value| value[component]));
        coefficients.iter_mut().zip(polynomial).for_each(|(target, value)| target[component] = value);
    }
    coefficients
}

/// Value and derivative of a polynomial at θ.
fn at([a, b, c, d]: &[Vector3; POINTS], theta: f64) -> (Vector3, Vector3) {
    (a + theta * (b + theta * (c + theta * d)), b + theta * (2.0 * c + 3.0 * theta * d))
}
