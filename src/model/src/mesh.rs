//! Nodes, elements and named node sets.

use std::collections::{BTreeMap, HashMap};

use crate::{Error, Result, element::ElementKind};

/// Solid element.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Element {
    /// Kind.
    pub kind: ElementKind,
    /// Node indices (from 0) in the kind's order.
    pub nodes: Vec<usize>,
}

/// Finite-element mesh. All indices count from 0; exported files count from 1.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Mesh {
    /// Node coordinates (x, y, z) in m.
    pub nodes: Vec<[f64; 3]>,
    /// Elements.
    pub elements: Vec<Element>,
    /// Named sets of node indices, ascending.
    pub sets: BTreeMap<String, Vec<usize>>,
}

impl Mesh {
    /// Returns the coordinates of the nodes of an element in the order of the element (m).
    ///
    /// # Examples
    /// ```
    /// # use tiprub_model::{Material, Mesh, element::ElementKind, mesh::Element};
    /// # // Three cubes of 20 mm in a row along x, from a radius of 0.3 m; all nodes of ROOT are at the inner end.
    /// # let at = |i: usize, j: usize, k: usize| 4 * i + 2 * j + k;
    /// # let place = |n: usize| [0.3 + 0.02 * (n / 4) as f64, 0.02 * (n / 2 % 2) as f64 - 0.01, 0.02 * (n % 2) as f64];
    /// # let cube = |i: usize| Element {
    /// #     kind: ElementKind::Hex8,
    /// #     nodes: [0, 1].into_iter().flat_map(|k| [at(i, 0, k), at(i + 1, 0, k), at(i + 1, 1, k), at(i, 1, k)]).collect(),
    /// # };
    /// # let mesh = Mesh {
    /// #     nodes: (0..16).map(place).collect(),
    /// #     elements: (0..3).map(cube).collect(),
    /// #     sets: [("ROOT".to_owned(), (0..4).collect()), ("TIP".to_owned(), (12..16).collect())].into(),
    /// # };
    ///
    /// let corners = mesh.coordinates(&mesh.elements[0]);
    /// assert_eq!(corners.len(), 8);
    /// # Ok::<(), tiprub_model::Error>(())
    /// ```
    pub fn coordinates(&self, element: &Element) -> Vec<[f64; 3]> {
        element.nodes.iter().map(|&node| self.nodes[node]).collect()
    }

    /// Returns the nodes of a named set.
    ///
    /// # Examples
    /// ```
    /// # use tiprub_model::{Material, Mesh, element::ElementKind, mesh::Element};
    /// # // Three cubes of 20 mm in a row along x, from a radius of 0.3 m; all nodes of ROOT are at the inner end.
    /// # let at = |i: usize, j: usize, k: usize| 4 * i + 2 * j + k;
    /// # let place = |n: usize| [0.3 + 0.02 * (n / 4) as f64, 0.02 * (n / 2 % 2) as f64 - 0.01, 0.02 * (n % 2) as f64];
    /// # let cube = |i: usize| Element {
    /// #     kind: ElementKind::Hex8,
    /// #     nodes: [0, 1].into_iter().flat_map(|k| [at(i, 0, k), at(i + 1, 0, k), at(i + 1, 1, k), at(i, 1, k)]).collect(),
    /// # };
    /// # let mesh = Mesh {
    /// #     nodes: (0..16).map(place).collect(),
    /// #     elements: (0..3).map(cube).collect(),
    /// #     sets: [("ROOT".to_owned(), (0..4).collect()), ("TIP".to_owned(), (12..16).collect())].into(),
    /// # };
    ///
    /// assert_eq!(mesh.set("TIP")?, [12, 13, 14, 15]);
    /// assert!(mesh.set("HUB").is_err());
    /// # Ok::<(), tiprub_model::Error>(())
    /// ```
    ///
    /// # Errors
    /// [`Error::Invalid`] with a list of the existing sets.
    pub fn set(&self, name: &str) -> Result<&[usize]> {
        self.sets.get(name).map(Vec::as_slice).ok_or_else(|| {
            let names: Vec<_> = self.sets.keys().map(String::as_str).collect();
            Error::invalid(
                format!("node set `{name}`"),
                "the mesh has no set of this name",
                format!("Choose one of: {}", names.join(", ")),
            )
        })
    }

    /// Checks node counts and indices of the elements, coordinates, and that every node belongs to an element.
    ///
    /// # Examples
    /// ```
    /// # use tiprub_model::{Material, Mesh, element::ElementKind, mesh::Element};
    /// # // Three cubes of 20 mm in a row along x, from a radius of 0.3 m; all nodes of ROOT are at the inner end.
    /// # let at = |i: usize, j: usize, k: usize| 4 * i + 2 * j + k;
    /// # let place = |n: usize| [0.3 + 0.02 * (n / 4) as f64, 0.02 * (n / 2 % 2) as f64 - 0.01, 0.02 * (n % 2) as f64];
    /// # let cube = |i: usize| Element {
    /// #     kind: ElementKind::Hex8,
    /// #     nodes: [0, 1].into_iter().flat_map(|k| [at(i, 0, k), at(i + 1, 0, k), at(i + 1, 1, k), at(i, 1, k)]).collect(),
    /// # };
    /// # let mesh = Mesh {
    /// #     nodes: (0..16).map(place).collect(),
    /// #     elements: (0..3).map(cube).collect(),
    /// #     sets: [("ROOT".to_owned(), (0..4).collect()), ("TIP".to_owned(), (12..16).collect())].into(),
    /// # };
    ///
    /// mesh.validate()?;
    /// # Ok::<(), tiprub_model::Error>(())
    /// ```
    ///
    /// # Errors
    /// [`Error::Invalid`] with the element, node or set.
    pub fn validate(&self) -> Result<()> {
        if let Some(index) = self.nodes.iter().position(|node| node.iter().any(|x| !x.is_finite())) {
            let problem = format!("coordinates {:?} are not finite", self.nodes[index]);
            return Err(Error::invalid(format!("node {}", index + 1), problem, "Correct the mesh"));
        }
        let mut used = vec![false; self.nodes.len()];
        for (index, element) in self.elements.iter().enumerate() {
            let what = || format!("element {} ({})", index + 1, element.kind.calculix_name());
            if element.nodes.len() != element.kind.node_count() {
                let problem = format!("it has {} nodes instead of {}", element.nodes.len(), element.kind.node_count());
                return Err(Error::invalid(what(), problem, "Correct the element"));
            }
            for &node in &element.nodes {
                let Some(flag) = used.get_mut(node) else {
                    let problem = format!("node {} does not exist; the mesh has {} nodes", node + 1, self.nodes.len());
                    return Err(Error::invalid(what(), problem, "Correct the element"));
                };
                *flag = true;
            }
        }
        if let Some(node) = used.iter().position(|&flag| !flag) {
            let problem = "it belongs to no element, so it has neither stiffness nor mass";
            return Err(Error::invalid(format!("node {}", node + 1), problem, "Remove it from the mesh"));
        }
        for (name, nodes) in &self.sets {
            if let Some(&node) = nodes.iter().find(|&&node| node >= self.nodes.len()) {
                let problem = format!("node {} does not exist; the mesh has {} nodes", node + 1, self.nodes.len());
                return Err(Error::invalid(format!("node set `{name}`"), problem, "Correct the set"));
            }
        }
        Ok(())
    }

    /// Returns the mesh with quadratic elements: a node is added in the middle of every edge of a linear element.
    ///
    /// # Examples
    /// ```
    /// # use tiprub_model::{Material, Mesh, element::ElementKind, mesh::Element};
    /// # // Three cubes of 20 mm in a row along x, from a radius of 0.3 m; all nodes of ROOT are at the inner end.
    /// # let at = |i: usize, j: usize, k: usize| 4 * i + 2 * j + k;
    /// # let place = |n: usize| [0.3 + 0.02 * (n / 4) as f64, 0.02 * (n / 2 % 2) as f64 - 0.01, 0.02 * (n % 2) as f64];
    /// # let cube = |i: usize| Element {
    /// #     kind: ElementKind::Hex8,
    /// #     nodes: [0, 1].into_iter().flat_map(|k| [at(i, 0, k), at(i + 1, 0, k), at(i + 1, 1, k), at(i, 1, k)]).collect(),
    /// # };
    /// # let mesh = Mesh {
    /// #     nodes: (0..16).map(place).collect(),
    /// #     elements: (0..3).map(cube).collect(),
    /// #     sets: [("ROOT".to_owned(), (0..4).collect()), ("TIP".to_owned(), (12..16).collect())].into(),
    /// # };
    ///
    /// let quadratic = mesh.quadratic();
    /// assert_eq!(quadratic.elements[0].nodes.len(), 20);
    /// # Ok::<(), tiprub_model::Error>(())
    /// ```
    #[must_use]
    pub fn quadratic(&self) -> Self {
        let mut mesh = self.clone();
        let mut middles: HashMap<(usize, usize), usize> = HashMap::new();
        for element in &mut mesh.elements {
            if element.kind == element.kind.quadratic() {
                continue;
            }
            for &[a, b] in element.kind.edges() {
                let (a, b) = (element.nodes[a], element.nodes[b]);
                let middle = *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                    let (p, q) = (mesh.nodes[a], mesh.nodes[b]);
                    mesh.nodes.push(core::array::from_fn(|i| 0.5 * (p[i] + q[i])));
                    mesh.nodes.len() - 1
                });
                element.nodes.push(middle);
            }
            element.kind = element.kind.quadratic();
        }
        mesh
    }
}

/// Returns the corner nodes of the outer faces, three or four per face, counter-clockwise seen from outside.
///
/// A face is an outer face if it belongs to a single element.
///
/// # Examples
/// ```
/// # use tiprub_model::{Material, Mesh, element::ElementKind, mesh::Element};
/// # // Three cubes of 20 mm in a row along x, from a radius of 0.3 m; all nodes of ROOT are at the inner end.
/// # let at = |i: usize, j: usize, k: usize| 4 * i + 2 * j + k;
/// # let place = |n: usize| [0.3 + 0.02 * (n / 4) as f64, 0.02 * (n / 2 % 2) as f64 - 0.01, 0.02 * (n % 2) as f64];
/// # let cube = |i: usize| Element {
/// #     kind: ElementKind::Hex8,
/// #     nodes: [0, 1].into_iter().flat_map(|k| [at(i, 0, k), at(i + 1, 0, k), at(i + 1, 1, k), at(i, 1, k)]).collect(),
/// # };
/// # let mesh = Mesh {
/// #     nodes: (0..16).map(place).collect(),
/// #     elements: (0..3).map(cube).collect(),
/// #     sets: [("ROOT".to_owned(), (0..4).collect()), ("TIP".to_owned(), (12..16).collect())].into(),
/// # };
///
/// // Three cubes in a row have 14 outer faces.
/// assert_eq!(tiprub_model::surface_quads(&mesh).len(), 14);
/// # Ok::<(), tiprub_model::Error>(())
/// ```
pub fn surface_quads(mesh: &Mesh) -> Vec<Vec<usize>> {
    let mut count: HashMap<Vec<usize>, usize> = HashMap::new();
    let faces: Vec<Vec<usize>> = mesh
        .elements
        .iter()
        .flat_map(|element| {
            element.kind.faces().iter().map(|face| face.iter().map(|&corner| element.nodes[corner]).collect())
        })
        .collect();
    let sorted = |face: &Vec<usize>| {
        let mut key = face.clone();
        key.sort_unstable();
        key
    };
    for face in &faces {
        *count.entry(sorted(face)).or_default() += 1;
    }
    faces.into_iter().filter(|face| count[&sorted(face)] == 1).collect()
}

/// Lists sets with their numbers of nodes, for messages.
///
/// # Examples
/// ```
/// let sets = [("TIP".to_owned(), vec![4, 5]), ("ROOT".to_owned(), vec![0])].into();
/// assert_eq!(tiprub_model::mesh::set_counts(&sets), "ROOT (1), TIP (2)");
/// ```
pub fn set_counts(sets: &BTreeMap<String, Vec<usize>>) -> String {
    let counts: Vec<String> = sets.iter().map(|(name, nodes)| format!("{name} ({})", nodes.len())).collect();
    counts.join(", ")
}
