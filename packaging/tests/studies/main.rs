//! Built-in scenes and user scenes, run and studied with the `tiprub` program.

mod shipped_scenes;
mod studies;
