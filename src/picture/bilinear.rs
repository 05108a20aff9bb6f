//! Looking a value up in a page.

use glam::{DVec2, DVec3, Vec3};

use crate::raster::Lightmap;

/// The page's value at `at`: bilinear, clamped to the edge, (0, 0) the top left corner, texel centres at
/// ((x + 1/2) / width, (y + 1/2) / height).
pub(crate) fn sample(page: &Lightmap, at: DVec2) -> DVec3 {
    let size = DVec2::new(page.width.into(), page.height.into());
    let last = (size - 1.0).max(DVec2::ZERO);
    let place = (at * size - 0.5).clamp(DVec2::ZERO, last);
    let low = place.floor();
    let high = (low + 1.0).min(last);
    let fraction = place - low;
    let texel = |x: f64, y: f64| {
        let index = y as usize * page.width as usize + x as usize;
        page.texels.get(index).map_or(DVec3::ZERO, |&texel| Vec3::from_array(texel).as_dvec3())
    };
    let row = |y| texel(low.x, y).lerp(texel(high.x, y), fraction.x);
    row(low.y).lerp(row(high.y), fraction.y)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn between_texels_it_is_linear_and_beyond_the_edge_constant() {
        let texels = [1.0, 3.0, 5.0, 11.0].map(|v: f32| [v, 0.0, 0.0]).to_vec();
        let page = Lightmap { width: 2, height: 2, texels };
        let red = |x, y| sample(&page, DVec2::new(x, y)).x;
        assert_eq!([red(0.25, 0.25), red(0.75, 0.25), red(0.25, 0.75)], [1.0, 3.0, 5.0]);
        assert_eq!([red(0.5, 0.25), red(0.5, 0.5)], [2.0, 5.0]);
        assert_eq!([red(-3.0, 0.0), red(1.0, 9.0)], [1.0, 11.0]);
    }
}
