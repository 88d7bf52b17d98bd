//! Plausibility of a model: size, stiffness and density compared with real structures.

use crate::fe_model::FeModel;
use crate::material::Material;

/// Signs of wrong units in a model.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Plausibility {
    /// Impossible values.
    pub impossible: Vec<String>,
    /// Unusual values.
    pub doubtful: Vec<String>,
}

/// Usual range of a quantity, and a wider range of possible values.
struct PlausibleRange {
    what: &'static str,
    unit: &'static str,
    usual: [f64; 2],
    possible: [f64; 2],
}

/// From the blade of a small turbocharger to the casing of a large water turbine.
const SIZE: PlausibleRange =
    PlausibleRange { what: "largest dimension", unit: "m", usual: [2e-3, 8.0], possible: [1e-4, 20.0] };
/// From rubber (1 MPa) to beyond diamond (1.2 TPa), including metals and composites.
const MODULUS: PlausibleRange =
    PlausibleRange { what: "Young's modulus", unit: "Pa", usual: [1e8, 2e12], possible: [1e6, 1e13] };
/// From foams to osmium (22600 kg/m³).
const DENSITY: PlausibleRange =
    PlausibleRange { what: "density", unit: "kg/m³", usual: [100.0, 23_000.0], possible: [1.0, 1e5] };
/// √(E/ρ): about 5000 m/s for steel, titanium, nickel and aluminium.
const WAVE: PlausibleRange =
    PlausibleRange { what: "√(E/ρ)", unit: "m/s", usual: [500.0, 20_000.0], possible: [1.0, 1e6] };
/// Mass over the volume of the bounding box; thin structures fill little of it.
const FILLING: PlausibleRange = PlausibleRange {
    what: "mass per volume of the bounding box",
    unit: "kg/m³",
    usual: [0.1, 23_000.0],
    possible: [1e-6, 1e5],
};

impl Plausibility {
    fn check(&mut self, range: &PlausibleRange, value: f64, whose: &str) {
        let PlausibleRange { what, unit, usual, possible } = range;
        let outside = |[low, high]: &[f64; 2]| !(value >= *low && value <= *high);
        let text = format!("{whose}{what} {value:.3e} {unit}");
        if outside(possible) {
            self.impossible.push(text);
        } else if outside(usual) {
            self.doubtful.push(text);
        }
    }
}

/// Returns the total mass (kg) of a model: that of a rigid motion along x.
pub fn total_mass(model: &FeModel) -> f64 {
    let pattern = &model.mass.pattern;
    let entries = (0..model.nodes.len()).map(|node| 3 * node).flat_map(|column| {
        (pattern.starts[column]..pattern.starts[column + 1]).filter(|&entry| pattern.rows[entry].is_multiple_of(3))
    });
    entries.map(|entry| model.mass.values[entry]).sum()
}

/// Returns the lowest and highest coordinates (m).
pub fn bounding_box(nodes: &[[f64; 3]]) -> [[f64; 3]; 2] {
    nodes.iter().fold([[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]], |[low, high], node| {
        [core::array::from_fn(|i| low[i].min(node[i])), core::array::from_fn(|i| high[i].max(node[i]))]
    })
}

/// Looks for signs that the units of a model and its materials are wrong.
pub fn plausibility(model: &FeModel, materials: &[Material]) -> Plausibility {
    let mut found = Plausibility::default();
    let [low, high] = bounding_box(&model.nodes);
    let sides: [f64; 3] = core::array::from_fn(|i| high[i] - low[i]);
    found.check(&SIZE, sides.iter().copied().fold(0.0, f64::max), "");
    for material in materials {
        let whose = format!("material `{}`: ", material.name);
        found.check(&MODULUS, material.young_modulus, &whose);
        found.check(&DENSITY, material.density, &whose);
        found.check(&WAVE, (material.young_modulus / material.density).sqrt(), &whose);
    }
    if materials.is_empty() && sides.iter().all(|&side| side > 0.0) {
        found.check(&FILLING, total_mass(model) / sides.iter().product::<f64>(), "");
    }
    found
}
