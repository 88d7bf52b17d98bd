//! Files that appear whole or not at all.

use std::path::Path;

use crate::{Error, Result};

/// Write a file: to a temporary one beside it first, then renamed.
///
/// # Errors
/// [`Error::File`] when it cannot be written, and then nothing is left behind.
pub(crate) fn write_whole(path: &Path, bytes: &[u8]) -> Result<()> {
    let mut name = path.file_name().unwrap_or_default().to_os_string();
    name.push(".part");
    let temporary = path.with_file_name(name);
    std::fs::write(&temporary, bytes).and_then(|()| std::fs::rename(&temporary, path)).map_err(|source| {
        // Best effort: the error that counts is the one reported.
        let _ = std::fs::remove_file(&temporary);
        Error::File { path: path.to_path_buf(), source }
    })
}
