//! Triangles in space.

use glam::DVec3;

/// Twice the area times the unit normal; zero for a degenerate triangle.
#[must_use]
pub fn area_normal(t: [DVec3; 3]) -> DVec3 {
    (t[1] - t[0]).cross(t[2] - t[0])
}

/// Area, square metres.
#[must_use]
pub fn area(t: [DVec3; 3]) -> f64 {
    area_normal(t).length() / 2.0
}
