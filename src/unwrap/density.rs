//! Finds the density that fills a page, or the page that a density needs.
//!
//! Whether charts fit is a nearly monotone question, so it is asked by bisection: first of the
//! skyline, which answers in milliseconds, then of xatlas, which begins at the skyline's answer
//! and gets few tries. A layout of xatlas's counts only after its footprints have been checked
//! against each other.

use super::bit_grid::BitGrid;
use super::footprint;
use super::pack::{Packer, Page, Place, SizedShape};
use super::shape::Shape;
use super::skyline::Skyline;
use super::{Atlas, UnwrapError};
use crate::options::Resolution;

/// The largest page, texels a side.
pub(super) const LARGEST_SIDE: u32 = 16384;

/// A side that follows from a density is a multiple of this: block-compressed formats need it.
const SIDE_STEP: u32 = 4;

/// The share of a page that a first guess assumes to be covered; typical of the skyline.
const GUESSED_SHARE: f64 = 0.92;

/// How long a search goes on.
#[derive(Clone, Copy, Debug)]
struct Effort {
    /// Packs at most.
    packs: u32,
    /// The search ends when the bracket's ends differ by less than this factor.
    precision: f64,
    /// The first steps away from the guess go by this factor.
    stride: f64,
}

const SKYLINE_EFFORT: Effort = Effort { packs: 16, precision: 1.002, stride: 1.04 };
#[cfg(feature = "xatlas")]
const XATLAS_EFFORT: Effort = Effort { packs: 7, precision: 1.008, stride: 1.04 };

/// Charts that fit.
struct Layout {
    texels_per_metre: f64,
    places: Vec<Place>,
}

/// Lays `shapes` out at the resolution asked for.
pub(super) fn lay_out(shapes: &[Shape], resolution: Resolution, padding: u32) -> Result<Atlas, UnwrapError> {
    let padding = padding.min(LARGEST_SIDE);
    match resolution {
        Resolution::Size(side) => {
            let page = Page { side: side.min(LARGEST_SIDE), padding };
            let too_small = UnwrapError::TooSmall { charts: shapes.len(), padding, side };
            let layout = fill(shapes, page).ok_or(too_small)?;
            Ok(atlas(shapes, page, &layout))
        }
        Resolution::TexelsPerMetre(texels_per_metre) => {
            let too_large =
                UnwrapError::TooLarge { charts: shapes.len(), texels_per_metre, side: LARGEST_SIDE };
            let (side, layout) = least_page(shapes, texels_per_metre, padding).ok_or(too_large)?;
            Ok(atlas(shapes, Page { side, padding }, &layout))
        }
    }
}

/// The densest layout found in `page`, or nothing if not even charts of one texel fit.
fn fill(shapes: &[Shape], page: Page) -> Option<Layout> {
    let ceiling = density_bound(shapes, page);
    let guess = density_at_share(shapes, page, GUESSED_SHARE).min(ceiling);
    let sparsest = attempt(&Skyline, shapes, page, 0.0);
    let best = densest(&Skyline, (shapes, page), (sparsest, guess, ceiling), SKYLINE_EFFORT);
    #[cfg(feature = "xatlas")]
    if let Some(packer) = super::xatlas::Nesting::worthwhile(shapes, page.side) {
        let guess = best.as_ref().map_or(guess, |b| b.texels_per_metre * XATLAS_EFFORT.stride).min(ceiling);
        return densest(&packer, (shapes, page), (best, guess, ceiling), XATLAS_EFFORT);
    }
    best
}

/// Bisects for the densest layout, from `known` (which fits) upward, trying `guess` first;
/// nothing fits at or above `ceiling`.
fn densest(
    packer: &dyn Packer,
    (shapes, page): (&[Shape], Page),
    (known, guess, ceiling): (Option<Layout>, f64, f64),
    effort: Effort,
) -> Option<Layout> {
    let mut best = known;
    let mut above = ceiling;
    let mut next = guess;
    let mut stride = effort.stride;
    for _ in 0..effort.packs {
        match attempt(packer, shapes, page, next) {
            Some(layout) => best = Some(layout),
            None => above = next,
        }
        let below = best.as_ref().map_or(0.0, |b| b.texels_per_metre);
        if below > 0.0 && above <= below * effort.precision {
            break;
        }
        // Far from the answer the steps grow; once both sides are near, halve.
        next = if below > 0.0 && above / below < stride * stride {
            (below * above).sqrt()
        } else if above == next {
            (next / stride).max((below * above).sqrt())
        } else {
            (below * stride).min((below * above).sqrt())
        };
        stride *= stride;
    }
    best
}

/// The least page that holds the charts at a density, and how they lie in it.
fn least_page(shapes: &[Shape], texels_per_metre: f64, padding: u32) -> Option<(u32, Layout)> {
    let sized = sized(shapes, texels_per_metre)?;
    let in_steps = |texels: f64| (texels / f64::from(SIDE_STEP)).ceil().max(1.0) as u32;
    let longest = sized.iter().map(|s| s.width.max(s.height) + 1).max().unwrap_or(0);
    let covered: f64 = sized.iter().map(|s| texels_of(s, padding)).sum();
    let floor = in_steps((covered.sqrt() - f64::from(2 * padding)).max(f64::from(longest)));
    let attempt = |packer: &dyn Packer, steps: u32| {
        let page = Page { side: steps * SIDE_STEP, padding };
        packed(packer, &sized, page).map(|places| Layout { texels_per_metre, places })
    };

    let most = LARGEST_SIDE / SIDE_STEP;
    let (mut below, mut steps) = (floor.saturating_sub(1), floor);
    let mut best = loop {
        if steps > most {
            return None;
        }
        match attempt(&Skyline, steps) {
            Some(layout) => break (steps, layout),
            None => {
                below = steps;
                steps = if steps == most { most + 1 } else { (steps + steps.div_ceil(16)).min(most) };
            }
        }
    };
    best = narrow(best, below, u32::MAX, |steps| attempt(&Skyline, steps));
    #[cfg(feature = "xatlas")]
    if let Some(packer) = super::xatlas::Nesting::worthwhile(shapes, best.0 * SIDE_STEP) {
        let area: f64 = shapes.iter().map(weighed_area).sum();
        let floor = in_steps((area.sqrt() * texels_per_metre).max(f64::from(longest)));
        best = narrow(best, floor.saturating_sub(1), XATLAS_EFFORT.packs, |steps| attempt(&packer, steps));
    }
    Some((best.0 * SIDE_STEP, best.1))
}

/// Bisects between `below`, which does not fit, and `best`, which does.
fn narrow(
    mut best: (u32, Layout),
    mut below: u32,
    packs: u32,
    attempt: impl Fn(u32) -> Option<Layout>,
) -> (u32, Layout) {
    for _ in 0..packs {
        if best.0 <= below + 1 {
            break;
        }
        let middle = below + (best.0 - below) / 2;
        match attempt(middle) {
            Some(layout) => best = (middle, layout),
            None => below = middle,
        }
    }
    best
}

/// Packs at a density.
fn attempt(packer: &dyn Packer, shapes: &[Shape], page: Page, texels_per_metre: f64) -> Option<Layout> {
    let places = packed(packer, &sized(shapes, texels_per_metre)?, page)?;
    Some(Layout { texels_per_metre, places })
}

/// Packs and checks.
fn packed(packer: &dyn Packer, charts: &[SizedShape<'_>], page: Page) -> Option<Vec<Place>> {
    if charts.iter().any(|c| c.width.max(c.height) >= page.side) {
        return None;
    }
    let places = packer.pack(charts, page)?;
    keeps_apart(charts, &places, page).then_some(places)
}

fn sized(shapes: &[Shape], texels_per_metre: f64) -> Option<Vec<SizedShape<'_>>> {
    shapes.iter().map(|s| SizedShape::new(s, texels_per_metre)).collect()
}

fn atlas(shapes: &[Shape], page: Page, layout: &Layout) -> Atlas {
    let charts = shapes
        .iter()
        .zip(&layout.places)
        .filter_map(|(shape, &place)| Some(SizedShape::new(shape, layout.texels_per_metre)?.chart(place)))
        .collect();
    Atlas {
        width: page.side,
        height: page.side,
        texels_per_metre: layout.texels_per_metre,
        padding: page.padding,
        charts,
    }
}

/// Whether every footprint lies in the page, and none meets another when each is grown by the padding.
fn keeps_apart(charts: &[SizedShape<'_>], places: &[Place], page: Page) -> bool {
    let padding = i64::from(page.padding);
    let grown = |texels: u32| texels as usize + 2 * page.padding as usize;
    let mut taken = BitGrid::new(grown(page.side), grown(page.side));
    charts.iter().zip(places).all(|(sized, &place)| {
        let local = sized.chart(Place { x: page.padding, y: page.padding, ..place });
        let (width, height) = match place.turn {
            super::pack::Turn::Upright => (sized.width, sized.height),
            super::pack::Turn::Swapped => (sized.height, sized.width),
        };
        let inside = place.x + width < page.side && place.y + height < page.side;
        let mut own = BitGrid::new(grown(width + 1), grown(height + 1));
        let bound = grown(height + 1) as i64;
        for triangle in &sized.shape.triangles {
            for span in footprint::spans(triangle.map(|p| local.texel(p)), 1.0, (0, bound)) {
                for y in span.y - padding..=span.y + padding {
                    own.set_span(y, span.first - padding, span.last + padding);
                }
            }
        }
        inside && taken.stamp(&own, place.x as usize, place.y as usize)
    })
}

/// The texels that a shape takes up at one texel a metre.
fn weighed_area(shape: &Shape) -> f64 {
    shape.area * shape.weight.element_product()
}

/// Texels that a chart's bounding rectangle takes up with its padding.
fn texels_of(chart: &SizedShape<'_>, padding: u32) -> f64 {
    let side = |texels: u32| f64::from(texels + 1 + 2 * padding);
    side(chart.width) * side(chart.height)
}

/// The density at which the bounding rectangles with their padding take up `share` of the page.
fn density_at_share(shapes: &[Shape], page: Page, share: f64) -> f64 {
    let room = share * f64::from(page.side + 2 * page.padding).powi(2);
    let (mut low, mut high) = (0.0, density_bound(shapes, page));
    for _ in 0..24 {
        let middle = 0.5 * (low + high);
        let covered = |s: &Shape| SizedShape::new(s, middle).map_or(room, |c| texels_of(&c, page.padding));
        if shapes.iter().map(covered).sum::<f64>() > room {
            high = middle;
        } else {
            low = middle;
        }
    }
    low
}

/// A density at which nothing fits any more: the charts have more area than the page, or one is
/// longer than it.
fn density_bound(shapes: &[Shape], page: Page) -> f64 {
    let side = f64::from(page.side);
    let area: f64 = shapes.iter().map(weighed_area).sum();
    let longest = shapes.iter().map(|s| (s.extent * s.weight).max_element()).fold(0.0, f64::max);
    let bound = (side / longest).min(side / area.sqrt());
    // Only points: any density will do.
    if bound.is_finite() { bound } else { 1.0 }
}
