//! Reduced-order model of heat conduction, as plain data.

use nalgebra::DMatrix;
use tiprub_cosim::ThermalPatch;
use tiprub_cosim::bounds;
use tiprub_cosim::shown;
use tiprub_cosim::{Error, Result};

/// Largest number of coordinates: their eigenvalue problem is dense, and solved again when a convection factor
/// changes.
pub const LARGEST_ORDER: usize = 1000;
/// Tolerance of the symmetry of matrices and of the conservation of heat by conduction, as a fraction of their
/// largest entry.
const ROUNDING: f64 = 1e-9;

/// Coordinates x with T = V x at the nodes of a mesh and Vᵀ C V = I, C the heat capacity: ẋ + (K + s_g H_g + s_a H_a)
/// x = loads.
///
/// The first coordinate is the uniform temperature, x₁ = √C T with the total heat capacity C, so that heat is
/// conserved regardless of the truncation of the other coordinates: the stored heat is √C x₁.
#[derive(Debug, Clone, PartialEq)]
pub struct ConductionModel {
    /// Name.
    pub name: String,
    /// Origin of the model, as text.
    pub origin: String,
    /// Heat capacity C (J/K).
    pub heat_capacity: f64,
    /// K, coordinates × coordinates (1/s); its first row and column are zero.
    pub conduction: DMatrix<f64>,
    /// H_g of the gas inside, coordinates × coordinates (1/s).
    pub gas_convection: DMatrix<f64>,
    /// H_a of the air outside, coordinates × coordinates (1/s).
    pub ambient_convection: DMatrix<f64>,
    /// Heating of the coordinates by one watt into each patch, coordinates × patches (√(K/J)), distributed evenly
    /// over the heated surface of the patch. The transpose gives the mean temperature there.
    pub heat_loads: DMatrix<f64>,
    /// Mean temperature of the volume of each patch, patches × coordinates (√(K/J)).
    pub patch_means: DMatrix<f64>,
    /// Mean temperatures of the surfaces in the gas and in the air, 2 × coordinates.
    pub wetted_means: DMatrix<f64>,
    /// Temperatures of places on the heated surface, places × coordinates.
    pub places: DMatrix<f64>,
    /// Patches, identical with those of the mechanical model.
    pub patches: Vec<ThermalPatch>,
    /// Diffusion time of the elements under the heated surface (s): their largest depth squared over the diffusivity.
    /// Shorter transients occur within one element, which does not resolve them.
    pub element_time: f64,
}

impl ConductionModel {
    /// Returns the number of coordinates.
    ///
    /// # Examples
    /// ```
    /// # let model = tiprub_test_models::wall();
    /// println!("{} coordinates", model.order());
    /// # Ok::<(), tiprub_cosim::Error>(())
    /// ```
    pub fn order(&self) -> usize {
        self.conduction.nrows()
    }

    /// Returns h A of the gas at a factor of 1 (W/K): xᵀ H_g x of the uniform temperature of 1 K.
    ///
    /// # Examples
    /// ```
    /// # let model = tiprub_test_models::wall();
    /// // A wall of 50 J/K with a film of 0.02 1/s.
    /// assert!((model.gas_conductance() - 1.0).abs() < 1e-12);
    /// # Ok::<(), tiprub_cosim::Error>(())
    /// ```
    pub fn gas_conductance(&self) -> f64 {
        self.heat_capacity * self.gas_convection[(0, 0)]
    }

    /// Returns h A of the air at a factor of 1 (W/K).
    ///
    /// # Examples
    /// ```
    /// # let model = tiprub_test_models::wall();
    /// assert!(model.ambient_conductance() < model.gas_conductance());
    /// # Ok::<(), tiprub_cosim::Error>(())
    /// ```
    pub fn ambient_conductance(&self) -> f64 {
        self.heat_capacity * self.ambient_convection[(0, 0)]
    }

    /// Checks the sizes and the properties that the simulation relies on.
    ///
    /// # Examples
    /// ```
    /// # let model = tiprub_test_models::wall();
    /// model.validate()?;
    /// let broken = tiprub_thermal::ConductionModel { heat_capacity: -1.0, ..model };
    /// assert!(broken.validate().is_err());
    /// # Ok::<(), tiprub_cosim::Error>(())
    /// ```
    ///
    /// # Errors
    /// [`Error::Invalid`] with the array.
    pub fn validate(&self) -> Result<()> {
        let (order, patches) = (self.order(), self.patches.len());
        if order == 0 || order > LARGEST_ORDER {
            return refuse("conduction", format!("{order} coordinates, but only 1 to {LARGEST_ORDER} are supported"));
        }
        if patches == 0 || patches > bounds::PATCHES {
            return refuse("patches", format!("{patches} patches, but only 1 to {} are supported", bounds::PATCHES));
        }
        if !(self.heat_capacity.is_finite() && self.heat_capacity > 0.0) {
            return refuse("heat_capacity", format!("{} J/K is not positive", shown(self.heat_capacity)));
        }
        if !(self.element_time.is_finite() && self.element_time > 0.0) {
            return refuse("element_time", format!("{} s is not positive", shown(self.element_time)));
        }
        for (name, array, shape) in [
            ("conduction", &self.conduction, (order, order)),
            ("gas_convection", &self.gas_convection, (order, order)),
            ("ambient_convection", &self.ambient_convection, (order, order)),
            ("heat_loads", &self.heat_loads, (order, patches)),
            ("patch_means", &self.patch_means, (patches, order)),
            ("wetted_means", &self.wetted_means, (2, order)),
            ("places", &self.places, (self.places.nrows(), order)),
        ] {
            if array.shape() != shape {
                return refuse(name, format!("found shape {:?}, expected {shape:?}", array.shape()));
            }
            if let Some(wrong) = array.iter().find(|value| value.is_nan() || value.abs() > bounds::MATRIX) {
                return refuse(name, format!("it contains {wrong}"));
            }
        }
        if self.places.nrows() == 0 {
            return refuse("places", "the array is empty".into());
        }
        self.validate_physics()
    }

    /// Checks symmetry, signs, and that heat is conserved.
    fn validate_physics(&self) -> Result<()> {
        for (name, matrix) in [
            ("conduction", &self.conduction),
            ("gas_convection", &self.gas_convection),
            ("ambient_convection", &self.ambient_convection),
        ] {
            let slack = ROUNDING * matrix.amax();
            if (matrix - matrix.transpose()).amax() > slack {
                return refuse(name, "it is not symmetric".into());
            }
            let lowest = matrix.symmetric_eigenvalues().min();
            if lowest < -slack {
                let problem =
                    format!("it has the negative eigenvalue {}: heat would flow from cold to hot", shown(lowest));
                return refuse(name, problem);
            }
        }
        if self.conduction.row(0).amax() > 0.0 || self.conduction.column(0).amax() > 0.0 {
            return refuse(
                "conduction",
                "its first row and column are not zero: a uniform temperature would not be steady".into(),
            );
        }
        let share = 1.0 / self.heat_capacity.sqrt();
        if self.heat_loads.row(0).iter().any(|load| (load - share).abs() > ROUNDING * share) {
            return refuse(
                "heat_loads",
                "heat is not conserved: 1 W into a patch does not heat the whole model by 1 W (first row)".into(),
            );
        }
        let uniform = [&self.patch_means, &self.wetted_means, &self.places];
        if uniform
            .iter()
            .flat_map(|rows| rows.column(0).iter().copied().collect::<Vec<_>>())
            .any(|value| (value - share).abs() > ROUNDING * share)
        {
            return refuse(
                "patch_means",
                "the mean of a uniform temperature differs from that temperature (first column)".into(),
            );
        }
        Ok(())
    }
}

fn refuse(name: &str, problem: String) -> Result<()> {
    Err(Error::invalid(format!("thermal model, `{name}`"), problem, "Write the model again with `tiprub thermal`"))
}
