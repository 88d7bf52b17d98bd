//! Friction from none to 2 with every solver in both senses; speeds at rest, tiny, reversed, jumping.

use tiprub_core::{
    Result,
    settings::{Scheme, Shape, Solver},
};

use super::super::{
    Case, Cases, Check, Expected, Happened,
    models::{GAP, RADIUS, SCHEMES, SOLVERS, Tower, blade, bumps, round, with_methods, with_step},
    observe::{Watch, apart, begin, displacements, real, set},
    press::{Press, pressed},
};

const COEFFICIENTS: [f64; 6] = [0.0, 0.15, 0.5, 1.0, 1.5, 2.0];

/// All of them.
pub(crate) fn cases() -> Vec<Case> {
    coefficients().into_iter().chain(speeds()).collect()
}

/// Angle of the principal axes at which the flexibility couples radius and circumference.
const TURNED: f64 = 0.45;

/// −w_rr/w_rθ of the turned tower: beyond it W = w_rr + µ w_rθ is negative where tips slide along +θ, and never where they
/// slide along −θ.
fn turned_limit() -> f64 {
    let tower = Tower { turned: TURNED, slope: 0.0, ..Tower::default() };
    let (sine, cosine) = TURNED.sin_cos();
    let [a, b] = [1.0 / tower.base[0], 1.0 / tower.base[1]];
    let across = a * cosine * cosine + b * sine * sine + 1.0 / tower.tip;
    across / ((b - a) * sine * cosine)
}

fn coefficients() -> Vec<Case> {
    let mut cases = Vec::new();
    for friction in COEFFICIENTS {
        for (solver, solver_name) in SOLVERS {
            for (scheme, scheme_name) in SCHEMES {
                for sense in [1.0, -1.0] {
                    for model in ["straight", "turned"] {
                        let sign = if sense > 0.0 { "+" } else { "−" };
                        let name = format!("friction/{model}/µ={friction}/{solver_name}/{scheme_name}/{sign}Ω");
                        let against = "static sliding contact, torque, signs of the ledger";
                        let expected = if model == "straight" {
                            Expected::right(against)
                        } else {
                            Expected::either(against, ["µ"])
                        };
                        let quick = scheme == Scheme::ModalExact && sense > 0.0;
                        let work = move |_: &_| sliding(model, friction, solver, scheme, sense);
                        cases.push(Case::new(name, expected, work).quick(quick));
                    }
                }
            }
        }
    }
    cases
}

fn sliding(model: &str, friction: f64, solver: Solver, scheme: Scheme, sense: f64) -> Happened {
    let turned = if model == "turned" { TURNED } else { 0.0 };
    let tower = Tower { turned, slope: 0.0, ..Tower::default() };
    let mut scene = with_methods(round(tower.rom()), scheme, solver);
    scene.settings.contacts[0].friction = friction;
    scene.settings.structures[0].speed = 1300.0 * sense;
    let outcome = Press::new(with_step(scene, 1e-6)).run();
    match outcome {
        Ok(mut checks) => {
            if model == "turned" {
                let limit = turned_limit();
                let text = format!("along −θ, or µ below −w_rr/w_rθ = {limit:.3}: there W > 0");
                checks.push(Check::so(text, sense < 0.0 || friction < limit));
            }
            Happened::answer(checks)
        }
        Err(error) => {
            // A refusal is right where W loses its sign statically, or where the scheme or the contact grows.
            let message = error.to_string();
            let lost = sense > 0.0 && friction >= 0.99 * turned_limit();
            let text = format!("statically lost at µ = {:.3}, or growth is named", turned_limit());
            let checks = vec![Check::so(text, lost || message.contains("grows") || message.contains("film"))];
            Happened { checks, ..Happened::refused(message) }
        }
    }
}

fn speeds() -> Vec<Case> {
    let mut cases = Vec::new();
    for (solver, name) in SOLVERS {
        for speed in [1e-300, 1e-200, 1e-100, 1e-12, 1e-3, 1.0, 1e4, 1e6, 1e100, 1e200, 1e300, 1.7e308] {
            for sense in [1.0, -1.0] {
                let expected = if speed > 1e5 {
                    Expected::either("static contact, friction −µλ", ["speed"])
                } else {
                    slow(
                        solver,
                        speed,
                        "static normal forces, friction at most µλ, against the slip where tips slide; else a warning",
                    )
                };
                let case = format!("speed/steady/{name}/{:e}", sense * speed);
                cases.add(solver == Solver::Lcp && sense > 0.0, case, expected, move || steady(solver, sense * speed));
            }
        }
        let zero =
            slow(solver, 0.0, "static normal forces, friction at most µλ; with film and lcp a warning of sticking");
        cases.add(true, format!("speed/steady/{name}/0"), zero, move || steady(solver, 0.0));
        for (course, text) in [("reversal", "torque of either sense, −µΣλr"), ("jump", "torque unchanged, −µΣλr")]
        {
            cases.add(true, format!("speed/{course}/{name}"), Expected::right(text), move || changing(solver, course));
        }
        for course in ["reversal", "jump", "ramp", "stop"] {
            let expected = Expected::right("the same with a fourth of the step");
            cases.add(solver == Solver::Lcp, format!("speed/bumps/{course}/{name}"), expected, move || {
                on_bumps(solver, course)
            });
        }
    }
    cases
}

/// Where tips stick, a law that only slides may end the run because its friction puts energy in.
fn slow(solver: Solver, speed: f64, against: &str) -> Expected {
    if solver == Solver::Coulomb || speed.abs() >= 1.0 {
        return Expected::right(against);
    }
    Expected::either(against, ["friction has put", "no sticking"])
}

/// A pressed round casing at one speed. The normal forces do not know of it; friction is at most µλ.
fn steady(solver: Solver, speed: f64) -> Result<Vec<Check>> {
    let tower = Tower { slope: 0.0, ..Tower::default() };
    let mut scene = with_step(with_methods(round(tower.rom()), Scheme::ModalExact, solver), 2e-6);
    scene.settings.contacts[0].friction = 0.15;
    scene.settings.structures[0].speed = speed;
    scene.settings.structures[0].damping_ratio = Some(0.3);
    let (mut simulation, mut watch) = begin(&scene)?;
    for index in 0..6000 {
        let share = (f64::from(index) / 2000.0).min(1.0);
        set(&mut simulation, "casing_radius_change", -(GAP + 5e-5) * share * share * (3.0 - 2.0 * share))?;
        watch.step(&mut simulation, 2e-6)?;
    }
    let exact = pressed(&scene.roms[0], 0.0, 5e-5).multipliers[0];
    let system = simulation.system();
    let mut checks = watch.complementarity();
    checks.push(watch.ledger());
    checks.push(Check::so("all outputs finite", watch.finite));
    // Film and lcp know sliding only: the work of their friction means nothing where tips stick, and the start must say so.
    if solver != Solver::Coulomb && speed.abs() < 1.0 {
        let told = simulation.warnings().iter().any(|text| text.contains("sticking"));
        checks.push(Check::so("a warning that sticking is not modelled", told));
    } else {
        checks.push(Check::at_most("friction heat falls by", watch.heat_drop(), 1e-9));
    }
    checks.push(Check::at_most("impact loss falls by", watch.impact_drop(), 1e-9));
    checks.push(Check::so("all 12 nodes in contact", system.events().len() == 12));
    for event in system.events().iter().take(1) {
        checks.push(Check::relative("λ from the static solution", event.normal, exact, 1e-6));
        checks.push(Check::at_most("friction beyond µλ", event.tangential / (0.15 * event.normal) - 1.0, 1e-9));
        if speed.abs() >= 1.0 {
            let force = event.force[1] / (0.15 * event.normal);
            checks.push(Check::relative("friction from −µλ", force, -speed.signum(), 1e-9));
        }
    }
    Ok(checks)
}

/// Speed changes while pressed: friction turns round with the sense of sliding and knows nothing of its size.
fn changing(solver: Solver, course: &str) -> Result<Vec<Check>> {
    let tower = Tower { slope: 0.0, ..Tower::default() };
    let mut scene = with_step(with_methods(round(tower.rom()), Scheme::ModalExact, solver), 2e-6);
    scene.settings.contacts[0].friction = 0.15;
    scene.settings.structures[0].damping_ratio = Some(0.3);
    let (mut simulation, mut watch) = begin(&scene)?;
    let mut torques = Vec::new();
    let total = 12.0 * pressed(&scene.roms[0], 0.0, 5e-5).multipliers[0];
    for index in 0..20_000 {
        let share = (f64::from(index) / 2000.0).min(1.0);
        set(&mut simulation, "casing_radius_change", -(GAP + 5e-5) * share * share * (3.0 - 2.0 * share))?;
        let along = ((f64::from(index) - 7000.0) / 5000.0).clamp(0.0, 1.0);
        let speed = match course {
            "reversal" => 1300.0 * (1.0 - 2.0 * along),
            _ if index < 7000 => 1300.0,
            _ => 13_000.0,
        };
        set(&mut simulation, "speed", speed)?;
        watch.step(&mut simulation, 2e-6)?;
        if index == 6999 || index == 19_999 {
            torques.push(real(&simulation, "torque") / (0.15 * total * RADIUS));
        }
    }
    let last = if course == "reversal" { 1.0 } else { -1.0 };
    let mut checks = watch.complementarity();
    checks.push(watch.ledger());
    checks.push(Check::relative("torque before", torques[0], -1.0, 1e-6));
    checks.push(Check::relative("torque after", torques[1], last, 1e-6));
    checks.push(Check::at_most("friction heat falls by", watch.heat_drop(), 1e-6));
    checks.push(Check::at_most("impact loss falls by", watch.impact_drop(), 1e-9));
    Ok(checks)
}

/// Speed changes while blades rub on two bumps: compared with a finer step before small differences have grown.
fn on_bumps(solver: Solver, course: &'static str) -> Result<Vec<Check>> {
    let run = |step: f64| -> Result<(Vec<f64>, Watch)> {
        let mut scene = with_step(with_methods(bumps(blade(12)), Scheme::ModalExact, solver), step);
        scene.settings.surfaces[0].shape = Shape::TwoLobe { depth: 0.7, width: 0.15, phase: 0.0 };
        scene.settings.structures[0].damping_ratio = Some(0.05);
        let (mut simulation, mut watch) = begin(&scene)?;
        let mut history = Vec::new();
        let length = 2e-5;
        for index in 0..100 {
            let time = f64::from(index) * length;
            let speed = match course {
                "reversal" => 1300.0 * (1.0 - 2.0 * ((time - 5e-4) / 1e-3).clamp(0.0, 1.0)),
                // Film and lcp know sliding only: they are compared while the tips slide.
                "stop" if solver != Solver::Coulomb => (1300.0 * (1.0 - time / 1.5e-3)).max(130.0),
                "jump" => {
                    if time < 1e-3 {
                        1300.0
                    } else {
                        13_000.0
                    }
                }
                "ramp" => 200.0 + 1e6 * time,
                _ => 1300.0 * (1.0 - (time / 1.5e-3).min(1.0)),
            };
            set(&mut simulation, "speed", speed)?;
            watch.step(&mut simulation, length)?;
            history.extend(displacements(&simulation));
        }
        Ok((history, watch))
    };
    let (coarse, watch) = run(1e-6)?;
    let (fine, finer) = run(2.5e-7)?;
    let mut checks = vec![
        Check::at_most("displacements from a fourth of the step", apart(&coarse, &fine), 0.05),
        Check::relative("impulse from a fourth of the step", watch.impulse, finer.impulse, 0.05),
        Check::so("the blades touched", watch.contacts > 0 && finer.contacts > 0),
        watch.ledger(),
        finer.ledger(),
    ];
    if solver != Solver::Film {
        checks.extend(watch.complementarity());
        checks.push(Check::at_most("impact loss falls by", watch.impact_drop(), 1e-6));
    }
    Ok(checks)
}
