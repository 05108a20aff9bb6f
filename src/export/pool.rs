//! Lightmap coordinates on the source's own vertices, and on those that cuts add.
//!
//! Primitives of a mesh may draw from one pool of vertices. A vertex whose triangles lie in one
//! chart only gets that chart's coordinates; one whose triangles lie in several is split, once for
//! each further chart. Triangles without a surface (zero area) take whatever is there.

use std::collections::BTreeMap;

use glam::DVec3;

use super::blend::{Blend, BlendKey};
use super::cut::Cuts;
use super::{Baked, ExportError};
use crate::scene::{Placement, Triangle};
use crate::unwrap::Atlas;

/// The vertices that a group of placements draws from.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Pool {
    /// What each vertex is made of.
    pub(super) vertices: Vec<Blend>,
    /// `TEXCOORD_1` of each vertex.
    pub(super) coordinates: Vec<[f32; 2]>,
    /// The triangles of each placement, in source order and winding, indices into the pool.
    pub(super) corners: Vec<Vec<[u32; 3]>>,
    /// Whether the pool is the source's own, vertex for vertex.
    pub(super) unsplit: bool,
    /// Whether some triangles are not those of the choice.
    pub(super) partial: bool,
    /// Whether the pool holds every source vertex, and copies of them alone.
    pub(super) complete: bool,
}

/// A chart: the surface, and which of the surface's charts.
pub(super) type ChartOf = (usize, usize);

/// Where `world` lies in its page by a surface's chart: texture coordinates, origin top left.
pub(super) fn chart_coordinates(baked: &Baked, (surface, chart): ChartOf, world: DVec3) -> [f32; 2] {
    let Some(point) = baked.surfaces.get(surface).map(|s| s.frame.project(world)) else { return [0.0; 2] };
    let Some(chart) = baked.atlas.charts_of(surface).get(chart) else { return [0.0; 2] };
    let texel = chart.texel(point);
    let Some(page) = baked.atlas.pages.get(chart.page) else { return [0.0; 2] };
    let side = |length: u32| f64::from(length.max(1));
    let at = [texel.x / side(page.width), (texel.y - f64::from(page.row)) / side(page.height)];
    at.map(|c| if c.is_finite() { c as f32 } else { 0.0 })
}

/// What the placements' triangles are to be written with.
pub(super) struct Charted<'a> {
    pub(super) baked: &'a Baked<'a>,
    /// The surface of each triangle of the scene.
    pub(super) surface_of: &'a [Option<usize>],
    /// The triangles' parts.
    pub(super) cuts: &'a Cuts,
    /// Which pieces are wanted.
    pub(super) choice: Choice,
}

impl Charted<'_> {
    /// Builds the pool of placements that share their attributes; `count` source vertices.
    pub(super) fn pool(&self, placements: &[&Placement], count: usize) -> Result<Pool, ExportError> {
        let mut builder = Builder {
            chart: vec![Chart::Unused; count],
            coordinates: vec![[0.0; 2]; count],
            ..Builder::default()
        };
        let mut corners = Vec::with_capacity(placements.len());
        let mut partial = false;
        for placement in placements {
            let mut list = Vec::with_capacity(placement.triangles.len());
            for index in placement.triangles.clone() {
                let (triangle, surface) = (self.baked.scene.triangles.get(index), self.surface_of.get(index));
                let (Some(triangle), Some(&surface)) = (triangle, surface) else {
                    return Err(ExportError::Mismatch { what: "placements" });
                };
                for piece in self.cuts.pieces(index) {
                    let chart = surface.map(|surface| (surface, piece.chart));
                    if !self.choice.takes(self.baked.atlas, chart) {
                        partial = true;
                        continue;
                    }
                    // The source's winding.
                    let order = if placement.mirrored { [0, 2, 1] } else { [0, 1, 2] };
                    let mut out = [0; 3];
                    for (slot, corner) in out.iter_mut().zip(order.map(|i: usize| piece.corners[i])) {
                        *slot = builder.corner(self.baked, chart, triangle, corner)?;
                    }
                    list.push(out);
                }
            }
            corners.push(list);
        }
        Ok(Pool { partial, ..builder.finish(corners) })
    }
}

impl Charted<'_> {
    /// The pool of placements whose vertices have `coordinates` of their own, whatever charts their triangles lie in.
    pub(super) fn uncharted_pool(
        &self,
        placements: &[&Placement],
        coordinates: &[[f32; 2]],
    ) -> Result<Pool, ExportError> {
        let triangles = |placement: &&Placement| {
            let own = self.baked.scene.triangles.get(placement.triangles.clone());
            let own = own.ok_or(ExportError::Mismatch { what: "placements" })?;
            let source_winding = |triangle: &Triangle| {
                let [a, b, c] = triangle.source_vertices;
                if placement.mirrored { [a, c, b] } else { [a, b, c] }
            };
            Ok(own.iter().map(source_winding).collect())
        };
        Ok(Pool {
            vertices: (0_u32..).take(coordinates.len()).map(Blend::copy_of).collect(),
            coordinates: coordinates.to_vec(),
            corners: placements.iter().map(triangles).collect::<Result<_, ExportError>>()?,
            unsplit: true,
            partial: false,
            complete: true,
        })
    }
}

/// Of a node's triangles those that one page lights.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Choice {
    /// The page.
    pub(super) page: usize,
    /// Whether the node has triangles on other pages too.
    pub(super) is_part: bool,
    /// Whether triangles without a surface belong to it; one page of the node has them.
    pub(super) is_first: bool,
}

impl Choice {
    /// Whether a triangle in that chart, or in none, is one of these.
    pub(super) fn takes(self, atlas: &Atlas, chart: Option<ChartOf>) -> bool {
        if !self.is_part {
            return true;
        }
        let Some((surface, chart)) = chart else { return self.is_first };
        atlas.charts_of(surface).get(chart).is_some_and(|chart| chart.page == self.page)
    }
}

/// The chart that a source vertex was given to.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Chart {
    /// No triangle has it.
    Unused,
    /// Only zero-area triangles have it so far.
    Free,
    Of(ChartOf),
}

#[derive(Default)]
struct Builder {
    chart: Vec<Chart>,
    /// Of the source's vertices, then of those that were added.
    coordinates: Vec<[f32; 2]>,
    /// By what they are made of and chart, the numbers of vertices that were added.
    numbers: BTreeMap<(BlendKey, ChartOf), u32>,
    /// What was added: copies and blends.
    added: Vec<Blend>,
}

impl Builder {
    /// The pool vertex for a corner, weights of a triangle's own, as the chart sees it.
    fn corner(
        &mut self,
        baked: &Baked,
        chart: Option<ChartOf>,
        triangle: &Triangle,
        weights: [f64; 3],
    ) -> Result<u32, ExportError> {
        let mismatch = || ExportError::Mismatch { what: "triangles" };
        let blend = Blend::new(triangle.source_vertices, weights);
        let mut taken = true;
        if let Some(source) = blend.original() {
            let held = self.chart.get_mut(source as usize).ok_or_else(mismatch)?;
            let Some(chart) = chart else {
                if *held == Chart::Unused {
                    *held = Chart::Free;
                }
                return Ok(source);
            };
            if *held == Chart::Of(chart) {
                return Ok(source);
            }
            taken = matches!(*held, Chart::Of(_));
            if !taken {
                *held = Chart::Of(chart);
            }
        }
        let chart = chart.ok_or_else(mismatch)?;
        let key = (blend.key(), chart);
        if let (true, Some(&number)) = (taken, self.numbers.get(&key)) {
            return Ok(number);
        }
        let mut world = DVec3::ZERO;
        for (vertex, weight) in triangle.vertices.into_iter().zip(weights).filter(|part| part.1 > 0.0) {
            world += weight * *baked.scene.vertices.get(vertex as usize).ok_or_else(mismatch)?;
        }
        let coordinates = chart_coordinates(baked, chart, world);
        if let (false, Some(source)) = (taken, blend.original()) {
            if let Some(slot) = self.coordinates.get_mut(source as usize) {
                *slot = coordinates;
            }
            return Ok(source);
        }
        let number = u32::try_from(self.coordinates.len()).map_err(|_| mismatch())?;
        self.coordinates.push(coordinates);
        self.added.push(blend);
        self.numbers.insert(key, number);
        Ok(number)
    }

    /// Where vertices were added, those that no triangle has are left out: the pool is written anew
    /// anyway, and many meshes may draw from one large pool.
    fn finish(self, mut corners: Vec<Vec<[u32; 3]>>) -> Pool {
        let all = (0_u32..).take(self.chart.len()).map(Blend::copy_of);
        if self.added.is_empty() {
            let (vertices, coordinates) = (all.collect(), self.coordinates);
            return Pool { vertices, coordinates, corners, unsplit: true, partial: false, complete: true };
        }
        let mut pool = Pool::default();
        let mut place = Vec::with_capacity(self.coordinates.len());
        let used = self.chart.iter().map(|chart| *chart != Chart::Unused);
        let used = used.chain(self.added.iter().map(|_| true));
        let vertices = all.chain(self.added.iter().copied());
        for ((used, vertex), coordinates) in used.zip(vertices).zip(&self.coordinates) {
            place.push(pool.vertices.len() as u32);
            if used {
                pool.vertices.push(vertex);
                pool.coordinates.push(*coordinates);
            }
        }
        for corner in corners.iter_mut().flatten().flatten() {
            *corner = place.get(*corner as usize).copied().unwrap_or_default();
        }
        pool.complete = pool.vertices.len() == self.coordinates.len()
            && self.added.iter().all(|vertex| vertex.original().is_some());
        pool.corners = corners;
        pool
    }
}
