//! Communication steps of every length, ten million steps without damping, jumps of inputs, states restored elsewhere.

use tiprub_core::{
    Result, Scene, Simulation,
    settings::{Scheme, Solver},
};

use super::{
    super::{
        Case, Cases, Check, Expected, Happened,
        models::{GAP, Random, SCHEMES, SOLVERS, Tower, blade, bumps, round, with_methods, with_step},
        observe::{MASSLESS_RETURN, Watch, apart, begin, bits, displacements, real, set},
    },
    gaps::processor_time,
    limits::massless_step,
};

/// All of them.
pub(crate) fn cases() -> Vec<Case> {
    [communication(), long(), jumps(), restore()].into_iter().flatten().collect()
}

fn communication() -> Vec<Case> {
    let mut cases = Vec::new();
    for (scheme, scheme_name) in SCHEMES {
        for (solver, solver_name) in SOLVERS {
            for ratio in [1e-3, 0.1, 0.7, 1.0, 2.0, 3.3, 10.0, 1e3] {
                let expected = if ratio < 1.0 {
                    Expected::right("the same with h = H/4")
                } else {
                    Expected::right("the same with H = h, one step at a time")
                };
                let name = format!("communication/H={ratio}h/{scheme_name}/{solver_name}");
                let quick = solver == Solver::Lcp && scheme == Scheme::ModalExact;
                cases.add(quick, name, expected, move || lengths(scheme, solver, ratio));
            }
            let expected = Expected::right("the same with even steps a quarter as long; signs of the ledger");
            let name = format!("communication/wild/{scheme_name}/{solver_name}");
            cases.add(solver == Solver::Lcp, name, expected, move || wildly(scheme, solver));
        }
        let expected = Expected::right("energy of free blades without damping, and their phase against ω t");
        cases.add(false, format!("communication/H=1e6h/{scheme_name}"), expected, move || huge(scheme));
        let refused = Expected::refused(["communicationStepSize", "internal steps"]);
        cases.push(
            Case::new(format!("communication/H=1e10h/{scheme_name}"), refused, move |_| {
                Happened::of(beyond(scheme, 1e4))
            })
            .quick(true),
        );
        for (what, length, word) in [
            ("0", 0.0, "communicationStepSize"),
            ("-1e-6", -1e-6, "communicationStepSize"),
            ("NaN", f64::NAN, "communicationStepSize"),
            ("inf", f64::INFINITY, "communicationStepSize"),
            ("5e-324", 5e-324, "communicationStepSize"),
            ("1e308", 1e308, "communicationStepSize"),
        ] {
            cases.add(true, format!("communication/H={what}/{scheme_name}"), Expected::refused([word]), move || {
                beyond(scheme, length)
            });
        }
        for length in [5e-324, 1e-310, 1e-17, 9e-13, 1e-12] {
            let expected = if length < 1e-12 {
                Expected::refused(["communicationStepSize", "1e-12"])
            } else {
                Expected::right("finite outputs")
            };
            cases.add(true, format!("communication/from-0/H={length:e}/{scheme_name}"), expected, move || {
                from(0.0, scheme, length)
            });
        }
    }
    cases
}

/// A step after a start at 1 s, so that the shortest ones do not change the time.
fn beyond(scheme: Scheme, length: f64) -> Result<Vec<Check>> {
    from(1.0, scheme, length)
}

/// A step from `start` (s).
fn from(start: f64, scheme: Scheme, length: f64) -> Result<Vec<Check>> {
    let scene = with_methods(with_step(round(Tower::default().rom()), 1e-6), scheme, Solver::Lcp);
    let mut simulation = Simulation::new(&scene)?;
    simulation.initialise(start)?;
    simulation.do_step(start, length)?;
    let finite = super::super::observe::outputs(&simulation).iter().all(|value| value.is_finite());
    Ok(vec![Check::so("all outputs finite", finite)])
}

fn rub(scheme: Scheme, solver: Solver, step: f64) -> Scene {
    let mut scene = with_methods(bumps(blade(6)), scheme, solver);
    scene.settings.structures[0].damping_ratio = Some(0.02);
    // The bumps stand still at the start and are there at once where the blades are not.
    scene.settings.time.step = step;
    scene
}

/// March a rub to 2 ms by communication steps of these lengths; displacements every 0.1 ms.
fn history(scene: &Scene, mut length: impl FnMut() -> f64) -> Result<(Vec<f64>, Watch)> {
    let mut simulation = Simulation::new(scene)?;
    simulation.initialise(0.0)?;
    let mut watch = Watch::new(scene);
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

fn lengths(scheme: Scheme, solver: Solver, ratio: f64) -> Result<Vec<Check>> {
    let length = (ratio * STEP).min(1e-4);
    let (found, watch) = if ratio < 0.01 {
        // A thousand times as many: the first two marks are enough.
        return short(scheme, solver, length);
    } else {
        history(&rub(scheme, solver, STEP), || length)?
    };
    let (other, bound) = if ratio < 1.0 {
        (history(&rub(scheme, solver, length / 4.0), || length)?.0, 0.05)
    } else if (ratio - 3.3).abs() < 0.1 {
        // 3.3 h is four steps of 0.825 h.
        (history(&rub(scheme, solver, length / 4.0), || length / 4.0)?.0, 0.05)
    } else {
        (history(&rub(scheme, solver, STEP), || STEP)?.0, 1e-6)
    };
    let mut checks = vec![
        Check::at_most("displacements differ", apart(&found, &other), bound),
        Check::so("the blades touched", watch.contacts > 0),
        watch.ledger(),
    ];
    if solver != Solver::Film {
        checks.extend(watch.complementarity());
    }
    Ok(checks)
}

/// h/1000 for a tenth of a microsecond in contact, continued from a state at h, against ten times as long steps.
fn short(scheme: Scheme, solver: Solver, length: f64) -> Result<Vec<Check>> {
    let mut scene = rub(scheme, solver, STEP);
    scene.settings.surfaces[0].ramp_time = 0.0;
    scene.settings.surfaces[0].shape = tiprub_core::settings::Shape::Circular {};
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
            "displacements from ten times as long steps",
            apart(&displacements(&simulation), &displacements(&other)),
            1e-3,
        ),
        Check::so("the blades touched", watch.contacts > 0),
        watch.ledger(),
    ])
}

fn wildly(scheme: Scheme, solver: Solver) -> Result<Vec<Check>> {
    let mut random = Random(11);
    let (found, watch) = history(&rub(scheme, solver, STEP), || random.scale(1e-8, 5e-5))?;
    let (even, _) = history(&rub(scheme, solver, STEP / 4.0), || STEP / 4.0)?;
    let mut checks = vec![
        Check::at_most("displacements from even steps", apart(&found, &even), 0.05),
        Check::so("the blades touched", watch.contacts > 0),
        watch.ledger(),
    ];
    if solver != Solver::Film {
        checks.extend(watch.complementarity());
    }
    Ok(checks)
}

/// A blade in free motion: kicked by the casing, which then leaves.
fn kicked(scheme: Scheme, step: f64) -> Result<(Simulation, f64)> {
    let tower = Tower { sectors: 1, ..Tower::default() };
    let mut scene = with_methods(round(tower.rom()), scheme, Solver::Lcp);
    scene.settings.structures[0].damping_ratio = Some(0.0);
    scene.settings.outputs.all_sectors = false;
    let step = match scheme {
        Scheme::CentralDifference => 0.9 * 2.0 / tower.largest_frequency(),
        Scheme::ModalExact | Scheme::Galerkin => step,
        Scheme::MasslessBoundary => 0.5 * massless_step(&scene).unwrap_or(step),
    };
    let scene = with_step(scene, step);
    let mut simulation = Simulation::new(&scene)?;
    simulation.initialise(0.0)?;
    for index in 0..400 {
        set(&mut simulation, "casing_radius_change", -1.2 * GAP * f64::from(index.min(300)) / 300.0)?;
        simulation.do_step(simulation.time(), step)?;
    }
    set(&mut simulation, "casing_radius_change", 2e-2)?;
    simulation.do_step(simulation.time(), step)?;
    Ok((simulation, step))
}

/// What the scheme conserves (J).
fn energy(simulation: &Simulation) -> f64 {
    real(simulation, "scheme_energy")
}

fn huge(scheme: Scheme) -> Result<Vec<Check>> {
    let (mut simulation, step) = kicked(scheme, 2e-6)?;
    let mut twin = simulation.clone();
    let before = energy(&simulation);
    simulation.do_step(simulation.time(), 1e6 * step)?;
    for _ in 0..1000 {
        twin.do_step(twin.time(), 1e3 * step)?;
    }
    Ok(vec![
        Check::so("there is energy", before > 0.0),
        Check::at_most("energy drift over 1e6 steps", (energy(&simulation) / before - 1.0).abs(), 1e-11),
        Check::at_most(
            "displacements from 1000 steps as long in all",
            apart(&displacements(&simulation), &displacements(&twin)),
            1e-5,
        ),
    ])
}

fn long() -> Vec<Case> {
    let mut cases = Vec::new();
    for (scheme, name) in SCHEMES {
        for (steps, quick) in [(1e5, true), (1e7, false)] {
            let expected = Expected::right("energy of free undamped blades");
            let work = move |_: &_| match drift(scheme, steps) {
                Ok((checks, remark)) => Happened::answer(checks).remark(remark),
                Err(error) => Happened::refused(error),
            };
            cases.push(Case::new(format!("long/{steps:e}-steps/{name}"), expected, work).quick(quick).within(600.0));
        }
    }
    for (scheme, name) in SCHEMES {
        let expected = Expected::right("energy at most what the casing did; signs of the ledger");
        cases.push(
            Case::new(format!("long/chatter/{name}"), expected, move |_: &_| Happened::of(chatter(scheme)))
                .within(600.0),
        );
    }
    cases
}

fn drift(scheme: Scheme, steps: f64) -> Result<(Vec<Check>, String)> {
    let (mut simulation, step) = kicked(scheme, 2e-6)?;
    let (before, clock) = (energy(&simulation), processor_time());
    let mut most: f64 = 0.0;
    for _ in 0..100 {
        simulation.do_step(simulation.time(), 0.01 * steps * step)?;
        most = most.max((energy(&simulation) / before - 1.0).abs());
    }
    let time = (processor_time() - clock) / steps;
    let remark = format!("largest drift {most:.1e} over {steps:e} steps of {step:.2e} s, {:.0} ns each", 1e9 * time);
    Ok((vec![Check::so("there is energy", before > 0.0), Check::at_most("energy drift", most, 1e-11)], remark))
}

/// Blades without damping that bounce in a round casing for long: contact may take energy, never give it.
fn chatter(scheme: Scheme) -> Result<Vec<Check>> {
    let tower = Tower { sectors: 4, ..Tower::default() };
    let mut scene = with_methods(round(tower.rom()), scheme, Solver::Lcp);
    scene.settings.structures[0].damping_ratio = Some(if scheme == Scheme::MasslessBoundary { 1e-3 } else { 0.0 });
    let scene = with_step(scene, 2e-6);
    let (mut simulation, mut watch) = begin(&scene)?;
    for index in 0..500_000 {
        let share = (f64::from(index) / 500.0).min(1.0);
        set(&mut simulation, "casing_radius_change", -1.05 * GAP * share)?;
        watch.step(&mut simulation, 2e-6)?;
    }
    let supplied = real(&simulation, "external_work");
    Ok([
        watch.complementarity(),
        vec![
            watch.ledger(),
            Check::at_most(
                "energy beyond the work of the casing",
                energy(&simulation) / supplied - 1.0,
                if scheme == Scheme::MasslessBoundary { MASSLESS_RETURN } else { 1e-9 },
            ),
            Check::at_most(
                "impact loss falls by",
                watch.impact_drop(),
                if scheme == Scheme::MasslessBoundary { MASSLESS_RETURN } else { 1e-9 },
            ),
        ],
    ]
    .concat())
}

fn jumps() -> Vec<Case> {
    let mut cases = Vec::new();
    for (solver, name) in SOLVERS {
        for (scheme, scheme_name) in SCHEMES {
            for jump in [1e-6, 1e-5, 1e-4, 1e-3, -1e-4] {
                let expected = Expected::right("impulse = W⁻¹ jump, energy of the casing = impact loss + energy left");
                cases.add(
                    solver == Solver::Lcp,
                    format!("jump/gap-offset/{jump:e}/{scheme_name}/{name}"),
                    expected,
                    move || jumped(scheme, solver, jump),
                );
            }
        }
    }
    cases
}

/// The casing jumps onto resting blades by a distance. In that step the force is the jump over W, an impulse p = λh; the casing
/// does λ·jump/2 of work twice over two steps, what stays is in the blade.
fn jumped(scheme: Scheme, solver: Solver, jump: f64) -> Result<Vec<Check>> {
    let tower = Tower { sectors: 3, slope: 0.0, ..Tower::default() };
    let mut scene = with_step(with_methods(round(tower.rom()), scheme, solver), 2e-6);
    scene.settings.structures[0].damping_ratio = Some(0.0);
    let (mut simulation, mut watch) = begin(&scene)?;
    watch.step(&mut simulation, 2e-6)?;
    set(&mut simulation, "gap_offset", -GAP - jump)?;
    watch.step(&mut simulation, 2e-6)?;
    let found = simulation.system().multiplier(0, 1);
    let model = tiprub_core::dynamics::modal::ModalModel::from_rom(&scene.roms[0], 0.0)?;
    let compliance: f64 = (0..model.len())
        .map(|mode| model.contact_modes[(0, mode)].powi(2) * model.coefficient(mode, 1.0, scheme, 2e-6).compliance)
        .sum();
    let exact = if jump > 0.0 { jump / compliance } else { 0.0 };
    let displaced = simulation.system().bank().row(0, 1);
    let mut checks = watch.complementarity();
    checks.push(Check::relative("λ from jump/W", found, exact, 1e-9));
    checks.push(Check::at_most("tip from the casing", (displaced + jump.max(0.0)).abs() / GAP, 1e-9));
    for _ in 0..500 {
        watch.step(&mut simulation, 2e-6)?;
    }
    let supplied = real(&simulation, "external_work");
    checks.extend(watch.books_of(scheme));
    if jump > 0.0 {
        checks.push(Check::at_most(
            "energy beyond the work of the casing",
            energy(&simulation) / supplied - 1.0,
            if scheme == Scheme::MasslessBoundary { MASSLESS_RETURN } else { 1e-9 },
        ));
    } else {
        checks.push(Check::so("nothing moves", energy(&simulation) == 0.0 && supplied == 0.0));
    }
    Ok(checks)
}

fn restore() -> Vec<Case> {
    let mut cases = Vec::new();
    for (solver, name) in SOLVERS {
        for (scheme, scheme_name) in SCHEMES {
            let expected = Expected::right("the same bits as where it was saved, whatever the parameters there were");
            cases.add(true, format!("restore/other-parameters/{scheme_name}/{name}"), expected, move || {
                elsewhere(scheme, solver)
            });
        }
    }
    let expected = Expected::right("refused, set back, and then the same bits as of a fresh instance");
    cases.push(Case::new("restore/refused-scheme", expected, |_| Happened::of(after_refusal())).quick(true));
    let expected = Expected::right("a warning for the step taken, once; none for the step proposed");
    cases.push(Case::new("communication/other-step-than-proposed", expected, |_| Happened::of(told())).quick(true));
    let expected = Expected::refused(["another scene"]);
    cases.push(Case::new("restore/other-scene", expected, |_| Happened::of(other_scene())).quick(true));
    cases
}

fn elsewhere(scheme: Scheme, solver: Solver) -> Result<Vec<Check>> {
    let scene = rub(scheme, solver, STEP);
    let mut simulation = Simulation::new(&scene)?;
    simulation.initialise(0.0)?;
    for _ in 0..40 {
        simulation.do_step(simulation.time(), 3e-5)?;
    }
    let mut state = vec![0; simulation.state_size()];
    simulation.save_state(&mut state)?;
    // Another instance of the same scene with everything else, which has been elsewhere.
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
    Ok(vec![Check::so("all outputs the same bit by bit over 40 steps", same)])
}

/// A scheme that leaves no mode, asked for and taken back as an FMU does in Initialization Mode.
fn after_refusal() -> Result<Vec<Check>> {
    // As many modes as three contact nodes have directions.
    let mut scene = rub(Scheme::ModalExact, Solver::Lcp, STEP);
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
        Check::so("massless-boundary is refused", refused),
        Check::so("the bits of a fresh instance", bits(&simulation) == bits(&fresh)),
    ])
}

/// Steps longer than the scene proposes, across the step that resolves all modes.
fn told() -> Result<Vec<Check>> {
    let tower = Tower::default();
    let resolved = 2.0 / tower.largest_frequency();
    let mut scene = with_methods(with_step(round(tower.rom()), 1.6 * resolved), Scheme::ModalExact, Solver::Lcp);
    scene.settings.experiment.communication_step = 0.9 * resolved;
    let mut simulation = Simulation::new(&scene)?;
    simulation.initialise(0.0)?;
    let before = simulation.warnings().len();
    let mut told = Vec::new();
    for factor in [0.9, 1.3, 1.3, 0.9] {
        simulation.do_step(simulation.time(), factor * resolved)?;
        told.push(simulation.take_notes().len());
    }
    Ok(vec![
        Check::so("no warning for the step proposed", before == 0),
        Check::so("one for the first longer step", told == [0, 1, 0, 0]),
    ])
}

fn other_scene() -> Result<Vec<Check>> {
    let scene = rub(Scheme::ModalExact, Solver::Lcp, STEP);
    let mut changed = scene.clone();
    changed.roms[0].stiffness[(0, 0)] *= 1.0 + 1e-15;
    let [first, mut second] = [Simulation::new(&scene)?, Simulation::new(&changed)?];
    let mut state = vec![0; first.state_size()];
    first.save_state(&mut state)?;
    second.restore_state(&state)?;
    Ok(vec![Check::so("it was restored", true)])
}
