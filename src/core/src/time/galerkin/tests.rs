//! Sectors that rub a moving wall: energy, order, tolerance.

use super::island::Island;
use super::level::StepTables;
use super::span::StepGoal;
use super::surroundings::{AcceptedStep, CarriersInStep, Surroundings, Witness};
use super::tables::Tables;
use super::trial::{ForceInterpolation, Obstacle, SlidingState};
use crate::contact::ContactParameters;
use crate::geometry::{Gap, Sliding, Vector3};
use crate::modes::coordinates::ContactModes;
use crate::system::Effort;
use nalgebra::DMatrix;

/// Random numbers between −1 and 1.
struct RandomNumbers(u64);

impl RandomNumbers {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        f64::from(u32::try_from(self.0 >> 33).unwrap()) / f64::from(1_u32 << 30) - 1.0
    }
}

/// Modes from a few hundred to a few 10⁵ rad/s, and the residual flexibility of as many higher modes.
fn modes(count: usize, nodes: usize, damping: f64, random: &mut RandomNumbers) -> ContactModes {
    let all = 2 * count;
    let shapes = DMatrix::from_fn(3 * nodes, all, |_, _| 3.0 * random.next());
    let frequency = |mode: usize| 900.0 * (1.0 + f64::from(u32::try_from(mode).unwrap()).powf(1.5));
    let mut residual = DMatrix::zeros(3 * nodes, 3 * nodes);
    for mode in count..all {
        residual += shapes.column(mode) * shapes.column(mode).transpose() / frequency(mode).powi(2);
    }
    residual += DMatrix::identity(3 * nodes, 3 * nodes) * 2e-9;
    ContactModes {
        frequencies: (0..count).map(frequency).collect(),
        damping_ratios: vec![damping; count],
        shapes: shapes.columns(0, count).into_owned(),
        residual,
    }
}

/// A plane normal to x that vibrates and slides in y.
struct MovingWall {
    clearance: f64,
    amplitude: f64,
    frequency: f64,
    parameters: ContactParameters,
    /// Start and length of the span (s), and times of the points of the step.
    start: f64,
    span: f64,
    times: [f64; 4],
    work: f64,
    damping: f64,
    dropped: f64,
    impulse: f64,
    lowest: f64,
    switches: u64,
}

impl MovingWall {
    fn new(clearance: f64, amplitude: f64, friction: f64) -> Self {
        Self {
            clearance,
            amplitude,
            frequency: 1700.0,
            parameters: ContactParameters { friction, ..ContactParameters::FRICTIONLESS },
            start: 0.0,
            span: 0.0,
            times: [0.0; 4],
            work: 0.0,
            damping: 0.0,
            dropped: 0.0,
            impulse: 0.0,
            lowest: 0.0,
            switches: 0,
        }
    }

    fn place(&self, time: f64) -> f64 {
        self.clearance - self.amplitude * (self.frequency * time).sin()
    }
}

impl Obstacle for &mut MovingWall {
    fn gap(&mut self, _: usize, point: usize, moved: Vector3) -> Gap {
        Gap { distance: self.place(self.times[point]) - moved[0], normal: -Vector3::x(), ..Gap::NOTHING }
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

impl Surroundings for MovingWall {
    type Surfaces<'a> = &'a mut Self;

    fn surfaces<'a>(&'a mut self, _: usize, _: CarriersInStep<'a>) -> &'a mut Self {
        self
    }
}

impl Witness for &mut MovingWall {
    fn begin_step(&mut self, from: f64, length: f64, level: &StepTables, kind: ForceInterpolation) {
        for (time, point) in self.times.iter_mut().zip(level.basis.points) {
            *time = self.start + self.span * (from + length * point);
        }
        if kind == ForceInterpolation::Constant {
            self.times[1] = self.start + self.span * (from + length);
        }
    }

    fn is_clear(&self, from: f64, length: f64, reach: &[f64]) -> bool {
        let nearest = self.place(self.start + self.span * from).min(self.clearance - self.amplitude.abs());
        let _ = length;
        reach.iter().step_by(3).all(|reach| *reach < nearest)
    }

    fn record_damping(&mut self, damping_loss: f64) {
        self.damping += damping_loss;
    }

    fn record_step(&mut self, step: &AcceptedStep) {
        let (trial, basis) = (step.trial, &step.level.basis);
        self.dropped += step.dropped;
        for node in 0..trial.nodes() {
            for component in 0..3 {
                let force = |point: usize| trial.force(point, node)[component];
                let moved = |point: usize| trial.displacement(point, node)[component];
                if (0..=trial.points()).all(|point| force(point) == 0.0) {
                    continue;
                }
                if step.kind == ForceInterpolation::Constant {
                    self.work += force(1) * (moved(1) - moved(0));
                    continue;
                }
                for i in 0..basis.count() {
                    for k in 0..basis.count() {
                        self.work += force(i) * basis.work[i][k] * moved(k);
                    }
                }
            }
            let pushes: Vec<bool> = (0..=trial.points()).map(|i| trial.multiplier(i, node) > 0.0).collect();
            self.switches += u64::from(pushes.iter().any(|one| *one) && !pushes.iter().all(|one| *one));
            for i in 0..=trial.points() {
                self.lowest = self.lowest.min(trial.gap(i, node));
                if step.kind == ForceInterpolation::Polynomial {
                    self.impulse += basis.weights[i] * trial.multiplier(i, node) * step.level.step;
                }
            }
        }
    }
}

struct TestRun {
    displacements: Vec<f64>,
    effort: Effort,
    wall: MovingWall,
    /// Largest residual of the energy balance, relative to the largest energy.
    residual: f64,
    /// Energy at the start and at the end, and the largest energy at the end of any span (J).
    start: f64,
    energy: f64,
    most: f64,
}

fn run(modes: &ContactModes, mut wall: MovingWall, span: f64, spans: usize, tolerance: f64, speed: f64) -> TestRun {
    let mut island = Island::of_one(Tables::new(modes.clone(), span));
    island.set_span(span);
    let state = &mut island.sectors[0].state;
    for (mode, v) in state.velocity.iter_mut().enumerate() {
        *v = speed / f64::from(u32::try_from(mode + 1).unwrap());
    }
    state.gaps.fill(wall.place(0.0));
    let sum = |(kinetic, strain): (f64, f64)| kinetic + strain;
    let start = sum(state.energies(&modes.frequencies, &modes.residual));
    let (mut effort, mut displacements, mut residual, mut most) = (Effort::default(), Vec::new(), 0.0_f64, start);
    let goal = StepGoal { tolerance, precision: 1e-15, longest: span, most: u64::MAX };
    let mut energy = start;
    for n in 0..spans {
        (wall.start, wall.span) = (span * f64::from(u32::try_from(n).unwrap()), span);
        island.begin(&mut wall, goal).integrate(&mut effort).unwrap();
        let state = &island.sectors[0].state;
        energy = sum(state.energies(&modes.frequencies, &modes.residual));
        most = most.max(energy);
        residual = residual.max((energy - start - wall.work + wall.damping + wall.dropped).abs() / most);
        for row in 0..modes.rows() {
            let of: f64 = (0..modes.len()).map(|mode| modes.shapes[(row, mode)] * state.position[mode]).sum();
            displacements.push(of + (modes.residual.row(row) * nalgebra::DVector::from_column_slice(&state.forces))[0]);
        }
    }
    TestRun { displacements, effort, wall, residual, start, energy, most }
}

fn apart(a: &[f64], b: &[f64]) -> f64 {
    #[expect(clippy::cast_precision_loss, reason = "thousands")]
    let count = a.len() as f64;
    (a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>() / count).sqrt()
}

#[test]
fn energy_balance_closes_with_all_losses() {
    let mut random = RandomNumbers(3);
    for (friction, damping) in [(0.0, 0.0), (0.15, 0.0), (0.3, 0.01)] {
        let modes = modes(12, 2, damping, &mut random);
        let found = run(&modes, MovingWall::new(2e-4, 1.5e-4, friction), 4e-5, 500, 2e-7, 0.3);
        println!(
            "µ {friction}, ξ {damping}: residual {:.1e}, switches {}, {:?}",
            found.residual, found.wall.switches, found.effort
        );
        assert!(found.residual < 1e-12 && found.wall.switches > 20 && found.wall.lowest > -1e-12);
    }
}

/// A statistical check: single impacts may exceed the tolerance by more.
#[test]
fn errors_meet_the_requested_tolerance() {
    let mut random = RandomNumbers(1234);
    let mut ratios: [Vec<f64>; 3] = Default::default();
    for _ in 0..40 {
        let mut modes = modes(10, 2, 0.002, &mut random);
        modes.residual += DMatrix::identity(6, 6) * (2e-9 * (1.0 + random.next()));
        let amplitude = 2e-4 + 1e-4 * random.next().abs();
        let of = |tolerance: f64| run(&modes, MovingWall::new(2e-4, amplitude, 0.1), 4e-5, 150, tolerance, 0.0);
        let truth = of(2e-11);
        for (ratios, tolerance) in ratios.iter_mut().zip([2e-6, 2e-7, 2e-8]) {
            ratios.push(apart(&of(tolerance).displacements, &truth.displacements) / tolerance);
        }
    }
    for ratios in &mut ratios {
        ratios.sort_by(f64::total_cmp);
        println!("median {:.2}, 90 % {:.2}, 95 % {:.2}, most {:.2}", ratios[20], ratios[36], ratios[38], ratios[39]);
        assert!(ratios[20] < 0.2 && ratios[38] < 0.6 && ratios[39] < 0.8);
    }
}

/// A node that swings through the wall and back within a step that is too short to be halved for near misses: straight lines
/// through the gaps at its ends do not show the contact.
#[test]
fn contact_between_the_ends_of_a_short_linear_step_is_found() {
    let (span, clearance, amplitude) = (1e-6, 5e-7, 1e-6);
    let frequency = std::f64::consts::PI / span;
    let modes = ContactModes {
        frequencies: vec![frequency],
        damping_ratios: vec![0.0],
        shapes: DMatrix::from_column_slice(3, 1, &[1.0, 0.0, 0.0]),
        residual: DMatrix::identity(3, 3) * 1e-9,
    };
    let mut island = Island::of_one(Tables::of_degree(modes, 1));
    island.set_span(span);
    let (mut wall, mut effort) = (MovingWall::new(clearance, 0.0, 0.0), Effort::default());
    let state = &mut island.sectors[0].state;
    (state.velocity[0], wall.span) = (amplitude * frequency, span);
    state.gaps.fill(clearance);
    let goal = StepGoal { tolerance: 1e-8, precision: 1e-15, longest: span, most: u64::MAX };
    island.begin(&mut wall, goal).integrate(&mut effort).unwrap();
    assert!(effort.steps > 1 && wall.impulse > 0.0, "{effort:?}, {} N·s", wall.impulse);
}

/// The energy never exceeds the initial energy, whatever the tolerance. Later steps spend the energy that lossy switches add to
/// the bank, so that little is lost even with a coarse tolerance.
#[test]
fn an_undamped_sector_never_has_more_energy_than_it_was_given() {
    let mut random = RandomNumbers(11);
    let mut kept = [1e-3, 1e-6].map(|tolerance| -> Vec<f64> {
        let run = || {
            let modes = modes(10, 2, 0.0, &mut random);
            let found = run(&modes, MovingWall::new(1e-4, 0.0, 0.0), 4e-5, 5000, tolerance, 0.5);
            assert!(found.wall.switches > 100 && found.most <= found.start * (1.0 + 1e-11));
            assert!(found.energy < found.start);
            found.energy / found.start
        };
        std::iter::repeat_with(run).take(11).collect()
    });
    kept.iter_mut().for_each(|kept| kept.sort_by(f64::total_cmp));
    println!("share of the energy that is left: {kept:.4?}");
    assert!(kept.iter().flatten().all(|share| *share > 0.998));
}
