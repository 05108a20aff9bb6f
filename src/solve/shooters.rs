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
    /// A bound, about, on the form factor from any point of a receiver with corners `hull` and normal `normal`
    /// that comes no nearer than `gap` metres.
    #[must_use]
    pub fn most_factor(&self, hull: &[DVec3], normal: DVec3, gap: f64) -> f64 {
        let Some(&origin) = hull.first() else { return 0.0 };
        let highest = self.reach(normal) - normal.dot(origin);
        let deepest = hull.iter().map(|&p| self.normal.dot(p - self.centre)).fold(0.0, f64::max);
        let cosines = (highest / gap).clamp(0.0, 1.0) * (deepest / gap).min(1.0);
        (cosines * self.area / (std::f64::consts::PI * gap * gap)).min(1.0)
    }

    /// How far it reaches along a direction.
    fn reach(&self, direction: DVec3) -> f64 {
        match &self.emitter {
            Emitter::Area(area) => area.reach(direction),
            Emitter::Punctual(_) => direction.dot(self.centre),
        }
    }

    /// Whether it has no parts.
    #[must_use]
    pub fn is_leaf(&self) -> bool {
        self.parts == [NONE; 4]
    }
}

/// Where a shooter's reflected light is taken from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reflected {
    /// The patch's mean, the same for all of its parts.
    ByPatch,
    /// What each element received in an earlier delivery.
    ByElement,
}

/// All shooters: a small tree for each patch.
#[derive(Clone, Debug)]
pub struct Shooters {
    /// Parts come after the whole.
    pub all: Vec<Shooter>,
    roots: Vec<u32>,
    reflected: Reflected,
}

impl Shooters {
    /// Makes shooters of the patches and of the elements that they are split into.
    #[must_use]
    pub fn new(facets: &[Facet], patches: &Patches, reflected: Reflected) -> Self {
        let mut shooters = Self { all: Vec::new(), roots: Vec::new(), reflected };
        for patch in &patches.patches {
            let facet = &facets[patch.facet as usize];
            let (mesh_direct, _) = facet.mean(patch.element);
            // The mesh's direct light, in proportion to what the energy balance made of it.
            let scale = DVec3::select(
                mesh_direct.cmpgt(DVec3::ZERO),
                patch.direct / mesh_direct.max(DVec3::splat(f64::MIN_POSITIVE)),
                DVec3::ZERO,
            );
            let light = |element| {
                let (direct, indirect) = facet.mean(element);
                let reflected = match reflected {
                    Reflected::ByPatch => patch.indirect,
                    Reflected::ByElement => indirect,
                };
                direct * scale + reflected
            };
            let root = shooters.add(facet, patch.element, &light);
            shooters.roots.push(root);
        }
        shooters
    }

    /// Where their reflected light was taken from.
    #[must_use]
    pub fn reflected(&self) -> Reflected {
        self.reflected
    }

    /// The shooter that is the patch with this index.
    #[must_use]
    pub fn of_patch(&self, patch: usize) -> u32 {
        self.roots[patch]
    }

    fn add(&mut self, facet: &Facet, element: u32, light: &dyn Fn(u32) -> DVec3) -> u32 {
        let e = &facet.elements[element as usize];
        let index = self.all.len();
        let radiosity = e.reflectance * light(element);
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
            let part = self.add(facet, child, light);
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
