//! Questions about a user mesh: sets that contain a part of the tip or the root, and a blade for the opposite rotation.

use super::ModelProject;

/// Exports a coarse rotor 37 as a user mesh, `blade.inp`.
fn exported(project: &ModelProject) -> String {
    project.succeed("reduce rotor37 --mesh 6x1x6 --modes 6 --inp blade.inp -o own.rom.safetensors");
    std::fs::read_to_string(project.root.path().join("blade.inp")).unwrap()
}

/// Returns the mesh without the last line of the nodes of a set.
fn without_a_line(mesh: &str, set: &str) -> String {
    let (before, rest) = mesh.split_once(&format!("*NSET, NSET={set}\n")).unwrap();
    let end = rest.find('*').unwrap();
    let lines: Vec<&str> = rest[..end].lines().collect();
    assert!(lines.len() > 1, "{lines:?}");
    let kept = lines[..lines.len() - 1].join("\n");
    format!("{before}*NSET, NSET={set}\n{kept}\n{}", &rest[end..])
}

/// Returns the numbers of the nodes of a set.
fn numbers_of(mesh: &str, set: &str) -> Vec<usize> {
    let (_, rest) = mesh.split_once(&format!("*NSET, NSET={set}\n")).unwrap();
    let words = rest[..rest.find('*').unwrap()].split([',', '\n']).map(str::trim);
    words.filter(|word| !word.is_empty()).map(|word| word.parse().unwrap()).collect()
}

/// Returns the mesh rotated by half a turn about the x axis: the same blade for the opposite rotation about the z axis.
fn turned_over(mesh: &str) -> String {
    let (head, rest) = mesh.split_once("*NODE, NSET=NALL\n").unwrap();
    let end = rest.find('*').unwrap();
    let turned = rest[..end].lines().map(|line| {
        let words: Vec<&str> = line.split(',').map(str::trim).collect();
        let [x, y, z] = [1, 2, 3].map(|place| words[place].parse::<f64>().unwrap());
        format!("{}, {x:e}, {:e}, {:e}\n", words[0], -y, -z)
    });
    format!("{head}*NODE, NSET=NALL\n{}{}", turned.collect::<String>(), &rest[end..])
}

fn warnings(project: &ModelProject, mesh: &str, options: &str) -> String {
    project.write("mesh.inp", mesh);
    let line = format!("reduce blade mesh.inp {options} --sectors 36 --modes 12 --force -o w.rom.safetensors");
    project.succeed(&line)["warnings"].to_string()
}

#[test]
fn warns_of_sets_that_cover_only_part_of_tip_or_root() {
    let project = ModelProject::new(&[]);
    let mesh = exported(&project);
    let both = "--contact-set TIP --clamp-set HUB";
    let whole = warnings(&project, &mesh, both);
    assert!(!whole.contains("nodes of the"), "{whole}");
    // Six by one quadratic elements have 33 nodes at the tip.
    let tip = warnings(&project, &without_a_line(&mesh, "TIP"), &format!("{both} --contact-patches 3"));
    assert!(tip.contains("TIP has ") && tip.contains(" of the 33 nodes of the outermost faces"), "{tip}");
    let root = warnings(&project, &without_a_line(&mesh, "HUB"), both);
    assert!(root.contains("HUB has ") && root.contains(" of the 33 nodes of the innermost faces"), "{root}");
    let sets = ["TIP", "HUB"].map(|set| numbers_of(&mesh, set)).concat();
    let other = (1..).find(|number| !sets.contains(number)).unwrap();
    let more = mesh.replace("*NSET, NSET=TIP\n", &format!("*NSET, NSET=TIP\n{other},\n"));
    let larger = warnings(&project, &more, both);
    assert!(larger.contains("TIP has 34 nodes, but only 33 are on the outermost faces"), "{larger}");
    // Single contact nodes cause no question.
    let nodes = warnings(&project, &without_a_line(&mesh, "TIP"), &format!("{both} --contact-nodes 3"));
    assert!(nodes.contains("contact at 3 nodes"), "{nodes}");
}

#[test]
fn warns_of_blade_staggered_for_opposite_rotation() {
    let project = ModelProject::new(&[]);
    let mesh = exported(&project);
    let right = warnings(&project, &mesh, "--clamp-set HUB");
    assert!(!right.contains("locks up"), "{right}");
    let wrong = warnings(&project, &turned_over(&mesh), "--clamp-set HUB");
    let parts =
        ["when the rotor turns towards +θ", "staggered for the opposite sense of rotation", " leads", "negative"];
    assert!(parts.iter().all(|part| wrong.contains(part)), "{wrong}");
}
