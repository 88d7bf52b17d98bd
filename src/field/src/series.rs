//! The files of a run: one `.vtu` per part and time, and one `.pvd` that lists them.
//!
//! A part is the surface of a structure, its contact nodes or patches, its stress points, or the rigid surface of a
//! contact. Only the fields of one time are in memory.

use std::{
    f64::consts::TAU,
    fs,
    io::{ErrorKind, Write},
    path::{Path, PathBuf},
};

use tiprub_core::scene::settings::BodyMotion;
use tiprub_core::{Scene, Simulation};
use tiprub_cosim::variables::NO_CLEARANCE;
use tiprub_model::SurfaceShapes;
use tiprub_shell::{Failure, Result, output_file, schedule::Schedule};

use crate::cells::{Cells, contact_cells, groups, points_alone, repeated};
use crate::ring::Ring;
use crate::structure::{Moved, RigidMotion, Role, Structure, Vector, elements};
use crate::vtu::{self, Content, EncodedArray, EncodedCells, cell};

/// Name of the file that lists all others.
pub const INDEX: &str = "fields.pvd";
/// Extensions of all files.
pub const FILES: [&str; 2] = ["pvd", "vtu"];
/// Choices for the files.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FieldOptions {
    /// Directory for the files.
    pub directory: PathBuf,
    /// Sectors to show (1-based); all if it is empty.
    pub sectors: Vec<usize>,
    /// Number of communication steps between two times of the series; the last communication point is always included.
    pub every: usize,
    /// True to accept a directory that is not empty, and to replace an earlier series in it.
    pub force: bool,
}

impl FieldOptions {
    /// Checks the directory before any work. Nothing remains.
    ///
    /// # Errors
    /// It is a file, cannot be written to, or is not empty without [`FieldOptions::force`].
    pub fn check_directory(&self) -> Result<()> {
        let path = &self.directory;
        let what = || format!("--vtk {}", path.display());
        if path.exists() && !path.is_dir() {
            return Err(Failure::usage(what(), "is a file, not a directory", "Give a directory"));
        }
        let has_entries = fs::read_dir(path).is_ok_and(|mut entries| entries.next().is_some());
        if has_entries && !self.force {
            let remedy = "Give another directory, or replace its files with --force";
            return Err(Failure::usage(what(), "the directory is not empty", remedy));
        }
        output_file::try_directory(path)
    }

    /// Returns the scene with the outputs from which the fields are read, see [`observed_scene`].
    ///
    /// # Errors
    /// No structure has a chosen sector, or a sector is given twice.
    pub fn scene(&self, scene: &Scene) -> Result<Scene> {
        observed_scene(scene, &self.sectors)
    }

    /// Returns whether communication point `index` of `count` steps belongs to the series.
    fn includes(&self, index: usize, count: usize) -> bool {
        index.is_multiple_of(self.every) || index == count
    }
}

/// Returns the scene with the outputs that an observer reads: the chosen sectors (1-based; all if `sectors` is empty) are watched, and
/// wear and stress are reported as far as the scene has them. The results are those of the original scene.
///
/// # Errors
/// No structure has a chosen sector, or a sector is given twice.
pub fn observed_scene(scene: &Scene, sectors: &[usize]) -> Result<Scene> {
    let mut extended = scene.clone();
    let settings = &scene.settings;
    let contacts = || settings.contacts.iter();
    let is_master = |name: &String| contacts().any(|contact| contact.master == *name);
    let structures = settings.structures.iter().zip(&scene.roms).filter(|(own, _)| is_master(&own.name));
    let masters: Vec<_> = structures.collect();
    let most = masters.iter().map(|(_, rom)| rom.sectors).max().unwrap_or(1);
    for (place, sector) in sectors.iter().enumerate() {
        if !(1..=most).contains(sector) {
            let problem = format!("there is no sector {sector}");
            return Err(Failure::usage("--vtk-sectors", problem, format!("Give sectors from 1 to {most}")));
        }
        if sectors[..place].contains(sector) {
            let problem = format!("sector {sector} is given twice");
            return Err(Failure::usage("--vtk-sectors", problem, "Give each sector once"));
        }
    }
    let outputs = &mut extended.settings.outputs;
    let chosen = (1..=most).filter(|sector| sectors.is_empty() || sectors.contains(sector));
    let added: Vec<usize> = chosen.filter(|sector| !outputs.watched_sectors.contains(sector)).collect();
    outputs.watched_sectors.extend(added);
    outputs.wear |= contacts().any(|contact| contact.coating.is_some());
    let rotors = || masters.iter().filter(|(own, rom)| own.motion != BodyMotion::Free && rom.extras.stress.is_some());
    let is_complete = rotors().all(|(own, rom)| {
        (!own.thermal || rom.extras.stress_thermal.is_some())
            && (!own.spin.growth || rom.extras.stress_centrifugal.is_some())
    });
    outputs.stress |= is_complete && rotors().next().is_some();
    Ok(extended)
}

/// Files of a run, written while it runs.
pub struct FieldSeries {
    options: FieldOptions,
    parts: Vec<Part>,
    structures: Vec<Structure>,
    schedule: Schedule,
    /// Number of communication points whose files are complete.
    reached: usize,
    /// Number of communication points at which the list of files is written next.
    next_index: usize,
    bytes: u64,
    files: usize,
}

/// One file per time.
struct Part {
    /// Beginning of the file names.
    name: String,
    cells: EncodedCells,
    /// Fields that stay the same.
    cell_fields: Vec<EncodedArray>,
    source: Source,
}

/// Origin of the points and fields of a part.
enum Source {
    /// Surface of a structure.
    Surface(usize),
    /// Contact nodes of a structure.
    Contact(usize),
    /// Stress points of a structure.
    Stress(usize),
    /// Rigid or coated surface of a contact.
    Ring(Box<Ring>),
}

/// Points and fields of a part at one time.
#[derive(Default)]
struct PartFields {
    points: Vec<f32>,
    point_fields: Vec<EncodedArray>,
    cell_fields: Vec<EncodedArray>,
}

impl FieldSeries {
    /// Prepares the files of a run of a scene. `shapes` are the surfaces of its structures, in its order.
    ///
    /// # Errors
    /// The directory cannot be created.
    pub fn new(
        options: FieldOptions,
        scene: &Scene,
        shapes: Vec<Option<SurfaceShapes>>,
        schedule: Schedule,
    ) -> Result<Self> {
        output_file::create_directory(&options.directory)?;
        let structures = Structure::of_scene(scene, shapes, &options.sectors);
        let mut parts = Vec::new();
        for (index, structure) in structures.iter().enumerate().filter(|(_, own)| !own.sectors.is_empty()) {
            if let Some(shapes) = &structure.shapes {
                parts.push(surface_part(index, structure, shapes)?);
            }
            parts.push(contact_part(index, structure, scene)?);
            let has_stress = scene.settings.outputs.stress && structure.role == Role::Rotor;
            if let Some(stress) = structure.rom.extras.stress.as_ref().filter(|_| has_stress) {
                let cells = repeated(&points_alone(stress.points.len()), stress.points.len(), structure.sectors.len());
                parts.push(part(format!("{}_stress", structure.name), structure, cells, Source::Stress(index))?);
            }
        }
        for contact in 0..scene.settings.contacts.len() {
            parts.extend(ring_part(contact, scene)?);
        }
        // Names of structures and surfaces may coincide with those of other parts.
        for index in 0..parts.len() {
            while parts[..index].iter().any(|other| other.name == parts[index].name) {
                parts[index].name.push_str("_2");
            }
        }
        Ok(Self { options, parts, structures, schedule, reached: 0, next_index: 1, bytes: 0, files: 0 })
    }

    /// Writes the files of a communication point, if it belongs to the series. The first call removes the files of an earlier series.
    ///
    /// # Errors
    /// A file cannot be written or removed.
    pub fn add(&mut self, index: usize, simulation: &Simulation) -> Result<()> {
        if !self.options.includes(index, self.schedule.count) {
            return Ok(());
        }
        if self.reached == 0 && self.options.force {
            remove_series(&self.options.directory)?;
        }
        let moved: Vec<Moved> = self.structures.iter().map(|structure| structure.moved(simulation)).collect();
        for part in &self.parts {
            let fields = match &part.source {
                Source::Surface(own) => surface_fields(&self.structures[*own], &moved[*own])?,
                Source::Contact(own) => contact_fields(&self.structures[*own], &moved[*own], simulation)?,
                Source::Stress(own) => stress_fields(&self.structures[*own], &moved[*own], simulation)?,
                Source::Ring(ring) => ring_fields(ring, simulation)?,
            };
            let cell_fields = [&part.cell_fields[..], &fields.cell_fields].concat();
            let content = Content {
                points: &fields.points,
                cells: &part.cells,
                point_fields: &fields.point_fields,
                cell_fields: &cell_fields,
            };
            let bytes = vtu::write(content)?;
            output_file::write(&self.options.directory.join(file_name(&part.name, index)), &bytes)?;
            self.bytes += bytes.len() as u64;
            self.files += 1;
        }
        self.reached = index + 1;
        // Rarely enough that the work does not grow faster than the number of times.
        if self.reached >= self.next_index {
            self.next_index = 2 * self.reached;
            self.write_index()?;
        }
        Ok(())
    }

    /// Writes the list of all files that are complete.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn finish(&mut self) -> Result<()> {
        if self.reached == 0 { Ok(()) } else { self.write_index() }
    }

    /// Path of the file that lists all others.
    pub fn index_path(&self) -> PathBuf {
        self.options.directory.join(INDEX)
    }

    /// Number and total size (bytes) of the files that were written.
    pub fn written(&self) -> (usize, u64) {
        (self.files, self.bytes)
    }

    /// Names of the structures that are shown by their contact nodes only.
    pub fn without_surface(&self) -> Vec<&str> {
        let shown = self.structures.iter().filter(|own| !own.sectors.is_empty() && own.shapes.is_none());
        shown.map(|own| own.name.as_str()).collect()
    }

    fn write_index(&self) -> Result<()> {
        let path = self.index_path();
        let failure = |error: std::io::Error| Failure::file(&path, "cannot be written", &error);
        let mut file = std::io::BufWriter::new(output_file::begin(&path)?);
        let head = "<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"0.1\" byte_order=\"LittleEndian\">\n\
                    <Collection>\n";
        file.write_all(head.as_bytes()).map_err(failure)?;
        for index in (0..self.reached).filter(|index| self.options.includes(*index, self.schedule.count)) {
            let time = self.schedule.time(index);
            for (number, part) in self.parts.iter().enumerate() {
                let name = file_name(&part.name, index);
                let own = &part.name;
                writeln!(
                    file,
                    "<DataSet timestep=\"{time:?}\" group=\"\" part=\"{number}\" name=\"{own}\" file=\"{name}\"/>"
                )
                .map_err(failure)?;
            }
        }
        file.write_all(b"</Collection>\n</VTKFile>\n").map_err(failure)?;
        let file = file.into_inner().map_err(|error| failure(error.into_error()))?;
        output_file::persist(file, &path)
    }
}

/// Removes the files of an earlier series that its list names. ParaView would show them together with the new files.
fn remove_series(directory: &Path) -> Result<()> {
    let index = directory.join(INDEX);
    // Reading a pipe might block.
    if !fs::metadata(&index).is_ok_and(|data| data.is_file()) {
        return Ok(());
    }
    let list = fs::read(&index).map_err(|error| Failure::file(&index, "cannot be read", &error))?;
    let list = String::from_utf8_lossy(&list);
    let names = list.split(" file=\"").skip(1).filter_map(|rest| rest.split('"').next());
    // An edited list may name files in other directories.
    let is_part = |name: &&str| {
        let path = Path::new(name);
        path.file_name() == Some(path.as_os_str()) && path.extension().is_some_and(|extension| extension == "vtu")
    };
    for path in names.filter(is_part).map(|name| directory.join(name)) {
        match fs::remove_file(&path) {
            Err(error) if error.kind() != ErrorKind::NotFound => {
                return Err(Failure::file(&path, "cannot be removed", &error));
            }
            _ => {}
        }
    }
    Ok(())
}

fn file_name(part: &str, index: usize) -> String {
    format!("{part}_{index:06}.vtu")
}

fn encoded(cells: &Cells) -> Result<EncodedCells> {
    let whole = |value: usize| {
        let remedy = "Choose fewer sectors with --vtk-sectors";
        i32::try_from(value).map_err(|_| Failure::new("--vtk", "too many points for one file", remedy))
    };
    let corners =
        cells.iter().flat_map(|(corners, _)| corners).map(|corner| whole(*corner)).collect::<Result<Vec<_>>>()?;
    let mut end = 0;
    let ends = cells.iter().map(|(corners, _)| {
        end += corners.len();
        whole(end)
    });
    let ends = ends.collect::<Result<Vec<_>>>()?;
    let types: Vec<u8> = cells.iter().map(|(_, kind)| *kind).collect();
    EncodedCells::new(&corners, &ends, &types)
}

/// Creates a part with the number of the sector of each cell.
fn part(name: String, structure: &Structure, cells: Cells, source: Source) -> Result<Part> {
    let per_sector = cells.len() / structure.sectors.len().max(1);
    let number = |sector: &usize| i32::try_from(sector + 1).unwrap_or(i32::MAX);
    let numbers = structure.sectors.iter().flat_map(|sector| std::iter::repeat_n(number(sector), per_sector));
    let sectors = EncodedArray::whole("sector", &numbers.collect::<Vec<_>>())?;
    Ok(Part { name, cells: encoded(&cells)?, cell_fields: vec![sectors], source })
}

fn surface_part(index: usize, structure: &Structure, shapes: &SurfaceShapes) -> Result<Part> {
    let mut start = 0;
    let face = |end: &u32| {
        let end = *end as usize;
        let corners: Vec<usize> = shapes.corners[start..end].iter().map(|corner| *corner as usize).collect();
        start = end;
        let kind = if corners.len() == 3 { cell::TRIANGLE } else { cell::QUAD };
        (corners, kind)
    };
    let cells: Cells = shapes.ends.iter().map(face).collect();
    let cells = repeated(&cells, shapes.points.len(), structure.sectors.len());
    part(structure.name.clone(), structure, cells, Source::Surface(index))
}

fn contact_part(index: usize, structure: &Structure, scene: &Scene) -> Result<Part> {
    let cells = contact_cells(&structure.rom, groups(structure, &scene.settings.contacts));
    let cells = repeated(&cells, structure.rom.contact_nodes.len(), structure.sectors.len());
    part(format!("{}_contact", structure.name), structure, cells, Source::Contact(index))
}

/// Returns the part of a surface of revolution; `None` unless the surface is rigid or has a coating.
fn ring_part(contact: usize, scene: &Scene) -> Result<Option<Part>> {
    let Some(ring) = Ring::for_contact(contact, scene)?.filter(|ring| ring.carrier.is_none() || ring.wear.is_some())
    else {
        return Ok(None);
    };
    let (around, along) = (ring.around, ring.rows.len() - 1);
    let face = |k: usize, i: usize| {
        let next = (i + 1) % around;
        (vec![k * around + i, k * around + next, (k + 1) * around + next, (k + 1) * around + i], cell::QUAD)
    };
    let cells: Cells = (0..along).flat_map(|k| (0..around).map(move |i| face(k, i))).collect();
    let name = ring.name.clone();
    Ok(Some(Part { name, cells: encoded(&cells)?, cell_fields: Vec::new(), source: Source::Ring(Box::new(ring)) }))
}

#[expect(clippy::cast_possible_truncation, reason = "rounding is intended")]
fn single(value: f64) -> f32 {
    value as f32
}

fn flat(vectors: impl Iterator<Item = Vector>) -> Vec<f32> {
    vectors.flatten().map(single).collect()
}

/// Returns points of all chosen sectors from those of the first sector of the structure.
fn placed(structure: &Structure, motion: RigidMotion, points: &[Vector]) -> Vec<f32> {
    let of_sector = |sector: &usize| {
        let motion = motion.of_sector(*sector, structure.rom.sectors);
        motion.place(points.iter().copied()).collect::<Vec<_>>()
    };
    flat(structure.sectors.iter().flat_map(of_sector))
}

fn displacement(moved: &[Vec<Vector>]) -> Result<EncodedArray> {
    EncodedArray::reals("displacement", 3, &flat(moved.iter().flatten().copied()))
}

fn surface_fields(structure: &Structure, moved: &Moved) -> Result<PartFields> {
    let points = structure.shapes.as_ref().map_or(&[][..], |shapes| &shapes.points);
    Ok(PartFields {
        points: placed(structure, moved.motion, points),
        point_fields: vec![displacement(&moved.surface)?],
        cell_fields: Vec::new(),
    })
}

/// Fields of contact nodes: name of the output, and of the field.
const CONTACT_FIELDS: [(&str, &str); 3] = [
    ("normal_force", "normal_force"),
    ("tangential_force", "tangential_force"),
    ("normal_pressure", "contact_pressure"),
];

/// Returns the values of an output of all chosen sectors, sector by sector; `None` if the scene does not have it.
fn of_sectors(structure: &Structure, simulation: &Simulation, name: &str) -> Option<Vec<f64>> {
    let values = structure.sectors.iter().map(|sector| elements(simulation, &structure.sector_variable(*sector, name)));
    values.collect::<Option<Vec<_>>>().map(|values| values.concat())
}

fn contact_fields(structure: &Structure, moved: &Moved, simulation: &Simulation) -> Result<PartFields> {
    let nodes: Vec<Vector> = structure.rom.contact_nodes.iter().map(|node| structure.position(node)).collect();
    let mut point_fields = vec![displacement(&moved.contact)?];
    if let Some(gaps) = structure.clearances(simulation) {
        let shown = |gap: f64| if gap >= NO_CLEARANCE { f32::NAN } else { single(gap) };
        let gaps: Vec<f32> = gaps.into_iter().map(shown).collect();
        point_fields.push(EncodedArray::reals("clearance", 1, &gaps)?);
        for (output, field) in CONTACT_FIELDS {
            let Some(values) = of_sectors(structure, simulation, output) else { continue };
            point_fields.push(EncodedArray::reals(field, 1, &values.into_iter().map(single).collect::<Vec<_>>())?);
        }
    }
    Ok(PartFields { points: placed(structure, moved.motion, &nodes), point_fields, cell_fields: Vec::new() })
}

/// Returns the stress at the stress points of a scene that reports it.
fn stress_fields(structure: &Structure, moved: &Moved, simulation: &Simulation) -> Result<PartFields> {
    let values = of_sectors(structure, simulation, "von_mises_stress").unwrap_or_default();
    let places = structure.rom.extras.stress.as_ref().map_or(&[][..], |stress| &stress.points);
    let points: Vec<Vector> = places.iter().map(|place| structure.position(place)).collect();
    let values: Vec<f32> = values.into_iter().map(single).collect();
    Ok(PartFields {
        points: placed(structure, moved.motion, &points),
        point_fields: vec![EncodedArray::reals("von_mises_stress", 1, &values)?],
        cell_fields: Vec::new(),
    })
}

fn ring_fields(ring: &Ring, simulation: &Simulation) -> Result<PartFields> {
    let drive = simulation.system().pairs()[ring.contact].drive_now();
    let direction = |i: usize| libm::sincos(TAU * i as f64 / ring.around as f64);
    let points = ring.rows.iter().flat_map(|[radius, z]| {
        (0..ring.around).map(move |i| {
            let (sine, cosine) = direction(i);
            [radius * cosine, radius * sine, *z]
        })
    });
    let mut fields = PartFields { points: flat(points), ..PartFields::default() };
    if ring.carrier.is_none() {
        let change = |(i, change): (usize, f64)| {
            let (sine, cosine) = direction(i);
            [change * cosine, change * sine, 0.0]
        };
        let outwards: Vec<Vector> = ring.radius_changes(drive, ring.around).enumerate().map(change).collect();
        let moved = ring.rows.iter().flat_map(|_| outwards.iter().copied());
        fields.point_fields.push(EncodedArray::reals("displacement", 3, &flat(moved))?);
    }
    if let Some(wear) = ring.wear.as_ref().and_then(|name| elements(simulation, name)) {
        let wear: Vec<f32> = wear.into_iter().map(single).collect();
        fields.cell_fields.push(EncodedArray::reals("wear_depth", 1, &wear)?);
    }
    Ok(fields)
}
