//! Parts that both versions of the standard describe in the same way.

use tiprub_cosim::variables::{DataType, Enumeration, Variable, VariableUnit};

use crate::Description;
use crate::element::XmlElement;
use crate::row::ONE;
use crate::text::number;

/// Log categories of both versions: (name, description).
pub const LOG_CATEGORIES: [(&str, &str); 5] = [
    ("logStatusWarning", "Results are usable, but there is a warning"),
    ("logStatusDiscard", "A call was rejected and had no effect"),
    ("logStatusError", "A call failed; the instance must be reset or restored"),
    ("logStatusFatal", "The instance can no longer be used"),
    ("logAll", "All messages"),
];

/// Adds the attributes of the root element after those that differ between the versions.
pub(crate) fn root_attributes(element: XmlElement, description: &Description) -> XmlElement {
    element
        .with_text("description", description.description)
        .with_text("author", description.author)
        .with_text("version", description.version)
        .with_text("copyright", description.copyright)
        .with_text("license", description.license)
        .with_text("generationTool", description.generation_tool)
        .with_text("generationDateAndTime", description.generated)
        .with("variableNamingConvention", "structured")
}

/// Returns the units in order of first use.
pub(crate) fn unit_definitions(description: &Description) -> Option<XmlElement> {
    let mut units: Vec<&'static VariableUnit> = Vec::new();
    for unit in description.table.variables().iter().filter_map(|variable| variable.unit) {
        if units.iter().all(|known| known.name != unit.name) {
            units.push(unit);
        }
    }
    let without = |variable: &Variable| variable.kind == DataType::Real && variable.unit.is_none();
    let one = description.table.variables().iter().any(without);
    let one = one.then(|| XmlElement::new("Unit").with("name", ONE).child(XmlElement::new("BaseUnit")));
    XmlElement::new("UnitDefinitions").children(units.into_iter().map(unit_definition).chain(one)).unless_empty()
}

fn unit_definition(unit: &VariableUnit) -> XmlElement {
    let mut base = XmlElement::new("BaseUnit");
    for (key, exponent) in ["kg", "m", "s", "rad", "K"].into_iter().zip(unit.exponents) {
        base = base.with_some(key, (exponent != 0).then(|| exponent.to_string()));
    }
    let display = |(name, factor): &(&str, f64)| {
        XmlElement::new("DisplayUnit").with("name", name).with("factor", number(*factor))
    };
    XmlElement::new("Unit").with("name", unit.name).child(base).children(unit.display.iter().map(display))
}

/// Returns the enumerations in order of first use.
pub(crate) fn enumerations(description: &Description) -> Vec<&'static Enumeration> {
    let mut enumerations: Vec<&'static Enumeration> = Vec::new();
    for variable in description.table.variables() {
        if let DataType::Enumeration(enumeration) = variable.kind
            && enumerations.iter().all(|known| known.name != enumeration.name)
        {
            enumerations.push(enumeration);
        }
    }
    enumerations
}

/// Returns the items of an enumeration; values start at 1.
pub(crate) fn items(enumeration: &'static Enumeration) -> impl Iterator<Item = XmlElement> {
    enumeration.items.iter().enumerate().map(|(index, (name, description))| {
        XmlElement::new("Item")
            .with("name", name)
            .with("value", (index + 1).to_string())
            .with_text("description", description)
    })
}

/// Returns the log categories.
pub(crate) fn log_categories() -> XmlElement {
    let category = |(name, description): (&str, &str)| {
        XmlElement::new("Category").with("name", name).with("description", description)
    };
    XmlElement::new("LogCategories").children(LOG_CATEGORIES.map(category))
}

/// Returns the default experiment.
pub(crate) fn default_experiment(description: &Description) -> XmlElement {
    XmlElement::new("DefaultExperiment")
        .with("startTime", number(description.experiment.start))
        .with("stopTime", number(description.experiment.stop))
        .with("stepSize", number(description.experiment.step))
}
