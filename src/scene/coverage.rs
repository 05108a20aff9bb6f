//! How much of a triangle is there: `alphaMode` `MASK` and `BLEND`.
//!
//! alpha = `baseColorFactor`'s × `baseColorTexture`'s × `COLOR_0`'s. With `MASK` the surface stops all light where
//! alpha is at least `alphaCutoff`, with `BLEND` the share alpha of it (glTF 2.0, section 3.9.4).

use std::sync::Arc;

use glam::{DVec2, DVec3};

use super::Scene;
use super::appearance::{Alpha, Attributes};
use super::pyramid::Pyramid;
use super::texture::{Binding, Place};

/// Tells how much of one triangle is there. Holds what it needs.
#[derive(Clone, Debug)]
pub struct Coverage {
    factor: f64,
    cutoff: Option<f64>,
    texture: Option<(Arc<Pyramid>, Binding)>,
    attributes: Arc<Attributes>,
    /// The corners as indices into the attributes.
    corners: [usize; 3],
}

impl Scene {
    /// The coverage of a triangle, an index into [`Scene::triangles`]; `None` where it is solid all over.
    #[must_use]
    pub fn coverage(&self, triangle: usize) -> Option<Coverage> {
        let triangle = self.triangles.get(triangle)?;
        let placement = self.placements.get(triangle.placement as usize)?;
        let Alpha { factor, cutoff, texture } =
            self.appearance.materials.get(placement.material)?.alpha.clone()?;
        let attributes = Arc::clone(self.appearance.placements.get(triangle.placement as usize)?);
        let texture = texture.and_then(|binding| {
            let pyramid = self.appearance.textures.get(binding.texture)?.as_ref()?;
            Some((Arc::clone(pyramid), binding))
        });
        let corners = triangle.source_vertices.map(|k| k as usize);
        let coverage = Coverage { factor, cutoff, texture, attributes, corners };
        let varies = coverage.texture.is_some() || coverage.attributes.alphas.is_some();
        (varies || coverage.of_alpha(factor) < 1.0).then_some(coverage)
    }
}

impl Coverage {
    /// The share of the light, 0 to 1, that the triangle stops at the point with these weights of its corners, in the
    /// order of [`Triangle::vertices`](super::Triangle::vertices).
    #[must_use]
    pub fn at(&self, barycentric: DVec3) -> f64 {
        let texture = self.texture.as_ref().map_or(1.0, |(pyramid, binding)| {
            let sets = &self.attributes.texture_coordinates;
            let Some((_, coordinates)) = sets.iter().find(|(number, _)| *number == binding.set) else {
                return pyramid.mean().x;
            };
            let corner = |k: usize| coordinates.get(k).copied().unwrap_or_default().as_dvec2();
            let coordinates: [DVec2; 3] = self.corners.map(corner);
            // A point: the corners in the world only say how wide a footprint is.
            let corners = [DVec3::ZERO, DVec3::X, DVec3::Y];
            binding.average(pyramid, &Place { corners, coordinates, barycentric, footprint: 0.0 }).x
        });
        let vertices = self.attributes.alphas.as_ref().map_or(1.0, |alphas| {
            let corner = |k: usize| alphas.get(k).copied().map_or(1.0, f64::from);
            DVec3::from_array(self.corners.map(corner)).dot(barycentric)
        });
        self.of_alpha(self.factor * texture * vertices)
    }

    fn of_alpha(&self, alpha: f64) -> f64 {
        match self.cutoff {
            Some(cutoff) => f64::from(u8::from(alpha >= cutoff)),
            None => alpha.clamp(0.0, 1.0),
        }
    }
}
