//! Why a bake failed: one variant a stage, each stage has an enum of its own.

use crate::options::OptionsError;

/// Why a bake failed. The cause is reached through `source`.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// An option is out of its range.
    #[error(transparent)]
    Options(#[from] OptionsError),

    /// The scene could not be read.
    #[error(transparent)]
    Import(#[from] crate::scene::ImportError),

    /// No atlas could be made.
    #[error(transparent)]
    Unwrap(#[from] crate::unwrap::UnwrapError),

    /// The result could not be written.
    #[error(transparent)]
    Export(#[from] crate::export::ExportError),

    /// The worker threads could not be started.
    #[error("cannot start {threads} worker threads; try a smaller --threads")]
    Threads {
        /// How many were asked for.
        threads: usize,
        /// What the thread pool reported.
        source: rayon::ThreadPoolBuildError,
    },

    /// The caller asked to stop; nothing was written.
    #[error("cancelled; nothing was written")]
    Cancelled,
}
