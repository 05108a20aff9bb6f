//! Pictures to look at: the lightmap tone-mapped, and the adaptive mesh drawn over it.
//!
//! For eyes only; nothing reads them back. Luminance `Y` is shown as `Y / (Y + m)` (Reinhard et al.,
//! "Photographic Tone Reproduction for Digital Images", SIGGRAPH 2002, without the white point), where
//! `m` is the median of the texels that hold light: half of them get less than half of the display's
//! light, and no highlight burns out. Texels that are not finite numbers are magenta.

use std::io::Cursor;

use glam::{DVec2, Vec3};
use image::{ImageError, ImageFormat, Rgb, RgbImage};

use crate::raster::Lightmap;
use crate::retriangulate::RadiosityMesh;
use crate::unwrap::Atlas;

/// What a texel looks like that holds no number.
const BROKEN: Rgb<u8> = Rgb([255, 0, 255]);

/// The mesh's edges.
const LINE: Rgb<u8> = Rgb([255, 160, 0]);

/// Luminance of linear Rec. 709 RGB.
const LUMINANCE: Vec3 = Vec3::new(0.2126, 0.7152, 0.0722);

/// The mesh's picture is enlarged up to this side, pixels, so that lines a texel apart stay apart.
const MESH_SIDE: u32 = 2048;

/// The greatest enlargement: beyond it, single texels turn into plain areas.
const MESH_SCALE: u32 = 8;

/// The lightmap, a pixel a texel. A page whose texel count does not fit its size gives the part that is there.
#[must_use]
pub fn of_lightmap(lightmap: &Lightmap) -> RgbImage {
    let middle = median_luminance(&lightmap.texels);
    let mut image = RgbImage::new(lightmap.width, lightmap.height);
    for (pixel, texel) in image.pixels_mut().zip(&lightmap.texels) {
        *pixel = tone(Vec3::from_array(*texel), middle);
    }
    image
}

/// The mesh's edges over `lightmap`, a picture of the same page by [`of_lightmap`], enlarged where it is small.
#[must_use]
pub fn of_mesh(mesh: &RadiosityMesh, atlas: &Atlas, lightmap: &RgbImage) -> RgbImage {
    let side = lightmap.width().max(lightmap.height()).max(1);
    let scale = (MESH_SIDE / side).clamp(1, MESH_SCALE);
    let mut image = enlarged(lightmap, scale);
    for (surface, chart) in mesh.surfaces.iter().zip(&atlas.charts) {
        let corner = |index: u32| {
            let vertex = surface.vertices.get(index as usize)?;
            Some(chart.texel(vertex.position) * f64::from(scale))
        };
        for &[a, b, c] in &surface.triangles {
            for (from, to) in [(a, b), (b, c), (c, a)] {
                if let (Some(from), Some(to)) = (corner(from), corner(to)) {
                    draw_line(&mut image, from, to);
                }
            }
        }
    }
    image
}

/// The picture as a PNG file.
///
/// # Errors
/// A picture without pixels.
pub fn to_png(image: &RgbImage) -> Result<Vec<u8>, ImageError> {
    let mut file = Cursor::new(Vec::new());
    image.write_to(&mut file, ImageFormat::Png)?;
    Ok(file.into_inner())
}

/// The median luminance of the texels that hold light; 0 where none does.
fn median_luminance(texels: &[[f32; 3]]) -> f32 {
    let luminance = |t: &[f32; 3]| LUMINANCE.dot(Vec3::from_array(*t));
    let mut lit: Vec<f32> = texels.iter().map(luminance).filter(|y| y.is_finite() && *y > 0.0).collect();
    let middle = lit.len() / 2;
    if lit.is_empty() {
        return 0.0;
    }
    *lit.select_nth_unstable_by(middle, f32::total_cmp).1
}

/// What `light` looks like where `middle` is half as bright as can be.
fn tone(light: Vec3, middle: f32) -> Rgb<u8> {
    if !light.is_finite() {
        return BROKEN;
    }
    let sum = LUMINANCE.dot(light) + middle;
    let shown = if sum > 0.0 { light / sum } else { Vec3::ZERO };
    Rgb(shown.to_array().map(srgb))
}

/// Linear light in `[0, 1]` as an sRGB byte (IEC 61966-2-1).
fn srgb(linear: f32) -> u8 {
    let linear = linear.clamp(0.0, 1.0);
    let encoded = if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 };
    (encoded * 255.0).round() as u8
}

/// `image` with each pixel repeated `scale` times both ways.
fn enlarged(image: &RgbImage, scale: u32) -> RgbImage {
    let (width, height) = (image.width().saturating_mul(scale), image.height().saturating_mul(scale));
    RgbImage::from_fn(width, height, |x, y| *image.get_pixel(x / scale, y / scale))
}

/// Draws the part of a line that lies in the picture; `(0, 0)` is its top left corner.
fn draw_line(image: &mut RgbImage, from: DVec2, to: DVec2) {
    let Some((from, to)) = clipped(image, from, to) else { return };
    let steps = (to - from).abs().max_element().ceil().max(1.0) as u32;
    for i in 0..=steps {
        let point = from.lerp(to, f64::from(i) / f64::from(steps));
        // A cast saturates, so a point on the left or upper rim falls on the first pixel.
        if let Some(pixel) = image.get_pixel_mut_checked(point.x as u32, point.y as u32) {
            *pixel = LINE;
        }
    }
}

/// The part of a segment inside the picture (Liang and Barsky 1984); `None` where there is none.
fn clipped(image: &RgbImage, from: DVec2, to: DVec2) -> Option<(DVec2, DVec2)> {
    if !from.is_finite() || !to.is_finite() {
        return None;
    }
    let size = DVec2::new(f64::from(image.width()), f64::from(image.height()));
    let along = to - from;
    let (mut enter, mut leave) = (0.0_f64, 1.0_f64);
    for (start, step, limit) in [(from.x, along.x, size.x), (from.y, along.y, size.y)] {
        if step == 0.0 {
            if start < 0.0 || start > limit {
                return None;
            }
            continue;
        }
        let (a, b) = (-start / step, (limit - start) / step);
        enter = enter.max(a.min(b));
        leave = leave.min(a.max(b));
    }
    (enter <= leave).then(|| (from + along * enter, from + along * leave))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::retriangulate::{MeshVertex, SurfaceMesh};
    use crate::unwrap::Chart;
    use glam::{DAffine2, DVec3};

    fn page(width: u32, height: u32, texels: Vec<[f32; 3]>) -> Lightmap {
        Lightmap { width, height, texels }
    }

    #[test]
    fn brighter_light_looks_brighter_and_nothing_burns_out() {
        let texels = [0.0, 0.1, 1.0, 10.0, 100.0].map(|y| [y; 3]).to_vec();
        let image = of_lightmap(&page(5, 1, texels));
        let greys: Vec<u8> = image.pixels().map(|p| p.0[0]).collect();
        assert!(greys.is_sorted() && greys.windows(2).all(|w| w[0] < w[1]), "{greys:?}");
        assert_eq!(greys[0], 0);
    }

    #[test]
    fn exposure_follows_the_scene() {
        let texels = vec![[0.2, 0.4, 0.1], [1.0, 0.5, 0.25]];
        let scaled = texels.iter().map(|t| t.map(|c| c * 1024.0)).collect();
        assert_eq!(of_lightmap(&page(2, 1, texels)), of_lightmap(&page(2, 1, scaled)));
    }

    #[test]
    fn broken_texels_are_plain_to_see_and_spoil_no_others() {
        let image = of_lightmap(&page(3, 1, vec![[f32::NAN, 0.0, 0.0], [1.0; 3], [f32::INFINITY; 3]]));
        assert_eq!(*image.get_pixel(0, 0), BROKEN);
        assert_eq!(
            *image.get_pixel(1, 0),
            of_lightmap(&page(1, 1, vec![[1.0; 3]])).get_pixel(0, 0).to_owned()
        );
        assert_eq!(*image.get_pixel(2, 0), BROKEN);
    }

    #[test]
    fn a_dark_page_is_black() {
        let image = of_lightmap(&page(2, 2, vec![[0.0; 3]; 4]));
        assert!(image.pixels().all(|p| p.0 == [0; 3]));
    }

    fn triangle(corners: [DVec2; 3]) -> RadiosityMesh {
        let vertex = |position| MeshVertex { position, direct: DVec3::ZERO, indirect: DVec3::ZERO };
        let surface = SurfaceMesh {
            vertices: corners.map(vertex).to_vec(),
            triangles: vec![[0, 1, 2]],
            regions: vec![0],
        };
        RadiosityMesh { surfaces: vec![surface] }
    }

    fn plain_atlas() -> Atlas {
        Atlas {
            width: 8,
            height: 8,
            texels_per_metre: 1.0,
            padding: 1,
            charts: vec![Chart { texel_from_plane: DAffine2::IDENTITY }],
        }
    }

    #[test]
    fn edges_are_drawn_where_the_chart_puts_them() {
        let mesh = triangle([DVec2::ZERO, DVec2::new(8.0, 0.0), DVec2::new(0.0, 8.0)]);
        let image = of_mesh(&mesh, &plain_atlas(), &RgbImage::new(8, 8));
        assert_eq!(image.dimensions(), (64, 64));
        assert_ne!(image.get_pixel(20, 0).0, [0; 3], "upper edge");
        assert_ne!(image.get_pixel(0, 20).0, [0; 3], "left edge");
        assert_ne!(image.get_pixel(32, 32).0, [0; 3], "hypotenuse");
        assert_eq!(image.get_pixel(50, 50).0, [0; 3], "outside");
    }

    /// Corners come from a file in the end: far away or no numbers, they cost no time and no panic.
    #[test]
    fn wild_corners_are_harmless() {
        for wild in [DVec2::splat(1e300), DVec2::splat(f64::NAN), DVec2::new(f64::INFINITY, 0.0)] {
            let mesh = triangle([DVec2::ZERO, wild, -wild]);
            let _ = of_mesh(&mesh, &plain_atlas(), &RgbImage::new(8, 8));
            let _ = of_mesh(&mesh, &plain_atlas(), &RgbImage::new(0, 0));
        }
    }
}
