//! Whether triangles in the plane share room.

use std::ops::ControlFlow;

use glam::DVec2;

use crate::geom::TriangleGrid;
use crate::geom::polygon::{clip_triangle, orient, signed_area};

/// How deep triangles may lie in each other, as a share of the layout's longer side: what coordinates of 16 bits, or
/// of 32 after a few sums, leave at edges.
const SLACK: f64 = 5e-5;

/// Calls `visit` with each two triangles (their indices) that overlap by more than slack, and the area that they share,
/// until it breaks off.
pub(super) fn overlaps(
    triangles: &[[DVec2; 3]],
    mut visit: impl FnMut([usize; 2], f64) -> ControlFlow<()>,
) -> ControlFlow<()> {
    let (low, high) = triangles
        .iter()
        .flatten()
        .fold((DVec2::INFINITY, DVec2::NEG_INFINITY), |(low, high), &p| (low.min(p), high.max(p)));
    let slack = SLACK * (high - low).max_element();
    let upright: Vec<[DVec2; 3]> = triangles
        .iter()
        .map(|&[a, b, c]| if orient(a, b, c) < 0.0 { [a, c, b] } else { [a, b, c] })
        .collect();
    let grid = TriangleGrid::new(&upright);
    for bucket in grid.buckets() {
        for (index, &a) in bucket.iter().enumerate() {
            for &b in bucket.get(index + 1..).unwrap_or_default() {
                let (a, b) = (a as usize, b as usize);
                let (one, other) = (upright[a], upright[b]);
                let is_apart = || is_beside(one, other, slack) || is_beside(other, one, slack);
                // Of the buckets that both lie in, one counts.
                let corner = least(one).max(least(other));
                if !is_apart() && std::ptr::eq(bucket, grid.candidates(corner)) {
                    visit([a, b], signed_area(&clip_triangle(one, &other)))?;
                }
            }
        }
    }
    ControlFlow::Continue(())
}

fn least([a, b, c]: [DVec2; 3]) -> DVec2 {
    a.min(b).min(c)
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

    fn found(triangles: &[[DVec2; 3]]) -> Vec<([usize; 2], f64)> {
        let mut found = Vec::new();
        let end = overlaps(triangles, |pair, area| {
            found.push((pair, area));
            ControlFlow::Continue(())
        });
        assert!(end.is_continue());
        found
    }

    fn pair(triangles: &[[DVec2; 3]]) -> Option<[usize; 2]> {
        found(triangles).first().map(|&(pair, _)| pair)
    }

    #[test]
    fn neighbours_and_mirror_images_are_apart_and_what_pokes_in_is_not() {
        let lower = triangle([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0)]);
        // Clockwise, and off the common diagonal by rounding.
        let upper = triangle([(0.0, 0.0), (0.0, 1.0), (1.0, 1.0 - 1e-6)]);
        assert_eq!(pair(&[lower, upper]), None);
        let poking = triangle([(0.5, 0.4), (0.4, 0.9), (0.3, 0.9)]);
        assert_eq!(pair(&[lower, poking]), Some([0, 1]));
        assert_eq!(pair(&[upper, lower, upper]), Some([0, 2]));
        // A triangle inside another, and lines, which have no room to share.
        assert!(pair(&[lower, lower.map(|p| 0.5 * p + DVec2::new(0.4, 0.1))]).is_some());
        assert_eq!(pair(&[lower, triangle([(0.2, 0.1), (0.9, 0.2), (0.2, 0.1)])]), None);
        assert_eq!(pair(&[]), None);
    }

    /// Many triangles, of which some overlap: the share is counted once, however many buckets they lie in.
    #[test]
    fn overlaps_are_found_and_measured_among_many() {
        let cell = |k: u32| {
            let at = DVec2::new(f64::from(k % 50), f64::from(k / 50));
            triangle([(0.0, 0.0), (0.9, 0.0), (0.0, 0.9)]).map(|p| (p + at) / 50.0)
        };
        let mut all: Vec<[DVec2; 3]> = (0..2500).map(cell).collect();
        assert_eq!(pair(&all), None);
        all.push(cell(1234));
        assert_eq!(pair(&all), Some([1234, 2500]));
        // Over all of the square: the room of all the others is shared.
        all[2500] = triangle([(0.0, 0.0), (2.0, 0.0), (0.0, 2.0)]);
        let shared: f64 = found(&all).iter().map(|(_, area)| area).sum();
        let expected = 2500.0 * 0.5 * (0.9_f64 / 50.0).powi(2);
        assert!((shared / expected - 1.0).abs() < 1e-9, "{shared} {expected}");
        assert!(overlaps(&all, |_, _| ControlFlow::Break(())).is_break());
    }
}
