//! Implausible values: values within their range that are probably mistakes of units, axes or sets. They are errors unless the scene
//! accepts them (`accept_implausible`); then they are warnings.

use tiprub_cosim::shown;
use tiprub_cosim::warning::{Topic, Warning};

use crate::scene::rom::DisplacementFrame;
use crate::{Error, Rom};

/// Remedy for a rejected value that is intended.
pub(crate) const IF_MEANT: &str =
    "If the value is correct, set `accept_implausible = true` in the scene (--accept-implausible)";

/// An implausible value.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Slip {
    /// Place of the value: a variable, a field or a ROM.
    pub what: String,
    /// The problem, with the value.
    pub problem: String,
    /// The value that was probably intended.
    pub question: String,
}

impl Slip {
    fn new(what: impl Into<String>, problem: impl Into<String>, question: impl Into<String>) -> Self {
        Self { what: what.into(), problem: problem.into(), question: question.into() }
    }

    /// Returns the value as an error.
    pub fn error(&self) -> Error {
        Error::invalid(self.what.clone(), self.problem.clone(), format!("{} {IF_MEANT}", self.question))
    }

    /// Returns the value as a warning, if the scene accepts it.
    pub fn warning(&self) -> Warning {
        let problem = format!("{}: {}", self.what, self.problem);
        Warning::new(Topic::Implausible, problem, self.question.clone())
    }
}

/// Largest plausible tip speed (m/s): fans and compressors reach 500, the last blades of steam turbines 800, and rotors of any material
/// burst above 1500. A speed in rpm used as rad/s is 9.5 times too fast.
pub(crate) const TIP_SPEED: f64 = 1500.0;
/// Largest plausible velocity of a free body (m/s): ten times a bird strike, the speed of space debris.
pub(crate) const FLIGHT: f64 = 3000.0;
/// Plausible radii of contact nodes (m): from the smallest turbines on a chip to four times the largest steam turbines. A radius of 20 mm
/// to 20 m in millimetres is 20 to 20 000.
const RADII: [f64; 2] = [1e-3, 20.0];
/// Plausible lowest natural frequencies (Hz): slower than a wind turbine's, faster than a blade on a chip.
const FREQUENCIES: [f64; 2] = [0.05, 1e6];
/// Tips may overlap seen along the axis: staggered blades by half a pitch, inducers by one or two. Sectors whose contact nodes span more
/// pitches than this do not belong to this axis.
const PITCHES: f64 = 3.0;
/// Frequencies below this fraction of the highest are rounding of rigid-body modes.
const RIGID: f64 = 1e-6;
/// Up to this number contact nodes are checked for crossing blades.
const CROSSING_UP_TO: usize = 200;

/// Checks for tips that are too fast at `speed` (rad/s), the value of the input `name`. Allocates only in this case.
pub(crate) fn of_speed(rom: &Rom, speed: f64, name: impl FnOnce() -> String) -> Option<Slip> {
    let fastest = speed.abs() * radii(rom)[1];
    (rom.frame == DisplacementFrame::Cylindrical && fastest > TIP_SPEED).then(|| {
        let speed_shown = shown(speed);
        let problem = format!(
            "at a speed of {speed_shown} rad/s the tips move at {fastest:.0} m/s, but rotors burst above {TIP_SPEED} m/s"
        );
        let radians = speed * std::f64::consts::PI / 30.0;
        Slip::new(name(), problem, format!("Is the speed in rpm? {speed_shown} rpm is {radians:.6} rad/s."))
    })
}

/// Largest plausible speed (rad/s).
pub fn fastest(rom: &Rom) -> f64 {
    if rom.frame == DisplacementFrame::Cylindrical { TIP_SPEED / radii(rom)[1] } else { f64::INFINITY }
}

/// Checks for a free body that is too fast at `velocity` (m/s).
pub(crate) fn of_velocity(name: &str, velocity: [f64; 3]) -> Option<Slip> {
    let size = velocity.iter().map(|component| component * component).sum::<f64>().sqrt();
    (size > FLIGHT).then(|| {
        let problem = format!("the free structure starts at {size:.0} m/s, above the plausible limit of {FLIGHT} m/s");
        Slip::new(format!("`velocity` of {name}"), problem, "Is the velocity in m/s?")
    })
}

/// Checks a ROM; `frequencies` are its angular frequencies (rad/s).
pub fn of_rom(rom: &Rom, frequencies: impl Iterator<Item = f64> + Clone) -> Vec<Slip> {
    let sectors = if rom.sectors > 1 && rom.extras.grid.is_none() { of_sectors(rom) } else { None };
    [of_size(rom), sectors, of_frequencies(rom, frequencies)].into_iter().flatten().collect()
}

/// Smallest and largest radius of the contact nodes (m); for a Cartesian ROM the extents of its bounding box.
fn radii(rom: &Rom) -> [f64; 2] {
    let along = |axis: usize| {
        let values = rom.contact_nodes.iter().map(|node| node.position[axis]);
        values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], value| [low.min(value), high.max(value)])
    };
    if rom.frame == DisplacementFrame::Cylindrical {
        return along(0);
    }
    let sides = [0, 1, 2].map(|axis| along(axis)[1] - along(axis)[0]);
    [f64::INFINITY, sides.into_iter().fold(0.0, f64::max)]
}

fn named(rom: &Rom) -> String {
    format!("ROM `{}`", rom.name)
}

fn of_size(rom: &Rom) -> Option<Slip> {
    let [low, high] = radii(rom);
    let what = if rom.frame == DisplacementFrame::Cylindrical { "are at a radius of" } else { "extend over" };
    if high > RADII[1] {
        let problem = format!("its contact nodes {what} {} m", shown(high));
        return Some(Slip::new(named(rom), problem, "Are its lengths in millimetres? ROMs use m, kg and s."));
    }
    (low < RADII[0]).then(|| {
        let problem = format!("contact nodes are at a radius of {} m", shown(low));
        Slip::new(named(rom), problem, "Is the axis of rotation correct, and are lengths in metres?")
    })
}

fn of_frequencies(rom: &Rom, frequencies: impl Iterator<Item = f64> + Clone) -> Option<Slip> {
    let highest = frequencies.clone().fold(0.0, f64::max);
    let elastic = frequencies.filter(|frequency| *frequency > RIGID * highest);
    let lowest = elastic.fold(f64::INFINITY, f64::min) / std::f64::consts::TAU;
    (lowest.is_finite() && !(FREQUENCIES[0]..=FREQUENCIES[1]).contains(&lowest)).then(|| {
        let problem = format!("its lowest natural frequency is {lowest:.3e} Hz");
        Slip::new(named(rom), problem, "Are the units (m, kg, s), the material and the clamped nodes correct?")
    })
}

/// Checks for neighbouring sectors that overlap.
fn of_sectors(rom: &Rom) -> Option<Slip> {
    if rom.frame != DisplacementFrame::Cylindrical {
        return None;
    }
    let pitch = std::f64::consts::TAU / crate::math::real(rom.sectors);
    let line: Vec<[f64; 2]> = developed(rom);
    let (low, high) =
        line.iter().fold((0.0_f64, 0.0_f64), |(low, high), [angle, _]| (low.min(*angle), high.max(*angle)));
    let how = if high - low > PITCHES * pitch {
        format!("its contact nodes span {:.4} rad, {:.1} times", high - low, (high - low) / pitch)
    } else if crosses_neighbour(&line, pitch) {
        "the line through its contact nodes crosses that of the next sector, given".to_owned()
    } else {
        return None;
    };
    let problem = format!("{how} the sector angle of {pitch:.4} rad ({} sectors)", rom.sectors);
    let question = "Are the number of sectors, the axis of rotation and the contact nodes correct?";
    Some(Slip::new(named(rom), problem, question))
}

/// Angle from the first contact node (rad, shortest way), and axial position (m) of every node.
fn developed(rom: &Rom) -> Vec<[f64; 2]> {
    let first = rom.contact_nodes.first().map_or(0.0, |node| node.position[1]);
    let turn = std::f64::consts::TAU;
    let short = |angle: f64| angle - turn * (angle / turn).round();
    rom.contact_nodes.iter().map(|node| [short(node.position[1] - first), node.position[2]]).collect()
}

/// Returns whether the line from node to node properly crosses itself one pitch further.
fn crosses_neighbour(line: &[[f64; 2]], pitch: f64) -> bool {
    if line.len() > CROSSING_UP_TO {
        return false;
    }
    let side = |[a, b]: [[f64; 2]; 2], c: [f64; 2]| (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
    let apart = |first: f64, second: f64| first * second < 0.0;
    let next = |[angle, z]: [f64; 2]| [angle + pitch, z];
    line.windows(2).any(|own| {
        let own = [own[0], own[1]];
        line.windows(2).map(|other| [next(other[0]), next(other[1])]).any(|other| {
            apart(side(own, other[0]), side(own, other[1])) && apart(side(other, own[0]), side(other, own[1]))
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distinguishes_crossing_from_overlapping_lines() {
        let straight = [[0.0, 0.0], [0.3, 0.1]];
        assert!(!crosses_neighbour(&straight, 0.1));
        let folded = [[0.0, 0.0], [0.3, 0.05], [0.0, 0.1]];
        assert!(!crosses_neighbour(&folded, 0.1));
        let loops = [[0.0, 0.0], [0.2, 0.1], [0.2, 0.0], [0.0, 0.1]];
        assert!(crosses_neighbour(&loops, 0.05));
    }
}
