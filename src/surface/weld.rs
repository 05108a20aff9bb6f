//! Vertices at one place become one, so that triangles that share an edge know it.
//!
//! Exporters repeat a position for each normal and texture coordinate, and f32 arithmetic along the
//! way leaves copies a few units in the last place apart.

use std::collections::HashMap;

use glam::DVec3;

use crate::geom::Bounds;

/// How far apart two copies of one position may be, metres: the unit in the last place of an f32 at
/// the largest coordinate, twice; but not more than a millionth of the part's size, since a part far
/// from the origin may well have been moved there in f64, and not less than f64 can tell apart.
pub(super) fn position_noise(bounds: Bounds) -> f64 {
    let size = bounds.diagonal();
    let largest = bounds.min.abs().max(bounds.max.abs()).max_element();
    let f32_step = largest * 2.0 * f64::from(f32::EPSILON);
    f32_step.min(1e-6 * size).max(1e-8 * size).max(4.0 * largest * f64::EPSILON)
}

/// For each position the index of the first one within `tolerance` (above 0) of it; itself where
/// there is none. A position that is not finite stays alone.
pub(super) fn weld(positions: &[DVec3], low: DVec3, tolerance: f64) -> Vec<u32> {
    let cell = 4.0 * tolerance;
    let key = |p: DVec3| {
        let q = ((p - low) / cell).floor();
        [q.x as i64, q.y as i64, q.z as i64]
    };
    // Looked up, never walked: the hash's order has no say.
    let mut cells: HashMap<[i64; 3], Vec<u32>> = HashMap::new();
    let mut first = Vec::with_capacity(positions.len());
    for (&p, id) in positions.iter().zip(0_u32..) {
        let found = if p.is_finite() {
            let (from, to) = (key(p - tolerance), key(p + tolerance));
            let mut best: Option<u32> = None;
            for x in from[0]..=to[0] {
                for y in from[1]..=to[1] {
                    for z in from[2]..=to[2] {
                        for &other in cells.get(&[x, y, z]).map_or(&[][..], Vec::as_slice) {
                            if positions[other as usize].distance(p) <= tolerance {
                                best = Some(best.map_or(other, |b| b.min(other)));
                            }
                        }
                    }
                }
            }
            best
        } else {
            None
        };
        if found.is_none() && p.is_finite() {
            cells.entry(key(p)).or_default().push(id);
        }
        first.push(found.unwrap_or(id));
    }
    first
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn copies_are_found_across_cells() {
        let p = DVec3::new(0.3, -7.0, 2.0);
        let step = DVec3::splat(5e-7);
        let positions = [p, p + step, p - step, p + DVec3::X, DVec3::NAN, p];
        assert_eq!(weld(&positions, DVec3::splat(-10.0), 1e-6), [0, 0, 0, 3, 4, 0]);
    }

    #[test]
    fn noise_follows_the_size_far_from_the_origin() {
        let near = position_noise(Bounds::of([DVec3::ZERO, DVec3::ONE]));
        let far = position_noise(Bounds::of([DVec3::splat(1e6), DVec3::splat(1e6 + 1.0)]));
        assert!(near > 1e-8 && near < 1e-6, "{near}");
        assert!(far < 1e-5, "{far}");
    }
}
