//! Gmsh meshes, MSH 4.1, text and binary.
//!
//! Physical groups become node sets: the nodes of their elements of any dimension. The node order of second-order
//! elements is converted to that of Abaqus. (Format: Gmsh reference manual, MSH file format, version 4.1.)

mod elements;
mod numbers;

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::sync::Arc;

use elements::{GmshElement, gmsh_element};
use numbers::Numbers;

use super::draft::{DraftElement, MeshDraft};
use super::source::{SourceLine, about};
use crate::Result;

/// Geometric entity: dimension and tag.
type Entity = (i64, i64);

/// Reads a mesh.
pub(super) fn read(path: &Path, bytes: &[u8]) -> Result<MeshDraft> {
    let mut reader = GmshReader { names: BTreeMap::new(), groups: BTreeMap::new(), draft: MeshDraft::default() };
    let mut sections = Sections::open(path, bytes)?;
    let mut found = BTreeSet::new();
    while let Some((name, mut numbers)) = sections.next()? {
        match name.as_str() {
            "PhysicalNames" => reader.physical_names(&mut numbers)?,
            "Entities" => reader.entities(&mut numbers)?,
            "Nodes" => reader.nodes(&mut numbers)?,
            "Elements" => reader.elements(&mut numbers)?,
            "PartitionedEntities" => {
                return Err(
                    numbers.error("the mesh is partitioned", "Save it unpartitioned: Mesh.PartitionCreateTopology = 0")
                );
            }
            _ => {}
        }
        found.insert(name);
    }
    for section in ["Nodes", "Elements"] {
        if !found.contains(section) {
            return Err(about(path, format!("section ${section} is missing"), "Export the complete mesh again"));
        }
    }
    Ok(reader.draft)
}

/// Iterator over the sections of a file.
struct Sections<'a> {
    file: Arc<str>,
    bytes: &'a [u8],
    next: usize,
    line: usize,
    binary: bool,
    big_endian: bool,
}

impl<'a> Sections<'a> {
    /// Reads `$MeshFormat`.
    fn open(path: &Path, bytes: &'a [u8]) -> Result<Self> {
        let file: Arc<str> = path.display().to_string().into();
        let mut sections = Self { file, bytes, next: 0, line: 1, binary: false, big_endian: false };
        while sections.peek_line() == Some("$Comments") {
            sections.skip_behind("$EndComments")?;
        }
        if sections.take_line() != Some("$MeshFormat") {
            return Err(sections.error("the file does not begin with $MeshFormat", "Give a mesh in Gmsh format 4.1"));
        }
        let format = sections.take_line().unwrap_or_default().to_owned();
        let mut words = format.split_whitespace();
        let (version, kind, size) = (words.next(), words.next(), words.next());
        if version != Some("4.1") {
            let problem = format!("the mesh has format version {}, but only 4.1 is supported", version.unwrap_or("?"));
            return Err(sections.error(problem, "Save it again with Mesh.MshFileVersion = 4.1"));
        }
        sections.binary = match kind {
            Some("0") => false,
            Some("1") => true,
            _ => return Err(sections.error(format!("`{format}` is not a format line"), "Export the mesh again")),
        };
        if size != Some("8") {
            return Err(sections.error("node numbers are not 8 bytes long", "Export it with Gmsh on a 64-bit machine"));
        }
        if sections.binary {
            let one = sections.bytes.get(sections.next..sections.next + 4).unwrap_or_default();
            sections.big_endian = match one {
                [1, 0, 0, 0] => false,
                [0, 0, 0, 1] => true,
                _ => return Err(sections.error("the byte order cannot be determined", "Export the mesh again")),
            };
            sections.next += 4;
        }
        sections.skip_behind("$EndMeshFormat")?;
        Ok(sections)
    }

    fn error(&self, problem: impl ToString, remedy: impl ToString) -> crate::Error {
        // The line that was just read.
        SourceLine { file: Arc::clone(&self.file), line: (self.line - 1).max(1) }.error(problem, remedy)
    }

    fn rest(&self) -> &'a [u8] {
        self.bytes.get(self.next..).unwrap_or_default()
    }

    fn peek_line(&self) -> Option<&'a str> {
        let rest = self.rest();
        let end = rest.iter().position(|&byte| byte == b'\n').unwrap_or(rest.len());
        if rest.is_empty() { None } else { core::str::from_utf8(&rest[..end]).ok().map(str::trim) }
    }

    fn take_line(&mut self) -> Option<&'a str> {
        let rest = self.rest();
        let line = self.peek_line();
        self.next += rest.iter().position(|&byte| byte == b'\n').map_or(rest.len(), |end| end + 1);
        self.line += 1;
        line
    }

    /// Returns the bytes before the line `end` and continues after it.
    fn skip_behind(&mut self, end: &str) -> Result<&'a [u8]> {
        let rest = self.rest();
        let Some(length) = rest.windows(end.len()).position(|window| window == end.as_bytes()) else {
            return Err(self.error(format!("{end} is missing"), "Export the complete mesh again"));
        };
        let inside = &rest[..length];
        self.line += inside.iter().filter(|&&byte| byte == b'\n').count();
        self.next += length;
        self.take_line();
        Ok(inside)
    }

    /// Returns the name and the numbers of the next section.
    fn next(&mut self) -> Result<Option<(String, Numbers<'a>)>> {
        while self.peek_line() == Some("") {
            self.take_line();
        }
        let Some(line) = self.take_line() else {
            return if self.rest().is_empty() {
                Ok(None)
            } else {
                Err(self.error("expected the beginning of a section", "Export the mesh again"))
            };
        };
        let Some(name) = line.strip_prefix('$').filter(|name| !name.is_empty()) else {
            return Err(self.error(format!("`{line}` is not a section"), "Export the mesh again"));
        };
        let (name, file, line, offset) = (name.to_owned(), Arc::clone(&self.file), self.line, self.next);
        let inside = self.skip_behind(&format!("$End{name}"))?;
        if self.binary && name != "PhysicalNames" {
            return Ok(Some((name, Numbers::Bytes { file, rest: inside, offset, big_endian: self.big_endian })));
        }
        match core::str::from_utf8(inside) {
            Ok(rest) => Ok(Some((name, Numbers::Text { file, rest, line }))),
            Err(_) => Err(SourceLine { file, line }.error(format!("${name} is not text"), "Export the mesh again")),
        }
    }
}

struct GmshReader {
    /// Names of physical groups by dimension and tag.
    names: BTreeMap<Entity, String>,
    /// Physical groups of each entity.
    groups: BTreeMap<Entity, Vec<i64>>,
    draft: MeshDraft,
}

impl GmshReader {
    fn physical_names(&mut self, numbers: &mut Numbers<'_>) -> Result<()> {
        let Numbers::Text { rest, .. } = numbers else { return Ok(()) };
        // Names may contain blanks: read line by line, DIMENSION TAG "NAME".
        for line in rest.lines().map(str::trim).skip(1).filter(|line| !line.is_empty()) {
            let mut parts = line.splitn(3, ' ');
            let (dimension, tag, name) = (parts.next(), parts.next(), parts.next());
            let read = |text: Option<&str>| text.and_then(|text| text.parse::<i32>().ok()).map(i64::from);
            let (Some(dimension), Some(tag), Some(name)) = (read(dimension), read(tag), name) else {
                let problem = format!("`{line}` is not of the form DIMENSION TAG \"NAME\"");
                return Err(numbers.error(problem, "Export the mesh again"));
            };
            self.names.insert((dimension, tag), name.trim().trim_matches('"').to_owned());
        }
        Ok(())
    }

    fn entities(&mut self, numbers: &mut Numbers<'_>) -> Result<()> {
        let mut counts = [0; 4];
        for count in &mut counts {
            *count = numbers.count(1)?;
        }
        for (dimension, count) in (0_i64..).zip(counts) {
            for _ in 0..count {
                let tag = numbers.int()?;
                // A point has its position, all other entities have a bounding box.
                for _ in 0..if dimension == 0 { 3 } else { 6 } {
                    numbers.real()?;
                }
                let groups = numbers.count(1)?;
                let groups = (0..groups).map(|_| numbers.int()).collect::<Result<Vec<_>>>()?;
                if dimension > 0 {
                    for _ in 0..numbers.count(1)? {
                        numbers.int()?;
                    }
                }
                // A negative tag means reversed orientation.
                self.groups.insert((dimension, tag), groups.into_iter().map(i64::abs).collect());
            }
        }
        Ok(())
    }

    fn nodes(&mut self, numbers: &mut Numbers<'_>) -> Result<()> {
        let blocks = numbers.count(4)?;
        for _ in 0..3 {
            numbers.size()?;
        }
        for _ in 0..blocks {
            let (dimension, _tag, parametric) = (numbers.int()?, numbers.int()?, numbers.int()?);
            let count = numbers.count(4)?;
            let tags = (0..count).map(|_| numbers.size()).collect::<Result<Vec<_>>>()?;
            for tag in tags {
                let place = numbers.place();
                let position = [numbers.real()?, numbers.real()?, numbers.real()?];
                for _ in 0..if parametric == 1 { dimension } else { 0 } {
                    numbers.real()?;
                }
                self.draft.add_node(tag, position, &|| place.clone())?;
            }
        }
        Ok(())
    }

    fn elements(&mut self, numbers: &mut Numbers<'_>) -> Result<()> {
        let blocks = numbers.count(4)?;
        for _ in 0..3 {
            numbers.size()?;
        }
        for _ in 0..blocks {
            let (dimension, tag, kind) = (numbers.int()?, numbers.int()?, numbers.int()?);
            let (kind, order, nodes) = match gmsh_element(kind) {
                Some(GmshElement::Solid(kind, order)) => (Some(kind), order, order.len()),
                Some(GmshElement::LowerDimension(nodes)) => (None, &[][..], nodes),
                Some(GmshElement::Refused(what, remedy)) => {
                    return Err(numbers.error(format!("{what} are not supported (element type {kind})"), remedy));
                }
                None => {
                    let problem = format!("element type {kind} is unknown");
                    return Err(numbers.error(problem, "Use tetrahedra, prisms or bricks of first or second order"));
                }
            };
            let count = numbers.count(nodes + 1)?;
            let sets = self.sets_of((dimension, tag));
            for _ in 0..count {
                let place = numbers.place();
                let number = numbers.size()?;
                let read = (0..nodes).map(|_| numbers.size()).collect::<Result<Vec<u64>>>()?;
                for set in &sets {
                    self.draft.node_sets.entry(set.clone()).or_default().extend(&read);
                }
                let nodes = if order.is_empty() { read } else { order.iter().map(|&gmsh| read[gmsh]).collect() };
                self.draft.add_element(DraftElement { number, kind, nodes, material: None, place })?;
            }
        }
        Ok(())
    }

    /// Returns the names of the physical groups of an entity; unnamed groups have names such as `surface_3`.
    fn sets_of(&self, entity: Entity) -> Vec<String> {
        let groups = self.groups.get(&entity).map_or(&[][..], Vec::as_slice);
        let name = |tag: &i64| {
            let unnamed = || {
                let dimension = ["point", "curve", "surface", "volume"];
                let dimension =
                    usize::try_from(entity.0).ok().and_then(|index| dimension.get(index)).unwrap_or(&"group");
                format!("{dimension}_{tag}")
            };
            self.names.get(&(entity.0, *tag)).cloned().unwrap_or_else(unnamed)
        };
        groups.iter().map(name).collect()
    }
}
