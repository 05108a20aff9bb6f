//! Points spread evenly over a bake's lit surfaces, the same every time.
//!
//! The surfaces' areas are laid end to end and cut into equal shares, a point each; where on its triangle
//! a point lies is told by the R₂ sequence (M. Roberts, "The Unreasonable Effectiveness of Quasirandom
//! Sequences", 2018), folded onto the triangle so that areas are kept (G. Turk, "Generating Random Points
//! in Triangles", Graphics Gems, 1990).

use super::{BakedScene, Place};
use crate::geom::triangle::area;

/// One over the plastic number, and its square.
const R2: [f64; 2] = [0.754_877_666_246_692_7, 0.569_840_290_998_053_2];

/// `count` places, uniform by area over all triangles with a lightmap. None where nothing has an area.
pub(super) fn places(baked: &BakedScene, count: usize) -> Vec<Place> {
    let lit = (0..baked.triangles().len()).filter(|&triangle| baked.chart(triangle).is_some());
    let mut end = 0.0;
    let ends: Vec<(usize, f64)> = lit
        .filter_map(|triangle| {
            end += area(*baked.triangles().get(triangle)?);
            Some((triangle, end))
        })
        .collect();
    let total = end;
    if total <= 0.0 {
        return Vec::new();
    }
    let place = |k: usize| {
        let at = total * (k as f64 + 0.5) / count as f64;
        let index = ends.partition_point(|&(_, end)| end <= at).min(ends.len() - 1);
        let [along, across] = R2.map(|step| (0.5 + step * k as f64).fract());
        let root = along.sqrt();
        let barycentric = [1.0 - root, root * (1.0 - across), root * across];
        ends.get(index).map(|&(triangle, _)| Place { triangle, barycentric })
    };
    (0..count).filter_map(place).collect()
}
