//! A group of facets becomes a frame and rings.

use glam::{DVec2, DVec3};

use super::boundary::trace_rings;
use super::facet::{Facet, Facets};
use crate::geom::{Frame, Ring, polygon};

/// A planar polygon in space.
#[derive(Clone, Debug)]
pub(super) struct Outline {
    /// The first axis follows the longest edge, whose start is the origin.
    pub(super) frame: Frame,
    /// Outer rings and holes, plane coordinates, metres; the one with the longest edge first, beginning there.
    pub(super) rings: Vec<Ring>,
    /// Square metres, above 0.
    pub(super) area: f64,
}

/// Rings may differ from the facets they outline by this share of the area.
const AREA_CHANGE: f64 = 1e-6;

/// Corners closer to the line between their neighbours than this, against the outline's size, are none.
const COLLINEAR: f64 = 1e-7;

/// Edges that differ by less than this share of their length count as equally long.
const SAME_LENGTH: f64 = 1e-6;

/// The outline of `members`, indices into `facets.facets`. `None` where they enclose no area.
///
/// The normal is the sum of the facets', weighted by area, so slivers do not sway it. Where the
/// boundary cannot be joined into rings of the right area (a group folded over itself), each facet
/// becomes a ring.
pub(super) fn outline(facets: &Facets, members: &[usize]) -> Option<Outline> {
    let members: Vec<&Facet> = members.iter().filter_map(|&m| facets.facets.get(m)).collect();
    let anchor = members.first()?.points[0];
    let mut normal = DVec3::ZERO;
    let mut centre = DVec3::ZERO;
    let mut area = 0.0;
    for f in &members {
        normal += f.normal * f.area;
        area += f.area;
        centre += (f.points.iter().map(|&p| p - anchor).sum::<DVec3>() / 3.0) * f.area;
    }
    // Divided first: the areas of tiny facets squared would underflow.
    let normal = (normal / area).try_normalize()?;
    let frame = Frame::new(anchor + centre / area, normal, members[0].points[1] - anchor);
    let expected: f64 = members.iter().map(|f| f.area * f.normal.dot(normal)).sum();

    let mut rings = boundary_rings(facets, &members, &frame);
    let enclosed = |rings: &[Vec<DVec3>]| {
        let project =
            |r: &Vec<DVec3>| polygon::signed_area(&r.iter().map(|&p| frame.project(p)).collect::<Ring>());
        rings.iter().map(project).sum::<f64>()
    };
    if (enclosed(&rings) - expected).abs() > AREA_CHANGE * expected {
        rings = members.iter().map(|f| f.points.to_vec()).collect();
    }
    let rings = rings.iter().map(|r| without_collinear_corners(r, &frame, facets.noise)).collect();
    let outline = framed(rings, &frame)?;
    (outline.area > 0.0 && outline.area.is_finite()).then_some(outline)
}

/// The group's boundary: edges whose other direction is not there too, joined into rings.
fn boundary_rings(facets: &Facets, members: &[&Facet], frame: &Frame) -> Vec<Vec<DVec3>> {
    let mut edges: Vec<(u32, u32)> = members
        .iter()
        .flat_map(|f| f.ring.iter().copied().zip(f.ring.iter().copied().cycle().skip(1)))
        .collect();
    edges.sort_unstable();
    let mut open: Vec<(u32, u32)> =
        edges.iter().copied().filter(|&(a, b)| edges.binary_search(&(b, a)).is_err()).collect();
    let mut vertices: Vec<u32> = open.iter().map(|e| e.0).collect();
    vertices.sort_unstable();
    vertices.dedup();
    let local = |v: u32| vertices.binary_search(&v).map_or(u32::MAX, |i| i as u32);
    for edge in &mut open {
        *edge = (local(edge.0), local(edge.1));
    }
    let places: Vec<DVec3> = vertices.iter().map(|&v| facets.positions[v as usize]).collect();
    let points: Vec<DVec2> = places.iter().map(|&p| frame.project(p)).collect();
    let rings = trace_rings(&points, open);
    rings
        .into_iter()
        .map(|r| r.into_iter().filter_map(|v| places.get(v as usize).copied()).collect())
        .collect()
}

fn without_collinear_corners(ring: &[DVec3], frame: &Frame, noise: f64) -> Vec<DVec3> {
    let flat: Ring = ring.iter().map(|&p| frame.project(p)).collect();
    let (low, high) =
        flat.iter().fold((DVec2::INFINITY, DVec2::NEG_INFINITY), |(low, high), &p| (low.min(p), high.max(p)));
    let tolerance = noise.max(COLLINEAR * (high - low).length());
    let corners = polygon::simplified_corners_keeping_area(&flat, tolerance, AREA_CHANGE / 4.0);
    corners.into_iter().map(|i| ring[i]).collect()
}

/// Gives the rings a frame along their longest edge; of equally long ones the one that starts first in
/// space, so that the choice does not depend on how the surface was cut into triangles.
fn framed(mut rings: Vec<Vec<DVec3>>, plane: &Frame) -> Option<Outline> {
    let edge = |ring: &Vec<DVec3>, i: usize| (ring[i], ring[(i + 1) % ring.len()]);
    let edges = || rings.iter().zip(0..).flat_map(|(ring, r)| (0..ring.len()).map(move |i| (r, i)));
    let length = |&(r, i): &(usize, usize)| {
        let (a, b) = edge(&rings[r], i);
        a.distance(b)
    };
    let longest = edges().map(|e| length(&e)).fold(0.0, f64::max);
    let start = |&(r, i): &(usize, usize)| rings[r][i].to_array();
    let first = edges()
        .filter(|e| length(e) >= longest * (1.0 - SAME_LENGTH))
        .min_by(|a, b| start(a).partial_cmp(&start(b)).unwrap_or(std::cmp::Ordering::Equal))?;
    let (from, to) = edge(&rings[first.0], first.1);
    let origin = from - plane.normal * plane.height(from);
    let frame = Frame::new(origin, plane.normal, to - from);

    rings[first.0].rotate_left(first.1);
    rings.swap(0, first.0);
    let mut rings: Vec<Ring> =
        rings.iter().map(|ring| ring.iter().map(|&p| frame.project(p)).collect()).collect();
    rings.retain(|r: &Ring| r.len() >= 3);
    if let Some((_, others)) = rings.split_first_mut() {
        for ring in others.iter_mut() {
            let least = (0..ring.len()).min_by(|&a, &b| by_place(ring[a], ring[b])).unwrap_or(0);
            ring.rotate_left(least);
        }
        others.sort_by(|a, b| by_place(a[0], b[0]));
    }
    let area = polygon::area(&rings);
    Some(Outline { frame, rings, area })
}

fn by_place(a: DVec2, b: DVec2) -> std::cmp::Ordering {
    a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y))
}
