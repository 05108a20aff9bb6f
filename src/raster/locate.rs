//! The light in a surface's mesh at a point.

use glam::{DVec2, DVec3};

use crate::geom::triangle_grid::{TriangleGrid, nearest_in_triangle};
use crate::retriangulate::SurfaceMesh;

/// Finds a surface's light by position.
pub(super) struct TriangleLocator<'a> {
    mesh: &'a SurfaceMesh,
    grid: TriangleGrid,
}

impl<'a> TriangleLocator<'a> {
    /// Sorts the triangles.
    #[must_use]
    pub(super) fn new(mesh: &'a SurfaceMesh) -> Self {
        let corners: Vec<_> =
            mesh.triangles.iter().map(|t| t.map(|v| mesh.vertices[v as usize].position)).collect();
        Self { mesh, grid: TriangleGrid::new(&corners) }
    }

    /// Direct and indirect irradiance at `p`, interpolated in the triangle of `region` that contains it, or in
    /// the nearest one where rounding left it outside of all. Black where there is no triangle.
    #[must_use]
    pub(super) fn light_at(&self, p: DVec2, region: u32) -> (DVec3, DVec3) {
        let mut best = (f64::INFINITY, [0.0; 3], 0);
        for &t in self.grid.candidates(p) {
            let corners = self.mesh.triangles[t as usize].map(|v| self.mesh.vertices[v as usize].position);
            let nearest = nearest_in_triangle(corners, p);
            // A triangle of another region serves only where its own has none here.
            let handicap = if self.mesh.regions[t as usize] == region { 0.0 } else { 1e30 };
            if nearest.distance_squared + handicap < best.0 {
                best = (nearest.distance_squared + handicap, nearest.barycentric, t);
                if best.0 == 0.0 {
                    break;
                }
            }
        }
        if best.0.is_infinite() {
            return (DVec3::ZERO, DVec3::ZERO);
        }
        let corners = self.mesh.triangles[best.2 as usize].map(|v| self.mesh.vertices[v as usize]);
        let mix = |light: fn(&crate::retriangulate::MeshVertex) -> DVec3| {
            corners.iter().zip(best.1).map(|(v, w)| light(v) * w).sum::<DVec3>()
        };
        (mix(|v| v.direct), mix(|v| v.indirect))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::retriangulate::MeshVertex;
    use glam::DVec2;

    /// A fan over a square whose light is linear in the position.
    fn linear_square() -> SurfaceMesh {
        let corner = |x: f64, y: f64| MeshVertex {
            position: DVec2::new(x, y),
            direct: DVec3::splat(1.0 + x),
            indirect: DVec3::splat(2.0 - y),
        };
        SurfaceMesh {
            vertices: vec![
                corner(0.0, 0.0),
                corner(4.0, 0.0),
                corner(4.0, 4.0),
                corner(0.0, 4.0),
                corner(1.0, 2.0),
            ],
            triangles: vec![[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]],
            regions: vec![0; 4],
        }
    }

    #[test]
    fn linear_light_is_interpolated_exactly() {
        let mesh = linear_square();
        let locator = TriangleLocator::new(&mesh);
        for k in 0..100 {
            let p = DVec2::new(f64::from(k % 10) * 0.44, f64::from(k / 10) * 0.44);
            let (direct, indirect) = locator.light_at(p, 0);
            assert!(
                (direct.x - (1.0 + p.x)).abs() < 1e-12 && (indirect.x - (2.0 - p.y)).abs() < 1e-12,
                "{p}"
            );
        }
    }

    #[test]
    fn a_point_outside_takes_the_nearest_edge() {
        let mesh = linear_square();
        let (direct, _) = TriangleLocator::new(&mesh).light_at(DVec2::new(5.0, 1.0), 0);
        assert!((direct.x - 5.0).abs() < 1e-12);
    }

    #[test]
    fn an_empty_mesh_is_black() {
        let mesh = SurfaceMesh::default();
        assert_eq!(TriangleLocator::new(&mesh).light_at(DVec2::ZERO, 0), (DVec3::ZERO, DVec3::ZERO));
    }
}
