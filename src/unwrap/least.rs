//! Finds the least page that charts of a given density need.
//!
//! Rectangles are packed into strips of several widths, as high as it takes, in several orders; the page
//! of the least area wins. It need not be square, nor its sides powers of two.

use rayon::prelude::*;

#[cfg(feature = "xatlas")]
use super::layout::packed;
use super::layout::{Layout, keeps_apart, sized};
use super::max_rects::MaxRects;
use super::pack::{LARGEST_SIDE, Packer, Page, Place, STEP, SizedShape};
use super::shape::Shape;

/// Strips that are tried.
const WIDTHS: i32 = 9;

/// The widest is this many times as wide as a square would be, the narrowest this many times narrower.
const WIDEST: f64 = 1.5;

/// Packs that xatlas gets.
#[cfg(feature = "xatlas")]
const XATLAS_PACKS: u32 = 6;

/// The least page found for the shapes at a density, no side longer than `longest`; `None` where they need a
/// longer one.
pub(super) fn least_page(
    shapes: &[Shape],
    texels_per_metre: f64,
    padding: u32,
    longest: u32,
) -> Option<(Page, Layout)> {
    let charts = sized(shapes, texels_per_metre)?;
    let longest = longest.min(LARGEST_SIDE);
    let mut found: Vec<(Page, Vec<Place>)> = strips(&charts, padding, longest)
        .into_par_iter()
        .flat_map_iter(|strip| MaxRects::ALL.map(|order| (strip, order)))
        .filter_map(|(strip, order)| {
            let places = order.pack(&charts, strip)?;
            Some((strip.cropped(&charts, &places), places))
        })
        .collect();
    // The sort is stable, so the first of equals wins whoever found it first.
    found.sort_by_key(|(page, _)| (area(*page), page.width.max(page.height)));
    let best = found.into_iter().find(|(page, places)| keeps_apart(&charts, places, *page));
    let best = best.map(|(page, places)| (page, Layout { texels_per_metre, places }))?;
    #[cfg(feature = "xatlas")]
    let best = nested(shapes, best);
    Some(best)
}

fn area(page: Page) -> u64 {
    u64::from(page.width) * u64::from(page.height)
}

/// The pages to pack into, without repetitions.
fn strips(charts: &[SizedShape<'_>], padding: u32, longest: u32) -> Vec<Page> {
    let page = Page { width: longest, height: longest, padding };
    let square = charts.iter().map(|c| page.cell_area(c)).sum::<f64>().sqrt();
    let footprint = |side: u32| side + 1;
    let thickest = charts.iter().map(|c| footprint(c.width.min(c.height))).max().unwrap_or(1);
    let longest_chart = charts.iter().map(|c| footprint(c.width.max(c.height))).max().unwrap_or(1);
    let half = WIDTHS / 2;
    let factors = (-half..=half).map(|k| WIDEST.powf(f64::from(k) / f64::from(half)));
    let widths = factors.map(|f| (f * square) as u32).chain([longest_chart]);
    let in_steps = |width: u32| width.max(thickest).next_multiple_of(STEP).min(longest);
    let mut widths: Vec<u32> = widths.map(in_steps).collect();
    widths.sort_unstable();
    widths.dedup();
    widths.into_iter().map(|width| Page { width, ..page }).collect()
}

/// A smaller square page in which the charts nest, if xatlas finds one.
#[cfg(feature = "xatlas")]
fn nested(shapes: &[Shape], best: (Page, Layout)) -> (Page, Layout) {
    let (Page { padding, .. }, density) = (best.0, best.1.texels_per_metre);
    let square = |steps: u32| Page { width: steps * STEP, height: steps * STEP, padding };
    let side = (area(best.0) as f64).sqrt();
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
