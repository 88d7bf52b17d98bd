//! Runs a refined scene, and compares its results with those of the next refinement.

use std::iter::zip;

use nalgebra::DMatrix;
use tiprub_core::scene::rom::ContactNode;
use tiprub_core::{Rom, Scene};

use super::coarsen::{COMMON, common};
use crate::error::{
    measure::parts_apart,
    run::{StepExtremes, TimedRun},
    scene::SceneRun,
};

/// Results of a run that are compared.
#[derive(Debug, Clone, PartialEq)]
pub struct RunSummary {
    /// Displacements of all watched points, sample by sample: point by point, axis by axis, sector by sector (m). Without watched points: those of
    /// the patches that models with other numbers of patches have in common, or of contact nodes, without the rigid motion of free flight.
    pub displacements: Vec<Vec<f64>>,
    /// These points, as the ROM defines them.
    pub points: Vec<ContactNode>,
    /// Normal impulse over the window (N·s).
    pub impulse: f64,
    /// Work of friction over the window (J).
    pub friction_work: f64,
    /// Largest mean of all normal forces over a communication step (N).
    pub peak_force: f64,
    /// Mean strain energy of the communication points (J).
    pub strain_energy: f64,
}

/// Quantities besides the displacements, by name and unit.
pub const QUANTITIES: [(&str, &str); 4] =
    [("impulse", "N·s"), ("friction work", "J"), ("peak force", "N"), ("strain energy", "J")];

impl RunSummary {
    /// Creates a summary that contains only displacements.
    pub(crate) fn of_displacements(points: Vec<ContactNode>, displacements: Vec<Vec<f64>>) -> Self {
        let (impulse, friction_work, peak_force, strain_energy) = (0.0, 0.0, 0.0, 0.0);
        Self { displacements, points, impulse, friction_work, peak_force, strain_energy }
    }

    /// Returns the quantities in the order of [`QUANTITIES`].
    pub fn quantities(&self) -> [f64; 4] {
        [self.impulse, self.friction_work, self.peak_force, self.strain_energy]
    }

    /// Returns the relative changes to the next refinement: of the displacements of common nodes (L2; `None` if there are none), and of every
    /// quantity (`None` if it is zero in both runs).
    pub fn changes(&self, next: &Self) -> [Option<f64>; 5] {
        let mut found = [self.displacement_change(next), None, None, None, None];
        for ((found, own), next) in zip(found.iter_mut().skip(1), self.quantities()).zip(next.quantities()) {
            let scale = own.abs().max(next.abs());
            *found = (scale > 0.0).then(|| (own - next).abs() / scale);
        }
        found
    }

    /// Returns the distance of the displacements of common points from those of another run, relative to these (L2); `None` if there are none.
    pub fn displacement_change(&self, next: &Self) -> Option<f64> {
        let pairs = self.pairs(next);
        if pairs.is_empty() {
            return None;
        }
        let of = |run: &Self, points: &dyn Fn(&(usize, usize)) -> usize| -> Vec<Vec<f64>> {
            let per_point = run.displacements.first().map_or(0, |all| all.len() / run.points.len());
            let chosen = |all: &Vec<f64>| {
                pairs.iter().flat_map(|pair| all[points(pair) * per_point..][..per_point].to_vec()).collect()
            };
            run.displacements.iter().map(chosen).collect()
        };
        let [own, next] = [of(self, &|pair| pair.0), of(next, &|pair| pair.1)];
        let length = own.first().map_or(0, Vec::len);
        Some(parts_apart(&own, &next, &[length]))
    }

    /// Returns the pairs of common points. Equal names are the same point, which another mesh has at nearly the same place; otherwise the position
    /// decides.
    fn pairs(&self, next: &Self) -> Vec<(usize, usize)> {
        if self.points.iter().map(|point| &point.name).eq(next.points.iter().map(|point| &point.name)) {
            return (0..self.points.len()).map(|index| (index, index)).collect();
        }
        let coordinates = next.points.iter().flat_map(|point| point.position);
        let size = coordinates.fold(0.0, |most: f64, value| most.max(value.abs()));
        let same =
            |a: &ContactNode, b: &ContactNode| zip(a.position, b.position).all(|(a, b)| (a - b).abs() <= 1e-9 * size);
        let place = |point: &ContactNode| next.points.iter().position(|other| same(point, other));
        self.points.iter().enumerate().filter_map(|(index, point)| Some((index, place(point)?))).collect()
    }
}

/// Displacements of a run that are compared with those of other runs.
pub(crate) enum Observed {
    /// Watched points.
    Watched,
    /// Common patches, with the map from the patches of the ROM.
    Patches(DMatrix<f64>),
    /// All contact nodes.
    Nodes,
}

impl Observed {
    /// Finds the points of a ROM that are compared.
    pub(crate) fn of(rom: &Rom) -> (Self, Vec<ContactNode>) {
        if let Some(watched) = &rom.extras.watched {
            return (Self::Watched, watched.points.clone());
        }
        match common(&rom.contact_nodes, rom.rows()) {
            Some(map) => {
                let name = |number: usize| format!("patch_{number}_of_{COMMON}");
                let points = (1..=COMMON).map(|number| ContactNode { name: name(number), ..ContactNode::default() });
                (Self::Patches(map), points.collect())
            }
            None => (Self::Nodes, rom.contact_nodes.clone()),
        }
    }

    /// Returns the current displacements (m): point by point, axis by axis, sector by sector.
    pub(crate) fn displacements(&self, run: &SceneRun) -> Vec<f64> {
        match self {
            Self::Watched => run.watched_displacements(),
            Self::Nodes => run.displacements(),
            Self::Patches(map) => {
                let own = run.displacements();
                let per_patch = own.len() / map.ncols();
                let own = DMatrix::from_column_slice(per_patch, map.ncols(), &own);
                (own * map.transpose()).as_slice().to_vec()
            }
        }
    }
}

/// Runs a scene over `samples` communication steps with `division` internal steps each.
///
/// # Errors
/// The scene is rejected or the run fails.
pub fn march(
    scene: &Scene,
    settings: &[(String, String)],
    division: u32,
    samples: usize,
) -> Result<RunSummary, String> {
    let interval = scene.settings.experiment.communication_step;
    let mut run = SceneRun::with_start_values(scene, interval, division, settings)?;
    let (observed, points) = Observed::of(&scene.roms[crate::master(scene)]);
    let mut found = RunSummary::of_displacements(points, Vec::with_capacity(samples));
    let mut seen = StepExtremes::nothing();
    for _ in 0..samples {
        seen.next();
        run.watch(&mut seen)?;
        found.displacements.push(observed.displacements(&run));
        found.impulse += seen.impulse;
        found.peak_force = found.peak_force.max(seen.impulse / interval);
        found.strain_energy += run.strain_energy() / samples as f64;
    }
    found.friction_work = run.friction_work();
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn marched(nodes: &[f64], displacement: f64, impulse: f64) -> RunSummary {
        RunSummary {
            displacements: vec![nodes.iter().flat_map(|node| [displacement * node, 0.0, 0.0]).collect()],
            points: nodes
                .iter()
                .map(|node| ContactNode {
                    name: format!("at_{node}"),
                    position: [1.0, 0.0, *node],
                    ..ContactNode::default()
                })
                .collect(),
            impulse,
            friction_work: 0.0,
            peak_force: 1.0,
            strain_energy: 2.0,
        }
    }

    #[test]
    fn changes_compare_only_common_nodes() {
        let (few, many) = (marched(&[0.1, 0.3], 1.0, 2.0), marched(&[0.1, 0.2, 0.3], 1.25, 1.0));
        let [moved, impulse, friction, peak, strain] = few.changes(&many);
        assert!((moved.unwrap() - 0.2).abs() < 1e-12, "{moved:?}");
        assert_eq!([impulse, friction, peak, strain], [Some(0.5), None, Some(0.0), Some(0.0)]);
        assert_eq!(few.changes(&marched(&[0.5], 1.0, 2.0))[0], None);
        // Another mesh has its nodes at nearly the same places.
        let mut moved = marched(&[0.1, 0.3], 2.0, 2.0);
        moved.points[1].position[2] += 1e-4;
        assert_eq!(few.changes(&moved)[0], Some(0.5));
    }
}
