//! The lightmap's own files, each read back by another reader than its writer.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test may fail")]

use std::io::Read as _;

use exr::prelude::{ReadChannels as _, ReadLayers as _};

use cobake::export::{SidecarForm, encode_sidecar};
use cobake::raster::Lightmap;

/// Values from a night scene's to a sunlit wall's, hues, and black.
fn map(scale: f32) -> Lightmap {
    let (width, height) = (37, 23);
    let texel = |i: u32| {
        let (x, y) = ((i % width) as f32 / 36.0, (i / width) as f32 / 22.0);
        [scale * x * x * x, scale * y, scale * 0.001 * (1.0 - x)]
    };
    Lightmap { width, height, texels: (0..width * height).map(texel).collect() }
}

/// Each channel is within `share` of its texel's largest, or `least`.
#[track_caller]
fn agree(map: &Lightmap, read: impl IntoIterator<Item = [f32; 3]>, share: f32, least: f32) {
    let read: Vec<_> = read.into_iter().collect();
    assert_eq!(read.len(), map.texels.len());
    for (index, (&meant, &read)) in map.texels.iter().zip(&read).enumerate() {
        let largest = meant.iter().fold(0.0_f32, |m, &c| m.max(c));
        for (meant, read) in meant.iter().zip(read) {
            let apart = (meant - read).abs();
            assert!(apart <= (share * largest).max(least), "texel {index}: {read} for {meant} of {largest}");
        }
    }
}

fn size(picture: &image::DynamicImage) -> (u32, u32) {
    (picture.width(), picture.height())
}

const SCALES: [f32; 4] = [0.01, 1.0, 37.0, 60_000.0];

#[test]
fn exr_reads_back() {
    for scale in SCALES {
        let map = map(scale);
        let bytes = encode_sidecar(&map, SidecarForm::Exr).unwrap();
        let image = exr::prelude::read()
            .no_deep_data()
            .largest_resolution_level()
            .rgb_channels(
                |size, _| (size.width(), vec![[0.0_f32; 3]; size.area()]),
                |(width, texels): &mut (usize, Vec<[f32; 3]>), at, (r, g, b): (f32, f32, f32)| {
                    texels[at.y() * *width + at.x()] = [r, g, b];
                },
            )
            .first_valid_layer()
            .all_attributes()
            .from_buffered(std::io::Cursor::new(bytes))
            .unwrap();
        // Halves have 11 bits; below 2⁻¹⁴ they step by 2⁻²⁴.
        agree(&map, image.layer_data.channel_data.pixels.1, 1.0 / 2048.0, 2.0_f32.powi(-25));
    }
}

#[test]
fn hdr_reads_back() {
    for scale in SCALES {
        let map = map(scale);
        let bytes = encode_sidecar(&map, SidecarForm::Hdr).unwrap();
        assert!(bytes.starts_with(b"#?RADIANCE"));
        let picture = image::load_from_memory_with_format(&bytes, image::ImageFormat::Hdr).unwrap();
        assert_eq!(size(&picture), (37, 23));
        agree(&map, picture.into_rgb32f().pixels().map(|p| p.0), 1.0 / 128.0, 0.0);
    }
}

#[test]
fn ktx2_reads_back() {
    for scale in SCALES {
        let map = map(scale);
        let bytes = encode_sidecar(&map, SidecarForm::Ktx2).unwrap();
        let file = ktx2::Reader::new(bytes.as_slice()).unwrap();
        let header = file.header();
        assert_eq!(header.format, Some(ktx2::Format::E5B9G9R9_UFLOAT_PACK32));
        assert_eq!(header.supercompression_scheme, Some(ktx2::SupercompressionScheme::Zstandard));
        assert_eq!((header.pixel_width, header.pixel_height, header.level_count), (37, 23, 1));
        assert_eq!(file.transfer_function(), Some(ktx2::TransferFunction::Linear));
        assert_eq!(file.color_primaries(), Some(ktx2::ColorPrimaries::BT709));
        let samples = &file.basic_dfd().unwrap().sample_information;
        assert_eq!(samples.len(), 6);
        let keys: Vec<_> = file.key_value_data().map(|(key, _)| key.to_owned()).collect();
        assert_eq!(keys, ["KTXorientation", "KTXwriter"]);
        let level = file.levels().next().unwrap();
        let mut texels = Vec::new();
        ruzstd::decoding::StreamingDecoder::new(level.data).unwrap().read_to_end(&mut texels).unwrap();
        assert_eq!(texels.len() as u64, level.uncompressed_byte_length);
        let read = texels.chunks_exact(4).map(|bytes| {
            let bits = u32::from_le_bytes(bytes.try_into().unwrap());
            let step = 2.0_f32.powi((bits >> 27) as i32 - 24);
            [0, 9, 18].map(|first| (bits >> first & 511) as f32 * step)
        });
        agree(&map, read, 1.0 / 512.0, 2.0_f32.powi(-25));
    }
}

#[test]
fn rgbm_reads_back() {
    for scale in SCALES {
        let map = map(scale);
        let bytes = encode_sidecar(&map, SidecarForm::Rgbm).unwrap();
        let reader = png::Decoder::new(std::io::Cursor::new(&bytes)).read_info().unwrap();
        let text = &reader.info().uncompressed_latin1_text[0];
        assert_eq!(text.keyword, "RGBM range");
        let range: f32 = text.text.parse().unwrap();
        assert!(range >= scale && range < 2.0 * scale);
        let picture = image::load_from_memory(&bytes).unwrap();
        assert_eq!(size(&picture), (37, 23));
        let read = picture.into_rgba8();
        let read = read.pixels().map(|p| {
            let [r, g, b, a] = p.0.map(|byte| f32::from(byte) / 255.0);
            [r, g, b].map(|c| range * a * c)
        });
        // Half a step of a byte with the least multiplier.
        agree(&map, read, 1.0 / 128.0, 0.51 * range / 255.0 / 255.0);
    }
}

#[test]
fn black_bright_and_broken_maps() {
    for form in [SidecarForm::Exr, SidecarForm::Hdr, SidecarForm::Ktx2, SidecarForm::Rgbm] {
        for value in [0.0, 1e-40, f32::MAX] {
            let map = Lightmap { width: 1, height: 1, texels: vec![[value; 3]] };
            assert!(!encode_sidecar(&map, form).unwrap().is_empty());
        }
        let map = Lightmap { width: 1, height: 1, texels: vec![[f32::NAN; 3]] };
        assert!(encode_sidecar(&map, form).is_err());
        let repeat = map_bytes(form);
        assert_eq!(map_bytes(form), repeat);
    }
}

fn map_bytes(form: SidecarForm) -> Vec<u8> {
    encode_sidecar(&map(3.0), form).unwrap()
}
