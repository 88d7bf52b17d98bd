//! Free bodies among plates: balances of momentum and energy, left and right, edges, rejected starts.

use tiprub_core::scene::method::{Scheme, Solver};
use tiprub_core::{CoSimulation, Result};

use super::{
    super::{
        Cases, Check, Expected, StabilityCase,
        bodies::{HALF, LumpChain, PLATE, Plate, Throw, vector},
        models::StabilityMethod,
        observe::{outputs, real, worse},
    },
    free::{STEP, apart, methods, size, started, throw, unless_few_modes},
};

/// Returns all cases of this family.
pub(crate) fn cases() -> Vec<StabilityCase> {
    [balances(), mirrors(), edges(), starts()].into_iter().flatten().collect()
}

/// A body between two elastic plates, one of them curved.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Balance {
    /// Method.
    pub method: StabilityMethod,
    /// Coefficient µ.
    pub friction: f64,
    /// Speed (m/s).
    pub speed: f64,
    /// Fraction of the mass in the balance: a value other than 1 must be detected.
    pub share: f64,
}

fn balances() -> Vec<StabilityCase> {
    let mut cases = Vec::new();
    for method in methods() {
        for friction in [0.0, 0.15, 1.0] {
            for speed in [0.01, 1.0, 10.0, 100.0] {
                let balance = Balance { method, friction, speed, share: 1.0 };
                // At 100 m/s the dents in the plates exceed the limit of small displacements.
                let against = "momentum and energy balance, sum of the pair forces, energy loss in contact";
                let displaced: &[&str] =
                    &["left_plate, which carries a surface, is displaced", "Check positions and velocity"];
                // Sliding stops at the impact, which laws without sticking do not describe: they end beyond 1 % of the energy exchanged.
                let sliding: &[&str] = &["friction has added", "less friction"];
                let slides = friction >= 1.0 && method.solver != Solver::Coulomb;
                let expected = match (speed > 50.0, slides) {
                    (true, true) => Expected::refused_as(&[displaced, sliding]),
                    (true, false) => Expected::refused_as(&[displaced]),
                    (false, true) => Expected::either_as(against, &[sliding]),
                    (false, false) => Expected::right(against),
                };
                let expected = unless_few_modes(method, expected);
                let name = format!("free/balance/µ={friction}/v={speed}/{}", method.name());
                let quick = method.scheme == Scheme::ModalExact && friction > 0.0 && friction < 1.0;
                cases.add(quick && method.solver == Solver::Lcp, name, expected, move || balance.run());
            }
        }
    }
    cases
}

impl Balance {
    /// Lets the body fly back and forth.
    ///
    /// # Errors
    /// A rejected scene.
    pub(crate) fn run(self) -> Result<Vec<Check>> {
        let body = LumpChain::elastic(&[0.1, 0.15, 0.05], 2e7);
        let mass = body.mass() * self.share;
        let gap = 30.4 * self.speed * STEP;
        let left = Plate { stiffness: 1e7, ..Plate::left(HALF + gap) };
        let right = Plate { stiffness: 3e7, radius: 0.18, ..Plate::right(HALF + 1.3 * gap) };
        let velocity = [-self.speed, 0.5 * self.speed, 0.1 * self.speed];
        let throw = Throw { friction: self.friction, method: self.method, ..throw(body, velocity, vec![left, right]) };
        let mut simulation = started(&throw)?;
        let (mut impulse, mut exchanged, mut off, mut sums) = ([0.0_f64; 3], 0.0_f64, 0.0_f64, 0.0_f64);
        let (mut residual, mut fallen, mut before, mut finite) = (0.0_f64, 0.0_f64, 0.0, true);
        let energy = 0.5 * mass * size(velocity).powi(2);
        for _ in 0..400 {
            simulation.do_step(simulation.time(), STEP)?;
            let [force, first, second] =
                ["force", "left_face.force", "right_face.force"].map(|name| vector(&simulation, name));
            sums = worse(sums, apart(force, std::array::from_fn(|i| first[i] + second[i])) / size(force).max(1e-300));
            impulse = std::array::from_fn(|i| impulse[i] + STEP * force[i]);
            exchanged += STEP * size(force);
            let now = vector(&simulation, "body.velocity");
            let change = std::array::from_fn(|i| mass * (now[i] - velocity[i]));
            off = worse(off, apart(change, impulse) / (exchanged + mass * self.speed));
            residual = worse(residual, real(&simulation, "energy_residual_relative").abs());
            let lost = real(&simulation, "impact_loss");
            (fallen, before) = (worse(fallen, (before - lost) / energy), lost);
            finite &= outputs(&simulation).iter().all(|value| value.is_finite());
        }
        let curved = real(&simulation, "curvature_work");
        let mut checks = vec![
            Check::so("both plates were hit, or one plate twice", exchanged > 1.05 * mass * self.speed),
            Check::at_most("deviation of the change of momentum from the impulse", off, 1e-12),
            Check::at_most("deviation of the sum of the pair forces from the total", sums, 1e-12),
            Check::at_most("energy residual", residual, 1e-10),
            Check::so("all outputs finite", finite),
        ];
        if self.method.solver != Solver::Film {
            checks.push(Check::at_most("decrease of the impact loss", fallen, 1e-9));
        }
        let held = real(&simulation, "kinetic_energy") + real(&simulation, "strain_energy");
        checks.push(Check::at_most("energy gain without curvature work", (held - curved) / energy - 1.0, 1e-9));
        Ok(checks)
    }
}

fn mirrors() -> Vec<StabilityCase> {
    let mut cases = Vec::new();
    for method in methods() {
        for friction in [0.0, 0.15, 0.5] {
            let expected =
                unless_few_modes(method, Expected::right("equal on the left and right, no transverse force"));
            let name = format!("free/symmetric/µ={friction}/{}", method.name());
            let quick = method.scheme == Scheme::ModalExact && method.solver != Solver::Film && friction > 0.2;
            cases.add(quick, name, expected, move || symmetric(method, friction));
        }
    }
    cases
}

/// Compares left and right for a body 0.2 mm too wide on each side that is thrown between two cylinders.
fn symmetric(method: StabilityMethod, friction: f64) -> Result<Vec<Check>> {
    let plate = |side: f64| Plate { side, radius: 0.18, stiffness: 1e7, ..Plate::left(HALF - 2e-4) };
    let body = LumpChain::elastic(&[0.1, 0.1, 0.1], 2e7).at([0.0, 0.045, 0.0]);
    let throw = Throw { friction, method, ..throw(body, [0.0, -40.0, 0.0], vec![plate(-1.0), plate(1.0)]) };
    let mut simulation = started(&throw)?;
    let (mut off, mut largest, mut across, mut pushed) = (0.0_f64, 0.0_f64, 0.0_f64, 0.0_f64);
    for _ in 0..80 {
        simulation.do_step(simulation.time(), 10.0 * STEP)?;
        let row = |node: usize, i: usize| simulation.system().bank().row(3 * node + i, 0);
        for node in 0..4 {
            let sides = [row(node, 0) + row(node + 4, 0), row(node, 1) - row(node + 4, 1)];
            off = sides.iter().fold(off, |most, side| worse(most, side.abs()));
            largest = worse(largest, row(node, 0).abs());
        }
        across = worse(across, vector(&simulation, "force")[0].abs());
        pushed = pushed.max(vector(&simulation, "left_face.force")[0].abs());
    }
    // Gauss-Seidel handles the contacts one after the other and ends at its tolerance.
    let bound = if method.solver == Solver::Coulomb && friction > 0.0 { 1e-7 } else { 1e-9 };
    Ok(vec![
        Check::so("the body was squeezed", pushed > 100.0),
        Check::at_most("difference of the positions", off / largest, bound),
        Check::at_most("transverse force", across / pushed, bound),
    ])
}

fn edges() -> Vec<StabilityCase> {
    let mut cases = Vec::new();
    // From beyond the edge y = 0.09 m inwards, with the face this far in front of the plate.
    let beyond = PLATE + HALF + 1e-4;
    for (solver, name) in Solver::ALL.map(|solver| (solver, solver.name())) {
        for (what, front, velocity) in [
            ("behind-0.2mm", -2e-4, [0.0, -40.0, 0.0]),
            ("behind-0.2µm", -2e-7, [0.0, -40.0, 0.0]),
            ("behind-0.2mm-fast", -2e-4, [0.0, -3000.0, 0.0]),
            ("in-front", 3e-4, [0.0, -40.0, 0.0]),
            ("in-front-by-1nm", 1e-9, [0.0, -40.0, 0.0]),
            ("hits-the-edge", 1e-5, [-4.0, -40.0, 0.0]),
        ] {
            let expected = if front < 0.0 {
                Expected::refused(["left_", "has passed the edge", "Extend the contact grid"])
            } else if velocity[0] < 0.0 {
                Expected::right("impact: momentum balance, no energy gain")
            } else {
                Expected::right("passes without a force at constant velocity")
            };
            cases.add(true, format!("free/edge/{what}/{name}"), expected, move || {
                edge(solver, [0.0, beyond, 0.0], HALF + front, velocity)
            });
        }
        for clearance in [1e-3, 1e-9, 1e-15] {
            let expected = Expected::right("passes without a force at constant velocity");
            cases.add(true, format!("free/grazing/{clearance:e}/{name}"), expected, move || {
                edge(solver, [0.0; 3], HALF + clearance, [0.0, -40.0, 7.0])
            });
        }
    }
    cases
}

fn edge(solver: Solver, centre: [f64; 3], distance: f64, velocity: [f64; 3]) -> Result<Vec<Check>> {
    let throw = Throw {
        friction: 0.15,
        method: StabilityMethod::exact(solver),
        ..throw(LumpChain::rigid(0.3).at(centre), velocity, vec![Plate::left(distance)])
    };
    let mut simulation = started(&throw)?;
    let (mut impulse, mut residual) = ([0.0_f64; 3], 0.0_f64);
    for _ in 0..600 {
        simulation.do_step(simulation.time(), STEP)?;
        let force = vector(&simulation, "force");
        impulse = std::array::from_fn(|i| impulse[i] + STEP * force[i]);
        residual = worse(residual, real(&simulation, "energy_residual_relative").abs());
    }
    let now = vector(&simulation, "body.velocity");
    let change: [f64; 3] = std::array::from_fn(|i| 0.3 * (now[i] - velocity[i]));
    let all = 0.3 * size(velocity);
    let mut checks = vec![
        Check::at_most("deviation of the change of momentum from the impulse", apart(change, impulse) / all, 1e-12),
        Check::at_most("energy residual", residual, 1e-12),
        Check::at_most("energy gain", size(now) / size(velocity) - 1.0, 1e-12),
    ];
    checks.push(if velocity[0] < 0.0 {
        Check::at_most("velocity into the plate", now[0].abs() / size(velocity), 1e-9)
    } else {
        Check::so("no force", size(impulse) == 0.0)
    });
    Ok(checks)
}

fn starts() -> Vec<StabilityCase> {
    let rigid = || throw(LumpChain::rigid(1.0), [-1.0, 0.0, 0.0], vec![Plate::left(0.021)]);
    let elastic = || throw(LumpChain::elastic(&[0.1, 0.2, 0.1], 1e7), [-1.0, 0.0, 0.0], vec![Plate::left(0.021)]);
    let fastest = (1e7_f64 * (1.0 / 0.1 + 2.0 / 0.2)).sqrt();
    let scheme = |scheme: Scheme| StabilityMethod { scheme, ..StabilityMethod::exact(Solver::Lcp) };
    let central =
        |factor: f64| Throw { method: scheme(Scheme::CentralDifference), step: factor * 2.0 / fastest, ..elastic() };
    let refused: Vec<(&str, Throw, Expected)> = vec![
        (
            "inside",
            Throw { plates: vec![Plate::left(0.0199)], ..rigid() },
            Expected::refused(["4 contact nodes start inside", "Move one of the structures"]),
        ),
        (
            "deep-inside",
            Throw { plates: vec![Plate::left(-1.0)], ..rigid() },
            Expected::refused(["start inside", "Move"]),
        ),
        (
            "massless",
            Throw { method: scheme(Scheme::MasslessBoundary), ..elastic() },
            Expected::refused(["massless-boundary", "Use \"modal-exact\""]),
        ),
        (
            "held",
            Throw { body: LumpChain { ground: 1e5, ..elastic().body }, ..elastic() },
            Expected::refused(["the structure is constrained", "without supports"]),
        ),
        ("step-beyond-limit", central(1.001), Expected::refused(["central-difference", "ω_max", "internal step"])),
        ("step-far-beyond-limit", central(30.0), Expected::refused(["central-difference", "ω_max", "internal step"])),
        (
            "infinite-velocity",
            Throw { velocity: [f64::INFINITY, 0.0, 0.0], ..rigid() },
            Expected::refused(["velocity", "finite"]),
        ),
        (
            "NaN-velocity",
            Throw { velocity: [0.0, f64::NAN, 0.0], ..rigid() },
            Expected::refused(["velocity", "finite"]),
        ),
        (
            "no-mass",
            Throw { body: LumpChain::rigid(0.0), ..rigid() },
            Expected::refused(["mass", "not positive definite"]),
        ),
        (
            "negative-mass",
            Throw { body: LumpChain::rigid(-1.0), ..rigid() },
            Expected::refused(["mass", "not positive definite"]),
        ),
        ("too-much-friction", Throw { friction: 2.1, ..rigid() }, Expected::refused(["friction", "between 0 and 2"])),
    ];
    let case = |(name, throw, expected): (&str, Throw, Expected)| {
        StabilityCase::new(format!("free/start/{name}"), expected, move |_: &_| {
            super::super::CaseEnd::of(begin(&throw))
        })
        .quick(true)
    };
    let mut cases: Vec<StabilityCase> = refused.into_iter().map(case).collect();
    for factor in [0.9, 0.999] {
        let throw = central(factor);
        let expected = Expected::right("momentum balance near the step limit");
        cases.add(true, format!("free/start/step={factor}-of-limit"), expected, move || begin(&throw));
    }
    cases
}

/// Performs a few hundred steps with their balance.
fn begin(throw: &Throw) -> Result<Vec<Check>> {
    let mut simulation = started(throw)?;
    let (mut impulse, mut residual) = (0.0, 0.0_f64);
    for _ in 0..300 {
        simulation.do_step(simulation.time(), throw.step)?;
        impulse += throw.step * real(&simulation, "force_x");
        residual = worse(residual, real(&simulation, "energy_residual_relative").abs());
    }
    let change = throw.body.mass() * (vector(&simulation, "body.velocity")[0] - throw.velocity[0]);
    Ok(vec![
        Check::so("there is contact", impulse > 0.0),
        Check::relative("deviation of the change of momentum from the impulse", change, impulse, 1e-11),
        Check::at_most("energy residual", residual, 1e-11),
    ])
}
