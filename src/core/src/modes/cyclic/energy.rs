//! Energies of the modes, and their damping losses.

use super::CyclicBank;

impl CyclicBank {
    /// Kinetic and strain energy of the disk (J), in the form that the scheme conserves (see [`crate::modes::schemes`]).
    pub fn energies(&self) -> (f64, f64) {
        let (mut kinetic, mut strain) = (0.0, 0.0);
        for nodal_diameter in 0..self.model.diameters.len() {
            let (own, stored) = self.diameter_energies(nodal_diameter);
            kinetic += own;
            strain += stored;
        }
        (kinetic, strain)
    }

    /// Instantaneous kinetic and strain energy of the disk (J), ½q̇² and ½ω²q² of every mode, under the persistent contact forces
    /// (`forces[row · lanes + sector]`, N) and the modal loads.
    pub(crate) fn energies_now(&mut self, forces: &[f64]) -> (f64, f64) {
        self.gather_forces(forces);
        let (mut kinetic, mut strain) = (0.0, 0.0);
        for nodal_diameter in 0..self.model.diameters.len() {
            for mode in 0..self.model.diameters[nodal_diameter].len() {
                let force = self.gathered_force(nodal_diameter, mode);
                let (position, increment) = self.modal_state(nodal_diameter, mode);
                let index = nodal_diameter * self.modes + mode;
                for part in 0..2 {
                    let velocity = self.velocities[index].of(position[part], increment[part], force[part]);
                    kinetic += 0.5 * velocity * velocity;
                    strain += self.coefficients[index].spring * (position[part] * position[part]);
                }
            }
        }
        (kinetic, strain)
    }

    /// Kinetic and strain energy of the modes of one nodal diameter (J).
    pub fn diameter_energies(&self, nodal_diameter: usize) -> (f64, f64) {
        let (mut kinetic, mut strain) = (0.0, 0.0);
        // The strain energy belongs to one time, or to two.
        let lag = self.scheme.strain_lag();
        for mode in 0..self.model.diameters[nodal_diameter].len() {
            let k = &self.coefficients[nodal_diameter * self.modes + mode];
            let (position, increment) = self.modal_state(nodal_diameter, mode);
            for part in 0..2 {
                kinetic += k.inertia * (increment[part] * increment[part]);
                strain += k.spring * (position[part] * (position[part] - lag * increment[part]));
            }
        }
        (kinetic, strain)
    }

    /// Damping loss since the last call (J).
    pub(crate) fn collect_loss(&mut self) -> f64 {
        self.finish();
        let loss = self.state.loss.iter().sum();
        self.state.loss.fill(0.0);
        loss
    }
}
