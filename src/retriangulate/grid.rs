//! Uniform grids for finding the vertices near a point and the edges near a point.

use std::collections::HashMap;

use glam::DVec2;

/// Finds vertices by position. Only looked up, never walked, so the hash's order has no say.
pub(super) struct VertexGrid {
    low: DVec2,
    cell: f64,
    cells: HashMap<(i64, i64), Vec<u32>>,
}

impl VertexGrid {
    /// For searches no wider than `radius` (above 0) metres; `low` is the least corner of what will come.
    pub(super) fn new(low: DVec2, radius: f64) -> Self {
        Self { low, cell: 4.0 * radius, cells: HashMap::new() }
    }

    fn key(&self, p: DVec2) -> (i64, i64) {
        let q = ((p - self.low) / self.cell).floor();
        (q.x as i64, q.y as i64)
    }

    /// Makes vertex `id` at `p` known.
    pub(super) fn insert(&mut self, id: u32, p: DVec2) {
        self.cells.entry(self.key(p)).or_default().push(id);
    }

    /// The nearest known vertex within `radius` of `p`; of equally near ones the first.
    pub(super) fn nearest(&self, vertices: &[DVec2], p: DVec2, radius: f64) -> Option<u32> {
        let (low, high) = (self.key(p - radius), self.key(p + radius));
        let mut best: Option<(f64, u32)> = None;
        for x in low.0..=high.0 {
            for y in low.1..=high.1 {
                for &id in self.cells.get(&(x, y)).map_or(&[][..], Vec::as_slice) {
                    let Some(q) = vertices.get(id as usize) else { continue };
                    let candidate = (q.distance(p), id);
                    if candidate.0 <= radius && best.is_none_or(|b| candidate < b) {
                        best = Some(candidate);
                    }
                }
            }
        }
        best.map(|b| b.1)
    }
}

/// Finds edges by position: a list of edges for each cell of a rectangle.
pub(super) struct EdgeGrid {
    low: DVec2,
    cell: DVec2,
    columns: usize,
    rows: usize,
    starts: Vec<u32>,
    entries: Vec<u32>,
}

/// What an [`EdgeGrid`] covers.
#[derive(Clone, Copy)]
pub(super) struct Extent {
    /// Least corner.
    pub(super) low: DVec2,
    /// Greatest corner.
    pub(super) high: DVec2,
    /// An edge is found from points up to this far away.
    pub(super) margin: f64,
}

impl EdgeGrid {
    /// No row or column is divided more often than this.
    const MOST_CELLS_A_SIDE: f64 = 512.0;

    /// Sorts `edges` into cells, about as many cells as edges.
    pub(super) fn new(extent: Extent, edges: &[[DVec2; 2]]) -> Self {
        let size = (extent.high - extent.low).max(DVec2::splat(f64::MIN_POSITIVE));
        let wanted = (edges.len() as f64).max(1.0);
        let side = (size.x * size.y / wanted).sqrt().max(4.0 * extent.margin);
        let divide = |length: f64| (length / side).ceil().clamp(1.0, Self::MOST_CELLS_A_SIDE) as usize;
        let (columns, rows) = (divide(size.x), divide(size.y));
        let cell = size / DVec2::new(columns as f64, rows as f64);
        let mut grid = Self { low: extent.low, cell, columns, rows, starts: Vec::new(), entries: Vec::new() };
        let mut starts = vec![0_u32; columns * rows + 1];
        for &edge in edges {
            grid.covered(edge, extent.margin, |c| starts[c + 1] += 1);
        }
        for i in 1..starts.len() {
            starts[i] += starts[i - 1];
        }
        let mut next = starts.clone();
        let mut entries = vec![0; starts.last().map_or(0, |&n| n as usize)];
        for (id, &edge) in edges.iter().enumerate() {
            grid.covered(edge, extent.margin, |c| {
                entries[next[c] as usize] = id as u32;
                next[c] += 1;
            });
        }
        grid.starts = starts;
        grid.entries = entries;
        grid
    }

    fn column(&self, x: f64) -> usize {
        (((x - self.low.x) / self.cell.x).max(0.0) as usize).min(self.columns - 1)
    }

    fn row(&self, y: f64) -> usize {
        (((y - self.low.y) / self.cell.y).max(0.0) as usize).min(self.rows - 1)
    }

    /// Calls `visit` with each cell that a point within `margin` of the edge may lie in.
    fn covered(&self, [a, b]: [DVec2; 2], margin: f64, mut visit: impl FnMut(usize)) {
        let (a, b) = if a.y <= b.y { (a, b) } else { (b, a) };
        for row in self.row(a.y - margin)..=self.row(b.y + margin) {
            // The piece of the edge whose neighbourhood reaches into this row.
            let floor = self.low.y + row as f64 * self.cell.y;
            let bottom = if row == 0 { f64::NEG_INFINITY } else { floor - margin };
            let top = if row + 1 == self.rows { f64::INFINITY } else { floor + self.cell.y + margin };
            let (mut from, mut to) = (a.x, b.x);
            if b.y > a.y {
                let x_at = |y: f64| a.x + (b.x - a.x) * ((y - a.y) / (b.y - a.y)).clamp(0.0, 1.0);
                (from, to) = (x_at(bottom), x_at(top));
            }
            let slack = margin + 1e-9 * self.cell.x;
            for column in self.column(from.min(to) - slack)..=self.column(from.max(to) + slack) {
                visit(row * self.columns + column);
            }
        }
    }

    /// The number of cells.
    pub(super) fn cell_count(&self) -> usize {
        self.columns * self.rows
    }

    /// The cell that `p` lies in; points outside count to the nearest.
    pub(super) fn cell_of(&self, p: DVec2) -> usize {
        self.row(p.y) * self.columns + self.column(p.x)
    }

    /// The edges that pass through a cell or within the margin of it, ascending.
    pub(super) fn edges_in(&self, cell: usize) -> &[u32] {
        match (self.starts.get(cell), self.starts.get(cell + 1)) {
            (Some(&from), Some(&to)) => self.entries.get(from as usize..to as usize).unwrap_or(&[]),
            _ => &[],
        }
    }

    /// The edges that may lie within the margin of `p`, ascending.
    pub(super) fn edges_near(&self, p: DVec2) -> &[u32] {
        self.edges_in(self.cell_of(p))
    }
}
