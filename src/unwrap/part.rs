//! What of a surface gets a chart of its own, and how fine.

use glam::DVec2;

use crate::geom::Ring;
use crate::geom::polygon::{clip_half_plane, rectangle, signed_area};
use crate::surface::Surface;

/// A part of a surface that gets a chart of its own.
#[derive(Clone, Debug, PartialEq)]
pub struct Part {
    /// Index into the surfaces.
    pub surface: usize,
    /// The part is what of the surface lies in this convex polygon, counter-clockwise, plane coordinates, metres.
    pub outline: Ring,
    /// How much denser than others its texels lie along the frame's axes, above 0.
    pub weight: DVec2,
}

/// One part a surface: all of it, at one density.
#[must_use]
pub fn whole(surfaces: &[Surface]) -> Vec<Part> {
    let of = |(surface, s): (usize, &Surface)| {
        let (min, max) = s.extent();
        Part { surface, outline: rectangle(min, max).to_vec(), weight: DVec2::ONE }
    };
    surfaces.iter().enumerate().map(of).collect()
}

/// The area of what of a surface lies in a convex polygon, square metres.
pub(crate) fn area_within(surface: &Surface, outline: &Ring) -> f64 {
    let triangles = surface.regions.iter().flat_map(|r| &r.triangles);
    let inside = triangles.map(|&t| clip(t, outline));
    inside.map(|ring| signed_area(&ring)).sum::<f64>().abs()
}

/// What of a triangle lies in a convex polygon, counter-clockwise: the triangle itself where that is all of it.
pub(crate) fn clip(triangle: [DVec2; 3], outline: &Ring) -> Ring {
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
