//! Finds the least page that charts of a given density need.
//!
//! Rectangles are packed into strips of several widths, as high as it takes, in several orders. The page
//! that will take the fewest bytes wins, about: it need not be square, nor its sides powers of two, and a
//! wide one is compressed better than a high one.

use rayon::prelude::*;

#[cfg(feature = "xatlas")]
use super::layout::packed;
use super::layout::{Layout, keeps_apart, sized};
use super::max_rects::MaxRects;
#[cfg(feature = "xatlas")]
use super::pack::STEP;
use super::pack::{Gutter, LARGEST_SIDE, Packer, Page, Place, SizedShape};
use super::shape::Shape;

/// How many times as wide as a square the strips are that are tried.
const WIDTHS: [f64; 9] = [0.8, 0.9, 1.0, 1.2, 1.5, 2.0, 2.5, 3.2, 4.0];

/// Strips more than this many times as wide as a square are not tried if they are wider than this, texels: small
/// pages gain most, and not every graphics card takes more than a few thousand.
const WIDE: (f64, f64) = (2.0, 1024.0);

/// An EXR is compressed in bands of this many rows,
const BAND: u32 = 32;
/// each of which has tables that take as much as this many texels.
const BAND_TABLES: u64 = 900;

/// Packs that xatlas gets.
#[cfg(feature = "xatlas")]
const XATLAS_PACKS: u32 = 6;

/// The least page found for the shapes at a density, no side longer than `longest`; `None` where they need a
/// longer one.
pub(super) fn least_page(
    shapes: &[Shape],
    texels_per_metre: f64,
    gutter: Gutter,
    longest: u32,
) -> Option<(Page, Layout)> {
    let charts = sized(shapes, texels_per_metre)?;
    let longest = longest.min(LARGEST_SIDE);
    let mut found: Vec<(Page, Vec<Place>)> = strips(&charts, gutter, longest)
        .into_par_iter()
        .flat_map_iter(|strip| MaxRects::ALL.map(|order| (strip, order)))
        .filter_map(|(strip, order)| {
            let places = order.pack(&charts, strip)?;
            Some((strip.cropped(&charts, &places), places))
        })
        .collect();
    // The sort is stable, so the first of equals wins whoever found it first.
    found.sort_by_key(|(page, _)| cost(*page));
    let best = found.into_iter().find(|(page, places)| keeps_apart(&charts, places, *page));
    let best = best.map(|(page, places)| (page, Layout { texels_per_metre, places }))?;
    #[cfg(feature = "xatlas")]
    let best = nested(shapes, best);
    Some(best)
}

/// What a page takes in the file, in texels.
fn cost(page: Page) -> u64 {
    u64::from(page.width) * u64::from(page.height) + BAND_TABLES * u64::from(page.height.div_ceil(BAND))
}

/// The pages to pack into, without repetitions.
fn strips(charts: &[SizedShape<'_>], gutter: Gutter, longest: u32) -> Vec<Page> {
    let page = Page { width: longest, height: longest, gutter };
    let square = charts.iter().map(|c| page.cell_area(c)).sum::<f64>().sqrt();
    let footprint = |side: u32| gutter.cell(side) - gutter.overhang();
    let thickest = charts.iter().map(|c| footprint(c.width.min(c.height))).max().unwrap_or(1);
    let longest_chart = charts.iter().map(|c| footprint(c.width.max(c.height))).max().unwrap_or(1);
    let is_tried = |factor: &f64| *factor <= WIDE.0 || factor * square <= WIDE.1;
    let factors = WIDTHS.into_iter().filter(is_tried);
    let widths = factors.map(|f| (f * square) as u32).chain([longest_chart]);
    let in_steps = |width: u32| width.max(thickest).next_multiple_of(gutter.step()).min(longest);
    let mut widths: Vec<u32> = widths.map(in_steps).collect();
    widths.sort_unstable();
    widths.dedup();
    widths.into_iter().map(|width| Page { width, ..page }).collect()
}

/// A smaller square page in which the charts nest, if xatlas finds one.
#[cfg(feature = "xatlas")]
fn nested(shapes: &[Shape], best: (Page, Layout)) -> (Page, Layout) {
    let (Page { gutter, .. }, density) = (best.0, best.1.texels_per_metre);
    let square = |steps: u32| Page { width: steps * STEP, height: steps * STEP, gutter };
    let side = (f64::from(best.0.width) * f64::from(best.0.height)).sqrt();
    let Some(packer) = super::xatlas::Nesting::worthwhile(shapes, square((side / f64::from(STEP)) as u32))
    else {
        return best;
    };
    let Some(charts) = sized(shapes, density) else { return best };
    let covered: f64 = shapes.iter().map(Shape::weighed_area).sum::<f64>().sqrt() * density;
    let (mut below, mut above) = ((covered / f64::from(STEP)) as u32, (side / f64::from(STEP)).ceil() as u32);
    let mut found = best;
    for _ in 0..XATLAS_PACKS {
        if above <= below + 1 {
            break;
        }
        let middle = below + (above - below) / 2;
        match packed(&packer, &charts, square(middle)) {
            Some(places) => {
                above = middle;
                found = (square(middle), Layout { texels_per_metre: density, places });
            }
            None => below = middle,
        }
    }
    found
}
