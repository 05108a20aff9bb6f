//! Packs bounding rectangles under a skyline.
//!
//! The charts' upper boundary is kept as a staircase. Each rectangle, tallest first, goes where its
//! top ends lowest; among equals where it covers the least room underneath, then leftmost
//! (the bottom-left skyline heuristic of Jylänki, "A Thousand Ways to Pack the Bin", 2010). Both
//! orientations are tried. What lies under an overhang is lost.

use super::pack::{Packer, Page, Place, SizedShape, Turn};

/// The packer over bounding rectangles.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Skyline;

/// A level stretch of the skyline; it ends where the next begins.
#[derive(Clone, Copy, Debug)]
struct Step {
    x: u32,
    y: u32,
}

/// Somewhere a rectangle would go; the least is the best.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Candidate {
    top: u32,
    lost: u64,
    x: u32,
    step: usize,
    swapped: bool,
}

impl Packer for Skyline {
    fn pack(&self, charts: &[SizedShape<'_>], page: Page) -> Option<Vec<Place>> {
        // Padding may hang over the page's edge, so the rectangles and the page grow by it.
        let grown = page.side + 2 * page.padding;
        let rectangle = |c: &SizedShape<'_>| {
            let (w, h) = (c.width + 1 + 2 * page.padding, c.height + 1 + 2 * page.padding);
            (w.max(h), w.min(h), if w >= h { Turn::Upright } else { Turn::Swapped })
        };
        let mut order: Vec<(u32, u32, Turn, usize)> = Vec::with_capacity(charts.len());
        let mut area = 0u64;
        for (index, chart) in charts.iter().enumerate() {
            let (long, short, turn) = rectangle(chart);
            area += u64::from(long) * u64::from(short);
            order.push((long, short, turn, index));
        }
        if area > u64::from(grown) * u64::from(grown) {
            return None;
        }
        order.sort_by_key(|&(long, short, _, index)| (std::cmp::Reverse((long, short)), index));

        let mut places = vec![Place { x: 0, y: 0, turn: Turn::Upright }; charts.len()];
        let mut skyline = vec![Step { x: 0, y: 0 }];
        for (long, short, turn, index) in order {
            let lying = best_step(&skyline, (long, short), grown).map(|c| Candidate { swapped: false, ..c });
            let standing =
                best_step(&skyline, (short, long), grown).map(|c| Candidate { swapped: true, ..c });
            let best = lying.into_iter().chain(standing).min()?;
            let (width, height) = if best.swapped { (short, long) } else { (long, short) };
            raise(&mut skyline, best, width);
            let turn = if best.swapped { turned(turn) } else { turn };
            // The footprint begins `padding` inside the rectangle, the page `padding` inside the grown page.
            *places.get_mut(index)? = Place { x: best.x, y: best.top - height, turn };
        }
        Some(places)
    }
}

fn turned(turn: Turn) -> Turn {
    match turn {
        Turn::Upright => Turn::Swapped,
        Turn::Swapped => Turn::Upright,
    }
}

/// Where a rectangle goes best, or nothing if it does not fit into a page of side `side`.
fn best_step(skyline: &[Step], (width, height): (u32, u32), side: u32) -> Option<Candidate> {
    let mut best: Option<Candidate> = None;
    for (index, step) in skyline.iter().enumerate() {
        if width > side || step.x > side - width {
            break;
        }
        if best.is_some_and(|b| step.y + height > b.top) {
            continue; // it can only end higher
        }
        let end = step.x + width;
        let under = skyline[index..].iter().take_while(|s| s.x < end);
        let y = under.clone().map(|s| s.y).max().unwrap_or(0);
        let top = y + height;
        if top > side || best.is_some_and(|b| top > b.top) {
            continue;
        }
        let ends = skyline[index + 1..].iter().map(|s| s.x).chain(std::iter::once(side));
        let lost = under.zip(ends).map(|(s, next)| u64::from(y - s.y) * u64::from(next.min(end) - s.x)).sum();
        let candidate = Candidate { top, lost, x: step.x, step: index, swapped: false };
        best = Some(best.map_or(candidate, |b| b.min(candidate)));
    }
    best
}

/// Lifts the skyline to `at.top` over `width` texels from `at.x`.
fn raise(skyline: &mut Vec<Step>, at: Candidate, width: u32) {
    let end = at.x + width;
    let covered = skyline[at.step..].iter().take_while(|s| s.x < end).count();
    let last_y = skyline[at.step + covered - 1].y;
    let reaches_on = skyline.get(at.step + covered).is_none_or(|next| next.x > end);
    let rest = reaches_on.then_some(Step { x: end, y: last_y });
    let raised = Step { x: at.x, y: at.top };
    skyline.splice(at.step..at.step + covered, std::iter::once(raised).chain(rest));
    // Level neighbours are one step; otherwise the list grows with every rectangle.
    skyline.dedup_by(|later, earlier| later.y == earlier.y);
}
