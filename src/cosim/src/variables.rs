//! The variable table, from which XML, HTML, value references, get and set are derived.
//!
//! A variable is a scalar or a one-dimensional array. Value references are consecutive: element `i` (0-based) of a variable has reference
//! `variable.reference + i`. FMI 2.0 sees every element as a scalar named `name[i+1]`; FMI 3.0 sees the array under its first reference (or
//! the scalars, if packaged in this way).

mod quantity;
mod table;

use crate::{Diagnostic, Result, shown};
pub use quantity::Quantity;
pub use table::VariableTable;

/// Value of a clearance output if there is no surface to touch (m): finite, as FMI requires, and larger than any distance in an engine. Its
/// time derivative is then 0.
pub const NO_CLEARANCE: f64 = 1e9;

/// Role of a variable, as in the FMI standards.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Causality {
    /// The independent variable, time.
    Independent,
    /// Set by the importer during the simulation.
    Input,
    /// Set by the importer before the simulation (and during it if tunable).
    Parameter,
    /// Computed output.
    #[default]
    Output,
    /// Computed or constant, not intended for connections.
    Local,
}

/// When a variable may change, as in the FMI standards.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
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
    #[default]
    Continuous,
}

/// Data type of a variable.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum DataType {
    /// f64.
    #[default]
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

impl DataType {
    /// Returns the type that values have: items of enumerations are integers.
    fn of_values(self) -> Self {
        if let Self::Enumeration(_) = self { Self::Integer } else { self }
    }

    fn name(self) -> &'static str {
        match self {
            Self::Real => "real",
            Self::Integer => "integer",
            Self::Boolean => "boolean",
            Self::String => "string",
            Self::Enumeration(_) => "enumeration",
        }
    }
}

/// Value to which a variable is set.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Value<'a> {
    /// A real number.
    Real(f64),
    /// An integer or an item of an enumeration.
    Integer(i64),
    /// A truth value.
    Boolean(bool),
    /// A text.
    String(&'a str),
}

impl Value<'_> {
    fn kind(self) -> DataType {
        match self {
            Self::Real(_) => DataType::Real,
            Self::Integer(_) => DataType::Integer,
            Self::Boolean(_) => DataType::Boolean,
            Self::String(_) => DataType::String,
        }
    }

    /// Returns the number by which the value is stored; texts have none.
    #[expect(clippy::cast_precision_loss, reason = "integers are checked to have 32 bits")]
    pub fn number(self) -> f64 {
        match self {
            Self::Real(value) => value,
            Self::Integer(value) => value as f64,
            Self::Boolean(value) => f64::from(u8::from(value)),
            Self::String(_) => f64::NAN,
        }
    }
}

/// An enumeration type definition.
#[derive(Debug, PartialEq, Eq)]
pub struct Enumeration {
    /// Type name.
    pub name: &'static str,
    /// Meaning of the item.
    pub description: &'static str,
    /// (item name, description); the value of an item is its index + 1.
    pub items: &'static [(&'static str, &'static str)],
}

/// A unit with its SI exponents (kg, m, s, rad, K) and the display units an importer may offer.
#[derive(Debug, PartialEq)]
pub struct VariableUnit {
    /// Unit name.
    pub name: &'static str,
    /// Name of the quantity among Modelica's SI units.
    pub quantity: &'static str,
    /// Exponents of kg, m, s, rad, K.
    pub exponents: [i32; 5],
    /// (name, factor): display value = factor · SI value.
    pub display: &'static [(&'static str, f64)],
}

/// Defines units: name of the constant, name of the unit, quantity, exponents of kg, m, s, rad, K, and display units.
#[macro_export]
macro_rules! units {
    ($($constant:ident $name:literal $quantity:literal [$($exponents:literal),*] [$($display:expr),*];)*) => {$(
        #[doc = $name]
        pub(crate) static $constant: $crate::variables::VariableUnit = $crate::variables::VariableUnit {
            name: $name,
            quantity: $quantity,
            exponents: [$($exponents),*],
            display: &[$($display),*],
        };
    )*};
}

/// Relation of a value to the last communication step.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Span {
    /// Value at the communication point.
    #[default]
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
pub enum StartValue {
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
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Variable {
    /// Structured name, for example `blade[1].clearance`.
    pub name: String,
    /// First value reference; [`VariableTable::new`] assigns it.
    pub reference: u32,
    /// `None` for a scalar, number of elements for an array.
    pub dimension: Option<usize>,
    /// Data type.
    pub kind: DataType,
    /// Role.
    pub causality: Causality,
    /// Variability.
    pub variability: Variability,
    /// Relation to the communication step.
    pub span: Span,
    /// Unit of reals, `None` if dimensionless.
    pub unit: Option<&'static VariableUnit>,
    /// Index into `unit.display` of the display unit, if one is better than SI.
    pub display: Option<usize>,
    /// Smallest legal value, for reals.
    pub min: Option<f64>,
    /// Largest legal value, for reals.
    pub max: Option<f64>,
    /// Typical magnitude, for reals.
    pub nominal: Option<f64>,
    /// Start value; present exactly for inputs, parameters and constants.
    pub start: Option<StartValue>,
    /// Description in one sentence.
    pub description: String,
    /// Quantity inside the simulation.
    pub quantity: Quantity,
    /// Index of the master, contact pair or surface carrier to which it belongs, each counted from 0 in the order of the scene; 0 if it
    /// belongs to none.
    pub of: usize,
}

/// Defines methods that set fields of a row and return it.
macro_rules! setters {
    ($($(#[$doc:meta])* $name:ident($($argument:ident: $type:ty),*) { $($field:ident = $value:expr),+ })*) => {
        impl Variable {$(
            $(#[$doc])*
            pub fn $name(&mut self, $($argument: $type),*) -> &mut Self {
                $(self.$field = $value;)+
                self
            }
        )*}
    };
}

setters! {
    /// Sets the typical magnitude.
    nominal(value: f64) { nominal = Some(value) }
    /// Sets the index of the display unit.
    display(index: usize) { display = Some(index) }
    /// Sets the smallest and the largest value.
    range(low: f64, high: f64) { min = Some(low), max = Some(high) }
    /// Makes it an array.
    elements(count: usize) { dimension = Some(count) }
    /// Makes it an array with start values.
    starts(values: Vec<f64>) { dimension = Some(values.len()), start = Some(StartValue::Real(values)) }
    /// Sets type and start value.
    kind(kind: DataType, start: StartValue) { kind = kind, start = Some(start) }
    /// Makes a continuous real variable an input with a start value.
    input(value: f64) { causality = Causality::Input, start = Some(StartValue::Real(vec![value])) }
    /// Makes the variable a fixed parameter whose value is an item of an enumeration.
    choice(choices: &'static Enumeration, value: i32) {
        kind = DataType::Enumeration(choices), start = Some(StartValue::Integer(value)),
        causality = Causality::Parameter, variability = Variability::Fixed
    }
    /// Makes the variable a constant.
    constant(kind: DataType, value: StartValue) {
        kind = kind, start = Some(value), causality = Causality::Local, variability = Variability::Constant
    }
    /// Sets the relation to the communication step.
    span(span: Span) { span = span }
    /// Sets role and variability.
    role(causality: Causality, variability: Variability) { causality = causality, variability = variability }
    /// Sets the quantity.
    quantity(quantity: Quantity) { quantity = quantity }
}

impl Variable {
    /// Creates the row of a continuous real output.
    pub fn output(name: String, description: String) -> Self {
        Self { name, description, ..Self::default() }
    }

    /// Number of elements (1 for a scalar).
    pub fn len(&self) -> usize {
        self.dimension.unwrap_or(1)
    }

    /// Returns false: a variable always has at least one element.
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

    /// Returns the `initial` attribute of the standards: true for exact, false for calculated, `None` for inputs and time.
    pub fn initial_is_exact(&self) -> Option<bool> {
        match (self.causality, self.variability) {
            (Causality::Independent | Causality::Input, _) => None,
            (Causality::Parameter, _) | (_, Variability::Constant) => Some(true),
            _ => Some(false),
        }
    }

    /// Returns whether an importer may set it before initialisation ends.
    pub fn is_settable(&self) -> bool {
        matches!(self.causality, Causality::Input | Causality::Parameter) && self.variability != Variability::Constant
    }

    /// Returns the subject of messages about an element.
    fn subject(&self, element: usize) -> String {
        format!("variable `{}`", self.element_name(element))
    }

    /// Checks the type of a variable; items of enumerations are integers.
    pub(crate) fn check_type(&self, element: usize, wanted: DataType) -> Result<(), Diagnostic> {
        if self.kind.of_values() == wanted {
            return Ok(());
        }
        let problem = format!("its type is {}, not {}", self.kind.name(), wanted.name());
        let remedy = "Call the function for the variable's type in modelDescription.xml";
        Err(Diagnostic::new(self.subject(element), problem, remedy))
    }

    /// Checks that an element may be set to a value now.
    ///
    /// # Errors
    /// A value of another type or out of range, a variable that is computed, or a fixed parameter after initialisation.
    pub fn check(&self, element: usize, value: Value, initialised: bool) -> Result<(), Diagnostic> {
        self.check_type(element, value.kind())?;
        if !self.is_settable() {
            let remedy = "Set inputs and parameters only";
            return Err(Diagnostic::new(self.subject(element), "it is computed and cannot be set", remedy));
        }
        if initialised && self.causality == Causality::Parameter && self.variability == Variability::Fixed {
            let problem = "a fixed parameter cannot be set after initialisation";
            let remedy = "Set it before initialisation ends, or reset the instance first";
            return Err(Diagnostic::new(self.subject(element), problem, remedy));
        }
        self.check_range(element, value)
    }

    /// Checks that a value is finite, in the range of the variable, or one of its items.
    fn check_range(&self, element: usize, value: Value) -> Result<(), Diagnostic> {
        let (low, high) = (self.min.unwrap_or(f64::MIN), self.max.unwrap_or(f64::MAX));
        let number = value.number();
        let (problem, remedy) = match (value, self.kind) {
            (Value::Integer(value), DataType::Enumeration(choices)) => {
                if usize::try_from(value).is_ok_and(|item| (1..=choices.items.len()).contains(&item)) {
                    return Ok(());
                }
                let items =
                    choices.items.iter().enumerate().map(|(index, (name, _))| format!("{} = {name}", index + 1));
                let remedy = format!("Use one of: {}", items.collect::<Vec<_>>().join(", "));
                (format!("{value} is not an item of {}", choices.name), remedy)
            }
            (Value::Integer(value), _) if i32::try_from(value).is_err() => {
                (format!("{value} is too large"), "Set a 32-bit integer".into())
            }
            (Value::Boolean(_), _) => return Ok(()),
            (Value::String(_), _) => ("string variables cannot be set".into(), "Remove the call".into()),
            _ if (low..=high).contains(&number) => return Ok(()),
            _ if !number.is_finite() => (format!("{number} is not finite"), "Set a finite number".into()),
            _ => {
                let unit = self.unit.map_or(String::new(), |unit| format!(" {}", unit.name));
                let range = format!("{} to {}{unit}", shown(low), shown(high));
                let problem = format!("{}{unit} is outside the range {range}", shown(number));
                (problem, "Set a value within this range".into())
            }
        };
        Err(Diagnostic::new(self.subject(element), problem, remedy))
    }

    /// Checks that a derivative of an input or output may be set or requested.
    ///
    /// # Errors
    /// A variable of another role or type, or one that is not continuous; an order other than 1.
    pub fn check_derivative(&self, element: usize, causality: Causality, order: i32) -> Result<(), Diagnostic> {
        let what = || format!("derivative of `{}`", self.element_name(element));
        let continuous = self.kind == DataType::Real && self.variability == Variability::Continuous;
        if self.causality != causality || !continuous {
            let role = if causality == Causality::Input { "input" } else { "output" };
            let problem = format!("the variable is not a continuous real {role}");
            return Err(Diagnostic::new(what(), problem, "Remove it from the request"));
        }
        if order != 1 {
            let remedy = "Use order 1, because inputs are linear in time";
            return Err(Diagnostic::new(what(), format!("order {order} is not supported"), remedy));
        }
        Ok(())
    }

    /// Returns whether a saved state can contain the value. The range of inputs is that of their current values, not of the set ones.
    pub(crate) fn can_have(&self, value: f64) -> bool {
        let in_range = |value| !self.is_settable() || self.check_range(0, value).is_ok();
        #[expect(clippy::cast_possible_truncation, reason = "compared with the value")]
        let integer = Some(value as i32).filter(|number| (f64::from(*number) - value).abs() == 0.0);
        match self.kind {
            DataType::Real if self.causality == Causality::Input => value.is_finite(),
            DataType::Real => value.is_finite() && in_range(Value::Real(value)),
            DataType::Boolean => matches!(integer, Some(0 | 1)),
            DataType::Integer | DataType::Enumeration(_) => {
                integer.is_some_and(|number| in_range(Value::Integer(number.into())))
            }
            DataType::String => true,
        }
    }
}
