//! Planar polygons: rings, areas, point location, clipping.

use glam::DVec2;

/// A closed ring of corners, the last joined to the first. Counter-clockwise rings are outer
/// boundaries, clockwise ones holes.
pub type Ring = Vec<DVec2>;

/// The corners of the rectangle from `min` to `max`, counter-clockwise from `min`.
#[must_use]
pub fn rectangle(min: DVec2, max: DVec2) -> [DVec2; 4] {
    [min, DVec2::new(max.x, min.y), max, DVec2::new(min.x, max.y)]
}

/// Twice the signed area of triangle `a b c`; positive when counter-clockwise.
#[must_use]
pub fn orient(a: DVec2, b: DVec2, c: DVec2) -> f64 {
    (b - a).perp_dot(c - a)
}

/// Signed area of a ring, square metres; negative for holes.
#[must_use]
pub fn signed_area(ring: &[DVec2]) -> f64 {
    let Some(&origin) = ring.first() else { return 0.0 };
    ring.windows(2).map(|e| (e[0] - origin).perp_dot(e[1] - origin)).sum::<f64>() / 2.0
}

/// Signed area of outer rings and holes together.
#[must_use]
pub fn area(rings: &[Ring]) -> f64 {
    rings.iter().map(|r| signed_area(r)).sum()
}

/// Whether `p` lies inside by the even-odd rule; points on an edge may fall either way.
#[must_use]
pub fn contains(rings: &[Ring], p: DVec2) -> bool {
    let mut inside = false;
    for ring in rings {
        for i in 0..ring.len() {
            let (a, b) = (ring[i], ring[(i + 1) % ring.len()]);
            if (a.y > p.y) != (b.y > p.y) && p.x < a.x + (p.y - a.y) * (b.x - a.x) / (b.y - a.y) {
                inside = !inside;
            }
        }
    }
    inside
}

/// The point of segment `a b` nearest to `p`.
#[must_use]
pub fn nearest_on_segment(a: DVec2, b: DVec2, p: DVec2) -> DVec2 {
    let d = b - a;
    let length_squared = d.length_squared();
    if length_squared == 0.0 {
        return a;
    }
    a + d * ((p - a).dot(d) / length_squared).clamp(0.0, 1.0)
}

/// Whether `p` lies in a convex, counter-clockwise ring or on it.
#[must_use]
pub fn is_in_convex(ring: &[DVec2], p: DVec2) -> bool {
    ring.iter().zip(ring.iter().cycle().skip(1)).all(|(&a, &b)| orient(a, b, p) >= 0.0)
}

/// The part of `ring` on the side of the line where `normal · p ≥ offset` (Sutherland and Hodgman 1974).
///
/// A concave ring that falls apart stays joined by edges along the line; they enclose no area.
#[must_use]
pub fn clip_half_plane(ring: &[DVec2], normal: DVec2, offset: f64) -> Ring {
    let mut out = Ring::with_capacity(ring.len() + 2);
    for i in 0..ring.len() {
        let (a, b) = (ring[i], ring[(i + 1) % ring.len()]);
        let (ha, hb) = (normal.dot(a) - offset, normal.dot(b) - offset);
        if ha >= 0.0 {
            out.push(a);
        }
        if (ha >= 0.0) != (hb >= 0.0) {
            out.push(a.lerp(b, ha / (ha - hb)));
        }
    }
    out
}

/// What of a triangle lies in a convex polygon, counter-clockwise: the triangle itself where that is all of it.
#[must_use]
pub fn clip_triangle(triangle: [DVec2; 3], outline: &[DVec2]) -> Ring {
    let edges = outline.iter().zip(outline.iter().cycle().skip(1));
    edges.fold(triangle.to_vec(), |ring, (&a, &b)| {
        // Inside lies to the left of an edge.
        let normal = (b - a).perp();
        if ring.iter().all(|p| normal.dot(*p - a) >= 0.0) {
            ring
        } else {
            clip_half_plane(&ring, normal, normal.dot(a))
        }
    })
}

/// The part of `ring` inside the rectangle from `min` to `max`.
#[must_use]
pub fn clip_rectangle(ring: &[DVec2], min: DVec2, max: DVec2) -> Ring {
    let mut ring = clip_half_plane(ring, DVec2::X, min.x);
    ring = clip_half_plane(&ring, DVec2::NEG_X, -max.x);
    ring = clip_half_plane(&ring, DVec2::Y, min.y);
    clip_half_plane(&ring, DVec2::NEG_Y, -max.y)
}

/// Corners of a closed ring that remain when those within `tolerance` metres of the line between
/// their kept neighbours are removed, as ascending indices (Douglas and Peucker 1973).
///
/// Corners are kept or removed, never moved. The first cut is made between two corners that are
/// surely kept: the one farthest from the ring's first corner, and the one farthest from that. A
/// ring that would fall below three corners is returned whole.
#[must_use]
pub fn simplified_corners(ring: &[DVec2], tolerance: f64) -> Vec<usize> {
    let count = ring.len();
    let Some(&first) = ring.first() else { return Vec::new() };
    let farthest = |from: DVec2| {
        let mut best = (0, -1.0);
        for (i, p) in ring.iter().enumerate() {
            let distance = p.distance_squared(from);
            if distance > best.1 {
                best = (i, distance);
            }
        }
        best.0
    };
    let a = farthest(first);
    let b = farthest(ring[a]);
    let (low, high) = (a.min(b), a.max(b));
    let mut kept = vec![false; count];
    kept[low] = true;
    kept[high] = true;
    // Spans of corners, counted past the end where they wrap round.
    let mut spans = vec![(low, high), (high, low + count)];
    while let Some((from, to)) = spans.pop() {
        let (start, end) = (ring[from % count], ring[to % count]);
        let mut best = (from, tolerance);
        for i in from + 1..to {
            let p = ring[i % count];
            let distance = nearest_on_segment(start, end, p).distance(p);
            if distance > best.1 {
                best = (i, distance);
            }
        }
        if best.0 != from {
            kept[best.0 % count] = true;
            spans.push((from, best.0));
            spans.push((best.0, to));
        }
    }
    let corners: Vec<usize> = (0..count).filter(|&i| kept[i]).collect();
    if corners.len() < 3 { (0..count).collect() } else { corners }
}

/// As [`simplified_corners`], with a tolerance small enough that the ring's area changes by no more
/// than `area_change` of itself.
#[must_use]
pub fn simplified_corners_keeping_area(ring: &[DVec2], tolerance: f64, area_change: f64) -> Vec<usize> {
    const ATTEMPTS: usize = 5;
    let whole = signed_area(ring);
    let mut tolerance = tolerance;
    for _ in 0..ATTEMPTS {
        let corners = simplified_corners(ring, tolerance);
        let rest: Ring = corners.iter().map(|&i| ring[i]).collect();
        if (signed_area(&rest) - whole).abs() <= area_change * whole.abs() {
            return corners;
        }
        tolerance /= 16.0;
    }
    (0..ring.len()).collect()
}

/// The part of segment `a b` inside the rectangle from `min` to `max`, `None` where they do not meet
/// (Liang and Barsky 1984).
#[must_use]
pub fn clip_segment(a: DVec2, b: DVec2, min: DVec2, max: DVec2) -> Option<[DVec2; 2]> {
    let d = b - a;
    let (mut enter, mut leave) = (0.0_f64, 1.0_f64);
    for (start, step, low, high) in [(a.x, d.x, min.x, max.x), (a.y, d.y, min.y, max.y)] {
        if step == 0.0 {
            if start < low || start > high {
                return None;
            }
            continue;
        }
        let (t0, t1) = ((low - start) / step, (high - start) / step);
        enter = enter.max(t0.min(t1));
        leave = leave.min(t0.max(t1));
    }
    if enter > leave || enter.is_nan() || leave.is_nan() {
        return None;
    }
    let at = |t: f64| if t == 1.0 { b } else { a + d * t };
    Some([at(enter), at(leave)])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square_with(points_per_side: usize) -> Ring {
        let corners = [DVec2::ZERO, DVec2::new(3.0, 0.0), DVec2::new(3.0, 2.0), DVec2::new(0.0, 2.0)];
        (0..4)
            .flat_map(|side| {
                let (a, b) = (corners[side], corners[(side + 1) % 4]);
                (0..points_per_side).map(move |i| a.lerp(b, i as f64 / points_per_side as f64))
            })
            .collect()
    }

    #[test]
    fn collinear_corners_go_and_corners_stay() {
        for points in [1, 2, 50, 20_000] {
            let mut ring = square_with(points);
            ring.rotate_left(points / 3); // the first point is no corner
            let kept: Vec<DVec2> = simplified_corners(&ring, 1e-9).into_iter().map(|i| ring[i]).collect();
            assert_eq!(kept.len(), 4, "{points} points a side");
            assert!((signed_area(&kept) - 6.0).abs() < 1e-9);
        }
    }

    #[test]
    fn a_circle_keeps_its_area() {
        let ring: Ring =
            (0..1000).map(|i| DVec2::from_angle(f64::from(i) * 0.001 * std::f64::consts::TAU)).collect();
        let kept = simplified_corners_keeping_area(&ring, 1e-2, 1e-6);
        let rest: Ring = kept.iter().map(|&i| ring[i]).collect();
        assert!((signed_area(&rest) / signed_area(&ring) - 1.0).abs() <= 1e-6);
        assert!(simplified_corners(&ring, 1e-2).len() < 100);
    }

    #[test]
    fn degenerate_rings_come_back_whole() {
        assert!(simplified_corners(&[], 1.0).is_empty());
        assert_eq!(simplified_corners(&[DVec2::ONE; 5], 1.0).len(), 5);
        assert_eq!(simplified_corners(&[DVec2::ZERO, DVec2::X, DVec2::X * 2.0], 1e-9).len(), 3);
    }

    #[test]
    fn segments_are_clipped_to_the_rectangle() {
        let (min, max) = (DVec2::ZERO, DVec2::ONE);
        let clip = |a: (f64, f64), b: (f64, f64)| clip_segment(a.into(), b.into(), min, max);
        assert_eq!(clip((-1.0, 0.5), (2.0, 0.5)), Some([DVec2::new(0.0, 0.5), DVec2::new(1.0, 0.5)]));
        assert_eq!(clip((0.2, 0.2), (0.4, 0.9)), Some([DVec2::new(0.2, 0.2), DVec2::new(0.4, 0.9)]));
        assert_eq!(clip((-1.0, 1.5), (2.0, 1.5)), None);
        assert_eq!(clip((-1.0, 0.5), (0.5, 2.1)), None);
    }
}
