//! Stand-in with the signature of `tiprub_format`, until that lands on this branch.
use std::path::Path;
use tiprub_core::Scene;

pub struct Resources {
    pub scene: Scene,
    pub token: String,
    pub fmi3_arrays: bool,
}

pub fn load_resources(directory: &Path) -> Result<Resources, String> {
    Err(format!("cannot read {}", directory.display()))
}
