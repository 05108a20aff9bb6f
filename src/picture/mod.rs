//! After the last stage: pictures for people.
//!
//! Lightmaps and planar drawings become PNG: what the solver did to a surface can be looked at
//! without a viewer, and so does the density of texels. Only [`pictures`] and the densities know the
//! stages' types; the rest takes plain data, polygons and colours. Legends of densities carry numbers; of all
//! else the file names say what it shows.

mod bake;
mod bilinear;
mod canvas;
mod colour_map;
mod density;
mod drawing;
mod lightmap;
mod png;
mod scale;
mod tone;
mod view;

pub use bake::{Picture, Subject, pictures};
pub(crate) use bilinear::sample;
pub(crate) use colour_map::shade;
pub use drawing::{Cell, Line, MeshDrawing};
pub use lightmap::lightmap_png;
pub(crate) use png::encode as encode_rgb;
pub use tone::ToneMap;
pub(crate) use tone::srgb_byte;

/// A colour of a picture: sRGB, 0 to 255.
pub type Colour = [u8; 3];

/// Paper.
pub const WHITE: Colour = [255, 255, 255];
/// Outlines of cells.
pub const INK: Colour = [32, 32, 36];
/// A Close Objects Buffer that nobody has asked for yet.
pub const UNINITIALIZED: Colour = [176, 176, 176];
/// A Close Objects Buffer without entries.
pub const EMPTY: Colour = [86, 140, 205];
/// A Close Objects Buffer with entries.
pub const NOT_EMPTY: Colour = [238, 144, 44];

/// Why a picture could not be made.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PictureError {
    /// The PNG encoder refused the picture.
    #[error("cannot encode a picture of {width} × {height} pixels as PNG; try without --pictures")]
    Encode {
        /// Pixels.
        width: u32,
        /// Pixels.
        height: u32,
        /// What the encoder reported.
        source: image::ImageError,
    },
}
