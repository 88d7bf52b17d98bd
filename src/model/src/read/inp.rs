//! CalculiX and Abaqus input files: nodes, solid elements, sets, one isotropic material per element.
//!
//! Supported are `*NODE`, `*ELEMENT`, `*NSET`, `*ELSET`, `*MATERIAL` with `*ELASTIC`, `*DENSITY` and `*EXPANSION`,
//! `*SOLID SECTION`, `*INCLUDE`, and `*BOUNDARY` as a hint. Keywords that change neither stiffness nor mass are
//! skipped and listed; keywords that do, and unknown keywords before the first `*STEP`, are rejected. Loads and
//! results inside steps are not read.

mod lines;
mod materials;
mod sets;
mod vocabulary;

use std::collections::BTreeMap;
use std::path::Path;

use lines::{Card, DataLine, cards};
use materials::DeckMaterial;
use sets::InpSets;
use vocabulary::{ElementType, UnreadKeyword, element_type, unread};

use super::draft::{DraftElement, MeshDraft};
use super::source::{Open, SourceLine, number};
use crate::Result;
use crate::material::Material;

/// Contents of an input file.
#[derive(Debug, Default)]
pub(super) struct Deck {
    /// Nodes, elements, sets.
    pub draft: MeshDraft,
    /// Materials in the order of the file, in its units.
    pub materials: Vec<Material>,
    /// Contents of `*BOUNDARY` as a hint: set names or node numbers, as written.
    pub held: Vec<String>,
}

/// Reads an input file; temperature-dependent tables are evaluated at `temperature`.
pub(super) fn read(path: &Path, bytes: &[u8], temperature: Option<f64>, open: Open<'_>) -> Result<Deck> {
    let mut reader = InpReader::default();
    for card in cards(path, bytes, open)? {
        reader.card(&card)?;
    }
    reader.finish(temperature)
}

#[derive(Debug)]
struct InpSection {
    set: String,
    material: String,
    place: SourceLine,
}

#[derive(Debug, Default)]
struct InpReader {
    draft: MeshDraft,
    sets: InpSets,
    materials: Vec<DeckMaterial>,
    sections: Vec<InpSection>,
    held: Vec<String>,
    skipped: BTreeMap<String, (usize, usize)>,
    near: BTreeMap<String, usize>,
    left_out: BTreeMap<String, usize>,
    parts: usize,
    instances: usize,
    in_step: bool,
    in_assembly: bool,
}

impl InpReader {
    fn card(&mut self, card: &Card) -> Result<()> {
        match card.keyword.as_str() {
            "BOUNDARY" => {
                let held = card.data.iter().filter_map(|line| line.values().next());
                self.held.extend(held.map(|name| sets::local_name(name).to_uppercase()));
            }
            "STEP" => {
                self.skip(card);
                self.in_step = true;
            }
            "END STEP" => self.in_step = false,
            // Loads and results; changes of the structure within a step, such as contact, do not apply at rest.
            _ if self.in_step => {}
            "PART" => return count(&mut self.parts, card, "part"),
            "INSTANCE" => return self.instance(card),
            "ASSEMBLY" => self.in_assembly = true,
            "NODE" => return self.nodes(card),
            "ELEMENT" => return self.elements(card),
            "NSET" => return self.sets.nodes.read(card, card.required("NSET")?),
            "ELSET" => return self.sets.elements.read(card, card.required("ELSET")?),
            "MATERIAL" => self.materials.push(DeckMaterial::new(card)?),
            "ELASTIC" | "DENSITY" | "EXPANSION" => return self.property(card),
            "SOLID SECTION" => return self.section(card),
            "TIE" if card.has("CYCLICSYMMETRY") => self.skip(card),
            keyword => return self.unread(keyword, card),
        }
        Ok(())
    }

    fn skip(&mut self, card: &Card) {
        self.skipped.entry(card.keyword.clone()).or_insert((0, card.place.line)).0 += 1;
    }

    fn unread(&mut self, keyword: &str, card: &Card) -> Result<()> {
        match unread(keyword) {
            UnreadKeyword::Harmless => self.skip(card),
            UnreadKeyword::Changes => {
                let problem = format!("*{keyword} changes the model and is not supported");
                let remedy = "Remove it if it is not needed, or give the matrices of the model: --stiffness and --mass";
                return Err(card.place.error(problem, remedy));
            }
            UnreadKeyword::Unknown => {
                let problem = format!("keyword *{keyword} is unknown");
                return Err(card.place.error(problem, "Remove it if it affects neither stiffness nor mass"));
            }
        }
        Ok(())
    }

    fn instance(&mut self, card: &Card) -> Result<()> {
        count(&mut self.instances, card, "instance")?;
        match card.data.first() {
            None => Ok(()),
            Some(line) => {
                let problem = "the instance is translated or rotated relative to its part";
                Err(line.place.error(problem, "Export the input file without parts and assemblies"))
            }
        }
    }

    fn nodes(&mut self, card: &Card) -> Result<()> {
        if self.in_assembly && self.instances > 0 && self.parts > 0 {
            let problem = "the assembly has nodes (reference points) in addition to those of the part";
            return Err(card.place.error(problem, "Remove the reference points, or export the file without parts"));
        }
        if let Some(system) = card.parameter("SYSTEM")?.filter(|system| !system.eq_ignore_ascii_case("R")) {
            let problem = format!("coordinates in SYSTEM={system} are not supported");
            return Err(card.place.error(problem, "Use Cartesian coordinates"));
        }
        let set = card.parameter("NSET")?.map(str::to_owned);
        for line in &card.data {
            let mut values = line.values();
            let node = label(values.next().unwrap_or(""), line, "a node number")?;
            let mut position = [0.0; 3];
            for x in &mut position {
                // An empty field is zero, as in the programs that read this format.
                *x = match values.next() {
                    None | Some("") => 0.0,
                    Some(text) => number(text).ok_or_else(|| {
                        line.place
                            .error(format!("coordinate `{text}` of node {node} is not a number"), "Correct the line")
                    })?,
                };
            }
            self.draft.add_node(node, position, &|| line.place.clone())?;
            if let Some(set) = &set {
                self.sets.nodes.add(set, node);
            }
        }
        Ok(())
    }

    fn elements(&mut self, card: &Card) -> Result<()> {
        let name = card.required("TYPE")?.to_uppercase();
        let set = card.parameter("ELSET")?.map(str::to_owned);
        let kind = match element_type(&name) {
            ElementType::Solid(kind) => Some(kind),
            ElementType::Near(kind) => {
                *self.near.entry(name.clone()).or_default() += card.data.len();
                Some(kind)
            }
            ElementType::LowerDimension => {
                *self.left_out.entry(name.clone()).or_default() += card.data.len();
                None
            }
            ElementType::Refused(reason, remedy) => {
                return Err(card.place.error(format!("element type {name} {reason}"), remedy));
            }
        };
        let wanted = kind.map(|kind| kind.node_count() + 1);
        let mut record: Vec<u64> = Vec::new();
        let mut place = card.place.clone();
        for (index, line) in card.data.iter().enumerate() {
            if record.is_empty() {
                place = line.place.clone();
            }
            for text in line.values() {
                record.push(label(text, line, "an element or node number")?);
            }
            let complete = wanted.map_or(!line.is_continued(), |wanted| record.len() >= wanted);
            if !complete && index + 1 < card.data.len() {
                continue;
            }
            if wanted.is_some_and(|wanted| record.len() != wanted) || record.len() < 2 {
                let (found, needed) = (record.len().saturating_sub(1), wanted.map_or(1, |wanted| wanted - 1));
                let problem = format!("element {} ({name}) has {found} nodes instead of {needed}", record[0]);
                return Err(place.error(problem, "Correct the element or its TYPE"));
            }
            let (number, nodes) = (record[0], record[1..].to_vec());
            record.clear();
            self.draft.add_element(DraftElement { number, kind, nodes, material: None, place: place.clone() })?;
            if let Some(set) = &set {
                self.sets.elements.add(set, number);
            }
        }
        Ok(())
    }

    fn property(&mut self, card: &Card) -> Result<()> {
        match self.materials.last_mut() {
            Some(material) => material.read(card),
            None => {
                let problem = format!("*{} appears before any *MATERIAL", card.keyword);
                Err(card.place.error(problem, "Write *MATERIAL, NAME=... above it"))
            }
        }
    }

    fn section(&mut self, card: &Card) -> Result<()> {
        if card.has("COMPOSITE") {
            return Err(card.place.error("composite sections are not supported", "Give the matrices of the model"));
        }
        let (set, material) = (card.required("ELSET")?.to_uppercase(), card.required("MATERIAL")?.to_uppercase());
        self.sections.push(InpSection { set, material, place: card.place.clone() });
        Ok(())
    }

    fn finish(mut self, temperature: Option<f64>) -> Result<Deck> {
        self.assign_materials()?;
        let materials: Vec<Material> = if self.materials.len() == 1 || !self.sections.is_empty() {
            self.materials.iter().map(|material| material.at(temperature)).collect::<Result<_>>()?
        } else {
            Vec::new()
        };
        self.sets.into_node_sets(&mut self.draft)?;
        for (name, count) in core::mem::take(&mut self.left_out) {
            let note = format!("{count} {name} elements are not solids: they are ignored, but their sets are kept");
            self.draft.notes.push(note);
        }
        for name in self.near.keys() {
            let full = name.trim_end_matches(|c: char| c.is_ascii_alphabetic());
            self.draft.warnings.push(format!(
                "{name} is fully integrated here{}: frequencies are higher than with reduced integration",
                if name == full { String::new() } else { format!(", like {full}") }
            ));
        }
        if !self.skipped.is_empty() {
            let skipped = self.skipped.iter().map(|(keyword, (_, line))| format!("*{keyword} (line {line})"));
            let skipped: Vec<String> = skipped.collect();
            self.draft.notes.push(format!("skipped, no effect on stiffness and mass: {}", skipped.join(", ")));
        }
        self.held.sort();
        self.held.dedup();
        Ok(Deck { draft: self.draft, materials, held: self.held })
    }

    /// Assigns to every element the material of its section.
    fn assign_materials(&mut self) -> Result<()> {
        for section in core::mem::take(&mut self.sections) {
            let InpSection { set, material, place } = &section;
            let Some(index) = self.materials.iter().position(|known| known.is_named(material)) else {
                let names: Vec<&str> = self.materials.iter().map(|known| known.name()).collect();
                let problem = format!("the section refers to material `{material}`, which is not defined");
                return Err(place.error(problem, format!("Choose one of these materials: {}", names.join(", "))));
            };
            for number in self.sets.elements.members(set, place, &self.draft)? {
                let Some(element) = self.draft.element(number) else { continue };
                if element.material.is_some_and(|other| other != index) {
                    let problem = format!("element {number} has a second section with a different material");
                    return Err(place.error(problem, "Give every element only one section"));
                }
                element.material = Some(index);
            }
            self.sections.push(section);
        }
        if self.sections.is_empty() && self.materials.len() == 1 {
            self.draft.notes.push(format!(
                "there is no *SOLID SECTION: material `{}` is used for all elements",
                self.materials[0].name()
            ));
            self.draft.elements.iter_mut().for_each(|element| element.material = Some(0));
        }
        Ok(())
    }
}

/// Counts items of which only one is supported, and rejects the second.
fn count(counter: &mut usize, card: &Card, what: &str) -> Result<()> {
    *counter += 1;
    if *counter == 1 {
        return Ok(());
    }
    let problem = format!("there is a second {what}, but only one is supported");
    Err(card
        .place
        .error(problem, "Merge the parts into one mesh, or export the input file without parts and assemblies"))
}

/// Reads a number of a node or an element.
fn label(text: &str, line: &DataLine, what: &str) -> Result<u64> {
    text.parse::<u64>().ok().filter(|&number| number > 0).ok_or_else(|| {
        line.place.error(format!("`{text}` is not {what} (a positive whole number)"), "Correct the line")
    })
}
