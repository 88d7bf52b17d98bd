//! What is gathered over one communication step: impulses, extremes, friction heat.

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
}

persist_fields!(Window {
    lowest,
    normal_impulse,
    tangential_impulse,
    force_impulse,
    torque_impulse,
    friction_heat,
    normal_peak
});

impl Window {
    /// Room for `len` nodes of all lanes.
    pub fn new(len: usize) -> Self {
        Self {
            lowest: vec![f64::INFINITY; len],
            normal_impulse: vec![0.0; len],
            tangential_impulse: vec![0.0; len],
            force_impulse: [0.0; 3],
            torque_impulse: 0.0,
            friction_heat: 0.0,
            normal_peak: 0.0,
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
            self.friction_heat += event.friction_heat;
            self.normal_peak = self.normal_peak.max(event.normal);
            let [first, second, third] = event.force;
            if let GapLaw::Revolution(law) = system.law() {
                let (sine, cosine) = libm::sincos(law.angle(event.node, event.sector, phase));
                self.force_impulse[0] += step * (first * cosine - second * sine);
                self.force_impulse[1] += step * (first * sine + second * cosine);
                self.torque_impulse += step * second * law.radius(event.node);
            } else {
                self.force_impulse[0] += step * first;
                self.force_impulse[1] += step * second;
            }
            self.force_impulse[2] += step * third;
        }
    }
}
