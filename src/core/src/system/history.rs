//! Values of one structure's contact nodes: current, one step before, and the oldest that a step still needs.

use tiprub_cosim::persist_fields;

use crate::geometry::Geometry;

/// A value of the last step and of the step before. Only the former is part of a saved state.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Two<T> {
    /// Value of the last step.
    pub now: T,
    /// Value of the step before.
    pub before: T,
}

persist_fields!(Two<T> { now, .. });

impl<T: Clone> Two<T> {
    /// Both entries with the same value.
    pub fn new(value: T) -> Self {
        Self { before: value.clone(), now: value }
    }

    /// Makes the current value the one of the step before; the current value must be written next.
    pub fn shift(&mut self) {
        std::mem::swap(&mut self.now, &mut self.before);
    }

    /// Value of one of the two steps.
    #[inline(always)]
    pub(crate) fn at(&self, when: When) -> &T {
        match when {
            When::Now => &self.now,
            When::Before => &self.before,
        }
    }
}

/// Selects one of two times.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum When {
    /// The last step.
    Now,
    /// One step earlier.
    Before,
}

/// An array at three times. The current values and those one step before are part of a saved state.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Three {
    /// At the current step.
    pub now: Vec<f64>,
    /// One step earlier.
    pub before: Vec<f64>,
    /// Two steps earlier.
    pub oldest: Vec<f64>,
}

persist_fields!(Three { now, before, .. });

impl Three {
    /// All entries with the same value.
    pub fn new(len: usize, value: f64) -> Self {
        Self { now: vec![value; len], before: vec![value; len], oldest: vec![value; len] }
    }

    /// Makes all values one step older; the current values must be written next.
    pub fn shift(&mut self) {
        std::mem::swap(&mut self.oldest, &mut self.before);
        std::mem::swap(&mut self.before, &mut self.now);
    }
}

/// Recent values at the contact nodes of one structure, in arrays `[node · lanes + lane]` and `[row · lanes + lane]` with three
/// rows per node. Current and previous displacements are those of the modes.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct ContactHistory {
    /// Gaps (m); infinite in padding lanes and where there is nothing to touch.
    pub gap: Three,
    /// Normals and closest points.
    pub geometry: Two<Geometry>,
    /// λ of the last step (N).
    pub multiplier: Vec<f64>,
    /// Part of λ that a coating carries (N).
    pub coating_force: Vec<f64>,
    /// Contact force on each row (N). The previous values serve laws that start from them.
    pub force: Two<Vec<f64>>,
    /// Contact points, see [`crate::geometry::GapLaw::contact_point`].
    pub points: Vec<f64>,
    /// Predicted displacements of the contact rows (m), for schemes whose contact forces act one step later.
    pub predicted: Two<Vec<f64>>,
    /// Data that is not part of the saved state: every step writes it before it reads it.
    pub passing: Passing,
}

/// Previous values that only the current step needs.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Passing {
    /// Displacements of all rows of the structure (m), two steps before the end of the current step.
    pub oldest: Vec<f64>,
    /// Contact forces on all rows (N) without those of impacts.
    pub lasting: Vec<f64>,
}

persist_fields!(ContactHistory { gap, geometry, multiplier, coating_force, force, points, predicted, .. });

impl ContactHistory {
    /// State without any contact so far: `contacts` nodes in all lanes, `rows` displacements.
    pub fn new(geometry: Geometry, contacts: usize, rows: usize) -> Self {
        Self {
            // Padding lanes keep an infinite gap.
            gap: Three::new(contacts, f64::INFINITY),
            geometry: Two::new(geometry),
            multiplier: vec![0.0; contacts],
            coating_force: vec![0.0; contacts],
            force: Two::new(vec![0.0; 3 * contacts]),
            points: vec![0.0; 3 * contacts],
            predicted: Two::new(vec![0.0; 3 * contacts]),
            passing: Passing { oldest: vec![0.0; rows], lasting: vec![0.0; rows] },
        }
    }

    /// Starts a step; `before` are the displacements one step earlier (m).
    pub fn shift(&mut self, before: &[f64]) {
        self.gap.shift();
        self.geometry.shift();
        self.passing.oldest.copy_from_slice(before);
    }

    /// Stores the forces of the last step as previous forces, for laws that start from them.
    pub(crate) fn keep_forces(&mut self) {
        self.force.before.copy_from_slice(&self.force.now);
    }

    /// Resets all contact forces and points to zero.
    pub fn clear(&mut self) {
        self.multiplier.fill(0.0);
        self.coating_force.fill(0.0);
        self.force.now.fill(0.0);
        self.points.fill(0.0);
    }
}
