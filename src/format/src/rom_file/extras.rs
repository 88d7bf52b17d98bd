//! Optional data of a ROM: spin, heat, contact grid (coupled sectors: [`super::harmonics`]). A file without them has
//! the format of the first release.

use nalgebra::DMatrix;
use tiprub_core::scene::rom::{
    ContactGrid, ContactNode, ReductionBasis, RomExtras, STRESSES, SUPPORT_ROWS, Spin, SupportRows, Thermal,
    WatchedPoints,
};
use tiprub_cosim::ThermalPatch;

use super::{Array, Arrays, Metadata, RomReader, WRITE_AGAIN, list, matrix, names};
use crate::Result;
use crate::remedy::name_remedy;
use crate::rom_layout::{
    SPIN_ARRAYS, STRESS_ARRAYS, STRESS_CENTRIFUGAL, STRESS_THERMAL, SUPPORT_ARRAYS, SUPPORT_THERMAL, THERMAL_ARRAYS,
    WATCHED_ARRAYS,
};

/// Third word of a contact grid with free edges all around.
const OPEN: &str = "open";

/// Metadata entry of the rows of patches.
const ROWS: &str = "contact_rows";

/// Values of the metadata entry `basis`.
const BASES: [(&str, ReductionBasis); 2] =
    [("craig-bampton", ReductionBasis::FixedInterface), ("free-interface", ReductionBasis::FreeInterface)];

/// Returns the metadata entry of the names of points with this array of positions.
fn names_of(positions: &str) -> String {
    positions.replace("positions", "names")
}

impl RomReader<'_> {
    pub(super) fn extras(&self, arrays: &Arrays, metadata: &Metadata, order: usize) -> Result<RomExtras> {
        Ok(RomExtras {
            spin: self.spin(arrays, metadata, order)?,
            thermal: self.thermal(arrays, order)?,
            grid: self.grid(metadata)?,
            harmonics: Vec::new(),
            watched: self.watched((arrays, metadata), (&WATCHED_ARRAYS, 3), order)?,
            stress: self.watched((arrays, metadata), (&STRESS_ARRAYS, STRESSES), order)?,
            stress_thermal: self.static_stress(arrays, STRESS_THERMAL, true)?,
            stress_centrifugal: self.static_stress(arrays, STRESS_CENTRIFUGAL, false)?,
            support: self.support(arrays, order)?,
            basis: self.basis(metadata)?,
            rows: self.rows(metadata)?,
        })
    }

    fn rows(&self, metadata: &Metadata) -> Result<Option<usize>> {
        let Some(text) = metadata.get(ROWS) else { return Ok(None) };
        match text.trim().parse::<usize>() {
            Ok(rows) => Ok(Some(rows).filter(|rows| *rows != 1)),
            Err(_) => {
                Err(self.error(format!("metadata `{ROWS}`"), format!("{text:?} is not a whole number"), WRITE_AGAIN))
            }
        }
    }

    fn basis(&self, metadata: &Metadata) -> Result<ReductionBasis> {
        let Some(text) = metadata.get("basis") else { return Ok(ReductionBasis::default()) };
        match BASES.iter().find(|(name, _)| name == text) {
            Some((_, basis)) => Ok(*basis),
            None => {
                let remedy = name_remedy(text, &BASES.map(|(name, _)| name));
                Err(self.error("metadata `basis`", format!("unknown basis {text:?}"), remedy))
            }
        }
    }

    /// Reads watched points: an array with a fixed number of components per point, an array of positions, and an entry
    /// of names.
    fn watched(
        &self,
        (arrays, metadata): (&Arrays, &Metadata),
        (names, components): (&[&str; 2], usize),
        order: usize,
    ) -> Result<Option<WatchedPoints>> {
        let [map_name, positions_name] = *names;
        let entry = names_of(positions_name);
        if !self.group(arrays, names)? {
            if metadata.contains_key(&entry) {
                let problem = format!("given without the array `{map_name}`");
                return Err(self.error(format!("metadata `{entry}`"), problem, "Remove the entry, or add the arrays"));
            }
            return Ok(None);
        }
        let positions = self.required(arrays, positions_name, 2)?;
        let count = positions.shape[0];
        self.shape(positions_name, positions, &[count, 3], "three coordinates per point")?;
        let map = self.required(arrays, map_name, 3)?;
        let reason = format!("points as in `{positions_name}`, {components} components, coordinates as in `mass`");
        self.shape(map_name, map, &[count, components, order], &reason)?;
        let names = self.point_names(&entry, self.entry(metadata, &entry)?, count)?;
        let (triples, _) = positions.values.as_chunks::<3>();
        let points = names.into_iter().zip(triples);
        let points = points.map(|(name, position)| ContactNode { name, position: *position, ..ContactNode::default() });
        let map = DMatrix::from_row_slice(components * count, order, &map.values);
        Ok(Some(WatchedPoints { map, points: points.collect() }))
    }

    /// Returns whether the arrays of a group are present: all or none.
    fn group(&self, arrays: &Arrays, names: &[&str]) -> Result<bool> {
        let Some(given) = names.iter().find(|name| arrays.contains_key(**name)) else { return Ok(false) };
        match names.iter().find(|name| !arrays.contains_key(**name)) {
            None => Ok(true),
            Some(missing) => {
                let list = names.iter().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ");
                let problem = format!("missing, although `{given}` is present");
                Err(self.error(format!("array `{missing}`"), problem, format!("Give all of {list}, or none of them")))
            }
        }
    }

    fn spin(&self, arrays: &Arrays, metadata: &Metadata, order: usize) -> Result<Option<Spin>> {
        if !self.group(arrays, &SPIN_ARRAYS)? {
            if metadata.contains_key("largest_speed") {
                let problem = format!("given without the array `{}`", SPIN_ARRAYS[0]);
                let remedy = "Remove the entry, or add the spin arrays";
                return Err(self.error("metadata `largest_speed`", problem, remedy));
            }
            return Ok(None);
        }
        let square = |name: &str| {
            let array = self.required(arrays, name, 2)?;
            self.shape(name, array, &[order, order], "same shape as `mass`")?;
            Ok(DMatrix::from_row_slice(order, order, &array.values))
        };
        let load = |name: &str| {
            let array = self.required(arrays, name, 1)?;
            self.shape(name, array, &[order], "coordinates as in `mass`")?;
            Ok(array.values.clone())
        };
        Ok(Some(Spin {
            stiffness_speed2: square("stiffness_speed2")?,
            stiffness_speed4: square("stiffness_speed4")?,
            coriolis: square("coriolis")?,
            centrifugal_load: load("centrifugal_load")?,
            centrifugal_load_speed4: load("centrifugal_load_speed4")?,
            largest_speed: self.number(metadata, "largest_speed")?,
        }))
    }

    fn thermal(&self, arrays: &Arrays, order: usize) -> Result<Option<Thermal>> {
        if !self.group(arrays, &THERMAL_ARRAYS)? {
            return Ok(None);
        }
        let places = self.required(arrays, "thermal_patches", 2)?;
        let count = places.shape[0];
        self.shape("thermal_patches", places, &[count, 4], "two angles and two axial positions per patch")?;
        let loads = self.required(arrays, "thermal_loads", 2)?;
        let reason = "coordinates as in `mass`, patches as in `thermal_patches`";
        self.shape("thermal_loads", loads, &[order, count], reason)?;
        let (places, _) = places.values.as_chunks::<4>();
        let patch = |&[from, to, low, high]: &[f64; 4]| ThermalPatch { angle: [from, to], axial: [low, high] };
        let loads = DMatrix::from_row_slice(order, count, &loads.values);
        Ok(Some(Thermal { loads, patches: places.iter().map(patch).collect() }))
    }

    /// Reads the static stress of one load, or of `several`; the validation of the ROM compares its shape with that of
    /// other arrays.
    fn static_stress(&self, arrays: &Arrays, name: &str, several: bool) -> Result<Option<DMatrix<f64>>> {
        if !arrays.contains_key(name) {
            return Ok(None);
        }
        let array = self.required(arrays, name, if several { 3 } else { 2 })?;
        let (places, loads) = (array.shape[0], array.shape.get(2).copied());
        let expected: Vec<usize> = [places, STRESSES].into_iter().chain(loads).collect();
        self.shape(name, array, &expected, "six components per stress point")?;
        Ok(Some(DMatrix::from_row_slice(STRESSES * places, loads.unwrap_or(1), &array.values)))
    }

    fn support(&self, arrays: &Arrays, order: usize) -> Result<Option<SupportRows>> {
        if !self.group(arrays, &SUPPORT_ARRAYS)? {
            if arrays.contains_key(SUPPORT_THERMAL) {
                let problem = format!("given without the array `{}`", SUPPORT_ARRAYS[0]);
                let remedy = "Remove it, or add `support_stiffness` and `support_mass`";
                return Err(self.error(format!("array `{SUPPORT_THERMAL}`"), problem, remedy));
            }
            return Ok(None);
        }
        let rows = |name: &str, columns: usize, reason: &str| {
            let array = self.required(arrays, name, 2)?;
            self.shape(name, array, &[SUPPORT_ROWS, columns], reason)?;
            Ok(DMatrix::from_row_slice(SUPPORT_ROWS, columns, &array.values))
        };
        let patches = arrays.get("thermal_patches").map_or(0, |patches| patches.shape[0]);
        let reason = "three forces and three moments, coordinates as in `mass`";
        Ok(Some(SupportRows {
            stiffness: rows(SUPPORT_ARRAYS[0], order, reason)?,
            mass: rows(SUPPORT_ARRAYS[1], order, reason)?,
            thermal: match arrays.get(SUPPORT_THERMAL) {
                Some(_) => {
                    rows(SUPPORT_THERMAL, patches, "three forces and three moments, patches as in `thermal_patches`")?
                }
                None => DMatrix::zeros(SUPPORT_ROWS, patches),
            },
        }))
    }

    fn grid(&self, metadata: &Metadata) -> Result<Option<ContactGrid>> {
        let Some(text) = metadata.get("contact_grid") else { return Ok(None) };
        let words: Vec<&str> = text.split(',').map(str::trim).collect();
        let counts = words.get(..2).map(|counts| (counts[0].parse(), counts[1].parse()));
        let closed = match &words[..] {
            [_, _] => Some(true),
            [_, _, OPEN] => Some(false),
            _ => None,
        };
        let (Some((Ok(around), Ok(along))), Some(closed)) = (counts, closed) else {
            let problem =
                format!("{text:?} is not of the form `around,along` or `around,along,{OPEN}` with two whole numbers");
            return Err(self.error("metadata `contact_grid`", problem, WRITE_AGAIN));
        };
        Ok(Some(ContactGrid { around, along, closed }))
    }
}

pub(super) fn arrays(extras: &RomExtras) -> Vec<(&'static str, Array)> {
    let mut arrays = Vec::new();
    if let Some(spin) = &extras.spin {
        arrays.extend([
            ("stiffness_speed2", matrix(&spin.stiffness_speed2)),
            ("stiffness_speed4", matrix(&spin.stiffness_speed4)),
            ("coriolis", matrix(&spin.coriolis)),
            ("centrifugal_load", list(spin.centrifugal_load.clone(), vec![spin.centrifugal_load.len()])),
            (
                "centrifugal_load_speed4",
                list(spin.centrifugal_load_speed4.clone(), vec![spin.centrifugal_load_speed4.len()]),
            ),
        ]);
    }
    if let Some(thermal) = &extras.thermal {
        let places = thermal.patches.iter().flat_map(|patch| patch.angle.into_iter().chain(patch.axial)).collect();
        arrays.extend([
            ("thermal_loads", matrix(&thermal.loads)),
            ("thermal_patches", list(places, vec![thermal.patches.len(), 4])),
        ]);
    }
    for (watched, names) in [(&extras.watched, WATCHED_ARRAYS), (&extras.stress, STRESS_ARRAYS)] {
        let Some(watched) = watched else { continue };
        let (count, [map, positions]) = (watched.points.len(), names);
        let shape = vec![count, watched.map.nrows() / count, watched.map.ncols()];
        let places = watched.points.iter().flat_map(|point| point.position).collect();
        arrays.extend([(map, Array { shape, ..matrix(&watched.map) }), (positions, list(places, vec![count, 3]))]);
    }
    for (name, stress) in [(STRESS_THERMAL, &extras.stress_thermal), (STRESS_CENTRIFUGAL, &extras.stress_centrifugal)] {
        let Some(stress) = stress else { continue };
        let loads = (name == STRESS_THERMAL).then(|| stress.ncols());
        let shape = [stress.nrows() / STRESSES, STRESSES].into_iter().chain(loads).collect();
        arrays.push((name, Array { shape, ..matrix(stress) }));
    }
    if let Some(support) = &extras.support {
        let [stiffness, mass] = SUPPORT_ARRAYS;
        arrays.extend([(stiffness, matrix(&support.stiffness)), (mass, matrix(&support.mass))]);
        if support.thermal.ncols() > 0 {
            arrays.push((SUPPORT_THERMAL, matrix(&support.thermal)));
        }
    }
    arrays
}

pub(super) fn metadata(extras: &RomExtras) -> Vec<(&'static str, String)> {
    let speed = extras.spin.as_ref().map(|spin| ("largest_speed", spin.largest_speed.to_string()));
    let grid = extras.grid.map(|ContactGrid { around, along, closed }| {
        let edges = if closed { String::new() } else { format!(",{OPEN}") };
        ("contact_grid", format!("{around},{along}{edges}"))
    });
    let watched = extras.watched.as_ref().map(|watched| ("watched_names", names(&watched.points)));
    let entry = BASES.iter().find(|(_, basis)| *basis == extras.basis && extras.basis != ReductionBasis::default());
    let basis = entry.map(|(name, _)| ("basis", (*name).to_owned()));
    let rows = extras.rows.map(|rows| (ROWS, rows.to_string()));
    let stress = extras.stress.as_ref().map(|stress| ("stress_names", names(&stress.points)));
    speed.into_iter().chain(grid).chain(watched).chain(stress).chain(basis).chain(rows).collect()
}
