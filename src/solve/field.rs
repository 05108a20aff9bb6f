//! What every point of the scene reflects: the light that rays gather.

use glam::{DVec2, DVec3, Vec3};
use rayon::prelude::*;

use super::locate::{Descent, FacetLocator};
use crate::element::Facet;
use crate::trace::{Hit, Tracer};

/// Reflected radiosity `ρ E` as the elements have it, as smooth as there.
pub struct RadiosityField<'a> {
    locator: &'a FacetLocator,
    facets: Vec<FacetField>,
}

struct FacetField {
    descent: Descent,
    /// By element; only leaves are ever asked.
    patches: Vec<FieldPatch>,
}

#[derive(Clone, Copy, Default)]
struct FieldPatch {
    min: DVec2,
    per_size: DVec2,
    corners: [Vec3; 4],
    /// As of [`Shading`](crate::element::Shading).
    bulge: Vec3,
}

impl<'a> RadiosityField<'a> {
    /// Takes down what `facets` received, their direct light times `direct_scale`.
    #[must_use]
    pub fn new(locator: &'a FacetLocator, facets: &[Facet], direct_scale: DVec3) -> Self {
        let facets = facets.par_iter().map(|facet| FacetField::new(facet, direct_scale)).collect();
        Self { locator, facets }
    }

    /// The radiosity that a ray met at `point`; zero on the back of a single-sided surface.
    #[inline]
    #[must_use]
    pub fn radiosity(&self, tracer: &Tracer, hit: &Hit, point: DVec3) -> Vec3 {
        match self.locator.find(tracer, hit, point) {
            Some((facet, p)) => self.facets[facet].radiosity(p),
            None => Vec3::ZERO,
        }
    }
}

impl FacetField {
    fn new(facet: &Facet, direct_scale: DVec3) -> Self {
        let mut patches = vec![FieldPatch::default(); facet.elements.len()];
        for leaf in facet.leaves() {
            let e = &facet.elements[leaf as usize];
            let radiosity = |p| {
                let (direct, indirect) = facet.received(leaf, p);
                (e.reflectance * (direct * direct_scale + indirect)).as_vec3()
            };
            let corners = e.corners().map(radiosity);
            let bulge = radiosity(0.5 * (e.min + e.max)) - 0.25 * corners.iter().sum::<Vec3>();
            patches[leaf as usize] =
                FieldPatch { min: e.min, per_size: 1.0 / (e.max - e.min), corners, bulge };
        }
        Self { descent: Descent::new(facet), patches }
    }

    #[inline]
    fn radiosity(&self, p: DVec2) -> Vec3 {
        let patch = &self.patches[self.descent.find(p, |_| false) as usize];
        let t = ((p - patch.min) * patch.per_size).clamp(DVec2::ZERO, DVec2::ONE).as_vec2();
        let [a, b, c, d] = patch.corners;
        let s = 2.0 * t - 1.0;
        a.lerp(b, t.x).lerp(d.lerp(c, t.x), t.y) + patch.bulge * (1.0 - 0.5 * s.length_squared())
    }
}
