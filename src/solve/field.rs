//! What every point of the scene reflects: the light that rays gather.

use glam::{DVec2, DVec3, Vec2, Vec3};
use rayon::prelude::*;

use super::hot::HotSpots;
use super::locate::{Descent, FacetLocator};
use crate::element::{Element, Facet};
use crate::light::luminance;
use crate::trace::{Hit, Tracer};

/// Reflected radiosity `ρ E` as the elements have it, as smooth as there, but in hot spots no more than a cap.
///
/// What these reflect beyond it would be met by a ray here and none there. They shine as
/// [emitters](super::hot) instead.
pub struct RadiosityField<'a> {
    locator: &'a FacetLocator,
    facets: Vec<FacetField>,
}

struct FacetField {
    descent: Descent,
    /// The facet's least corner, metres.
    min: DVec2,
    /// By element; only leaves are ever asked.
    patches: Vec<FieldPatch>,
    /// By element, what the cap took, mean.
    excess: Vec<Vec3>,
}

#[derive(Clone, Copy, Default)]
struct FieldPatch {
    /// Least corner, from the facet's.
    min: Vec2,
    per_size: Vec2,
    corners: [Vec3; 4],
    /// As of [`Shading`](crate::element::Shading).
    bulge: Vec3,
}

impl<'a> RadiosityField<'a> {
    /// Takes down what `facets` received, their direct light times `direct_scale`; what `hot` spots reflect beyond
    /// their cap is set apart.
    #[must_use]
    pub fn new(locator: &'a FacetLocator, facets: &[Facet], hot: &HotSpots, direct_scale: DVec3) -> Self {
        let facets = facets
            .par_iter()
            .zip(hot.leaves(facets))
            .map(|(facet, is_hot)| FacetField::new(facet, &is_hot, direct_scale, hot.cap))
            .collect();
        Self { locator, facets }
    }

    /// Mean radiosity of an element that was set apart.
    #[must_use]
    pub fn mean_excess(&self, index: usize, facet: &Facet, element: u32) -> DVec3 {
        let leaves = facet.leaves_of(element);
        let area = |leaf: u32| facet.elements[leaf as usize].area;
        let excess = |leaf: u32| self.facets[index].excess[leaf as usize].as_dvec3();
        let sum: DVec3 = leaves.iter().map(|&l| area(l) * excess(l)).sum();
        (sum / leaves.iter().map(|&l| area(l)).sum::<f64>()).max(DVec3::ZERO)
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
    fn new(facet: &Facet, is_hot: &[bool], direct_scale: DVec3, cap: f64) -> Self {
        let min = facet.elements[0].min;
        let mut patches = vec![FieldPatch::default(); facet.elements.len()];
        let mut excess = vec![Vec3::ZERO; facet.elements.len()];
        for leaf in facet.leaves() {
            let e = &facet.elements[leaf as usize];
            let radiosity = |p| {
                let (direct, indirect) = facet.received(leaf, p);
                e.reflectance * (direct * direct_scale + indirect)
            };
            let (corners, middle) = (e.corners().map(radiosity), radiosity(0.5 * (e.min + e.max)));
            let leaf = leaf as usize;
            patches[leaf] = FieldPatch::new(e, min, corners, middle);
            if is_hot[leaf] {
                let whole = patches[leaf].mean();
                patches[leaf] = FieldPatch::new(e, min, corners.map(|c| capped(c, cap)), capped(middle, cap));
                excess[leaf] = whole - patches[leaf].mean();
            }
        }
        Self { descent: Descent::new(facet), min, patches, excess }
    }

    #[inline]
    fn radiosity(&self, p: DVec2) -> Vec3 {
        let patch = &self.patches[self.descent.leaf(p) as usize];
        let t = (((p - self.min).as_vec2() - patch.min) * patch.per_size).clamp(Vec2::ZERO, Vec2::ONE);
        let [a, b, c, d] = patch.corners;
        let s = 2.0 * t - 1.0;
        a.lerp(b, t.x).lerp(d.lerp(c, t.x), t.y) + patch.bulge * (1.0 - 0.5 * s.length_squared())
    }
}

impl FieldPatch {
    fn new(e: &Element, facet_min: DVec2, corners: [DVec3; 4], middle: DVec3) -> Self {
        Self {
            min: (e.min - facet_min).as_vec2(),
            per_size: (1.0 / (e.max - e.min)).as_vec2(),
            bulge: (middle - 0.25 * corners.iter().sum::<DVec3>()).as_vec3(),
            corners: corners.map(|c| c.as_vec3()),
        }
    }

    fn mean(&self) -> Vec3 {
        0.25 * self.corners.iter().sum::<Vec3>() + self.bulge * (2.0 / 3.0)
    }
}

/// A colour with its luminance brought down to `cap`.
fn capped(colour: DVec3, cap: f64) -> DVec3 {
    let luminance = luminance(colour);
    if luminance > cap { colour * (cap / luminance) } else { colour }
}
