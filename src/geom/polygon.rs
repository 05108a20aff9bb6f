//! Planar polygons: rings, areas, point location, clipping.

use glam::DVec2;

/// A closed ring of corners, the last joined to the first. Counter-clockwise rings are outer
/// boundaries, clockwise ones holes.
pub type Ring = Vec<DVec2>;

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

/// The part of `ring` inside the rectangle from `min` to `max`.
#[must_use]
pub fn clip_rectangle(ring: &[DVec2], min: DVec2, max: DVec2) -> Ring {
    let mut ring = clip_half_plane(ring, DVec2::X, min.x);
    ring = clip_half_plane(&ring, DVec2::NEG_X, -max.x);
    ring = clip_half_plane(&ring, DVec2::Y, min.y);
    clip_half_plane(&ring, DVec2::NEG_Y, -max.y)
}
