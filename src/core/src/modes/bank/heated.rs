//! Heat: free thermal expansion of blades, and modes that soften without being coupled.
//!
//! A temperature T loads the modes with T K̂ e, where e is the free expansion per kelvin in modal coordinates and K̂ is the
//! stiffness in the step. Every sector therefore rests at T e whatever its stiffness is: softened, stiffened by the speed, or
//! mistuned (K̂ of a mistuned blade is that of the others times the square of its factor).

use super::ModalBank;

/// Thermal loads.
#[derive(Debug, Clone)]
pub(super) struct HeatLoads {
    /// Free expansion e of each mode (√kg m/K).
    expansion: Vec<f64>,
    /// K̂ e of a sector without a factor.
    load: Vec<f64>,
    /// Square of the factor of each sector minus 1; empty if all sectors are equal.
    excess: Vec<f64>,
    /// T K̂ e in the current step; empty if all sectors are equal.
    pub(super) now: Vec<f64>,
}

impl HeatLoads {
    /// Returns `None` without an expansion.
    pub(super) fn new(expansion: &[f64], factors: &[f64]) -> Option<Self> {
        let modes = expansion.len();
        (modes > 0).then(|| Self {
            expansion: expansion.to_vec(),
            load: vec![0.0; modes],
            excess: factors.iter().map(|factor| factor * factor - 1.0).collect(),
            now: vec![0.0; if factors.is_empty() { 0 } else { modes }],
        })
    }
}

impl ModalBank {
    /// Computes K̂ e for the current stiffness.
    pub(super) fn fill_heat(&mut self) {
        let Some(heat) = &mut self.heat else { return };
        for (mode, (load, expansion)) in heat.load.iter_mut().zip(&heat.expansion).enumerate() {
            let frequency = self.model.frequencies[mode];
            *load = frequency * frequency * expansion;
        }
        if let Some(coupling) = &self.coupling {
            coupling.add_stiffness(&heat.expansion, &mut heat.load);
        }
    }

    /// Adds the load of a temperature (K) to the modal loads of the next step.
    pub fn expand(&mut self, temperature: f64) {
        let Some(heat) = &mut self.heat else { return };
        for (load, heat) in self.modal_load.iter_mut().zip(&heat.load) {
            *load += temperature * heat;
        }
        heat.now.iter_mut().zip(&heat.load).for_each(|(now, heat)| *now = temperature * heat);
    }

    /// Moves all sectors, which are at rest, by the free expansion of a temperature (K), which loads them from now on.
    pub(crate) fn settle_expansion(&mut self, temperature: f64) {
        let Some(heat) = self.heat.take() else { return };
        for (mode, (expansion, load)) in heat.expansion.iter().zip(&heat.load).enumerate() {
            self.state.modal_load_before[mode] += temperature * load;
            for sector in 0..self.sectors {
                let index = self.index(mode, sector);
                self.state.position[index] += temperature * expansion;
            }
        }
        let before = self.state.heat_before.iter_mut().zip(&heat.load);
        before.for_each(|(before, load)| *before = temperature * load);
        self.heat = Some(heat);
        self.recover();
    }

    /// Adds the additional thermal loads of mistuned sectors to the predicted step.
    pub(super) fn act_expanded(&mut self) {
        let Some(heat) = self.heat.take() else { return };
        for (sector, excess) in heat.excess.iter().enumerate().filter(|(_, excess)| **excess != 0.0) {
            self.act_on_modes(sector, &heat.now, |k, load| k.load_compliance() * load * excess);
        }
        self.heat = Some(heat);
    }

    /// Additional thermal load on a mode of a mistuned sector in the previous step.
    pub(super) fn heat_before(&self, mode: usize, sector: usize) -> f64 {
        let excess = self.heat.as_ref().and_then(|heat| heat.excess.get(sector)).copied().unwrap_or(0.0);
        if excess == 0.0 { 0.0 } else { excess * self.state.heat_before[mode] }
    }

    /// Returns the work of the additional loads over the last step (J), see [`ModalBank::finish_loads`].
    pub(super) fn finish_heat(&mut self) -> f64 {
        let Some(heat) = &self.heat else { return 0.0 };
        let (mut work, dynamic) = (0.0, self.model.dynamic_modes(self.scheme));
        for (sector, excess) in heat.excess.iter().enumerate().filter(|(_, excess)| **excess != 0.0) {
            for (mode, (now, before)) in heat.now.iter().zip(&self.state.heat_before).enumerate() {
                let (load, index) = (if mode < dynamic { now } else { before }, self.index(mode, sector));
                work += 0.5 * excess * load * (self.state.increment[index] + self.increment_before[index]);
            }
        }
        self.state.heat_before.copy_from_slice(&heat.now);
        work
    }

    /// Softens the modes that ΔK does not couple: stiffness, inertia and damping are multiplied by one factor, so that the modes
    /// keep their recurrence and have the static displacement of the softened structure.
    pub(super) fn relax(&mut self) {
        let Some(coupling) = self.coupling.as_ref().filter(|coupling| coupling.softens()) else { return };
        let (modes, first) = (self.model.len(), coupling.coupled);
        for (index, coefficients) in
            self.coefficients.iter_mut().enumerate().filter(|(index, _)| index % modes >= first)
        {
            let factor = self.options.frequency_factors.get(index / modes).copied().unwrap_or(1.0);
            let cold = self.model.coefficient(index % modes, factor, self.scheme, self.step);
            *coefficients = cold.with_stiffness(coupling.share(index % modes));
        }
        if !self.lane_coefficients.is_empty() {
            self.spread_coefficients();
        }
    }

    /// Adds `sign` times the stiffness fractions of the quasi-static modes to the change of stiffness before the next step.
    pub(super) fn count_stiffness(&mut self, sign: f64) {
        let Some(coupling) = self.coupling.as_ref().filter(|coupling| coupling.softens()) else { return };
        let first = self.model.dynamic_modes(self.scheme);
        let gained = &mut self.state.stiffened[..];
        let unused = gained.len() - (self.model.len() - first);
        gained[unused..]
            .iter_mut()
            .enumerate()
            .for_each(|(index, gained)| *gained += sign * coupling.share(first + index));
    }

    /// Returns the work of heat on quasi-static modes over the last step (J), in addition to the change of energy at its
    /// beginning: these modes follow the force of the step immediately, and the change of stiffness also acts during that motion.
    pub(crate) fn finish_stiffening(&mut self) -> f64 {
        let (mut work, first) = (0.0, self.modes - self.state.stiffened.len());
        for mode in first..self.modes {
            let gained = std::mem::take(&mut self.state.stiffened[mode - first]);
            if gained != 0.0 {
                for sector in 0..self.sectors {
                    let (index, frequency) = (self.index(mode, sector), self.frequency(mode, sector));
                    let (position, increment) = (self.state.position[index], self.state.increment[index]);
                    let moved = increment + self.increment_before[index];
                    work += 0.5 * gained * frequency * frequency * (position - increment) * moved;
                }
            }
        }
        work
    }
}
