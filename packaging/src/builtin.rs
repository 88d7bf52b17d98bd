//! Models that ship with tiprub, by the name after `builtin:` in a scene; reduced when first asked for.

use tiprub_core::Rom;
use tiprub_model::{CasingOptions, Rotor37Options, casing::CASING37, rotor37::DESIGN_SPEED};

use crate::{Result, console::Console, reduction, rom_cache::RomCache};

/// The model of this name; `None` where there is no such model.
pub fn rom(name: &str, cache: &RomCache, console: &Console) -> Option<Result<Rom>> {
    let blade = |spin| {
        let options = Rotor37Options { spin, ..Rotor37Options::default() };
        cache.get(name, &options, console, &|| Ok(reduction::rotor37(&options, console)?.rom))
    };
    Some(match name {
        "rotor37" => blade(None),
        "rotor37-spin" => blade(Some(DESIGN_SPEED)),
        CASING37 => {
            let options = CasingOptions::default();
            cache.get(name, &options, console, &|| Ok(reduction::casing(&options, console)?.rom))
        }
        _ => return None,
    })
}
