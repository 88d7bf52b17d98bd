//! Complete state of a simulation, and its bytes.

use tiprub_core::persist::{Persist, StateReader, StateWriter, fingerprint};
use tiprub_core::{Error, Result, Sum, persist_fields};

use crate::course::InputCourse;
use crate::simulation::ThermalSimulation;

/// Number of bytes of the fingerprint of the model, before the state.
const FINGERPRINT_BYTES: usize = 8;
/// Largest absolute value of a number of a state (J of a year of the largest heats).
const LARGEST: f64 = 1e30;

/// Phase of a simulation: created, not yet initialised.
pub(crate) const CREATED: u64 = 0;
/// Phase: at a communication point.
pub(crate) const READY: u64 = 1;
/// Phase: a step failed.
pub(crate) const FAILED: u64 = 2;

/// State of a simulation.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct ThermalState {
    pub(crate) phase: u64,
    /// Time (s).
    pub(crate) time: f64,
    /// Parameters in the order of [`crate::table`]: initial temperature (K), item of the initial state, item of the interpolation.
    pub(crate) initial_temperature: f64,
    pub(crate) initial_state: i32,
    pub(crate) interpolation: i32,
    /// Heat of the patches (W).
    pub(crate) heat: Vec<InputCourse>,
    /// Temperatures of gas and air (K).
    pub(crate) films: [InputCourse; 2],
    /// Set convection factors.
    pub(crate) factors: [f64; 2],
    /// Factors of the last step, which define the eigenvectors of the coordinates.
    pub(crate) factors_used: [f64; 2],
    /// Coordinates z.
    pub(crate) coordinates: Vec<f64>,
    /// Length of the last step (s), 0 before the first; below, whether its film temperatures were ramps.
    pub(crate) last_length: f64,
    pub(crate) last_ramped: bool,
    /// Mean heat flows from gas and air over the last step (W).
    pub(crate) powers: [f64; 2],
    /// Heat supplied, from the gas and from the air since the start (J).
    pub(crate) totals: [Sum; 3],
    /// Sum of the absolute values of these heats (J).
    pub(crate) exchanged: f64,
    /// Heat stored at the start (J).
    pub(crate) initial_heat: f64,
}

persist_fields!(ThermalState {
    phase,
    time,
    initial_temperature,
    initial_state,
    interpolation,
    heat,
    films,
    factors,
    factors_used,
    coordinates,
    last_length,
    last_ramped,
    powers,
    totals,
    exchanged,
    initial_heat,
});

/// All inputs over time at one instant.
#[derive(Debug, Clone)]
pub struct ThermalInputs {
    heat: Vec<InputCourse>,
    films: [InputCourse; 2],
}

impl ThermalSimulation {
    /// Returns the inputs over time, derivatives included.
    ///
    /// # Examples
    /// ```
    /// # use tiprub_thermal::ThermalSimulation;
    /// # let model = tiprub_test_models::wall();
    /// # let mut simulation = ThermalSimulation::new(model)?;
    /// # simulation.initialise(0.0)?;
    /// let before = simulation.courses();
    /// simulation.restore_courses(before);
    /// # Ok::<(), tiprub_core::Error>(())
    /// ```
    pub fn courses(&self) -> ThermalInputs {
        ThermalInputs { heat: self.state.heat.clone(), films: self.state.films }
    }

    /// Restores the courses of the inputs at the same instant.
    ///
    /// # Examples
    /// ```
    /// # use tiprub_thermal::ThermalSimulation;
    /// # let model = tiprub_test_models::wall();
    /// # let mut simulation = ThermalSimulation::new(model)?;
    /// # simulation.initialise(0.0)?;
    /// let gas = simulation.table().find("gas_temperature").expect("an input").reference;
    /// let before = simulation.courses();
    /// simulation.set_input_derivative(gas, 1, 2.0)?;
    /// simulation.restore_courses(before);
    /// # Ok::<(), tiprub_core::Error>(())
    /// ```
    pub fn restore_courses(&mut self, courses: ThermalInputs) {
        (self.state.heat, self.state.films) = (courses.heat, courses.films);
    }

    /// Returns the size of a saved state (bytes).
    ///
    /// # Examples
    /// ```
    /// # use tiprub_thermal::ThermalSimulation;
    /// # let model = tiprub_test_models::wall();
    /// # let mut simulation = ThermalSimulation::new(model)?;
    /// # simulation.initialise(0.0)?;
    /// let buffer = vec![0; simulation.state_size()];
    /// assert!(!buffer.is_empty());
    /// # Ok::<(), tiprub_core::Error>(())
    /// ```
    pub fn state_size(&self) -> usize {
        let mut writer = StateWriter::new(&mut []);
        self.state.save(&mut writer);
        FINGERPRINT_BYTES + writer.written()
    }

    /// Saves the state into exactly [`ThermalSimulation::state_size`] bytes.
    ///
    /// # Examples
    /// ```
    /// # use tiprub_thermal::ThermalSimulation;
    /// # let model = tiprub_test_models::wall();
    /// # let mut simulation = ThermalSimulation::new(model)?;
    /// # simulation.initialise(0.0)?;
    /// let mut state = vec![0; simulation.state_size()];
    /// simulation.save_state(&mut state)?;
    /// # Ok::<(), tiprub_core::Error>(())
    /// ```
    ///
    /// # Errors
    /// A buffer of another length.
    pub fn save_state(&self, buffer: &mut [u8]) -> Result<()> {
        self.check_size(buffer.len())?;
        let (head, body) = buffer.split_at_mut(FINGERPRINT_BYTES);
        head.copy_from_slice(&self.fingerprint.to_le_bytes());
        self.state.save(&mut StateWriter::new(body));
        Ok(())
    }

    /// Restores a saved state; an error changes nothing.
    ///
    /// # Examples
    /// ```
    /// # use tiprub_thermal::ThermalSimulation;
    /// # let model = tiprub_test_models::wall();
    /// # let mut simulation = ThermalSimulation::new(model)?;
    /// # simulation.initialise(0.0)?;
    /// let mut state = vec![0; simulation.state_size()];
    /// simulation.save_state(&mut state)?;
    /// simulation.do_step(0.0, 10.0)?;
    /// simulation.restore_state(&state)?;
    /// assert_eq!(simulation.time(), 0.0);
    /// # Ok::<(), tiprub_core::Error>(())
    /// ```
    ///
    /// # Errors
    /// Another length, another model, or contents that are not a valid state.
    pub fn restore_state(&mut self, buffer: &[u8]) -> Result<()> {
        self.check_size(buffer.len())?;
        let (head, body) = buffer.split_at(FINGERPRINT_BYTES);
        if head != self.fingerprint.to_le_bytes() {
            return damaged("it belongs to another model");
        }
        let mut reader = StateReader::new(body);
        reader.up_to(LARGEST);
        self.state.check(&mut reader);
        if let Some(fault) = reader.fault() {
            return damaged(fault);
        }
        let mut state = self.state.clone();
        state.restore(&mut StateReader::new(body));
        let items = [state.initial_state, state.interpolation].iter().all(|item| (1..=2).contains(item));
        let factors =
            state.factors.iter().chain(&state.factors_used).all(|factor| crate::table::FACTORS.contains(factor));
        if reader.infinite() > 0 || state.phase > FAILED || !items || !factors || state.last_length < 0.0 {
            return damaged("it contains invalid values");
        }
        self.adopt(state);
        Ok(())
    }

    fn check_size(&self, found: usize) -> Result<()> {
        let expected = self.state_size();
        if found == expected {
            return Ok(());
        }
        Err(Error::State { problem: format!("it has {found} bytes, but this model needs {expected}") })
    }
}

fn damaged<T>(problem: &str) -> Result<T> {
    Err(Error::State { problem: problem.to_owned() })
}

/// Returns the fingerprint of a model's numbers.
pub(crate) fn fingerprint_of<'a>(arrays: impl Iterator<Item = &'a [f64]>) -> u64 {
    arrays.flatten().fold(0, |seed, value| fingerprint(&value.to_bits().to_le_bytes(), seed))
}
