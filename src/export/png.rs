//! The lightmap as an 8-bit PNG for loaders that know `MOZ_lightmap` and no EXR.
//!
//! A stored byte is `255 value / S`, linear, rounded, where `S` is a power of two so that the scale
//! itself rounds nothing. `S` is the least power of two at or above the map's largest value, unless
//! a few texels right under a lamp would take more than three of the eight bits from all others:
//! then it is the least one at or above the value that 99.9 % of the lit samples keep below, and
//! the brighter ones saturate. The EXR keeps them.

use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};

use super::ExportError;
use super::exr::check_texels;
use crate::raster::Lightmap;

/// At most one lit sample in this many saturates.
const SATURATED_SHARE: usize = 1000;

/// How far above the kept share the largest value may lie and still set the scale: three bits.
const HEADROOM: f32 = 8.0;

/// A lightmap in 8 bits a channel.
#[derive(Clone, Debug, PartialEq)]
pub struct Png {
    /// The file.
    pub bytes: Vec<u8>,
    /// What a stored 255 stands for, in the lightmap's quantity: a power of two.
    pub scale: f32,
}

/// Encodes a lightmap as PNG, row 0 on top. The same map gives the same bytes.
///
/// # Errors
/// [`ExportError::PageSize`] or [`ExportError::NotFinite`] for a map that is not whole.
pub fn encode_png(lightmap: &Lightmap) -> Result<Png, ExportError> {
    check_texels(lightmap)?;
    let scale = scale(lightmap);
    let factor = 255.0 / f64::from(scale);
    let samples: Vec<u8> = lightmap
        .texels
        .iter()
        .flatten()
        .map(|&c| (f64::from(c) * factor).round().clamp(0.0, 255.0) as u8)
        .collect();
    Ok(Png { bytes: rgb8(&samples, (lightmap.width, lightmap.height))?, scale })
}

/// A PNG of 8-bit RGB samples, row 0 on top.
pub(super) fn rgb8(samples: &[u8], (width, height): (u32, u32)) -> Result<Vec<u8>, ExportError> {
    let mut bytes = Vec::new();
    PngEncoder::new_with_quality(&mut bytes, CompressionType::Default, FilterType::Adaptive)
        .write_image(samples, width, height, ExtendedColorType::Rgb8)
        .map_err(|source| ExportError::Png { source })?;
    Ok(bytes)
}

/// What 255 stands for, by the module's rule; 1 for a black map.
pub(super) fn scale(lightmap: &Lightmap) -> f32 {
    let mut lit: Vec<f32> = lightmap.texels.iter().flatten().copied().filter(|&c| c > 0.0).collect();
    if lit.is_empty() {
        return 1.0;
    }
    let rank = lit.len() - 1 - lit.len() / SATURATED_SHARE;
    let (_, &mut usual, above) = lit.select_nth_unstable_by(rank, f32::total_cmp);
    let largest = above.iter().fold(usual, |m, &c| m.max(c));
    power_of_two_at_least(if largest <= HEADROOM * usual { largest } else { usual })
}

/// The least power of two at or above `value`, held between 2⁻¹²⁶ and 2¹²⁷.
pub(super) fn power_of_two_at_least(value: f32) -> f32 {
    (-126..=127).map(|exponent| 2.0_f32.powi(exponent)).find(|&p| p >= value).unwrap_or(2.0_f32.powi(127))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ramp(largest: f32) -> Lightmap {
        let texels = (0..64 * 64).map(|i| [largest * i as f32 / 4095.0; 3]).collect();
        Lightmap { width: 64, height: 64, texels }
    }

    fn samples(png: &Png) -> Vec<u8> {
        image::load_from_memory(&png.bytes).unwrap().into_rgb8().into_raw()
    }

    /// A byte times its step is within half a step of the value.
    #[test]
    fn values_are_within_half_a_step() {
        for largest in [1.0, 3.7, 4.0, 100_000.0, 2e-5] {
            let map = ramp(largest);
            let png = encode_png(&map).unwrap();
            assert!(png.scale >= largest && png.scale < 2.0 * largest, "{} for {largest}", png.scale);
            let step = png.scale / 255.0;
            // Half a step, and the rounding of the comparison itself.
            let tolerance = step * (0.5 + 1e-4);
            for (value, byte) in map.texels.iter().flatten().zip(samples(&png)) {
                assert!((value - f32::from(byte) * step).abs() <= tolerance, "{value} as {byte}");
            }
        }
    }

    /// One texel under a lamp saturates; the rest of the map keeps its bits.
    #[test]
    fn a_hot_texel_does_not_take_the_range() {
        let mut map = ramp(1.0);
        map.texels[7] = [1e4; 3];
        let png = encode_png(&map).unwrap();
        assert_eq!(png.scale, 1.0);
        assert_eq!(samples(&png)[21], 255);
    }

    #[test]
    fn small_and_black_maps_are_written() {
        for value in [0.0, 1e-45, f32::MAX] {
            let map = Lightmap { width: 1, height: 1, texels: vec![[value; 3]] };
            assert!(encode_png(&map).unwrap().scale > 0.0);
        }
    }
}
