//! Step sizes around the limits of the schemes, and stiffness that spans many orders of magnitude.

use tiprub_core::scene::method::{Scheme, Solver};
use tiprub_core::{CoSimulation, Scene, Simulation};

use super::super::{
    CaseEnd, Expected, StabilityCase,
    models::{StabilityMethod, Tower, blade, round, with_methods, with_step},
    press::Press,
};

const FACTORS: [f64; 5] = [0.9, 0.999, 1.001, 1.5, 10.0];

/// Returns all cases of this family.
pub(crate) fn cases() -> Vec<StabilityCase> {
    [step_limit(), ratios(), massless()].into_iter().flatten().collect()
}

/// Returns the largest usable step of massless-boundary (s), from its error for a long step.
pub(crate) fn massless_step(scene: &Scene) -> Option<f64> {
    let scene = with_step(with_methods(scene.clone(), Scheme::MasslessBoundary, Solver::Lcp), 1e-2);
    let refusal = Simulation::new(&scene).and_then(|mut simulation| simulation.initialise(0.0)).err()?.to_string();
    refusal.split("`internal_step_max`) below ").nth(1)?.split(' ').next()?.parse().ok()
}

fn step_limit() -> Vec<StabilityCase> {
    let mut cases = Vec::new();
    for method in StabilityMethod::all() {
        for (friction, model) in [(0.0, "tower"), (0.15, "tower"), (0.0, "blade"), (0.15, "blade")] {
            let against = "static contact, signs of the energy terms";
            let quick = model == "tower" && friction > 0.0 && method.solver == Solver::Lcp;
            if method.is_adaptive() {
                // The tolerance instead of the step.
                for tolerance in [1e-9, 1e-6, 1e-3, 0.1] {
                    let name = format!("step-limit/{}/{model}/µ={friction}/tolerance={tolerance:e}", method.name());
                    let work = move |_: &_| at(method.within(tolerance), friction, model, 1.0);
                    cases.push(StabilityCase::new(name, Expected::right(against), work).quick(quick));
                }
                continue;
            }
            for factor in FACTORS {
                let name = format!("step-limit/{}/{model}/µ={friction}/h={factor}", method.name());
                let expected = match method.scheme {
                    Scheme::Galerkin => Expected::right(against),
                    Scheme::CentralDifference if factor > 1.0 => Expected::refused(["central-difference", "ω_max"]),
                    Scheme::MasslessBoundary if factor > 1.0 => {
                        Expected::refused(["massless-boundary", "internal step"])
                    }
                    // Three nodes that push each other apart: film, which does not iterate, need not converge to the
                    // static solution.
                    _ if method.solver == Solver::Film && model == "blade" => Expected::either_as(
                        against,
                        &[
                            &["grows"],
                            &["film", "tensile impulse at contact node"],
                            &["kinetic and strain energy", "does not resolve"],
                        ],
                    ),
                    _ if friction > 0.0 && model == "blade" => Expected::either(against, ["grows"]),
                    // A mode near ωh = π may gain spurious energy.
                    Scheme::ModalExact if factor > 1.0 => {
                        Expected::either(against, ["kinetic and strain energy", "does not resolve"])
                    }
                    _ => Expected::right(against),
                };
                cases.push(
                    StabilityCase::new(name, expected, move |_| at(method, friction, model, factor)).quick(quick),
                );
            }
        }
    }
    cases
}

fn at(method: StabilityMethod, friction: f64, model: &str, factor: f64) -> CaseEnd {
    let tower = Tower::default();
    let rom = if model == "tower" { tower.rom() } else { blade(12) };
    let fastest = if model == "tower" { tower.largest_frequency() } else { rom.stiffness.diagonal().max().sqrt() };
    let mut scene = method.on(round(rom));
    scene.settings.contacts[0].friction = friction;
    // Without friction, so that the error is about the step.
    let limit = match method.scheme {
        Scheme::MasslessBoundary => {
            let mut pressed = scene.clone();
            pressed.settings.structures[0].damping_ratio = Some(0.3);
            massless_step(&pressed)
        }
        _ => Some(2.0 / fastest),
    };
    let Some(limit) = limit else { return CaseEnd::refused("the message does not state a limit") };
    CaseEnd::of(Press::new(with_step(scene, method.step(factor * limit))).run())
}

fn ratios() -> Vec<StabilityCase> {
    let mut cases = Vec::new();
    for exponent in 2..=8 {
        for method in StabilityMethod::all() {
            for kind in ["stiff node", "light node"] {
                let name = format!("stiffness/{}/1e{exponent}/{}", kind.replace(' ', "-"), method.name());
                let against = "static contact, signs of the energy terms";
                let expected = if method.is_massless() && kind == "stiff node" && exponent > 4 {
                    Expected::either(against, ["massless-boundary", "modes with inertia"])
                } else {
                    Expected::right(against)
                };
                let central = method.scheme == Scheme::CentralDifference;
                let quick = method.solver == Solver::Lcp && exponent % 3 == 2 && !central;
                let work = move |_: &_| ratio(kind, 10_f64.powi(exponent), method);
                cases.push(StabilityCase::new(name, expected, work).quick(quick).within(300.0));
            }
        }
    }
    cases
}

/// Compares models by the ratio of the squares of the highest to the lowest frequency: by stiffness, or by mass.
fn ratio(kind: &str, ratio: f64, method: StabilityMethod) -> CaseEnd {
    let soft = 4e6 / 0.1;
    let mut tower = Tower { sectors: 2, ..Tower::default() };
    if kind == "stiff node" {
        tower.tip = ratio * soft * tower.mass[1];
    } else {
        tower.mass[1] = tower.tip / (ratio * soft);
    }
    let mut scene = method.on(round(tower.rom()));
    scene.settings.contacts[0].friction = 0.15;
    let step = match method.scheme {
        scheme if scheme.properties().stable_below.is_finite() => {
            0.9 * scheme.properties().stable_below / tower.largest_frequency()
        }
        Scheme::MasslessBoundary => {
            scene.settings.structures[0].damping_ratio = Some(0.3);
            match massless_step(&scene) {
                // The family `massless` covers more of the range.
                Some(step) => (0.9 * step).min(5e-6),
                None => 5e-6,
            }
        }
        _ => method.step(5e-6),
    };
    CaseEnd::of(Press::new(with_step(scene, step)).run())
}

/// Returns cases of massless-boundary for various fractions of the limit of closed contact, tip stiffnesses and
/// damping: each must come to rest or be rejected.
fn massless() -> Vec<StabilityCase> {
    let mut cases = Vec::new();
    for share in [0.2, 0.24, 0.26, 0.5, 0.7, 0.79] {
        for exponent in 2..=7 {
            for damping in [0.02, 0.3] {
                let name = format!("massless/{share}-of-limit/tip-1e{exponent}/ξ={damping}");
                let expected = Expected::either("static contact", ["massless-boundary", "internal step"]);
                let work = move |_: &_| at_share(share, 10_f64.powi(exponent), damping);
                cases
                    .push(StabilityCase::new(name, expected, work).quick(exponent == 6 && damping > 0.1).within(300.0));
            }
        }
    }
    cases
}

fn at_share(share: f64, ratio: f64, damping: f64) -> CaseEnd {
    let mut tower = Tower { sectors: 2, ..Tower::default() };
    tower.tip = ratio * 4e7 * tower.mass[1];
    let mut scene = with_methods(round(tower.rom()), Scheme::MasslessBoundary, Solver::Lcp);
    scene.settings.structures[0].damping_ratio = Some(damping);
    // In closed contact both springs hold the base; modal-exact with the force a step late is stable while κ + cK < 4.
    let open = tower.base[0] / tower.mass[0];
    let closed = tower.tip / tower.mass[0];
    let unstable = |step: f64| {
        let sine = (0.5 * open.sqrt() * step).sin();
        let kappa = 4.0 * sine * sine;
        kappa + kappa / open * closed >= 4.0
    };
    let (mut low, mut high) = (0.0, 2.0 / closed.sqrt() * 1.5);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        *(if unstable(middle) { &mut high } else { &mut low }) = middle;
    }
    let mut press = Press::new(with_step(scene, share * low));
    press.hold = 12e-3 * 0.3 / damping;
    press.tolerance = 1e-4;
    CaseEnd::of(press.run())
}
