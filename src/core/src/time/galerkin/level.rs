//! Tables of the modes of one sector for one step length.

use super::basis::{MOST, POINTS, TimeBasis, real};
use super::compliance::{LaneCompliance, Lanes};
use super::kernels::{PADDED, SumOuterProducts};
use super::response::{GROUP, ModalResponse, TERMS, by_points};
use super::trial::ForceInterpolation;
use crate::math::simd::InstructionSet;
use crate::modes::coordinates::ContactModes;
use nalgebra::DMatrix;

impl ContactModes {
    /// Returns an earlier mode with the same frequency and damping ratio: its neighbour, or the real part of its pair in a row of lanes.
    fn twin(&self, mode: usize) -> Option<usize> {
        let of = |mode: usize| [self.frequencies[mode].to_bits(), self.damping_ratios[mode].to_bits()];
        [1, PADDED].into_iter().filter_map(|back| mode.checked_sub(back)).find(|twin| of(*twin) == of(mode))
    }

    /// Writes Σ c_m φφᵀ of the contact rows to `sum`.
    fn weigh(&self, weight: impl Fn(usize) -> f64, sum: &mut DMatrix<f64>) {
        InstructionSet::detect().run(SumOuterProducts { shapes: &self.shapes, weight, sum });
    }

    /// Returns Σ c_m φφᵀ of the contact rows.
    fn weighted(&self, weight: impl Fn(usize) -> f64) -> DMatrix<f64> {
        let mut sum = DMatrix::zeros(self.rows(), self.rows());
        self.weigh(weight, &mut sum);
        sum
    }

    /// The form δ² = JᵀQJ of the displacement error δ (m) caused by an impulse J (N·s) on the contact rows: the root mean square
    /// over rows of the modal amplitudes, summed over modes as if they were independent. Rigid-body modes count with their
    /// displacement in the period of the lowest vibration mode.
    pub(crate) fn error_form(&self) -> DMatrix<f64> {
        let lowest =
            self.frequencies.iter().copied().filter(|frequency| *frequency > 0.0).fold(f64::INFINITY, f64::min);
        let lowest = if lowest.is_finite() { lowest } else { 1.0 };
        let rows = real(self.rows());
        let scale = |mode: usize| {
            let shape = self.shapes.column(mode);
            0.5 * shape.norm_squared() / rows / self.frequencies[mode].max(lowest).powi(2)
        };
        self.weighted(scale)
    }

    /// Returns whether frictionless contact problems of degree 3 are solvable for all steps between `step`/2 and `step` (s). The
    /// criterion is G ⪰ 0.04 h² Σ φφᵀ over ωh < 4.3 (the first counter-example was found at 0.0233). Problems of degree 2 are
    /// always solvable.
    pub fn allows_cubics(&self, step: f64) -> bool {
        let slow: Vec<usize> = (0..self.len()).filter(|mode| self.frequencies[*mode] * step < 8.6).collect();
        let shapes = self.shapes.select_columns(&slow);
        let needed = &shapes * shapes.transpose() * (0.04 * step * step);
        let rounding = 1e-12 * needed.trace();
        let rows = self.rows();
        (&self.residual - needed + DMatrix::identity(rows, rows) * rounding).cholesky().is_some()
    }
}

/// Motion of the modes over a step, one entry per mode in each array.
#[derive(Debug, Clone, PartialEq)]
pub struct ModeSteps {
    /// `[i][0, 1]`: coefficients of q and q̇ in the displacement at point i + 1.
    pub points: [[Vec<f64>; 2]; MOST],
    /// Coefficients of (q, q̇, p_a) in q and q̇ at the end.
    pub end: [[Vec<f64>; TERMS]; 2],
    /// Damping loss (J), a symmetric form of (q, q̇, p_a).
    pub loss: [[Vec<f64>; TERMS]; TERMS],
}

impl ModeSteps {
    fn new(count: usize) -> Self {
        let zeros = || vec![0.0; count];
        Self {
            points: std::array::from_fn(|_| [zeros(), zeros()]),
            end: std::array::from_fn(|_| std::array::from_fn(|_| zeros())),
            loss: std::array::from_fn(|_| std::array::from_fn(|_| zeros())),
        }
    }

    /// Copies the entries of one mode to another with the same frequency and damping.
    fn copy(&mut self, from: usize, to: usize) {
        let rows = self.points.as_flattened_mut().iter_mut();
        let rows = rows.chain(self.end.as_flattened_mut()).chain(self.loss.as_flattened_mut());
        rows.for_each(|row| row[to] = row[from]);
    }

    fn set(&mut self, mode: usize, response: &ModalResponse, at: &[[f64; TERMS]; MOST]) {
        for (point, terms) in self.points.iter_mut().zip(at) {
            (point[0][mode], point[1][mode]) = (terms[0], terms[1]);
        }
        for (rows, terms) in self.end.iter_mut().zip([&response.position, &response.velocity]) {
            rows.iter_mut().zip(terms).for_each(|(row, term)| row[mode] = *term);
        }
        for (rows, terms) in self.loss.iter_mut().zip(&response.loss) {
            rows.iter_mut().zip(terms).for_each(|(row, term)| row[mode] = *term);
        }
    }
}

/// Motion of a mode at the points of a step under forces at these points.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Influence {
    /// `[i - 1][k]`: displacement at point i per modal force at point k.
    pub points: [[f64; POINTS]; MOST],
    /// Displacement at the end per constant modal force.
    pub constant: f64,
}

impl Influence {
    /// Displacement at point i under forces at the points 0 … `points`.
    pub(crate) fn displacement(
        &self,
        kind: ForceInterpolation,
        i: usize,
        points: usize,
        force: impl Fn(usize) -> f64,
    ) -> f64 {
        match kind {
            ForceInterpolation::Constant => self.constant * force(1),
            ForceInterpolation::Polynomial => (0..=points).map(|k| self.points[i - 1][k] * force(k)).sum(),
        }
    }
}

/// Tables for one step length.
#[derive(Debug, Clone, PartialEq)]
pub struct StepTables {
    /// h (s).
    pub step: f64,
    /// Step length as a fraction of the span.
    pub share: f64,
    /// Points of the step.
    pub basis: TimeBasis,
    /// Motion of all modes over the step.
    pub modes: ModeSteps,
    /// Displacements at the points per force at the points, including residual flexibility.
    pub compliance: LaneCompliance,
    /// Displacement at the end per constant force over the step, including residual flexibility. [`StepTables::set_constant`] fills it;
    /// only steps of the shortest length need it.
    pub constant: LaneCompliance,
    /// True if any mode is damped.
    pub damped: bool,
    /// Displacement of each mode at point i per force at point k, and at the end per constant force.
    pub influence: Vec<Influence>,
    block: DMatrix<f64>,
}

impl StepTables {
    /// Allocates tables of degree s; [`StepTables::set_step`] fills them.
    pub fn new(modes: &ContactModes, degree: usize) -> Self {
        let nodes = modes.rows() / 3;
        Self {
            step: 0.0,
            share: 1.0,
            modes: ModeSteps::new(modes.len()),
            compliance: LaneCompliance::new(Lanes { points: degree, nodes }),
            constant: LaneCompliance::new(Lanes { points: 1, nodes }),
            damped: false,
            basis: TimeBasis::new(degree),
            influence: vec![Influence::default(); modes.len()],
            block: DMatrix::zeros(modes.rows(), modes.rows()),
        }
    }

    /// Returns the displacements of all lanes per force of a kind.
    pub(crate) fn compliance_of(&self, kind: ForceInterpolation) -> &LaneCompliance {
        match kind {
            ForceInterpolation::Polynomial => &self.compliance,
            ForceInterpolation::Constant => &self.constant,
        }
    }

    /// Fills all tables except `constant` for step h (s). Does not allocate.
    pub fn set_step(&mut self, modes: &ContactModes, step: f64) {
        let Self { basis, influence, block, .. } = self;
        self.step = step;
        self.damped = modes.damping_ratios.iter().any(|ratio| *ratio > 0.0);
        let mut distinct = (0..modes.len()).filter(|mode| modes.twin(*mode).is_none());
        // The last group is padded with its first mode.
        while let Some(first) = distinct.next() {
            let group: [_; GROUP] = std::array::from_fn(|i| if i == 0 { Some(first) } else { distinct.next() });
            let [frequencies, ratios] = [&modes.frequencies, &modes.damping_ratios]
                .map(|values| group.map(|mode| values[mode.unwrap_or(first)]));
            let responses = ModalResponse::compute(frequencies, ratios, step);
            for (mode, response) in group.into_iter().flatten().zip(&responses) {
                let at = response.at_points(basis);
                let points = at.map(|terms| by_points(&terms, basis));
                influence[mode] = Influence { points, constant: response.position[2] };
                self.modes.set(mode, response, &at);
            }
        }
        for mode in 0..modes.len() {
            if let Some(twin) = modes.twin(mode) {
                influence[mode] = influence[twin];
                self.modes.copy(twin, mode);
            }
        }
        for i in 1..=basis.degree {
            for k in 0..basis.count() {
                modes.weigh(|mode| influence[mode].points[i - 1][k], block);
                if k == i {
                    *block += &modes.residual;
                }
                self.compliance.set(i, k, block);
            }
        }
        self.compliance.hold();
    }

    /// Fills `constant` for the current step; call [`StepTables::set_step`] first. Does not allocate.
    pub fn set_constant(&mut self, modes: &ContactModes) {
        let Self { influence, block, .. } = self;
        modes.weigh(|mode| influence[mode].constant, block);
        *block += &modes.residual;
        self.constant.set(1, 1, block);
        self.constant.hold();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// All combinations of closed points of one node have one solution, even with the smallest residual flexibility for which degree 3 is used.
    #[test]
    fn selected_degree_gives_solvable_contact_problems() {
        let (frequency, mut threes) = (1e4, 0);
        for place in 1..=84 {
            let step = 0.1 * f64::from(place) / frequency;
            let of = |flexibility: f64| ContactModes {
                frequencies: vec![frequency],
                damping_ratios: vec![0.0],
                shapes: DMatrix::from_column_slice(3, 1, &[1.0, 0.0, 0.0]),
                residual: DMatrix::identity(3, 3) * flexibility,
            };
            let (mut low, mut high) = (0.0, step * step);
            for _ in 0..60 {
                let middle = 0.5 * (low + high);
                *(if of(middle).allows_cubics(step) { &mut high } else { &mut low }) = middle;
            }
            let modes = of(high);
            threes += usize::from(high > 1e-6 * step * step);
            for share in [0.5, 0.6, 0.75, 0.9, 1.0] {
                let mut level = StepTables::new(&modes, 3);
                level.set_step(&modes, share * step);
                for set in 1..8_usize {
                    let members: Vec<usize> = (0..3).filter(|lane| set >> lane & 1 == 1).collect();
                    let minor = DMatrix::from_fn(members.len(), members.len(), |i, k| {
                        level.compliance.of_lane(members[k])[0][members[i]]
                    });
                    assert!(minor.determinant() > 0.0, "ωh = {:.1}, {members:?}", frequency * share * step);
                }
            }
        }
        assert!(threes > 80, "{threes}");
    }
}
