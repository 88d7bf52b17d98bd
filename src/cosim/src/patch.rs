//! Patches of a casing, by which units exchange heat and temperatures.

/// Part of a structure with one uniform temperature.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ThermalPatch {
    /// Start and end angle (rad), start < end ≤ start + 2π.
    pub angle: [f64; 2],
    /// Start and end axial position (m).
    pub axial: [f64; 2],
}
