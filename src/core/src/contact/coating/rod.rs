//! Law of one coating cell: a rod that is loaded in compression only, yields and hardens linearly.

use crate::scene::settings::CoatingSettings;

/// Branch of the law of a rod.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) enum Branch {
    /// Blade and rod are not in contact.
    #[default]
    Free,
    /// Along the modulus.
    Elastic,
    /// On the hardening line: the rod is being worn.
    Plastic,
}

/// Material of the rods (Legrand, Batailly, Pierre, J. Comput. Nonlinear Dyn. 2012): σ = E(ε − ε_p) ≥ 0 up to
/// σ = Y + Kε_p; beyond it ε_p grows. The hardening variable equals the plastic strain in monotonic compression.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct RodMaterial {
    pub(super) modulus: f64,
    pub(super) yield_stress: f64,
    pub(super) hardening: f64,
}

impl RodMaterial {
    /// Creates the material of a coating.
    pub fn new(settings: &CoatingSettings) -> Self {
        let &CoatingSettings { modulus, yield_stress, hardening, .. } = settings;
        Self { modulus, yield_stress, hardening }
    }

    /// Returns the branch at a total strain and the current plastic strain.
    pub fn branch(&self, strain: f64, plastic: f64) -> Branch {
        let trial = self.modulus * (strain - plastic);
        if trial <= 0.0 {
            Branch::Free
        } else if trial > self.yield_stress + self.hardening * plastic {
            Branch::Plastic
        } else {
            Branch::Elastic
        }
    }

    /// Straight line of a branch: stress at zero total strain (Pa) and tangent (Pa). The hardening line is the same for every current
    /// plastic strain.
    pub fn line(&self, branch: Branch, plastic: f64) -> (f64, f64) {
        let Self { modulus, yield_stress, hardening } = *self;
        match branch {
            Branch::Free => (0.0, 0.0),
            Branch::Elastic => (-modulus * plastic, modulus),
            Branch::Plastic => {
                let share = modulus / (modulus + hardening);
                (share * yield_stress, share * hardening)
            }
        }
    }

    /// Plastic strain after a strain on the hardening line: Eε = Y + (E + K)ε_p.
    pub fn worn(&self, strain: f64) -> f64 {
        (self.modulus * strain - self.yield_stress) / (self.modulus + self.hardening)
    }

    /// Stress (Pa) at a total strain, and the resulting plastic strain.
    #[cfg(test)]
    pub fn stress(&self, strain: f64, plastic: f64) -> (f64, f64) {
        let branch = self.branch(strain, plastic);
        let (offset, tangent) = self.line(branch, plastic);
        let after = if branch == Branch::Plastic { self.worn(strain).max(plastic) } else { plastic };
        (offset + tangent * strain, after)
    }

    /// Work spent per volume (J/m³) while the plastic strain grows: ∫(Y + Kε_p)dε_p, plastic and hardening part.
    pub fn wear_work(&self, before: f64, after: f64) -> f64 {
        (after - before) * (self.yield_stress + 0.5 * self.hardening * (before + after))
    }

    /// Returns the next branch, one border at a time, if `strain` is beyond the border of `branch` by more than `slack`; `None` if it
    /// holds.
    pub(super) fn next(&self, branch: Branch, strain: f64, plastic: f64, slack: f64) -> Option<Branch> {
        let beyond = |next: Branch| strain - self.border(branch, next, plastic);
        match branch {
            Branch::Free => (beyond(Branch::Elastic) > slack).then_some(Branch::Elastic),
            Branch::Plastic => (beyond(Branch::Elastic) < -slack).then_some(Branch::Elastic),
            Branch::Elastic if beyond(Branch::Free) < -slack => Some(Branch::Free),
            Branch::Elastic => (beyond(Branch::Plastic) > slack).then_some(Branch::Plastic),
        }
    }

    /// Total strain between two neighbouring branches.
    pub(super) fn border(&self, branch: Branch, next: Branch, plastic: f64) -> f64 {
        let yields = branch == Branch::Plastic || next == Branch::Plastic;
        plastic + if yields { (self.yield_stress + self.hardening * plastic) / self.modulus } else { 0.0 }
    }
}
