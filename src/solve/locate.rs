//! From what a ray met to the facet there, and to the element of its tree.

use glam::{DVec2, DVec3};

use crate::element::{Facet, NONE, Side};
use crate::geom::Ring;
use crate::geom::polygon::{area, clip_rectangle, contains};
use crate::surface::Surface;
use crate::trace::{Hit, Tracer};

/// A cell that a facet fills by less than this fraction does not count as touched: rounding.
const LEAST_SHARE: f64 = 1e-9;

/// About this many cells stand for each facet of a surface.
const CELLS_A_FACET: f64 = 16.0;

/// Finds facets.
pub struct FacetLocator {
    /// The surface of each of the scene's triangles, or [`NONE`].
    surface_of: Vec<u32>,
    surfaces: Vec<Places>,
    /// Outlines of facets that share a cell with others; empty for those that need not be told apart.
    rings: Vec<Vec<Ring>>,
}

/// Where a surface's facets lie: a grid of cells, each with the front facets that it touches.
struct Places {
    frame: crate::geom::Frame,
    min: DVec2,
    cells_per_metre: DVec2,
    columns: usize,
    rows: usize,
    starts: Vec<u32>,
    facets: Vec<u32>,
}

impl FacetLocator {
    /// Prepares look-ups. `facets` are in the order of `surfaces`; a back follows its front.
    #[must_use]
    pub fn new(surfaces: &[Surface], facets: &[Facet], triangles: usize) -> Self {
        let mut surface_of = vec![NONE; triangles];
        let mut rings = vec![Vec::new(); facets.len()];
        let mut places = Vec::with_capacity(surfaces.len());
        let mut first = 0;
        for (index, surface) in surfaces.iter().enumerate() {
            for &t in &surface.source_triangles {
                surface_of[t] = index as u32;
            }
            let count = facets[first..].iter().take_while(|f| f.surface == index).count();
            let fronts: Vec<u32> = (first as u32..(first + count) as u32)
                .filter(|&f| facets[f as usize].side == Side::Front)
                .collect();
            first += count;
            places.push(Places::new(surface, &fronts, facets, &mut rings));
        }
        Self { surface_of, surfaces: places, rings }
    }

    /// The surface of one of the scene's triangles, or [`NONE`].
    #[inline]
    #[must_use]
    pub fn surface_of(&self, triangle: usize) -> u32 {
        self.surface_of[triangle]
    }

    /// The one front facet of a surface that can be met between these corners; `None` where there are several.
    #[must_use]
    pub fn only_front(&self, surface: usize, low: DVec2, high: DVec2) -> Option<usize> {
        let places = &self.surfaces[surface];
        let (low, high) = (places.cell(low), places.cell(high));
        let mut cells = (low.1..=high.1).flat_map(|y| (low.0..=high.0).map(move |x| (x, y)));
        let first = places.only_in(cells.next()?)?;
        cells.all(|cell| places.only_in(cell) == Some(first)).then_some(first as usize)
    }

    /// The facet that a ray met at `point`, and the place in the facet's plane; `None` for the back of a
    /// single-sided surface.
    #[must_use]
    pub fn find(&self, tracer: &Tracer, hit: &Hit, point: DVec3) -> Option<(usize, DVec2)> {
        if tracer.met_back(hit) {
            return None;
        }
        let surface = self.surface_of[hit.triangle];
        let places = self.surfaces.get(surface as usize)?;
        let p = places.frame.project(point);
        let front = places.facet_at(p, &self.rings)?;
        Some(if hit.from_behind { (front + 1, DVec2::new(p.x, -p.y)) } else { (front, p) })
    }
}

impl Places {
    fn new(surface: &Surface, fronts: &[u32], facets: &[Facet], rings: &mut [Vec<Ring>]) -> Self {
        let (min, max) = surface.extent();
        let extent = (max - min).max(DVec2::splat(f64::MIN_POSITIVE));
        let wanted = if fronts.len() < 2 { 1.0 } else { CELLS_A_FACET * fronts.len() as f64 };
        let side = (extent.element_product() / wanted).sqrt();
        let cells = (extent / side).round().clamp(DVec2::ONE, DVec2::splat(wanted));
        let (columns, rows) = (cells.x as usize, cells.y as usize);
        let mut touched = vec![Vec::new(); columns * rows];
        if fronts.len() < 2 {
            touched[0].extend(fronts);
        } else {
            let size = extent / cells;
            for &front in fronts {
                let facet = &facets[front as usize];
                let root = &facet.elements[0];
                let low = ((root.min - min) / size - 1e-6).floor().max(DVec2::ZERO).as_usizevec2();
                let high = ((root.max - min) / size + 1e-6).floor().min(cells - 1.0).as_usizevec2();
                for y in low.y..=high.y {
                    for x in low.x..=high.x {
                        let corner = min + size * DVec2::new(x as f64, y as f64);
                        let clipped: Vec<Ring> =
                            facet.rings.iter().map(|r| clip_rectangle(r, corner, corner + size)).collect();
                        if area(&clipped) > LEAST_SHARE * size.element_product() {
                            touched[y * columns + x].push(front);
                        }
                    }
                }
            }
        }
        // Those of few corners are asked first, and the one of most, which may have a hundred holes, never.
        let corners = |f: &u32| facets[*f as usize].rings.iter().map(Vec::len).sum::<usize>();
        for here in touched.iter_mut().filter(|t| t.len() > 1) {
            here.sort_by_key(corners);
        }
        for &front in touched.iter().filter(|t| t.len() > 1).flatten() {
            if rings[front as usize].is_empty() {
                rings[front as usize].clone_from(&facets[front as usize].rings);
            }
        }
        let mut starts = vec![0];
        for t in &touched {
            starts.push(starts[starts.len() - 1] + t.len() as u32);
        }
        let facets = touched.into_iter().flatten().collect();
        Self { frame: surface.frame, min, cells_per_metre: cells / extent, columns, rows, starts, facets }
    }

    fn cell(&self, p: DVec2) -> (usize, usize) {
        let cell = ((p - self.min) * self.cells_per_metre).max(DVec2::ZERO);
        ((cell.x as usize).min(self.columns - 1), (cell.y as usize).min(self.rows - 1))
    }

    fn facets_in(&self, (x, y): (usize, usize)) -> &[u32] {
        let index = y * self.columns + x;
        &self.facets[self.starts[index] as usize..self.starts[index + 1] as usize]
    }

    /// The facet of a cell that no others share; any of the surface's for one that none touches.
    fn only_in(&self, cell: (usize, usize)) -> Option<u32> {
        match self.facets_in(cell) {
            [] => self.facets.first().copied(),
            [only] => Some(*only),
            _ => None,
        }
    }

    fn facet_at(&self, p: DVec2, rings: &[Vec<Ring>]) -> Option<usize> {
        let cell = self.cell(p);
        let facet = self.only_in(cell).or_else(|| {
            let (last, some) = self.facets_in(cell).split_last()?;
            Some(*some.iter().find(|&&f| contains(&rings[f as usize], p)).unwrap_or(last))
        });
        facet.map(|f| f as usize)
    }
}

/// A facet's tree, made for going down it fast.
pub struct Descent {
    nodes: Vec<Node>,
}

/// A node of the tree.
#[derive(Clone, Copy, Debug)]
pub struct Node {
    /// Where its quadrants meet, plane coordinates.
    pub middle: DVec2,
    /// By quadrant: left or right, plus two for above; all [`NONE`] for a leaf.
    pub children: [u32; 4],
}

impl Descent {
    /// Prepares the facet's tree; nodes are numbered as its elements.
    #[must_use]
    pub fn new(facet: &Facet) -> Self {
        let nodes = facet.elements.iter().map(|e| {
            let (middle, quarter) = (0.5 * (e.min + e.max), 0.25 * (e.max - e.min));
            let children = std::array::from_fn(|quadrant| {
                let sign = DVec2::new(
                    if quadrant & 1 == 0 { -1.0 } else { 1.0 },
                    if quadrant & 2 == 0 { -1.0 } else { 1.0 },
                );
                let inside = middle + sign * quarter;
                let distance = |&c: &u32| {
                    let child = &facet.elements[c as usize];
                    inside.clamp(child.min, child.max).distance_squared(inside)
                };
                e.children().min_by(|a, b| distance(a).total_cmp(&distance(b))).unwrap_or(NONE)
            });
            Node { middle, children }
        });
        Self { nodes: nodes.collect() }
    }

    /// The nodes, numbered as the facet's elements.
    #[must_use]
    pub fn nodes(&self) -> &[Node] {
        &self.nodes
    }

    /// The first element on the way down to `p` for which `is_goal` holds, or the leaf there.
    #[inline]
    #[must_use]
    pub fn find(&self, p: DVec2, is_goal: impl Fn(u32) -> bool) -> u32 {
        let mut at = 0;
        loop {
            let node = &self.nodes[at as usize];
            let quadrant = usize::from(p.x >= node.middle.x) + 2 * usize::from(p.y >= node.middle.y);
            let child = node.children[quadrant];
            if child == NONE || is_goal(at) {
                return at;
            }
            at = child;
        }
    }
}
