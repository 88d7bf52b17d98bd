//! Reading and setting variables: every request is checked in full before anything is read or written.

use tiprub_core::variables::{Causality, DataType, Variability, Variable};
use tiprub_core::{Error, shown};

use super::{Dialect, InstancePhase, Refusal, Result, Slave};
use crate::unit::CoSimulationUnit;

/// A get or set call as the importer made it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct AccessRequest<'a> {
    /// Type in the function's name: `Real`, `Float64`, ...
    pub type_name: &'static str,
    /// Value references.
    pub references: &'a [u32],
    /// Number of values the importer's array holds.
    pub values: usize,
}

/// A value of one of the types that variables have.
pub(crate) trait Value: Sized {
    /// Say what is wrong with the value for this variable, if anything.
    fn problem(&self, _variable: &Variable) -> Option<String> {
        None
    }

    /// The value of the independent variable, for the type that it has.
    fn of_time(_time: f64) -> Option<Self> {
        None
    }

    /// Read one element.
    fn get(unit: &dyn CoSimulationUnit, reference: u32) -> tiprub_core::Result<Self>;

    /// Set one element.
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

/// Integers and enumerations of FMI 3.0 travel as 64-bit integers.
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

/// Name of a variable's type in the standard's function names.
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
    /// Most value references a single call may bring. More than this can only be a mistaken count, and following it would
    /// read beyond the importer's array; repeating references is legal, hence the margin.
    pub(crate) fn reference_limit(&self) -> usize {
        16 * self.unit.table().references() + 1024
    }

    /// Value references of the single elements a request stands for.
    ///
    /// # Errors
    /// Unknown reference, another type, reference into the middle of an array, wrong number of values.
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

    /// Read values.
    ///
    /// # Errors
    /// As [`Slave::elements`]; a value that does not exist yet; an initial state that cannot be computed.
    pub(crate) fn read<T: Value>(&mut self, request: &AccessRequest<'_>) -> Result<Vec<T>> {
        let elements = self.elements(request)?;
        if matches!(self.phase, InstancePhase::Instantiated { .. }) {
            self.require_start_values(&elements)?;
        } else if elements.iter().any(|&element| self.is_computed(element)) {
            self.refresh()?;
        }
        elements.iter().map(|&element| self.value(element)).collect()
    }

    /// One value; time is the instance's own in every phase.
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

    /// Set values: all of them, or none.
    ///
    /// # Errors
    /// As [`Slave::elements`]; a variable that cannot be set now; a value out of range.
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

    /// The core has the last word; what was written before its refusal is taken back.
    fn apply<T: Value>(&mut self, elements: &[u32], values: &[T]) -> Result<()> {
        let (courses, mut former) = (self.unit.courses(), Vec::with_capacity(elements.len()));
        for (&element, value) in elements.iter().zip(values) {
            let before = T::get(&*self.unit, element)?;
            if let Err(error) = value.set(&mut *self.unit, element) {
                for (element, before) in former.into_iter().rev() {
                    T::set(&before, &mut *self.unit, element)?;
                }
                // Derivatives and ramps under way, which setting a value ends.
                self.unit.restore_courses(courses);
                return Err(error.into());
            }
            former.push((element, before));
        }
        self.collect_notes();
        Ok(())
    }

    /// Why a variable cannot be set in the present phase, if it cannot.
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

    /// First time derivatives of continuous real inputs: all of them, or none.
    ///
    /// # Errors
    /// Unknown reference, not a continuous input, order other than 1, non-finite value.
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

    /// One order per element, of one order per value reference.
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

    /// First time derivatives of continuous real outputs at the last communication point.
    ///
    /// # Errors
    /// Unknown reference, not a continuous output, order other than 1.
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
