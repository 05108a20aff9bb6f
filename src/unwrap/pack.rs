//! What a packer is given and what it returns.

use glam::{DAffine2, DMat2, DVec2};

use super::Chart;
use super::shape::Shape;

/// The largest page, texels a side.
pub(super) const LARGEST_SIDE: u32 = 16384;

/// Sides that are not given are multiples of this: block-compressed formats need it.
pub(super) const STEP: u32 = 4;

/// A page, and how far apart charts stay in it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Page {
    /// Texels.
    pub(super) width: u32,
    /// Texels.
    pub(super) height: u32,
    /// Free texels around each footprint; the page's edge needs none.
    pub(super) padding: u32,
}

impl Page {
    /// The columns and rows that charts take with their padding, which may hang over the page's edge.
    pub(super) fn grown(&self) -> (u32, u32) {
        (self.width + 2 * self.padding, self.height + 2 * self.padding)
    }

    /// The columns and rows that a chart takes with its padding.
    pub(super) fn cell(&self, chart: &SizedShape<'_>) -> (u32, u32) {
        (chart.width + 1 + 2 * self.padding, chart.height + 1 + 2 * self.padding)
    }

    /// As `cell`, in texels of the page.
    pub(super) fn cell_area(&self, chart: &SizedShape<'_>) -> f64 {
        let (width, height) = self.cell(chart);
        f64::from(width) * f64::from(height)
    }

    /// The page without the columns and rows that no chart reaches, in whole steps of `STEP`.
    pub(super) fn cropped(&self, charts: &[SizedShape<'_>], places: &[Place]) -> Self {
        let (mut width, mut height) = (1, 1);
        for (chart, place) in charts.iter().zip(places) {
            let (w, h) = chart.turned(place.turn);
            (width, height) = (width.max(place.x + w + 1), height.max(place.y + h + 1));
        }
        let step = |used: u32, all: u32| used.next_multiple_of(STEP).min(all);
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
    /// The footprints, each grown by the padding, do not overlap, and lie in the page before they
    /// are grown. The same input gives the same places.
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
        Chart { surface: self.shape.surface, outline: self.shape.outline.clone(), texel_from_plane }
    }
}
