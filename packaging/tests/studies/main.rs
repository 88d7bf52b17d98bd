//! Built-in scenes and user scenes, run and studied with the `tiprub` program.

mod convergence;
mod shipped_scenes;
mod stability;
mod studies;
