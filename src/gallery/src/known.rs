//! Discretisation errors of the built-in models in rubs, determined once with long runs; the ROMs carry them.
//!
//! A row applies to one model with all of its options. There are no errors for models with other options.
//!
//! Source of the figures: `lab refinement --scene rotor37-light`, `--scene rotor37-one-row`, `--scene stage` and `--scene stage-nodes-digging`,
//! 2026-11-23, version 0.1.0; for the paper's model `lab bases`, 2026-11-22, version 0.1.0.

use core::fmt::Debug;

use tiprub_core::Rom;
use tiprub_core::scene::rom::RubErrors;
use tiprub_model::{
    Rotor37Options,
    cyclic::ModeSelection,
    reduce::ReductionKind,
    rotor37::{MeshCounts, TipContact},
    stage::{SectorCounts, SectorOptions, StageOptions},
};

/// Built-in model with its errors.
struct KnownModel {
    /// Options of the model in debug form.
    options: String,
    /// Description of the rub.
    found_on: &'static str,
    /// Relative errors of the displacements by modes, patches, rows of patches across the thickness, and mesh.
    errors: [Option<f64>; 4],
}

/// Returns all rows.
fn rows() -> [KnownModel; 5] {
    let one_row = Rotor37Options {
        mesh: MeshCounts { chord: 24, thickness: 2, span: 40 },
        tip: TipContact::Patches(9),
        kind: ReductionKind::FreeInterface,
        modes: 80,
        ..Rotor37Options::paper()
    };
    let paper = Rotor37Options {
        mesh: MeshCounts { chord: 16, thickness: 2, span: 20 },
        tip: TipContact::Nodes(3),
        kind: ReductionKind::FixedInterface,
        modes: 20,
        ..Rotor37Options::paper()
    };
    let counts =
        SectorCounts { chord: 12, span: 18, thickness: 1, side: 2, overhang: 2, rim: 3, web: [6, 12], bore: [2, 2] };
    let stage = StageOptions {
        sector: SectorOptions { counts, ..SectorOptions::default() },
        tip: TipContact::Nodes(3),
        kind: ReductionKind::FixedInterface,
        modes: ModeSelection::Families(25),
        ..StageOptions::default()
    };
    [
        KnownModel {
            options: format!("{stage:?}"),
            found_on: "the first 9.5 ms of the rub of the stage with friction 0.15; error due to the nodes determined on a mesh \
                       with 0.7 times as many elements, error due to the mesh determined with five patches; later, the error due to \
                       the nodes is far larger",
            errors: [None, Some(0.102), None, Some(0.0068)],
        },
        KnownModel {
            options: format!(
                "{:?}",
                StageOptions { tip: TipContact::Rows([9, 2]), kind: ReductionKind::FreeInterface, ..stage }
            ),
            found_on: "the first 9.4 ms of the rub of the stage with friction 0.05; error due to the modes determined on a mesh \
                       with 0.7 times the elements",
            errors: [Some(0.0014), None, None, Some(0.0084)],
        },
        KnownModel {
            options: format!("{one_row:?}"),
            found_on: "a light rub of rotor 37 with friction 0.15, 4.73 ms",
            errors: [Some(0.0176), Some(0.0311), Some(0.274), Some(0.0557)],
        },
        KnownModel {
            options: format!("{:?}", Rotor37Options { tip: TipContact::Rows([9, 2]), ..one_row.clone() }),
            found_on: "a light rub of rotor 37 with friction 0.15, 4.73 ms",
            errors: [Some(0.0191), Some(0.0204), Some(0.0046), Some(0.0485)],
        },
        KnownModel {
            options: format!("{paper:?}"),
            found_on: "a light rub of rotor 37 with friction 0.15, one revolution, three nodes compared with nine \
                       patches",
            errors: [Some(0.047), Some(0.34), None, None],
        },
    ]
}

/// Adds the known errors to the ROM of a model with these options.
pub(crate) fn with_known_errors(options: &dyn Debug, mut rom: Rom) -> Rom {
    let options = format!("{options:?}");
    let known = rows().into_iter().find(|row| row.options == options);
    rom.checks.rub_errors = known.map(|row| {
        let [modes, patches, rows, mesh] = row.errors;
        RubErrors { found_on: row.found_on.into(), modes, patches, rows, mesh }
    });
    rom
}

#[cfg(test)]
mod tests {
    use tiprub_shell::console::Console;

    use super::*;
    use crate::{builtin, reduction};

    /// If the defaults change, a row no longer matches any model: determine the figures again.
    #[test]
    fn only_the_built_in_blade_has_known_errors() {
        let own = Rotor37Options::default();
        let console = Console::new(true, false);
        let small = Rotor37Options {
            mesh: MeshCounts { chord: 2, thickness: 1, span: 2 },
            tip: TipContact::Nodes(2),
            modes: 2,
            ..Rotor37Options::paper()
        };
        let rom = reduction::rotor37(&small, &console).unwrap().rom;
        assert_eq!(rom.checks.rub_errors, None);
        let rom = with_known_errors(&own, rom);
        let errors = rom.checks.rub_errors.clone().expect("a row of the blade that ships");
        assert!(
            errors.found_on.contains("light rub") && errors.rows == Some(0.0046) && errors.mesh == Some(0.0485),
            "{errors:?}"
        );
        assert!(
            with_known_errors(&Rotor37Options::paper(), rom.clone())
                .checks
                .rub_errors
                .is_some_and(|errors| errors.patches == Some(0.34))
        );
        let one = with_known_errors(&Rotor37Options::one_row(), rom.clone()).checks.rub_errors;
        assert!(one.is_some_and(|errors| errors.rows == Some(0.274) && errors.mesh.is_some()));
        let stage = with_known_errors(&StageOptions::default(), rom.clone()).checks.rub_errors;
        assert!(stage.is_some_and(|errors| errors.patches == Some(0.102) && errors.rows.is_none()));
        let stage = with_known_errors(&builtin::stage().1, rom.clone()).checks.rub_errors;
        assert!(stage.is_some_and(|errors| errors.modes == Some(0.0014) && errors.mesh == Some(0.0084)));
        let wider = StageOptions { tip: TipContact::Rows([5, 2]), ..builtin::stage().1 };
        for other in [StageOptions::coarse(), wider] {
            assert_eq!(with_known_errors(&other, rom.clone()).checks.rub_errors, None, "{other:?}");
        }
        let mesh = MeshCounts { span: own.mesh.span + 2, ..own.mesh };
        for other in [
            Rotor37Options { modes: 81, ..own.clone() },
            Rotor37Options { tip: TipContact::Patches(17), ..own.clone() },
            Rotor37Options { mesh, ..own.clone() },
            Rotor37Options { kind: ReductionKind::FixedInterface, ..own },
        ] {
            assert_eq!(with_known_errors(&other, rom.clone()).checks.rub_errors, None, "{other:?}");
        }
    }
}
