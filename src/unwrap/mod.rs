//! Stage 6: charts are laid out in the lightmap's page. The only module that knows xatlas.
//!
//! A surface is flat, so a chart of a part of it is an affine map of the surface's frame: a scale along
//! each axis that makes the extents whole numbers of texels, a quarter turn at most, and a whole-number
//! shift. The extreme corners therefore lie on texel centres, and a bilinear lookup inside a chart of
//! `w × h` texels touches exactly `(w + 1) × (h + 1)` of them. No chart is thinner than one texel.
//!
//! Two packers share one trait: a skyline over bounding rectangles, quick and always there, and
//! xatlas (feature `xatlas`), which sees the charts' shapes and nests them. The skyline's density
//! is where xatlas's search begins, and the answer where xatlas finds nothing better.

mod bit_grid;
mod density;
mod error;
pub(crate) mod footprint;
mod pack;
mod part;
mod shape;
mod skyline;
#[cfg(feature = "xatlas")]
mod xatlas;

pub use error::UnwrapError;
pub(crate) use part::clip;
pub use part::{Part, whole};

use glam::{DAffine2, DVec2};

use crate::geom::Ring;
use crate::options::Resolution;
use crate::surface::Surface;

/// Where each surface lies in the lightmap.
#[derive(Clone, Debug)]
pub struct Atlas {
    /// The page's width, texels.
    pub width: u32,
    /// The page's height, texels.
    pub height: u32,
    /// Texels per metre of surface, before what rounding charts to whole texels changed.
    pub texels_per_metre: f64,
    /// Free texels kept around what bilinear lookups of a chart touch, so that twice as many lie
    /// between two charts; none at the page's edge.
    pub padding: u32,
    /// Surface by surface, at least one for each.
    pub charts: Vec<Chart>,
}

impl Atlas {
    /// The charts of a surface: together they cover it, and no two share more than a cut.
    #[must_use]
    pub fn charts_of(&self, surface: usize) -> &[Chart] {
        let first = self.charts.partition_point(|c| c.surface < surface);
        let end = first + self.charts[first..].partition_point(|c| c.surface == surface);
        &self.charts[first..end]
    }

    /// The chart that holds point `p` of a surface (plane coordinates, metres), or the nearest one; `None` for a
    /// surface without charts.
    #[must_use]
    pub fn chart_at(&self, surface: usize, p: DVec2) -> Option<&Chart> {
        let outside = |chart: &Chart| {
            let edges = chart.outline.iter().zip(chart.outline.iter().cycle().skip(1));
            let beyond = edges.map(|(&a, &b)| (b - a).normalize_or_zero().perp_dot(a - p));
            beyond.fold(f64::NEG_INFINITY, f64::max)
        };
        self.charts_of(surface).iter().min_by(|a, b| outside(a).total_cmp(&outside(b)))
    }
}

/// A part of a surface and its place in the page: an affine map, since a surface is flat.
///
/// It can always be inverted. It may mirror: a chart that is turned has its axes swapped.
#[derive(Clone, Debug, PartialEq)]
pub struct Chart {
    /// Index into the surfaces.
    pub surface: usize,
    /// What of the surface the chart shows: what lies in this convex polygon, counter-clockwise, plane coordinates.
    pub outline: Ring,
    /// Takes the surface's plane coordinates (metres) to texels; `(0, 0)` is the page's top left corner,
    /// texel `(i, j)`'s centre lies at `(i + ½, j + ½)`.
    pub texel_from_plane: DAffine2,
}

impl Chart {
    /// Where plane point `p` lies in the page, texels.
    #[must_use]
    pub fn texel(&self, p: DVec2) -> DVec2 {
        self.texel_from_plane.transform_point2(p)
    }
}

/// What [`unwrap`] can be told.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct UnwrapOptions {
    /// The page's side, or the density from which it follows.
    pub resolution: Resolution,
    /// Free texels around each chart's bilinear footprint. Default: 1, which leaves two between
    /// charts, enough for bilinear filtering with a graphics card's fixed-point weights; 0 where
    /// the charts do not fit otherwise.
    pub padding: Option<u32>,
}

/// Lays a chart for each of the surfaces' `parts` (ordered by surface) out in one square page.
///
/// With [`Resolution::Size`] the page has exactly that side, and the density is the largest that
/// the search finds to fit. With [`Resolution::TexelsPerMetre`] the page's side is the least
/// multiple of 4 that the packers reach. The same input gives the same atlas.
///
/// # Errors
///
/// [`UnwrapError::TooSmall`] if the charts do not fit even with one texel each,
/// [`UnwrapError::TooLarge`] if the density asked for needs a page above 16384 texels.
pub fn unwrap(surfaces: &[Surface], parts: &[Part], options: &UnwrapOptions) -> Result<Atlas, UnwrapError> {
    let shapes: Vec<_> = parts.iter().map(|part| shape::Shape::of(part, &surfaces[part.surface])).collect();
    let padding = options.padding.unwrap_or(1);
    let atlas = density::lay_out(&shapes, options.resolution, padding);
    match (&atlas, options.padding) {
        (Err(_), None) => density::lay_out(&shapes, options.resolution, 0).or(atlas),
        _ => atlas,
    }
}
