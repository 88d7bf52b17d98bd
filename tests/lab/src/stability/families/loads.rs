//! Heat, nodal-diameter loads, coatings and casing shapes of any size.

use std::f64::consts::{PI, TAU};

use tiprub_core::scene::method::Solver;
use tiprub_core::scene::settings::{CoatingSettings, InputInterpolation, LoadSettings, Shape};
use tiprub_core::{CoSimulation, Result, Scene, Simulation};

use super::super::{
    CaseEnd, Cases, Check, Expected, StabilityCase,
    models::{GAP, LONGEST, RADIUS, StabilityMethod, Tower, blade, bumps, on_ring, round, with_step},
    observe::{StabilityWatch, amplitudes, apart, begin, displacements, real, set, steps},
};

/// Returns all cases of this family.
pub(crate) fn cases() -> Vec<StabilityCase> {
    [loads(), coatings(), shapes()].into_iter().flatten().collect()
}

fn ringed(method: StabilityMethod) -> Scene {
    let mut scene = method.stepping(round(Tower { slope: 0.0, ..Tower::default() }.rom()), 2e-6);
    on_ring(&mut scene, 0.03);
    scene.settings.structures[1].thermal = true;
    scene.settings.structures[1].load = Some(LoadSettings { order: 2, amplitude: 0.0, phase: 0.0 });
    scene.settings.outputs.slave_displacement = true;
    // Far enough away for any motion of the ring.
    scene.settings.contacts[0].gap = 0.02;
    scene
}

/// Returns modal-exact and both forms of galerkin, which differ in the treatment of loads.
fn methods() -> impl Iterator<Item = StabilityMethod> {
    StabilityMethod::common().filter(|method| method.solver == Solver::Lcp)
}

fn loads() -> Vec<StabilityCase> {
    let mut cases = Vec::new();
    for method in methods() {
        for order in [1, 2, 3, 4] {
            for amplitude in [5e-324, 1e-300, 1e-6, 1.0, 1e3, 1e5, 1e7, 1e9, 1e12, 1e100, 1e200, 1e308] {
                for sign in [1.0, -1.0] {
                    let against = "static amplitude F π R/2 · (½)²·2/ω² of one pair of modes, linear in the load";
                    let expected = if amplitude > 1e12 {
                        Expected::refused(["load.amplitude", "between -1e12 and 1e12"])
                    } else if amplitude > 1e9 {
                        Expected::refused(["initial state", "start values of", "loads"])
                    } else if amplitude > 1e5 {
                        // Loads below the limit of large values may still make the ring reach the blades.
                        Expected::either_as(
                            against,
                            &[
                                &["initial state", "start values of", "loads"],
                                &["initial clearance", "start inside the casing", "Enlarge the gap", "load"],
                            ],
                        )
                    } else {
                        Expected::right(against)
                    };
                    let name = format!("loads/nodal/{order}/{:e}/{}", sign * amplitude, method.integration());
                    let quick = order == 2 && sign > 0.0 && (method.is_adaptive() || amplitude > 1e12);
                    cases.add(quick, name, expected, move || nodal(method, order, sign * amplitude));
                }
            }
        }
        for temperature in [1e-300, 1e-6, 1.0, -1.0, 300.0, 3000.0, -3000.0] {
            let expected = Expected::right("static displacement under the modal loads, linear in the temperature");
            let name = format!("loads/heat/{temperature:e}/{}", method.integration());
            cases.add(method.is_adaptive(), name, expected, move || heated(method, temperature));
        }
        for temperature in [3001.0, 1e9, -1e308, f64::INFINITY] {
            let expected = Expected::refused(["casing_temperature"]);
            let name = format!("loads/heat/{temperature:e}/{}", method.integration());
            cases.add(method.is_adaptive(), name, expected, move || heated(method, temperature));
        }
    }
    for method in StabilityMethod::all_with(Solver::Lcp) {
        for step in ["load", "heat"] {
            let expected = Expected::right(
                "twice the static displacement after a sudden load, undamped; energy \
                                            balance",
            );
            let name = format!("loads/sudden-{step}/{}", method.integration());
            cases.add(true, name, expected, move || sudden(method, step));
        }
    }
    cases
}

fn nodal(method: StabilityMethod, order: u32, size: f64) -> Result<Vec<Check>> {
    let mut scene = ringed(method);
    scene.settings.structures[1].load = Some(LoadSettings { order, amplitude: size, phase: 0.0 });
    let mut simulation = Simulation::new(&scene)?;
    simulation.initialise(0.0)?;
    for _ in 0..20 {
        simulation.do_step(simulation.time(), method.step(2e-6))?;
    }
    let [found, across, rest] = amplitudes(&simulation, order);
    let off = across.abs().max(rest);
    // F cos² around R, on modes of amplitude ½: modal force ½ F π R, displacement ½ of it over ω².
    let omega = TAU * [9000.0, 900.0, 400.0, 1100.0, 2100.0][order as usize];
    let exact = 0.25 * size * PI * RADIUS / (omega * omega);
    let energy = real(&simulation, "kinetic_energy");
    Ok(vec![
        Check::at_most(
            "deviation of the amplitude from the static one",
            (found - exact).abs() / exact.abs().max(1e-290),
            1e-9,
        ),
        Check::at_most("amplitude of other shapes", off / exact.abs().max(1e-290), 1e-9),
        Check::at_most("kinetic energy at rest", energy / real(&simulation, "strain_energy").max(1e-290), 1e-18),
    ])
}

fn heated(method: StabilityMethod, temperature: f64) -> Result<Vec<Check>> {
    let scene = ringed(method);
    let mut simulation = Simulation::new(&scene)?;
    set(&mut simulation, "casing_temperature", temperature)?;
    simulation.initialise(0.0)?;
    for _ in 0..20 {
        simulation.do_step(simulation.time(), method.step(2e-6))?;
    }
    let ring = tiprub_test_models::ring(36, 3);
    let Some(loads) = ring.extras.thermal.as_ref().map(|thermal| &thermal.loads) else { return Ok(Vec::new()) };
    let Some(row) = simulation.table().find("casing_displacement").map(|row| row.reference) else {
        return Ok(Vec::new());
    };
    let exact = |node: usize| -> f64 {
        (0..ring.order())
            .map(|mode| {
                ring.contact_map[(3 * node, mode)] * loads[(mode, 0)] * temperature / ring.stiffness[(mode, mode)]
            })
            .sum()
    };
    let (mut off, mut size) = (0.0_f64, 0.0_f64);
    for (node, reference) in (0..108).zip(row..) {
        size = size.max(exact(node).abs());
        off = off.max((simulation.real(reference)? - exact(node)).abs());
    }
    Ok(vec![Check::at_most("deviation of the displacement from the static one", off / size.max(1e-300), 1e-9)])
}

/// Compares a sudden load: without damping the ring oscillates up to twice its static displacement and back.
fn sudden(method: StabilityMethod, what: &str) -> Result<Vec<Check>> {
    let mut scene = ringed(method);
    scene.settings.time.input_interpolation = InputInterpolation::Hold;
    scene.settings.structures[1].damping_ratio = Some(0.0);
    let (mut simulation, mut watch) = begin(&scene)?;
    // Short enough to resolve the largest displacement of the oscillation.
    let length = scene.settings.experiment.communication_step.min(1e-5);
    let omega = TAU * 400.0;
    if what == "load" {
        set(&mut simulation, "casing_load_amplitude", 1e5)?;
    } else {
        set(&mut simulation, "casing_temperature", 100.0)?;
    }
    let (mut most, mut work) = (0.0_f64, 0.0_f64);
    for _ in 0..steps(2.6e-3, length) {
        watch.step(&mut simulation, length)?;
        most = most.max(amplitudes(&simulation, 2)[0]);
        work = work.max(real(&simulation, "load_work"));
    }
    let mut checks = watch.laws();
    let energy = real(&simulation, "scheme_energy");
    checks.push(Check::relative(
        "deviation of the energy from the work of the \
                                 load",
        energy,
        real(&simulation, "load_work"),
        1e-9,
    ));
    checks.push(Check::so("the load did work", work > 0.0));
    if what == "load" {
        checks.push(Check::relative(
            "deviation from twice the static amplitude",
            most,
            0.5 * 1e5 * PI * RADIUS / (omega * omega),
            1e-3,
        ));
    }
    Ok(checks)
}

fn coatings() -> Vec<StabilityCase> {
    let mut cases = Vec::new();
    let plain = tiprub_test_models::coating_of(1.5e-4, [500, 7]);
    type Change = fn(CoatingSettings) -> CoatingSettings;
    let accepted: [(&str, Change); 13] = [
        ("plain", |c| c),
        ("zero-yield", |c| CoatingSettings { yield_stress: 0.0, ..c }),
        ("no-hardening", |c| CoatingSettings { hardening: 0.0, ..c }),
        ("zero-yield-no-hardening", |c| CoatingSettings { yield_stress: 0.0, hardening: 0.0, ..c }),
        ("stiff", |c| CoatingSettings { modulus: 1e13, ..c }),
        ("soft", |c| CoatingSettings { modulus: 1e-3, ..c }),
        ("thin-1e-9", |c| CoatingSettings { thickness: 1e-9, ..c }),
        ("thick", |c| CoatingSettings { thickness: 0.01, ..c }),
        ("hard", |c| CoatingSettings { yield_stress: 1e13, hardening: 1e13, ..c }),
        ("24-cells", |c| CoatingSettings { cells_around: 24, cells_along: 1, ..c }),
        ("10000-cells", |c| CoatingSettings { cells_around: 1000, cells_along: 10, ..c }),
        ("1e6-cells", |c| CoatingSettings { cells_around: 1000, cells_along: 1000, ..c }),
        ("denormal", |c| CoatingSettings { modulus: 1e-310, yield_stress: 1e-310, hardening: 1e-310, ..c }),
    ];
    let refused: [(&str, &'static str, Change); 10] = [
        ("thin-1e-300", "thickness", |c| CoatingSettings { thickness: 1e-300, ..c }),
        ("1-cell", "cells", |c| CoatingSettings { cells_around: 1, cells_along: 1, ..c }),
        ("23-cells", "cells", |c| CoatingSettings { cells_around: 23, ..c }),
        ("no-rows", "cells_along", |c| CoatingSettings { cells_along: 0, ..c }),
        ("1e18-cells", "cells", |c| CoatingSettings { cells_around: 1 << 30, cells_along: 1 << 30, ..c }),
        ("no-thickness", "thickness", |c| CoatingSettings { thickness: 0.0, ..c }),
        ("NaN-modulus", "modulus", |c| CoatingSettings { modulus: f64::NAN, ..c }),
        ("negative-yield", "yield_stress", |c| CoatingSettings { yield_stress: -1.0, ..c }),
        ("infinite-hardening", "hardening", |c| CoatingSettings { hardening: f64::INFINITY, ..c }),
        ("1e308-modulus", "modulus", |c| CoatingSettings { modulus: 1e308, ..c }),
    ];
    for method in StabilityMethod::all_with(Solver::Lcp) {
        for (name, change) in accepted {
            let coating = change(plain);
            let work = move |_: &_| {
                let mut scene = method.stepping(round(blade(12)), 1e-6);
                scene.settings.contacts[0].coating = Some(coating);
                CaseEnd::of(worn(scene, coating))
            };
            let against = "wear only grows, ∫σdε ≥ Y V, signs of the energy terms, no penetration of the hard casing";
            let expected = if method.is_galerkin() {
                Expected::refused(["galerkin", "contact.coating"])
            } else {
                Expected::right(against)
            };
            let quick = (method == StabilityMethod::exact(Solver::Lcp) && name != "1e6-cells")
                || (method.is_galerkin() && name == "plain");
            let name = format!("coating/{name}/{}", method.integration());
            cases.push(StabilityCase::new(name, expected, work).quick(quick));
        }
    }
    for (name, word, change) in refused {
        let coating = change(plain);
        let work = move |_: &_| {
            let mut scene = StabilityMethod::exact(Solver::Lcp).stepping(round(blade(12)), 1e-6);
            scene.settings.contacts[0].coating = Some(coating);
            CaseEnd::of(worn(scene, coating))
        };
        cases.push(StabilityCase::new(format!("coating/{name}"), Expected::refused([word]), work).quick(true));
    }
    cases
}

fn worn(mut scene: Scene, coating: CoatingSettings) -> Result<Vec<Check>> {
    scene.settings.contacts[0].friction = 0.15;
    scene.settings.structures[0].damping_ratio = Some(0.05);
    let (mut simulation, mut watch) = begin(&scene)?;
    let (mut before, mut fallen, mut deepest) = (0.0_f64, 0.0_f64, 0.0_f64);
    for index in 0..3000 {
        // Down to three tenths of a coating of 0.15 mm, and back.
        let swing = 0.5 - 0.5 * (TAU * f64::from(index) / 2000.0).cos();
        set(&mut simulation, "casing_radius_change", -(GAP + 4.5e-5) * swing)?;
        watch.step(&mut simulation, 1e-6)?;
        let volume = real(&simulation, "worn_volume");
        fallen = fallen.max(before - volume);
        before = volume;
        let system = simulation.system();
        deepest = system.gaps().fold(deepest, |most: f64, gap| most.max(-gap));
    }
    let energy = real(&simulation, "wear_energy");
    let (yields, depth) = (coating.yield_stress, real(&simulation, "wear_depth_maximum"));
    let most = (yields + coating.hardening * depth / coating.thickness) * before;
    let massless = scene.settings.time.scheme == tiprub_core::scene::method::Scheme::MasslessBoundary;
    let mut checks = watch.books_of(scene.settings.time.scheme);
    if massless {
        checks.retain(|check| !check.what.contains("impact"));
    }
    checks.extend([
        Check::so("wear only grows", fallen <= 0.0),
        Check::at_most("deficit of the wear energy below Y V", (yields * before - energy) / most.max(1e-300), 1e-9),
        Check::at_most("excess of the wear energy over (Y + K ε) V", (energy - most) / most.max(1e-300), 1e-9),
        Check::at_most(
            "penetration beyond the coating",
            (deepest - coating.thickness) / (GAP + coating.thickness),
            1e-9,
        ),
        if yields + coating.hardening > 0.0 {
            Check::so("the blades touched", watch.contacts > 0)
        } else {
            Check::so("wear without force", watch.contacts == 0 && before > 0.0 && energy == 0.0)
        },
    ]);
    Ok(checks)
}

fn shapes() -> Vec<StabilityCase> {
    let mut cases = Vec::new();
    let against = "same result with a quarter of the step, or a sixteenth of the tolerance";
    for method in StabilityMethod::common() {
        let (lcp, name) = (method.solver == Solver::Lcp, method.name());
        for width in [1e-3, 0.01, 0.05, 0.15, 0.25] {
            for depth in [-1.0, 0.1, 0.51, 0.6, 1.0, 3.0, 30.0] {
                // Bumps of three or thirty clearances.
                let expected = if depth > 1.0 {
                    let deep: &[&str] = &["inside the casing", "flank", "Check gap, casing shape"];
                    let around: &[&str] = &["displaced", "around the axis", "Check casing shape"];
                    // One step can exceed several of these limits.
                    let implausible: &[&str] =
                        &["penetrated the casing by as much", "flank", "Check gap, casing shape"];
                    // Tips that vibrate this much slide back and forth, which ends the run as well.
                    let sliding: &[&str] = &["friction has added", "less friction"];
                    // When a tip crosses a steep bump, the contact normal may rotate too far within an internal step, which ends the run.
                    let rotating: &[&str] = &["spurious energy", "normals rotate too far", "internal step"];
                    Expected::either_as(against, &[deep, around, implausible, sliding, rotating])
                } else {
                    Expected::right(against)
                };
                let shape = Shape::TwoLobe { depth, width, phase: 0.0 };
                cases.add(
                    lcp && (depth - 0.6).abs() < 0.05 && width > 0.01,
                    format!("shapes/two-lobe/w={width}/d={depth}/{name}"),
                    expected,
                    move || shaped(method, shape.clone()),
                );
            }
        }
        for order in [1, 2, 7, 36, 72, 300, 10_000] {
            // A lobe in less than a step; adaptive steps are halved.
            let expected = if order > 1000 && method.is_galerkin() {
                Expected::either(against, ["features of the casing shape", "internal_step_max (time.step) below"])
            } else if order > 1000 {
                Expected::refused([
                    "variable `speed`",
                    "features of the casing shape that are 1.000e-4 rad wide",
                    "internal_step_max (time.step) below",
                ])
            } else {
                Expected::right(against)
            };
            let shape = Shape::Lobes { amplitude: 4e-4, order, phase: 0.3 };
            cases.add(lcp && order != 300, format!("shapes/lobes/{order}/{name}"), expected, move || {
                shaped(method, shape.clone())
            });
        }
        for (what, height) in [("small", 3.8e-4), ("high", 4e-3), ("huge", 1.0)] {
            let expected = if height > 0.1 {
                Expected::refused(["surface[1].shape: 1.000e0 m", "in metres"])
            } else if height > 1e-3 {
                Expected::either(against, ["displaced", "around the axis", "clearance"])
            } else {
                Expected::right(against)
            };
            let jump = move |index: usize| if index < 18 { -height } else { 0.0 };
            let shape = Shape::Table { radius_change: (0..36).map(jump).collect() };
            cases.add(lcp, format!("shapes/jump-{what}/{name}"), expected, move || shaped(method, shape.clone()));
        }
    }
    cases
}

/// Compares a rub on a shape with the same rub with finer steps, over the first contacts.
fn shaped(method: StabilityMethod, shape: Shape) -> Result<Vec<Check>> {
    // A bump or a lobe takes at least two hundred steps to pass.
    let feature = match shape {
        Shape::TwoLobe { width, .. } => 2.0 * PI * width,
        Shape::Lobes { order, .. } => TAU / f64::from(order.min(300)),
        _ => TAU / 36.0,
    };
    let run = |method: StabilityMethod, step: f64| -> Result<(Vec<f64>, StabilityWatch)> {
        // The longest adaptive step is short compared with the features of the shape, as required of every scene.
        let longest = if method.is_adaptive() { (0.1 * feature / 1300.0).min(LONGEST) } else { step };
        let mut scene = with_step(method.on(bumps(blade(6))), longest);
        scene.settings.surfaces[0].shape = shape.clone();
        scene.settings.surfaces[0].ramp_time = 5e-4;
        scene.settings.structures[0].damping_ratio = Some(0.05);
        let (mut simulation, mut watch) = begin(&scene)?;
        let mut history = Vec::new();
        for _ in 0..70 {
            watch.step(&mut simulation, 1e-5)?;
            history.extend(displacements(&simulation));
        }
        Ok((history, watch))
    };
    let step = (feature / 1300.0 / 200.0).min(5e-7);
    let (better, parts) = method.finer();
    let (coarse, watch) = run(method, step)?;
    let (fine, finer) = run(better, step / parts)?;
    let mut checks = vec![
        Check::at_most("deviation of the displacements from the finer run", apart(&coarse, &fine), 0.1),
        Check::at_most(
            "deviation of the impulse from the finer run",
            (watch.impulse - finer.impulse).abs() / finer.impulse.max(1e-12),
            0.1,
        ),
        watch.ledger(),
        finer.ledger(),
    ];
    if method.solver != Solver::Film {
        checks.extend(watch.complementarity());
    }
    Ok(checks)
}
