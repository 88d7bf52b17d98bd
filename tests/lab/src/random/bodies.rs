//! Free bodies thrown randomly among plates.

use tiprub_core::Rom;
use tiprub_core::scene::method::{Scheme, Solver};
use tiprub_core::scene::settings::{Interpolation, SceneSettings, SplineSettings};
use tiprub_test_models::{SeededRandom, lattice};

use super::structures::chance;
use crate::stability::bodies::{HALF, LumpChain, Plate, Throw};
use crate::stability::models::StabilityMethod;

/// Returns settings, structures, and a length (m) that scales displacements.
pub(crate) fn scene(random: &mut SeededRandom, scheme: Scheme, solver: Solver) -> (SceneSettings, Vec<Rom>, f64) {
    let friction = random.of(&[0.0, 0.1, 0.3, 0.8]);
    // Contact nodes on its faces alone preserve modes with inertia, which galerkin needs; the model is large and
    // therefore rare.
    let mut scene = if scheme == Scheme::Galerkin && chance(random, 0.3) {
        let plates = [(lattice::BlockSide::Left, HALF + 5e-5), (lattice::BlockSide::Right, HALF + 1e-4)];
        let faces = lattice::faces([0.0; 3]);
        let mut scene =
            lattice::with(lattice::scene(faces, &plates, false, random.vector(8.0)), friction, solver, scheme);
        for surface in &mut scene.settings.surfaces {
            surface.rigid = chance(random, 0.7);
        }
        scene
    } else {
        throw(random, scheme, solver, friction).scene()
    };
    for surface in &mut scene.settings.surfaces {
        if chance(random, 0.2) {
            let interpolation = random.of(&[Interpolation::Spline, Interpolation::Facets]);
            surface.spline = Some(SplineSettings { interpolation, ..SplineSettings::default() });
        }
    }
    for structure in &mut scene.settings.structures {
        structure.damping_ratio = chance(random, 0.4).then(|| random.scale(1e-4, 0.05));
    }
    (scene.settings, scene.roms, 1e-4)
}

fn throw(random: &mut SeededRandom, scheme: Scheme, solver: Solver, friction: f64) -> Throw {
    let lumps = 1 + random.below(3);
    let masses: Vec<f64> = (0..lumps).map(|_| random.scale(0.02, 1.0)).collect();
    let body =
        if lumps == 1 { LumpChain::rigid(masses[0]) } else { LumpChain::elastic(&masses, random.scale(1e6, 1e8)) };
    let radius = random.of(&[0.0, 0.0, 0.3]);
    let mut plate = |side: f64| Plate {
        side,
        distance: HALF + random.scale(1e-5, 3e-4),
        radius,
        stiffness: random.of(&[0.0, 1e6, 1e7]),
    };
    let plates = match plate(-1.0) {
        left if left.stiffness > 5e6 => vec![left],
        left => vec![left, plate(1.0)],
    };
    let method = StabilityMethod { scheme, ..StabilityMethod::exact(solver) };
    Throw { body, velocity: random.vector(6.0), plates, friction, method, step: 1e-6 }
}
