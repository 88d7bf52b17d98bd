//! What both versions of the standard describe alike.

use tiprub_core::variables::{Enumeration, Kind, Unit, Variable};

use crate::Description;
use crate::element::Element;
use crate::row::ONE;
use crate::text::number;

/// Log categories of both versions: (name, description).
pub const LOG_CATEGORIES: [(&str, &str); 5] = [
    ("logStatusWarning", "Results are usable, but something deserves attention"),
    ("logStatusDiscard", "A call that was refused without consequences"),
    ("logStatusError", "A call that failed; the instance must be reset or restored"),
    ("logStatusFatal", "The instance cannot be used any more"),
    ("logAll", "All messages"),
];

/// Attributes of the root element after those that differ between the versions.
pub(crate) fn root_attributes(element: Element, description: &Description) -> Element {
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

/// Units in order of first use.
pub(crate) fn unit_definitions(description: &Description) -> Option<Element> {
    let mut units: Vec<&'static Unit> = Vec::new();
    for unit in description.table.variables().iter().filter_map(|variable| variable.unit) {
        if units.iter().all(|known| known.name != unit.name) {
            units.push(unit);
        }
    }
    let without = |variable: &Variable| variable.kind == Kind::Real && variable.unit.is_none();
    let one = description.table.variables().iter().any(without);
    let one = one.then(|| Element::new("Unit").with("name", ONE).child(Element::new("BaseUnit")));
    Element::new("UnitDefinitions").children(units.into_iter().map(unit_definition).chain(one)).unless_empty()
}

fn unit_definition(unit: &Unit) -> Element {
    let mut base = Element::new("BaseUnit");
    for (key, exponent) in ["kg", "m", "s", "rad", "K"].into_iter().zip(unit.exponents) {
        base = base.with_some(key, (exponent != 0).then(|| exponent.to_string()));
    }
    let display =
        |(name, factor): &(&str, f64)| Element::new("DisplayUnit").with("name", name).with("factor", number(*factor));
    Element::new("Unit").with("name", unit.name).child(base).children(unit.display.iter().map(display))
}

/// Enumerations in order of first use.
pub(crate) fn enumerations(description: &Description) -> Vec<&'static Enumeration> {
    let mut enumerations: Vec<&'static Enumeration> = Vec::new();
    for variable in description.table.variables() {
        if let Kind::Enumeration(enumeration) = variable.kind
            && enumerations.iter().all(|known| known.name != enumeration.name)
        {
            enumerations.push(enumeration);
        }
    }
    enumerations
}

/// The items of an enumeration; values count from 1.
pub(crate) fn items(enumeration: &'static Enumeration) -> impl Iterator<Item = Element> {
    enumeration.items.iter().enumerate().map(|(index, (name, description))| {
        Element::new("Item")
            .with("name", name)
            .with("value", (index + 1).to_string())
            .with_text("description", description)
    })
}

/// The log categories.
pub(crate) fn log_categories() -> Element {
    let category = |(name, description): (&str, &str)| {
        Element::new("Category").with("name", name).with("description", description)
    };
    Element::new("LogCategories").children(LOG_CATEGORIES.map(category))
}

/// The default experiment.
pub(crate) fn default_experiment(description: &Description) -> Element {
    Element::new("DefaultExperiment")
        .with("startTime", number(description.experiment.start))
        .with("stopTime", number(description.experiment.stop))
        .with("stepSize", number(description.experiment.step))
}
