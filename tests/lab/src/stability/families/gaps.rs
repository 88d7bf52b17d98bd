//! Clearances from nothing to too much, contact nodes at one place, numbers of sectors, amplitudes down to denormals.

use tiprub_core::{
    Result, Scene, Simulation,
    settings::{Scheme, Solver},
};

use super::super::{
    Case, Cases, Check, Expected, Happened,
    models::{GAP, SCHEMES, SOLVERS, Tower, on_ring, round, with_methods, with_step},
    observe::{Watch, begin, real, set},
    press::Press,
};

/// All of them.
pub(crate) fn cases() -> Vec<Case> {
    [clearances(), redundant(), sectors(), whole_casing(), scales()].into_iter().flatten().collect()
}

fn tower_scene(solver: Solver) -> Scene {
    let mut scene = with_methods(round(Tower::default().rom()), Scheme::ModalExact, solver);
    scene.settings.contacts[0].friction = 0.15;
    with_step(scene, 2e-6)
}

fn clearances() -> Vec<Case> {
    let mut cases = Vec::new();
    for (solver, name) in SOLVERS {
        for gap in [1e-6, 1e-12, 1e-30, 1e-300, f64::MIN_POSITIVE, 5e-324, 0.02] {
            let expected = Expected::right("static contact, signs of the ledger");
            let work = move |_: &_| pressed_from(solver, gap);
            let quick = solver == Solver::Lcp;
            cases.push(Case::new(format!("gap/{name}/{gap:e}"), expected, work).quick(quick));
        }
        for (what, gap, words) in [
            ("zero", 0.0, "contact[1].gap"),
            ("negative", -1e-6, "contact[1].gap"),
            ("millimetres-for-metres", 0.356, "metres"),
            ("1e300", 1e300, "contact[1].gap"),
            ("infinite", f64::INFINITY, "contact[1].gap"),
            ("NaN", f64::NAN, "contact[1].gap"),
        ] {
            let work = move |_: &_| pressed_from(solver, gap);
            cases.push(Case::new(format!("gap/{name}/{what}"), Expected::refused([words]), work).quick(true));
        }
        for (what, offset) in
            [("all-just-closed", -GAP), ("all-inside", -1.0001 * GAP), ("all-deep-inside", -10.0 * GAP)]
        {
            let expected = if what == "all-just-closed" {
                Expected::right("no force, no motion")
            } else {
                Expected::refused(["initial clearance", "12 contact nodes"])
            };
            cases.add(true, format!("gap/{name}/{what}"), expected, move || offset_at_start(solver, offset));
        }
        let expected = Expected::refused(["initial clearance", "1 contact nodes", "sector 4"]);
        cases.add(true, format!("gap/{name}/one-blade-inside"), expected, move || one_inside(solver));
    }
    cases
}

fn pressed_from(solver: Solver, gap: f64) -> Happened {
    let mut scene = tower_scene(solver);
    scene.settings.contacts[0].gap = gap;
    Happened::of(Press::new(scene).run())
}

fn offset_at_start(solver: Solver, offset: f64) -> Result<Vec<Check>> {
    let scene = tower_scene(solver);
    let mut simulation = Simulation::new(&scene)?;
    set(&mut simulation, "gap_offset", offset)?;
    simulation.initialise(0.0)?;
    let mut watch = Watch::new(&scene);
    for _ in 0..500 {
        watch.step(&mut simulation, 2e-6)?;
    }
    let energy = real(&simulation, "kinetic_energy") + real(&simulation, "strain_energy");
    Ok([watch.laws(), vec![Check::so("no energy, no impulse", energy == 0.0 && watch.impulse == 0.0)]].concat())
}

fn one_inside(solver: Solver) -> Result<Vec<Check>> {
    let mut scene = tower_scene(solver);
    scene.settings.contacts[0].sector_gaps = (0..12).map(|sector| if sector == 3 { 1e-5 } else { GAP }).collect();
    let mut simulation = Simulation::new(&scene)?;
    set(&mut simulation, "gap_offset", -2e-5)?;
    simulation.initialise(0.0)?;
    Ok(vec![Check::so("it started", true)])
}

fn redundant() -> Vec<Case> {
    let mut cases = Vec::new();
    for copies in [2, 3, 10] {
        for (scheme, scheme_name) in SCHEMES {
            for (solver, solver_name) in SOLVERS {
                for friction in [0.0, 0.15, 0.5] {
                    let against = "static contact (sum over coincident nodes), signs of the ledger";
                    let expected = if scheme == Scheme::MasslessBoundary {
                        Expected::either(against, ["massless-boundary"])
                    } else {
                        Expected::right(against)
                    };
                    let work = move |_: &_| {
                        let tower = Tower { sectors: 4, copies, ..Tower::default() };
                        let mut scene = with_methods(round(tower.rom()), scheme, solver);
                        scene.settings.contacts[0].friction = friction;
                        Happened::of(Press::new(with_step(scene, 2e-6)).run())
                    };
                    let name = format!("redundant/{copies}-nodes/{scheme_name}/{solver_name}/µ={friction}");
                    let quick = scheme == Scheme::ModalExact && friction > 0.0;
                    cases.push(Case::new(name, expected, work).quick(quick));
                }
            }
        }
    }
    cases
}

fn sectors() -> Vec<Case> {
    let mut cases = Vec::new();
    for count in [1, 2, 3, 5, 8, 9, 36, 200] {
        for (solver, name) in SOLVERS {
            for neighbour in [0.0, 1e6] {
                // One sector has no neighbours.
                if count == 1 && neighbour > 0.0 {
                    continue;
                }
                let work = move |_: &_| {
                    let tower = Tower { sectors: count, neighbour, ..Tower::default() };
                    let mut scene = with_methods(round(tower.rom()), Scheme::ModalExact, solver);
                    scene.settings.contacts[0].friction = 0.15;
                    // Coupled contact of 200 sectors is dense.
                    let step = if neighbour > 0.0 && count > 100 { 2e-5 } else { 2e-6 };
                    Happened::of(Press::new(with_step(scene, step)).run())
                };
                let kind = if neighbour > 0.0 { "coupled" } else { "uncoupled" };
                let expected = Expected::right("static contact, all sectors alike, no resultant");
                let quick = count < 5 || (count == 200 && neighbour == 0.0 && solver == Solver::Lcp);
                cases.push(
                    Case::new(format!("sectors/{count}/{kind}/{name}"), expected, work).quick(quick).within(600.0),
                );
            }
        }
    }
    for (solver, name) in SOLVERS {
        let expected = Expected::right("no force on it, the others bit by bit as without");
        cases.add(true, format!("sectors/one-blade-missing/{name}"), expected, move || missing(solver));
    }
    cases
}

/// A blade that is missing is one far from the casing; uncoupled sectors do not feel it.
fn missing(solver: Solver) -> Result<Vec<Check>> {
    let run = |gaps: Vec<f64>| -> Result<Vec<f64>> {
        let mut scene = tower_scene(solver);
        scene.settings.contacts[0].sector_gaps = gaps;
        let mut simulation = Simulation::new(&scene)?;
        simulation.initialise(0.0)?;
        let mut forces = Vec::new();
        for index in 0..2000 {
            let share = (f64::from(index) / 1000.0).min(1.0);
            set(&mut simulation, "casing_radius_change", -(GAP + 5e-5) * share * share * (3.0 - 2.0 * share))?;
            simulation.do_step(simulation.time(), 2e-6)?;
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
            "the other blades as without, bit by bit",
            others.clone().all(|(_, (a, b))| a.to_bits() == b.to_bits()),
        ),
        Check::so("they touch", others.into_iter().any(|(_, (a, _))| *a > 0.0)),
    ])
}

/// A cubic through 36 points of the circle is off it by at most R (2π/36)⁴/384 (m).
const ROUNDNESS: f64 = 6.1e-7;

fn whole_casing() -> Vec<Case> {
    let mut cases = Vec::new();
    for (solver, solver_name) in SOLVERS {
        for (scheme, scheme_name) in SCHEMES {
            for friction in [0.0, 0.15] {
                for (surface, flexible) in [("rigid", false), ("ring", true)] {
                    let expected = Expected::right("forces of blades and casing in equilibrium, all alike, 36 nodes");
                    let quick = solver == Solver::Lcp && scheme == Scheme::ModalExact;
                    let name = format!("whole-casing/{surface}/{scheme_name}/{solver_name}/µ={friction}");
                    cases.push(
                        Case::new(name, expected, move |_: &_| {
                            Happened::of(closed_long(scheme, solver, friction, flexible))
                        })
                        .quick(quick)
                        .within(300.0),
                    );
                }
            }
        }
    }
    cases
}

/// All nodes of all blades closed for long. Twelve blades on a ring of 36 nodes are alike, so that the ring answers with its
/// two round modes alone: its flexibility per blade is 12 (0.5)²/ω² at the node's place along the axis.
fn closed_long(scheme: Scheme, solver: Solver, friction: f64, flexible: bool) -> Result<Vec<Check>> {
    let tower = Tower { slope: 0.0, ..Tower::default() };
    let mut scene = with_methods(round(tower.rom()), scheme, solver);
    scene.settings.contacts[0].friction = friction;
    scene.settings.structures[0].damping_ratio = Some(0.3);
    if flexible {
        on_ring(&mut scene, 0.3);
        // A spline through 36 points of a circle ripples by 0.1 µm, which fast blades feel.
        scene.settings.structures[0].speed = 10.0;
    }
    let step = 2e-6;
    let scene = with_step(scene, step);
    let (mut simulation, mut watch) = begin(&scene)?;
    let depth = 5e-5;
    for index in 0..15_000 {
        let share = (f64::from(index) / 2000.0).min(1.0);
        set(&mut simulation, "casing_radius_change", -(GAP + depth) * share * share * (3.0 - 2.0 * share))?;
        watch.step(&mut simulation, step)?;
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
    let mut checks = watch.books_of(scheme);
    if solver != Solver::Film {
        checks.extend(watch.complementarity());
    }
    checks.push(Check::at_most("λ from the static solution", off, if flexible { ROUNDNESS / depth } else { 1e-6 }));
    let turning = forces.iter().fold(0.0, |most: f64, force| most.max((force / forces[0] - 1.0).abs()));
    checks.push(Check::at_most("blades differ", turning, if flexible { ROUNDNESS / depth } else { 0.0 }));
    checks.push(Check::so("all 12 nodes in contact", system.events().len() == 12));
    Ok(checks)
}

fn scales() -> Vec<Case> {
    let mut cases = Vec::new();
    for exponent in [-20, -60, -100, -200, -300, -400, -450, -500, -700, -900, -1000, -1060] {
        for (solver, name) in SOLVERS {
            for friction in [0.0, 0.15] {
                let expected = Expected::right("every λ scaled by the same power of two; time per step");
                let case = format!("tiny/2^{exponent}/{name}/µ={friction}");
                cases.add(solver == Solver::Lcp && (exponent % 100 == 0), case, expected, move || {
                    scaled(exponent, solver, friction)
                });
            }
        }
    }
    cases
}

/// Round contact without inertia of sliding is homogeneous: lengths times 2ⁿ give forces times 2ⁿ, in floating point bit by
/// bit until numbers leave the normal range.
fn scaled(exponent: i32, solver: Solver, friction: f64) -> Result<Vec<Check>> {
    let (plain, calm) = small_rub(0, solver, friction)?;
    let (small, time) = small_rub(exponent, solver, friction)?;
    let scale = power_of_two(exponent);
    let largest = plain.iter().fold(0.0, |most: f64, force| most.max(*force));
    let off = plain.iter().zip(&small).fold(0.0, |most: f64, (a, b)| {
        // Divided in two parts: the inverse of the scale may not exist.
        let back = b / power_of_two(exponent / 2) / (scale / power_of_two(exponent / 2));
        most.max((back - a).abs() / largest)
    });
    // Below 1e-150 modes are flushed to rest every 512 steps: what is left are forces of the size of the scaled ones.
    let (bound, most) = if exponent > -440 { (1e-12, 1.0 + 1e-12) } else { (f64::INFINITY, 10.0) };
    let negative = small.iter().fold(0.0, |most: f64, force| most.max(-force));
    Ok(vec![
        Check::so("they touch", largest > 0.0),
        Check::at_most("scaled λ differ by", off, bound),
        Check::so("no adhesion, all finite", negative == 0.0 && small.iter().all(|force| force.is_finite())),
        Check::at_most(
            "largest λ beyond the scaled one",
            small.iter().fold(0.0, |a: f64, b| a.max(*b)) / largest / scale.max(1e-290),
            most,
        ),
        Check::at_most("time per step against normal numbers", time / calm.max(LEAST_TIME), 8.0),
    ])
}

/// The clock of processor time ticks: less than this per step (s) it cannot tell.
const LEAST_TIME: f64 = 5e-7;

/// 2ⁿ, denormals included.
fn power_of_two(exponent: i32) -> f64 {
    let half = 2_f64.powi(exponent / 2);
    half * 2_f64.powi(exponent - exponent / 2)
}

/// λ of a casing that swings into blades, all lengths times 2ⁿ, and processor time per step (s).
fn small_rub(exponent: i32, solver: Solver, friction: f64) -> Result<(Vec<f64>, f64)> {
    let scale = power_of_two(exponent);
    // Without coupling of radius and circumference the sense of sliding does not change.
    let tower = Tower { slope: 0.0, ..Tower::default() };
    let mut scene = with_methods(round(tower.rom()), Scheme::ModalExact, solver);
    scene.settings.contacts[0].friction = friction;
    scene.settings.contacts[0].gap = GAP * scale;
    scene.settings.outputs.all_sectors = false;
    let scene = with_step(scene, 2e-6);
    let mut simulation = Simulation::new(&scene)?;
    simulation.initialise(0.0)?;
    let mut forces = Vec::new();
    let clock = processor_time();
    for index in 0..4000 {
        let swing = 0.5 - 0.5 * (f64::from(index) * 5e-3).cos();
        set(&mut simulation, "casing_radius_change", -1.1 * GAP * swing * scale)?;
        simulation.do_step(simulation.time(), 2e-6)?;
        forces.extend((0..12).map(|sector| simulation.system().multiplier(0, sector)));
    }
    Ok((forces, (processor_time() - clock) / 4000.0))
}

/// Processor time of this process's only working thread (s), as the system counts it; 0 where it does not tell.
pub(crate) fn processor_time() -> f64 {
    let told = std::fs::read_to_string("/proc/self/schedstat").unwrap_or_default();
    told.split_whitespace()
        .next()
        .and_then(|text| text.parse::<f64>().ok())
        .map_or(0.0, |nanoseconds| 1e-9 * nanoseconds)
}
