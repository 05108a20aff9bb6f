//! How dense a layout is.

use glam::{DMat2, DVec2, DVec3};

use crate::geom::polygon::orient;
use crate::geom::triangle::area_normal;

/// What is less dense along some direction than this share of its layout's mean has no area there to speak of.
pub(crate) const LEAST_STRETCH: f64 = 1e-4;

/// The layout's units a metre, by the areas of all triangles: corners in the scene and in the layout; 0 where either
/// has none.
pub(crate) fn mean_density(triangles: impl Iterator<Item = ([DVec3; 3], [DVec2; 3])>) -> f64 {
    let (scene, layout) = triangles.fold((0.0, 0.0), |(scene, layout), (points, [a, b, c])| {
        (scene + area_normal(points).length(), layout + orient(a, b, c).abs())
    });
    let density = (layout / scene).sqrt();
    if density.is_finite() { density } else { 0.0 }
}

/// The least density that a triangle's coordinates have in any direction, units a metre; `None` where the triangle
/// itself has no area.
pub(crate) fn stretch([a, b, c]: [DVec3; 3], uv: [DVec2; 3]) -> Option<f64> {
    let along = (b - a).try_normalize()?;
    let normal = (b - a).cross(c - a).try_normalize()?;
    let plane = |p: DVec3| DVec2::new(p.dot(along), p.dot(normal.cross(along)));
    let sides = DMat2::from_cols(plane(b - a), plane(c - a));
    let map = DMat2::from_cols(uv[1] - uv[0], uv[2] - uv[0]) * sides.inverse();
    map.is_finite().then(|| least_stretch(map))
}

/// The lesser singular value of a map: the least density in any direction.
pub(crate) fn least_stretch(map: DMat2) -> f64 {
    let squares = map.x_axis.length_squared() + map.y_axis.length_squared();
    let determinant = map.determinant().abs();
    let greater = (squares + (squares * squares - 4.0 * determinant * determinant).max(0.0).sqrt()) / 2.0;
    if greater > 0.0 { determinant / greater.sqrt() } else { 0.0 }
}
