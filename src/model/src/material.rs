//! Linear isotropic material.

use crate::{Error, Result};

/// A linear elastic isotropic material.
#[derive(Debug, Clone, PartialEq)]
pub struct Material {
    /// Name, as written into exported files.
    pub name: String,
    /// Young's modulus E (Pa).
    pub young_modulus: f64,
    /// Poisson's ratio ν.
    pub poisson_ratio: f64,
    /// Density ρ (kg/m³).
    pub density: f64,
}

impl Material {
    /// Maraging steel as taken for rotor 37: E = 180 GPa, ν = 0.3, ρ = 8000 kg/m³.
    pub fn maraging_steel() -> Self {
        Self { name: "maraging_steel".into(), young_modulus: 180e9, poisson_ratio: 0.3, density: 8000.0 }
    }

    /// Lamé's constants (λ, µ) in Pa.
    pub fn lame(&self) -> (f64, f64) {
        let (e, nu) = (self.young_modulus, self.poisson_ratio);
        (e * nu / ((1.0 + nu) * (1.0 - 2.0 * nu)), e / (2.0 * (1.0 + nu)))
    }

    /// Check that the material is one.
    ///
    /// # Errors
    /// [`Error::Invalid`] naming the property.
    pub fn validate(&self) -> Result<()> {
        let positive = |value: f64| value.is_finite() && value > 0.0;
        let fail = |property: &str, value: f64, range: &str| {
            Err(Error::invalid(
                format!("material `{}`, {property}", self.name),
                format!("{value} is outside {range}"),
                "Give SI units: Pa and kg/m³",
            ))
        };
        if !positive(self.young_modulus) {
            return fail("Young's modulus", self.young_modulus, "E > 0");
        }
        if !positive(self.density) {
            return fail("density", self.density, "ρ > 0");
        }
        if !(self.poisson_ratio > -1.0 && self.poisson_ratio < 0.5) {
            return fail("Poisson's ratio", self.poisson_ratio, "-1 < ν < 0.5");
        }
        Ok(())
    }
}
