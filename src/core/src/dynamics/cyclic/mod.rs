//! A disk of coupled sectors in modal coordinates, stepped together.
//!
//! Nodal diameters are SIMD lanes in blocks of [`LANES`], complex amplitudes are pairs of real and imaginary parts:
//! `state[block · modes + mode][re, im][lane]`. A nodal diameter with fewer modes than others, and the padding of the last
//! block, has modes of coefficients 0. Contact displacements go to the sectors, and forces on sectors to the nodal
//! diameters, by the transforms of `fourier`; what a force does to any sector within a step is the block-circulant
//! flexibility G(s − s') = Σ_n Re(Ĝ_n e^(2πin(s − s')/N)), Ĝ_n = Ψ_n diag(c) Ψ_nᴴ.

mod coefficients;
mod contact;
mod fourier;
mod model;
mod pass;

use super::bank::{FLUSH_BELOW, LANES, lanes};
use super::dispatch::InstructionSet;
use crate::persist::{Persist, Reader, Writer, persist_fields};
use crate::schemes::{ModeCoefficients, Velocity, free_increment};
use crate::settings::Scheme;
use fourier::{Fourier, Synthesis};
pub use model::{CyclicModel, DiameterModes};
use pass::{Complexes, LaneCoefficients, Pass, Recover};

const NOTHING: Complexes = [[0.0; LANES]; 2];

/// Everything that moves.
#[derive(Debug, Clone, PartialEq)]
struct CyclicState {
    /// q at the current step, without the contact forces that have not been applied yet.
    position: Vec<Complexes>,
    /// d = q − q⁻, likewise.
    increment: Vec<Complexes>,
    /// d of the step before, for the damping loss.
    older: Vec<Complexes>,
    /// Displacements of the contact rows at the current step, `[row][lane of sector]`, contact included.
    displacement: Vec<f64>,
    /// The same one step earlier.
    displacement_before: Vec<f64>,
    /// Damping loss per nodal diameter since the last collection (J).
    loss: Vec<f64>,
    /// Modal loads of the step before; empty without loads.
    modal_load_before: Vec<f64>,
    /// Spectrum of the contact forces of the last step (N).
    force: Vec<Complexes>,
    /// Contact nodes, of any sector, that carry one.
    touched: Vec<bool>,
    /// They have not acted on the modes of their own step.
    unapplied: bool,
    /// There are such forces.
    acting: bool,
    /// The damping loss of the last step has not been added.
    loss_due: bool,
}

persist_fields!(CyclicState {
    position,
    increment,
    older,
    displacement,
    displacement_before,
    loss,
    modal_load_before,
    force,
    touched,
    unapplied,
    acting,
    loss_due
});

/// Coupled sectors, stepped together.
#[derive(Debug, Clone)]
pub struct CyclicBank {
    instruction_set: InstructionSet,
    model: CyclicModel,
    fourier: Fourier,
    lanes: usize,
    rows: usize,
    /// Largest number of modes of a nodal diameter.
    modes: usize,
    /// Ψ, `[block][mode][row]`.
    shapes: Vec<Complexes>,
    /// `[block][mode]`.
    lane_coefficients: Vec<LaneCoefficients>,
    /// `[n · modes + mode]`; the default where there is no such mode.
    coefficients: Vec<ModeCoefficients>,
    /// Velocities, the same; quasi-static modes have none.
    velocities: Vec<Velocity>,
    /// Ĝ, `[block][column][row]`.
    spectral_flexibility: Vec<Complexes>,
    /// G(s − s'), `[difference][column node][row node][component of the force][component of the displacement]`, the last
    /// padded to four.
    flexibility: Vec<[[f64; 4]; 3]>,
    scheme: Scheme,
    step: f64,
    loads: bool,
    state: CyclicState,
    /// Modal loads of nodal diameter 0 for the step under way.
    modal_load: Vec<f64>,
    /// Displacements caused by `modal_load`, per mode.
    load_response: Vec<f64>,
    /// Scratch: spectrum of displacements.
    spectrum: Vec<Complexes>,
    /// Forces that an answer was asked for: (sector, node, force).
    asked: Vec<(usize, usize, [f64; 3])>,
    /// Their spectrum and contact nodes.
    asked_force: Vec<Complexes>,
    asked_nodes: Vec<bool>,
    /// Displacements that they cause (m), `[row][lane of sector]`.
    moved: Vec<f64>,
}

impl CyclicBank {
    /// All sectors at rest; [`CyclicBank::set_step`] must be called before stepping. With `loads` there are modal loads of
    /// nodal diameter 0 beside contact.
    pub fn new(model: &CyclicModel, loads: bool) -> Self {
        let (sectors, rows, modes) = (model.sectors, model.rows(), model.most_modes());
        let (fourier, lanes) = (Fourier::new(sectors), lanes(sectors));
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
        let load_count = if loads { model.diameters[0].len() } else { 0 };
        Self {
            instruction_set: InstructionSet::detect(),
            lane_coefficients: vec![LaneCoefficients::NONE; blocks * modes],
            coefficients: vec![ModeCoefficients::default(); model.diameters.len() * modes],
            velocities: vec![Velocity::default(); model.diameters.len() * modes],
            spectral_flexibility: vec![NOTHING; blocks * rows * rows],
            flexibility: vec![[[0.0; 4]; 3]; sectors * rows / 3 * rows / 3],
            scheme: Scheme::default(),
            step: 0.0,
            state: CyclicState {
                position: vec![NOTHING; blocks * modes],
                increment: vec![NOTHING; blocks * modes],
                older: vec![NOTHING; blocks * modes],
                displacement: vec![0.0; rows * lanes],
                displacement_before: vec![0.0; rows * lanes],
                loss: vec![0.0; blocks * LANES],
                modal_load_before: vec![0.0; load_count],
                force: vec![NOTHING; blocks * rows],
                touched: vec![false; rows / 3],
                unapplied: false,
                acting: false,
                loss_due: false,
            },
            modal_load: vec![0.0; load_count],
            load_response: vec![0.0; load_count],
            spectrum: vec![NOTHING; blocks * rows],
            asked: Vec::with_capacity(sectors * rows / 3),
            asked_force: vec![NOTHING; blocks * rows],
            asked_nodes: vec![false; rows / 3],
            moved: vec![0.0; rows * lanes],
            model: model.clone(),
            fourier,
            lanes,
            rows,
            modes,
            shapes,
            loads,
        }
    }

    /// Number of sectors.
    pub fn sectors(&self) -> usize {
        self.model.sectors
    }

    /// Lanes of a displacement row: sectors rounded up to whole registers.
    pub fn lanes(&self) -> usize {
        self.lanes
    }

    /// Number of contact rows of a sector (3 per contact node).
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Instruction set of the hot loops.
    pub fn instruction_set(&self) -> InstructionSet {
        self.instruction_set
    }

    /// The modes.
    pub fn model(&self) -> &CyclicModel {
        &self.model
    }

    /// Step size of the coefficients in use (s).
    pub fn step(&self) -> f64 {
        self.step
    }

    /// Displacements of the contact rows at the current step (m), `[row][lane of sector]`.
    pub fn displacement(&self) -> &[f64] {
        &self.state.displacement
    }

    /// Displacements of the contact rows one step earlier (m), `[row][lane of sector]`.
    pub fn displacement_before(&self) -> &[f64] {
        &self.state.displacement_before
    }

    fn index(&self, nodal_diameter: usize, mode: usize) -> (usize, usize) {
        (nodal_diameter / LANES * self.modes + mode, nodal_diameter % LANES)
    }

    /// Modal amplitude q (re, im) and increment d (re, im) of a mode of a nodal diameter.
    pub fn modal_state(&self, nodal_diameter: usize, mode: usize) -> ([f64; 2], [f64; 2]) {
        let (index, lane) = self.index(nodal_diameter, mode);
        let part = |values: &Complexes| values.map(|part| part[lane]);
        let (mut position, mut increment) = (part(&self.state.position[index]), part(&self.state.increment[index]));
        if self.state.unapplied {
            let compliance = self.lane_coefficients[index].compliance[lane];
            for (part, force) in self.modal_force(nodal_diameter, mode).into_iter().enumerate() {
                position[part] += compliance * force;
                increment[part] += compliance * force;
            }
        }
        (position, increment)
    }

    /// Set amplitude and velocity (re, im) of a mode of a nodal diameter; the increment is that of free motion under no
    /// force. A quasi-static mode carries neither and stays 0, and so does the imaginary part of a real mode.
    pub fn set_modal_state(&mut self, nodal_diameter: usize, mode: usize, position: [f64; 2], velocity: [f64; 2]) {
        let diameter = &self.model.diameters[nodal_diameter];
        if mode >= diameter.dynamic_modes(self.scheme) {
            return;
        }
        let (frequency, ratio) = (diameter.frequencies[mode], diameter.damping_ratios[mode]);
        let (index, lane) = self.index(nodal_diameter, mode);
        self.state.unapplied = false;
        for part in 0..if self.model.is_real(nodal_diameter) { 1 } else { 2 } {
            let increment = free_increment(frequency, ratio, position[part], velocity[part], self.step);
            self.state.position[index][part][lane] = position[part];
            self.state.increment[index][part][lane] = increment;
        }
    }

    /// Static equilibrium under the modal loads `modal_load` of nodal diameter 0: q = L/ω², rigid modes at 0.
    pub fn settle(&mut self, modal_load: &[f64]) {
        self.rest();
        self.state.modal_load_before.copy_from_slice(modal_load);
        for (mode, load) in modal_load.iter().enumerate() {
            let frequency = self.model.diameters[0].frequencies[mode];
            let rest = if frequency > 0.0 { load / (frequency * frequency) } else { 0.0 };
            self.state.position[mode][0][0] = rest;
        }
        self.recover();
    }

    /// Everything at rest and undeformed.
    pub fn rest(&mut self) {
        let state = &mut self.state;
        for values in [&mut state.position, &mut state.increment, &mut state.older, &mut state.force] {
            values.fill(NOTHING);
        }
        for values in [
            &mut state.displacement,
            &mut state.displacement_before,
            &mut state.loss,
            &mut state.modal_load_before,
            &mut self.modal_load,
        ] {
            values.fill(0.0);
        }
        state.touched.fill(false);
        (state.unapplied, state.acting, state.loss_due) = (false, false, false);
    }

    /// Modal loads of nodal diameter 0 for the next step, to be set before [`CyclicBank::predict`].
    pub fn loads_mut(&mut self) -> &mut [f64] {
        &mut self.modal_load
    }

    /// Predict one step without contact (eq. 9 of the paper) and recover the contact displacements of all sectors. Contact
    /// forces of the step before act first where they have not yet.
    pub fn predict(&mut self, with_loss: bool) {
        for (mode, (load_response, modal_load)) in self.load_response.iter_mut().zip(&self.modal_load).enumerate() {
            *load_response = self.coefficients[mode].load_compliance() * modal_load;
        }
        let delayed = self.state.acting && self.scheme == Scheme::MasslessBoundary;
        match (self.state.unapplied, delayed, self.state.loss_due) {
            (false, false, false) => self.pass::<false, false, false, true>(),
            (false, false, true) => self.pass::<false, false, true, true>(),
            (true, false, false) => self.pass::<true, false, false, true>(),
            (true, false, true) => self.pass::<true, false, true, true>(),
            (false, true, false) => self.pass::<false, true, false, true>(),
            (false, true, true) => self.pass::<false, true, true, true>(),
            (true, true, false) => self.pass::<true, true, false, true>(),
            (true, true, true) => self.pass::<true, true, true, true>(),
        }
        std::mem::swap(&mut self.state.increment, &mut self.state.older);
        std::mem::swap(&mut self.state.displacement, &mut self.state.displacement_before);
        (self.state.unapplied, self.state.acting, self.state.loss_due) = (false, false, with_loss);
        let values = &mut self.state.displacement;
        let (fourier, spectrum, rows, lanes) = (&self.fourier, &self.spectrum, self.rows, self.lanes);
        self.instruction_set.run(Synthesis { fourier, spectrum, rows, lanes, values });
    }

    /// Let the contact forces of the last step act on its modes, and add its damping loss. The numbers are those that the
    /// next [`CyclicBank::predict`] would make.
    pub fn finish(&mut self) {
        match (self.state.unapplied, self.state.loss_due) {
            (false, false) => {}
            (false, true) => self.pass::<false, false, true, false>(),
            (true, false) => self.pass::<true, false, false, false>(),
            (true, true) => self.pass::<true, false, true, false>(),
        }
        (self.state.unapplied, self.state.loss_due) = (false, false);
    }

    fn pass<const APPLY: bool, const DELAYED: bool, const LOSS: bool, const ADVANCE: bool>(&mut self) {
        let state = &mut self.state;
        self.instruction_set.run(Pass::<APPLY, DELAYED, LOSS, ADVANCE> {
            modes: self.modes,
            rows: self.rows,
            touched: &state.touched,
            coefficients: &self.lane_coefficients,
            shapes: &self.shapes,
            force: &state.force,
            modal_load: &self.load_response,
            position: &mut state.position,
            increment: &mut state.increment,
            older: &mut state.older,
            loss: &mut state.loss,
            spectrum: &mut self.spectrum,
        });
    }

    /// Recompute the contact displacements from the modal state (after setting it). Losses not added yet are dropped.
    pub fn recover(&mut self) {
        self.finish();
        let state = &mut self.state;
        for ((before, position), increment) in state.older.iter_mut().zip(&state.position).zip(&state.increment) {
            for part in 0..2 {
                for lane in 0..LANES {
                    before[part][lane] = position[part][lane] - increment[part][lane];
                }
            }
        }
        for (position, displacement) in
            [(&state.position, &mut state.displacement), (&state.older, &mut state.displacement_before)]
        {
            let (modes, rows, shapes) = (self.modes, self.rows, &self.shapes[..]);
            self.instruction_set.run(Recover { modes, rows, shapes, position, spectrum: &mut self.spectrum });
            let (fourier, spectrum, lanes) = (&self.fourier, &self.spectrum, self.lanes);
            self.instruction_set.run(Synthesis { fourier, spectrum, rows, lanes, values: displacement });
        }
    }

    /// Kinetic and strain energy of the disk (J), in the quantity the scheme conserves (see [`crate::schemes`]).
    pub fn energies(&self) -> (f64, f64) {
        let (mut kinetic, mut strain) = (0.0, 0.0);
        for nodal_diameter in 0..self.model.diameters.len() {
            let (own, stored) = self.diameter_energies(nodal_diameter);
            kinetic += own;
            strain += stored;
        }
        (kinetic, strain)
    }

    /// Kinetic and strain energy of the disk at this instant (J), ½q̇² and ½ω²q² of every mode, under the contact forces
    /// that last (`forces[row · lanes + sector]`, N) and the modal loads.
    pub fn energies_now(&mut self, forces: &[f64]) -> (f64, f64) {
        self.gather_forces(forces);
        let (mut kinetic, mut strain) = (0.0, 0.0);
        for nodal_diameter in 0..self.model.diameters.len() {
            for mode in 0..self.model.diameters[nodal_diameter].len() {
                let force = self.gathered_force(nodal_diameter, mode);
                let (position, increment) = self.modal_state(nodal_diameter, mode);
                let index = nodal_diameter * self.modes + mode;
                for part in 0..2 {
                    let velocity = self.velocities[index].of(position[part], increment[part], force[part]);
                    kinetic += 0.5 * velocity * velocity;
                    strain += self.coefficients[index].spring * (position[part] * position[part]);
                }
            }
        }
        (kinetic, strain)
    }

    /// Kinetic and strain energy of the modes of one nodal diameter (J).
    pub fn diameter_energies(&self, nodal_diameter: usize) -> (f64, f64) {
        let (mut kinetic, mut strain) = (0.0, 0.0);
        for mode in 0..self.model.diameters[nodal_diameter].len() {
            let k = &self.coefficients[nodal_diameter * self.modes + mode];
            let (position, increment) = self.modal_state(nodal_diameter, mode);
            for part in 0..2 {
                kinetic += k.inertia * (increment[part] * increment[part]);
                strain += k.spring * (position[part] * (position[part] - increment[part]));
            }
        }
        (kinetic, strain)
    }

    /// Damping loss since the last call (J).
    pub fn collect_loss(&mut self) -> f64 {
        self.finish();
        let loss = self.state.loss.iter().sum();
        self.state.loss.fill(0.0);
        loss
    }

    /// Set amplitudes that have decayed to nothing to exactly zero, so that no denormals arise.
    pub fn flush(&mut self) {
        for values in [&mut self.state.position, &mut self.state.increment, &mut self.state.older] {
            for value in values.iter_mut().flatten().flatten().filter(|value| value.abs() < FLUSH_BELOW) {
                *value = 0.0;
            }
        }
    }

    /// True when every modal coordinate is finite.
    pub fn is_finite(&self) -> bool {
        let state = &self.state;
        let all = state.position.iter().chain(&state.increment).chain(&state.force);
        all.flatten().flatten().all(|value| value.is_finite())
    }

    /// Save the state (not the step size).
    pub fn save(&self, writer: &mut Writer) {
        self.state.save(writer);
    }

    /// Pass over a saved state and refuse what is none.
    pub fn check(&self, reader: &mut Reader) {
        self.state.check(reader);
    }

    /// Restore a saved state, after [`CyclicBank::set_step`].
    pub fn restore(&mut self, reader: &mut Reader) {
        self.state.restore(reader);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Complex, DMatrix};

    fn model(sectors: usize, nodes: usize) -> CyclicModel {
        let diameter = |n: usize| {
            // Fewer modes for some nodal diameters than for others.
            let modes = 3 * nodes + 4 - n % 3;
            let real = n == 0 || 2 * n == sectors;
            let shape = |row: usize, mode: usize| {
                let x = 1.7 * row as f64 + 0.9 * mode as f64 + 0.4 * n as f64;
                Complex::new(x.sin(), if real { 0.0 } else { (1.3 * x).cos() })
            };
            DiameterModes {
                nodal_diameter: n,
                frequencies: (1..=modes).map(|mode| 700.0 * (mode * mode) as f64 + 50.0 * n as f64).collect(),
                damping_ratios: vec![0.005; modes],
                contact_modes: DMatrix::from_fn(3 * nodes, modes, shape),
                shapes: DMatrix::identity(modes, modes),
                quasi_static: 3 * nodes,
            }
        };
        CyclicModel { sectors, diameters: (0..=sectors / 2).map(diameter).collect() }
    }

    /// Free motion keeps ½q̇² + ½ω²q² of every nodal diameter, which the energy that is conserved does not tell.
    #[test]
    fn the_energy_of_the_instant_is_that_of_the_motion() {
        let mut undamped = model(11, 2);
        undamped.set_damping_ratio(0.0);
        let mut bank = CyclicBank::new(&undamped, false);
        bank.set_step(Scheme::ModalExact, 2e-5);
        let mut expected = 0.0;
        for (n, diameter) in undamped.diameters.iter().enumerate() {
            for (mode, frequency) in diameter.frequencies.iter().enumerate() {
                let (q, v) = (1e-4 / (1.0 + mode as f64), 0.3 - 0.1 * n as f64);
                bank.set_modal_state(n, mode, [q, -0.5 * q], [v, 0.2 * v]);
                let parts = if undamped.is_real(n) { [1.0, 0.0] } else { [1.0, 1.0] };
                let square = |a: f64, b: f64| parts[0] * a * a + parts[1] * b * b;
                expected += 0.5 * square(v, 0.2 * v) + 0.5 * frequency * frequency * square(q, 0.5 * q);
            }
        }
        let none = vec![0.0; bank.rows() * bank.lanes()];
        for _ in 0..200 {
            bank.predict(false);
            let (kinetic, strain) = bank.energies_now(&none);
            let off = (kinetic + strain - expected).abs() / expected;
            assert!(off < 1e-9 && kinetic >= 0.0 && strain >= 0.0, "{off:e}");
        }
    }

    #[test]
    fn at_rest_nothing_of_the_run_before_acts() {
        for scheme in [Scheme::ModalExact, Scheme::CentralDifference, Scheme::MasslessBoundary] {
            let mut bank = CyclicBank::new(&model(11, 2), true);
            bank.set_step(scheme, 1e-6);
            for step in 0..5 {
                bank.loads_mut()[1] = 1e3;
                bank.predict(true);
                bank.ask([(3, 0, [1.0, 0.3, -0.2]), (step, 1, [-2.0, 0.0, 0.5])].into_iter());
                bank.act();
                assert!(bank.finish_loads() != 0.0);
            }
            bank.rest();
            let none = vec![0.0; bank.rows() * bank.lanes()];
            assert_eq!((bank.energies_now(&none), bank.collect_loss()), ((0.0, 0.0), 0.0), "{scheme:?}");
            bank.resample(scheme, 7e-7, &none);
            for _ in 0..2 {
                bank.predict(true);
                assert_eq!((bank.finish_loads(), bank.energies_now(&none)), (0.0, (0.0, 0.0)), "{scheme:?}");
                assert!(bank.displacement().iter().chain(bank.displacement_before()).all(|value| *value == 0.0));
            }
            assert_eq!(bank.collect_loss().to_bits(), 0.0_f64.to_bits());
        }
    }

    #[test]
    fn quasi_static_modes_have_no_motion_to_start_with() {
        let mut undamped = model(8, 1);
        undamped.set_damping_ratio(0.0);
        let mut bank = CyclicBank::new(&undamped, false);
        bank.set_step(Scheme::MasslessBoundary, 1e-6);
        let mut expected = 0.0;
        for (n, diameter) in undamped.diameters.iter().enumerate() {
            for (mode, frequency) in diameter.frequencies.iter().enumerate() {
                bank.set_modal_state(n, mode, [1e-4, 0.0], [0.3, 0.0]);
                let dynamic = mode + diameter.quasi_static < diameter.len();
                expected += if dynamic { 0.5 * (0.09 + (1e-4 * frequency).powi(2)) } else { 0.0 };
            }
        }
        let none = vec![0.0; bank.rows() * bank.lanes()];
        let (kinetic, strain) = bank.energies_now(&none);
        assert!(((kinetic + strain) / expected - 1.0).abs() < 1e-12, "{kinetic} + {strain} of {expected} J");
    }

    /// The widest set against the baseline; a processor without wider registers compares the baseline with itself.
    #[test]
    fn every_instruction_set_gives_the_same_bits() {
        for (sectors, nodes) in [(13, 1), (20, 2), (36, 5)] {
            for scheme in [Scheme::ModalExact, Scheme::MasslessBoundary] {
                let run = |instruction_set| {
                    let mut bank = CyclicBank::new(&model(sectors, nodes), true);
                    bank.instruction_set = instruction_set;
                    bank.set_step(scheme, 1e-6);
                    for step in 0..300 {
                        bank.loads_mut()[1] = 1e3;
                        bank.predict(true);
                        if step % 3 > 0 {
                            let force = [f64::from(step).cos(), 0.3, -0.2];
                            let index = usize::try_from(step).unwrap();
                            let forces = [(index % sectors, index % nodes, force), (index * 5 % sectors, 0, force)];
                            bank.ask(forces.into_iter());
                            bank.act();
                        }
                        if step % 50 == 0 {
                            bank.collect_loss();
                        }
                    }
                    let loss = bank.collect_loss().to_bits();
                    let state = &bank.state;
                    let modes = state.position.iter().chain(&state.increment).flatten().flatten();
                    let bits = modes.chain(&state.displacement).map(|value| value.to_bits());
                    (bits.collect::<Vec<_>>(), loss)
                };
                assert!(
                    run(InstructionSet::Baseline) == run(InstructionSet::detect()),
                    "{sectors} x {nodes} {scheme:?}"
                );
                #[cfg(target_arch = "x86_64")]
                if InstructionSet::detect() == InstructionSet::Avx512 {
                    assert!(
                        run(InstructionSet::Avx2) == run(InstructionSet::Baseline),
                        "{sectors} x {nodes} {scheme:?}"
                    );
                }
            }
        }
    }

    /// Contact displacements that were corrected at once are those of the modes corrected one by one later.
    #[test]
    fn displacements_and_modes_agree_after_contact() {
        let mut bank = CyclicBank::new(&model(11, 2), false);
        bank.set_step(Scheme::ModalExact, 1e-4);
        for step in 0..200_usize {
            bank.predict(true);
            bank.ask([(step % 11, step % 2, [1.0, -0.4, 0.1]), (3, 0, [0.2, 0.5, -1.0])].into_iter());
            bank.act();
            if step % 20 == 7 {
                let found = bank.displacement().to_vec();
                bank.recover();
                let size = found.iter().fold(0.0_f64, |most, value| most.max(value.abs()));
                let off = found.iter().zip(bank.displacement()).fold(0.0_f64, |most, (a, b)| most.max((a - b).abs()));
                assert!(size > 0.0 && off < 1e-13 * size, "step {step}: {off:e} of {size:e}");
            }
        }
    }
}
