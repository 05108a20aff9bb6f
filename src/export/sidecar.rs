//! The lightmap as a file of its own, in the forms that engines ask for.

use image::Rgb;
use image::codecs::hdr::HdrEncoder;

use super::exr::check_texels;
use super::{ExportError, encode_exr, ktx2, rgbm};
use crate::raster::Lightmap;

/// A file format for a lightmap.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[non_exhaustive]
pub enum SidecarForm {
    /// OpenEXR of halves or floats, the same bytes as inside the output.
    Exr,
    /// Radiance RGBE: 8 bits a channel, one exponent a texel.
    Hdr,
    /// KTX 2.0 with 9 bits a channel and one exponent a texel, under Zstandard.
    Ktx2,
    /// PNG whose alpha is a multiplier.
    Rgbm,
}

/// Encodes a lightmap, row 0 on top. The same map gives the same bytes.
///
/// | form | of a texel's largest channel, each channel is right to | largest value |
/// |---|---|---|
/// | EXR | 2⁻¹¹ (halves), exactly (floats) | that of a float |
/// | HDR | 1/128 | 1.7e38 |
/// | KTX2 | 1/512, or 2⁻²⁵ | 65408 |
/// | RGBM | 1/128 where it is above 1/255 of the map's range | the map's own |
///
/// Brighter values saturate.
///
/// # Errors
/// [`ExportError::PageSize`] or [`ExportError::NotFinite`] for a map that is not whole.
pub fn encode_sidecar(lightmap: &Lightmap, form: SidecarForm) -> Result<Vec<u8>, ExportError> {
    check_texels(lightmap)?;
    match form {
        SidecarForm::Exr => encode_exr(lightmap),
        SidecarForm::Hdr => encode_hdr(lightmap),
        SidecarForm::Ktx2 => Ok(ktx2::encode(lightmap)),
        SidecarForm::Rgbm => rgbm::encode(lightmap),
    }
}

fn encode_hdr(lightmap: &Lightmap) -> Result<Vec<u8>, ExportError> {
    /// The format's own is 2¹²⁷ a little short of its rounding up.
    const LARGEST: f32 = 1.6e38;
    let texels: Vec<Rgb<f32>> =
        lightmap.texels.iter().map(|texel| Rgb(texel.map(|c| c.clamp(0.0, LARGEST)))).collect();
    let mut bytes = Vec::new();
    HdrEncoder::new(&mut bytes)
        .encode(&texels, lightmap.width as usize, lightmap.height as usize)
        .map_err(|source| ExportError::Hdr { source })?;
    Ok(bytes)
}
