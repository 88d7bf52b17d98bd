//! An independent check of the gaps that the energy ledger uses.
//!
//! The ledger splits the work of a contact into approach and the rest, and the balance closes for any gaps. But a gap is a signed
//! distance: it changes by no more than the motion of the node and of the surface, plus the prescribed motion of both. If a gap
//! changes by more, it is not a distance, and the step fails.

use super::{ContactEvent, StepFailure, System};
use crate::math::vector::{Vector3, length};

/// Changes below this count as rounding in any model (m), because no meaningful length is as short.
const ROUNDING: f64 = 1e-15;
/// Gaps may change by this factor more than the motion explains, because they are linear in the correction of a step, along one normal.
const FACTOR: f64 = 2.0;

impl System {
    /// Checks that the gap of a contact has changed over the two recorded steps by no more than its motion `moved` (m) and the
    /// prescribed motion `rigid` (m) explain.
    ///
    /// # Errors
    /// [`StepFailure::Unexplained`].
    #[inline(always)]
    pub(crate) fn witness(&self, event: &ContactEvent, moved: Vector3, rigid: f64) -> Result<(), StepFailure> {
        let ContactEvent { structure, node, sector, .. } = *event;
        let of = &self.structures[structure];
        let (index, gaps) = (of.index(node, sector), &of.history.gap);
        let (gap, oldest) = (gaps.now[index], gaps.oldest[index]);
        // A node that passes a free edge has been checked before (`check_edges`).
        if oldest.is_infinite() || self.counted.steps < self.counted.witnessed {
            return Ok(());
        }
        // Rounding and the linear gap within a step; `moved` is half of the motion over two steps.
        let own = self.pairs[event.pair].gap().indifferent(node) + ROUNDING;
        let explained = rigid + (2.0 * FACTOR * length(moved) + own);
        let jump = (gap - oldest).abs();
        if jump.is_nan() || explained.is_nan() || jump > explained {
            return Err(StepFailure::Unexplained { structure, node, sector, jump, explained });
        }
        Ok(())
    }

    /// Returns the change of the gaps of a pair over two steps that prescribed motion explains (m): moving inputs, and rotation
    /// under the shape of the casing.
    pub(crate) fn explained_by_drive(&self, pair: usize) -> f64 {
        let pair = &self.pairs[pair];
        let (drive, motion) = (pair.drive_now(), pair.prescribed.motion.now.since(&pair.prescribed.motion.before));
        // The larger of the rotations relative to the casing and to its shape.
        let turned = motion.turn.abs().max((motion.turn - motion.shape_rotation).abs());
        let off_centre = libm::hypot(drive.shaft[0], drive.shaft[1]);
        let factor = drive.shape_factor.abs().max((drive.shape_factor - motion.shape_factor).abs());
        let shape = pair.gap().shape_size() * motion.shape_factor.abs();
        let carrier = pair.carrier().filter(|_| pair.gap().layout().is_some());
        let carried = carrier.map_or(0.0, |carrier| self.structures[carrier.structure].largest_displacement());
        let turning = pair.gap().turned_under(turned, factor, carried);
        let shifted = length(motion.shaft);
        FACTOR * (shifted + turned * off_centre + motion.opening.abs() + shape + turning)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::ContactParameters;
    use crate::geometry::{FixedGap, GapLaw, PrescribedMotion};
    use crate::modes::bank::SectorModel;
    use crate::modes::modal::ModalModel;
    use crate::scene::method::{Scheme, Solver};
    use crate::system::{PairParts, StructureParts, SystemSettings};
    use crate::time::{Recurrence, Stepper};
    use nalgebra::DMatrix;

    /// A mass on a soft spring that moves at 1 m/s towards a wall 0.1 mm away.
    fn flying() -> System {
        let model = ModalModel {
            frequencies: vec![10.0],
            damping_ratios: vec![0.0],
            contact_modes: DMatrix::from_row_slice(3, 1, &[1.0, 0.0, 0.0]),
            shapes: DMatrix::identity(1, 1),
            quasi_static: 0,
        };
        let law = FixedGap { normals: vec![-Vector3::x()], gaps: vec![1e-4], sliding: vec![Vector3::zeros()] };
        let (scheme, solver) = (Scheme::ModalExact, Solver::Lcp);
        let settings = SystemSettings { scheme, solver, ledger: true };
        let parameters = ContactParameters::FRICTIONLESS;
        let pair = PairParts { structure: 0, gap: GapLaw::Fixed(law), carrier: None, parameters };
        let structure = StructureParts::Touching(SectorModel::Uncoupled(&model, 1), Box::default());
        let mut system = System::of(vec![structure], vec![pair], Vec::new(), settings);
        system.set_step(1e-6);
        system.bank_mut().set_modal_state(0, 0, 0.0, 1.0);
        system.start(&[PrescribedMotion::default()]);
        system
    }

    #[test]
    fn inconsistent_gap_change_fails_the_step() {
        let mut system = flying();
        let mut honest = system.clone();
        while system.events().is_empty() {
            honest = system.clone();
            Recurrence.step(&mut system, &[PrescribedMotion::default()]).unwrap();
        }
        // The mass came 1 µm closer; errors of 10 µm and of 1 m are rejected, one of 0.1 µm is not.
        for (off, passes) in [(0.0, true), (1e-7, true), (1e-5, false), (1.0, false), (f64::NAN, false)] {
            let mut spoilt = honest.clone();
            spoilt.structures[0].history.gap.before[0] += off;
            let outcome = Recurrence.step(&mut spoilt, &[PrescribedMotion::default()]);
            assert_eq!(outcome.is_ok(), passes, "{off}: {outcome:?}");
            if let (Err(failure), false) = (outcome, off.is_nan()) {
                let StepFailure::Unexplained { structure: 0, node: 0, sector: 0, jump, explained } = failure else {
                    panic!("{failure:?}")
                };
                assert!(jump > off && explained < 1e-5, "{jump:e}, {explained:e}");
            }
        }
    }
}
