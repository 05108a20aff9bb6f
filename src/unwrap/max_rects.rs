//! Packs bounding rectangles into the largest free ones.
//!
//! All free rectangles that no other contains are kept; they overlap. Each chart's rectangle, the largest
//! first, goes where its bottom ends nearest to the page's top, then leftmost (the bottom-left rule of
//! the maximal rectangles packer of Jylänki, "A Thousand Ways to Pack the Bin", 2010, with rows counted
//! from the top). Both orientations are tried. Which rectangle counts as larger is the caller's to
//! choose; no order is best for all charts, but it is mostly the one by the shorter side: room beside
//! thick rectangles can still be used by thin ones.

use std::cmp::Reverse;

use super::pack::{Packer, Page, Place, SizedShape, Turn};

/// Which rectangle is larger.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Order {
    /// The one with the longer shorter side.
    Thicker,
    /// The one with the longer longer side.
    Longer,
    /// The one with more area.
    Area,
}

/// The packer over bounding rectangles.
#[derive(Clone, Copy, Debug)]
pub(super) struct MaxRects(pub(super) Order);

impl MaxRects {
    /// All orders, the best guess first.
    pub(super) const ALL: [Self; 3] = [Self(Order::Thicker), Self(Order::Longer), Self(Order::Area)];
}

impl Order {
    /// Greater for the larger rectangle.
    fn key(self, long: u32, short: u32) -> (u64, u64) {
        let (long, short) = (u64::from(long), u64::from(short));
        match self {
            Self::Thicker => (short, long),
            Self::Longer => (long, short),
            Self::Area => (long * short, long),
        }
    }
}

/// A rectangle of the page.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Rect {
    x: u32,
    y: u32,
    width: u32,
    height: u32,
}

impl Packer for MaxRects {
    fn pack(&self, charts: &[SizedShape<'_>], page: Page) -> Option<Vec<Place>> {
        let (width, height) = page.grown();
        let mut order: Vec<(u32, u32, usize)> = Vec::with_capacity(charts.len());
        let mut area = 0u64;
        for (index, chart) in charts.iter().enumerate() {
            let (w, h) = page.cell(chart);
            area += u64::from(w) * u64::from(h);
            order.push((w, h, index));
        }
        if area > u64::from(width) * u64::from(height) {
            return None;
        }
        order.sort_by_key(|&(w, h, index)| (Reverse(self.0.key(w.max(h), w.min(h))), index));

        let mut places = vec![Place { x: 0, y: 0, turn: Turn::Upright }; charts.len()];
        let mut free = vec![Rect { x: 0, y: 0, width, height }];
        for (w, h, index) in order {
            let upright = best(&free, (w, h)).map(|best| (best, Turn::Upright));
            let swapped = best(&free, (h, w)).map(|best| (best, Turn::Swapped));
            let ((_, taken), turn) =
                upright.into_iter().chain(swapped).min_by_key(|&((score, _), _)| score)?;
            take(&mut free, taken);
            *places.get_mut(index)? = page.place((taken.x, taken.y), turn);
        }
        Some(places)
    }
}

/// Where a rectangle goes best, and how good that is (less is better): its far side's row, its column, and how
/// much of the free rectangle it leaves along the tighter side.
fn best(free: &[Rect], (width, height): (u32, u32)) -> Option<([u32; 3], Rect)> {
    let fitting = free.iter().filter(|f| f.width >= width && f.height >= height);
    let score = |f: &Rect| [f.y + height, f.x, (f.width - width).min(f.height - height)];
    let best = fitting.map(|f| (score(f), f)).min_by_key(|&(score, _)| score);
    best.map(|(score, f)| (score, Rect { x: f.x, y: f.y, width, height }))
}

/// Cuts what is taken out of the free rectangles; those that lie in others go.
fn take(free: &mut Vec<Rect>, taken: Rect) {
    let mut rest = Vec::new();
    free.retain(|f| {
        let meets = f.meets(&taken);
        if meets {
            f.without(&taken, &mut rest);
        }
        !meets
    });
    for (index, candidate) in rest.iter().enumerate() {
        let among = |others: &[Rect]| others.iter().any(|other| other.holds(candidate));
        // Of two that are equal the first stays.
        let repeated = |others: &[Rect]| others.iter().any(|o| o.holds(candidate) && o != candidate);
        if !among(free) && !repeated(&rest[index + 1..]) {
            free.push(*candidate);
        }
    }
}

impl Rect {
    fn meets(&self, other: &Self) -> bool {
        self.x < other.x + other.width
            && other.x < self.x + self.width
            && self.y < other.y + other.height
            && other.y < self.y + self.height
    }

    fn holds(&self, other: &Self) -> bool {
        self.x <= other.x
            && self.y <= other.y
            && self.x + self.width >= other.x + other.width
            && self.y + self.height >= other.y + other.height
    }

    /// Adds the rectangles that remain where `other` is taken, at most one for each of its sides.
    fn without(&self, other: &Self, rest: &mut Vec<Self>) {
        if other.x > self.x {
            rest.push(Self { width: other.x - self.x, ..*self });
        }
        if other.y > self.y {
            rest.push(Self { height: other.y - self.y, ..*self });
        }
        let (end, own_end) = (other.x + other.width, self.x + self.width);
        if end < own_end {
            rest.push(Self { x: end, width: own_end - end, ..*self });
        }
        let (end, own_end) = (other.y + other.height, self.y + self.height);
        if end < own_end {
            rest.push(Self { y: end, height: own_end - end, ..*self });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_taken_is_free_no_more_and_nothing_else_is() {
        let mut free = vec![Rect { x: 0, y: 0, width: 10, height: 8 }];
        let taken = [(0, 0, 4, 3), (4, 0, 2, 5), (7, 4, 3, 2), (0, 6, 7, 2)];
        let taken = taken.map(|(x, y, width, height)| Rect { x, y, width, height });
        taken.into_iter().for_each(|rect| take(&mut free, rect));
        for y in 0..8 {
            for x in 0..10 {
                let texel = Rect { x, y, width: 1, height: 1 };
                let is_free = free.iter().any(|f| f.holds(&texel));
                assert_eq!(is_free, !taken.iter().any(|t| t.holds(&texel)), "{x}, {y}");
            }
        }
        for (i, a) in free.iter().enumerate() {
            assert!(free.iter().enumerate().all(|(j, b)| i == j || !b.holds(a)), "{a:?} lies in another");
        }
    }
}
