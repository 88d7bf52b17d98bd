//! Presents total errors as a picture, tables, files and statements.

use serde_json::{Value, json};
use tiprub_figure::table::Table;
use tiprub_shell::recording::shortest;

use super::{
    chart::{ErrorChart, Points, front},
    competitor::{Competitor, PAPER},
    ranking::seconds,
    sheets::{STEP, step_name},
    total::{SceneModel, Total, TotalRow},
};
use crate::{Picture, Sheet, Statement, StudyFigure, estimate};

/// Target errors.
pub const TARGETS: [f64; 3] = [1e-1, 1e-2, 1e-3];

impl Total {
    /// Returns the name of errors against the reference: they are total if modes, contact points and their rows take part.
    pub fn name(&self) -> String {
        let points = if self.touching == "nodes" { "contact nodes" } else { self.touching };
        let rows = self.finer[2] && self.touching != "nodes";
        let all = [("modes", self.finer[0]), (points, self.finer[1]), ("rows", rows)];
        let parts: Vec<&str> = all.iter().filter(|(_, finer)| *finer).map(|(name, _)| *name).collect();
        match parts.as_slice() {
            _ if self.is_total() => "total error".into(),
            [] => "error of the steps alone".into(),
            [one] => format!("error of steps and {one}"),
            [first, second, ..] => format!("error of steps, {first} and {second}"),
        }
    }

    /// Returns whether the error contains all discretisation errors of the model except that of the mesh.
    pub fn is_total(&self) -> bool {
        self.finer == [true; 3]
    }

    /// Returns the name of the errors for files and results.
    pub fn key(&self) -> &'static str {
        if self.is_total() { "total" } else { "own_model" }
    }

    /// Returns the directions in which the reference is finer than the scene, and the others; nodes have no rows.
    pub fn directions(&self) -> [Vec<&'static str>; 2] {
        let [modes, points, rows] = self.finer;
        let all =
            [("steps", true), ("modes", modes), (self.touching, points), ("rows", rows), ("mesh", self.mesh.is_ok())];
        let all = all.iter().filter(|(name, _)| *name != "rows" || self.touching != "nodes");
        [true, false].map(|which| all.clone().filter(|(_, finer)| *finer == which).map(|(name, _)| *name).collect())
    }

    /// Describes these directions.
    pub fn scope(&self) -> String {
        let [refined, not] = self.directions().map(|all| all.join(", "));
        if not.is_empty() { format!("refined: {refined}") } else { format!("refined: {refined}; not refined: {not}") }
    }

    /// Returns the settings that ran, with time (s) and error.
    fn ran(&self) -> impl Iterator<Item = (&TotalRow, f64, f64)> {
        self.rows.iter().filter_map(|row| row.outcome.as_ref().ok().map(|(seconds, error)| (row, *seconds, *error)))
    }

    /// Returns the fastest setting with at most this error.
    pub fn cheapest(&self, error: f64, only: Option<Competitor>) -> Option<(&TotalRow, f64, f64)> {
        let good = self.ran().filter(|(row, _, own)| *own <= error && only.is_none_or(|only| row.competitor == only));
        good.min_by(|a, b| a.1.total_cmp(&b.1))
    }

    /// Formats a setting, such as "5 patches, 40 modes, modal-exact + lcp, h = 1.000 µs".
    fn setting(&self, row: &TotalRow) -> String {
        let model = &self.models[row.model];
        let (tip, modes) = (model.tip(self.touching), model.modes);
        format!("{tip}, {modes} modes, {}, {}", row.competitor.name(), row.competitor.setting(row.step))
    }

    /// Returns whether an error is too small to be distinguished from that of the reference.
    fn hidden(&self, error: f64) -> bool {
        self.readable.is_some_and(|least| error < least)
    }

    /// Formats an error together with that of the mesh.
    fn with_mesh(&self, error: f64) -> String {
        self.mesh.as_ref().map_or("unknown".into(), |mesh| format!("{:.1e}", error + mesh))
    }

    fn winners(&self, title: &str) -> Table {
        let name = self.name();
        let columns = [name.as_str(), "cheapest setting", "time", "error", "error with mesh", "the paper's method"];
        let mut table = Table::new(format!("{title}: cheapest setting by {} ({})", self.name(), self.scope()), columns);
        for target in TARGETS {
            let paper = self.cheapest(target, Some(PAPER));
            let paper = paper.map_or("not reached".into(), |(_, time, _)| seconds(time));
            let cells = match self.cheapest(target, None) {
                _ if self.hidden(target) => vec!["not measurable: the reference is not accurate enough".into()],
                None => vec!["none".into()],
                Some((row, time, error)) => {
                    vec![self.setting(row), seconds(time), format!("{error:.1e}"), self.with_mesh(error), paper]
                }
            };
            let mut cells: Vec<String> = std::iter::once(format!("{target:.0e}")).chain(cells).collect();
            cells.resize(columns.len(), String::new());
            table.rows.push(cells);
        }
        table
    }

    /// Tabulates the settings that no other setting beats in both time and error.
    fn best(&self, title: &str) -> Table {
        let points: Vec<(f64, f64)> = self.ran().map(|(_, time, error)| (time, error)).collect();
        let mut table = Table::new(
            format!("{title}: Pareto-optimal settings for time and {}", self.name()),
            ["setting", "time", self.name().as_str()],
        );
        for (time, error) in front(&points) {
            let row = self.ran().find(|(_, own_time, own_error)| (*own_time, *own_error) == (time, error));
            table.rows.extend(row.map(|(row, ..)| vec![self.setting(row), seconds(time), format!("{error:.2e}")]));
        }
        table
    }

    fn all(&self, title: &str) -> Table {
        let mut table =
            Table::new(format!("{title}: all settings"), ["setting", "time", self.name().as_str(), "remark"]);
        for row in &self.rows {
            let own = if row.own { "the scene as it stands" } else { "" };
            table.rows.push(match &row.outcome {
                Ok((time, error)) => vec![self.setting(row), seconds(*time), format!("{error:.2e}"), own.into()],
                Err(why) => vec![self.setting(row), String::new(), String::new(), why.clone()],
            });
        }
        table
    }

    fn chart(&self) -> ErrorChart {
        let mut all: Vec<Points> = Vec::new();
        for (row, time, error) in self.ran() {
            match all.iter_mut().find(|points| points.competitor == row.competitor) {
                Some(points) => points.points.push((time, error)),
                None => all.push(Points { competitor: row.competitor, points: vec![(time, error)] }),
            }
        }
        ErrorChart {
            error_label: format!("{}, displacements (relative L2)", self.name()),
            all,
            joined: false,
            readable: self.readable.map(|least| (least, "accuracy of the reference".into())),
        }
    }

    fn sheet(&self) -> Sheet {
        let own = "setting of the scene (1 yes)";
        let mut sheet = Sheet::new(["time (s)", self.name().as_str(), "points", "rows", "modes", STEP, own]);
        for (row, time, error) in self.ran() {
            let (model, own) = (&self.models[row.model], f64::from(u8::from(row.own)));
            let [points, rows, modes] = [model.points, model.rows, model.modes].map(|count| count as f64);
            sheet.rows.push(vec![time, error, points, rows, modes, row.step, own]);
        }
        sheet
    }

    /// Returns the picture and the tables.
    pub fn figure(&self, title: &str) -> StudyFigure {
        let chart = self.chart();
        let mut html = chart.to_svg();
        html.push_str(&self.winners(title).to_html(false));
        html.push_str(&self.best(title).to_html(false));
        html.push_str(&self.all(title).to_html(true));
        let mesh = match &self.mesh {
            Ok(mesh) => format!("The mesh adds an error of {mesh:.1e} to every setting"),
            Err(why) => format!("The mesh error is not included ({why})"),
        };
        StudyFigure {
            name: if self.is_total() { "scene-total" } else { "scene-own-model" },
            caption: format!(
                "{title}: {} (displacements) with other steps, schemes and numbers of {}{} and modes, against {}; {}. \
                 {mesh}.",
                self.name(),
                self.touching,
                if self.touching == "nodes" { "" } else { ", rows" },
                self.truth,
                self.scope()
            ),
            picture: Picture { svg: chart.to_svg(), html },
            sheet: self.sheet(),
        }
    }

    /// Returns the results in words.
    pub fn statements(&self, title: &str) -> Vec<Statement> {
        let mut all = Vec::new();
        if let Some((row, time, error)) = self.ran().find(|(row, ..)| row.own) {
            let found = format!("{error:.1e}, stepping time {} ({})", seconds(time), self.setting(row));
            all.push(Statement::remark(
                format!("{title}: {} of the scene as it stands ({})", self.name(), self.scope()),
                found,
            ));
        }
        if let Some(reported) = estimate::rom_errors_text(&self.of_rom) {
            all.push(Statement::remark(format!("{title}: errors stored in the ROM"), reported));
        }
        for target in TARGETS {
            let found = match self.cheapest(target, None) {
                _ if self.hidden(target) => {
                    format!(
                        "not measurable: the last refinement changed the reference by {:.1e}",
                        self.readable.unwrap_or(0.0)
                    )
                }
                None => "none".into(),
                Some((row, time, error)) => format!("{}: {}, error {error:.1e}", seconds(time), self.setting(row)),
            };
            all.push(Statement::remark(
                format!("{title}: cheapest setting, {} at most {target:.0e} ({})", self.name(), self.scope()),
                found,
            ));
        }
        let found = match &self.mesh {
            Ok(mesh) => {
                format!("{mesh:.1e} of the displacements; only a reduction with a finer mesh makes it smaller")
            }
            Err(why) => format!("unknown: {why}"),
        };
        all.push(Statement::remark(format!("{title}: mesh error"), found));
        all.push(Statement::remark(format!("{title}: reference for these errors"), self.truth.clone()));
        all
    }

    /// Returns every setting as comma-separated values; rejections with their reason.
    pub fn csv(&self) -> String {
        let mut text = format!("competitor,{},rows,modes,{STEP},time (s),{},remark\n", self.touching, self.name());
        for row in &self.rows {
            let model = &self.models[row.model];
            let SceneModel { points, rows, modes, .. } = model;
            let start = format!("\"{}\",{points},{rows},{modes},{}", row.competitor.name(), shortest(row.step));
            text.push_str(&match &row.outcome {
                Ok((time, error)) => format!("{start},{time:.4e},{error:.4e},\n"),
                Err(why) => format!("{start},,,\"{}\"\n", why.replace('"', "'")),
            });
        }
        text
    }

    /// Returns the cheapest setting for a target as comma-separated values.
    fn cheapest_row(&self, target: f64) -> String {
        let Some((row, time, error)) = self.cheapest(target, None).filter(|_| !self.hidden(target)) else {
            return format!("{},{target:e},,,,,,,\n", self.key());
        };
        let (SceneModel { points, rows, modes, .. }, name) = (&self.models[row.model], row.competitor.name());
        let key = self.key();
        format!("{key},{target:e},\"{name}\",{points},{rows},{modes},{},{time:.4e},{error:.4e}\n", shortest(row.step))
    }

    /// Returns the results as JSON.
    pub fn to_json(&self) -> Value {
        let error_name = if self.is_total() { "total_error" } else { "error" };
        let [refined, not_refined] = self.directions();
        let row = |row: &TotalRow| {
            let model = &self.models[row.model];
            let (time, error) = row.outcome.as_ref().map_or((None, None), |(time, error)| (Some(time), Some(error)));
            json!({
                "competitor": row.competitor.name(), self.touching: model.points, "rows": model.rows, "modes": model.modes, step_name(row.competitor): row.step,
                "own": row.own, "seconds": time, error_name: error, "refused": row.outcome.as_ref().err(),
            })
        };
        let cheapest = |target: f64| {
            let found = self.cheapest(target, None).filter(|_| !self.hidden(target));
            json!({ "error": target, "setting": found.map(|(found, ..)| row(found)) })
        };
        json!({
            "what": self.name(), "refined": refined, "not_refined": not_refined, "estimates_of_rom": estimate::json_of(&self.of_rom),
            "truth": self.truth, "readable": self.readable, "mesh": self.mesh.as_ref().ok(), "mesh_unknown": self.mesh.as_ref().err(),
            "cheapest": TARGETS.map(cheapest), "rows": self.rows.iter().map(row).collect::<Vec<_>>(),
        })
    }
}

/// Returns the cheapest settings for errors of the steps, in the form of [`super::sheets::to_json`], and for errors against the reference of
/// `total`.
pub fn cheapest_csv(of_steps: &[Value], total: &Total) -> String {
    let mut text = format!("error of,at most,competitor,{},rows,modes,{STEP},time (s),error\n", total.touching);
    for row in of_steps {
        let number = |name: &str| row[name].as_f64().map_or_else(String::new, shortest);
        let name = row["competitor"].as_str().map_or_else(String::new, |name| format!("\"{name}\""));
        let own = total.models.iter().find(|model| model.own).filter(|_| !name.is_empty());
        let [points, rows, modes] = own.map_or([String::new(), String::new(), String::new()], |own| {
            [own.points, own.rows, own.modes].map(|n| n.to_string())
        });
        let [target, time, error] = ["error", "seconds", "error_of_steps"].map(number);
        let step = ["internal_step", "tolerance"].map(number).concat();
        text.push_str(&format!("steps,{target},{name},{points},{rows},{modes},{step},{time},{error}\n"));
    }
    text + &TARGETS.map(|target| total.cheapest_row(target)).concat()
}
