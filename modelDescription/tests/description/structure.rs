//! Requirements of the standards on a model description, checked with an XML reader.

use std::collections::{BTreeMap, BTreeSet};

use quick_xml::Reader;
use quick_xml::events::{BytesStart, Event};
use tiprub_cosim::variables::{Causality, DataType};
use tiprub_model_description::{LOG_CATEGORIES, fmi2_xml, fmi3_xml, html};

use crate::common;

/// Element as read: path of element names, attributes.
type Read = (String, BTreeMap<String, String>);

fn attributes(start: &BytesStart) -> BTreeMap<String, String> {
    let unescaped = |value: &str| quick_xml::escape::unescape(value).unwrap().into_owned();
    start
        .attributes()
        .map(|attribute| attribute.unwrap())
        .map(|attribute| (attribute.key.as_ref().to_owned(), unescaped(&attribute.value)))
        .collect()
}

fn read(xml: &str) -> Vec<Read> {
    let mut reader = Reader::from_str(xml);
    let (mut path, mut elements): (Vec<String>, _) = (Vec::new(), Vec::new());
    let full = |path: &[String], start: &BytesStart| {
        path.iter()
            .map(String::as_str)
            .chain([start.name().as_ref()])
            .map(|name| format!("/{name}"))
            .collect::<String>()
    };
    loop {
        match reader.read_event().unwrap() {
            Event::Start(start) => {
                elements.push((full(&path, &start), attributes(&start)));
                path.push(start.name().as_ref().to_owned());
            }
            Event::Empty(start) => elements.push((full(&path, &start), attributes(&start))),
            Event::End(_) => drop(path.pop()),
            Event::Eof => return elements,
            _ => {}
        }
    }
}

fn at<'a>(elements: &'a [Read], path: &str) -> Vec<&'a BTreeMap<String, String>> {
    let path = format!("/fmiModelDescription{path}");
    elements.iter().filter(|(found, _)| *found == path).map(|(_, attributes)| attributes).collect()
}

/// Returns one description of each version and kind.
fn all() -> [(&'static str, Vec<Read>); 3] {
    let (table, rom) = (common::table(), common::rom());
    [
        ("2.0", read(&fmi2_xml(&common::description(&table, &rom, true)))),
        ("3.0", read(&fmi3_xml(&common::description(&table, &rom, true)))),
        ("3.0", read(&fmi3_xml(&common::description(&table, &rom, false)))),
    ]
}

#[test]
fn the_root_names_version_token_and_date() {
    for (version, elements) in all() {
        let root = at(&elements, "")[0];
        assert_eq!(root["fmiVersion"], version);
        let token = if version == "2.0" { "guid" } else { "instantiationToken" };
        assert_eq!(root[token], "{01234567-89ab-cdef-0123-456789abcdef}");
        assert_eq!(root["generationDateAndTime"], "2026-01-31T12:00:00Z");
        assert_eq!(root["variableNamingConvention"], "structured");
        assert_eq!(root["description"], "Tip rub of 36 blades & a casing");
        assert_eq!(at(&elements, "/CoSimulation")[0]["modelIdentifier"], "tiprub");
        let categories: Vec<_> = at(&elements, "/LogCategories/Category").iter().map(|c| c["name"].clone()).collect();
        assert_eq!(categories, LOG_CATEGORIES.map(|(name, _)| name));
    }
}

#[test]
fn declared_capabilities_match_the_implementation() {
    let flags = |text: &str| -> BTreeMap<String, String> {
        let pair = |flag: &str| flag.split_once('=').map(|(key, value)| (key.to_owned(), value.to_owned())).unwrap();
        text.split_whitespace().map(pair).collect()
    };
    let [(_, two), (_, three), _] = all();
    let expected = flags(
        "modelIdentifier=tiprub needsExecutionTool=false canHandleVariableCommunicationStepSize=true \
         canInterpolateInputs=true maxOutputDerivativeOrder=1 canRunAsynchronuously=false \
         canBeInstantiatedOnlyOncePerProcess=false canNotUseMemoryManagementFunctions=true canGetAndSetFMUstate=true \
         canSerializeFMUstate=true providesDirectionalDerivative=false",
    );
    assert_eq!(*at(&two, "/CoSimulation")[0], expected);
    let expected = flags(
        "modelIdentifier=tiprub needsExecutionTool=false canBeInstantiatedOnlyOncePerProcess=false \
         canGetAndSetFMUState=true canSerializeFMUState=true providesDirectionalDerivatives=false \
         providesAdjointDerivatives=false canHandleVariableCommunicationStepSize=true fixedInternalStepSize=1e-6 maxOutputDerivativeOrder=1 \
         providesIntermediateUpdate=true mightReturnEarlyFromDoStep=true canReturnEarlyAfterIntermediateUpdate=true \
         hasEventMode=false",
    );
    assert_eq!(*at(&three, "/CoSimulation")[0], expected);
}

#[test]
fn arrays_are_flattened_with_consecutive_references() {
    let [(_, two), (_, arrays), (_, scalars)] = all();
    let reference =
        |variable: &BTreeMap<String, String>| (variable["name"].clone(), variable["valueReference"].clone());
    let two: Vec<_> = at(&two, "/ModelVariables/ScalarVariable").into_iter().map(reference).collect();
    let numbers: Vec<_> = two.iter().map(|(_, number)| number.parse::<usize>().unwrap()).collect();
    assert_eq!(numbers, (1..=numbers.len()).collect::<Vec<_>>(), "all but time, which FMI 2.0 does not list");
    let names: Vec<_> = two.iter().map(|(name, _)| name.as_str()).filter(|name| name.contains("gap")).collect();
    assert_eq!(names, ["sector_gap[1]", "sector_gap[2]", "sector_gap[3]"]);
    let in_three = |elements: &[Read]| -> Vec<_> {
        let prefix = "/fmiModelDescription/ModelVariables/";
        let variables = elements.iter().filter(|(path, _)| path.strip_prefix(prefix).is_some_and(|p| !p.contains('/')));
        variables.map(|(_, attributes)| reference(attributes)).collect()
    };
    let scalars_of_three = in_three(&scalars);
    assert_eq!(scalars_of_three[0].0, "time");
    assert_eq!(scalars_of_three[1..], two, "scalars of FMI 3.0 are those of FMI 2.0");
    let table = common::table();
    let whole: Vec<_> = table.variables().iter().map(|v| (v.name.clone(), v.reference.to_string())).collect();
    assert_eq!(in_three(&arrays), whole);
    let gap = at(&arrays, "/ModelVariables/Float64").into_iter().find(|v| v["name"] == "sector_gap").unwrap();
    assert_eq!(gap["start"], "0.00035 0.00036 1e-7");
    assert_eq!(at(&arrays, "/ModelVariables/Float64/Dimension").len(), 2);
    assert_eq!(at(&scalars, "/ModelVariables/Float64/Dimension").len(), 0);
}

#[test]
fn start_values_are_present_exactly_where_required() {
    let [(_, two), (_, three), _] = all();
    let typed: Vec<_> = two.iter().filter(|(path, _)| path.contains("/ScalarVariable/")).collect();
    for (variable, (_, value)) in at(&two, "/ModelVariables/ScalarVariable").iter().zip(typed) {
        let has = value.contains_key("start");
        let causality = variable["causality"].as_str();
        assert_eq!(has, variable.get("initial").is_some_and(|i| i == "exact") || causality == "input", "{variable:?}");
        assert_eq!(variable.contains_key("initial"), !["input", "independent"].contains(&causality), "{variable:?}");
    }
    let table = common::table();
    for variable in table.variables().iter().filter(|variable| variable.kind != DataType::String) {
        let element = three.iter().find(|(_, a)| a.get("name").is_some_and(|name| *name == variable.name)).unwrap();
        let wanted = variable.is_settable() || variable.initial_is_exact() == Some(true);
        assert_eq!(element.1.contains_key("start"), wanted, "{}", variable.name);
    }
    assert_eq!(at(&three, "/ModelVariables/String/Start")[0]["value"], "a \"b\" <c>");
    let independent = |a: &&Read| a.1.get("causality").is_some_and(|causality| causality == "independent");
    assert_eq!(three.iter().filter(independent).count(), 1);
}

#[test]
fn the_model_structure_is_complete() {
    let table = common::table();
    let outputs = table.variables().iter().filter(|variable| variable.causality == Causality::Output);
    let whole: Vec<u32> = outputs.clone().map(|variable| variable.reference).collect();
    let elements: Vec<u32> = outputs
        .flat_map(|variable| variable.reference..variable.reference + u32::try_from(variable.len()).unwrap())
        .collect();
    let [(_, two), (_, arrays), (_, scalars)] = all();
    let numbers = |elements: &[Read], path: &str, key: &str| -> Vec<u32> {
        at(elements, path).iter().map(|unknown| unknown[key].parse().unwrap()).collect()
    };
    // Indices of FMI 2.0 start at 1; references of this table start at 0 without gaps, and time, at 0, is not listed.
    for path in ["/ModelStructure/Outputs/Unknown", "/ModelStructure/InitialUnknowns/Unknown"] {
        assert_eq!(numbers(&two, path, "index"), elements);
    }
    for path in ["/ModelStructure/Output", "/ModelStructure/InitialUnknown"] {
        assert_eq!(numbers(&arrays, path, "valueReference"), whole);
        assert_eq!(numbers(&scalars, path, "valueReference"), elements);
    }
}

#[test]
fn outputs_have_no_dependencies_and_means_start_at_zero() {
    for (version, elements) in all() {
        let (outputs, initial) = match version {
            "2.0" => ("/ModelStructure/Outputs/Unknown", "/ModelStructure/InitialUnknowns/Unknown"),
            _ => ("/ModelStructure/Output", "/ModelStructure/InitialUnknown"),
        };
        assert!(at(&elements, outputs).iter().all(|unknown| unknown["dependencies"].is_empty()));
        let free: Vec<_> = at(&elements, initial).into_iter().filter(|u| u.contains_key("dependencies")).collect();
        assert_eq!(free.len(), 1, "`contact.force` is the one mean of the table");
        assert!(free[0]["dependencies"].is_empty());
    }
}

#[test]
fn units_and_types_used_are_defined() {
    for (version, elements) in all() {
        let names =
            |path: &str| -> BTreeSet<String> { at(&elements, path).iter().map(|e| e["name"].clone()).collect() };
        let units = names("/UnitDefinitions/Unit");
        assert_eq!(units, ["m", "s", "N", "rad/s", "1"].map(String::from).into());
        let displayed = names("/UnitDefinitions/Unit/DisplayUnit");
        for (_, attributes) in &elements {
            assert!(attributes.get("unit").is_none_or(|unit| units.contains(unit)));
            assert!(attributes.get("displayUnit").is_none_or(|unit| displayed.contains(unit)));
        }
        let newton = at(&elements, "/UnitDefinitions/Unit/BaseUnit")[3];
        let exponents = [("kg", "1"), ("m", "1"), ("s", "-2")].map(|(key, value)| (key.to_owned(), value.to_owned()));
        assert_eq!(*newton, BTreeMap::from(exponents));
        let items = match version {
            "2.0" => at(&elements, "/TypeDefinitions/SimpleType/Enumeration/Item"),
            _ => at(&elements, "/TypeDefinitions/EnumerationType/Item"),
        };
        let values: Vec<_> = items.iter().map(|item| (item["name"].as_str(), item["value"].as_str())).collect();
        assert_eq!(values, [("central_difference", "1"), ("modal_exact", "2")]);
    }
}

#[test]
fn intermediate_updates_have_continuous_variables() {
    let [_, (_, three), _] = all();
    let mut counts = [0, 0];
    for (_, attributes) in three.iter().filter(|(_, attributes)| attributes.contains_key("causality")) {
        let flow = ["input", "output"].contains(&attributes["causality"].as_str());
        let wanted = flow && attributes["variability"] == "continuous";
        assert_eq!(attributes.contains_key("intermediateUpdate"), wanted, "{}", attributes["name"]);
        counts[usize::from(wanted)] += 1;
    }
    assert!(counts[0] > 2 && counts[1] == 2, "{counts:?}");
}

#[test]
fn page_names_all_variables_and_checks() {
    let (table, rom) = (common::table(), common::rom());
    let page = html(&common::description(&table, &rom, true));
    for variable in table.variables() {
        assert!(page.contains(&format!("<code>{}", variable.name)), "{}", variable.name);
    }
    for part in [
        "sector_gap[1..3]",
        "812.346",
        "5.300e-4",
        "0.00430",
        "1 = central_difference, 2 = modal_exact",
        "≥ 0<",
        "0.00035, ..., 1e-7",
        "rad/s (rpm)",
        "hex20 mesh of &lt;many&gt; nodes",
        "Small displacements within &lt;each&gt; structure.",
        "ω·h = 2.5 &gt; 2",
    ] {
        assert!(page.contains(part), "{part}");
    }
    for outside in ["http:", "https:", "<script", "src=", "@import"] {
        assert!(!page.contains(outside), "{outside}");
    }
}

proptest::proptest! {
    #[test]
    fn arbitrary_user_text_round_trips(text in "\\PC*|[\\x00-\\x20<>&\"']*") {
        let (table, rom) = (common::table(), common::rom());
        let mut description = common::description(&table, &rom, true);
        description.description = &text;
        (description.limits, description.features) = (vec![text.clone()], vec![text.clone()]);
        let control = |c: char| c.is_ascii_control() && !c.is_ascii_whitespace() || c == '\u{b}' || c == '\u{c}';
        let expected: String = text
            .chars()
            .map(|c| match c {
                '\n' | '\r' | '\t' => ' ',
                '\u{fffe}' | '\u{ffff}' => '\u{fffd}',
                c if control(c) && c != '\u{7f}' => '\u{fffd}',
                c => c,
            })
            .collect();
        for xml in [fmi2_xml(&description), fmi3_xml(&description)] {
            let root = &read(&xml)[0].1;
            proptest::prop_assert_eq!(root.get("description").map_or("", String::as_str), &expected);
        }
        let page = html(&description);
        proptest::prop_assert_eq!(page.matches("<li>").count(), 3);
    }
}
