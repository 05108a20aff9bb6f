//! A plane with coordinates of its own.

use glam::{DVec2, DVec3};

/// A right-handed orthonormal frame: points of the plane are `origin + x u + y v`, `u × v = normal`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// The plane's origin, world space, metres.
    pub origin: DVec3,
    /// Unit vector of the first coordinate.
    pub u: DVec3,
    /// Unit vector of the second coordinate.
    pub v: DVec3,
    /// Unit normal; the front side.
    pub normal: DVec3,
}

impl Frame {
    /// The plane through `origin` with unit `normal` whose first axis follows `along` as closely as it can.
    ///
    /// Where `along` is parallel to `normal` (or zero), any axis is taken.
    #[must_use]
    pub fn new(origin: DVec3, normal: DVec3, along: DVec3) -> Self {
        let u = (along - normal * normal.dot(along))
            .try_normalize()
            .unwrap_or_else(|| normal.any_orthonormal_vector());
        Self { origin, u, v: normal.cross(u), normal }
    }

    /// The plane coordinates of `point`'s foot, metres.
    #[must_use]
    pub fn project(&self, point: DVec3) -> DVec2 {
        let d = point - self.origin;
        DVec2::new(d.dot(self.u), d.dot(self.v))
    }

    /// The world-space point at plane coordinates `p`.
    #[must_use]
    pub fn lift(&self, p: DVec2) -> DVec3 {
        self.origin + p.x * self.u + p.y * self.v
    }

    /// Signed distance of `point` from the plane, metres; positive in front.
    #[must_use]
    pub fn height(&self, point: DVec3) -> f64 {
        (point - self.origin).dot(self.normal)
    }

    /// The direction that `(u, v)` of the unit square stands for, cosine-distributed about the normal: `u` turns
    /// round it, `v` goes from it (0) to the plane (1).
    #[must_use]
    pub fn cosine_direction(&self, u: f64, v: f64) -> DVec3 {
        let (sin, cos) = (std::f64::consts::TAU * u).sin_cos();
        v.sqrt() * (cos * self.u + sin * self.v) + (1.0 - v).sqrt() * self.normal
    }

    /// The same plane seen from behind: `v` and the normal turn round, so `lift` takes `(x, −y)`.
    #[must_use]
    pub fn flipped(&self) -> Self {
        Self { origin: self.origin, u: self.u, v: -self.v, normal: -self.normal }
    }
}
