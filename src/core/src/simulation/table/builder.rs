//! Rows of the variable table, and the rows that every scene has.

use tiprub_cosim::bounds::SHORTEST_STEP;
use tiprub_cosim::variables::{
    Causality, DataType, Enumeration, Quantity, Span, StartValue, Variability, Variable, VariableTable, VariableUnit,
};

use super::parts::AXES;
use crate::Result;
use crate::scene::method::SCHEMES;
use crate::scene::method::SOLVERS;
use crate::scene::ranges;
use crate::scene::ranges::{DAMPING, FRICTION, LONGEST_STEP, TURNED};
use crate::scene::settings::{ContactSettings, SceneSettings, TOLERANCE};
use crate::simulation::outputs::{OutputReader, OutputView, scalar};
use crate::simulation::units::{ANGLE, INPUT_INTERPOLATIONS, STEP_DERIVATIVES, TIME};

/// Description of inputs that would cause an impact if they jumped.
pub(crate) const RAMPED: &str = "; reached at the end of the communication step (see input_interpolation)";
/// Description of angle inputs that would cause an impact if they jumped.
const RAMPED_ANGLE: &str =
    "; reached at the end of the communication step (see input_interpolation), so do not wrap it to one turn";

/// Unit; `None` for dimensionless numbers and texts.
type Unit = Option<&'static VariableUnit>;

/// Unit with a typical magnitude; `None` for dimensionless numbers.
pub(crate) type NominalUnit = Option<(&'static VariableUnit, f64)>;

/// Collects rows.
#[derive(Default)]
pub(crate) struct TableBuilder {
    variables: Vec<Variable>,
    /// Readers of the outputs, in the order of the outputs.
    readers: Vec<OutputReader>,
    /// Index of the structure or pair of the next rows, and the prefix of their names.
    of: usize,
    prefix: String,
}

impl TableBuilder {
    /// Assigns the following rows to structure or pair `of`, with names that start with `prefix`.
    pub fn belongs(&mut self, of: usize, prefix: String) {
        (self.of, self.prefix) = (of, prefix);
    }

    /// Assigns the following rows to the whole scene.
    pub(crate) fn belongs_to_all(&mut self) {
        self.belongs(0, String::new());
    }

    pub fn push(
        &mut self,
        quantity: Quantity,
        name: impl Into<String>,
        description: impl Into<String>,
    ) -> &mut Variable {
        let name = format!("{}{}", self.prefix, name.into());
        self.variables.push(Variable { of: self.of, ..Variable::output(name, description.into()) });
        let variable = self.variables.last_mut().unwrap_or_else(|| unreachable!("just pushed"));
        variable.quantity(quantity)
    }

    pub fn input(&mut self, quantity: Quantity, name: &str, unit: Unit, start: f64, text: &str) -> &mut Variable {
        let variable = self.push(quantity, name, text).input(start);
        variable.unit = unit;
        if unit == Some(&ANGLE) { variable.range(-TURNED, TURNED) } else { variable }
    }

    /// Adds an input that moves or loads a structure and therefore never jumps.
    pub fn moving_input(
        &mut self,
        quantity: Quantity,
        name: &str,
        unit: Unit,
        start: f64,
        text: &str,
    ) -> &mut Variable {
        let variable = self.input(quantity, name, unit, start, text);
        variable.description += if unit == Some(&ANGLE) { RAMPED_ANGLE } else { RAMPED };
        variable
    }

    pub fn parameter(&mut self, quantity: Quantity, name: &str, unit: Unit, start: f64, text: &str) -> &mut Variable {
        self.input(quantity, name, unit, start, text).role(Causality::Parameter, Variability::Fixed)
    }

    pub fn choice(&mut self, quantity: Quantity, name: &str, choices: &'static Enumeration, start: i32, text: &str) {
        self.push(quantity, name, text).choice(choices, start);
    }

    /// Adds a parameter that is a whole number.
    pub fn whole(&mut self, quantity: Quantity, name: &str, start: u32, text: &str) -> &mut Variable {
        let start = StartValue::Integer(i32::try_from(start).unwrap_or(i32::MAX));
        self.parameter(quantity, name, None, 0.0, text).kind(DataType::Integer, start)
    }

    /// Adds an output with its reader.
    pub fn output(
        &mut self,
        name: impl Into<String>,
        span: Span,
        unit: NominalUnit,
        text: impl Into<String>,
        read: OutputReader,
    ) -> &mut Variable {
        self.readers.push(read);
        let variable = self.push(Quantity::Output, name, text).span(span);
        (variable.unit, variable.nominal) = unit.unzip();
        variable
    }

    /// Adds the components of a vector along x, y, z. The name of the axis replaces `{axis}` in the text; the reader
    /// receives the index of the axis.
    pub fn vector(
        &mut self,
        name: &str,
        span: Span,
        unit: NominalUnit,
        text: &str,
        read: impl Fn(&OutputView, usize) -> f64 + Copy + Send + Sync + 'static,
    ) {
        for (axis, letter) in AXES.into_iter().enumerate() {
            let text = text.replace("{axis}", letter);
            self.output(format!("{name}_{letter}"), span, unit, text, scalar(move |view| read(view, axis)));
        }
    }

    /// Adds a friction coefficient, which may change between communication steps.
    pub fn friction(&mut self, contact: &ContactSettings, text: &str) {
        let row = self.parameter(Quantity::Friction, "friction_coefficient", None, contact.friction, text);
        row.range(0.0, FRICTION).variability = Variability::Tunable;
    }

    /// Adds a modal damping ratio.
    pub fn damping(&mut self, quantity: Quantity, name: &str, start: f64, text: &str) -> &mut Variable {
        self.parameter(quantity, name, None, start, text).range(0.0, DAMPING)
    }

    /// Adds internal step, largest number of steps, number of threads, scheme and solver.
    pub fn methods(&mut self, settings: &SceneSettings) {
        let text = "Maximum internal time step; the step in use divides the communication step evenly";
        let step = self.parameter(Quantity::StepMax, "internal_step_max", Some(&TIME), settings.time.step, text);
        step.range(SHORTEST_STEP, LONGEST_STEP).nominal(settings.time.step).display(1);
        let (scheme, solver) = (settings.time.scheme.number(), settings.contacts[0].solver as i32 + 1);
        if settings.takes_a_tolerance() {
            let text = "Permitted displacement error of a galerkin step, as a fraction of the smallest clearance";
            let start = settings.time.tolerance.unwrap_or(TOLERANCE);
            let tolerance = self.parameter(Quantity::Tolerance, "tolerance", None, start, text);
            tolerance.range(ranges::TOLERANCE[0], ranges::TOLERANCE[1]).nominal(start);
        }
        if settings.bounds_steps() {
            self.max_internal_steps(settings);
        }
        if settings.shares_blades() {
            let text = "Number of threads that share independent blades in adaptive steps; results do not depend on it";
            self.whole(Quantity::Threads, "threads", 1, text).range(1.0, ranges::THREADS);
        }
        let reason = settings.time.scheme_reason.as_ref();
        let reason = reason.map_or(String::new(), |reason| format!("; the start value is {reason}"));
        self.choice(Quantity::SchemeChoice, "scheme", &SCHEMES, scheme, &format!("Time-stepping scheme{reason}"));
        self.choice(Quantity::SolverChoice, "solver", &SOLVERS, solver, "Contact solver");
    }

    /// Adds the largest number of internal steps, which may change between communication steps.
    fn max_internal_steps(&mut self, settings: &SceneSettings) {
        let text = "Maximum number of internal steps in one communication step, including rejected trials (0: no \
                    limit); a communication step that needs more is discarded";
        let most = settings.time.max_internal_steps.unwrap_or(0);
        let row = self.whole(Quantity::MaxInternalSteps, "max_internal_steps", most, text);
        row.range(0.0, ranges::STEPS).variability = Variability::Tunable;
    }

    /// Adds the interpolation of inputs between communication points.
    pub fn input_interpolation(&mut self, settings: &SceneSettings) {
        let start = settings.time.input_interpolation as i32 + 1;
        let text = "Interpolation of gap_offset and of all motion and load inputs between communication points; speed is \
             always held";
        self.choice(Quantity::InputInterpolation, "input_interpolation", &INPUT_INTERPOLATIONS, start, text);
    }

    /// Adds the choice of derivatives over communication steps.
    pub fn step_derivatives(&mut self) {
        let text = "Whether directional derivatives of the outputs at the end of the last communication step with \
                    respect to the inputs during that step are available; if on, the state at the start of each step is stored";
        self.choice(Quantity::StepDerivatives, "step_derivatives", &STEP_DERIVATIVES, 1, text);
    }

    /// Adds the name of the scene.
    pub(crate) fn scene_name(&mut self, settings: &SceneSettings) {
        let name = self.push(Quantity::SceneName, "scene", "Name of the scene from which this FMU was generated");
        name.constant(DataType::String, StartValue::String(settings.name.clone()));
    }

    /// Adds the time, the independent variable.
    pub fn time(&mut self) {
        let time = self.push(Quantity::Time, "time", "Simulated time");
        (time.causality, time.unit) = (Causality::Independent, Some(&TIME));
    }

    /// Returns the table of all rows, and the readers of its outputs, in their order.
    ///
    /// # Errors
    /// Duplicate names.
    pub fn finish(self) -> Result<(VariableTable, Vec<OutputReader>)> {
        Ok((VariableTable::new(self.variables)?, self.readers))
    }
}
