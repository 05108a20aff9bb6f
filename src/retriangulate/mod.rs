//! Stage 5: leaf vertices and outlines become triangles that conform. The only module that knows spade.

mod arrange;
mod conform;
mod grid;
pub mod mesh;
mod subdivide;

use glam::{DVec2, DVec3};

pub(crate) use arrange::{Arrangement, PlaneInput, arrange};
pub use conform::conform;
pub(crate) use subdivide::{Face, Subdivision, subdivide};

/// A planar region to triangulate.
#[derive(Clone, Copy, Debug)]
pub struct PlanarRegion<'a> {
    /// Outer rings and holes.
    pub rings: &'a [crate::geom::Ring],
    /// Points to become vertices: the leaves' corners. Those outside the rings are left out; those
    /// within `snap` of an edge become a vertex of that edge.
    pub points: &'a [DVec2],
    /// Points closer together than this are one, metres.
    pub snap: f64,
}

/// Triangles over a planar region.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Triangulation {
    /// Plane coordinates.
    pub vertices: Vec<DVec2>,
    /// Counter-clockwise, indices into `vertices`, in an order that repeats from run to run.
    pub triangles: Vec<[u32; 3]>,
    /// Constraint edges or points that spade refused and that were left out.
    pub dropped: usize,
}

/// Triangulates `region`: constrained Delaunay, no vertex inside another triangle's edge, the rings'
/// whole area and no more.
///
/// Ring corners are never moved, and of points closer together than `snap` the first stays. The rings'
/// inside is where their winding number is above 0. A leaf mesh is cut into regions by passing each
/// region all leaf corners (or those near it), its neighbours' boundary corners among them: the ones
/// outside are left out, and the ones on the boundary make both sides conform.
///
/// Never fails: what is not finite, and what spade refuses, is left out and counted in
/// [`Triangulation::dropped`]; without a usable ring the result is empty.
#[must_use]
pub fn triangulate(region: PlanarRegion) -> Triangulation {
    let PlanarRegion { rings, points, snap } = region;
    let inside = subdivide(arrange(PlaneInput { rings, contacts: &[], points, snap }));
    let mut new_index = vec![None; inside.vertices.len()];
    for corner in inside.faces.iter().flat_map(|f| f.corners) {
        new_index[corner as usize] = Some(0);
    }
    let mut vertices = Vec::with_capacity(inside.vertices.len());
    for (index, &p) in new_index.iter_mut().zip(&inside.vertices) {
        if let Some(index) = index {
            *index = vertices.len() as u32;
            vertices.push(p);
        }
    }
    let renumber = |c: u32| new_index[c as usize].unwrap_or(0);
    let triangles = inside.faces.iter().map(|f| f.corners.map(renumber)).collect();
    Triangulation { vertices, triangles, dropped: inside.dropped }
}

/// The radiosity solution on conforming triangles: one entry per surface (front sides).
#[derive(Clone, Debug, Default)]
pub struct RadiosityMesh {
    /// In the order of the surfaces.
    pub surfaces: Vec<SurfaceMesh>,
}

/// One surface's triangles. Vertices are shared inside a region and doubled on contact edges.
#[derive(Clone, Debug, Default)]
pub struct SurfaceMesh {
    /// The vertices.
    pub vertices: Vec<MeshVertex>,
    /// Counter-clockwise in the surface's frame, indices into `vertices`.
    pub triangles: Vec<[u32; 3]>,
    /// The region of each triangle.
    pub regions: Vec<u32>,
}

/// A vertex of the radiosity mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeshVertex {
    /// Plane coordinates in the surface's frame, metres.
    pub position: DVec2,
    /// Irradiance that came straight from emitters and lights.
    pub direct: DVec3,
    /// Irradiance that was reflected at least once.
    pub indirect: DVec3,
}

#[cfg(test)]
mod tests;
