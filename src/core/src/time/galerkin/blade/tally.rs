//! Integrals over a span of the contacts of a blade, in blocks of nodes.

use super::columns::values_at_points;
use super::level::{BladeLevel, PartWeights};
use super::off_centre::{Directions, OffCentreGaps, directions_of, in_rotor};
use super::rows::BladeRows;
use super::surface::FacedSurface;
use super::trial::BladeTrial;
use crate::geometry::Vector3;
use crate::geometry::wrench::Wrench;
use crate::math::octet::{Eight, Octet, OctetKernel, both};
use crate::math::vector::ZERO;
use crate::system::ContactEvent;
use crate::system::contact_view::ContactMember;
use crate::system::work::ContactWork;
use crate::time::galerkin::basis::POINTS;
use crate::time::galerkin::record::{FORCE_ROUNDING, TurningMotion};
use crate::time::galerkin::trial::ForceInterpolation;

/// Sums over a span for each node.
#[derive(Debug, Clone)]
pub(crate) struct BladeTally {
    /// ∫λ dt and ∫|F_t| dt (N·s).
    normal: Vec<Eight>,
    tangential: Vec<Eight>,
    /// ∫ of the components of the force along the closing and the circumferential displacement (N·s).
    force: [Vec<Eight>; 2],
    /// ∫ of the force (N·s) and its moment (N·m·s) in fixed directions, and λ-weighted ∫ of its point of application
    /// (m·N·s).
    fixed_force: [Vec<Eight>; 3],
    moment: [Vec<Eight>; 3],
    point: [Vec<Eight>; 3],
    /// Largest λ (N), friction heat (J), and smallest gap (m).
    peak: Vec<Eight>,
    heat: Vec<Eight>,
    pub(super) lowest: Vec<Eight>,
    /// Work of all nodes (J).
    pub work: ContactWork,
    /// Damping loss (J).
    pub damping: f64,
    /// True if a contact exceeds the limits of small displacements.
    pub implausible: bool,
    /// True if a contact force acts during the span.
    pub touched: bool,
}

/// Largest depth of a plausible contact, as a fraction of the radius.
const SMALL: f64 = 0.1;

impl BladeTally {
    /// Allocates sums for the nodes of a blade.
    pub fn new(rows: &BladeRows) -> Self {
        let zeros = || vec![Eight::ZERO; rows.blocks];
        Self {
            normal: zeros(),
            tangential: zeros(),
            force: [zeros(), zeros()],
            fixed_force: [zeros(), zeros(), zeros()],
            moment: [zeros(), zeros(), zeros()],
            point: [zeros(), zeros(), zeros()],
            peak: zeros(),
            heat: zeros(),
            lowest: zeros(),
            work: ContactWork::default(),
            damping: 0.0,
            implausible: false,
            touched: false,
        }
    }

    /// Starts a span with these gaps (m).
    pub(super) fn begin(&mut self, lowest: &[Eight]) {
        let Self { normal, tangential, force, fixed_force, moment, point, peak, heat, .. } = self;
        let sums = [normal, tangential, peak, heat].into_iter();
        let sums = sums.chain(force).chain(fixed_force).chain(moment).chain(point);
        sums.for_each(|sums| sums.fill(Eight::ZERO));
        self.lowest.copy_from_slice(lowest);
        (self.work, self.damping) = (ContactWork::default(), 0.0);
        (self.implausible, self.touched) = (false, false);
    }

    /// Smallest gap of a node (m).
    pub fn lowest(&self, node: usize) -> f64 {
        self.lowest[node / 8].0[node % 8]
    }

    /// Mean contact of a node over a span of `span` seconds; `None` without contact.
    pub fn event(&self, rows: &BladeRows, at: ContactMember, span: f64) -> Option<ContactEvent> {
        let (block, i) = (at.node / 8, at.node % 8);
        let of = |values: &[Eight]| values[block].0[i];
        let normal = of(&self.normal);
        if normal <= 0.0 {
            return None;
        }
        let three = |values: &[Vec<Eight>; 3]| Vector3::from([0, 1, 2].map(|c| of(&values[c])));
        let wrench = Wrench {
            point: three(&self.point) / normal,
            force: three(&self.fixed_force) / span,
            moment: three(&self.moment) / span,
        };
        let force = rows.in_space(at.node, [0, 1].map(|along| of(&self.force[along])).into()) / span;
        let event = ContactEvent::new(at, normal / span, force, 0.0, ZERO, wrench);
        let (tangential, peak, friction_heat) = (of(&self.tangential) / span, of(&self.peak), of(&self.heat));
        Some(ContactEvent { tangential, peak, friction_heat, ..event })
    }
}

/// Sums to which a step is added.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Sums {
    /// Sums of the span, and the work.
    All,
    /// Sums of the span without the work.
    SpanOnly,
    /// The work.
    WorkOnly,
}

/// Adds a step, or a part of it, to the sums of a span.
pub(super) struct AddStep<'a> {
    pub tally: &'a mut BladeTally,
    pub trial: &'a BladeTrial,
    pub rows: &'a BladeRows,
    pub level: &'a BladeLevel,
    pub faced: &'a FacedSurface<'a>,
    /// Motion over which the forces at the points do work.
    pub motions: &'a [TurningMotion; POINTS],
    /// Weights of the part of the step.
    pub part: &'a PartWeights,
    pub sums: Sums,
}

impl OctetKernel for AddStep<'_> {
    type Output = ();
    #[inline(always)]
    fn run<L: Octet>(mut self) {
        for block in 0..self.rows.blocks {
            self.add_block::<L>(block);
        }
    }
}

impl AddStep<'_> {
    /// Adds the step or the part of it.
    pub fn add(self) {
        let instructions = self.trial.instructions;
        instructions.run_octets(self);
    }

    #[inline(always)]
    fn add_block<L: Octet>(&mut self, block: usize) {
        let Self { tally, trial, rows, level, faced, motions, part, sums } = self;
        let count = level.points() + 1;
        let start = &trial.start;
        let gaps = values_at_points::<L>(&start.gaps, &trial.gaps, block, count);
        let sigmas = values_at_points::<L>(&start.sigma, &trial.sigma, block, count);
        let multipliers = values_at_points::<L>(&start.multipliers, &trial.multipliers, block, count);
        let steepness = L::load(&rows.steepness[block]);
        let length = |sigma: L| (steepness * steepness + sigma * sigma).sqrt();
        let mut any = 0;
        for multiplier in &multipliers[..count] {
            any |= L::zero().less(*multiplier);
        }
        if any == 0 {
            return;
        }
        tally.touched |= *sums != Sums::WorkOnly;
        let forces = both(|along| values_at_points::<L>(&start.forces[along], &trial.forces[along], block, count));
        let moved = both(|along| values_at_points::<L>(&start.moved[along], &trial.moved[along], block, count));
        let radius = L::splat(1.0) / L::load(&rows.per_radius[block]);
        let per_radius = L::load(&rows.per_radius[block]);
        let slope = L::load(&rows.slopes[block]);
        let angles = directions_of::<L>(&trial.directions_of_nodes, block);
        let (mut work, mut by_shaft) = ([L::zero(); 4], [L::zero(); 2]);
        let mut heat_of_nodes = L::zero();
        let mut normals = [L::zero(); POINTS];
        let weights_of = |i: usize, values: &[L; POINTS]| {
            let mut sum = L::zero();
            for k in 0..count {
                sum = sum + values[k] * L::splat(part.work[i][k]);
            }
            sum
        };
        for i in 0..count {
            if L::zero().less(multipliers[i]) == 0 {
                continue;
            }
            let (multiplier, sigma) = (multipliers[i], sigmas[i]);
            let (size, duration) = (length(sigma), L::splat(part.durations[i]));
            let normal = multiplier * size;
            normals[i] = normal;
            let [closing, around] = [forces[0][i], forces[1][i]];
            // The friction force is the force minus its normal part λ' (1, σ).
            let mut friction = [closing - multiplier, around - multiplier * sigma];
            if faced.friction == 0.0 {
                let rounding = multiplier * L::splat(FORCE_ROUNDING);
                friction = friction.map(|part| L::select(rounding.less(part.abs()), part, L::zero()));
            }
            let tangential = (friction[0] * friction[0] * steepness * steepness + friction[1] * friction[1]).sqrt();
            let motion = &motions[i];
            let spin = radius * L::splat(motion.turn);
            let over = [weights_of(i, &moved[0]), weights_of(i, &moved[1])];
            let mut heat = L::zero() - (friction[0] * over[0] + friction[1] * (over[1] + spin));
            let drive = &faced.drives[i];
            let off_centre = faced.is_off_centre.then(|| {
                let place = (L::load(&trial.angles[block]), angles);
                OffCentreGaps::new(faced.surface, drive, (rows, block), place, [moved[0][i], moved[1][i]])
            });
            let meridional = L::load(&trial.meridional[i * rows.blocks + block]) * L::load(&rows.per_steepness[block]);
            let radial_move = slope * meridional - moved[0][i] / (steepness * steepness);
            let axial_move = slope * moved[0][i] / (steepness * steepness) + meridional;
            if let Some(off_centre) = &off_centre {
                let shaft = in_rotor(drive.rotor, motion.shaft);
                let axial = slope * L::splat(shaft[2]);
                let [closed, turned] = off_centre.seen(slope, L::splat(1.0) + radial_move * per_radius, &shaft);
                heat = heat - (friction[0] * closed + friction[1] * turned);
                by_shaft[0] = by_shaft[0] - (closing * (closed - axial) + around * turned);
                by_shaft[1] = by_shaft[1] - closing * axial;
            }
            heat_of_nodes = heat_of_nodes + heat;
            work[0] = work[0] - around * spin;
            work[1] = work[1] + closing * over[0] + around * over[1];
            work[2] = work[2] - multiplier * weights_of(i, &gaps);
            if !motion.is_casing_at_rest() {
                let at = L::load(&trial.angles[block]) + L::splat(drive.turned) + moved[1][i] * per_radius;
                let [shape, slope, scale] = match &off_centre {
                    Some(seen) => [seen.shape, seen.slope, seen.scale],
                    None => {
                        let [shape, slope, _] = faced.surface.evaluate_octet::<L>(at);
                        [shape, slope, L::splat(1.0)]
                    }
                };
                let turned = slope * L::splat(drive.factor * motion.shape_rotation);
                let opened = L::splat(motion.opening) + shape * L::splat(motion.shape_factor) - turned;
                work[3] = work[3] - multiplier * opened * scale;
            }
            if *sums == Sums::WorkOnly {
                continue;
            }
            let add = |sum: &mut Eight, value: L| (L::load(sum) + value).store(sum);
            add(&mut tally.normal[block], duration * normal);
            add(&mut tally.tangential[block], duration * tangential);
            add(&mut tally.force[0][block], duration * closing);
            add(&mut tally.force[1][block], duration * around);
            let frame = Directions::new(angles, drive.rotor, moved[1][i] * per_radius);
            let (arm, height) = (radius + radial_move, L::load(&rows.axial[block]) + axial_move);
            let (radial, tangent, axial) =
                (L::zero() - closing, around / (L::splat(1.0) + radial_move * per_radius), slope * closing);
            let in_plane = frame.fixed(radial, tangent);
            let place = frame.fixed(arm, L::zero());
            let centre = drive.shaft_in_space();
            // Cross product of (arm, 0, height) and (radial, tangential, axial) in the directions of the node.
            let moment = frame.fixed(L::zero() - height * tangent, height * radial - arm * axial);
            for c in [0, 1] {
                add(&mut tally.fixed_force[c][block], duration * in_plane[c]);
                add(&mut tally.moment[c][block], duration * moment[c]);
                add(&mut tally.point[c][block], duration * normal * (place[c] + L::splat(centre[c])));
            }
            add(&mut tally.fixed_force[2][block], duration * axial);
            add(&mut tally.moment[2][block], duration * radius * around);
            add(&mut tally.point[2][block], duration * normal * (height + L::splat(centre[2])));
            if level.basis.points[i] <= part.ends[1] {
                let deep = (gaps[i] / size).less(radius * L::splat(-SMALL)) | L::splat(1.0).less(sigma.abs());
                tally.implausible |= deep & L::zero().less(multiplier) != 0;
            }
        }
        if *sums != Sums::WorkOnly {
            (L::load(&tally.heat[block]) + heat_of_nodes).store(&mut tally.heat[block]);
            let peak = peak_of(level, &normals, part.ends);
            peak.max(L::load(&tally.peak[block])).store(&mut tally.peak[block]);
        }
        if *sums == Sums::SpanOnly {
            return;
        }
        let [shaft, exact, closing, casing] = [work[0].total(), work[1].total(), work[2].total(), work[3].total()];
        let [whirl, shift] = if faced.is_off_centre { both(|of| by_shaft[of].total()) } else { [0.0; 2] };
        let work = ContactWork {
            shaft,
            whirl,
            shift,
            exact,
            closing,
            casing,
            heat: heat_of_nodes.total(),
            turnover: shaft.abs() + whirl.abs() + shift.abs() + casing.abs(),
            moved: exact.abs(),
            ..ContactWork::default()
        };
        tally.work.add(&work);
    }
}

/// Largest value within a part of the step of the polynomial through values at its points.
#[inline(always)]
fn peak_of<L: Octet>(level: &BladeLevel, values: &[L; POINTS], ends: [f64; 2]) -> L {
    let count = level.points() + 1;
    let mut peak = L::zero();
    for (value, point) in values[..count].iter().zip(level.basis.points) {
        if level.kind == ForceInterpolation::Constant || (ends[0]..=ends[1]).contains(&point) {
            peak = peak.max(*value);
        }
    }
    if level.kind == ForceInterpolation::Constant {
        return peak;
    }
    let mut terms = [L::zero(); POINTS];
    for (value, row) in values[..count].iter().zip(&level.basis.monomials) {
        for (term, coefficient) in terms.iter_mut().zip(row) {
            *term = *term + *value * L::splat(*coefficient);
        }
    }
    // The derivative b + 2cθ + 3dθ² falls through zero at θ = b/(√(c² − 3bd) − c).
    let [a, b, c, d] = terms;
    let square = c * c - L::splat(3.0) * b * d;
    let theta = b / (square.max(L::zero()).sqrt() - c);
    let value = a + theta * (b + theta * (c + theta * d));
    let is_inside = L::zero().less(square) & L::splat(ends[0]).less(theta) & theta.less(L::splat(ends[1]));
    let mut peak = L::select(is_inside, peak.max(value), peak);
    for end in ends {
        if !level.basis.points[..count].contains(&end) {
            let end = L::splat(end);
            peak = peak.max(a + end * (b + end * (c + end * d)));
        }
    }
    peak
}
