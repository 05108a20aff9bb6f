//! NumPy's archives: a zip file with one `NAME.npy` an array, stored or deflated.

use std::fs::File;
use std::io::{BufReader, Read};
use std::path::{Path, PathBuf};

use zip::ZipArchive;
use zip::result::ZipError;

use super::CompareError;
use super::npy::{Array, NpyFault};

/// Arrays beyond this many bytes are not read: an archive may claim anything.
const LARGEST_ARRAY: u64 = 1 << 30;

/// An open `.npz`.
pub(super) struct Archive {
    path: PathBuf,
    zip: ZipArchive<BufReader<File>>,
}

impl Archive {
    /// Opens the archive at `path`.
    ///
    /// # Errors
    /// [`CompareError::ReadPoints`] or [`CompareError::NotNpz`].
    pub(super) fn open(path: &Path) -> Result<Self, CompareError> {
        let unreadable = |source| CompareError::ReadPoints { path: path.to_owned(), source };
        let file = File::open(path).map_err(unreadable)?;
        if file.metadata().map_err(unreadable)?.is_dir() {
            return Err(unreadable(std::io::Error::from(std::io::ErrorKind::IsADirectory)));
        }
        let zip = ZipArchive::new(BufReader::new(file))
            .map_err(|source| CompareError::NotNpz { path: path.to_owned(), source })?;
        Ok(Self { path: path.to_owned(), zip })
    }

    /// The file.
    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// Reads the array `name`.
    ///
    /// # Errors
    /// [`CompareError::NoArray`] or [`CompareError::Array`].
    pub(super) fn array(&mut self, name: &'static str) -> Result<Array, CompareError> {
        let entry = format!("{name}.npy");
        if self.zip.index_for_name(&entry).is_none() {
            let names = self.zip.file_names().filter_map(Result::ok);
            let found = names.filter_map(|file| file.strip_suffix(".npy").map(str::to_owned)).collect();
            return Err(CompareError::NoArray { path: self.path.clone(), name, found });
        }
        self.bytes(&entry).and_then(|bytes| Array::read(&bytes)).map_err(|fault| self.fault(name, fault))
    }

    /// Names the array at fault.
    pub(super) fn fault(&self, name: &'static str, fault: NpyFault) -> CompareError {
        CompareError::Array { path: self.path.clone(), name, fault }
    }

    fn bytes(&mut self, entry: &str) -> Result<Vec<u8>, NpyFault> {
        let damaged = |problem: String| NpyFault::Damaged { problem };
        let file = self.zip.by_name(entry).map_err(|error: ZipError| damaged(error.to_string()))?;
        if file.size() > LARGEST_ARRAY {
            return Err(NpyFault::TooLarge { bytes: file.size(), limit: LARGEST_ARRAY });
        }
        let mut bytes = Vec::new();
        file.take(LARGEST_ARRAY).read_to_end(&mut bytes).map_err(|error| damaged(error.to_string()))?;
        Ok(bytes)
    }
}
