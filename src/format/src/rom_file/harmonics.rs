//! Coupled sectors: three arrays per nodal diameter above 0, and the nodal diameter of every mode of the checks.

use std::collections::BTreeSet;

use nalgebra::{Complex, DMatrix};
use tiprub_core::Rom;
use tiprub_core::scene::rom::Harmonic;

use super::{Array, Arrays, RomReader, WRITE_AGAIN, list};
use crate::Result;
use crate::rom_layout::{HARMONIC_ARRAYS, NUMBER};

/// Returns the kind (as in [`HARMONIC_ARRAYS`]) and the nodal diameter of an array of coupled sectors; `None` for other
/// names. A number is written without sign and leading zeros, so that its text is unique.
pub(super) fn parts(name: &str) -> Option<(&'static str, usize)> {
    HARMONIC_ARRAYS.iter().find_map(|kind| {
        let digits = name.strip_prefix(kind.strip_suffix(NUMBER)?)?;
        let number: usize = digits.parse().ok()?;
        (number.to_string() == digits).then_some((*kind, number))
    })
}

fn array_name(kind: &str, number: usize) -> String {
    kind.replace(NUMBER, &number.to_string())
}

impl RomReader<'_> {
    /// Reads all nodal diameters 1 ..= sectors/2, or none.
    pub(super) fn harmonics(&self, arrays: &Arrays, sectors: usize, nodes: usize) -> Result<Vec<Harmonic>> {
        let numbers: BTreeSet<usize> = arrays.keys().filter_map(|name| Some(parts(name)?.1)).collect();
        let largest = sectors / 2;
        let Some(given) = arrays.keys().find(|name| parts(name).is_some()) else { return Ok(Vec::new()) };
        if let Some(number) = numbers.iter().find(|number| !(1..=largest).contains(*number)) {
            let held = arrays.keys().find(|name| parts(name).is_some_and(|(_, other)| other == *number));
            let problem = match largest {
                0 => format!("nodal diameter {number}, but {sectors} sector(s) have none above 0"),
                _ => format!(
                    "nodal diameter {number}, but {sectors} sectors allow numbered arrays for 1 to {largest} only"
                ),
            };
            let remedy = "Correct the number in the array name or metadata `sectors`; the arrays of nodal diameter 0 have no \
                 number";
            return Err(self.error(format!("array `{}`", held.unwrap_or(given)), problem, remedy));
        }
        for number in 1..=largest {
            let names = HARMONIC_ARRAYS.map(|kind| array_name(kind, number));
            if let Some(missing) = names.iter().find(|name| !arrays.contains_key(*name)) {
                let remedy = format!(
                    "Give `mass_<n>`, `stiffness_<n>` and `contact_map_<n>` for every n from 1 to {largest} (half of \
                     metadata `sectors`), or none of them"
                );
                let problem = format!("missing, although `{given}` is present");
                return Err(self.error(format!("array `{missing}`"), problem, remedy));
            }
        }
        (1..=largest).map(|number| self.harmonic(arrays, number, nodes)).collect()
    }

    fn harmonic(&self, arrays: &Arrays, number: usize, nodes: usize) -> Result<Harmonic> {
        let names = HARMONIC_ARRAYS.map(|kind| array_name(kind, number));
        let [mass, stiffness, map] = names.each_ref().map(|name| &arrays[name]);
        let order = mass.shape.first().copied().unwrap_or(0);
        let of_mass = format!("same shape as `{}`", names[0]);
        self.shape(&names[0], mass, &[order, order, 2], "square, real and imaginary parts")?;
        self.shape(&names[1], stiffness, &[order, order, 2], &of_mass)?;
        let reason = format!(
            "nodes as in `contact_positions`, 3 components, coordinates as in `{}`, real and imaginary parts",
            names[0]
        );
        self.shape(&names[2], map, &[nodes, 3, order, 2], &reason)?;
        Ok(Harmonic {
            mass: complex(order, order, &mass.values),
            stiffness: complex(order, order, &stiffness.values),
            contact_map: complex(3 * nodes, order, &map.values),
        })
    }

    /// Reads one integer per mode of the checks, only with coupled sectors.
    pub(super) fn nodal_diameters(&self, arrays: &Arrays, sectors: usize, uncoupled: bool) -> Result<Vec<u32>> {
        let name = "nodal_diameters";
        let values = self.check_values(arrays, name)?;
        if values.is_empty() {
            return Ok(Vec::new());
        }
        let what = format!("array `{name}`");
        if uncoupled {
            let remedy = "Remove it, or add the arrays of the nodal diameters";
            return Err(self.error(what, "given although the sectors are not coupled", remedy));
        }
        for other in ["full_frequencies", "reduced_frequencies", "frequency_deviation", "residual_criterion"] {
            let count = arrays.get(other).map_or(values.len(), |array| array.values.len());
            if count != values.len() {
                let problem = format!("found {} values, but {count} in `{other}`", values.len());
                return Err(self.error(what, problem, WRITE_AGAIN));
            }
        }
        let largest = u32::try_from(sectors / 2).unwrap_or(u32::MAX);
        values.iter().enumerate().map(|(index, value)| self.nodal_diameter(index, *value, largest)).collect()
    }

    fn nodal_diameter(&self, index: usize, value: f64, largest: u32) -> Result<u32> {
        if value.fract() == 0.0 && (0.0..=f64::from(largest)).contains(&value) {
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "whole and within 0..=largest"
            )]
            return Ok(value as u32);
        }
        let problem = format!("entry {index} is {value}, not a whole number from 0 to {largest}");
        Err(self.error("array `nodal_diameters`", problem, "Use nodal diameters up to half of metadata `sectors`"))
    }
}

/// Returns a matrix from row-major values, in which the real and the imaginary part of each entry are adjacent.
fn complex(rows: usize, columns: usize, values: &[f64]) -> DMatrix<Complex<f64>> {
    let (pairs, _) = values.as_chunks::<2>();
    DMatrix::from_row_iterator(rows, columns, pairs.iter().map(|[re, im]| Complex::new(*re, *im)))
}

fn parts_by_rows(matrix: &DMatrix<Complex<f64>>) -> Vec<f64> {
    matrix.transpose().iter().flat_map(|value| [value.re, value.im]).collect()
}

pub(super) fn arrays(rom: &Rom) -> Vec<(String, Array)> {
    let nodes = rom.contact_nodes.len();
    let mut arrays = Vec::new();
    for (harmonic, number) in rom.extras.harmonics.iter().zip(1..) {
        let columns = harmonic.contact_map.ncols();
        let matrices = [
            (&harmonic.mass, vec![harmonic.mass.nrows(), harmonic.mass.ncols(), 2]),
            (&harmonic.stiffness, vec![harmonic.stiffness.nrows(), harmonic.stiffness.ncols(), 2]),
            (&harmonic.contact_map, vec![nodes, 3, columns, 2]),
        ];
        for (kind, (matrix, shape)) in HARMONIC_ARRAYS.iter().zip(matrices) {
            arrays.push((array_name(kind, number), list(parts_by_rows(matrix), shape)));
        }
    }
    let diameters: Vec<f64> = rom.checks.nodal_diameters.iter().map(|number| f64::from(*number)).collect();
    if !diameters.is_empty() {
        let modes = diameters.len();
        arrays.push(("nodal_diameters".to_owned(), list(diameters, vec![modes])));
    }
    arrays
}
