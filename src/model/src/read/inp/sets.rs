//! Node and element sets: numbers, ranges and other sets, resolved after the file is read.

use std::collections::{BTreeMap, BTreeSet};

use super::super::draft::MeshDraft;
use super::super::source::SourceLine;
use super::lines::Card;
use crate::Result;

/// Returns the name without its instance prefix: `PART-1-1.TIP` becomes `TIP`.
pub(super) fn local_name(name: &str) -> &str {
    name.rsplit_once('.').map_or(name, |(_, local)| local).trim_matches('"')
}

#[derive(Debug)]
enum SetMember {
    Number(u64),
    /// A number that is listed explicitly, which must exist.
    Written(u64, SourceLine),
    /// First, last, increment; numbers in between need not exist.
    Range(u64, u64, u64),
    Set(String, SourceLine),
}

/// Sets of one kind by name, in upper case.
#[derive(Debug, Default)]
pub(super) struct NamedSets {
    sets: BTreeMap<String, Vec<SetMember>>,
}

/// Node sets and element sets.
#[derive(Debug, Default)]
pub(super) struct InpSets {
    pub nodes: NamedSets,
    pub elements: NamedSets,
}

impl NamedSets {
    /// Adds a number that is defined together with the set.
    pub(super) fn add(&mut self, set: &str, number: u64) {
        self.entry(set).push(SetMember::Number(number));
    }

    fn entry(&mut self, set: &str) -> &mut Vec<SetMember> {
        let name = local_name(set).to_uppercase();
        self.sets.entry(name).or_default()
    }

    /// Reads the data of `*NSET` or `*ELSET`.
    pub(super) fn read(&mut self, card: &Card, set: &str) -> Result<()> {
        let mut members = Vec::new();
        if let Some(elements) = card.parameter("ELSET")?.filter(|_| card.keyword == "NSET") {
            let problem = format!("node set `{set}` is defined by element set `{elements}`");
            let remedy = "Remove it: every element set is also available as a set of its nodes";
            return Err(card.place.error(problem, remedy));
        }
        for line in &card.data {
            if card.has("GENERATE") {
                let values: Option<Vec<u64>> = line.values().map(|text| text.parse().ok()).collect();
                let (first, last, step) = match values.as_deref() {
                    Some(&[first, last]) => (first, last, 1),
                    Some(&[first, last, step]) => (first, last, step),
                    _ => (0, 0, 0),
                };
                if first == 0 || last < first || step == 0 {
                    let problem = format!("`{}` is not of the form FIRST, LAST, INCREMENT", line.text);
                    return Err(line.place.error(problem, "Give whole numbers with LAST ≥ FIRST ≥ 1, INCREMENT ≥ 1"));
                }
                members.push(SetMember::Range(first, last, step));
                continue;
            }
            for text in line.values().filter(|text| !text.is_empty()) {
                members.push(match text.parse() {
                    Ok(number) => SetMember::Written(number, line.place.clone()),
                    Err(_) => SetMember::Set(local_name(text).to_uppercase(), line.place.clone()),
                });
            }
        }
        self.entry(set).extend(members);
        Ok(())
    }

    /// Returns the numbers of the existing members of a set.
    pub(super) fn members(&self, set: &str, place: &SourceLine, draft: &MeshDraft) -> Result<BTreeSet<u64>> {
        let every: Vec<u64> = draft.elements.iter().map(|element| element.number).collect();
        self.resolve(local_name(set), place, &every, &|number| !draft.nodes_of(number).is_empty())
    }

    fn resolve(
        &self,
        set: &str,
        place: &SourceLine,
        every: &[u64],
        exists: &dyn Fn(u64) -> bool,
    ) -> Result<BTreeSet<u64>> {
        let (mut found, mut seen) = (BTreeSet::new(), BTreeSet::new());
        let mut open = vec![(set.to_owned(), place.clone())];
        while let Some((name, place)) = open.pop() {
            if !seen.insert(name.clone()) {
                continue;
            }
            let Some(members) = self.sets.get(&name) else {
                let names: Vec<&str> = self.sets.keys().take(20).map(String::as_str).collect();
                let problem = format!("set `{name}` is not defined");
                return Err(place.error(problem, format!("Choose one of these sets: {}", names.join(", "))));
            };
            for member in members {
                match member {
                    SetMember::Number(number) => _ = found.insert(*number),
                    SetMember::Written(number, place) => {
                        if !exists(*number) {
                            let problem = format!("set `{name}` contains {number}, which is not defined");
                            return Err(place.error(problem, "Correct the set, or export the complete mesh again"));
                        }
                        found.insert(*number);
                    }
                    SetMember::Range(first, last, step) => {
                        let inside = |number: &&u64| {
                            (*first..=*last).contains(number) && (*number - first).is_multiple_of(*step)
                        };
                        found.extend(every.iter().filter(inside));
                    }
                    SetMember::Set(other, place) => open.push((other.clone(), place.clone())),
                }
            }
        }
        Ok(found)
    }
}

impl InpSets {
    /// Converts every node set, and every element set as the set of its nodes.
    pub(crate) fn into_node_sets(self, draft: &mut MeshDraft) -> Result<()> {
        let nowhere = SourceLine { file: "".into(), line: 0 };
        let mut node_sets = BTreeMap::new();
        for name in self.elements.sets.keys() {
            let members = self.elements.members(name, &nowhere, draft)?;
            let nodes: BTreeSet<u64> = members.iter().flat_map(|&number| draft.nodes_of(number)).copied().collect();
            node_sets.insert(name.clone(), nodes);
        }
        for name in self.nodes.sets.keys() {
            let members = self.nodes.resolve(name, &nowhere, &draft.numbers, &|number| draft.has_node(number))?;
            if node_sets.get(name).is_some_and(|others| *others != members) {
                draft.notes.push(format!("`{name}` is both a node set and an element set: the node set is used"));
            }
            node_sets.insert(name.clone(), members);
        }
        draft.node_sets = node_sets;
        Ok(())
    }
}
