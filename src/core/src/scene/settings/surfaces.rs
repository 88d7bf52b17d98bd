//! Settings of surfaces: shape, spline, patches.

use serde::{Deserialize, Serialize};

use super::is_default;

/// Shape of a rigid surface of revolution: radial clearance change around the circumference.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Shape {
    /// Perfectly round: the clearance is the gap everywhere.
    Circular {},
    /// Harmonic lobes: the casing radius changes by −amplitude·cos(order·θ − phase).
    Lobes {
        /// Amplitude (m).
        amplitude: f64,
        /// Number of lobes around the circumference.
        order: u32,
        /// Phase (rad).
        #[serde(default)]
        phase: f64,
    },
    /// Two smooth bumps half a turn apart: clearance c(1 − 2·depth·exp(−((mod(θ − phase, π)/π − ½)/width)²)), c the gap.
    TwoLobe {
        /// Depth factor (-): at 1 the bump overlaps the undeformed tip by as much as the gap.
        #[serde(default = "one")]
        depth: f64,
        /// Width parameter of the bump (-), fraction of half a turn.
        #[serde(default = "two_lobe_width")]
        width: f64,
        /// Phase (rad).
        #[serde(default)]
        phase: f64,
    },
    /// Table of the change of casing radius (m) at equally spaced angles starting at θ = 0, periodic cubic between.
    Table {
        /// Change of casing radius (m), at least 4 values; positive opens the clearance.
        radius_change: Vec<f64>,
    },
}

impl Default for Shape {
    fn default() -> Self {
        Self::Circular {}
    }
}

fn one() -> f64 {
    1.0
}

fn two_lobe_width() -> f64 {
    0.15
}

/// Continuation of a surface spline around the circumference.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Closure {
    /// Continuous first and second derivatives (fig. 8b of the paper; default).
    #[default]
    Smooth,
    /// Free ends: at the seam θ = 0 only the position is continuous (fig. 8a of the paper).
    FreeEnds,
}

/// Interpolation between the data points of a surface.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Interpolation {
    /// Bicubic uniform B-spline (default).
    #[default]
    Spline,
    /// Bilinear facets, whose normals jump from facet to facet; for comparison only.
    Facets,
}

/// A surface through data points, with the closest point as the contact point.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SplineSettings {
    /// Number of data points around the circumference; that of the structure's contact grid if the surface has a structure.
    #[serde(default = "default_count::<AROUND>", skip_serializing_if = "is_default_count::<AROUND>")]
    pub around: usize,
    /// Number of rings of data points along the axis; that of the structure's contact grid if the surface has a structure.
    #[serde(default = "default_count::<ALONG>", skip_serializing_if = "is_default_count::<ALONG>")]
    pub along: usize,
    /// Closure around the circumference.
    #[serde(default, skip_serializing_if = "is_default")]
    pub closure: Closure,
    /// Interpolation between the data points.
    #[serde(default, skip_serializing_if = "is_default")]
    pub interpolation: Interpolation,
}

impl Default for SplineSettings {
    fn default() -> Self {
        Self { around: AROUND, along: ALONG, closure: Closure::default(), interpolation: Interpolation::default() }
    }
}

/// Default numbers of data points around the circumference and along the axis.
const AROUND: usize = 72;
const ALONG: usize = 5;

fn default_count<const N: usize>() -> usize {
    N
}

fn is_default_count<const N: usize>(count: &usize) -> bool {
    *count == N
}

/// Patches for friction power: equal parts of the circumference and of the axial extent of the contact.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PatchSettings {
    /// Number of parts around the circumference, the first from θ = 0.
    pub around: usize,
    /// Number of parts along the axis.
    #[serde(default = "default_count::<1>", skip_serializing_if = "is_default_count::<1>")]
    pub along: usize,
}

/// One surface: around the z axis and parallel to the tip contour of its rotor, or through the open contact grid of a structure if its
/// master is a free body.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SurfaceSettings {
    /// Name by which contacts refer to it.
    pub name: String,
    /// Shape around the circumference.
    #[serde(default)]
    pub shape: Shape,
    /// Time over which the shape grows smoothly from circular to full (s), 0 = immediately.
    #[serde(default)]
    pub ramp_time: f64,
    /// Makes the amplitude factor of the shape, its rotation and the uniform radius change inputs.
    #[serde(default)]
    pub moving: bool,
    /// Structure that carries the surface and deforms it; its ROM needs a contact grid. The surface is rigid if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub structure: Option<String>,
    /// True if the structure only defines the position of the surface and does not deform it. For free bodies only.
    #[serde(default, skip_serializing_if = "is_default")]
    pub rigid: bool,
    /// Surface spline through data points; the analytical surface of revolution if absent (always a spline on a structure).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub spline: Option<SplineSettings>,
    /// Patches whose friction power is an output; the heated patches of the ROM if absent and the structure is thermal.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub patches: Option<PatchSettings>,
}
