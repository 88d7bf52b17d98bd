//! Effects of contact forces on any of the sectors.

use super::fourier::Synthesis;
use super::pass::{Gather, SpectralResponse, modal_force};
use super::{CyclicBank, LANES};
use crate::math::vector::Vector3;

impl CyclicBank {
    /// Displacement at the contact node `row` of a sector per unit force at the contact node `column` of the sector that lies
    /// `difference` sectors before it (m/N): force components by displacement components.
    #[inline(always)]
    pub fn flexibility(&self, difference: usize, column: usize, row: usize) -> &[[f64; 4]; 3] {
        let nodes = self.rows / 3;
        &self.flexibility[(difference * nodes + column) * nodes + row]
    }

    /// Computes the effect of contact forces (sector, node, force in N) on the predicted step; [`CyclicBank::moved`] returns the result.
    pub fn ask(&mut self, forces: impl Iterator<Item = (usize, usize, Vector3)>) {
        self.asked.clear();
        self.asked.extend(forces.filter(|(.., force)| *force != Vector3::zeros()));
        self.asked_nodes.fill(false);
        for (_, node, _) in &self.asked {
            self.asked_nodes[*node] = true;
        }
        let (fourier, rows, forces) = (&self.fourier, self.rows, &self.asked[..]);
        self.instruction_set.run(Gather { fourier, rows, forces, spectrum: &mut self.asked_force });
        let (touched, flexibility, force) = (&self.asked_nodes[..], &self.spectral_flexibility[..], &self.asked_force);
        self.instruction_set.run(SpectralResponse { rows, touched, flexibility, force, spectrum: &mut self.spectrum });
        let (spectrum, lanes, values) = (&self.spectrum, self.lanes, &mut self.moved);
        self.instruction_set.run(Synthesis { fourier, spectrum, rows, lanes, values });
    }

    /// Displacements that the requested forces would cause (m), `[row][lane of sector]`.
    pub fn moved(&self) -> &[f64] {
        &self.moved
    }

    /// Applies the requested forces to the predicted step, eq. 11 of the paper: to contact displacements immediately, to the
    /// modes in the next pass over them.
    pub fn act(&mut self) {
        for (displacement, moved) in self.state.displacement.iter_mut().zip(&self.moved) {
            *displacement += moved;
        }
        self.state.force.copy_from_slice(&self.asked_force);
        self.state.touched.copy_from_slice(&self.asked_nodes);
        (self.state.unapplied, self.state.acting) = (true, true);
    }

    /// Modal force (re, im) of the contact forces of the last step on one mode (N).
    pub(super) fn modal_force(&self, nodal_diameter: usize, mode: usize) -> [f64; 2] {
        let (index, lane) = self.index(nodal_diameter, mode);
        let force = &self.state.force[nodal_diameter / LANES * self.rows..][..self.rows];
        modal_force(&self.state.touched, &self.shapes[index * self.rows..][..self.rows], force).map(|part| part[lane])
    }

    /// Returns the work of the modal loads over the last step (J), after the contact correction. A quasi-static mode follows its
    /// current load, so over this step the previous load did the work.
    pub(crate) fn finish_loads(&mut self) -> f64 {
        if !self.loads {
            return 0.0;
        }
        let (mut work, dynamic) = (0.0, self.model.diameters[0].dynamic_modes(self.scheme));
        for mode in 0..self.modal_load.len() {
            let load = if mode < dynamic { self.modal_load[mode] } else { self.state.modal_load_before[mode] };
            if load != 0.0 {
                let (_, increment) = self.modal_state(0, mode);
                work += 0.5 * load * (increment[0] + self.state.older[mode][0][0]);
            }
        }
        self.state.modal_load_before.copy_from_slice(&self.modal_load);
        work
    }
}
