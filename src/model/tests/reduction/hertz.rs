//! Hertz contact of a rigid sphere with an elastic half-space: a quarter of a large block, reduced to the nodes of
//! its surface and solved by the contact solvers of the core, statically and in an impact.

use crate::guide::print_row;
use nalgebra::DMatrix;
use tiprub_core::Rom;
use tiprub_core::geometry::{FixedGap, GapLaw, PrescribedMotion, Vector3};
use tiprub_core::modes::modal::ModalModel;
use tiprub_core::scene::method::{Scheme, Solver};
use tiprub_core::system::SystemSettings;
use tiprub_core::time::{Recurrence, Stepper};
use tiprub_model::assembly::assemble_with;
use tiprub_model::craig_bampton::craig_bampton;
use tiprub_model::element::{ElementKind, Formulation};
use tiprub_model::mesh::Element;
use tiprub_model::progress::silent;
use tiprub_model::sparse::principal_pair;
use tiprub_model::{Material, Mesh};
use tiprub_reference::closed::impact::Hertz;
use tiprub_test_models::{node, single_sector, structure};

/// Contact radius in the computation (m); below, the radius of the sphere.
const CONTACT: f64 = 1e-3;
const RADIUS: f64 = 0.05;
const APPROACH: f64 = CONTACT * CONTACT / RADIUS;
/// Distance within which surface nodes may touch, as a multiple of the contact radius.
const REACH: f64 = 1.3;
/// Width and depth of the block in contact radii; its clamped faces increase its stiffness by about 0.95/L of the
/// force.
const EXTENT: f64 = 400.0;

fn material() -> Material {
    Material { name: "steel".into(), young_modulus: 210e9, poisson_ratio: 0.3, density: 7800.0, expansion: 0.0 }
}

fn hertz() -> Hertz {
    let Material { young_modulus, poisson_ratio, .. } = material();
    Hertz { radius: RADIUS, modulus: young_modulus / (1.0 - poisson_ratio * poisson_ratio) }
}

/// Returns equal elements of `size` up to `fine`, then elements growing by a `factor` up to exactly `length`.
fn graded(size: f64, fine: f64, factor: f64, length: f64) -> Vec<f64> {
    let mut places = vec![0.0];
    while places[places.len() - 1] < fine - 0.5 * size {
        places.push(size * places.len() as f64);
    }
    let (start, mut next, mut rest) = (places.len(), size, Vec::new());
    let mut reached = places[start - 1];
    while reached < length {
        next *= factor;
        reached += next;
        rest.push(reached);
    }
    let (from, over) = (places[start - 1], rest[rest.len() - 1]);
    places.extend(rest.iter().map(|place| from + (place - from) * (length - from) / (over - from)));
    places
}

struct HertzBlock {
    rom: Rom,
    /// Distance of every contact node from the axis (m).
    distance: Vec<f64>,
    /// Surface area of every contact node (m²), in the quarter.
    area: Vec<f64>,
    elements: usize,
}

/// Creates a quarter of a block x, y ≤ L, −L ≤ z ≤ 0 with symmetry at x = 0 and y = 0, clamped outside; `per_radius`
/// elements per contact radius. Refinement is uniform: with twice as many elements, the growth factor is its square
/// root.
fn block(per_radius: usize) -> HertzBlock {
    let (size, factor) = (CONTACT / per_radius as f64, (1.17 / per_radius as f64).exp());
    let side = graded(size, REACH * CONTACT, factor, EXTENT * CONTACT);
    let depth = graded(size, CONTACT, factor, EXTENT * CONTACT);
    let (nx, nz) = (side.len(), depth.len());
    let number = |i: usize, j: usize, k: usize| i + nx * (j + nx * k);
    let mut mesh = Mesh::default();
    for k in 0..nz {
        for j in 0..nx {
            mesh.nodes.extend((0..nx).map(|i| [side[i], side[j], -depth[nz - 1 - k]]));
        }
    }
    for k in 0..nz - 1 {
        for j in 0..nx - 1 {
            for i in 0..nx - 1 {
                let corner = [(0, 0), (1, 0), (1, 1), (0, 1)];
                let nodes = (0..8).map(|c| number(i + corner[c % 4].0, j + corner[c % 4].1, k + c / 4)).collect();
                mesh.elements.push(Element { kind: ElementKind::Hex8, nodes });
            }
        }
    }
    let elements = mesh.elements.len();
    let assembled = assemble_with(&mesh, &material(), Formulation::Displacement, &silent).unwrap();
    let held = |dof: usize| {
        let (node, axis) = (dof / 3, dof % 3);
        let [i, j, k] = [node % nx, node / nx % nx, node / (nx * nx)];
        i == nx - 1 || j == nx - 1 || k == 0 || (axis == 0 && i == 0) || (axis == 1 && j == 0)
    };
    let free: Vec<usize> = (0..3 * mesh.nodes.len()).filter(|dof| !held(*dof)).collect();
    let (stiffness, mass) = principal_pair(&assembled.stiffness, &assembled.mass, &free);
    let places = || (0..nx).flat_map(|j| (0..nx).map(move |i| [i, j]));
    let touching: Vec<[usize; 2]> = places().filter(|[i, j]| side[*i].hypot(side[*j]) < REACH * CONTACT).collect();
    let interface: Vec<usize> =
        touching.iter().map(|[i, j]| free.partition_point(|dof| *dof < 3 * number(*i, *j, nz - 1) + 2)).collect();
    let reduced = craig_bampton(&stiffness, &mass, &interface, 4, &silent).unwrap();
    let share = |i: usize| if i == 0 { 0.5 * size } else { size };
    HertzBlock {
        distance: touching.iter().map(|[i, j]| side[*i].hypot(side[*j])).collect(),
        area: touching.iter().map(|[i, j]| share(*i) * share(*j)).collect(),
        elements,
        rom: rom("block", reduced.mass, reduced.stiffness, touching.len()),
    }
}

/// Creates a ROM whose first `nodes` coordinates are the displacements of the contact nodes along z.
fn rom(name: &str, mass: DMatrix<f64>, stiffness: DMatrix<f64>, nodes: usize) -> Rom {
    let along_z = |row: usize, column: usize| if row % 3 == 2 && row / 3 == column { 1.0 } else { 0.0 };
    let map = DMatrix::from_fn(3 * nodes, mass.nrows(), along_z);
    let nodes = (0..nodes).map(|i| node(format!("{name}_{i}"), [0.0; 3], 0.0)).collect();
    structure(name, mass, stiffness, map, nodes)
}

/// Returns the gap of a paraboloid r²/2R, as in Hertz's theory, closer by `approach` than touching; the sphere is
/// above the block.
fn law(block: &HertzBlock, approach: f64) -> GapLaw {
    GapLaw::Fixed(FixedGap {
        normals: vec![-Vector3::z(); block.distance.len()],
        gaps: block.distance.iter().map(|r| r * r / (2.0 * RADIUS) - approach).collect(),
        sliding: vec![Vector3::zeros(); block.distance.len()],
    })
}

struct AtRest {
    force: f64,
    /// From the second moment of the pressure, ∫pr²dA = 2Fa²/5, and the farthest node in contact (m).
    radius: [f64; 2],
    /// Largest pressure relative to Hertz's, and relative L2 error of the profile within 0.9 a for the computed
    /// force.
    pressure: [f64; 2],
    /// Largest penetration and negative force.
    violation: [f64; 2],
}

/// Computes the equilibrium under strong damping with the sphere held at `approach` (m).
fn at_rest(block: &HertzBlock, model: &ModalModel, solver: Solver, approach: f64) -> AtRest {
    let settings = SystemSettings { scheme: Scheme::ModalExact, solver, ledger: true };
    let mut system = single_sector(model, law(block, approach), 0.0, settings);
    system.set_step(0.5 / model.frequencies[0]);
    system.start(&[PrescribedMotion::default()]);
    for _ in 0..200 {
        Recurrence.step(&mut system, &[PrescribedMotion::default()]).unwrap();
    }
    let nodes = block.distance.len();
    let forces: Vec<f64> = (0..nodes).map(|node| system.multiplier(node, 0)).collect();
    let force = 4.0 * forces.iter().sum::<f64>();
    let moment: f64 = 4.0 * forces.iter().zip(&block.distance).map(|(f, r)| f * r * r).sum::<f64>();
    let touching = (0..nodes).filter(|node| forces[*node] > 0.0);
    let farthest = touching.map(|node| block.distance[node]).fold(0.0, f64::max);
    let theory = hertz();
    let (mut error, mut size) = (0.0, 0.0);
    for node in (0..nodes).filter(|node| block.distance[*node] < 0.9 * theory.contact_radius(force)) {
        let exact = theory.pressure_at(force, block.distance[node]);
        error += block.area[node] * (forces[node] / block.area[node] - exact).powi(2);
        size += block.area[node] * exact * exact;
    }
    let least = forces.iter().fold(0.0, |least: f64, force| least.min(*force));
    let deepest = (0..nodes).map(|node| system.gap(node, 0)).fold(0.0, f64::min);
    AtRest {
        force,
        radius: [(2.5 * moment / force).sqrt(), farthest],
        pressure: [forces[0] / block.area[0] / theory.pressure(force), (error / size).sqrt()],
        violation: [-deepest / approach, -least / force],
    }
}

/// Returns the errors of the force, of the contact radius and of the pressure profile, root mean square over
/// approaches that put the edge of the contact at every position within an element.
fn refine(per_radius: usize) -> ([f64; 3], String) {
    let (theory, block) = (hertz(), block(per_radius));
    let model = ModalModel::from_rom(&block.rom, 0.8).unwrap();
    let (count, mut squares, mut middle) = (12, [0.0; 3], 0.0);
    for index in 0..count {
        let radius = CONTACT * (0.75 + 0.25 * f64::from(index + 1) / f64::from(count));
        let approach = radius * radius / RADIUS;
        let found = at_rest(&block, &model, Solver::Lcp, approach);
        assert!(found.violation.iter().all(|size| *size <= 0.0), "{:?}", found.violation);
        // The farthest node in contact is within one diagonal of an element.
        let edge = (found.radius[1] - radius).abs() * per_radius as f64 / CONTACT;
        assert!(edge < 1.5, "edge {edge} elements off");
        let errors = [found.force / theory.force(approach) - 1.0, found.radius[0] / radius - 1.0, found.pressure[1]];
        squares = [0, 1, 2].map(|i| squares[i] + errors[i] * errors[i] / f64::from(count));
        if index + 1 == count {
            middle = found.pressure[0];
            for solver in [Solver::Coulomb, Solver::Film] {
                let other = at_rest(&block, &model, solver, approach);
                let off = other.force / theory.force(approach) - 1.0;
                let [deep, negative] = other.violation;
                print_row!(
                    "| {per_radius}, δ = 20 µm | {} | {solver:?} | {off:+.2e} | {:+.2e} | {:.2e} | {:.4} | penetration {deep:.0e} δ, adhesion {negative:.0e} F |",
                    block.elements,
                    other.radius[0] / radius - 1.0,
                    other.pressure[1],
                    other.pressure[0]
                );
                assert!(solver == Solver::Film || (other.force / found.force - 1.0).abs() < 1e-9, "{solver:?}");
            }
            print_row!(
                "| {per_radius}, δ = 20 µm | {} | Lcp | {:+.2e} | {:+.2e} | {:.2e} | {:.4} | |",
                block.elements,
                errors[0],
                errors[1],
                errors[2],
                found.pressure[0]
            );
        }
    }
    let means = squares.map(f64::sqrt);
    let [force, radius, pressure] = means.map(|mean| 100.0 * mean);
    (
        means,
        format!("| {per_radius} | {} | {force:.2} % | {radius:.1} % | {pressure:.1} % | {middle:.3} |", block.elements),
    )
}

fn table(meshes: &[usize]) -> Vec<[f64; 3]> {
    print_row!("| elements per radius | elements | solver | force | contact radius | pressure, L2 | p(0)/p0 | |");
    print_row!("|---|---|---|---|---|---|---|---|");
    let found = meshes.iter().map(|per_radius| refine(*per_radius));
    let (errors, rows): (Vec<[f64; 3]>, Vec<String>) = found.unzip();
    rows.iter().for_each(|row| print_row!("{row}"));
    errors
}

#[test]
fn pressed_sphere_on_block_matches_hertz() {
    let errors = table(&[2, 3, 4]);
    let [force, radius, pressure] = [0, 1, 2].map(|i| errors[0][i] / errors[2][i]);
    // At least first order in the element size.
    assert!(force > 1.8 && radius > 1.8 && pressure > 1.8, "{errors:?}");
    assert!(errors[2][0] < 0.005 && errors[2][1] < 0.02 && errors[2][2] < 0.04, "{errors:?}");
    crate::guide::hold("cargo test -p tiprub-model --test reduction pressed");
}

/// A heavy sphere with a slow impact: the block responds quasi-statically, as Hertz's impact theory assumes.
#[test]
fn sphere_impact_on_block_matches_hertz() {
    print_row!(
        "| scheme | h (µs) | duration | largest force | deepest | impulse | energy left in the sphere | ledger |"
    );
    print_row!("|---|---|---|---|---|---|---|---|");
    let (theory, block) = (hertz(), block(3));
    // Waves cross the block in 0.07 ms; the impact takes 20 ms.
    let duration = 20e-3;
    let speed = 2.943_275 * APPROACH / duration;
    let mass = 16.0 / 15.0 * theory.modulus * RADIUS.sqrt() * APPROACH.powf(2.5) / (speed * speed);
    let exact = theory.impact(mass, speed);
    assert!((exact.duration / duration - 1.0).abs() < 1e-9);
    // A quarter of the sphere belongs to a quarter of the block.
    let sphere = rom("sphere", DMatrix::from_element(1, 1, 0.25 * mass), DMatrix::zeros(1, 1), 1);
    let parts = [&block.rom, &sphere].map(|rom| ModalModel::from_rom(rom, 0.0).unwrap());
    let nodes = block.distance.len();
    let pairs: Vec<_> = (0..nodes).map(|node| [node, 0]).collect();
    let model = tiprub_test_models::relative(&parts[0], &parts[1], &pairs);
    let last = model.len() - 1;
    for scheme in [Scheme::ModalExact] {
        let step = duration / 4000.0;
        let settings = SystemSettings { scheme, solver: Solver::Lcp, ledger: true };
        let mut system = single_sector(&model, law(&block, 0.0), 0.0, settings);
        system.set_step(step);
        // The sphere moves down with its lowest point on the surface at time 0.
        system.bank_mut().set_modal_state(last, 0, 0.0, -speed * (0.25 * mass).sqrt());
        system.start(&[PrescribedMotion::default()]);
        let (mut release, mut force, mut deepest, mut impulse) = (0.0, 0.0_f64, 0.0_f64, 0.0);
        while (system.steps() as f64) * step < 1.2 * duration {
            Recurrence.step(&mut system, &[PrescribedMotion::default()]).unwrap();
            let now: f64 = 4.0 * (0..nodes).map(|node| system.multiplier(node, 0)).sum::<f64>();
            if now > 0.0 {
                release = system.steps() as f64 * step;
            }
            force = force.max(now);
            impulse += now * step;
            deepest = deepest.max(-system.bank().modal_state(last, 0).0 / (0.25 * mass).sqrt());
        }
        system.close_ledger();
        let (kinetic, strain) = system.energies();
        let ledger = system.ledger().residual(kinetic + strain) / system.ledger().initial;
        let left = (system.bank().modal_state(last, 0).1 / step).powi(2) / (0.25 * mass * speed * speed);
        let off = [release / exact.duration, force / exact.force, deepest / exact.depth, impulse / exact.impulse, left]
            .map(|value| value - 1.0);
        print_row!(
            "| {scheme:?} | {:.0} | {:+.2e} | {:+.2e} | {:+.2e} | {:+.2e} | {:+.2e} | {ledger:.0e} |",
            step * 1e6,
            off[0],
            off[1],
            off[2],
            off[3],
            off[4]
        );
        let bounds = [3e-3, 1.2e-2, 5e-3, 1e-4, 1e-3];
        assert!(off.iter().zip(bounds).all(|(off, bound)| off.abs() < bound) && ledger.abs() < 1e-12, "{off:?}");
    }
}
