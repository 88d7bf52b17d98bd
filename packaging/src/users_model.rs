//! A finite-element model of one's own: read, judged, reduced, told about.

use std::{cell::RefCell, fmt::Write as _, path::Path};

use serde_json::{Value, json};
use tiprub_core::{Rom, rom::Frame};
use tiprub_gallery::reduction::{self, with_progress};
use tiprub_model::{
    CasingOptions, FeModel, Material, Reduction,
    casing::{self, CasingReductionOptions, GridNodes},
    cyclic::{CyclicBoundary, CyclicOptions, ModeSelection, PairingReport, reduce_cyclic},
    element::Formulation,
    read::{
        ContactChoice, Imported, MatrixFiles, MeshOptions, bounding_box, choose_contact_nodes, plausibility,
        read_matrices, read_mesh, set_counts, total_mass,
    },
    reduce::{ContactPoint, ReductionOptions},
    reduce_casing, reduce_model,
    thermal::equal_patches,
};
use tiprub_shell::{Failure, Result, console::Console};

use crate::{
    casing_arguments::CasingArguments,
    cli::{Model, ReduceArguments},
    file_arguments::{FileArguments, UnitChoice},
    reduced::Reduced,
};

/// Fixed-interface modes, modes compared with the full model, and damping ratio where none are given.
const MODES: usize = 25;
const CHECKED_MODES: usize = 10;
const DAMPING: f64 = 0.005;

/// Names of the sets of all clamped nodes and of the two faces in exported files.
const CLAMPED: &str = casing::CLAMPED;
const FACES: [&str; 2] = ["CYCLIC_LOW", "CYCLIC_HIGH"];

/// First natural frequencies (Hz) of things that are built lie in here.
const USUAL_FREQUENCIES: [f64; 2] = [1.0, 1e6];

/// Share of the largest radius by which nodes of the two faces of a sector may miss each other.
const FACE_TOLERANCE: f64 = 1e-5;

/// What is reduced, chosen from what was read.
struct Chosen {
    clamped: Vec<usize>,
    contact: Vec<ContactPoint>,
    faces: Option<(CyclicBoundary, PairingReport)>,
    /// Contact nodes of a casing.
    grid: Option<GridNodes>,
}

/// Read, choose, reduce.
///
/// # Errors
/// Files and sets, naming file, line and remedy; options that do not go together; and whatever the reduction refuses.
pub fn reduce(arguments: &ReduceArguments, console: &Console) -> Result<Reduced> {
    refuse_other_options(arguments)?;
    let imported = import(arguments, console)?;
    let asked = &arguments.file;
    let mut warnings = imported.warnings.clone();
    warnings.extend(judge(&imported, asked)?);
    let chosen = choose(&imported, arguments)?;
    let read = describe(&imported, asked, &chosen);
    let name = name(arguments);
    warnings.extend(radius_warning(&imported, &chosen));
    let mut model = imported.model;
    let clamped = (!chosen.clamped.is_empty()).then_some(CLAMPED);
    if let Some((mesh, _)) = model.mesh.as_mut().filter(|_| clamped.is_some()) {
        mesh.sets.insert(CLAMPED.to_owned(), chosen.clamped.clone());
    }
    let mut reduced = match (&chosen.faces, &chosen.grid) {
        (_, Some(grid)) => {
            let reduction = ring(arguments, model, &imported.materials, &chosen.clamped, grid, name, console)?;
            Reduced::general(reduction, clamped)
        }
        (None, None) => Reduced::general(general(arguments, model, &chosen, name, console)?, clamped),
        (Some((boundary, _)), None) => cyclic(arguments, model, &chosen, boundary, name, console)?,
    };
    let notes = core::mem::take(&mut reduced.read.0);
    reduced.read = read;
    for note in notes.lines() {
        let _ = write!(reduced.read.0, "\n  note: {note}");
    }
    warnings.extend(frequency_warning(&reduced.rom, clamped.is_none()));
    reduced.warnings = warnings;
    Ok(reduced)
}

fn general(
    arguments: &ReduceArguments,
    model: FeModel,
    chosen: &Chosen,
    name: String,
    console: &Console,
) -> Result<Reduction> {
    let asked = &arguments.file;
    let title = format!("Reducing {name}");
    let options = ReductionOptions {
        name,
        fixed_interface_modes: arguments.modes.unwrap_or(MODES),
        checked_modes: CHECKED_MODES,
        sectors: asked.sectors.unwrap_or(1) as usize,
        frame: Frame::Cylindrical,
        damping_ratio: asked.damping.unwrap_or(DAMPING),
    };
    let model = RefCell::new(Some(model));
    with_progress(&title, console, &|listener| {
        // The matrices are handed over, not copied.
        let model = model.take().ok_or_else(|| tiprub_model::Error::invalid("model", "it is reduced already", ""))?;
        reduce_model(model, &chosen.clamped, &chosen.contact, &options, arguments.spin, listener)
    })
}

/// A casing whose contact nodes form a grid.
fn ring(
    arguments: &ReduceArguments,
    model: FeModel,
    materials: &[Material],
    clamped: &[usize],
    grid: &GridNodes,
    name: String,
    console: &Console,
) -> Result<Reduction> {
    let asked = &arguments.casing;
    let (Some((mesh, material)), [_]) = (model.mesh, materials) else {
        let problem = "a casing is reduced from a mesh of one material";
        return Err(Failure::usage("--contact-grid", problem, "Give a mesh file whose elements share one material"));
    };
    let [low, high] = bounding_box(&mesh.nodes);
    let [around, along] = asked.patches.unwrap_or([0, 0]);
    let patches = equal_patches(around, along, [low[2], high[2]]);
    let title = format!("Reducing {name}");
    let defaults = CasingOptions::default();
    let options = CasingReductionOptions {
        name,
        formulation: Formulation::Displacement,
        fixed_interface_modes: asked.fixed_interface_modes.unwrap_or(defaults.fixed_interface_modes),
        modes: arguments.modes.unwrap_or(defaults.modes),
        checked_modes: CHECKED_MODES,
        damping_ratio: arguments.file.damping.unwrap_or(DAMPING),
    };
    let mesh = RefCell::new(Some(mesh));
    with_progress(&title, console, &|listener| {
        let mesh = mesh.take().ok_or_else(|| tiprub_model::Error::invalid("model", "it is reduced already", ""))?;
        reduce_casing(mesh, &material, clamped, grid, &patches, &options, listener)
    })
}

fn cyclic(
    arguments: &ReduceArguments,
    model: FeModel,
    chosen: &Chosen,
    boundary: &CyclicBoundary,
    name: String,
    console: &Console,
) -> Result<Reduced> {
    let asked = &arguments.file;
    let title = format!("Reducing {name}");
    let options = CyclicOptions {
        name,
        modes: ModeSelection::Families(arguments.modes.unwrap_or(MODES)),
        checked_modes: CHECKED_MODES,
        damping_ratio: asked.damping.unwrap_or(DAMPING),
    };
    let Chosen { clamped, contact, .. } = chosen;
    let reduction = with_progress(&title, console, &|listener| {
        reduce_cyclic(&model, clamped, contact, boundary, &options, listener)
    })?;
    let (nodes, held) = (model.nodes.len(), (!clamped.is_empty()).then_some(CLAMPED));
    let mut mesh = model.mesh;
    if let Some((mesh, _)) = &mut mesh {
        for (face, side) in FACES.iter().zip([0, 1]) {
            let mut face_nodes: Vec<usize> = boundary.pairs.iter().map(|pair| pair[side]).collect();
            face_nodes.sort_unstable();
            mesh.sets.insert((*face).to_owned(), face_nodes);
        }
    }
    Ok(Reduced::cyclic(reduction, mesh, nodes, held, FACES))
}

fn choose(imported: &Imported, arguments: &ReduceArguments) -> Result<Chosen> {
    let asked = &arguments.file;
    let contact_set = named_set(imported, asked.contact_set.as_deref(), "--contact-set")?;
    let (contact_nodes, by_number) = nodes_of(imported, contact_set, "--contact-set")?;
    let clamped = clamped_nodes(imported, &asked.clamp_set)?;
    let faces = pair_faces(imported, asked)?;
    let mut fixed = clamped.clone();
    if let Some((boundary, _)) = &faces {
        fixed.extend(boundary.pairs.iter().flatten());
        fixed.sort_unstable();
    }
    let free: Vec<usize> = contact_nodes.into_iter().filter(|node| fixed.binary_search(node).is_err()).collect();
    if free.is_empty() {
        let problem = "all of its nodes are clamped or lie on the faces to the neighbours";
        return Err(Failure::new(format!("--contact-set {contact_set}"), problem, "Choose a set whose nodes can move"));
    }
    if let Some([around, along]) = arguments.casing.contact_grid {
        let Some((mesh, _)) = &imported.model.mesh else {
            let remedy = "Give a mesh file instead of matrices";
            return Err(Failure::usage("--contact-grid", "a casing is reduced from a mesh", remedy));
        };
        let axial = arguments.casing.contact_axial;
        let grid = GridNodes::chosen(mesh, &free, around, along, axial).map_err(failure)?;
        return Ok(Chosen { clamped, contact: grid.contact_points(), faces, grid: Some(grid) });
    }
    // Nodes given one by one are all meant.
    let count = arguments.contact_nodes.or(by_number.then_some(free.len()));
    let choice = ContactChoice { count, names: asked.contact_names.clone() };
    let contact = choose_contact_nodes(&imported.model.nodes, &free, &choice).map_err(failure)?;
    Ok(Chosen { clamped, contact, faces, grid: None })
}

fn pair_faces(imported: &Imported, asked: &FileArguments) -> Result<Option<(CyclicBoundary, PairingReport)>> {
    let (Some(low), Some(high), Some(sectors)) = (&asked.cyclic_low, &asked.cyclic_high, asked.sectors) else {
        return Ok(None);
    };
    let nodes = &imported.model.nodes;
    let radius = nodes.iter().map(|[x, y, _]| x.hypot(*y)).fold(0.0, f64::max);
    let tolerance = asked.cyclic_tolerance.unwrap_or(FACE_TOLERANCE * radius);
    CyclicBoundary::pair(nodes, set(imported, low)?, set(imported, high)?, sectors as usize, tolerance)
        .map(Some)
        .map_err(failure)
}

fn refuse_other_options(arguments: &ReduceArguments) -> Result<()> {
    let casing = &arguments.casing;
    let shared =
        CasingArguments { material: casing.material, expansion: casing.expansion, ..CasingArguments::default() };
    // With a contact grid the model is a casing.
    let of_grid = CasingArguments {
        contact_grid: casing.contact_grid,
        contact_axial: casing.contact_axial,
        patches: casing.patches,
        fixed_interface_modes: casing.fixed_interface_modes,
        ..shared.clone()
    };
    let expected = if casing.contact_grid.is_some() { of_grid } else { shared };
    if *casing != expected || arguments.mesh.is_some() {
        let remedy = "Leave out --mesh and what `tiprub reduce --help` lists as options of `casing`";
        return Err(Failure::usage("MODEL", "an option given describes a casing or a blade that ships", remedy));
    }
    let file = &arguments.file;
    let of_blades = file.sectors.is_some()
        || !file.contact_names.is_empty()
        || arguments.contact_nodes.is_some()
        || arguments.spin.is_some();
    if casing.contact_grid.is_some() && of_blades {
        let problem = "it makes the model a casing, and an option given describes blades";
        let remedy = "Leave out --sectors, the cyclic faces, --contact-names, --contact-nodes and --spin";
        return Err(Failure::usage("--contact-grid", problem, remedy));
    }
    if arguments.coarse {
        return Err(Failure::usage("--coarse", "it belongs to `stage`", "Leave it out"));
    }
    if file.cyclic_low.is_some() && arguments.spin.is_some() {
        let remedy = "Leave --spin out, or --cyclic-low and --cyclic-high: blades that know nothing of each other";
        return Err(Failure::usage("--spin", "the effects of spin are not computed for coupled sectors", remedy));
    }
    if arguments.spin.is_some() && file.stiffness.is_some() {
        let remedy = "Leave it out, or give a mesh file of one material instead of matrices";
        return Err(Failure::usage("--spin", "the effects of spin are computed from a mesh", remedy));
    }
    Ok(())
}

fn import(arguments: &ReduceArguments, console: &Console) -> Result<Imported> {
    let asked = &arguments.file;
    let material = asked.material(arguments.casing.material, arguments.casing.expansion)?;
    let mesh = match &arguments.model {
        Some(Model::File(path)) => Some(path),
        _ => None,
    };
    let (Some(stiffness), Some(mass)) = (&asked.stiffness, &asked.mass) else {
        let Some(path) = mesh else {
            return Err(Failure::usage("MODEL", "there is no file", "Give a mesh file, or --stiffness and --mass"));
        };
        let options =
            MeshOptions { units: asked.units(), axis: asked.axis(), material, temperature: asked.temperature };
        let title = format!("Reading {}", path.display());
        return with_progress(&title, console, &|listener| read_mesh(path, &options, listener));
    };
    if material.is_some() {
        let remedy = "Leave --material, --young, --poisson and --density out";
        return Err(Failure::usage("--stiffness", "matrices hold their material", remedy));
    }
    let nodes = match (&asked.nodes, mesh) {
        (Some(_), Some(_)) => {
            let remedy = "Give one of them: a mesh file whose nodes and sets are taken, or a table with --nodes";
            return Err(Failure::usage("--nodes", "the nodes are given twice", remedy));
        }
        (Some(nodes), None) | (None, Some(nodes)) => nodes.clone(),
        (None, None) => {
            let remedy = "Give --nodes FILE (lines NODE,X,Y,Z,SETS) or the mesh file of the model";
            return Err(Failure::usage("--stiffness", "the positions of the nodes are missing", remedy));
        }
    };
    let files = MatrixFiles {
        stiffness: stiffness.clone(),
        mass: mass.clone(),
        nodes,
        dofs: asked.dofs.clone(),
        units: asked.units(),
        axis: asked.axis(),
        left_out: asked.clamp_set.clone(),
    };
    console.say(format_args!("Reading {} and {}", stiffness.display(), mass.display()));
    read_matrices(&files).map_err(failure)
}

fn failure(error: tiprub_model::Error) -> Failure {
    reduction::failure("model", error)
}

/// What cannot be meant is refused, unless the units are said to be SI; what is unusual is asked about.
fn judge(imported: &Imported, asked: &FileArguments) -> Result<Vec<String>> {
    let found = plausibility(&imported.model, &imported.materials);
    let question = |list: &[String]| format!("{}: is that meant?", list.join("; "));
    let mut warnings = Vec::new();
    if !found.impossible.is_empty() {
        if asked.units != Some(UnitChoice::Metre) {
            let remedy = match asked.units {
                _ if asked.young.is_some() && found.impossible.iter().all(|text| text.starts_with("material")) => {
                    "--young and --density are in SI units, Pa and kg/m³, whatever the file's units are"
                }
                None => {
                    "If lengths are in mm, masses in t and stresses in MPa, say --units mm-t-s; if it is meant, --units m"
                }
                Some(_) => "Are the file's units m, kg and s after all? Then leave --units out",
            };
            let problem = format!("{} cannot be meant", found.impossible.join("; "));
            return Err(Failure::new("units of the model", problem, remedy));
        }
        warnings.push(question(&found.impossible));
    }
    if !found.doubtful.is_empty() {
        warnings.push(format!("{} (--units mm-t-s is for files in mm, t and s)", question(&found.doubtful)));
    }
    Ok(warnings)
}

/// Share of the largest radius of the model below which contact nodes are not its tips: shrouds and flared tips stay above.
const TIPS: f64 = 0.9;

/// Blades whose contact nodes lie inside: tip and root exchanged, or another axis.
fn radius_warning(imported: &Imported, chosen: &Chosen) -> Option<String> {
    let radius = |[x, y, _]: [f64; 3]| x.hypot(y);
    let nodes = &imported.model.nodes;
    let outermost = nodes.iter().copied().map(radius).fold(0.0, f64::max);
    let contact = chosen.contact.iter().map(|point| radius(nodes[point.node])).fold(0.0, f64::max);
    (chosen.grid.is_none() && contact < TIPS * outermost).then(|| {
        format!(
            "the contact nodes reach a radius of {contact:.6} m, the model one of {outermost:.6} m: are tip and root, and the \
             axis of rotation, those that are meant?"
        )
    })
}

fn frequency_warning(rom: &Rom, free: bool) -> Option<String> {
    let first = *rom.checks.full_frequencies.get(if free { 6 } else { 0 })?;
    let [low, high] = USUAL_FREQUENCIES;
    (!(low..=high).contains(&first)).then(|| {
        format!(
            "the first natural frequency is {first:.3e} Hz: are units, material and clamped nodes those that are meant?"
        )
    })
}

fn sets_of(imported: &Imported) -> String {
    if imported.model.sets.is_empty() {
        return "the model has no sets: name groups of nodes, elements or faces where it is meshed".into();
    }
    format!("sets of the model, with their numbers of nodes: {}", set_counts(&imported.model.sets))
}

fn named_set<'a>(imported: &Imported, name: Option<&'a str>, option: &str) -> Result<&'a str> {
    name.ok_or_else(|| Failure::usage(option, "it is missing", format!("Give one; {}", sets_of(imported))))
}

fn set<'a>(imported: &'a Imported, name: &str) -> Result<&'a [usize]> {
    imported.model.set(name).map_err(failure)
}

/// Nodes of a set, or those whose numbers in the file are listed (then true), ascending.
fn nodes_of(imported: &Imported, text: &str, option: &str) -> Result<(Vec<usize>, bool)> {
    let numbers: Result<Vec<u64>, _> = text.split(',').map(|part| part.trim().parse::<u64>()).collect();
    let (Ok(numbers), false) = (numbers, imported.model.sets.contains_key(text)) else {
        return Ok((set(imported, text)?.to_vec(), false));
    };
    let mut nodes = Vec::with_capacity(numbers.len());
    for number in numbers {
        let found = imported.node_numbers.iter().position(|own| *own == number);
        nodes.push(found.ok_or_else(|| {
            let remedy =
                "Give the name of a set, or numbers of nodes of the file that belong to solid elements: 12,57,103";
            Failure::new(format!("{option} {text}"), format!("the model has no node {number}"), remedy)
        })?);
    }
    nodes.sort_unstable();
    nodes.dedup();
    Ok((nodes, true))
}

/// All nodes that are held, ascending.
fn clamped_nodes(imported: &Imported, names: &[String]) -> Result<Vec<usize>> {
    let mut clamped = imported.absent.clone();
    let free = matches!(names, [only] if only.eq_ignore_ascii_case("none"));
    if names.is_empty() && clamped.is_empty() {
        let held = match imported.held.as_slice() {
            [] => String::new(),
            held => format!(
                "; *BOUNDARY of the file holds {}",
                held.iter().take(10).cloned().collect::<Vec<_>>().join(", ")
            ),
        };
        let remedy = format!("Give the set that is held, or `none`; {}{held}", sets_of(imported));
        return Err(Failure::usage("--clamp-set", "it is missing", remedy));
    }
    for name in names.iter().filter(|_| !free) {
        // Of matrices the set was left out when they were read.
        clamped.extend(nodes_of(imported, name, "--clamp-set")?.0);
    }
    clamped.sort_unstable();
    clamped.dedup();
    Ok(clamped)
}

/// Name of the model.
pub fn name(arguments: &ReduceArguments) -> String {
    if let Some(name) = &arguments.file.name {
        return name.clone();
    }
    let path = match &arguments.model {
        Some(Model::File(path)) => path,
        _ => arguments.file.stiffness.as_deref().unwrap_or(Path::new("model")),
    };
    path.file_stem().map_or_else(|| "model".to_owned(), |stem| stem.to_string_lossy().into_owned())
}

/// What was read and chosen, for people and for programs.
fn describe(imported: &Imported, asked: &FileArguments, chosen: &Chosen) -> (String, Value) {
    let model = &imported.model;
    let [low, high] = bounding_box(&model.nodes);
    let mass = total_mass(model);
    let mut text = format!("{}: {} nodes", model.origin, model.nodes.len());
    if let Some((mesh, _)) = &model.mesh {
        let _ = write!(text, ", {} elements", mesh.elements.len());
    }
    for material in &imported.materials {
        let _ = write!(
            text,
            "\n  material                  {}: E = {:.4e} Pa, ν = {}, ρ = {:.1} kg/m³",
            material.name, material.young_modulus, material.poisson_ratio, material.density
        );
    }
    for (axis, name) in ["x", "y", "z"].iter().enumerate() {
        let _ = write!(text, "\n  {name}                         {:.6} m to {:.6} m", low[axis], high[axis]);
    }
    let _ = write!(
        text,
        "\n  mass                      {mass:.6} kg\n  sets                      {}",
        set_counts(&model.sets)
    );
    let _ = write!(text, "\n  clamped                   {} nodes", chosen.clamped.len());
    let contact_set = asked.contact_set.as_deref().unwrap_or_default();
    let _ = write!(text, "\n  contact nodes             {} from {contact_set}", chosen.contact.len());
    if let Some(grid) = &chosen.grid {
        let _ = write!(text, ": {} around x {} along", grid.around, grid.along());
    }
    for point in chosen.contact.iter().filter(|_| chosen.grid.is_none()) {
        let number = imported.node_numbers[point.node];
        let _ = write!(text, "\n    {:<24}node {number} of the file", point.name);
    }
    if let Some((boundary, report)) = &chosen.faces {
        let PairingReport { largest_mismatch, typical_mismatch, .. } = report;
        let (pairs, pitch) = (boundary.pairs.len(), boundary.pitch().to_degrees());
        let _ = write!(
            text,
            "\n  faces                     {pairs} pairs of nodes, {pitch:.4}° apart; off by {largest_mismatch:.2e} m at most, \
             typically {typical_mismatch:.2e} m"
        );
        if report.swapped {
            text.push_str("\n  note: the faces are named the other way round: low is the one at the smaller angle");
        }
    }
    for note in &imported.notes {
        let _ = write!(text, "\n  note: {note}");
    }
    let json = json!({
        "origin": model.origin,
        "nodes": model.nodes.len(),
        "box": { "low": low, "high": high },
        "mass": mass,
        "sets": model.sets.iter().map(|(name, nodes)| (name.clone(), json!(nodes.len()))).collect::<serde_json::Map<_, _>>(),
        "clamped_nodes": chosen.clamped.len(),
        "faces": chosen.faces.as_ref().map(|(boundary, report)| json!({
            "pairs": boundary.pairs.len(),
            "largest_mismatch": report.largest_mismatch,
            "typical_mismatch": report.typical_mismatch,
            "swapped": report.swapped,
        })),
        "contact_nodes": chosen.contact.iter().map(|point| json!({
            "name": point.name, "node": imported.node_numbers[point.node], "slope": point.meridional_slope,
        })).collect::<Vec<_>>(),
        "notes": imported.notes,
    });
    (text, json)
}
