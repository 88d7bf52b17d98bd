//! One run of a refined scene: what is reported, and how far it is from that of the next refinement.

use std::iter::zip;

use tiprub_core::Scene;

use crate::error::{
    measure::parts_apart,
    run::{Run, Seen},
    scene::SceneRun,
};

/// What a run leaves behind.
#[derive(Debug, Clone, PartialEq)]
pub struct Marched {
    /// Displacements of all watched points, or contact nodes without flight where there are none, of all sectors, sample by sample: node
    /// by node, axis by axis, sector by sector (m).
    pub displacements: Vec<Vec<f64>>,
    /// Positions of these, as the ROM has them.
    pub nodes: Vec<[f64; 3]>,
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

impl Marched {
    /// In the order of [`QUANTITIES`].
    pub fn quantities(&self) -> [f64; 4] {
        [self.impulse, self.friction_work, self.peak_force, self.strain_energy]
    }

    /// Relative change to the next refinement: of the displacements of the nodes that both have (L2; `None` where there are none), and
    /// of every quantity; `None` of one that is zero in both.
    pub fn changes(&self, next: &Self) -> [Option<f64>; 5] {
        let mut found = [self.displacement_change(next), None, None, None, None];
        for ((found, own), next) in zip(found.iter_mut().skip(1), self.quantities()).zip(next.quantities()) {
            let scale = own.abs().max(next.abs());
            *found = (scale > 0.0).then(|| (own - next).abs() / scale);
        }
        found
    }

    fn displacement_change(&self, next: &Self) -> Option<f64> {
        let size = next.nodes.iter().flatten().fold(0.0, |most: f64, value| most.max(value.abs()));
        let same = |a: &[f64; 3], b: &[f64; 3]| zip(a, b).all(|(a, b)| (a - b).abs() <= 1e-9 * size);
        let place = |node: &[f64; 3]| next.nodes.iter().position(|other| same(node, other));
        let pairs: Vec<(usize, usize)> =
            self.nodes.iter().enumerate().filter_map(|(index, node)| Some((index, place(node)?))).collect();
        if pairs.is_empty() {
            return None;
        }
        let of = |run: &Self, nodes: &dyn Fn(&(usize, usize)) -> usize| -> Vec<Vec<f64>> {
            let per_node = run.displacements.first().map_or(0, |all| all.len() / run.nodes.len());
            let chosen = |all: &Vec<f64>| {
                pairs.iter().flat_map(|pair| all[nodes(pair) * per_node..][..per_node].to_vec()).collect()
            };
            run.displacements.iter().map(chosen).collect()
        };
        let [own, next] = [of(self, &|pair| pair.0), of(next, &|pair| pair.1)];
        let length = own.first().map_or(0, Vec::len);
        Some(parts_apart(&own, &next, &[length]))
    }
}

/// March a scene over `samples` communication steps with `division` internal steps each.
///
/// # Errors
/// Why it is refused or fails.
pub fn march(scene: &Scene, settings: &[(String, String)], division: u32, samples: usize) -> Result<Marched, String> {
    let interval = scene.settings.experiment.communication_step;
    let mut run = SceneRun::with_start_values(scene, interval, division, settings)?;
    let rom = &scene.roms[crate::master(scene)];
    // Patches of another number are elsewhere; what is watched stays.
    let points = rom.extras.watched.as_ref().map_or(&rom.contact_nodes, |watched| &watched.points);
    let mut found = Marched {
        displacements: Vec::with_capacity(samples),
        nodes: points.iter().map(|point| point.position).collect(),
        impulse: 0.0,
        friction_work: 0.0,
        peak_force: 0.0,
        strain_energy: 0.0,
    };
    let mut seen = Seen::nothing();
    for _ in 0..samples {
        seen.next();
        run.watch(&mut seen)?;
        found.displacements.push(match rom.extras.watched {
            Some(_) => run.watched_displacements(),
            None => run.displacements(),
        });
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

    fn marched(nodes: &[f64], displacement: f64, impulse: f64) -> Marched {
        Marched {
            displacements: vec![nodes.iter().flat_map(|node| [displacement * node, 0.0, 0.0]).collect()],
            nodes: nodes.iter().map(|node| [1.0, 0.0, *node]).collect(),
            impulse,
            friction_work: 0.0,
            peak_force: 1.0,
            strain_energy: 2.0,
        }
    }

    #[test]
    fn changes_are_those_of_the_nodes_that_both_have() {
        let (few, many) = (marched(&[0.1, 0.3], 1.0, 2.0), marched(&[0.1, 0.2, 0.3], 1.25, 1.0));
        let [moved, impulse, friction, peak, strain] = few.changes(&many);
        assert!((moved.unwrap() - 0.2).abs() < 1e-12, "{moved:?}");
        assert_eq!([impulse, friction, peak, strain], [Some(0.5), None, Some(0.0), Some(0.0)]);
        assert_eq!(few.changes(&marched(&[0.5], 1.0, 2.0))[0], None);
    }
}
