//! The two kinds of sectors: uncoupled sectors and a disk of coupled sectors.

use tiprub_cosim::persist::{StateReader, StateWriter};

use super::bank::{BankOptions, ModalBank};
use super::cyclic::{CyclicBank, CyclicModel};
use super::modal::ModalModel;
use crate::scene::method::Scheme;

/// Modes of the sectors.
#[derive(Debug, Clone, Copy)]
pub enum SectorModel<'a> {
    /// Modes of one uncoupled sector, and the number of sectors.
    Uncoupled(&'a ModalModel, usize),
    /// Modes of the whole disk.
    Coupled(&'a CyclicModel),
}

/// State of all modes of all sectors.
#[derive(Debug, Clone)]
#[expect(clippy::large_enum_variant, reason = "a system has one of them for good; a box would cost every access")]
pub enum Sectors {
    /// Uncoupled sectors.
    Uncoupled(ModalBank),
    /// Sectors of one elastic disk.
    Coupled(CyclicBank),
}

/// Forwards a call to either kind.
macro_rules! delegate {
    ($($(#[$doc:meta])* $name:ident[$($kind:tt)?]($($argument:ident: $type:ty),*) $(-> $result:ty)?;)+) => {
        $($(#[$doc])* #[inline(always)]
        pub fn $name(& $($kind)? self, $($argument: $type),*) $(-> $result)? {
            match self {
                Self::Uncoupled(bank) => bank.$name($($argument),*),
                Self::Coupled(bank) => bank.$name($($argument),*),
            }
        })+
    };
}

impl Sectors {
    /// Creates sectors at rest; call [`Sectors::set_step`] before stepping.
    ///
    /// # Panics
    /// If coupled sectors get options that they do not support: mistuning, or spin that couples modes.
    pub fn new(model: SectorModel, options: BankOptions) -> Self {
        match model {
            SectorModel::Uncoupled(model, sectors) => Self::Uncoupled(ModalBank::with_options(model, sectors, options)),
            SectorModel::Coupled(model) => {
                assert!(
                    options.frequency_factors.is_empty() && options.coupling.is_none(),
                    "coupled sectors support neither mistuning nor spin coupling"
                );
                Self::Coupled(CyclicBank::new(model, options.loads).excited(options.excitation))
            }
        }
    }

    delegate! {
        /// Number of sectors.
        sectors[]() -> usize;
        /// Number of lanes of a displacement row: sectors rounded up to whole registers.
        lanes[]() -> usize;
        /// Number of contact rows of a sector (3 per contact node).
        rows[]() -> usize;
        /// Step size of the current coefficients (s).
        step[]() -> f64;
        /// Displacements of the contact rows at the current step (m), `[row][lane]`.
        displacement[]() -> &[f64];
        /// Displacements of the contact rows one step earlier (m), `[row][lane]`.
        displacement_before[]() -> &[f64];
        /// Sets a new step size: coefficients and flexibility; the state is unchanged.
        set_step[mut](scheme: Scheme, step: f64);
        /// Sets the modal damping ratio of all modes; the first modes have their `own` (takes effect with the next [`Sectors::set_step`]).
        set_damping_ratio[mut](damping_ratio: f64, own: &[f64]);
        /// Converts the state to another step size under the last contact forces (`forces[row · lanes + sector]`, N) and the modal loads.
        resample[mut](scheme: Scheme, new_step: f64, forces: &[f64]);
        /// Sets the static equilibrium under modal loads of every sector, or of nodal diameter 0.
        settle[mut](modal_load: &[f64]);
        /// Recomputes the contact displacements from the modal state (after setting it).
        recover[mut]();
        /// Sets the state to rest, undeformed.
        rest[mut]();
        /// Modal loads of the next step, of every sector or of nodal diameter 0; to be set before [`Sectors::predict`].
        loads_mut[mut]() -> &mut [f64];
        /// Sets the engine order of the excitation, if any.
        set_excitation_order[mut](order: u32);
        /// Sets the excitation of the next step, before [`Sectors::predict`]: amplitude (N) and phase ψ (rad).
        excite[mut](amplitude: f64, phase: f64);
        /// Returns the work of the excitation over the last step (J), after the contact correction.
        finish_excitation[mut]() -> f64;
        /// Makes the current displacements the previous ones.
        begin_span[mut]();
        /// Predicts one step without contact (eq. 9 of the paper) and recovers the contact displacements.
        predict[mut]();
        /// Stops collecting the damping loss, which takes time.
        skip_losses[mut]();
        /// Kinetic and strain energy of all sectors (J), in the form that the scheme conserves.
        energies[]() -> (f64, f64);
        /// Instantaneous kinetic and strain energy of all sectors (J), under the persistent contact forces
        /// (`forces[row · lanes + sector]`, N) and the modal loads.
        energies_now[mut](forces: &[f64]) -> (f64, f64);
        /// Damping loss since the last call (J).
        collect_loss[mut]() -> f64;
        /// Returns the work of the modal loads over the last step (J), after the contact correction.
        finish_loads[mut]() -> f64;
        /// Sets amplitudes that have decayed almost to zero to exactly zero.
        flush[mut]();
        /// Returns whether every modal coordinate is finite.
        is_finite[]() -> bool;
        /// Saves the state (not the step size).
        save[](writer: &mut StateWriter);
        /// Reads over a saved state and rejects invalid values.
        check[](reader: &mut StateReader);
        /// Restores a saved state, after [`Sectors::set_step`].
        restore[mut](reader: &mut StateReader);
    }

    /// Returns the uncoupled sectors, if any.
    pub fn uncoupled(&self) -> Option<&ModalBank> {
        if let Self::Uncoupled(bank) = self { Some(bank) } else { None }
    }

    /// Returns the disk of coupled sectors, if any.
    pub fn coupled(&self) -> Option<&CyclicBank> {
        if let Self::Coupled(bank) = self { Some(bank) } else { None }
    }

    /// Returns the disk of coupled sectors, to set initial conditions.
    pub fn coupled_mut(&mut self) -> Option<&mut CyclicBank> {
        if let Self::Coupled(bank) = self { Some(bank) } else { None }
    }

    /// Displacement of one contact row of one sector (m).
    #[inline(always)]
    pub fn row(&self, row: usize, sector: usize) -> f64 {
        self.displacement()[row * self.lanes() + sector]
    }

    /// Displacement of one contact row of one sector one step earlier (m).
    #[inline(always)]
    pub fn row_before(&self, row: usize, sector: usize) -> f64 {
        self.displacement_before()[row * self.lanes() + sector]
    }

    /// Modal position and increment of one mode of an uncoupled sector; for coupled sectors, the real part of nodal diameter `sector`.
    pub fn modal_state(&self, mode: usize, sector: usize) -> (f64, f64) {
        match self {
            Self::Uncoupled(bank) => bank.modal_state(mode, sector),
            Self::Coupled(bank) => {
                let (position, increment) = bank.modal_state(sector, mode);
                (position[0], increment[0])
            }
        }
    }

    /// Sets position and velocity of one mode of an uncoupled sector, or of the real part of nodal diameter `sector`.
    pub fn set_modal_state(&mut self, mode: usize, sector: usize, position: f64, velocity: f64) {
        match self {
            Self::Uncoupled(bank) => bank.set_modal_state(mode, sector, position, velocity),
            Self::Coupled(bank) => bank.set_modal_state(sector, mode, [position, 0.0], [velocity, 0.0]),
        }
    }

    /// Adds the load of a temperature (K) to uncoupled sectors for the next step, after [`Sectors::loads_mut`].
    pub fn expand(&mut self, temperature: f64) {
        if let Self::Uncoupled(bank) = self {
            bank.expand(temperature);
        }
    }

    /// Moves uncoupled sectors at rest by the free expansion of a temperature (K), after [`Sectors::settle`].
    pub(crate) fn settle_expansion(&mut self, temperature: f64) {
        if let Self::Uncoupled(bank) = self {
            bank.settle_expansion(temperature);
        }
    }

    /// Returns the work of heat on quasi-static modes over the last step (J), in addition to the result of [`Sectors::set_speed`] before it.
    pub(crate) fn finish_stiffening(&mut self) -> f64 {
        match self {
            Self::Uncoupled(bank) => bank.finish_stiffening(),
            Self::Coupled(_) => 0.0,
        }
    }

    /// Sets the rotor speed (rad/s) and temperature (K) if they couple the modes; returns the change of energy (J).
    pub fn set_speed(&mut self, speed: f64, temperature: f64) -> f64 {
        match self {
            Self::Uncoupled(bank) => bank.set_speed(speed, temperature),
            Self::Coupled(_) => 0.0,
        }
    }
}
