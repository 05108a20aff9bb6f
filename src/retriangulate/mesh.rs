//! The radiosity mesh: conforming triangles over the leaves, light in every vertex.

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::{MeshVertex, PlanarRegion, RadiosityMesh, SurfaceMesh, triangulate};
use crate::element::{Facet, Side};
use crate::light::luminance;
use crate::surface::Surface;

/// Points closer than this fraction of a surface's extent are one.
const SNAP: f64 = 1e-7;

/// A bulge above this fraction of the light gets a vertex.
const NOTABLE: f64 = 2e-3;

/// Triangulates the leaves of all front facets and gives each vertex the mean of what the leaves around it
/// received there.
///
/// Also returns how many points or edges had to be left out.
#[must_use]
pub fn radiosity_mesh(surfaces: &[Surface], facets: &[Facet]) -> (RadiosityMesh, usize) {
    let mut of_region: Vec<Vec<Vec<&Facet>>> =
        surfaces.iter().map(|s| vec![Vec::new(); s.regions.len()]).collect();
    for facet in facets.iter().filter(|f| f.side == Side::Front) {
        of_region[facet.surface][facet.region].push(facet);
    }
    let meshes: Vec<(SurfaceMesh, usize)> =
        surfaces.par_iter().zip(&of_region).map(|(s, regions)| surface_mesh(s, regions)).collect();
    let dropped = meshes.iter().map(|(_, dropped)| dropped).sum();
    (RadiosityMesh { surfaces: meshes.into_iter().map(|(mesh, _)| mesh).collect() }, dropped)
}

fn surface_mesh(surface: &Surface, regions: &[Vec<&Facet>]) -> (SurfaceMesh, usize) {
    let (min, max) = surface.extent();
    let snap = SNAP * (max - min).max_element();
    let points: Vec<Vec<DVec2>> = regions.iter().map(|facets| leaf_points(facets)).collect();
    let mut mesh = SurfaceMesh::default();
    let mut dropped = 0;
    for (index, (region, facets)) in surface.regions.iter().zip(regions).enumerate() {
        // Where regions meet, each takes the other's vertices on their common edge, so that no T-vertex is left.
        let mut own = points[index].clone();
        if regions.len() > 1 {
            own.extend(border_points(&region.rings, &points, index, snap));
        }
        let triangulation = triangulate(PlanarRegion { rings: &region.rings, points: &own, snap });
        dropped += triangulation.dropped;
        let first = mesh.vertices.len() as u32;
        mesh.vertices.extend(triangulation.vertices.iter().map(|&p| vertex(facets, p, snap)));
        mesh.triangles.extend(triangulation.triangles.iter().map(|t| t.map(|v| v + first)));
        mesh.regions.resize(mesh.triangles.len(), index as u32);
    }
    (mesh, dropped)
}

fn leaf_points(facets: &[&Facet]) -> Vec<DVec2> {
    let mut points = Vec::new();
    for facet in facets {
        for leaf in facet.leaves() {
            let e = &facet.elements[leaf as usize];
            match &e.cut {
                None => {
                    points.extend(e.corners());
                    if has_bulge(facet, leaf) {
                        points.push(0.5 * (e.min + e.max));
                    }
                }
                Some(cut) => points.extend(cut.rings.iter().flatten()),
            }
        }
    }
    points
}

/// Whether light in the leaf's middle is notably not what its corners say.
fn has_bulge(facet: &Facet, leaf: u32) -> bool {
    let e = &facet.elements[leaf as usize];
    let bulge = luminance((e.direct.bulge + e.indirect.bulge).abs());
    let (direct, indirect) = facet.received(leaf, e.centroid);
    bulge > NOTABLE * luminance(direct + indirect)
}

/// Other regions' points that lie on this region's rings, and all regions' corners.
fn border_points(rings: &[crate::geom::Ring], points: &[Vec<DVec2>], own: usize, snap: f64) -> Vec<DVec2> {
    let others = points.iter().enumerate().filter(|&(i, _)| i != own).flat_map(|(_, p)| p);
    let edges: Vec<_> =
        rings.iter().flat_map(|r| (0..r.len()).map(|i| (r[i], r[(i + 1) % r.len()]))).collect();
    let is_on = |p: DVec2| {
        edges.iter().any(|&(a, b)| {
            p.cmpge(a.min(b) - snap).all()
                && p.cmple(a.max(b) + snap).all()
                && crate::geom::polygon::nearest_on_segment(a, b, p).distance(p) <= snap
        })
    };
    others.copied().filter(|&p| is_on(p)).collect()
}

/// The mean of what the leaves that touch `p` received there.
fn vertex(facets: &[&Facet], p: DVec2, snap: f64) -> MeshVertex {
    let (mut direct, mut indirect, mut count) = (DVec3::ZERO, DVec3::ZERO, 0.0);
    for facet in facets {
        for_each_leaf_at(facet, p, snap, &mut |leaf| {
            let (d, i) = facet.received(leaf, p);
            direct += d;
            indirect += i;
            count += 1.0;
        });
    }
    if count == 0.0 {
        // Rounding put it beside all leaves: the nearest facet answers.
        let nearest = facets.iter().min_by(|a, b| distance(a, p).total_cmp(&distance(b, p)));
        (direct, indirect) = nearest.map_or((DVec3::ZERO, DVec3::ZERO), |f| f.received(f.leaf_at(p), p));
        count = 1.0;
    }
    MeshVertex { position: p, direct: direct / count, indirect: indirect / count }
}

fn distance(facet: &Facet, p: DVec2) -> f64 {
    let root = &facet.elements[0];
    p.clamp(root.min, root.max).distance_squared(p)
}

fn for_each_leaf_at(facet: &Facet, p: DVec2, snap: f64, visit: &mut dyn FnMut(u32)) {
    let mut stack = vec![0];
    while let Some(element) = stack.pop() {
        let e = &facet.elements[element as usize];
        if p.cmpge(e.min - snap).all() && p.cmple(e.max + snap).all() {
            if e.is_leaf() {
                visit(element);
            } else {
                stack.extend(e.children());
            }
        }
    }
}
