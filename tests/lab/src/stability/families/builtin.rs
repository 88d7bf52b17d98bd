//! Built-in models: rotor 37 and the coupled stage in its elastic casing, and inconsistent ROMs.

use tiprub_core::scene::method::{Scheme, Solver};
use tiprub_core::{CoSimulation, Result, Rom, Scene, Simulation};
use tiprub_gallery::{builtin, rom_cache::RomCache, scene_source};
use tiprub_shell::console::Console;

use super::{
    super::{
        CaseEnd, Cases, Check, Expected, StabilityCase,
        models::{StabilityMethod, Tower, round, with_step},
        observe::{StabilityWatch, apart, begin, displacements, set},
        press::Press,
    },
    limits::massless_step,
};

/// Returns all cases of this family.
pub(crate) fn cases() -> Vec<StabilityCase> {
    [rotor37(), stage(), exchanged()].into_iter().flatten().collect()
}

fn model(name: &str) -> Option<Rom> {
    builtin::rom(name, &RomCache::of_user(), &Console::new(true, false))?.ok()
}

fn rotor37() -> Vec<StabilityCase> {
    let mut cases = Vec::new();
    for method in StabilityMethod::all() {
        let factors: &[f64] = if method.is_adaptive() { &[1.0] } else { &[0.9, 0.999, 1.001, 1.5, 10.0, 100.0] };
        for factor in factors.iter().copied() {
            let name = format!("rotor37/step-limit/{}/h={factor}", method.name());
            let against = "static contact of all 36 blades, signs of the energy terms";
            let expected = match method.scheme {
                Scheme::CentralDifference if factor > 1.0 => Expected::refused(["central-difference", "ω_max"]),
                Scheme::MasslessBoundary if factor > 1.0 => Expected::refused(["massless-boundary"]),
                Scheme::ModalExact if factor > 50.0 => Expected::refused(["modal-exact", "contact flexibility"]),
                // Steps of several periods: film closes all patches, with tensile forces at those that the static
                // solution opens.
                Scheme::ModalExact if method.solver == Solver::Film && factor > 5.0 => {
                    Expected::refused(["film", "tensile impulse at contact node", "lcp"])
                }
                _ => Expected::right(against),
            };
            let work = move |_: &_| at_limit(method, factor);
            cases.push(StabilityCase::new(name, expected, work).within(300.0));
        }
    }
    for share in [0.1, 0.2, 0.24, 0.3, 0.39, 0.5, 0.6, 0.79] {
        for damping in [0.005, 0.05, 0.3] {
            let name = format!("rotor37/massless/{share}-of-limit/ξ={damping}");
            let expected = Expected::either("static contact", ["massless-boundary", "internal step"]);
            let work = move |_: &_| share_of_limit(share, damping);
            cases.push(StabilityCase::new(name, expected, work).within(300.0));
        }
    }
    for method in StabilityMethod::common() {
        for friction in [0.0, 0.15, 0.5, 1.0, 1.5, 2.0] {
            for sense in [1.0, -1.0] {
                let sign = if sense > 0.0 { '+' } else { '−' };
                let name = format!("rotor37/friction/µ={friction}/{}/{sign}Ω", method.name());
                // Rejected at the start by µ, or ended in a step because of friction.
                let against = "agreement with a finer run, complementarity";
                let expected = Expected::either_as(against, &[&["µ"], &["less friction"]]);
                let work = move |_: &_| CaseEnd::of(rubbed(method, friction, sense));
                cases.push(StabilityCase::new(name, expected, work).within(300.0));
            }
        }
    }
    // Steps at which growth by the mass of contact nodes varies, whatever its effect on the run.
    for method in StabilityMethod::common().filter(|method| method.solver == Solver::Lcp && !method.is_adaptive()) {
        for friction in [0.15, 0.4, 0.8] {
            for step in [5e-7, 1e-6, 2e-6, 4e-6] {
                let expected = Expected::either_as("agreement with a finer run", &[&["time.step"], &["µ below"]]);
                let name = format!("rotor37/growth/µ={friction}/h={step:e}/{}", method.integration());
                let work = move |_: &_| CaseEnd::of(grown(method, friction, step));
                cases.push(StabilityCase::new(name, expected, work).within(300.0));
            }
        }
    }
    cases
}

/// Rubs against bumps that do not move.
fn grown(method: StabilityMethod, friction: f64, step: f64) -> Result<Vec<Check>> {
    let Some(rom) = model("rotor37-one-row") else { return Ok(Vec::new()) };
    let mut scene = super::super::models::bumps(rom);
    scene.settings.contacts[0].friction = friction;
    scene.settings.structures[0].speed = 1800.0;
    scene.settings.surfaces[0].moving = false;
    against_finer(&scene, method, step, 150, 0.1)
}

fn at_limit(method: StabilityMethod, factor: f64) -> CaseEnd {
    let Some(rom) = model("rotor37-one-row") else { return CaseEnd::refused("the model of rotor 37 is missing") };
    let fastest =
        tiprub_core::modes::modal::ModalModel::from_rom(&rom, 0.0).map_or(f64::NAN, |model| model.largest_frequency());
    let mut scene = method.on(round(rom));
    scene.settings.structures[0].damping_ratio = Some(0.3);
    let limit = match method.scheme {
        Scheme::MasslessBoundary => massless_step(&scene),
        _ => Some(2.0 / fastest),
    };
    let Some(limit) = limit else { return CaseEnd::refused("the message does not state a limit") };
    let press = Press { depth: 2e-5, ..Press::new(with_step(scene, method.step(factor * limit))) };
    CaseEnd::of(press.run())
}

/// Runs with a fraction of the limit of closed contact that an error contains.
fn share_of_limit(share: f64, damping: f64) -> CaseEnd {
    // With few nodes: lightly damped blades need a second of steps near the limit to come to rest.
    let Some(rom) = model("rotor37-paper") else { return CaseEnd::refused("the model of rotor 37 is missing") };
    let method = StabilityMethod { scheme: Scheme::MasslessBoundary, ..StabilityMethod::exact(Solver::Lcp) };
    let mut scene = method.on(round(rom));
    scene.settings.structures[0].damping_ratio = Some(damping);
    let long = with_step(scene.clone(), 1e-2);
    let refusal = Simulation::new(&long)
        .and_then(|mut simulation| simulation.initialise(0.0))
        .err()
        .map(|error| error.to_string());
    let limit = refusal
        .as_deref()
        .and_then(|text| text.split("stable only below ").nth(1)?.split(' ').next()?.parse::<f64>().ok());
    let Some(limit) = limit else { return CaseEnd::refused("the message does not state a limit") };
    let press = Press {
        depth: 2e-5,
        hold: 12e-3 * (0.3 / damping).max(1.0),
        tolerance: 1e-4,
        ..Press::new(with_step(scene, share * limit))
    };
    CaseEnd::of(press.run())
}

fn rubbed(method: StabilityMethod, friction: f64, sense: f64) -> Result<Vec<Check>> {
    let Some(rom) = model("rotor37-one-row") else { return Ok(Vec::new()) };
    let mut scene = super::super::models::bumps(rom);
    scene.settings.contacts[0].friction = friction;
    scene.settings.structures[0].speed = 1800.0 * sense;
    against_finer(&scene, method, 5e-7, 150, 0.1)
}

/// Compares a scene with the same scene with a fourth of the step, or a sixteenth of the tolerance.
fn against_finer(scene: &Scene, method: StabilityMethod, step: f64, count: usize, bound: f64) -> Result<Vec<Check>> {
    let run = |method: StabilityMethod, step: f64| -> Result<(Vec<f64>, StabilityWatch)> {
        let mut scene = method.stepping(scene.clone(), step);
        scene.settings.experiment.communication_step = 1e-5;
        let (mut simulation, mut watch) = begin(&scene)?;
        let mut history = Vec::new();
        for _ in 0..count {
            watch.step(&mut simulation, 1e-5)?;
            history.extend(displacements(&simulation));
        }
        Ok((history, watch))
    };
    let (better, parts) = method.finer();
    let (coarse, watch) = run(method, step)?;
    let (fine, finer) = run(better, step / parts)?;
    let mut checks = vec![
        Check::at_most("deviation of the displacements from the finer run", apart(&coarse, &fine), bound),
        Check::so("the blades touched", watch.contacts > 0 && finer.contacts > 0),
        watch.ledger(),
        finer.ledger(),
        Check::so("all outputs finite", watch.finite),
    ];
    if method.solver != Solver::Film {
        checks.extend(watch.complementarity());
        checks.push(watch.impact(if method.is_massless() { 2e-2 } else { 1e-9 }));
    }
    Ok(checks)
}

fn stage() -> Vec<StabilityCase> {
    let mut cases = Vec::new();
    for method in StabilityMethod::common() {
        for friction in [0.0, 0.15, 1.0, 2.0] {
            let expected = Expected::either("agreement with a finer run, complementarity", ["µ"]);
            let name = format!("stage/oval/µ={friction}/{}", method.name());
            let work = move |_: &_| CaseEnd::of(on_stage(method, friction, 1.35e5));
            cases.push(StabilityCase::new(name, expected, work).within(600.0));
        }
        for load in [1e7, 1e9, 1e12, 1e300] {
            let expected = Expected::refused_as(&[
                &["initial state", "start values of", "loads"],
                &["casing is displaced", "Check its loads"],
                &["initial clearance", "start inside the casing", "load"],
                &["casing_load_amplitude", "within"],
                &["load.amplitude", "between"],
            ]);
            let name = format!("stage/load={load:e}/{}", method.name());
            let work = move |_: &_| CaseEnd::of(on_stage(method, 0.15, load));
            cases.push(StabilityCase::new(name, expected, work).within(600.0));
        }
    }
    cases
}

fn on_stage(method: StabilityMethod, friction: f64, load: f64) -> Result<Vec<Check>> {
    let mut scene = scene_source::stage_scene(true, &RomCache::of_user(), &Console::new(true, false))
        .map_err(|failure| tiprub_core::Error::invalid("builtin:stage", failure.to_string(), ""))?;
    scene.settings.contacts[0].friction = friction;
    scene.settings.surfaces[0].ramp_time = 1e-3;
    if load > 1e6 {
        scene.settings.structures[1].load = scene.settings.structures[1]
            .load
            .map(|old| tiprub_core::scene::settings::LoadSettings { amplitude: load, ..old });
    }
    // High friction makes contact unstable: small steps, before the runs diverge.
    let (step, count) = if friction > 0.5 { (2.5e-7, 60) } else { (2e-6, 120) };
    against_finer(&scene, method, step, count, 0.1)
}

fn exchanged() -> Vec<StabilityCase> {
    let mut cases = Vec::new();
    for (name, swap) in [("exchanged", true), ("as-they-are", false)] {
        let expected = if swap {
            Expected::refused(["harmonics", "nodal diameter"])
        } else {
            Expected::right("it starts and steps")
        };
        cases.add(true, format!("rom/harmonics-{name}"), expected, move || harmonics(swap));
    }
    cases
}

/// Checks a disk whose checks contain the frequencies of each nodal diameter, with two of its harmonics exchanged if
/// `swap`.
fn harmonics(swap: bool) -> Result<Vec<Check>> {
    let tower = Tower { sectors: 8, neighbour: 1e6, ..Tower::default() };
    let mut rom = tower.rom();
    let disk = tiprub_core::modes::cyclic::CyclicModel::from_rom(&rom, 0.0)?;
    let mut all: Vec<(f64, u32)> = Vec::new();
    for (diameter, number) in disk.diameters.iter().zip(0_u32..) {
        all.extend(diameter.frequencies.iter().take(2).map(|omega| (omega / std::f64::consts::TAU, number)));
    }
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    rom.checks.reduced_frequencies = all.iter().map(|(frequency, _)| *frequency).collect();
    rom.checks.full_frequencies.clone_from(&rom.checks.reduced_frequencies);
    rom.checks.nodal_diameters = all.iter().map(|(_, diameter)| *diameter).collect();
    if swap {
        rom.extras.harmonics.swap(0, 2);
    }
    let scene = with_step(round(rom), 2e-6);
    let (mut simulation, mut watch) = begin(&scene)?;
    for _ in 0..200 {
        set(&mut simulation, "casing_radius_change", -1e-5)?;
        watch.step(&mut simulation, 2e-6)?;
    }
    Ok(watch.laws())
}
