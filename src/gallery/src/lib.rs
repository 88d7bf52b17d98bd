//! Built-in models and scenes (`builtin:`), reduced once and cached in the user's cache directory.
//!
//! [`scene_source`] loads any scene with its ROMs, [`builtin`] defines the models, [`rom_cache`] caches them, [`mod@reduction`] reduces with
//! progress.

#![warn(unreachable_pub)]
pub mod builtin;
mod known;
pub mod reduction;
pub mod rom_cache;
pub mod scene_source;
