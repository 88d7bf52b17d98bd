//! The one variable table: XML, HTML, value references, get and set are all derived from it.
//!
//! A variable is a scalar or a one-dimensional array. Value references are consecutive: element `i` (0-based) of
//! a variable has reference `variable.reference + i`. FMI 2.0 sees every element as a scalar named
//! `name[i+1]`; FMI 3.0 sees the array under its first reference (or the scalars, when packaged so).

use crate::{Error, Result};

/// Role of a variable, as in the FMI standards.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Causality {
    /// The independent variable, time.
    Independent,
    /// Set by the importer during the simulation.
    Input,
    /// Set by the importer before the simulation (and during it when tunable).
    Parameter,
    /// Computed.
    Output,
    /// Computed or constant, not meant for connections.
    Local,
}

/// When a variable may change, as in the FMI standards.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Variability {
    /// Never.
    Constant,
    /// Not after initialisation.
    Fixed,
    /// Between communication steps.
    Tunable,
    /// At communication points only.
    Discrete,
    /// Continuously.
    Continuous,
}

/// Data type of a variable.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// f64.
    Real,
    /// i32.
    Integer,
    /// bool.
    Boolean,
    /// Text.
    String,
    /// One item of an enumeration, as i32 starting at 1.
    Enumeration(&'static Enumeration),
}

/// An enumeration type definition.
#[derive(Debug, PartialEq, Eq)]
pub struct Enumeration {
    /// Type name.
    pub name: &'static str,
    /// What it selects.
    pub description: &'static str,
    /// (item name, description); the value of an item is its index + 1.
    pub items: &'static [(&'static str, &'static str)],
}

/// A unit with its SI exponents (kg, m, s, rad) and the display units an importer may offer.
#[derive(Debug, PartialEq)]
pub struct Unit {
    /// Unit name.
    pub name: &'static str,
    /// Exponents of kg, m, s, rad.
    pub exponents: [i32; 4],
    /// (name, factor): display value = factor · SI value.
    pub display: &'static [(&'static str, f64)],
}

/// How a value relates to the communication step just finished.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Span {
    /// Value at the communication point.
    Point,
    /// Mean over the communication step (impulse / H).
    Mean,
    /// Extreme or sum within the communication step.
    Window,
    /// Accumulated since the start.
    Total,
}

/// A start value.
#[derive(Debug, Clone, PartialEq)]
pub enum Start {
    /// Reals, one per element.
    Real(Vec<f64>),
    /// An integer or an enumeration item.
    Integer(i32),
    /// A boolean.
    Boolean(bool),
    /// A text.
    String(String),
}

/// One row of the table.
#[derive(Debug, Clone, PartialEq)]
pub struct Variable {
    /// Structured name, for example `blade[1].clearance`.
    pub name: String,
    /// First value reference.
    pub reference: u32,
    /// `None` for a scalar, number of elements for an array.
    pub dimension: Option<usize>,
    /// Data type.
    pub kind: Kind,
    /// Role.
    pub causality: Causality,
    /// When it may change.
    pub variability: Variability,
    /// Relation to the communication step.
    pub span: Span,
    /// Unit of reals, `None` if dimensionless.
    pub unit: Option<&'static Unit>,
    /// Index into `unit.display` of the display unit, if one is better than SI.
    pub display: Option<usize>,
    /// Smallest legal value, for reals.
    pub min: Option<f64>,
    /// Largest legal value, for reals.
    pub max: Option<f64>,
    /// Typical magnitude, for reals.
    pub nominal: Option<f64>,
    /// Start value; present exactly for inputs, parameters and constants.
    pub start: Option<Start>,
    /// One sentence.
    pub description: String,
    /// What the value stands for inside the simulation.
    pub quantity: Quantity,
}

/// What a variable stands for inside the simulation (the only link between table and state).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    /// Simulated time.
    Time,
}

impl Variable {
    /// Number of elements (1 for a scalar).
    pub fn len(&self) -> usize {
        self.dimension.unwrap_or(1)
    }

    /// A variable always has at least one element.
    pub fn is_empty(&self) -> bool {
        false
    }

    /// Name of element `index` (0-based) as a scalar: `name` for scalars, `name[index+1]` for arrays.
    pub fn element_name(&self, index: usize) -> String {
        match self.dimension {
            None => self.name.clone(),
            Some(_) => format!("{}[{}]", self.name, index + 1),
        }
    }

    /// `Initial` attribute of the standards: true for exact, false for calculated, `None` for inputs and time.
    pub fn initial_is_exact(&self) -> Option<bool> {
        match (self.causality, self.variability) {
            (Causality::Independent | Causality::Input, _) => None,
            (Causality::Parameter, _) | (_, Variability::Constant) => Some(true),
            _ => Some(false),
        }
    }

    /// Whether an importer may set it before initialisation ends.
    pub fn is_settable(&self) -> bool {
        matches!(self.causality, Causality::Input | Causality::Parameter)
    }
}

/// The table: variables in order of their references, which start at 0 (time) without gaps.
#[derive(Debug, Clone, PartialEq)]
pub struct VariableTable {
    variables: Vec<Variable>,
    /// Row of each value reference.
    rows: Vec<u32>,
}

impl VariableTable {
    /// All rows.
    pub fn variables(&self) -> &[Variable] {
        &self.variables
    }

    /// Row and element index of a value reference.
    ///
    /// # Errors
    /// [`Error::UnknownReference`].
    pub fn locate(&self, reference: u32) -> Result<(&Variable, usize)> {
        let row = usize::try_from(reference).ok().and_then(|index| self.rows.get(index));
        let row = *row.ok_or(Error::UnknownReference { reference })? as usize;
        let variable = &self.variables[row];
        Ok((variable, (reference - variable.reference) as usize))
    }

    /// Find a variable by its name (scalar or array name, not an element name).
    pub fn find(&self, name: &str) -> Option<&Variable> {
        self.variables.iter().find(|variable| variable.name == name)
    }
}
