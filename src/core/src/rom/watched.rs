//! Points of a structure whose motion is looked at, and that touch nothing.

use nalgebra::DMatrix;

use super::{ContactNode, Rom, entries};
use crate::{Error, Result, ranges};

/// Points whose motion is looked at, and that touch nothing.
#[derive(Debug, Clone, PartialEq)]
pub struct Watched {
    /// Displacement of the points, 3·points × n; rows (point, component), directions as for contact nodes.
    pub map: DMatrix<f64>,
    /// Names and places.
    pub points: Vec<ContactNode>,
}

impl Rom {
    pub(super) fn validate_watched(&self, remedy: &str) -> Result<()> {
        let Some(watched) = &self.extras.watched else { return Ok(()) };
        let expected = (3 * watched.points.len(), self.order());
        if watched.points.is_empty() || watched.map.shape() != expected {
            let problem = format!("shape {:?}, {expected:?} and at least one point expected", watched.map.shape());
            return Err(Error::invalid("ROM array `watched_map`", problem, remedy));
        }
        if self.is_cyclic() {
            let problem = "given with coupled sectors, whose nodal diameters above 0 it says nothing of";
            return Err(Error::invalid("ROM array `watched_map`", problem, "Leave watched points out"));
        }
        entries("watched_map", &watched.map, ranges::MAP, remedy)?;
        let what = |index: usize| format!("ROM array `watched_positions`, point {}", index + 1);
        let mut places = watched.points.iter().enumerate();
        places.try_for_each(|(index, point)| self.validate_place(&what(index), point, remedy))
    }
}
