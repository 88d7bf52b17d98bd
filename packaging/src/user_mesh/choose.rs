//! Chooses contact nodes, clamped nodes and faces from the sets of an imported model.

use tiprub_model::{
    FeModel, Mesh,
    casing::GridNodes,
    cyclic::{CyclicBoundary, PairingReport},
    patches::{FoundTip, find_root, find_tip, places_along_chord, row_name, tip_patches},
    read::{ContactChoice, Imported, choose_contact_nodes, set_counts},
    reduce::ContactPoint,
    stress::StressPlaces,
};
use tiprub_shell::{Failure, Result};

use super::failure;
use crate::mesh_arguments::{BladeOptions, CasingMeshArguments, ModelOptions, SectorArguments, TipOptions};

/// Largest distance between corresponding nodes of the two faces of a sector, as a fraction of the largest radius.
const FACE_TOLERANCE: f64 = 1e-5;

/// Nodes and options of the reduction, chosen from the input.
pub struct Chosen {
    /// Points at which the ROM recovers stress.
    pub stress: StressPlaces,
    /// Clamped nodes, ascending.
    pub clamped: Vec<usize>,
    /// Contact nodes.
    pub contact: Vec<ContactPoint>,
    /// Faces of a sector.
    pub faces: Option<(CyclicBoundary, PairingReport)>,
    /// Contact nodes of a casing.
    pub grid: Option<GridNodes>,
    /// Blade tip found in the mesh, and true if contact uses it because no set was named.
    pub tip: Option<(FoundTip, bool)>,
    /// Nodes of the contact set that can move, if it names the whole tip instead of single contact nodes; else empty.
    pub tip_set: Vec<usize>,
    /// Nodes of the blade root found in the mesh, ascending; empty without a mesh.
    pub root: Vec<usize>,
}

/// Default number of patches along the chord: more change little, fewer a lot.
pub const PATCHES: usize = 9;
/// Default number of rows of patches across the thickness, which lie at the sides of the tip.
const ROWS: usize = 2;
/// Largest set whose nodes are single contact nodes. Larger sets name a tip.
const SMALL_SET: usize = 12;

/// Chooses the nodes for blades, or for a sector between its faces.
///
/// # Errors
/// Sets are missing or inconsistent.
pub fn tips(
    imported: &Imported,
    options: &ModelOptions,
    tips: &TipOptions,
    sector: Option<&SectorArguments>,
) -> Result<Chosen> {
    let clamped = clamped_nodes(imported, &options.clamp_set)?;
    let faces = sector.map(|sector| pair_faces(imported, sector)).transpose()?;
    let mut fixed = clamped.clone();
    if let Some((boundary, _)) = &faces {
        fixed.extend(boundary.pairs.iter().flatten());
        fixed.sort_unstable();
    }
    let (free, by_number, tip) = candidates(imported, options, &fixed)?;
    let names_nodes = options.contact_set.is_some() && (by_number || free.len() <= SMALL_SET);
    let mesh = imported.model.mesh.as_ref().map(|(mesh, _)| mesh);
    let default_mesh = mesh.filter(|_| !names_nodes && tips.contact_nodes.is_none());
    let patch_count =
        tips.contact_patches.or_else(|| default_mesh.map(|mesh| default_patches(tips, &tip, mesh, &free)));
    if let (Some(_), None) = (tips.contact_rows, patch_count) {
        let problem = "rows require contact patches, but contact is at the nodes of the set";
        return Err(Failure::usage(
            "--contact-rows",
            problem,
            "Give the number of patches along the chord, for example --contact-patches 9",
        ));
    }
    let contact = if let Some(count) = patch_count {
        let in_rows = |rows: usize| patches(imported, &free, [count, rows], &tips.contact_names);
        match tips.contact_rows {
            Some(rows) => in_rows(rows)?,
            // A coarse tip may not resolve two rows.
            None => in_rows(ROWS).or_else(|_| in_rows(1))?,
        }
    } else {
        // Nodes given by number are all used.
        let count = tips.contact_nodes.or(by_number.then_some(free.len()));
        let choice = ContactChoice { count, names: tips.contact_names.clone() };
        choose_contact_nodes(&imported.model.nodes, &free, &choice).map_err(failure)?
    };
    let is_tip = options.contact_set.is_some() && (tips.contact_patches.is_some() || !names_nodes);
    let tip_set = if is_tip { free } else { Vec::new() };
    let root = mesh.map_or(Vec::new(), find_root);
    Ok(Chosen { stress: StressPlaces::default(), clamped, contact, faces, grid: None, tip, tip_set, root })
}

/// Candidates for contact nodes, true if they were given by number, and the tip with true if the candidates are its nodes.
type Candidates = (Vec<usize>, bool, Option<(FoundTip, bool)>);

/// Returns the nodes of the contact set, or of the tip if there is no set.
fn candidates(imported: &Imported, options: &ModelOptions, fixed: &[usize]) -> Result<Candidates> {
    let mesh = imported.model.mesh.as_ref().map(|(mesh, _)| mesh);
    let found = mesh.map(|mesh| find_tip(mesh, fixed).map_err(failure)).transpose();
    if options.contact_set.is_some() {
        let (free, by_number) = free_contact_nodes(imported, options, fixed)?;
        return Ok((free, by_number, found.ok().flatten().map(|tip| (tip, false))));
    }
    let tip = found?.ok_or_else(|| missing(imported, "--contact-set"))?;
    Ok((tip.nodes.clone(), false, Some((tip, true))))
}

/// Returns the default number of patches: the number of names, else nine, or as many as a coarse tip or contact set permits.
fn default_patches(tips: &TipOptions, tip: &Option<(FoundTip, bool)>, mesh: &Mesh, set: &[usize]) -> usize {
    match tips.contact_names.len() {
        0 => tip.as_ref().map_or(PATCHES, |(tip, _)| tip.at_most(PATCHES)).min(places_along_chord(mesh, set)),
        named => named,
    }
}

/// Returns the patches of the faces whose nodes are all in the contact set.
fn patches(
    imported: &Imported,
    set: &[usize],
    [count, rows]: [usize; 2],
    names: &[String],
) -> Result<Vec<ContactPoint>> {
    let Some((mesh, _)) = &imported.model.mesh else {
        let problem = "contact patches require a mesh";
        return Err(Failure::usage("--contact-patches", problem, "Give a mesh file, or use --contact-nodes"));
    };
    if !names.is_empty() && names.len() != count {
        let problem = format!("{} names for {count} contact patches", names.len());
        return Err(Failure::usage("--contact-names", problem, "Give one name per patch, in order of increasing z"));
    }
    let along = |index: usize| names.get(index).cloned().unwrap_or_else(|| format!("patch_{}", index + 1));
    let name = |index: usize| row_name(&along(index % count), index / count, rows);
    tip_patches(mesh, set, [count, rows], name).map_err(failure)
}

/// Returns the edges and the middle of a tip with patches as watched points; empty for contact nodes, whose displacements are outputs anyway.
///
/// # Errors
/// Does not fail for patches from [`tips`].
pub fn watched(model: &FeModel, contact: &[ContactPoint]) -> Result<Vec<ContactPoint>> {
    let mut set: Vec<usize> = contact.iter().flat_map(|point| point.patch.iter().map(|(node, _)| *node)).collect();
    set.sort_unstable();
    set.dedup();
    if set.is_empty() {
        return Ok(Vec::new());
    }
    let names: Vec<String> = ["edge_1", "mid_chord", "edge_2"].map(String::from).to_vec();
    let choice = ContactChoice { count: Some(names.len()), names };
    choose_contact_nodes(&model.nodes, &set, &choice).map_err(failure)
}

/// Largest number of points of a set: each has seven outputs per watched sector.
const MOST_PLACES: usize = 1000;

/// Returns the points at which the ROM of blades recovers stress.
///
/// # Errors
/// Sets are missing or too large.
pub fn stress(imported: &Imported, options: &BladeOptions) -> Result<StressPlaces> {
    let mut places = StressPlaces { nodes: Vec::new(), modes: options.stress_modes.unwrap_or(0) };
    if let Some(name) = &options.stress_set {
        let (nodes, _) = nodes_of(imported, name, "--stress-set")?;
        if nodes.len() > MOST_PLACES {
            let problem = format!("the set has {} nodes, but at most {MOST_PLACES} are allowed", nodes.len());
            return Err(Failure::usage("--stress-set", problem, "Give a smaller set with the nodes of interest"));
        }
        let named = |node: usize| (format!("node_{}", imported.node_numbers[node]), node);
        places.nodes = nodes.into_iter().map(named).collect();
    }
    Ok(places)
}

/// Chooses the nodes for a casing.
///
/// # Errors
/// Sets are missing, or do not contain the grid.
pub fn grid(imported: &Imported, options: &CasingMeshArguments) -> Result<Chosen> {
    let name = named_set(imported, options.model.contact_set.as_deref(), "--contact-set")?;
    let clamped = clamped_nodes(imported, &options.model.clamp_set)?;
    free_contact_nodes(imported, &options.model, &clamped)?;
    let (set, _) = nodes_of(imported, name, "--contact-set")?;
    let Some((mesh, _)) = &imported.model.mesh else { return Err(super::no_mesh()) };
    let grid =
        GridNodes::chosen(mesh, (&set, &clamped), options.contact_grid, options.contact_axial).map_err(failure)?;
    Ok(Chosen {
        stress: StressPlaces::default(),
        clamped,
        contact: grid.contact_points(),
        faces: None,
        grid: Some(grid),
        tip: None,
        tip_set: Vec::new(),
        root: Vec::new(),
    })
}

/// Returns the contact nodes that are not among the `fixed` ones, and whether they were given by number.
fn free_contact_nodes(imported: &Imported, options: &ModelOptions, fixed: &[usize]) -> Result<(Vec<usize>, bool)> {
    let name = named_set(imported, options.contact_set.as_deref(), "--contact-set")?;
    let (nodes, by_number) = nodes_of(imported, name, "--contact-set")?;
    let free: Vec<usize> = nodes.into_iter().filter(|node| fixed.binary_search(node).is_err()).collect();
    if free.is_empty() {
        let problem = "all nodes of the set are clamped or lie on the cyclic faces";
        return Err(Failure::new(format!("--contact-set {name}"), problem, "Choose a set whose nodes can move"));
    }
    Ok((free, by_number))
}

fn pair_faces(imported: &Imported, options: &SectorArguments) -> Result<(CyclicBoundary, PairingReport)> {
    let nodes = &imported.model.nodes;
    let radius = nodes.iter().map(|[x, y, _]| x.hypot(*y)).fold(0.0, f64::max);
    let tolerance = options.cyclic_tolerance.unwrap_or(FACE_TOLERANCE * radius);
    let (low, high) = (set(imported, &options.cyclic_low)?, set(imported, &options.cyclic_high)?);
    CyclicBoundary::pair(nodes, low, high, options.sectors as usize, tolerance).map_err(failure)
}

fn sets_of(imported: &Imported) -> String {
    if imported.model.sets.is_empty() {
        return "the model has no sets: define groups of nodes, elements or faces in the mesh generator".into();
    }
    format!("sets of the model with their node counts: {}", set_counts(&imported.model.sets))
}

fn named_set<'a>(imported: &Imported, name: Option<&'a str>, option: &str) -> Result<&'a str> {
    name.ok_or_else(|| missing(imported, option))
}

fn missing(imported: &Imported, option: &str) -> Failure {
    Failure::usage(option, "no set is given", format!("Give a set; {}", sets_of(imported)))
}

fn set<'a>(imported: &'a Imported, name: &str) -> Result<&'a [usize]> {
    imported.model.set(name).map_err(failure)
}

/// Returns the nodes of a set, or those whose numbers in the file are listed (then true), ascending.
pub fn nodes_of(imported: &Imported, text: &str, option: &str) -> Result<(Vec<usize>, bool)> {
    let numbers: Result<Vec<u64>, _> = text.split(',').map(|part| part.trim().parse::<u64>()).collect();
    let (Ok(numbers), false) = (numbers, imported.model.sets.contains_key(text)) else {
        return Ok((set(imported, text)?.to_vec(), false));
    };
    let mut nodes = Vec::with_capacity(numbers.len());
    for number in numbers {
        let found = imported.node_numbers.iter().position(|own| *own == number);
        nodes.push(found.ok_or_else(|| {
            let remedy =
                "Give the name of a set, or node numbers of the file that belong to solid elements, such as 12,57,103";
            Failure::new(format!("{option} {text}"), format!("the model has no node {number}"), remedy)
        })?);
    }
    nodes.sort_unstable();
    nodes.dedup();
    Ok((nodes, true))
}

/// Returns all clamped nodes, ascending.
fn clamped_nodes(imported: &Imported, names: &[String]) -> Result<Vec<usize>> {
    let mut clamped = imported.absent.clone();
    let free = matches!(names, [only] if only.eq_ignore_ascii_case("none"));
    if names.is_empty() && clamped.is_empty() {
        let held = match imported.held.as_slice() {
            [] => String::new(),
            held => format!(
                "; *BOUNDARY in the file fixes {}",
                held.iter().take(10).cloned().collect::<Vec<_>>().join(", ")
            ),
        };
        let remedy = format!("Give the set of clamped nodes, or `none`; {}{held}", sets_of(imported));
        return Err(Failure::usage("--clamp-set", "no set is given", remedy));
    }
    for name in names.iter().filter(|_| !free) {
        // With matrices, the set was already left out when they were read.
        clamped.extend(nodes_of(imported, name, "--clamp-set")?.0);
    }
    clamped.sort_unstable();
    clamped.dedup();
    Ok(clamped)
}
