//! State of a blade at any time within an accepted step (dense output).

use super::columns::displace_nodes;
use super::level::BladeLevel;
use super::minima::steady_motion;
use super::off_centre::{OffCentreGaps, directions_of};
use super::rows::BladeRows;
use super::surface::{DriveRate, FacedSurface};
use super::trial::{BladeTrial, StartContacts};
use crate::math::octet::{Eight, Octet, OctetKernel, both};
use crate::time::galerkin::basis::POINTS;
use crate::time::galerkin::trial::ForceInterpolation;

/// Response of the modes after a time: q = A q₀ + B q̇₀ and q̇ = −ω²B q₀ + C q̇₀ without forces.
#[derive(Debug, Clone)]
pub(super) struct ModeResponse {
    /// Kind of the sector, and bits of the time since the start of the step (s).
    key: (usize, u64),
    /// A, B (s) and C.
    terms: [Vec<Eight>; 3],
}

impl ModeResponse {
    /// Allocates the response of modes.
    pub fn new(rows: &BladeRows) -> Self {
        Self { key: (usize::MAX, 0), terms: std::array::from_fn(|_| vec![Eight::ZERO; rows.mode_blocks]) }
    }

    /// Returns whether the response belongs to a kind of sectors and a time (s).
    pub fn matches(&self, kind: usize, time: f64) -> bool {
        self.key == (kind, time.to_bits())
    }

    /// Returns q and q̇ of eight modes without forces, from their values at the start of the step and ω².
    #[inline(always)]
    pub fn free<L: Octet>(&self, block: usize, [q, v]: [L; 2], square: L) -> [L; 2] {
        let [a, b] = both(|term| L::load(&self.terms[term][block]));
        let c = L::load(&self.terms[2][block]);
        [a * q + b * v, c * v - square * b * q]
    }

    /// Computes the response of a kind of sectors after a time (s).
    pub fn compute(&mut self, rows: &BladeRows, kind: usize, time: f64) {
        self.key = (kind, time.to_bits());
        let [rates, per_frequency, ..] = &rows.rates;
        for (k, (rates, per_frequency)) in rates.iter().zip(per_frequency).enumerate() {
            for (i, (rate, per_frequency)) in rates.0.into_iter().zip(per_frequency.0).enumerate() {
                let (sine, cosine) = if per_frequency > 0.0 { libm::sincos(time / per_frequency) } else { (0.0, 0.0) };
                let decay = libm::exp(-rate * time);
                let (swing, lag) = (decay * cosine, decay * rate * per_frequency * sine);
                self.terms[0][k].0[i] = swing + lag;
                self.terms[1][k].0[i] = decay * per_frequency * sine;
                self.terms[2][k].0[i] = swing - lag;
            }
        }
    }
}

/// Finds modes, forces and gaps at a time within the accepted step.
pub(super) struct DenseOutput<'a> {
    pub trial: &'a mut BladeTrial,
    pub rows: &'a BladeRows,
    /// Table of the step.
    pub level: &'a BladeLevel,
    /// Response of the modes after the time since the start of the step.
    pub response: &'a ModeResponse,
    /// Time since the start of the step (s).
    pub time: f64,
    /// The first drive is the prescribed motion at that time.
    pub faced: &'a FacedSurface<'a>,
    /// Rates of the prescribed motion at that time.
    pub rate: DriveRate,
    /// True if forces act in the step.
    pub pushes: bool,
}

impl OctetKernel for DenseOutput<'_> {
    type Output = ();
    #[inline(always)]
    fn run<L: Octet>(mut self) {
        self.find_modes::<L>();
        let BladeTrial { start, sample, path_moved, evaluated, .. } = &mut *self.trial;
        evaluated.count(self.rows.blocks, 4);
        if !self.pushes {
            sample.multipliers.fill(Eight::ZERO);
            sample.forces.iter_mut().for_each(|forces| forces.fill(Eight::ZERO));
        }
        sample.slopes.copy_from_slice(&start.slopes);
        let ([closing_moved, around_moved], blocks) = (path_moved, self.rows.blocks);
        let modes = [&sample.modes[0][..], &sample.modes[1]];
        displace_nodes::<L, 2, 2>(self.rows, [0, 1], self.rows.mode_blocks, modes, [closing_moved, around_moved]);
        for (along, moved) in [&*closing_moved, &*around_moved].into_iter().enumerate() {
            sample.moved[along].copy_from_slice(&moved[..blocks]);
            sample.held[along].copy_from_slice(&moved[blocks..]);
        }
        if self.pushes {
            let weights = match self.level.kind {
                ForceInterpolation::Polynomial => self.level.basis.weights_at(self.time / self.level.step),
                ForceInterpolation::Constant => [0.0, 1.0, 0.0, 0.0],
            };
            self.find_forces::<L>(&weights);
        }
        self.find_gaps::<L>();
    }
}

impl DenseOutput<'_> {
    /// Finds q and q̇. The response to the polynomial force is a polynomial plus free vibration.
    #[inline(always)]
    fn find_modes<L: Octet>(&mut self) {
        let Self { trial, rows, level, response, time, pushes, .. } = self;
        let BladeTrial { start, sample, modal_forces, .. } = &mut **trial;
        for k in 0..rows.mode_blocks {
            let [a, b] = both(|term| L::load(&response.terms[term][k]));
            let c = L::load(&response.terms[2][k]);
            let [q, v] = both(|of| L::load(&start.modes[of][k]));
            let square = L::load(&rows.rates[2][k]);
            let mut steady = [L::zero(); 3];
            if *pushes {
                steady = steady_motion::<L>(rows, modal_forces, k, level.step);
            }
            let (left, rate) = (q - steady[0], v - steady[1]);
            let time = L::splat(*time);
            let position = steady[0] + time * (steady[1] + time * steady[2]) + a * left + b * rate;
            let velocity = steady[1] + L::splat(2.0) * time * steady[2] - square * b * left + c * rate;
            position.store(&mut sample.modes[0][k]);
            velocity.store(&mut sample.modes[1][k]);
        }
    }

    /// Interpolates multipliers and forces, and adds the quasi-static displacements under these forces.
    #[inline(always)]
    fn find_forces<L: Octet>(&mut self, weights: &[f64; POINTS]) {
        let Self { trial, rows, level, .. } = self;
        let BladeTrial { start, sample, multipliers, forces, .. } = &mut **trial;
        for block in 0..rows.blocks {
            let at = |start: &[Eight], lanes: &[Eight]| {
                let mut sum = L::splat(weights[0]) * L::load(&start[block]);
                for point in 0..level.points() {
                    sum = sum + L::splat(weights[point + 1]) * L::load(&lanes[point * rows.blocks + block]);
                }
                sum
            };
            let multiplier = at(&start.multipliers, multipliers);
            let acts = L::zero().less(multiplier) & rows.valid(block);
            L::select(acts, multiplier, L::zero()).store(&mut sample.multipliers[block]);
            for along in [0, 1] {
                L::select(acts, at(&start.forces[along], &forces[along]), L::zero())
                    .store(&mut sample.forces[along][block]);
            }
            let mut nodes = acts;
            while nodes != 0 {
                let i = nodes.trailing_zeros() as usize;
                nodes &= nodes - 1;
                for (along, seen) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
                    let force = L::splat(sample.forces[along][block].0[i]);
                    let column = &rows.flexibility[along][seen][(8 * block + i) * rows.blocks..][..rows.blocks];
                    for (moved, flexibility) in sample.moved[seen].iter_mut().zip(column) {
                        (L::load(moved) + L::load(flexibility) * force).store(moved);
                    }
                }
            }
        }
    }

    /// Finds the gaps F, their rates and σ from displacements and velocities. If a force acts on a node at any point of the step, F is at least
    /// the smallest of its values at the points, because the points represent fast modes only on average. Where this bound applies, or a force
    /// acts at this time, the rate is that of the polynomial through these values. Where a force acts at this time, σ follows from its direction.
    #[inline(always)]
    fn find_gaps<L: Octet>(&mut self) {
        let Self { trial, rows, level, faced, rate: of_drive, pushes, .. } = self;
        let BladeTrial { start, sample, multipliers, gaps, angles, directions_of_nodes, rates, .. } = &mut **trial;
        let drive = &faced.drives[0];
        let (speed, factor_rate) = (L::splat(of_drive.turned), L::splat(of_drive.factor));
        let slopes = level.basis.slopes_at(self.time / level.step).map(|slope| slope / level.step);
        for block in 0..rows.blocks {
            let per_radius = L::load(&rows.per_radius[block]);
            let [closing, around] = both(|along| L::load(&sample.moved[along][block]));
            let [closing_rate, around_rate] = both(|along| L::load(&sample.held[along][block]));
            let steepness = L::load(&rows.steepness[block]);
            let (clear, mut sigma, mut rate) = if faced.is_off_centre {
                let place = (L::load(&angles[block]), directions_of(directions_of_nodes, block));
                let seen = OffCentreGaps::new(faced.surface, drive, (rows, block), place, [closing, around]);
                let slope = L::load(&rows.slopes[block]);
                (seen.clear, seen.sigma, seen.rate(drive, of_drive, slope, [closing_rate, around_rate]))
            } else {
                let at = L::load(&angles[block]) + L::splat(drive.turned) + around * per_radius;
                let [shape, slope, _] = faced.surface.evaluate_octet::<L>(at);
                let factor = L::splat(drive.factor);
                let rate = closing_rate + shape * factor_rate + slope * factor * (speed + around_rate * per_radius);
                (L::splat(drive.clearance) + shape * factor, slope * factor * per_radius, rate)
            };
            let mut gap = clear + closing;
            if *pushes {
                let first = L::load(&start.gaps[block]);
                let mut touches = L::zero().less(L::load(&start.multipliers[block]));
                let (mut lowest, mut change) = (first, L::splat(slopes[0]) * first);
                for point in 0..level.points() {
                    let lane = point * rows.blocks + block;
                    touches |= L::zero().less(L::load(&multipliers[lane]));
                    let at_point = L::load(&gaps[lane]);
                    lowest = lowest.min(at_point);
                    change = change + L::splat(slopes[point + 1]) * at_point;
                }
                let penetrates = touches & gap.less(lowest);
                gap = L::select(penetrates, lowest, gap);
                let pushes = L::zero().less(L::load(&sample.multipliers[block]));
                rate = L::select(touches & (penetrates | pushes), change, rate);
                let around = L::load(&sample.forces[1][block]) / L::load(&sample.multipliers[block]);
                let of_force = around + L::load(&start.friction[block]) * steepness;
                sigma = L::select(pushes, of_force, sigma);
            }
            (rate / (steepness * steepness + sigma * sigma).sqrt()).store(&mut rates[block]);
            gap.store(&mut sample.gaps[block]);
            sigma.store(&mut sample.sigma[block]);
        }
    }
}

impl StartContacts {
    /// Allocates contacts and modes for a number of blocks of nodes and of modes.
    pub fn new(nodes: usize, modes: usize) -> Self {
        let of_nodes = || vec![Eight::ZERO; nodes];
        Self {
            modes: [vec![Eight::ZERO; modes], vec![Eight::ZERO; modes]],
            forces: [of_nodes(), of_nodes()],
            multipliers: of_nodes(),
            slopes: of_nodes(),
            held: [of_nodes(), of_nodes()],
            moved: [of_nodes(), of_nodes()],
            gaps: of_nodes(),
            sigma: of_nodes(),
            friction: of_nodes(),
            pushed: false,
        }
    }
}
