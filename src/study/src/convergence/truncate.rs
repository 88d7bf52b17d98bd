//! Truncates a ROM to fewer of its modes with a Craig-Bampton reduction of the reduced model itself, so that contact nodes and their static
//! responses are kept. If the coordinates of the contact nodes leave no room for that, the lowest natural modes are kept.

use nalgebra::{ComplexField, DMatrix};
use tiprub_core::Rom;
use tiprub_core::scene::rom::{Harmonic, ReductionBasis, RomChecks, Spin, Thermal};

/// Form of truncation of a ROM.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Truncation {
    /// Fixed-interface modes, beside the displacements of the contact nodes.
    Held,
    /// Natural modes, beside the static responses to contact forces.
    Free,
    /// Natural modes alone.
    Natural,
}

impl Truncation {
    /// Returns the form that suits a ROM.
    pub fn of(rom: &Rom) -> Self {
        match rom.extras.basis {
            _ if rom.contact_map.nrows() >= rom.order() => Self::Natural,
            ReductionBasis::FixedInterface => Self::Held,
            ReductionBasis::FreeInterface => Self::Free,
        }
    }

    /// Returns the number of modes of a ROM in this form; for coupled sectors, that of nodal diameter 0.
    pub fn modes(self, rom: &Rom) -> usize {
        match self {
            Self::Held | Self::Free => rom.order() - rom.contact_map.nrows(),
            Self::Natural => rom.order(),
        }
    }
}

/// Returns the ROM with `modes` of its modes; for coupled sectors, every nodal diameter loses the same number of modes.
///
/// # Errors
/// The ROM cannot be truncated.
pub fn truncated(rom: &Rom, modes: usize) -> Result<Rom, String> {
    let form = Truncation::of(rom);
    let less = form.modes(rom).saturating_sub(modes);
    let basis = basis(form, [&rom.mass, &rom.stiffness, &rom.contact_map], less)?;
    let [mass, stiffness] = [&rom.mass, &rom.stiffness].map(|matrix| congruent(matrix, &basis));
    let mut found = Rom {
        mass,
        stiffness,
        contact_map: &rom.contact_map * &basis,
        checks: RomChecks::default(),
        origin: format!("{}; truncated to {modes} modes", rom.origin),
        ..rom.clone()
    };
    found.extras.spin = rom.extras.spin.as_ref().map(|spin| of_spin(spin, &basis));
    found.extras.thermal = rom
        .extras
        .thermal
        .as_ref()
        .map(|thermal| Thermal { loads: basis.transpose() * &thermal.loads, patches: thermal.patches.clone() });
    for seen in [&mut found.extras.watched, &mut found.extras.stress].into_iter().flatten() {
        seen.map = &seen.map * &basis;
    }
    let harmonics = rom.extras.harmonics.iter().map(|harmonic| of_harmonic(form, harmonic, less));
    found.extras.harmonics = harmonics.collect::<Result<_, _>>()?;
    found.validate().map_err(|error| error.to_string())?;
    Ok(found)
}

fn of_harmonic(form: Truncation, harmonic: &Harmonic, less: usize) -> Result<Harmonic, String> {
    let basis = basis(form, [&harmonic.mass, &harmonic.stiffness, &harmonic.contact_map], less)?;
    Ok(Harmonic {
        mass: congruent(&harmonic.mass, &basis),
        stiffness: congruent(&harmonic.stiffness, &basis),
        contact_map: &harmonic.contact_map * &basis,
    })
}

fn of_spin(spin: &Spin, basis: &DMatrix<f64>) -> Spin {
    let load = |load: &[f64]| (basis.transpose() * DMatrix::from_column_slice(load.len(), 1, load)).as_slice().to_vec();
    let coriolis = basis.transpose() * &spin.coriolis * basis;
    Spin {
        stiffness_speed2: congruent(&spin.stiffness_speed2, basis),
        stiffness_speed4: congruent(&spin.stiffness_speed4, basis),
        coriolis: (&coriolis - coriolis.transpose()) * 0.5,
        centrifugal_load: load(&spin.centrifugal_load),
        centrifugal_load_speed4: load(&spin.centrifugal_load_speed4),
        largest_speed: spin.largest_speed,
    }
}

/// Returns Tᴴ A T of a Hermitian matrix A, made Hermitian to the last bit.
fn congruent<T: ComplexField<RealField = f64>>(matrix: &DMatrix<T>, basis: &DMatrix<T>) -> DMatrix<T> {
    let found = basis.adjoint() * matrix * basis;
    (&found + found.adjoint()).map(|entry| entry.scale(0.5))
}

/// Returns the basis of the truncated model: static responses to displacements of the contact nodes and fixed-interface modes, or natural modes. The
/// `less` highest modes are omitted.
fn basis<T: ComplexField<RealField = f64>>(
    form: Truncation,
    [mass, stiffness, map]: [&DMatrix<T>; 3],
    less: usize,
) -> Result<DMatrix<T>, String> {
    let order = mass.nrows();
    if form == Truncation::Natural {
        let kept = order.checked_sub(less).filter(|kept| *kept > 0).ok_or("no mode would be left")?;
        return modes(&DMatrix::identity(order, order), mass, stiffness, kept);
    }
    if form == Truncation::Free {
        return free_basis([mass, stiffness, map], less);
    }
    // Minimum-norm coordinates of the contact displacements, and the space that moves no contact node.
    let gram = (map * map.adjoint()).try_inverse().ok_or("two contact displacements are linearly dependent")?;
    let inverse = map.adjoint() * gram;
    let projector = DMatrix::identity(order, order) - &inverse * map;
    let eigen = projector.symmetric_eigen();
    let free: Vec<usize> = (0..order).filter(|column| eigen.eigenvalues[*column] > 0.5).collect();
    let inner = eigen.eigenvectors.select_columns(&free);
    let kept = free.len().checked_sub(less).ok_or("no mode would be left at one of the nodal diameters")?;
    let held = inner.adjoint() * stiffness * &inner;
    let moved = held.try_inverse().ok_or("the structure can move as a rigid body even with its contact nodes held")?;
    let statics = &inverse - &inner * (moved * inner.adjoint() * stiffness * &inverse);
    let modes = modes(&inner, mass, stiffness, kept)?;
    let mut basis = DMatrix::zeros(order, statics.ncols() + kept);
    basis.columns_mut(0, statics.ncols()).copy_from(&statics);
    basis.columns_mut(statics.ncols(), kept).copy_from(&modes);
    Ok(basis)
}

/// Returns the static responses, and the natural modes beside them without the `less` highest.
fn free_basis<T: ComplexField<RealField = f64>>(
    [mass, stiffness, map]: [&DMatrix<T>; 3],
    less: usize,
) -> Result<DMatrix<T>, String> {
    let (order, rows) = (mass.nrows(), map.nrows());
    let kept = order.checked_sub(rows + less).ok_or("no mode would be left at one of the nodal diameters")?;
    let flexibility =
        stiffness.clone().try_inverse().ok_or("the structure can move as a rigid body and has no static response")?;
    let mut basis = DMatrix::zeros(order, rows + kept);
    // Scaled to the size of modes for good conditioning.
    let responses = flexibility * map.adjoint();
    let energies = congruent(stiffness, &responses).diagonal().map(|entry| entry.real().sqrt());
    for (column, energy) in energies.iter().enumerate() {
        basis.column_mut(column).copy_from(&responses.column(column).map(|entry| entry.unscale(*energy)));
    }
    basis.columns_mut(rows, kept).copy_from(&modes(&DMatrix::identity(order, order), mass, stiffness, kept)?);
    Ok(basis)
}

/// Returns the `kept` lowest modes of the pencil within a subspace.
fn modes<T: ComplexField<RealField = f64>>(
    space: &DMatrix<T>,
    mass: &DMatrix<T>,
    stiffness: &DMatrix<T>,
    kept: usize,
) -> Result<DMatrix<T>, String> {
    let lower = congruent(mass, space).cholesky().ok_or("the mass matrix is not positive definite")?.l();
    let inverse = lower.try_inverse().ok_or("the mass matrix is singular")?;
    let scaled = &inverse * congruent(stiffness, space) * inverse.adjoint();
    let eigen = (&scaled + scaled.adjoint()).map(|entry| entry.scale(0.5)).symmetric_eigen();
    let mut order: Vec<usize> = (0..eigen.eigenvalues.len()).collect();
    order.sort_by(|a, b| eigen.eigenvalues[*a].total_cmp(&eigen.eigenvalues[*b]));
    order.truncate(kept);
    Ok(space * inverse.adjoint() * eigen.eigenvectors.select_columns(&order))
}

#[cfg(test)]
mod tests {
    use tiprub_core::modes::modal::ModalModel;
    use tiprub_model::{
        Rotor37Options, reduce_rotor37,
        rotor37::{MeshCounts, TipContact},
    };

    use super::*;

    /// Craig-Bampton modes are nested: truncation to fewer modes equals reduction with fewer modes, spin matrices included.
    #[test]
    fn truncation_is_the_reduction_with_fewer_modes() {
        let options = |modes: usize| Rotor37Options {
            mesh: MeshCounts { chord: 4, thickness: 1, span: 6 },
            tip: TipContact::Nodes(2),
            modes,
            spin: Some(1000.0),
            ..Rotor37Options::paper()
        };
        let [fine, coarse] = [8, 4].map(|modes| reduce_rotor37(&options(modes), &|_| {}).unwrap().rom);
        let found = truncated(&fine, 4).unwrap();
        assert_eq!(
            (Truncation::of(&fine), Truncation::of(&fine).modes(&fine), found.order()),
            (Truncation::Held, 8, coarse.order())
        );
        // The dependence of the stiffness on the speed is a fit to the modes that are kept.
        for (speed, close) in [(0.0, 1e-6), (900.0, 1e-3)] {
            let [own, other] = [&found, &coarse].map(|rom| ModalModel::at_speed(rom, 0.01, speed).unwrap());
            for (a, b) in own.frequencies.iter().zip(&other.frequencies) {
                assert!((a / b - 1.0).abs() < close, "{a} {b} at {speed}");
            }
        }
        // With all modes nothing changes, and the static response never changes. The result does not depend on the kind of coordinates.
        let order = fine.order();
        let turned = DMatrix::from_fn(order, order, |i, j| if i == j { 1.0 } else { 0.3 / (1 + i + 2 * j) as f64 });
        let mut other = fine.clone();
        (other.mass, other.stiffness) = (congruent(&fine.mass, &turned), congruent(&fine.stiffness, &turned));
        other.contact_map = &fine.contact_map * &turned;
        other.extras.spin = None;
        let again = truncated(&other, 4).unwrap();
        let [own, expected] = [&again, &coarse].map(|rom| ModalModel::from_rom(rom, 0.01).unwrap().frequencies);
        assert!(own.iter().zip(&expected).all(|(a, b)| (a / b - 1.0).abs() < 1e-6), "{own:?} {expected:?}");
        let whole = truncated(&fine, 8).unwrap();
        let compliance =
            |rom: &Rom| &rom.contact_map * rom.stiffness.clone().try_inverse().unwrap() * rom.contact_map.transpose();
        for rom in [&whole, &found, &again] {
            let off = (compliance(rom) - compliance(&fine)).amax() / compliance(&fine).amax();
            assert!(off < 1e-9, "{off:e}");
        }
    }

    #[test]
    fn rom_with_more_contacts_than_coordinates_keeps_low_modes() {
        let options = Rotor37Options {
            mesh: MeshCounts { chord: 4, thickness: 1, span: 6 },
            tip: TipContact::Nodes(2),
            modes: 8,
            ..Rotor37Options::paper()
        };
        let mut rom = reduce_rotor37(&options, &|_| {}).unwrap().rom;
        let frequencies = ModalModel::from_rom(&rom, 0.01).unwrap().frequencies;
        // The same displacements are repeated several times.
        rom.contact_map = DMatrix::from_fn(18, rom.order(), |row, column| rom.contact_map[(row % 6, column)]);
        let nodes = rom.contact_nodes.iter().cycle().take(6).enumerate();
        rom.contact_nodes = nodes
            .map(|(number, node)| tiprub_core::scene::rom::ContactNode {
                name: format!("node_{number}"),
                ..node.clone()
            })
            .collect();
        let found = truncated(&rom, 5).unwrap();
        assert_eq!((Truncation::of(&rom), found.order()), (Truncation::Natural, 5));
        for (a, b) in ModalModel::from_rom(&found, 0.01).unwrap().frequencies.iter().zip(&frequencies) {
            assert!((a / b - 1.0).abs() < 1e-9, "{a} {b}");
        }
        assert!(truncated(&rom, 0).unwrap_err().contains("no mode"));
    }
}
