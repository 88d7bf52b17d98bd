//! Tip of a user mesh: its detection, patches over it, and warnings about contact at points.

use std::{fs, path::Path};

use serde_json::Value;

use super::{ModelProject, data, guide};

/// Patches over the whole tip of an exported mesh agree with those of the blade itself; a scene runs with them.
#[test]
fn user_mesh_patches_match_the_built_in_blade() {
    let project = ModelProject::new(&[]);
    let own = project
        .succeed("reduce rotor37 --mesh 6x1x6 --inp blade.inp --contact-patches 4 --contact-rows 1 --modes 20 -o own.rom.safetensors");
    assert!(
        own["rom"]["origin"].as_str().unwrap().contains("forces on 4 patches and 20 free-interface modes"),
        "{own:#}"
    );
    let line = "reduce blade blade.inp --contact-set TIP --clamp-set HUB --sectors 36 --contact-patches 4 --contact-rows 1 \
                --modes 20 -o read.rom.safetensors";
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
        fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../src/gallery/scenes/rotor37-one-row.toml"))
            .unwrap();
    project.write(
        "scene.toml",
        scene.replace("builtin:rotor37-one-row", "read.rom.safetensors").replace("modal-exact", "massless-boundary"),
    );
    let run = project.succeed("run scene.toml --stop 0.003");
    assert!(run["last"]["friction_loss"].as_f64().unwrap() > 100.0, "{run:#}");
    for (line, reported) in [
        ("reduce rotor37 --contact-patches 4 --contact-nodes 3", "cannot be used with"),
        ("reduce rotor37 --mesh 6x1x6 --contact-patches 40 --contact-rows 1", "40 is outside the range 1 to 16"),
        (
            "reduce blade blade.inp --contact-set TIP --clamp-set HUB --contact-patches 2 --contact-names a",
            "1 names for 2 contact patches",
        ),
    ] {
        let code = if reported.contains("cannot") || reported.contains("names") { 2 } else { 1 };
        assert!(project.fail(line, code).contains(reported), "{line}: {}", project.fail(line, code));
    }
}

/// Rows of patches across the thickness of an exported mesh agree with those of the blade itself, with a row in every name and their number in the
/// ROM.
#[test]
fn user_mesh_patch_rows_match_the_built_in_blade() {
    let project = ModelProject::new(&[]);
    let line = "reduce rotor37 --mesh 6x2x4 --inp blade.inp --contact-patches 4 --contact-rows 2 --modes 20 -o own.rom.safetensors";
    let own = project.succeed(line);
    assert!(own["rom"]["origin"].as_str().unwrap().contains("forces on 8 patches in 2 rows and 20"), "{own:#}");
    let common = "reduce blade blade.inp --contact-set TIP --clamp-set HUB --sectors 36 --modes 20";
    let read = project.succeed(&format!("{common} --contact-patches 4 --contact-rows 2 -o read.rom.safetensors"));
    assert_eq!((&own["rom"]["contact_rows"], &read["rom"]["contact_rows"]), (&2.into(), &2.into()));
    let first = &read["model"]["contact_nodes"][0]["node"];
    let by_number = format!("reduce blade blade.inp --contact-set {first} --clamp-set HUB");
    let [own, read] = ["own.rom.safetensors", "read.rom.safetensors"].map(|name| project.rom(name));
    assert_eq!([own.rows(), read.rows()], [2, 2]);
    for (contact, reported) in
        [("", "rows across the thickness 2\n"), ("--contact-rows 1", "1: the sides of the tip do not touch")]
    {
        let line = format!("{common} --contact-patches 4 {contact} --force -o told.rom.safetensors");
        let output = project.run(&line);
        let text = String::from_utf8(output.stdout).unwrap();
        assert!(text.contains(reported), "{line}: {text}");
    }
    for (own, read) in own.contact_nodes.iter().zip(&read.contact_nodes) {
        assert_eq!(own.name, read.name);
        assert!(own.position.iter().zip(read.position).all(|(a, b)| (a - b).abs() < 1e-9), "{own:?} {read:?}");
    }
    let [first, last] = [&own.contact_nodes[0], &own.contact_nodes[7]];
    assert_eq!([first.name.as_str(), last.name.as_str()], ["patch_1_row_1", "patch_4_row_2"]);
    // The sides of the tip, not thirds of its thickness: their distance in rθ is that of the mesh's sides, which lines of patches follow.
    let across = own.contact_nodes[6].position[1] - own.contact_nodes[2].position[1];
    assert!((2e-3..2e-2).contains(&across.abs()), "{across}");
    let named = format!("{common} --contact-patches 2 --contact-rows 2 --contact-names a,b -o named.rom.safetensors");
    project.succeed(&named);
    let names: Vec<String> =
        project.rom("named.rom.safetensors").contact_nodes.into_iter().map(|node| node.name).collect();
    assert_eq!(names, ["a_row_1", "b_row_1", "a_row_2", "b_row_2"]);
    // Built-in scene with rows, around the coarse blade.
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../src/gallery/scenes/rotor37.toml");
    let scene = fs::read_to_string(path).unwrap().replace("builtin:rotor37", "read.rom.safetensors");
    project.write("scene.toml", &scene);
    let run = project.succeed("run scene.toml --stop 0.003 --estimate");
    assert!(run["last"]["friction_loss"].as_f64().unwrap() > 100.0, "{run:#}");
    let why = run["estimated_errors"]["rows"]["unknown"].as_str().unwrap();
    assert!(why.contains("the ROM has 2:") && why.contains("--contact-rows 3"), "{why}");
    let coating = "\n[contact.coating]\nthickness = 2e-3\nmodulus = 1e9\nyield_stress = 5e6\nhardening = 1e8\ncells_around = 720\ncells_along = 5\n";
    project.write(
        "coated.toml",
        scene
            .replace("\n[time]", &format!("{coating}\n[time]"))
            .replace("galerkin", "modal-exact")
            .replace("8.0e-5", "5.0e-7"),
    );
    let reported = project.fail("run coated.toml --stop 0.001", 1);
    assert!(
        reported.contains("contact[1].coating: cannot be combined with a ROM with several rows of contact patches"),
        "{reported}"
    );
    for (line, reported, code) in [
        ("reduce rotor37 --contact-rows 2 --contact-nodes 3".to_owned(), "cannot be used with", 2),
        ("reduce stage --contact-rows 2 --contact-nodes 3".to_owned(), "cannot be used with", 2),
        (format!("{by_number} --contact-rows 2 -o no.rom"), "Give the number of patches along the chord", 2),
        (
            format!("{common} --contact-patches 4 --contact-rows 14 -o no.rom"),
            "14 rows of 4 patches are not possible with the",
            1,
        ),
        ("reduce rotor37 --mesh 6x1x4 --contact-patches 4 --contact-rows 0".to_owned(), "0 rows of 4 patches", 1),
    ] {
        assert!(project.fail(&line, code).contains(reported), "{line}: {}", project.fail(&line, code));
    }
}

/// The tip is found if no set names it: the nodes of the set TIP, for every kind of element; five patches, free-interface modes.
#[test]
fn finds_and_reports_the_tip_of_a_mesh() {
    let files = [
        "blade_tet10.inp",
        "blade_hex20.inp",
        "blade_hex8.inp",
        "blade_penta15.inp",
        "blade_tet10.msh",
        "blade_hex20_binary.msh",
    ];
    let project = ModelProject::new(&files);
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
        // Nine patches in two rows, or as many as the elements permit.
        let (count, rows) = (patches.len(), found["rom"]["contact_rows"].as_u64().unwrap());
        assert!(
            rows == 2
                && (10..=18).contains(&count)
                && patches.iter().all(|patch| patch["patch_nodes"].as_u64() > Some(2)),
            "{patches:?}"
        );
        assert!(
            found["rom"]["origin"]
                .as_str()
                .unwrap()
                .contains(&format!("{count} patches in 2 rows and 12 free-interface modes"))
        );
        // The set that names the tip gives the same contact, with numbers and without.
        for numbers in [String::new(), format!("--contact-patches {} --contact-rows 2", count / 2)] {
            project.succeed(&format!("{line} --contact-set TIP {numbers} -o named.rom.safetensors"));
            assert!(project.rom("found.rom.safetensors") == project.rom("named.rom.safetensors"), "{file} {numbers}");
        }
        let reported = String::from_utf8(project.run(&format!("{line} -o text.rom.safetensors")).stdout).unwrap();
        let patches = format!("contact patches           {count} from the detected tip");
        let wanted = ["detected tip", "faces, ", "chord 0.032", &patches];
        assert!(wanted.iter().all(|part| reported.contains(part)), "{reported}");
    }
}

/// Contact at points causes a warning if the mesh permits patches, and always if there is only one point.
#[test]
fn warns_of_point_contact_on_a_fine_tip() {
    let project = ModelProject::new(&["blade_hex20.inp", "bar.inp", "blade_tet10.msh"]);
    let warned = |line: &str| -> String {
        let common = "--units mm-t-s --material titanium --modes 4 --clamp-set ROOT --force -o w.rom.safetensors";
        project.succeed(&format!("reduce blade {line} {common}"))["warnings"].to_string()
    };
    for (line, wanted) in [
        ("blade_hex20.inp --contact-set TIP --contact-nodes 3", Some("contact at 3 nodes of a tip about")),
        ("blade_hex20.inp --contact-set TIP --contact-nodes 1", Some("contact at a single node of a tip")),
        ("blade_hex20.inp --contact-patches 1", Some("contact at a single patch along the chord")),
        ("blade_hex20.inp --contact-patches 1 --contact-rows 1", Some("contact at the single patch `patch_1`")),
        ("blade_hex20.inp --contact-nodes 7", None),
        ("blade_hex20.inp --contact-patches 3 --kind craig-bampton", None),
        ("blade_hex20.inp --contact-patches 7", None),
        ("blade_hex20.inp --contact-patches 9", Some("9 contact patches along about 6 element edges")),
        ("blade_tet10.msh --contact-set TIP --contact-patches 12", Some("12 contact patches along about")),
        ("blade_hex20.inp --contact-patches 7 --contact-rows 3", None),
        ("blade_hex20.inp --contact-patches 7 --contact-rows 4", Some("4 rows of contact patches across 2 elements")),
    ] {
        let reported = warned(line);
        match wanted {
            Some(part) => assert!(reported.contains(part), "{line}: {reported}"),
            None => {
                assert!(!reported.contains("contact at") && !reported.contains("contact patches"), "{line}: {reported}")
            }
        }
    }
    let own = |patches: usize| -> String {
        let line =
            format!("reduce rotor37 --mesh 6x1x4 --modes 6 --contact-patches {patches} --force -o r.rom.safetensors");
        project.succeed(&line)["warnings"].to_string()
    };
    assert!(own(9).contains("9 contact patches along about 6 element edges"), "{}", own(9));
    assert!(!own(7).contains("contact patches"), "{}", own(7));
}

/// Returns the mesh of the tests twice: the second blade is rotated about the axis, and slightly farther in or equally far out.
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

/// A second surface at the same radius is reported, one well inside is not; the tip is that of one blade. The texts are those of the guide.
#[test]
fn reports_a_second_surface_at_the_tip_radius() {
    let project = ModelProject::new(&[]);
    let reduce = |farther_in: f64| -> Value {
        project.write("two.inp", two_blades(farther_in));
        let line = "reduce blade two.inp --clamp-set ROOT --clamp-set ROOT_TWO --units mm-t-s --material titanium --modes 8 --force";
        project.succeed(&format!("{line} -o two.rom.safetensors"))
    };
    let found = reduce(0.0);
    let warnings = found["warnings"].to_string();
    assert!(
        warnings.contains("besides the detected tip, 12 faces that are not connected to it are as far out"),
        "{warnings}"
    );
    assert_eq!(found["model"]["tip"]["faces"], 12, "{found:#}");
    let inside = reduce(3.0);
    assert!(!inside["warnings"].to_string().contains("as far out"), "{inside:#}");
    let guide = guide();
    for reported in [
        "besides the detected tip, 12 faces that are not connected to it are as far out",
        "contact at a single node of a tip about 6 element edges long",
        "9 contact patches along about 6 element edges",
    ] {
        assert!(guide.contains(reported), "{reported}");
    }
}

/// The tip of a sector is found as well, and both kinds of reduction accept patches with the same static flexibility.
#[test]
fn both_reduction_kinds_support_patches_on_a_sector() {
    let project = ModelProject::new(&["sector.msh"]);
    let line = "reduce sector sector.msh --clamp-set BORE --sectors 12 --cyclic-low LOW --cyclic-high HIGH --units mm-t-s --material steel \
                --modes 6";
    let free = project.succeed(&format!("{line} -o free.rom.safetensors"));
    let count = free["model"]["contact_nodes"].as_array().unwrap().len();
    assert_eq!(count, 6, "two elements along the chord have no more than three patches in each row");
    assert!(free["rom"]["origin"].as_str().unwrap().contains("forces on 6 patches in 2 rows and"), "{free:#}");
    let held = format!("{line} --contact-set TIP --contact-patches 3 --kind craig-bampton -o held.rom.safetensors");
    project.succeed(&held);
    let [free, held] = ["free.rom.safetensors", "held.rom.safetensors"].map(|name| {
        let rom = project.rom(name);
        &rom.contact_map * rom.stiffness.clone().try_inverse().unwrap() * rom.contact_map.transpose()
    });
    assert!((&free - &held).amax() < 1e-9 * free.amax(), "{:e}", (&free - &held).amax() / free.amax());
}
