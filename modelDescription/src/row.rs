//! Rows of the variable table in a model description: arrays as one row or as their elements.

use tiprub_core::VariableTable;
use tiprub_cosim::variables::{Causality, DataType, Span, StartValue, Variability, Variable};

use crate::text::number;

/// Unit of dimensionless reals.
pub(crate) const ONE: &str = "1";

/// Variable of the description: a scalar, an element of an array, or a whole array.
pub(crate) struct DescribedVariable<'a> {
    pub name: String,
    pub reference: u32,
    /// Number of elements for a whole array.
    pub dimension: Option<usize>,
    /// Start value in the form of an attribute (arrays: separated by spaces); strings are separate, see `start_text`.
    pub start: Option<String>,
    /// Position in the description, from 1, as in FMI 2.0.
    pub index: usize,
    pub variable: &'a Variable,
}

/// Returns every variable in order of value references; `arrays` keeps arrays whole.
pub(crate) fn rows(table: &VariableTable, arrays: bool) -> Vec<DescribedVariable<'_>> {
    let mut rows = Vec::new();
    for variable in table.variables() {
        let elements = if arrays { 1 } else { variable.len() };
        for (element, reference) in (0..elements).zip(variable.reference..) {
            let whole = arrays && variable.dimension.is_some();
            rows.push(DescribedVariable {
                name: if whole { variable.name.clone() } else { variable.element_name(element) },
                reference,
                dimension: variable.dimension.filter(|_| whole),
                start: start(variable, if whole { 0..variable.len() } else { element..element + 1 }),
                index: rows.len() + 1,
                variable,
            });
        }
    }
    rows
}

/// Returns the scalars without time: in FMI 2.0 the independent variable is optional, and old versions of FMI Library report errors for it.
pub(crate) fn rows_without_time(table: &VariableTable) -> Vec<DescribedVariable<'_>> {
    let mut rows = rows(table, false);
    rows.retain(|row| row.variable.causality != Causality::Independent);
    for (index, row) in rows.iter_mut().enumerate() {
        row.index = index + 1;
    }
    rows
}

fn start(variable: &Variable, elements: std::ops::Range<usize>) -> Option<String> {
    let repeated = |text: String| vec![text; elements.len()].join(" ");
    Some(match variable.start.as_ref()? {
        StartValue::Real(values) => values[elements].iter().map(|value| number(*value)).collect::<Vec<_>>().join(" "),
        StartValue::Integer(value) => repeated(value.to_string()),
        StartValue::Boolean(value) => repeated(value.to_string()),
        StartValue::String(text) => text.clone(),
    })
}

impl DescribedVariable<'_> {
    /// Returns whether the variable belongs to the outputs of the model structure.
    pub(crate) fn is_output(&self) -> bool {
        self.variable.causality == Causality::Output
    }

    /// Returns whether the variable belongs to the initial unknowns: outputs that are computed during initialisation.
    pub(crate) fn is_initial_unknown(&self) -> bool {
        self.is_output() && self.variable.initial_is_exact() == Some(false)
    }

    /// Returns the attribute `dependencies` of an output: none. Outputs are computed by `doStep` and remain constant until the next one, independent
    /// of inputs set in between, so that importers find no algebraic loop through this FMU.
    pub(crate) fn output_dependencies(&self) -> &'static str {
        ""
    }

    /// Returns the attribute `dependencies` of an initial unknown: none for means and totals, which are zero at the start; `None` for all others,
    /// because an absent attribute means that they may depend on every input and parameter.
    pub(crate) fn initial_dependencies(&self) -> Option<&'static str> {
        matches!(self.variable.span, Span::Mean | Span::Total).then_some("")
    }

    /// Returns the attribute `initial`, which is absent for inputs and time.
    pub(crate) fn initial(&self) -> Option<&'static str> {
        self.variable.initial_is_exact().map(|exact| if exact { "exact" } else { "calculated" })
    }

    /// Returns the name of the unit: "1" for dimensionless reals (as FMI 3.0 proposes), `None` for other types.
    pub(crate) fn unit(&self) -> Option<&'static str> {
        let real = self.variable.kind == DataType::Real;
        real.then(|| self.variable.unit.map_or(ONE, |unit| unit.name))
    }

    /// Returns the quantity that the unit measures.
    pub(crate) fn quantity(&self) -> Option<&'static str> {
        self.variable.unit.map(|unit| unit.quantity)
    }

    /// Returns the bounds in the format of the type.
    pub(crate) fn bounds(&self) -> [Option<String>; 2] {
        [self.variable.min, self.variable.max].map(|bound| {
            bound.map(
                |bound| if self.variable.kind == DataType::Integer { format!("{bound:.0}") } else { number(bound) },
            )
        })
    }

    /// Returns the name of the display unit, if one is better than SI.
    pub(crate) fn display_unit(&self) -> Option<&'static str> {
        let unit = self.variable.unit?;
        self.variable.display.and_then(|index| unit.display.get(index)).map(|(name, _)| *name)
    }

    /// Returns the name of the enumeration of an enumeration variable.
    pub(crate) fn type_name(&self) -> Option<&'static str> {
        match self.variable.kind {
            DataType::Enumeration(enumeration) => Some(enumeration.name),
            _ => None,
        }
    }
}

/// Returns the attribute `causality`.
pub(crate) fn causality(causality: Causality) -> &'static str {
    match causality {
        Causality::Independent => "independent",
        Causality::Input => "input",
        Causality::Parameter => "parameter",
        Causality::Output => "output",
        Causality::Local => "local",
    }
}

/// Returns the attribute `variability`.
pub(crate) fn variability(variability: Variability) -> &'static str {
    match variability {
        Variability::Constant => "constant",
        Variability::Fixed => "fixed",
        Variability::Tunable => "tunable",
        Variability::Discrete => "discrete",
        Variability::Continuous => "continuous",
    }
}

/// Describes a span: (short name, explanation).
pub fn meaning_of_span(span: Span) -> (&'static str, &'static str) {
    match span {
        Span::Point => ("point", "the value at the communication point"),
        Span::Mean => (
            "mean",
            "the average over the last communication step; multiplied by the length of the step, it is exactly the \
             transferred impulse or energy",
        ),
        Span::Window => ("window", "the smallest, largest or accumulated value within the last communication step"),
        Span::Total => ("total", "accumulated since the start of the simulation"),
    }
}
