//! The cuts of a surface's radiosity mesh.

use std::borrow::Cow;
use std::collections::BTreeMap;

use glam::{DVec2, DVec3};

use super::super::blend::Blend;
use super::super::{Baked, ExportError};
use super::{Borders, Corner, Edges, Piece, Sheet, cut};
use crate::retriangulate::{MeshVertex, SurfaceMesh};

/// A surface's mesh of which each triangle lies in one chart.
#[derive(Clone, Debug)]
pub(in super::super) struct ChartedMesh<'a> {
    /// Vertices on borders are not yet doubled.
    pub(in super::super) mesh: Cow<'a, SurfaceMesh>,
    /// The chart of each triangle, among those of the surface; none where there is but one.
    charts: Vec<usize>,
}

impl<'a> ChartedMesh<'a> {
    /// Cuts the mesh along the borders of its surface's charts.
    pub(in super::super) fn of(
        baked: &Baked,
        surface: usize,
        mesh: &'a SurfaceMesh,
    ) -> Result<Self, ExportError> {
        let charts = baked.atlas.charts_of(surface);
        let Some(of) = baked.surfaces.get(surface).filter(|_| charts.len() > 1) else {
            return Ok(Self { mesh: Cow::Borrowed(mesh), charts: Vec::new() });
        };
        let corner = |&vertex: &u32| {
            let point = mesh.vertices.get(vertex as usize)?.position;
            // −0 is 0.
            let [x, y] = (point + 0.0).to_array().map(f64::to_bits);
            Some(Corner { place: [x, y, 0], point })
        };
        let corners = mesh.triangles.iter().map(|[a, b, c]| Some([corner(a)?, corner(b)?, corner(c)?]));
        let triangles = corners.collect::<Option<Vec<_>>>();
        let triangles = triangles.ok_or(ExportError::Mismatch { what: "meshes of the surfaces" })?;
        let sheet = Sheet { surface, borders: Borders::of(of, charts), triangles };
        let pieces = cut(baked.atlas, &[sheet], &mut Edges::default());
        Ok(Self::assemble(mesh, &pieces.into_iter().flatten().collect::<Vec<_>>()))
    }

    /// The chart of a triangle.
    pub(in super::super) fn chart(&self, triangle: usize) -> usize {
        self.charts.get(triangle).copied().unwrap_or(0)
    }

    /// The mesh of the pieces of each of `mesh`'s triangles.
    fn assemble(mesh: &SurfaceMesh, pieces: &[Vec<Piece>]) -> Self {
        let mut numbers = BTreeMap::new();
        let mut whole = SurfaceMesh { vertices: mesh.vertices.clone(), ..SurfaceMesh::default() };
        let mut charts = Vec::new();
        for ((index, triangle), pieces) in mesh.triangles.iter().enumerate().zip(pieces) {
            for piece in pieces {
                let corners = piece.corners.map(|weights| {
                    let blend = Blend::new(*triangle, weights);
                    blend.original().unwrap_or_else(|| {
                        *numbers.entry(blend.key()).or_insert_with(|| {
                            whole.vertices.push(mean(&mesh.vertices, &blend));
                            (whole.vertices.len() - 1) as u32
                        })
                    })
                });
                whole.triangles.push(corners);
                whole.regions.push(mesh.regions.get(index).copied().unwrap_or(0));
                charts.push(piece.chart);
            }
        }
        Self { mesh: Cow::Owned(whole), charts }
    }
}

fn mean(vertices: &[MeshVertex], blend: &Blend) -> MeshVertex {
    let mut mean = MeshVertex { position: DVec2::ZERO, direct: DVec3::ZERO, indirect: DVec3::ZERO };
    for (vertex, weight) in blend.parts() {
        if let Some(vertex) = vertices.get(vertex as usize) {
            mean.position += weight * vertex.position;
            mean.direct += weight * vertex.direct;
            mean.indirect += weight * vertex.indirect;
        }
    }
    mean
}
