//! The lightmap as KTX 2.0 (Khronos 2020): `VK_FORMAT_E5B9G9R9_UFLOAT_PACK32` under Zstandard.
//!
//! Layout, all numbers little endian:
//!
//! ```text
//!   0  identifier, 12 bytes
//!  12  header, 9 u32: vkFormat 123, typeSize 4, width, height, depth 0, layers 0, faces 1, levels 1,
//!      supercompression 2 (Zstandard)
//!  48  index: offset and length of the data format descriptor and of the key/value data (u32 each) and of
//!      the supercompression's global data (u64 each, none)
//!  80  level index: offset, length, length when decompressed (u64 each)
//! 104  data format descriptor, 124 bytes: its length, and one basic block with 6 samples
//! 228  key/value data
//!      the level
//! ```
//!
//! A texel is three mantissas of 9 bits and an exponent of 5 (OpenGL's EXT_texture_shared_exponent):
//! `channel = mantissa 2^(exponent - 24)`.

use ruzstd::encoding::{CompressionLevel, compress_to_vec};

use crate::raster::Lightmap;

/// Every KTX 2.0 file starts with this.
const IDENTIFIER: [u8; 12] = [0xab, b'K', b'T', b'X', b' ', b'2', b'0', 0xbb, b'\r', b'\n', 0x1a, b'\n'];

const VK_FORMAT_E5B9G9R9: u32 = 123;
const ZSTANDARD: u32 = 2;

/// Where the data format descriptor begins, after header, index and one level's entry.
const DESCRIPTOR_OFFSET: u32 = 104;

/// The largest channel value: all nine bits and the largest exponent.
const LARGEST: f64 = 511.0 * 128.0;

/// Encodes a map whose texels are finite.
pub(super) fn encode(lightmap: &Lightmap) -> Vec<u8> {
    let texels: Vec<u8> = lightmap.texels.iter().flat_map(|&texel| packed(texel).to_le_bytes()).collect();
    let level = compress_to_vec(texels.as_slice(), CompressionLevel::Fastest);
    let descriptor = descriptor();
    let mut pairs = Vec::new();
    pair(&mut pairs, "KTXorientation", "rd");
    pair(&mut pairs, "KTXwriter", concat!("cobake ", env!("CARGO_PKG_VERSION")));
    let pairs_offset = DESCRIPTOR_OFFSET + descriptor.len() as u32;
    let level_offset = u64::from(pairs_offset) + pairs.len() as u64;

    let mut bytes = IDENTIFIER.to_vec();
    let mut words = |list: &[u32]| list.iter().for_each(|word| bytes.extend(word.to_le_bytes()));
    words(&[VK_FORMAT_E5B9G9R9, 4, lightmap.width, lightmap.height, 0, 0, 1, 1, ZSTANDARD]);
    words(&[DESCRIPTOR_OFFSET, descriptor.len() as u32, pairs_offset, pairs.len() as u32]);
    let longs = [0, 0, level_offset, level.len() as u64, texels.len() as u64];
    longs.iter().for_each(|long: &u64| bytes.extend(long.to_le_bytes()));
    bytes.extend(descriptor);
    bytes.extend(pairs);
    bytes.extend(level);
    bytes
}

/// Three channels with one exponent, each rounded to the nearest; negative ones are 0, too large ones saturate.
fn packed(texel: [f32; 3]) -> u32 {
    let channels = texel.map(|c| f64::from(c).clamp(0.0, LARGEST));
    let largest = channels.iter().copied().fold(0.0, f64::max);
    // The least exponent whose mantissa has room for the largest channel, rounded.
    let exponent = (0..31).find(|&e| (largest / step(e)).round() < 512.0).unwrap_or(31);
    let [r, g, b] = channels.map(|c| (c / step(exponent)).round() as u32);
    r | (g << 9) | (b << 18) | ((exponent as u32) << 27)
}

fn step(exponent: i32) -> f64 {
    2.0_f64.powi(exponent - 24)
}

/// Says what the 32 bits of a texel are (Khronos Data Format Specification 1.3).
fn descriptor() -> Vec<u8> {
    const SAMPLES: u32 = 6;
    const BLOCK: u32 = 24 + 16 * SAMPLES;
    const EXPONENT: u32 = 0x20;
    /// RGBSDA, Rec. 709 primaries, linear, straight alpha.
    const MODEL: u32 = 1 | (1 << 8) | (1 << 16);
    let mut words = vec![4 + BLOCK, 0, 2 | (BLOCK << 16), MODEL, 0, 4, 0];
    for channel in 0..3 {
        // First bit, bits less one and kind; position; least and greatest value.
        words.extend([(9 * channel) | (8 << 16) | (channel << 24), 0, 0, 8448]);
        words.extend([27 | (4 << 16) | ((channel | EXPONENT) << 24), 0, 15, 31]);
    }
    words.into_iter().flat_map(u32::to_le_bytes).collect()
}

/// Adds a key and its value, both ended by a zero, padded to 4 bytes.
fn pair(pairs: &mut Vec<u8>, key: &str, value: &str) {
    pairs.extend(((key.len() + value.len() + 2) as u32).to_le_bytes());
    for text in [key, value] {
        pairs.extend_from_slice(text.as_bytes());
        pairs.push(0);
    }
    pairs.resize(pairs.len().next_multiple_of(4), 0);
}

#[cfg(test)]
mod tests {
    use super::*;

    /// By hand: 1 is 256 · 2⁻⁸, whose exponent is 16; 511.6 · 2⁻²⁴ needs the next exponent.
    #[test]
    fn texels_are_packed_as_the_extension_says() {
        assert_eq!(packed([0.0; 3]), 0);
        assert_eq!(packed([1.0, 0.5, 0.25]), 256 | (128 << 9) | (64 << 18) | (16 << 27));
        assert_eq!(packed([511.6 * 2.0_f32.powi(-24), 0.0, 0.0]), 256 | (1 << 27));
        assert_eq!(packed([1e9, -1.0, 0.0]), 511 | (31 << 27));
        assert_eq!(packed([65408.0, 128.0, 64.0]), 511 | (1 << 9) | (1 << 18) | (31 << 27));
    }
}
