//! Communication steps of every length, ten million undamped steps, jumps of inputs, states restored in other
//! instances.

use tiprub_core::scene::method::{Scheme, Solver};
use tiprub_core::{CoSimulation, Result, Scene, Simulation};
use tiprub_study::error::clock;

use super::{
    super::{
        CaseEnd, Cases, Check, Expected, StabilityCase,
        models::{GAP, SeededRandom, StabilityMethod, Tower, allowed, blade, bumps, round, with_methods, with_step},
        observe::{MASSLESS_RETURN, StabilityWatch, apart, begin, bits, displacements, real, set, steps},
    },
    limits::massless_step,
};

/// Returns all cases of this family.
pub(crate) fn cases() -> Vec<StabilityCase> {
    [communication(), long(), jumps(), restore()].into_iter().flatten().collect()
}

fn communication() -> Vec<StabilityCase> {
    let mut cases = Vec::new();
    for method in StabilityMethod::all() {
        let lcp = method.solver == Solver::Lcp;
        for ratio in [1e-3, 0.1, 0.7, 1.0, 2.0, 3.3, 10.0, 1e3] {
            let expected = if ratio < 1.0 {
                Expected::right("same result with h = H/4")
            } else {
                Expected::right("same result with H = h")
            };
            let name = format!("communication/H={ratio}h/{}", method.name());
            let quick = lcp && (method == StabilityMethod::exact(Solver::Lcp) || method.is_galerkin());
            cases.add(quick && ratio > 0.5, name, expected, move || lengths(method, ratio));
        }
        let expected = Expected::right(
            "same result with uniform steps of a quarter of the length; signs of the energy \
                                        terms",
        );
        let name = format!("communication/wild/{}", method.name());
        cases.add(false, name, expected, move || wildly(method));
    }
    for method in StabilityMethod::all_with(Solver::Lcp) {
        let name = method.integration();
        let expected = Expected::right("energy of free undamped blades, and their phase compared with ω t");
        cases.add(false, format!("communication/H=1e6h/{name}"), expected, move || huge(method));
        // Steps of galerkin are counted as they are performed.
        let words = ["communicationStepSize", "internal steps"];
        let expected =
            if method.is_galerkin() { Expected::either("finite outputs", words) } else { Expected::refused(words) };
        cases.add(true, format!("communication/H=1e10h/{name}"), expected, move || beyond(method, 1e4));
        for (what, length) in [
            ("0", 0.0),
            ("-1e-6", -1e-6),
            ("NaN", f64::NAN),
            ("inf", f64::INFINITY),
            ("5e-324", 5e-324),
            ("1e308", 1e308),
        ] {
            let refused = Expected::refused(["communicationStepSize"]);
            cases.add(true, format!("communication/H={what}/{name}"), refused, move || beyond(method, length));
        }
        for length in [5e-324, 1e-310, 1e-17, 9e-13, 1e-12] {
            let expected = if length < 1e-12 {
                Expected::refused(["communicationStepSize", "1e-12"])
            } else {
                Expected::right("finite outputs")
            };
            let name = format!("communication/from-0/H={length:e}/{name}");
            cases.add(true, name, expected, move || from(0.0, method, length));
        }
    }
    cases
}

/// Performs a step after a start at 1 s, so that the shortest ones do not change the time.
fn beyond(method: StabilityMethod, length: f64) -> Result<Vec<Check>> {
    from(1.0, method, length)
}

/// Performs a step from `start` (s).
fn from(start: f64, method: StabilityMethod, length: f64) -> Result<Vec<Check>> {
    let scene = method.stepping(round(Tower::default().rom()), 1e-6);
    let mut simulation = Simulation::new(&scene)?;
    simulation.initialise(start)?;
    simulation.do_step(start, length)?;
    let finite = super::super::observe::outputs(&simulation).iter().all(|value| value.is_finite());
    Ok(vec![Check::so("all outputs finite", finite)])
}

fn rub(method: StabilityMethod, step: f64) -> Scene {
    let mut scene = method.stepping(bumps(blade(6)), step);
    scene.settings.structures[0].damping_ratio = Some(0.02);
    // The bumps are at rest at the start and present from the beginning, away from the blades.
    scene
}

/// Runs a rub to 2 ms with communication steps of these lengths; returns displacements every 0.1 ms.
fn history(scene: &Scene, mut length: impl FnMut() -> f64) -> Result<(Vec<f64>, StabilityWatch)> {
    let mut simulation = Simulation::new(scene)?;
    simulation.initialise(0.0)?;
    let mut watch = StabilityWatch::new(scene);
    let mut history = Vec::new();
    for mark in 1..=20 {
        let end = 1e-4 * f64::from(mark);
        loop {
            let (left, next) = (end - simulation.time(), length());
            if left <= 1e-9 * end {
                break;
            }
            watch.step(&mut simulation, if next > 0.999_999 * left { left } else { next })?;
        }
        history.extend(displacements(&simulation));
    }
    Ok((history, watch))
}

const STEP: f64 = 1e-6;

fn lengths(method: StabilityMethod, ratio: f64) -> Result<Vec<Check>> {
    let length = (ratio * STEP).min(1e-4);
    let (found, watch) = if ratio < 0.01 {
        // A thousand times as many steps: the first two samples are enough.
        return short(method, length);
    } else {
        history(&rub(method, STEP), || length)?
    };
    // The step chosen by a tolerance depends on the communication step.
    let same = if method.is_galerkin() { 0.05 } else { 1e-6 };
    let (other, bound) = if ratio < 1.0 {
        (history(&rub(method, length / 4.0), || length)?.0, 0.05)
    } else if (ratio - 3.3).abs() < 0.1 {
        // 3.3 h is four steps of 0.825 h.
        (history(&rub(method, length / 4.0), || length / 4.0)?.0, 0.05)
    } else {
        (history(&rub(method, STEP), || STEP)?.0, same)
    };
    let mut checks = vec![
        Check::at_most("difference of the displacements", apart(&found, &other), bound),
        Check::so("the blades touched", watch.contacts > 0),
        watch.ledger(),
    ];
    if method.solver != Solver::Film {
        checks.extend(watch.complementarity());
    }
    Ok(checks)
}

/// Compares h/1000 for a tenth of a microsecond in contact, continued from a state at h, with steps ten times as long.
fn short(method: StabilityMethod, length: f64) -> Result<Vec<Check>> {
    let mut scene = rub(method, STEP);
    scene.settings.surfaces[0].ramp_time = 0.0;
    scene.settings.surfaces[0].shape = tiprub_core::scene::settings::Shape::Circular {};
    let (mut simulation, mut watch) = begin(&scene)?;
    for index in 0..700 {
        set(&mut simulation, "casing_radius_change", -1.1 * GAP * f64::from(index) / 700.0)?;
        watch.step(&mut simulation, STEP)?;
    }
    let mut other = simulation.clone();
    let mut second = watch.clone();
    for _ in 0..2000 {
        watch.step(&mut simulation, length)?;
    }
    for _ in 0..200 {
        second.step(&mut other, 10.0 * length)?;
    }
    Ok(vec![
        Check::at_most(
            "deviation from the displacements with steps ten times as long",
            apart(&displacements(&simulation), &displacements(&other)),
            1e-3,
        ),
        Check::so("the blades touched", watch.contacts > 0),
        watch.ledger(),
    ])
}

fn wildly(method: StabilityMethod) -> Result<Vec<Check>> {
    let mut random = SeededRandom(11);
    let (found, watch) = history(&rub(method, STEP), || random.scale(1e-8, 5e-5))?;
    let (even, _) = history(&rub(method, STEP / 4.0), || STEP / 4.0)?;
    let mut checks = vec![
        Check::at_most("deviation from the displacements with uniform steps", apart(&found, &even), 0.05),
        Check::so("the blades touched", watch.contacts > 0),
        watch.ledger(),
    ];
    if method.solver != Solver::Film {
        checks.extend(watch.complementarity());
    }
    Ok(checks)
}

/// Returns a blade in free motion: hit by the casing, which then leaves.
fn kicked(method: StabilityMethod, step: f64) -> Result<(Simulation, f64)> {
    let tower = Tower { sectors: 1, ..Tower::default() };
    let mut scene = method.on(round(tower.rom()));
    scene.settings.structures[0].damping_ratio = Some(0.0);
    scene.settings.outputs.all_sectors = false;
    let step = match method.scheme {
        scheme if scheme.properties().stable_below.is_finite() => {
            0.9 * scheme.properties().stable_below / tower.largest_frequency()
        }
        Scheme::MasslessBoundary => 0.5 * massless_step(&scene).unwrap_or(step),
        _ => step,
    };
    let scene = with_step(scene, method.step(step));
    let mut simulation = Simulation::new(&scene)?;
    simulation.initialise(0.0)?;
    // The casing leaves slowly, because the forces of massless-boundary act a step late and do work on its motion then.
    let place = |index: u32| match index {
        0..400 => -1.2 * f64::from(index.min(300)) / 300.0,
        _ => -1.2 + 2.2 * f64::from(index - 400) / 2000.0,
    };
    for index in 0..=2400 {
        set(&mut simulation, "casing_radius_change", GAP * place(index))?;
        simulation.do_step(simulation.time(), step)?;
    }
    set(&mut simulation, "casing_radius_change", 2e-2)?;
    simulation.do_step(simulation.time(), step)?;
    Ok((simulation, step))
}

/// Returns the energy that the scheme conserves (J).
fn energy(simulation: &Simulation) -> f64 {
    real(simulation, "scheme_energy")
}

fn huge(method: StabilityMethod) -> Result<Vec<Check>> {
    let (mut simulation, step) = kicked(method, 2e-6)?;
    let mut twin = simulation.clone();
    let before = energy(&simulation);
    simulation.do_step(simulation.time(), 1e6 * step)?;
    for _ in 0..1000 {
        twin.do_step(twin.time(), 1e3 * step)?;
    }
    Ok(vec![
        Check::so("the energy is positive", before > 0.0),
        Check::at_most("energy drift over 1e6 steps", (energy(&simulation) / before - 1.0).abs(), 1e-11),
        Check::at_most(
            "deviation from the displacements with 1000 steps of the same total length",
            apart(&displacements(&simulation), &displacements(&twin)),
            1e-5,
        ),
    ])
}

fn long() -> Vec<StabilityCase> {
    let mut cases = Vec::new();
    for method in StabilityMethod::all_with(Solver::Lcp) {
        let name = method.integration();
        for (steps, quick) in [(1e5, true), (1e7, false)] {
            let expected = Expected::right("energy of free undamped blades");
            let work = move |_: &_| match drift(method, steps) {
                Ok((checks, remark)) => CaseEnd::answer(checks).remark(remark),
                Err(error) => CaseEnd::refused(error),
            };
            cases.push(
                StabilityCase::new(format!("long/{steps:e}-steps/{name}"), expected, work).quick(quick).within(600.0),
            );
        }
        let expected = Expected::right("energy at most the work of the casing; signs of the energy terms");
        let work = move |_: &_| CaseEnd::of(chatter(method));
        cases.push(StabilityCase::new(format!("long/chatter/{name}"), expected, work).within(600.0));
    }
    cases
}

fn drift(method: StabilityMethod, steps: f64) -> Result<(Vec<Check>, String)> {
    let (mut simulation, step) = kicked(method, 2e-6)?;
    let (before, start) = (energy(&simulation), clock::now());
    let mut most: f64 = 0.0;
    for _ in 0..100 {
        simulation.do_step(simulation.time(), 0.01 * steps * step)?;
        most = most.max((energy(&simulation) / before - 1.0).abs());
    }
    let time = (clock::now() - start).as_secs_f64() / steps;
    let remark = format!("largest drift {most:.1e} over {steps:e} steps of {step:.2e} s, {:.0} ns each", 1e9 * time);
    // Each adaptive step multiplies an undamped mode by a matrix of determinant 1. The determinant is a difference of products of two rounded
    // entries, so its error is at most 2 ε per step. `galerkin` covers the longest case, 20 s, in 2.5e5 steps of 80 µs, in which equal errors
    // add up. `galerkin-fixed` has the same bound.
    let bound = if method.scheme == Scheme::Galerkin { 2.5e5 * 2.0 * f64::EPSILON } else { 1e-11 };
    Ok((vec![Check::so("the energy is positive", before > 0.0), Check::at_most("energy drift", most, bound)], remark))
}

/// Checks undamped blades that bounce in a round casing for a long time: contact may dissipate energy, never add it.
fn chatter(method: StabilityMethod) -> Result<Vec<Check>> {
    let tower = Tower { sectors: 4, ..Tower::default() };
    let mut scene = method.stepping(round(tower.rom()), 2e-6);
    scene.settings.structures[0].damping_ratio = Some(if method.is_massless() { 1e-3 } else { 0.0 });
    let length = scene.settings.experiment.communication_step;
    let (mut simulation, mut watch) = begin(&scene)?;
    for index in 0..steps(1.0, length) {
        let share = (f64::from(index) * length / 1e-3).min(1.0);
        set(&mut simulation, "casing_radius_change", -1.05 * GAP * share)?;
        watch.step(&mut simulation, length)?;
    }
    let supplied = real(&simulation, "external_work");
    let bound = if method.is_massless() { MASSLESS_RETURN } else { 1e-9 };
    Ok([
        watch.complementarity(),
        vec![
            watch.ledger(),
            Check::at_most(
                "excess of the energy over the work of the casing",
                energy(&simulation) / supplied - 1.0,
                bound,
            ),
            watch.impact(bound),
        ],
    ]
    .concat())
}

fn jumps() -> Vec<StabilityCase> {
    let mut cases = Vec::new();
    for method in StabilityMethod::all() {
        for jump in [1e-6, 1e-5, 1e-4, 1e-3, -1e-4] {
            let expected = Expected::right("impulse = W⁻¹ jump, work of the casing = impact loss + remaining energy");
            let name = format!("jump/gap-offset/{jump:e}/{}", method.name());
            cases.add(method.solver == Solver::Lcp, name, expected, move || jumped(method, jump));
        }
    }
    cases
}

/// Checks a casing that jumps onto resting blades. In that step the force is the jump over W, an impulse p = λh; the
/// casing does λ·jump/2 of work twice over two steps, and the remaining energy is in the blade.
fn jumped(method: StabilityMethod, jump: f64) -> Result<Vec<Check>> {
    let tower = Tower { sectors: 3, slope: 0.0, ..Tower::default() };
    let mut scene = with_step(method.on(round(tower.rom())), 2e-6);
    scene.settings.structures[0].damping_ratio = Some(0.0);
    let (mut simulation, mut watch) = begin(&scene)?;
    watch.step(&mut simulation, 2e-6)?;
    set(&mut simulation, "gap_offset", -GAP - jump)?;
    watch.step(&mut simulation, 2e-6)?;
    let found = simulation.system().multiplier(0, 1);
    let exact = if jump <= 0.0 {
        0.0
    } else if method.is_galerkin() {
        pushed(&scene.roms[0], jump, 2e-6)
    } else {
        let model = tiprub_core::modes::modal::ModalModel::from_rom(&scene.roms[0], 0.0)?;
        let compliance = |mode: usize| {
            let coefficient = model.coefficient(mode, 1.0, method.scheme, 2e-6);
            model.contact_modes[(0, mode)].powi(2) * coefficient.compliance
        };
        jump / (0..model.len()).map(compliance).sum::<f64>()
    };
    let displaced = simulation.system().bank().row(0, 1);
    let mut checks = watch.complementarity();
    let near = allowed(&scene);
    checks.push(Check::relative(
        "deviation of λ from jump/W",
        found,
        exact,
        1e-9 + if jump > 0.0 { near / jump } else { 0.0 },
    ));
    checks.push(Check::at_most(
        "deviation of the tip from the casing",
        (displaced + jump.max(0.0)).abs() / GAP,
        1e-9 + near / GAP,
    ));
    for _ in 0..500 {
        watch.step(&mut simulation, 2e-6)?;
    }
    let supplied = real(&simulation, "external_work");
    checks.extend(watch.books_of(method.scheme));
    if jump > 0.0 {
        checks.push(Check::at_most(
            "excess of the energy over the work of the casing",
            energy(&simulation) / supplied - 1.0,
            if method.is_massless() { MASSLESS_RETURN } else { 1e-9 },
        ));
    } else {
        checks.push(Check::so("nothing moves", energy(&simulation) == 0.0 && supplied == 0.0));
    }
    Ok(checks)
}

/// Returns λ of a tip that a wall pushes inwards at constant speed, `jump` (m) deep at the end of a step that also
/// closes the gap. The tip has no mass: with its residual flexibility G and one mode with inertia, q̈ + ω²q = φλ and
/// φq + Gλ = vt.
fn pushed(rom: &tiprub_core::Rom, jump: f64, step: f64) -> f64 {
    let (frequencies, shapes) = super::decay::modes(&rom.mass, &rom.stiffness);
    let seen = |mode: usize| shapes[(3, mode)];
    let flexible: f64 = (3..6).map(|mode| (seen(mode) / frequencies[mode]).powi(2)).sum();
    let moving = (0..3).max_by(|a, b| seen(*a).abs().total_cmp(&seen(*b).abs())).unwrap_or(0);
    let (time, speed) = (step * jump / (GAP + jump), (GAP + jump) / step);
    let held = (frequencies[moving].powi(2) + seen(moving).powi(2) / flexible).sqrt();
    let turned = held * time;
    // t − sin(Ωt)/Ω, by its series for small t.
    let late = if turned < 1e-2 { turned * turned * time / 6.0 } else { time - turned.sin() / held };
    let moved = seen(moving) * speed / (flexible * held * held) * late;
    (jump - seen(moving) * moved) / flexible
}

fn restore() -> Vec<StabilityCase> {
    let mut cases = Vec::new();
    for method in StabilityMethod::all() {
        let expected = Expected::right(
            "bitwise the same as the saved instance, whatever the parameters of the \
                                        restoring one",
        );
        let name = format!("restore/other-parameters/{}", method.name());
        cases.add(method.solver == Solver::Lcp, name, expected, move || elsewhere(method));
    }
    let expected = Expected::right("rejected, reset, and then bitwise the same as a fresh instance");
    cases.push(StabilityCase::new("restore/refused-scheme", expected, |_| CaseEnd::of(after_refusal())).quick(true));
    let expected = Expected::right("one warning for the step used; none for the proposed step");
    cases.push(
        StabilityCase::new("communication/other-step-than-proposed", expected, |_| CaseEnd::of(reported())).quick(true),
    );
    let expected = Expected::refused(["a different scene"]);
    cases.push(StabilityCase::new("restore/other-scene", expected, |_| CaseEnd::of(other_scene())).quick(true));
    cases
}

fn elsewhere(method: StabilityMethod) -> Result<Vec<Check>> {
    let scene = rub(method, STEP);
    let mut simulation = Simulation::new(&scene)?;
    simulation.initialise(0.0)?;
    for _ in 0..40 {
        simulation.do_step(simulation.time(), 3e-5)?;
    }
    let mut state = vec![0; simulation.state_size()];
    simulation.save_state(&mut state)?;
    // Another instance of the same scene with different values and a different past.
    let mut other = Simulation::new(&scene)?;
    for (parameter, value) in [
        ("friction_coefficient", 0.05),
        ("damping_ratio", 0.4),
        ("gap_offset", 1e-4),
        ("internal_step_max", 7e-7),
        ("initial_rotor_angle", 1.0),
        ("casing_ramp_time", 5e-3),
        ("speed", -400.0),
    ] {
        set(&mut other, parameter, value)?;
    }
    if let Some(row) = other.table().find("scheme").map(|row| row.reference) {
        other.set_integer(row, 2)?;
    }
    other.initialise(0.5)?;
    for _ in 0..10 {
        other.do_step(other.time(), 1e-5)?;
    }
    other.restore_state(&state)?;
    let mut same = true;
    for _ in 0..40 {
        simulation.do_step(simulation.time(), 3e-5)?;
        other.do_step(other.time(), 3e-5)?;
        same &= bits(&simulation) == bits(&other);
    }
    Ok(vec![Check::so("all outputs are bitwise equal over 40 steps", same)])
}

/// Selects a scheme that keeps no mode and reverts it, as an FMU does in Initialization Mode.
fn after_refusal() -> Result<Vec<Check>> {
    // As many modes as three contact nodes have directions.
    let mut scene = rub(StabilityMethod::exact(Solver::Lcp), STEP);
    let rom = &mut scene.roms[0];
    for matrix in [&mut rom.mass, &mut rom.stiffness, &mut rom.contact_map] {
        *matrix = matrix.view((0, 0), (9, 9)).into_owned();
    }
    let [mut simulation, mut fresh] = [Simulation::new(&scene)?, Simulation::new(&scene)?];
    let scheme = simulation.table().find("scheme").map_or(0, |row| row.reference);
    let mut state = vec![0; simulation.state_size()];
    simulation.set_integer(scheme, 3)?;
    simulation.save_state(&mut state)?;
    let refused = simulation.initialise(0.0).is_err();
    simulation.restore_state(&state)?;
    simulation.set_integer(scheme, 2)?;
    for run in [&mut simulation, &mut fresh] {
        run.initialise(0.0)?;
        for _ in 0..40 {
            run.do_step(run.time(), 3e-5)?;
        }
    }
    Ok(vec![
        Check::so("massless-boundary is rejected", refused),
        Check::so("bitwise the same as a fresh instance", bits(&simulation) == bits(&fresh)),
    ])
}

/// Checks steps longer than the scene proposes, across the step that resolves all modes.
fn reported() -> Result<Vec<Check>> {
    let tower = Tower::default();
    let resolved = 2.0 / tower.largest_frequency();
    let mut scene = with_methods(with_step(round(tower.rom()), 1.6 * resolved), Scheme::ModalExact, Solver::Lcp);
    scene.settings.experiment.communication_step = 0.9 * resolved;
    scene.settings.silence = vec!["stiffness-at-rest".to_owned()];
    let mut simulation = Simulation::new(&scene)?;
    simulation.initialise(0.0)?;
    let before = simulation.warnings().len();
    let mut reported = Vec::new();
    for factor in [0.9, 1.3, 1.3, 0.9] {
        simulation.do_step(simulation.time(), factor * resolved)?;
        reported.push(simulation.take_notes().len());
    }
    Ok(vec![
        Check::so("no warning for the proposed step", before == 0),
        Check::so("one warning for the first longer step", reported == [0, 1, 0, 0]),
    ])
}

fn other_scene() -> Result<Vec<Check>> {
    let scene = rub(StabilityMethod::exact(Solver::Lcp), STEP);
    let mut changed = scene.clone();
    changed.roms[0].stiffness[(0, 0)] *= 1.0 + 1e-15;
    let [first, mut second] = [Simulation::new(&scene)?, Simulation::new(&changed)?];
    let mut state = vec![0; first.state_size()];
    first.save_state(&mut state)?;
    second.restore_state(&state)?;
    Ok(vec![Check::so("the state was restored", true)])
}
