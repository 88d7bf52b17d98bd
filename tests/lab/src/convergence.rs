//! Number of component modes that the reduced disk needs: frequency deviation (eq. 13) and residual convergence
//! criterion (eq. 12) of the lowest modes of the disk against the number of component modes, as in figs 9 and 10 of the
//! paper.

use serde_json::json;
use tiprub_figure::{
    plots::{Plot, Series, SeriesForm},
    waterfall::{Waterfall, WaterfallAxis},
};
use tiprub_model::cyclic::{ConvergenceRow, CyclicReduction, NodalDiameter};
use tiprub_packaging::rom_facts::{DEVIATION_LIMIT, RESIDUAL_LIMIT};
use tiprub_shell::Result;
use tiprub_study::{Picture, Sheet, Statement, Study, StudyFigure};

/// Upper limits of the paper's figures (%).
const DEVIATION_SHOWN: f64 = 3.0;
const RESIDUAL_SHOWN: f64 = 5.0;
/// Number of modes of the disk that the paper evaluates.
const MODES: usize = 56;
/// Changes of a frequency deviation below this are rounding of the eigenvalues (%).
const ROUNDING: f64 = 1e-6;

/// One of the two criteria.
struct Criterion {
    name: &'static str,
    title: &'static str,
    label: &'static str,
    limit: f64,
    shown: f64,
    values: fn(&ConvergenceRow) -> &[f64],
}

const CRITERIA: [Criterion; 2] = [
    Criterion {
        name: "deviation",
        title: "Frequency deviation (eq. 13)",
        label: "frequency deviation (%)",
        limit: DEVIATION_LIMIT,
        shown: DEVIATION_SHOWN,
        values: |row| &row.frequency_deviation,
    },
    Criterion {
        name: "residual",
        title: "Residual convergence criterion (eq. 12)",
        label: "residual criterion (%)",
        limit: RESIDUAL_LIMIT,
        shown: RESIDUAL_SHOWN,
        values: |row| &row.residual_criterion,
    },
];

impl Criterion {
    /// Returns the largest magnitude over the modes compared; infinite if one of them is unknown.
    fn worst(&self, row: &ConvergenceRow) -> f64 {
        let values = (self.values)(row);
        let known = values.len() >= MODES && values.iter().take(MODES).all(|value| !value.is_nan());
        let worst = values.iter().take(MODES).fold(0.0, |worst: f64, value| worst.max(value.abs()));
        if known { worst } else { f64::INFINITY }
    }

    /// Returns the smallest number of component modes per nodal diameter from which on the limit is met.
    fn enough<'a>(&self, rows: &'a [ConvergenceRow]) -> Option<&'a ConvergenceRow> {
        let good = rows.iter().rev().take_while(|row| self.worst(row) < self.limit);
        good.last()
    }

    fn waterfall(&self, rows: &[ConvergenceRow]) -> Waterfall {
        let curve = |row: &ConvergenceRow| {
            let modes = (self.values)(row).iter().take(MODES).zip(1_u32..);
            (row.total_modes as f64, modes.map(|(value, mode)| (f64::from(mode), value.abs())).collect())
        };
        Waterfall {
            x: WaterfallAxis::over("mode of the disk (-)", [1.0, MODES as f64].into_iter()),
            depth: WaterfallAxis::over("component modes (-)", rows.iter().map(|row| row.total_modes as f64)).reversed(),
            value: WaterfallAxis::over(self.label, [0.0, self.shown].into_iter()),
            curves: rows.iter().map(curve).collect(),
        }
    }

    fn sheet(&self, rows: &[ConvergenceRow]) -> Sheet {
        let mut sheet =
            Sheet::new(["component modes per nodal diameter", "component modes of the disk", "mode", self.label]);
        for row in rows {
            for (value, mode) in (self.values)(row).iter().take(MODES).zip(1_u32..) {
                sheet.rows.push(vec![row.modes as f64, row.total_modes as f64, f64::from(mode), *value]);
            }
        }
        sheet
    }

    fn figure(&self, rows: &[ConvergenceRow]) -> StudyFigure {
        StudyFigure {
            name: self.name,
            caption: format!(
                "{} of the {MODES} lowest modes of the disk against the number of component modes in the reduced model. \
                 Values above {} % are clipped, as in the paper's figure; the data file has the full values.",
                self.title, self.shown
            ),
            picture: Picture::waterfall(&self.waterfall(rows)),
            sheet: self.sheet(rows),
        }
    }

    fn statement(&self, rows: &[ConvergenceRow]) -> Statement {
        let last = rows.last().map_or(f64::NAN, |row| self.worst(row));
        let found = match self.enough(rows) {
            Some(row) => format!(
                "reached with {} or more per nodal diameter ({} component modes of the disk); at most {last:.2e} % \
                 with all of them",
                row.modes, row.total_modes
            ),
            None => format!("still {last:.3} % with the largest number of component modes"),
        };
        let expected =
            format!("each of the {MODES} lowest modes is below {} % with enough component modes", self.limit);
        Statement::tested(format!("{}: {expected}", self.title), self.enough(rows).is_some(), found)
    }
}

/// Returns the figure of both criteria, the largest value over the modes, which determines the number of component
/// modes.
fn worst_figure(rows: &[ConvergenceRow]) -> Result<StudyFigure> {
    let series = CRITERIA.iter().map(|criterion| {
        let points = rows.iter().map(|row| (row.modes as f64, criterion.worst(row)));
        Series::line(criterion.title, points.collect())
    });
    let limit = |criterion: &Criterion, color| {
        let ends = [rows.first(), rows.last()].into_iter().flatten().map(|row| (row.modes as f64, criterion.limit));
        Series::line(format!("limit {} %", criterion.limit), ends.collect()).drawn(SeriesForm::Thin, color)
    };
    let series = series.chain([limit(&CRITERIA[0], 0), limit(&CRITERIA[1], 1)]).collect();
    let plot = Plot {
        logarithmic: true,
        height: 320,
        ..Plot::new("component modes per nodal diameter (-)", "maximum over the modes (%)", series)
    };
    let mut sheet = Sheet::new([
        "component modes per nodal diameter",
        "component modes of the disk",
        CRITERIA[0].label,
        CRITERIA[1].label,
    ]);
    for row in rows {
        sheet.rows.push(vec![row.modes as f64, row.total_modes as f64, CRITERIA[0].worst(row), CRITERIA[1].worst(row)]);
    }
    Ok(StudyFigure {
        name: "worst",
        caption: format!("Maximum over the {MODES} lowest modes of the disk, with the limits."),
        picture: Picture::plot(&plot)?,
        sheet,
    })
}

/// Checks that modes occur in pairs: except those with n = 0 and n = N/2 every mode of a disk is double. `order` holds
/// the nodal diameters of the lowest modes, double ones twice.
fn pairs(rows: &[ConvergenceRow], order: &[usize], sectors: usize) -> Statement {
    let values =
        rows.last().map_or(&[][..], |row| &row.frequency_deviation[..row.frequency_deviation.len().min(MODES)]);
    let (mut alone, mut wrong, mut index) = (Vec::new(), 0, 0);
    while index < values.len().min(order.len()) {
        let number = order[index];
        let paired = values.get(index + 1).is_some_and(|next| next.to_bits() == values[index].to_bits());
        let single = number == 0 || 2 * number == sectors;
        // The end of the list may split a pair.
        wrong += usize::from(single == paired && index + 1 < values.len());
        if single {
            alone.push(number.to_string());
        }
        index += if single { 1 } else { 2 };
    }
    Statement::tested(
        format!(
            "Values occur in pairs because of the cyclic symmetry, except for the modes of nodal diameter 0{}",
            if sectors.is_multiple_of(2) { format!(" and {}", sectors / 2) } else { String::new() }
        ),
        values.len() == MODES && order.len() >= MODES && wrong == 0,
        format!(
            "{wrong} of {} modes violate this; {} modes are unpaired (nodal diameters {})",
            values.len(),
            alone.len(),
            alone.join(", ")
        ),
    )
}

/// Returns the nodal diameters of the lowest modes of the disk, double ones twice, in the order of the rows.
fn disk_order(diameters: &[NodalDiameter], sectors: usize) -> Vec<usize> {
    let copies = |number: usize| if number == 0 || 2 * number == sectors { 1 } else { 2 };
    let mut modes: Vec<(f64, usize)> = diameters
        .iter()
        .flat_map(|one| {
            let each = one.full_frequencies.iter().map(|frequency| (*frequency, one.number));
            each.flat_map(|mode| std::iter::repeat_n(mode, copies(one.number)))
        })
        .collect();
    modes.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    modes.into_iter().map(|mode| mode.1).take(MODES).collect()
}

/// Checks that a reduced model is stiffer than the full one, and less so with more component modes.
fn monotone(rows: &[ConvergenceRow]) -> Statement {
    let changes = rows.windows(2).flat_map(|pair| {
        let [few, many] = [&pair[0], &pair[1]].map(|row| &row.frequency_deviation);
        // A mode that the model cannot represent has an infinite deviation, and may keep it.
        few.iter()
            .zip(many)
            .take(MODES)
            .map(|(few, many)| if few.is_infinite() && many.is_infinite() { 0.0 } else { many - few })
            .collect::<Vec<_>>()
    });
    let worst = changes.fold(0.0, |worst: f64, rise| if rise.is_nan() { f64::NAN } else { worst.max(rise) });
    let values = rows.iter().flat_map(|row| row.frequency_deviation.iter().take(MODES));
    let lowest = values.copied().fold(f64::INFINITY, f64::min);
    Statement::tested(
        format!(
            "Frequencies decrease towards those of the full model as component modes are added: none rises, or falls \
             below the full model, by more than {ROUNDING:e} %"
        ),
        rows.len() > 1 && worst < ROUNDING && lowest > -ROUNDING,
        format!("largest rise between successive numbers of modes {worst:.1e} %, lowest deviation {lowest:.1e} %"),
    )
}

/// Creates the study of a reduction that took `seconds`.
///
/// # Errors
/// A plot that cannot be drawn.
pub(crate) fn study(reduction: &CyclicReduction, seconds: f64, quick: bool) -> Result<Study> {
    let rows = &reduction.convergence;
    let rom = &reduction.rom;
    let order = rom.order();
    let mut statements: Vec<Statement> = CRITERIA.iter().map(|criterion| criterion.statement(rows)).collect();
    let lowest = disk_order(&reduction.nodal_diameters, rom.sectors);
    statements.extend([pairs(rows, &lowest, rom.sectors), monotone(rows)]);
    statements.push(Statement::remark(
        "In the paper, RCC < 1 % for the 56 lowest modes with 56 or more component modes of the disk",
        match CRITERIA[1].enough(rows) {
            Some(row) => format!(
                "here with {} or more. The geometry, mesh and contact nodes of the paper's industrial disk are not \
                 published, so only the order of magnitude can be compared",
                row.total_modes
            ),
            None => "not reached here".into(),
        },
    ));
    let mut figures: Vec<StudyFigure> = CRITERIA.iter().map(|criterion| criterion.figure(rows)).collect();
    figures.push(worst_figure(rows)?);
    Ok(Study {
        name: "convergence",
        title: "Convergence of the reduced bladed disk".into(),
        summary: format!(
            "Craig-Bampton models of {} with increasing numbers of component modes, compared with the full \
             finite-element model.{}",
            rom.name,
            if quick { " Quick mode: a coarse mesh, for a first look only." } else { "" }
        ),
        facts: vec![
            ("model".into(), rom.origin.clone()),
            ("sectors".into(), rom.sectors.to_string()),
            ("free degrees of freedom of one sector".into(), reduction.free_dofs.to_string()),
            ("reduced coordinates per nodal diameter".into(), format!("{order} at nodal diameter 0")),
            ("degrees of freedom of the reduced disk".into(), rom.total_order().to_string()),
            ("largest angular frequency".into(), format!("{:.4e} rad/s", reduction.largest_angular_frequency)),
            ("time to reduce".into(), format!("{:.1} s", seconds)),
        ],
        statements,
        figures,
        results: json!({
            "enough": CRITERIA.iter().map(|criterion| (criterion.name.to_string(), match criterion.enough(rows) {
                Some(row) => json!({ "per_nodal_diameter": row.modes, "disk": row.total_modes }),
                None => json!(null),
            })).collect::<serde_json::Map<_, _>>(),
            "sectors": rom.sectors,
            "free_dofs_of_a_sector": reduction.free_dofs,
            "reduced_dofs": rom.total_order(),
            "seconds": seconds,
        }),
        files: Vec::new(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(modes: usize, deviation: f64) -> ConvergenceRow {
        // A single mode, then pairs, as in one family.
        let factor = |mode: usize| f64::from(u32::try_from(mode.div_ceil(2)).unwrap()) / 28.0;
        let values: Vec<f64> = (0..56).map(|mode| deviation * factor(mode)).collect();
        ConvergenceRow {
            modes,
            total_modes: 56 * modes,
            residual_criterion: values.iter().map(|value| 3.0 * value).collect(),
            frequency_deviation: values,
        }
    }

    fn rows() -> Vec<ConvergenceRow> {
        [(0, 40.0), (1, 0.2), (2, 0.5), (3, 0.25), (4, 0.1)].map(|(modes, deviation)| row(modes, deviation)).to_vec()
    }

    #[test]
    fn criterion_counts_only_if_satisfied_from_then_on() {
        let rows = rows();
        // A single component mode is accurate by chance: two are worse again.
        assert_eq!(CRITERIA[0].enough(&rows).unwrap().modes, 3);
        assert_eq!(CRITERIA[1].enough(&rows).unwrap().modes, 3);
        assert!(CRITERIA[0].enough(&rows[..3]).is_none());
        assert_eq!(CRITERIA[0].statement(&rows[..3]).holds, Some(false));
        // With fewer modes than required, or a NaN, "each of them" is false.
        let mut short = rows.clone();
        short[4].frequency_deviation.truncate(55);
        assert_eq!(CRITERIA[0].statement(&short).holds, Some(false));
        let mut unknown = rows;
        unknown[4].frequency_deviation[7] = f64::NAN;
        assert_eq!(CRITERIA[0].statement(&unknown).holds, Some(false));
    }

    #[test]
    fn detects_broken_mode_pairs_and_rising_errors() {
        let rows = rows();
        // One family of 56 blades: nodal diameters 0, 1, 1, 2, 2, ... 28.
        let order: Vec<usize> = (0..56_usize).map(|mode| mode.div_ceil(2)).collect();
        assert_eq!(pairs(&rows, &order, 56).holds, Some(true));
        assert_eq!(monotone(&rows).holds, Some(false));
        assert_eq!(monotone(&rows[2..]).holds, Some(true));
        // One broken pair, or one too many.
        for (mode, other) in [(3, 0.5), (0, 1.0 / 28.0)] {
            let mut rows = rows.clone();
            rows.last_mut().unwrap().frequency_deviation[mode] = other * 0.1;
            assert_eq!(pairs(&rows, &order, 56).holds, Some(false), "{mode}");
        }
        let mut below = rows[2..].to_vec();
        below[2].frequency_deviation[5] = -0.01;
        assert_eq!(monotone(&below).holds, Some(false));
    }

    #[test]
    fn figures_contain_the_data_they_show() {
        let rows = rows();
        let figure = CRITERIA[0].figure(&rows);
        assert_eq!(figure.sheet.rows.len(), 5 * 56);
        assert_eq!(figure.sheet.rows[56 + 55], [1.0, 56.0, 56.0, 0.2]);
        assert!(figure.picture.svg.contains("component modes (-)") && figure.picture.svg.contains(">3<"));
        let worst = worst_figure(&rows).unwrap();
        assert_eq!(worst.sheet.rows[4], [4.0, 224.0, 0.1, 0.1 * 3.0]);
        assert!(worst.picture.svg.contains("limit 0.3 %"), "the legend is in the file");
    }
}
