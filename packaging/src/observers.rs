//! Observers of a run: fields over time for ParaView, and the motion for the report.

use std::path::Path;

use tiprub_core::Scene;
use tiprub_field::{FieldOptions, FieldSeries, animation::Capture, observed_scene, shape_file};
use tiprub_gallery::{builtin, rom_cache::RomCache};
use tiprub_model::SurfaceShapes;
use tiprub_shell::{
    Result,
    console::Console,
    native::{NativeRun, ObservedScene, RunInputs, StartedRun},
    schedule::Schedule,
};

/// Requested observers of a run, and the scene that they observe.
pub struct Observers {
    /// Scene with the outputs that the observers read.
    scene: Scene,
    /// Outputs of the original scene, which the results of the run have.
    observed: ObservedScene,
    /// Files for ParaView.
    pub fields: Option<FieldSeries>,
    /// Motion for the report.
    pub capture: Option<Capture>,
}

impl Observers {
    /// Prepares the observers of a run, and warns about structures without a surface. `None` if no observer is requested.
    ///
    /// # Errors
    /// The options of the fields are wrong, or the scene is rejected.
    pub fn new(
        scene: &Scene,
        schedule: &Schedule,
        (fields, is_reported): (Option<FieldOptions>, bool),
        shapes: impl FnOnce() -> Result<Vec<Option<SurfaceShapes>>>,
        console: &Console,
    ) -> Result<Option<Self>> {
        let watching = match (&fields, is_reported) {
            (None, false) => return Ok(None),
            (Some(fields), false) => fields.scene(scene)?,
            (None, true) => observed_scene(scene, &[])?,
            (Some(fields), true) => {
                // This call only checks the chosen sectors; the report needs all sectors.
                fields.scene(scene)?;
                observed_scene(scene, &[])?
            }
        };
        let shapes = shapes()?;
        let capture = is_reported.then(|| Capture::new(&watching, shapes.clone(), *schedule)).transpose()?;
        let fields = fields.map(|fields| FieldSeries::new(fields, &watching, shapes, *schedule)).transpose()?;
        let alone = match (&capture, &fields) {
            (Some(capture), _) => capture.without_surface(),
            (None, fields) => fields.as_ref().map(FieldSeries::without_surface).unwrap_or_default(),
        };
        let alone = alone.into_iter().map(|name| {
            format!(
                "{name} is shown by its contact nodes only: no shape file belongs to its ROM. `tiprub reduce` writes one \
                 beside the ROM of a mesh with one material"
            )
        });
        console.warn_texts(&alone.collect::<Vec<_>>());
        Ok(Some(Self { observed: ObservedScene::new(scene, schedule)?, scene: watching, fields, capture }))
    }

    /// Runs the scene and passes every communication point to the observers. The results are those of the scene without them.
    ///
    /// # Errors
    /// The run fails, or a file cannot be written.
    pub fn run(&mut self, schedule: &Schedule, given: RunInputs<'_>, progress: &dyn Fn(usize)) -> Result<NativeRun> {
        let Self { scene, observed, fields, capture } = self;
        let started = StartedRun::new(scene, schedule, RunInputs { observed: Some(observed), ..given });
        let observed = started.and_then(|run| {
            run.finish_observed(progress, &mut |index, simulation| {
                if let Some(capture) = capture {
                    capture.add(index, simulation);
                }
                fields.as_mut().map_or(Ok(()), |fields| fields.add(index, simulation))
            })
        });
        let Some(fields) = fields else { return observed };
        // The list of files is also written if the run fails, so that its files can be used.
        observed.and_then(|run| fields.finish().map(|()| run)).inspect_err(|_| drop(fields.finish()))
    }
}

/// Finds the surfaces of the structures of a scene, which was loaded from `argument`, in the cache or in shape files beside the
/// ROMs.
///
/// # Errors
/// A shape file is damaged, or a built-in model cannot be reduced.
pub fn surfaces(
    scene: &Scene,
    argument: &str,
    cache: &RomCache,
    console: &Console,
) -> Result<Vec<Option<SurfaceShapes>>> {
    let directory = Path::new(argument).parent().unwrap_or(Path::new(""));
    let shapes = scene.settings.structures.iter().zip(&scene.roms).map(|(structure, rom)| {
        match tiprub_format::builtin_model(structure) {
            Some(name) => builtin::shapes(name, rom, cache, console).transpose(),
            None => {
                let path = directory.join(&structure.rom);
                let beside = shape_file::beside(&path);
                let files = shape_file::in_directory(path.parent().unwrap_or(Path::new("")), Some(&beside));
                shape_file::find(rom, files)
            }
        }
    });
    shapes.collect()
}
