//! Blocks of texels over which an emitter's light is smooth, although something stands between.
//!
//! Far from what casts it, a penumbra is wider than a block of many texels; there a few exact
//! values and the biquadratic surface through them stand for all. What is close to the block
//! may cast a narrow shadow that no sample sees: such blocks are left to be halved.

use glam::{DVec2, DVec3};

use crate::geom::Bounds;
use crate::light::luminance;
use crate::solve::emitter::Emitter;
use crate::solve::umbra::Occluder;

/// A penumbra has to be wider than this fraction of the block's diagonal: samples lie half a side apart.
const WIDTH: f64 = 0.5;

/// What the interpolation may miss in the points that test it, as a fraction of the light there.
const TOLERANCE: f64 = 0.004;

/// Light below this fraction of the scene's typical light is judged by that.
const DIM: f64 = 0.5;

/// The centre may differ by this fraction from the mean of the corners before more is looked at.
const LIKELY: f64 = 0.2;

/// Whether the shadows of all `occluders` are wide against the block with these corners.
pub(super) fn is_soft(corners: &[DVec3], emitter: &Emitter, occluders: &[Occluder], diagonal: f64) -> bool {
    let Some(width) = emitter.width() else { return false };
    let block = Bounds::of(corners.iter().copied());
    let (centre, size) = (block.centre(), block.diagonal());
    let to_emitter = emitter.centre(centre, diagonal).distance(centre);
    occluders.iter().all(|occluder| {
        let bounds = Bounds::of(occluder.corners.iter().copied());
        let near = (bounds.distance(centre) - 0.5 * size).max(0.0);
        near >= to_emitter || width * near >= WIDTH * size * (to_emitter - near)
    })
}

/// A biquadratic surface over a rectangle.
pub(super) struct SmoothBlock {
    min: DVec2,
    size: DVec2,
    /// Row by row, three a row.
    values: [DVec3; 9],
}

impl SmoothBlock {
    /// Fits the surface to `light`, and tests it; `None` where it misses.
    pub(super) fn fit(
        (min, max): (DVec2, DVec2),
        typical: f64,
        mut light: impl FnMut(DVec2) -> DVec3,
    ) -> Option<Self> {
        let size = max - min;
        let mut at = |x: f64, y: f64| light(min + size * DVec2::new(x, y));
        let corners = [at(0.0, 0.0), at(1.0, 0.0), at(0.0, 1.0), at(1.0, 1.0)];
        let middle = at(0.5, 0.5);
        let bound = |tolerance: f64, value: DVec3| tolerance * luminance(value).max(DIM * typical);
        let mean = 0.25 * corners.iter().sum::<DVec3>();
        if luminance((mean - middle).abs()) > bound(LIKELY, middle) {
            return None;
        }
        let [a, b, c, d] = corners;
        let values = [a, at(0.5, 0.0), b, at(0.0, 0.5), middle, at(1.0, 0.5), c, at(0.5, 1.0), d];
        let block = Self { min, size, values };
        for (x, y) in [(0.25, 0.25), (0.75, 0.25), (0.25, 0.75), (0.75, 0.75)] {
            let exact = at(x, y);
            let error = luminance((block.at(min + size * DVec2::new(x, y)) - exact).abs());
            if error > bound(TOLERANCE, exact) {
                return None;
            }
        }
        Some(block)
    }

    /// The surface's value.
    pub(super) fn at(&self, p: DVec2) -> DVec3 {
        let t = ((p - self.min) / self.size).clamp(DVec2::ZERO, DVec2::ONE);
        let quadratic = |t: f64| [(1.0 - t) * (1.0 - 2.0 * t), 4.0 * t * (1.0 - t), t * (2.0 * t - 1.0)];
        let (x, y) = (quadratic(t.x), quadratic(t.y));
        (0..9).map(|k| self.values[k] * x[k % 3] * y[k / 3]).sum::<DVec3>().max(DVec3::ZERO)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_smooth_slope_is_taken_and_an_edge_is_not() {
        let extent = (DVec2::ZERO, DVec2::new(2.0, 1.0));
        let slope = |p: DVec2| DVec3::splat(1.0 + 0.3 * p.x - 0.1 * p.x * p.y + 0.05 * p.y * p.y);
        let block = SmoothBlock::fit(extent, 1.0, slope).unwrap();
        let p = DVec2::new(1.3, 0.9);
        assert!((block.at(p) - slope(p)).length() < 1e-9);
        let edge = |p: DVec2| DVec3::splat(if p.x < 0.7 { 0.0 } else { 1.0 });
        assert!(SmoothBlock::fit(extent, 1.0, edge).is_none());
    }
}
