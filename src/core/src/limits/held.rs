//! Oscillators constrained by closed contacts: a structure in closed sliding contact, in continuous time or in steps.

use nalgebra::{Complex, DMatrix};

use super::{SlidingContacts, directional_modes};
use crate::scene::method::Scheme;

/// (s² + a s + b) q = (1 + γs) c φ_fᵀF of each mode, while the contacts have zero gap: Σ φ_n q + R F = 0.
#[derive(Debug, Clone)]
pub(crate) struct HeldContacts {
    /// φ_n and φ_f, contacts × modes.
    pub normals: DMatrix<f64>,
    pub forces: DMatrix<f64>,
    /// a, b, c of each mode.
    pub modes: Vec<[f64; 3]>,
    /// R of the modes without inertia, contacts²; `None` if there are none.
    pub residual: Option<DMatrix<f64>>,
    /// γ: forces act one step after they are computed.
    pub late: f64,
}

impl HeldContacts {
    /// Creates the modes of a model, the highest of them quasi-static or not, with all contacts of `directions` closed and sliding.
    fn new(
        SlidingContacts { model, friction, directions }: SlidingContacts,
        quasi_static: bool,
        mode: impl Fn(usize) -> [f64; 3],
        late: f64,
    ) -> Self {
        let (normals, forces) = directional_modes(model, friction, directions);
        let (fixed, contacts) = (if quasi_static { model.quasi_static.min(model.len()) } else { 0 }, directions.len());
        let dynamic = model.len() - fixed;
        let residual = quasi_static.then(|| {
            let bent = DMatrix::from_fn(contacts, fixed, |node, column| {
                let frequency = model.frequencies[dynamic + column];
                forces[(node, dynamic + column)] / (frequency * frequency)
            });
            normals.columns(dynamic, fixed) * bent.transpose()
        });
        Self {
            normals: normals.columns(0, dynamic).into_owned(),
            forces: forces.columns(0, dynamic).into_owned(),
            modes: (0..dynamic).map(mode).collect(),
            residual,
            late,
        }
    }

    /// Creates the problem of the differential equations, with s per `step` (s) and the highest modes quasi-static or not.
    pub fn continuous(contacts: SlidingContacts, quasi_static: bool, step: f64) -> Self {
        let mode = |mode: usize| {
            let angle = step * contacts.model.frequencies[mode];
            [2.0 * contacts.model.damping_ratios[mode] * angle, angle * angle, step * step]
        };
        Self::new(contacts, quasi_static, mode, 0.0)
    }

    /// Creates the problem of the recurrence q⁺ = q + d⁺, d⁺ = βd − κq + cφ_fᵀF, which multiplies a motion by 1 + s per step.
    pub fn stepped(contacts: SlidingContacts, scheme: Scheme, step: f64) -> Self {
        let mode = |mode: usize| {
            let found = contacts.model.coefficient(mode, 1.0, scheme, step);
            [1.0 - found.beta + found.kappa, found.kappa, found.load_compliance()]
        };
        let properties = scheme.properties();
        let late = if properties.delays_contact { 1.0 } else { 0.0 };
        Self::new(contacts, properties.quasi_static, mode, late)
    }

    /// Number of contacts.
    pub fn contacts(&self) -> usize {
        self.normals.nrows()
    }

    /// Returns the eigenvalues of the matrix of the first-order form; without inertialess modes on the null space of the contact normals, so that the
    /// constraint adds no zero eigenvalues.
    pub(crate) fn dense_eigenvalues(&self) -> Option<Vec<Complex<f64>>> {
        let [stiffness, damping] = match &self.residual {
            Some(residual) => self.sprung(residual)?,
            None => self.constrained()?,
        };
        let size = stiffness.nrows();
        let mut flow = DMatrix::zeros(2 * size, 2 * size);
        flow.view_mut((0, size), (size, size)).fill_with_identity();
        flow.view_mut((size, 0), (size, size)).copy_from(&-stiffness);
        flow.view_mut((size, size), (size, size)).copy_from(&-damping);
        general_eigenvalues(flow)
    }

    /// Stiffness and damping with the contacts as springs on the residual flexibility.
    fn sprung(&self, residual: &DMatrix<f64>) -> Option<[DMatrix<f64>; 2]> {
        let contact = self.forces.transpose() * (residual.clone().try_inverse()? * &self.normals);
        let with = |own: usize, gain: f64| {
            DMatrix::from_fn(self.modes.len(), self.modes.len(), |row, column| {
                let alone = if row == column { self.modes[row][own] } else { 0.0 };
                alone + gain * self.modes[row][2] * contact[(row, column)]
            })
        };
        Some([with(1, 1.0), with(0, self.late)])
    }

    /// Stiffness and damping on the null space of the normals, P = I − C B_f (B_nᵀ C B_f)⁻¹ B_nᵀ of the rest.
    fn constrained(&self) -> Option<[DMatrix<f64>; 2]> {
        let modes = self.modes.len();
        let tangent = null_space(&self.normals)?;
        let response =
            DMatrix::from_fn(modes, self.contacts(), |mode, node| self.modes[mode][2] * self.forces[(node, mode)]);
        let coupling = (&self.normals * &response).try_inverse()?;
        let projected = tangent.transpose() - (tangent.transpose() * response) * coupling * &self.normals;
        let with = |own: usize| {
            &projected
                * DMatrix::from_fn(modes, tangent.ncols(), |mode, column| {
                    self.modes[mode][own] * tangent[(mode, column)]
                })
        };
        Some([with(1), with(0)])
    }
}

/// Eigenvalues of a general matrix; `None` if the iteration does not converge (entries of extreme size).
pub(super) fn general_eigenvalues(matrix: DMatrix<f64>) -> Option<Vec<Complex<f64>>> {
    // An empty matrix has none; the iteration would access its last row.
    if matrix.is_empty() {
        return Some(Vec::new());
    }
    let iterations = 100 * matrix.nrows();
    let schur = nalgebra::Schur::try_new(matrix, f64::EPSILON, iterations)?;
    Some(schur.complex_eigenvalues().iter().copied().collect())
}

/// Orthonormal basis of the vectors that `rows` maps to zero; `None` if it is empty.
fn null_space(rows: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let (count, modes) = rows.shape();
    let free = modes.checked_sub(count).filter(|free| *free > 0)?;
    let mut turned = DMatrix::identity(modes, modes);
    rows.transpose().qr().q_tr_mul(&mut turned);
    Some(turned.rows(count, free).transpose())
}
