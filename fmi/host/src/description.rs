//! Reader of modelDescription.xml for an importer: both FMI versions give one list of variables.

use std::collections::BTreeMap;

use quick_xml::{
    Reader, XmlVersion,
    events::{BytesStart, Event},
};
use tiprub_shell::{Failure, Result};

/// Maximum depth of elements and number of attributes of one; no description has more. Each takes memory, and
/// attributes are compared with each other.
const MOST_NESTED: usize = 50;
const MOST_ATTRIBUTES: usize = 50;

/// Data type of a variable, which selects the getter that reads it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum VariableType {
    /// fmi2Real, fmi3Float64.
    Float64,
    /// fmi2Integer, fmi3Int32, and fmi2 enumerations.
    Int32,
    /// fmi3 enumerations and fmi3Int64.
    Int64,
    /// Booleans.
    Boolean,
    /// Strings.
    Text,
}

/// One variable of modelDescription.xml.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ImportedVariable {
    /// Name.
    pub name: String,
    /// Value reference.
    pub reference: u32,
    /// Data type.
    pub kind: VariableType,
    /// Causality (`local` if the attribute is missing).
    pub causality: String,
    /// Variability, if given.
    pub variability: Option<String>,
    /// Unit, if given directly.
    pub unit: Option<String>,
    /// Description, if given.
    pub description: Option<String>,
    /// Number of elements of an array, `None` for scalars.
    pub elements: Option<usize>,
}

/// Content of modelDescription.xml that an importer needs.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ImportedDescription {
    /// Attribute fmiVersion.
    pub fmi_version: String,
    /// Attribute modelName.
    pub model_name: String,
    /// guid or instantiationToken.
    pub token: String,
    /// Attribute generationTool, if given.
    pub generation_tool: Option<String>,
    /// modelIdentifier of the co-simulation interface.
    pub model_identifier: String,
    /// Capability flags and the other attributes of the co-simulation element.
    pub capabilities: BTreeMap<String, String>,
    /// Attributes of DefaultExperiment.
    pub experiment: BTreeMap<String, f64>,
    /// All variables, in file order.
    pub variables: Vec<ImportedVariable>,
}

impl ImportedDescription {
    /// Returns the numeric outputs, in file order.
    pub(crate) fn numeric_outputs(&self) -> impl Iterator<Item = &ImportedVariable> {
        self.variables.iter().filter(|variable| variable.causality == "output" && variable.kind != VariableType::Text)
    }
}

impl ImportedVariable {
    /// Returns the scalar names of all elements.
    pub(crate) fn scalar_names(&self) -> Vec<String> {
        match self.elements {
            None => vec![self.name.clone()],
            Some(elements) => (1..=elements).map(|element| format!("{}[{element}]", self.name)).collect(),
        }
    }
}

/// Parses modelDescription.xml of FMI 2.0 or 3.0.
///
/// # Errors
/// Text that is not well-formed or misses data that every importer needs; the message contains the place.
pub fn parse(text: &str) -> Result<ImportedDescription> {
    let mut reader = Reader::from_str(text);
    let mut parser = Parser::default();
    loop {
        let position = reader.buffer_position();
        let event =
            reader.read_event().map_err(|error| wrong(format!("not well-formed at byte {position}: {error}")))?;
        match event {
            Event::Start(element) => parser.open(&element, true)?,
            Event::Empty(element) => parser.open(&element, false)?,
            Event::End(_) => parser.close(),
            Event::Eof => break,
            _ => {}
        }
    }
    parser.finish()
}

fn wrong(problem: impl std::fmt::Display) -> Failure {
    Failure::new("modelDescription.xml", problem, "Create the FMU again with the tool that wrote it")
}

#[derive(Default)]
struct Parser {
    path: Vec<String>,
    description: ImportedDescription,
    /// Start value of each structural parameter, for dimensions that refer to one.
    structural: BTreeMap<u32, usize>,
}

type Attributes = BTreeMap<String, String>;

impl Parser {
    fn open(&mut self, element: &BytesStart<'_>, has_content: bool) -> Result<()> {
        let name = element.local_name().as_ref().to_string();
        let attributes = read_attributes(element)?;
        let parent = self.path.last().map_or("", String::as_str);
        match (parent, name.as_str()) {
            ("", "fmiModelDescription") => self.root(&attributes),
            ("fmiModelDescription", "CoSimulation") => {
                self.description.model_identifier = attributes.get("modelIdentifier").cloned().unwrap_or_default();
                self.description.capabilities = attributes;
            }
            ("fmiModelDescription", "DefaultExperiment") => {
                for (key, value) in attributes {
                    let value = value
                        .parse()
                        .map_err(|_| wrong(format!("DefaultExperiment {key} = {value:?} is not a number")))?;
                    self.description.experiment.insert(key, value);
                }
            }
            ("ModelVariables", "ScalarVariable") => self.variable(&attributes, VariableType::Float64)?,
            ("ScalarVariable", kind) => self.scalar_type(kind, &attributes),
            ("ModelVariables", kind) => {
                if let Some(kind) = fmi3_type(kind) {
                    self.variable(&attributes, kind)?;
                }
            }
            (_, "Dimension") => self.dimension(&attributes)?,
            _ => {}
        }
        if has_content {
            if self.path.len() == MOST_NESTED {
                return Err(wrong(format!("elements are nested more than {MOST_NESTED} deep")));
            }
            self.path.push(name);
        }
        Ok(())
    }

    fn close(&mut self) {
        self.path.pop();
    }

    fn root(&mut self, attributes: &Attributes) {
        let get = |name: &str| attributes.get(name).cloned();
        self.description.fmi_version = get("fmiVersion").unwrap_or_default();
        self.description.model_name = get("modelName").unwrap_or_default();
        self.description.token = get("guid").or_else(|| get("instantiationToken")).unwrap_or_default();
        self.description.generation_tool = get("generationTool");
    }

    fn variable(&mut self, attributes: &Attributes, kind: VariableType) -> Result<()> {
        let name = attributes.get("name").cloned().ok_or_else(|| wrong("a variable has no name"))?;
        let reference = attributes.get("valueReference").and_then(|text| text.parse().ok());
        let reference = reference.ok_or_else(|| wrong(format!("variable {name} has no valid valueReference")))?;
        if attributes.get("causality").is_some_and(|causality| causality == "structuralParameter")
            && let Some(size) = attributes.get("start").and_then(|text| text.parse().ok())
        {
            self.structural.insert(reference, size);
        }
        self.description.variables.push(ImportedVariable {
            name,
            reference,
            kind,
            causality: attributes.get("causality").cloned().unwrap_or_else(|| "local".into()),
            variability: attributes.get("variability").cloned(),
            unit: attributes.get("unit").cloned(),
            description: attributes.get("description").cloned(),
            elements: None,
        });
        Ok(())
    }

    /// Reads the type of an FMI 2.0 variable, which is a child element.
    fn scalar_type(&mut self, kind: &str, attributes: &Attributes) {
        let kind = match kind {
            "Real" => VariableType::Float64,
            "Integer" | "Enumeration" => VariableType::Int32,
            "Boolean" => VariableType::Boolean,
            "String" => VariableType::Text,
            _ => return,
        };
        if let Some(variable) = self.description.variables.last_mut() {
            variable.kind = kind;
            variable.unit = attributes.get("unit").cloned();
        }
    }

    /// Reads a dimension of an FMI 3.0 array, one element each.
    fn dimension(&mut self, attributes: &Attributes) -> Result<()> {
        let Some(variable) = self.description.variables.last_mut() else { return Ok(()) };
        let fixed = attributes.get("start").and_then(|text| text.parse().ok());
        let referred = || {
            let reference = attributes.get("valueReference")?.parse().ok()?;
            self.structural.get(&reference).copied()
        };
        let size: usize = fixed
            .or_else(referred)
            .ok_or_else(|| wrong(format!("variable {} has a dimension without a size", variable.name)))?;
        variable.elements = Some(variable.elements.unwrap_or(1).saturating_mul(size));
        Ok(())
    }

    fn finish(self) -> Result<ImportedDescription> {
        let description = self.description;
        if let Some(open) = self.path.last() {
            return Err(wrong(format!("ends inside the element {open}")));
        }
        if description.fmi_version.is_empty() {
            return Err(wrong("no fmiModelDescription element with an fmiVersion"));
        }
        let needed =
            [("guid/instantiationToken", &description.token), ("modelIdentifier", &description.model_identifier)];
        match needed.iter().find(|(_, value)| value.is_empty()) {
            Some((name, _)) => Err(wrong(format!("no {name} for co-simulation"))),
            None => Ok(description),
        }
    }
}

fn read_attributes(element: &BytesStart<'_>) -> Result<Attributes> {
    let mut attributes = Attributes::new();
    for (index, attribute) in element.attributes().enumerate() {
        if index == MOST_ATTRIBUTES {
            return Err(wrong(format!("an element has more than {MOST_ATTRIBUTES} attributes")));
        }
        let attribute = attribute.map_err(|error| wrong(format!("invalid attribute: {error}")))?;
        let value = attribute
            .normalized_value(XmlVersion::Implicit1_0)
            .map_err(|error| wrong(format!("invalid attribute value: {error}")))?;
        attributes.insert(attribute.key.local_name().as_ref().to_string(), value.into_owned());
    }
    Ok(attributes)
}

fn fmi3_type(element: &str) -> Option<VariableType> {
    Some(match element {
        "Float64" => VariableType::Float64,
        "Int32" => VariableType::Int32,
        "Int64" | "UInt64" | "Enumeration" => VariableType::Int64,
        "Boolean" => VariableType::Boolean,
        "String" => VariableType::Text,
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const FMI2: &str = r#"<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="rub &amp; more" guid="{1}">
  <CoSimulation modelIdentifier="tiprub" canHandleVariableCommunicationStepSize="true"/>
  <DefaultExperiment startTime="0" stopTime="0.01" stepSize="1e-5"/>
  <ModelVariables>
    <ScalarVariable name="time" valueReference="0" causality="independent"><Real unit="s"/></ScalarVariable>
    <ScalarVariable name="f[1]" valueReference="7" causality="output"><Real unit="N"/></ScalarVariable>
    <ScalarVariable name="count" valueReference="9" causality="output"><Integer/></ScalarVariable>
    <ScalarVariable name="hidden" valueReference="10"><Boolean/></ScalarVariable>
  </ModelVariables>
  <ModelStructure><Outputs><Unknown index="2"/></Outputs></ModelStructure>
</fmiModelDescription>"#;

    const FMI3: &str = r#"<fmiModelDescription fmiVersion="3.0" modelName="rub" instantiationToken="{2}">
  <CoSimulation modelIdentifier="tiprub"/>
  <ModelVariables>
    <UInt64 name="n" valueReference="3" causality="structuralParameter" variability="fixed" start="4"/>
    <Float64 name="f" valueReference="7" causality="output" unit="N"><Dimension start="3"/></Float64>
    <Float64 name="g" valueReference="8" causality="output"><Dimension valueReference="3"/></Float64>
    <Int32 name="count" valueReference="9" causality="output"/>
    <String name="text" valueReference="11" causality="output"/>
  </ModelVariables>
</fmiModelDescription>"#;

    #[test]
    fn reads_fmi2_and_fmi3_descriptions() {
        let two = parse(FMI2).unwrap();
        assert_eq!(
            (two.fmi_version.as_str(), two.model_name.as_str(), two.token.as_str()),
            ("2.0", "rub & more", "{1}")
        );
        let outputs: Vec<_> = two.numeric_outputs().map(|variable| (variable.name.as_str(), variable.kind)).collect();
        assert_eq!(outputs, [("f[1]", VariableType::Float64), ("count", VariableType::Int32)]);
        assert_eq!(two.variables[1].unit.as_deref(), Some("N"));
        assert_eq!(two.experiment["stepSize"].to_bits(), 1e-5_f64.to_bits());
        let three = parse(FMI3).unwrap();
        let names: Vec<_> = three.numeric_outputs().flat_map(ImportedVariable::scalar_names).collect();
        assert_eq!(names, ["f[1]", "f[2]", "f[3]", "g[1]", "g[2]", "g[3]", "g[4]", "count"]);
    }

    #[test]
    fn rejects_excessive_nesting_and_attributes() {
        let nested = "<a>".repeat(60);
        assert!(parse(&nested).unwrap_err().problem.contains("nested"));
        let attributes: String = (0..60).map(|index| format!(" a{index}=\"\"")).collect();
        assert!(parse(&format!("<a{attributes}/>")).unwrap_err().problem.contains("attributes"));
    }

    #[test]
    fn rejects_every_truncation() {
        for (length, _) in FMI3.char_indices() {
            // If it is cut after the last variable, the closing tags are missing.
            let result = parse(&FMI3[..length]);
            assert!(result.is_err(), "{length} characters: {result:?}");
        }
    }
}
