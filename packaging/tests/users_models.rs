//! Models of a user's own, as the user meets them: reduce, package, run, and what is said of wrong ones.

#[path = "../../tests/guide.rs"]
mod guide;

use guide::told;
use std::{
    fs,
    path::{Path, PathBuf},
    process::{Command, Output},
};

use serde_json::Value;
use tempfile::TempDir;

fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/data/models").join(name)
}

/// A directory with the models of the tests.
struct Project {
    root: TempDir,
}

impl Project {
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

/// The scene of the guide.
fn scene() -> String {
    let guide = guide();
    let text = guide.split("```toml\n").nth(1).unwrap().split("```").next().unwrap();
    assert!(text.lines().count() <= 20, "a scene of one's own needs no more than 20 lines");
    text.to_owned()
}

/// The command of the guide that reduces the blade, without `tiprub`.
fn command() -> String {
    let guide = guide();
    let lines = guide.split("\n    tiprub reduce blade blade.inp --contact-set TIP").nth(2).expect("the second one");
    let text: String = lines.split("\n    tiprub package").next().unwrap().replace("\\\n", " ");
    format!("reduce blade blade_hex20.inp --contact-set TIP{text}")
}

#[test]
fn a_mesh_of_gmsh_becomes_a_running_scene_as_the_guide_tells() {
    let project = Project::new(&["blade_hex20.inp"]);
    let told = project.succeed(&command());
    assert_eq!(told["rom"]["sectors"], 36);
    assert_eq!(told["model"]["sets"]["TIP"], 53);
    assert!((told["model"]["mass"].as_f64().unwrap() - 0.0771).abs() < 1e-4);
    let names: Vec<&str> =
        told["rom"]["contact_nodes"].as_array().unwrap().iter().map(|node| node["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["leading_edge", "mid_chord", "trailing_edge"]);
    // The chord of the tip is 32 mm at 40 degrees to the axis: the edges' middles lie 12.26 mm before and behind.
    let rom = project.rom("blade.rom.safetensors");
    for (node, z) in rom.contact_nodes.iter().zip([-12.256e-3, 0.0, 12.256e-3]) {
        let [radius, _, axial] = node.position;
        assert!((axial - z).abs() < 5e-6 && (radius - 0.26).abs() < 3e-4, "{node:?}");
    }
    project.write("blade.toml", scene());
    let run = project.succeed("run blade.toml --csv rub.csv");
    assert_eq!(run["communication_steps"], 500);
    let csv = fs::read_to_string(project.root.path().join("rub.csv")).unwrap();
    let names: Vec<&str> = csv.lines().next().unwrap().split(',').collect();
    let column = names.iter().position(|name| *name == "clearance_minimum").unwrap();
    let smallest = csv.lines().skip(1).map(|line| line.split(',').nth(column).unwrap().parse::<f64>().unwrap());
    let smallest = smallest.fold(f64::INFINITY, f64::min);
    assert!(smallest.abs() < 2e-6, "the lobes close the gap and the blades give way: {smallest}");
}

#[test]
fn matrices_of_calculix_give_the_rom_of_the_mesh() {
    let project =
        Project::new(&["bar.inp", "bar.sti", "bar.mas", "bar.dof", "bar_held.sti", "bar_held.mas", "bar_held.dof"]);
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
        // Shapes have no sign of their own.
        let off = (found.mass.abs() - expected.mass.abs()).amax() / expected.mass.amax();
        let stiffness = (found.stiffness.abs() - expected.stiffness.abs()).amax() / expected.stiffness.amax();
        println!("{name}: mass off by {off:.2e}, stiffness by {stiffness:.2e}");
        assert!(off < 1e-10 && stiffness < 1e-10, "{name}: {off:.2e} {stiffness:.2e}");
        assert!(found.origin.contains(".sti"), "{}", found.origin);
    }
}

#[test]
fn a_sector_of_gmsh_becomes_a_disk_with_the_frequencies_of_calculix() {
    let project = Project::new(&["sector.msh"]);
    let line = "reduce sector sector.msh --contact-set TIP --clamp-set BORE --sectors 12 --cyclic-low LOW --cyclic-high HIGH \
                --units mm-t-s --young 210e9 --poisson 0.3 --density 7850 --contact-nodes 3 --modes 12 \
                --inp sector_out.inp --vtk sector.vtu";
    let told = project.succeed(line);
    let faces = &told["model"]["faces"];
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
    // The other way round is noticed and put right.
    let swapped = line.replace("--cyclic-low LOW --cyclic-high HIGH", "--cyclic-low HIGH --cyclic-high LOW --force");
    assert_eq!(project.succeed(&swapped)["model"]["faces"]["swapped"], true);
    assert!(project.rom("sector.rom.safetensors") == rom);
}

#[test]
fn an_exported_mesh_is_read_back_to_the_same_frequencies() {
    let project = Project::new(&[]);
    let first = project.succeed("reduce rotor37 --mesh 6x1x6 --inp blade.inp");
    let again =
        project.succeed("reduce blade blade.inp --contact-set TIP --clamp-set HUB --contact-nodes 3 --modes 20");
    let (a, b) = (numbers(&first["rom"]["checks"], "full_hz"), numbers(&again["rom"]["checks"], "full_hz"));
    assert!(a.iter().zip(&b).all(|(a, b)| (a / b - 1.0).abs() < 1e-9), "{a:?} {b:?}");
}

/// Patches over the whole tip of an exported mesh: those of the blade itself; a scene runs with them.
#[test]
fn patches_of_a_mesh_of_ones_own_are_those_of_the_blade() {
    let project = Project::new(&[]);
    let own = project
        .succeed("reduce rotor37 --mesh 6x1x6 --inp blade.inp --contact-patches 4 --modes 20 -o own.rom.safetensors");
    assert!(
        own["rom"]["origin"].as_str().unwrap().contains("forces on 4 patches and 20 free-interface modes"),
        "{own:#}"
    );
    let line = "reduce blade blade.inp --contact-set TIP --clamp-set HUB --sectors 36 --contact-patches 4 --modes 20 \
                -o read.rom.safetensors";
    let read = project.succeed(line);
    assert_eq!(
        read["model"]["contact_nodes"][1]["patch_nodes"].as_u64().map(|nodes| nodes > 9),
        Some(true),
        "{read:#}"
    );
    let [own, read] = ["own.rom.safetensors", "read.rom.safetensors"].map(|name| project.rom(name));
    for (own, read) in own.contact_nodes.iter().zip(&read.contact_nodes) {
        assert_eq!(own.name, read.name);
        let near = own.position.iter().zip(read.position).all(|(a, b)| (a - b).abs() < 1e-9);
        assert!(near && (own.meridional_slope - read.meridional_slope).abs() < 1e-6, "{own:?} {read:?}");
    }
    let flexibility = |rom: &tiprub_core::Rom| rom.stiffness.clone().try_inverse().unwrap();
    let (own, read) = (flexibility(&own), flexibility(&read));
    assert!((own.view((0, 0), (12, 12)) - read.view((0, 0), (12, 12))).amax() < 1e-7 * own.amax());
    let scene =
        fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../src/gallery/scenes/rotor37.toml")).unwrap();
    project.write(
        "scene.toml",
        scene.replace("builtin:rotor37", "read.rom.safetensors").replace("modal-exact", "massless-boundary"),
    );
    let run = project.succeed("run scene.toml --stop 0.003");
    assert!(run["last"]["friction_loss"].as_f64().unwrap() > 100.0, "{run:#}");
    for (line, told) in [
        ("reduce rotor37 --contact-patches 4 --contact-nodes 3", "cannot be used with"),
        ("reduce rotor37 --mesh 6x1x6 --contact-patches 40", "40 is outside 1..=16"),
        (
            "reduce blade blade.inp --contact-set TIP --clamp-set HUB --contact-patches 2 --contact-names a",
            "1 names for 2 contact patches",
        ),
    ] {
        let code = if told.contains("cannot") || told.contains("names") { 2 } else { 1 };
        assert!(project.fail(line, code).contains(told), "{line}: {}", project.fail(line, code));
    }
}

/// Rows of patches across the thickness of an exported mesh: those of the blade itself, with a row in every name and their number in the ROM.
#[test]
fn rows_of_patches_of_a_mesh_of_ones_own_are_those_of_the_blade() {
    let project = Project::new(&[]);
    let line = "reduce rotor37 --mesh 6x2x4 --inp blade.inp --contact-patches 4 --contact-rows 2 --modes 20 -o own.rom.safetensors";
    let own = project.succeed(line);
    assert!(own["rom"]["origin"].as_str().unwrap().contains("forces on 8 patches in 2 rows and 20"), "{own:#}");
    let common = "reduce blade blade.inp --contact-set TIP --clamp-set HUB --sectors 36 --modes 20";
    let read = project.succeed(&format!("{common} --contact-patches 4 --contact-rows 2 -o read.rom.safetensors"));
    assert_eq!((&own["rom"]["contact_rows"], &read["rom"]["contact_rows"]), (&2.into(), &2.into()));
    let [own, read] = ["own.rom.safetensors", "read.rom.safetensors"].map(|name| project.rom(name));
    assert_eq!([own.rows(), read.rows()], [2, 2]);
    for (contact, told) in
        [("--contact-rows 2", "rows across the thickness 2\n"), ("", "1: the sides of the tip do not touch")]
    {
        let line = format!("{common} --contact-patches 4 {contact} --force -o told.rom.safetensors");
        let output = project.run(&line);
        let text = String::from_utf8(output.stdout).unwrap();
        assert!(text.contains(told), "{line}: {text}");
    }
    for (own, read) in own.contact_nodes.iter().zip(&read.contact_nodes) {
        assert_eq!(own.name, read.name);
        assert!(own.position.iter().zip(read.position).all(|(a, b)| (a - b).abs() < 1e-9), "{own:?} {read:?}");
    }
    let [first, last] = [&own.contact_nodes[0], &own.contact_nodes[7]];
    assert_eq!([first.name.as_str(), last.name.as_str()], ["patch_1_row_1", "patch_4_row_2"]);
    // The sides of the tip, not thirds of its thickness: rθ apart by the mesh's own sides, which lines of patches follow.
    let across = own.contact_nodes[6].position[1] - own.contact_nodes[2].position[1];
    assert!((2e-3..2e-2).contains(&across.abs()), "{across}");
    let named = format!("{common} --contact-patches 2 --contact-rows 2 --contact-names a,b -o named.rom.safetensors");
    project.succeed(&named);
    let names: Vec<String> =
        project.rom("named.rom.safetensors").contact_nodes.into_iter().map(|node| node.name).collect();
    assert_eq!(names, ["a_row_1", "b_row_1", "a_row_2", "b_row_2"]);
    // The scene that ships with rows, around the coarse blade.
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../src/gallery/scenes/rotor37-rows.toml");
    let scene = fs::read_to_string(path).unwrap().replace("builtin:rotor37-rows", "read.rom.safetensors");
    project.write("scene.toml", &scene);
    let run = project.succeed("run scene.toml --stop 0.003 --estimate");
    assert!(run["last"]["friction_loss"].as_f64().unwrap() > 100.0, "{run:#}");
    let why = run["estimated_errors"]["rows"]["unknown"].as_str().unwrap();
    assert!(why.contains("two rows of patches do not tell") && why.contains("--contact-rows 3"), "{why}");
    let coating = "\n[contact.coating]\nthickness = 2e-3\nmodulus = 1e9\nyield_stress = 5e6\nhardening = 1e8\ncells_around = 720\ncells_along = 5\n";
    project.write(
        "coated.toml",
        scene
            .replace("\n[time]", &format!("{coating}\n[time]"))
            .replace("galerkin", "modal-exact")
            .replace("8.0e-5", "5.0e-7"),
    );
    let told = project.fail("run coated.toml --stop 0.001", 1);
    assert!(told.contains("contact[1].coating: excludes a ROM whose contact patches are in rows"), "{told}");
    for (line, told, code) in [
        ("reduce rotor37 --contact-rows 2 --contact-nodes 3".to_owned(), "cannot be used with", 2),
        ("reduce stage --contact-rows 2".to_owned(), "--contact-patches", 2),
        (format!("{common} --contact-rows 2 -o no.rom"), "Say how many patches along the chord", 2),
        (
            format!("{common} --contact-patches 4 --contact-rows 14 -o no.rom"),
            "14 rows of 4 are none, or more than the",
            1,
        ),
        ("reduce rotor37 --mesh 6x1x4 --contact-patches 4 --contact-rows 0".to_owned(), "0 rows of 4 are none", 1),
    ] {
        assert!(project.fail(&line, code).contains(told), "{line}: {}", project.fail(&line, code));
    }
}

/// The tip is found where no set names it: the nodes of the set TIP, of every kind of element; five patches, free-interface modes.
#[test]
fn the_tip_of_a_mesh_is_found_and_told() {
    let files = [
        "blade_tet10.inp",
        "blade_hex20.inp",
        "blade_hex8.inp",
        "blade_penta15.inp",
        "blade_tet10.msh",
        "blade_hex20_binary.msh",
    ];
    let project = Project::new(&files);
    for file in files {
        let line =
            format!("reduce blade {file} --clamp-set ROOT --units mm-t-s --material titanium --modes 12 --force");
        let found = project.succeed(&format!("{line} -o found.rom.safetensors"));
        let tip = &found["model"]["tip"];
        assert_eq!(tip["nodes"], found["model"]["sets"]["TIP"], "{file}: {tip}");
        assert!((tip["chord"].as_f64().unwrap() - 0.0321).abs() < 5e-4, "{file}: {tip}");
        let radii = [0, 1].map(|end| tip["radius"][end].as_f64().unwrap());
        assert!((radii[0] - 0.2597).abs() < 4e-4 && (radii[1] - 0.2601).abs() < 4e-4, "{file}: {tip}");
        let patches = found["model"]["contact_nodes"].as_array().unwrap();
        // Nine, or as many as the elements are wide.
        let count = patches.len();
        assert!(
            (5..=9).contains(&count) && patches.iter().all(|patch| patch["patch_nodes"].as_u64() > Some(2)),
            "{patches:?}"
        );
        assert!(
            found["rom"]["origin"].as_str().unwrap().contains(&format!("{count} patches and 12 free-interface modes"))
        );
        project.succeed(&format!("{line} --contact-set TIP --contact-patches {count} -o named.rom.safetensors"));
        assert!(project.rom("found.rom.safetensors") == project.rom("named.rom.safetensors"), "{file}");
        let told = String::from_utf8(project.run(&format!("{line} -o text.rom.safetensors")).stdout).unwrap();
        let patches = format!("contact patches           {count} from the tip that was found");
        let wanted = ["tip found", "faces, ", "chord 0.032", &patches];
        assert!(wanted.iter().all(|part| told.contains(part)), "{told}");
    }
}

/// Radial flexibility (m/N) in the middle of the tip, on meshes of three kinds: patches do not depend on the elements, nodes do.
#[test]
fn patches_of_other_elements_are_as_soft() {
    let kinds = ["hex20", "penta15", "tet10"];
    let files = kinds.map(|kind| format!("blade_{kind}.inp"));
    let project = Project::new(&files.each_ref().map(String::as_str));
    let radial = |file: &String, contact: &str| -> f64 {
        let line = "--clamp-set ROOT --units mm-t-s --material titanium --modes 8 --kind free-interface --force -o r.rom.safetensors";
        project.succeed(&format!("reduce blade {file} {contact} {line}"));
        project.rom("r.rom.safetensors").stiffness.try_inverse().unwrap()[(6, 6)]
    };
    let all = |contact: &str| files.each_ref().map(|file| radial(file, contact));
    let (nodes, patches) = (all("--contact-nodes 5"), all("--contact-patches 5"));
    for (kind, (node, patch)) in kinds.iter().zip(nodes.into_iter().zip(patches)) {
        told!("| {kind} | {node} | {patch} |");
    }
    let apart = |values: [f64; 3]| {
        values.iter().fold(0.0, |a: f64, b| a.max(*b)) / values.iter().fold(f64::INFINITY, |a, b| a.min(*b)) - 1.0
    };
    assert!(apart(patches) < 0.02 && apart(nodes) > 0.2, "{patches:?} {nodes:?}");
    guide::hold("cargo test -p tiprub --test users_models");
}

/// Contact at points is warned of where the mesh could carry more, and at one place always.
#[test]
fn contact_at_points_of_a_fine_tip_is_warned_of() {
    let project = Project::new(&["blade_hex20.inp", "bar.inp", "blade_tet10.msh"]);
    let warned = |line: &str| -> String {
        let common = "--units mm-t-s --material titanium --modes 4 --clamp-set ROOT --force -o w.rom.safetensors";
        project.succeed(&format!("reduce blade {line} {common}"))["warnings"].to_string()
    };
    for (line, wanted) in [
        ("blade_hex20.inp --contact-set TIP", Some("contact at 3 nodes of a tip about")),
        ("blade_hex20.inp --contact-set TIP --contact-nodes 1", Some("contact at a single node of a tip")),
        ("blade_hex20.inp --contact-patches 1", Some("contact at the single patch `patch_1`")),
        ("blade_hex20.inp --contact-nodes 7", None),
        ("blade_hex20.inp --contact-patches 3 --kind craig-bampton", None),
        ("blade_hex20.inp --contact-patches 7", None),
        ("blade_hex20.inp --contact-patches 9", Some("9 contact patches along about 6 edges of elements")),
        ("blade_tet10.msh --contact-set TIP --contact-patches 12", Some("12 contact patches along about")),
        ("blade_hex20.inp --contact-patches 7 --contact-rows 3", None),
        ("blade_hex20.inp --contact-patches 7 --contact-rows 4", Some("4 rows of contact patches across 2 elements")),
    ] {
        let told = warned(line);
        match wanted {
            Some(part) => assert!(told.contains(part), "{line}: {told}"),
            None => assert!(!told.contains("contact at") && !told.contains("contact patches"), "{line}: {told}"),
        }
    }
    let own = |patches: usize| -> String {
        let line =
            format!("reduce rotor37 --mesh 6x1x4 --modes 6 --contact-patches {patches} --force -o r.rom.safetensors");
        project.succeed(&line)["warnings"].to_string()
    };
    assert!(own(9).contains("9 contact patches along about 6 edges"), "{}", own(9));
    assert!(!own(7).contains("contact patches"), "{}", own(7));
}

/// The mesh of the tests twice: the same blade again, turned about the axis and a little farther in or as far out.
fn two_blades(farther_in: f64) -> String {
    const NEXT: usize = 5000;
    let text = fs::read_to_string(data("blade_hex20.inp")).unwrap();
    let second = text.split_once("*NODE\n").unwrap().1;
    let (sine, cosine) = 0.4_f64.sin_cos();
    let mut found = format!("{}*NODE\n", text);
    let mut nodes = true;
    for line in second.lines() {
        let words: Vec<&str> = line.split(',').map(str::trim).filter(|word| !word.is_empty()).collect();
        if let Some(keyword) = line.strip_prefix('*') {
            nodes = false;
            let suffix = if keyword.contains("ELSET") { "_TWO" } else { "" };
            found.push_str(&format!("*{keyword}{suffix}\n"));
        } else if nodes {
            let [x, y, z] = [1, 2, 3].map(|place| words[place].parse::<f64>().unwrap());
            let number = words[0].parse::<usize>().unwrap() + NEXT;
            let (x, y) = (x - farther_in, y);
            found.push_str(&format!("{number}, {}, {}, {z}\n", cosine * x - sine * y, sine * x + cosine * y));
        } else {
            let next = words.iter().map(|word| (word.parse::<usize>().unwrap() + NEXT).to_string());
            let comma = if line.trim_end().ends_with(',') { "," } else { "" };
            found.push_str(&format!("{}{comma}\n", next.collect::<Vec<_>>().join(", ")));
        }
    }
    found
}

/// A second surface as far out is told of, one well inside is not; the tip is that of one blade. The texts are those of the guide.
#[test]
fn a_second_surface_as_far_out_is_told_of() {
    let project = Project::new(&[]);
    let reduce = |farther_in: f64| -> Value {
        project.write("two.inp", two_blades(farther_in));
        let line = "reduce blade two.inp --clamp-set ROOT --clamp-set ROOT_TWO --units mm-t-s --material titanium --modes 8 --force";
        project.succeed(&format!("{line} -o two.rom.safetensors"))
    };
    let found = reduce(0.0);
    let warnings = found["warnings"].to_string();
    assert!(
        warnings.contains("beside the tip that was found 12 faces that are not connected with it are as far out"),
        "{warnings}"
    );
    assert_eq!(found["model"]["tip"]["faces"], 12, "{found:#}");
    let inside = reduce(3.0);
    assert!(!inside["warnings"].to_string().contains("as far out"), "{inside:#}");
    let guide = guide();
    for told in [
        "beside the tip that was found 12 faces that are not connected with it are as far out",
        "contact at a single node of a tip about 6 edges of elements long",
        "9 contact patches along about 6 edges of elements",
    ] {
        assert!(guide.contains(told), "{told}");
    }
}

/// Of a sector the tip is found as well, and both kinds take patches; static flexibility at them is one.
#[test]
fn a_sector_has_patches_of_both_kinds() {
    let project = Project::new(&["sector.msh"]);
    let line = "reduce sector sector.msh --clamp-set BORE --sectors 12 --cyclic-low LOW --cyclic-high HIGH --units mm-t-s --material steel \
                --modes 6";
    let free = project.succeed(&format!("{line} -o free.rom.safetensors"));
    let count = free["model"]["contact_nodes"].as_array().unwrap().len();
    assert_eq!(count, 3, "two elements along the chord have no more than three patches");
    assert!(free["rom"]["origin"].as_str().unwrap().contains(&format!("forces on {count} patches and")), "{free:#}");
    let held =
        format!("{line} --contact-set TIP --contact-patches {count} --kind craig-bampton -o held.rom.safetensors");
    project.succeed(&held);
    let [free, held] = ["free.rom.safetensors", "held.rom.safetensors"].map(|name| {
        let rom = project.rom(name);
        &rom.contact_map * rom.stiffness.clone().try_inverse().unwrap() * rom.contact_map.transpose()
    });
    assert!((&free - &held).amax() < 1e-9 * free.amax(), "{:e}", (&free - &held).amax() / free.amax());
}

#[test]
fn effects_of_spin_are_computed_for_a_mesh_of_ones_own() {
    let project = Project::new(&["blade_tet10.msh"]);
    let line = "reduce blade blade_tet10.msh --contact-set TIP --clamp-set ROOT --units mm-t-s --material titanium --spin 1500";
    let told = project.succeed(line);
    assert_eq!(told["rom"]["spin"]["largest_speed"], 1500.0);
    let check = &told["spin"][1];
    let (rest, spinning) = (told["rom"]["checks"][0]["full_hz"].as_f64().unwrap(), &check["full_frequencies"][0]);
    assert!(spinning.as_f64().unwrap() > 1.005 * rest, "{spinning} {rest}");
}

#[test]
fn wrong_command_lines_and_models_are_refused_with_the_remedy() {
    let project = Project::new(&["bar.inp", "bar.sti", "bar.mas", "bar.dof", "sector.msh", "blade_hex8.inp"]);
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
        (1, format!("reduce blade bar.inp {bar} --material steel --contact-nodes 40"), &["40 of a set of", "Give a number"]),
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
        (1, format!("reduce blade bar.inp {bar} --stiffness bar.mas --mass bar.sti --dofs bar.dof"), &["exchanged"]),
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
fn rigid_body_modes_of_a_free_disk_are_no_reason_to_warn() {
    let project = Project::new(&["sector.msh"]);
    let line = "reduce sector sector.msh --contact-set TIP --clamp-set none --sectors 12 --cyclic-low LOW --cyclic-high HIGH \
                --units mm-t-s --material steel --contact-nodes 2 --modes 25";
    let output = project.run(line);
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{stderr}");
    assert!(!stderr.contains("(0.0 Hz)") && !stderr.contains("(-0.0 Hz)"), "{stderr}");
}

#[test]
fn a_casing_of_ones_own_is_the_casing_that_ships() {
    let project = Project::new(&[]);
    let common = "--contact-grid 12x2 --modes 20 --fixed-interface-modes 40";
    project.succeed(&format!(
        "reduce casing --mesh 24x1x6 --patches 0x0 {common} -o ships.rom.safetensors --inp ring.inp"
    ));
    let file = format!(
        "reduce casing-mesh ring.inp --contact-set INNER --clamp-set CLAMPED --contact-axial 0.0026:0.038 {common}"
    );
    let told = project.succeed(&format!("{file} -o own.rom.safetensors"));
    assert_eq!(told["model"]["contact_nodes"].as_array().unwrap().len(), 24);
    let (ships, own) = (project.rom("ships.rom.safetensors"), project.rom("own.rom.safetensors"));
    assert_eq!(own.extras.grid, ships.extras.grid);
    for (own, ships) in own.contact_nodes.iter().zip(&ships.contact_nodes) {
        assert_eq!(own.name, ships.name);
        assert!(own.position.iter().zip(ships.position).all(|(a, b)| (a - b).abs() < 1e-12), "{own:?} {ships:?}");
    }
    // Two rings tell a straight line; the ring that ships knows its contour.
    let [[low, _, front], [high, _, back]] = [own.contact_nodes[0].position, own.contact_nodes[12].position];
    assert!((own.contact_nodes[0].meridional_slope - (high - low) / (back - front)).abs() < 1e-9);
    let off = (own.stiffness.diagonal() - ships.stiffness.diagonal()).component_div(&ships.stiffness.diagonal()).amax();
    println!("eigenvalues differ by {off:.1e}");
    assert!(own.order() == ships.order() && off < 1e-9, "{off:.1e}");
    // The expansion of the command line holds beside the file's material, which has the rest.
    let heated = file
        .replace("12x2", "4x2")
        .replace("--modes 20 --fixed-interface-modes 40", "--modes 8 --fixed-interface-modes 8");
    let loads = |expansion: &str| {
        project.succeed(&format!("{heated} --patches 4x1 --expansion {expansion} -o hot.rom.safetensors --force"));
        project.rom("hot.rom.safetensors").extras.thermal.unwrap().loads.amax()
    };
    assert!((loads("2e-5") / loads("1e-5") - 2.0).abs() < 1e-6);
    for (line, code, words) in [
        (file.replace("12x2", "13x2"), 1, ["no node at", "divides"]),
        (file.replace("12x2", "12x14"), 1, ["fewer than 14 rings", "fewer rings"]),
        (format!("{file} --sectors 12"), 2, ["unexpected argument", "--sectors"]),
    ] {
        let text = project.fail(&line, code);
        assert!(words.iter().all(|word| text.contains(word)), "{line}: {text}");
    }
}

#[test]
fn contact_nodes_are_given_by_number_and_slips_of_tip_and_axis_are_asked_about() {
    let project = Project::new(&["blade_hex8.inp"]);
    let line =
        "reduce blade blade_hex8.inp --clamp-set ROOT --sectors 36 --units mm-t-s --material steel --modes 4 --force";
    let told = project.succeed(&format!("{line} --contact-set TIP -o set.rom.safetensors"));
    let numbers: Vec<String> =
        told["model"]["contact_nodes"].as_array().unwrap().iter().map(|node| node["node"].to_string()).collect();
    project.succeed(&format!("{line} --contact-set {} -o numbers.rom.safetensors", numbers.join(",")));
    let [by_set, by_number] = ["set", "numbers"].map(|name| project.rom(&format!("{name}.rom.safetensors")));
    assert_eq!(by_set.contact_map, by_number.contact_map);
    let places = |rom: &tiprub_core::Rom| rom.contact_nodes.iter().map(|node| node.position).collect::<Vec<_>>();
    assert_eq!(places(&by_set), places(&by_number));
    let error = project.fail(&format!("{line} --contact-set 1,999999999"), 1);
    assert!(error.contains("no node 999999999"), "{error}");
    // Held at the tip, touching with the root.
    let line = "reduce blade blade_hex8.inp --sectors 36 --units mm-t-s --material steel --modes 4 --force";
    let swapped = project.succeed(&format!("{line} --contact-set ROOT --clamp-set TIP"));
    assert!(swapped["warnings"].to_string().contains("tip and root"), "{}", swapped["warnings"]);
    let turned = project.succeed(
        &format!("{line} --contact-set TIP --clamp-set ROOT --axis x --sectors 400").replacen("--sectors 36 ", "", 1),
    );
    assert!(turned["warnings"].to_string().contains("axis"), "{}", turned["warnings"]);
    let right = project.succeed(&format!("{line} --contact-set TIP --clamp-set ROOT"));
    assert!(!right["warnings"].to_string().contains("axis"), "{}", right["warnings"]);
}
