//! Stage 6: charts are laid out in the lightmap's page. The only module that knows xatlas.
//!
//! A surface is flat, so a chart of a part of it is an affine map of the surface's frame: a scale along
//! each axis that makes the extents whole numbers of texels, a quarter turn at most, and a whole-number
//! shift. The extreme corners therefore lie on texel centres, and a bilinear lookup inside a chart of
//! `w × h` texels touches exactly `(w + 1) × (h + 1)` of them. No chart is thinner than one texel.
//!
//! Two packers share one trait: one for bounding rectangles, quick and always there, and
//! xatlas (feature `xatlas`), which sees the charts' shapes and nests them in a square page. The
//! first one's answer is where xatlas's search begins, and the answer where xatlas finds nothing better.
//!
//! Pages need not be square. Where the page is given, charts grow until it is full (`fill`); where
//! the charts' density is given, the page becomes as small as they allow (`least`).

mod bit_grid;
mod block;
mod error;
mod fill;
pub(crate) mod footprint;
mod islands;
mod layout;
mod least;
mod max_rects;
mod pack;
mod pages;
mod part;
mod shape;
#[cfg(feature = "xatlas")]
mod xatlas;

pub use block::{Block, Member, blocks};
pub use error::UnwrapError;
pub use islands::shared_texels;
pub(crate) use part::area_within;
pub use part::{Part, whole};

use std::ops::Range;

use glam::{DAffine2, DVec2};

use crate::geom::Ring;
use crate::surface::Surface;
use fill::fill;
use layout::density_of_texels;
use least::least_page;
use pack::{Gutter, LARGEST_SIDE, Page};
use pages::lay_out_on_pages;
use shape::Shape;

/// Where each surface lies in the lightmap.
///
/// While texels are made, pages lie one below another in one sheet; a single page is the sheet.
#[derive(Clone, Debug)]
pub struct Atlas {
    /// The sheet's width, texels: that of the widest page.
    pub width: u32,
    /// The sheet's height, texels: that of all pages, and free rows between them.
    pub height: u32,
    /// The pages, from the top; at least one.
    pub pages: Vec<PageArea>,
    /// Texels per metre of surface, before what rounding charts to whole texels changed.
    pub texels_per_metre: f64,
    /// Free texels kept between what bilinear lookups of two charts touch; none at the page's edge.
    pub gutter: u32,
    /// Surface by surface, at least one for each that gets a lightmap.
    pub charts: Vec<Chart>,
    /// Where each [`Block`] lies.
    pub blocks: Vec<BlockPlace>,
}

/// A block's place in the sheet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BlockPlace {
    /// Index into the atlas's pages.
    pub page: usize,
    /// Takes the layout's coordinates to texels of the sheet.
    pub texel_from_uv: DAffine2,
}

impl BlockPlace {
    /// What takes the layout's coordinates to those of its page, `[0, 1]`; `None` where that changes nothing.
    #[must_use]
    pub fn page_from_uv(&self, atlas: &Atlas) -> Option<DAffine2> {
        let page = atlas.pages.get(self.page)?;
        let size = DVec2::new(page.width.into(), page.height.into());
        if self.texel_from_uv == DAffine2::from_scale(size) {
            return None;
        }
        let shift = DAffine2::from_translation(DVec2::new(0.0, -f64::from(page.row)));
        Some(DAffine2::from_scale(1.0 / size) * shift * self.texel_from_uv)
    }
}

impl Atlas {
    /// The charts of a surface: together they cover it, and no two share more than a cut.
    #[must_use]
    pub fn charts_of(&self, surface: usize) -> &[Chart] {
        &self.charts[self.indices_of(surface)]
    }

    /// The indices of [`Self::charts_of`].
    #[must_use]
    pub fn indices_of(&self, surface: usize) -> Range<usize> {
        let first = self.charts.partition_point(|c| c.surface < surface);
        first..first + self.charts[first..].partition_point(|c| c.surface == surface)
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

/// A page's place in the sheet: it begins in column 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PageArea {
    /// Its first row.
    pub row: u32,
    /// Texels.
    pub width: u32,
    /// Texels.
    pub height: u32,
}

impl PageArea {
    /// How many texels it has.
    #[must_use]
    pub fn texels(&self) -> u64 {
        u64::from(self.width) * u64::from(self.height)
    }
}

/// A part of a surface and its place in the sheet: an affine map, since a surface is flat.
///
/// It can always be inverted. It may mirror: a chart that is turned has its axes swapped.
#[derive(Clone, Debug, PartialEq)]
pub struct Chart {
    /// Index into the surfaces.
    pub surface: usize,
    /// What of the surface the chart shows: what lies in this convex polygon, counter-clockwise, plane coordinates.
    pub outline: Ring,
    /// Index into the atlas's pages.
    pub page: usize,
    /// Takes the surface's plane coordinates (metres) to texels; `(0, 0)` is the sheet's top left corner,
    /// texel `(i, j)`'s centre lies at `(i + ½, j + ½)`.
    pub texel_from_plane: DAffine2,
}

impl Chart {
    /// Where plane point `p` lies in the sheet, texels.
    #[must_use]
    pub fn texel(&self, p: DVec2) -> DVec2 {
        self.texel_from_plane.transform_point2(p)
    }
}

/// What decides how large the page becomes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Room {
    /// The page is a square of this side, texels, and charts are as dense as fit; columns and rows
    /// that no chart reaches are cut off.
    Square(u32),
    /// This many texels a metre; the page is as small as the packers reach.
    Density(f64),
    /// About this many texels in all, with gaps; the page is as small as the packers reach.
    Texels(f64),
}

/// What [`unwrap`] can be told.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UnwrapOptions {
    /// How large the page becomes.
    pub room: Room,
    /// Charts are not denser than this, texels a metre, where more would fit. Default: no limit.
    pub most: Option<f64>,
    /// Free texels around each chart's bilinear footprint, twice as many between two. Default: one texel between two
    /// charts, which no lookup inside either touches, also with a graphics card's fixed-point weights; none where
    /// the charts do not fit otherwise.
    pub padding: Option<u32>,
    /// Mip levels, at most [`MOST_MIPS`], in which bilinear lookups inside a chart touch no other chart's texels:
    /// each chart's cell begins and ends at multiples of `2^mips`, with at least half as much
    /// free inside. Costs room. Default: 0, for lookups in the page itself only.
    pub mips: u32,
    /// The most pages, at least 1: [`Room::Square`] is for each, and as many are filled as charts want;
    /// otherwise there are several where one of 16384 texels a side does not do. Default: 1.
    pub pages: u32,
}

/// The most mip levels that [`UnwrapOptions::mips`] asks for: cells of 16 texels.
pub const MOST_MIPS: u32 = 4;

impl UnwrapOptions {
    /// The defaults in a page of this size.
    #[must_use]
    pub fn new(room: Room) -> Self {
        Self { room, most: None, padding: None, mips: 0, pages: 1 }
    }
}

/// Lays a chart for each of the surfaces' `parts` (ordered by surface) out in one page, or in several.
///
/// A part's own weight multiplies the density. Sides of the page are multiples of 4, but for one that
/// [`Room::Square`] gives, and of the cells that mip levels ask for in any case. The same input gives the same atlas.
///
/// # Errors
///
/// [`UnwrapError::TooSmall`] if the charts do not fit even with one texel each,
/// [`UnwrapError::TooLarge`] if the density asked for needs a page above 16384 texels.
pub fn unwrap(surfaces: &[Surface], parts: &[Part], options: &UnwrapOptions) -> Result<Atlas, UnwrapError> {
    unwrap_groups(surfaces, (&[], parts), &|surface| surface.placement, options)
}

/// As [`unwrap`], with blocks of other surfaces beside the parts; surfaces of one `group` share a page where they can.
/// A block that is alone has the page to itself: its layout's unit square is the page.
///
/// # Errors
/// As [`unwrap`].
pub fn unwrap_groups(
    surfaces: &[Surface],
    (blocks, parts): (&[Block], &[Part]),
    group: &dyn Fn(&Surface) -> usize,
    options: &UnwrapOptions,
) -> Result<Atlas, UnwrapError> {
    if let ([block], []) = (blocks, parts) {
        return block.page(surfaces, options, gutter(options.padding, options.mips));
    }
    let own = parts.iter().map(|part| Shape::of(part, &surfaces[part.surface]));
    let shapes: Vec<_> = blocks.iter().map(|block| block.shape(surfaces)).chain(own).collect();
    let first = |block: &Block| block.members.first().map_or(0, |member| member.surface);
    let firsts = blocks.iter().map(first).chain(parts.iter().map(|part| part.surface));
    let groups: Vec<usize> = firsts.map(|surface| surfaces.get(surface).map_or(0, group)).collect();
    let lay_out = |gutter| match options.pages {
        0 | 1 => lay_out(&shapes, options, gutter),
        _ => lay_out_on_pages(&shapes, &groups, options, gutter),
    };
    let atlas = lay_out(gutter(options.padding, options.mips));
    let atlas = match (&atlas, options.padding) {
        (Err(_), None) => lay_out(Gutter::new(0, options.mips)).or(atlas),
        _ => atlas,
    };
    atlas.map(|atlas| opened(atlas, blocks, surfaces))
}

/// The atlas with the charts of the blocks' surfaces in place of the blocks' own, which come first.
fn opened(mut atlas: Atlas, blocks: &[Block], surfaces: &[Surface]) -> Atlas {
    for (block, chart) in blocks.iter().zip(atlas.charts.drain(..blocks.len()).collect::<Vec<_>>()) {
        let (place, charts) = block.charts(surfaces, &chart);
        atlas.blocks.push(place);
        atlas.charts.extend(charts);
    }
    // The sort is stable.
    atlas.charts.sort_by_key(|chart| chart.surface);
    atlas
}

/// Refuses square pages of this side if so many charts cannot fit, however small they are and whatever lies between:
/// lookups in the smallest touch two by two texels.
///
/// # Errors
///
/// [`UnwrapError::TooSmall`].
pub fn check_side(charts: usize, (side, pages): (u32, u32), padding: Option<u32>) -> Result<(), UnwrapError> {
    let fit = u64::from(pages) * u64::from(side / 2).pow(2);
    if charts as u64 <= fit {
        return Ok(());
    }
    Err(UnwrapError::TooSmall { charts, gutter: 2 * padding.unwrap_or(0), side })
}

fn gutter(padding: Option<u32>, mips: u32) -> Gutter {
    Gutter::new(padding.map_or(1, |p| 2 * p.min(LARGEST_SIDE)), mips)
}

/// The columns, and the rows, that a chart's cell takes beside its footprint, on average.
#[must_use]
pub fn mean_gutter(padding: Option<u32>, mips: u32) -> u32 {
    let Gutter { gap, align } = gutter(padding, mips);
    gap + align / 2
}

/// Lays `shapes` out with that much between them.
fn lay_out(shapes: &[Shape], options: &UnwrapOptions, gutter: Gutter) -> Result<Atlas, UnwrapError> {
    let most = options.most.unwrap_or(f64::INFINITY);
    let charts = shapes.len();
    let (density, longest) = match options.room {
        Room::Square(side) => {
            // Levels of a page whose sides are no multiples of the cells' would not keep to the cells.
            let side = side.min(LARGEST_SIDE) / gutter.align * gutter.align;
            let page = Page { width: side, height: side, gutter };
            let too_small = UnwrapError::TooSmall { charts, gutter: gutter.gap, side };
            let layout = fill(shapes, page, most).ok_or(too_small.clone())?;
            if layout.texels_per_metre < most {
                return layout.atlas(shapes, page).ok_or(too_small);
            }
            // There is room to spare.
            (most, side)
        }
        Room::Density(density) => (density.min(most), LARGEST_SIDE),
        Room::Texels(texels) => {
            let area: f64 = shapes.iter().map(Shape::weighed_area).sum();
            let bound = (texels / area).sqrt();
            let most = most.min(if bound.is_finite() { bound } else { 1.0 });
            (density_of_texels(shapes, texels, gutter, most), LARGEST_SIDE)
        }
    };
    let too_large = UnwrapError::TooLarge { charts, texels_per_metre: density, side: longest };
    let (page, layout) = least_page(shapes, density, gutter, longest).ok_or(too_large.clone())?;
    layout.atlas(shapes, page).ok_or(too_large)
}
