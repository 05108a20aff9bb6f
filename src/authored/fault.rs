//! What keeps a node's texture coordinates from being a lightmap layout.

use std::ops::ControlFlow;

use glam::DVec2;

use super::map::{LEAST_STRETCH, mean_density, stretch};
use super::overlap::overlaps;
use super::{area, layout};
use crate::geom::triangle::area_normal;
use crate::scene::{Placement, Scene};

/// Coordinates may lie outside of the square by this much: rounding by whoever made them.
const OUTSIDE: f64 = 1e-4;

/// Triangles without area in the layout may have this share of the node's area in the scene: slivers.
const NO_AREA: f64 = 1e-3;

/// Triangles may share this fraction of a layout's area. Automatic unwrappings of fine models fold over themselves here
/// and there by less than a texel: 1.4 % of the layout of PlayCanvas's house.
pub(super) const MOST_SHARED: f64 = 0.02;

/// Why a node's layout cannot be kept.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Fault {
    /// There is none.
    Missing,
    /// A primitive has none.
    MissingIn {
        /// Its index in the mesh.
        primitive: usize,
    },
    /// It leaves the unit square.
    Outside {
        /// Its bounds.
        low: DVec2,
        high: DVec2,
    },
    /// Triangles are lines or points in it.
    NoArea {
        /// So many of them,
        count: usize,
        /// of all that the node has.
        all: usize,
    },
    /// Triangles share room in it.
    Overlap {
        /// As a fraction of its area, at least; the layout is not kept beyond [`MOST_SHARED`].
        share: f64,
        /// Two of them, counted through the node's primitives.
        triangles: [usize; 2],
    },
}

impl Fault {
    /// What is this node's own, to be put behind its name.
    pub(super) fn detail(self) -> String {
        match self {
            Self::Missing => String::new(),
            Self::MissingIn { primitive } => format!(" (primitive {primitive})"),
            Self::Outside { low, high } => {
                format!(" (from {:.3}, {:.3} to {:.3}, {:.3})", low.x, low.y, high.x, high.y)
            }
            Self::NoArea { count, all } => format!(" ({count} of {all} triangles)"),
            Self::Overlap { share, triangles: [a, b] } if !self.is_fatal() => {
                format!(" ({:.2} % of its area, such as triangles {a} and {b})", 100.0 * share)
            }
            Self::Overlap { triangles: [a, b], .. } => format!(" (such as triangles {a} and {b})"),
        }
    }

    /// Whether the layout cannot be kept for it.
    pub(super) fn is_fatal(self) -> bool {
        !matches!(self, Self::Overlap { share, .. } if share <= MOST_SHARED)
    }

    /// The reason and what happens instead, the same words for all nodes.
    pub(super) fn text(self) -> String {
        let reason = match self {
            Self::Missing => {
                return "there is no TEXCOORD_1 to keep: the lightmap gets a layout of its own".to_owned();
            }
            Self::Overlap { .. } if !self.is_fatal() => {
                return "triangles overlap a little in TEXCOORD_1, which is kept: there they show the light of one of \
                        them"
                    .to_owned();
            }
            Self::MissingIn { .. } => "a primitive has no TEXCOORD_1",
            Self::Outside { .. } => "TEXCOORD_1 leaves the range from 0 to 1",
            Self::NoArea { .. } => "triangles have no area in TEXCOORD_1",
            Self::Overlap { .. } => "triangles overlap in TEXCOORD_1",
        };
        format!(
            "{reason}, so it is not kept: the lightmap gets a layout of its own, and the old one moves to TEXCOORD_2 if \
             textures use it"
        )
    }
}

/// What is wrong with the layout of a node of these placements, if anything.
pub(super) fn fault(
    scene: &Scene,
    placements: &[&Placement],
    coordinates: &[Option<[DVec2; 3]>],
) -> Option<Fault> {
    let lacks = |p: &&&Placement| coordinates.get(p.triangles.start).copied().flatten().is_none();
    let lacking: Vec<usize> = placements.iter().filter(lacks).map(|p| p.primitive).collect();
    if let Some(&primitive) = lacking.first() {
        let is_all = lacking.len() == placements.len();
        return Some(if is_all { Fault::Missing } else { Fault::MissingIn { primitive } });
    }
    let triangles: Vec<[DVec2; 3]> = placements.iter().flat_map(|p| layout(p, coordinates)).collect();
    let (low, high) = triangles
        .iter()
        .flatten()
        .fold((DVec2::INFINITY, DVec2::NEG_INFINITY), |(low, high), &p| (low.min(p), high.max(p)));
    let is_inside =
        |p: &DVec2| p.cmpge(DVec2::splat(-OUTSIDE)).all() && p.cmple(DVec2::splat(1.0 + OUTSIDE)).all();
    if !triangles.iter().flatten().all(is_inside) {
        return Some(Fault::Outside { low, high });
    }
    let corners =
        placements.iter().flat_map(|p| scene.triangles.get(p.triangles.clone()).unwrap_or_default());
    let pairs: Vec<_> = corners.map(|t| scene.corners(t)).zip(triangles.iter().copied()).collect();
    let density = mean_density(pairs.iter().copied());
    let (mut count, mut lost, mut all) = (0, 0.0, 0.0);
    for &(points, uv) in &pairs {
        let own = area_normal(points).length();
        all += own;
        // What has no area in the scene needs none in the layout.
        let stretch = stretch(points, uv);
        if own > 0.0 && stretch.is_some_and(|least| least <= LEAST_STRETCH * density) {
            (count, lost) = (count + 1, lost + own);
        }
    }
    if lost > NO_AREA * all || density <= 0.0 {
        return Some(Fault::NoArea { count, all: triangles.len() });
    }
    let whole = area(&triangles);
    let (mut first, mut share) = (None, 0.0);
    let _ = overlaps(&triangles, |pair, area| {
        first = first.or(Some(pair));
        share += area / whole;
        if share > MOST_SHARED { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    });
    first.map(|triangles| Fault::Overlap { share, triangles })
}
