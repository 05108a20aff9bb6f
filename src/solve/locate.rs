//! From what a ray met to the facet there, and to the element of its tree.

use glam::{DVec2, DVec3, UVec2, Vec2};

use crate::element::{Facet, NONE, Side};
use crate::geom::Ring;
use crate::geom::polygon::{area, clip_rectangle, contains};
use crate::surface::Surface;
use crate::trace::{Hit, Tracer};

/// A cell that a facet fills by less than this fraction does not count as touched: rounding.
const LEAST_SHARE: f64 = 1e-9;

/// About this many cells stand for each facet of a surface.
const CELLS_A_FACET: f64 = 16.0;

/// About this many cells stand for each leaf of a facet.
const CELLS_A_LEAF: f64 = 4.0;

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

    fn facet_at(&self, p: DVec2, rings: &[Vec<Ring>]) -> Option<usize> {
        let cell = ((p - self.min) * self.cells_per_metre).max(DVec2::ZERO);
        let (x, y) = ((cell.x as usize).min(self.columns - 1), (cell.y as usize).min(self.rows - 1));
        let index = y * self.columns + x;
        let here = &self.facets[self.starts[index] as usize..self.starts[index + 1] as usize];
        match here {
            [] => self.facets.first().map(|&f| f as usize),
            [only] => Some(*only as usize),
            [first, ..] => {
                let found = here.iter().find(|&&f| contains(&rings[f as usize], p));
                Some(*found.unwrap_or(first) as usize)
            }
        }
    }
}

/// A facet's tree, made for going down it fast.
pub struct Descent {
    /// What nodes are relative to: the facet's least corner, metres.
    min: DVec2,
    nodes: Vec<Node>,
    /// A grid over the facet: by cell the last node that holds all of it.
    starts: Vec<u32>,
    cells: UVec2,
    cells_per_metre: Vec2,
}

struct Node {
    middle: Vec2,
    /// By quadrant: left or right, plus two for above; all [`NONE`] for a leaf.
    children: [u32; 4],
}

impl Node {
    #[inline]
    fn child(&self, p: Vec2) -> u32 {
        self.children[usize::from(p.x >= self.middle.x) + 2 * usize::from(p.y >= self.middle.y)]
    }
}

impl Descent {
    /// Prepares the facet's tree; nodes are numbered as its elements.
    #[must_use]
    pub fn new(facet: &Facet) -> Self {
        let root = &facet.elements[0];
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
            Node { middle: (middle - root.min).as_vec2(), children }
        });
        let nodes: Vec<Node> = nodes.collect();
        let extent = root.max - root.min;
        let leaves = facet.leaves().count() as f64;
        let cells = (extent * (CELLS_A_LEAF * leaves / extent.element_product()).sqrt())
            .ceil()
            .clamp(DVec2::ONE, DVec2::splat(CELLS_A_LEAF * leaves));
        let size = (extent / cells).as_vec2();
        let cells = cells.as_uvec2();
        let start = |x: u32, y: u32| {
            let low = size * UVec2::new(x, y).as_vec2();
            let (left, above) = (Vec2::new(size.x, 0.0), Vec2::new(0.0, size.y));
            let mut at = 0;
            loop {
                let [next, others @ ..] =
                    [low, low + left, low + above, low + size].map(|p| nodes[at as usize].child(p));
                if next == NONE || others != [next; 3] {
                    return at;
                }
                at = next;
            }
        };
        let starts =
            (0..cells.y).flat_map(|y| (0..cells.x).map(move |x| (x, y))).map(|(x, y)| start(x, y)).collect();
        Self { min: root.min, starts, cells, cells_per_metre: 1.0 / size, nodes }
    }

    /// The leaf at `p`, plane coordinates.
    #[inline]
    #[must_use]
    pub fn leaf(&self, p: DVec2) -> u32 {
        let p = (p - self.min).as_vec2();
        let cell = (p * self.cells_per_metre).max(Vec2::ZERO);
        let (x, y) = ((cell.x as u32).min(self.cells.x - 1), (cell.y as u32).min(self.cells.y - 1));
        let mut at = self.starts[(y * self.cells.x + x) as usize];
        loop {
            let child = self.nodes[at as usize].child(p);
            if child == NONE {
                return at;
            }
            at = child;
        }
    }

    /// The first element on the way down to `p` for which `is_goal` holds, or the leaf there.
    #[must_use]
    pub fn find(&self, p: DVec2, is_goal: impl Fn(u32) -> bool) -> u32 {
        let p = (p - self.min).as_vec2();
        let mut at = 0;
        loop {
            let child = self.nodes[at as usize].child(p);
            if child == NONE || is_goal(at) {
                return at;
            }
            at = child;
        }
    }
}
