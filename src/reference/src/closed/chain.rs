//! Ring of N masses m on springs k to the ground, neighbours coupled by k_c: static response and response to a
//! travelling wave.

use std::f64::consts::TAU;

/// Chain of masses.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Chain {
    /// Number of masses N.
    pub sectors: usize,
    /// m (kg).
    pub mass: f64,
    /// k (N/m).
    pub spring: f64,
    /// k_c (N/m).
    pub coupling: f64,
    /// Damping ratio of all modes.
    pub damping_ratio: f64,
}

impl Chain {
    /// Returns the angular frequency ω_n (rad/s): ω_n² = (k + 4k_c sin²(πn/N))/m.
    pub fn frequency(&self, nodal_diameter: u32) -> f64 {
        let sectors = u32::try_from(self.sectors).expect("the number of sectors fits into 32 bits");
        super::frequencies::cyclic_chain(nodal_diameter, sectors, self.mass, self.spring, self.coupling)
    }

    /// Returns the displacement of sector s under a static unit force on sector 0 (m/N): (r^s + r^(N−s))/((1 − r^N)
    /// √(k² + 4kk_c)), r < 1 the root of k_c r² − (k + 2k_c) r + k_c = 0.
    pub fn influence(&self, sector: usize) -> f64 {
        let (k, c) = (self.spring, self.coupling);
        let root = (k * k + 4.0 * k * c).sqrt();
        // The smaller root is computed from the larger one, without cancellation.
        let r = 2.0 * c / (k + 2.0 * c + root);
        let power = |n: usize| r.powi(i32::try_from(n).expect("the number of sectors fits into 32 bits"));
        (power(sector) + power(self.sectors - sector)) / ((1.0 - power(self.sectors)) * root)
    }

    /// Returns the force on every mass per unit amplitude of a displacement wave cos(2πns/N − ωt) that is imposed on
    /// all: amplitude |m(ω_n² − ω² + 2iξω_nω)| (N/m) and the phase lead of the force (rad).
    pub fn wave_force(&self, nodal_diameter: u32, omega: f64) -> (f64, f64) {
        let own = self.frequency(nodal_diameter);
        let real = self.mass * (own * own - omega * omega);
        let imaginary = self.mass * 2.0 * self.damping_ratio * own * omega;
        (real.hypot(imaginary), imaginary.atan2(real))
    }

    /// Returns the angle between neighbours (rad).
    pub fn pitch(&self) -> f64 {
        TAU / f64::from(u32::try_from(self.sectors).expect("the number of sectors fits into 32 bits"))
    }
}
