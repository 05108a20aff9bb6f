//! Whether triangles in the plane share room.

use glam::DVec2;

use crate::geom::TriangleGrid;
use crate::geom::polygon::{clip_half_plane, orient, signed_area};

/// How deep triangles may lie in each other, as a share of the layout's longer side: what coordinates of 16 bits, or
/// of 32 after a few sums, leave at edges.
const SLACK: f64 = 5e-5;

/// Triangles that share room.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Overlap {
    /// Area that two triangles share against the area of all, at least; the search ends where it exceeds the limit.
    pub(super) share: f64,
    /// The first two found, by their indices.
    pub(super) triangles: [usize; 2],
}

/// Which of the triangles overlap, of those pairs that `count`; `None` where none do by more than slack.
///
/// Looks on until they share more than the fraction `limit` of their area.
pub(super) fn overlap(
    triangles: &[[DVec2; 3]],
    limit: f64,
    counts: impl Fn(usize, usize) -> bool,
) -> Option<Overlap> {
    let (low, high) = triangles
        .iter()
        .flatten()
        .fold((DVec2::INFINITY, DVec2::NEG_INFINITY), |(low, high), &p| (low.min(p), high.max(p)));
    let slack = SLACK * (high - low).max_element();
    let upright: Vec<[DVec2; 3]> = triangles
        .iter()
        .map(|&[a, b, c]| if orient(a, b, c) < 0.0 { [a, c, b] } else { [a, b, c] })
        .collect();
    let all: f64 = upright.iter().map(|&[a, b, c]| orient(a, b, c) / 2.0).sum();
    let grid = TriangleGrid::new(&upright);
    let mut found: Option<Overlap> = None;
    for bucket in grid.buckets() {
        for (index, &a) in bucket.iter().enumerate() {
            for &b in bucket.get(index + 1..).unwrap_or_default() {
                let (a, b) = (a as usize, b as usize);
                let (one, other) = (upright[a], upright[b]);
                let is_apart = || is_beside(one, other, slack) || is_beside(other, one, slack);
                // Of the buckets that both lie in, one counts.
                let corner = least(one).max(least(other));
                if !counts(a, b) || is_apart() || !std::ptr::eq(bucket, grid.candidates(corner)) {
                    continue;
                }
                let shared = shared_area(one, other) / all;
                let overlap = found.get_or_insert(Overlap { share: 0.0, triangles: [a, b] });
                overlap.share += shared;
                if overlap.share > limit {
                    return found;
                }
            }
        }
    }
    found
}

/// The area that two counter-clockwise triangles share.
fn shared_area(one: [DVec2; 3], other: [DVec2; 3]) -> f64 {
    let sides = (0..3).map(|k| [other[k], other[(k + 1) % 3]]);
    let shared = sides.fold(one.to_vec(), |ring, [a, b]| {
        // Inside lies to the left of a side.
        let normal = (b - a).perp();
        clip_half_plane(&ring, normal, normal.dot(a))
    });
    signed_area(&shared)
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

    fn pair(triangles: &[[DVec2; 3]]) -> Option<[usize; 2]> {
        overlap(triangles, 0.0, |_, _| true).map(|overlap| overlap.triangles)
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
        let small = 0.5 * (0.9_f64 / 50.0).powi(2) * 2500.0;
        let share = overlap(&all, 1.0, |_, _| true).expect("some").share;
        let expected =
            (small - 0.5 * (0.9_f64 / 50.0).powi(2)) / (small + 2.0 - 0.5 * (0.9_f64 / 50.0).powi(2));
        assert!((share / expected - 1.0).abs() < 1e-3, "{share} {expected}");
        assert_eq!(overlap(&all, 1.0, |_, b| b != 2500), None);
    }
}
