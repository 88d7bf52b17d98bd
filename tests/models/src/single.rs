//! Systems of one structure with a single sector, against one rigid surface.

use tiprub_core::contact::ContactParameters;
use tiprub_core::geometry::GapLaw;
use tiprub_core::modes::bank::BankOptions;
use tiprub_core::modes::bank::SectorModel;
use tiprub_core::modes::modal::ModalModel;
use tiprub_core::system::{PairParts, StructureParts, System, SystemSettings};

/// Returns a system at rest, with friction coefficient µ. Call `set_step` and `start` before the first step.
pub fn single_sector(model: &ModalModel, gap: GapLaw, friction: f64, settings: SystemSettings) -> System {
    single_sector_with(model, BankOptions::default(), gap, friction, settings)
}

/// Returns a system as [`single_sector`] does, with options for its modes.
pub fn single_sector_with(
    model: &ModalModel,
    options: BankOptions,
    gap: GapLaw,
    friction: f64,
    settings: SystemSettings,
) -> System {
    let parameters = ContactParameters { friction, ..ContactParameters::FRICTIONLESS };
    let pair = PairParts { structure: 0, gap, carrier: None, parameters };
    let structure = StructureParts::Touching(SectorModel::Uncoupled(model, 1), Box::new(options));
    System::of(vec![structure], vec![pair], Vec::new(), settings)
}
