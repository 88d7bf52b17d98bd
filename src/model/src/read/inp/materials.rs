//! Isotropic elastic materials, with temperature-dependent tables.

use super::super::source::{SourceLine, number};
use super::lines::Card;
use crate::Result;
use crate::material::Material;

/// Table of values over temperature: one row, or several with ascending temperatures.
#[derive(Debug)]
struct TemperatureTable<const N: usize> {
    rows: Vec<([f64; N], Option<f64>)>,
    place: SourceLine,
}

/// Material as read, in the units of the file.
#[derive(Debug)]
pub(super) struct DeckMaterial {
    name: String,
    place: SourceLine,
    elastic: Option<TemperatureTable<2>>,
    density: Option<TemperatureTable<1>>,
    expansion: Option<TemperatureTable<1>>,
}

impl DeckMaterial {
    pub(super) fn new(card: &Card) -> Result<Self> {
        let name = card.required("NAME")?.to_owned();
        Ok(Self { name, place: card.place.clone(), elastic: None, density: None, expansion: None })
    }

    pub(super) fn name(&self) -> &str {
        &self.name
    }

    pub(crate) fn is_named(&self, name: &str) -> bool {
        self.name.eq_ignore_ascii_case(name)
    }

    /// Reads `*ELASTIC`, `*DENSITY` or `*EXPANSION` of this material.
    pub(super) fn read(&mut self, card: &Card) -> Result<()> {
        let kind = card.parameter("TYPE")?.map(str::to_uppercase);
        if kind.as_deref().is_some_and(|kind| !matches!(kind, "ISO" | "ISOTROPIC")) || card.has("DEPENDENCIES") {
            let (keyword, name) = (&card.keyword, &self.name);
            let problem = format!("*{keyword} of material `{name}` is anisotropic or depends on field variables");
            return Err(card.place.error(problem, "Use an isotropic material, or give the matrices of the model"));
        }
        match card.keyword.as_str() {
            "ELASTIC" => self.elastic = Some(TemperatureTable::read(card)?),
            "DENSITY" => self.density = Some(TemperatureTable::read(card)?),
            _ => self.expansion = Some(TemperatureTable::read(card)?),
        }
        Ok(())
    }

    /// Returns the material at a temperature; without a temperature, no property may be a table.
    pub(super) fn at(&self, temperature: Option<f64>) -> Result<Material> {
        let missing = |keyword: &str| {
            let problem = format!("material `{}` has no *{keyword}", self.name);
            self.place.error(problem, "Add it, or give the material on the command line")
        };
        let [young_modulus, poisson_ratio] =
            self.elastic.as_ref().ok_or_else(|| missing("ELASTIC"))?.at(temperature, &self.name)?;
        let [density] = self.density.as_ref().ok_or_else(|| missing("DENSITY"))?.at(temperature, &self.name)?;
        let [expansion] = self.expansion.as_ref().map_or(Ok([0.0]), |table| table.at(temperature, &self.name))?;
        Ok(Material { name: self.name.clone(), young_modulus, poisson_ratio, density, expansion })
    }
}

impl<const N: usize> TemperatureTable<N> {
    fn read(card: &Card) -> Result<Self> {
        let mut rows = Vec::new();
        for line in &card.data {
            let values: Option<Vec<f64>> = line.values().map(number).collect();
            let values = values.filter(|values| (N..=N + 1).contains(&values.len())).ok_or_else(|| {
                let wanted = if N == 2 { "E, ν" } else { "VALUE" };
                let problem = format!("`{}` is neither {wanted} nor {wanted}, TEMPERATURE", line.text);
                line.place.error(problem, "Correct the line")
            })?;
            rows.push((core::array::from_fn(|i| values[i]), values.get(N).copied()));
        }
        let ascending = rows.windows(2).all(|pair| matches!((pair[0].1, pair[1].1), (Some(a), Some(b)) if a < b));
        if rows.is_empty() || !ascending {
            let problem = format!("*{} needs one line, or several with ascending temperatures", card.keyword);
            return Err(card.place.error(problem, "Correct the lines below the keyword"));
        }
        Ok(Self { rows, place: card.place.clone() })
    }

    /// Interpolates linearly between the rows, with constant values beyond them.
    fn at(&self, temperature: Option<f64>, material: &str) -> Result<[f64; N]> {
        if let [(values, _)] = self.rows.as_slice() {
            return Ok(*values);
        }
        let Some(temperature) = temperature else {
            let problem = format!("material `{material}` depends on temperature ({} lines)", self.rows.len());
            return Err(self.place.error(problem, "Give the temperature with --temperature, in the unit of the file"));
        };
        let value = |index: usize| (self.rows[index].0, self.rows[index].1.unwrap_or(0.0));
        let above = self.rows.iter().position(|(_, row)| row.is_some_and(|row| row >= temperature));
        Ok(match above {
            Some(0) => value(0).0,
            None => value(self.rows.len() - 1).0,
            Some(above) => {
                let ((low, t_low), (high, t_high)) = (value(above - 1), value(above));
                let share = (temperature - t_low) / (t_high - t_low);
                core::array::from_fn(|i| low[i] + share * (high[i] - low[i]))
            }
        })
    }
}
