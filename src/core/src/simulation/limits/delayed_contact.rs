//! Step limits of a structure whose contact forces act one step late, with and without surface carriers.

use std::f64::consts::TAU;

use nalgebra::DMatrix;

use super::checking::{CARRIER_ANGLES, Checking, carrier_angle, carrier_at};
use super::known::CheckPart;
use crate::geometry::spline::SplineGap;
use crate::limits::finding::{ErrorKind, WarningKind};
use crate::limits::massless::{self, CarrierUnderNodes, MasslessCheck, MasslessLimit};
use crate::math::real;
use crate::modes::cyclic::CyclicModel;
use crate::modes::modal::ModalModel;

/// Smallest number of rotor angles per sector at which all blades are checked together.
const ANGLES_PER_SECTOR: usize = 4;

/// The surfaces that carriers deform, and the modes of the carriers at the control points of these surfaces.
type CarriedSurfaces<'a> = [(&'a SplineGap, usize, ModalModel)];

/// Returns the check at the place where the carriers are most compliant, because a casing may differ around the circumference.
fn choose_most_compliant<'a>(
    check: MasslessCheck<'a>,
    places: impl Iterator<Item = Vec<CarrierUnderNodes<'a>>>,
    step: f64,
) -> MasslessCheck<'a> {
    let (mut most, mut chosen) = (f64::NEG_INFINITY, check.clone());
    for carriers in places {
        let tried = MasslessCheck { carriers, ..check.clone() };
        if let Some((_, found)) = tried.eigenvalues(step).filter(|(_, found)| *found > most) {
            (most, chosen) = (found, tried);
        }
    }
    chosen
}

impl Checking<'_> {
    /// Returns warnings for the expected `step` (s), and the step limits, if contact forces act one step late. The warnings concern energy
    /// that contact may gain, and blades in simultaneous contact for which stability is not proven.
    pub(super) fn delayed_contact(&self, step: f64) -> Result<(Vec<WarningKind>, MasslessLimit), ErrorKind> {
        if !self.parameters.scheme.properties().delays_contact {
            return Ok((Vec::new(), MasslessLimit::NONE));
        }
        // Each surface has its own carrier: several surfaces of one carrier are rejected.
        let carried = self.carried();
        let largest = 1.01 * self.parameters.step.max(step) / massless::USABLE_STIFF;
        let (mut limit, mut worst) = (MasslessLimit::NONE, (0.0, 0.0));
        for (diameter, model) in self.models.iter().enumerate() {
            let mut check = self.without_carriers(model);
            if !carried.is_empty() {
                let at = |place| self.carriers_under(&carried, diameter, carrier_angle(place));
                check = choose_most_compliant(check, (0..CARRIER_ANGLES).map(at), step);
            }
            // Only the tightest of several limits counts.
            limit = limit.tightest(check.limit(largest.min(limit.closed))?);
            let found = check.eigenvalues(step / massless::USABLE).unwrap_or(worst);
            worst = (found.0.max(worst.0), found.1.max(worst.1));
        }
        massless::check(step, limit)?;
        let (master, carrier) = worst;
        let sectors = self.compiled.body(self.body).1.sectors;
        let are_all_stable = || {
            let compute = || self.eigenvalue_of_all_blades(&carried, step);
            let found = self.known.get(CheckPart::AllBladesOnCarrier, &[step.to_bits()], compute);
            found.is_some_and(|found| found < massless::STABLE)
        };
        let blades = (!carried.is_empty() && !are_all_stable()).then(|| {
            let stable = ((massless::STABLE - master) / carrier).floor().max(1.0);
            WarningKind::MasslessBlades { stable, sectors }
        });
        Ok((massless::warning(step, limit).into_iter().chain(blades).collect(), limit))
    }

    /// Returns the check of a model on rigid surfaces.
    fn without_carriers<'a>(&self, model: &'a ModalModel) -> MasslessCheck<'a> {
        MasslessCheck { model, normals: self.normals(model), carriers: Vec::new() }
    }

    /// Returns the modes of the carriers under one blade at an angle (rad), projected on one nodal diameter of coupled sectors. A contact
    /// of one blade acts equally on all nodal diameters, so the most compliant one bounds the contribution of the carrier.
    fn carriers_under<'a>(
        &self,
        carried: &'a CarriedSurfaces,
        diameter: usize,
        angle: f64,
    ) -> Vec<CarrierUnderNodes<'a>> {
        let rows = self.models[diameter].contact_modes.nrows() / 3;
        let weight = self.disk().map_or(1.0, |disk| disk.weight(diameter));
        let under = |(gap, _, model): &'a (&SplineGap, usize, ModalModel)| {
            let along_normals = carrier_at(gap, model, &self.nodes, angle).0;
            // The real part of the displacement pattern comes first.
            let normals = (along_normals * weight).resize_vertically(rows, 0.0);
            CarrierUnderNodes { normals, model }
        };
        carried.iter().map(under).collect()
    }

    /// Returns a bound on the eigenvalues of closed contact of all blades, at a step that is longer than `step` (s) by the margin of the
    /// accepted steps. `None` if the flexibility of the contact nodes is singular.
    fn eigenvalue_of_all_blades(&self, carried: &CarriedSurfaces, step: f64) -> Option<f64> {
        let small = massless::small_step(&self.models[0]);
        let added = self.carrier_eigenvalue_of_all_blades(carried, small)?;
        let mut stiffenings = self.models.iter().map(|model| {
            let check = self.without_carriers(model);
            Some(check.stiffening(small, check.eigenvalues(small)?.0 + added))
        });
        let stiffening = stiffenings.try_fold(0.0, |most: f64, found| Some(most.max(found?)))?;
        let longer = step / massless::usable_fraction(stiffening);
        let mut masters = self.models.iter().map(|model| Some(self.without_carriers(model).eigenvalues(longer)?.0));
        let master = masters.try_fold(0.0, |most: f64, found| Some(most.max(found?)))?;
        Some(master + self.carrier_eigenvalue_of_all_blades(carried, longer)?)
    }

    /// Returns the largest eigenvalue that the carriers add at a step (s) while all blades are in contact, over all checked rotor angles.
    /// Distant blades hardly interact, so it is much smaller than the sum over the blades. `None` if the flexibility of the contact nodes
    /// is singular.
    fn carrier_eigenvalue_of_all_blades(&self, carried: &CarriedSurfaces, step: f64) -> Option<f64> {
        let sectors = self.compiled.body(self.body).1.sectors;
        let pitch = TAU / real(sectors);
        let flexibilities: Vec<DMatrix<f64>> = self
            .models
            .iter()
            .map(|model| self.without_carriers(model).flexibility_factor(step))
            .collect::<Option<_>>()?;
        let at_angle = |first: f64| -> Option<f64> {
            let under = |sector: usize| {
                let angle = first + pitch * real(sector);
                let each = carried.iter().map(|(gap, _, model)| {
                    let normals = carrier_at(gap, model, &self.nodes, angle).0;
                    CarrierUnderNodes { normals, model }.scaled_normals(step)
                });
                join_columns(&each.collect::<Vec<_>>())
            };
            let blades: Vec<DMatrix<f64>> = (0..sectors).map(under).collect();
            largest_eigenvalue(&blades, &flexibilities, self.disk())
        };
        // The number of angles on the casing is at least that of the check of one blade.
        let count = ANGLES_PER_SECTOR.max(CARRIER_ANGLES.div_ceil(sectors));
        let angles = (0..count).map(|place| pitch * real(place) / real(count));
        angles.map(at_angle).try_fold(0.0, |most: f64, found| Some(most.max(found?)))
    }
}

/// Returns the largest eigenvalue of Ψᵀ G⁻¹ Ψ. `blades` contains the rows of Ψ for every blade. `factors` contains the L of G = L Lᵀ for
/// one uncoupled blade, or for every nodal diameter of a disk. `None` if a factor is singular.
fn largest_eigenvalue(blades: &[DMatrix<f64>], factors: &[DMatrix<f64>], disk: Option<&CyclicModel>) -> Option<f64> {
    let mut sum = DMatrix::zeros(blades[0].ncols(), blades[0].ncols());
    let mut add = |factor: &DMatrix<f64>, rows: &DMatrix<f64>| {
        let half = factor.solve_lower_triangular(rows)?;
        sum.gemm_tr(1.0, &half, &half, 1.0);
        Some(())
    };
    match disk {
        None => blades.iter().try_for_each(|blade| add(&factors[0], blade))?,
        Some(disk) => factors.iter().enumerate().try_for_each(|(diameter, factor)| {
            // The flexibility of a nodal diameter contains the square of its weight, and so does a product of two orthonormal patterns.
            add(factor, &(project(blades, diameter, disk.is_real(diameter)) * disk.weight(diameter).powi(2)))
        })?,
    }
    Some(sum.symmetric_eigenvalues().max())
}

/// Joins the columns of matrices with the same number of rows.
fn join_columns(parts: &[DMatrix<f64>]) -> DMatrix<f64> {
    let columns: Vec<_> = parts.iter().flat_map(|part| part.column_iter()).collect();
    DMatrix::from_columns(&columns)
}

/// Sums the rows of all blades with the phases of a nodal diameter: the real parts, then the imaginary parts unless they are zero.
fn project(blades: &[DMatrix<f64>], diameter: usize, is_real: bool) -> DMatrix<f64> {
    let (rows, columns) = blades[0].shape();
    let mut sums = DMatrix::zeros(if is_real { rows } else { 2 * rows }, columns);
    for (sector, blade) in blades.iter().enumerate() {
        let angle = TAU * real(diameter * sector % blades.len()) / real(blades.len());
        for (part, factor) in [libm::cos(angle), -libm::sin(angle)].into_iter().enumerate().take(sums.nrows() / rows) {
            sums.rows_mut(part * rows, rows).zip_apply(blade, |sum, entry| *sum += factor * entry);
        }
    }
    sums
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Complex;
    use tiprub_test_models::SeededRandom;

    /// Returns the flexibility of one nodal diameter: a Hermitian matrix, or a real one.
    fn flexibility(random: &mut SeededRandom, nodes: usize, is_real: bool) -> DMatrix<Complex<f64>> {
        let imaginary = if is_real { 0.0 } else { 1.0 };
        let root = random
            .matrix(nodes, nodes)
            .zip_map(&random.matrix(nodes, nodes), |re, im| Complex::new(re, imaginary * im));
        &root * root.adjoint() + DMatrix::identity(nodes, nodes) * Complex::new(0.1, 0.0)
    }

    /// Returns the displacements of all sectors under unit forces: u_s = Σ_n Re(G_n Σ_r f_r e^(iφ_n(s − r))).
    fn disk_flexibility(flexibilities: &[DMatrix<Complex<f64>>], sectors: usize) -> DMatrix<f64> {
        let nodes = flexibilities[0].nrows();
        DMatrix::from_fn(sectors * nodes, sectors * nodes, |row, column| {
            let apart = real(row / nodes) - real(column / nodes);
            let term = |(n, flexibility): (usize, &DMatrix<Complex<f64>>)| {
                let angle = TAU * real(n) * apart / real(sectors);
                let turn = Complex::new(angle.cos(), angle.sin());
                (flexibility[(row % nodes, column % nodes)] * turn).re
            };
            flexibilities.iter().enumerate().map(term).sum()
        })
    }

    #[test]
    fn eigenvalue_of_all_blades_equals_that_of_the_whole_disk() {
        let mut random = SeededRandom(5);
        for (sectors, nodes, modes) in [(5, 2, 3), (6, 3, 4), (7, 1, 9)] {
            let disk = CyclicModel { sectors, diameters: Vec::new() };
            let diameters = 0..=sectors / 2;
            let flexibilities: Vec<_> =
                diameters.clone().map(|n| flexibility(&mut random, nodes, disk.is_real(n))).collect();
            let factors: Vec<_> = diameters
                .map(|n| {
                    let (flexibility, parts) = (&flexibilities[n], if disk.is_real(n) { 1 } else { 2 });
                    let paired = DMatrix::from_fn(parts * nodes, parts * nodes, |row, column| {
                        let value = flexibility[(row % nodes, column % nodes)];
                        match (row / nodes, column / nodes) {
                            (0, 0) | (1, 1) => value.re,
                            (0, _) => -value.im,
                            _ => value.im,
                        }
                    });
                    paired.cholesky().unwrap().l()
                })
                .collect();
            let blades: Vec<_> = (0..sectors).map(|_| random.matrix(nodes, modes)).collect();
            let all = DMatrix::from_fn(sectors * nodes, modes, |row, mode| blades[row / nodes][(row % nodes, mode)]);
            let whole = disk_flexibility(&flexibilities, sectors).cholesky().unwrap();
            let expected = (all.transpose() * whole.solve(&all)).symmetric_eigenvalues().max();
            let found = largest_eigenvalue(&blades, &factors, Some(&disk)).unwrap();
            assert!((found / expected - 1.0).abs() < 1e-12, "{sectors} sectors: {found}, expected {expected}");
            // Fewer blades add less.
            let few: Vec<_> =
                blades.iter().enumerate().map(|(s, blade)| if s < 2 { blade.clone() } else { blade * 0.0 }).collect();
            assert!(largest_eigenvalue(&few, &factors, Some(&disk)).unwrap() < found);
            let uncoupled = largest_eigenvalue(&blades, &factors[..1], None).unwrap();
            let bound: f64 = blades
                .iter()
                .map(|blade| largest_eigenvalue(std::slice::from_ref(blade), &factors[..1], None).unwrap())
                .sum();
            assert!(uncoupled <= bound * (1.0 + 1e-12), "{uncoupled} above {bound}");
        }
    }
}
