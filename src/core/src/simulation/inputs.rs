//! All inputs of a scene over one communication step, and what is refused of them.

use super::drive::{Input, RotorAngle};
use super::{SAME_STEP, Simulation};
use crate::persist::persist_fields;
use crate::variables::{Causality, Quantity, Variable};
use crate::{Error, Result, shown};

/// Largest factor by which ramps may become faster because a step is shorter.
const QUICKER: f64 = 2.0;

/// Prescribed inputs of a rotor.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct RotorInputs {
    /// Speed of the rotor: what is set acts at once, so that its integral is the angle that the importer expects.
    pub speed: Input,
    /// Speed that growth and stiffening follow (rad/s): that of the rotor, without its jumps.
    pub spin: Input,
    /// Whirl x, whirl y, axial shift.
    pub shaft: [Input; 3],
    /// Amplitude and phase of the excitation; empty where there is none.
    pub excitation: Vec<Input>,
    /// Temperature; empty where it is none of the inputs.
    pub temperature: Vec<Input>,
}

/// Prescribed inputs of a surface.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct PairInputs {
    pub gap_offset: Input,
    pub shape_factor: Input,
    pub shape_rotation: Input,
    pub radius_change: Input,
}

/// Loads of a structure that carries surfaces.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct CarrierInputs {
    pub load_amplitude: Input,
    pub load_phase: Input,
    /// One per patch.
    pub temperatures: Vec<Input>,
}

/// The real inputs, each with its derivative.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Inputs {
    /// One per structure that touches.
    pub rotors: Vec<RotorInputs>,
    /// One per contact pair.
    pub pairs: Vec<PairInputs>,
    /// One per structure that carries surfaces.
    pub carriers: Vec<CarrierInputs>,
    /// Shortest time that ramps take from here (s), see [`Inputs::reach`].
    pub extrapolation: f64,
    /// When ramps under way end: offset from the start of the communication step (s).
    pub until: f64,
}

persist_fields!(RotorInputs { speed, spin, shaft, excitation, temperature });
persist_fields!(PairInputs { gap_offset, shape_factor, shape_rotation, radius_change });
persist_fields!(CarrierInputs { load_amplitude, load_phase, temperatures });
persist_fields!(Inputs { rotors, pairs, carriers, extrapolation, until });

impl RotorInputs {
    fn moving(&self) -> impl Iterator<Item = &Input> {
        self.shaft.iter().chain(&self.excitation).chain(&self.temperature)
    }

    fn moving_mut(&mut self) -> impl Iterator<Item = &mut Input> {
        self.shaft.iter_mut().chain(&mut self.excitation).chain(&mut self.temperature)
    }

    /// Temperature that acts at an offset (K).
    pub fn temperature_at(&self, offset: f64) -> f64 {
        self.temperature.first().map_or(0.0, |input| input.at(offset))
    }

    /// From `offset` on, growth and stiffening go where the speed is at `until`.
    pub fn lead_spin(&mut self, offset: f64, until: f64, hold: bool) {
        self.spin.follow(&self.speed);
        if hold { self.spin.take() } else { self.spin.aim(offset, until) }
    }
}

impl PairInputs {
    fn moving(&self) -> impl Iterator<Item = &Input> {
        [&self.gap_offset, &self.shape_factor, &self.shape_rotation, &self.radius_change].into_iter()
    }

    fn moving_mut(&mut self) -> impl Iterator<Item = &mut Input> {
        [&mut self.gap_offset, &mut self.shape_factor, &mut self.shape_rotation, &mut self.radius_change].into_iter()
    }
}

impl CarrierInputs {
    fn moving(&self) -> impl Iterator<Item = &Input> {
        [&self.load_amplitude, &self.load_phase].into_iter().chain(&self.temperatures)
    }

    fn moving_mut(&mut self) -> impl Iterator<Item = &mut Input> {
        [&mut self.load_amplitude, &mut self.load_phase].into_iter().chain(&mut self.temperatures)
    }
}

impl Inputs {
    /// The input behind a variable: its quantity, which structure or pair it belongs to, and which element it is.
    pub fn get(&self, quantity: Quantity, of: usize, element: usize) -> Option<&Input> {
        match quantity {
            Quantity::Speed => Some(&self.rotors[of].speed),
            Quantity::ShaftDisplacement(component) => self.rotors[of].shaft.get(component),
            Quantity::Excitation(component) => self.rotors[of].excitation.get(component),
            Quantity::RotorTemperature => self.rotors[of].temperature.first(),
            Quantity::GapOffset => Some(&self.pairs[of].gap_offset),
            Quantity::ShapeFactor => Some(&self.pairs[of].shape_factor),
            Quantity::ShapeRotation => Some(&self.pairs[of].shape_rotation),
            Quantity::RadiusChange => Some(&self.pairs[of].radius_change),
            Quantity::LoadAmplitude => Some(&self.carriers[of].load_amplitude),
            Quantity::LoadPhase => Some(&self.carriers[of].load_phase),
            Quantity::CasingTemperature => self.carriers[of].temperatures.get(element),
            _ => None,
        }
    }

    /// The same, to change it.
    pub fn get_mut(&mut self, quantity: Quantity, of: usize, element: usize) -> Option<&mut Input> {
        match quantity {
            Quantity::Speed => Some(&mut self.rotors[of].speed),
            Quantity::ShaftDisplacement(component) => self.rotors[of].shaft.get_mut(component),
            Quantity::Excitation(component) => self.rotors[of].excitation.get_mut(component),
            Quantity::RotorTemperature => self.rotors[of].temperature.first_mut(),
            Quantity::GapOffset => Some(&mut self.pairs[of].gap_offset),
            Quantity::ShapeFactor => Some(&mut self.pairs[of].shape_factor),
            Quantity::ShapeRotation => Some(&mut self.pairs[of].shape_rotation),
            Quantity::RadiusChange => Some(&mut self.pairs[of].radius_change),
            Quantity::LoadAmplitude => Some(&mut self.carriers[of].load_amplitude),
            Quantity::LoadPhase => Some(&mut self.carriers[of].load_phase),
            Quantity::CasingTemperature => self.carriers[of].temperatures.get_mut(element),
            _ => None,
        }
    }

    /// All that move or load something, which a jump would hit or shake.
    fn moving(&self) -> impl Iterator<Item = &Input> {
        let shafts = self.rotors.iter().flat_map(RotorInputs::moving);
        let pairs = self.pairs.iter().flat_map(PairInputs::moving);
        shafts.chain(pairs).chain(self.carriers.iter().flat_map(CarrierInputs::moving))
    }

    fn moving_mut(&mut self) -> impl Iterator<Item = &mut Input> {
        let shafts = self.rotors.iter_mut().flat_map(RotorInputs::moving_mut);
        let pairs = self.pairs.iter_mut().flat_map(PairInputs::moving_mut);
        shafts.chain(pairs).chain(self.carriers.iter_mut().flat_map(CarrierInputs::moving_mut))
    }

    /// Returns the duration of ramps that begin with a step of length `length` (s): that of the step. A change that accumulated over a step more than
    /// twice as long is not applied within this one, where it would act as an impact. A step of a nanosecond after one of ten microseconds continues
    /// with the rate of change it finds; the remaining delay shrinks by half of the time that passes.
    pub fn extrapolation_time(&self, length: f64) -> f64 {
        if self.extrapolation <= QUICKER * length { length } else { self.extrapolation }
    }

    /// A run starts: no step came before.
    pub fn start(&mut self) {
        self.rotors.iter_mut().for_each(|rotor| rotor.spin = rotor.speed);
        (self.extrapolation, self.until) = (0.0, 0.0);
    }

    /// A communication step of length `length` begins.
    pub fn begin(&mut self, length: f64, hold: bool) {
        let until = self.extrapolation_time(length);
        self.until = until;
        if !hold {
            self.moving_mut().for_each(|input| input.aim(0.0, until));
        }
        self.rotors.iter_mut().for_each(|rotor| rotor.lead_spin(0.0, until, hold));
    }

    /// The communication step is over after `length`.
    pub fn shift(&mut self, length: f64) {
        self.moving_mut().for_each(|input| input.shift(length));
        for rotor in &mut self.rotors {
            rotor.speed.shift(length);
            rotor.spin.shift(length);
        }
        self.extrapolation = if self.until > length { self.until - 0.5 * length } else { length };
    }

    /// Nothing will move in a step of length `length`.
    fn rest(&self, length: f64) -> bool {
        let rests =
            |input: &Input| input.slope == 0.0 && input.at(0.0).to_bits() == input.requested_value(length).to_bits();
        self.rotors.iter().all(|rotor| rotor.speed.slope == 0.0) && self.moving().all(rests)
    }

    /// Start values everywhere.
    pub fn clear(&mut self) {
        self.moving_mut().for_each(|input| *input = Input::default());
        self.rotors.iter_mut().for_each(|rotor| (rotor.speed, rotor.spin) = Default::default());
        (self.extrapolation, self.until) = (0.0, 0.0);
        for pair in &mut self.pairs {
            pair.shape_factor.value = 1.0;
            pair.shape_factor.take();
        }
    }
}

/// All inputs over time at one instant, to go back to where a set of values is refused as a whole.
#[derive(Debug, Clone)]
pub struct InputCourses {
    inputs: Inputs,
    rotors: Vec<RotorAngle>,
}

impl Simulation {
    /// Returns the inputs over time, derivatives included.
    ///
    /// # Examples
    /// ```
    /// # use tiprub_core::Simulation;
    /// # let scene = tiprub_test_models::rub(2);
    /// # let mut simulation = Simulation::new(&scene)?;
    /// # simulation.initialise(0.0)?;
    /// let speed = simulation.table().find("speed").expect("an input").reference;
    /// let before = simulation.courses();
    /// simulation.set_real(speed, 1310.0)?;
    /// simulation.set_real(speed, 1300.0)?;
    /// simulation.restore_courses(before);
    /// # Ok::<(), tiprub_core::Error>(())
    /// ```
    pub fn courses(&self) -> InputCourses {
        InputCourses { inputs: self.inputs.clone(), rotors: self.rotors.clone() }
    }

    /// Back to what the inputs did at the same instant; values as read are set back by [`Simulation::set_real`] before.
    ///
    /// # Examples
    /// ```
    /// # use tiprub_core::Simulation;
    /// # let scene = tiprub_test_models::rub(2);
    /// # let mut simulation = Simulation::new(&scene)?;
    /// # simulation.initialise(0.0)?;
    /// let speed = simulation.table().find("speed").expect("an input").reference;
    /// let before = simulation.courses();
    /// simulation.set_input_derivative(speed, 1, 5000.0)?;
    /// simulation.restore_courses(before);
    /// # Ok::<(), tiprub_core::Error>(())
    /// ```
    pub fn restore_courses(&mut self, courses: InputCourses) {
        (self.inputs, self.rotors) = (courses.inputs, courses.rotors);
    }

    /// Values set act at once instead of at the end of the step.
    pub(super) fn holds(&self) -> bool {
        self.compiled.references.input_interpolation.is_some_and(|reference| self.values[reference] > 1.5)
    }

    /// Whether a value of this input acts at once.
    pub(super) fn acts_at_once(&self, quantity: Quantity) -> bool {
        quantity == Quantity::Speed || self.holds()
    }

    /// Every input must be where it may be at the end of a step of length `step_size`. Allocates only to refuse.
    pub(super) fn check_courses(&self, step_size: f64) -> Result<()> {
        if self.inputs.rest(step_size) {
            return Ok(());
        }
        for variable in self.table.variables() {
            if variable.causality != Causality::Input && variable.quantity != Quantity::GapOffset {
                continue;
            }
            let at_once = self.acts_at_once(variable.quantity);
            for element in 0..variable.len() {
                let Some(input) = self.inputs.get(variable.quantity, variable.of, element) else { continue };
                self.check_course(variable, element, input, at_once, [0.0, step_size])?;
            }
        }
        Ok(())
    }

    /// One input between two offsets (s): its range at the end, and where it does not act at once its way there.
    pub(super) fn check_course(
        &self,
        variable: &Variable,
        element: usize,
        input: &Input,
        at_once: bool,
        [start, until]: [f64; 2],
    ) -> Result<()> {
        let (low, high) = (variable.min.unwrap_or(f64::MIN), variable.max.unwrap_or(f64::MAX));
        let (reached, end) = (input.at(start), input.requested_value(until));
        let beyond = (low - end).max(end - high);
        let what = || format!("variable `{}`", variable.element_name(element));
        if input.slope != 0.0 && !(end.is_finite() && beyond <= SAME_STEP * low.abs().max(high.abs())) {
            let problem = format!(
                "with the derivative {} it reaches {} at t = {} s, outside {} … {}",
                shown(input.slope),
                shown(end),
                shown(self.time + until),
                shown(low),
                shown(high)
            );
            let remedy = "Give a smaller derivative or none, or a shorter communication step";
            return Err(Error::invalid(what(), problem, remedy));
        }
        let rate = (end - reached) / (until - start);
        let angle =
            matches!(variable.quantity, Quantity::ShapeRotation | Quantity::LoadPhase | Quantity::Excitation(1));
        let turned = if angle { (input.requested_value(start) - reached).abs() } else { 0.0 };
        if at_once || (rate.is_finite() && turned <= std::f64::consts::PI) {
            return Ok(());
        }
        let time = shown(self.time + until);
        let way = format!("the value goes from {} to {} by t = {time} s", shown(reached), shown(end));
        Err(if turned > std::f64::consts::PI {
            Error::invalid(
                what(),
                format!("{way}, more than half a turn: a wrapped angle would rotate all the way back"),
                "Give the angle without wrapping it; if such a fast rotation is intended, set its derivative or use \
                 shorter communication steps",
            )
        } else {
            let problem = format!("{way}, and the rate overflows double precision");
            Error::invalid(what(), problem, "Use smaller values or a longer communication step")
        })
    }
}
