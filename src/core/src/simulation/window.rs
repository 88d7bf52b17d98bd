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
    /// ∫M dt on the rotor about fixed x, y, z through the shaft's centre, or on a free master about the origin (N·m·s).
    pub moment_impulse: [f64; 3],
    /// Friction heat (J).
    pub friction_heat: f64,
    /// Largest λ (N).
    pub normal_peak: f64,
    /// Friction heat per patch (J); empty where the scene has none.
    pub patch_heat: Vec<f64>,
    /// ∫F dt on a free master along x, y, z (N·s) per pair; empty for rotors.
    pub pair_impulse: Vec<[f64; 3]>,
    /// The same of ∫M dt about the origin (N·m·s).
    pub pair_moment: Vec<[f64; 3]>,
}

persist_fields!(Window {
    lowest,
    normal_impulse,
    tangential_impulse,
    force_impulse,
    moment_impulse,
    friction_heat,
    normal_peak,
    patch_heat,
    pair_impulse,
    pair_moment
});

impl Window {
    /// Room for `len` nodes of all lanes and numbers of patches and of pairs of a free master.
    pub fn new(len: usize, patches: usize, pairs: usize) -> Self {
        Self {
            lowest: vec![f64::INFINITY; len],
            normal_impulse: vec![0.0; len],
            tangential_impulse: vec![0.0; len],
            force_impulse: [0.0; 3],
            moment_impulse: [0.0; 3],
            friction_heat: 0.0,
            normal_peak: 0.0,
            patch_heat: vec![0.0; patches],
            pair_impulse: vec![[0.0; 3]; pairs],
            pair_moment: vec![[0.0; 3]; pairs],
        }
    }

    /// Begin anew; the gaps at the beginning belong to the window.
    pub fn open(&mut self, gaps: &[f64]) {
        self.lowest.copy_from_slice(gaps);
        self.normal_impulse.fill(0.0);
        self.tangential_impulse.fill(0.0);
        self.force_impulse = [0.0; 3];
        self.moment_impulse = [0.0; 3];
        self.friction_heat = 0.0;
        self.normal_peak = 0.0;
        self.patch_heat.fill(0.0);
        self.pair_impulse.fill([0.0; 3]);
        self.pair_moment.fill([0.0; 3]);
    }

    /// Add the internal step just done, of length `step` (s).
    pub fn add(&mut self, system: &System, patches: Option<&Patches>, step: f64) {
        for (lowest, gap) in self.lowest.iter_mut().zip(system.gaps()) {
            *lowest = if *gap < *lowest { *gap } else { *lowest };
        }
        for event in system.events() {
            self.normal_peak = self.normal_peak.max(event.normal);
        }
        let lanes = system.bank().lanes();
        for event in system.acted() {
            let index = event.node * lanes + event.sector;
            self.normal_impulse[index] += event.normal * step;
            self.tangential_impulse[index] += event.tangential * step;
            add_scaled(&mut self.force_impulse, step, event.wrench.force);
            add_scaled(&mut self.moment_impulse, step, event.wrench.moment);
            if let GapLaw::Free(law) = system.law()
                && let Some(pair) = law.surface_of(event.node)
            {
                add_scaled(&mut self.pair_impulse[pair], step, event.wrench.force);
                add_scaled(&mut self.pair_moment[pair], step, event.wrench.moment);
            }
            self.friction_heat += event.friction_heat;
            if let Some(patches) = patches {
                let [x, y, z] = event.wrench.point;
                self.patch_heat[patches.find(libm::atan2(y, x), z)] += event.friction_heat;
            }
        }
    }
}

fn add_scaled(sum: &mut [f64; 3], factor: f64, term: [f64; 3]) {
    *sum = std::array::from_fn(|i| sum[i] + factor * term[i]);
}
