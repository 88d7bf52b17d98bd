//! Closed forms against independent computations.

use nalgebra::{DMatrix, DVector, SymmetricEigen};
use tiprub_model::element::ElementKind;
use tiprub_model::mesh::Element;
use tiprub_model::progress::silent;
use tiprub_model::reduce::full_modes;
use tiprub_model::{FeModel, Material, Mesh};
use tiprub_reference::closed::belt::StickSlipBelt;
use tiprub_reference::closed::bouncing_bar::{self as bar, displacement, pressure};
use tiprub_reference::closed::frequencies::{cantilever, cantilever_root, cyclic_chain, free_ring};
use tiprub_reference::closed::impact::{Hertz, rigid_bounce};
use tiprub_reference::paper::DenseFilm;

#[test]
fn the_bouncing_bar_solves_the_wave_equation_in_every_phase() {
    let (dx, dt) = (0.02, 0.02 / bar::wave_speed());
    for time in [0.4, 1.13, 1.31, 1.6, 2.2, 3.1, 3.75, 4.21, 4.9] {
        for x in [0.7, 3.3, 6.1, 9.2] {
            let second = |a: f64, b: f64, c: f64| a - 2.0 * b + c;
            let here = displacement(x, time);
            let in_time = second(displacement(x, time - dt), here, displacement(x, time + dt)) / (dt * dt);
            let in_space = second(displacement(x - dx, time), here, displacement(x + dx, time)) / (dx * dx);
            let residual = in_time - bar::YOUNG / bar::DENSITY * in_space + bar::GRAVITY;
            // Across a kink of the wave both second differences see the same jump: dt = dx/c.
            assert!(residual.abs() < 0.05, "residual {residual} at x = {x}, t = {time}");
        }
    }
}

#[test]
fn bouncing_bar_conserves_energy_and_is_continuous() {
    for time in [0.5, 1.2, 1.5, 2.0, 3.0, 3.9, 4.2, 5.0] {
        let (dt, dx, mut energy) = (1e-4, 0.025, 0.0);
        for i in 0..400 {
            let x = (f64::from(i) + 0.5) * dx;
            let velocity = (displacement(x, time + dt) - displacement(x, time - dt)) / (2.0 * dt);
            let strain = (displacement(x + 0.5 * dx, time) - displacement(x - 0.5 * dx, time)) / dx;
            energy += dx * (0.5 * bar::DENSITY * velocity * velocity + 0.5 * bar::YOUNG * strain * strain);
            energy += dx * bar::DENSITY * bar::GRAVITY * displacement(x, time);
        }
        assert!((energy / bar::energy() - 1.0).abs() < 2e-3, "energy {energy} at {time}");
    }
    for edge in bar::CONTACTS.into_iter().flatten() {
        for x in [0.0, 2.5, 5.0, 10.0] {
            let jump = displacement(x, edge + 1e-9) - displacement(x, edge - 1e-9);
            assert!(jump.abs() < 1e-3, "jump {jump} at x = {x}, t = {edge}");
        }
    }
    let lowest = (1..2000).map(|i| displacement(0.0, bar::PERIOD * f64::from(i) / 2000.0)).fold(f64::MAX, f64::min);
    assert!(lowest > -1e-3, "the bottom goes {lowest} m into the ground");
}

#[test]
fn contact_impulse_matches_momentum_of_the_bouncing_bar() {
    for [from, to] in bar::CONTACTS {
        let steps = 100_000;
        let dt = (to - from) / f64::from(steps);
        let impulse: f64 = (0..steps).map(|i| pressure(from + (f64::from(i) + 0.5) * dt) * dt).sum();
        // From −v₀ to +v₀, plus the weight during the contact.
        let expected = bar::DENSITY * bar::LENGTH * (20.0 + bar::GRAVITY * (to - from));
        assert!((impulse / expected - 1.0).abs() < 1e-9, "{impulse} N·s/m² instead of {expected}");
    }
}

/// Returns the largest error of the bottom (m) up to the end of the first period with n elements; equations of the
/// paper, Courant number 0.9.
fn bouncing_error(n: usize) -> f64 {
    let size = bar::LENGTH / n as f64;
    let step = 0.9 * size / bar::wave_speed();
    let mut stiffness = DMatrix::zeros(n + 1, n + 1);
    let mut mass = DMatrix::zeros(n + 1, n + 1);
    for e in 0..n {
        for (i, j, sign) in [(0, 0, 1.0), (1, 1, 1.0), (0, 1, -1.0), (1, 0, -1.0)] {
            stiffness[(e + i, e + j)] += sign * bar::YOUNG / size;
        }
        mass[(e, e)] += 0.5 * bar::DENSITY * size;
        mass[(e + 1, e + 1)] += 0.5 * bar::DENSITY * size;
    }
    // Gravity as a moving frame: heights above a free-falling point, so that the ground rises.
    let start = DVector::from_element(n + 1, bar::HEIGHT);
    let mut film = DenseFilm::new(mass, DMatrix::zeros(n + 1, n + 1), stiffness, step, start.clone(), start);
    let normal = DMatrix::from_fn(n + 1, 1, |i, _| if i == 0 { 1.0 } else { 0.0 });
    let (mut worst, mut index) = (0.0_f64, 0);
    while f64::from(index) * step < bar::PERIOD {
        index += 1;
        let time = f64::from(index) * step;
        let fallen = 0.5 * bar::GRAVITY * time * time;
        film.step(&normal, &normal, &DVector::from_element(1, -fallen));
        worst = worst.max((film.now[0] - fallen - displacement(0.0, time)).abs());
    }
    worst
}

#[test]
fn paper_algorithm_converges_to_bouncing_bar_solution() {
    let errors = [25, 50, 100].map(bouncing_error);
    println!("largest error of the bottom with 25, 50, 100 elements: {errors:.3?} m of {} m", bar::HEIGHT);
    assert!(errors[2] < 0.6 * errors[1] && errors[1] < 0.75 * errors[0], "{errors:?}");
    assert!(errors[2] < 0.05 * bar::HEIGHT, "{errors:?}");
}

/// Returns the time, largest depth and force of a mass against a force law, by small steps of velocity Verlet.
fn collide(mass: f64, speed: f64, step: f64, force: impl Fn(f64) -> f64) -> [f64; 3] {
    let (mut depth, mut velocity, mut time) = (0.0, speed, 0.0);
    let (mut deepest, mut strongest) = (0.0_f64, 0.0_f64);
    loop {
        let half = velocity - 0.5 * step * force(depth) / mass;
        depth += step * half;
        velocity = half - 0.5 * step * force(depth) / mass;
        time += step;
        if depth <= 0.0 {
            return [time, deepest, strongest];
        }
        deepest = deepest.max(depth);
        strongest = strongest.max(force(depth));
    }
}

#[test]
fn bounces_of_rigid_bodies_follow_their_force_laws() {
    let bounce = rigid_bounce(0.3, 2e5, 4.0);
    let hertz = Hertz { radius: 0.02, modulus: 1.1e11 };
    let impact = hertz.impact(0.26, 1.5);
    for (closed, found) in [
        (bounce, collide(0.3, 4.0, 1e-8, |depth| 2e5 * depth)),
        (impact, collide(0.26, 1.5, 1e-10, |depth| hertz.force(depth))),
    ] {
        assert!((found[0] / closed.duration - 1.0).abs() < 1e-5, "{found:?} {closed:?}");
        assert!((found[1] / closed.depth - 1.0).abs() < 1e-5, "{found:?} {closed:?}");
        assert!((found[2] / closed.force - 1.0).abs() < 1e-5, "{found:?} {closed:?}");
    }
    // δ = a²/R, and the mean of an ellipsoidal pressure is two thirds of the largest.
    let force = hertz.force(1e-5);
    assert!((hertz.contact_radius(force).powi(2) / hertz.radius / 1e-5 - 1.0).abs() < 1e-12);
    let mean = force / (std::f64::consts::PI * hertz.contact_radius(force).powi(2));
    assert!((hertz.pressure(force) / mean - 1.5).abs() < 1e-12);
}

#[test]
fn the_block_on_the_belt_follows_its_equation_of_motion() {
    let belt = StickSlipBelt { mass: 2.0, stiffness: 5000.0, speed: 0.1, sticking: 120.0, sliding: 80.0 };
    // Sliding starts when the spring force is F_s; velocity Verlet under F_k until the speed of the belt is reached
    // again.
    let (step, mut x, mut v, mut time) = (1e-7, belt.sticking / belt.stiffness, belt.speed, 0.0);
    let force = |x: f64| (belt.sliding - belt.stiffness * x) / belt.mass;
    let (mut low, mut high) = (x, x);
    loop {
        let half = v + 0.5 * step * force(x);
        x += step * half;
        v = half + 0.5 * step * force(x);
        time += step;
        (low, high) = (f64::min(low, x), f64::max(high, x));
        if time > 1e-3 && v >= belt.speed {
            break;
        }
    }
    assert!((time / belt.slide_time() - 1.0).abs() < 1e-5, "{time} s of {}", belt.slide_time());
    assert!((0.5 * (high - low) / belt.amplitude() - 1.0).abs() < 1e-7);
    // From the start of sticking, the belt moves the block back to F_s.
    let stick = (belt.sticking / belt.stiffness - x) / belt.speed;
    assert!((stick / belt.stick_time() - 1.0).abs() < 1e-5, "{stick} s of {}", belt.stick_time());
}

#[test]
fn cantilever_roots_match_finite_element_frequency() {
    for (n, root) in [(1, 1.8751), (2, 4.6941), (3, 7.8548)] {
        assert!((cantilever_root(n) - root).abs() < 5e-5, "root {n}: {}", cantilever_root(n));
    }
    // 60 beam elements with the classical matrices, one end clamped.
    let (elements, length) = (60, 1.0_f64);
    let size = length / elements as f64;
    let order = 2 * elements + 2;
    let (mut k, mut m) = (DMatrix::<f64>::zeros(order, order), DMatrix::<f64>::zeros(order, order));
    let stiff = [[12.0, 6.0, -12.0, 6.0], [6.0, 4.0, -6.0, 2.0], [-12.0, -6.0, 12.0, -6.0], [6.0, 2.0, -6.0, 4.0]];
    let heavy =
        [[156.0, 22.0, 54.0, -13.0], [22.0, 4.0, 13.0, -3.0], [54.0, 13.0, 156.0, -22.0], [-13.0, -3.0, -22.0, 4.0]];
    for e in 0..elements {
        for i in 0..4 {
            for j in 0..4 {
                // Rotations are scaled by the element size, so that all entries have one unit.
                k[(2 * e + i, 2 * e + j)] += stiff[i][j] / size.powi(3);
                m[(2 * e + i, 2 * e + j)] += heavy[i][j] * size / 420.0;
            }
        }
    }
    let (k, m) =
        (k.view((2, 2), (order - 2, order - 2)).into_owned(), m.view((2, 2), (order - 2, order - 2)).into_owned());
    let inverse = m.cholesky().expect("positive definite").l().try_inverse().expect("regular");
    let mut found: Vec<f64> =
        SymmetricEigen::new(&inverse * k * inverse.transpose()).eigenvalues.iter().copied().collect();
    found.sort_by(f64::total_cmp);
    for n in 1..=3_u32 {
        let (omega, closed) = (found[n as usize - 1].sqrt(), cantilever(n, 1.0, 1.0, length));
        assert!((omega / closed - 1.0).abs() < 1e-6, "{omega} instead of {closed}");
    }
}

#[test]
fn frequencies_of_the_cyclic_chain_are_eigenvalues() {
    let (sectors, mass, spring, coupling) = (9_u32, 0.4, 3e4, 1.1e4);
    let count = sectors as usize;
    let mut matrix = DMatrix::<f64>::identity(count, count) * spring;
    for i in 0..count {
        let next = (i + 1) % count;
        matrix[(i, i)] += coupling;
        matrix[(next, next)] += coupling;
        matrix[(i, next)] -= coupling;
        matrix[(next, i)] -= coupling;
    }
    let mut found: Vec<f64> = SymmetricEigen::new(matrix / mass).eigenvalues.iter().map(|x| x.sqrt()).collect();
    found.sort_by(f64::total_cmp);
    let mut closed: Vec<f64> = (0..sectors).map(|n| cyclic_chain(n, sectors, mass, spring, coupling)).collect();
    closed.sort_by(f64::total_cmp);
    for (a, b) in found.iter().zip(&closed) {
        assert!((a / b - 1.0).abs() < 1e-12, "{a} {b}");
    }
}

/// Thin free ring of quadratic bricks; the closed form omits shear and rotary inertia, about (t/R)² of the frequency.
#[test]
fn the_free_ring_has_its_two_wave_frequency() {
    let (radius, thickness, width, arc) = (1.0, 0.02, 0.02, 96_usize);
    let mut mesh = Mesh::default();
    for i in 0..arc {
        let angle = std::f64::consts::TAU * i as f64 / arc as f64;
        for (j, k) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
            let r = radius + thickness * (f64::from(k) - 0.5);
            mesh.nodes.push([r * angle.cos(), r * angle.sin(), width * f64::from(j)]);
        }
    }
    for i in 0..arc {
        let next = (i + 1) % arc;
        let quad = |j: usize| [4 * i + 2 * j, 4 * i + 2 * j + 1, 4 * next + 2 * j + 1, 4 * next + 2 * j];
        mesh.elements.push(Element { kind: ElementKind::Hex8, nodes: [quad(0), quad(1)].concat() });
    }
    let mut mesh = mesh.quadratic();
    // Move mid-arc nodes back onto their circles.
    for node in &mut mesh.nodes {
        let r = node[0].hypot(node[1]);
        let exact = [radius - 0.5 * thickness, radius, radius + 0.5 * thickness]
            .into_iter()
            .min_by(|a, b| (a - r).abs().total_cmp(&(b - r).abs()))
            .expect("three circles");
        *node = [node[0] * exact / r, node[1] * exact / r, node[2]];
    }
    let steel = Material { poisson_ratio: 0.0, ..Material::steel() };
    let model = FeModel::assembled(mesh, &steel, "thin ring".into(), &silent).unwrap();
    let modes = full_modes(&model.stiffness, &model.mass, true, 16, &silent).unwrap().modes;
    let found: Vec<f64> = modes.frequencies().iter().map(|f| std::f64::consts::TAU * f).collect();
    let bending = steel.young_modulus * width * thickness.powi(3) / 12.0;
    let closed = free_ring(2, bending, steel.density * width * thickness, radius);
    assert!((closed / (2.683 * (bending / (steel.density * width * thickness)).sqrt()) - 1.0).abs() < 1e-3);
    let nearest = found.iter().map(|omega| (omega / closed - 1.0).abs()).fold(f64::MAX, f64::min);
    println!("free ring: nearest frequency {nearest:.1e} from the closed form");
    assert!(nearest < 2e-3, "{found:?} have none near {closed}");
}
