//! Putting the finished file at its place, whole or not at all.
//!
//! The bytes go into a temporary file beside the target, are flushed to the disk, read back and
//! checked; only then does the file take its name, in one step. Whatever fails before leaves
//! neither a temporary file nor a change at the target.

use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use super::{ExportError, glb, verify};

/// Writes a GLB made by [`encode`](super::encode) to `path`, replacing a file that is there.
///
/// A path that ends in `.gltf` gets glTF text with everything inside as a data URI; every other
/// one gets the GLB. A symbolic link is followed, so that the file it names is replaced.
///
/// # Errors
/// Names the place and the remedy; nothing is left behind.
pub fn write(path: &Path, glb: &[u8]) -> Result<(), ExportError> {
    verify(glb)?;
    let text = path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("gltf"));
    let text = if text { Some(glb::as_text(glb)?) } else { None };
    write_whole(path, text.as_deref().unwrap_or(glb))
}

/// Puts `bytes` at `path`, whole or not at all, replacing a file that is there.
///
/// A symbolic link is followed, so that the file it names is replaced.
///
/// # Errors
/// Names the place and the remedy; nothing is left behind.
pub fn write_whole(path: &Path, bytes: &[u8]) -> Result<(), ExportError> {
    let target = resolve(path)?;
    let folder = match target.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    if !folder.is_dir() {
        return Err(ExportError::NoFolder { folder: folder.into() });
    }
    let mut file = builder()
        .tempfile_in(folder)
        .map_err(|source| ExportError::Create { folder: folder.into(), source })?;
    let failed = |source| ExportError::Write { path: path.into(), source };
    file.write_all(bytes).map_err(failed)?;
    file.as_file().sync_all().map_err(failed)?;
    let back = fs::read(file.path()).map_err(failed)?;
    if back != bytes {
        return Err(ExportError::Corrupted { path: path.into() });
    }
    file.persist(&target).map_err(|error| ExportError::Rename { path: path.into(), source: error.error })?;
    // The new name is on the disk once the folder is; not every system lets a folder be flushed.
    if let Ok(folder) = fs::File::open(folder) {
        folder.sync_all().ok();
    }
    Ok(())
}

/// Follows a symbolic link and refuses what is no file.
fn resolve(path: &Path) -> Result<PathBuf, ExportError> {
    let not_a_file = || ExportError::NotAFile { path: path.into() };
    if path.file_name().is_none() {
        return Err(not_a_file());
    }
    match fs::metadata(path) {
        Ok(there) if !there.is_file() => Err(not_a_file()),
        // A path that cannot be resolved is written to as it stands.
        Ok(_) => Ok(fs::canonicalize(path).unwrap_or_else(|_| path.into())),
        Err(_) => Ok(path.into()),
    }
}

/// Temporary files are private by default; the output gets what any new file gets.
fn builder() -> tempfile::Builder<'static, 'static> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(".cobake-").suffix(".part");
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt as _;
        builder.permissions(fs::Permissions::from_mode(0o666));
    }
    builder
}
