//! Single free bodies, also against one plate: flights, impacts, rebounds, from almost at rest to far too fast.

use tiprub_core::scene::method::{Scheme, Solver};
use tiprub_core::{CoSimulation, Result, Simulation};

use super::super::{
    CaseEnd, Cases, Check, Expected, StabilityCase,
    bodies::{FURTHEST, HALF, LumpChain, Plate, Throw, vector},
    models::{LONGEST, StabilityMethod},
    observe::{real, worse},
};
use super::decay::modes;

/// Internal step of most cases (s).
pub(crate) const STEP: f64 = 1e-6;
/// Returns the methods of free bodies.
pub(crate) fn methods() -> impl Iterator<Item = StabilityMethod> {
    StabilityMethod::all().filter(|method| !method.is_massless())
}

/// Expects a correct result, or the rule that excludes bodies with as few modes as contact nodes have directions.
pub(crate) fn unless_few_modes(method: StabilityMethod, expected: Expected) -> Expected {
    if method.is_galerkin() {
        Expected::refused(["galerkin", "more than three modes per contact node"])
    } else {
        expected
    }
}

/// Returns all cases of this family.
pub(crate) fn cases() -> Vec<StabilityCase> {
    [flights(), tunnels(), impacts(), rebounds(), bounces()].into_iter().flatten().collect()
}

/// Returns a throw without friction.
pub(crate) fn throw(body: LumpChain, velocity: [f64; 3], plates: Vec<Plate>) -> Throw {
    Throw { body, velocity, plates, friction: 0.0, method: StabilityMethod::exact(Solver::Lcp), step: STEP }
}

/// Initialises the simulation at time 0.
///
/// # Errors
/// A rejected scene.
pub(crate) fn started(throw: &Throw) -> Result<Simulation> {
    let mut simulation = Simulation::new(throw.scene())?;
    simulation.initialise(0.0)?;
    Ok(simulation)
}

/// Returns the length of a vector.
pub(crate) fn size(v: [f64; 3]) -> f64 {
    // Scaled, because squares of tiny or huge values leave the range of numbers.
    let largest = v.iter().fold(0.0, |most: f64, x| worse(most, x.abs()));
    if largest == 0.0 { 0.0 } else { largest * v.iter().map(|x| (x / largest).powi(2)).sum::<f64>().sqrt() }
}

/// Returns the length of a difference.
pub(crate) fn apart(a: [f64; 3], b: [f64; 3]) -> f64 {
    size(std::array::from_fn(|i| a[i] - b[i]))
}

fn flights() -> Vec<StabilityCase> {
    let mut cases = Vec::new();
    for method in methods().filter(|method| method.solver == Solver::Lcp) {
        let name = method.integration();
        let furthest = 0.999 * FURTHEST / method.step(STEP);
        for speed in [1e-100, 1e-12, 1e-6, 1.0, 1e3, furthest].into_iter().filter(|speed| *speed <= furthest) {
            for mass in [1e-12, 1e-3, 1.0, 1e12] {
                let expected = Expected::right("x = vt, constant velocity and energy, no contact");
                let quick = (0.5..2.0).contains(&mass) && speed > 0.5;
                let name = format!("free/flight/{speed:e}/m={mass:e}/{name}");
                cases.add(quick, name, expected, move || flight(method, speed, mass));
            }
        }
    }
    cases
}

fn flight(method: StabilityMethod, speed: f64, mass: f64) -> Result<Vec<Check>> {
    let velocity = [speed, -2.0 / 3.0 * speed, 0.1 * speed];
    // ω h is equal for any mass.
    let body = LumpChain::elastic(&[0.2 * mass, 0.5 * mass, 0.3 * mass], 1e9 * mass);
    let body = if method.is_galerkin() { body.with_middles() } else { body };
    let count = 2 * body.corners;
    let throw = Throw { method, ..throw(body, velocity, vec![Plate::left(9.0), Plate::right(9.0)]) };
    let mut simulation = started(&throw)?;
    let (mut off, mut nodes) = (0.0_f64, 0.0_f64);
    for _ in 0..300 {
        simulation.do_step(simulation.time(), 3.7 * STEP)?;
        let exact = velocity.map(|component| component * simulation.time());
        off = worse(off, apart(vector(&simulation, "body.displacement"), exact) / size(exact));
        let row = |node: usize| std::array::from_fn(|i| simulation.system().bank().row(3 * node + i, 0));
        nodes = (0..count).fold(nodes, |most, node| worse(most, apart(row(node), exact) / size(exact)));
    }
    let kinetic = 0.5 * mass * size(velocity).powi(2);
    // Adaptive steps round the velocity once per step; recurrences add increments of the displacement.
    let rounding = if method.is_galerkin() { 300.0 * 3.7 * f64::EPSILON } else { 1e-13 };
    Ok(vec![
        Check::at_most("deviation of the centre from x = vt", off, 1e-12),
        Check::at_most("largest deviation of a node from x = vt", nodes, 1e-12),
        Check::at_most(
            "deviation of the velocity",
            apart(vector(&simulation, "body.velocity"), velocity) / size(velocity),
            rounding,
        ),
        Check::at_most(
            "deviation of the kinetic energy",
            (real(&simulation, "kinetic_energy") - kinetic).abs() / kinetic.max(f64::MIN_POSITIVE),
            1e-12,
        ),
        Check::so("no impulse", real(&simulation, "normal_impulse") == 0.0),
    ])
}

fn tunnels() -> Vec<StabilityCase> {
    let mut cases = Vec::new();
    for (way, direction) in [("at-it", [-1.0, 0.0, 0.0]), ("along", [0.0, -1.0, 0.0]), ("oblique", [-1.0, 0.7, 0.7])] {
        for speed in [1.001 * FURTHEST / STEP, 1e4, 1e5, 1e6, 1e100, 1e308] {
            let expected = if speed > 1e5 {
                Expected::refused(["velocity", "between -100000 and 100000"])
            } else {
                Expected::refused(["in one internal step", "smaller internal step"])
            };
            let work = move |_: &_| {
                let body = LumpChain::rigid(1.0);
                let velocity = direction.map(|component| component * speed);
                CaseEnd::of(started(&throw(body, velocity, vec![Plate::left(0.06)])).and_then(|mut simulation| {
                    simulation.do_step(0.0, 10.0 * STEP)?;
                    Ok(vec![Check::so("the step was rejected", false)])
                }))
            };
            cases.push(StabilityCase::new(format!("free/tunnel/{way}/{speed:e}"), expected, work).quick(true));
        }
    }
    cases
}

/// A body of one mass that hits a plate obliquely.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Impact {
    /// Method.
    pub method: StabilityMethod,
    /// Speed towards the plate (m/s).
    pub speed: f64,
    /// Mass (kg).
    pub mass: f64,
    /// Coefficient µ.
    pub friction: f64,
    /// Speed along the plate, relative to the one towards it.
    pub along: f64,
    /// Fraction of the mass in the closed form: a value other than 1 must be detected.
    pub share: f64,
}

fn impacts() -> Vec<StabilityCase> {
    let mut cases = Vec::new();
    for method in methods() {
        for speed in [1e-6, 1e-3, 1.0, 100.0, 0.9 * FURTHEST / STEP] {
            for mass in [1e-12, 1.0, 1e12] {
                // Film and lcp model sliding only: bodies that friction stops require coulomb.
                for (friction, along) in [(0.0, 0.5), (0.15, 0.5), (0.49, 0.5), (1.0, 0.5), (2.0, 0.9), (0.15, 0.0)] {
                    if method.solver != Solver::Coulomb && friction > 0.9 * along {
                        continue;
                    }
                    let impact = Impact { method, speed, mass, friction, along, share: 1.0 };
                    let expected = Expected::right("impulses m v and µ m v, losses, remaining velocity");
                    let expected = unless_few_modes(method, expected);
                    let name = format!("free/impact/{speed:e}/m={mass:e}/µ={friction}/w={along}/{}", method.name());
                    let quick = (mass - 1.0).abs() < 0.5 && (speed - 1.0).abs() < 0.5 && method.solver != Solver::Film;
                    cases
                        .add(quick && method.scheme != Scheme::CentralDifference, name, expected, move || impact.run());
                }
            }
        }
    }
    cases
}

impl Impact {
    /// Lets the body fly, hit and slide on.
    ///
    /// # Errors
    /// A rejected scene.
    pub(crate) fn run(self) -> Result<Vec<Check>> {
        let (speed, mass, sideways) = (self.speed, self.mass * self.share, self.along * self.speed);
        let velocity = [-speed, 0.8 * sideways, -0.6 * sideways];
        let plate = Plate::left(HALF + 5.37 * speed * STEP);
        let throw = Throw {
            friction: self.friction,
            method: self.method,
            ..throw(LumpChain::rigid(self.mass), velocity, vec![plate])
        };
        let mut simulation = started(&throw)?;
        let (mut impulse, mut peak) = ([0.0_f64; 3], 0.0_f64);
        for _ in 0..12 {
            simulation.do_step(simulation.time(), STEP)?;
            let force = vector(&simulation, "force");
            impulse = std::array::from_fn(|i| impulse[i] + STEP * force[i]);
            peak = worse(peak, real(&simulation, "energy_residual_relative").abs());
        }
        let left = (sideways - self.friction * speed).max(0.0);
        let kept = if sideways > 0.0 { left / sideways } else { 0.0 };
        let after = [0.0, velocity[1] * kept, velocity[2] * kept];
        let exact: [f64; 3] = std::array::from_fn(|i| mass * (after[i] - velocity[i]));
        let energy = |v: f64| 0.5 * mass * v * v;
        // Positions round to 1e-17 m at any speed.
        let bound = 1e-9 + 1e-16 / (speed * STEP);
        let all = energy(speed) + energy(sideways);
        let mut checks = vec![
            Check::at_most(
                "deviation of the final velocity",
                apart(vector(&simulation, "body.velocity"), after) / speed,
                bound,
            ),
            Check::at_most(
                "deviation of the impulse from m v and µ m v",
                apart(impulse, exact) / (mass * speed),
                bound,
            ),
            Check::at_most(
                "deviation of the impact loss from m v²/2",
                (real(&simulation, "impact_loss") - energy(speed)).abs() / all,
                bound,
            ),
            Check::at_most(
                "deviation of the remaining energy",
                (real(&simulation, "kinetic_energy") - energy(left)).abs() / all,
                bound,
            ),
            Check::at_most("energy residual", peak, 1e-12),
        ];
        if self.friction > 0.0 {
            let heat = energy(sideways) - energy(left);
            checks.push(Check::at_most(
                "deviation of the friction heat",
                (real(&simulation, "friction_loss") - heat).abs() / all,
                bound,
            ));
        }
        Ok(checks)
    }
}

fn rebounds() -> Vec<StabilityCase> {
    let mut cases = Vec::new();
    for method in methods() {
        for ratio in [1e-6, 1e-2, 1.0, 10.0] {
            for speed in [1e-6, 1.0, 10.0] {
                // 10 m/s move the rear mass by 10 mm, above the limit of small displacements.
                let expected = if speed > 5.0 {
                    Expected::refused(["moved relative to each other", "Check positions and velocity"])
                } else {
                    Expected::right("contact for half a period of the rear mass, impulse (m₁ + 2m₂)v, loss m₁v²/2")
                };
                let expected = unless_few_modes(method, expected);
                let name = format!("free/rebound/m1:m2={ratio:e}/v={speed:e}/{}", method.name());
                let quick = method.solver == Solver::Lcp && (0.5..2.0).contains(&ratio);
                cases.add(quick, name, expected, move || rebound(method, ratio, speed));
            }
        }
    }
    cases
}

/// Returns cases of three masses with one node on each face, none of whose local modes has inertia with galerkin.
fn bounces() -> Vec<StabilityCase> {
    let mut cases = Vec::new();
    for method in methods().filter(|method| method.is_galerkin()) {
        for speed in [1e-6, 1e-3, 0.1, 1.0] {
            for friction in [0.0, 0.15] {
                let against =
                    "contact for half a period of the mass on the flexibility of the body, impulse 2Mv, no loss";
                // Nothing slides, and lcp models sliding only.
                let expected = if friction > 0.0 && method.solver == Solver::Lcp {
                    Expected::either(against, ["friction has added", "not model sticking"])
                } else {
                    Expected::right(against)
                };
                let name = format!("free/bounce/v={speed:e}/µ={friction}/{}", method.name());
                let quick = method.solver != Solver::Film && speed > 0.05;
                cases.add(quick, name, expected, move || bounce(method, speed, friction));
            }
        }
    }
    cases
}

/// Compares the bounce of a mass on the static flexibility G of its front node, which leaves a plate after π√(GM) at
/// its approach speed.
fn bounce(method: StabilityMethod, speed: f64, friction: f64) -> Result<Vec<Check>> {
    let body = LumpChain::elastic(&[0.05, 0.1, 0.05], 1e6).with_middles();
    let (rom, mass) = (body.rom(), body.mass());
    let (frequencies, shapes) = modes(&rom.mass, &rom.stiffness);
    let flexible: f64 = (3..9).map(|mode| (shapes[(0, mode)] / frequencies[mode]).powi(2)).sum();
    let held = std::f64::consts::PI * (flexible * mass).sqrt();
    let deepest = speed * (flexible * mass).sqrt();
    let plate = Plate::left(HALF + 0.37 * speed * LONGEST);
    let throw = Throw { method, friction, ..throw(body, [-speed, 0.0, 0.0], vec![plate]) };
    let mut simulation = started(&throw)?;
    let (mut impulse, mut residual) = (0.0, 0.0_f64);
    let length = method.step(STEP);
    while simulation.time() < 2.0 * held + LONGEST {
        simulation.do_step(simulation.time(), length)?;
        impulse += length * real(&simulation, "force_x");
        residual = worse(residual, real(&simulation, "energy_residual_relative").abs());
    }
    // Its position after half a period at the plate, plus the flight since then.
    let place = -0.37 * speed * LONGEST + speed * (simulation.time() - 0.37 * LONGEST - held);
    let bound = BOUNCED + ROUNDED / deepest;
    Ok(vec![
        Check::relative("deviation of the impulse from 2Mv", impulse, 2.0 * mass * speed, bound),
        Check::relative("deviation of the final velocity", vector(&simulation, "body.velocity")[0], speed, bound),
        Check::at_most(
            "deviation of the final position from that after half a period",
            (vector(&simulation, "body.displacement")[0] - place).abs() / deepest,
            bound,
        ),
        Check::at_most("energy residual", residual, 1e-10),
    ])
}

/// Relative error of a bounce, from the tolerance of its steps.
const BOUNCED: f64 = 1e-4;
/// Distance caused by precision and rounding of gaps (m): a thousandth of the tolerance.
const ROUNDED: f64 = 4e-12;

/// Compares two masses: the plate stops the front one, the rear one moves back on the spring and pulls it off after T =
/// π/ω.
fn rebound(method: StabilityMethod, ratio: f64, speed: f64) -> Result<Vec<Check>> {
    let (rear, spring) = (0.1, 1e5);
    let front = ratio * rear;
    let (omega, fastest) = ((spring / rear).sqrt(), (spring * (1.0 / rear + 1.0 / front)).sqrt());
    let step = (2e-3 / omega).min(0.5 / fastest).min(STEP);
    let body = LumpChain::elastic(&[front, rear], spring);
    let gap = 10.37 * speed * step;
    let throw = Throw { method, step, ..throw(body, [-speed, 0.0, 0.0], vec![Plate::left(HALF + gap)]) };
    let mut simulation = started(&throw)?;
    let (mut impulse, mut touched, mut last, mut residual) = (0.0, None, 0.0, 0.0_f64);
    let end = 1.5 * std::f64::consts::PI / omega;
    while simulation.time() < end {
        simulation.do_step(simulation.time(), step)?;
        impulse += step * real(&simulation, "force_x");
        residual = worse(residual, real(&simulation, "energy_residual_relative").abs());
        if !simulation.system().events().is_empty() {
            touched.get_or_insert(simulation.time());
            last = simulation.time();
        }
    }
    let held = last - touched.unwrap_or(f64::NAN);
    let (exact, total) = ((front + 2.0 * rear) * speed, front + rear);
    let after = rear * speed / total;
    // Positions round to 1e-17 m; the impact lies anywhere within a step.
    let bound = 2.0 * omega * step + 1e-16 / (speed * step);
    Ok(vec![
        Check::at_most(
            "deviation of the contact time from π/ω",
            (held * omega / std::f64::consts::PI - 1.0).abs(),
            bound,
        ),
        Check::at_most("deviation of the impulse from (m₁ + 2m₂)v", (impulse / exact - 1.0).abs(), bound),
        Check::at_most(
            "deviation of the final velocity",
            (vector(&simulation, "body.velocity")[0] / after - 1.0).abs(),
            bound,
        ),
        Check::at_most(
            "deviation of the impact loss from m₁v²/2",
            (real(&simulation, "impact_loss") - 0.5 * front * speed * speed).abs() / (0.5 * total * speed * speed),
            bound,
        ),
        Check::at_most("energy residual", residual, 1e-10),
    ])
}
