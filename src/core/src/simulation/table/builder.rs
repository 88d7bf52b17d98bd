//! Rows of the variable table, and the rows that every scene has.

use tiprub_cosim::bounds::SHORTEST_STEP;
use tiprub_cosim::variables::{
    Causality, DataType, Enumeration, Quantity, Span, StartValue, Variability, Variable, VariableTable, VariableUnit,
};

use crate::Result;
use crate::scene::method::SCHEMES;
use crate::scene::method::SOLVERS;
use crate::scene::ranges;
use crate::scene::ranges::{DAMPING, FRICTION, LONGEST_STEP, TURNED};
use crate::scene::settings::{ContactSettings, SceneSettings, TOLERANCE};
use crate::simulation::outputs::OutputReader;
use crate::simulation::units::{ANGLE, INPUT_INTERPOLATIONS, STEP_DERIVATIVES, TIME};

/// Description of inputs that would cause an impact if they jumped.
pub(crate) const RAMPED: &str = "; reached at the end of the communication step (see input_interpolation)";
/// Description of angle inputs that would cause an impact if they jumped.
const RAMPED_ANGLE: &str =
    "; reached at the end of the communication step (see input_interpolation), so do not wrap it to one turn";

/// Collects rows and assigns references.
#[derive(Default)]
pub(crate) struct TableBuilder {
    variables: Vec<Variable>,
    /// Readers of the outputs, in the order of the outputs.
    readers: Vec<OutputReader>,
    next: u32,
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
        self.close();
        self.variables.push(Variable {
            name: format!("{}{}", self.prefix, name.into()),
            reference: self.next,
            dimension: None,
            kind: DataType::Real,
            causality: Causality::Output,
            variability: Variability::Continuous,
            span: Span::Point,
            unit: None,
            display: None,
            min: None,
            max: None,
            nominal: None,
            start: None,
            description: description.into(),
            quantity,
            of: self.of,
        });
        self.variables.last_mut().unwrap_or_else(|| unreachable!("just pushed"))
    }

    /// Counts the references of the last row, whose dimension is now known.
    fn close(&mut self) {
        self.next = self
            .variables
            .last()
            .map_or(0, |last| last.reference.saturating_add(u32::try_from(last.len()).unwrap_or(u32::MAX)));
    }

    pub fn input(
        &mut self,
        quantity: Quantity,
        name: &str,
        unit: Option<&'static VariableUnit>,
        start: f64,
        text: &str,
    ) -> &mut Variable {
        let variable = self.push(quantity, name, text);
        variable.causality = Causality::Input;
        variable.unit = unit;
        variable.start = Some(StartValue::Real(vec![start]));
        if unit == Some(&ANGLE) {
            (variable.min, variable.max) = (Some(-TURNED), Some(TURNED));
        }
        variable
    }

    /// Adds an input that moves or loads a structure and therefore never jumps.
    pub(crate) fn moving_input(
        &mut self,
        quantity: Quantity,
        name: &str,
        unit: Option<&'static VariableUnit>,
        start: f64,
        text: &str,
    ) -> &mut Variable {
        let variable = self.input(quantity, name, unit, start, text);
        variable.description += if unit == Some(&ANGLE) { RAMPED_ANGLE } else { RAMPED };
        variable
    }

    pub fn parameter(
        &mut self,
        quantity: Quantity,
        name: &str,
        unit: Option<&'static VariableUnit>,
        start: f64,
        text: &str,
    ) -> &mut Variable {
        let variable = self.input(quantity, name, unit, start, text);
        variable.causality = Causality::Parameter;
        variable.variability = Variability::Fixed;
        variable
    }

    pub fn choice(&mut self, quantity: Quantity, name: &str, choices: &'static Enumeration, start: i32, text: &str) {
        let variable = self.parameter(quantity, name, None, 0.0, text);
        variable.kind = DataType::Enumeration(choices);
        variable.start = Some(StartValue::Integer(start));
    }

    /// Adds an output with its reader.
    pub fn output(
        &mut self,
        name: impl Into<String>,
        span: Span,
        unit: Option<(&'static VariableUnit, f64)>,
        text: impl Into<String>,
        read: OutputReader,
    ) -> &mut Variable {
        self.readers.push(read);
        let variable = self.push(Quantity::Output, name, text);
        variable.span = span;
        if let Some((unit, nominal)) = unit {
            variable.unit = Some(unit);
            variable.nominal = Some(nominal);
        }
        variable
    }

    /// Adds a friction coefficient, which may change between communication steps.
    pub fn friction(&mut self, contact: &ContactSettings, text: &str) {
        let row = self.parameter(Quantity::Friction, "friction_coefficient", None, contact.friction, text);
        (row.min, row.max, row.variability) = (Some(0.0), Some(FRICTION), Variability::Tunable);
    }

    /// Adds a modal damping ratio.
    pub fn damping(&mut self, quantity: Quantity, name: &str, start: f64, text: &str) -> &mut Variable {
        let row = self.parameter(quantity, name, None, start, text);
        (row.min, row.max) = (Some(0.0), Some(DAMPING));
        row
    }

    /// Adds internal step, largest number of steps, scheme and solver.
    pub fn methods(&mut self, settings: &SceneSettings) {
        let step = self.parameter(
            Quantity::StepMax,
            "internal_step_max",
            Some(&TIME),
            settings.time.step,
            "Maximum internal time step; the step in use divides the communication step evenly",
        );
        (step.min, step.max) = (Some(SHORTEST_STEP), Some(LONGEST_STEP));
        (step.nominal, step.display) = (Some(settings.time.step), Some(1));
        let (scheme, solver) = (settings.time.scheme.number(), settings.contacts[0].solver as i32 + 1);
        if settings.takes_a_tolerance() {
            let text = "Permitted displacement error of a galerkin step, as a fraction of the smallest clearance";
            let start = settings.time.tolerance.unwrap_or(TOLERANCE);
            let tolerance = self.parameter(Quantity::Tolerance, "tolerance", None, start, text);
            (tolerance.min, tolerance.max) = (Some(ranges::TOLERANCE[0]), Some(ranges::TOLERANCE[1]));
            tolerance.nominal = Some(start);
        }
        if settings.bounds_steps() {
            self.max_internal_steps(settings);
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
        let most = self.parameter(Quantity::MaxInternalSteps, "max_internal_steps", None, 0.0, text);
        (most.kind, most.variability) = (DataType::Integer, Variability::Tunable);
        (most.min, most.max) = (Some(0.0), Some(ranges::STEPS));
        most.start =
            Some(StartValue::Integer(i32::try_from(settings.time.max_internal_steps.unwrap_or(0)).unwrap_or(i32::MAX)));
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
        (name.kind, name.causality, name.variability) = (DataType::String, Causality::Local, Variability::Constant);
        name.start = Some(StartValue::String(settings.name.clone()));
    }

    /// Adds the time, the independent variable.
    pub fn time(&mut self) {
        let time = self.push(Quantity::Time, "time", "Simulated time");
        time.causality = Causality::Independent;
        time.unit = Some(&TIME);
    }

    /// Returns the table of all rows, and the readers of its outputs, in their order.
    ///
    /// # Errors
    /// Duplicate names.
    pub fn finish(self) -> Result<(VariableTable, Vec<OutputReader>)> {
        Ok((VariableTable::new(self.variables)?, self.readers))
    }
}
