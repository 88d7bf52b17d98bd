//! User models through the program: reduce, package, run, and messages about wrong models.

mod fields;
mod sets;
mod tips;

use crate::guide::print_row;
use std::{
    f64::consts::TAU,
    fs,
    path::{Path, PathBuf},
    process::{Command, Output},
};

use serde_json::Value;
use tempfile::TempDir;

fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/data/models").join(name)
}

/// Directory with the models of the tests.
struct ModelProject {
    root: TempDir,
}

impl ModelProject {
    fn new(files: &[&str]) -> Self {
        let root = tempfile::tempdir().unwrap();
        for name in files {
            fs::copy(data(name), root.path().join(name)).unwrap();
        }
        Self { root }
    }

    fn run(&self, line: &str) -> Output {
        let mut command = Command::new(env!("CARGO_BIN_EXE_tiprub"));
        command.current_dir(self.root.path()).args(line.split_whitespace()).output().unwrap()
    }

    #[track_caller]
    fn succeed(&self, line: &str) -> Value {
        let output = self.run(&format!("--json --quiet {line}"));
        let stderr = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(0), "{line}: {stderr}");
        serde_json::from_slice(&output.stdout).unwrap()
    }

    #[track_caller]
    fn fail(&self, line: &str, code: i32) -> String {
        let output = self.run(line);
        let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(code), "{line}: {stderr}");
        assert!(!stderr.contains("panicked"), "{stderr}");
        assert!(stderr.contains("error: "), "{line}: {stderr}");
        stderr
    }

    fn write(&self, name: &str, contents: impl AsRef<[u8]>) {
        fs::write(self.root.path().join(name), contents).unwrap();
    }

    fn rom(&self, name: &str) -> tiprub_core::Rom {
        tiprub_format::read_rom(&fs::read(self.root.path().join(name)).unwrap(), name).unwrap()
    }
}

fn numbers(value: &Value, key: &str) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|row| row[key].as_f64().unwrap()).collect()
}

fn guide() -> String {
    fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/models.md")).unwrap()
}

/// Returns the scene of the guide.
fn scene() -> String {
    let guide = guide();
    let text = guide.split("```toml\n").nth(1).unwrap().split("```").next().unwrap();
    assert!(text.lines().count() <= 20, "a scene of one's own needs no more than 20 lines");
    text.to_owned()
}

/// Returns the command of the guide that reduces the blade, without `tiprub`.
fn command() -> String {
    let guide = guide();
    let lines = guide.split("\n    tiprub reduce blade blade.inp --clamp-set ROOT").nth(2).expect("the second one");
    let text: String = lines.split("\n    tiprub run").next().unwrap().replace("\\\n", " ");
    format!("reduce blade blade_hex20.inp --clamp-set ROOT{text}")
}

#[test]
fn gmsh_mesh_becomes_a_running_scene_as_in_the_guide() {
    let project = ModelProject::new(&["blade_hex20.inp"]);
    let reported = project.succeed(&command());
    assert_eq!(reported["rom"]["sectors"], 36);
    assert_eq!(reported["model"]["sets"]["TIP"], 53);
    assert!((reported["model"]["mass"].as_f64().unwrap() - 0.0771).abs() < 1e-4);
    // Seven patches are the most for the six elements along the tip, in two rows at its sides.
    let rom = project.rom("blade.rom.safetensors");
    assert_eq!((rom.contact_nodes.len(), rom.rows()), (14, 2));
    // The chord of the tip is 32 mm at 40 degrees to the axis: the middles of the edges lie 12.26 mm before and behind the centre.
    let watched = &rom.extras.watched.as_ref().unwrap().points;
    for (node, z) in watched.iter().zip([-12.256e-3, 0.0, 12.256e-3]) {
        let [radius, _, axial] = node.position;
        assert!((axial - z).abs() < 5e-6 && (radius - 0.26).abs() < 3e-4, "{node:?}");
    }
    project.write("blade.toml", scene());
    let run = project.succeed("run blade.toml --csv rub.csv");
    assert_eq!(run["communication_steps"], 500);
    assert!(run["scheme"].as_str().unwrap().starts_with("galerkin, the default for rigid surfaces"), "{run:#}");
    let csv = fs::read_to_string(project.root.path().join("rub.csv")).unwrap();
    let names: Vec<&str> = csv.lines().next().unwrap().split(',').collect();
    let column = names.iter().position(|name| *name == "clearance_minimum").unwrap();
    let smallest = csv.lines().skip(1).map(|line| line.split(',').nth(column).unwrap().parse::<f64>().unwrap());
    let smallest = smallest.fold(f64::INFINITY, f64::min);
    assert!(smallest.abs() < 2e-6, "the lobes close the gap and the blades give way: {smallest}");
}

#[test]
fn calculix_matrices_give_the_same_rom_as_the_mesh() {
    let project = ModelProject::new(&[
        "bar.inp",
        "bar.sti",
        "bar.mas",
        "bar.dof",
        "bar_held.sti",
        "bar_held.mas",
        "bar_held.dof",
    ]);
    let common = "--contact-set TIP --contact-nodes 3 --modes 8 --units mm-t-s";
    let mesh = format!(
        "reduce blade bar.inp --clamp-set ROOT --young 210e9 --poisson 0.3 --density 7850 {common} -o mesh.rom.safetensors"
    );
    let matrices = format!(
        "reduce blade bar.inp --clamp-set ROOT --stiffness bar.sti --mass bar.mas {common} -o matrices.rom.safetensors"
    );
    let held =
        format!("reduce blade bar.inp --stiffness bar_held.sti --mass bar_held.mas {common} -o held.rom.safetensors");
    for line in [&mesh, &matrices, &held] {
        project.succeed(line);
    }
    let expected = project.rom("mesh.rom.safetensors");
    for name in ["matrices.rom.safetensors", "held.rom.safetensors"] {
        let found = project.rom(name);
        assert_eq!(found.contact_nodes, expected.contact_nodes);
        // The sign of a shape is arbitrary.
        let off = (found.mass.abs() - expected.mass.abs()).amax() / expected.mass.amax();
        let stiffness = (found.stiffness.abs() - expected.stiffness.abs()).amax() / expected.stiffness.amax();
        println!("{name}: mass off by {off:.2e}, stiffness by {stiffness:.2e}");
        assert!(off < 1e-10 && stiffness < 1e-10, "{name}: {off:.2e} {stiffness:.2e}");
        assert!(found.origin.contains(".sti"), "{}", found.origin);
    }
}

#[test]
fn gmsh_sector_frequencies_match_calculix() {
    let project = ModelProject::new(&["sector.msh"]);
    let line = "reduce sector sector.msh --contact-set TIP --clamp-set BORE --sectors 12 --cyclic-low LOW --cyclic-high HIGH \
                --units mm-t-s --young 210e9 --poisson 0.3 --density 7850 --contact-nodes 3 --modes 12 \
                --inp sector_out.inp --vtk sector.vtu";
    let reported = project.succeed(line);
    let faces = &reported["model"]["faces"];
    assert!(faces["largest_mismatch"].as_f64().unwrap() < 1e-12 && faces["swapped"] == false, "{faces}");
    let rom = project.rom("sector.rom.safetensors");
    assert_eq!((rom.sectors, rom.extras.harmonics.len()), (12, 6));
    let checks = &rom.checks;
    let reference = fs::read_to_string(data("sector_calculix.csv")).unwrap();
    let rows = reference.lines().filter(|line| line.starts_with(|c: char| c.is_ascii_digit()));
    let mut compared = 0;
    for row in rows {
        let values: Vec<f64> = row.split(',').map(|value| value.parse().unwrap()).collect();
        let diameter: u32 = row.split(',').next().unwrap().parse().unwrap();
        let own: Vec<f64> = checks
            .full_frequencies
            .iter()
            .zip(&checks.nodal_diameters)
            .filter(|(_, n)| **n == diameter)
            .map(|(frequency, _)| *frequency)
            .collect();
        for (found, expected) in own.iter().zip(&values[1..]) {
            assert!((found / expected - 1.0).abs() < 1e-4, "n = {}: {found} {expected}", values[0]);
            compared += 1;
        }
    }
    assert!(compared >= 14, "{compared} frequencies");
    assert!(
        fs::read_to_string(project.root.path().join("sector_out.inp"))
            .unwrap()
            .contains("*CYCLIC SYMMETRY MODEL, N=12")
    );
    assert!(fs::metadata(project.root.path().join("sector.vtu")).unwrap().len() > 1000);
    // The opposite order is detected and corrected.
    let swapped = line.replace("--cyclic-low LOW --cyclic-high HIGH", "--cyclic-low HIGH --cyclic-high LOW --force");
    assert_eq!(project.succeed(&swapped)["model"]["faces"]["swapped"], true);
    assert!(project.rom("sector.rom.safetensors") == rom);
}

#[test]
fn an_exported_mesh_is_read_back_to_the_same_frequencies() {
    let project = ModelProject::new(&[]);
    let first = project.succeed("reduce rotor37 --mesh 6x1x6 --inp blade.inp");
    let again =
        project.succeed("reduce blade blade.inp --contact-set TIP --clamp-set HUB --contact-nodes 3 --modes 20");
    let (a, b) = (numbers(&first["rom"]["checks"], "full_hz"), numbers(&again["rom"]["checks"], "full_hz"));
    assert!(a.iter().zip(&b).all(|(a, b)| (a / b - 1.0).abs() < 1e-9), "{a:?} {b:?}");
}

/// Radial flexibility (m/N) in the middle of the tip on meshes of three kinds: with patches it does not depend on the elements, with nodes it does.
#[test]
fn patch_flexibility_is_independent_of_element_type() {
    let kinds = ["hex20", "penta15", "tet10"];
    let files = kinds.map(|kind| format!("blade_{kind}.inp"));
    let project = ModelProject::new(&files.each_ref().map(String::as_str));
    let radial = |file: &String, contact: &str| -> f64 {
        let line = "--clamp-set ROOT --units mm-t-s --material titanium --modes 8 --kind free-interface --force -o r.rom.safetensors";
        project.succeed(&format!("reduce blade {file} {contact} {line}"));
        project.rom("r.rom.safetensors").stiffness.try_inverse().unwrap()[(6, 6)]
    };
    let all = |contact: &str| files.each_ref().map(|file| radial(file, contact));
    let (nodes, patches) = (all("--contact-nodes 5"), all("--contact-patches 5 --contact-rows 1"));
    for (kind, (node, patch)) in kinds.iter().zip(nodes.into_iter().zip(patches)) {
        print_row!("| {kind} | {node} | {patch} |");
    }
    let apart = |values: [f64; 3]| {
        values.iter().fold(0.0, |a: f64, b| a.max(*b)) / values.iter().fold(f64::INFINITY, |a, b| a.min(*b)) - 1.0
    };
    assert!(apart(patches) < 0.02 && apart(nodes) > 0.2, "{patches:?} {nodes:?}");
    crate::guide::hold("cargo test -p tiprub --test command_line user_meshes");
}

#[test]
fn spin_effects_are_computed_for_a_user_mesh() {
    let project = ModelProject::new(&["blade_tet10.msh"]);
    let line = "reduce blade blade_tet10.msh --contact-set TIP --clamp-set ROOT --units mm-t-s --material titanium --spin 1500";
    let reported = project.succeed(line);
    assert_eq!(reported["rom"]["spin"]["largest_speed"], 1500.0);
    let check = &reported["spin"][1];
    let (rest, spinning) = (reported["rom"]["checks"][0]["full_hz"].as_f64().unwrap(), &check["full_frequencies"][0]);
    assert!(spinning.as_f64().unwrap() > 1.005 * rest, "{spinning} {rest}");
}

#[test]
fn rejects_invalid_arguments_and_models_with_remedy() {
    let project = ModelProject::new(&["bar.inp", "bar.sti", "bar.mas", "bar.dof", "sector.msh", "blade_hex8.inp"]);
    project.write("empty.inp", "");
    project.write("picture.png", b"\x89PNG");
    project.write("old.msh", "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n");
    project.write("k.mtx", "%%MatrixMarket matrix coordinate real symmetric\n3 3 1\n1 1 1.0\n");
    let bar = "--contact-set TIP --clamp-set ROOT --units mm-t-s";
    let cases: Vec<(i32, String, &[&str])> = vec![
        (2, "reduce blade".into(), &["<FILE>"]),
        (2, "reduce rotor38".into(), &["`rotor37`", ".inp"]),
        (2, format!("reduce bar.inp {bar}"), &["tiprub reduce blade bar.inp --contact-set TIP"]),
        (1, format!("reduce blade missing.inp {bar}"), &["missing.inp", "Check the path"]),
        (1, format!("reduce blade empty.inp {bar}"), &["empty.inp", "no solid element"]),
        (1, format!("reduce blade picture.png {bar}"), &["picture.png", ".inp", ".msh"]),
        (1, format!("reduce blade old.msh {bar}"), &["old.msh:2", "Mesh.MshFileVersion"]),
        (1, format!("reduce blade bar.inp {bar}"), &["bar.inp", "no material", "--material"]),
        (1, "reduce blade blade_hex8.inp --contact-set TIP --clamp-set ROOT --material steel".into(), &["6.0", "--units mm-t-s", "--units m"]),
        (1, format!("reduce blade bar.inp {bar} --young 210e3 --poisson 0.3 --density 7.85e-9"), &["Young's modulus", "SI units"]),
        (2, "reduce blade bar.inp --material steel --units mm-t-s".into(), &["--clamp-set", "TIP (8)", "ROOT (8)"]),
        (2, "reduce blade bar.inp --stiffness bar.sti --mass bar.mas --clamp-set ROOT --units mm-t-s".into(), &["--contact-set", "TIP (8)", "ROOT (8)"]),
        (1, "reduce blade bar.inp --clamp-set TIP --material steel --units mm-t-s".into(), &["tip of the blade", "are clamped", "--contact-set"]),
        (2, "reduce blade bar.inp --material steel --units mm-t-s --contact-set TIP".into(), &["--clamp-set", "ROOT (8)", "none"]),
        (1, "reduce blade bar.inp --material steel --units mm-t-s --contact-set TIPS --clamp-set ROOT".into(), &["`TIPS`", "TIP (8)"]),
        (1, "reduce blade bar.inp --material steel --units mm-t-s --contact-set ROOT --clamp-set ROOT".into(), &["ROOT", "clamped"]),
        (1, format!("reduce blade bar.inp {bar} --material steel --contact-nodes 40"), &["40 requested from a set of", "Give a number"]),
        (1, format!("reduce blade bar.inp {bar} --material steel --contact-nodes 2 --contact-names a,b,c"), &["3 names for 2"]),
        (1, format!("reduce blade bar.inp {bar} --material steel --modes 5000"), &["5000", "fewer modes"]),
        (2, format!("reduce blade bar.inp {bar} --material steel --young 1e11 --poisson 0.3 --density 1e3"), &["--material", "cannot be used with", "--young"]),
        (2, format!("reduce blade bar.inp {bar} --young 1e11"), &["--poisson"]),
        (2, format!("reduce blade bar.inp {bar} --material steel --contour 0:1,1:1"), &["unexpected argument", "--contour"]),
        (2, "reduce rotor37 --contact-set TIP".into(), &["unexpected argument", "--contact-set"]),
        (2, format!("reduce blade bar.inp {bar} --material steel --name ../up"), &["plain name"]),
        (2, format!("reduce blade bar.inp {bar} --material steel --contact-names a-b"), &["variable names"]),
        (2, format!("reduce blade bar.inp {bar} --stiffness bar.sti"), &["--mass"]),
        (2, format!("reduce blade --stiffness bar.sti --mass bar.mas {bar}"), &["--nodes", "mesh file"]),
        (2, format!("reduce blade bar.inp {bar} --stiffness bar.sti --mass bar.mas --material steel"), &["cannot be used with", "--stiffness"]),
        (1, format!("reduce blade bar.inp {bar} --stiffness k.mtx --mass bar.mas"), &["k.mtx", "3 rows", "96"]),
        (1, format!("reduce blade bar.inp {bar} --stiffness bar.mas --mass bar.sti --dofs bar.dof"), &["swapped"]),
        (2, "reduce sector sector.msh --contact-set TIP --clamp-set BORE --cyclic-low LOW --material steel --units mm-t-s".into(), &["--cyclic-high"]),
        (1, "reduce sector sector.msh --contact-set TIP --clamp-set BORE --cyclic-low LOW --cyclic-high HIGH --sectors 13 --material steel --units mm-t-s".into(), &["cyclic faces", "number of sectors"]),
        (1, "reduce sector sector.msh --contact-set LOW --clamp-set BORE --cyclic-low LOW --cyclic-high HIGH --sectors 12 --material steel --units mm-t-s".into(), &["LOW", "faces"]),
    ];
    for (code, line, wanted) in cases {
        let message = project.fail(&line, code);
        println!("{}", message.trim_end());
        for part in wanted {
            assert!(message.contains(part), "`{part}` is not in: {message}\n{line}");
        }
    }
}

#[test]
fn free_disk_rigid_body_modes_cause_no_warning() {
    let project = ModelProject::new(&["sector.msh"]);
    let line = "reduce sector sector.msh --contact-set TIP --clamp-set none --sectors 12 --cyclic-low LOW --cyclic-high HIGH \
                --units mm-t-s --material steel --contact-nodes 2 --modes 25";
    let output = project.run(line);
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{stderr}");
    assert!(!stderr.contains("(0.0 Hz)") && !stderr.contains("(-0.0 Hz)"), "{stderr}");
}

#[test]
fn user_casing_mesh_reproduces_the_built_in_casing() {
    let project = ModelProject::new(&[]);
    let common = "--contact-grid 12x2 --modes 20 --fixed-interface-modes 40";
    project.succeed(&format!(
        "reduce casing --mesh 24x1x6 --patches 0x0 {common} -o ships.rom.safetensors --inp ring.inp"
    ));
    let file = format!(
        "reduce casing-mesh ring.inp --contact-set INNER --clamp-set CLAMPED --contact-axial 0.0026:0.038 {common}"
    );
    let reported = project.succeed(&format!("{file} -o own.rom.safetensors"));
    assert_eq!(reported["model"]["contact_nodes"].as_array().unwrap().len(), 24);
    let (ships, own) = (project.rom("ships.rom.safetensors"), project.rom("own.rom.safetensors"));
    assert_eq!(own.extras.grid, ships.extras.grid);
    for (own, ships) in own.contact_nodes.iter().zip(&ships.contact_nodes) {
        assert_eq!(own.name, ships.name);
        assert!(own.position.iter().zip(ships.position).all(|(a, b)| (a - b).abs() < 1e-12), "{own:?} {ships:?}");
    }
    // Two rings define a straight line; the built-in ring has the exact contour.
    let [[low, _, front], [high, _, back]] = [own.contact_nodes[0].position, own.contact_nodes[12].position];
    assert!((own.contact_nodes[0].meridional_slope - (high - low) / (back - front)).abs() < 1e-9);
    let off = (own.stiffness.diagonal() - ships.stiffness.diagonal()).component_div(&ships.stiffness.diagonal()).amax();
    println!("eigenvalues differ by {off:.1e}");
    assert!(own.order() == ships.order() && off < 1e-9, "{off:.1e}");
    // The expansion from the command line is combined with the material of the file, which defines the other properties.
    let heated = file
        .replace("12x2", "4x2")
        .replace("--modes 20 --fixed-interface-modes 40", "--modes 8 --fixed-interface-modes 8");
    let loads = |expansion: &str| {
        project.succeed(&format!("{heated} --patches 4x1 --expansion {expansion} -o hot.rom.safetensors --force"));
        project.rom("hot.rom.safetensors").extras.thermal.unwrap().loads.amax()
    };
    assert!((loads("2e-5") / loads("1e-5") - 2.0).abs() < 1e-6);
    // Between nodes, the grid lies on the faces, and angles start from zero.
    let between = project.run(&format!("{} --force -o between.rom.safetensors", file.replace("12x2", "13x2")));
    let text = String::from_utf8_lossy(&between.stdout);
    assert!(
        between.status.success()
            && text.contains("contact points            26 from INNER: 13 around x 2 along, on the faces"),
        "{text}"
    );
    let between = project.rom("between.rom.safetensors").contact_nodes[14].position;
    assert!((between[1] - TAU / 13.0).abs() < 1e-12 && (between[2] - 0.038).abs() < 1e-12, "{between:?}");
    for (line, code, words) in [
        (file.replace("12x2", "12x14"), 1, ["too coarse to move 12 x 14 points", "fewer rings"]),
        (format!("{file} --sectors 12"), 2, ["unexpected argument", "--sectors"]),
    ] {
        let text = project.fail(&line, code);
        assert!(words.iter().all(|word| text.contains(word)), "{line}: {text}");
    }
}

#[test]
fn conducts_heat_in_a_casing_mesh_of_the_user() {
    let project = ModelProject::new(&[]);
    // The parts of a library for heat conduction on Linux on x86-64 that packaging checks.
    let mut library = vec![0_u8; 4096];
    library[..20].copy_from_slice(b"\x7fELF\x02\x01\x01\0\0\0\0\0\0\0\0\0\x03\0\x3e\0");
    let parts = ["fmi2DoStep\0fmi3DoStep\0", tiprub_format::LIBRARY_RELEASE, tiprub_format::THERMAL_FILE];
    for (place, part) in [64, 128, 512].into_iter().zip(parts) {
        library[place..][..part.len()].copy_from_slice(part.as_bytes());
    }
    fs::write(project.root.path().join("library.so"), library).unwrap();
    project.succeed(
        "reduce casing --mesh 24x1x6 --patches 0x0 --contact-grid 12x2 --modes 8 --fixed-interface-modes 8 -o a.rom.safetensors --inp ring.inp",
    );
    let common = "--contact-axial 0.0026:0.038 --patches 4x1 --modes 4 --library library.so --fmi 3 -o .";
    let own = format!("thermal ring.inp --contact-set INNER --material steel {common}");
    let [built, own_facts] = [format!("thermal --mesh 24x1x6 --contact-grid 12x2 {common}"), own.clone()]
        .map(|line| project.succeed(&line)["model"].take());
    assert_eq!(own_facts["name"], "ring_thermal");
    let numbers = |facts: &Value| -> Vec<f64> {
        let lists = ["areas", "conductances", "time_constants"].map(|key| facts[key].as_array().unwrap().clone());
        lists.concat().iter().chain([&facts["heat_capacity"]]).map(|value| value.as_f64().unwrap()).collect()
    };
    for (own, built) in numbers(&own_facts).iter().zip(numbers(&built)) {
        assert!((own / built - 1.0).abs() < 1e-8, "{own_facts} {built}");
    }
    let found = project.succeed(&own.replace("--contact-set INNER", "--name found"));
    assert_eq!(numbers(&found["model"]), numbers(&own_facts));
    for (line, code, words) in [
        (own.replace("--material steel", ""), 2, ["material of FILE", "--conductivity"]),
        (own.replace("INNER", "OUTER"), 1, ["none of the 144 outer faces points", "--contact-set"]),
        (own.replace("--contact-set INNER", "--axis x"), 1, ["not a full ring about the z axis", "--axis"]),
        (format!("{own} --mesh 24x1x6"), 2, ["cannot be used with", "--mesh"]),
    ] {
        let text = project.fail(&line, code);
        assert!(words.iter().all(|word| text.contains(word)), "{line}: {text}");
    }
}

#[test]
fn accepts_node_numbers_and_rejects_invalid_tips_and_axes() {
    let project = ModelProject::new(&["blade_hex8.inp"]);
    let line =
        "reduce blade blade_hex8.inp --clamp-set ROOT --sectors 36 --units mm-t-s --material steel --modes 4 --force";
    let reported = project.succeed(&format!("{line} --contact-set TIP --contact-nodes 3 -o set.rom.safetensors"));
    let numbers: Vec<String> =
        reported["model"]["contact_nodes"].as_array().unwrap().iter().map(|node| node["node"].to_string()).collect();
    project.succeed(&format!("{line} --contact-set {} -o numbers.rom.safetensors", numbers.join(",")));
    let [by_set, by_number] = ["set", "numbers"].map(|name| project.rom(&format!("{name}.rom.safetensors")));
    assert_eq!(by_set.contact_map, by_number.contact_map);
    let places = |rom: &tiprub_core::Rom| rom.contact_nodes.iter().map(|node| node.position).collect::<Vec<_>>();
    assert_eq!(places(&by_set), places(&by_number));
    let error = project.fail(&format!("{line} --contact-set 1,999999999"), 1);
    assert!(error.contains("no node 999999999"), "{error}");
    // Clamped at the tip, with contact at the root.
    let line =
        "reduce blade blade_hex8.inp --sectors 36 --units mm-t-s --material steel --modes 4 --contact-nodes 3 --force";
    let swapped = format!("{line} --contact-set ROOT --clamp-set TIP");
    let refused = project.fail(&swapped, 1);
    assert!(refused.contains("the tip, the root") && refused.contains("--accept-implausible"), "{refused}");
    let meant = project.succeed(&format!("{swapped} --accept-implausible"));
    assert!(meant["warnings"].to_string().contains("the tip, the root"), "{}", meant["warnings"]);
    let turned =
        format!("{line} --contact-set TIP --clamp-set ROOT --axis x --sectors 400").replacen("--sectors 36 ", "", 1);
    assert!(project.fail(&turned, 1).contains("axis"));
    let right = project.succeed(&format!("{line} --contact-set TIP --clamp-set ROOT"));
    assert!(!right["warnings"].to_string().contains("axis"), "{}", right["warnings"]);
}
