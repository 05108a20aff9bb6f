//! The lightmap as PNG with a multiplier in alpha.
//!
//! ```text
//! value = range · alpha · rgb        all linear: bytes over 255, no sRGB
//! ```
//!
//! `range` is the least power of two at or above the map's largest value, and stands in the PNG's text chunk
//! `RGBM range`. A texel's alpha is the least that holds its largest channel. A bilinear lookup mixes `alpha`
//! and `rgb` apart from each other, so what is read between two texels may be off by more than a texel is.

use super::ExportError;
use super::png::power_of_two_at_least;
use crate::raster::Lightmap;

/// The key of the text chunk with the range.
const RANGE: &str = "RGBM range";

/// Encodes a map whose texels are finite.
pub(super) fn encode(lightmap: &Lightmap) -> Result<Vec<u8>, ExportError> {
    let failed = |source| ExportError::Rgbm { source };
    let range = range(lightmap);
    let samples: Vec<u8> =
        lightmap.texels.iter().flat_map(|texel| packed(texel.map(|c| f64::from(c) / range))).collect();
    let mut bytes = Vec::new();
    let mut encoder = ::png::Encoder::new(&mut bytes, lightmap.width, lightmap.height);
    encoder.set_color(::png::ColorType::Rgba);
    encoder.set_depth(::png::BitDepth::Eight);
    encoder.set_filter(::png::Filter::Adaptive);
    encoder.add_text_chunk(RANGE.into(), range.to_string()).map_err(failed)?;
    let mut writer = encoder.write_header().map_err(failed)?;
    writer.write_image_data(&samples).map_err(failed)?;
    writer.finish().map_err(failed)?;
    Ok(bytes)
}

/// What `alpha · rgb = 1` stands for; 1 for a black map.
fn range(lightmap: &Lightmap) -> f64 {
    let largest = lightmap.texels.iter().flatten().fold(0.0_f32, |m, &c| m.max(c));
    if largest > 0.0 { f64::from(power_of_two_at_least(largest)) } else { 1.0 }
}

/// Bytes for channels from 0 to 1. Black has the least multiplier: alpha 0 makes programs throw the colour away.
fn packed(channels: [f64; 3]) -> [u8; 4] {
    let largest = channels.iter().copied().fold(0.0, f64::max);
    let multiplier = (255.0 * largest).ceil().clamp(1.0, 255.0);
    let [r, g, b] = channels.map(|c| (255.0 * 255.0 * c / multiplier).round().clamp(0.0, 255.0) as u8);
    [r, g, b, multiplier as u8]
}
