//! What is gathered over one communication step: impulses, extremes, friction heat.

use super::patches::Patches;
use crate::contact::gap::GapLaw;
use crate::persist::persist_fields;
use crate::system::System;

/// Sums and extremes since the communication step began.
#[derive(Debug, Clone, PartialEq)]
pub struct Window {
    /// Smallest gap of every node (m), `[node · lanes + lane]`.
    pub lowest: Vec<f64>,
    /// ∫λ dt per node (N·s), same layout.
    pub normal_impulse: Vec<f64>,
    /// ∫µλ dt per node (N·s), same layout.
    pub tangential_impulse: Vec<f64>,
    /// ∫F dt on the rotor along fixed x, y, z (N·s).
    pub force_impulse: [f64; 3],
    /// ∫T dt on the rotor about z (N·m·s).
    pub torque_impulse: f64,
    /// Friction heat (J).
    pub friction_heat: f64,
    /// Largest λ (N).
    pub normal_peak: f64,
    /// Friction heat per patch (J); empty where the scene has none.
    pub patch_heat: Vec<f64>,
    /// ∫F dt on a free master along x, y, z (N·s) per pair; empty for rotors.
    pub pair_impulse: Vec<[f64; 3]>,
}

persist_fields!(Window {
    lowest,
    normal_impulse,
    tangential_impulse,
    force_impulse,
    torque_impulse,
    friction_heat,
    normal_peak,
    patch_heat,
    pair_impulse
});

impl Window {
    /// Room for `len` nodes of all lanes and numbers of patches and of pairs of a free master.
    pub fn new(len: usize, patches: usize, pairs: usize) -> Self {
        Self {
            lowest: vec![f64::INFINITY; len],
            normal_impulse: vec![0.0; len],
            tangential_impulse: vec![0.0; len],
            force_impulse: [0.0; 3],
            torque_impulse: 0.0,
            friction_heat: 0.0,
            normal_peak: 0.0,
            patch_heat: vec![0.0; patches],
            pair_impulse: vec![[0.0; 3]; pairs],
        }
    }

    /// Begin anew; the gaps at the beginning belong to the window.
    pub fn open(&mut self, gaps: &[f64]) {
        self.lowest.copy_from_slice(gaps);
        self.normal_impulse.fill(0.0);
        self.tangential_impulse.fill(0.0);
        self.force_impulse = [0.0; 3];
        self.torque_impulse = 0.0;
        self.friction_heat = 0.0;
        self.normal_peak = 0.0;
        self.patch_heat.fill(0.0);
        self.pair_impulse.fill([0.0; 3]);
    }

    /// Add the internal step just done, of length `step` (s), at the rotor phase `phase` (rad).
    pub fn add(&mut self, system: &System, phase: f64, step: f64) {
        for (lowest, gap) in self.lowest.iter_mut().zip(system.gaps()) {
            *lowest = if *gap < *lowest { *gap } else { *lowest };
        }
        let lanes = system.bank().lanes();
        for event in system.events() {
            let index = event.node * lanes + event.sector;
            self.normal_impulse[index] += event.normal * step;
            self.tangential_impulse[index] += event.tangential * step;
            self.normal_peak = self.normal_peak.max(event.normal);
            let [first, second, third] = event.force;
            if let Some(layout) = system.law().layout() {
                let (sine, cosine) = libm::sincos(layout.angles[index] + phase);
                self.force_impulse[0] += step * (first * cosine - second * sine);
                self.force_impulse[1] += step * (first * sine + second * cosine);
                self.torque_impulse += step * second * layout.radii[event.node];
            } else {
                self.force_impulse[0] += step * first;
                self.force_impulse[1] += step * second;
            }
            self.force_impulse[2] += step * third;
            if let GapLaw::Free(law) = system.law()
                && let Some(pair) = law.surface_of(event.node)
            {
                let sum = &mut self.pair_impulse[pair];
                *sum = std::array::from_fn(|i| sum[i] + step * event.force[i]);
            }
        }
    }

    /// Add the friction heat of the internal step just done.
    pub fn add_heat(&mut self, system: &System, phase: f64, patches: Option<&Patches>) {
        for event in system.heated() {
            self.friction_heat += event.friction_heat;
            if let (Some(patches), Some(layout)) = (patches, system.law().layout()) {
                let index = event.node * layout.lanes + event.sector;
                let patch = patches.find(layout.angles[index] + phase, layout.axial[event.node]);
                self.patch_heat[patch] += event.friction_heat;
            }
        }
    }
}
