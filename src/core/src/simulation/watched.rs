//! Clearance of watched points: the gap between a point without contact and the surface that it faces, at communication points.
//!
//! A point faces the surface of the contact node that is nearest to it. Its gap is that of a contact node at its place, at the current
//! displacements. A surface of revolution runs parallel to the tip contour, which is known at the contact nodes: between two of them it is
//! the cubic with their radii and slopes (straight if a ROM has no slopes), beyond them it is straight. For a point off the contour the gap
//! changes by its distance from the contour.

use tiprub_cosim::variables::NO_CLEARANCE;

use crate::geometry::layout::Layout;
use crate::geometry::wrench::At;
use crate::geometry::{GapLaw, RevolutionGap, Vector3};
use crate::scene::rom::{ContactNode, WatchedPoints};
use crate::system::{ContactPair, System};
use crate::{Result, Rom};

use super::Simulation;
use super::compile::Compiled;

/// Distance of a point from the place at which its gap function is evaluated (m, outwards), and the factor of arcs there.
type Raised = (f64, f64);

/// Watched points of a structure that face one surface.
#[derive(Debug, Clone)]
struct WatchedPair {
    body: usize,
    pair: usize,
    /// Indices of these watched points.
    points: Vec<usize>,
    /// Gap function of all watched points of the structure.
    law: GapLaw,
    /// Offsets of the watched points.
    raised: Vec<Raised>,
}

/// Clearances of the watched points of all structures in the watched sectors.
#[derive(Debug, Clone, Default)]
pub(crate) struct WatchedGaps {
    facing: Vec<WatchedPair>,
    /// Watched sectors (0-based).
    sectors: Vec<usize>,
    /// Clearances of each structure (m), `[point · watched sectors + watched sector]`.
    clearances: Vec<Vec<f64>>,
}

impl WatchedGaps {
    /// Creates the clearances at rest, which are not known yet.
    ///
    /// # Errors
    /// Errors of the gap functions.
    pub fn new(compiled: &Compiled) -> Result<Self> {
        let watched = &compiled.scene.settings.outputs.watched_sectors;
        let sectors: Vec<usize> = watched.iter().map(|sector| sector - 1).collect();
        let points = |body| compiled.body(body).1.extras.watched.as_ref().map_or(0, |watched| watched.points.len());
        let bodies = 0..compiled.bodies.len();
        let mut gaps = Self {
            clearances: bodies.map(|body| vec![NO_CLEARANCE; points(body) * sectors.len()]).collect(),
            facing: Vec::new(),
            sectors,
        };
        if gaps.sectors.is_empty() {
            return Ok(gaps);
        }
        for (pair, plan) in compiled.plan.pairs.iter().enumerate() {
            let rom = compiled.body(plan.body).1;
            let Some(watched) = &rom.extras.watched else { continue };
            let nearest = |point: &ContactNode| plan.nodes.contains(&nearest(&rom.contact_nodes, point));
            let points: Vec<usize> =
                (0..watched.points.len()).filter(|index| nearest(&watched.points[*index])).collect();
            if points.is_empty() {
                continue;
            }
            if let Some((law, raised)) = of_points(compiled.gap(pair)?, rom, watched)? {
                gaps.facing.push(WatchedPair { body: plan.body, pair, points, law, raised });
            }
        }
        Ok(gaps)
    }

    /// Returns the clearance of a watched sector (0-based) of a structure (m).
    pub fn clearance(&self, body: usize, point: usize, sector: usize) -> f64 {
        let place = self.sectors.iter().position(|watched| *watched == sector);
        place.map_or(NO_CLEARANCE, |place| self.clearances[body][point * self.sectors.len() + place])
    }

    /// Finds the clearances at the current instant of a simulation.
    fn find(&mut self, simulation: &Simulation) {
        for facing in &mut self.facing {
            let of_rom = simulation.system.structures()[facing.body].modes().sectors();
            let pair = &simulation.system.pairs()[facing.pair];
            facing.follow(&simulation.system, pair);
            for (place, sector) in self.sectors.iter().copied().enumerate().filter(|(_, sector)| *sector < of_rom) {
                for index in 0..facing.points.len() {
                    let (body, point) = (facing.body, facing.points[index]);
                    let moved = [0, 1, 2].map(|axis| simulation.watched_row(body, 3 * point + axis, sector));
                    let gap = facing.gap(pair, (point, sector), moved.into());
                    self.clearances[body][point * self.sectors.len() + place] = gap.min(NO_CLEARANCE);
                }
            }
        }
    }
}

impl WatchedPair {
    /// Moves the surface to its current position.
    fn follow(&mut self, system: &System, pair: &ContactPair) {
        let GapLaw::Spline(law) = &mut self.law else { return };
        let carried = pair.carrier().map_or(&[][..], |carrier| {
            let points = law.surface.control_points().len();
            &system.structures()[carrier.structure].modes().displacement()[carrier.first_row..][..3 * points]
        });
        law.follow(pair.drive_now().shape_factor, carried);
    }

    /// Gap (m) of a point of a sector displaced by `moved` (m).
    fn gap(&mut self, pair: &ContactPair, (point, sector): (usize, usize), moved: Vector3) -> f64 {
        let (drive, lanes) = (pair.drive_now(), self.law.layout().map_or(1, |layout| layout.lanes));
        let (outwards, longer) = self.raised[point];
        let at = At { node: point, index: point * lanes + sector, drive };
        let moved = Vector3::new(moved[0] + outwards, moved[1] / longer, moved[2]);
        match &mut self.law {
            GapLaw::Spline(law) => law.gap_to_current(at, moved).distance,
            law => law.gap(at, moved, None).distance,
        }
    }
}

impl Simulation {
    /// Finds the clearances of watched points at the instant reached.
    pub(super) fn find_watched(&mut self) {
        if self.outputs.watched_gaps.facing.is_empty() {
            return;
        }
        let mut gaps = std::mem::take(&mut self.outputs.watched_gaps);
        gaps.find(self);
        self.outputs.watched_gaps = gaps;
    }
}

/// Returns the gap function of watched points, and their offsets; `None` if there is no surface around an axis.
fn of_points(law: GapLaw, rom: &Rom, watched: &WatchedPoints) -> Result<Option<(GapLaw, Vec<Raised>)>> {
    let mut places: Vec<[f64; 3]> = watched.points.iter().map(|point| point.position).collect();
    let on_contour = |law: &RevolutionGap| -> Vec<(f64, f64)> {
        places.iter().map(|place| contour(&rom.contact_nodes, &law.slopes, &law.nodes, place[2])).collect()
    };
    let around = |places: &[[f64; 3]], layout: &Layout| {
        Layout::of_places(places, rom.sectors, &layout.clearances[..rom.sectors], layout.lanes)
    };
    Ok(match law {
        GapLaw::Revolution(law) => {
            let contour = on_contour(&law);
            let mut raised = Vec::with_capacity(places.len());
            for (place, (radius, _)) in places.iter_mut().zip(&contour) {
                raised.push((place[0] - radius, place[0] / radius));
                place[0] = *radius;
            }
            let layout = around(&places, &law.layout)?;
            let slopes = contour.into_iter().map(|(_, slope)| slope).collect();
            Some((GapLaw::Revolution(law.of_points(layout, slopes)), raised))
        }
        GapLaw::Spline(law) => {
            let layout = around(&places, &law.layout)?;
            Some((GapLaw::Spline(Box::new(law.of_points(layout))), vec![(0.0, 1.0); places.len()]))
        }
        GapLaw::Fixed(_) | GapLaw::Open(_) => None,
    })
}

/// The contact node that is nearest to a point around an axis.
fn nearest(nodes: &[ContactNode], point: &ContactNode) -> usize {
    let off = |node: &ContactNode| {
        let ([r, angle, z], [radius, other, axial]) = (node.position, point.position);
        let chord = 2.0 * libm::sin(0.5 * (angle - other));
        (r - radius) * (r - radius) + r * radius * chord * chord + (z - axial) * (z - axial)
    };
    let all = nodes.iter().map(off).enumerate();
    all.min_by(|a, b| a.1.total_cmp(&b.1)).map_or(0, |(index, _)| index)
}

/// Radius (m) of the tip contour at an axial position (m), from the contact nodes of a pair, and the slope of the surface there; `slopes`
/// are those of the surface at the nodes.
fn contour(nodes: &[ContactNode], slopes: &[f64], members: &[usize], z: f64) -> (f64, f64) {
    let axial = |node: usize| nodes[node].position[2];
    let below = members.iter().copied().filter(|node| axial(*node) <= z).max_by(|a, b| axial(*a).total_cmp(&axial(*b)));
    let above = members.iter().copied().filter(|node| axial(*node) > z).min_by(|a, b| axial(*a).total_cmp(&axial(*b)));
    let (low, high) = match (below, above) {
        (Some(low), Some(high)) => (low, high),
        (Some(one), None) | (None, Some(one)) => (one, one),
        (None, None) => return (1.0, 0.0),
    };
    let ends = [low, high];
    let ([from, to], own) = (ends.map(|node| nodes[node].position[0]), ends.map(|node| nodes[node].meridional_slope));
    let (length, rise) = (axial(high) - axial(low), to - from);
    if length <= 0.0 {
        return (from + own[0] * (z - axial(low)), slopes[low]);
    }
    let t = (z - axial(low)) / length;
    let [first, last] = if own[0] == 0.0 && own[1] == 0.0 { [rise; 2] } else { own.map(|slope| slope * length) };
    let bent = t * (first + t * (3.0 * rise - 2.0 * first - last + t * (first + last - 2.0 * rise)));
    (from + bent, slopes[low] + t * (slopes[high] - slopes[low]))
}
