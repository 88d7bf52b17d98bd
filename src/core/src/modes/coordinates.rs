//! Modal coordinates of a body, and its modes as contact sees them.

use nalgebra::DMatrix;

/// Modes with inertia and residual flexibility of a sector at its contact rows (three per contact node).
#[derive(Debug, Clone, PartialEq)]
pub struct ContactModes {
    /// Angular frequencies ω (rad/s).
    pub frequencies: Vec<f64>,
    /// Damping ratios ξ.
    pub damping_ratios: Vec<f64>,
    /// Mode shapes Φ at the contact rows, rows × modes (1/√kg).
    pub shapes: DMatrix<f64>,
    /// Residual flexibility G: static displacement of the rows per force on the rows that the modes do not represent, rows × rows (m/N).
    pub residual: DMatrix<f64>,
}

impl ContactModes {
    /// Number of modes.
    pub fn len(&self) -> usize {
        self.frequencies.len()
    }

    /// Returns whether there are no modes.
    pub fn is_empty(&self) -> bool {
        self.frequencies.is_empty()
    }

    /// Number of contact rows.
    pub fn rows(&self) -> usize {
        self.shapes.nrows()
    }
}

/// Modal coordinates of a body: modes with inertia, quasi-static modes, and entries without a mode.
#[derive(Debug, Clone, PartialEq)]
pub struct Coordinates {
    /// ω of the modes with inertia (rad/s), 0 for the others.
    pub frequencies: Vec<f64>,
    /// Damping ratios ξ.
    pub damping_ratios: Vec<f64>,
    /// 1 for modes with inertia, otherwise 0.
    pub inertia: Vec<f64>,
    /// 1/ω² of quasi-static modes (s²), otherwise 0.
    pub softness: Vec<f64>,
}

impl Coordinates {
    /// Creates coordinates from modes, the first `dynamic` of which have inertia.
    pub fn new(frequencies: &[f64], damping_ratios: &[f64], dynamic: usize) -> Self {
        let of = |with: fn(f64) -> f64, without: fn(f64) -> f64| -> Vec<f64> {
            let value = |(mode, w): (usize, &f64)| if mode < dynamic { with(*w) } else { without(*w) };
            frequencies.iter().enumerate().map(value).collect()
        };
        Self {
            frequencies: of(|w| w, |_| 0.0),
            damping_ratios: damping_ratios.to_vec(),
            inertia: of(|_| 1.0, |_| 0.0),
            softness: of(|_| 0.0, |w| 1.0 / (w * w)),
        }
    }

    /// Returns the modes with inertia at rows and the flexibility of the other modes there. `shapes`: rows × coordinates (1/√kg).
    pub(crate) fn seen_at(&self, shapes: &DMatrix<f64>) -> ContactModes {
        let (mut dynamic, rows) = (shapes.clone(), shapes.nrows());
        let mut residual = DMatrix::zeros(rows, rows);
        for (mode, softness) in self.softness.iter().enumerate() {
            let shape = shapes.column(mode);
            if *softness > 0.0 {
                residual.ger(*softness, &shape, &shape, 1.0);
            }
            dynamic.column_mut(mode).scale_mut(self.inertia[mode]);
        }
        ContactModes {
            frequencies: self.frequencies.clone(),
            damping_ratios: self.damping_ratios.clone(),
            shapes: dynamic,
            residual,
        }
    }
}
