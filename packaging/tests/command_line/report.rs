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

/// The report shows the values of the run instead of those of the scene.
#[test]
fn report_shows_values_that_replace_scene_settings() {
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

/// Returns a project with adaptive steps.
fn adaptive() -> Project {
    let project = Project::new();
    let rom = project.path("small.rom.safetensors");
    let small = tiprub_format::read_rom(&fs::read(&rom).unwrap(), "small").unwrap();
    // Adaptive steps need more modes than contact directions.
    let stiffness = DMatrix::from_diagonal(&DVector::from_fn(6, |mode, _| 1e5 * (1.0 + mode as f64)));
    let contact_map = DMatrix::from_fn(3, 6, |row, mode| if mode % 3 == row { 1.0 / (1.0 + mode as f64) } else { 0.0 });
    let adaptive = Rom { mass: DMatrix::identity(6, 6) * 0.1, stiffness, contact_map, ..small };
    fs::write(&rom, tiprub_format::write_rom(&adaptive)).unwrap();
    fs::write(project.path("scene.toml"), SCENE.replace("[time]", "[time]\nscheme = \"galerkin\"")).unwrap();
    project
}

#[test]
fn report_describes_the_steps_of_the_run() {
    let project = adaptive();
    let [adaptive, fixed] = [
        "<th>adaptive steps</th><td>tolerance 1·10<sup>−3</sup> of",
        "<th>internal step h</th><td>5·10<sup>−5</sup> s",
    ];
    let page = |set: &[&str]| {
        let run = [&["run", "scene.toml", "--stop", "0.005", "--report", "run.html"], set].concat();
        project.succeed(&run);
        read(&project, "run.html")
    };
    let html = page(&["--set", "tolerance=1e-3"]);
    assert!(html.contains(adaptive) && !html.contains("internal step h"));
    for scheme in ["scheme=modal-exact", "scheme=2"] {
        let html = page(&["--set", scheme, "--set", "internal_step_max=5e-5"]);
        assert!(html.contains(fixed) && !html.contains("adaptive steps"), "{scheme}");
    }
}

#[test]
fn report_describes_inputs_over_time() {
    let project = Project::new();
    let page = |lines: &str| {
        fs::write(project.path("in.csv"), lines).unwrap();
        project.succeed(&["run", "scene.toml", "--step", "2e-4", "--inputs", "in.csv", "--report", "run.html"]);
        read(&project, "run.html")
    };
    let html = page("time,speed,gap_offset\n0,-80,0\n0.04,-120,0\n0.09,-900,0\n");
    for wanted in [
        "Inputs over time come from the file <code>in.csv</code>: <code>speed</code>, <code>gap_offset</code>.",
        "over its range of speeds, 80.0 rad/s to 276 rad/s (horizontal bars)",
    ] {
        assert!(html.contains(wanted), "{wanted}");
    }
    assert!(!html.contains("times the rotational frequency") && !html.contains("at its speed"));
    let html = page("time,gap_offset\n0,0\n0.05,1e-5\n");
    assert!(html.contains("<code>in.csv</code>: <code>gap_offset</code>.") && html.contains("at its speed (circles)"));
}

/// The report names the rotor in text and figures, and uses speed and modes of the rotor that is hit hardest.
#[test]
fn report_distinguishes_several_rotors() {
    let project = Project::new();
    let stiff = tiprub_format::read_rom(&fs::read(project.path("small.rom.safetensors")).unwrap(), "small").unwrap();
    let stiff = Rom { stiffness: stiff.stiffness.clone() * 4.0, ..stiff };
    fs::write(project.path("stiff.rom.safetensors"), tiprub_format::write_rom(&stiff)).unwrap();
    let rear = "[[structure]]\nname = \"rear\"\nrom = \"stiff.rom.safetensors\"\nspeed = 100.0\n\
                [[surface]]\nname = \"around_rear\"\nshape = { kind = \"lobes\", amplitude = 2.5e-3, order = 3 }\nramp_time = 0.02\n\
                [[contact]]\nmaster = \"rear\"\nslave = \"around_rear\"\ngap = 1e-3\nfriction = 0.1\n";
    fs::write(project.path("scene.toml"), format!("{SCENE}{rear}")).unwrap();
    project.succeed(&["run", "scene.toml", "--step", "2e-4", "--set", "rear.speed=70", "--report", "run.html"]);
    let html = read(&project, "run.html");
    for wanted in [
        " of rear is hit hardest",
        "each contact node of blade",
        " of rear, which is hit hardest",
        " of rear</label>",
        "Torque of the contacts on each rotor",
        "</i>rear</span>",
    ] {
        assert!(html.contains(wanted), "{wanted}");
    }
    // The caption has the frequency of the largest amplitude and its multiple of the rotational frequency.
    let caption = html.split("The largest amplitude, ").nth(1).unwrap().split(" times the").next().unwrap();
    let number = |text: &str| text.trim_matches(|other: char| !other.is_ascii_digit()).parse::<f64>().unwrap();
    let (hertz, order) = caption.split_once(" is at ").unwrap().1.split_once(" Hz (").unwrap();
    let speed = std::f64::consts::TAU * number(hertz) / number(order);
    assert!((speed / 70.0 - 1.0).abs() < 0.02, "{caption}: {speed}");
    // A mass of 0.1 kg on a spring of 4e5 N/m has a natural frequency of 318 Hz.
    assert!(html.contains("mode 1: 318 Hz") && !html.contains("mode 1: 159 Hz"));
}

/// A run with one short communication step needs no internal steps if the blades are far from the casing.
#[test]
fn run_without_internal_steps_has_no_time_per_step() {
    let project = adaptive();
    let scene = fs::read_to_string(project.path("scene.toml")).unwrap().replace("gap = 1e-3", "gap = 0.01");
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
