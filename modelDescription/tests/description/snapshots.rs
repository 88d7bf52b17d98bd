//! Compares the texts for a synthetic table with files in the repository: any change of the output appears as a change of these files.
//! `UPDATE_SNAPSHOTS=1 cargo test` regenerates them.

use std::fs;
use std::path::Path;

use tiprub_model_description::{fmi2_xml, fmi3_xml, html};

use crate::common;

#[track_caller]
fn compare(name: &str, text: &str) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/snapshots").join(name);
    if std::env::var_os("UPDATE_SNAPSHOTS").is_some() {
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(&path, text).unwrap();
    }
    let expected = fs::read_to_string(&path).unwrap_or_default();
    let difference = text.lines().zip(expected.lines()).find(|(found, expected)| found != expected);
    assert_eq!(difference, None, "{name}: (found, expected) of the first line that differs");
    assert_eq!(text.lines().count(), expected.lines().count(), "{name}: number of lines");
}

#[test]
fn descriptions_match_the_snapshots() {
    let (table, rom) = (common::table(), common::rom());
    let description = common::description(&table, &rom, true);
    compare("fmi2.xml", &fmi2_xml(&description));
    compare("fmi3_arrays.xml", &fmi3_xml(&description));
    compare("fmi3_scalars.xml", &fmi3_xml(&common::description(&table, &rom, false)));
    compare("index.html", &html(&description));
}
