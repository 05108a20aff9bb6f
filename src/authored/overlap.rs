//! Whether triangles in the plane share room.

use glam::DVec2;

use crate::geom::TriangleGrid;
use crate::geom::polygon::orient;

/// How deep triangles may lie in each other, as a share of the layout's longer side: what coordinates of 16 bits, or
/// of 32 after a few sums, leave at edges.
const SLACK: f64 = 5e-5;

/// The first two triangles found that overlap, by their indices.
pub(super) fn overlap(triangles: &[[DVec2; 3]]) -> Option<[usize; 2]> {
    let (low, high) = triangles
        .iter()
        .flatten()
        .fold((DVec2::INFINITY, DVec2::NEG_INFINITY), |(low, high), &p| (low.min(p), high.max(p)));
    let slack = SLACK * (high - low).max_element();
    let upright: Vec<[DVec2; 3]> = triangles
        .iter()
        .map(|&[a, b, c]| if orient(a, b, c) < 0.0 { [a, c, b] } else { [a, b, c] })
        .collect();
    let meet = |a: [DVec2; 3], b: [DVec2; 3]| !is_beside(a, b, slack) && !is_beside(b, a, slack);
    TriangleGrid::new(&upright).buckets().find_map(|bucket| {
        bucket.iter().enumerate().find_map(|(index, &a)| {
            let others = bucket.get(index + 1..).unwrap_or_default().iter();
            let found = others.copied().find(|&b| meet(upright[a as usize], upright[b as usize]));
            found.map(|b| [a as usize, b as usize])
        })
    })
}

/// Whether one of the counter-clockwise `triangle`'s sides has all of `other` outside, up to `slack`.
fn is_beside(triangle: [DVec2; 3], other: [DVec2; 3], slack: f64) -> bool {
    (0..3).any(|k| {
        let (a, b) = (triangle[k], triangle[(k + 1) % 3]);
        let side = a.distance(b);
        other.iter().all(|&p| orient(a, b, p) <= slack * side)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn triangle(corners: [(f64, f64); 3]) -> [DVec2; 3] {
        corners.map(DVec2::from)
    }

    #[test]
    fn neighbours_and_mirror_images_are_apart_and_what_pokes_in_is_not() {
        let lower = triangle([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0)]);
        // Clockwise, and off the common diagonal by rounding.
        let upper = triangle([(0.0, 0.0), (0.0, 1.0), (1.0, 1.0 - 1e-6)]);
        assert_eq!(overlap(&[lower, upper]), None);
        let poking = triangle([(0.5, 0.4), (0.4, 0.9), (0.3, 0.9)]);
        assert_eq!(overlap(&[lower, poking]), Some([0, 1]));
        assert_eq!(overlap(&[upper, lower, upper]), Some([0, 2]));
        // A triangle inside another, and lines, which have no room to share.
        assert!(overlap(&[lower, lower.map(|p| 0.5 * p + DVec2::new(0.4, 0.1))]).is_some());
        assert_eq!(overlap(&[lower, triangle([(0.2, 0.1), (0.9, 0.2), (0.2, 0.1)])]), None);
        assert_eq!(overlap(&[]), None);
    }

    /// Many triangles, of which two overlap.
    #[test]
    fn overlaps_are_found_among_many() {
        let cell = |k: u32| {
            let at = DVec2::new(f64::from(k % 50), f64::from(k / 50));
            triangle([(0.0, 0.0), (0.9, 0.0), (0.0, 0.9)]).map(|p| (p + at) / 50.0)
        };
        let mut all: Vec<[DVec2; 3]> = (0..2500).map(cell).collect();
        assert_eq!(overlap(&all), None);
        all.push(cell(1234));
        assert_eq!(overlap(&all), Some([1234, 2500]));
    }
}
