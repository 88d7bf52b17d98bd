//! Clearances from zero to too large, coincident contact nodes, numbers of sectors, amplitudes down to denormals.

use tiprub_core::scene::method::Solver;
use tiprub_core::{CoSimulation, Result, Scene, Simulation};
use tiprub_study::error::clock;

use super::super::{
    CaseEnd, Cases, Check, Expected, StabilityCase,
    models::{GAP, LONGEST, StabilityMethod, Tower, allowed, on_ring, round, with_step},
    observe::{StabilityWatch, begin, real, set, steps},
    press::Press,
};

/// Returns all cases of this family.
pub(crate) fn cases() -> Vec<StabilityCase> {
    [clearances(), redundant(), sectors(), whole_casing(), scales()].into_iter().flatten().collect()
}

fn tower_scene(method: StabilityMethod) -> Scene {
    let mut scene = method.stepping(round(Tower::default().rom()), 2e-6);
    scene.settings.contacts[0].friction = 0.15;
    scene
}

fn clearances() -> Vec<StabilityCase> {
    let mut cases = Vec::new();
    for method in StabilityMethod::common() {
        let (lcp, name) = (method.solver == Solver::Lcp, method.name());
        for gap in [1e-6, 1e-12, 1e-30, 1e-300, f64::MIN_POSITIVE, 5e-324, 0.02] {
            let against = "static contact, signs of the energy terms";
            // The tolerance is a fraction of the clearance, and far below the rounding of displacements. The solver may then find no solution.
            let expected = if method.is_galerkin() && method.solver == Solver::Coulomb && gap < 1e-11 {
                Expected::either(against, ["the contact problem", "no solution"])
            } else if method.solver == Solver::Film && gap < 1e-18 {
                // Rounding alone moves nodes into the casing by more than such a clearance, and film then reports penetration.
                Expected::either(against, ["film has left contact node", "Use solver"])
            } else {
                Expected::right(against)
            };
            let work = move |_: &_| pressed_from(method, gap);
            cases.push(StabilityCase::new(format!("gap/{name}/{gap:e}"), expected, work).quick(lcp));
        }
        for (what, gap, words) in [
            ("zero", 0.0, "contact[1].gap"),
            ("negative", -1e-6, "contact[1].gap"),
            ("millimetres-for-metres", 0.356, "metres"),
            ("1e300", 1e300, "contact[1].gap"),
            ("infinite", f64::INFINITY, "contact[1].gap"),
            ("NaN", f64::NAN, "contact[1].gap"),
        ] {
            let work = move |_: &_| pressed_from(method, gap);
            let rule: &[&str] = if method.is_galerkin() { &["galerkin", "clearance above 0"] } else { &[] };
            let expected = Expected::refused_as(&[&[words], rule]);
            cases.push(StabilityCase::new(format!("gap/{name}/{what}"), expected, work).quick(lcp));
        }
        for (what, offset) in
            [("all-just-closed", -GAP), ("all-inside", -1.0001 * GAP), ("all-deep-inside", -10.0 * GAP)]
        {
            let expected = if what == "all-just-closed" {
                Expected::right("no force, no motion")
            } else {
                Expected::refused(["initial clearance", "12 contact nodes"])
            };
            cases.add(lcp, format!("gap/{name}/{what}"), expected, move || offset_at_start(method, offset));
        }
        let expected = Expected::refused(["initial clearance", "1 contact nodes", "sector 4"]);
        cases.add(lcp, format!("gap/{name}/one-blade-inside"), expected, move || one_inside(method));
    }
    cases
}

fn pressed_from(method: StabilityMethod, gap: f64) -> CaseEnd {
    let mut scene = tower_scene(method);
    if method.is_galerkin() && gap < 1e-20 {
        // The tolerance is far below the rounding of displacements, so steps in contact are halved to the shortest length, 1/4096 of the longest
        // step. With a longest step of 2 µs, twelve blades would take 2.5e7 steps per millisecond.
        scene = with_step(scene, LONGEST);
    }
    scene.settings.contacts[0].gap = gap;
    CaseEnd::of(Press::new(scene).run())
}

fn offset_at_start(method: StabilityMethod, offset: f64) -> Result<Vec<Check>> {
    let scene = tower_scene(method);
    let mut simulation = Simulation::new(&scene)?;
    set(&mut simulation, "gap_offset", offset)?;
    simulation.initialise(0.0)?;
    let mut watch = StabilityWatch::new(&scene);
    for _ in 0..500 {
        watch.step(&mut simulation, scene.settings.experiment.communication_step)?;
    }
    let energy = real(&simulation, "kinetic_energy") + real(&simulation, "strain_energy");
    Ok([watch.laws(), vec![Check::so("no energy, no impulse", energy == 0.0 && watch.impulse == 0.0)]].concat())
}

fn one_inside(method: StabilityMethod) -> Result<Vec<Check>> {
    let mut scene = tower_scene(method);
    scene.settings.contacts[0].sector_gaps = (0..12).map(|sector| if sector == 3 { 1e-5 } else { GAP }).collect();
    let mut simulation = Simulation::new(&scene)?;
    set(&mut simulation, "gap_offset", -2e-5)?;
    simulation.initialise(0.0)?;
    Ok(vec![Check::so("the simulation started", true)])
}

fn redundant() -> Vec<StabilityCase> {
    let mut cases = Vec::new();
    for copies in [2, 3, 10] {
        for method in StabilityMethod::all() {
            for friction in [0.0, 0.15, 0.5] {
                let against = "static contact (sum over coincident nodes), signs of the energy terms";
                let expected = if method.is_massless() {
                    Expected::either(against, ["massless-boundary"])
                } else if method.is_galerkin() {
                    // Six modes.
                    Expected::refused(["galerkin", "more than three modes per contact node"])
                } else {
                    Expected::right(against)
                };
                let work = move |_: &_| {
                    let tower = Tower { sectors: 4, copies, ..Tower::default() };
                    let mut scene = method.stepping(round(tower.rom()), 2e-6);
                    scene.settings.contacts[0].friction = friction;
                    CaseEnd::of(Press::new(scene).run())
                };
                let name = format!("redundant/{copies}-nodes/{}/µ={friction}", method.name());
                let quick = !method.is_massless() && method.solver == Solver::Lcp && friction > 0.0;
                cases.push(StabilityCase::new(name, expected, work).quick(quick));
            }
        }
    }
    cases
}

fn sectors() -> Vec<StabilityCase> {
    let mut cases = Vec::new();
    for count in [1, 2, 3, 5, 8, 9, 36, 200] {
        for method in StabilityMethod::common() {
            for neighbour in [0.0, 1e6] {
                // One sector has no neighbours.
                if count == 1 && neighbour > 0.0 {
                    continue;
                }
                let work = move |_: &_| {
                    let tower = Tower { sectors: count, neighbour, ..Tower::default() };
                    // Coupled contact of 200 sectors is dense.
                    let step = if neighbour > 0.0 && count > 100 { 2e-5 } else { 2e-6 };
                    let mut scene = method.stepping(round(tower.rom()), step);
                    scene.settings.contacts[0].friction = 0.15;
                    CaseEnd::of(Press::new(scene).run())
                };
                let kind = if neighbour > 0.0 { "coupled" } else { "uncoupled" };
                let expected = Expected::right("static contact, equal in all sectors, no resultant force");
                let lcp = method.solver == Solver::Lcp;
                let quick = lcp && count < 5 || (count == 200 && neighbour == 0.0 && lcp && method.is_adaptive());
                let name = format!("sectors/{count}/{kind}/{}", method.name());
                cases.push(StabilityCase::new(name, expected, work).quick(quick).within(600.0));
            }
        }
    }
    for method in StabilityMethod::common() {
        let expected =
            Expected::right("no force on the missing blade, the others bitwise equal to the run with all blades");
        let name = format!("sectors/one-blade-missing/{}", method.name());
        cases.add(method.solver == Solver::Lcp, name, expected, move || missing(method));
    }
    cases
}

/// Compares a missing blade with one far from the casing; uncoupled sectors are not affected.
fn missing(method: StabilityMethod) -> Result<Vec<Check>> {
    let run = |gaps: Vec<f64>| -> Result<Vec<f64>> {
        let mut scene = tower_scene(method);
        scene.settings.contacts[0].sector_gaps = gaps;
        let length = scene.settings.experiment.communication_step;
        let mut simulation = Simulation::new(&scene)?;
        simulation.initialise(0.0)?;
        let mut forces = Vec::new();
        for index in 0..steps(4e-3, length) {
            let share = (f64::from(index) * length / 2e-3).min(1.0);
            set(&mut simulation, "casing_radius_change", -(GAP + 5e-5) * share * share * (3.0 - 2.0 * share))?;
            simulation.do_step(simulation.time(), length)?;
            forces.extend((0..12).map(|sector| simulation.system().multiplier(0, sector)));
        }
        Ok(forces)
    };
    let whole = run(vec![GAP; 12])?;
    let gone = run((0..12).map(|sector| if sector == 5 { 0.025 } else { GAP }).collect())?;
    let others = whole.iter().zip(&gone).enumerate().filter(|(index, _)| index % 12 != 5);
    Ok(vec![
        Check::so("no force on the missing blade", gone.iter().skip(5).step_by(12).all(|force| *force == 0.0)),
        Check::so(
            "the other blades are bitwise equal to the run with all blades",
            others.clone().all(|(_, (a, b))| a.to_bits() == b.to_bits()),
        ),
        Check::so("there is contact", others.into_iter().any(|(_, (a, _))| *a > 0.0)),
    ])
}

/// Largest deviation of a cubic through 36 points of the circle, R (2π/36)⁴/384 (m).
const ROUNDNESS: f64 = 6.1e-7;

fn whole_casing() -> Vec<StabilityCase> {
    let mut cases = Vec::new();
    for method in StabilityMethod::all() {
        for friction in [0.0, 0.15] {
            for (surface, flexible) in [("rigid", false), ("ring", true)] {
                let expected = Expected::right("forces of blades and casing in equilibrium, all equal, 36 nodes");
                let lcp = method.solver == Solver::Lcp && friction > 0.0;
                let quick = lcp && method.is_adaptive();
                let name = format!("whole-casing/{surface}/{}/µ={friction}", method.name());
                let work = move |_: &_| CaseEnd::of(closed_long(method, friction, flexible));
                cases.push(StabilityCase::new(name, expected, work).quick(quick).within(300.0));
            }
        }
    }
    cases
}

/// Compares permanently closed contact of all nodes of all blades. Twelve blades on a ring of 36 nodes are equal, so
/// that only the two round modes of the ring respond: its flexibility per blade is 12 (0.5)²/ω² at the axial position
/// of the node.
fn closed_long(method: StabilityMethod, friction: f64, flexible: bool) -> Result<Vec<Check>> {
    let tower = Tower { slope: 0.0, ..Tower::default() };
    let mut scene = method.stepping(round(tower.rom()), 2e-6);
    scene.settings.contacts[0].friction = friction;
    scene.settings.structures[0].damping_ratio = Some(0.3);
    if flexible {
        on_ring(&mut scene, 0.3);
        // A spline through 36 points of a circle has ripples of 0.1 µm, which affect fast blades.
        scene.settings.structures[0].speed = 10.0;
    }
    let length = scene.settings.experiment.communication_step;
    let (mut simulation, mut watch) = begin(&scene)?;
    let depth = 5e-5;
    for index in 0..steps(30e-3, length) {
        let share = (f64::from(index) * length / 4e-3).min(1.0);
        set(&mut simulation, "casing_radius_change", -(GAP + depth) * share * share * (3.0 - 2.0 * share))?;
        watch.step(&mut simulation, length)?;
    }
    let blade = 1.0 / tower.base[0] + 1.0 / tower.tip;
    let omega = |tilt: f64| std::f64::consts::TAU * 9000.0 * (1.0 + 0.6 * tilt);
    // At z = 0 the tilting mode moves by 0.5·(0 − 0.015)/0.035.
    let seen = |tilt: f64| if tilt > 0.0 { 0.5 * 0.015 / 0.035 } else { 0.5 };
    let ring = [0.0, 1.0].map(|tilt| 12.0 * (seen(tilt) / omega(tilt)).powi(2));
    let exact = depth / (blade + if flexible { ring[0] + ring[1] } else { 0.0 });
    let system = simulation.system();
    let forces: Vec<f64> = (0..12).map(|sector| system.multiplier(0, sector)).collect();
    let off = forces.iter().fold(0.0, |most: f64, force| most.max((force / exact - 1.0).abs()));
    let mut checks = watch.books_of(method.scheme);
    if method.solver != Solver::Film {
        checks.extend(watch.complementarity());
    }
    // Galerkin closes gaps to a fraction of its tolerance.
    let near = 1e-3 * allowed(&scene) / depth;
    let static_bound = near + if flexible { ROUNDNESS / depth } else { 1e-6 };
    checks.push(Check::at_most("deviation of λ from the static solution", off, static_bound));
    let turning = forces.iter().fold(0.0, |most: f64, force| most.max((force / forces[0] - 1.0).abs()));
    checks.push(Check::at_most(
        "difference between blades",
        turning,
        near + if flexible { ROUNDNESS / depth } else { 0.0 },
    ));
    checks.push(Check::so("all 12 nodes in contact", system.events().len() == 12));
    Ok(checks)
}

fn scales() -> Vec<StabilityCase> {
    let mut cases = Vec::new();
    for exponent in [-20, -60, -100, -200, -300, -400, -450, -500, -700, -900, -1000, -1060] {
        for method in StabilityMethod::common() {
            for friction in [0.0, 0.15] {
                let against = "every λ scaled by the same power of two; time per step";
                // The tolerance of such lengths is close to the smallest numbers.
                let expected = if method.is_galerkin() && method.solver == Solver::Coulomb && exponent < -600 {
                    Expected::either(against, ["the contact problem", "no solution"])
                } else {
                    Expected::right(against)
                };
                let case = format!("tiny/2^{exponent}/{}/µ={friction}", method.name());
                let quick = method.solver == Solver::Lcp && exponent % 200 == 0 && friction > 0.0;
                cases.add(quick, case, expected, move || scaled(exponent, method, friction));
            }
        }
    }
    cases
}

/// Compares scaled scenes: round contact without inertia of sliding is homogeneous, so that lengths times 2ⁿ give
/// forces times 2ⁿ, in floating point bit by bit until numbers leave the normal range.
fn scaled(exponent: i32, method: StabilityMethod, friction: f64) -> Result<Vec<Check>> {
    // The fastest of a few short runs, because other processes disturb single ones.
    let fastest = |exponent| -> Result<(Vec<f64>, f64)> {
        let (forces, mut time) = small_rub(exponent, method, friction)?;
        for _ in 1..REPEATS {
            time = small_rub(exponent, method, friction)?.1.min(time);
        }
        Ok((forces, time))
    };
    let (plain, calm) = fastest(0)?;
    let (small, time) = fastest(exponent)?;
    let scale = power_of_two(exponent);
    let largest = plain.iter().fold(0.0, |most: f64, force| most.max(*force));
    let off = plain.iter().zip(&small).fold(0.0, |most: f64, (a, b)| {
        // Divided in two parts, because the inverse of the scale may not exist.
        let back = b / power_of_two(exponent / 2) / (scale / power_of_two(exponent / 2));
        most.max((back - a).abs() / largest)
    });
    // Below 1e-150 modes are flushed to rest every 512 steps: the remaining forces have the size of the scaled ones.
    let (bound, most) = if exponent > -440 { (1e-12, 1.0 + 1e-12) } else { (f64::INFINITY, 10.0) };
    let negative = small.iter().fold(0.0, |most: f64, force| most.max(-force));
    Ok(vec![
        Check::so("there is contact", largest > 0.0),
        Check::at_most("difference of the scaled λ", off, bound),
        Check::so("no adhesion, all values finite", negative == 0.0 && small.iter().all(|force| force.is_finite())),
        Check::at_most(
            "excess of the largest λ over the scaled one",
            small.iter().fold(0.0, |a: f64, b| a.max(*b)) / largest / scale.max(1e-290),
            most,
        ),
        Check::at_most("time per step relative to normal numbers", time / calm.max(LEAST_TIME), 8.0),
    ])
}

/// Number of runs of which the fastest is timed.
const REPEATS: usize = 3;
/// Shortest time per step that is compared (s).
const LEAST_TIME: f64 = 5e-7;

/// Returns 2ⁿ, including denormals.
fn power_of_two(exponent: i32) -> f64 {
    let half = 2_f64.powi(exponent / 2);
    half * 2_f64.powi(exponent - exponent / 2)
}

/// Returns λ of a casing that oscillates into blades, all lengths times 2ⁿ, and processor time per step (s).
fn small_rub(exponent: i32, method: StabilityMethod, friction: f64) -> Result<(Vec<f64>, f64)> {
    let scale = power_of_two(exponent);
    // Without coupling of radius and circumference the direction of sliding does not change.
    let tower = Tower { slope: 0.0, ..Tower::default() };
    let mut scene = method.stepping(round(tower.rom()), 2e-6);
    scene.settings.contacts[0].friction = friction;
    scene.settings.contacts[0].gap = GAP * scale;
    scene.settings.outputs.all_sectors = false;
    let length = scene.settings.experiment.communication_step;
    let count = steps(8e-3, length);
    let mut simulation = Simulation::new(&scene)?;
    simulation.initialise(0.0)?;
    let mut forces = Vec::new();
    let before = clock::now();
    for index in 0..count {
        let swing = 0.5 - 0.5 * (f64::from(index) * length * 2.5e3).cos();
        set(&mut simulation, "casing_radius_change", -1.1 * GAP * swing * scale)?;
        simulation.do_step(simulation.time(), length)?;
        forces.extend((0..12).map(|sector| simulation.system().multiplier(0, sector)));
    }
    Ok((forces, (clock::now() - before).as_secs_f64() / f64::from(count)))
}
