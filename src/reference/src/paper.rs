//! Literal implementation of the algorithm of the paper with dense matrices (section 4.3, eqs 9-11).

use nalgebra::{DMatrix, DVector, Dyn, LU};

/// M ü + D u̇ + K u = F with forward-increment Lagrange multipliers.
#[derive(Debug, Clone)]
pub struct DenseFilm {
    mass: DMatrix<f64>,
    damping: DMatrix<f64>,
    stiffness: DMatrix<f64>,
    step: f64,
    /// M/h² + D/2h, factorised.
    inertia: LU<f64, Dyn, Dyn>,
    /// u_n (m).
    pub now: DVector<f64>,
    /// u_{n−1} (m).
    pub before: DVector<f64>,
}

impl DenseFilm {
    /// Creates a run from two displacement vectors one step `step` (s) apart.
    pub fn new(
        mass: DMatrix<f64>,
        damping: DMatrix<f64>,
        stiffness: DMatrix<f64>,
        step: f64,
        now: DVector<f64>,
        before: DVector<f64>,
    ) -> Self {
        let inertia = (&mass / (step * step) + &damping / (2.0 * step)).lu();
        Self { mass, damping, stiffness, step, inertia, now, before }
    }

    /// Performs one step: prediction (9), gaps, correction (10)-(11). `normal` and `sliding` are C_N and C_NT, dofs ×
    /// contacts; `gaps` the gaps at zero displacement (m). Returns the multipliers (N), zero without penetration.
    pub fn step(&mut self, normal: &DMatrix<f64>, sliding: &DMatrix<f64>, gaps: &DVector<f64>) -> DVector<f64> {
        let square = self.step * self.step;
        let right = (&self.mass * (2.0 / square) - &self.stiffness) * &self.now
            + (&self.damping / (2.0 * self.step) - &self.mass / square) * &self.before;
        let predicted = self.solve(&right);
        let gap = gaps + normal.transpose() * &predicted;
        let penetrating: Vec<usize> = (0..gap.len()).filter(|contact| gap[*contact] < 0.0).collect();
        let mut multipliers = DVector::zeros(gap.len());
        let mut corrected = predicted;
        if !penetrating.is_empty() {
            let (normal, sliding) = (normal.select_columns(&penetrating), sliding.select_columns(&penetrating));
            let response = DMatrix::from_columns(
                &sliding.column_iter().map(|column| self.solve(&column.into_owned())).collect::<Vec<_>>(),
            );
            let delassus = normal.transpose() * &response;
            let wanted = DVector::from_iterator(penetrating.len(), penetrating.iter().map(|contact| -gap[*contact]));
            let solution = delassus.lu().solve(&wanted).expect("a nonsingular Delassus matrix");
            corrected += response * &solution;
            for (index, contact) in penetrating.iter().enumerate() {
                multipliers[*contact] = solution[index];
            }
        }
        self.before = std::mem::replace(&mut self.now, corrected);
        multipliers
    }

    fn solve(&self, right: &DVector<f64>) -> DVector<f64> {
        self.inertia.solve(right).expect("M/h² + D/2h is nonsingular")
    }
}
