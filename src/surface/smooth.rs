//! The normals that curved surfaces are drawn with, and the curved surface that they tell of.
//!
//! A sphere of few facets looks round because its vertices' normals are interpolated. Light that follows these
//! normals reaches places that the facets themselves hide from it: near the shadow's terminator a facet has its back
//! to light that the normals still face, and shows dark blotches. So light is received a little above the facet,
//! where the curved surface would be: the place is projected onto the planes of tangency in the three corners, and
//! what comes of it is interpolated (J. Hanika, "Hacking the Shadow Terminator", Ray Tracing Gems II, 2021, chapter 4).
//! Along an edge that depends on its two ends only, so that neighbours agree there.

use glam::{DVec2, DVec3};

use super::Geometry;
use crate::geom::hull::convex_hull;
use crate::geom::triangle_grid::{Nearest, TriangleGrid, nearest_in_triangle};
use crate::geom::{Frame, Slab};

/// Normals that are off the facet's by less than this are taken for that, sine: what eight bits round them by.
const FLAT: f64 = 0.0087;

/// Triangles with a normal that faces away from them by more than this, cosine, are lit as facets.
const LEAST_COSINE: f64 = 0.1;

/// A triangle none of whose corners lies farther before another's plane of tangency than this fraction of the distance
/// between them is convex.
const CONCAVE: f64 = 1e-3;

/// Interpolation moves no place by more than this fraction of what a corner is off another's plane of tangency: by
/// weights whose squares sum to a third at least.
const MOST_OF_OFFSET: f64 = 2.0 / 3.0;

/// Surfaces with more normals are not asked whether all of them face away from light.
const MOST_NORMALS: usize = 24;

/// The normals over a surface, or over its back.
#[derive(Clone, Debug)]
pub struct SmoothNormals {
    triangles: Vec<[Corner; 3]>,
    grid: TriangleGrid,
    /// Those of the corners, each once; none where they are too many.
    normals: Vec<DVec3>,
    /// The box that all offsets lie in: along the frame's axes and its normal, metres.
    reach: [DVec3; 2],
    /// The surface's triangles, ascending.
    own: Vec<u32>,
    is_convex: bool,
}

/// A place on a smooth surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SmoothPlace {
    /// Interpolated normal, unit length.
    pub normal: DVec3,
    /// From the facet to the curved surface, metres.
    pub offset: DVec3,
}

/// A triangle and its place that is nearest to another.
type Found<'a> = (&'a [Corner; 3], Nearest);

impl SmoothPlace {
    /// Position and normal, given the place's `foot` on the facet.
    #[must_use]
    pub fn above(&self, foot: DVec3) -> (DVec3, DVec3) {
        (foot + self.offset, self.normal)
    }
}

#[derive(Clone, Copy, Debug)]
struct Corner {
    /// Plane coordinates.
    place: DVec2,
    normal: DVec3,
    /// The normal's part in the plane.
    slope: DVec2,
}

impl Corner {
    fn new(frame: &Frame, place: DVec2, normal: DVec3) -> Self {
        Self { place, normal, slope: DVec2::new(normal.dot(frame.u), normal.dot(frame.v)) }
    }

    /// How far a place of the plane lies behind the plane of tangency here, metres.
    fn depth(&self, p: DVec2) -> f64 {
        (self.place - p).dot(self.slope)
    }
}

impl SmoothNormals {
    /// The normals over scene triangles in the plane of `frame`; `None` where they are the plane's.
    #[must_use]
    pub(super) fn of(geometry: &Geometry, frame: &Frame, source_triangles: &[usize]) -> Option<Self> {
        let mut is_smooth = false;
        let mut corners_of = |&triangle: &usize| {
            let vertices = geometry.triangles.get(triangle)?.vertices;
            let points = geometry.points(triangle)?;
            let normals = vertices.map(|v| geometry.normals.get(v as usize).copied().unwrap_or_default());
            let are_usable = normals.iter().all(|n| n.dot(frame.normal) >= LEAST_COSINE);
            let normals = if are_usable { normals } else { [frame.normal; 3] };
            is_smooth |= normals.iter().any(|n| n.cross(frame.normal).length() > FLAT);
            Some([0, 1, 2].map(|k| Corner::new(frame, frame.project(points[k]), normals[k])))
        };
        let triangles: Vec<[Corner; 3]> = source_triangles.iter().filter_map(&mut corners_of).collect();
        if !is_smooth {
            return None;
        }
        let mut own: Vec<u32> = source_triangles.iter().map(|&t| t as u32).collect();
        own.sort_unstable();
        Some(Self::new(frame, triangles, own))
    }

    /// The same as seen from behind, in the [flipped](Frame::flipped) frame.
    #[must_use]
    pub fn flipped(&self, frame: &Frame) -> Self {
        let corner = |c: Corner| Corner::new(frame, DVec2::new(c.place.x, -c.place.y), -c.normal);
        let triangles: Vec<_> = self.triangles.iter().map(|&[a, b, c]| [a, c, b].map(corner)).collect();
        Self::new(frame, triangles, self.own.clone())
    }

    fn new(frame: &Frame, triangles: Vec<[Corner; 3]>, own: Vec<u32>) -> Self {
        let places: Vec<[DVec2; 3]> = triangles.iter().map(|t| t.map(|c| c.place)).collect();
        let (mut normals, mut reach) = (Vec::new(), [DVec3::ZERO; 2]);
        for triangle in &triangles {
            let depths = triangle.iter().flat_map(|c| triangle.iter().map(|other| c.depth(other.place)));
            let most = MOST_OF_OFFSET * depths.fold(0.0, f64::max);
            for Corner { normal, slope, .. } in triangle {
                let offset = most * slope.extend(normal.dot(frame.normal));
                reach = [reach[0].min(offset), reach[1].max(offset)];
                if normals.len() <= MOST_NORMALS && !normals.contains(normal) {
                    normals.push(*normal);
                }
            }
        }
        if normals.len() > MOST_NORMALS {
            normals.clear();
        }
        let is_convex = triangles.iter().all(is_convex);
        Self { grid: TriangleGrid::new(&places), triangles, normals, reach, own, is_convex }
    }

    /// The place on the curved surface that stands for one of the plane.
    #[must_use]
    pub fn at(&self, p: DVec2) -> SmoothPlace {
        let nearest = |t: &[Corner; 3]| nearest_in_triangle(t.map(|c| c.place), p);
        let closer = |a: &Found, b: &Found| a.1.distance_squared.total_cmp(&b.1.distance_squared);
        let candidates = self.grid.candidates(p).iter().map(|&t| &self.triangles[t as usize]);
        let found = candidates.map(|t| (t, nearest(t))).min_by(closer);
        let found = found.or_else(|| self.triangles.iter().map(|t| (t, nearest(t))).min_by(closer));
        let Some((triangle, Nearest { barycentric, .. })) = found else {
            return SmoothPlace { normal: DVec3::ZERO, offset: DVec3::ZERO };
        };
        let weighted = || triangle.iter().zip(barycentric);
        SmoothPlace {
            normal: weighted().map(|(c, w)| w * c.normal).sum::<DVec3>().normalize(),
            offset: weighted().map(|(c, w)| w * c.depth(p).max(0.0) * c.normal).sum(),
        }
    }

    /// Normals among which all others lie; none where these are too many to look at.
    #[must_use]
    pub fn normals(&self) -> &[DVec3] {
        &self.normals
    }

    /// What holds the places on the curved surface that stand for those in a convex polygon of the plane.
    #[must_use]
    pub fn slab(&self, frame: &Frame, polygon: &[DVec2]) -> Slab {
        let [low, high] = self.reach;
        if high.z <= 0.0 {
            return Slab::flat(polygon.iter().map(|&p| frame.lift(p)).collect());
        }
        let moves = [low.truncate(), DVec2::new(high.x, low.y), high.truncate(), DVec2::new(low.x, high.y)];
        let moved = polygon.iter().flat_map(|&p| moves.map(|m| p + m)).collect();
        Slab::thick(convex_hull(moved).into_iter().map(|p| frame.lift(p)).collect(), frame.normal * high.z)
    }

    /// Corrects the `occluders` before light, ascending, for the surface's own triangles: where it is convex they hide
    /// nothing from itself; in a hollow they hide what reaches behind the facet, which the normals may face.
    pub fn settle_own(&self, reaches_behind: bool, occluders: &mut Vec<u32>) {
        if self.is_convex {
            occluders.retain(|t| self.own.binary_search(t).is_err());
        } else if reaches_behind {
            occluders.extend(&self.own);
            occluders.sort_unstable();
            occluders.dedup();
        }
    }
}

fn is_convex(triangle: &[Corner; 3]) -> bool {
    let is_behind = |c: &Corner, p: DVec2| c.depth(p) >= -CONCAVE * c.place.distance(p);
    triangle.iter().all(|c| triangle.iter().all(|other| is_behind(c, other.place)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A triangle in the plane `z = 0` with normals that turn away from its middle, as on a sphere.
    fn convex() -> (Frame, SmoothNormals) {
        let frame = Frame::new(DVec3::ZERO, DVec3::Z, DVec3::X);
        let corner = |(x, y): (f64, f64)| {
            Corner::new(&frame, DVec2::new(x, y), DVec3::new(0.3 * x, 0.3 * y, 1.0).normalize())
        };
        let triangle = [(-1.0, -0.6), (1.0, -0.6), (0.0, 1.2)].map(corner);
        assert!(is_convex(&triangle));
        (frame, SmoothNormals::new(&frame, vec![triangle], vec![7]))
    }

    /// The curved surface goes through the corners and bulges between them, and the slab holds it.
    #[test]
    fn places_are_lifted_onto_the_curved_surface() {
        let (frame, smooth) = convex();
        let corner = smooth.at(DVec2::new(1.0, -0.6));
        assert!(corner.offset.length() < 1e-12);
        assert!((corner.normal - DVec3::new(0.3, -0.18, 1.0).normalize()).length() < 1e-12);
        let middle = smooth.at(DVec2::ZERO);
        assert!(middle.offset.z > 0.1 && (middle.normal - DVec3::Z).length() < 0.05, "{middle:?}");
        let triangle = smooth.triangles[0].map(|c| c.place);
        let slab = smooth.slab(&frame, &triangle);
        let bounds = crate::geom::Bounds::of(slab.corners().iter().copied());
        for k in 0..100 {
            let (u, v) = (f64::from(k % 10) / 9.0, f64::from(k / 10) / 9.0);
            let p = triangle[0].lerp(triangle[1], u).lerp(triangle[2], v);
            let (lifted, _) = smooth.at(p).above(frame.lift(p));
            assert!(bounds.grown(1e-12).distance(lifted) == 0.0, "{lifted} outside of {bounds:?}");
        }
    }

    /// From behind the same triangle is hollow: it is not lifted, and shades itself.
    #[test]
    fn the_back_is_hollow() {
        let (frame, smooth) = convex();
        let back = smooth.flipped(&frame.flipped());
        let p = DVec2::new(0.2, 0.1);
        let place = back.at(DVec2::new(p.x, -p.y));
        assert!((place.normal + smooth.at(p).normal).length() < 1e-12);
        assert!(place.offset.length() < 1e-12);
        let mut occluders = vec![3, 7, 9];
        smooth.settle_own(true, &mut occluders);
        assert_eq!(occluders, [3, 9]);
        back.settle_own(false, &mut occluders);
        assert_eq!(occluders, [3, 9]);
        back.settle_own(true, &mut occluders);
        assert_eq!(occluders, [3, 7, 9]);
    }
}
