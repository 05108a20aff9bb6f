//! Small places that reflect so much that rays would meet them here and miss them there.
//!
//! The inside of a lamp's shade, the ceiling a hand above a lamp: what they reflect beyond a cap is sent in closed
//! form with shadow rays, as emitters send their light, and rays read no more than the cap.

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::emitter::AreaEmitter;
use super::field::RadiosityField;
use super::patches::Patches;
use crate::element::{Facet, Side};
use crate::light::luminance;

/// What reflects this many times as much as the scene's mean is hot.
const HOT: f64 = 16.0;

/// A spot's brightest place reflects no more than this many times as much as its darkest: from afar it is even.
const EVEN: f64 = 2.0;

/// No more spots than this, the strongest.
const MOST_SPOTS: usize = 128;

/// A spot, as it shines.
pub struct HotSpot {
    /// What the field does not hold of it, as if it were even.
    pub emitter: AreaEmitter,
    /// Index of its facet, the facet's surface and side.
    facet: (usize, usize, Side),
    /// The element, plane coordinates of the facet.
    min: DVec2,
    max: DVec2,
}

impl HotSpot {
    /// The exitance with which it shines at a place: from close by only a part of it is seen.
    #[must_use]
    pub fn exitance_at(&self, place: DVec3, field: &RadiosityField) -> DVec3 {
        let frame = &self.emitter.frame();
        let nearest = frame.project(place).clamp(self.min, self.max);
        let distance = place.distance(frame.lift(nearest)) / (self.max - self.min).max_element();
        if distance >= 1.0 {
            return self.emitter.exitance();
        }
        field.excess_at(self.facet, nearest).lerp(self.emitter.exitance(), distance)
    }
}

/// The spots of a scene.
#[derive(Clone, Debug)]
pub struct HotSpots {
    /// Luminance of reflected radiosity up to which rays read them.
    pub cap: f64,
    /// Facets and their elements.
    elements: Vec<(usize, u32)>,
}

impl HotSpots {
    /// Finds them among the elements of all patches.
    #[must_use]
    pub fn find(patches: &Patches, facets: &[Facet]) -> Self {
        let cap = HOT * patches.mean_reflected();
        let mut spots: Vec<(f64, (usize, u32))> = patches
            .patches
            .par_iter()
            .flat_map_iter(|p| {
                let mut spots = Vec::new();
                collect(&facets[p.facet as usize], p.element, cap, &mut spots);
                spots.into_iter().map(|(power, element)| (power, (p.facet as usize, element)))
            })
            .collect();
        spots.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        spots.truncate(MOST_SPOTS);
        Self { cap, elements: spots.into_iter().map(|(_, element)| element).collect() }
    }

    /// For each facet and element whether it is a leaf of a spot.
    #[must_use]
    pub fn leaves(&self, facets: &[Facet]) -> Vec<Vec<bool>> {
        let mut is_hot: Vec<Vec<bool>> = facets.iter().map(|f| vec![false; f.elements.len()]).collect();
        for &(facet, element) in &self.elements {
            for leaf in facets[facet].leaves_of(element) {
                is_hot[facet][leaf as usize] = true;
            }
        }
        is_hot
    }

    /// What `field` does not hold of them.
    #[must_use]
    pub fn shining(&self, field: &RadiosityField, facets: &[Facet]) -> Vec<HotSpot> {
        let spot = |&(index, element): &(usize, u32)| {
            let facet = &facets[index];
            let e = &facet.elements[element as usize];
            let mean = field.mean_excess(index, facet, element);
            let emitter = AreaEmitter::new(facet.frame, facet.parts(element), e.area, mean);
            HotSpot { emitter, facet: (index, facet.surface, facet.side), min: e.min, max: e.max }
        };
        self.elements.iter().map(spot).collect()
    }
}

/// The luminance that a leaf reflects in its middle.
pub(super) fn reflected(facet: &Facet, leaf: u32) -> f64 {
    let e = &facet.elements[leaf as usize];
    let (direct, indirect) = facet.received(leaf, e.centroid);
    luminance(e.reflectance * (direct + indirect))
}

/// The largest elements under `element` that are hot and even, or leaves, with their power beyond the cap.
fn collect(facet: &Facet, element: u32, cap: f64, spots: &mut Vec<(f64, u32)>) {
    let (mut least, mut most, mut power) = (f64::INFINITY, 0.0_f64, 0.0);
    for leaf in facet.leaves_of(element) {
        let reflected = reflected(facet, leaf);
        (least, most) = (least.min(reflected), most.max(reflected));
        power += (reflected - cap).max(0.0) * facet.elements[leaf as usize].area;
    }
    if most <= cap {
        return;
    }
    let e = &facet.elements[element as usize];
    if e.is_leaf() || (least > cap && most <= EVEN * least) {
        spots.push((power, element));
    } else {
        e.children().for_each(|child| collect(facet, child, cap, spots));
    }
}
