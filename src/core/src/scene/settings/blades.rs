//! Settings of blades other than contact.

use serde::{Deserialize, Serialize};

use super::is_positive_zero;

/// Component of a displacement or force at a contact node of a rotating structure.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ForceDirection {
    /// Away from the axis.
    Radial,
    /// Around the axis, with increasing angle.
    Tangential,
    /// Along the axis.
    Axial,
}

/// Aerodynamic excitation by an engine order: the force on blade j of N is amplitude·cos(order·(θ_r + 2π(j − 1)/N) − phase), a stationary
/// pattern.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ExcitationSettings {
    /// Start value of the engine order.
    pub order: u32,
    /// The only mode family (1-based) that is loaded: by the modal load of the force at `node`, or, without a node, at the component of a
    /// contact node that the mode moves most. All modes are loaded if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mode: Option<usize>,
    /// Contact node at which the force acts.
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

/// Initial displacement and velocity of the blades in one mode family, as those of the component of a contact node that the mode moves
/// most.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct InitialSettings {
    /// Mode family (1-based).
    pub mode: usize,
    /// Sector (1-based) that moves alone.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sector: Option<usize>,
    /// Nodal diameter n: blade j of N moves with cos(2πn(j − 1)/N − phase); all blades move alike if neither this nor `sector` is given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub nodal_diameter: Option<usize>,
    /// Phase of that pattern (rad).
    #[serde(default, skip_serializing_if = "is_positive_zero")]
    pub phase: f64,
    /// Start value of the displacement parameter (m).
    #[serde(default, skip_serializing_if = "is_positive_zero")]
    pub displacement: f64,
    /// Start value of the velocity parameter (m/s).
    #[serde(default, skip_serializing_if = "is_positive_zero")]
    pub velocity: f64,
}
