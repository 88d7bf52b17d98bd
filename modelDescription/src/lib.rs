//! Writes the variable table as `modelDescription.xml` of FMI 2.0 and FMI 3.0, and as an HTML page.
//!
//! This crate makes no decisions about variables: names, references, units, causality and start values come from the [`VariableTable`], which the
//! FMU's get and set functions use as well.
#![warn(unreachable_pub)]
#![forbid(unsafe_code)]

mod element;
mod extras;
mod fmi2;
mod fmi3;
mod html;
mod row;
mod shared;
mod text;

use tiprub_core::{Rom, VariableTable};

pub use extras::{fmi3_terminals, references_manifest};
pub use fmi2::fmi2_xml;
pub use fmi3::fmi3_xml;
pub use html::html;
pub use row::meaning_of_span;
pub use shared::LOG_CATEGORIES;

/// Content of a model description. Equal descriptions give equal text.
#[derive(Debug, Clone)]
pub struct Description<'a> {
    /// Name of the model.
    pub model_name: &'a str,
    /// Model identifier: the file name of the library without its extension.
    pub identifier: &'a str,
    /// Instantiation token (FMI 2.0: GUID) that the library computes from the resources.
    pub token: &'a str,
    /// Description in one or a few sentences, for the catalogue of an importer.
    pub description: &'a str,
    /// Purpose and use of the unit, for the page.
    pub about: &'a str,
    /// Text about communication steps, for the page.
    pub steps: &'a str,
    /// Generation date as `xs:dateTime`, for example `2026-01-31T12:00:00Z`. The caller chooses it, so that equal input can give equal files.
    pub generated: &'a str,
    /// Program that generated the FMU, with its version.
    pub generation_tool: &'a str,
    /// Version of the model.
    pub version: &'a str,
    /// Author or organisation.
    pub author: &'a str,
    /// Copyright notice.
    pub copyright: &'a str,
    /// Licence.
    pub license: &'a str,
    /// Default experiment that is proposed to the importer.
    pub experiment: DefaultExperiment,
    /// Internal step (s), if it is the same for every communication step that is a multiple of it.
    pub fixed_internal_step: Option<f64>,
    /// True if friction heat is output by thermal patches of the ROMs instead of a separate grid.
    pub patches_of_roms: bool,
    /// Table of variables.
    pub table: &'a VariableTable,
    /// FMI 3.0: true for whole arrays, false for scalars as in FMI 2.0.
    pub fmi3_arrays: bool,
    /// Structures of the scene with their ROMs, for the page.
    pub structures: Vec<(&'a str, &'a Rom)>,
    /// Features of the scene beyond a plain rub, for the page; one phrase each.
    pub features: Vec<String>,
    /// Limits of validity, for the page; one sentence each.
    pub limits: Vec<String>,
    /// Warnings about this scene, for the page; one sentence each.
    pub warnings: Vec<String>,
}

/// Default experiment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DefaultExperiment {
    /// Start time (s).
    pub start: f64,
    /// Stop time (s).
    pub stop: f64,
    /// Communication step H (s).
    pub step: f64,
}
