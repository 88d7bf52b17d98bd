//! A block on a spring, thrown along a belt at rest, that repeatedly stops and sticks; with a closed form.

use nalgebra::DMatrix;
use tiprub_core::geometry::{FixedGap, GapLaw, PrescribedMotion, Vector3};
use tiprub_core::limits::{self, massless};
use tiprub_core::modes::modal::ModalModel;
use tiprub_core::scene::method::{Scheme, Solver};
use tiprub_core::system::{System, SystemSettings};
use tiprub_core::time::TimeStepper;
use tiprub_reference::closed::belt::ThrownBlock;
use tiprub_test_models::single_sector;

use super::{
    case::ErrorCase,
    competitor::{Competitor, EquationFamily, TOLERANCES},
    run::{StepExtremes, TimedRun, Trace},
};

const BLOCK: ThrownBlock = ThrownBlock { mass: 2.0, omega: 50.0, flexibility: 4e-6, friction: 2.0, velocity: 0.5 };
/// Friction coefficient; the normal force is the friction force divided by it.
const FRICTION: f64 = 0.4;
/// Clearance of a second node that never touches (m): tolerances are relative to it.
const CLEARANCE: f64 = 1e-3;
/// Frequency of the modes that represent the flexibility of the contact (rad/s). Schemes with mass at the contact node
/// keep their inertia.
const FAST: f64 = 1e5;
/// Contact nodes: the one on the belt, and the one with the clearance.
const NODES: usize = 2;
/// Outward normal of the belt.
const NORMAL: Vector3 = Vector3::new(0.0, 0.0, 1.0);
/// Time between samples (s), and their numbers: full study, quick form.
const INTERVAL: f64 = 2e-3;
const SAMPLES: [usize; 2] = [500, 100];
/// Numbers of fixed steps per sample. The longest are beyond the limit of central differences.
const DIVISIONS: [u32; 7] = [1, 4, 20, 80, 200, 800, 3200];
/// Numbers of steps per sample of the references.
const REFERENCE: [u32; 2] = [12_800, 6400];

/// The block on the belt.
pub(crate) struct BeltCase {
    model: ModalModel,
    massless_limit: massless::MasslessLimit,
    quick: bool,
}

impl BeltCase {
    /// Creates the block as modes: the spring, and six that represent the flexibility of two contact nodes.
    pub(crate) fn new(quick: bool) -> Self {
        let rows = 3 * NODES;
        let mut contact_modes = DMatrix::zeros(rows, rows + 1);
        contact_modes[(0, 0)] = 1.0 / BLOCK.mass.sqrt();
        for row in 0..rows {
            contact_modes[(row, row + 1)] = BLOCK.flexibility.sqrt() * FAST;
        }
        let model = ModalModel {
            frequencies: [vec![BLOCK.omega], vec![FAST; rows]].concat(),
            damping_ratios: vec![0.0; rows + 1],
            contact_modes,
            shapes: DMatrix::identity(rows + 1, rows + 1),
            quasi_static: rows,
        };
        let check = massless::MasslessCheck { model: &model, normals: vec![NORMAL; NODES], carriers: Vec::new() };
        let massless_limit = check.limit(1.0).unwrap_or(massless::MasslessLimit::NONE);
        Self { model, massless_limit, quick }
    }

    /// Returns the displacement of the contact node by the belt (m).
    fn pressed() -> f64 {
        BLOCK.flexibility * BLOCK.friction / FRICTION
    }

    fn run(&self, (scheme, solver): (Scheme, Solver), division: u32, perturbation: f64) -> Result<BeltRun, String> {
        let law = GapLaw::Fixed(FixedGap {
            normals: vec![NORMAL; NODES],
            gaps: vec![-Self::pressed(), CLEARANCE],
            sliding: vec![Vector3::zeros(); NODES],
        });
        let settings = SystemSettings { scheme, solver, ledger: true };
        let mut system = single_sector(&self.model, law, FRICTION, settings);
        let by_tolerance = scheme == Scheme::Galerkin;
        let step = if by_tolerance { INTERVAL } else { INTERVAL / f64::from(division) };
        if !by_tolerance {
            let largest = self.model.frequencies[self.model.dynamic_modes(scheme) - 1];
            limits::check_step(largest, scheme, step).map_err(|error| error.to_string())?;
            if scheme == Scheme::MasslessBoundary {
                massless::check(step, self.massless_limit).map_err(|error| error.to_string())?;
            }
        }
        let mut stepper = TimeStepper::new(&mut system, step, 1.0 / f64::from(division));
        stepper.set_step(&mut system, step);
        let velocity = BLOCK.velocity * (1.0 + perturbation) * BLOCK.mass.sqrt();
        system.bank_mut().set_modal_state(0, 0, 0.0, velocity);
        // The mode that the belt presses back, if it has inertia.
        let normal = 3;
        if normal < self.model.dynamic_modes(scheme) {
            let amplitude = Self::pressed() / self.model.contact_modes[(normal - 1, normal)];
            system.bank_mut().set_modal_state(normal, 0, amplitude, 0.0);
        }
        system.start(&[PrescribedMotion::default()]);
        Ok(BeltRun { system, stepper, step, count: if by_tolerance { 1 } else { division } })
    }

    fn samples_of(&self) -> usize {
        SAMPLES[usize::from(self.quick)]
    }
}

impl ErrorCase for BeltCase {
    fn name(&self) -> &'static str {
        "belt"
    }

    fn figures(&self) -> [&'static str; 2] {
        ["belt-steps", "belt-total"]
    }

    fn title(&self) -> &'static str {
        "Block on a belt"
    }

    fn description(&self) -> String {
        "A block on a spring is given an initial velocity along a stationary belt. Friction stops it; it sticks and slides \
         again (the stick-slip oscillator of J. P. den Hartog, 1931, with a flexible contact). Only `coulomb` models \
         sticking. Compared with the closed-form solution."
            .into()
    }

    fn size_name(&self) -> &'static str {
        "coordinates"
    }

    fn sizes(&self) -> Vec<usize> {
        vec![self.model.len()]
    }

    fn interval(&self) -> f64 {
        INTERVAL
    }

    fn samples(&self) -> usize {
        self.samples_of()
    }

    fn impulse_window(&self) -> usize {
        1
    }

    fn divisions(&self, _: usize) -> Vec<u32> {
        let count = if self.quick { 5 } else { DIVISIONS.len() };
        DIVISIONS[..count].to_vec()
    }

    fn divisions_of(&self, size: usize, competitor: Competitor) -> Vec<u32> {
        if competitor.is_by_tolerance() { TOLERANCES.to_vec() } else { self.divisions(size) }
    }

    fn reference_divisions(&self, _: usize) -> (u32, u32) {
        let [fine, half] = if self.quick { [3200, 1600] } else { REFERENCE };
        (fine, half)
    }

    fn first(&self) -> Competitor {
        Competitor::Core(Scheme::ModalExact, Solver::Coulomb)
    }

    fn tolerant(&self) -> Competitor {
        Competitor::Core(Scheme::Galerkin, Solver::Coulomb)
    }

    fn second(&self) -> Competitor {
        self.first()
    }

    fn relation(&self) -> &'static str {
        "the same scheme with twice the step"
    }

    fn competitors(&self, _: usize) -> Vec<Competitor> {
        let own = Scheme::RECURRENCES.into_iter().map(|scheme| Competitor::Core(scheme, Solver::Coulomb));
        own.chain([self.tolerant()]).collect()
    }

    fn start<'a>(
        &'a self,
        _: usize,
        competitor: Competitor,
        division: u32,
        perturbation: f64,
    ) -> Result<Box<dyn TimedRun + 'a>, String> {
        match competitor {
            Competitor::Core(scheme, solver) => Ok(Box::new(self.run((scheme, solver), division, perturbation)?)),
            _ => Err("only the methods of tiprub are available for the belt".into()),
        }
    }

    fn exact(&self) -> Option<Trace> {
        let samples = self.samples_of();
        let motion = BLOCK.motion(INTERVAL, samples);
        let start = 0.5 * BLOCK.mass * BLOCK.velocity * BLOCK.velocity;
        // The normal force is constant, and so is its spring.
        let normal = BLOCK.friction / FRICTION;
        let pressed = 0.5 * normal * Self::pressed();
        Some(Trace {
            displacements: motion.positions.iter().map(|position| vec![*position]).collect(),
            parts: vec![1],
            impulses: vec![normal * INTERVAL; samples],
            shares: Vec::new(),
            last_forces: Vec::new(),
            energies: motion.energies.iter().map(|energy| energy + pressed).collect(),
            initial_energy: start + pressed,
            residual: None,
            penetration: 0.0,
            adhesion: 0.0,
        })
    }

    fn families(&self, _: usize) -> Vec<EquationFamily> {
        vec![EquationFamily::STICKING, EquationFamily::BOTH]
    }

    fn several_nodes(&self) -> bool {
        false
    }
}

/// A run of the block.
struct BeltRun {
    system: System,
    stepper: TimeStepper,
    /// Length of fixed steps, or the longest adaptive step (s), and their number per sample.
    step: f64,
    count: u32,
}

impl BeltRun {
    fn one(&mut self) -> Result<(), String> {
        let stepped = self.stepper.step(&mut self.system, &[PrescribedMotion::default()]);
        stepped.map_err(|failure| format!("step {} failed: {failure:?}", self.system.steps()))
    }
}

impl TimedRun for BeltRun {
    fn advance(&mut self) -> Result<(), String> {
        (0..self.count).try_for_each(|_| self.one())
    }

    #[expect(clippy::cast_precision_loss, reason = "step counts are below 2^52")]
    fn watch(&mut self, seen: &mut StepExtremes) -> Result<(), String> {
        for _ in 0..self.count {
            self.one()?;
            let forces = self.system.events().iter().map(|event| event.normal);
            seen.add(self.system.steps() as f64 * self.step, self.step, forces, self.system.gap(0, 0));
        }
        self.system.close_ledger();
        Ok(())
    }

    fn displacements(&self) -> Vec<f64> {
        vec![self.system.bank().row(0, 0)]
    }

    fn energy(&self) -> f64 {
        let (kinetic, strain) = self.system.energies();
        kinetic + strain
    }

    fn residual(&self) -> Option<f64> {
        let (kinetic, strain) = self.system.energies();
        let scale = self.system.ledger().scale();
        (scale > 0.0).then(|| self.system.ledger().residual(kinetic + strain) / scale)
    }
}
