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
    /// Direct irradiance that this element received itself, in the corners.
    pub direct: [DVec3; 4],
    /// Indirect irradiance that it received itself, in the corners.
    pub indirect: [DVec3; 4],
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

    /// Bilinear interpolation of corner values at `p`, which may lie a little outside.
    #[must_use]
    pub fn interpolate(&self, corners: &[DVec3; 4], p: DVec2) -> DVec3 {
        let t = (p - self.min) / (self.max - self.min);
        corners[0].lerp(corners[1], t.x).lerp(corners[3].lerp(corners[2], t.x), t.y)
    }
}
