//! The scheme of a scene file without one: chosen when the file is read, with the reason.

use tiprub_core::Rom;
use tiprub_core::scene::method::Scheme;
use tiprub_core::scene::settings::{ADAPTIVE_STEP, SceneSettings};
use tiprub_cosim::Diagnostic;
use tiprub_format::{parse_scene, read_scene, write_scene};
use tiprub_test_models::{blade, disk::TestDisk, rich_blade};

/// Without a table `[time]`.
const SCENE: &str = r#"name = "demo"
[[structure]]
name = "rotor"
rom = "rotor.safetensors"
[[surface]]
name = "casing"
[[contact]]
master = "rotor"
slave = "casing"
gap = 1e-3
friction = 0.1
[experiment]
stop = 1.0
communication_step = 1e-3
"#;

const COATING: &str = "coating = { thickness = 2e-3, modulus = 1e9, yield_stress = 5e6, hardening = 1e8, cells_around = 90, cells_along = 3 }\n";
const RING: &str = "[[structure]]\nname = \"ring\"\nrom = \"ring.safetensors\"\nmotion = \"still\"\n";

/// Returns the scene with lines inserted after others, and with fixed steps where it needs them.
fn scene(after: &str, line: &str, step: bool) -> Result<SceneSettings, Diagnostic> {
    assert_eq!(SCENE.matches(after).count(), 1, "{after:?}");
    let time = if step { "[time]\nstep = 1e-6\n" } else { "" };
    parse_scene(&(SCENE.replace(after, &format!("{after}{line}")) + time), "demo.toml")
}

/// Lines inserted into a scene, the line before them, and the reason that is reported.
const FIXED: [(&str, &str, &str); 6] = [
    ("gap = 1e-3\n", COATING, "`contact.coating`"),
    ("rom = \"rotor.safetensors\"\n", "spin = { growth = true }\n", "`structure.spin`"),
    ("rom = \"rotor.safetensors\"\n", "thermal = true\n", "`structure.thermal` of a rotor"),
    ("rom = \"rotor.safetensors\"\n", "excitation = { order = 2, mode = 1 }\n", "`structure.excitation`"),
    ("gap = 1e-3\n", "solver = \"film\"\n", "`contact.solver = \"film\"`"),
    ("[[surface]]\nname = \"casing\"\n", "structure = \"ring\"\n", "the surface `casing` is elastic"),
];

#[test]
fn rigid_casing_defaults_to_adaptive_steps() {
    let settings = parse_scene(SCENE, "demo.toml").unwrap();
    assert_eq!((settings.time.scheme, settings.time.step), (Scheme::Galerkin, ADAPTIVE_STEP));
    assert!(settings.time.scheme_reason.as_ref().unwrap().contains("the default for rigid surfaces"));
    // The choice is packaged together with its reason.
    assert_eq!(parse_scene(&write_scene(&settings), "again").unwrap(), settings);
}

/// Advises adaptive steps for a missing step only where they are the default.
#[test]
fn missing_step_suggests_adaptive_steps_where_allowed() {
    let refusal = |text: String| {
        parse_scene(&format!("{text}[time]\nscheme = \"modal-exact\"\n"), "demo.toml").unwrap_err().to_string()
    };
    assert!(refusal(SCENE.to_owned()).contains("or use scheme = \"galerkin\""));
    for (after, line, reason) in FIXED.iter().filter(|(_, line, _)| !line.contains("ring")) {
        let found = refusal(SCENE.replace(after, &format!("{after}{line}")));
        assert!(found.contains("time.step: missing") && !found.contains("galerkin"), "{reason}: {found}");
    }
}

#[test]
fn chooses_fixed_steps_with_a_reason_where_galerkin_is_excluded() {
    for (after, line, reason) in FIXED {
        let text = if line.contains("ring") { format!("{line}{RING}") } else { line.to_owned() };
        let settings = scene(after, &text, true).unwrap_or_else(|error| panic!("{line}: {error}"));
        let own = settings.time.scheme_reason.clone().unwrap();
        assert_eq!((settings.time.scheme, settings.time.step), (Scheme::ModalExact, 1e-6), "{line}");
        assert!(own.contains("fixed steps, because") && own.contains(reason), "{line}: {own}");
        // Fixed steps need a length: the error states why the steps are fixed.
        let refusal = scene(after, &text, false).unwrap_err().to_string();
        assert!(refusal.contains("time.step: missing") && refusal.contains(reason), "{refusal}");
        // A scheme in the file is used as it is.
        let named = format!("{}[time]\nscheme = \"galerkin\"\n", SCENE.replace(after, &format!("{after}{text}")));
        match parse_scene(&named, "demo.toml") {
            Ok(settings) => assert!(reason.contains("elastic") && settings.time.scheme_reason.is_none()),
            Err(error) => {
                assert!(error.to_string().contains("cannot be combined with") && !reason.contains("elastic"), "{error}")
            }
        }
    }
}

#[test]
fn explicit_schemes_have_no_reason_and_may_require_a_step() {
    for scheme in Scheme::ALL {
        let text = format!("{SCENE}[time]\nscheme = \"{}\"\n", scheme.name());
        let settings = parse_scene(&format!("{text}step = 1e-6\n"), "demo.toml").unwrap();
        assert_eq!((settings.time.scheme, settings.time.scheme_reason), (scheme, None));
        match parse_scene(&text, "demo.toml") {
            Ok(settings) => assert_eq!((scheme, settings.time.step), (Scheme::Galerkin, ADAPTIVE_STEP)),
            Err(error) => {
                let text = error.to_string();
                assert!(text.contains("time.step: missing") && text.contains("scheme = \"galerkin\""), "{text}");
            }
        }
    }
    let paper = parse_scene(&format!("preset = \"paper\"\n{SCENE}[time]\nstep = 1e-6\n"), "demo.toml").unwrap();
    assert_eq!((paper.time.scheme, paper.time.scheme_reason), (Scheme::CentralDifference, None));
}

#[test]
fn default_scheme_depends_on_the_rom() {
    let choice = |rom: Rom| {
        let text = format!("{SCENE}[time]\nstep = 1e-6\n");
        let scene = read_scene::<Diagnostic>(&text, "demo.toml", |_, _| Ok(rom.clone())).unwrap();
        (scene.settings.time.scheme, scene.settings.time.scheme_reason.unwrap())
    };
    assert_eq!(choice(rich_blade(4)).0, Scheme::Galerkin);
    let (scheme, reason) = choice(blade(4));
    assert!(scheme == Scheme::ModalExact && reason.contains("more than three modes per contact node"), "{reason}");
    let (scheme, reason) = choice(TestDisk::random(6, 1, 4, 0.1, 1).cyclic());
    assert!(scheme == Scheme::ModalExact && reason.contains("the sectors of `rotor` are coupled"), "{reason}");
    // A missing step is detected only with the ROM.
    let refusal = read_scene::<Diagnostic>(SCENE, "demo.toml", |_, _| Ok(blade(4))).unwrap_err().to_string();
    assert!(refusal.contains("time.step: missing") && refusal.contains("three modes per contact node"), "{refusal}");
}
