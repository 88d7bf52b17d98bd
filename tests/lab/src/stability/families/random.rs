//! A hundred scenes with random parameters within their documented ranges, each compared with the laws of mechanics and
//! a finer step.

use tiprub_core::scene::method::{Scheme, Solver};
use tiprub_core::scene::settings::Shape;
use tiprub_core::{CoSimulation, Result, Scene};

use super::super::{
    CaseEnd, Check, Expected, StabilityCase,
    models::{GAP, SeededRandom, StabilityMethod, Tower, blade, on_ring, round, with_methods, with_step},
    observe::{MASSLESS_RETURN, StabilityWatch, apart, begin, displacements, set},
};

/// Numbers of scenes in the quick table and in the full one.
const COUNT: [u64; 2] = [12, 100];

/// Returns all cases of this family.
pub(crate) fn cases() -> Vec<StabilityCase> {
    let case = |method: Option<StabilityMethod>, index: u64| {
        // The method of the scene, or another way to integrate it with its solver.
        let drawn = method_of(&scene(index).0);
        let method = method.map_or(drawn, |method| StabilityMethod { solver: drawn.solver, ..method });
        let against = "signs of the energy terms, complementarity, same result with a quarter of the step";
        let expected = Expected::either_as(
            against,
            &[
                &["displaced by more than a tenth", "Check gap, casing shape"],
                &["is displaced by", "u²/2r", "Check casing shape"],
                &["µ", "Use"],
                &["internal step", "below"],
                &["massless-boundary", "film"],
                &["friction has added", "not model sticking"],
                &["the contact problem", "no solution", "Use less friction"],
            ],
        );
        let name = format!("random/{index:03}/{}", method.name());
        let case = StabilityCase::new(name, expected, move |_| happened(method, index));
        // Some of them take as long as all others.
        case.quick(index < COUNT[0] && ![5, 9, 11].contains(&index)).within(300.0)
    };
    let mut cases: Vec<StabilityCase> = (0..COUNT[1]).map(|index| case(None, index)).collect();
    for method in StabilityMethod::all_with(Solver::Lcp).filter(|method| method.is_galerkin()) {
        cases.extend((0..COUNT[1]).map(|index| case(Some(method), index)));
    }
    cases
}

/// Returns the scene, and the amplitude and rate of the casing's oscillation (m, rad/s).
fn scene(index: u64) -> (Scene, f64, f64) {
    let mut random = SeededRandom(0x9e37_79b9_7f4a_7c15 ^ (index + 1).wrapping_mul(0xd134_2543_de82_ef95));
    for _ in 0..8 {
        random.unit();
    }
    let sectors = random.of(&[1_usize, 2, 3, 4, 6]);
    let rom = match random.of(&[0, 1, 2]) {
        0 => blade(sectors),
        kind => Tower {
            sectors,
            mass: [random.scale(0.01, 1.0), random.scale(1e-4, 5e-3)],
            base: [random.scale(1e6, 1e8), random.scale(1e6, 1e8), random.scale(1e6, 1e8)],
            tip: random.scale(1e7, 1e9),
            turned: random.within(-0.5, 0.5),
            slope: random.within(-0.5, 0.5),
            neighbour: if kind == 2 && sectors > 1 { random.scale(1e4, 1e7) } else { 0.0 },
            ..Tower::default()
        }
        .rom(),
    };
    let (scheme, solver) = (random.of(&Scheme::RECURRENCES), random.of(&Solver::ALL));
    let mut scene = with_methods(round(rom), scheme, solver);
    scene.settings.contacts[0].gap = random.scale(1e-5, 1e-3);
    scene.settings.contacts[0].friction = random.of(&[0.0, 0.05, 0.15, 0.3, 0.6]);
    scene.settings.structures[0].speed = random.of(&[1.0, -1.0]) * random.scale(100.0, 3000.0);
    scene.settings.structures[0].damping_ratio = Some(random.scale(1e-3, 0.5));
    if random.unit() < 0.3 {
        let gap = scene.settings.contacts[0].gap;
        let order = random.of(&[1_u32, 2, 3, 5]);
        scene.settings.surfaces[0].shape = Shape::Lobes { amplitude: 0.5 * gap, order, phase: random.within(0.0, 6.0) };
    }
    if random.unit() < 0.2 {
        on_ring(&mut scene, random.scale(1e-3, 0.3));
    }
    let step = random.scale(2e-7, 2e-6);
    let swing =
        scene.settings.contacts[0].gap * random.within(1.05, 1.6).min(1.0 + 1e-4 / scene.settings.contacts[0].gap);
    (with_step(scene, step), swing, random.scale(2000.0, 20_000.0))
}

/// Returns the method that was drawn for a scene.
fn method_of(scene: &Scene) -> StabilityMethod {
    StabilityMethod { scheme: scene.settings.time.scheme, ..StabilityMethod::exact(scene.settings.contacts[0].solver) }
}

fn happened(method: StabilityMethod, index: u64) -> CaseEnd {
    let (scene, ..) = scene(index);
    let contact = &scene.settings.contacts[0];
    let remark = format!(
        "{} sectors of {}, µ = {}, h = {:.1e} s",
        scene.roms[0].sectors, scene.roms[0].name, contact.friction, scene.settings.time.step
    );
    CaseEnd::of(checked(method, index)).remark(remark)
}

fn checked(method: StabilityMethod, index: u64) -> Result<Vec<Check>> {
    let massless = method.is_massless();
    let (coarse, watch) = run(method, index, 1.0)?;
    let (fine, finer) = run(method, index, 0.25)?;
    let (finest, _) = run(method, index, 0.0625)?;
    let (error, better) = (apart(&coarse, &finest), apart(&fine, &finest));
    let mut checks = vec![
        Check::so("the blades touched", watch.contacts > 0 && finer.contacts > 0),
        // Coarse steps may be inaccurate; finer ones must come closer.
        Check::at_most(
            "deviation of the displacements with h/4 from those with h/16, relative to that with h",
            better.min(better / error.max(1e-9) * 0.1),
            if massless { 0.1 } else { 0.05 },
        ),
        watch.ledger(),
        finer.ledger(),
        Check::so("all outputs finite", watch.finite),
    ];
    if method.solver != Solver::Film {
        checks.extend(watch.complementarity());
        checks.push(watch.impact(if massless { MASSLESS_RETURN } else { 1e-9 }));
    }
    // Film and lcp reverse the friction of a node that sticks for a moment with its vibration.
    let sticks = method.solver == Solver::Coulomb && !massless;
    checks.push(watch.heat(if sticks { 1e-9 } else { 1e-2 }));
    Ok(checks)
}

/// Runs 1.5 ms with the step, or the root of the tolerance, times `factor`; returns displacements every 50 µs.
fn run(method: StabilityMethod, index: u64, factor: f64) -> Result<(Vec<f64>, StabilityWatch)> {
    let (scene, swing, rate) = scene(index);
    let step = scene.settings.time.step * factor;
    let mut scene = method.within(1e-4 * factor * factor).stepping(scene, step);
    scene.settings.experiment.communication_step = 1e-5;
    let (mut simulation, mut watch) = begin(&scene)?;
    watch.scale = watch.scale.max(GAP);
    let mut history = Vec::new();
    for index in 0..150 {
        let time = 1e-5 * f64::from(index);
        let place = |time: f64| -swing * 0.5 * (1.0 - (rate * time).cos());
        // Linear within the communication step, so that all step sizes have the same casing.
        set(&mut simulation, "casing_radius_change", place(time))?;
        if let Some(row) = simulation.table().find("casing_radius_change").map(|row| row.reference) {
            simulation.set_input_derivative(row, 1, (place(time + 1e-5) - place(time)) / 1e-5)?;
        }
        watch.step_moving(&mut simulation, 1e-5)?;
        if index % 5 == 4 {
            history.extend(displacements(&simulation));
        }
    }
    Ok((history, watch))
}
