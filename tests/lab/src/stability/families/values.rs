//! NaN, infinities, the largest and the smallest numbers on every input and parameter, through the setters of the core and
//! through the C ABI of packaged FMUs.

use tiprub_core::scene::method::Solver;
use tiprub_core::scene::settings::LoadSettings;
use tiprub_core::{CoSimulation, Error, Result, Scene, Simulation};
use tiprub_cosim::variables::{Causality, DataType, Quantity, Variable};
use tiprub_fmi_host::{Session, UnpackedFmu};

use super::super::{
    CaseContext, CaseEnd, Check, Expected, StabilityCase,
    models::{StabilityMethod, Tower, blade, bumps, on_ring, round},
    observe::{bits, outputs},
};

/// Values that are tried on every variable.
pub(crate) const VALUES: [(&str, f64); 12] = [
    ("NaN", f64::NAN),
    ("inf", f64::INFINITY),
    ("-inf", f64::NEG_INFINITY),
    ("1e308", 1e308),
    ("-1e308", -1e308),
    ("1e154", 1e154),
    ("-1e20", -1e20),
    ("1e9", 1e9),
    ("denormal", 1e-310),
    ("-denormal", -1e-310),
    ("least", 5e-324),
    ("-0", -0.0),
];

/// Scenes whose variables are tested.
pub(crate) const SCENES: [&str; 5] = ["bumps", "round", "ring", "disk", ADAPTIVE];
/// Name of the scene with a tolerance.
const ADAPTIVE: &str = "galerkin";

/// Returns the scene of this name.
pub(crate) fn scene(name: &str) -> Scene {
    let mut scene = match name {
        "bumps" => {
            let mut scene = bumps(blade(4));
            scene.settings.structures[0].whirl = true;
            scene.settings.structures[0].axial_shift = true;
            scene
        }
        "round" | ADAPTIVE => {
            let mut scene = round(Tower { sectors: 3, ..Tower::default() }.rom());
            scene.settings.contacts[0].friction = 0.15;
            scene
        }
        "ring" => {
            let mut scene = bumps(blade(4));
            on_ring(&mut scene, 0.01);
            scene.settings.structures[1].thermal = true;
            scene.settings.structures[1].load = Some(LoadSettings { order: 2, amplitude: 1e3, phase: 0.0 });
            scene.settings.contacts[0].slave_heat_fraction = Some(0.5);
            scene
        }
        _ => bumps(Tower { sectors: 4, neighbour: 1e6, ..Tower::default() }.rom()),
    };
    scene.settings.name = name.into();
    scene.settings.outputs.all_sectors = true;
    let adaptive = |method: &StabilityMethod| method.is_adaptive() == (name == ADAPTIVE);
    let method = StabilityMethod::common().filter(|method| method.solver == Solver::Lcp).find(adaptive);
    method.unwrap_or(StabilityMethod::exact(Solver::Lcp)).on(scene)
}

/// Returns all cases of this family.
pub(crate) fn cases() -> Vec<StabilityCase> {
    let mut cases = Vec::new();
    for name in SCENES {
        // The variable table of a scene is cheap, and the only list of settable variables.
        let Ok(simulation) = Simulation::new(scene(name)) else { continue };
        for variable in
            simulation.table().variables().iter().filter(|row| row.is_settable() && row.kind == DataType::Real)
        {
            for (text, value) in VALUES {
                cases.extend(of_variable(name, variable, text, value));
            }
        }
    }
    cases.extend(settings());
    cases
}

fn of_variable(scene: &'static str, variable: &Variable, text: &str, value: f64) -> Vec<StabilityCase> {
    let against = "same result as the nearest ordinary value, or finite and consistent; a rejection changes nothing";
    let name = variable.name.clone();
    let word = match name.as_str() {
        "speed" => "speed",
        "casing_load_amplitude" => "load",
        _ => "casing",
    };
    let expected = || {
        let finite = value.is_finite()
            && variable.min.is_none_or(|min| value >= min)
            && variable.max.is_none_or(|max| value <= max);
        if !finite {
            Expected::refused([&variable.name])
        } else if variable.name == "casing_ramp_time" && value.abs() <= 1.0 {
            // Without a ramp some blades start inside the bumps.
            Expected::either(against, ["initial clearance"])
        } else if value.abs() > 1.0 {
            // With large loads, tips may vibrate faster than they slide.
            Expected::either_as(against, &[&[word], &["friction has added", "not model sticking"]])
        } else {
            Expected::right(against)
        }
    };
    let mut cases = Vec::new();
    for (when, during) in [("start", false), ("run", true)] {
        if during
            && variable.causality == Causality::Parameter
            && variable.variability == tiprub_cosim::variables::Variability::Fixed
        {
            continue;
        }
        let owned = name.clone();
        let work = move |_: &CaseContext| by_setter(scene, &owned, value, during);
        // Steps must be positive: the shortest numbers are out of range.
        let case = StabilityCase::new(format!("values/{scene}/{name}/{text}/{when}"), expected(), work);
        let scene = scene == "round" || (scene == "ring" && during) || scene == ADAPTIVE;
        cases.push(case.quick(common(text) && scene));
    }
    if variable.causality == Causality::Input {
        let owned = name.clone();
        let expected = if value.is_finite() {
            Expected::either_as(against, &[&[&variable.name], &[word]])
        } else {
            Expected::refused([&variable.name])
        };
        let work = move |_: &CaseContext| by_slope(scene, &owned, value);
        let case = StabilityCase::new(format!("values/{scene}/{name}/{text}/slope"), expected, work);
        cases.push(case.quick(scene == "round" && common(text)));
    }
    for version in [2_u8, 3] {
        let owned = name.clone();
        let work = move |context: &CaseContext| by_import(context, scene, version, &owned, value);
        let case =
            StabilityCase::new(format!("values/{scene}/{name}/{text}/fmi{version}"), expected(), work).importing();
        let quick = scene == ADAPTIVE && common(text);
        cases.push(case.quick(quick));
    }
    cases
}

/// Returns whether a value belongs to the quick table.
fn common(text: &str) -> bool {
    ["NaN", "1e308", "denormal"].contains(&text)
}

/// Number of steps before the extreme value.
const CALM: usize = 3;
const LENGTH: f64 = 2e-5;

fn started(scene: &Scene) -> Result<Simulation> {
    let mut simulation = Simulation::new(scene)?;
    simulation.initialise(0.0)?;
    for _ in 0..CALM {
        simulation.do_step(simulation.time(), LENGTH)?;
    }
    Ok(simulation)
}

/// Sets a value before initialisation or in a run; the result must equal that of an ordinary value if there is one, and
/// otherwise be finite and within the bounds of mechanics.
fn by_setter(name: &str, variable: &str, value: f64, during: bool) -> CaseEnd {
    let scene = scene(name);
    let outcome = (|| -> Result<CaseEnd> {
        let (mut simulation, mut twin) = if during {
            (started(&scene)?, started(&scene)?)
        } else {
            (Simulation::new(&scene)?, Simulation::new(&scene)?)
        };
        let row = simulation.table().find(variable).map_or(0, |row| row.reference);
        let before = simulation.real(row)?;
        let mut set = simulation.set_real(row, value);
        if set.is_ok() && !during {
            set = simulation.initialise(0.0);
        }
        let stepped = set.and_then(|()| go_on(&mut simulation));
        let plain = ordinary(variable, value);
        if let Err(refusal) = &stepped {
            return Ok(refused(refusal, simulation, twin, row, before, during));
        }
        let mut checks = sane(&simulation);
        if let Some(plain) = plain {
            twin.set_real(row, plain)?;
            if !during {
                twin.initialise(0.0)?;
            }
            go_on(&mut twin)?;
            checks.push(Check::at_most(
                format!("difference of the outputs from those with {plain:.6}"),
                differ(&simulation, &twin),
                1e-6,
            ));
        }
        Ok(CaseEnd::answer(checks))
    })();
    outcome.unwrap_or_else(CaseEnd::refused)
}

/// Returns the value to which an extreme one must be equivalent: zero, or for an angle the remainder of whole turns.
fn ordinary(variable: &str, value: f64) -> Option<f64> {
    let angle = ["initial_rotor_angle", "casing_shape_rotation"].contains(&variable);
    (value.abs() < 1e-300).then_some(0.0).or_else(|| angle.then_some(value % std::f64::consts::TAU))
}

fn go_on(simulation: &mut Simulation) -> Result<()> {
    for _ in 0..5 {
        simulation.do_step(simulation.time(), LENGTH)?;
    }
    Ok(())
}

/// Checks finite outputs, a ledger that closes, clearances without penetration, and friction that generates heat.
fn sane(simulation: &Simulation) -> Vec<Check> {
    let finite = outputs(simulation).iter().all(|value| value.is_finite());
    let ledger = simulation.system().ledger();
    let (kinetic, strain) = simulation.system().energies();
    let scale = ledger.scale().max(f64::MIN_POSITIVE);
    vec![
        Check::so("all outputs finite", finite),
        Check::at_most("energy residual", ledger.residual(kinetic + strain).abs() / scale, 1e-9),
        Check::at_most("energy gain in impacts", -ledger.impact_loss.value() / scale, 1e-9),
        Check::at_most("negative friction heat", -ledger.friction_loss.value() / scale, 1e-6),
    ]
}

/// Returns the largest difference of all outputs relative to their size; the total angle counts turns, and is excluded.
fn differ(first: &Simulation, second: &Simulation) -> f64 {
    let mut most = 0.0_f64;
    let table = first.table().variables();
    for variable in table.iter().filter(|row| !row.is_settable() && row.quantity != Quantity::RotorAngle) {
        for reference in (variable.reference..).take(variable.len()) {
            let [Ok(a), Ok(b)] = [first.real(reference), second.real(reference)] else { continue };
            let size = a.abs().max(b.abs());
            if size >= 1e-200 && a.to_bits() != b.to_bits() {
                most = most.max((a - b).abs() / size);
            }
        }
    }
    most
}

/// Checks that the instance continues after an error as if the value had not been set; if a step had begun, after a
/// reset.
fn refused(
    error: &Error,
    mut simulation: Simulation,
    mut twin: Simulation,
    row: u32,
    before: f64,
    during: bool,
) -> CaseEnd {
    let mut checks = Vec::new();
    let outcome = (|| -> Result<bool> {
        if during && simulation.set_real(row, before).is_ok() && go_on(&mut simulation).is_ok() {
            twin.set_real(row, before)?;
            go_on(&mut twin)?;
            // A step that fails in its middle cannot be undone: then only a reset helps, which is tested below.
            if bits(&simulation) == bits(&twin) {
                return Ok(true);
            }
        }
        for run in [&mut simulation, &mut twin] {
            run.reset();
            run.initialise(0.0)?;
            go_on(run)?;
        }
        Ok(bits(&simulation) == bits(&twin))
    })();
    checks.push(Check::so("continues bitwise as if the value had not been set", outcome == Ok(true)));
    CaseEnd { checks, ..CaseEnd::refused(error) }
}

/// Sets the derivative of an input.
fn by_slope(name: &str, variable: &str, value: f64) -> CaseEnd {
    let scene = scene(name);
    let outcome = (|| -> Result<CaseEnd> {
        let (mut simulation, twin) = (started(&scene)?, started(&scene)?);
        let row = simulation.table().find(variable).map_or(0, |row| row.reference);
        let before = simulation.real(row)?;
        let stepped = simulation.set_input_derivative(row, 1, value).and_then(|()| go_on(&mut simulation));
        Ok(match stepped {
            Err(refusal) => refused(&refusal, simulation, twin, row, before, true),
            Ok(()) => CaseEnd::answer(sane(&simulation)),
        })
    })();
    outcome.unwrap_or_else(CaseEnd::refused)
}

/// Uses a packaged FMU: sets the value after the start, steps, reads everything.
fn by_import(context: &CaseContext, scene: &str, version: u8, variable: &str, value: f64) -> CaseEnd {
    let Some(directory) = &context.fmus else { return CaseEnd::refused("no FMUs were packaged") };
    let outcome = (|| -> tiprub_shell::Result<CaseEnd> {
        let fmu = UnpackedFmu::open(&directory.join(format!("{scene}-{version}.fmu")))?;
        let mut session = Session::new(&fmu)?;
        let set = session.set_real(variable, value);
        let stepped = set.and_then(|()| {
            session.initialise(0.0)?;
            (0..5).try_for_each(|index| session.do_step(f64::from(index) * LENGTH, LENGTH))
        });
        if let Err(refusal) = stepped {
            return Ok(CaseEnd {
                checks: vec![Check::so("reported through a status", true)],
                ..CaseEnd::refused(refusal)
            });
        }
        let values = session.outputs()?;
        let mut checks = vec![Check::so("all outputs finite", values.iter().all(|value| value.is_finite()))];
        // The same run without FMI, bit by bit.
        let mut native =
            Simulation::new(self::scene(scene)).map_err(|error| tiprub_shell::Failure::from_core("scene", error))?;
        let run = native.table().find(variable).map_or(0, |row| row.reference);
        let ran = native.set_real(run, value).and_then(|()| native.initialise(0.0)).and_then(|()| go_on(&mut native));
        checks.push(Check::so("also runs without FMI", ran.is_ok()));
        let expected = tiprub_shell::native::numeric_outputs(&native);
        let same =
            expected.len() == values.len() && expected.iter().zip(&values).all(|(a, b)| a.to_bits() == b.to_bits());
        checks.push(Check::so("bitwise the same as the run without FMI", same));
        Ok(CaseEnd::answer(checks))
    })();
    outcome.unwrap_or_else(CaseEnd::refused)
}

/// Returns the accepted messages for a finite but extreme value of a setting: the field, and the problem or the remedy.
fn refusals(field: &str) -> &'static [&'static [&'static str]] {
    match field {
        "speed" => &[&["variable `speed`", "Use a lower speed"], &["structure[1].speed", "between -1e6 and 1e6"]],
        "damping_ratio" => &[&["structure[1].damping_ratio", "between 0 and 0.99"]],
        "frequency_factors" => &[&["structure[1].frequency_factors[4]", "between 0.5 and 2"]],
        "gap" => &[
            &["contact[1].gap", "> 0"],
            &["contact[1].gap", "missing or 0", "clearance (m)"],
            &["contact[1].gap", "between 0 and"],
            &["contact.gap", "in metres"],
        ],
        "sector_gaps" => &[
            &["contact[1].sector_gaps", "> 0"],
            &["contact[1].sector_gaps", "between 0 and"],
            &["contact.gap", "in metres"],
        ],
        "friction" => &[&["contact[1].friction", "between 0 and 2"]],
        "ramp_time" => &[
            &["surface[1].ramp_time", "between 0 and 1e9"],
            &["initial clearance", "start inside the casing", "ramp_time"],
        ],
        "time.step" => &[&["time.step", "between 1e-12 and 1"]],
        "communication_step" => &[&["experiment.communication_step", "between 1e-12 and 1e9"]],
        "start" => &[&["experiment.start", "between -1e9 and 1e9"], &["experiment.stop", "after"]],
        "shape.depth" => &[&["surface[1].shape", "in metres"], &["surface[1].shape.depth", "between"]],
        "shape.phase" => &[&["surface[1].shape.phase", "between -1e6 and 1e6"]],
        "rom.radius" => &[
            &["`contact_positions`", "between 1e-5 and 1000"],
            &["`contact_positions`", "not positive"],
            &["`contact_meridional_slopes`", "their positions rise"],
        ],
        "rom.axial" => &[
            &["`contact_positions`", "between -1000 and 1000"],
            &["`contact_meridional_slopes`", "their positions rise"],
        ],
        "rom.angle" => &[&["`contact_positions`", "between -1e6 and 1e6"]],
        "rom.slope" => &[
            &["`contact_meridional_slopes`", "between -1000 and 1000"],
            &["`contact_meridional_slopes`", "their positions rise"],
        ],
        "rom.map" => &[&["`contact_map`", "exceeds 1e15"], &["µ"], &["small displacements"]],
        "shape.width" => &[&["surface[1].shape.width", "between 0.001 and 0.25"]],
        "rom.mass" => &[
            &["`mass`", "exceeds 1e30"],
            &["`mass`", "not positive definite"],
            &["`mass` and `stiffness`", "orders of magnitude"],
        ],
        "rom.stiffness" => &[
            &["`stiffness`", "exceeds 1e30"],
            &["`mass` and `stiffness`", "orders of magnitude"],
            &["`stiffness`", "not positive semidefinite"],
            &["µ", "no unique solution", "Use no friction"],
        ],
        _ => &[],
    }
}

/// Returns the cases for settings of a scene, which have no setter.
fn settings() -> Vec<StabilityCase> {
    type Change = fn(&mut Scene, f64);
    let fields: [(&str, &str, Change); 20] = [
        ("speed", "speed", |scene, value| scene.settings.structures[0].speed = value),
        ("damping_ratio", "damping_ratio", |scene, value| scene.settings.structures[0].damping_ratio = Some(value)),
        ("frequency_factors", "frequency_factors", |scene, value| {
            scene.settings.structures[0].frequency_factors = vec![1.0, 1.0, 1.0, value];
        }),
        ("gap", "gap", |scene, value| scene.settings.contacts[0].gap = value),
        ("sector_gaps", "gap", |scene, value| scene.settings.contacts[0].sector_gaps = vec![3e-4, 3e-4, value, 3e-4]),
        ("friction", "friction", |scene, value| scene.settings.contacts[0].friction = value),
        ("ramp_time", "ramp_time", |scene, value| scene.settings.surfaces[0].ramp_time = value),
        ("time.step", "time.step", |scene, value| scene.settings.time.step = value),
        ("communication_step", "communication_step", |scene, value| {
            scene.settings.experiment.communication_step = value
        }),
        ("shape.depth", "shape", |scene, value| {
            scene.settings.surfaces[0].shape =
                tiprub_core::scene::settings::Shape::TwoLobe { depth: value, width: 0.15, phase: 0.0 };
        }),
        ("shape.width", "shape.width", |scene, value| {
            scene.settings.surfaces[0].shape =
                tiprub_core::scene::settings::Shape::TwoLobe { depth: 0.5, width: value, phase: 0.0 };
        }),
        ("shape.phase", "shape.phase", |scene, value| {
            scene.settings.surfaces[0].shape =
                tiprub_core::scene::settings::Shape::TwoLobe { depth: 0.4, width: 0.15, phase: value };
        }),
        ("rom.mass", "mass", |scene, value| scene.roms[0].mass[(2, 2)] = value),
        ("rom.stiffness", "stiffness", |scene, value| scene.roms[0].stiffness[(2, 2)] = value),
        ("start", "experiment", |scene, value| scene.settings.experiment.start = value),
        ("rom.radius", "contact_positions", |scene, value| scene.roms[0].contact_nodes[1].position[0] = value),
        ("rom.angle", "contact_positions", |scene, value| scene.roms[0].contact_nodes[1].position[1] = value),
        ("rom.axial", "contact_positions", |scene, value| scene.roms[0].contact_nodes[1].position[2] = value),
        ("rom.slope", "contact_meridional_slopes", |scene, value| {
            scene.roms[0].contact_nodes[1].meridional_slope = value
        }),
        ("rom.map", "contact_map", |scene, value| scene.roms[0].contact_map[(2, 2)] = value),
    ];
    let mut cases = Vec::new();
    for (field, word, change) in fields {
        for (text, value) in VALUES {
            let expected = if value.is_finite() {
                Expected::either_as("finite outputs, closed energy balance", refusals(field))
            } else {
                Expected::refused([word])
            };
            let work = move |_: &CaseContext| {
                let mut scene = scene("bumps");
                change(&mut scene, value);
                CaseEnd::of((|| {
                    // As when the ROM file is read.
                    scene.roms[0].validate()?;
                    let mut simulation = Simulation::new(&scene)?;
                    simulation.initialise(0.0)?;
                    go_on(&mut simulation)?;
                    Ok(sane(&simulation))
                })())
            };
            cases.push(StabilityCase::new(format!("settings/{field}/{text}"), expected, work).quick(common(text)));
        }
    }
    cases
}
