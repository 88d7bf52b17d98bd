//! Scenes that together cover every feature, scheme, solver, gap law and shape.

use tiprub_core::Scene;
use tiprub_core::scene::method::{Scheme, Solver};
use tiprub_core::scene::settings::{
    Closure, InputInterpolation, Interpolation, LoadSettings, Meridian, OutputSettings, PatchSettings, Shape,
    SplineSettings,
};
use tiprub_test_models::{
    coating, disk, flexible,
    lattice::{self, BlockSide},
    rich_blade, rub, several as models, spin,
};

const SECTORS: usize = 12;

/// Returns twelve uncoupled blades in a rigid casing with two bumps.
fn rotor(name: &str, scheme: Scheme, solver: Solver, change: impl Fn(&mut Scene)) -> Scene {
    let mut scene = rub(SECTORS);
    scene.roms[0] = rich_blade(SECTORS);
    scene.settings.name = name.into();
    (scene.settings.time.scheme, scene.settings.contacts[0].solver) = (scheme, solver);
    scene.settings.outputs.nodal_diameters = Some(SECTORS / 2);
    change(&mut scene);
    scene
}

fn spline(scene: &mut Scene) {
    scene.settings.surfaces[0].spline = Some(SplineSettings::default());
}

fn shaft(scene: &mut Scene) {
    let rotor = &mut scene.settings.structures[0];
    (rotor.whirl, rotor.axial_shift) = (true, true);
}

/// Adds the ring with temperatures, a load, and heat shared with the blades.
fn warm(scene: &mut Scene) {
    flexible(scene);
    let ring = &mut scene.settings.structures[1];
    (ring.thermal, ring.load) = (true, Some(LoadSettings { order: 2, amplitude: 100.0, phase: 0.1 }));
    scene.settings.contacts[0].slave_heat_fraction = Some(0.4);
    scene.settings.outputs.slave_displacement = true;
}

fn patches(scene: &mut Scene) {
    scene.settings.surfaces[0].patches = Some(PatchSettings { around: 4, along: 2 });
}

fn mistuned(scene: &mut Scene) {
    let factor = |sector: usize| 1.0 + 0.01 * ((5 * sector % SECTORS) as f64 - 5.0);
    scene.settings.structures[0].frequency_factors = (0..SECTORS).map(factor).collect();
    scene.settings.contacts[0].sector_gaps = (0..SECTORS).map(|sector| 3.56e-4 * factor(sector)).collect();
}

fn spinning(scene: &mut Scene) {
    let order = scene.roms[0].order();
    scene.roms[0].extras.spin = Some(spin(order));
    let spin = &mut scene.settings.structures[0].spin;
    (spin.stiffening, spin.growth, spin.coriolis) = (true, true, true);
}

/// Couples the blades to their neighbours.
fn coupled(scene: &mut Scene) {
    scene.roms[0] = disk::TestDisk::random(SECTORS, 3, 12, 0.1, 7).cyclic();
}

fn sticking(scene: &mut Scene) {
    scene.settings.contacts.iter_mut().for_each(|contact| contact.solver = Solver::Coulomb);
}

/// Makes outputs need the gaps of one blade only, so that blades that certainly stay open can be left out.
fn few_outputs(scene: &mut Scene) {
    scene.settings.outputs = OutputSettings { watched_sectors: vec![1], ..OutputSettings::default() };
}

fn shape(shape: Shape) -> impl Fn(&mut Scene) {
    move |scene| scene.settings.surfaces[0].shape = shape.clone()
}

fn lobes(scene: &mut Scene) {
    shape(Shape::Lobes { amplitude: 4.5e-4, order: 3, phase: 0.2 })(scene);
    scene.settings.surfaces[0].ramp_time = 5e-4;
}

fn table(scene: &mut Scene) {
    let change = |place: i32| -5e-4 * (0.5 * f64::from(place)).sin().powi(2);
    shape(Shape::Table { radius_change: (0..32).map(change).collect() })(scene);
}

/// Combines several changes.
fn all_of(changes: &[fn(&mut Scene)]) -> impl Fn(&mut Scene) {
    let changes = changes.to_vec();
    move |scene| changes.iter().for_each(|change| change(scene))
}

/// Returns blades with adaptive steps.
fn galerkin(name: &str, changes: &[fn(&mut Scene)]) -> Scene {
    let changes = changes.to_vec();
    rotor(name, Scheme::Galerkin, Solver::Lcp, |scene| {
        (scene.settings.time.step, scene.settings.time.tolerance) = (4e-5, Some(1e-3));
        changes.iter().for_each(|change| change(scene));
    })
}

fn rotors() -> Vec<Scene> {
    use Scheme::{CentralDifference, MasslessBoundary, ModalExact};
    use Solver::{Coulomb, Film, Lcp};
    vec![
        rotor("revolution_film", CentralDifference, Film, |_| {}),
        rotor("revolution_lcp_mistuned", CentralDifference, Lcp, mistuned),
        rotor("revolution_coulomb_patches", ModalExact, Coulomb, patches),
        rotor("revolution_no_friction", ModalExact, Lcp, |scene| scene.settings.contacts[0].friction = 0.0),
        rotor("cylinder_massless_lobes", MasslessBoundary, Lcp, |scene| {
            lobes(scene);
            scene.settings.contacts[0].meridian = Meridian::Cylinder;
        }),
        rotor("massless_coulomb_mistuned", MasslessBoundary, Coulomb, mistuned),
        rotor("whirl_table_film", ModalExact, Film, all_of(&[shaft, table])),
        rotor("whirl_held", ModalExact, Lcp, |scene| {
            shaft(scene);
            scene.settings.time.input_interpolation = InputInterpolation::Hold;
        }),
        rotor("spin", ModalExact, Lcp, spinning),
        rotor("spin_whirl_massless", MasslessBoundary, Lcp, |scene| {
            spinning(scene);
            shaft(scene);
            scene.settings.structures[0].spin.coriolis = false;
        }),
        rotor("spline_whirl_film", CentralDifference, Film, all_of(&[spline, shaft])),
        rotor("spline_coulomb", ModalExact, Coulomb, spline),
        rotor("spline_free_ends", ModalExact, Lcp, |scene| {
            let settings = SplineSettings { around: 60, closure: Closure::FreeEnds, ..SplineSettings::default() };
            scene.settings.surfaces[0].spline = Some(settings);
        }),
        rotor("coating_whirl", ModalExact, Lcp, all_of(&[coating, shaft])),
        rotor("flexible_film", CentralDifference, Film, flexible),
        rotor("flexible_warm", ModalExact, Lcp, all_of(&[warm, shaft])),
        rotor("flexible_coulomb", ModalExact, Coulomb, all_of(&[flexible, patches])),
        rotor("flexible_massless", MasslessBoundary, Lcp, flexible),
        rotor("flexible_coating_wear", ModalExact, Lcp, |scene| {
            flexible(scene);
            coating(scene);
            scene.settings.outputs.wear = true;
        }),
        galerkin("galerkin", &[]),
        galerkin("galerkin_steady", &[]),
        galerkin("galerkin_steady_mistuned_lobes", &[mistuned, lobes]),
        galerkin("galerkin_whirl_spline", &[spline, shaft]),
        galerkin("galerkin_mistuned_lobes", &[mistuned, lobes]),
        galerkin("galerkin_strongly_damped", &[|scene| scene.settings.structures[0].damping_ratio = Some(0.9)]),
        galerkin("galerkin_flexible_warm", &[warm, shaft]),
        galerkin("galerkin_flexible_few_outputs", &[flexible, few_outputs]),
        galerkin("galerkin_coupled", &[coupled]),
        galerkin("galerkin_coupled_flexible", &[coupled, flexible, lobes]),
        galerkin("galerkin_coulomb", &[sticking, spline, shaft]),
        galerkin("galerkin_coulomb_coupled_flexible", &[sticking, coupled, flexible]),
        rotor("coupled_lcp", ModalExact, Lcp, coupled),
        rotor("coupled_flexible_film", CentralDifference, Film, all_of(&[coupled, flexible, shaft])),
        rotor("coupled_massless", MasslessBoundary, Lcp, coupled),
        rotor("coupled_spline_coulomb", ModalExact, Coulomb, all_of(&[coupled, spline, mistuned_gaps])),
    ]
}

fn mistuned_gaps(scene: &mut Scene) {
    mistuned(scene);
    scene.settings.structures[0].frequency_factors.clear();
}

/// Returns scenes of a free body between elastic or rigid surfaces.
fn bodies() -> Vec<Scene> {
    let named = |name: &str, mut scene: Scene| {
        scene.settings.name = name.into();
        (scene.settings.outputs.watched_sectors, scene.settings.outputs.energies) = (vec![1], true);
        scene
    };
    let with = |scene, solver, scheme| lattice::with(scene, 0.2, solver, scheme);
    let between = [(BlockSide::Left, 0.0203), (BlockSide::Right, 0.021)];
    let thrown = lattice::scene(lattice::block([0.0; 3], 3e6), &between, false, [-12.0, 6.0, 1.0]);
    let mut rigid = lattice::squeezed_by(1e-4, [0.0, -40.0, 1.0]);
    rigid.settings.surfaces[1].rigid = true;
    let mut facets = lattice::squeezed();
    for surface in &mut facets.settings.surfaces {
        surface.spline = Some(SplineSettings { interpolation: Interpolation::Facets, ..SplineSettings::default() });
    }
    let distance = 0.5 * lattice::SIDE - 3e-4;
    let plates = [(BlockSide::Left, distance), (BlockSide::Right, distance)];
    let faces = lattice::scene(lattice::faces([0.0, 0.045, 0.0]), &plates, true, [0.0, -40.0, 0.0]);
    let mut marched = with(faces, Solver::Lcp, Scheme::Galerkin);
    (marched.settings.time.step, marched.settings.time.tolerance) = (2e-5, Some(1e-3));
    let mut stuck = marched.clone();
    sticking(&mut stuck);
    vec![
        named("body_galerkin_coulomb", stuck),
        named("body_galerkin", marched),
        named("body_film", with(thrown.clone(), Solver::Film, Scheme::CentralDifference)),
        named("body_coulomb", with(thrown, Solver::Coulomb, Scheme::ModalExact)),
        named("body_between_rings", with(lattice::squeezed(), Solver::Lcp, Scheme::ModalExact)),
        named("body_one_side_rigid", with(rigid, Solver::Lcp, Scheme::CentralDifference)),
        named("body_facets", with(facets, Solver::Lcp, Scheme::ModalExact)),
    ]
}

/// Returns scenes of several structures and pairs.
fn several() -> Vec<Scene> {
    let named = |name: &str, mut scene: Scene| {
        scene.settings.name = name.into();
        scene
    };
    let blades = || rub(6);
    vec![
        named("two_rotors_one_casing", models::in_one_casing(blades(), Solver::Lcp, 0.15)),
        named("two_rotors_coulomb", models::in_one_casing(blades(), Solver::Coulomb, 0.15)),
        named("tip_and_seal", models::tip_and_seal(blades(), Solver::Film)),
        named("three_pairs", models::split(&blades())),
    ]
}

/// The built-in scene with `preset = "paper"`.
pub const PRESET: &str = include_str!("../../../src/gallery/scenes/rotor37-paper.toml");

/// Returns the scene of a text with blades of analytic modes, so that no bit depends on a reduction.
#[track_caller]
pub fn around_blades(text: &str) -> Scene {
    let settings = tiprub_format::parse_scene(text, "golden.toml").unwrap_or_else(|error| panic!("{error}"));
    Scene { settings, roms: vec![rich_blade(SECTORS)] }
}

/// Returns all scenes.
pub fn all() -> Vec<Scene> {
    rotors().into_iter().chain(bodies()).chain(several()).chain([around_blades(PRESET)]).collect()
}
