//! Facets: one side of a tile of a region, with its elements and samples.

use std::collections::HashMap;
use std::sync::Arc;

use glam::{DVec2, DVec3};

use super::{Element, NONE, Shading};
use crate::cob::CobLists;
use crate::geom::{Frame, Ring, Slab};
use crate::solve::form_factor::SurfacePoint;
use crate::surface::SmoothNormals;

/// A side of a surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// The side the winding shows; lightmaps hold this one.
    Front,
    /// The back of a `doubleSided` material.
    Back,
}

/// Where light is received.
#[derive(Clone, Copy, Debug)]
pub struct Sample {
    /// Place on the facet, plane coordinates, inside the outline.
    pub position: DVec2,
    /// The same in space, lifted off the surface.
    pub point: SurfacePoint,
}

/// One side of a tile of a region, with the tree of elements over it.
#[derive(Clone, Debug)]
pub struct Facet {
    /// Index of the surface.
    pub surface: usize,
    /// Index of the region in that surface.
    pub region: usize,
    /// Which side of the surface.
    pub side: Side,
    /// Plane coordinates; the normal points to the side that receives. On the back, `y` runs the other way
    /// than in the surface's frame.
    pub frame: Frame,
    /// The normals that light is received about, as seen from this side; `None` where these are the plane's.
    pub smooth: Option<Arc<SmoothNormals>>,
    /// The outline inside this tile.
    pub rings: Vec<Ring>,
    /// The same area as convex polygons.
    pub parts: Vec<Ring>,
    /// Emitted exitance `π L`.
    pub exitance: DVec3,
    /// The tree; element 0 is the whole facet, children come after their parents.
    pub elements: Vec<Element>,
    /// Receiving places.
    pub samples: Vec<Sample>,
    /// Close objects of elements that have some.
    pub cobs: CobLists,
    pub(super) lattice: HashMap<[u32; 2], u32>,
    /// How far samples keep from the outline, and from the surface, metres.
    pub(super) nudge: f64,
    /// How far samples are lifted off the surface, metres.
    pub(super) lift: f64,
}

impl Facet {
    /// Plane coordinates in the surface's frame to this facet's.
    #[must_use]
    pub fn from_surface_plane(&self, p: DVec2) -> DVec2 {
        match self.side {
            Side::Front => p,
            Side::Back => DVec2::new(p.x, -p.y),
        }
    }

    /// The element's outline hull in world space, counter-clockwise seen from the receiving side.
    #[must_use]
    pub fn hull(&self, element: u32) -> Vec<DVec3> {
        self.plane_hull(element).iter().map(|&p| self.frame.lift(p)).collect()
    }

    fn plane_hull(&self, element: u32) -> Vec<DVec2> {
        let e = &self.elements[element as usize];
        match &e.cut {
            Some(cut) if cut.hull.len() >= 3 => cut.hull.clone(),
            _ => e.corners().to_vec(),
        }
    }

    /// What holds all places where the element receives light.
    #[must_use]
    pub fn slab(&self, element: u32) -> Slab {
        match &self.smooth {
            None => Slab::flat(self.hull(element)),
            Some(smooth) => smooth.slab(&self.frame, &self.plane_hull(element)),
        }
    }

    /// Whether `p`, inside the element's rectangle, lies inside the outline.
    #[must_use]
    pub fn contains(&self, element: u32, p: DVec2) -> bool {
        let contains = |part: &Ring| crate::geom::polygon::contains(std::slice::from_ref(part), p);
        self.elements[element as usize].cut.as_ref().is_none_or(|c| c.parts.iter().any(contains))
    }

    /// The element's area as convex polygons in world space, counter-clockwise seen from the receiving side.
    #[must_use]
    pub fn parts(&self, element: u32) -> Vec<Vec<DVec3>> {
        match &self.elements[element as usize].cut {
            Some(cut) => cut.parts.iter().map(|p| p.iter().map(|&q| self.frame.lift(q)).collect()).collect(),
            None => vec![self.hull(element)],
        }
    }

    /// The element's centroid as a receiving point.
    #[must_use]
    pub fn centre(&self, element: u32) -> SurfacePoint {
        self.receiving(self.elements[element as usize].centroid)
    }

    /// A place of the facet as a receiving point.
    #[must_use]
    pub fn receiving(&self, p: DVec2) -> SurfacePoint {
        SurfacePoint::receiving(&self.frame, self.smooth.as_deref(), p, self.lift)
    }

    /// The leaf at `p`, or the nearest one inside the facet's rectangle.
    #[must_use]
    pub fn leaf_at(&self, p: DVec2) -> u32 {
        let root = &self.elements[0];
        let p = p.clamp(root.min, root.max);
        let mut leaf = 0;
        while let Some(child) = self.child_at(leaf, p) {
            leaf = child;
        }
        leaf
    }

    /// The part of `element` that contains `p`, or, where the outline left none there, the nearest part.
    fn child_at(&self, element: u32, p: DVec2) -> Option<u32> {
        let distance = |&c: &u32| {
            let e = &self.elements[c as usize];
            p.clamp(e.min, e.max).distance_squared(p)
        };
        self.elements[element as usize].children().min_by(|a, b| distance(a).total_cmp(&distance(b)))
    }

    /// What `element` and its ancestors received at `p`: direct, indirect.
    #[must_use]
    pub fn received(&self, element: u32, p: DVec2) -> (DVec3, DVec3) {
        let (mut direct, mut indirect) = (DVec3::ZERO, DVec3::ZERO);
        let mut at = element;
        while at != NONE {
            let e = &self.elements[at as usize];
            let t = e.place(p);
            direct += e.direct.at(t);
            indirect += e.indirect.at(t);
            at = e.parent;
        }
        (direct.max(DVec3::ZERO), indirect.max(DVec3::ZERO))
    }

    /// The reflected light that `element` and its ancestors had at `p` when their shadings were these, by element;
    /// those that there were not yet had none.
    #[must_use]
    pub fn indirect_before(&self, before: &[Shading], element: u32, p: DVec2) -> DVec3 {
        let (mut indirect, mut at) = (DVec3::ZERO, element);
        while at != NONE {
            let e = &self.elements[at as usize];
            indirect += before.get(at as usize).map_or(DVec3::ZERO, |s| s.at(e.place(p)));
            at = e.parent;
        }
        indirect.max(DVec3::ZERO)
    }

    /// Whether `element` or an ancestor lies in a narrow gap.
    #[must_use]
    pub fn is_enclosed(&self, element: u32) -> bool {
        let mut at = element;
        while at != NONE {
            let e = &self.elements[at as usize];
            if e.is_enclosed {
                return true;
            }
            at = e.parent;
        }
        false
    }

    /// Mean direct and indirect irradiance over `element`, its parts and its ancestors included.
    #[must_use]
    pub fn mean(&self, element: u32) -> (DVec3, DVec3) {
        let e = &self.elements[element as usize];
        if e.is_leaf() {
            // The paraboloid's mean is two thirds of its height.
            let (direct, indirect) = self.received(element, e.centroid);
            return (direct - e.direct.bulge / 3.0, indirect - e.indirect.bulge / 3.0);
        }
        let (direct, indirect, area) =
            e.children().fold((DVec3::ZERO, DVec3::ZERO, 0.0), |(direct, indirect, area), c| {
                let a = self.elements[c as usize].area;
                let (d, i) = self.mean(c);
                (direct + a * d, indirect + a * i, area + a)
            });
        (direct / area, indirect / area)
    }

    /// Multiplies what `element` and its parts received by reflection, but not in narrow gaps.
    pub fn scale_open_indirect(&mut self, element: u32, scale: DVec3) {
        let mut stack = vec![element];
        while let Some(at) = stack.pop() {
            let e = &mut self.elements[at as usize];
            if e.is_enclosed {
                continue;
            }
            e.indirect.corners.iter_mut().for_each(|c| *c *= scale);
            e.indirect.bulge *= scale;
            stack.extend(e.children());
        }
    }

    /// The leaves that `element` is split into, or itself.
    #[must_use]
    pub fn leaves_of(&self, element: u32) -> Vec<u32> {
        let (mut leaves, mut stack) = (Vec::new(), vec![element]);
        while let Some(at) = stack.pop() {
            let e = &self.elements[at as usize];
            if e.is_leaf() {
                leaves.push(at);
            }
            stack.extend(e.children());
        }
        leaves
    }

    /// The leaves in tree order.
    pub fn leaves(&self) -> impl Iterator<Item = u32> + '_ {
        (0..self.elements.len() as u32).filter(|&e| self.elements[e as usize].is_leaf())
    }
}
