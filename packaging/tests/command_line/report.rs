//! Report of a run: it is complete and small, opens offline, and does not change the results.

use std::fs;

use nalgebra::{DMatrix, DVector};
use serde_json::Value;
use tiprub_core::Rom;

use crate::project::{Project, SCENE};

/// Elements without a closing tag.
const VOID: [&str; 4] = ["meta", "input", "br", "!DOCTYPE"];

/// Checks that all elements of a page are closed in their order; text of scripts and styles is skipped.
#[track_caller]
fn assert_well_formed(html: &str) {
    let (mut open, mut rest) = (Vec::new(), html);
    while let Some(start) = rest.find('<') {
        rest = &rest[start + 1..];
        let end = rest.find('>').expect("a tag ends");
        let (tag, after) = (&rest[..end], &rest[end + 1..]);
        rest = after;
        let name = |tag: &str| tag.split([' ', '\n', '/']).next().unwrap_or_default().to_owned();
        if let Some(closed) = tag.strip_prefix('/') {
            assert_eq!(open.pop().as_deref(), Some(closed), "{}", &after[..after.len().min(80)]);
        } else if !tag.ends_with('/') && !VOID.contains(&name(tag).as_str()) {
            open.push(name(tag));
        }
        if let Some(raw) = open.last().filter(|name| ["script", "style"].contains(&name.as_str())) {
            rest = &rest[rest.find(&format!("</{raw}>")).expect("it is closed")..];
        }
    }
    assert!(open.is_empty(), "{open:?}");
}

/// Reads a report, and checks the properties of every report.
#[track_caller]
fn read(project: &Project, name: &str) -> String {
    let html = fs::read_to_string(project.path(name)).unwrap();
    assert_well_formed(&html);
    assert!(html.len() < 1_200_000, "{} bytes", html.len());
    let outside = html.replace("http://www.w3.org/2000/svg", "");
    assert!(!outside.contains("http") && !outside.contains(" src=") && !outside.contains("url("), "opens offline");
    assert!(!outside.contains("@import") && !outside.contains("fetch("));
    assert!(!html.contains(">NaN") && !html.contains(">inf") && !html.contains("NaN "), "no number is missing");
    assert_eq!(html.matches("<figure").count(), html.matches("<figcaption").count());
    for title in ["How hard?", "How long?", "How hot?", "How much wear?", "Does it grow?", "The run", "Scene"] {
        assert!(html.contains(title), "{title}");
    }
    html
}

/// Returns the header of the animation.
fn header(html: &str) -> Value {
    let text = html.split("id=\"run-header\">").nth(1).unwrap().split("</script>").next().unwrap();
    serde_json::from_str(text).unwrap()
}

#[test]
fn report_is_complete_and_does_not_change_the_results() {
    let project = Project::new();
    let energies = format!("{SCENE}[outputs]\nenergies = true\n");
    fs::write(project.path("scene.toml"), energies).unwrap();
    project.succeed(&["run", "scene.toml", "--csv", "alone.csv", "--step", "2e-4"]);
    let run = ["run", "scene.toml", "--csv", "observed.csv", "--step", "2e-4", "--report", "out/run.html"];
    let printed = project.succeed(&run);
    assert!(printed.contains("written: out/run.html (0.") && printed.contains("open it in a browser"), "{printed}");
    let [alone, observed] = ["alone.csv", "observed.csv"].map(|name| fs::read(project.path(name)).unwrap());
    assert!(alone == observed, "a report does not change the results");
    let html = read(&project, "out/run.html");
    for wanted in [
        "The blades touch the casing for the first time after",
        "is hit hardest",
        "the casing has no coating",
        "Where do the tips touch?",
        "Campbell diagram",
        "Spectrogram",
        "energy (J)",
        "rotor is shown by contact nodes only",
        "All settings of the scene, defaults included",
    ] {
        assert!(html.contains(wanted), "{wanted}");
    }
    let header = header(&html);
    assert_eq!(header["bodies"][0]["sectors"], 4);
    assert_eq!(header["bodies"][0]["triangles"][1], 0);
    let times = header["times"].as_array().unwrap();
    assert!((20..=121).contains(&times.len()), "{}", times.len());
    assert_eq!(header["totals"].as_array().unwrap().len(), times.len());
    assert!(header["totals"].as_array().unwrap().iter().any(|force| force.as_f64().unwrap() > 0.0));
    // The same run gives the same bytes, apart from the measured times.
    project.succeed(&["run", "scene.toml", "--step", "2e-4", "--report", "again.html"]);
    let data = |html: &str| html.split("id=\"run-data\">").nth(1).unwrap().split('<').next().unwrap().to_owned();
    assert_eq!(data(&html), data(&read(&project, "again.html")));
}

#[test]
fn report_states_that_no_contact_occurred() {
    let project = Project::new();
    fs::write(project.path("scene.toml"), SCENE.replace("amplitude = 2e-3", "amplitude = 2e-5")).unwrap();
    let printed = project.succeed(&["--json", "run", "scene.toml", "--report", "free.html"]);
    let result: Value = serde_json::from_str(&printed).unwrap();
    assert_eq!(result["report"], "free.html");
    let html = read(&project, "free.html");
    assert!(html.contains("No blade touches the casing in") && html.contains("no contact occurred"));
    assert!(!html.contains("is hit hardest"));
}

/// The page shows the values of the run, not those of the scene.
#[test]
fn report_shows_the_values_that_replace_those_of_the_scene() {
    let project = Project::new();
    project.succeed(&["run", "scene.toml", "--report", "scene.html"]);
    let html = read(&project, "scene.html");
    assert!(!html.contains("start values replace") && html.contains("from 0 s to 0.05 s"));
    let run = "run scene.toml --set speed=90 --set internal_step_max=5e-5 --stop 0.04 --step 2e-3 --report run.html";
    project.succeed(&run.split(' ').collect::<Vec<_>>());
    let html = read(&project, "run.html");
    for wanted in [
        "start values replace settings of the scene: <code>speed = 90</code>, <code>internal_step_max = 5e-5</code>.",
        "from 0 s to 0.04 s, with communication steps of 0.002 s",
        "<th>internal step h</th><td>5·10<sup>−5</sup> s",
    ] {
        assert!(html.contains(wanted), "{wanted}");
    }
}

/// Blades far from the casing take no step in a run of one short communication step, so there is no time per step.
#[test]
fn run_without_internal_steps_has_no_time_per_step() {
    let project = Project::new();
    let rom = project.path("small.rom.safetensors");
    let small = tiprub_format::read_rom(&fs::read(&rom).unwrap(), "small").unwrap();
    // Adaptive steps need more modes than contact directions.
    let stiffness = DMatrix::from_diagonal(&DVector::from_fn(6, |mode, _| 1e5 * (1.0 + mode as f64)));
    let contact_map = DMatrix::from_fn(3, 6, |row, mode| if mode % 3 == row { 1.0 / (1.0 + mode as f64) } else { 0.0 });
    let adaptive = Rom { mass: DMatrix::identity(6, 6) * 0.1, stiffness, contact_map, ..small };
    fs::write(&rom, tiprub_format::write_rom(&adaptive)).unwrap();
    let scene = SCENE.replace("[time]", "[time]\nscheme = \"galerkin\"").replace("gap = 1e-3", "gap = 0.01");
    fs::write(project.path("scene.toml"), scene).unwrap();
    let run = ["run", "scene.toml", "--all", "--stop", "1e-5", "--step", "1e-5", "--report", "run.html"];
    let printed = project.succeed(&run);
    assert!(printed.contains("internal steps: 0\n") && !printed.contains("per internal step"), "{printed}");
    assert!(!printed.contains("inf") && !printed.contains("NaN"), "{printed}");
    let html = read(&project, "run.html");
    assert!(html.contains("<th>internal steps</th><td>0</td>") && !html.contains("per internal step"));
}

#[test]
fn names_are_escaped_in_page_and_script() {
    let project = Project::new();
    let scene = SCENE.replace("name = \"small\"", "name = \"small\"\ndescription = \"a </script><b> & c\"");
    fs::write(project.path("scene.toml"), scene).unwrap();
    project.succeed(&["run", "scene.toml", "--report", "run.html"]);
    let html = read(&project, "run.html");
    assert!(html.contains("a &lt;/script&gt;&lt;b&gt; &amp; c") && html.matches("</script>").count() == 3);
}

#[test]
fn rejects_a_report_that_cannot_be_written() {
    let project = Project::new();
    for (file, problem) in [("scene.toml", "is the same file as SCENE"), (".", "")] {
        let failure = project.fail(&["run", "scene.toml", "--report", file], if file == "." { 1 } else { 2 });
        assert!(failure.contains("--report") || failure.contains(problem), "{failure}");
    }
    assert_eq!(fs::read_to_string(project.path("scene.toml")).unwrap(), SCENE);
}
