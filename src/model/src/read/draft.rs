//! Common intermediate form of all mesh formats: nodes and elements by their numbers in the file, sets by name.

use std::collections::{BTreeMap, BTreeSet, HashMap};

use super::EngineAxis;
use super::source::SourceLine;
use crate::element::ElementKind;
use crate::mesh::{Element, Mesh};
use crate::{Error, Result};

/// Element as read from a file.
#[derive(Debug, Clone)]
pub(super) struct DraftElement {
    /// Number in the file.
    pub number: u64,
    /// `None` for points, lines and faces, whose nodes can still form a set.
    pub kind: Option<ElementKind>,
    /// Node numbers in the file, already in the order of [`ElementKind`].
    pub nodes: Vec<u64>,
    /// Index of the material, if known.
    pub material: Option<usize>,
    /// Line in the file.
    pub place: SourceLine,
}

/// Mesh as read from a file.
#[derive(Debug, Default)]
pub(super) struct MeshDraft {
    /// Node numbers in the order of the file.
    pub numbers: Vec<u64>,
    /// Coordinates of the nodes, in the unit of the file.
    pub positions: Vec<[f64; 3]>,
    /// Index for each node number.
    index: HashMap<u64, usize>,
    /// Elements in the order of the file.
    pub elements: Vec<DraftElement>,
    /// Index for each element number.
    element_index: HashMap<u64, usize>,
    /// Node sets: numbers of nodes.
    pub node_sets: BTreeMap<String, BTreeSet<u64>>,
    /// Information for the user that needs no action.
    pub notes: Vec<String>,
    /// Differences from the results of the program that the file is written for.
    pub warnings: Vec<String>,
}

/// Mesh with the numbers of its nodes and elements in the file.
#[derive(Debug)]
pub(super) struct Numbered {
    /// The mesh.
    pub mesh: Mesh,
    /// Number of each node in the file.
    pub nodes: Vec<u64>,
    /// Number of each element in the file.
    pub elements: Vec<u64>,
    /// Material index of each element.
    pub materials: Vec<Option<usize>>,
}

impl MeshDraft {
    /// Adds a node. A number may be repeated with the same coordinates.
    pub(crate) fn add_node(&mut self, number: u64, position: [f64; 3], place: &dyn Fn() -> SourceLine) -> Result<()> {
        if let Some(&index) = self.index.get(&number) {
            if self.positions[index].map(f64::to_bits) == position.map(f64::to_bits) {
                return Ok(());
            }
            let problem = format!("node {number} is defined twice with different coordinates");
            return Err(place().error(problem, "Give every node a unique number"));
        }
        self.index.insert(number, self.numbers.len());
        self.numbers.push(number);
        self.positions.push(position);
        Ok(())
    }

    /// Adds an element.
    pub(crate) fn add_element(&mut self, element: DraftElement) -> Result<()> {
        if self.element_index.insert(element.number, self.elements.len()).is_some() {
            let problem = format!("element {} is defined twice", element.number);
            return Err(element.place.error(problem, "Give every element a unique number"));
        }
        self.elements.push(element);
        Ok(())
    }

    /// Returns whether there is a node with this number.
    pub(crate) fn has_node(&self, number: u64) -> bool {
        self.index.contains_key(&number)
    }

    /// Returns the element with this number.
    pub(super) fn element(&mut self, number: u64) -> Option<&mut DraftElement> {
        self.element_index.get(&number).map(|&index| &mut self.elements[index])
    }

    /// Returns the nodes of an element.
    pub(super) fn nodes_of(&self, number: u64) -> &[u64] {
        self.element_index.get(&number).map_or(&[], |&index| &self.elements[index].nodes)
    }

    /// Returns the mesh of the solid elements, with coordinates scaled by `scale` and rotated so that `axis` is z;
    /// nodes that belong to no solid element are omitted.
    pub(crate) fn into_mesh(
        mut self,
        scale: f64,
        axis: EngineAxis,
        what: &str,
    ) -> Result<(Numbered, Vec<String>, Vec<String>)> {
        let mut used = vec![false; self.numbers.len()];
        for element in &self.elements {
            self.check_nodes(element)?;
            if element.kind.is_some() {
                element.nodes.iter().for_each(|node| used[self.index[node]] = true);
            }
        }
        let solids = || self.elements.iter().filter(|element| element.kind.is_some());
        if solids().next().is_none() {
            let problem = "the file has no solid elements (tetrahedra, prisms, bricks)";
            let remedy = "Mesh the volume and export its elements: shells and faces are not supported";
            return Err(Error::read(what, problem, remedy));
        }
        self.check_overlaid()?;
        let kept: Vec<usize> = (0..self.numbers.len()).filter(|&index| used[index]).collect();
        let mut position = vec![usize::MAX; self.numbers.len()];
        kept.iter().enumerate().for_each(|(new, &old)| position[old] = new);
        let place =
            |number: &u64| self.index.get(number).map(|&index| position[index]).filter(|&new| new != usize::MAX);
        let sets = self.node_sets.iter().map(|(name, numbers)| {
            let mut nodes: Vec<usize> = numbers.iter().filter_map(place).collect();
            nodes.sort_unstable();
            (name.clone(), nodes)
        });
        let (sets, empty): (BTreeMap<String, Vec<usize>>, BTreeMap<_, _>) =
            sets.partition(|(_, nodes)| !nodes.is_empty());
        let element = |element: &DraftElement| {
            let nodes = element.nodes.iter().filter_map(place).collect();
            element.kind.map(|kind| Element { kind, nodes })
        };
        let numbered = Numbered {
            nodes: kept.iter().map(|&index| self.numbers[index]).collect(),
            elements: solids().map(|element| element.number).collect(),
            materials: solids().map(|element| element.material).collect(),
            mesh: Mesh {
                nodes: kept.iter().map(|&index| axis.turned(self.positions[index].map(|x| scale * x))).collect(),
                elements: self.elements.iter().filter_map(element).collect(),
                sets,
            },
        };
        if kept.len() < self.numbers.len() {
            let left_out = self.numbers.len() - kept.len();
            self.notes.push(format!("{left_out} nodes that belong to no solid element are ignored"));
        }
        if !empty.is_empty() {
            let names: Vec<&str> = empty.keys().map(String::as_str).collect();
            self.notes.push(format!("sets without nodes of solid elements are ignored: {}", names.join(", ")));
        }
        Ok((numbered, self.notes, self.warnings))
    }

    /// Rejects two solids on the same nodes, whose stiffness and mass would count twice.
    fn check_overlaid(&self) -> Result<()> {
        let mut first: HashMap<Vec<u64>, u64> = HashMap::with_capacity(self.elements.len());
        for element in self.elements.iter().filter(|element| element.kind.is_some()) {
            let mut nodes = element.nodes.clone();
            nodes.sort_unstable();
            if let Some(other) = first.insert(nodes, element.number) {
                let problem = format!("element {} has the same nodes as element {other}", element.number);
                let remedy = "Remove one of them, or its stiffness and mass are counted twice";
                return Err(element.place.error(problem, remedy));
            }
        }
        Ok(())
    }

    fn check_nodes(&self, element: &DraftElement) -> Result<()> {
        if let Some(node) = element.nodes.iter().find(|node| !self.index.contains_key(node)) {
            let problem = format!("element {} refers to node {node}, which is not defined", element.number);
            return Err(element.place.error(problem, "Add the node, or export the complete mesh again"));
        }
        let distinct: BTreeSet<&u64> = element.nodes.iter().collect();
        if element.kind.is_some() && distinct.len() < element.nodes.len() {
            let problem = format!("element {} is collapsed: it refers to a node twice", element.number);
            let remedy = "Use prisms and tetrahedra instead of collapsed bricks";
            return Err(element.place.error(problem, remedy));
        }
        Ok(())
    }
}
