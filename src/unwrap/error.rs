//! Why no atlas could be made.

/// Why no atlas could be made.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum UnwrapError {
    /// The charts with their padding do not fit.
    #[error(
        "{charts} charts with {gutter} texels between them do not fit into {side} × {side} texels; ask for a larger --size, more --pages, a smaller --padding or fewer --mips"
    )]
    TooSmall {
        /// How many charts there are.
        charts: usize,
        /// Padding asked for.
        gutter: u32,
        /// The page's side.
        side: u32,
    },

    /// The density asked for needs more than the largest page.
    #[error(
        "{charts} charts at {texels_per_metre} texels a metre do not fit into {side} × {side} texels; ask for fewer texels (--texels-per-metre, --budget) or more --pages"
    )]
    TooLarge {
        /// How many charts there are.
        charts: usize,
        /// The density asked for.
        texels_per_metre: f64,
        /// The largest page's side.
        side: u32,
    },
}
