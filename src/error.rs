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

    /// The scene's lightmap cannot be that small: every surface takes a texel at least.
    #[error(
        "the lightmap needs at least {least} bytes, more than the budget of {budget}; ask for --budget {}KiB or more",
        in_kib(*least)
    )]
    Budget {
        /// Bytes that were asked for.
        budget: u64,
        /// Bytes of the least lightmap that could be made.
        least: u64,
    },

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

/// A round figure a little above `bytes`: the least lightmap depends on the budget a little, since the light is
/// solved as finely as the texels show it.
fn in_kib(bytes: u64) -> u64 {
    (bytes + bytes / 16).div_ceil(1024)
}
