//! The lightmap as OpenEXR: full precision, upright, the same bytes every time.
//!
//! Three channels, scan lines from the top, PIZ compression: of the lossless compressions the one
//! that every loader we tried reads. The line order is fixed and there is no custom attribute,
//! because the encoder's defaults give other bytes on every run.
//!
//! Channels are 16-bit halves, whose relative step is at most 2⁻¹⁰ between 2⁻¹⁴ and 65504. Where
//! that range does not serve the map, they are 32-bit floats: when a value lies above 65504 (a
//! scene in sunlight: 100 000 lux), and when the brightest value is below 2⁻⁴, so that values a
//! thousandth as bright would be subnormal halves and lose precision.

use std::io::Cursor;

use ::exr::math::Vec2;
use ::exr::meta::attribute::LineOrder;
use ::exr::prelude::{
    Blocks, Compression, Encoding, Image, IntoSample, ReadChannels, ReadLayers, SpecificChannels,
    WritableImage, f16, read,
};

use super::ExportError;
use crate::raster::Lightmap;

/// The largest finite half.
const HALF_MAX: f32 = 65504.0;

/// Maps whose brightest value is below this get 32-bit channels: 2¹⁰ times the least normal half.
const HALF_DIM: f32 = 0.0625;

/// The longest side that [`decode_exr`] accepts, texels: the largest page that a bake can make.
const SIDE_LIMIT: usize = 16384;

/// Encodes a lightmap as OpenEXR: channels R, G and B, row 0 on top. The same map gives the same bytes.
///
/// Texels are rounded to half precision, or kept as they are where the module's rule takes 32 bits.
///
/// # Errors
/// [`ExportError::PageSize`] or [`ExportError::NotFinite`] for a map that is not whole.
pub fn encode_exr(lightmap: &Lightmap) -> Result<Vec<u8>, ExportError> {
    check_texels(lightmap)?;
    let brightest = lightmap.texels.iter().flatten().fold(0.0_f32, |m, c| m.max(c.abs()));
    if brightest > HALF_MAX || (brightest > 0.0 && brightest < HALF_DIM) {
        encode_as(lightmap, |value| value)
    } else {
        encode_as(lightmap, f16::from_f32)
    }
}

/// Decodes an OpenEXR of channels R, G and B (halves, floats or integers; others are ignored).
///
/// # Errors
/// [`ExportError::Exr`] for bytes that are not such a file, [`ExportError::ExrSize`] for one that
/// claims more than 16384 texels a side.
pub fn decode_exr(bytes: &[u8]) -> Result<Lightmap, ExportError> {
    let failed = |source| ExportError::Exr { source };
    let headers =
        ::exr::meta::MetaData::read_from_buffered(Cursor::new(bytes), false).map_err(failed)?.headers;
    for header in &headers {
        let Vec2(width, height) = header.layer_size;
        if width > SIDE_LIMIT || height > SIDE_LIMIT {
            return Err(ExportError::ExrSize { width, height, limit: SIDE_LIMIT });
        }
    }
    let image = read()
        .no_deep_data()
        .largest_resolution_level()
        .rgb_channels(
            |size, _| (size.width(), vec![[0.0_f32; 3]; size.area()]),
            |(width, texels): &mut (usize, Vec<[f32; 3]>), at, (r, g, b): (f32, f32, f32)| {
                if let Some(texel) = texels.get_mut(at.y() * *width + at.x()) {
                    *texel = [r, g, b];
                }
            },
        )
        .first_valid_layer()
        .all_attributes()
        .non_parallel()
        .from_buffered(Cursor::new(bytes))
        .map_err(failed)?;
    let Vec2(width, height) = image.layer_data.size;
    let side = |length| u32::try_from(length).unwrap_or(u32::MAX);
    Ok(Lightmap { width: side(width), height: side(height), texels: image.layer_data.channel_data.pixels.1 })
}

/// Checks that there is one texel per place and that all are finite.
pub(super) fn check_texels(lightmap: &Lightmap) -> Result<(), ExportError> {
    let &Lightmap { width, height, ref texels } = lightmap;
    if u64::from(width) * u64::from(height) != texels.len() as u64 || texels.is_empty() {
        return Err(ExportError::PageSize { texels: texels.len(), width, height });
    }
    let mut place = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
    let fault = texels.iter().position(|texel| texel.iter().any(|c| !c.is_finite()));
    match fault.and_then(|index| place.nth(index)) {
        Some((x, y)) => Err(ExportError::NotFinite { x, y }),
        None => Ok(()),
    }
}

/// Encodes with the sample type that `convert` makes.
fn encode_as<Sample>(
    lightmap: &Lightmap,
    convert: impl Fn(f32) -> Sample + Sync,
) -> Result<Vec<u8>, ExportError>
where
    Sample: IntoSample,
{
    let width = lightmap.width as usize;
    let pixel = |at: Vec2<usize>| {
        let [r, g, b] = lightmap.texels.get(at.y() * width + at.x()).copied().unwrap_or_default();
        (convert(r), convert(g), convert(b))
    };
    let encoding = Encoding {
        compression: Compression::PIZ,
        blocks: Blocks::ScanLines,
        line_order: LineOrder::Increasing,
    };
    let size = (width, lightmap.height as usize);
    let image = Image::from_encoded_channels(size, encoding, SpecificChannels::rgb(pixel));
    let mut bytes = Vec::new();
    image
        .write()
        .non_parallel()
        .to_buffered(Cursor::new(&mut bytes))
        .map_err(|source| ExportError::Exr { source })?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn map(scale: f32) -> Lightmap {
        let (width, height) = (37, 23);
        let texels = (0..width * height)
            .map(|i| [scale * (i as f32 / 850.0), scale * 0.5, scale * ((i % 37) as f32 / 36.0)])
            .collect();
        Lightmap { width, height, texels }
    }

    #[test]
    fn bytes_repeat() {
        let first = encode_exr(&map(3.0)).unwrap();
        for _ in 0..12 {
            assert_eq!(encode_exr(&map(3.0)).unwrap(), first);
        }
    }

    /// Every texel comes back as the half nearest to it, at its own place.
    #[test]
    fn halves_round_trip() {
        let map = map(3.0);
        let back = decode_exr(&encode_exr(&map).unwrap()).unwrap();
        assert_eq!((back.width, back.height), (map.width, map.height));
        for (a, b) in map.texels.iter().zip(&back.texels) {
            assert_eq!(a.map(|c| f16::from_f32(c).to_f32()), *b);
        }
    }

    /// 100 000 lux do not fit into a half and a night scene falls below its normal range.
    #[test]
    fn values_beyond_halves_are_exact() {
        for scale in [1e5, 3e-3, 1e30, 1e-30] {
            let map = map(scale);
            assert_eq!(decode_exr(&encode_exr(&map).unwrap()).unwrap(), map, "scale {scale}");
        }
    }

    #[test]
    fn a_black_map_is_written() {
        let map = Lightmap { width: 2, height: 1, texels: vec![[0.0; 3]; 2] };
        assert_eq!(decode_exr(&encode_exr(&map).unwrap()).unwrap(), map);
    }

    #[test]
    fn faults_are_named() {
        let mut map = map(1.0);
        map.texels[38] = [0.0, f32::NAN, 0.0];
        assert!(matches!(encode_exr(&map), Err(ExportError::NotFinite { x: 1, y: 1 })));
        map.texels.pop();
        assert!(matches!(encode_exr(&map), Err(ExportError::PageSize { .. })));
        assert!(matches!(decode_exr(b"not an EXR"), Err(ExportError::Exr { .. })));
    }
}
