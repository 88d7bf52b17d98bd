//! Reduction of the model of one sector to a checked reduced-order model of the disk.

use faer::{Mat, MatRef, c64};
use nalgebra::{Complex, DMatrix};
use tiprub_core::Rom;
use tiprub_core::scene::rom::{ContactNode, DisplacementFrame, Harmonic, RomExtras};

use super::component::{self, Component, ComponentModes, RequestedModes};
use super::condense::Condensed;
use super::operator::CyclicPencil;
use super::sector::Sector;
use super::{CyclicBoundary, CyclicOptions, CyclicReduction, ModeSelection, NodalDiameter};
use super::{families, lanczos, parallel, quality};
use crate::progress::{Listener, ReductionStage, report};
use crate::reduce::{ContactPoint, ReductionKind, check_nodes, interface, responses};
use crate::shapes::{DiameterShapes, Surface};
use crate::{Error, FeModel, Result};

/// Result of one nodal diameter, computed in parallel.
struct DiameterReduction {
    component: Component,
    full_squares: Vec<f64>,
    shapes: Vec<Vec<[Complex<f64>; 3]>>,
    /// Displacements of the surface per computed coordinate, 3·points × coordinates; `None` without a mesh.
    moved: Option<Mat<c64>>,
}

/// Reduces one sector of a disk to its contact nodes or patches and modes, for every nodal diameter.
///
/// The reduced coordinates of nodal diameter n are the radial, tangential and axial displacements of the contact
/// nodes or patches, one by one, then the modes (for free-interface modes, the modes of their parts with the contact
/// held), so `contact_map` is \[I 0\]; [`tiprub_core::scene::rom::Harmonic`] describes how they determine the displacements
/// of sector s. A disk without clamped nodes keeps its rigid-body modes, in nodal diameters 0 and 1. The bits of the
/// result do not depend on the number of threads.
///
/// # Errors
/// [`crate::Error::Invalid`] for contact that is clamped, repeated, on the axis or on a face, and for patches that
/// depend on each other; [`crate::Error::NotPositiveDefinite`] for unconnected parts; the errors of the eigenvalue
/// iteration and of the ROM validation.
pub fn reduce_cyclic(
    model: &FeModel,
    clamped: &[usize],
    contact: &[ContactPoint],
    boundary: &CyclicBoundary,
    options: &CyclicOptions,
    listener: Listener<'_>,
) -> Result<CyclicReduction> {
    // As in `reduce`: the bits must not depend on the number of threads.
    faer::set_global_parallelism(faer::Par::Seq);
    check_options(contact, options)?;
    boundary.validate(model.nodes.len())?;
    check_nodes(&model.nodes, clamped, contact, DisplacementFrame::Cylindrical)?;
    let sector = Sector::new(model, clamped, contact, boundary)?;
    let at_rest = Condensed::new(&sector, 0.0, listener)?;
    // As in `reduce`: a millionth of the order of the highest ω² lies among the lowest elastic ones.
    let shift = -1e-6 * sector.stiffness.trace() / sector.mass.trace();
    let shifted = if clamped.is_empty() { Some(Condensed::new(&sector, shift, listener)?) } else { None };
    let faces = [0, 1].map(|side| boundary.pairs.iter().map(|pair| pair[side]).collect());
    let surface = model.mesh.as_ref().map(|(mesh, _)| Surface::new(mesh, &faces));
    let diameters = boundary.largest_nodal_diameter() + 1;
    let found = parallel::for_each(diameters, 2, (ReductionStage::FixedInterfaceModes, listener), |number, step| {
        let sizes = (number, boundary.sectors, model.nodes.len());
        find((&at_rest, shifted.as_ref()), surface.as_ref(), sizes, options, step)
    })?;
    report(listener, ReductionStage::FullModes, 1, 1);
    report(listener, ReductionStage::Checks, 0, 1);
    let result = assembled((model, clamped.len(), contact, boundary), (&sector, surface), found, options)?;
    report(listener, ReductionStage::Checks, 1, 1);
    Ok(result)
}

fn check_options(contact: &[ContactPoint], options: &CyclicOptions) -> Result<()> {
    if contact.is_empty() {
        return Err(Error::invalid(
            "contact nodes",
            "none given",
            "Give at least one, for example at the tip of the blade",
        ));
    }
    match options.modes {
        ModeSelection::UpTo(limit) if !(limit.is_finite() && limit > 0.0) => {
            let problem = format!("the frequency limit of {limit} Hz is invalid");
            Err(Error::invalid("fixed-interface modes", problem, "Give a finite frequency above 0"))
        }
        _ => Ok(()),
    }
}

/// Computes everything about one nodal diameter that needs the full model.
fn find(
    (at_rest, shifted): (&Condensed<'_>, Option<&Condensed<'_>>),
    surface: Option<&Surface>,
    (number, sectors, nodes): (usize, usize, usize),
    options: &CyclicOptions,
    step: &dyn Fn(),
) -> Result<DiameterReduction> {
    let parts = at_rest.parts();
    let held = CyclicPencil::new(at_rest, number, sectors, shifted.is_some())?;
    let moving = shifted.map(|condensed| CyclicPencil::new(condensed, number, sectors, false)).transpose()?;
    let full = moving.as_ref().unwrap_or(&held);
    let checked = options.checked_modes.min(parts.order());
    let wanted = families::wanted(options.modes, parts.order() - parts.contact);
    // The first mode is always computed, since it distinguishes a mechanism from a structure.
    let mut modes = match (options.kind, wanted) {
        (ReductionKind::FixedInterface, _) => lanczos::lowest_modes(full, parts.order(), checked.max(1))?,
        (ReductionKind::FreeInterface, RequestedModes::Count(count)) => {
            lanczos::lowest_modes(full, parts.order(), count.max(checked).max(1))?
        }
        (ReductionKind::FreeInterface, RequestedModes::UpTo(_)) => component::modes(full, parts.order(), wanted)?,
    };
    step();
    let mut component = match (options.kind, wanted) {
        (ReductionKind::FixedInterface, _) => Component::fixed_interface(&held, full, wanted)?,
        (ReductionKind::FreeInterface, RequestedModes::Count(count)) => {
            Component::free_interface(&held, full, &modes.lowest(count))?
        }
        (ReductionKind::FreeInterface, RequestedModes::UpTo(_)) => Component::free_interface(&held, full, &modes)?,
    };
    modes = modes.lowest(checked);
    let shapes = node_shapes(full, modes.shapes.as_ref(), nodes);
    let transformation = core::mem::replace(&mut component.transformation, Mat::zeros(0, 0));
    let moved = surface.map(|surface| surface.moved(&node_shapes(full, transformation.as_ref(), nodes)));
    step();
    Ok(DiameterReduction { component, full_squares: modes.eigenvalues, shapes, moved })
}

/// Returns the displacements (x, y, z) of every node of the model; zero for clamped nodes.
fn node_shapes(operator: &CyclicPencil<'_>, shapes: MatRef<'_, c64>, nodes: usize) -> Vec<Vec<[Complex<f64>; 3]>> {
    let sector = operator.condensed.sector;
    let displacements = operator.expand(shapes);
    let width = shapes.ncols();
    let shape = |k: usize| {
        let mut shape = vec![[Complex::new(0.0, 0.0); 3]; nodes];
        for (place, (&node, directions)) in sector.nodes.iter().zip(&sector.directions).enumerate() {
            for i in 0..3 {
                for j in 0..3 {
                    let row = 3 * place + j;
                    let imaginary = if operator.real { 0.0 } else { displacements[(row, width + k)] };
                    shape[node][i] += Complex::new(displacements[(row, k)], imaginary) * directions[(i, j)];
                }
            }
        }
        if let Some(patches) = &sector.patches {
            let own = patches.displaced(Complex::new(0.0, 0.0), |dof| shape[dof / 3][dof % 3]);
            own.into_iter().for_each(|(dof, value)| shape[dof / 3][dof % 3] = value);
        }
        shape
    };
    (0..width).map(shape).collect()
}

fn assembled(
    (model, clamped, contact, boundary): (&FeModel, usize, &[ContactPoint], &CyclicBoundary),
    (sector, surface): (&Sector, Option<Surface>),
    found: Vec<DiameterReduction>,
    options: &CyclicOptions,
) -> Result<CyclicReduction> {
    let squares: Vec<&[f64]> = found.iter().map(|one| one.component.squares.as_slice()).collect();
    let choice = families::choose(options.modes, &squares);
    let full: Vec<&[f64]> = found.iter().map(|one| one.full_squares.as_slice()).collect();
    let components: Vec<&Component> = found.iter().map(|one| &one.component).collect();
    let convergence = quality::convergence(&components, &full, boundary.sectors)?;
    let mut harmonics = Vec::with_capacity(found.len());
    let mut nodal_diameters = Vec::with_capacity(found.len());
    let mut moved = Vec::with_capacity(found.len());
    let mut largest = 0.0_f64;
    for (number, (one, &count)) in found.iter().zip(&choice.counts).enumerate() {
        let order = one.component.contact + count;
        let quality = one.component.quality(count, order)?;
        largest = quality.squares.iter().copied().fold(largest, f64::max);
        let kept = one.component.kept(count)?;
        nodal_diameters.push(nodal_diameter(number, one, &kept, &quality));
        harmonics.push(harmonic(&one.component, &kept));
        moved.extend(one.moved.as_ref().map(|own| {
            let own = own.get(.., ..order);
            let own = kept.turn.as_ref().map_or_else(|| own.to_owned(), |turn| own * turn);
            DiameterShapes::new(&own, one.component.real)
        }));
    }
    for (diameter, one) in nodal_diameters.iter_mut().zip(found) {
        diameter.shapes = one.shapes;
    }
    let kept = basis_text(options.kind, &choice.counts, contact);
    let origin = format!(
        "{}; one of {} sectors: {} nodes, {clamped} clamped, {} on each face; {kept} per nodal diameter",
        model.origin,
        boundary.sectors,
        model.nodes.len(),
        boundary.pairs.len(),
    );
    let checks = quality::merged(&nodal_diameters);
    let mut rest = harmonics.into_iter();
    let first = rest.next().expect("nodal diameter 0 is always there");
    let rom = Rom {
        name: options.name.clone(),
        origin,
        sectors: boundary.sectors,
        frame: DisplacementFrame::Cylindrical,
        mass: first.mass.map(|value| value.re),
        stiffness: first.stiffness.map(|value| value.re),
        damping_ratio: options.damping_ratio,
        contact_map: first.contact_map.map(|value| value.re),
        contact_nodes: contact.iter().map(|point| contact_node(model, point)).collect(),
        checks,
        extras: RomExtras {
            harmonics: rest.collect(),
            basis: options.kind.basis(),
            rows: ContactPoint::rows(contact),
            ..RomExtras::default()
        },
    };
    rom.validate()?;
    Ok(CyclicReduction {
        shapes: surface.map(|surface| surface.with(moved)),
        rom,
        nodal_diameters,
        convergence,
        free_dofs: sector.parts.order(),
        largest_angular_frequency: largest.max(0.0).sqrt(),
        notes: choice.note.into_iter().collect(),
    })
}

/// Describes the basis in words.
fn basis_text(kind: ReductionKind, counts: &[usize], contact: &[ContactPoint]) -> String {
    let counts = match (counts.iter().min(), counts.iter().max()) {
        (Some(least), Some(most)) if least < most => format!("{least} to {most}"),
        (Some(least), _) => least.to_string(),
        _ => "no".to_owned(),
    };
    match kind {
        ReductionKind::FixedInterface => {
            format!("cyclic Craig-Bampton with {} and {counts} fixed-interface modes", interface(contact))
        }
        ReductionKind::FreeInterface => format!("{} and {counts} free-interface modes", responses(contact)),
    }
}

fn contact_node(model: &FeModel, point: &ContactPoint) -> ContactNode {
    let ContactPoint { meridional_slope, area, length, .. } = *point;
    let position = point.cylindrical(&model.nodes);
    ContactNode { name: point.name.clone(), position, meridional_slope, area, length }
}

fn harmonic(component: &Component, kept: &ComponentModes) -> Harmonic {
    let order = kept.mass.nrows();
    // The imaginary parts of a real nodal diameter are zeros of either sign.
    let entry = |value: c64| Complex::new(value.re, if component.real { 0.0 } else { value.im });
    let copied = |matrix: &Mat<c64>| DMatrix::from_fn(order, order, |i, j| entry(matrix[(i, j)]));
    Harmonic {
        mass: copied(&kept.mass),
        stiffness: copied(&kept.stiffness),
        contact_map: DMatrix::identity(component.contact, order),
    }
}

fn hertz(square: f64) -> f64 {
    square.max(0.0).sqrt() / core::f64::consts::TAU
}

fn nodal_diameter(
    number: usize,
    found: &DiameterReduction,
    kept: &ComponentModes,
    quality: &super::component::ModeQuality,
) -> NodalDiameter {
    let count = found.full_squares.len().min(quality.squares.len());
    let full_frequencies: Vec<f64> = found.full_squares[..count].iter().map(|&square| hertz(square)).collect();
    let reduced_frequencies: Vec<f64> = quality.squares[..count].iter().map(|&square| hertz(square)).collect();
    let frequency_deviation =
        full_frequencies.iter().zip(&reduced_frequencies).map(|(&full, &reduced)| quality::deviation(full, reduced));
    NodalDiameter {
        number,
        frequency_deviation: frequency_deviation.collect(),
        full_frequencies,
        reduced_frequencies,
        residual_criterion: quality.residual_criterion[..count].to_vec(),
        fixed_interface_frequencies: kept.squares.iter().map(|&square| hertz(square)).collect(),
        shapes: Vec::new(),
    }
}
