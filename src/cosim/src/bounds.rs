//! Bounds of numbers that every unit has. Beyond them sums and squares of such numbers lose the digits of the others.

use crate::{Error, Result, shown};

/// Largest entry of mass and stiffness matrices, including spin, in any unit of the coordinates. Squares do not overflow.
pub const MATRIX: f64 = 1e30;
/// Largest start and stop time, and communication step (s): thirty years.
pub const TIME: f64 = 1e9;
/// Shortest step (s), internal or of communication. Positions of 1 m are rounded to 1e-16 m, which a step of 1e-12 s turns into velocities
/// of 1e-4 m/s: a ten-thousandth of those of rubbing blades. Much shorter steps would turn rounding into impacts.
pub const SHORTEST_STEP: f64 = 1e-12;
/// Largest number of patches: each is an output.
pub const PATCHES: usize = 10_000;
/// Largest number of values of all variables of a scene: a wear map of a thousand by a thousand cells. Each has a name and a column in
/// results.
pub const VALUES: usize = 1_000_000;

/// Rejects a number outside `low` to `high`.
///
/// # Errors
/// A number out of range; the error names `field` and the range.
pub fn within(field: &str, value: f64, low: f64, high: f64) -> Result<()> {
    if (low..=high).contains(&value) {
        return Ok(());
    }
    let kind = if value.is_finite() { "value" } else { "finite value" };
    // The smallest positive number stands for any positive value.
    let range = if low.to_bits() == 1 {
        format!("above 0 and at most {}", shown(high))
    } else {
        format!("between {} and {}", shown(low), shown(high))
    };
    let remedy = format!("Give a {kind} {range}");
    Err(Error::invalid(field, format!("{} is out of range", shown(value)), remedy))
}

/// Rejects a number that is not finite, or whose magnitude exceeds `most`.
///
/// # Errors
/// A number out of range; the error names `field` and the range.
pub fn at_most(field: &str, value: f64, most: f64) -> Result<()> {
    within(field, value, -most, most)
}
