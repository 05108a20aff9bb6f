//! A lightmap as a picture.

use glam::{DVec3, Vec3};

use super::{PictureError, ToneMap, png};
use crate::raster::Lightmap;

/// The page as PNG, one pixel a texel, exposed by its bright texels ([`ToneMap::for_values`]).
///
/// Texels that are missing from a page that is not whole are black.
///
/// # Errors
///
/// [`PictureError::Encode`], for a page without texels for instance.
pub fn lightmap_png(lightmap: &Lightmap) -> Result<Vec<u8>, PictureError> {
    let value = |texel: &[f32; 3]| -> DVec3 { Vec3::from_array(*texel).as_dvec3() };
    let tone = ToneMap::for_values(lightmap.texels.iter().map(value));
    let size = (lightmap.width, lightmap.height);
    let pixels = lightmap.width as usize * lightmap.height as usize;
    let mut bytes: Vec<u8> =
        lightmap.texels.iter().take(pixels).flat_map(|t| tone.colour(value(t))).collect();
    if lightmap.texels.len() < pixels {
        // An empty list of texels and a claimed size must not make us reserve gigabytes.
        let size = if lightmap.texels.is_empty() {
            (0, 0)
        } else {
            (lightmap.width, bytes.len() as u32 / 3 / lightmap.width.max(1))
        };
        bytes.truncate(size.0 as usize * size.1 as usize * 3);
        return png::encode(&bytes, size);
    }
    png::encode(&bytes, size)
}
