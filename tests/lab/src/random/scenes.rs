//! Random valid scenes: features, schemes, solvers and inputs by chance.

use tiprub_core::scene::method::{Scheme, Solver};
use tiprub_core::scene::settings::{
    BodyMotion, Closure, CoatingSettings, ContactSettings, CuttingSettings, ExcitationSettings, ExperimentSettings,
    ForceDirection, InitialSettings, InputInterpolation, Interpolation, LoadSettings, Meridian, OutputSettings,
    PatchSettings, Preset, SceneSettings, Shape, SplineSettings, StructureSettings, SurfaceSettings, TimeSettings,
};
use tiprub_core::{Rom, Scene};
use tiprub_test_models::SeededRandom;

use super::bodies;
use super::structures::{self, casing, chance, largest_frequency, lowest_frequency, rotor};

/// A scene with its communication steps.
#[derive(Debug, Clone)]
pub(crate) struct RandomScene {
    /// Seed of the scene.
    pub seed: u64,
    /// The scene.
    pub scene: Scene,
    /// Lengths of the communication steps (s).
    pub lengths: Vec<f64>,
    /// Clearance (m) that scales the inputs which move a structure.
    pub gap: f64,
    /// True if inputs are set with their derivatives.
    pub slopes: bool,
}

/// Returns random numbers for a seed; each purpose has separate ones.
pub(crate) fn numbers(seed: u64, purpose: u64) -> SeededRandom {
    let mut mixed = seed ^ purpose.wrapping_mul(0x9e37_79b9_7f4a_7c15);
    mixed = (mixed ^ (mixed >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    SeededRandom(mixed ^ (mixed >> 31))
}

/// Returns the scene of a seed.
pub(crate) fn trial(seed: u64) -> RandomScene {
    let mut random = numbers(seed, 1);
    let scheme = random.of(&Scheme::ALL);
    let solver = match scheme {
        Scheme::Galerkin if chance(&mut random, 0.9) => random.of(&[Solver::Lcp, Solver::Coulomb]),
        _ => random.of(&[Solver::Film, Solver::Lcp, Solver::Coulomb]),
    };
    // These two exclude each other.
    let solver = if scheme == Scheme::MasslessBoundary && solver == Solver::Film { Solver::Lcp } else { solver };
    let free = chance(&mut random, if scheme == Scheme::MasslessBoundary { 0.02 } else { 0.12 });
    let (settings, roms, gap) = if free {
        bodies::scene(&mut random, scheme, solver)
    } else {
        let mut draw = Draw { random: &mut random, scheme, solver, settings: empty(), roms: Vec::new() };
        draw.rotors();
        let gap = draw.settings.contacts.iter().map(ContactSettings::nominal_gap).fold(f64::INFINITY, f64::min);
        (draw.settings, draw.roms, gap)
    };
    let mut scene = Scene { settings, roms };
    scene.settings.name = format!("random_{seed:x}");
    let lengths = time(&mut random, &mut scene, scheme);
    let slopes = chance(&mut random, 0.4);
    RandomScene { seed, scene, lengths, gap, slopes }
}

/// Returns settings without structures.
pub(crate) fn empty() -> SceneSettings {
    SceneSettings {
        // Small random models have implausible sizes and speeds.
        accept_implausible: true,
        silence: Vec::new(),
        name: "random".into(),
        description: String::new(),
        preset: Preset::None,
        structures: Vec::new(),
        surfaces: Vec::new(),
        contacts: Vec::new(),
        time: TimeSettings { step: 1e-6, ..TimeSettings::default() },
        outputs: OutputSettings::default(),
        experiment: ExperimentSettings { start: 0.0, stop: 0.01, communication_step: 1e-5 },
    }
}

/// Chooses the internal step, the communication steps and their limits.
fn time(random: &mut SeededRandom, scene: &mut Scene, scheme: Scheme) -> Vec<f64> {
    let fastest = scene.roms.iter().map(largest_frequency).fold(0.0, f64::max);
    let slowest = scene.roms.iter().map(lowest_frequency).fold(f64::INFINITY, f64::min);
    let time = &mut scene.settings.time;
    time.scheme = scheme;
    time.step = match scheme {
        Scheme::Galerkin => random.scale(4.0, 60.0) / fastest,
        _ => random.scale(0.08, 1.9) / fastest,
    };
    // Coupled problems with many contacts are expensive with galerkin.
    let dense = scene.roms.iter().any(|rom| rom.is_cyclic() || rom.order() > 70) || scene.roms.len() > 1;
    let internal = match scheme {
        Scheme::Galerkin => {
            if dense {
                8.0
            } else {
                24.0
            }
        }
        _ => 400.0,
    };
    // A few periods of the slowest mode, if the number of steps permits it.
    let total = (random.within(1.0, 4.0) * std::f64::consts::TAU / slowest).min(internal * time.step);
    let count = 10 + random.below(15);
    let length = total / count as f64;
    if scheme == Scheme::Galerkin && chance(random, 0.8) {
        time.tolerance = Some(random.scale(1e-5, 5e-2));
    }
    if chance(random, 0.03) {
        time.max_internal_steps = Some(2 + u32::try_from(random.below(40)).unwrap_or(0));
    }
    if chance(random, 0.1) {
        time.input_interpolation = InputInterpolation::Hold;
    }
    scene.settings.experiment = ExperimentSettings { start: 0.0, stop: total, communication_step: length };
    (0..count).map(|_| length * random.of(&[1.0, 1.0, 1.0, 1.0, 0.41])).collect()
}

struct Draw<'a> {
    random: &'a mut SeededRandom,
    scheme: Scheme,
    solver: Solver,
    settings: SceneSettings,
    roms: Vec<Rom>,
}

impl Draw<'_> {
    fn chance(&mut self, probability: f64) -> bool {
        chance(self.random, probability)
    }

    /// Returns whether to use a feature; if the scheme or solver does not support it, the probability is small, so that
    /// most scenes run.
    fn feature(&mut self, probability: f64, supported: bool) -> bool {
        let probability = if supported { probability } else { 0.06 * probability };
        self.chance(probability)
    }

    fn rotors(&mut self) {
        let rotors = if self.chance(0.15) { 2 } else { 1 };
        let shared = self.feature(0.3, rotors == 1 || self.scheme != Scheme::MasslessBoundary);
        let coated = self.feature(0.12, self.solver == Solver::Lcp && self.scheme != Scheme::Galerkin);
        for index in 0..rotors {
            self.rotor(index, coated);
        }
        if shared {
            self.ring();
        }
        self.outputs(shared, coated);
    }

    fn rotor(&mut self, index: usize, coated: bool) {
        let coupled = self.chance(0.22);
        let sectors = self.random.of(if coupled { &[3, 4, 5, 6] } else { &[1, 2, 3, 4, 6] });
        let nodes = self.random.of(&[1_usize, 2, 3, 4]);
        let shape = structures::RotorShape { sectors, nodes, coupled, axial: 0.03 * index as f64 };
        let rom = rotor(self.random, shape);
        let name = if index == 0 { "front" } else { "rear" };
        let parts = if nodes > 1 && !coated && self.chance(0.15) { 2 } else { 1 };
        for part in 0..parts {
            let kept = (parts == 2).then(|| format!("tip_{}", part + 1));
            self.pair(name, &rom, kept, coated);
        }
        let structure = self.structure(name, &rom);
        self.settings.structures.push(structure);
        self.roms.push(rom);
    }

    fn structure(&mut self, name: &str, rom: &Rom) -> StructureSettings {
        let plain = self.scheme != Scheme::Galerkin;
        let coupled = rom.is_cyclic();
        let slow = self.chance(0.15);
        let speed = if slow { self.random.scale(1e-2, 30.0) } else { self.random.scale(30.0, 2500.0) };
        let mut own = StructureSettings {
            name: name.into(),
            rom: name.into(),
            speed: speed * self.random.of(&[1.0, 1.0, -1.0, 0.0, 1.0]),
            ..StructureSettings::default()
        };
        own.damping_ratio = self.chance(0.5).then(|| self.random.scale(1e-4, 0.2));
        if self.chance(0.1) {
            own.damping_ratios = (0..2.min(rom.order())).map(|_| self.random.scale(1e-4, 0.1)).collect();
        }
        own.whirl = self.chance(0.25);
        own.axial_shift = self.chance(0.2);
        own.spin.stiffening = self.feature(0.2, plain && !coupled);
        own.spin.growth = self.feature(0.2, plain && !coupled);
        own.spin.coriolis = self.feature(0.2, plain && !coupled && self.scheme != Scheme::MasslessBoundary);
        own.thermal = self.feature(0.2, plain);
        if own.thermal && self.feature(0.4, !coupled) {
            own.softening = self.random.scale(1e-5, 1e-3);
        }
        if self.feature(0.2, !coupled) {
            own.frequency_factors = (0..rom.sectors).map(|_| self.random.within(0.93, 1.07)).collect();
        }
        if self.feature(0.2, plain) {
            own.excitation = Some(self.excitation(rom));
        }
        if self.chance(0.2) {
            own.initial.push(self.initial(rom));
        }
        own
    }

    fn excitation(&mut self, rom: &Rom) -> ExcitationSettings {
        let by_node = self.chance(0.5);
        let node = by_node.then(|| rom.contact_nodes[self.random.below(rom.contact_nodes.len())].name.clone());
        let all = [ForceDirection::Radial, ForceDirection::Tangential, ForceDirection::Axial];
        let mode = (!by_node || self.chance(0.3)).then_some(1);
        ExcitationSettings {
            order: u32::try_from(self.random.below(6)).unwrap_or(0),
            mode,
            node,
            direction: by_node.then(|| self.random.of(&all)),
            amplitude: self.random.scale(0.1, 100.0),
            phase: self.random.within(-3.0, 3.0),
        }
    }

    fn initial(&mut self, rom: &Rom) -> InitialSettings {
        let (of_sector, of_diameter) = (self.feature(0.4, !rom.is_cyclic()), self.chance(0.4));
        InitialSettings {
            mode: 1,
            sector: of_sector.then(|| 1 + self.random.below(rom.sectors)),
            nodal_diameter: (!of_sector && of_diameter).then(|| self.random.below(rom.sectors / 2 + 1)),
            phase: self.random.within(-3.0, 3.0),
            displacement: self.random.of(&[0.0, 1e-5, -4e-5]),
            velocity: self.random.of(&[0.0, 0.2, -1.0]),
        }
    }

    /// Adds a surface and the contact with it.
    fn pair(&mut self, master: &str, rom: &Rom, nodes: Option<String>, coated: bool) {
        let slave = format!("casing_{}", self.settings.surfaces.len() + 1);
        let gap = self.random.scale(5e-5, 8e-4);
        let surface = self.surface(&slave, gap);
        let splined = surface.spline.is_some();
        let friction = self.random.of(&[0.0, 0.05, 0.15, 0.3, 0.6, 1.0]);
        let mut contact = ContactSettings {
            master: master.into(),
            slave,
            nodes,
            gap,
            friction,
            solver: self.solver,
            ..ContactSettings::default()
        };
        if self.chance(0.2) {
            contact.sector_gaps = (0..rom.sectors).map(|_| gap * self.random.within(0.8, 1.2)).collect();
        }
        if !splined && self.chance(0.2) {
            contact.meridian = Meridian::Cylinder;
        }
        if friction > 0.0 && self.chance(0.2) {
            contact.slave_heat_fraction = Some(self.random.unit());
        }
        contact.coating = coated.then(|| self.coating(gap));
        self.settings.surfaces.push(surface);
        self.settings.contacts.push(contact);
    }

    fn surface(&mut self, name: &str, gap: f64) -> SurfaceSettings {
        let moving = self.chance(0.8);
        let depth = if moving { self.random.within(0.1, 1.3) } else { self.random.within(1.0, 1.5) };
        let shape = match self.random.of(&[0, 0, 1, 2, 3]) {
            0 if moving => Shape::Circular {},
            1 => Shape::TwoLobe {
                depth: 0.55 * depth,
                width: self.random.within(0.05, 0.25),
                phase: self.random.within(-3.0, 3.0),
            },
            2 => {
                let change = |_| -gap * depth * self.random.unit();
                Shape::Table { radius_change: (0..16).map(change).collect() }
            }
            _ => Shape::Lobes {
                amplitude: gap * depth,
                order: 1 + u32::try_from(self.random.below(5)).unwrap_or(0),
                phase: self.random.within(-3.0, 3.0),
            },
        };
        let ramped = self.chance(if depth > 0.9 { 0.9 } else { 0.3 });
        SurfaceSettings {
            name: name.into(),
            shape,
            ramp_time: if ramped { self.random.scale(1e-4, 5e-3) } else { 0.0 },
            moving,
            spline: self.chance(0.25).then(|| self.spline()),
            patches: self
                .chance(0.2)
                .then(|| PatchSettings { around: 1 + self.random.below(6), along: 1 + self.random.below(2) }),
            ..SurfaceSettings::default()
        }
    }

    fn spline(&mut self) -> SplineSettings {
        SplineSettings {
            around: self.random.of(&[12, 24, 48]),
            along: self.random.of(&[2, 3, 5]),
            closure: self.random.of(&[Closure::Smooth, Closure::Smooth, Closure::FreeEnds]),
            interpolation: self.random.of(&[Interpolation::Spline, Interpolation::Spline, Interpolation::Facets]),
        }
    }

    fn coating(&mut self, gap: f64) -> CoatingSettings {
        let cut = self.feature(0.4, self.scheme != Scheme::MasslessBoundary);
        let cutting = cut.then(|| CuttingSettings {
            specific_energy: self.random.scale(1e7, 1e10),
            normal_ratio: self.random.scale(0.2, 3.0),
        });
        let material = |value: f64| if cut { 0.0 } else { value };
        CoatingSettings {
            thickness: gap * self.random.within(0.3, 3.0),
            modulus: material(self.random.scale(1e7, 1e10)),
            yield_stress: material(self.random.scale(1e5, 1e8)),
            hardening: material(self.random.of(&[0.0, 1e7, 1e9])),
            cells_around: self.random.of(&[60, 200, 720]),
            cells_along: self.random.of(&[1, 2, 4]),
            contact_width: (!cut).then_some(3e-3),
            cutting,
        }
    }

    /// Adds an elastic casing that carries the first surface, or all of them.
    fn ring(&mut self) {
        let rom = casing(self.random);
        let rings = rom.extras.grid.map_or(4, |grid| grid.around);
        let all = self.chance(if self.scheme == Scheme::MasslessBoundary { 0.1 } else { 0.5 });
        let coated = self.settings.contacts.iter().any(|contact| contact.coating.is_some());
        let count = if all && !coated { self.settings.surfaces.len() } else { 1 };
        for (surface, contact) in self.settings.surfaces.iter_mut().zip(&mut self.settings.contacts).take(count) {
            surface.structure = Some("ring".into());
            surface.spline = None;
            contact.meridian = Meridian::Contour;
        }
        let load = LoadSettings {
            order: u32::try_from(self.random.below(rings / 2)).unwrap_or(0),
            amplitude: self.random.scale(1.0, 1e4),
            phase: self.random.within(-3.0, 3.0),
        };
        let structure = StructureSettings {
            name: "ring".into(),
            rom: "ring".into(),
            motion: BodyMotion::Still,
            damping_ratio: self.chance(0.5).then(|| self.random.scale(1e-3, 0.1)),
            thermal: self.chance(0.35),
            load: self.chance(0.3).then_some(load),
            ..StructureSettings::default()
        };
        self.settings.structures.push(structure);
        self.roms.push(rom);
    }

    fn outputs(&mut self, flexible: bool, coated: bool) {
        let sectors = self.roms.iter().zip(&self.settings.structures);
        let rotors = sectors.filter(|(_, own)| own.motion == BodyMotion::Rotating);
        let (fewest, coupled) = rotors.fold((usize::MAX, false), |(fewest, coupled), (rom, _)| {
            (fewest.min(rom.sectors), coupled || rom.is_cyclic())
        });
        let diameters = self.chance(0.3).then(|| self.random.below(fewest / 2 + 1));
        let modal_amplitudes = self.feature(0.3, !coupled).then_some(1);
        let stress = self.feature(0.3, !coupled);
        let reaction = self.feature(if flexible { 0.3 } else { 0.0 }, self.scheme != Scheme::Galerkin);
        self.settings.outputs = OutputSettings {
            watched_sectors: if self.chance(0.8) || modal_amplitudes.is_some() || stress { vec![1] } else { vec![] },
            all_sectors: self.chance(0.3),
            nodal_diameters: diameters,
            energies: true,
            instantaneous_forces: self.chance(0.3),
            stress,
            modal_amplitudes,
            casing_forces: self.chance(0.3),
            support_reaction: reaction,
            wear: coated && self.chance(0.2),
            wear_profile: coated && self.chance(0.4),
            slave_displacement: flexible && self.chance(0.5),
            ..OutputSettings::default()
        };
        self.settings.outputs.tip_displacements = !self.settings.outputs.watched_sectors.is_empty() && self.chance(0.3);
    }
}
