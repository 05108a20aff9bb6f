//! Putting the finished file at its place, whole or not at all.
//!
//! The bytes go into a temporary file beside the target, are flushed to the disk, read back and
//! checked; only then does the file take its name, in one step. Whatever fails before leaves
//! neither a temporary file nor a change at the target.

use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use tempfile::{NamedTempFile, TempPath};

use super::{ExportError, glb, verify};

/// A finished file that waits for its name.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct WrittenFile {
    /// Where it goes; a file that is there is replaced.
    pub path: PathBuf,
    /// What it holds.
    pub bytes: Vec<u8>,
}

/// The file for a GLB made by [`encode`](super::encode), checked.
///
/// A path that ends in `.gltf` gets glTF text with everything inside as a data URI; every other
/// one gets the GLB.
///
/// # Errors
/// [`ExportError::NotBaked`] and others where `glb` is not a whole baked document.
pub fn file_of(path: &Path, glb: &[u8]) -> Result<WrittenFile, ExportError> {
    verify(glb)?;
    let text = path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("gltf"));
    let bytes = if text { glb::as_text(glb)? } else { glb.to_vec() };
    Ok(WrittenFile { path: path.into(), bytes })
}

/// Writes a GLB made by [`encode`](super::encode) to `path`, replacing a file that is there. See [`file_of`].
///
/// A symbolic link is followed, so that the file it names is replaced.
///
/// # Errors
/// Names the place and the remedy; nothing is left behind.
pub fn write(path: &Path, glb: &[u8]) -> Result<(), ExportError> {
    write_all(&[file_of(path, glb)?])
}

/// Puts `bytes` at `path`, whole or not at all, replacing a file that is there. See [`write_all`].
///
/// # Errors
/// Names the place and the remedy; nothing is left behind.
pub fn write_whole(path: &Path, bytes: &[u8]) -> Result<(), ExportError> {
    write_all(&[WrittenFile { path: path.into(), bytes: bytes.into() }])
}

/// Puts all files in their places, or none: what was replaced comes back if a later one fails.
///
/// All are on the disk under temporary names, and read back, before the first takes its name; the first of the
/// list takes its name last, so that what refers to the others is never there without them. Symbolic links are
/// followed.
///
/// # Errors
/// Names the place and the remedy; nothing is left behind.
pub fn write_all(files: &[WrittenFile]) -> Result<(), ExportError> {
    let staged = files.iter().map(stage).collect::<Result<Vec<Staged>, _>>()?;
    let several = staged.len() > 1;
    let mut placed: Vec<Placed> = Vec::with_capacity(staged.len());
    for staged in staged.into_iter().rev() {
        match staged.place(several) {
            Ok(done) => placed.push(done),
            Err(error) => {
                placed.into_iter().rev().for_each(Placed::undo);
                return Err(error);
            }
        }
    }
    for folder in placed.iter().map(|placed| folder_of(&placed.target)) {
        // The new name is on the disk once the folder is; not every system lets a folder be flushed.
        if let Ok(folder) = fs::File::open(folder) {
            folder.sync_all().ok();
        }
    }
    Ok(())
}

/// A file under its temporary name.
struct Staged {
    file: NamedTempFile,
    target: PathBuf,
    /// As it was given.
    path: PathBuf,
}

fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    }
}

fn stage(WrittenFile { path, bytes }: &WrittenFile) -> Result<Staged, ExportError> {
    let target = resolve(path)?;
    let folder = folder_of(&target);
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
    if back != *bytes {
        return Err(ExportError::Corrupted { path: path.into() });
    }
    Ok(Staged { file, target, path: path.into() })
}

/// A file in its place, and what was there before.
struct Placed {
    target: PathBuf,
    before: Option<TempPath>,
}

impl Staged {
    /// Gives the file its name; with `keep` what was there can come back.
    fn place(self, keep: bool) -> Result<Placed, ExportError> {
        let Self { file, target, path } = self;
        let before = if keep && target.exists() { Some(copy_of(&target, &path)?) } else { None };
        file.persist(&target).map_err(|error| ExportError::Rename { path, source: error.error })?;
        Ok(Placed { target, before })
    }
}

impl Placed {
    fn undo(self) {
        match self.before {
            Some(before) => drop(before.persist(&self.target)),
            None => drop(fs::remove_file(&self.target)),
        }
    }
}

/// A second name for the file at `target`, or a copy where the disk knows no second names.
fn copy_of(target: &Path, path: &Path) -> Result<TempPath, ExportError> {
    let failed = |source| ExportError::Write { path: path.into(), source };
    let folder = folder_of(target);
    let made = builder().make_in(folder, |name| fs::hard_link(target, name));
    let made = made.or_else(|_| builder().make_in(folder, |name| fs::copy(target, name).map(drop)));
    Ok(made.map_err(failed)?.into_temp_path())
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
