//! The Close Objects Buffer.
//!
//! Each element owns a prism that stands on it and lists the polygons that reach into it.
//! Before a strong shot is received, the list tells whether a sharp shadow of something
//! close may fall onto the element, and the element is split before the light is lost in
//! it rather than after. The list is made when it is first asked for, from the parent's
//! list where there is one, for what does not reach into the parent's prism does not reach
//! into the child's.
//!
//! A. Telea, C. van Overveld, "The Close Objects Buffer: A Sharp Shadow Detection Technique
//! for Radiosity Methods", Journal of Graphics Tools 2(2), 1997.

use glam::DVec3;

use crate::geom::Bounds;
use crate::options::CobHeight;
use crate::trace::Tracer;
use crate::trace::shaft::Shaft;

/// An element's handle to its list: four bytes, and no more while nothing is close.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Cob(u32);

/// The three states of a Close Objects Buffer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CobState {
    /// Nobody asked yet.
    Uninitialized,
    /// Nothing is close.
    Empty,
    /// Something is close.
    NotEmpty,
}

/// The lists of one facet's elements.
#[derive(Clone, Debug, Default)]
pub struct CobLists {
    lists: Vec<Box<[u32]>>,
}

impl Cob {
    /// The state of every element at first.
    pub const UNINITIALIZED: Self = Self(0);
    const EMPTY: Self = Self(1);
    const FIRST_LIST: u32 = 2;

    /// The state.
    #[must_use]
    pub fn state(self) -> CobState {
        match self {
            Self::UNINITIALIZED => CobState::Uninitialized,
            Self::EMPTY => CobState::Empty,
            _ => CobState::NotEmpty,
        }
    }
}

impl CobLists {
    /// Triangles that reach into the prism; empty unless the state is [`CobState::NotEmpty`].
    #[must_use]
    pub fn entries(&self, cob: Cob) -> &[u32] {
        cob.0.checked_sub(Cob::FIRST_LIST).and_then(|i| self.lists.get(i as usize)).map_or(&[], |l| l)
    }

    /// Fills a buffer: from the parent's entries where the parent has been asked, else from the whole scene.
    pub fn fill(&mut self, prism: &Prism, parent: Cob, tracer: &Tracer) -> Cob {
        let mut close = Vec::new();
        match parent.state() {
            CobState::Uninitialized => {
                let mut candidates = Vec::new();
                tracer.triangles_in(prism.bounds, &mut candidates);
                prism.shaft.filter(tracer, &candidates, &mut close);
            }
            CobState::Empty => {}
            CobState::NotEmpty => prism.shaft.filter(tracer, self.entries(parent), &mut close),
        }
        if close.is_empty() {
            return Cob::EMPTY;
        }
        self.lists.push(close.into_boxed_slice());
        Cob(self.lists.len() as u32 - 1 + Cob::FIRST_LIST)
    }

    /// Memory of all lists, bytes, without the elements' handles.
    #[must_use]
    pub fn bytes(&self) -> usize {
        self.lists.iter().map(|l| size_of::<Box<[u32]>>() + size_of_val::<[u32]>(l)).sum()
    }
}

/// The prism above an element.
#[derive(Clone, Debug)]
pub struct Prism {
    shaft: Shaft,
    bounds: Bounds,
}

impl Prism {
    /// The prism of `height` metres over a convex polygon that faces along `normal`.
    ///
    /// What comes no higher than `margin` above the base, or no deeper than that through a side, does not
    /// reach into it.
    #[must_use]
    pub fn over(base: &[DVec3], normal: DVec3, height: f64, margin: f64) -> Self {
        let top: Vec<DVec3> = base.iter().map(|&p| p + normal * height).collect();
        Self {
            shaft: Shaft::between(base, &top, margin),
            bounds: Bounds::of(base.iter().chain(&top).copied()),
        }
    }
}

/// The prism's height over an element of a given size, metres.
#[must_use]
pub fn prism_height(height: CobHeight, element_size: f64) -> f64 {
    match height {
        CobHeight::OfElement(fraction) => fraction * element_size,
        CobHeight::Metres(metres) => metres,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The paper gives five bytes for an empty buffer; ours must not need more.
    #[test]
    fn an_empty_buffer_takes_at_most_five_bytes() {
        assert!(size_of::<Cob>() <= 5);
        let tracer = Tracer::new(Vec::new());
        let mut lists = CobLists::default();
        let cob = lists.fill(&prism(0.0, 1.0), Cob::UNINITIALIZED, &tracer);
        assert_eq!((cob.state(), lists.bytes()), (CobState::Empty, 0));
    }

    fn prism(x: f64, height: f64) -> Prism {
        let base = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)].map(|(u, v)| DVec3::new(x + u, v, 0.0));
        Prism::over(&base, DVec3::Z, height, 1e-9)
    }

    fn sheet(x: f64, z: f64) -> [DVec3; 3] {
        [DVec3::new(x, 0.2, z), DVec3::new(x + 0.5, 0.2, z), DVec3::new(x, 0.8, z)]
    }

    #[test]
    fn it_lists_what_reaches_into_the_prism_and_nothing_else() {
        let floor_below = sheet(0.2, -0.1);
        let coplanar = sheet(0.2, 0.0);
        let wall_at_foot = [DVec3::new(1.0, 0.0, 0.0), DVec3::new(1.0, 1.0, 0.0), DVec3::new(1.0, 0.0, 1.0)];
        let scene =
            vec![sheet(0.2, 0.001), sheet(0.2, 0.5), sheet(1.2, 0.1), floor_below, coplanar, wall_at_foot];
        let tracer = Tracer::new(scene);
        let mut lists = CobLists::default();
        let cob = lists.fill(&prism(0.0, 0.3), Cob::UNINITIALIZED, &tracer);
        assert_eq!(lists.entries(cob), [0]);
        let higher = lists.fill(&prism(0.0, 0.6), Cob::UNINITIALIZED, &tracer);
        assert_eq!(lists.entries(higher), [0, 1]);
    }

    /// A child's buffer made from its parent's equals one made from the whole scene.
    #[test]
    fn handing_down_loses_nothing() {
        let scene: Vec<_> =
            (0..40).map(|k| sheet(f64::from(k) * 0.05 - 0.5, 0.02 + f64::from(k % 7) * 0.1)).collect();
        let tracer = Tracer::new(scene);
        let mut lists = CobLists::default();
        let parent = lists.fill(&prism(0.0, 0.4), Cob::UNINITIALIZED, &tracer);
        let base = [(0.5, 0.0), (1.0, 0.0), (1.0, 0.5), (0.5, 0.5)].map(|(u, v)| DVec3::new(u, v, 0.0));
        let child = Prism::over(&base, DVec3::Z, 0.2, 1e-9);
        let handed_down = lists.fill(&child, parent, &tracer);
        let afresh = lists.fill(&child, Cob::UNINITIALIZED, &tracer);
        assert_eq!(lists.entries(handed_down), lists.entries(afresh));
        assert!(!lists.entries(afresh).is_empty());
    }
}
