//! Stage 6: charts are laid out in the lightmap's page.

use glam::{DAffine2, DVec2};

/// Where each surface lies in the lightmap.
#[derive(Clone, Debug)]
pub struct Atlas {
    /// The page's width, texels.
    pub width: u32,
    /// The page's height, texels.
    pub height: u32,
    /// Texels per metre of surface, before what rounding charts to whole texels changed.
    pub texels_per_metre: f64,
    /// Free texels kept around each chart.
    pub padding: u32,
    /// One per surface, in order.
    pub charts: Vec<Chart>,
}

/// A surface's place in the page: an affine map, since a surface is flat.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Chart {
    /// Takes the surface's plane coordinates (metres) to texels; `(0, 0)` is the page's top left corner,
    /// texel `(i, j)`'s centre lies at `(i + ½, j + ½)`.
    pub texel_from_plane: DAffine2,
}

impl Chart {
    /// Where plane point `p` lies in the page, texels.
    #[must_use]
    pub fn texel(&self, p: DVec2) -> DVec2 {
        self.texel_from_plane.transform_point2(p)
    }
}

/// Why no atlas could be made.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum UnwrapError {
    /// The charts with their padding do not fit.
    #[error(
        "{charts} charts with {padding} texels of padding do not fit into {side} × {side} texels; ask for a larger --size or a smaller --padding"
    )]
    TooSmall {
        /// How many charts there are.
        charts: usize,
        /// Padding asked for.
        padding: u32,
        /// The page's side.
        side: u32,
    },
}
