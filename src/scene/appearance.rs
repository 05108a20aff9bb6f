//! What varies over the surfaces: textures, their coordinates, vertex colours.

use std::sync::Arc;

use glam::{DVec3, Vec2, Vec3};

use super::Scene;
use super::pyramid::Pyramid;
use super::texture::{Binding, Place};

/// The textures of a scene and how its surfaces show them.
///
/// Opaque: read through [`Scene::reflectance_at`] and [`Scene::emission_at`]. The default has no
/// textures, so that every surface shows its material's means.
#[derive(Debug, Default)]
pub struct Appearance {
    /// By [`Binding::texture`]; `None` where the image could not be read.
    pub(super) textures: Vec<Option<Arc<Pyramid>>>,
    /// One entry a material of the scene.
    pub(super) materials: Vec<Layers>,
    /// One entry a placement.
    pub(super) placements: Vec<Arc<Attributes>>,
}

/// What a primitive's vertices carry beside their positions.
#[derive(Debug, Default)]
pub(super) struct Attributes {
    /// The sets that the material needs: their numbers and values.
    pub(super) texture_coordinates: Vec<(u32, Vec<Vec2>)>,
    /// `COLOR_0`, linear, unless it is white.
    pub(super) colours: Option<Vec<Vec3>>,
    /// The alpha of `COLOR_0`, unless it is 1.
    pub(super) alphas: Option<Vec<f32>>,
}

/// A material's factors and textures: `reflectance = base * (1 - specular)`.
#[derive(Clone, Debug, Default)]
pub(super) struct Layers {
    pub(super) base: DVec3,
    pub(super) base_texture: Option<Binding>,
    /// The share of the light that is not diffusely reflected: the metallic factor.
    pub(super) specular: f64,
    pub(super) specular_texture: Option<(Binding, Channel)>,
    pub(super) emission: DVec3,
    pub(super) emission_texture: Option<Binding>,
    /// What is there of the surface; `None` where all of it is.
    pub(super) alpha: Option<Alpha>,
}

/// How much of a surface is there: `factor * texture * COLOR_0`'s alpha.
#[derive(Clone, Debug)]
pub(super) struct Alpha {
    pub(super) factor: f64,
    pub(super) texture: Option<Binding>,
    /// The surface is there where its alpha is at least this (`alphaMode` `MASK`); without, alpha is the share of the
    /// light that it stops (`BLEND`).
    pub(super) cutoff: Option<f64>,
}

/// What a texture says about the specular share.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Channel {
    /// A metallic-roughness texture's metallic channel.
    Blue,
    /// The largest channel of a specular-glossiness texture.
    Largest,
}

impl Channel {
    fn of(self, texel: DVec3) -> f64 {
        match self {
            Self::Blue => texel.z,
            Self::Largest => texel.max_element(),
        }
    }
}

impl Layers {
    /// Diffuse reflectance, with `look_up` giving a texture's value.
    pub(super) fn reflectance(&self, look_up: impl Fn(&Binding) -> DVec3) -> DVec3 {
        let base = self.base * self.base_texture.as_ref().map_or(DVec3::ONE, &look_up);
        let share =
            self.specular_texture.as_ref().map_or(1.0, |(texture, channel)| channel.of(look_up(texture)));
        base * (1.0 - self.specular * share)
    }

    /// Emitted radiance, with `look_up` giving a texture's value.
    pub(super) fn emission(&self, look_up: impl Fn(&Binding) -> DVec3) -> DVec3 {
        self.emission * self.emission_texture.as_ref().map_or(DVec3::ONE, look_up)
    }

    /// All textures in use.
    pub(super) fn bindings(&self) -> impl Iterator<Item = &Binding> {
        let specular = self.specular_texture.as_ref().map(|(binding, _)| binding);
        [self.base_texture.as_ref(), specular, self.emission_texture.as_ref()].into_iter().flatten()
    }
}

impl Appearance {
    /// A texture's mean; white where it could not be read.
    pub(super) fn mean(&self, binding: &Binding) -> DVec3 {
        self.texture(binding).map_or(DVec3::ONE, Pyramid::mean)
    }

    /// A texture that could be read.
    pub(super) fn texture(&self, binding: &Binding) -> Option<&Pyramid> {
        self.textures.get(binding.texture).and_then(Option::as_deref)
    }
}

impl Scene {
    /// The diffuse reflectance around a point, averaged over a square of side `footprint` metres.
    ///
    /// `triangle` indexes [`Scene::triangles`]; `barycentric` weights its [`vertices`] in their order
    /// and sums to 1. The square lies in the triangle's plane along the texture's axes and may reach
    /// beyond the triangle, where it sees the texture go on. It spans at least a texel. The result
    /// lies in `[0, 1]` and is not clamped to `max_reflectance`. Vertex colours (`COLOR_0`) are
    /// taken at the point. Cheap: at most some 64 texels are read. Out of range gives zero.
    ///
    /// [`vertices`]: super::Triangle::vertices
    #[must_use]
    pub fn reflectance_at(&self, triangle: usize, barycentric: [f64; 3], footprint: f64) -> DVec3 {
        let Some(spot) = self.spot(triangle, barycentric, footprint) else { return DVec3::ZERO };
        match spot.layers {
            Some(layers) => {
                let reflectance = layers.reflectance(|binding| spot.look_up(binding)) * spot.colour();
                reflectance.clamp(DVec3::ZERO, DVec3::ONE)
            }
            None => spot.material.reflectance,
        }
    }

    /// The emitted radiance around a point, nits; as [`Scene::reflectance_at`], without vertex colours.
    #[must_use]
    pub fn emission_at(&self, triangle: usize, barycentric: [f64; 3], footprint: f64) -> DVec3 {
        let Some(spot) = self.spot(triangle, barycentric, footprint) else { return DVec3::ZERO };
        match spot.layers {
            Some(layers) => layers.emission(|binding| spot.look_up(binding)),
            None => spot.material.emission,
        }
    }

    fn spot(&self, triangle: usize, barycentric: [f64; 3], footprint: f64) -> Option<Spot<'_>> {
        let triangle = self.triangles.get(triangle)?;
        let placement = self.placements.get(triangle.placement as usize)?;
        let material = self.materials.get(placement.material)?;
        Some(Spot {
            scene: self,
            triangle,
            material,
            // A uniform material needs no textures looked up.
            layers: self.appearance.materials.get(placement.material).filter(|_| material.textured),
            attributes: self.appearance.placements.get(triangle.placement as usize).map(Arc::as_ref),
            barycentric: DVec3::from_array(barycentric),
            footprint,
        })
    }
}

/// A point on a triangle, with what it shows.
struct Spot<'a> {
    scene: &'a Scene,
    triangle: &'a super::Triangle,
    material: &'a super::Material,
    layers: Option<&'a Layers>,
    attributes: Option<&'a Attributes>,
    barycentric: DVec3,
    footprint: f64,
}

impl Spot<'_> {
    /// A texture's value here; its mean where the surface lacks the texture coordinates.
    fn look_up(&self, binding: &Binding) -> DVec3 {
        let Some(pyramid) = self.scene.appearance.texture(binding) else { return DVec3::ONE };
        let sets = self.attributes.map(|attributes| attributes.texture_coordinates.as_slice());
        let set = sets.unwrap_or_default().iter().find(|(number, _)| *number == binding.set);
        let Some((_, coordinates)) = set else { return pyramid.mean() };
        let corner = |k: u32| coordinates.get(k as usize).copied().unwrap_or_default().as_dvec2();
        let position = |k: u32| self.scene.vertices.get(k as usize).copied().unwrap_or_default();
        let place = Place {
            corners: self.triangle.vertices.map(position),
            coordinates: self.triangle.source_vertices.map(corner),
            barycentric: self.barycentric,
            footprint: self.footprint,
        };
        binding.average(pyramid, &place)
    }

    /// The vertex colour here; white where there is none.
    fn colour(&self) -> DVec3 {
        let Some(colours) = self.attributes.and_then(|attributes| attributes.colours.as_ref()) else {
            return DVec3::ONE;
        };
        let [a, b, c] = self
            .triangle
            .source_vertices
            .map(|k| colours.get(k as usize).copied().unwrap_or(Vec3::ONE).as_dvec3());
        let colour = self.barycentric.x * a + self.barycentric.y * b + self.barycentric.z * c;
        if colour.is_finite() { colour.max(DVec3::ZERO) } else { DVec3::ONE }
    }
}
