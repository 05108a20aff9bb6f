//! Axis-aligned boxes in space.

use glam::DVec3;

/// An axis-aligned box, metres. [`Bounds::EMPTY`] contains nothing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// Least corner.
    pub min: DVec3,
    /// Greatest corner.
    pub max: DVec3,
}

impl Bounds {
    /// The box that contains nothing; growing it gives the grown point.
    pub const EMPTY: Self = Self { min: DVec3::INFINITY, max: DVec3::NEG_INFINITY };

    /// The least box around `points`.
    pub fn of(points: impl IntoIterator<Item = DVec3>) -> Self {
        points.into_iter().fold(Self::EMPTY, Self::with)
    }

    /// This box grown to contain `point`.
    #[must_use]
    pub fn with(self, point: DVec3) -> Self {
        Self { min: self.min.min(point), max: self.max.max(point) }
    }

    /// The least box around both.
    #[must_use]
    pub fn union(self, other: Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    /// This box with each face moved outward by `margin` metres.
    #[must_use]
    pub fn grown(self, margin: f64) -> Self {
        Self { min: self.min - margin, max: self.max + margin }
    }

    /// Whether the boxes share a point; touching counts.
    #[must_use]
    pub fn overlaps(self, other: Self) -> bool {
        self.min.cmple(other.max).all() && other.min.cmple(self.max).all()
    }

    /// The length of the diagonal, metres; 0 for an empty box.
    #[must_use]
    pub fn diagonal(self) -> f64 {
        if self.min.cmple(self.max).all() { (self.max - self.min).length() } else { 0.0 }
    }

    /// How far `point` is from the box, metres; 0 inside.
    #[must_use]
    pub fn distance(self, point: DVec3) -> f64 {
        point.clamp(self.min, self.max).distance(point)
    }

    /// The middle.
    #[must_use]
    pub fn centre(self) -> DVec3 {
        0.5 * (self.min + self.max)
    }
}
