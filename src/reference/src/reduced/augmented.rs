//! Newmark's average acceleration (α = ¼, δ = ½) with an augmented Lagrangian.
//!
//! Contact is a penalty ε on the gap at the end of the step, augmented by multipliers while a node penetrates by more
//! than a tolerance (J. C. Simo, T. A. Laursen, Comput. Struct. 42 (1992) 97-116). The forces take part in the
//! average acceleration like all other forces, so that nodes rebound. Normals are those of the end of the step
//! without contact.

use nalgebra::{DMatrix, DVector};

use super::{NodeContact, ReducedMethod, ReducedScene, ReducedStep, energy, finite};

/// Options of this method.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NewmarkOptions {
    /// ε (N/m).
    pub penalty: f64,
    /// Largest penetration that needs no further augmentation (m).
    pub tolerance: f64,
    /// Distance from the obstacle, before contact acts, below which nodes are included (m).
    pub margin: f64,
}

/// Largest number of augmentations per step; below, that of Newton iterations of each.
const AUGMENTATIONS: usize = 200;
const ITERATIONS: usize = 60;

/// State of a run.
pub struct Augmented<'a, S: ReducedScene> {
    scene: &'a S,
    options: NewmarkOptions,
    step: f64,
    steps: u64,
    position: Vec<f64>,
    velocity: Vec<f64>,
    acceleration: Vec<f64>,
    /// 1/(1 + hξω + h²ω²/4), and h²/4 of it.
    inertia: Vec<f64>,
    compliance: Vec<f64>,
}

impl<'a, S: ReducedScene> Augmented<'a, S> {
    /// Creates a run from the start of the scene with steps of `step` (s), without contact at first.
    pub fn new(scene: &'a S, step: f64, options: NewmarkOptions) -> Self {
        let modes = scene.modes();
        let (position, velocity) = scene.start();
        let at_first = |mode: usize| {
            let frequency = modes.frequencies[mode];
            let drag = 2.0 * modes.damping[mode] * frequency * velocity[mode];
            scene.load()[mode] - frequency * frequency * position[mode] - drag
        };
        let inertia: Vec<f64> = modes
            .frequencies
            .iter()
            .zip(&modes.damping)
            .map(|(frequency, damping)| {
                let angle = step * frequency;
                1.0 / (1.0 + damping * angle + 0.25 * angle * angle)
            })
            .collect();
        Self {
            acceleration: (0..modes.len()).map(at_first).collect(),
            compliance: inertia.iter().map(|inertia| 0.25 * step * step * inertia).collect(),
            scene,
            options,
            step,
            steps: 0,
            position,
            velocity,
            inertia,
        }
    }

    /// Computes λ = max(0, k − ε g), increasing k until no node is too deep; gaps are those at the end of the step.
    fn multipliers(&self, group: &[NodeContact]) -> Result<(DVector<f64>, f64), String> {
        let count = group.len();
        let matrix = DMatrix::from_fn(count, count, |i, j| group[i].normal.weighted(&self.compliance, &group[j].force));
        let gaps = DVector::from_fn(count, |i, _| group[i].gap);
        let mut given: DVector<f64> = DVector::zeros(count);
        for _ in 0..AUGMENTATIONS {
            let found = self.pressed(&matrix, &gaps, &given)?;
            let least = (&gaps + &matrix * &found).min();
            if least >= -self.options.tolerance {
                return Ok((found, least));
            }
            given = found;
        }
        Err(format!("step {} did not converge in {AUGMENTATIONS} augmentations", self.steps))
    }

    /// Solves the piecewise linear problem of one augmentation by Newton's method: closed nodes satisfy (ε⁻¹ + W) λ =
    /// ε⁻¹ k − g.
    fn pressed(
        &self,
        matrix: &DMatrix<f64>,
        gaps: &DVector<f64>,
        given: &DVector<f64>,
    ) -> Result<DVector<f64>, String> {
        let soft = 1.0 / self.options.penalty;
        let mut closed: Vec<usize> = (0..gaps.len()).filter(|i| soft * given[*i] > gaps[*i]).collect();
        for _ in 0..ITERATIONS {
            let mut found = DVector::zeros(gaps.len());
            if !closed.is_empty() {
                let mut part = matrix.select_rows(&closed).select_columns(&closed);
                part.fill_diagonal(0.0);
                closed.iter().enumerate().for_each(|(row, i)| part[(row, row)] = matrix[(*i, *i)] + soft);
                let right = given.select_rows(&closed) * soft - gaps.select_rows(&closed);
                let values = part.lu().solve(&right).ok_or("the contact matrix is singular")?;
                closed.iter().zip(values.iter()).for_each(|(i, value)| found[*i] = *value);
            }
            let reached = gaps + matrix * &found;
            let next: Vec<usize> = (0..gaps.len()).filter(|i| soft * given[*i] > reached[*i]).collect();
            if next == closed {
                return Ok(found);
            }
            closed = next;
        }
        Err(format!("Newton's method did not converge in step {}", self.steps))
    }
}

impl<S: ReducedScene> ReducedMethod for Augmented<'_, S> {
    #[expect(clippy::cast_precision_loss, reason = "step counts are below 2^52")]
    fn step(&mut self) -> Result<ReducedStep, String> {
        let (h, modes, load) = (self.step, self.scene.modes(), self.scene.load());
        let count = modes.len();
        // q* = q + h v + h²/4 a, v* = v + h/2 a; a⁺ follows from the equation of motion at the end.
        let (mut ahead, mut rate, mut next) = (vec![0.0; count], vec![0.0; count], vec![0.0; count]);
        let mut free = vec![0.0; count];
        for mode in 0..count {
            let frequency = modes.frequencies[mode];
            rate[mode] = self.velocity[mode] + 0.5 * h * self.acceleration[mode];
            ahead[mode] = self.position[mode] + h * self.velocity[mode] + 0.25 * h * h * self.acceleration[mode];
            let drag = 2.0 * modes.damping[mode] * frequency * rate[mode];
            next[mode] = self.inertia[mode] * (load[mode] - frequency * frequency * ahead[mode] - drag);
            free[mode] = ahead[mode] + 0.25 * h * h * next[mode];
        }
        self.steps += 1;
        let contacts = self.scene.contacts(self.steps as f64 * h, &free, self.options.margin);
        let mut report = ReducedStep { forces: Vec::new(), least_gap: f64::INFINITY };
        let mut pushed = vec![0.0; if contacts.is_empty() { 0 } else { count }];
        for group in contacts.chunk_by(|a, b| a.group == b.group) {
            let (found, least) = self.multipliers(group)?;
            report.least_gap = report.least_gap.min(least);
            for (contact, multiplier) in group.iter().zip(found.iter()).filter(|(_, multiplier)| **multiplier > 0.0) {
                contact.force.add_to(*multiplier, &mut pushed);
                report.forces.push((contact.node, *multiplier));
            }
        }
        for (mode, force) in pushed.iter().enumerate() {
            next[mode] += self.inertia[mode] * force;
        }
        for mode in 0..count {
            self.position[mode] = ahead[mode] + 0.25 * h * h * next[mode];
            self.velocity[mode] = rate[mode] + 0.5 * h * next[mode];
        }
        self.acceleration = next;
        finite(&self.position, self.steps)?;
        Ok(report)
    }

    fn state(&self) -> (&[f64], &[f64]) {
        (&self.position, &self.velocity)
    }
    fn energy(&self) -> f64 {
        energy(self.scene.modes(), &self.position, &self.velocity)
    }
}
