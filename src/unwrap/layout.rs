//! Charts in their places, and the check that they keep apart.

use super::bit_grid::BitGrid;
use super::footprint;
use super::pack::{Gutter, Packer, Page, Place, SizedShape};
use super::shape::Shape;
use super::{Atlas, PageArea, pack};

/// Charts that fit.
#[derive(Clone, Debug)]
pub(super) struct Layout {
    /// The density; each shape's own weight comes on top.
    pub(super) texels_per_metre: f64,
    /// One a shape, in order.
    pub(super) places: Vec<Place>,
}

impl Layout {
    /// The layout as the stages after this one see it, in a page without empty columns and rows at its end.
    pub(super) fn atlas(&self, shapes: &[Shape], page: Page) -> Option<Atlas> {
        let sized = sized(shapes, self.texels_per_metre)?;
        let page = page.cropped(&sized, &self.places);
        let sum = |of: fn(&Shape) -> f64| shapes.iter().map(of).sum::<f64>();
        let mean_weight = (sum(Shape::weighed_area) / sum(|s| s.area)).sqrt();
        Some(Atlas {
            width: page.width,
            height: page.height,
            pages: vec![PageArea { row: 0, width: page.width, height: page.height }],
            texels_per_metre: self.texels_per_metre * if mean_weight.is_finite() { mean_weight } else { 1.0 },
            gutter: page.gutter.gap,
            charts: sized.iter().zip(&self.places).map(|(chart, &place)| chart.chart(place)).collect(),
            blocks: Vec::new(),
        })
    }
}

/// Packs at a density.
pub(super) fn attempt(
    packer: &dyn Packer,
    shapes: &[Shape],
    page: Page,
    texels_per_metre: f64,
) -> Option<Layout> {
    let places = packed(packer, &sized(shapes, texels_per_metre)?, page)?;
    Some(Layout { texels_per_metre, places })
}

/// Packs and checks.
pub(super) fn packed(packer: &dyn Packer, charts: &[SizedShape<'_>], page: Page) -> Option<Vec<Place>> {
    let longest = page.width.max(page.height);
    if charts.iter().any(|c| c.width.max(c.height) >= longest) {
        return None;
    }
    let places = packer.pack(charts, page)?;
    keeps_apart(charts, &places, page).then_some(places)
}

/// All shapes at a density; `None` if one is too long for any page.
pub(super) fn sized(shapes: &[Shape], texels_per_metre: f64) -> Option<Vec<SizedShape<'_>>> {
    shapes.iter().map(|s| SizedShape::new(s, texels_per_metre)).collect()
}

/// Whether every footprint lies in the page, and each is the gap from all others.
pub(super) fn keeps_apart(charts: &[SizedShape<'_>], places: &[Place], page: Page) -> bool {
    let Gutter { gap, .. } = page.gutter;
    let grown = |texels: u32| texels as usize + gap as usize;
    let mut taken = BitGrid::new(grown(page.width), grown(page.height));
    charts.iter().zip(places).all(|(sized, &place)| {
        let local = sized.chart(Place { x: 0, y: 0, ..place });
        let (width, height) = sized.turned(place.turn);
        let inside = place.x + width < page.width && place.y + height < page.height;
        let mut own = BitGrid::new(grown(width + 1), grown(height + 1));
        let (bound, gap) = (grown(height + 1) as i64, i64::from(gap));
        for triangle in &sized.shape.triangles {
            for span in footprint::spans(triangle.map(|p| local.texel(p)), 1.0, (0, bound)) {
                for y in span.y..=span.y + gap {
                    own.set_span(y, span.first, span.last + gap);
                }
            }
        }
        inside && taken.stamp(&own, place.x as usize, place.y as usize)
    })
}

/// The density at which all charts take about `texels` with their gaps, none above `most`;
/// 0 where charts of one texel take more.
pub(super) fn density_of_texels(shapes: &[Shape], texels: f64, gutter: Gutter, most: f64) -> f64 {
    let page = Page { width: pack::LARGEST_SIDE, height: pack::LARGEST_SIDE, gutter };
    let fits = |density: f64| {
        let texels_of = |s: &Shape| SizedShape::new(s, density).map_or(f64::INFINITY, |c| page.cell_area(&c));
        shapes.iter().map(texels_of).sum::<f64>() <= texels
    };
    if fits(most) {
        return most;
    }
    let (mut low, mut high) = (0.0, most);
    for _ in 0..32 {
        let middle = 0.5 * (low + high);
        if fits(middle) { low = middle } else { high = middle }
    }
    low
}
