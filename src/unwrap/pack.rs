//! What a packer is given and what it returns.

use glam::{DAffine2, DMat2, DVec2};

use super::Chart;
use super::shape::Shape;

/// The largest page, texels a side.
pub(super) const LARGEST_SIDE: u32 = 16384;

/// Sides that are not given are multiples of this: block-compressed formats need it.
pub(super) const STEP: u32 = 4;

/// How far apart charts stay, and where they may begin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Gutter {
    /// Free texels between two footprints, at least.
    pub(super) gap: u32,
    /// Charts' cells (footprint and gap) begin and end at multiples of this, a power of two, so that a
    /// texel of a mip map shows one chart only. Where it is 1, gaps may hang over the page's far edges.
    pub(super) align: u32,
}

impl Gutter {
    /// For so many mip levels, with at least `gap`.
    ///
    /// A lookup in level `n` touches texels of `b = 2ⁿ` whose centres are less than `b` away. With the footprint
    /// at least `b / 2` inside a cell of whole such texels these are the cell's own, and they are in the
    /// finer levels then.
    pub(super) fn new(gap: u32, mips: u32) -> Self {
        let align = 1 << mips.min(super::MOST_MIPS);
        let gap = gap.min(LARGEST_SIDE);
        Self { gap: if align == 1 { gap } else { gap.max(align).next_multiple_of(2) }, align }
    }

    /// Sides that are not given are multiples of this.
    pub(super) fn step(self) -> u32 {
        STEP.max(self.align)
    }

    /// Texels that a cell takes along a side on which its chart has `texels` from the first centre to the last.
    pub(super) fn cell(self, texels: u32) -> u32 {
        (texels + 1 + self.gap).next_multiple_of(self.align)
    }

    /// The texels by which cells may hang over the page's far edges.
    pub(super) fn overhang(self) -> u32 {
        if self.align == 1 { self.gap } else { 0 }
    }

    /// Texels from a cell's beginning to its footprint.
    fn inset(self) -> u32 {
        if self.align == 1 { 0 } else { self.gap / 2 }
    }
}

/// A page, and how far apart charts stay in it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Page {
    /// Texels.
    pub(super) width: u32,
    /// Texels.
    pub(super) height: u32,
    /// What lies between charts.
    pub(super) gutter: Gutter,
}

impl Page {
    /// Columns and rows that there are for cells.
    pub(super) fn grown(&self) -> (u32, u32) {
        let over = self.gutter.overhang();
        (self.width + over, self.height + over)
    }

    /// The columns and rows that a chart takes with the gap beside it.
    pub(super) fn cell(&self, chart: &SizedShape<'_>) -> (u32, u32) {
        (self.gutter.cell(chart.width), self.gutter.cell(chart.height))
    }

    /// As `cell`, in texels of the page.
    pub(super) fn cell_area(&self, chart: &SizedShape<'_>) -> f64 {
        let (width, height) = self.cell(chart);
        f64::from(width) * f64::from(height)
    }

    /// The place of a chart whose cell begins at that column and row of those that there are for cells.
    pub(super) fn place(&self, (x, y): (u32, u32), turn: Turn) -> Place {
        let inset = self.gutter.inset();
        Place { x: x + inset, y: y + inset, turn }
    }

    /// The page without the columns and rows at its end that no chart reaches.
    pub(super) fn cropped(&self, charts: &[SizedShape<'_>], places: &[Place]) -> Self {
        let (mut width, mut height) = (1, 1);
        for (chart, place) in charts.iter().zip(places) {
            let (w, h) = chart.turned(place.turn);
            let end = |at: u32, texels: u32| {
                at + self.gutter.cell(texels) - self.gutter.inset() - self.gutter.overhang()
            };
            (width, height) = (width.max(end(place.x, w)), height.max(end(place.y, h)));
        }
        let step = |used: u32, all: u32| used.next_multiple_of(self.gutter.step()).min(all);
        Self { width: step(width, self.width), height: step(height, self.height), ..*self }
    }
}

/// A shape at a density: its extents in whole texels.
#[derive(Clone, Copy, Debug)]
pub(super) struct SizedShape<'a> {
    /// The surface's outline.
    pub(super) shape: &'a Shape,
    /// Texels from the first texel centre to the last, at least 1; the footprint has one more.
    pub(super) width: u32,
    /// As `width`, in the second direction.
    pub(super) height: u32,
}

/// Where a chart lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Place {
    /// Column of the footprint's first texel.
    pub(super) x: u32,
    /// Row of the footprint's first texel.
    pub(super) y: u32,
    /// How the chart lies.
    pub(super) turn: Turn,
}

/// How a chart lies in the page.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Turn {
    /// The frame's first axis runs along rows.
    Upright,
    /// The frame's axes are swapped.
    Swapped,
}

/// Puts charts into a page.
pub(super) trait Packer {
    /// One place per chart, in order, or nothing if they do not fit.
    ///
    /// The footprints lie in the page, two of them at least the gap apart. The same input gives the same places.
    fn pack(&self, charts: &[SizedShape<'_>], page: Page) -> Option<Vec<Place>>;
}

impl<'a> SizedShape<'a> {
    /// `shape` at a density, rounded to whole texels; `None` if it is too long for any page.
    pub(super) fn new(shape: &'a Shape, texels_per_metre: f64) -> Option<Self> {
        let side = |metres: f64, weight: f64| {
            let texels = (metres * weight * texels_per_metre).round().max(1.0);
            (texels < f64::from(LARGEST_SIDE)).then_some(texels as u32)
        };
        let (extent, weight) = (shape.extent, shape.weight);
        Some(Self { shape, width: side(extent.x, weight.x)?, height: side(extent.y, weight.y)? })
    }

    /// Columns and rows from the first texel centre to the last, where the chart lies so.
    pub(super) fn turned(&self, turn: Turn) -> (u32, u32) {
        match turn {
            Turn::Upright => (self.width, self.height),
            Turn::Swapped => (self.height, self.width),
        }
    }

    /// Texels per metre along each of the frame's axes.
    pub(super) fn scale(&self) -> DVec2 {
        let along = |texels: u32, metres: f64| if metres > 0.0 { f64::from(texels) / metres } else { 1.0 };
        DVec2::new(along(self.width, self.shape.extent.x), along(self.height, self.shape.extent.y))
    }

    /// The map that puts the chart at `place`.
    pub(super) fn chart(&self, place: Place) -> Chart {
        let scale = self.scale();
        let matrix = match place.turn {
            Turn::Upright => DMat2::from_diagonal(scale),
            Turn::Swapped => DMat2::from_cols(DVec2::new(0.0, scale.x), DVec2::new(scale.y, 0.0)),
        };
        let corner = DVec2::new(f64::from(place.x), f64::from(place.y)) + 0.5;
        let texel_from_plane = DAffine2::from_mat2_translation(matrix, corner - matrix * self.shape.corner);
        Chart { surface: self.shape.surface, outline: self.shape.outline.clone(), page: 0, texel_from_plane }
    }
}
