//! Lightmap coordinates on the source's own vertices.
//!
//! Primitives of a mesh may draw from one pool of vertices. A vertex whose triangles lie in one
//! chart only gets that chart's coordinates; one whose triangles lie in several is split, once for
//! each further chart. Triangles without a surface (zero area) take whatever is there.

use std::collections::BTreeMap;
use std::ops::Range;

use glam::DVec3;

use super::{Baked, ExportError};
use crate::scene::{Placement, Triangle};

/// The vertices that a group of placements draws from.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Pool {
    /// The source vertex that each vertex is a copy of.
    pub(super) sources: Vec<u32>,
    /// `TEXCOORD_1` of each vertex.
    pub(super) coordinates: Vec<[f32; 2]>,
    /// The triangles of each placement, in source order and winding, indices into the pool.
    pub(super) corners: Vec<Vec<[u32; 3]>>,
    /// Whether the pool is the source's own, vertex for vertex.
    pub(super) unsplit: bool,
    /// Whether every source vertex is there.
    pub(super) complete: bool,
}

/// Where `world` lies in the page of `surface`'s chart: texture coordinates, origin top left.
pub(super) fn chart_coordinates(baked: &Baked, surface: usize, world: DVec3) -> [f32; 2] {
    let Some(point) = baked.surfaces.get(surface).map(|s| s.frame.project(world)) else { return [0.0; 2] };
    let Some(chart) = baked.atlas.chart_at(surface, point) else { return [0.0; 2] };
    let texel = chart.texel(point);
    let side = |length: u32| f64::from(length.max(1));
    let at = [texel.x / side(baked.atlas.width), texel.y / side(baked.atlas.height)];
    at.map(|c| if c.is_finite() { c as f32 } else { 0.0 })
}

/// The corners of a triangle as source vertices, in the source's winding, with their places in the world.
fn source_corners(triangle: &Triangle, placement: &Placement) -> [(u32, u32); 3] {
    let [a, b, c] = triangle.source_vertices;
    let [p, q, r] = triangle.vertices;
    if placement.mirrored { [(a, p), (c, r), (b, q)] } else { [(a, p), (b, q), (c, r)] }
}

/// Builds the pool of placements that share their attributes; `count` source vertices.
pub(super) fn build(
    baked: &Baked,
    surface_of: &[Option<usize>],
    placements: &[&Placement],
    count: usize,
) -> Result<Pool, ExportError> {
    let mut builder = Builder {
        chart: vec![Chart::Unused; count],
        coordinates: vec![[0.0; 2]; count],
        ..Builder::default()
    };
    let mut corners = Vec::with_capacity(placements.len());
    for placement in placements {
        let range: Range<usize> = placement.triangles.clone();
        let triangles = baked.scene.triangles.get(range.clone());
        let surfaces = surface_of.get(range);
        let (Some(triangles), Some(surfaces)) = (triangles, surfaces) else {
            return Err(ExportError::Mismatch { what: "placements" });
        };
        let mut list = Vec::with_capacity(triangles.len());
        for (triangle, &surface) in triangles.iter().zip(surfaces) {
            let mut out = [0; 3];
            for (slot, (source, world)) in out.iter_mut().zip(source_corners(triangle, placement)) {
                *slot = builder.corner(baked, surface, source, world)?;
            }
            list.push(out);
        }
        corners.push(list);
    }
    Ok(builder.finish(corners))
}

/// The chart that a source vertex was given to.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Chart {
    /// No triangle has it.
    Unused,
    /// Only zero-area triangles have it so far.
    Free,
    Of(usize),
}

#[derive(Default)]
struct Builder {
    chart: Vec<Chart>,
    /// Of the source's vertices, then of the copies.
    coordinates: Vec<[f32; 2]>,
    /// By source vertex and surface, the copy's number.
    copies: BTreeMap<(u32, usize), u32>,
    /// The source vertex of each copy.
    copied: Vec<u32>,
}

impl Builder {
    /// The pool vertex for a source vertex as a triangle of `surface` sees it.
    fn corner(
        &mut self,
        baked: &Baked,
        surface: Option<usize>,
        source: u32,
        world: u32,
    ) -> Result<u32, ExportError> {
        let mismatch = || ExportError::Mismatch { what: "triangles" };
        let chart = self.chart.get_mut(source as usize).ok_or_else(mismatch)?;
        let Some(surface) = surface else {
            if *chart == Chart::Unused {
                *chart = Chart::Free;
            }
            return Ok(source);
        };
        let taken = matches!(*chart, Chart::Of(other) if other != surface);
        if *chart == Chart::Of(surface) {
            return Ok(source);
        }
        if let (true, Some(&copy)) = (taken, self.copies.get(&(source, surface))) {
            return Ok(copy);
        }
        let world = *baked.scene.vertices.get(world as usize).ok_or_else(mismatch)?;
        let coordinates = chart_coordinates(baked, surface, world);
        if !taken {
            *chart = Chart::Of(surface);
            if let Some(slot) = self.coordinates.get_mut(source as usize) {
                *slot = coordinates;
            }
            return Ok(source);
        }
        let copy = u32::try_from(self.coordinates.len()).map_err(|_| mismatch())?;
        self.coordinates.push(coordinates);
        self.copied.push(source);
        self.copies.insert((source, surface), copy);
        Ok(copy)
    }

    /// Where there are copies, vertices that no triangle has are left out: the pool is written anew
    /// anyway, and many meshes may draw from one large pool.
    fn finish(self, mut corners: Vec<Vec<[u32; 3]>>) -> Pool {
        let all = (0_u32..).take(self.chart.len());
        if self.copied.is_empty() {
            let (sources, coordinates) = (all.collect(), self.coordinates);
            return Pool { sources, coordinates, corners, unsplit: true, complete: true };
        }
        let mut pool = Pool::default();
        let mut place = Vec::with_capacity(self.coordinates.len());
        let used = self.chart.iter().map(|chart| *chart != Chart::Unused);
        let used = used.chain(self.copied.iter().map(|_| true));
        let sources = all.chain(self.copied.iter().copied());
        for ((used, source), coordinates) in used.zip(sources).zip(&self.coordinates) {
            place.push(pool.sources.len() as u32);
            if used {
                pool.sources.push(source);
                pool.coordinates.push(*coordinates);
            }
        }
        for corner in corners.iter_mut().flatten().flatten() {
            *corner = place.get(*corner as usize).copied().unwrap_or_default();
        }
        pool.complete = pool.sources.len() == self.coordinates.len();
        pool.corners = corners;
        pool
    }
}
