//! The reduced-order model of one structure, as plain data.
//!
//! A ROM is what Craig-Bampton (or any other linear reduction) leaves of a finite-element model: small dense
//! mass and stiffness matrices and the map from reduced coordinates to the displacement of the contact nodes.
//! `sectors` identical, mutually uncoupled copies of it stand around the axis (blades on a rigid hub);
//! `sectors = 1` is a single general structure.

use nalgebra::DMatrix;

use crate::{Error, Result};

/// Most sectors of a ROM. Bladed disks have tens to a few hundred; a damaged or hostile file must not ask for all memory,
/// which ends the process of the importer.
pub const MAX_SECTORS: usize = 10_000;

/// Which directions the three displacement components of a contact node have.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Frame {
    /// (radial, tangential, axial) of the node's own position, turning with the structure.
    Cylindrical,
    /// (x, y, z), fixed to the structure.
    Cartesian,
}

/// One contact node of the first sector.
#[derive(Debug, Clone, PartialEq)]
pub struct ContactNode {
    /// Name used in variable names and plots, for example `leading_edge`.
    pub name: String,
    /// Undeformed position: (r, θ, z) in m, rad, m for [`Frame::Cylindrical`], else (x, y, z) in m.
    pub position: [f64; 3],
    /// Slope dr/dz of the tip contour in the meridional plane at this node (the casing runs parallel to it).
    pub meridional_slope: f64,
}

/// How well the reduced model stands for the full one. Empty vectors where a ROM came from elsewhere.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct RomChecks {
    /// Natural frequencies of the full finite-element model (Hz), ascending.
    pub full_frequencies: Vec<f64>,
    /// Natural frequencies of the reduced model (Hz), ascending, same modes.
    pub reduced_frequencies: Vec<f64>,
    /// Frequency deviation per mode (%), eq. 13 of the paper.
    pub frequency_deviation: Vec<f64>,
    /// Residual convergence criterion per mode (%), eq. 12 of the paper.
    pub residual_criterion: Vec<f64>,
}

/// Reduced-order model of one structure.
#[derive(Debug, Clone, PartialEq)]
pub struct Rom {
    /// Name of the structure.
    pub name: String,
    /// Where it came from: mesh counts, material, reduction, in one or a few sentences.
    pub origin: String,
    /// Number of identical uncoupled copies around the axis (1 to [`MAX_SECTORS`]).
    pub sectors: usize,
    /// Directions of the displacement components.
    pub frame: Frame,
    /// Reduced mass matrix, n × n (kg for physical coordinates), symmetric positive definite.
    pub mass: DMatrix<f64>,
    /// Reduced stiffness matrix, n × n, symmetric positive semidefinite.
    pub stiffness: DMatrix<f64>,
    /// Modal damping ratio proposed by the author of the ROM; the scene may override it.
    pub damping_ratio: f64,
    /// Displacement of the contact nodes, 3·nodes × n; rows (node, component).
    pub contact_map: DMatrix<f64>,
    /// The contact nodes of the first sector.
    pub contact_nodes: Vec<ContactNode>,
    /// Quality of the reduction.
    pub checks: RomChecks,
}

impl Rom {
    /// Number of reduced coordinates of one sector.
    pub fn order(&self) -> usize {
        self.mass.nrows()
    }

    /// Check shapes, finiteness, symmetry and definiteness.
    ///
    /// # Errors
    /// [`Error::Invalid`] naming the array and the remedy.
    pub fn validate(&self) -> Result<()> {
        let order = self.mass.nrows();
        let remedy = "Write the ROM again with `tiprub reduce`, or see the ROM file chapter of the user guide";
        if order == 0 || self.mass.ncols() != order {
            return Err(Error::invalid(
                "ROM array `mass`",
                format!("shape {:?} is not square or empty", self.mass.shape()),
                remedy,
            ));
        }
        if self.stiffness.shape() != (order, order) {
            return Err(Error::invalid(
                "ROM array `stiffness`",
                format!("shape {:?} does not match `mass` {order} x {order}", self.stiffness.shape()),
                remedy,
            ));
        }
        if self.contact_nodes.is_empty() {
            return Err(Error::invalid("ROM array `contact_positions`", "no contact node", remedy));
        }
        if self.contact_map.shape() != (3 * self.contact_nodes.len(), order) {
            return Err(Error::invalid(
                "ROM array `contact_map`",
                format!(
                    "shape {:?} is not 3 x {} nodes by {order} coordinates",
                    self.contact_map.shape(),
                    self.contact_nodes.len()
                ),
                remedy,
            ));
        }
        if self.sectors == 0 {
            return Err(Error::invalid("ROM metadata `sectors`", "zero sectors", remedy));
        }
        if self.sectors > MAX_SECTORS {
            return Err(Error::invalid(
                "ROM metadata `sectors`",
                format!("{} sectors, more than {MAX_SECTORS}", self.sectors),
                remedy,
            ));
        }
        if !(0.0..1.0).contains(&self.damping_ratio) {
            return Err(Error::invalid(
                "ROM metadata `damping_ratio`",
                format!("{} is not in 0 ≤ ξ < 1", self.damping_ratio),
                remedy,
            ));
        }
        for (name, matrix) in [("mass", &self.mass), ("stiffness", &self.stiffness), ("contact_map", &self.contact_map)]
        {
            if let Some(index) = matrix.iter().position(|value| !value.is_finite()) {
                let (row, column) = (index % matrix.nrows(), index / matrix.nrows());
                return Err(Error::invalid(
                    format!("ROM array `{name}`"),
                    format!("non-finite entry at ({row}, {column})"),
                    remedy,
                ));
            }
        }
        for (index, node) in self.contact_nodes.iter().enumerate() {
            let finite = node.position.iter().all(|value| value.is_finite()) && node.meridional_slope.is_finite();
            let radius_positive = self.frame == Frame::Cartesian || node.position[0] > 0.0;
            if !finite || !radius_positive {
                return Err(Error::invalid(
                    format!("ROM array `contact_positions`, node {}", index + 1),
                    format!("{:?} is not finite, or its radius is not positive", node.position),
                    remedy,
                ));
            }
        }
        self.validate_definiteness(remedy)
    }

    fn validate_definiteness(&self, remedy: &str) -> Result<()> {
        for (name, matrix) in [("mass", &self.mass), ("stiffness", &self.stiffness)] {
            let asymmetry = (matrix - matrix.transpose()).amax();
            if asymmetry > 1e-8 * matrix.amax() {
                return Err(Error::invalid(
                    format!("ROM array `{name}`"),
                    format!("not symmetric: largest |A - Aᵀ| is {asymmetry:.3e} at largest |A| {:.3e}", matrix.amax()),
                    remedy,
                ));
            }
        }
        if self.mass.clone().cholesky().is_none() {
            return Err(Error::invalid("ROM array `mass`", "not positive definite", remedy));
        }
        Ok(())
    }
}
