//! Coupling of the sectors of a disk: modes of nodal diameters, and the effects of contact forces on all sectors.
//!
//! The transforms of `fourier` convert contact displacements to sectors and forces on sectors to nodal diameters. The effect of a
//! force on any sector within a step is the block-circulant flexibility G(s − s') = Σ_n Re(Ĝ_n e^(2πin(s − s')/N)), Ĝ_n = Ψ_n diag(c)
//! Ψ_nᴴ. Nodal diameters are lanes of blocks, complex amplitudes pairs of real and imaginary parts.

mod coordinates;
mod fourier;
mod pass;

use tiprub_cosim::persist_fields;

use super::{LANES, ModalBank};
use crate::math::simd::InstructionSet;
use crate::math::vector::{Vector3, strided_vector3};
use crate::modes::cyclic::CyclicModel;
use crate::modes::schemes::ModeCoefficients;
use crate::scene::method::Scheme;
use fourier::{Fourier, Synthesis};
use pass::{Combination, Complexes, Gather, LaneCoefficients, ModalForces, Pass, find_modal_force};

const NOTHING: Complexes = [[0.0; LANES]; 2];

/// State of a disk in addition to that of its modes.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct DiskState {
    /// Spectrum of the contact forces of the last step (N).
    pub force: Vec<Complexes>,
    /// True for contact nodes with a force on any sector.
    pub touched: Vec<bool>,
    /// True if the contact forces have not been applied to the modes of their step.
    pub unapplied: bool,
    /// True if there are such forces.
    pub acting: bool,
    /// True if the damping loss of the last step has not been added.
    pub loss_due: bool,
}

persist_fields!(DiskState { force, touched, unapplied, acting, loss_due });

impl DiskState {
    pub(super) fn rest(&mut self) {
        self.force.fill(NOTHING);
        self.touched.fill(false);
        (self.unapplied, self.acting, self.loss_due) = (false, false, false);
    }

    pub(super) fn is_finite(&self) -> bool {
        self.force.as_flattened().as_flattened().iter().all(|value| value.is_finite())
    }
}

/// Coupling of the sectors of a disk.
#[derive(Debug, Clone)]
pub struct Disk {
    instruction_set: InstructionSet,
    pub(super) model: CyclicModel,
    fourier: Fourier,
    rows: usize,
    /// Largest number of modes of a nodal diameter.
    modes: usize,
    /// Number of modes of each block of nodal diameters that have inertia, and thus can differ from 0 after the prediction.
    moving: Vec<usize>,
    /// Ψ, `[block][mode][row]`.
    shapes: Vec<Complexes>,
    /// `[block][mode]`.
    coefficients: Vec<LaneCoefficients>,
    /// Ĝ, `[block][column][row]`.
    spectral_flexibility: Vec<Complexes>,
    /// G(s − s'), `[difference][column node][row node][component of the force][component of the displacement]`, the last
    /// padded to four.
    flexibility: Vec<[[f64; 4]; 3]>,
    pub(super) state: DiskState,
    /// Displacements caused by the modal loads, per mode of nodal diameter 0.
    load_response: Vec<f64>,
    /// Scratch: spectra of displacements at one point and at another point of a step.
    spectrum: Vec<Complexes>,
    other_spectrum: Vec<Complexes>,
    /// Scratch: spectrum and contact nodes of the forces at another point of a step.
    other_force: Vec<Complexes>,
    other_nodes: Vec<bool>,
    /// Requested forces: (sector, node, force).
    asked: Vec<(usize, usize, Vector3)>,
    /// Spectrum and contact nodes of the requested forces.
    pub(super) asked_force: Vec<Complexes>,
    pub(super) asked_nodes: Vec<bool>,
    /// Modal forces of the forces on all rows, `[block][mode]`.
    asked_modal: Vec<Complexes>,
    /// Displacements caused by the requested forces (m), `[row][lane of sector]`.
    pub(crate) moved: Vec<f64>,
}

impl Disk {
    pub(super) fn new(model: &CyclicModel) -> Self {
        let (sectors, rows, modes) = (model.sectors, model.rows(), model.most_modes());
        let fourier = Fourier::new(sectors);
        let blocks = fourier.blocks();
        let mut shapes = vec![NOTHING; blocks * modes * rows];
        for (n, diameter) in model.diameters.iter().enumerate() {
            for mode in 0..diameter.len() {
                for row in 0..rows {
                    let value = diameter.contact_modes[(row, mode)];
                    let entry = &mut shapes[(n / LANES * modes + mode) * rows + row];
                    (entry[0][n % LANES], entry[1][n % LANES]) = (value.re, value.im);
                }
            }
        }
        Self {
            instruction_set: InstructionSet::detect(),
            coefficients: vec![LaneCoefficients::default(); blocks * modes],
            spectral_flexibility: vec![NOTHING; blocks * rows * rows],
            flexibility: vec![[[0.0; 4]; 3]; sectors * rows / 3 * rows / 3],
            state: DiskState {
                force: vec![NOTHING; blocks * rows],
                touched: vec![false; rows / 3],
                unapplied: false,
                acting: false,
                loss_due: false,
            },
            load_response: vec![0.0; model.diameters[0].len()],
            spectrum: vec![NOTHING; blocks * rows],
            other_spectrum: vec![NOTHING; blocks * rows],
            other_force: vec![NOTHING; blocks * rows],
            other_nodes: vec![false; rows / 3],
            asked: Vec::with_capacity(sectors * rows / 3),
            asked_force: vec![NOTHING; blocks * rows],
            asked_nodes: vec![false; rows / 3],
            asked_modal: vec![NOTHING; blocks * modes],
            moved: vec![0.0; rows * super::lanes(sectors)],
            model: model.clone(),
            fourier,
            rows,
            modes,
            moving: vec![modes; blocks],
            shapes,
        }
    }

    /// Returns the modes of the disk.
    pub fn model(&self) -> &CyclicModel {
        &self.model
    }

    /// Computes the flexibility from the coefficients of all modes under a scheme, `[n][mode]`.
    pub(super) fn fill(&mut self, coefficients: &[ModeCoefficients], scheme: Scheme) {
        let (modes, rows) = (self.modes, self.rows);
        for (moving, diameters) in self.moving.iter_mut().zip(self.model.diameters.chunks(LANES)) {
            *moving = diameters.iter().map(|diameter| diameter.dynamic_modes(scheme)).max().unwrap_or(0);
        }
        for (n, coefficients) in coefficients.chunks_exact(modes).enumerate() {
            for (lanes, k) in self.coefficients[n / LANES * modes..].iter_mut().zip(coefficients) {
                lanes.set(n % LANES, k);
            }
        }
        // Ĝ_n = Ψ_n diag(c) Ψ_nᴴ.
        self.spectral_flexibility.fill(NOTHING);
        for (block, target) in self.spectral_flexibility.chunks_exact_mut(rows * rows).enumerate() {
            for mode in block * modes..(block + 1) * modes {
                let shapes = &self.shapes[mode * rows..][..rows];
                for (column, entries) in shapes.iter().zip(target.chunks_exact_mut(rows)) {
                    add_outer(entries, shapes, column, &self.coefficients[mode].compliance);
                }
            }
        }
        self.fill_flexibility();
    }

    /// Computes G of every difference of sectors: the columns of Ĝ are spectra.
    fn fill_flexibility(&mut self) {
        let rows = self.rows;
        let (nodes, lanes) = (rows / 3, self.moved.len() / rows);
        for column in 0..rows {
            for (block, spectrum) in self.spectrum.chunks_exact_mut(rows).enumerate() {
                spectrum.copy_from_slice(&self.spectral_flexibility[(block * rows + column) * rows..][..rows]);
            }
            let mut moved = std::mem::take(&mut self.moved);
            self.synthesise(&mut moved);
            for difference in 0..self.model.sectors {
                for row in 0..rows {
                    let pair = (difference * nodes + column / 3) * nodes + row / 3;
                    self.flexibility[pair][column % 3][row % 3] = moved[row * lanes + difference];
                }
            }
            self.moved = moved;
        }
    }

    /// Displacement at the contact node `row` of a sector per unit force at the contact node `column` of the sector that lies
    /// `difference` sectors before it (m/N): force components by displacement components.
    #[inline(always)]
    pub fn flexibility(&self, difference: usize, column: usize, row: usize) -> &[[f64; 4]; 3] {
        let nodes = self.rows / 3;
        &self.flexibility[(difference * nodes + column) * nodes + row]
    }

    /// Computes the effect of contact forces (sector, node, force in N) on the predicted step; [`Disk::moved`] returns the result.
    pub(crate) fn ask(&mut self, forces: impl Iterator<Item = (usize, usize, Vector3)>) {
        self.gather(forces.filter(|(.., force)| *force != Vector3::zeros()));
        self.instruction_set.run_octets(Combination {
            columns: self.rows,
            rows: self.rows,
            matrix: &self.spectral_flexibility,
            values: &self.asked_force,
            touched: Some(&self.asked_nodes),
            spectrum: &mut self.spectrum,
        });
        let mut moved = std::mem::take(&mut self.moved);
        self.synthesise(&mut moved);
        self.moved = moved;
    }

    /// Computes the spectrum of contact forces (sector, node, N).
    fn gather(&mut self, forces: impl Iterator<Item = (usize, usize, Vector3)>) {
        self.asked.clear();
        self.asked.extend(forces);
        self.asked_nodes.fill(false);
        for (_, node, _) in &self.asked {
            self.asked_nodes[*node] = true;
        }
        let (fourier, rows, forces) = (&self.fourier, self.rows, &self.asked[..]);
        self.instruction_set.run(Gather { fourier, rows, forces, spectrum: &mut self.asked_force });
    }

    /// Computes the spectrum and the modal forces of the forces on all contact nodes (`forces[row · lanes + sector]`, N).
    pub(super) fn gather_rows(&mut self, forces: &[f64], lanes: usize) {
        let (sectors, nodes) = (self.model.sectors, self.rows / 3);
        let all = (0..sectors).flat_map(|sector| (0..nodes).map(move |node| (sector, node)));
        self.gather(
            all.map(|(sector, node)| (sector, node, strided_vector3(forces, 3 * node * lanes + sector, lanes)))
                .filter(|(.., force)| *force != Vector3::zeros()),
        );
        let mut to = std::mem::take(&mut self.asked_modal);
        self.find_modal_forces(to.as_flattened_mut().as_flattened_mut());
        self.asked_modal = to;
    }

    /// Computes the modal forces of the gathered forces, `[block][mode][part][lane]`.
    fn find_modal_forces(&self, to: &mut [f64]) {
        let Self { modes, rows, shapes, asked_force: force, asked_nodes: touched, .. } = self;
        self.instruction_set.run_octets(ModalForces { modes: *modes, rows: *rows, shapes, force, touched, to });
    }

    /// Modal force (re, im) on one mode by the forces of [`Disk::gather_rows`].
    pub(super) fn asked_modal_force(&self, mode: usize, n: usize) -> [f64; 2] {
        self.asked_modal[n / LANES * self.modes + mode].map(|part| part[n % LANES])
    }

    /// Modal force (re, im) of a spectrum of contact forces on one mode.
    pub(super) fn modal_force(&self, mode: usize, n: usize, touched: &[bool], force: &[Complexes]) -> [f64; 2] {
        let shapes = &self.shapes[(n / LANES * self.modes + mode) * self.rows..][..self.rows];
        find_modal_force(touched, shapes, &force[n / LANES * self.rows..][..self.rows]).map(|part| part[n % LANES])
    }

    /// Adds the displacements caused by the amplitude (re, im) of one mode to the spectrum.
    pub(super) fn add_to_spectrum(&mut self, mode: usize, n: usize, moved: [f64; 2]) {
        let (block, lane) = (n / LANES, n % LANES);
        let shapes = &self.shapes[(block * self.modes + mode) * self.rows..][..self.rows];
        for (sum, shape) in self.spectrum[block * self.rows..][..self.rows].iter_mut().zip(shapes) {
            let shape = shape.map(|part| part[lane]);
            sum[0][lane] += shape[0] * moved[0] - shape[1] * moved[1];
            sum[1][lane] += shape[0] * moved[1] + shape[1] * moved[0];
        }
    }

    /// Computes the values of all sectors from the spectrum, `[row][lane of sector]`.
    fn synthesise(&self, values: &mut [f64]) {
        let (fourier, spectrum, rows) = (&self.fourier, &self.spectrum[..], self.rows);
        let lanes = values.len() / rows;
        self.instruction_set.run(Synthesis { fourier, spectrum, rows, lanes, values });
    }
}

/// Converts a flat array to complex lanes.
fn complexes(values: &[f64]) -> &[Complexes] {
    values.as_chunks::<LANES>().0.as_chunks::<2>().0
}

/// Converts a flat array to complex lanes.
fn complexes_mut(values: &mut [f64]) -> &mut [Complexes] {
    values.as_chunks_mut::<LANES>().0.as_chunks_mut::<2>().0
}

/// entries += c · shapes · conj(column), lane by lane.
fn add_outer(entries: &mut [Complexes], shapes: &[Complexes], column: &Complexes, compliance: &[f64; LANES]) {
    let mut scaled = *column;
    for part in &mut scaled {
        part.iter_mut().zip(compliance).for_each(|(value, compliance)| *value *= compliance);
    }
    let [real, imaginary] = &scaled;
    for (entry, shape) in entries.iter_mut().zip(shapes) {
        for lane in 0..LANES {
            entry[0][lane] += shape[0][lane] * real[lane] + shape[1][lane] * imaginary[lane];
            entry[1][lane] += shape[1][lane] * real[lane] - shape[0][lane] * imaginary[lane];
        }
    }
}

impl ModalBank {
    /// Predicts one step of a disk. Contact forces of the previous step that have not been applied yet are applied first.
    pub(super) fn predict_disk(&mut self) {
        let Some(disk) = &mut self.disk else { return };
        for ((response, load), k) in disk.load_response.iter_mut().zip(&self.modal_load).zip(&self.coefficients) {
            *response = k.load_compliance() * load;
        }
        let delayed = disk.state.acting && self.scheme.properties().delays_contact;
        match (disk.state.unapplied, delayed, disk.state.loss_due) {
            (false, false, false) => self.pass::<false, false, false, true>(),
            (false, false, true) => self.pass::<false, false, true, true>(),
            (true, false, false) => self.pass::<true, false, false, true>(),
            (true, false, true) => self.pass::<true, false, true, true>(),
            (false, true, false) => self.pass::<false, true, false, true>(),
            (false, true, true) => self.pass::<false, true, true, true>(),
            (true, true, false) => self.pass::<true, true, false, true>(),
            (true, true, true) => self.pass::<true, true, true, true>(),
        }
        self.act_excited_disk();
        if let Some(disk) = &mut self.disk {
            (disk.state.unapplied, disk.state.acting, disk.state.loss_due) = (false, false, self.with_loss);
            disk.synthesise(&mut self.state.displacement);
        }
    }

    /// Applies the contact forces of the last step to the modes of a disk and adds its damping loss. The result is the same as that
    /// of the next [`ModalBank::predict`].
    pub(super) fn finish(&mut self) {
        let Some(disk) = &mut self.disk else { return };
        let due = (disk.state.unapplied, disk.state.loss_due);
        (disk.state.unapplied, disk.state.loss_due) = (false, false);
        match due {
            (false, false) => {}
            (false, true) => self.pass::<false, false, true, false>(),
            (true, false) => self.pass::<true, false, false, false>(),
            (true, true) => self.pass::<true, false, true, false>(),
        }
    }

    fn pass<const APPLY: bool, const DELAYED: bool, const LOSS: bool, const ADVANCE: bool>(&mut self) {
        let Some(disk) = &mut self.disk else { return };
        let mut increments = [&mut self.state.increment, &mut self.increment_before];
        if ADVANCE {
            // Already exchanged, for the new increments.
            increments.reverse();
        }
        let [increment, older] = increments.map(|values| complexes_mut(values));
        disk.instruction_set.run_octets(Pass::<APPLY, DELAYED, LOSS, ADVANCE> {
            modes: disk.modes,
            moving: &disk.moving,
            rows: disk.rows,
            touched: &disk.state.touched,
            coefficients: &disk.coefficients,
            shapes: &disk.shapes,
            force: &disk.state.force,
            modal_load: if self.modal_load.is_empty() { &[] } else { &disk.load_response },
            position: complexes_mut(&mut self.state.position),
            increment,
            older,
            loss: &mut self.state.loss,
            spectrum: &mut disk.spectrum,
        });
    }

    /// Recomputes the contact displacements of a disk from its modal state.
    pub(super) fn recover_disk(&mut self) {
        self.finish();
        let Self { state, increment_before: before, .. } = self;
        for ((before, position), increment) in before.iter_mut().zip(&state.position).zip(&state.increment) {
            *before = position - increment;
        }
        if let Some(disk) = &mut self.disk {
            disk.rows_of(&state.position, &mut state.displacement);
            disk.rows_of(before, &mut state.displacement_before);
        }
    }

    /// Applies the requested forces to the predicted step of a disk, eq. 11 of the paper: to contact displacements immediately, to the
    /// modes in the next pass over them.
    pub(crate) fn act(&mut self) {
        let Some(disk) = &mut self.disk else { return };
        for (displacement, moved) in self.state.displacement.iter_mut().zip(&disk.moved) {
            *displacement += moved;
        }
        disk.state.force.copy_from_slice(&disk.asked_force);
        disk.state.touched.copy_from_slice(&disk.asked_nodes);
        (disk.state.unapplied, disk.state.acting) = (true, true);
    }
}

#[cfg(test)]
mod tests;
