//! Reflectance and emission of elements, averaged over their own texels.

use glam::{DVec2, DVec3};

use super::SurfaceAppearance;
use crate::geom::triangle_grid::{TriangleGrid, nearest_in_triangle};
use crate::scene::Scene;
use crate::surface::Surface;

/// A textured element's mean is taken over this many places a side; each averages its own surroundings.
const PLACES_A_SIDE: u32 = 4;

/// The materials of a scene as its surfaces carry them.
pub struct SceneAppearance<'a> {
    scene: &'a Scene,
    surfaces: &'a [Surface],
    /// For surfaces with textures: their source triangles in plane coordinates.
    textured: Vec<Option<SourceTriangles>>,
    max_reflectance: f64,
}

struct SourceTriangles {
    corners: Vec<[DVec2; 3]>,
    grid: TriangleGrid,
}

impl<'a> SceneAppearance<'a> {
    /// Prepares look-ups; reflectances are clamped to `max_reflectance`.
    #[must_use]
    pub fn new(scene: &'a Scene, surfaces: &'a [Surface], max_reflectance: f64) -> Self {
        let textured = surfaces
            .iter()
            .map(|s| {
                scene.materials[s.material].textured.then(|| {
                    let corners: Vec<_> = s
                        .source_triangles
                        .iter()
                        .map(|&t| {
                            scene.triangles[t].vertices.map(|v| s.frame.project(scene.vertices[v as usize]))
                        })
                        .collect();
                    SourceTriangles { grid: TriangleGrid::new(&corners), corners }
                })
            })
            .collect();
        Self { scene, surfaces, textured, max_reflectance }
    }

    /// Mean of `of` over a rectangle; `None` where the surface has no texture.
    fn mean(
        &self,
        surface: usize,
        (min, max): (DVec2, DVec2),
        of: impl Fn(usize, [f64; 3], f64) -> DVec3,
    ) -> Option<DVec3> {
        let source = self.textured[surface].as_ref()?;
        let step = (max - min) / f64::from(PLACES_A_SIDE);
        let (mut sum, mut count) = (DVec3::ZERO, 0);
        for k in 0..PLACES_A_SIDE * PLACES_A_SIDE {
            let cell = DVec2::new((k % PLACES_A_SIDE).into(), (k / PLACES_A_SIDE).into());
            let p = min + (cell + 0.5) * step;
            let found = source
                .grid
                .candidates(p)
                .iter()
                .map(|&t| (t, nearest_in_triangle(source.corners[t as usize], p)))
                .min_by(|a, b| a.1.distance_squared.total_cmp(&b.1.distance_squared));
            if let Some((t, nearest)) = found
                && (nearest.distance_squared == 0.0 || count == 0)
            {
                let triangle = self.surfaces[surface].source_triangles[t as usize];
                sum += of(triangle, nearest.barycentric, step.max_element());
                count += 1;
            }
        }
        (count > 0).then(|| sum / f64::from(count))
    }
}

impl SurfaceAppearance for SceneAppearance<'_> {
    fn reflectance(&self, surface: usize, min: DVec2, max: DVec2) -> DVec3 {
        let mean = self.mean(surface, (min, max), |t, b, f| self.scene.reflectance_at(t, b, f));
        mean.unwrap_or_else(|| self.scene.materials[self.surfaces[surface].material].reflectance)
            .clamp(DVec3::ZERO, DVec3::splat(self.max_reflectance))
    }

    fn exitance(&self, surface: usize, min: DVec2, max: DVec2) -> DVec3 {
        let mean = self.mean(surface, (min, max), |t, b, f| self.scene.emission_at(t, b, f));
        std::f64::consts::PI
            * mean.unwrap_or_else(|| self.scene.materials[self.surfaces[surface].material].emission)
    }
}
