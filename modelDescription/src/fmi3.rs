//! `modelDescription.xml` of FMI 3.0 for co-simulation.

use tiprub_cosim::variables::{Causality, DataType, Variability};

use crate::Description;
use crate::element::XmlElement;
use crate::row::{DescribedVariable, causality, rows, variability};
use crate::shared::{default_experiment, enumerations, items, log_categories, root_attributes, unit_definitions};
use crate::text::number;

/// Returns the model description of FMI 3.0, with whole or flattened arrays according to the description.
pub fn fmi3_xml(description: &Description) -> String {
    let rows = rows(description.table, description.fmi3_arrays);
    let root = XmlElement::new("fmiModelDescription")
        .with("fmiVersion", "3.0")
        .with("modelName", description.model_name)
        .with("instantiationToken", description.token);
    root_attributes(root, description)
        .child(co_simulation(description))
        .children(unit_definitions(description))
        .children(type_definitions(description))
        .child(log_categories())
        .child(default_experiment(description))
        .child(XmlElement::new("ModelVariables").children(rows.iter().map(variable)))
        .child(model_structure(&rows))
        .document()
}

fn co_simulation(description: &Description) -> XmlElement {
    XmlElement::new("CoSimulation")
        .with("modelIdentifier", description.identifier)
        .with("needsExecutionTool", "false")
        .with("canBeInstantiatedOnlyOncePerProcess", "false")
        .with("canGetAndSetFMUState", "true")
        .with("canSerializeFMUState", "true")
        .with("providesDirectionalDerivatives", "false")
        .with("providesAdjointDerivatives", "false")
        .with("canHandleVariableCommunicationStepSize", "true")
        .with_some("fixedInternalStepSize", description.fixed_internal_step.map(number))
        .with("maxOutputDerivativeOrder", "1")
        .with("providesIntermediateUpdate", "true")
        .with("mightReturnEarlyFromDoStep", "true")
        .with("canReturnEarlyAfterIntermediateUpdate", "true")
        .with("hasEventMode", "false")
}

fn type_definitions(description: &Description) -> Option<XmlElement> {
    let definition = |enumeration: &'static tiprub_cosim::variables::Enumeration| {
        XmlElement::new("EnumerationType")
            .with("name", enumeration.name)
            .with_text("description", enumeration.description)
            .children(items(enumeration))
    };
    XmlElement::new("TypeDefinitions").children(enumerations(description).into_iter().map(definition)).unless_empty()
}

fn variable(row: &DescribedVariable) -> XmlElement {
    let variable = row.variable;
    let name = match variable.kind {
        DataType::Real => "Float64",
        DataType::Integer => "Int64",
        DataType::Boolean => "Boolean",
        DataType::String => "String",
        DataType::Enumeration(_) => "Enumeration",
    };
    let mut element = XmlElement::new(name)
        .with("name", &row.name)
        .with("valueReference", row.reference.to_string())
        .with_text("description", &variable.description)
        .with("causality", causality(variable.causality))
        .with("variability", variability(variable.variability))
        .with_some("initial", row.initial())
        .with_some("intermediateUpdate", takes_part_in_intermediate_updates(row).then_some("true"))
        .with_some("declaredType", row.type_name());
    if matches!(variable.kind, DataType::Real | DataType::Integer) {
        let [min, max] = row.bounds();
        element = element
            .with_some("quantity", row.quantity())
            .with_some("unit", row.unit())
            .with_some("displayUnit", row.display_unit())
            .with_some("min", min)
            .with_some("max", max)
            .with_some("nominal", variable.nominal.map(number));
    }
    let dimension = row.dimension.map(|size| XmlElement::new("Dimension").with("start", size.to_string()));
    match (variable.kind, &row.start) {
        // The start value of a string is an element, one per array element.
        (DataType::String, Some(text)) => {
            let start = |_| XmlElement::new("Start").with("value", text);
            element.children(dimension).children((0..row.dimension.unwrap_or(1)).map(start))
        }
        (_, start) => element.with_some("start", start.as_ref()).children(dimension),
    }
}

/// Returns whether a variable takes part in intermediate updates: continuous inputs may be set and continuous outputs read.
fn takes_part_in_intermediate_updates(row: &DescribedVariable) -> bool {
    matches!(row.variable.causality, Causality::Input | Causality::Output)
        && row.variable.variability == Variability::Continuous
}

/// Returns outputs and initial unknowns by value reference.
fn model_structure(rows: &[DescribedVariable]) -> XmlElement {
    let unknown =
        |name, row: &DescribedVariable| XmlElement::new(name).with("valueReference", row.reference.to_string());
    let output = |row: &DescribedVariable| unknown("Output", row).with("dependencies", row.output_dependencies());
    let initial =
        |row: &DescribedVariable| unknown("InitialUnknown", row).with_some("dependencies", row.initial_dependencies());
    XmlElement::new("ModelStructure")
        .children(rows.iter().filter(|row| row.is_output()).map(output))
        .children(rows.iter().filter(|row| row.is_initial_unknown()).map(initial))
}
