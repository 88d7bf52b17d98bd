//! Friction from 0 to 2 with every solver in both directions; speeds at rest, tiny, reversed, jumping.

use tiprub_core::scene::method::{Scheme, Solver};
use tiprub_core::scene::settings::Shape;
use tiprub_core::{CoSimulation, Result, Scene};

use super::super::{
    CaseEnd, Cases, Check, Expected, StabilityCase,
    models::{GAP, RADIUS, StabilityMethod, Tower, allowed, blade, bumps, round},
    observe::{StabilityWatch, apart, begin, displacements, real, set, steps},
    press::{Press, pressed},
};

const COEFFICIENTS: [f64; 6] = [0.0, 0.15, 0.5, 1.0, 1.5, 2.0];

/// Returns all cases of this family.
pub(crate) fn cases() -> Vec<StabilityCase> {
    coefficients().into_iter().chain(speeds()).collect()
}

/// Angle of the principal axes at which the flexibility couples radius and circumference.
const TURNED: f64 = 0.45;

/// Returns −w_rr/w_rθ of the turned tower: for a larger µ, W = w_rr + µ w_rθ is negative for tips that slide along +θ,
/// and never for those that slide along −θ.
fn turned_limit() -> f64 {
    let tower = Tower { turned: TURNED, slope: 0.0, ..Tower::default() };
    let (sine, cosine) = TURNED.sin_cos();
    let [a, b] = [1.0 / tower.base[0], 1.0 / tower.base[1]];
    let across = a * cosine * cosine + b * sine * sine + 1.0 / tower.tip;
    across / ((b - a) * sine * cosine)
}

fn coefficients() -> Vec<StabilityCase> {
    let mut cases = Vec::new();
    for friction in COEFFICIENTS {
        for method in StabilityMethod::all() {
            for sense in [1.0, -1.0] {
                for model in ["straight", "turned"] {
                    let sign = if sense > 0.0 { "+" } else { "−" };
                    let name = format!("friction/{model}/µ={friction}/{}/{sign}Ω", method.name());
                    let against = "static sliding contact, torque, signs of the energy terms";
                    let expected =
                        if model == "straight" { Expected::right(against) } else { Expected::either(against, ["µ"]) };
                    let scheme = method.scheme == Scheme::ModalExact || method.is_adaptive();
                    let quick = scheme && sense > 0.0 && method.solver == Solver::Lcp && (0.1..0.3).contains(&friction);
                    let work = move |_: &_| sliding(model, friction, method, sense);
                    cases.push(StabilityCase::new(name, expected, work).quick(quick));
                }
            }
        }
    }
    cases
}

fn sliding(model: &str, friction: f64, method: StabilityMethod, sense: f64) -> CaseEnd {
    let turned = if model == "turned" { TURNED } else { 0.0 };
    let tower = Tower { turned, slope: 0.0, ..Tower::default() };
    let mut scene = method.stepping(round(tower.rom()), 1e-6);
    scene.settings.contacts[0].friction = friction;
    scene.settings.structures[0].speed = 1300.0 * sense;
    let outcome = Press::new(scene).run();
    match outcome {
        Ok(mut checks) => {
            if model == "turned" {
                let limit = turned_limit();
                let text = format!("sliding along −θ, or µ below −w_rr/w_rθ = {limit:.3}, where W > 0");
                checks.push(Check::so(text, sense < 0.0 || friction < limit));
            }
            CaseEnd::answer(checks)
        }
        Err(error) => {
            // An error is correct if W loses its sign statically, or if the scheme or the contact grows.
            let message = error.to_string();
            let lost = sense > 0.0 && friction >= 0.99 * turned_limit();
            let text =
                format!("static contact lost at or above µ = {:.3}, or the message reports growth", turned_limit());
            let checks = vec![Check::so(text, lost || message.contains("grows") || message.contains("film"))];
            CaseEnd { checks, ..CaseEnd::refused(message) }
        }
    }
}

fn speeds() -> Vec<StabilityCase> {
    let mut cases = Vec::new();
    for method in StabilityMethod::common() {
        let (solver, name) = (method.solver, method.name());
        let lcp = solver == Solver::Lcp;
        for speed in [1e-300, 1e-200, 1e-100, 1e-12, 1e-3, 1.0, 1e4, 1e6, 1e100, 1e200, 1e300, 1.7e308] {
            for sense in [1.0, -1.0] {
                let expected = if speed > 1e5 {
                    Expected::either("static contact, friction −µλ", ["speed"])
                } else {
                    slow(
                        solver,
                        speed,
                        "static normal forces, friction at most µλ and opposite to the slip of sliding tips; otherwise \
                         a warning",
                    )
                };
                let case = format!("speed/steady/{name}/{:e}", sense * speed);
                let quick = lcp && sense > 0.0 && [1e-300, 1e-3, 1e4, 1.7e308].contains(&speed);
                cases.add(quick, case, expected, move || steady(method, sense * speed));
            }
        }
        let zero =
            slow(solver, 0.0, "static normal forces, friction at most µλ; with film and lcp a warning of sticking");
        cases.add(lcp, format!("speed/steady/{name}/0"), zero, move || steady(method, 0.0));
        for (course, text) in
            [("reversal", "torque −µΣλr in both directions of rotation"), ("jump", "unchanged torque −µΣλr")]
        {
            // A speed that passes 0 lets tips stick.
            let expected = if course == "reversal" { slow(solver, 0.0, text) } else { Expected::right(text) };
            cases.add(lcp, format!("speed/{course}/{name}"), expected, move || changing(method, course));
        }
        for course in ["reversal", "jump", "ramp", "stop"] {
            let expected = Expected::right("same result with a quarter of the step, or a sixteenth of the tolerance");
            cases.add(lcp && course == "jump", format!("speed/bumps/{course}/{name}"), expected, move || {
                on_bumps(method, course)
            });
        }
    }
    cases
}

/// Expects a correct result; with sticking tips and a law without sticking also an error, because its friction adds
/// energy.
fn slow(solver: Solver, speed: f64, against: &str) -> Expected {
    if solver == Solver::Coulomb || speed.abs() >= 1.0 {
        return Expected::right(against);
    }
    Expected::either(against, ["friction has added", "not model sticking"])
}

/// Compares a pressed round casing at one speed. The normal forces do not depend on it; friction is at most µλ.
fn steady(method: StabilityMethod, speed: f64) -> Result<Vec<Check>> {
    let tower = Tower { slope: 0.0, ..Tower::default() };
    let mut scene = method.stepping(round(tower.rom()), 2e-6);
    scene.settings.contacts[0].friction = 0.15;
    scene.settings.structures[0].speed = speed;
    scene.settings.structures[0].damping_ratio = Some(0.3);
    let (mut simulation, mut watch) = begin(&scene)?;
    let length = scene.settings.experiment.communication_step;
    for index in 0..steps(12e-3, length) {
        let share = (f64::from(index) * length / 4e-3).min(1.0);
        set(&mut simulation, "casing_radius_change", -(GAP + 5e-5) * share * share * (3.0 - 2.0 * share))?;
        watch.step(&mut simulation, length)?;
    }
    let exact = pressed(&scene.roms[0], 0.0, 5e-5).multipliers[0];
    let system = simulation.system();
    let mut checks = watch.complementarity();
    checks.push(watch.ledger());
    checks.push(Check::so("all outputs finite", watch.finite));
    // Film and lcp model sliding only: the work of their friction is meaningless for sticking tips, and a warning at
    // the start must state this.
    if method.solver != Solver::Coulomb && speed.abs() < 1.0 {
        let reported = simulation.warnings().iter().any(|text| text.contains("sticking"));
        checks.push(Check::so("a warning that sticking is not modelled", reported));
    } else {
        checks.push(watch.heat(1e-9));
    }
    checks.push(watch.impact(1e-9));
    checks.push(Check::so("all 12 nodes in contact", system.events().len() == 12));
    for event in system.events().iter().take(1) {
        checks.push(Check::relative(
            "deviation of λ from the static solution",
            event.normal,
            exact,
            1e-6 + near(&scene),
        ));
        checks.push(Check::at_most("excess of friction over µλ", event.tangential / (0.15 * event.normal) - 1.0, 1e-9));
        if speed.abs() >= 1.0 {
            let force = event.force[1] / (0.15 * event.normal);
            checks.push(Check::relative("deviation of friction from −µλ", force, -speed.signum(), 1e-9));
        }
    }
    Ok(checks)
}

/// Returns the accuracy of static forces by the tolerance of a scene, as a fraction: gaps are closed to a ten-thousandth of it, with a margin of ten.
fn near(scene: &Scene) -> f64 {
    1e-3 * allowed(scene) / 5e-5
}

/// Changes the speed of pressed tips: friction reverses with the direction of sliding and does not depend on its speed.
fn changing(method: StabilityMethod, course: &str) -> Result<Vec<Check>> {
    let tower = Tower { slope: 0.0, ..Tower::default() };
    let mut scene = method.stepping(round(tower.rom()), 2e-6);
    scene.settings.contacts[0].friction = 0.15;
    scene.settings.structures[0].damping_ratio = Some(0.3);
    let (mut simulation, mut watch) = begin(&scene)?;
    let length = scene.settings.experiment.communication_step;
    let mut torques = Vec::new();
    let total = 12.0 * pressed(&scene.roms[0], 0.0, 5e-5).multipliers[0];
    let (before, last) = (steps(14e-3, length), steps(40e-3, length));
    for index in 0..last {
        let time = f64::from(index) * length;
        let share = (time / 4e-3).min(1.0);
        set(&mut simulation, "casing_radius_change", -(GAP + 5e-5) * share * share * (3.0 - 2.0 * share))?;
        let along = ((time - 14e-3) / 10e-3).clamp(0.0, 1.0);
        let speed = match course {
            "reversal" => 1300.0 * (1.0 - 2.0 * along),
            _ if index < before => 1300.0,
            _ => 13_000.0,
        };
        set(&mut simulation, "speed", speed)?;
        watch.step(&mut simulation, length)?;
        if index + 1 == before || index + 1 == last {
            torques.push(real(&simulation, "torque") / (0.15 * total * RADIUS));
        }
    }
    let after = if course == "reversal" { 1.0 } else { -1.0 };
    let bound = 1e-6 + near(&scene);
    let mut checks = watch.complementarity();
    checks.push(watch.ledger());
    checks.push(Check::relative("deviation of the torque before the speed change", torques[0], -1.0, bound));
    checks.push(Check::relative("deviation of the torque after the speed change", torques[1], after, bound));
    checks.push(watch.heat(1e-6));
    checks.push(watch.impact(1e-9));
    Ok(checks)
}

/// Changes the speed while blades rub on two bumps: compared with a finer step before small differences have grown.
fn on_bumps(method: StabilityMethod, course: &'static str) -> Result<Vec<Check>> {
    let run = |method: StabilityMethod, step: f64| -> Result<(Vec<f64>, StabilityWatch)> {
        let mut scene = method.stepping(bumps(blade(12)), step);
        scene.settings.surfaces[0].shape = Shape::TwoLobe { depth: 0.7, width: 0.15, phase: 0.0 };
        scene.settings.structures[0].damping_ratio = Some(0.05);
        let (mut simulation, mut watch) = begin(&scene)?;
        let mut history = Vec::new();
        let length = 2e-5;
        for index in 0..100 {
            let time = f64::from(index) * length;
            let speed = match course {
                "reversal" => 1300.0 * (1.0 - 2.0 * ((time - 5e-4) / 1e-3).clamp(0.0, 1.0)),
                // Film and lcp model sliding only: they are compared while the tips slide.
                "stop" if method.solver != Solver::Coulomb => (1300.0 * (1.0 - time / 1.5e-3)).max(130.0),
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
    let (better, parts) = method.finer();
    let (coarse, watch) = run(method, 1e-6)?;
    let (fine, finer) = run(better, 1e-6 / parts)?;
    let mut checks = vec![
        Check::at_most("deviation of the displacements from the finer run", apart(&coarse, &fine), 0.05),
        Check::relative("deviation of the impulse from the finer run", watch.impulse, finer.impulse, 0.05),
        Check::so("the blades touched", watch.contacts > 0 && finer.contacts > 0),
        watch.ledger(),
        finer.ledger(),
    ];
    if method.solver != Solver::Film {
        checks.extend(watch.complementarity());
        checks.push(watch.impact(1e-6));
    }
    Ok(checks)
}
