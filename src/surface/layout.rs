//! Whether a kept layout goes on from one facet to another.

use glam::{DVec2, DVec3};

use super::facet::Facet;

/// Coordinates that differ by no more than this are one: half a texel in a page of 4096, and what 12 bits are exact to.
const SAME: f64 = 1.25e-4;

/// The affine map from a facet's plane to its texture coordinates.
pub(super) struct FacetLayout {
    corner: DVec3,
    start: DVec2,
    /// What weighs the way to the second and to the third corner.
    duals: [DVec3; 2],
    sides: [DVec2; 2],
}

impl FacetLayout {
    /// The layout of a facet that keeps its own.
    pub(super) fn of(facet: &Facet) -> Option<Self> {
        let ([a, b, c], uv) = (facet.points, facet.coordinates?);
        let (first, second) = (b - a, c - a);
        let dual = |along: DVec3, across: DVec3| {
            let dual = across.cross(facet.normal);
            dual / dual.dot(along)
        };
        let duals = [dual(first, second), dual(second, first)];
        Some(Self { corner: a, start: uv[0], duals, sides: [uv[1] - uv[0], uv[2] - uv[0]] })
    }

    /// Whether another facet's coordinates are what this map gives.
    pub(super) fn goes_on(&self, facet: &Facet) -> bool {
        let is_same = |(&p, uv): (&DVec3, DVec2)| {
            let way = p - self.corner;
            let expected =
                self.start + self.duals[0].dot(way) * self.sides[0] + self.duals[1].dot(way) * self.sides[1];
            (uv - expected).abs().max_element() <= SAME
        };
        facet.coordinates.is_some_and(|uv| facet.points.iter().zip(uv).all(is_same))
    }
}
