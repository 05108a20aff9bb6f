//! Stage 7: from charts and the radiosity mesh to texels.

pub mod coverage;
pub mod dilate;

pub use coverage::{SitePosition, TexelSite, sites};
pub use dilate::dilate;

/// A finished lightmap page.
#[derive(Clone, Debug, PartialEq)]
pub struct Lightmap {
    /// Texels.
    pub width: u32,
    /// Texels.
    pub height: u32,
    /// Row by row from the top: the quantity asked for, linear RGB.
    pub texels: Vec<[f32; 3]>,
}
