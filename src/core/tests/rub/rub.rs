//! A rub of a synthetic bladed disk through the whole simulation: energy balance, states, time, steps.

use tiprub_core::scene::method::Scheme;
use tiprub_core::scene::settings::Shape;
use tiprub_core::{CoSimulation, Simulation};
use tiprub_cosim::variables::Causality;
use tiprub_test_models::{self as models, go, real, reference, saved, started};

fn run(simulation: &mut Simulation, steps: u32, length: f64) {
    for _ in 0..steps {
        go(simulation, length);
    }
}

/// On a round casing tips slide along the circumference: the heat is µλ times the distance of the rotor plus half of
/// the displacement of the node over the last two steps, because forces act at the middle of those. Impulses and
/// displacements are read from outside.
#[test]
fn friction_heat_is_force_times_sliding() {
    let (friction, radius, sectors) = (0.15, 0.25, 4);
    let mut scene = models::rub(sectors);
    scene.settings.surfaces[0].shape = Shape::Circular {};
    let mut simulation = started(&scene);
    simulation.set_real(reference(&simulation, "casing_radius_change"), -4.2e-4).unwrap();
    let (step, speed) = (1e-6, 1300.0);
    let tangential =
        |simulation: &Simulation, node: usize, sector: usize| simulation.system().bank().row(3 * node + 1, sector);
    let all = |simulation: &Simulation| -> Vec<f64> {
        (0..3 * sectors).map(|index| tangential(simulation, index / sectors, index % sectors)).collect()
    };
    let (mut oldest, mut before, mut heat) = (all(&simulation), all(&simulation), 0.0);
    for _ in 0..3000 {
        go(&mut simulation, step);
        for event in simulation.system().events() {
            let place = event.node * sectors + event.sector;
            let moved = 0.5 * (tangential(&simulation, event.node, event.sector) - oldest[place]);
            heat += friction * event.normal * (speed * radius * step + moved);
        }
        oldest = std::mem::replace(&mut before, all(&simulation));
    }
    let booked = real(&simulation, "friction_loss");
    println!("friction heat {booked:.6} J, force times sliding {heat:.6} J");
    assert!(heat > 1.0, "{heat} J: no rub to speak of");
    assert!((booked / heat - 1.0).abs() < 1e-9, "{booked} J booked, {heat} J slid");
}

#[test]
fn shaft_power_is_torque_times_speed() {
    // Without friction the power comes only from the slope of the lobes.
    for friction in [0.0, 0.15] {
        shaft_power(friction);
    }
}

fn shaft_power(friction: f64) {
    let mut scene = models::rub(12);
    scene.settings.time.step = 1e-7;
    scene.settings.contacts[0].friction = friction;
    let mut simulation = started(&scene);
    let (mut by_torque, mut steps) = (0.0, 0);
    run(&mut simulation, 25, 5e-5);
    let before = real(&simulation, "shaft_work");
    while steps < 150 {
        run(&mut simulation, 1, 5e-5);
        by_torque -= real(&simulation, "torque") * 1300.0 * 5e-5;
        steps += 1;
    }
    let by_ledger = real(&simulation, "shaft_work") - before;
    println!("µ {friction}: shaft work {by_torque} J by torque, {by_ledger} J by ledger");
    assert!((by_torque / by_ledger - 1.0).abs() < 1e-11, "{by_torque} vs {by_ledger}");
}

#[test]
fn forces_and_torque_are_in_the_fixed_frame() {
    // A round casing moved by 0.4 mm towards 0.7 rad + π: blades are pressed inwards at 0.7 rad and dragged against +z.
    let mut scene = models::rub(12);
    scene.settings.surfaces[0].shape = Shape::Lobes { amplitude: 4.1e-4, order: 1, phase: 0.7 };
    let nodes = scene.roms[0].contact_nodes.clone();
    let mut simulation = started(&scene);
    let (mut checked, mut normal) = (0, [0.0; 2]);
    while simulation.time() < 4e-3 {
        run(&mut simulation, 1, 1e-6);
        let angle = real(&simulation, "rotor_angle");
        let (mut force, mut torque, mut size) = ([0.0; 3], 0.0, 0.0);
        for event in simulation.system().events() {
            let [r, theta, _] = nodes[event.node].position;
            // Contact point of the step: the circumferential displacement is an arc of the undeformed radius.
            let [outwards, around, _] = event.point.into();
            let theta = theta + std::f64::consts::TAU * event.sector as f64 / 12.0 + angle + around / r;
            let [radial, conjugate, axial] = event.force.into();
            let (tangential, r) = (conjugate * r / (r + outwards), r + outwards);
            let (fx, fy) =
                (radial * theta.cos() - tangential * theta.sin(), radial * theta.sin() + tangential * theta.cos());
            force = [force[0] + fx, force[1] + fy, force[2] + axial];
            // (x, y) × (F_x, F_y)
            torque += r * theta.cos() * fy - r * theta.sin() * fx;
            size += event.normal;
            (normal[0], normal[1]) = (normal[0] + radial * theta.cos(), normal[1] + radial * theta.sin());
            assert!(radial < 0.0 && tangential < 0.0 && axial < 0.0);
            checked += 1;
        }
        for (name, expected) in [("force_x", force[0]), ("force_y", force[1]), ("force_z", force[2])] {
            assert!((real(&simulation, name) - expected).abs() <= 1e-11 * size, "{name}");
        }
        assert!((real(&simulation, "torque") - torque).abs() <= 1e-11 * size);
    }
    let direction = (-normal[1]).atan2(-normal[0]);
    println!("{checked} contacts; inward push at {direction:.3} rad, the casing is closest at 0.7 rad");
    assert!(checked > 100 && (direction - 0.7).abs() < 0.3, "{checked} contacts at {direction}");
}

#[test]
fn pressed_blade_stays_at_rest_for_any_step_sizes() {
    // Closed contact under a constant force: converting (q, d) to another h must neither push nor pull.
    let mut scene = models::rub(1);
    scene.settings.contacts[0].friction = 0.0;
    scene.settings.structures[0].damping_ratio = Some(0.3);
    scene.settings.surfaces[0].shape = Shape::Circular {};
    scene.settings.outputs.watched_sectors = vec![1];
    scene.settings.outputs.nodal_diameters = None;
    scene.settings.time.step = 4e-6;
    let mut simulation = started(&scene);
    let radius = reference(&simulation, "casing_radius_change");
    while simulation.time() < 1e-2 {
        let time = simulation.time();
        simulation.set_real(radius, (-0.2 * time).max(-4e-4)).unwrap();
        simulation.set_input_derivative(radius, 1, if time < 2e-3 { -0.2 } else { 0.0 }).unwrap();
        simulation.do_step(time, 1e-5).unwrap();
    }
    let force = |simulation: &Simulation| simulation.system().events().iter().map(|event| event.normal).sum::<f64>();
    let (at_rest, mut worst) = (force(&simulation), 0.0_f64);
    for step in 0..300 {
        run(&mut simulation, 1, [4e-6, 1.5e-6, 3e-6, 1e-6][step % 4]);
        worst = worst.max((force(&simulation) / at_rest - 1.0).abs());
    }
    println!("{at_rest} N at rest, largest relative change {worst:.1e}");
    assert!(at_rest > 100.0 && worst < 1e-6, "{worst} of {at_rest} N");
}

/// Rates of clearances in a round casing that opens, and above passing lobes, against the closed form and differences.
#[test]
fn clearance_and_angle_rates_match_the_motion() {
    let rate = |simulation: &Simulation, reference| simulation.output_derivative(reference, 1).unwrap();
    let mut scene = models::rub(4);
    scene.settings.surfaces[0].shape = Shape::Circular {};
    let mut simulation = started(&scene);
    let (clearance, angle) = (reference(&simulation, "blade[1].clearance"), reference(&simulation, "rotor_angle"));
    // Across the contour, whose slope is -0.2 at every node.
    let per_opening = 1.0 / 1.04_f64.sqrt();
    let (radius, mut opened) = (reference(&simulation, "casing_radius_change"), 0.0);
    for (opening, length) in [(0.03, 5e-5), (0.03, 1e-6), (-0.02, 1e-6), (0.05, 3e-7), (-0.01, 5e-5)] {
        simulation.set_real(radius, opened).unwrap();
        simulation.set_input_derivative(radius, 1, opening).unwrap();
        run(&mut simulation, 1, length);
        for node in 0..3 {
            let found = rate(&simulation, clearance + node);
            assert!((found / (opening * per_opening) - 1.0).abs() < 1e-6, "node {node}, H = {length}: {found} m/s");
        }
        assert_eq!(rate(&simulation, angle).to_bits(), 1300.0_f64.to_bits());
        // Beginning a step of another length does not change their rates either.
        let before = rate(&simulation, clearance);
        simulation.begin_step(simulation.time(), 0.37 * length).unwrap();
        assert!((rate(&simulation, clearance) / before - 1.0).abs() < 1e-9);
        while !simulation.advance().unwrap().finished {}
        opened += 1.37 * opening * length;
    }
    let mut simulation = started(&models::rub(4));
    run(&mut simulation, 20, 5e-5);
    let clearance = reference(&simulation, "blade[1].clearance");
    let (mut fastest, read) = (0.0_f64, |simulation: &Simulation| simulation.real(clearance).unwrap());
    for index in 0..400 {
        // A communication step is one internal step.
        let (length, before) = ([1e-6, 4e-7][index % 2], read(&simulation));
        run(&mut simulation, 1, length);
        let (exact, found) = ((read(&simulation) - before) / length, rate(&simulation, clearance));
        assert!((found - exact).abs() < 1e-9 * exact.abs() + 1e-9, "{found}, by the difference {exact} m/s");
        fastest = fastest.max(exact.abs());
    }
    assert!(fastest > 0.1, "{fastest} m/s");
}

/// Outputs over a communication step are recomputed from the values visible between its internal steps.
#[test]
fn outputs_cover_all_internal_steps() {
    let (sectors, nodes) = (12, 3);
    let mut simulation = started(&models::rub(sectors));
    let lanes = simulation.system().bank().lanes();
    let least = |values: &mut dyn Iterator<Item = f64>| values.fold(f64::INFINITY, f64::min);
    // Per kind: clearances that were smaller within the step than at its end.
    let (mut passed, mut pressed, mut peaks) = ([0; 4], 0, 0);
    for communication in 0..120 {
        let length = if communication % 3 == 0 { 5e-5 } else { 3.1e-5 };
        simulation.begin_step(simulation.time(), length).unwrap();
        let mut lowest = simulation.system().structures()[0].gaps().to_vec();
        let (mut normal, mut tangential) = (vec![0.0; lowest.len()], vec![0.0; lowest.len()]);
        let (mut peak, mut last, mut finished) = (0.0_f64, 0.0_f64, false);
        while !finished {
            finished = simulation.advance().unwrap().finished;
            let (system, share) = (simulation.system(), simulation.system().bank().step() / length);
            lowest.iter_mut().zip(system.gaps()).for_each(|(low, gap)| *low = low.min(*gap));
            last = 0.0;
            for event in system.events() {
                normal[event.node * lanes + event.sector] += event.normal * share;
                tangential[event.node * lanes + event.sector] += 0.15 * event.normal * share;
                last = last.max(event.normal);
            }
            peak = peak.max(last);
        }
        let now = simulation.system().structures()[0].gaps();
        let column =
            |values: &[f64], sector: usize| (0..nodes).map(|node| values[node * lanes + sector]).collect::<Vec<_>>();
        let row = |values: &[f64], node: usize| values[node * lanes..][..sectors].to_vec();
        let mut check = |kind: usize, name: &str, element: usize, places: &dyn Fn(&[f64]) -> Vec<f64>| {
            let found = simulation.real(reference(&simulation, name) + u32::try_from(element).unwrap()).unwrap();
            let exact = least(&mut places(&lowest).into_iter());
            assert_eq!(
                found.to_bits(),
                exact.to_bits(),
                "{name}[{element}], step {communication}: {found}, not {exact}"
            );
            passed[kind] += usize::from(exact < least(&mut places(now).into_iter()) - 1e-6);
        };
        check(0, "clearance_minimum", 0, &|values| (0..nodes).flat_map(|node| row(values, node)).collect());
        (0..nodes).for_each(|node| check(1, "node_clearance_minimum", node, &|values| row(values, node)));
        (0..sectors).for_each(|sector| check(2, "sector_clearance_minimum", sector, &|values| column(values, sector)));
        for (sector, node) in (0..2).flat_map(|sector| (0..nodes).map(move |node| (sector, node))) {
            let name = format!("blade[{}].clearance_minimum", sector + 1);
            check(3, &name, node, &|values| vec![values[node * lanes + sector]]);
            for (output, exact) in [("normal_force", &normal), ("tangential_force", &tangential)] {
                let name = format!("blade[{}].{output}", sector + 1);
                let found = simulation.real(reference(&simulation, &name) + u32::try_from(node).unwrap()).unwrap();
                let exact = exact[node * lanes + sector];
                assert!((found - exact).abs() <= 1e-9 * exact, "{name}[{node}]: {found} N, exactly {exact} N");
                pressed += usize::from(exact > 0.0);
            }
        }
        for sector in 0..sectors {
            let exact: f64 = column(&normal, sector).iter().sum();
            let found = reference(&simulation, "sector_normal_force") + u32::try_from(sector).unwrap();
            assert!((simulation.real(found).unwrap() - exact).abs() <= 1e-9 * exact);
        }
        assert_eq!(real(&simulation, "normal_force_peak").to_bits(), peak.to_bits());
        let impulse = length * normal.iter().sum::<f64>();
        assert!((real(&simulation, "normal_impulse") - impulse).abs() <= 1e-9 * impulse);
        peaks += usize::from(peak > 1.01 * last);
    }
    println!("smaller within the step than at its end: {passed:?}; forces {pressed}, peaks {peaks}");
    assert!(passed.iter().all(|count| *count > 10) && pressed > 10 && peaks > 10, "{passed:?}, {pressed}, {peaks}");
}

#[test]
fn any_step_sequence_ends_exactly_and_converges() {
    let scene = models::rub(12);
    let end = 6e-3;
    let result = |lengths: &dyn Fn(u32) -> f64, step: f64| {
        let mut scene = scene.clone();
        scene.settings.time.step = step;
        let mut simulation = started(&scene);
        let mut index = 0;
        while simulation.time() < end {
            let time = simulation.time();
            // Time differences stay representable in the importer's clock.
            let length = lengths(index).min(end - time);
            simulation.do_step(time, length).unwrap();
            assert_eq!(simulation.time().to_bits(), (time + length).to_bits());
            index += 1;
        }
        (0..12).map(|sector| simulation.system().bank().row(1, sector)).collect::<Vec<f64>>()
    };
    let fine = result(&|_| 1e-4, 2e-8);
    let size = fine.iter().fold(0.0_f64, |largest, value| largest.max(value.abs()));
    let difference = |other: &[f64]| fine.iter().zip(other).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) / size;
    let regular = difference(&result(&|_| 1e-4, 4e-7));
    let uneven = difference(&result(&|_| 1.03e-5, 4e-7));
    let changing = difference(&result(&|i| 1e-5 * (1.0 + f64::from(i % 7)), 4e-7));
    let odd = difference(&result(&|i| if i % 2 == 0 { 3.3e-7 } else { 8.1e-5 }, 4e-7));
    println!(
        "relative differences from the fine run: regular {regular:.1e}, uneven {uneven:.1e}, changing {changing:.1e}, odd {odd:.1e}"
    );
    assert!(regular < 1e-2, "{regular}");
    // Uneven steps are as accurate as even ones: changing h costs no order.
    for found in [uneven, changing, odd] {
        assert!(found < 1.2 * regular, "{found}");
    }
}

#[test]
fn a_tiny_communication_step_at_an_impact_adds_no_energy() {
    // The importer inserts an event: a step of a nanosecond or less, whose impact has a multiplier p/h of meganewtons.
    for tiny in [1e-8, 1e-10, 1e-12] {
        let mut simulation = started(&models::rub(12));
        let (mut impacts, mut worst) = (0, 0.0_f64);
        for step in 0..4000_u32 {
            go(&mut simulation, if step % 2 == 0 { 7.3e-7 } else { tiny });
            if step % 2 == 1 && !simulation.system().events().is_empty() {
                impacts += 1;
            }
            let energy = real(&simulation, "kinetic_energy") + real(&simulation, "strain_energy");
            let change = real(&simulation, "step_change_energy");
            worst = worst.max(change.abs() / (energy + real(&simulation, "impact_loss")).max(1e-3));
        }
        println!(
            "tiny step {tiny:e}: {impacts} tiny steps with contact, largest share of step change energy {worst:.2e}"
        );
        assert!(impacts > 10, "no contact in a tiny step: the test would prove nothing");
        assert!(worst < 0.2, "tiny step {tiny:e}: {worst}");
    }
}

#[test]
fn one_sixtieth_with_rounding_is_a_single_step() {
    let mut scene = models::rub(6);
    scene.settings.time.step = 1e-5;
    let ways = [1.0 / 60.0, 0.016_666_666_666_666_677, 2.0 / 60.0 - 1.0 / 60.0 + 1e-17];
    let ends: Vec<Vec<f64>> = ways
        .iter()
        .map(|length| {
            let mut simulation = started(&scene);
            for _ in 0..3 {
                let time = simulation.time();
                simulation.do_step(time, *length).unwrap();
                assert_eq!(simulation.time().to_bits(), (time + length).to_bits());
            }
            (0..6).map(|sector| simulation.system().bank().row(0, sector)).collect()
        })
        .collect();
    let size = ends[0].iter().fold(0.0_f64, |largest, value| largest.max(value.abs()));
    for other in &ends[1..] {
        let worst = ends[0].iter().zip(other).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(worst < 1e-6 * size, "{worst:e} of {size:e}");
    }
}

#[test]
fn inputs_are_linear_where_derivatives_are_given() {
    let scene = models::rub(6);
    let mut simulation = started(&scene);
    let speed = reference(&simulation, "speed");
    for _ in 0..10 {
        let time = simulation.time();
        simulation.set_real(speed, 1000.0 + 4e5 * time).unwrap();
        simulation.set_input_derivative(speed, 1, 4e5).unwrap();
        simulation.do_step(time, 1e-4).unwrap();
    }
    let exact = 1000.0 * 1e-3 + 0.5 * 4e5 * 1e-6;
    assert!((real(&simulation, "rotor_angle") - exact).abs() < 1e-13);
    assert!(simulation.set_input_derivative(speed, 2, 1.0).is_err());
    assert!(simulation.set_input_derivative(speed, 1, f64::NAN).is_err());
}

#[test]
fn rejects_every_invalid_value_and_call() {
    let scene = models::rub(6);
    let mut simulation = Simulation::new(&scene).unwrap();
    let rows = simulation.table().variables().to_vec();
    for row in &rows {
        for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            assert!(simulation.set_real(row.reference, value).is_err(), "{} took {value}", row.name);
        }
        if !matches!(row.causality, Causality::Input | Causality::Parameter) {
            assert!(simulation.set_real(row.reference, 1.0).is_err(), "{} could be set", row.name);
        }
    }
    assert!(simulation.set_real(1_000_000, 1.0).is_err());
    let friction = reference(&simulation, "friction_coefficient");
    assert!(simulation.set_real(friction, -0.1).is_err() && simulation.set_real(friction, 2.1).is_err());
    let scheme = reference(&simulation, "scheme");
    assert!(simulation.set_integer(scheme, 0).is_err() && simulation.set_integer(scheme, 5).is_err());
    assert!(simulation.initialise(f64::NAN).is_err());
    simulation.initialise(0.0).unwrap();
    assert!(simulation.set_integer(scheme, 1).is_err(), "fixed after initialisation");
    for (time, length) in [(0.0, 0.0), (0.0, -1e-5), (0.0, f64::NAN), (1e-5, 1e-5), (f64::NAN, 1e-5), (0.0, 1e9)] {
        assert!(simulation.do_step(time, length).is_err(), "step {length} at {time} was taken");
    }
    run(&mut simulation, 3, 5e-5);
}

#[test]
fn rejects_unstable_or_penetrating_starts_with_numbers() {
    let mut scene = models::rub(6);
    scene.settings.time.scheme = Scheme::CentralDifference;
    scene.settings.time.step = 2.002 / (std::f64::consts::TAU * 40_000.0);
    scene.settings.experiment.communication_step = scene.settings.time.step;
    let message = Simulation::new(&scene).unwrap().initialise(0.0).unwrap_err().to_string();
    assert!(message.contains("ω_max") && message.contains("modal-exact"), "{message}");
    scene.settings.time.step = 1.998 / (std::f64::consts::TAU * 40_000.0);
    scene.settings.experiment.communication_step = scene.settings.time.step;
    scene.settings.contacts[0].friction = 0.0;
    Simulation::new(&scene).unwrap().initialise(0.0).unwrap();
    // A bump directly over sector 1, without a ramp: depth 0.6 intrudes by 0.2 gaps.
    scene.settings.surfaces[0].ramp_time = 0.0;
    scene.settings.surfaces[0].shape = Shape::TwoLobe { depth: 0.6, width: 0.15, phase: std::f64::consts::FRAC_PI_2 };
    let message = Simulation::new(&scene).unwrap().initialise(0.0).unwrap_err().to_string();
    assert!(message.contains("ramp_time") && message.contains("sector"), "{message}");
}

#[test]
fn round_casing_never_touches_an_undisturbed_disk() {
    let mut scene = models::rub(12);
    scene.settings.surfaces[0].shape = Shape::Circular {};
    let mut simulation = started(&scene);
    run(&mut simulation, 20, 1e-3);
    let clearance = 3.56e-4 / (1.0_f64 + 0.04).sqrt();
    assert!((real(&simulation, "clearance_minimum") - clearance).abs() < 1e-18);
    assert!(real(&simulation, "kinetic_energy").abs() < 1e-30);
}

/// An importer computes lengths as differences of times, which are rounded at late times: to 1e-5 of H here.
#[test]
fn rub_is_independent_of_the_start_time() {
    let (scene, length) = (models::rub(6), 1e-5);
    let run = |begin: f64| {
        let mut simulation = Simulation::new(&scene).unwrap();
        simulation.initialise(begin).unwrap();
        let (mut peak, mut impulse) = (0.0_f64, 0.0);
        for index in 0..300 {
            let [now, next] = [index, index + 1].map(|index| begin + f64::from(index) * length);
            simulation.do_step(now, next - now).unwrap();
            peak = peak.max(real(&simulation, "normal_force_peak"));
            impulse += real(&simulation, "normal_impulse");
            assert_eq!(real(&simulation, "internal_step").to_bits(), 1e-6_f64.to_bits());
            if index % 7 == 0 {
                let state = saved(&simulation);
                simulation.restore_state(&state).unwrap();
            }
        }
        [peak, impulse, real(&simulation, "internal_steps"), real(&simulation, "rotor_angle")]
    };
    let early = run(0.0);
    for begin in [1e3, 1e6, -1e6] {
        let late = run(begin);
        println!("from {begin:e} s: {late:?} of {early:?}");
        // Time itself is known to 1e-10 s.
        let apart = early.iter().zip(late).map(|(early, late)| (late / early - 1.0).abs()).fold(0.0, f64::max);
        assert!(apart < 1e-3, "from {begin:e} s: {late:?} of {early:?}");
    }
}

/// Amplitudes of nodal diameters equal an independently computed Fourier sum over the blades: of the middle node, and
/// for patches in rows of the mean over the thickness, not of the first patch of another row.
#[test]
fn amplitudes_of_nodal_diameters_are_fourier_coefficients() {
    for (rows, middle) in [(None, vec![1]), (Some(3), vec![0, 1, 2])] {
        let mut scene = tiprub_test_models::rub(7);
        scene.settings.outputs.nodal_diameters = Some(3);
        scene.roms[0].extras.rows = rows;
        scene.roms[0].contact_nodes.iter_mut().for_each(|node| node.area = 1e-5);
        let mut simulation = tiprub_test_models::started(&scene);
        tiprub_test_models::go(&mut simulation, 2e-3);
        let modes = simulation.system().structures()[0].modes();
        for diameter in 0..=3_u32 {
            let sum = (0..7_u32).fold([0.0, 0.0], |[real, imaginary]: [f64; 2], sector| {
                let (sine, cosine) = (std::f64::consts::TAU * f64::from(diameter * sector) / 7.0).sin_cos();
                let moved = middle.iter().map(|node| modes.row(3 * node, sector as usize)).sum::<f64>();
                [real + moved * cosine, imaginary + moved * sine]
            });
            let expected = sum[0].hypot(sum[1]) / middle.len() as f64 * if diameter == 0 { 1.0 } else { 2.0 } / 7.0;
            let reported = tiprub_test_models::element(&simulation, "nodal_diameter_amplitude", diameter);
            assert!(
                expected > 1e-9 && (reported / expected - 1.0).abs() < 1e-10,
                "{diameter}: {reported:e} {expected:e}"
            );
        }
    }
}
