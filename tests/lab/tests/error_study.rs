//! `lab error` in its quick form: properties of errors that hold on every machine.

use std::{fs, path::Path, process::Command};

use serde_json::Value;

/// Runs the quick study of some scenes.
fn study(root: &Path, scenes: &[&str]) -> Value {
    let mut command = Command::new(env!("CARGO_BIN_EXE_lab"));
    command.current_dir(root).env("TIPRUB_CACHE", env!("CARGO_TARGET_TMPDIR")).env("SOURCE_DATE_EPOCH", "951782400");
    command.args(["error", "--quick", "--json", "--quiet", "--out", "out"]);
    command.args(scenes.iter().flat_map(|scene| ["--scene", scene]));
    let output = command.output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let json: Value = serde_json::from_slice(&output.stdout).unwrap();
    for statement in json["statements"].as_array().unwrap() {
        let expected = statement["expected"].as_str().unwrap();
        let remarks = ["longest step of modal-exact", "film compared with lcp", "solutions with and without mass"];
        let is_remark = remarks.iter().any(|remark| expected.contains(remark));
        assert_eq!(statement["holds"], if is_remark { Value::Null } else { Value::Bool(true) }, "{statement:#}");
    }
    assert_eq!(json["facts"]["date"], "2000-02-29");
    json
}

/// Returns (step, value) of a competitor at the standard size, finest last; rejected runs have no value.
fn values(scene: &Value, competitor: &str, key: &str) -> Vec<(f64, Option<f64>)> {
    let rows = scene["rows"].as_array().unwrap().iter();
    let own = rows.filter(|row| row["competitor"] == competitor && row["size"] == scene["standard_size"]);
    own.map(|row| (row["internal_step"].as_f64().unwrap(), row[key].as_f64())).collect()
}

fn finest(scene: &Value, competitor: &str, key: &str) -> f64 {
    values(scene, competitor, key).last().unwrap().1.unwrap()
}

#[test]
fn bars_converge_with_elements_and_steps() {
    let root = tempfile::tempdir().unwrap();
    let json = study(root.path(), &["carpenter", "bouncing-bar"]);
    for scene in json["results"]["scenes"].as_array().unwrap() {
        let truncation: Vec<f64> =
            scene["reference_from_truth"].as_array().unwrap().iter().map(|value| value.as_f64().unwrap()).collect();
        assert!(truncation.windows(2).all(|pair| pair[1] < 0.8 * pair[0]), "{truncation:?}");
        // Modal-exact is more accurate than the paper's scheme at equal steps, and both independent methods agree.
        let steps = |competitor| finest(scene, competitor, "error_of_steps");
        assert!(steps("modal-exact + lcp") < 0.3 * steps("central-difference + film"));
        assert!(steps("Moreau-Jean, implicit") < 1e-2);
        // Film and lcp agree with one contact; a massless contact node keeps its energy at an impact.
        assert_eq!(steps("modal-exact + lcp").to_bits(), steps("modal-exact + film").to_bits());
        // Central differences are rejected beyond their limit, which the error states.
        let refused = values(scene, "central-difference + film", "seconds");
        assert!(refused.iter().filter(|(_, seconds)| seconds.is_none()).count() >= 2, "{refused:?}");
        let reason = scene["rows"].as_array().unwrap().iter().find_map(|row| row["refused"].as_str()).unwrap();
        assert!(reason.contains("ω_max·h = "), "{reason}");
    }
    let text = fs::read_to_string(root.path().join("out/tables.md")).unwrap();
    // In free vibration modal-exact has no error at all; in sustained contact it is of fourth order.
    let line = text.lines().find(|line| line.starts_with("| modal-exact + lcp") && line.contains("exact |")).unwrap();
    let orders: Vec<&str> = line.split('|').map(str::trim).collect();
    assert_eq!(orders[2], "exact", "{line}");
    assert!((3.7..4.3).contains(&orders[3].parse::<f64>().unwrap()), "{line}");
    let csv = fs::read_to_string(root.path().join("out/carpenter.csv")).unwrap();
    assert!(csv.lines().any(|line| line.contains("ω_max·h")), "rejected runs are rows");
}

#[test]
fn a_sticking_block_converges_to_its_closed_form() {
    let root = tempfile::tempdir().unwrap();
    let json = study(root.path(), &["belt"]);
    let scene = &json["results"]["scenes"][0];
    let rows = scene["rows"].as_array().unwrap();
    let adaptive: Vec<f64> = rows
        .iter()
        .filter(|row| row["competitor"] == "galerkin + coulomb")
        .map(|row| row["total_error"].as_f64().unwrap())
        .collect();
    // A tolerance is relative to the clearance of 1 mm, and the error here to displacements of some 10 mm.
    assert!(adaptive.len() == 4 && adaptive[3] < 5e-6, "{adaptive:?}");
    assert!(adaptive.iter().zip([1e-2, 1e-3, 1e-4, 1e-5]).all(|(error, tolerance)| *error < tolerance), "{adaptive:?}");
    // Schemes with and without mass of the contact node have different limits.
    let of_steps = |competitor| -> Vec<f64> {
        values(scene, competitor, "error_of_own_limit").into_iter().filter_map(|(_, error)| error).collect()
    };
    for competitor in ["modal-exact + coulomb", "massless-boundary + coulomb"] {
        let errors = of_steps(competitor);
        assert!(errors.len() == 5 && errors[4] < 0.02 * errors[0], "{competitor}: {errors:?}");
    }
}

#[test]
fn film_error_stagnates_where_lcp_converges() {
    let root = tempfile::tempdir().unwrap();
    let json = study(root.path(), &["rotor37-paper-light"]);
    let scene = &json["results"]["scenes"][0];
    let errors = |competitor| -> Vec<f64> {
        values(scene, competitor, "error_of_steps").into_iter().filter_map(|(_, error)| error).collect()
    };
    let (film, lcp) = (errors("modal-exact + film"), errors("modal-exact + lcp"));
    let count = lcp.len();
    assert!(lcp[count - 1] < 0.7 * lcp[count - 2], "lcp converges: {lcp:?}");
    assert!(film[count - 1] > 3.0 * lcp[count - 1] && film[count - 1] > 0.4 * film[count - 2], "{film:?}");
    // The product and Moreau-Jean share no code and are closer to each other than film is to either.
    let apart = scene["references_apart"][0][0].as_f64().unwrap();
    assert!(apart < film[count - 1], "{apart} {film:?}");
    assert!(finest(scene, "modal-exact + lcp", "penetration") <= 0.0);
    assert!(finest(scene, "central differences, penalty", "penetration") > 1e-9);
    assert!(finest(scene, "modal-exact + film", "least_force") < 0.0, "film lets contacts pull");
    assert!(finest(scene, "modal-exact + lcp", "ledger_residual") < 1e-12);
}

#[test]
fn cube_converges_to_full_model_with_steps_and_modes() {
    let root = tempfile::tempdir().unwrap();
    let json = study(root.path(), &["cube"]);
    let scene = &json["results"]["scenes"][0];
    let truncation: Vec<f64> =
        scene["reference_from_truth"].as_array().unwrap().iter().map(|value| value.as_f64().unwrap()).collect();
    assert!(truncation[1] < 0.85 * truncation[0] && truncation[0] < 1e-2, "{truncation:?}");
    for competitor in ["modal-exact + lcp", "central-difference + film", "b, bi-potential, full model"] {
        let errors = values(scene, competitor, "error_of_steps");
        let [.., coarse, fine] = &errors[..] else { panic!("{errors:?}") };
        assert!(fine.1.unwrap() < 0.6 * coarse.1.unwrap(), "{competitor}: {errors:?}");
    }
    assert!(values(scene, "massless-boundary + lcp", "seconds").iter().all(|(_, seconds)| seconds.is_none()));
    assert!(finest(scene, "modal-exact + lcp", "ledger_residual").abs() < 1e-12);
}

#[test]
fn adaptive_steps_converge_faster_than_the_paper_method() {
    let root = tempfile::tempdir().unwrap();
    let json = study(root.path(), &["rotor37-light"]);
    let scene = &json["results"]["scenes"][0];
    let rows = || scene["rows"].as_array().unwrap().iter();
    let errors: Vec<f64> = rows()
        .filter(|row| row["competitor"] == "galerkin")
        .map(|row| row["error_of_own_limit"].as_f64().unwrap())
        .collect();
    assert!(errors.len() == 2 && errors[1] < 0.7 * errors[0] && errors[0] < 3e-2, "{errors:?}");
    // The paper's method is rejected at the longer steps, because of the stability limit or growth.
    let rejected: Vec<&str> = rows()
        .filter(|row| row["competitor"] == "central-difference + film")
        .filter_map(|row| row["refused"].as_str())
        .collect();
    assert!(
        !rejected.is_empty() && rejected.iter().all(|reason| reason.contains("unstable") || reason.contains('µ')),
        "{rejected:?}"
    );
    let table = fs::read_to_string(root.path().join("out/communication-steps.md")).unwrap();
    let cells = |line: &str| line.split(" | ").map(|cell| cell.trim_matches(['|', ' ']).to_owned()).collect::<Vec<_>>();
    let lines: Vec<Vec<String>> = table.lines().skip(4).map(cells).collect();
    assert_eq!(lines.len(), 9, "three tolerances, three lengths: {table}");
    for line in &lines {
        let [tolerance, error] = [&line[1], &line[4]].map(|cell| cell.parse::<f64>().unwrap());
        assert!(error > 0.0 && error < 3.0 * tolerance, "{line:?}");
    }
}
