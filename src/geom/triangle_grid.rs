//! Which of many planar triangles lie under a point.

use glam::DVec2;

use super::polygon::{nearest_on_segment, orient};

/// A grid has at most this many buckets a side.
const MOST_BUCKETS: f64 = 1024.0;

/// A grid of buckets over triangles, about one triangle a bucket.
#[derive(Clone, Debug)]
pub struct TriangleGrid {
    min: DVec2,
    scale: DVec2,
    columns: usize,
    rows: usize,
    /// Start of each bucket in `entries`, one more than there are buckets.
    starts: Vec<u32>,
    entries: Vec<u32>,
}

/// The point of a triangle nearest to another point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Nearest {
    /// Squared distance, 0 inside.
    pub distance_squared: f64,
    /// Barycentric coordinates of the nearest point, in `[0, 1]`, summing to 1.
    pub barycentric: [f64; 3],
}

impl TriangleGrid {
    /// Sorts triangles into buckets.
    #[must_use]
    pub fn new(triangles: &[[DVec2; 3]]) -> Self {
        let (min, max) = triangles
            .iter()
            .flatten()
            .fold((DVec2::INFINITY, DVec2::NEG_INFINITY), |(lo, hi), &p| (lo.min(p), hi.max(p)));
        let extent = (max - min).max(DVec2::splat(f64::MIN_POSITIVE));
        let per_side = (triangles.len() as f64 / extent.element_product().max(f64::MIN_POSITIVE)).sqrt();
        let count = (extent * per_side).clamp(DVec2::ONE, DVec2::splat(MOST_BUCKETS)).floor();
        let is_empty = triangles.is_empty();
        let mut grid = Self {
            min,
            scale: count / extent,
            columns: if is_empty { 0 } else { count.x as usize },
            rows: if is_empty { 0 } else { count.y as usize },
            starts: Vec::new(),
            entries: Vec::new(),
        };
        grid.fill(triangles);
        grid
    }

    fn fill(&mut self, triangles: &[[DVec2; 3]]) {
        let mut counts = vec![0_u32; self.columns * self.rows + 1];
        self.for_each_entry(triangles, |bucket, _| counts[bucket + 1] += 1);
        for i in 1..counts.len() {
            counts[i] += counts[i - 1];
        }
        self.starts.clone_from(&counts);
        let mut entries = vec![0; counts.last().map_or(0, |&n| n as usize)];
        self.for_each_entry(triangles, |bucket, triangle| {
            entries[counts[bucket] as usize] = triangle;
            counts[bucket] += 1;
        });
        self.entries = entries;
    }

    fn for_each_entry(&self, triangles: &[[DVec2; 3]], mut visit: impl FnMut(usize, u32)) {
        for (index, [a, b, c]) in triangles.iter().enumerate() {
            let (x0, y0) = self.bucket(a.min(*b).min(*c));
            let (x1, y1) = self.bucket(a.max(*b).max(*c));
            for y in y0..=y1 {
                for x in x0..=x1 {
                    visit(y * self.columns + x, index as u32);
                }
            }
        }
    }

    fn bucket(&self, p: DVec2) -> (usize, usize) {
        let cell = ((p - self.min) * self.scale).max(DVec2::ZERO);
        ((cell.x as usize).min(self.columns - 1), (cell.y as usize).min(self.rows - 1))
    }

    /// The triangles of each bucket, ascending: two that share room share a bucket.
    pub fn buckets(&self) -> impl Iterator<Item = &[u32]> {
        self.starts.windows(2).map(|ends| &self.entries[ends[0] as usize..ends[1] as usize])
    }

    /// The triangles that may contain `p`, in ascending order; those of the nearest bucket where `p` lies outside.
    #[must_use]
    pub fn candidates(&self, p: DVec2) -> &[u32] {
        if self.columns == 0 {
            return &[];
        }
        let (x, y) = self.bucket(p);
        let bucket = y * self.columns + x;
        &self.entries[self.starts[bucket] as usize..self.starts[bucket + 1] as usize]
    }
}

/// The point of triangle `corners` (counter-clockwise) nearest to `p`.
#[must_use]
pub fn nearest_in_triangle(corners: [DVec2; 3], p: DVec2) -> Nearest {
    let [a, b, c] = corners;
    let whole = orient(a, b, c);
    let weigh = |q: DVec2| {
        if whole <= 0.0 {
            return [1.0, 0.0, 0.0];
        }
        let w = [orient(q, b, c), orient(a, q, c), orient(a, b, q)].map(|w| (w / whole).clamp(0.0, 1.0));
        let sum = w[0] + w[1] + w[2];
        w.map(|w| w / sum)
    };
    let edges = [(a, b), (b, c), (c, a)];
    if whole > 0.0 && edges.iter().all(|&(s, e)| orient(s, e, p) >= 0.0) {
        return Nearest { distance_squared: 0.0, barycentric: weigh(p) };
    }
    let feet = edges.map(|(s, e)| nearest_on_segment(s, e, p));
    let foot =
        feet.into_iter().min_by(|q, r| q.distance_squared(p).total_cmp(&r.distance_squared(p))).unwrap_or(a);
    Nearest { distance_squared: foot.distance_squared(p), barycentric: weigh(foot) }
}
