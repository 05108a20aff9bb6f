//! Stage 8: EXR, PNG and glTF; written under a temporary name, read back, then renamed.

mod error;

pub use error::ExportError;
