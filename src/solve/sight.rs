//! What places in narrow gaps see, kept while light is followed from one side to the other.
//!
//! Round after round the same places look along the same rays, and nothing is split meanwhile: what they meet stays,
//! only its light changes. Looking once and reading many times is a matrix of form factors (Goral, Torrance,
//! Greenberg and Battaile, "Modeling the Interaction of Light Between Diffuse Surfaces", 1984) for these places only.

use std::collections::HashMap;

use glam::DVec3;

use super::field::{Met, RadiosityField};
use super::hot::HotSpot;
use super::patches::Receiver;

/// No more rays than about this many are kept, 16 bytes each; hot spots, at most 8 bytes each for 128 of them at
/// each place, take less.
const MOST_KEPT: usize = 1 << 24;

/// An element in a gap, which shares its places with its neighbours, has about so many.
const RAYS_AN_ELEMENT: usize = 100;

/// A place of a facet.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Place {
    /// A sample.
    Sample(u32),
    /// The place where a small element receives.
    Element(u32),
}

/// What a place sees.
#[derive(Clone, Debug, Default)]
pub struct Sight {
    /// What its rays meet that may shine, each with the share of its light that arrives.
    pub met: Vec<(Met, f32)>,
    /// The numbers of the hot spots in sight, and their form factors.
    pub hot: Vec<(u32, f32)>,
    /// Its rays.
    pub rays: f64,
    /// Harmonic mean distance of what the rays met, metres.
    pub distance: f64,
    /// Whether most of the rays met something near.
    pub is_enclosed: bool,
}

impl Sight {
    /// The irradiance at the place, which is that of the sight.
    #[must_use]
    pub fn irradiance(&self, place: DVec3, field: &RadiosityField, hot_spots: &[HotSpot]) -> DVec3 {
        let met = |(met, share): &(Met, f32)| f64::from(*share) * field.radiosity_met(met).as_dvec3();
        let hot = |&(spot, form_factor): &(u32, f32)| {
            f64::from(form_factor) * hot_spots[spot as usize].exitance_at(place, field)
        };
        self.met.iter().map(met).sum::<DVec3>() / self.rays + self.hot.iter().map(hot).sum::<DVec3>()
    }
}

/// What the places of a facet see.
pub type Sights = HashMap<Place, Sight>;

/// Room for what places in these elements see, by facet; `None` where that is too much to be kept.
#[must_use]
pub fn sights(elements: &[Vec<Receiver>]) -> Option<Vec<Sights>> {
    let rays = elements.iter().map(Vec::len).sum::<usize>() * RAYS_AN_ELEMENT;
    (rays <= MOST_KEPT).then(|| vec![Sights::new(); elements.len()])
}
