//! Small places that reflect so much that rays would meet them here and miss them there.
//!
//! The inside of a lamp's shade, the ceiling a hand above a lamp: what they reflect beyond a cap is sent in closed
//! form with shadow rays, as emitters send their light, and rays read no more than the cap.

use rayon::prelude::*;

use super::emitter::AreaEmitter;
use super::field::RadiosityField;
use super::patches::Patches;
use crate::element::Facet;
use crate::light::luminance;

/// What reflects this many times as much as the scene's mean is hot.
const HOT: f64 = 16.0;

/// A spot's brightest place reflects no more than this many times as much as its darkest: it is sent as even.
const EVEN: f64 = 2.0;

/// No more spots than this, the strongest.
const MOST_SPOTS: usize = 128;

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

    /// What `field` does not hold of them, as emitters.
    #[must_use]
    pub fn emitters(&self, field: &RadiosityField, facets: &[Facet]) -> Vec<AreaEmitter> {
        let emitter = |&(index, element): &(usize, u32)| {
            let facet = &facets[index];
            let area = facet.elements[element as usize].area;
            AreaEmitter::new(
                facet.frame,
                facet.parts(element),
                area,
                field.mean_excess(index, facet, element),
            )
        };
        self.elements.iter().map(emitter).collect()
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
