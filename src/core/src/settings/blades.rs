//! What a scene gives blades beside contact.

use serde::{Deserialize, Serialize};

use super::is_positive_zero;

/// Component of a displacement or force at a contact node of a structure that turns.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ForceDirection {
    /// Away from the axis.
    Radial,
    /// Around it, with the angle.
    Tangential,
    /// Along it.
    Axial,
}

/// Aerodynamic excitation by an engine order: blade j of N feels amplitude·cos(order·(θ_r + 2π(j − 1)/N) − phase), the pattern of
/// something that stands still.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ExcitationSettings {
    /// Start value of the engine order.
    pub order: u32,
    /// The mode family (1-based) that alone is loaded: by the modal load of the force at `node`, or, without one, at the component
    /// of a contact node that the mode moves most. All modes are loaded where it is absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mode: Option<usize>,
    /// Contact node that the force acts on.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub node: Option<String>,
    /// Direction of the force at that node.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub direction: Option<ForceDirection>,
    /// Start value of the amplitude input (N per blade).
    #[serde(default, skip_serializing_if = "is_positive_zero")]
    pub amplitude: f64,
    /// Start value of the phase input (rad).
    #[serde(default, skip_serializing_if = "is_positive_zero")]
    pub phase: f64,
}

/// Displacement and velocity of the blades in one mode family at the start, as those of the component of a contact node that the
/// mode moves most.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct InitialSettings {
    /// Mode family (1-based).
    pub mode: usize,
    /// Sector (1-based) that moves alone.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sector: Option<usize>,
    /// Blade j of N moves with cos(2πn(j − 1)/N − phase); all alike where neither this nor `sector` is given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub nodal_diameter: Option<usize>,
    /// Phase of that pattern (rad).
    #[serde(default, skip_serializing_if = "is_positive_zero")]
    pub phase: f64,
    /// Start value of the parameter displacement (m).
    #[serde(default, skip_serializing_if = "is_positive_zero")]
    pub displacement: f64,
    /// Start value of the parameter velocity (m/s).
    #[serde(default, skip_serializing_if = "is_positive_zero")]
    pub velocity: f64,
}
