//! All inputs of a scene over one communication step, and what is refused of them.

use super::drive::{Input, RotorAngle};
use super::{SAME_STEP, Simulation};
use crate::persist::persist_fields;
use crate::variables::{Causality, Quantity, Variable};
use crate::{Error, Result, shown};

/// How many times as fast as before ramps may go because a step is shorter.
const QUICKER: f64 = 2.0;

/// The real inputs, each with its derivative.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Inputs {
    /// Speed of the rotor: what is set acts at once, so that its integral is the angle that the importer expects.
    pub speed: Input,
    /// Speed that growth and stiffening follow (rad/s): that of the rotor, without its jumps.
    pub spin: Input,
    pub gap_offset: Input,
    pub shape_factor: Input,
    pub shape_rotation: Input,
    pub radius_change: Input,
    /// Whirl x, whirl y, axial shift.
    pub shaft: [Input; 3],
    pub load_amplitude: Input,
    pub load_phase: Input,
    /// One per patch.
    pub temperatures: Vec<Input>,
    /// Shortest time that ramps take from here (s), see [`Inputs::reach`].
    pub pace: f64,
    /// When ramps under way end: offset from the start of the communication step (s).
    pub until: f64,
}

persist_fields!(Inputs {
    speed,
    spin,
    gap_offset,
    shape_factor,
    shape_rotation,
    radius_change,
    shaft,
    load_amplitude,
    load_phase,
    temperatures,
    pace,
    until
});

impl Inputs {
    pub fn get(&self, quantity: Quantity, element: usize) -> Option<&Input> {
        match quantity {
            Quantity::Speed => Some(&self.speed),
            Quantity::GapOffset => Some(&self.gap_offset),
            Quantity::ShapeFactor => Some(&self.shape_factor),
            Quantity::ShapeRotation => Some(&self.shape_rotation),
            Quantity::RadiusChange => Some(&self.radius_change),
            Quantity::ShaftDisplacement(component) => self.shaft.get(component),
            Quantity::LoadAmplitude => Some(&self.load_amplitude),
            Quantity::LoadPhase => Some(&self.load_phase),
            Quantity::CasingTemperature => self.temperatures.get(element),
            _ => None,
        }
    }

    pub fn get_mut(&mut self, quantity: Quantity, element: usize) -> Option<&mut Input> {
        match quantity {
            Quantity::Speed => Some(&mut self.speed),
            Quantity::GapOffset => Some(&mut self.gap_offset),
            Quantity::ShapeFactor => Some(&mut self.shape_factor),
            Quantity::ShapeRotation => Some(&mut self.shape_rotation),
            Quantity::RadiusChange => Some(&mut self.radius_change),
            Quantity::ShaftDisplacement(component) => self.shaft.get_mut(component),
            Quantity::LoadAmplitude => Some(&mut self.load_amplitude),
            Quantity::LoadPhase => Some(&mut self.load_phase),
            Quantity::CasingTemperature => self.temperatures.get_mut(element),
            _ => None,
        }
    }

    /// All that move or load something, which a jump would hit or shake.
    fn moving(&self) -> impl Iterator<Item = &Input> {
        let single = [
            &self.gap_offset,
            &self.shape_factor,
            &self.shape_rotation,
            &self.radius_change,
            &self.load_amplitude,
            &self.load_phase,
        ];
        single.into_iter().chain(&self.shaft).chain(&self.temperatures)
    }

    fn moving_mut(&mut self) -> impl Iterator<Item = &mut Input> {
        let single = [
            &mut self.gap_offset,
            &mut self.shape_factor,
            &mut self.shape_rotation,
            &mut self.radius_change,
            &mut self.load_amplitude,
            &mut self.load_phase,
        ];
        single.into_iter().chain(&mut self.shaft).chain(&mut self.temperatures)
    }

    /// How long ramps take that begin with a step of length `length` (s): as long as the step, but what came together
    /// over a step more than twice as long is not put into this one, where it would hit. A step of a nanosecond after
    /// one of ten microseconds goes on at the pace it finds; the delay left shrinks by half of the time that passes.
    pub fn reach(&self, length: f64) -> f64 {
        if self.pace <= QUICKER * length { length } else { self.pace }
    }

    /// A run starts: no step came before.
    pub fn start(&mut self) {
        self.spin = self.speed;
        (self.pace, self.until) = (0.0, 0.0);
    }

    /// A communication step of length `length` begins.
    pub fn begin(&mut self, length: f64, hold: bool) {
        let until = self.reach(length);
        self.until = until;
        if !hold {
            self.moving_mut().for_each(|input| input.aim(0.0, until));
        }
        self.lead_spin(0.0, until, hold);
    }

    /// From `offset` on, growth and stiffening go where the speed is at `until`.
    pub fn lead_spin(&mut self, offset: f64, until: f64, hold: bool) {
        self.spin.follow(&self.speed);
        if hold { self.spin.take() } else { self.spin.aim(offset, until) }
    }

    /// The communication step is over after `length`.
    pub fn shift(&mut self, length: f64) {
        self.moving_mut().for_each(|input| input.shift(length));
        self.speed.shift(length);
        self.spin.shift(length);
        self.pace = if self.until > length { self.until - 0.5 * length } else { length };
    }

    /// Nothing will move in a step of length `length`.
    fn rest(&self, length: f64) -> bool {
        let rests = |input: &Input| input.slope == 0.0 && input.at(0.0).to_bits() == input.asked(length).to_bits();
        self.speed.slope == 0.0 && self.moving().all(rests)
    }

    /// Start values everywhere.
    pub fn clear(&mut self) {
        self.moving_mut().for_each(|input| *input = Input::default());
        (self.speed, self.spin) = (Input::default(), Input::default());
        (self.pace, self.until) = (0.0, 0.0);
        self.shape_factor.value = 1.0;
        self.shape_factor.take();
    }
}

/// All inputs over time at one instant, to go back to where a set of values is refused as a whole.
#[derive(Debug, Clone)]
pub struct Courses {
    inputs: Inputs,
    rotor: RotorAngle,
}

impl Simulation {
    /// What the inputs do, derivatives included.
    pub fn courses(&self) -> Courses {
        Courses { inputs: self.inputs.clone(), rotor: self.rotor }
    }

    /// Back to what the inputs did at the same instant; values as read are set back by [`Simulation::set_real`] before.
    pub fn restore_courses(&mut self, courses: Courses) {
        (self.inputs, self.rotor) = (courses.inputs, courses.rotor);
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
                let Some(input) = self.inputs.get(variable.quantity, element) else { continue };
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
        let (reached, end) = (input.at(start), input.asked(until));
        let beyond = (low - end).max(end - high);
        let what = || format!("variable `{}`", variable.element_name(element));
        if input.slope != 0.0 && !(end.is_finite() && beyond <= SAME_STEP * low.abs().max(high.abs())) {
            let problem = format!(
                "its derivative {} takes it to {} by t = {} s, outside {} … {}",
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
        let angle = matches!(variable.quantity, Quantity::ShapeRotation | Quantity::LoadPhase);
        let turned = if angle { (input.asked(start) - reached).abs() } else { 0.0 };
        if at_once || (rate.is_finite() && turned <= std::f64::consts::PI) {
            return Ok(());
        }
        let way = format!("goes from {} to {} by t = {} s", shown(reached), shown(end), shown(self.time + until));
        Err(if turned > std::f64::consts::PI {
            Error::invalid(
                what(),
                format!("{way}, more than half a turn: an angle wrapped to one turn would be turned back all the way"),
                "Give the angle without wrapping it; if so fast a turn is meant, give its derivative or shorter \
                 communication steps",
            )
        } else {
            Error::invalid(what(), format!("{way}, too fast for a number"), "Use smaller values or a longer step")
        })
    }
}
