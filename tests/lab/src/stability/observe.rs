//! Observation of a running simulation, based on the state and not on the solver's output.

use tiprub_core::scene::method::Scheme;
use tiprub_core::scene::settings::Shape;
use tiprub_core::{CoSimulation, Result, Scene, Simulation};

use super::{Check, models::allowed};

/// Largest fraction of the energy exchanged that massless-boundary may return in one step; its warning contains it.
pub(crate) const MASSLESS_RETURN: f64 = 2e-2;
/// Work error of the iterations of galerkin, as a fraction of the energy exchanged.
const ITERATED: f64 = 1e-5;

/// Returns the smallest number of steps of `length` (s) that cover `time` (s).
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a positive number of steps")]
pub(crate) fn steps(time: f64, length: f64) -> u32 {
    (time / length * (1.0 - 1e-9)).ceil() as u32
}

/// Initialises a simulation at time 0, and its watch.
///
/// # Errors
/// A rejected scene.
pub(crate) fn begin(scene: &Scene) -> Result<(Simulation, StabilityWatch)> {
    let mut simulation = Simulation::new(scene)?;
    simulation.initialise(0.0)?;
    Ok((simulation, StabilityWatch::new(scene)))
}

/// Returns the value of a real variable that the scene has.
pub(crate) fn real(simulation: &Simulation, name: &str) -> f64 {
    let row = simulation.table().find(name);
    row.and_then(|row| simulation.real(row.reference).ok()).unwrap_or(f64::NAN)
}

/// Sets the first element of a real variable; a missing variable is ignored.
///
/// # Errors
/// A rejected value.
pub(crate) fn set(simulation: &mut Simulation, name: &str, value: f64) -> Result<()> {
    let Some(reference) = simulation.table().find(name).map(|row| row.reference) else { return Ok(()) };
    simulation.set_real(reference, value)
}

/// Returns all numeric outputs, to compare two runs bit by bit.
pub(crate) fn outputs(simulation: &Simulation) -> Vec<f64> {
    let mut values = Vec::new();
    for variable in simulation.table().variables() {
        for reference in (variable.reference..).take(variable.len()) {
            if let Ok(value) = simulation.real(reference) {
                values.push(value);
            }
        }
    }
    values
}

/// Returns all numeric outputs as bits.
pub(crate) fn bits(simulation: &Simulation) -> Vec<u64> {
    outputs(simulation).into_iter().map(f64::to_bits).collect()
}

/// Returns the radial displacement of the first ring of the 36 × 3 nodes of the casing: amplitudes of cos nθ and of sin nθ, and the largest rest at
/// any node (m).
pub(crate) fn amplitudes(simulation: &Simulation, order: u32) -> [f64; 3] {
    let Some(row) = simulation.table().find("casing_displacement").map(|row| row.reference) else {
        return [f64::NAN; 3];
    };
    let values: Vec<f64> = (0..36).map(|i| simulation.real(row + i).unwrap_or(f64::NAN)).collect();
    let angle = |i: usize| f64::from(order) * std::f64::consts::TAU * i as f64 / 36.0;
    let sum = |weight: &dyn Fn(f64) -> f64| values.iter().enumerate().map(|(i, u)| u * weight(angle(i))).sum::<f64>();
    let [cosine, sine] = [sum(&f64::cos) / 18.0, sum(&f64::sin) / 18.0];
    let rest = |(i, u): (usize, &f64)| (u - cosine * angle(i).cos() - sine * angle(i).sin()).abs();
    [cosine, sine, values.iter().enumerate().map(rest).fold(0.0, f64::max)]
}

/// Largest values over a run of everything that should be small.
#[derive(Debug, Clone)]
pub(crate) struct StabilityWatch {
    sectors: usize,
    slopes: Vec<f64>,
    clearances: Vec<f64>,
    /// True if gaps follow from displacements and radius alone: a rigid, round casing, on springs of any kind.
    round: bool,
    /// Length with which others are compared (m).
    pub scale: f64,
    /// Distance that the tolerance of the scene permits (m).
    allowed: f64,
    galerkin: bool,
    /// Largest λ within any step so far (N).
    max_force: f64,
    /// Largest −λ (N).
    adhesion: f64,
    /// Largest −g, as a fraction of `scale`.
    penetration: f64,
    /// Largest |λg| (N), with g as a fraction of `scale`.
    product: f64,
    /// Largest amounts by which the recomputed gap is above and below the reported gap, as fractions of `scale`.
    gap_excess: f64,
    gap_shortfall: f64,
    residual: f64,
    impact_drop: f64,
    heat_drop: f64,
    impact_deficit: f64,
    before: [f64; 2],
    /// Energy exchanged so far (J).
    exchanged: f64,
    /// Number of contacts in all internal steps.
    pub contacts: u64,
    /// ∫Σλ dt (N·s).
    pub impulse: f64,
    /// True if all outputs were finite.
    pub finite: bool,
}

impl StabilityWatch {
    /// Creates the watch before the first step of an initialised simulation of `scene`.
    pub(crate) fn new(scene: &tiprub_core::Scene) -> Self {
        let (contact, rom) = (&scene.settings.contacts[0], &scene.roms[0]);
        let clearances =
            if contact.sector_gaps.is_empty() { vec![contact.gap; rom.sectors] } else { contact.sector_gaps.clone() };
        let surface = &scene.settings.surfaces[0];
        let rotor = &scene.settings.structures[0];
        Self {
            sectors: rom.sectors,
            slopes: rom.contact_nodes.iter().map(|node| node.meridional_slope).collect(),
            scale: clearances.iter().fold(0.0, |most: f64, gap| most.max(*gap)),
            clearances,
            allowed: allowed(scene),
            galerkin: scene.settings.time.scheme == Scheme::Galerkin,
            round: surface.shape == (Shape::Circular {})
                && surface.structure.is_none()
                && surface.spline.is_none()
                && !rotor.whirl
                && !rotor.axial_shift,
            max_force: 0.0,
            adhesion: 0.0,
            penetration: 0.0,
            product: 0.0,
            gap_excess: 0.0,
            gap_shortfall: 0.0,
            residual: 0.0,
            impact_drop: 0.0,
            heat_drop: 0.0,
            impact_deficit: 0.0,
            before: [0.0; 2],
            exchanged: 0.0,
            contacts: 0,
            impulse: 0.0,
            finite: true,
        }
    }

    /// Performs one communication step, observed after every internal step.
    ///
    /// # Errors
    /// A rejected step.
    pub(crate) fn step(&mut self, simulation: &mut Simulation, length: f64) -> Result<()> {
        simulation.begin_step(simulation.time(), length)?;
        let mut begun = simulation.time();
        loop {
            let progress = simulation.advance()?;
            self.look(simulation, progress.time - begun);
            begun = progress.time;
            if progress.finished {
                break;
            }
        }
        self.look_at_books(simulation);
        self.finite &= outputs(simulation).iter().all(|value| value.is_finite());
        Ok(())
    }

    /// Performs a step while inputs change within it: gaps are not recomputed.
    ///
    /// # Errors
    /// A rejected step.
    pub(crate) fn step_moving(&mut self, simulation: &mut Simulation, length: f64) -> Result<()> {
        self.round = false;
        self.step(simulation, length)
    }

    /// Observes the state after an interval of `duration` (s). With adaptive steps, contact forces are means over it; with fixed steps, they are
    /// those of its last step.
    fn look(&mut self, simulation: &Simulation, duration: f64) {
        let system = simulation.system();
        self.contacts += system.events().len() as u64;
        let sum: f64 = system.events().iter().map(|event| event.normal).sum();
        self.impulse += sum * if self.galerkin { duration } else { system.bank().step() };
        self.max_force = system.events().iter().fold(self.max_force, |most, event| most.max(event.peak));
        let opening = if self.round { open(simulation) } else { f64::NAN };
        for node in 0..self.slopes.len() {
            for sector in 0..self.sectors {
                let (gap, multiplier) = (system.gap(node, sector), system.multiplier(node, sector));
                self.penetration = worse(self.penetration, -gap / self.scale);
                self.adhesion = worse(self.adhesion, -multiplier);
                self.product = worse(self.product, (multiplier * (gap / self.scale)).abs());
                if self.round {
                    let moved = |i: usize| system.bank().row(3 * node + i, sector);
                    let slope = self.slopes[node];
                    let radial = self.clearances[sector] + opening - moved(0) + slope * moved(2);
                    let recomputed_gap = radial / (1.0 + slope * slope).sqrt();
                    self.gap_excess = worse(self.gap_excess, (recomputed_gap - gap) / self.scale);
                    self.gap_shortfall = worse(self.gap_shortfall, (gap - recomputed_gap) / self.scale);
                }
            }
        }
    }

    fn look_at_books(&mut self, simulation: &Simulation) {
        let ledger = simulation.system().ledger();
        let (kinetic, strain) = simulation.system().energies();
        let scale = ledger.scale();
        if scale > 0.0 {
            self.residual = worse(self.residual, ledger.residual(kinetic + strain).abs() / scale);
            let now = [ledger.impact_loss.value(), ledger.friction_loss.value()];
            self.impact_drop = worse(self.impact_drop, self.before[0] - now[0]);
            self.heat_drop = worse(self.heat_drop, self.before[1] - now[1]);
            self.impact_deficit = worse(self.impact_deficit, -now[0]);
            self.before = now;
            self.exchanged = scale;
        }
    }

    /// Checks that the energy balance closes, and that its entries have the correct signs: contact dissipates energy,
    /// friction generates heat.
    pub(crate) fn laws(&self) -> Vec<Check> {
        vec![
            Check::so("all outputs finite", self.finite),
            Check::at_most("energy residual", self.residual, 1e-9),
            self.impact(1e-9),
            self.heat(1e-9),
        ]
    }

    /// Checks that impacts dissipate energy. With galerkin, gains are paid from earlier losses: the loss stays
    /// positive.
    pub(crate) fn impact(&self, bound: f64) -> Check {
        if self.galerkin {
            return Check::at_most("negative impact loss", self.share(self.impact_deficit), ITERATED);
        }
        Check::at_most("decrease of the impact loss", self.impact_drop(), bound)
    }

    /// Checks that friction dissipates energy.
    pub(crate) fn heat(&self, bound: f64) -> Check {
        let bound = if self.galerkin { bound.max(ITERATED) } else { bound };
        Check::at_most("decrease of the friction heat", self.heat_drop(), bound)
    }

    /// Checks the laws for a scheme: massless-boundary applies contact forces a step late, and returns a little of the
    /// energy it absorbed.
    pub(crate) fn books_of(&self, scheme: Scheme) -> Vec<Check> {
        let mut checks = self.laws();
        if scheme == Scheme::MasslessBoundary {
            checks[2].bound = MASSLESS_RETURN;
        }
        checks
    }

    /// Checks the ledger alone.
    pub(crate) fn ledger(&self) -> Check {
        Check::at_most("energy residual", self.residual, 1e-9)
    }

    /// Returns the largest decrease of the impact loss in a communication step, relative to all energy exchanged.
    pub(crate) fn impact_drop(&self) -> f64 {
        self.share(self.impact_drop)
    }

    /// Returns the largest decrease of the friction heat, likewise.
    pub(crate) fn heat_drop(&self) -> f64 {
        self.share(self.heat_drop)
    }

    fn share(&self, energy: f64) -> f64 {
        if energy > 0.0 { energy / self.exchanged } else { energy }
    }

    /// Checks λ ≥ 0, g ≥ 0 and λg = 0 after every call of `advance`, and compares g with the gap recomputed from the displacements. Galerkin
    /// closes gaps within its tolerance. Within a step with contact, it reports at least the smallest gap at the points of the step, so the
    /// recomputed gap may be smaller than g by up to the tolerance, but not larger.
    pub(crate) fn complementarity(&self) -> Vec<Check> {
        let distance = 1e-10 + self.allowed / self.scale;
        let relative_to_max_force =
            |value: f64| if self.max_force > f64::MIN_POSITIVE { value / self.max_force } else { value };
        let mut checks = vec![
            Check::at_most("adhesion", relative_to_max_force(self.adhesion), 1e-10),
            Check::at_most("penetration", self.penetration, distance),
            Check::at_most("λg", relative_to_max_force(self.product), distance),
        ];
        if self.round {
            let shortfall_bound = if self.galerkin { distance } else { 1e-9 };
            checks.extend([
                Check::at_most("excess of the gap recomputed from the displacements", self.gap_excess, 1e-9),
                Check::at_most(
                    "shortfall of the gap recomputed from the displacements",
                    self.gap_shortfall,
                    shortfall_bound,
                ),
            ]);
        }
        checks
    }
}

/// Returns the larger value; NaN is preserved.
pub(crate) fn worse(before: f64, now: f64) -> f64 {
    if before >= now || before.is_nan() { before } else { now }
}

/// Returns the additional distance of the round casing (m).
fn open(simulation: &Simulation) -> f64 {
    let change = real(simulation, "casing_radius_change");
    real(simulation, "gap_offset") + if change.is_nan() { 0.0 } else { change }
}

/// Returns the largest difference of two histories of displacements relative to the largest value of the second.
pub(crate) fn apart(first: &[f64], second: &[f64]) -> f64 {
    let largest = second.iter().fold(0.0, |most: f64, value| most.max(value.abs()));
    let square = |values: &mut dyn Iterator<Item = f64>| values.map(|value| value * value).sum::<f64>();
    if largest == 0.0 || first.len() != second.len() {
        return if first == second { 0.0 } else { f64::INFINITY };
    }
    let off = square(&mut first.iter().zip(second).map(|(a, b)| (a - b) / largest));
    (off / square(&mut second.iter().map(|value| value / largest))).sqrt()
}

/// Returns the displacements of all contact nodes of the sectors (m).
pub(crate) fn displacements(simulation: &Simulation) -> Vec<f64> {
    let system = simulation.system();
    let rows = system.bank().rows();
    (0..system.bank().sectors()).flat_map(|sector| (0..rows).map(move |row| system.bank().row(row, sector))).collect()
}
