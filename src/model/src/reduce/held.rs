//! Contact that is held during the computation of modes: nodes directly, patches by a change of variables.

use core::f64::consts::TAU;

use tiprub_core::scene::rom::DisplacementFrame;

use super::outcome::rotated;
use crate::Result;
use crate::contact_point::{ContactPoint, clamped_point};
use crate::craig_bampton::{CraigBampton, InnerBasis, craig_bampton_with};
use crate::eigen::EigenModes;
use crate::patches::PatchCoordinates;
use crate::progress::Listener;
use crate::sparse::SparseMatrix;

/// Contact as degrees of freedom that can be held.
#[derive(Debug)]
pub(crate) struct HeldContact<'a> {
    nodes: &'a [[f64; 3]],
    contact: &'a [ContactPoint],
    frame: DisplacementFrame,
    /// Change of variables if there are patches.
    patches: Option<PatchCoordinates>,
    /// Rows of the contact's dofs among the free ones, point by point.
    pub interface: Vec<usize>,
}

impl<'a> HeldContact<'a> {
    /// Finds the contact degrees of freedom among the free dofs (3·node + component, ascending) of a model.
    ///
    /// # Errors
    /// Clamped contact; patches that depend on each other.
    pub(crate) fn new(
        free: &[usize],
        nodes: &'a [[f64; 3]],
        contact: &'a [ContactPoint],
        frame: DisplacementFrame,
    ) -> Result<Self> {
        let patches = PatchCoordinates::new(free, nodes, contact, frame)?;
        let points = patches.as_ref().map_or(contact, PatchCoordinates::points);
        let dofs = points.iter().flat_map(|point| (0..3).map(move |component| (point, 3 * point.node + component)));
        let place = |(point, dof): (&ContactPoint, usize)| free.binary_search(&dof).map_err(|_| clamped_point(point));
        let interface = dofs.map(place).collect::<Result<_>>()?;
        Ok(Self { nodes, contact, frame, patches, interface })
    }

    /// Computes the Craig-Bampton reduction of these matrices of the free dofs, contact displacements in the frame;
    /// the transformation yields displacements of nodes.
    ///
    /// # Errors
    /// The errors of [`craig_bampton_with`].
    pub(crate) fn craig_bampton(
        &self,
        stiffness: &SparseMatrix,
        mass: &SparseMatrix,
        modes: usize,
        listener: Listener<'_>,
    ) -> Result<CraigBampton> {
        let inner = InnerBasis { modes, whole_pairs: false, loads: None };
        self.reduced(stiffness, mass, &inner, listener)
    }

    /// Computes the free-interface modes with exact residual flexibility of a structure that may move as a rigid
    /// body: `modes` are its modes, including rigid ones. The remainder of a mode φ with held contact is the static
    /// response to its inertia forces, K_ii⁻¹(Mφ)_i: for an elastic mode φ minus the constraint modes, up to scale;
    /// for a rigid mode the response that inertia relief requires.
    ///
    /// # Errors
    /// The errors of [`craig_bampton_with`].
    pub(crate) fn free_interface(
        &self,
        stiffness: &SparseMatrix,
        mass: &SparseMatrix,
        modes: &EigenModes,
        listener: Listener<'_>,
    ) -> Result<CraigBampton> {
        let mut inertia = mass.times(modes.shapes.as_ref());
        if let Some(patches) = &self.patches {
            patches.project(&mut inertia);
        }
        let inner = InnerBasis { modes: 0, whole_pairs: false, loads: Some(inertia.as_ref()) };
        let mut found = self.reduced(stiffness, mass, &inner, listener)?;
        let first = 3 * self.contact.len();
        let inner = found.stiffness.diagonal().iter().skip(first).map(|square| square.sqrt() / TAU).collect();
        found.fixed_interface_frequencies = inner;
        Ok(found)
    }

    fn reduced(
        &self,
        stiffness: &SparseMatrix,
        mass: &SparseMatrix,
        inner: &InnerBasis<'_>,
        listener: Listener<'_>,
    ) -> Result<CraigBampton> {
        let Some(patches) = &self.patches else {
            let cartesian = craig_bampton_with(stiffness, mass, &self.interface, inner, listener)?;
            return Ok(rotated(cartesian, self.nodes, self.contact, self.frame));
        };
        let (stiffness, mass) = patches.transformed(stiffness, mass)?;
        let cartesian = craig_bampton_with(&stiffness, &mass, &self.interface, inner, listener)?;
        let mut found = rotated(cartesian, self.nodes, patches.points(), self.frame);
        patches.restore(&mut found.transformation);
        Ok(found)
    }
}
