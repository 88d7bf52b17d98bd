//! Getting and setting variables: every request is checked completely before anything is read or written.

use tiprub_cosim::variables::{Causality, DataType, Variability, Variable};
use tiprub_cosim::{CoSimulation, Diagnostic, Value};

use super::{Dialect, InstancePhase, Refusal, Result, Slave};

/// A get or set call of the importer.
#[derive(Debug, Clone, Copy)]
pub(crate) struct AccessRequest<'a> {
    /// Type in the function's name: `Real`, `Float64`, ...
    pub type_name: &'static str,
    /// Value references.
    pub references: &'a [u32],
    /// Number of values in the importer's array.
    pub values: usize,
}

/// A value of one of the types that the C functions transfer.
pub(crate) trait FmiValue: Sized {
    /// Returns the value of the independent variable, if this is its type.
    fn of_time(time: f64) -> Option<Self>;

    /// Reads one element.
    fn get(unit: &dyn CoSimulation, reference: u32) -> tiprub_cosim::Result<Self>;

    /// Returns the value for setting.
    fn value(&self) -> Value<'_>;
}

/// Implements [`FmiValue`] for a type. The arguments are the type, the getter of a unit with the conversion of its
/// result, the value for setting, and the value of the independent variable.
macro_rules! fmi_values {
    ($($rust:ty: $get:ident $from:expr, |$own:ident| $value:expr, |$time:ident| $of_time:expr;)*) => {$(
        impl FmiValue for $rust {
            fn of_time($time: f64) -> Option<Self> {
                $of_time
            }

            fn get(unit: &dyn CoSimulation, reference: u32) -> tiprub_cosim::Result<Self> {
                unit.$get(reference).map($from)
            }

            fn value(&self) -> Value<'_> {
                let $own = self;
                $value
            }
        }
    )*};
}

// FMI 3.0 transfers integers and enumerations as 64-bit integers.
fmi_values! {
    f64: real Self::from, |own| Value::Real(*own), |time| Some(time);
    i32: integer Self::from, |own| Value::Integer((*own).into()), |_time| None;
    i64: integer Self::from, |own| Value::Integer(*own), |_time| None;
    bool: boolean Self::from, |own| Value::Boolean(*own), |_time| None;
    String: string Self::from, |own| Value::String(own), |_time| None;
}

/// Returns the name of a variable's type in the function names of the standard.
fn type_name(dialect: Dialect, kind: DataType) -> &'static str {
    match (dialect, kind) {
        (Dialect::Fmi2, DataType::Real) => "Real",
        (Dialect::Fmi2, DataType::Integer | DataType::Enumeration(_)) => "Integer",
        (Dialect::Fmi3, DataType::Real) => "Float64",
        (Dialect::Fmi3, DataType::Integer | DataType::Enumeration(_)) => "Int64",
        (_, DataType::Boolean) => "Boolean",
        (_, DataType::String) => "String",
    }
}

impl Slave {
    /// Returns the maximum number of value references in a call. A larger count can only be a mistake, and following it
    /// would read beyond the importer's array; repeated references are legal, hence the margin.
    pub(crate) fn reference_limit(&self) -> usize {
        16 * self.unit.table().references() + 1024
    }

    /// Returns the value references of the single elements of a request.
    ///
    /// # Errors
    /// Unknown reference, variable of another type, reference into the middle of an array, wrong number of values.
    pub(crate) fn elements(&self, request: &AccessRequest<'_>) -> Result<Vec<u32>> {
        let mut elements = Vec::with_capacity(request.references.len());
        for &reference in request.references {
            let (variable, index) = self.unit.table().locate(reference)?;
            let expected = type_name(self.dialect, variable.kind);
            if expected != request.type_name {
                return Err(Refusal::error(format!(
                    "{} (value reference {reference}) is of type {expected}, not {}. Call the function for that type",
                    variable.element_name(index),
                    request.type_name
                )));
            }
            if !self.arrays {
                elements.push(reference);
            } else if index == 0 {
                elements.extend((reference..).take(variable.len()));
            } else {
                return Err(Refusal::error(format!(
                    "value reference {reference} lies inside the array {}. Use {}, which refers to all {} elements",
                    variable.name,
                    variable.reference,
                    variable.len()
                )));
            }
        }
        if elements.len() == request.values {
            return Ok(elements);
        }
        Err(Refusal::error(format!(
            "nValues = {}, but the {} value references cover {} values. Pass exactly one value per array element",
            request.values,
            request.references.len(),
            elements.len()
        )))
    }

    /// Reads values.
    ///
    /// # Errors
    /// Same as [`Slave::elements`]; a value that does not exist yet; an initial state that cannot be computed.
    pub(crate) fn read<T: FmiValue>(&mut self, request: &AccessRequest<'_>) -> Result<Vec<T>> {
        let elements = self.elements(request)?;
        if matches!(self.phase, InstancePhase::Instantiated { .. }) {
            self.require_start_values(&elements)?;
        } else if elements.iter().any(|&element| self.is_computed(element)) {
            self.refresh()?;
        }
        elements.iter().map(|&element| self.value(element)).collect()
    }

    /// Returns one value; the time is that of the instance in every phase.
    fn value<T: FmiValue>(&self, element: u32) -> Result<T> {
        let (variable, _) = self.unit.table().locate(element)?;
        let time = (variable.causality == Causality::Independent).then(|| T::of_time(self.time())).flatten();
        time.map_or_else(|| Ok(T::get(&*self.unit, element)?), Ok)
    }

    fn is_computed(&self, element: u32) -> bool {
        self.unit.table().locate(element).is_ok_and(|(variable, _)| variable.start.is_none())
    }

    fn require_start_values(&self, elements: &[u32]) -> Result<()> {
        for &element in elements {
            let (variable, index) = self.unit.table().locate(element)?;
            if variable.start.is_none() {
                return Err(Refusal::error(format!(
                    "{} (value reference {element}) is computed and has no value before initialisation. Enter \
                     Initialization Mode first",
                    variable.element_name(index)
                )));
            }
        }
        Ok(())
    }

    /// Sets either all values or none.
    ///
    /// # Errors
    /// Same as [`Slave::elements`]; a variable that cannot be set now; a value out of range.
    pub(crate) fn write<T: FmiValue>(&mut self, elements: &[u32], values: &[T]) -> Result<()> {
        for (&element, value) in elements.iter().zip(values) {
            let (variable, index) = self.unit.table().locate(element)?;
            self.check_settable(variable, index, value.value()).map_err(|problem| problem.at(place(element)))?;
        }
        if elements.is_empty() {
            return Ok(());
        }
        self.invalidate()?;
        self.apply(elements, values)
    }

    /// Sets the values in the unit; if the unit rejects one, the previous ones are restored.
    fn apply<T: FmiValue>(&mut self, elements: &[u32], values: &[T]) -> Result<()> {
        let (courses, mut former) = (self.unit.courses(), Vec::<(u32, T)>::with_capacity(elements.len()));
        for (&element, value) in elements.iter().zip(values) {
            let before = T::get(&*self.unit, element)?;
            if let Err(error) = self.unit.set(element, value.value()) {
                for (element, before) in former.into_iter().rev() {
                    self.unit.set(element, before.value())?;
                }
                // Restores derivatives and ramps in progress, which end when a value is set.
                self.unit.restore_courses(&courses);
                return Err(error.into());
            }
            former.push((element, before));
        }
        self.collect_notes();
        Ok(())
    }

    /// Checks that an element can be set to a value in the present phase.
    fn check_settable(&self, variable: &Variable, index: usize, value: Value) -> Result<(), Diagnostic> {
        let initialised = matches!(self.phase, InstancePhase::Stepping { .. } | InstancePhase::Updating { .. });
        variable.check(index, value, initialised)?;
        let continuous = variable.causality == Causality::Input && variable.variability == Variability::Continuous;
        if continuous || !matches!(self.phase, InstancePhase::Updating { .. }) {
            return Ok(());
        }
        let what = format!("variable `{}`", variable.element_name(index));
        Err(Diagnostic::new(what, "it is not a continuous input", "Set it at a communication point"))
    }

    /// Sets the first time derivatives of continuous real inputs, either all or none.
    ///
    /// # Errors
    /// Unknown reference, variable that is not a continuous input, order other than 1, value that is not finite.
    pub(crate) fn set_input_derivatives(&mut self, references: &[u32], orders: &[i32], values: &[f64]) -> Result<()> {
        for ((&reference, &order), value) in references.iter().zip(orders).zip(values) {
            let checked = self.unit.check_input_derivative(reference, order, *value);
            checked.map_err(|error| error.into_diagnostic().at(place(reference)))?;
        }
        self.invalidate()?;
        let courses = self.unit.courses();
        for ((&reference, &order), &value) in references.iter().zip(orders).zip(values) {
            if let Err(error) = self.unit.set_input_derivative(reference, order, value) {
                self.unit.restore_courses(&courses);
                return Err(error.into());
            }
        }
        Ok(())
    }

    /// Returns one order per element, from one order per value reference.
    pub(crate) fn orders_of_elements(&self, references: &[u32], orders: &[i32]) -> Vec<i32> {
        let table = self.unit.table();
        let count = |reference: u32| match table.locate(reference) {
            Ok((variable, _)) if self.arrays => variable.len(),
            _ => 1,
        };
        references
            .iter()
            .zip(orders)
            .flat_map(|(&reference, &order)| std::iter::repeat_n(order, count(reference)))
            .collect()
    }

    /// Returns the first time derivatives of continuous real outputs at the last communication point.
    ///
    /// # Errors
    /// Unknown reference, variable that is not a continuous output, order other than 1.
    pub(crate) fn output_derivatives(&self, elements: &[u32], orders: &[i32]) -> Result<Vec<f64>> {
        let derivative = |(&element, &order): (&u32, &i32)| {
            let (variable, index) = self.unit.table().locate(element)?;
            let checked = variable.check_derivative(index, Causality::Output, order);
            checked.map_err(|problem| problem.at(place(element)))?;
            Ok(self.unit.output_derivative(element, order)?)
        };
        elements.iter().zip(orders).map(derivative).collect()
    }
}

/// Names the value reference in messages about a variable.
fn place(reference: u32) -> String {
    format!("value reference {reference}")
}
