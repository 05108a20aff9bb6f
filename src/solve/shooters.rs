//! Patches and their parts as shooters of reflected light.

use glam::DVec3;

use super::emitter::{AreaEmitter, Emitter};
use super::patches::Patches;
use crate::element::{Facet, NONE};

/// An element that sends what it reflects.
#[derive(Clone, Debug)]
pub struct Shooter {
    /// Its shape and radiosity.
    pub emitter: Emitter,
    /// Reflected radiosity `ρ E`.
    pub radiosity: DVec3,
    /// The most by which a part's luminance differs from this one's.
    pub spread: f64,
    /// Centroid.
    pub centre: DVec3,
    /// Unit normal.
    pub normal: DVec3,
    /// Square metres.
    pub area: f64,
    /// From the centroid to the farthest corner, metres.
    pub radius: f64,
    /// Parts, or [`NONE`].
    pub parts: [u32; 4],
}

impl Shooter {
    /// Whether it has no parts.
    #[must_use]
    pub fn is_leaf(&self) -> bool {
        self.parts == [NONE; 4]
    }
}

/// All shooters: a small tree for each patch.
#[derive(Clone, Debug, Default)]
pub struct Shooters {
    /// Parts come after the whole.
    pub all: Vec<Shooter>,
    roots: Vec<u32>,
}

impl Shooters {
    /// Makes shooters of the patches and of the elements that direct light split them into.
    #[must_use]
    pub fn new(facets: &[Facet], patches: &Patches) -> Self {
        let mut shooters = Self::default();
        for patch in &patches.patches {
            let facet = &facets[patch.facet as usize];
            let mesh_direct = facet.mean_direct(patch.element);
            // The mesh's direct light, in proportion to what the energy balance made of it.
            let scale = DVec3::select(
                mesh_direct.cmpgt(DVec3::ZERO),
                patch.direct / mesh_direct.max(DVec3::splat(f64::MIN_POSITIVE)),
                DVec3::ZERO,
            );
            let root = shooters.add(facet, patch.element, scale, patch.indirect);
            shooters.roots.push(root);
        }
        shooters
    }

    /// The shooter that is the patch with this index.
    #[must_use]
    pub fn of_patch(&self, patch: usize) -> u32 {
        self.roots[patch]
    }

    fn add(&mut self, facet: &Facet, element: u32, scale: DVec3, indirect: DVec3) -> u32 {
        let e = &facet.elements[element as usize];
        let index = self.all.len();
        let direct = facet.mean_direct(element) * scale;
        let radiosity = e.reflectance * (direct + indirect);
        let parts = facet.parts(element);
        let centre = facet.frame.lift(e.centroid);
        self.all.push(Shooter {
            radius: parts.iter().flatten().map(|p| p.distance(centre)).fold(0.0, f64::max),
            emitter: Emitter::Area(AreaEmitter::new(facet.frame, parts, e.area, radiosity)),
            radiosity,
            spread: 0.0,
            centre,
            normal: facet.frame.normal,
            area: e.area,
            parts: [NONE; 4],
        });
        let mut parts = [NONE; 4];
        let mut spread: f64 = 0.0;
        for (slot, child) in parts.iter_mut().zip(e.children()) {
            let part = self.add(facet, child, scale, indirect);
            let p = &self.all[part as usize];
            let luminance = |b: DVec3| b.dot(DVec3::new(0.2126, 0.7152, 0.0722));
            spread = spread.max(luminance((p.radiosity - radiosity).abs()) + p.spread);
            *slot = part;
        }
        self.all[index].parts = parts;
        self.all[index].spread = spread;
        index as u32
    }
}
