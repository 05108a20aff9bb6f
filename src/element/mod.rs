//! Stage 3: a hierarchy of elements over each surface.
//!
//! A region is laid out in tiles, a tile with one side of the surface is a [`Facet`], and
//! each facet carries a tree of rectangular elements, cut by the region's outline. Elements
//! split into halves or quarters so that they stay about square. Light is received at
//! samples: the corners of full elements, shared between neighbours, and the nearest places
//! inside for elements that the outline cuts.
//!
//! Each element keeps what it received itself, as values in its four corners; what arrives
//! at a point is the sum over the elements of the tree that contain it. A weak shot is
//! received by a coarse element and costs four samples, a strong one by many fine ones.

mod appearance;
mod build;
mod facet;
mod sampling;

use glam::{DVec2, DVec3};

pub use appearance::SceneAppearance;
pub use build::{MeshOptions, SurfaceAppearance, build};
pub use facet::{Facet, Sample, Side};

use crate::cob::Cob;
use crate::geom::Ring;
use crate::geom::polygon::rectangle;
use crate::solve::overhang::Overhang;

/// Marks an absent parent or child.
pub const NONE: u32 = u32::MAX;

/// A rectangle of a facet, cut by the facet's outline.
#[derive(Clone, Debug)]
pub struct Element {
    /// The element that this one is a part of, or [`NONE`].
    pub parent: u32,
    /// Its parts, [`NONE`] where there are fewer than four; all [`NONE`] for a leaf.
    pub children: [u32; 4],
    /// Least corner, plane coordinates of the facet's frame, metres.
    pub min: DVec2,
    /// Greatest corner.
    pub max: DVec2,
    /// Lattice coordinates of the corners, in units of the facet's finest division.
    cell: [u32; 4],
    /// Area inside the outline, square metres.
    pub area: f64,
    /// Centre of that area.
    pub centroid: DVec2,
    /// What the outline leaves of the rectangle; `None` where it leaves all.
    pub cut: Option<Box<Cut>>,
    /// Where light is received: near corners (min, min), (max, min), (max, max), (min, max).
    pub samples: [u32; 4],
    /// Mean diffuse reflectance.
    pub reflectance: DVec3,
    /// The Close Objects Buffer.
    pub cob: Cob,
    /// Direct irradiance that this element received itself.
    pub direct: Shading,
    /// Indirect irradiance that it received itself.
    pub indirect: Shading,
    /// Whether reflected light was found to be uneven over it, so that its parts gather in its place. What one round
    /// found holds in the next ones: a middle that is right by chance must not undo it.
    pub is_uneven: bool,
    /// Whether it lies in a narrow gap, as reflected light was gathered last.
    pub is_enclosed: bool,
    /// What hangs closely over a part of it, if it is too small to be split for that.
    pub overhang: Option<Overhang>,
}

/// Light over an element's rectangle.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Shading {
    /// In the corners, in the order of [`Element::samples`].
    pub corners: [DVec3; 4],
    /// How much more it is in the middle than the mean of the corners: the share that no bilinear
    /// interpolation holds. Without it, light that falls off to all sides would lose energy.
    pub bulge: DVec3,
}

impl Shading {
    /// The light at `t`, which runs from 0 to 1 along both sides: bilinear, and a paraboloid that vanishes in the
    /// corners.
    #[must_use]
    pub fn at(&self, t: DVec2) -> DVec3 {
        let [a, b, c, d] = self.corners;
        let s = 2.0 * t - 1.0;
        a.lerp(b, t.x).lerp(d.lerp(c, t.x), t.y) + self.bulge * (1.0 - 0.5 * s.length_squared())
    }

    /// Adds another's light.
    pub fn add(&mut self, other: &Self) {
        self.corners.iter_mut().zip(other.corners).for_each(|(sum, c)| *sum += c);
        self.bulge += other.bulge;
    }
}

/// What the outline leaves of an element's rectangle.
#[derive(Clone, Debug)]
pub struct Cut {
    /// The rings inside the rectangle.
    pub rings: Vec<Ring>,
    /// The same area as convex polygons.
    pub parts: Vec<Ring>,
    /// The convex hull of all.
    pub hull: Vec<DVec2>,
    /// Takes values in the samples to values in the rectangle's corners: a plane fitted through them.
    corners_from_samples: [[f64; 4]; 4],
}

impl Element {
    /// Whether it has no parts.
    #[must_use]
    pub fn is_leaf(&self) -> bool {
        self.children == [NONE; 4]
    }

    /// Its parts.
    pub fn children(&self) -> impl Iterator<Item = u32> + use<> {
        self.children.into_iter().filter(|&c| c != NONE)
    }

    /// The rectangle's corners, in the order of [`samples`](Self::samples).
    #[must_use]
    pub fn corners(&self) -> [DVec2; 4] {
        rectangle(self.min, self.max)
    }

    /// The longer side, metres: the paper's size(i).
    #[must_use]
    pub fn size(&self) -> f64 {
        (self.max - self.min).max_element()
    }

    /// Whether `p` lies in the rectangle, edges included.
    #[must_use]
    pub fn covers(&self, p: DVec2) -> bool {
        self.min.cmple(p).all() && p.cmple(self.max).all()
    }

    /// Turns values in the samples into values in the corners.
    #[must_use]
    pub fn corner_values(&self, samples: [DVec3; 4]) -> [DVec3; 4] {
        match &self.cut {
            None => samples,
            Some(cut) => {
                cut.corners_from_samples.map(|row| row.iter().zip(&samples).map(|(&w, &s)| s * w).sum())
            }
        }
    }

    /// Where `p`, which may lie a little outside, is in the rectangle: 0 to 1 along both sides.
    #[must_use]
    pub fn place(&self, p: DVec2) -> DVec2 {
        (p - self.min) / (self.max - self.min)
    }

    /// Light from its values in the samples.
    #[must_use]
    pub fn flat(&self, samples: [DVec3; 4]) -> Shading {
        Shading { corners: self.corner_values(samples), bulge: DVec3::ZERO }
    }

    /// Light from its values in the samples and in the centroid.
    #[must_use]
    pub fn shading(&self, samples: [DVec3; 4], middle: DVec3) -> Shading {
        let flat = self.flat(samples);
        // The centroid of a cut element is no middle to speak of.
        let bulge =
            if self.cut.is_some() { DVec3::ZERO } else { middle - flat.at(self.place(self.centroid)) };
        Shading { bulge, ..flat }
    }
}
