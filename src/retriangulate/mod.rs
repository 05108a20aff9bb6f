//! Stage 5: leaf vertices and outlines become triangles that conform. The only module that knows spade.

pub mod mesh;
mod stub;
use glam::{DVec2, DVec3};
pub use stub::triangulate;

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
