//! What ships: models and scenes behind `builtin:`, reduced once and kept in the user's cache directory.
//!
//! [`scene_source`] loads any scene with its ROMs, [`builtin`] knows the models, [`rom_cache`] keeps them,
//! [`mod@reduction`] reduces with progress.

#![warn(unreachable_pub)]
pub mod builtin;
mod known;
pub mod reduction;
pub mod rom_cache;
pub mod scene_source;
