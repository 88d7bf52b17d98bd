//! Linear isotropic material.

use tiprub_cosim::shown;

use crate::{Error, Result};

/// Linear elastic isotropic material.
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
    /// Coefficient of linear thermal expansion α (1/K), secant from the reference temperature.
    pub expansion: f64,
}

impl Material {
    /// Returns maraging steel as used for rotor 37: E = 180 GPa, ν = 0.3, ρ = 8000 kg/m³; α = 10.1e-6 1/K is that of
    /// 18Ni maraging steel (250 grade, 24 to 284 °C, ASM Metals Handbook).
    pub fn maraging_steel() -> Self {
        Self {
            name: "maraging_steel".into(),
            young_modulus: 180e9,
            poisson_ratio: 0.3,
            density: 8000.0,
            expansion: 10.1e-6,
        }
    }

    /// Returns plain carbon steel: E = 210 GPa, ν = 0.3, ρ = 7850 kg/m³ (EN 1993-1-1, 3.2.6); α = 11.7e-6 1/K
    /// (low-carbon steel AISI 1020, 0 to 100 °C, ASM Metals Handbook).
    ///
    /// # Examples
    /// ```
    /// assert_eq!(tiprub_model::Material::steel().poisson_ratio, 0.3);
    /// # Ok::<(), tiprub_model::Error>(())
    /// ```
    pub fn steel() -> Self {
        Self { name: "steel".into(), young_modulus: 210e9, poisson_ratio: 0.3, density: 7850.0, expansion: 11.7e-6 }
    }

    /// Returns titanium Ti-6Al-4V, annealed: E = 113.8 GPa, ν = 0.342, ρ = 4430 kg/m³, α = 8.6e-6 1/K (20 to 100 °C,
    /// ASM).
    pub fn titanium() -> Self {
        Self {
            name: "titanium".into(),
            young_modulus: 113.8e9,
            poisson_ratio: 0.342,
            density: 4430.0,
            expansion: 8.6e-6,
        }
    }

    /// Returns Lamé's constants (λ, µ) in Pa.
    ///
    /// # Examples
    /// ```
    /// let (lambda, mu) = tiprub_model::Material::steel().lame();
    /// assert!(lambda > mu);
    /// # Ok::<(), tiprub_model::Error>(())
    /// ```
    pub fn lame(&self) -> (f64, f64) {
        let (e, nu) = (self.young_modulus, self.poisson_ratio);
        (e * nu / ((1.0 + nu) * (1.0 - 2.0 * nu)), e / (2.0 * (1.0 + nu)))
    }

    /// Checks that the properties are valid.
    ///
    /// # Errors
    /// [`Error::Invalid`] with the property.
    pub(crate) fn validate(&self) -> Result<()> {
        let positive = |value: f64| value.is_finite() && value > 0.0;
        let fail = |property: &str, value: f64, range: &str| {
            Err(Error::invalid(
                format!("material `{}`, {property}", self.name),
                format!("{} does not satisfy {range}", shown(value)),
                "Use SI units: Pa, kg/m³ and 1/K",
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
        // All metals are below 1e-4; a value given in 1e-6/K must not pass as 1/K.
        if self.expansion.is_nan() || self.expansion.abs() > 1e-3 {
            return fail("thermal expansion coefficient", self.expansion, "|α| ≤ 1e-3 1/K");
        }
        Ok(())
    }
}
