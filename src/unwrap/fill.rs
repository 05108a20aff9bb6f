//! Finds the density that fills a page.
//!
//! Whether charts fit is a nearly monotone question, so it is asked by bisection: first of the
//! packer of rectangles, which answers in milliseconds, then of the same in other orders and of xatlas, which
//! begin at the best answer so far and get few tries. A layout counts only after its footprints have
//! been checked against each other.

use super::layout::{Layout, attempt, density_of_texels};
use super::max_rects::MaxRects;
use super::pack::{Packer, Page};
use super::shape::Shape;

/// The share of a page that a first guess assumes to be covered; typical of rectangles.
const GUESSED_SHARE: f64 = 0.96;

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

const FIRST: Effort = Effort { packs: 16, precision: 1.002, stride: 1.03 };
/// Of the orders after the first.
const AGAIN: Effort = Effort { packs: 4, precision: 1.002, stride: 1.004 };
#[cfg(feature = "xatlas")]
const XATLAS: Effort = Effort { packs: 7, precision: 1.008, stride: 1.04 };

/// The densest layout found in `page`, no denser than `most`, or nothing if not even charts of one texel fit.
pub(super) fn fill(shapes: &[Shape], page: Page, most: f64) -> Option<Layout> {
    let ceiling = density_bound(shapes, page);
    let (width, height) = page.grown();
    let room = GUESSED_SHARE * f64::from(width) * f64::from(height);
    let guess = density_of_texels(shapes, room, page.gutter, ceiling.min(most));
    let sparsest = MaxRects::ALL.iter().find_map(|order| attempt(order, shapes, page, 0.0))?;
    let search = Search { shapes, page, ceiling, most };
    let mut best = search.densest(&MaxRects::ALL[0], sparsest, guess, FIRST);
    for order in &MaxRects::ALL[1..] {
        tracing::debug!(density = best.texels_per_metre, next = ?order, "fill");
        let guess = best.texels_per_metre * AGAIN.stride;
        best = search.densest(order, best, guess, AGAIN);
    }
    tracing::debug!(density = best.texels_per_metre, ceiling, most, "filled");
    #[cfg(feature = "xatlas")]
    if let Some(packer) = super::xatlas::Nesting::worthwhile(shapes, page) {
        let guess = best.texels_per_metre * XATLAS.stride;
        best = search.densest(&packer, best, guess, XATLAS);
    }
    Some(best)
}

struct Search<'a> {
    shapes: &'a [Shape],
    page: Page,
    /// Nothing fits at or above this density.
    ceiling: f64,
    /// Nobody wants more than this density.
    most: f64,
}

impl Search<'_> {
    /// Bisects for the densest layout, from `best` (which fits) upward, trying `guess` first.
    fn densest(&self, packer: &dyn Packer, mut best: Layout, guess: f64, effort: Effort) -> Layout {
        let mut above = self.ceiling;
        let mut next = guess.min(above);
        let mut stride = effort.stride;
        for _ in 0..effort.packs {
            if best.texels_per_metre >= self.most {
                break;
            }
            next = next.min(self.most);
            match attempt(packer, self.shapes, self.page, next) {
                Some(layout) => best = layout,
                None => above = next,
            }
            let below = best.texels_per_metre;
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
}

/// A density at which nothing fits any more: the charts have more area than the page, or one is
/// longer than it.
fn density_bound(shapes: &[Shape], page: Page) -> f64 {
    let area: f64 = shapes.iter().map(Shape::weighed_area).sum();
    let longest = shapes.iter().map(|s| (s.extent * s.weight).max_element()).fold(0.0, f64::max);
    let (width, height) = (f64::from(page.width), f64::from(page.height));
    let bound = (width.max(height) / longest).min((width * height / area).sqrt());
    // Only points: any density will do.
    if bound.is_finite() { bound } else { 1.0 }
}
