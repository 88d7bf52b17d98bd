//! Random sectors against a wall, without a scene: energy over very many switches, contact problems without a solution.

use nalgebra::DMatrix;
use tiprub_core::contact::ContactParameters;
use tiprub_core::geometry::{Gap, Sliding, Vector3};
use tiprub_core::modes::coordinates::ContactModes;
use tiprub_core::system::Effort;
use tiprub_core::time::galerkin::{
    island::{Island, StepControl},
    level::StepTables,
    span::StepGoal,
    state::SectorState,
    surroundings::{AcceptedStep, CarriersInStep, Surroundings, Witness},
    tables::Tables,
    trial::{ForceInterpolation, Obstacle, SlidingState},
};
use tiprub_test_models::SeededRandom;

/// Returns modes from some hundred to some 10⁵ rad/s, the flexibility of as many higher ones, and `stiff` times that of
/// a local flexibility.
fn modes(count: usize, nodes: usize, stiff: f64, random: &mut SeededRandom) -> ContactModes {
    let rows = 3 * nodes;
    let shapes = random.matrix(rows, 2 * count) * 3.0;
    let frequency = |mode: usize| 900.0 * (1.0 + (mode as f64).powf(1.5));
    let mut residual = DMatrix::identity(rows, rows) * (2e-9 * stiff);
    for mode in count..2 * count {
        residual += shapes.column(mode) * shapes.column(mode).transpose() / frequency(mode).powi(2);
    }
    ContactModes {
        frequencies: (0..count).map(frequency).collect(),
        damping_ratios: vec![0.0; count],
        shapes: shapes.columns(0, count).into_owned(),
        residual,
    }
}

/// A plane normal to x that slides along y.
struct ScatterWall {
    place: f64,
    parameters: ContactParameters,
    /// Number of steps in which a node opens or closes.
    switches: u64,
    /// Energy dropped by constant forces (J).
    dropped: f64,
}

impl ScatterWall {
    fn new(place: f64, friction: f64) -> Self {
        let parameters = ContactParameters { friction, ..ContactParameters::FRICTIONLESS };
        Self { place, parameters, switches: 0, dropped: 0.0 }
    }
}

impl Obstacle for &mut ScatterWall {
    fn gap(&mut self, _: usize, _: usize, moved: Vector3) -> Gap {
        Gap { distance: self.place - moved[0], normal: -Vector3::x(), ..Gap::NOTHING }
    }

    fn parameters(&self, _: usize) -> &ContactParameters {
        &self.parameters
    }

    fn sliding(&mut self, _: usize, _: usize, _: &SlidingState) -> Sliding {
        Sliding { direction: Vector3::y(), speed: 1.0 }
    }

    fn sector(&self) -> usize {
        0
    }

    fn angle(&self, _: usize, _: usize, _: Vector3) -> f64 {
        0.0
    }
}

impl Surroundings for ScatterWall {
    type Surfaces<'a> = &'a mut Self;

    fn surfaces<'a>(&'a mut self, _: usize, _: CarriersInStep<'a>) -> &'a mut Self {
        self
    }
}

impl Witness for &mut ScatterWall {
    fn begin_step(&mut self, _: f64, _: f64, _: &StepTables, _: ForceInterpolation) {}

    fn is_clear(&self, _: f64, _: f64, reach: &[f64]) -> bool {
        reach.iter().step_by(3).all(|reach| *reach < self.place)
    }

    fn record_damping(&mut self, _: f64) {}

    fn record_step(&mut self, step: &AcceptedStep) {
        self.dropped += step.dropped;
        let points = 0..=step.trial.points();
        for node in 0..step.trial.nodes() {
            let pushing = points.clone().filter(|point| step.trial.multiplier(*point, node) > 0.0).count();
            self.switches += u64::from(pushing > 0 && pushing < points.clone().count());
        }
    }
}

/// Energy of a sector without damping, friction and motion of the wall.
#[derive(Debug, Clone, Copy)]
pub(super) struct SectorEnergy {
    pub(super) tolerance: f64,
    pub(super) switches: u64,
    /// Largest energy at the end of any span, and final energy, relative to the start.
    pub(super) most: f64,
    pub(super) left: f64,
    pub(super) effort: Effort,
}

/// Number of attempted steps per switch after which a sector counts as at rest.
const MOST_TRIED: u64 = 100;

/// Runs until `switches` contacts have opened or closed, or no contact remains.
pub(super) fn energy(tolerance: f64, switches: u64) -> Option<SectorEnergy> {
    let (span, nodes, count) = (4e-5, 2, 10);
    let modes = modes(count, nodes, 1.0, &mut SeededRandom(11));
    let mut island = Island::of_one(Tables::new(modes.clone(), span));
    island.set_span(span);
    let state = &mut island.sectors[0].state;
    for (mode, v) in state.velocity.iter_mut().enumerate() {
        *v = 0.5 / (mode + 1) as f64;
    }
    let mut wall = ScatterWall::new(1e-4, 0.0);
    state.gaps.fill(wall.place);
    let energy = |state: &SectorState| {
        let (kinetic, strain) = state.energies(&modes.frequencies, &modes.residual);
        kinetic + strain
    };
    let (start, mut most, mut effort) = (energy(&island.sectors[0].state), 0.0_f64, Effort::default());
    let goal = StepGoal { tolerance, precision: 1e-15, longest: span, most: u64::MAX };
    // The losses of switches may end contact permanently.
    while wall.switches < switches && effort.tried() < MOST_TRIED * switches {
        island.begin(&mut wall, goal).integrate(&mut effort).ok()?;
        most = most.max(energy(&island.sectors[0].state));
    }
    Some(SectorEnergy {
        tolerance,
        switches: wall.switches,
        most: most / start,
        left: energy(&island.sectors[0].state) / start,
        effort,
    })
}

/// Statistics of contact problems.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Problems {
    pub(super) degree: usize,
    pub(super) friction: f64,
    pub(super) trials: u64,
    /// Number of problems without a solution found; the step is then halved.
    pub(super) unsolved: u64,
    /// Number of spans in which no step was short enough.
    pub(super) given_up: u64,
}

/// Runs random sectors with random motion at a wall, span by span, until `trials` contact problems of one degree were
/// tried.
pub(super) fn problems(degree: usize, friction: f64, trials: u64) -> Problems {
    let mut random = SeededRandom(7 + degree as u64);
    let mut found = Problems { degree, friction, ..Problems::default() };
    while found.trials < trials {
        let nodes = 1 + random.below(3);
        let count = 4 + random.below(9);
        // With little residual flexibility the degree is 2.
        let modes = modes(count, nodes, random.scale(1e-3, 10.0), &mut random);
        let span = random.scale(5e-6, 8e-5);
        let tables = Tables::new(modes, span);
        if tables.levels[0].basis.degree != degree {
            continue;
        }
        let mut island = Island::of_one(tables);
        island.set_span(span);
        for _ in 0..20 {
            island.control = StepControl::default();
            let state = &mut island.sectors[0].state;
            *state = SectorState::new(count, nodes);
            state.velocity.iter_mut().for_each(|v| *v = random.signed());
            let mut wall = ScatterWall::new(2e-5 * random.unit(), friction);
            state.gaps.fill(wall.place);
            let (mut effort, goal) =
                (Effort::default(), StepGoal { tolerance: 1e-7, precision: 1e-13, longest: span, most: u64::MAX });
            let outcome = (0..4).try_for_each(|_| island.begin(&mut wall, goal).integrate(&mut effort));
            found.given_up += u64::from(outcome.is_err());
            found.trials += effort.trials;
            found.unsolved += effort.unsolved;
        }
    }
    found
}

/// Numbers of solutions of contact problems.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Solutions {
    pub(super) degree: usize,
    pub(super) friction: f64,
    pub(super) problems: u64,
    pub(super) none: u64,
    pub(super) several: u64,
}

/// Returns the number of solutions of 0 ≤ λ ⟂ g + Wλ ≥ 0, by trying every set of closed points.
fn count_solutions(w: &DMatrix<f64>, gaps: &[f64]) -> usize {
    let size = gaps.len();
    let scale = gaps.iter().fold(0.0, |most: f64, gap| most.max(gap.abs()));
    let holds = |set: usize| {
        let members: Vec<usize> = (0..size).filter(|lane| set >> lane & 1 == 1).collect();
        if members.is_empty() {
            return gaps.iter().all(|gap| *gap >= 0.0);
        }
        let held = DMatrix::from_fn(members.len(), members.len(), |i, k| w[(members[i], members[k])]);
        let right = nalgebra::DVector::from_iterator(members.len(), members.iter().map(|lane| -gaps[*lane]));
        let Some(forces) = held.lu().solve(&right) else { return false };
        let gap =
            |lane: usize| gaps[lane] + members.iter().zip(forces.iter()).map(|(k, f)| w[(lane, *k)] * f).sum::<f64>();
        forces.iter().all(|force| *force > 0.0)
            && (0..size).all(|lane| set >> lane & 1 == 1 || gap(lane) > -1e-12 * scale)
    };
    (0..1_usize << size).filter(|set| holds(*set)).count()
}

/// Solves contact problems of one and two nodes in random motion without forces, on a step of random length.
pub(super) fn solutions(degree: usize, friction: f64, problems: u64) -> Solutions {
    let mut random = SeededRandom(70 + degree as u64);
    let mut found = Solutions { degree, friction, ..Solutions::default() };
    while found.problems < problems {
        let (nodes, count) = (1 + random.below(2), 4 + random.below(9));
        let modes = modes(count, nodes, random.scale(1e-3, 10.0), &mut random);
        let step = random.scale(5e-6, 8e-5);
        if modes.allows_cubics(step) != (degree == 3) {
            continue;
        }
        let mut level = StepTables::new(&modes, degree);
        level.set_step(&modes, step);
        let lanes = level.compliance.lanes();
        // The displacement along x per force (−1, −µ) opens by correspondingly less.
        let w = DMatrix::from_fn(lanes.len(), lanes.len(), |row, column| {
            let [x, y, _] = level.compliance.of_lane(column);
            x[row] + friction * y[row]
        });
        for _ in 0..20 {
            let velocities: Vec<f64> = (0..count).map(|_| random.signed()).collect();
            let place = 2e-5 * random.unit();
            let gaps: Vec<f64> = (0..lanes.len())
                .map(|lane| {
                    let (point, node) = lanes.place(lane);
                    let moved = |mode: usize| modes.shapes[(3 * node, mode)] * level.modes.points[point - 1][1][mode];
                    place - (0..count).map(|mode| moved(mode) * velocities[mode]).sum::<f64>()
                })
                .collect();
            let solutions = count_solutions(&w, &gaps);
            found.problems += 1;
            found.none += u64::from(solutions == 0);
            found.several += u64::from(solutions > 1);
        }
    }
    found
}
