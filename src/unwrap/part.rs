//! What of a surface gets a chart of its own, and how fine.

use glam::DVec2;

use crate::geom::Ring;
use crate::geom::polygon::{clip_triangle, rectangle, signed_area};
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
    let inside = triangles.map(|&t| clip_triangle(t, outline));
    inside.map(|ring| signed_area(&ring)).sum::<f64>().abs()
}
