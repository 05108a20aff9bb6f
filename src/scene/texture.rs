//! Textures: decoding to linear light, texture coordinates, where and how wide to look.

use std::io::Cursor;
use std::sync::OnceLock;

use glam::{DAffine2, DMat2, DVec2, DVec3, Vec3};

use super::document::{Document, TextureInfo, follow};
use super::pyramid::{Pyramid, Window, Wrap};
use super::warning::Warnings;
use super::{ImportError, Item};

/// The largest image that is decoded, texels a side and bytes.
const LARGEST_SIDE: u32 = 16384;
const MOST_BYTES: u64 = 1 << 30;

/// How an image's numbers are to be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Encoding {
    /// Colours, by the sRGB transfer function.
    Srgb,
    /// Anything else, as they stand.
    Linear,
    /// The alpha channel alone, in all three channels; 1 where the image has none.
    Alpha,
}

/// An image that a material needs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Request {
    pub(super) image: usize,
    pub(super) encoding: Encoding,
}

/// How a material looks up a texture.
#[derive(Clone, Copy, Debug)]
pub(super) struct Binding {
    /// Index into the requests, and later into the decoded textures.
    pub(super) texture: usize,
    /// Which `TEXCOORD_n`.
    pub(super) set: u32,
    /// `KHR_texture_transform`.
    transform: DAffine2,
    wrap: [Wrap; 2],
    /// Texels a window spans at least: 1, which is bilinear interpolation, or 0 for the nearest texel.
    least: f64,
}

/// Where on a triangle a texture is averaged.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    /// The corners in the world, metres.
    pub(super) corners: [DVec3; 3],
    /// The corners' texture coordinates.
    pub(super) coordinates: [DVec2; 3],
    /// The point, as weights of the corners.
    pub(super) barycentric: DVec3,
    /// The side of the square around it, metres.
    pub(super) footprint: f64,
}

/// Resolves a material's reference to a texture, and notes the image in `requests`.
/// `None`, with a warning, where the texture has no image that can be read.
pub(super) fn bind(
    document: &Document,
    info: &TextureInfo,
    encoding: Encoding,
    (from, requests, warnings): (&dyn Fn() -> Item, &mut Vec<Request>, &mut Warnings),
) -> Result<Option<Binding>, ImportError> {
    let texture = follow(&document.textures, info.index, "texture", from)?;
    let item = || Item::new("texture", info.index, texture.name.as_deref());
    let sampler = match texture.sampler {
        Some(index) => Some(follow(&document.samplers, index, "sampler", item)?),
        None => None,
    };
    let Some(image) = texture.source else {
        warnings.about(item(), "it has no PNG or JPEG image; materials that use it keep their factors alone");
        return Ok(None);
    };
    follow(&document.images, image, "image", item)?;

    let request = Request { image, encoding };
    let texture = requests.iter().position(|known| *known == request).unwrap_or_else(|| {
        requests.push(request);
        requests.len() - 1
    });
    let transform = info.extensions.transform.as_ref();
    let wrap = [sampler.and_then(|s| s.wrap_s), sampler.and_then(|s| s.wrap_t)].map(|code| match code {
        Some(33071) => Wrap::Clamp,
        Some(33648) => Wrap::Mirror,
        _ => Wrap::Repeat,
    });
    Ok(Some(Binding {
        texture,
        set: transform.and_then(|transform| transform.tex_coord).unwrap_or(info.tex_coord),
        transform: transform.map_or(DAffine2::IDENTITY, affine),
        wrap,
        least: if sampler.and_then(|s| s.mag_filter) == Some(9728) { 0.0 } else { 1.0 },
    }))
}

/// Scale, then rotation, then offset. A positive angle turns the image clockwise; the matrix printed in
/// the extension's text turns it the other way than its own example and all viewers.
fn affine(transform: &super::document::TextureTransform) -> DAffine2 {
    let (sin, cos) = transform.rotation.unwrap_or(0.0).sin_cos();
    let rotation = DMat2::from_cols(DVec2::new(cos, -sin), DVec2::new(sin, cos));
    let scale = DVec2::from_array(transform.scale.unwrap_or([1.0; 2]));
    DAffine2 {
        matrix2: rotation * DMat2::from_diagonal(scale),
        translation: DVec2::from_array(transform.offset.unwrap_or([0.0; 2])),
    }
}

impl Binding {
    /// The mean of `pyramid` over a square of the surface, laid along the texture's axes.
    ///
    /// Where the mapping shears, the square stands for the sheared one of the same extents.
    pub(super) fn average(&self, pyramid: &Pyramid, place: &Place) -> DVec3 {
        let size = pyramid.size();
        let [a, b, c] = place.coordinates.map(|uv| self.transform.transform_point2(uv) * size);
        let weights = place.barycentric;
        let centre = weights.x * a + weights.y * b + weights.z * c;

        // The gradients of both texel coordinates in the triangle's plane, texels per metre.
        let [p, q, r] = place.corners;
        let (e1, e2) = (q - p, r - p);
        let normal = e1.cross(e2);
        let (d1, d2) = (b - a, c - a);
        let inverse = normal.length_squared().recip();
        let gradient = |d1: f64, d2: f64| (d1 * e2.cross(normal) + d2 * normal.cross(e1)).length() * inverse;
        let extent = place.footprint.max(0.0) * DVec2::new(gradient(d1.x, d2.x), gradient(d1.y, d2.y));
        // A triangle without area has no gradients.
        let extent = if inverse.is_finite() { extent } else { DVec2::ZERO };
        pyramid.average(Window { centre, size: extent.max(DVec2::splat(self.least)) }, self.wrap)
    }
}

/// Decodes a PNG or JPEG.
///
/// # Errors
/// What the decoder reports, also for images of more than 16384 texels a side or 1 GiB.
pub(super) fn decode(bytes: &[u8], encoding: Encoding) -> Result<Pyramid, image::ImageError> {
    let mut reader = image::ImageReader::new(Cursor::new(bytes)).with_guessed_format()?;
    let mut limits = image::Limits::default();
    limits.max_image_width = Some(LARGEST_SIDE);
    limits.max_image_height = Some(LARGEST_SIDE);
    limits.max_alloc = Some(MOST_BYTES);
    reader.limits(limits);
    let image = reader.decode()?;
    let (width, height) = (image.width() as usize, image.height() as usize);
    if width == 0 || height == 0 {
        let parameter = image::error::ParameterErrorKind::DimensionMismatch;
        return Err(image::ImageError::Parameter(image::error::ParameterError::from_kind(parameter)));
    }
    if encoding == Encoding::Alpha {
        let texels = image.into_rgba32f();
        let alpha = |x: usize, y: usize| Vec3::splat(texels.get_pixel(x as u32, y as u32).0[3]);
        return Ok(Pyramid::new(width, height, alpha));
    }
    let pyramid = if image.color().bytes_per_pixel() > image.color().channel_count() {
        let texels = image.into_rgb32f();
        let at = |x: usize, y: usize| Vec3::from_array(texels.get_pixel(x as u32, y as u32).0);
        match encoding {
            Encoding::Linear | Encoding::Alpha => Pyramid::new(width, height, at),
            Encoding::Srgb => {
                Pyramid::new(width, height, |x, y| Vec3::from_array(at(x, y).to_array().map(linear)))
            }
        }
    } else {
        let texels = image.into_rgb8();
        let table = byte_table(encoding);
        let look_up = |byte: u8| table.get(usize::from(byte)).copied().unwrap_or_default();
        Pyramid::new(width, height, |x, y| {
            Vec3::from_array(texels.get_pixel(x as u32, y as u32).0.map(look_up))
        })
    };
    Ok(pyramid)
}

/// The sRGB transfer function (IEC 61966-2-1), from the encoded value to linear light.
fn linear(encoded: f32) -> f32 {
    if encoded <= 0.04045 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) }
}

/// The linear value of each byte.
fn byte_table(encoding: Encoding) -> &'static [f32; 256] {
    static SRGB: OnceLock<[f32; 256]> = OnceLock::new();
    static LINEAR: OnceLock<[f32; 256]> = OnceLock::new();
    let fraction = |byte: usize| byte as f32 / 255.0;
    match encoding {
        Encoding::Srgb => SRGB.get_or_init(|| std::array::from_fn(|byte| linear(fraction(byte)))),
        Encoding::Linear | Encoding::Alpha => LINEAR.get_or_init(|| std::array::from_fn(fraction)),
    }
}
