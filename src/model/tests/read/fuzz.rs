//! Damaged files: truncations and random byte changes of small files result in a model or an error, never in a panic.

use std::path::Path;

use tiprub_model::progress::silent;
use tiprub_model::read::{EngineAxis, MatrixFiles, Units, parse_mesh, read_matrices};
use tiprub_model::{Error, FeModel, Material};

fn data(name: &str) -> Vec<u8> {
    std::fs::read(Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/models").join(name)).unwrap()
}

/// Simple reproducible random number generator (Marsaglia's xorshift).
struct Draws(u64);

impl Draws {
    fn below(&mut self, limit: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        usize::try_from(self.0 % limit as u64).unwrap()
    }
}

const MESHES: [&str; 3] = ["bar.inp", "bar.msh", "bar_binary.msh"];

/// Reads a file, assembles the result, and returns whether both succeeded.
fn tried(name: &str, bytes: &[u8]) -> bool {
    match parse_mesh(name, bytes) {
        Ok(mesh) => {
            let _ = FeModel::assembled(mesh, &Material::steel(), String::new(), &silent);
            true
        }
        Err(Error::Read(error)) => {
            let place = error.place.as_deref().unwrap_or_default();
            assert!(place.contains(name) && !error.problem.is_empty() && !error.remedy.is_empty(), "{error}");
            false
        }
        Err(other) => panic!("{name}: {other}"),
    }
}

#[test]
fn truncated_mesh_files_never_panic() {
    for name in MESHES {
        let whole = data(name);
        assert!(tried(name, &whole));
        let read = (0..whole.len()).filter(|&length| tried(name, &whole[..length])).count();
        // Only contents after the elements may be missing.
        assert!(read < whole.len() / 2, "{name}: {read} of {} beginnings are read", whole.len());
    }
}

#[test]
fn corrupted_mesh_files_never_panic() {
    let mut draws = Draws(0x9e37_79b9_7f4a_7c15);
    for name in MESHES {
        let whole = data(name);
        let mut refused = 0;
        for _ in 0..4000 {
            let mut bytes = whole.clone();
            for _ in 0..=draws.below(3) {
                let place = draws.below(bytes.len());
                bytes[place] = match draws.below(4) {
                    0 => b"0123456789,.*-e\n $"[draws.below(18)],
                    1 => bytes[place] ^ (1 << draws.below(8)),
                    2 => 0xff,
                    _ => u8::try_from(draws.below(256)).unwrap(),
                };
            }
            refused += usize::from(!tried(name, &bytes));
        }
        assert!(refused > 500, "{name}: only {refused} of 4000 damaged files are refused");
    }
}

#[test]
fn corrupted_matrices_and_node_tables_never_panic() {
    let root = tempfile::tempdir().unwrap();
    let written = |name: &str, bytes: &[u8]| std::fs::write(root.path().join(name), bytes).unwrap();
    let table = "node,x,y,z,sets\n1,0.1,0,0,A\n2,0.2,0,0,A B\n";
    let entries = "1 1 5\n2 2 5\n3 3 5\n4 4 5\n5 5 5\n6 6 5\n4 1 -1\n";
    let market = format!("%%MatrixMarket matrix coordinate real symmetric\n6 6 7\n{entries}");
    let named = "1,1,1,1,5\n1,2,1,2,5\n1,3,1,3,5\n2,1,2,1,5\n2,2,2,2,5\n2,3,2,3,5\n1,1,2,1,-1\n";
    let files = MatrixFiles {
        stiffness: root.path().join("k"),
        mass: root.path().join("m"),
        nodes: root.path().join("nodes.csv"),
        dofs: None,
        units: Units::Si,
        axis: EngineAxis::Z,
        left_out: vec!["B".into()],
    };
    let mut draws = Draws(0x1234_5678_9abc_def1);
    let mut refused = 0;
    for (stiffness, mass) in [(market.as_str(), entries), (named, market.as_str())] {
        let all = [("k", stiffness), ("m", mass), ("nodes.csv", table)];
        all.iter().for_each(|(name, text)| written(name, text.as_bytes()));
        read_matrices(&files).unwrap();
        for (name, text) in all {
            for round in 0..text.len() + 300 {
                let mut bytes = text.as_bytes().to_vec();
                if round < text.len() {
                    bytes.truncate(round);
                } else {
                    let place = draws.below(bytes.len());
                    bytes[place] = b"0123456789,.-e\n %x"[draws.below(18)];
                }
                written(name, &bytes);
                refused += usize::from(read_matrices(&files).is_err());
            }
            written(name, text.as_bytes());
        }
    }
    assert!(refused > 500, "{refused}");
}
