//! Scenes that ship and scenes of users, run and studied by the `tiprub` program.

mod shipped_scenes;
mod studies;
