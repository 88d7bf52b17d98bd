//! Files that an input file includes, which are read and protected as well.

use std::{
    io::{BufRead, BufReader},
    path::{Path, PathBuf},
};

/// Largest number of files that a mesh includes.
const MOST_INCLUDED: usize = 1000;

/// Collects the files that an input file names with INPUT=, recursively; unreadable files include nothing.
pub(super) fn collect(path: &Path, found: &mut Vec<PathBuf>) {
    let is_input = path.extension().is_none_or(|kind| !kind.eq_ignore_ascii_case("msh"));
    let Some(file) = tiprub_format::open_file(path).ok().filter(|_| is_input) else { return };
    // Comments have various encodings.
    for line in BufReader::new(file).split(b'\n').map_while(std::io::Result::ok) {
        let text = String::from_utf8_lossy(&line);
        let upper = text.to_ascii_uppercase();
        let Some(place) = upper.find("INPUT").filter(|_| !text.starts_with("**")) else { continue };
        let Some(name) = text[place + "INPUT".len()..].trim_start().strip_prefix('=') else { continue };
        let name = name.split(',').next().unwrap_or_default().trim().trim_matches(['"', '\'']).replace('\\', "/");
        let part = path.parent().unwrap_or(Path::new("")).join(name);
        if !found.contains(&part) && found.len() < MOST_INCLUDED {
            found.push(part.clone());
            collect(&part, found);
        }
    }
}
