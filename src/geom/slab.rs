//! A place with extent: flat, or with depth.

use glam::DVec3;

/// A convex polygon, or the hull of two parallel ones.
#[derive(Clone, Debug)]
pub struct Slab {
    /// Those of the lower polygon, then those of the upper one, if there is one.
    corners: Vec<DVec3>,
    /// Corners of the lower polygon.
    low: usize,
}

impl Slab {
    /// A convex polygon of these corners, in order.
    #[must_use]
    pub fn flat(corners: Vec<DVec3>) -> Self {
        Self { low: corners.len(), corners }
    }

    /// What lies between a convex polygon, whose corners come in order, and the same moved by `up`.
    #[must_use]
    pub fn thick(mut corners: Vec<DVec3>, up: DVec3) -> Self {
        let low = corners.len();
        corners.extend_from_within(..);
        corners[low..].iter_mut().for_each(|p| *p += up);
        Self { corners, low }
    }

    /// The same elsewhere.
    #[must_use]
    pub fn moved(&self, by: DVec3) -> Self {
        Self { corners: self.corners.iter().map(|&p| p + by).collect(), low: self.low }
    }

    /// All corners: what is convex and holds these holds the slab.
    #[must_use]
    pub fn corners(&self) -> &[DVec3] {
        &self.corners
    }

    /// The one polygon, or the two.
    #[must_use]
    pub fn faces(&self) -> Vec<&[DVec3]> {
        let (low, high) = self.corners.split_at(self.low);
        if high.is_empty() { vec![low] } else { vec![low, high] }
    }
}
