//! Consistency of the tip contour in the meridional plane: slopes of the ROM against slopes between its positions.
//!
//! A surface of revolution takes its normals from the slopes, a surface spline from a curve through the positions. Both must describe the
//! same contour.

use tiprub_cosim::shown;

use crate::math::argsort;
use crate::{Error, Result, Rom};

/// Allowed difference between given slopes and slopes between positions (-), which turns a normal by 14 degrees. Reasons are means over
/// patches, a tip that is not quite a surface of revolution, and fillets.
const APART: f64 = 0.25;
/// Allowed difference for a cylinder, which also results from a ROM file without slopes.
const CYLINDER: f64 = 0.05;
/// Contact nodes closer along the axis than this fraction of their extent are one station.
const SAME_PLACE: f64 = 1e-3;
/// Contact nodes whose axial extent is below this fraction of their radius have no contour.
const FLAT: f64 = 1e-6;
/// Radii of one station may differ by this fraction, since a tip may be cut flat.
const UNEVEN: f64 = 1e-4;

/// A station along the axis: its first node, and the mean values there.
#[derive(Debug, Clone, Copy)]
struct AxialStation {
    node: usize,
    count: f64,
    axial: f64,
    radius: f64,
    slope: f64,
}

/// Checks the slopes of the contact nodes of one pair; `uses_slopes` for a surface whose normals follow them. Zeros count as missing slopes
/// if they are unused.
///
/// # Errors
/// [`Error::Invalid`] with the ROM, two nodes, their slopes and the slope between their positions.
pub(crate) fn check_contour(rom: &Rom, nodes: &[usize], uses_slopes: bool) -> Result<()> {
    let straight = nodes.iter().all(|node| rom.contact_nodes[*node].meridional_slope == 0.0);
    if straight && !uses_slopes {
        return Ok(());
    }
    let places = places(rom, nodes);
    let apart = if straight { CYLINDER } else { APART };
    for pair in places.windows(2) {
        let [low, high] = [pair[0], pair[1]];
        let length = high.axial - low.axial;
        let rise = (high.radius - low.radius) / length;
        // The mean slope of a parabola is the mean of the slopes at its ends; a kink may deviate from it by half their difference.
        let bent = 0.25 * (high.slope - low.slope).abs();
        let off = (rise - 0.5 * (low.slope + high.slope)).abs();
        if off > apart + bent + UNEVEN * low.radius / length {
            return Err(contradicted(rom, [low, high], rise, straight));
        }
    }
    Ok(())
}

fn contradicted(rom: &Rom, [low, high]: [AxialStation; 2], rise: f64, straight: bool) -> Error {
    let [first, last] = [low, high].map(|place| &rom.contact_nodes[place.node].name);
    let remedy = if straight {
        "Give dr/dz of the tip contour at each node, which is 0 if the array is missing, or set meridian = \
         \"cylinder\" for the contact"
    } else {
        "Give the slope dr/dz of the tip contour at each node, with its sign for increasing z, not an angle"
    };
    Error::invalid(
        format!("ROM `{}`, array `contact_meridional_slopes`", rom.name),
        format!(
            "nodes `{first}` and `{last}` have the slopes {} and {}, but their radii increase by {} m per m along the \
             axis",
            shown(low.slope),
            shown(high.slope),
            shown((rise * 1e4).round() / 1e4)
        ),
        remedy,
    )
}

/// Returns the stations of some contact nodes in ascending axial order; empty if the nodes have no axial extent.
fn places(rom: &Rom, nodes: &[usize]) -> Vec<AxialStation> {
    let axial = |node: &usize| rom.contact_nodes[*node].position[2];
    let positions: Vec<f64> = nodes.iter().map(axial).collect();
    let order: Vec<usize> = argsort(&positions).into_iter().map(|index| nodes[index]).collect();
    let mut places: Vec<AxialStation> = Vec::new();
    let [Some(first), Some(last)] = [order.first(), order.last()] else { return places };
    let extent = axial(last) - axial(first);
    if extent <= FLAT * rom.contact_nodes[*first].position[0] {
        return places;
    }
    for node in order {
        let own = &rom.contact_nodes[node];
        let ([radius, _, axial], slope) = (own.position, own.meridional_slope);
        match places.last_mut() {
            Some(place) if axial - place.axial <= SAME_PLACE * extent => {
                place.count += 1.0;
                place.radius += (radius - place.radius) / place.count;
                place.slope += (slope - place.slope) / place.count;
            }
            _ => places.push(AxialStation { node, count: 1.0, axial, radius, slope }),
        }
    }
    places
}
