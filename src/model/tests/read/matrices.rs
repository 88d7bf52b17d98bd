//! Models from matrices against the mesh of the matrices: CalculiX, Matrix Market, Abaqus text.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use tempfile::TempDir;
use tiprub_core::Rom;
use tiprub_core::scene::rom::DisplacementFrame;
use tiprub_model::progress::silent;
use tiprub_model::read::{
    ContactChoice, EngineAxis, Imported, MatrixFiles, MeshOptions, Units, choose_contact_nodes, read_matrices,
    read_mesh,
};
use tiprub_model::reduce::{ReductionKind, ReductionOptions};
use tiprub_model::stress::StressPlaces;
use tiprub_model::{Material, reduce_model};

fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/models").join(name)
}

fn bar() -> Imported {
    let material =
        Material { name: "steel".into(), young_modulus: 210e9, poisson_ratio: 0.3, density: 7850.0, expansion: 0.0 };
    let options =
        MeshOptions { units: Units::MillimetreTonneSecond, material: Some(material), ..MeshOptions::default() };
    read_mesh(&data("bar.inp"), &options, &silent).unwrap()
}

fn rom(imported: &Imported) -> Rom {
    let model = imported.model.clone();
    let contact = choose_contact_nodes(&model.nodes, model.set("TIP").unwrap(), &ContactChoice::default()).unwrap();
    let options = ReductionOptions {
        name: "bar".into(),
        kind: ReductionKind::FixedInterface,
        modes: 8,
        checked_modes: 6,
        sectors: 1,
        frame: DisplacementFrame::Cylindrical,
        watched: Vec::new(),
        stress: StressPlaces::default(),
        damping_ratio: 0.005,
    };
    let clamped = model.set("ROOT").unwrap().to_vec();
    reduce_model(model, &clamped, &contact, &options, None, &silent).unwrap().rom
}

/// Returns the largest difference of mass and stiffness of the reduced models, as a fraction of the largest entry of
/// each.
fn difference(a: &Rom, b: &Rom) -> f64 {
    assert_eq!(a.contact_nodes, b.contact_nodes);
    let share = |a: &nalgebra::DMatrix<f64>, b: &nalgebra::DMatrix<f64>| {
        // The sign of a mode shape is arbitrary.
        (a.abs() - b.abs()).amax() / a.amax()
    };
    share(&a.mass, &b.mass).max(share(&a.stiffness, &b.stiffness))
}

fn files(directory: &Path, stiffness: &str, mass: &str, nodes: &str) -> MatrixFiles {
    MatrixFiles {
        stiffness: directory.join(stiffness),
        mass: directory.join(mass),
        nodes: directory.join(nodes),
        dofs: None,
        units: Units::Si,
        axis: EngineAxis::Z,
        left_out: Vec::new(),
    }
}

#[test]
fn calculix_matrices_give_the_same_model_as_the_mesh() {
    let expected = rom(&bar());
    for (name, absent) in [("bar", 0), ("bar_held", 8)] {
        let files = MatrixFiles {
            units: Units::MillimetreTonneSecond,
            ..files(&data(""), &format!("{name}.sti"), &format!("{name}.mas"), "bar.inp")
        };
        let imported = read_matrices(&files).unwrap();
        assert_eq!((imported.absent.len(), imported.model.nodes.len()), (absent, 32));
        assert!(imported.warnings.is_empty(), "{:?}", imported.warnings);
        let off = difference(&expected, &rom(&imported));
        println!("{name}: the reduced model differs by {off:.2e}");
        assert!(off < 1e-10, "{name}: {off:.2e}");
    }
}

#[derive(Clone, Copy, PartialEq)]
enum Triangle {
    Lower,
    Upper,
    Both,
}

/// Returns the entries (row, column, value) of a triangle, from 1.
fn entries(
    imported: &Imported,
    mass: bool,
    triangle: Triangle,
    keep: &dyn Fn(usize) -> bool,
) -> Vec<(usize, usize, f64)> {
    let matrix = if mass { &imported.model.mass } else { &imported.model.stiffness };
    let mut found = Vec::new();
    for column in 0..matrix.order() {
        for entry in matrix.pattern.starts[column]..matrix.pattern.starts[column + 1] {
            let row = matrix.pattern.rows[entry];
            let wanted = match triangle {
                Triangle::Lower => row >= column,
                Triangle::Upper => row <= column,
                Triangle::Both => true,
            };
            if wanted && keep(row / 3) && keep(column / 3) {
                found.push((row + 1, column + 1, matrix.values[entry]));
            }
        }
    }
    found
}

fn market(imported: &Imported, mass: bool, triangle: Triangle) -> String {
    let entries = entries(imported, mass, triangle, &|_| true);
    let order = imported.model.mass.order();
    let symmetry = if triangle == Triangle::Both { "general" } else { "symmetric" };
    let mut text =
        format!("%%MatrixMarket matrix coordinate real {symmetry}\n% a comment\n{order} {order} {}\n", entries.len());
    for (row, column, value) in entries {
        let _ = writeln!(text, "{row} {column} {value:e}");
    }
    text
}

fn node_table(imported: &Imported) -> String {
    let mut text = String::from("node,x,y,z,sets\n# millimetres were converted\n");
    for (index, [x, y, z]) in imported.model.nodes.iter().enumerate() {
        let sets = imported.model.sets.iter().filter(|(_, nodes)| nodes.contains(&index));
        let sets: Vec<&str> = sets.map(|(name, _)| name.as_str()).collect();
        let _ = writeln!(text, "{},{x:e},{y:e},{z:e},{}", imported.node_numbers[index], sets.join(" "));
    }
    text
}

struct Written {
    root: TempDir,
}

impl Written {
    fn new(stiffness: &str, mass: &str, nodes: &str) -> Self {
        let root = tempfile::tempdir().unwrap();
        for (name, text) in [("k.mtx", stiffness), ("m.mtx", mass), ("nodes.csv", nodes)] {
            std::fs::write(root.path().join(name), text).unwrap();
        }
        Self { root }
    }

    fn files(&self) -> MatrixFiles {
        files(self.root.path(), "k.mtx", "m.mtx", "nodes.csv")
    }

    #[track_caller]
    fn refused(&self) -> String {
        read_matrices(&self.files()).expect_err("the files are wrong").to_string()
    }
}

#[test]
fn both_matrix_market_triangles_are_bit_identical() {
    let bar = bar();
    let expected = rom(&bar);
    for triangle in [Triangle::Lower, Triangle::Upper, Triangle::Both] {
        let written = Written::new(&market(&bar, false, triangle), &market(&bar, true, triangle), &node_table(&bar));
        let imported = read_matrices(&written.files()).unwrap();
        assert_eq!(imported.model.sets, bar.model.sets);
        // The two triangles of the assembled matrices differ in the last bits.
        let off = difference(&expected, &rom(&imported));
        assert!(off < 1e-12, "{off:.2e}");
        if triangle == Triangle::Both {
            let all: Vec<usize> = (0..bar.model.mass.order()).collect();
            let (ours, theirs) = (bar.model.stiffness.block(&all, &all), imported.model.stiffness.block(&all, &all));
            let largest = ours.norm_max();
            assert!((ours - theirs).norm_max() < 1e-15 * largest);
        }
    }
}

/// Returns Abaqus MATRIX INPUT text: node, dof, node, dof, value.
fn labelled(imported: &Imported, mass: bool, keep: &dyn Fn(usize) -> bool) -> String {
    let mut text = String::from("** a comment\n");
    for (row, column, value) in entries(imported, mass, Triangle::Lower, keep) {
        let label = |dof: usize| (imported.node_numbers[(dof - 1) / 3], (dof - 1) % 3 + 1);
        let ((a, i), (b, j)) = (label(row), label(column));
        let _ = writeln!(text, "{a},{i}, {b},{j}, {value:.15e}");
    }
    text
}

#[test]
fn reads_labelled_abaqus_text_with_constrained_dofs() {
    let bar = bar();
    let expected = rom(&bar);
    let root = bar.model.set("ROOT").unwrap().to_vec();
    let free = |node: usize| !root.contains(&node);
    let mut huge = labelled(&bar, false, &free);
    for &node in &root {
        for dof in 1..=3 {
            let number = bar.node_numbers[node];
            let _ = writeln!(huge, "{number},{dof},{number},{dof},1.0e36");
        }
    }
    let all = labelled(&bar, false, &|_| true);
    let (some, some_mass) = (labelled(&bar, false, &free), labelled(&bar, true, &free));
    let (every_mass, table) = (labelled(&bar, true, &|_| true), node_table(&bar));
    for (stiffness, mass, absent) in [(&all, &every_mass, 0), (&some, &some_mass, 8), (&huge, &every_mass, 8)] {
        let imported = read_matrices(&Written::new(stiffness, mass, &table).files()).unwrap();
        assert_eq!(imported.absent.len(), absent);
        let off = difference(&expected, &rom(&imported));
        assert!(off < 1e-12, "{absent} absent: {off:.2e}");
    }
}

#[test]
fn accepts_matrices_without_clamped_nodes_given_their_set() {
    let bar = bar();
    let root = bar.model.set("ROOT").unwrap().to_vec();
    let free: Vec<usize> = (0..bar.model.nodes.len()).filter(|node| !root.contains(node)).collect();
    let text = |mass: bool| {
        let mut text = String::new();
        for (row, column, value) in entries(&bar, mass, Triangle::Lower, &|node| !root.contains(&node)) {
            let place =
                |dof: usize| 3 * free.iter().position(|&node| node == (dof - 1) / 3).unwrap() + (dof - 1) % 3 + 1;
            let _ = writeln!(text, "{}, {}, {value:.16e}", place(row), place(column));
        }
        text
    };
    let written = Written::new(&text(false), &text(true), &node_table(&bar));
    let refused = written.refused();
    assert!(refused.contains("72 rows") && refused.contains("3·32 = 96"), "{refused}");
    let imported = read_matrices(&MatrixFiles { left_out: vec!["ROOT".into()], ..written.files() }).unwrap();
    assert_eq!(imported.absent, root);
    let off = difference(&rom(&bar), &rom(&imported));
    assert!(off < 1e-12, "{off:.2e}");
}

#[test]
fn rejects_invalid_matrices_with_remedy() {
    let bar = bar();
    let (k, m) = (market(&bar, false, Triangle::Lower), market(&bar, true, Triangle::Lower));
    let table = node_table(&bar);
    let first = |text: &str, from: &str, to: &str| text.replacen(from, to, 1);
    let both = market(&bar, false, Triangle::Both);
    let skewed = {
        let line = both.lines().find(|line| line.starts_with("1 3 ")).unwrap();
        both.replacen(line, "1 3 12345.0", 1)
    };
    let named = labelled(&bar, false, &|_| true);
    let cases: Vec<(&str, String, String, String, &[&str])> = vec![
        ("complex", first(&k, "real", "complex"), m.clone(), table.clone(), &["k.mtx:1", "coordinate real symmetric"]),
        ("sizes", first(&k, "96 96", "96 95"), m.clone(), table.clone(), &["k.mtx:3", "square"]),
        ("cut", k[..k.len() / 2].to_owned(), m.clone(), table.clone(), &["k.mtx", "again"]),
        ("word", first(&k, "e", "e+x"), m.clone(), table.clone(), &["k.mtx:1"]),
        ("nan", k.replacen("\n1 1 ", "\n1 1 NaN", 1), m.clone(), table.clone(), &["k.mtx:4", "finite"]),
        ("zero index", k.replacen("\n1 1 ", "\n0 1 ", 1), m.clone(), table.clone(), &["k.mtx:4", "indices from 1"]),
        ("not symmetric", skewed, m.clone(), table.clone(), &["not symmetric", "(1, 3)"]),
        ("both triangles", first(&both, "general", "symmetric"), m.clone(), table.clone(), &["both sides", "general"]),
        ("one triangle", first(&k, "symmetric", "general"), m.clone(), table.clone(), &["one side", "symmetric"]),
        ("no matrix", "hello\n".into(), m.clone(), table.clone(), &["not a matrix", "Matrix Market"]),
        ("negative", k.replacen("\n1 1 ", "\n1 1 -", 1), m.clone(), table.clone(), &["k.mtx", "negative"]),
        ("exchanged", m.clone(), k.clone(), table.clone(), &["m.mtx", "swapped"]),
        ("mass cut", k.clone(), first(&m, "\n1 1 ", "\n1 1 -"), table.clone(), &["m.mtx", "mass"]),
        (
            "short table",
            k.clone(),
            m.clone(),
            table.lines().take(20).collect::<Vec<_>>().join("\n"),
            &["96 rows", "node table"],
        ),
        (
            "node twice",
            k.clone(),
            m.clone(),
            format!("{table}{}", table.lines().nth(2).unwrap()),
            &["nodes.csv:35", "twice"],
        ),
        ("table line", k.clone(), m.clone(), first(&table, "\n1,", "\n1,x"), &["nodes.csv", "NODE,X,Y,Z"]),
        ("empty table", k.clone(), m.clone(), "node,x,y,z\n".into(), &["no node"]),
        ("rotation", format!("{named}1,4,1,4,1.0\n"), m.clone(), table.clone(), &["degree of freedom 4", "rotations"]),
        ("unknown node", format!("{named}77,1,77,1,1.0\n"), m.clone(), table.clone(), &["node 77", "nodes.csv"]),
        ("twice", format!("{named}1,1,1,1,1.0\n"), m.clone(), table.clone(), &["(1.1, 1.1)", "twice"]),
        ("internal", format!("{named}-1,1,1,1,1.0\n"), m.clone(), table.clone(), &["internal", "constraints"]),
    ];
    for (name, stiffness, mass, nodes, wanted) in cases {
        let text = Written::new(&stiffness, &mass, &nodes).refused();
        println!("{name:<16} {text}");
        for part in wanted {
            assert!(text.contains(part), "{name}: `{part}` is not in: {text}");
        }
    }
}

#[test]
fn warns_of_swapped_mass_and_stiffness_matrices() {
    let names = ["bar_held.mas", "bar_held.sti"];
    let files = MatrixFiles {
        dofs: Some(data("bar_held.dof")),
        units: Units::MillimetreTonneSecond,
        ..files(&data(""), names[0], names[1], "bar.inp")
    };
    let warnings = read_matrices(&files).unwrap().warnings;
    assert!(warnings.iter().any(|warning| warning.contains("mass along x, y and z differs")), "{warnings:?}");
}

#[test]
fn detects_node_order_that_differs_from_matrix_rows() {
    let bar = bar();
    let mut lines: Vec<String> = node_table(&bar).lines().map(str::to_owned).collect();
    lines[2..].reverse();
    let written =
        Written::new(&market(&bar, false, Triangle::Lower), &market(&bar, true, Triangle::Lower), &lines.join("\n"));
    let imported = read_matrices(&written.files()).unwrap();
    assert!(imported.warnings.iter().any(|warning| warning.contains("in the order of the rows")), "{imported:?}");
}

#[test]
fn engine_axis_option_rotates_model_and_matrices() {
    let bar = bar();
    let expected = rom(&bar);
    // Cyclic change of the axes: (x, y, z) in the file is (z, x, y) of the bar.
    let mut table = String::new();
    for (index, [x, y, z]) in bar.model.nodes.iter().enumerate() {
        let sets = bar.model.sets.iter().filter(|(_, nodes)| nodes.contains(&index));
        let sets: Vec<&str> = sets.map(|(name, _)| name.as_str()).collect();
        let _ = writeln!(table, "{},{z:e},{x:e},{y:e},{}", bar.node_numbers[index], sets.join(" "));
    }
    let there = |dof: usize| (bar.node_numbers[(dof - 1) / 3], [2, 3, 1][(dof - 1) % 3]);
    let text = |mass: bool| {
        let entries = entries(&bar, mass, Triangle::Lower, &|_| true);
        let line = |(row, column, value): &(usize, usize, f64)| {
            let ((a, i), (b, j)) = (there(*row), there(*column));
            format!("{a},{i},{b},{j},{value:.16e}\n")
        };
        entries.iter().map(line).collect::<String>()
    };
    let written = Written::new(&text(false), &text(true), &table);
    let turned = read_matrices(&MatrixFiles { axis: EngineAxis::X, ..written.files() }).unwrap();
    assert!(turned.warnings.is_empty(), "{:?}", turned.warnings);
    assert_eq!(turned.model.nodes, bar.model.nodes);
    let off = difference(&expected, &rom(&turned));
    assert!(off < 1e-12, "{off:.2e}");
    let straight = read_matrices(&written.files()).unwrap();
    let [x, y, z] = bar.model.nodes[5];
    assert_eq!(straight.model.nodes[5].map(f64::to_bits), [z, x, y].map(f64::to_bits));
}

#[test]
fn detects_calculix_matrix_truncated_at_a_line_end() {
    let whole = std::fs::read_to_string(data("bar.sti")).unwrap();
    let lines: Vec<&str> = whole.lines().collect();
    let directory = tempfile::tempdir().unwrap();
    for (count, wanted) in [(lines.len() / 2, "the list of dofs has 96"), (2 * lines.len(), "twice")] {
        let text: String = lines.iter().cycle().take(count).flat_map(|line| [line, "\n"]).collect();
        std::fs::write(directory.path().join("k.sti"), text).unwrap();
        let files = MatrixFiles {
            stiffness: directory.path().join("k.sti"),
            dofs: Some(data("bar.dof")),
            units: Units::MillimetreTonneSecond,
            ..files(&data(""), "bar.sti", "bar.mas", "bar.inp")
        };
        let message = read_matrices(&files).unwrap_err().to_string();
        assert!(message.contains(wanted), "{message}");
    }
}
