//! An abradable coating that is pressed in or cut, with its material.

use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize};

/// Cutting of a coating: the tips shear it off along their path, and the shaft does the work.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CuttingSettings {
    /// Specific cutting energy u (J/m³): tangential force per cross-section of the cut.
    pub specific_energy: f64,
    /// Normal force per tangential force κ (-).
    pub normal_ratio: f64,
}

/// Abradable coating on a surface: cells of rods that yield and harden (Legrand, Batailly, Pierre, J. Comput. Nonlinear Dyn. 2012), or that
/// are cut. Its unworn surface is at the distance `gap`; the hard surface is `thickness` behind it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(into = "CoatingInFile")]
pub struct CoatingSettings {
    /// Thickness h₀ (m), 1e-9 to 0.1.
    pub thickness: f64,
    /// Modulus E (Pa), > 0; 0 if it is cut.
    pub modulus: f64,
    /// Yield stress Y (Pa), ≥ 0.
    pub yield_stress: f64,
    /// Linear hardening modulus K (Pa), ≥ 0.
    pub hardening: f64,
    /// Cells around the circumference.
    pub cells_around: usize,
    /// Cells along the axis, over the axial extent of the contact nodes.
    pub cells_along: usize,
    /// Width around the circumference over which a tip presses the coating (m), 1e-6 to 1: its thickness over the cosine of its stagger
    /// angle. `None`: from areas and lengths of the contact patches in the ROM.
    pub contact_width: Option<f64>,
    /// Cutting instead of pressing in; `modulus`, `yield_stress` and `hardening` are then 0.
    pub cutting: Option<CuttingSettings>,
}

/// Coating as in a scene file: a coating that is cut has no modulus, yield stress and hardening, any other has all of them.
#[derive(Serialize, Deserialize)]
#[serde(rename = "CoatingSettings", deny_unknown_fields)]
struct CoatingInFile {
    thickness: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    modulus: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    yield_stress: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    hardening: Option<f64>,
    cells_around: usize,
    cells_along: usize,
    #[serde(skip_serializing_if = "Option::is_none")]
    contact_width: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    cutting: Option<CuttingSettings>,
}

impl From<CoatingSettings> for CoatingInFile {
    fn from(settings: CoatingSettings) -> Self {
        let of_plastic = |value: f64| (settings.cutting.is_none() || value != 0.0).then_some(value);
        Self {
            thickness: settings.thickness,
            modulus: of_plastic(settings.modulus),
            yield_stress: of_plastic(settings.yield_stress),
            hardening: of_plastic(settings.hardening),
            cells_around: settings.cells_around,
            cells_along: settings.cells_along,
            contact_width: settings.contact_width,
            cutting: settings.cutting,
        }
    }
}

impl<'de> Deserialize<'de> for CoatingSettings {
    fn deserialize<D: Deserializer<'de>>(source: D) -> Result<Self, D::Error> {
        let file = CoatingInFile::deserialize(source)?;
        let given = |value: Option<f64>, key: &'static str| match (value, file.cutting) {
            (None, None) => Err(D::Error::missing_field(key)),
            (value, _) => Ok(value.unwrap_or(0.0)),
        };
        Ok(Self {
            thickness: file.thickness,
            modulus: given(file.modulus, "modulus")?,
            yield_stress: given(file.yield_stress, "yield_stress")?,
            hardening: given(file.hardening, "hardening")?,
            cells_around: file.cells_around,
            cells_along: file.cells_along,
            contact_width: file.contact_width,
            cutting: file.cutting,
        })
    }
}
