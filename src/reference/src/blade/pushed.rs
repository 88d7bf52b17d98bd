//! Static load on the leading side of the tip of the rotor 37 blade, for a comparison of stress with CalculiX.

use tiprub_model::rotor37::{MeshCounts, blade_mesh};
use tiprub_model::{Material, Mesh, Result, Rotor37Options};

use super::{FullBlade, Gauge, calculix};

/// Force on the first of nine patches in the first of two rows (N): inwards, back along the circumference, along the axis.
const FORCE: [f64; 3] = [-1000.0, -150.0, 0.0];

/// Places where its six lowest modes have their largest stress, as
/// `tiprub reduce rotor37 --mesh 12x2x20 --contact-rows 2` finds them: nodes from 0.
const PLACES: [usize; 6] = [1494, 2742, 1062, 490, 2762, 386];

/// Blade with its load.
#[derive(Debug, Clone)]
pub struct PushedBlade {
    mesh: Mesh,
    material: Material,
    full: FullBlade,
    /// Node, force along x, y, z (N).
    forces: Vec<(usize, [f64; 3])>,
}

impl PushedBlade {
    /// Creates the blade with 12 × 2 × 20 bricks, clamped at the hub.
    ///
    /// # Errors
    /// None for this mesh.
    pub fn new() -> Result<Self> {
        let blade = blade_mesh(MeshCounts { chord: 12, thickness: 2, span: 20 })?;
        let material = Rotor37Options::default().material;
        let full = FullBlade::new(&blade.mesh, &material, blade.mesh.set("hub")?)?;
        let patches = blade.contact_rows([9, 2])?;
        let forces = patches[0].weights().map(|(node, weight)| {
            let [x, y, _] = blade.mesh.nodes[node];
            let (sine, cosine) = y.atan2(x).sin_cos();
            let [radial, along, axial] = FORCE;
            let force = [radial * cosine - along * sine, radial * sine + along * cosine, axial];
            (node, force.map(|one| weight * one))
        });
        Ok(Self { forces: forces.collect(), mesh: blade.mesh, material, full })
    }

    /// Returns the places of the stress by name.
    pub fn places() -> impl Iterator<Item = (String, usize)> {
        PLACES.into_iter().enumerate().map(|(mode, node)| (format!("mode_{}", mode + 1), node))
    }

    /// Returns the displacements of the places along x, y, z (m) and the stress there along radius, circumference,
    /// axis (Pa).
    ///
    /// # Errors
    /// None for this mesh.
    pub fn unit_stresses(&self) -> Result<Vec<([f64; 3], [f64; 6])>> {
        let moved = self.full.moved(&self.forces)?;
        let at = |node: usize| {
            let gauge = Gauge::at(&self.mesh, &self.material, node)?;
            Ok((moved[node], gauge.read(|node| moved[node])))
        };
        PLACES.into_iter().map(at).collect()
    }

    /// Rotates stress along x, y, z to radius, circumference, axis at a place.
    pub fn turned(&self, node: usize, [xx, yy, zz, xy, yz, zx]: [f64; 6]) -> [f64; 6] {
        let [x, y, _] = self.mesh.nodes[node];
        let (s, c) = y.atan2(x).sin_cos();
        [
            c * c * xx + s * s * yy + 2.0 * s * c * xy,
            s * s * xx + c * c * yy - 2.0 * s * c * xy,
            zz,
            s * c * (yy - xx) + (c * c - s * s) * xy,
            c * yz - s * zx,
            c * zx + s * yz,
        ]
    }

    /// Returns the input files: the loaded blade, and the same displacements imposed on it.
    ///
    /// # Errors
    /// None for this mesh.
    pub fn inputs(&self) -> Result<[String; 2]> {
        let moved = self.full.moved(&self.forces)?;
        Ok([
            calculix::pushed(&self.mesh, &self.material, "hub", &self.forces)?,
            calculix::moved(&self.mesh, &self.material, &moved, self.far())?,
        ])
    }

    /// Returns the node farthest from all places.
    fn far(&self) -> usize {
        let away = |node: &[f64; 3]| {
            let to = |place: usize| (0..3).map(|i| (node[i] - self.mesh.nodes[place][i]).powi(2)).sum::<f64>();
            PLACES.into_iter().map(to).fold(f64::INFINITY, f64::min)
        };
        let all = self.mesh.nodes.iter().enumerate();
        all.max_by(|a, b| away(a.1).total_cmp(&away(b.1))).map_or(0, |(node, _)| node)
    }
}
