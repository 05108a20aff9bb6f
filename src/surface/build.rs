//! The stage itself: group, outline, find contacts, cut.

use std::ops::Range;

use rayon::prelude::*;

use super::contact::{BoxQuery, ContactSearch, Sides};
use super::facet::Facets;
use super::group::group;
use super::outline::{Outline, outline};
use super::region::Cutting;
use super::{Geometry, Region, Surface, SurfaceSet};
use crate::geom::Bounds;

/// Contact tolerance against the scene's diagonal: what f32 positions are exact to, and room for the
/// transforms on top.
const CONTACT: f64 = 1e-6;

/// The same against the surface's own size, so that small things in a large scene keep their shape.
const CONTACT_OF_SURFACE: f64 = 1e-3;

/// Groups the scene's triangles into planar surfaces and cuts these into regions along their contact edges.
///
/// `neighbours` finds the same triangles by place. Surfaces come in the order of their placements,
/// and within one in the order of their first triangles; nothing depends on the number of threads.
/// Zero-area triangles belong to no surface.
#[must_use]
pub fn build_surfaces(geometry: &Geometry, neighbours: &dyn BoxQuery) -> SurfaceSet {
    let whole = 0..geometry.placements.len();
    let grouped: Vec<(Vec<Grouped>, usize)> =
        whole.into_par_iter().map(|placement| group_placement(geometry, placement)).collect();
    let without_area = grouped.iter().map(|g| g.1).sum();
    let grouped: Vec<Grouped> = grouped.into_iter().flat_map(|g| g.0).collect();

    let finite = geometry.vertices.iter().copied().filter(|p| p.is_finite());
    let search = Search { geometry, neighbours, diagonal: Bounds::of(finite).diagonal() };
    let finished: Vec<(Surface, usize)> = grouped.into_par_iter().map(|g| search.finish(g)).collect();
    let dropped_contacts = finished.iter().map(|f| f.1).sum();
    let surfaces = finished.into_iter().map(|f| f.0).collect();
    SurfaceSet { surfaces, without_area, dropped_contacts }
}

/// A surface that is not yet cut.
struct Grouped {
    placement: usize,
    outline: Outline,
    triangles: Vec<usize>,
}

/// A placement's surfaces and how many of its triangles are in none.
fn group_placement(geometry: &Geometry, placement: usize) -> (Vec<Grouped>, usize) {
    let facets = Facets::of(geometry, placement);
    let mut without_area = facets.without_area;
    let mut surfaces = Vec::new();
    for members in group(&facets) {
        let triangles: Vec<usize> = members.iter().map(|&m| facets.facets[m].triangle).collect();
        match outline(&facets, &members) {
            Some(outline) => surfaces.push(Grouped { placement, outline, triangles }),
            None => without_area += triangles.len(),
        }
    }
    (surfaces, without_area)
}

struct Search<'a> {
    geometry: &'a Geometry<'a>,
    neighbours: &'a dyn BoxQuery,
    diagonal: f64,
}

impl Search<'_> {
    /// Cuts a surface; also gives the number of contacts that could not be used.
    fn finish(&self, grouped: Grouped) -> (Surface, usize) {
        let Grouped { placement, outline, triangles } = grouped;
        let material = self.geometry.placements.get(placement).map_or(0, |p| p.material);
        let double_sided = self.geometry.double_sided.get(material).copied().unwrap_or(false);
        let size = Bounds::of(outline.rings.iter().flatten().map(|p| p.extend(0.0))).diagonal();
        let snap = (CONTACT * self.diagonal).min(CONTACT_OF_SURFACE * size);
        let search = ContactSearch { geometry: self.geometry, neighbours: self.neighbours, tolerance: snap };
        let sides = if double_sided { Sides::Both } else { Sides::Front };
        let contacts = search.contacts(&outline, &triangles, sides);
        let cutting = Cutting { rings: &outline.rings, area: outline.area, contacts: &contacts, snap };
        let parts = cutting.cut();
        let mut regions = parts.regions;
        if regions.is_empty() {
            regions.push(self.as_drawn(&outline, &triangles));
        }
        let Outline { frame, rings, area } = outline;
        let surface =
            Surface { placement, material, frame, rings, source_triangles: triangles, regions, area, double_sided };
        (surface, parts.dropped)
    }

    /// The whole surface as one region in the triangles that it came in.
    fn as_drawn(&self, outline: &Outline, triangles: &[usize]) -> Region {
        let points = triangles.iter().filter_map(|&t| self.geometry.points(t));
        let triangles = points.map(|t| t.map(|p| outline.frame.project(p))).collect();
        Region { rings: outline.rings.clone(), triangles, area: outline.area }
    }
}

impl Geometry<'_> {
    /// The corners of a scene triangle; `None` where there is no such triangle.
    pub(super) fn points(&self, triangle: usize) -> Option<[glam::DVec3; 3]> {
        let [a, b, c] = self.triangles.get(triangle)?.vertices.map(|v| self.vertices.get(v as usize).copied());
        Some([a?, b?, c?])
    }

    /// A placement's triangles, as indices into [`Geometry::triangles`]; empty where there is none.
    pub(super) fn triangles_of(&self, placement: usize) -> Range<usize> {
        let range = self.placements.get(placement).map_or(0..0, |p| p.triangles.clone());
        range.start.min(self.triangles.len())..range.end.min(self.triangles.len())
    }
}
