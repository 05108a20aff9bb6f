//! A lightmap as a picture.

use glam::Vec3;

use super::{PictureError, ToneMap, png};
use crate::raster::Lightmap;

/// The page as PNG, one pixel a texel, exposed by its bright texels ([`ToneMap::for_values`]).
///
/// A page that has fewer texels than it says is cut after its last whole row.
///
/// # Errors
///
/// [`PictureError::Encode`], for a page without texels.
pub fn lightmap_png(lightmap: &Lightmap) -> Result<Vec<u8>, PictureError> {
    let value = |texel: &[f32; 3]| Vec3::from_array(*texel).as_dvec3();
    let width = lightmap.width as usize;
    let rows = (lightmap.texels.len() / width.max(1)).min(lightmap.height as usize);
    let texels = lightmap.texels.get(..width * rows).unwrap_or_default();
    let tone = ToneMap::for_values(texels.iter().map(value));
    let pixels: Vec<u8> = texels.iter().flat_map(|t| tone.colour(value(t))).collect();
    png::encode(&pixels, (lightmap.width, rows as u32))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_keeps_its_size_and_its_top() {
        let mut texels = vec![[0.0; 3]; 6];
        texels[1] = [5.0; 3];
        let bytes = lightmap_png(&Lightmap { width: 3, height: 2, texels }).unwrap();
        let picture = image::load_from_memory(&bytes).unwrap().into_rgb8();
        assert_eq!(picture.dimensions(), (3, 2));
        assert!(picture.get_pixel(1, 0).0[0] > 150);
        assert_eq!(picture.get_pixel(1, 1).0, [0; 3]);
    }

    #[test]
    fn a_page_that_is_not_whole_does_no_harm() {
        let texels = vec![[1.0; 3]; 7];
        let cut = lightmap_png(&Lightmap { width: 3, height: u32::MAX, texels }).unwrap();
        assert_eq!(image::load_from_memory(&cut).unwrap().into_rgb8().dimensions(), (3, 2));
        assert!(lightmap_png(&Lightmap { width: 0, height: 0, texels: Vec::new() }).is_err());
    }
}
