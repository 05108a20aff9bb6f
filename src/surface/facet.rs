//! One placement's triangles with shared vertices, cut where a neighbour's corner lies on an edge.
//!
//! Walls drawn with T-junctions are as common as clean ones; a corner on a neighbour's edge is put
//! into that edge here, so that grouping and outlining need to know shared edges only.

use std::collections::HashMap;

use glam::{DVec2, DVec3};

use super::Geometry;
use super::weld::{position_noise, weld};
use crate::geom::{Bounds, triangle};
use crate::scene::Triangle;

/// A triangle that has area.
#[derive(Clone, Debug)]
pub(super) struct Facet {
    /// Index into the scene's triangles.
    pub(super) triangle: usize,
    /// Indices into [`Facets::positions`]: the corners and what lies on the edges between them,
    /// counter-clockwise.
    pub(super) ring: Vec<u32>,
    /// The triangle's own corners.
    pub(super) points: [DVec3; 3],
    /// Unit normal.
    pub(super) normal: DVec3,
    /// Square metres.
    pub(super) area: f64,
    /// The least height, metres.
    pub(super) height: f64,
    /// The corners' texture coordinates where they are kept.
    pub(super) coordinates: Option<[DVec2; 3]>,
}

/// The facets of one placement, or of some of it.
#[derive(Clone, Debug, Default)]
pub(super) struct Facets {
    /// World-space positions, metres.
    pub(super) positions: Vec<DVec3>,
    /// In the order of the scene's triangles.
    pub(super) facets: Vec<Facet>,
    /// How far two copies of one position may be apart, metres.
    pub(super) noise: f64,
}

/// A triangle is without area when it is thinner than this against its longest edge: f64 rounding
/// in a rotated triangle of no height stays a thousand times below.
const THINNEST: f64 = 1e-12;

impl Facets {
    /// The facets of the scene's triangles with the ascending `indices`. Copies of one position lie
    /// as far apart as the part's size suggests, and at least `least_noise` metres.
    pub(super) fn of(geometry: &Geometry, indices: &[usize], least_noise: f64) -> Self {
        let triangles: Vec<Triangle> =
            indices.iter().filter_map(|&i| geometry.triangles.get(i).copied()).collect();
        let mut used: Vec<u32> = triangles.iter().flat_map(|t| t.vertices).collect();
        used.sort_unstable();
        used.dedup();
        used.retain(|&v| geometry.vertices.get(v as usize).is_some_and(|p| p.is_finite()));
        let positions: Vec<DVec3> = used.iter().map(|&v| geometry.vertices[v as usize]).collect();
        let bounds = Bounds::of(positions.iter().copied());
        let noise = position_noise(bounds).max(least_noise);
        if !(noise > 0.0 && noise.is_finite()) {
            return Self::default();
        }
        let first = weld(&positions, bounds.min, noise);
        let mut facets = Vec::with_capacity(triangles.len());
        for (triangle, &index) in triangles.iter().zip(indices) {
            let local = triangle.vertices.map(|v| used.binary_search(&v).ok());
            let [Some(a), Some(b), Some(c)] = local else { continue };
            let points = [positions[a], positions[b], positions[c]];
            let own = [a, b, c].map(|v| v as u32);
            let welded = own.map(|v| first[v as usize]);
            let distinct = welded[0] != welded[1] && welded[1] != welded[2] && welded[2] != welded[0];
            let ring = if distinct { welded } else { own }.to_vec();
            let coordinates = geometry.coordinates.get(index).copied().flatten();
            facets.extend(facet(index, ring, points, noise).map(|f| Facet { coordinates, ..f }));
        }
        let mut facets = Self { positions, facets, noise };
        facets.cut_edges(bounds);
        facets
    }

    /// Puts vertices that lie on edges without a neighbour into those edges.
    fn cut_edges(&mut self, bounds: Bounds) {
        let open = self.open_edges();
        if open.is_empty() {
            return;
        }
        let grid = OpenEdges::new(&self.positions, &open, bounds, self.noise);
        let mut vertices: Vec<u32> = open.iter().flat_map(|e| [e.from, e.to]).collect();
        vertices.sort_unstable();
        vertices.dedup();
        let mut cuts: Vec<Vec<(f64, u32)>> = vec![Vec::new(); open.len()];
        for v in vertices {
            let p = self.positions[v as usize];
            for &e in grid.near(p) {
                let edge = open[e as usize];
                if self.facets[edge.facet].ring.contains(&v) {
                    continue;
                }
                let (a, b) = (self.positions[edge.from as usize], self.positions[edge.to as usize]);
                let along = b - a;
                let t = (p - a).dot(along) / along.length_squared();
                if t > 0.0 && t < 1.0 && (a + along * t).distance(p) <= self.noise {
                    cuts[e as usize].push((t, v));
                }
            }
        }
        for (edge, mut cuts) in open.into_iter().zip(cuts) {
            cuts.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            cuts.dedup_by_key(|c| c.1);
            let ring = &mut self.facets[edge.facet].ring;
            if let Some(at) = ring.iter().position(|&v| v == edge.from) {
                ring.splice(at + 1..at + 1, cuts.into_iter().map(|c| c.1));
            }
        }
    }

    /// The edges that one facet only has.
    fn open_edges(&self) -> Vec<OpenEdge> {
        let mut edges = Vec::with_capacity(3 * self.facets.len());
        for (facet, f) in self.facets.iter().enumerate() {
            for i in 0..3 {
                edges.push(OpenEdge { from: f.ring[i], to: f.ring[(i + 1) % 3], facet });
            }
        }
        let key = |e: &OpenEdge| (e.from.min(e.to), e.from.max(e.to));
        edges.sort_by_key(|e| (key(e), e.facet));
        edges.chunk_by(|a, b| key(a) == key(b)).filter(|c| c.len() == 1).flatten().copied().collect()
    }
}

/// The facet of a triangle, `None` where it has no area to speak of: thinner than its corners are exact.
fn facet(triangle: usize, ring: Vec<u32>, points: [DVec3; 3], noise: f64) -> Option<Facet> {
    let [a, b, c] = points;
    let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
    // Scaled first, so that tiny triangles do not underflow.
    let scaled = points.map(|p| (p - a) / longest);
    let double = triangle::area_normal(scaled);
    let normal = double.try_normalize()?;
    let height = double.length() * longest;
    let thin = height <= THINNEST * longest || (height <= noise && height <= 1e-3 * longest);
    let area = height * longest / 2.0;
    let usable = normal.is_finite() && area > 0.0 && !thin;
    usable.then_some(Facet { triangle, ring, points, normal, area, height, coordinates: None })
}

#[derive(Clone, Copy, Debug)]
struct OpenEdge {
    from: u32,
    to: u32,
    facet: usize,
}

/// Finds open edges by position: each is cut into pieces no longer than a cell.
struct OpenEdges {
    low: DVec3,
    cell: f64,
    cells: HashMap<[i64; 3], Vec<u32>>,
}

impl OpenEdges {
    const MOST_CELLS_A_SIDE: f64 = 128.0;

    fn new(positions: &[DVec3], open: &[OpenEdge], bounds: Bounds, margin: f64) -> Self {
        let side = (2.0 * (open.len() as f64).sqrt()).clamp(1.0, Self::MOST_CELLS_A_SIDE);
        let cell = (bounds.diagonal() / side).max(4.0 * margin);
        let mut grid = Self { low: bounds.min, cell, cells: HashMap::new() };
        for (edge, id) in open.iter().zip(0_u32..) {
            let (a, b) = (positions[edge.from as usize], positions[edge.to as usize]);
            let pieces = (a.distance(b) / cell).ceil().clamp(1.0, 2.0 * Self::MOST_CELLS_A_SIDE);
            for i in 0..pieces as usize {
                let at = |i: usize| a.lerp(b, i as f64 / pieces);
                let piece = Bounds::of([at(i), at(i + 1)]).grown(margin);
                let (low, high) = (grid.key(piece.min), grid.key(piece.max));
                for x in low[0]..=high[0] {
                    for y in low[1]..=high[1] {
                        for z in low[2]..=high[2] {
                            let list = grid.cells.entry([x, y, z]).or_default();
                            if list.last() != Some(&id) {
                                list.push(id);
                            }
                        }
                    }
                }
            }
        }
        grid
    }

    fn key(&self, p: DVec3) -> [i64; 3] {
        let q = ((p - self.low) / self.cell).floor();
        [q.x as i64, q.y as i64, q.z as i64]
    }

    fn near(&self, p: DVec3) -> &[u32] {
        self.cells.get(&self.key(p)).map_or(&[], Vec::as_slice)
    }
}
