//! What packing needs to know of a surface.

use glam::DVec2;

use super::part::Part;
use crate::geom::Ring;
use crate::geom::polygon::{clip_triangle, orient};
use crate::surface::Surface;

/// The outline of a surface's part in the surface's plane, metres.
#[derive(Clone, Debug)]
pub(super) struct Shape {
    /// The least corner of the bounding rectangle.
    pub(super) corner: DVec2,
    /// The bounding rectangle's sides.
    pub(super) extent: DVec2,
    /// What of the regions' triangles lies in the part; together all of it.
    pub(super) triangles: Vec<[DVec2; 3]>,
    /// The area of the triangles, square metres.
    pub(super) area: f64,
    /// How much denser than others its texels lie along the frame's axes.
    pub(super) weight: DVec2,
    /// Index of the surface.
    pub(super) surface: usize,
    /// The part's outline.
    pub(super) outline: Ring,
}

impl Shape {
    /// The shape of a part. One that has no finite extent becomes a point, which gets a chart of one texel.
    pub(super) fn of(part: &Part, surface: &Surface) -> Self {
        let whole = surface.regions.iter().flat_map(|r| r.triangles.iter().copied());
        let triangles: Vec<[DVec2; 3]> = whole
            .flat_map(|t| {
                let ring = clip_triangle(t, &part.outline);
                (2..ring.len()).map(move |k| [ring[0], ring[k - 1], ring[k]]).collect::<Vec<_>>()
            })
            .collect();
        Self {
            surface: part.surface,
            outline: part.outline.clone(),
            ..Self::of_triangles(triangles, part.weight)
        }
    }

    /// The shape of triangles in a plane. Without finite extent they become a point, which gets a chart of one texel.
    pub(super) fn of_triangles(triangles: Vec<[DVec2; 3]>, weight: DVec2) -> Self {
        let corners = triangles.iter().flatten();
        let (low, high) =
            corners.fold((DVec2::INFINITY, DVec2::NEG_INFINITY), |(low, high), &p| (low.min(p), high.max(p)));
        let area = triangles.iter().map(|t| orient(t[0], t[1], t[2]).abs() / 2.0).sum();
        let extent = high - low;
        let point = Self {
            corner: DVec2::ZERO,
            extent: DVec2::ZERO,
            triangles: Vec::new(),
            area: 0.0,
            weight,
            surface: 0,
            outline: Ring::new(),
        };
        if extent.is_finite() && extent.cmpge(DVec2::ZERO).all() {
            Self { corner: low, extent, triangles, area, ..point }
        } else {
            point
        }
    }

    /// The texels that it takes up at one texel a metre.
    pub(super) fn weighed_area(&self) -> f64 {
        self.area * self.weight.element_product()
    }

    /// The convex hull of the triangles, counter-clockwise, without collinear corners
    /// (Andrew's monotone chain, 1979); fewer than three corners if there is no area.
    #[cfg(feature = "xatlas")]
    pub(super) fn convex_hull(&self) -> Vec<DVec2> {
        let mut points: Vec<DVec2> = self.triangles.iter().flatten().copied().collect();
        points.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
        points.dedup();
        let mut hull = half_hull(points.iter().copied());
        let upper = half_hull(points.iter().rev().copied());
        hull.pop();
        hull.extend(upper);
        hull.pop();
        hull
    }
}

/// The chain that turns left only.
#[cfg(feature = "xatlas")]
fn half_hull(points: impl Iterator<Item = DVec2>) -> Vec<DVec2> {
    let mut chain: Vec<DVec2> = Vec::new();
    for point in points {
        while let [.., a, b] = chain[..] {
            if orient(a, b, point) > 0.0 {
                break;
            }
            chain.pop();
        }
        chain.push(point);
    }
    chain
}
