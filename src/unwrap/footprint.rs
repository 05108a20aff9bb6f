//! Which texels a chart's lookups touch.
//!
//! A bilinear lookup at `p` weighs texels whose centres are less than one texel away from `p` in
//! both directions. So texel `c` belongs to a triangle's footprint exactly where the open square
//! of half side 1 around `c` meets the triangle. Row by row: what the triangle has in the band of
//! that row is convex, so it spans an interval of `x`, and the texels are those less than 1 from it.

use glam::DVec2;

/// Closer than this to the edge of its reach, a texel's weight is rounding error, texels.
const TOUCH: f64 = 1e-5;

/// A run of texels in a row, both ends included.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Span {
    /// The row.
    pub(crate) y: i64,
    /// The first column.
    pub(crate) first: i64,
    /// The last column.
    pub(crate) last: i64,
}

/// The texels whose centres are less than `reach` texels from `triangle` (texel space) in the
/// sense above, rows from `rows.0` up to and without `rows.1`.
pub(crate) fn spans(triangle: [DVec2; 3], reach: f64, rows: (i64, i64)) -> impl Iterator<Item = Span> {
    let reach = reach - TOUCH;
    let [a, b, c] = triangle;
    let first = first_above(a.y.min(b.y).min(c.y) - reach).max(rows.0);
    let last = last_below(a.y.max(b.y).max(c.y) + reach).min(rows.1 - 1);
    (first..=last).filter_map(move |y| {
        let centre = y as f64 + 0.5;
        let (low, high) = extent_in_band(triangle, centre - reach, centre + reach)?;
        let (first, last) = (first_above(low - reach), last_below(high + reach));
        (first <= last).then_some(Span { y, first, last })
    })
}

/// The least texel whose centre lies at or above `x`.
fn first_above(x: f64) -> i64 {
    (x - 0.5).ceil() as i64
}

/// The greatest texel whose centre lies at or below `x`.
fn last_below(x: f64) -> i64 {
    (x - 0.5).floor() as i64
}

/// The extent in `x` of what lies between `y = low` and `y = high`.
fn extent_in_band(triangle: [DVec2; 3], low: f64, high: f64) -> Option<(f64, f64)> {
    let mut extent = (f64::INFINITY, f64::NEG_INFINITY);
    let mut add = |x: f64| extent = (extent.0.min(x), extent.1.max(x));
    for i in 0..3 {
        let (a, b) = (triangle[i], triangle[(i + 1) % 3]);
        if (low..=high).contains(&a.y) {
            add(a.x);
        }
        for y in [low, high] {
            if (a.y < y) != (b.y < y) {
                add(a.x + (y - a.y) * (b.x - a.x) / (b.y - a.y));
            }
        }
    }
    (extent.0 <= extent.1).then_some(extent)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An axis-aligned chart whose corners are texel centres touches one texel more than its width.
    #[test]
    fn aligned_triangle_has_no_rim() {
        let t = [DVec2::new(2.5, 1.5), DVec2::new(5.5, 1.5), DVec2::new(2.5, 3.5)];
        let rows: Vec<_> = spans(t, 1.0, (0, 100)).collect();
        assert_eq!(rows.iter().map(|s| s.y).collect::<Vec<_>>(), [1, 2, 3]);
        assert_eq!((rows[0].first, rows[0].last), (2, 5));
        assert_eq!(rows[2].first, 2);
    }

    /// Against the definition: a texel is in where some point of the triangle has weight in it.
    #[test]
    fn agrees_with_dense_sampling() {
        let t = [DVec2::new(1.3, 2.9), DVec2::new(9.7, 4.1), DVec2::new(3.2, 8.8)];
        let mut sampled = vec![false; 144];
        let steps = 400;
        for i in 0..=steps {
            for j in 0..=steps - i {
                let (u, v) = (f64::from(i) / f64::from(steps), f64::from(j) / f64::from(steps));
                let p = t[0] + u * (t[1] - t[0]) + v * (t[2] - t[0]) - 0.5;
                for (x, y) in [(p.x.floor(), p.y.floor()), (p.x.ceil(), p.y.floor())]
                    .into_iter()
                    .chain([(p.x.floor(), p.y.ceil()), (p.x.ceil(), p.y.ceil())])
                {
                    sampled[y as usize * 12 + x as usize] = true;
                }
            }
        }
        let mut exact = vec![false; 144];
        for s in spans(t, 1.0, (0, 12)) {
            (s.first..=s.last).for_each(|x| exact[(s.y * 12 + x) as usize] = true);
        }
        assert_eq!(sampled, exact);
    }
}
