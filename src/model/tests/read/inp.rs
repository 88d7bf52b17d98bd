//! Syntax of input files, and the messages for invalid ones.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use tempfile::TempDir;
use tiprub_model::progress::silent;
use tiprub_model::read::{Imported, MeshOptions, Units, parse_mesh, read_mesh};
use tiprub_model::{Error, Mesh};

/// Two adjacent bricks with gaps in their numbers, the second record over two lines.
const NODES: &str = "10, 0.1, 0., 0.\n20, 0.11, 0., 0.\n30, 0.11, 0.01, 0.\n40, 0.1, 0.01, 0.\n\
                     50, 0.1, 0., 0.01\n60, 0.11, 0., 0.01\n70, 0.11, 0.01, 0.01\n80, 0.1, 0.01, 0.01\n\
                     110, 0.1, 0., 0.02\n120, 1.1d-1, , 0.02\n130, 0.11, 0.01, 0.02\n140, 0.1, 0.01, 2.0E-2\n";
const ELEMENTS: &str = "1, 10, 20, 30, 40, 50, 60, 70, 80\n5, 50, 60, 70, 80,\n 110, 120, 130, 140\n";
const MATERIAL: &str =
    "*Material, name=Steel\n*Elastic\n210e9, 0.3\n*Density\n7850.,\n*Solid Section, elset=EALL, material=STEEL\n";

fn deck() -> String {
    format!("*NODE, NSET=NALL\n{NODES}*ELEMENT, TYPE=C3D8, ELSET=EALL\n{ELEMENTS}{MATERIAL}")
}

#[track_caller]
fn mesh(text: &str) -> Mesh {
    parse_mesh("a.inp", text.as_bytes()).unwrap()
}

#[track_caller]
fn sets(text: &str) -> BTreeMap<String, Vec<usize>> {
    mesh(&format!("{}{text}", deck())).sets
}

/// Reads `a.inp` from a directory with these files.
fn read(files: &[(&str, &str)], options: &MeshOptions) -> Result<Imported, Error> {
    let root: TempDir = tempfile::tempdir().unwrap();
    for (name, text) in files {
        let path = root.path().join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, text).unwrap();
    }
    read_mesh(&root.path().join("a.inp"), options, &silent)
}

#[track_caller]
fn imported(text: &str) -> Imported {
    read(&[("a.inp", text)], &MeshOptions::default()).unwrap()
}

#[test]
fn reads_numbering_gaps_continued_lines_and_empty_fields() {
    let mesh = mesh(&deck());
    assert_eq!((mesh.nodes.len(), mesh.elements.len()), (12, 2));
    assert_eq!(mesh.elements[1].nodes, [4, 5, 6, 7, 8, 9, 10, 11]);
    assert_eq!(mesh.nodes[9].map(f64::to_bits), [0.11, 0.0, 0.02].map(f64::to_bits));
    assert_eq!(imported(&deck()).node_numbers[11], 140);
}

#[test]
fn ignores_case_comments_blank_lines_and_line_ends() {
    let plain = mesh(&deck());
    let noisy = deck()
        .replace("*NODE, NSET=NALL", "** nodes\n\n  *node ,\n   nset = nall")
        .replace("*ELEMENT, TYPE=C3D8,", "*element,type=c3d8,\n** in between\n")
        .replace('\n', "\r\n");
    assert_eq!(mesh(&noisy), plain);
}

#[test]
fn sets_are_lists_ranges_other_sets_and_sets_of_elements() {
    let found = sets(
        "*NSET, NSET=tip\n110, 120,\n130\n*NSET, NSET=TIP\n140\n*NSET, NSET=RANGE, GENERATE\n10, 60, 20\n60,9999999999999\n\
         *NSET, NSET=BOTH\nTIP, RANGE, 10\n*NSET, NSET=CIRCLE\nCIRCLE2, 10\n*NSET, NSET=CIRCLE2\nCIRCLE, 20\n\
         *ELSET, ELSET=UPPER, GENERATE\n2, 9\n*ELSET, ELSET=AGAIN\nUPPER\n",
    );
    assert_eq!(found["TIP"], [8, 9, 10, 11]);
    assert_eq!(found["RANGE"], [0, 2, 4, 5, 6, 7, 8, 9, 10, 11]);
    assert_eq!(found["BOTH"], found["RANGE"], "10 and the tip are in the range");
    assert_eq!((&found["CIRCLE"], &found["CIRCLE2"]), (&vec![0, 1], &vec![0, 1]));
    assert_eq!(found["AGAIN"], [4, 5, 6, 7, 8, 9, 10, 11]);
    assert_eq!(found["EALL"].len(), 12);
}

#[test]
fn shell_elements_are_skipped_but_define_node_sets() {
    let text = format!("{}*ELEMENT, TYPE=S4, ELSET=SKIN\n900, 110, 120, 130, 140\n", deck());
    let imported = imported(&text);
    assert_eq!(imported.model.set("skin").unwrap(), [8, 9, 10, 11]);
    assert!(imported.notes.iter().any(|note| note.contains("1 S4 elements")), "{:?}", imported.notes);
}

#[test]
fn reads_a_part_with_one_instance() {
    let text = format!(
        "*Heading\nx\n*Part, name=Blade\n*NODE\n{NODES}*ELEMENT, TYPE=C3D8, ELSET=EALL\n{ELEMENTS}\
         *Solid Section, elset=EALL, material=STEEL\n*End Part\n*Assembly, name=A\n*Instance, name=Blade-1, part=Blade\n\
         *End Instance\n*Nset, nset=TIP, instance=Blade-1\n110, 120\n*End Assembly\n*Material, name=STEEL\n*Elastic\n1e11,.3\n\
         *Density\n5e3\n*Step\n*Static\n*Boundary\nBlade-1.TIP, 1, 3\n*Cload\nTIP, 1, 5.\n*End Step\n"
    );
    let imported = imported(&text);
    assert_eq!(imported.model.set("TIP").unwrap(), [8, 9]);
    assert_eq!(imported.held, ["TIP"]);
    assert!(imported.notes.iter().any(|note| note.contains("*STEP")), "{:?}", imported.notes);
}

#[test]
fn includes_are_resolved_relative_to_the_including_file() {
    let files = [
        ("a.inp", "*NODE\n*INCLUDE, INPUT=parts/nodes.txt\n*INCLUDE, INPUT=\"parts\\rest.inp\"\n"),
        ("parts/nodes.txt", NODES),
        ("parts/rest.inp", "*ELEMENT, TYPE=C3D8, ELSET=EALL, INPUT=elements.txt\n*INCLUDE, INPUT=material.inp\n"),
        ("parts/elements.txt", ELEMENTS),
        ("parts/material.inp", MATERIAL),
    ];
    let imported = read(&files, &MeshOptions::default()).unwrap();
    assert_eq!((imported.model.nodes.len(), imported.model.sets["EALL"].len()), (12, 12));
    let circle = [("a.inp", "*INCLUDE, INPUT=b.inp\n"), ("b.inp", "*HEADING\n*INCLUDE, INPUT=a.inp\n")];
    let text = read(&circle, &MeshOptions::default()).unwrap_err().to_string();
    assert!(text.contains("b.inp:2") && text.contains("included"), "{text}");
    let missing = read(&[("a.inp", "*INCLUDE, INPUT=c.inp\n")], &MeshOptions::default()).unwrap_err().to_string();
    assert!(missing.contains("a.inp:1") && missing.contains("c.inp"), "{missing}");
}

/// Repeated includes of a few kilobytes must not expand to gigabytes, for any spelling of the path.
#[test]
fn rejects_repeated_includes_beyond_the_size_limit() {
    let list: String = (0..20_000).map(|_| "10, 20\n").collect();
    let include = |path: &str, count: usize| format!("*INCLUDE, INPUT={path}\n").repeat(count);
    let head = format!("{}*NSET, NSET=TIP\n", deck());
    let few = format!("{head}{}", include("list.txt", 4));
    let imported = read(&[("a.inp", &few), ("list.txt", &list)], &MeshOptions::default()).unwrap();
    assert_eq!(imported.model.set("TIP").unwrap(), [0, 1]);
    for path in ["list.txt", "./list.txt"] {
        let many = format!("{head}{}{}", include(path, 60), include("list.txt", 60));
        let text = read(&[("a.inp", &many), ("list.txt", &list)], &MeshOptions::default()).unwrap_err().to_string();
        assert!(
            text.contains("list.txt") && text.contains("8 MiB") && text.contains("Include every file only once"),
            "{text}"
        );
    }
}

#[test]
fn materials_are_converted_and_tables_read_at_a_temperature() {
    let text = deck()
        .replace("210e9, 0.3", "210000., 0.3, 20.\n180000., 0.32, 420.")
        .replace("7850.,", "7.85e-9")
        .replace("*Solid", "*EXPANSION\n1.2e-5\n*CONDUCTIVITY\n50.\n*Solid");
    let options =
        |temperature| MeshOptions { units: Units::MillimetreTonneSecond, temperature, ..MeshOptions::default() };
    let refused = read(&[("a.inp", &text)], &options(None)).unwrap_err().to_string();
    assert!(refused.contains("a.inp:19") && refused.contains("--temperature"), "{refused}");
    for (temperature, young) in [(-100.0, 210e9), (120.0, 202.5e9), (420.0, 180e9), (900.0, 180e9)] {
        let imported = read(&[("a.inp", &text)], &options(Some(temperature))).unwrap();
        let material = &imported.materials[0];
        assert!((material.young_modulus / young - 1.0).abs() < 1e-12, "{temperature}: {material:?}");
        assert!((material.density - 7850.0).abs() < 1e-9 && material.expansion.to_bits() == 1.2e-5_f64.to_bits());
    }
}

#[test]
fn elements_are_assembled_with_their_own_material() {
    let text =
        deck().replace("ELSET=EALL\n1,", "ELSET=E1\n1,").replace("5, 50", "*ELEMENT, TYPE=C3D8, ELSET=E5\n5, 50");
    let sections = "*Solid Section, elset=E1, material=STEEL\n*Solid Section, elset=E5, material=LIGHT\n\
                    *Material, name=LIGHT\n*Elastic\n105e9, 0.3\n*Density\n3925.\n";
    let text = text.replace("*Solid Section, elset=EALL, material=STEEL\n", sections);
    let (two, one) = (imported(&text), imported(&deck()));
    assert_eq!(two.materials.len(), 2);
    let mass = |imported: &Imported| tiprub_model::read::total_mass(&imported.model);
    assert!((mass(&two) / mass(&one) - 0.75).abs() < 1e-12);
    // Nodes of the upper face belong to the second brick alone: half of everything.
    let all: Vec<usize> = (24..36).collect();
    let (a, b) = (two.model.stiffness.block(&all, &all), one.model.stiffness.block(&all, &all));
    assert!((&a - &b * faer::Scale(0.5)).norm_max() < 1e-12 * b.norm_max());
    let lower: Vec<usize> = (0..12).collect();
    let (a, b) = (two.model.stiffness.block(&lower, &lower), one.model.stiffness.block(&lower, &lower));
    assert!((&a - &b).norm_max() < 1e-12 * b.norm_max());
}

#[test]
fn rejects_invalid_files_with_line_and_remedy() {
    let with = |more: &str| format!("{}{more}", deck());
    let swap = |from: &str, to: &str| {
        let text = deck().replacen(from, to, 1);
        assert_ne!(text, deck(), "{from}");
        text
    };
    let cases: Vec<(String, &[&str])> = vec![
        (swap("30, 0.11", "30, 0.1x1"), &["a.inp:4", "`0.1x1`", "not a number"]),
        (swap("30, 0.11", "30, nan"), &["a.inp:4", "not a number"]),
        (swap("40, 0.1,", "-4, 0.1,"), &["a.inp:5", "`-4`", "node number"]),
        (swap("20, 0.11", "10, 0.11"), &["a.inp:3", "node 10", "twice"]),
        (swap("5, 50", "1, 50"), &["a.inp:16", "element 1", "twice"]),
        (swap("1, 10, 20", "1, 10, 99"), &["a.inp:15", "node 99", "not defined"]),
        (swap("70, 80\n", "70\n"), &["element 1 (C3D8)", "8"]),
        (swap("120, 130, 140\n", "120, 130\n"), &["a.inp:16", "element 5 (C3D8) has 7 nodes"]),
        (swap("1, 10, 20", "1, 20, 10"), &["element 1 (C3D8)", "inverted"]),
        (swap("1, 10, 20", "1, 10, 10"), &["a.inp:15", "twice", "collapsed"]),
        (swap("C3D8", "C3D8I"), &["a.inp:14", "C3D8I", "incompatible", "--stiffness"]),
        (swap("C3D8", "C3D27"), &["a.inp:14", "C3D27", "Convert"]),
        (swap("TYPE=C3D8, ", ""), &["a.inp:14", "parameter TYPE"]),
        (with("*EQUATION\n2\n10,1,1.,20,1,-1.\n"), &["a.inp:24", "*EQUATION", "not supported", "--stiffness"]),
        (with("*NSETS, NSET=A\n10\n"), &["a.inp:24", "*NSETS", "unknown"]),
        (with("*NSET, NSET=A\n10, B\n"), &["a.inp:25", "`B`", "NALL"]),
        (with("*NSET, NSET=A\n11\n"), &["a.inp:25", "`A` contains 11"]),
        (with("*NSET, NSET=A, GENERATE\n20, 10, 1\n"), &["a.inp:25", "FIRST, LAST, INCREMENT"]),
        (swap("*Density\n7850.,\n", ""), &["a.inp:18", "`Steel`", "*DENSITY", "command line"]),
        (swap("*Elastic\n", "*Elastic, type=ENGINEERING CONSTANTS\n"), &["a.inp:19", "isotropic"]),
        (swap("210e9, 0.3", "210e9"), &["a.inp:20", "E, ν"]),
        (swap("210e9, 0.3", "210e9, 0.5"), &["Poisson's ratio", "0.5"]),
        (swap("material=STEEL", "material=IRON"), &["a.inp:23", "`IRON`", "Steel"]),
        (swap("elset=EALL, material", "elset=EALLE, material"), &["a.inp:23", "EALLE"]),
        (
            swap("ELSET=EALL\n1,", "ELSET=E1\n1,").replace("EALL", "E1").replace("5, 50", "*ELEMENT, TYPE=C3D8\n5, 50"),
            &["element 5", "SECTION"],
        ),
        (with("*PART, NAME=A\n*PART, NAME=B\n"), &["a.inp:25", "second part", "without parts"]),
        (format!("*NODE\n{NODES}"), &["no solid element"]),
        ("1, 2, 3\n*NODE\n".into(), &["a.inp:1", "before the first keyword"]),
        (swap("*NODE, NSET=NALL", "*NODE, SYSTEM=C"), &["a.inp:1", "SYSTEM=C", "Cartesian"]),
        (with("*ELASTIC, TYPE=\n1,2\n"), &["a.inp:24", "TYPE", "no value"]),
    ];
    for (text, wanted) in cases {
        let error = read(&[("a.inp", &text)], &MeshOptions::default()).unwrap_err();
        let message = error.to_string();
        println!("{}", message.rsplit('/').next().unwrap());
        for part in wanted {
            assert!(message.contains(part), "`{part}` is not in: {message}");
        }
    }
}

#[test]
fn rejects_unsupported_gmsh_versions_and_elements() {
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/models/bar.msh");
    let text = fs::read_to_string(data).unwrap();
    for (from, to, wanted) in [
        ("4.1 0 8", "2.2 0 8", "Mesh.MshFileVersion"),
        ("$Elements\n", "$Elementz\n", "$EndElementz is missing"),
        ("$EndNodes", "$EndNodez", "$EndNodes is missing"),
        ("3 1 5 9", "3 1 12 9", "SecondOrderIncomplete"),
        ("3 1 5 9", "3 1 7 9", "pyramids"),
        ("3 1 5 9", "3 1 999 9", "unknown"),
        ("3 1 5 9", "3 1 5 999999999999", "more than it can contain"),
    ] {
        let changed = text.replacen(from, to, 1);
        assert_ne!(changed, text, "{from}");
        let message = parse_mesh("bar.msh", changed.as_bytes()).unwrap_err().to_string();
        println!("{message}");
        assert!(message.contains(wanted) && message.starts_with("bar.msh:"), "{message}");
    }
}

#[test]
fn rejects_duplicate_elements() {
    // The second element is numbered from another corner.
    let text = deck().replace(ELEMENTS, &format!("{ELEMENTS}7, 20, 30, 40, 10, 60, 70, 80, 50\n"));
    let error = read(&[("a.inp", &text)], &MeshOptions::default()).unwrap_err().to_string();
    for part in ["a.inp:", "element 7", "element 1", "counted twice"] {
        assert!(error.contains(part), "`{part}` is not in: {error}");
    }
}
