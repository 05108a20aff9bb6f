//! The stage itself: group, outline, find contacts, cut.

use std::ops::Range;
use std::sync::Arc;

use rayon::prelude::*;

use super::contact::{BoxQuery, ContactSearch, Sides};
use super::facet::Facets;
use super::group::{Apart, group};
use super::outline::{Outline, outline};
use super::region::Cutting;
use super::{Geometry, Region, SmoothNormals, Surface, SurfaceSet};
use crate::geom::Bounds;

/// Contact tolerance against the scene's diagonal: what f32 positions are exact to, and room for the
/// transforms on top.
const CONTACT: f64 = 1e-6;

/// The same against the surface's own size, so that small things in a large scene keep their shape.
const CONTACT_OF_SURFACE: f64 = 1e-3;

/// Surfaces of more triangles than this stay whole even where they lie over themselves.
const MOST_TO_TAKE_APART: usize = 2000;

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
    let finished: Vec<Vec<Finished>> = grouped.into_par_iter().map(|g| search.finish(g)).collect();
    let mut finished: Vec<Finished> = finished.into_iter().flatten().collect();
    finished.sort_by_key(|f| (f.surface.placement, f.surface.source_triangles.first().copied()));
    let dropped_contacts = finished.iter().map(|f| f.dropped).sum();
    let surfaces = finished.into_iter().map(|f| f.surface).collect();
    SurfaceSet { surfaces, without_area, dropped_contacts }
}

/// A surface that is not yet cut.
struct Grouped {
    placement: usize,
    outline: Outline,
    triangles: Vec<usize>,
    /// How exact the positions are, metres.
    noise: f64,
}

/// A surface, and how many of its contacts could not be used.
struct Finished {
    surface: Surface,
    dropped: usize,
}

/// A placement's surfaces and how many of its triangles are in none.
fn group_placement(geometry: &Geometry, placement: usize) -> (Vec<Grouped>, usize) {
    let triangles: Vec<usize> = geometry.triangles_of(placement).collect();
    let facets = Facets::of(geometry, &triangles, 0.0);
    let surfaces = outline_groups(&facets, placement, Apart::Edges);
    let placed: usize = surfaces.iter().map(|s| s.triangles.len()).sum();
    (surfaces, triangles.len() - placed)
}

fn outline_groups(facets: &Facets, placement: usize, apart: Apart) -> Vec<Grouped> {
    let outlined = |members: Vec<usize>| {
        let outline = outline(facets, &members)?;
        let triangles = members.iter().map(|&m| facets.facets[m].triangle).collect();
        Some(Grouped { placement, outline, triangles, noise: facets.noise })
    };
    group(facets, apart).into_iter().filter_map(outlined).collect()
}

struct Search<'a> {
    geometry: &'a Geometry<'a>,
    neighbours: &'a dyn BoxQuery,
    diagonal: f64,
}

impl Search<'_> {
    /// Cuts a surface. One that lies over itself is taken apart first.
    fn finish(&self, grouped: Grouped) -> Vec<Finished> {
        let (regions, dropped) = self.cut(&grouped);
        if !regions.is_empty() {
            return vec![self.surface(grouped, regions, dropped)];
        }
        let parts = self.take_apart(&grouped);
        let kept: usize = parts.iter().map(|p| p.triangles.len()).sum();
        if parts.len() < 2 || kept < grouped.triangles.len() {
            return vec![self.finish_overlapping(grouped)];
        }
        let finish_part = |part: Grouped| {
            let (regions, dropped) = self.cut(&part);
            if regions.is_empty() {
                self.finish_overlapping(part)
            } else {
                self.surface(part, regions, dropped)
            }
        };
        parts.into_iter().map(finish_part).collect()
    }

    /// Cuts what the surface covers, each place once, so that its area is less than its triangles'.
    fn finish_overlapping(&self, mut grouped: Grouped) -> Finished {
        let Outline { rings, area, .. } = &grouped.outline;
        let snap = self.snap(&grouped.outline);
        let (rings, area) = Cutting { rings, area: *area, contacts: &[], snap }.union();
        if area > 0.0 {
            grouped.outline.rings = rings;
            grouped.outline.area = area;
        }
        let (mut regions, dropped) = self.cut(&grouped);
        if regions.is_empty() {
            regions.push(self.as_drawn(&grouped));
        }
        self.surface(grouped, regions, dropped)
    }

    /// The same triangles as surfaces that do not lie over themselves.
    fn take_apart(&self, grouped: &Grouped) -> Vec<Grouped> {
        if grouped.triangles.len() > MOST_TO_TAKE_APART {
            return Vec::new();
        }
        let facets = Facets::of(self.geometry, &grouped.triangles, grouped.noise);
        outline_groups(&facets, grouped.placement, Apart::Areas)
    }

    /// Regions, none where the surface lies over itself, and how many contacts could not be used.
    fn cut(&self, grouped: &Grouped) -> (Vec<Region>, usize) {
        let Outline { rings, area, .. } = &grouped.outline;
        let snap = self.snap(&grouped.outline);
        let search = ContactSearch { geometry: self.geometry, neighbours: self.neighbours, tolerance: snap };
        let sides = if self.is_double_sided(grouped.placement) { Sides::Both } else { Sides::Front };
        let contacts = search.contacts(&grouped.outline, &grouped.triangles, sides);
        let parts = Cutting { rings, area: *area, contacts: &contacts, snap }.cut();
        (parts.regions, parts.dropped)
    }

    fn snap(&self, outline: &Outline) -> f64 {
        let size = Bounds::of(outline.rings.iter().flatten().map(|p| p.extend(0.0))).diagonal();
        (CONTACT * self.diagonal).min(CONTACT_OF_SURFACE * size)
    }

    fn material(&self, placement: usize) -> usize {
        self.geometry.placements.get(placement).map_or(0, |p| p.material)
    }

    fn is_double_sided(&self, placement: usize) -> bool {
        self.geometry.double_sided.get(self.material(placement)).copied().unwrap_or(false)
    }

    fn surface(&self, grouped: Grouped, regions: Vec<Region>, dropped: usize) -> Finished {
        let Grouped { placement, outline: Outline { frame, rings, area }, triangles, .. } = grouped;
        let smooth = SmoothNormals::of(self.geometry, &frame, &triangles).map(Arc::new);
        let surface = Surface {
            placement,
            material: self.material(placement),
            frame,
            rings,
            source_triangles: triangles,
            regions,
            area,
            smooth,
            double_sided: self.is_double_sided(placement),
        };
        Finished { surface, dropped }
    }

    /// The whole surface as one region in the triangles that it came in.
    fn as_drawn(&self, grouped: &Grouped) -> Region {
        let outline = &grouped.outline;
        let points = grouped.triangles.iter().filter_map(|&t| self.geometry.points(t));
        let triangles = points.map(|t| t.map(|p| outline.frame.project(p))).collect();
        Region { rings: outline.rings.clone(), triangles, area: outline.area }
    }
}

impl Geometry<'_> {
    /// The corners of a scene triangle; `None` where there is no such triangle.
    pub(super) fn points(&self, triangle: usize) -> Option<[glam::DVec3; 3]> {
        let [a, b, c] =
            self.triangles.get(triangle)?.vertices.map(|v| self.vertices.get(v as usize).copied());
        Some([a?, b?, c?])
    }

    /// A placement's triangles, as indices into [`Geometry::triangles`]; empty where there is none.
    pub(super) fn triangles_of(&self, placement: usize) -> Range<usize> {
        let range = self.placements.get(placement).map_or(0..0, |p| p.triangles.clone());
        range.start.min(self.triangles.len())..range.end.min(self.triangles.len())
    }
}
