//! Getting and setting variables: every request is checked completely before anything is read or written.

use tiprub_core::variables::{Causality, DataType, Variability, Variable};
use tiprub_core::{Error, shown};

use super::{Dialect, InstancePhase, Refusal, Result, Slave};
use crate::unit::CoSimulationUnit;

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

/// A value of one of the types that variables have.
pub(crate) trait Value: Sized {
    /// Returns the problem with the value for this variable, if there is one.
    fn problem(&self, _variable: &Variable) -> Option<String> {
        None
    }

    /// Returns the value of the independent variable, if this is its type.
    fn of_time(_time: f64) -> Option<Self> {
        None
    }

    /// Reads one element.
    fn get(unit: &dyn CoSimulationUnit, reference: u32) -> tiprub_core::Result<Self>;

    /// Sets one element.
    fn set(&self, unit: &mut dyn CoSimulationUnit, reference: u32) -> tiprub_core::Result<()>;
}

impl Value for f64 {
    fn problem(&self, variable: &Variable) -> Option<String> {
        let unit = variable.unit.map_or(String::new(), |unit| format!(" {}", unit.name));
        let (min, max) = (variable.min.unwrap_or(f64::NEG_INFINITY), variable.max.unwrap_or(f64::INFINITY));
        if !self.is_finite() {
            Some(format!("{self} is not finite. Set a finite number"))
        } else if *self < min || *self > max {
            Some(format!(
                "{}{unit} is outside the range {} to {}{unit}. Set a value within this range",
                shown(*self),
                shown(min),
                shown(max)
            ))
        } else {
            None
        }
    }

    fn of_time(time: f64) -> Option<Self> {
        Some(time)
    }

    fn get(unit: &dyn CoSimulationUnit, reference: u32) -> tiprub_core::Result<Self> {
        unit.real(reference)
    }

    fn set(&self, unit: &mut dyn CoSimulationUnit, reference: u32) -> tiprub_core::Result<()> {
        unit.set_real(reference, *self)
    }
}

impl Value for i32 {
    fn problem(&self, variable: &Variable) -> Option<String> {
        i64::from(*self).problem(variable)
    }

    fn get(unit: &dyn CoSimulationUnit, reference: u32) -> tiprub_core::Result<Self> {
        unit.integer(reference)
    }

    fn set(&self, unit: &mut dyn CoSimulationUnit, reference: u32) -> tiprub_core::Result<()> {
        unit.set_integer(reference, *self)
    }
}

/// FMI 3.0 transfers integers and enumerations as 64-bit integers.
impl Value for i64 {
    fn problem(&self, variable: &Variable) -> Option<String> {
        let DataType::Enumeration(enumeration) = variable.kind else { return None };
        let item = usize::try_from(*self).ok().filter(|item| (1..=enumeration.items.len()).contains(item));
        item.is_none().then(|| {
            let items =
                enumeration.items.iter().enumerate().map(|(index, (name, _))| format!("{} = {name}", index + 1));
            format!("{self} is not an item of {}. Items: {}", enumeration.name, items.collect::<Vec<_>>().join(", "))
        })
    }

    fn get(unit: &dyn CoSimulationUnit, reference: u32) -> tiprub_core::Result<Self> {
        unit.integer(reference).map(Self::from)
    }

    fn set(&self, unit: &mut dyn CoSimulationUnit, reference: u32) -> tiprub_core::Result<()> {
        let value = i32::try_from(*self).map_err(|_| {
            Error::invalid(
                format!("value reference {reference}"),
                format!("{self} is too large"),
                "Set a 32-bit integer",
            )
        })?;
        unit.set_integer(reference, value)
    }
}

impl Value for bool {
    fn get(unit: &dyn CoSimulationUnit, reference: u32) -> tiprub_core::Result<Self> {
        unit.boolean(reference)
    }

    fn set(&self, unit: &mut dyn CoSimulationUnit, reference: u32) -> tiprub_core::Result<()> {
        unit.set_boolean(reference, *self)
    }
}

impl Value for String {
    fn get(unit: &dyn CoSimulationUnit, reference: u32) -> tiprub_core::Result<Self> {
        unit.string(reference).map(Self::from)
    }

    fn set(&self, unit: &mut dyn CoSimulationUnit, reference: u32) -> tiprub_core::Result<()> {
        unit.set_string(reference, self)
    }
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
    pub(crate) fn read<T: Value>(&mut self, request: &AccessRequest<'_>) -> Result<Vec<T>> {
        let elements = self.elements(request)?;
        if matches!(self.phase, InstancePhase::Instantiated { .. }) {
            self.require_start_values(&elements)?;
        } else if elements.iter().any(|&element| self.is_computed(element)) {
            self.refresh()?;
        }
        elements.iter().map(|&element| self.value(element)).collect()
    }

    /// Returns one value; the time is that of the instance in every phase.
    fn value<T: Value>(&self, element: u32) -> Result<T> {
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
    pub(crate) fn write<T: Value>(&mut self, elements: &[u32], values: &[T]) -> Result<()> {
        for (&element, value) in elements.iter().zip(values) {
            let (variable, index) = self.unit.table().locate(element)?;
            let problem = self.not_settable(variable).or_else(|| value.problem(variable));
            if let Some(problem) = problem {
                let name = variable.element_name(index);
                return Err(Refusal::error(format!("{name} (value reference {element}): {problem}")));
            }
        }
        if elements.is_empty() {
            return Ok(());
        }
        self.invalidate()?;
        self.apply(elements, values)
    }

    /// Sets the values in the unit; if the unit rejects one, the previous ones are restored.
    fn apply<T: Value>(&mut self, elements: &[u32], values: &[T]) -> Result<()> {
        let (courses, mut former) = (self.unit.courses(), Vec::with_capacity(elements.len()));
        for (&element, value) in elements.iter().zip(values) {
            let before = T::get(&*self.unit, element)?;
            if let Err(error) = value.set(&mut *self.unit, element) {
                for (element, before) in former.into_iter().rev() {
                    T::set(&before, &mut *self.unit, element)?;
                }
                // Restores derivatives and ramps in progress, which end when a value is set.
                self.unit.restore_courses(courses);
                return Err(error.into());
            }
            former.push((element, before));
        }
        self.collect_notes();
        Ok(())
    }

    /// Returns the reason why a variable cannot be set in the present phase, if it cannot.
    fn not_settable(&self, variable: &Variable) -> Option<String> {
        if !variable.is_settable() || variable.variability == Variability::Constant {
            return Some("is computed by the FMU and cannot be set. Set inputs and parameters only".into());
        }
        let input = variable.causality == Causality::Input;
        match self.phase {
            InstancePhase::Stepping { .. } if !input && variable.variability != Variability::Tunable => Some(
                "is a fixed parameter and cannot be set after initialisation. Set it earlier, or reset the instance"
                    .into(),
            ),
            InstancePhase::Updating { .. } if !input || variable.variability != Variability::Continuous => {
                Some("is not a continuous input. Set it at a communication point".into())
            }
            _ => None,
        }
    }

    /// Sets the first time derivatives of continuous real inputs, either all or none.
    ///
    /// # Errors
    /// Unknown reference, variable that is not a continuous input, order other than 1, value that is not finite.
    pub(crate) fn set_input_derivatives(&mut self, references: &[u32], orders: &[i32], values: &[f64]) -> Result<()> {
        for ((&reference, &order), value) in references.iter().zip(orders).zip(values) {
            let what = self.check_derivative(reference, order, Causality::Input)?;
            if !value.is_finite() {
                return Err(Refusal::error(format!(
                    "derivative of {what}: {value} is not finite. Set a finite number"
                )));
            }
        }
        self.invalidate()?;
        let courses = self.unit.courses();
        for ((&reference, &order), &value) in references.iter().zip(orders).zip(values) {
            if let Err(error) = self.unit.set_input_derivative(reference, order, value) {
                self.unit.restore_courses(courses);
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
            self.check_derivative(element, order, Causality::Output)?;
            Ok(self.unit.output_derivative(element, order)?)
        };
        elements.iter().zip(orders).map(derivative).collect()
    }

    fn check_derivative(&self, reference: u32, order: i32, causality: Causality) -> Result<String> {
        let (variable, index) = self.unit.table().locate(reference)?;
        let what = format!("{} (value reference {reference})", variable.element_name(index));
        let continuous = variable.kind == DataType::Real && variable.variability == Variability::Continuous;
        if variable.causality != causality || !continuous {
            let wanted = if causality == Causality::Input { "input" } else { "output" };
            return Err(Refusal::error(format!(
                "{what} is not a continuous {wanted} of real type. Remove it from the request"
            )));
        }
        if order != 1 {
            return Err(Refusal::error(format!(
                "{what}: derivatives of order {order} are not supported. Pass order 1"
            )));
        }
        Ok(what)
    }
}
