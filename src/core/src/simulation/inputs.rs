//! All inputs of a scene over one communication step, and their checks.

use tiprub_cosim::variables::{Causality, Quantity, Variable};
use tiprub_cosim::{persist_fields, shown};

use super::Simulation;
use super::clock::SAME_STEP;
use super::compile::Compiled;
use super::drive::{Input, RotorAngle};
use crate::scene::settings::StructureSettings;
use crate::{Error, Result};

/// Largest factor by which ramps may become steeper because a step is shorter.
const QUICKER: f64 = 2.0;

/// Prescribed inputs of a rotor.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct RotorInputs {
    /// Speed of the rotor: a new value acts immediately, so that its integral is the angle that the importer expects.
    pub speed: Input,
    /// Speed that growth and stiffening follow (rad/s): the rotor speed without its jumps.
    pub spin: Input,
    /// Whirl x, whirl y, axial shift.
    pub shaft: [Input; 3],
    /// Amplitude and phase of the excitation; empty without excitation.
    pub excitation: Vec<Input>,
    /// Temperature; empty if it is not an input.
    pub temperature: Vec<Input>,
    /// Integral of the speed.
    pub angle: RotorAngle,
}

/// Prescribed inputs of a surface.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct PairInputs {
    pub gap_offset: Input,
    pub shape_factor: Input,
    pub shape_rotation: Input,
    pub radius_change: Input,
}

/// Loads of a surface carrier.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct CarrierInputs {
    pub load_amplitude: Input,
    pub load_phase: Input,
    /// One per patch.
    pub temperatures: Vec<Input>,
}

/// The real inputs, each with its derivative.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Inputs {
    /// One per master.
    pub rotors: Vec<RotorInputs>,
    /// One per contact pair.
    pub pairs: Vec<PairInputs>,
    /// One per surface carrier.
    pub carriers: Vec<CarrierInputs>,
    /// Shortest duration of ramps that begin now (s), see [`Inputs::extrapolation_time`].
    pub extrapolation: f64,
    /// Offset at which current ramps end, from the start of the communication step (s).
    pub until: f64,
}

persist_fields!(RotorInputs { speed, spin, shaft, excitation, temperature, angle });
persist_fields!(PairInputs { gap_offset, shape_factor, shape_rotation, radius_change });
persist_fields!(CarrierInputs { load_amplitude, load_phase, temperatures });
persist_fields!(Inputs { rotors, pairs, carriers, extrapolation, until });

impl RotorInputs {
    /// Returns the inputs that a structure has.
    fn of(structure: &StructureSettings) -> Self {
        let inputs = |count: usize| vec![Input::default(); count];
        Self {
            excitation: inputs(if structure.excitation.is_some() { 2 } else { 0 }),
            temperature: inputs(usize::from(structure.thermal)),
            ..Self::default()
        }
    }

    /// Acting temperature at an offset (K).
    pub(crate) fn temperature_at(&self, offset: f64) -> f64 {
        self.temperature.first().map_or(0.0, |input| input.at(offset))
    }

    /// Speed (rad/s) and temperature (K), as set.
    pub fn reference(&self) -> [f64; 2] {
        [self.speed.value, self.temperature.first().map_or(0.0, |input| input.value)]
    }

    /// Total rotor angle at an offset (rad).
    pub(crate) fn total_angle(&self, offset: f64) -> f64 {
        self.angle.total(&self.speed, offset)
    }

    /// From `offset` on, ramps growth and stiffening to the speed at `until`.
    pub(crate) fn lead_spin(&mut self, offset: f64, until: f64, hold: bool) {
        self.spin.copy_request(&self.speed);
        if hold { self.spin.act_immediately() } else { self.spin.ramp(offset, until) }
    }
}

impl Inputs {
    /// Returns the inputs that a scene has.
    pub fn new(compiled: &Compiled) -> Self {
        let heated = |count: usize| CarrierInputs { temperatures: vec![Input::default(); count], ..Default::default() };
        Self {
            rotors: (0..compiled.bodies.len()).map(|body| RotorInputs::of(compiled.body(body).0)).collect(),
            pairs: vec![PairInputs::default(); compiled.plan.pairs.len()],
            carriers: compiled.carriers.iter().map(|carrier| heated(carrier.loads.thermal.len())).collect(),
            ..Self::default()
        }
    }

    /// Returns speed (rad/s) and temperature (K) of each master, as set.
    pub fn references(&self) -> Vec<[f64; 2]> {
        self.rotors.iter().map(RotorInputs::reference).collect()
    }

    /// Returns the duration of ramps that begin with a step of length `length` (s): the length of the step. A change that accumulated over
    /// a step more than twice as long is not applied within this one, where it would act as an impact. A step of a nanosecond after one of
    /// ten microseconds continues with the current rate of change; the remaining delay shrinks by half of the time that passes.
    pub(crate) fn extrapolation_time(&self, length: f64) -> f64 {
        if self.extrapolation <= QUICKER * length { length } else { self.extrapolation }
    }

    /// Starts a run, without a previous step.
    pub fn start(&mut self) {
        self.rotors.iter_mut().for_each(|rotor| rotor.spin = rotor.speed);
        (self.extrapolation, self.until) = (0.0, 0.0);
    }

    /// Begins a communication step of length `length`.
    pub fn begin(&mut self, length: f64, hold: bool) {
        let until = self.extrapolation_time(length);
        self.until = until;
        if !hold {
            self.moving_mut().for_each(|input| input.ramp(0.0, until));
        }
        self.rotors.iter_mut().for_each(|rotor| rotor.lead_spin(0.0, until, hold));
    }

    /// Ends the communication step after `length`.
    pub fn shift(&mut self, length: f64) {
        self.moving_mut().for_each(|input| input.shift(length));
        for rotor in &mut self.rotors {
            rotor.speed.shift(length);
            rotor.spin.shift(length);
            rotor.angle.shift(length);
        }
        self.extrapolation = if self.until > length { self.until - 0.5 * length } else { length };
    }

    /// Returns whether no input moves a structure in a step of length `length`.
    fn rest(&self, length: f64) -> bool {
        let rests =
            |input: &Input| input.slope == 0.0 && input.at(0.0).to_bits() == input.requested_value(length).to_bits();
        self.rotors.iter().all(|rotor| rotor.speed.slope == 0.0) && self.moving().all(rests)
    }

    /// Resets all inputs to their start values.
    pub fn clear(&mut self) {
        self.moving_mut().for_each(|input| *input = Input::default());
        self.rotors.iter_mut().for_each(|rotor| (rotor.speed, rotor.spin, rotor.angle) = Default::default());
        (self.extrapolation, self.until) = (0.0, 0.0);
        for pair in &mut self.pairs {
            pair.shape_factor.value = 1.0;
            pair.shape_factor.act_immediately();
        }
    }
}

/// Defines the functions that look up single inputs, for reading and for changes: their names, and the collection
/// methods that they call.
macro_rules! ways_to_inputs {
    ($($of_variable:ident $moving:ident $get:ident $iter:ident $($mutable:ident)?;)*) => {$(
        impl Inputs {
            /// Returns the input of a variable: its quantity, the index of its structure or pair, and its element.
            pub fn $of_variable(&$($mutable)? self, quantity: Quantity, of: usize, element: usize) -> Option<&$($mutable)? Input> {
                match quantity {
                    Quantity::Speed => Some(&$($mutable)? self.rotors[of].speed),
                    Quantity::ShaftDisplacement(component) => self.rotors[of].shaft.$get(component),
                    Quantity::Excitation(component) => self.rotors[of].excitation.$get(component),
                    Quantity::RotorTemperature => self.rotors[of].temperature.$get(0),
                    Quantity::GapOffset => Some(&$($mutable)? self.pairs[of].gap_offset),
                    Quantity::ShapeFactor => Some(&$($mutable)? self.pairs[of].shape_factor),
                    Quantity::ShapeRotation => Some(&$($mutable)? self.pairs[of].shape_rotation),
                    Quantity::RadiusChange => Some(&$($mutable)? self.pairs[of].radius_change),
                    Quantity::LoadAmplitude => Some(&$($mutable)? self.carriers[of].load_amplitude),
                    Quantity::LoadPhase => Some(&$($mutable)? self.carriers[of].load_phase),
                    Quantity::CasingTemperature => self.carriers[of].temperatures.$get(element),
                    _ => None,
                }
            }

            /// Returns all inputs that move or load a structure. A jump of such an input would excite vibration.
            pub(super) fn $moving(&$($mutable)? self) -> impl Iterator<Item = &$($mutable)? Input> {
                let rotors = self.rotors.$iter().flat_map(|rotor| {
                    let RotorInputs { shaft, excitation, temperature, .. } = rotor;
                    shaft.$iter().chain(excitation.$iter()).chain(temperature.$iter())
                });
                let pairs = self.pairs.$iter().flat_map(|pair| {
                    let PairInputs { gap_offset, shape_factor, shape_rotation, radius_change } = pair;
                    [gap_offset, shape_factor, shape_rotation, radius_change]
                });
                let carriers = self.carriers.$iter().flat_map(|carrier| {
                    let CarrierInputs { load_amplitude, load_phase, temperatures } = carrier;
                    [load_amplitude, load_phase].into_iter().chain(temperatures.$iter())
                });
                rotors.chain(pairs).chain(carriers)
            }
        }
    )*};
}

ways_to_inputs! {
    get moving get iter;
    get_mut moving_mut get_mut iter_mut mut;
}

impl Simulation {
    /// Returns whether new values act immediately instead of at the end of the step.
    pub(super) fn holds(&self) -> bool {
        self.compiled.references.input_interpolation.is_some_and(|reference| self.state.values[reference] > 1.5)
    }

    /// Returns whether a new value of this input acts immediately.
    pub(super) fn acts_at_once(&self, quantity: Quantity) -> bool {
        quantity == Quantity::Speed || self.holds()
    }

    /// Checks that every input is in its range at the end of a step of length `step_size`. Allocates only to reject.
    pub(super) fn check_courses(&self, step_size: f64) -> Result<()> {
        if self.state.inputs.rest(step_size) {
            return Ok(());
        }
        for variable in self.state.values.table().variables() {
            if variable.causality != Causality::Input && variable.quantity != Quantity::GapOffset {
                continue;
            }
            let at_once = self.acts_at_once(variable.quantity);
            for element in 0..variable.len() {
                let Some(input) = self.state.inputs.get(variable.quantity, variable.of, element) else { continue };
                self.check_course(variable, element, input, at_once, [0.0, step_size])?;
            }
        }
        Ok(())
    }

    /// Checks one input between two offsets (s): its range at the end, and its slope unless it acts immediately.
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
                "with the derivative {} it reaches {} at t = {} s, outside the range {} to {}",
                shown(input.slope),
                shown(end),
                shown(self.state.clock.time + until),
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
        let time = shown(self.state.clock.time + until);
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
