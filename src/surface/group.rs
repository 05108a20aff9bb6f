//! Maximal connected coplanar groups of facets.
//!
//! A group grows from its largest facet across shared edges. Each further facet is measured against
//! the plane of all before it, never against its neighbour's, so a finely tessellated cylinder, whose
//! neighbours differ by less than any tolerance, still falls apart. The tolerances follow what the
//! positions are exact to: a thin facet's normal says less than a wide one's. Where texture coordinates are kept,
//! a group ends where their map changes.

use std::collections::VecDeque;

use glam::{DVec2, DVec3};

use super::facet::{Facet, Facets};
use super::layout::FacetLayout;
use crate::geom::{Frame, polygon};

/// Facets whose normals differ by more than this are not coplanar, radians; what noise adds comes on top.
const ANGLE: f64 = 1e-4;

/// How far off the group's plane a vertex may lie, per metre of distance from the group's centre.
const SLOPE: f64 = 1e-5;

/// However thin it is, a facet turned by more than this belongs to another plane, radians.
const MOST_TILT: f64 = 0.25;

/// A set of facets, as ascending indices into [`Facets::facets`].
pub(super) type Group = Vec<usize>;

/// What two facets of one group must not share.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Apart {
    /// A side of an edge. Enough for all but strange surfaces.
    Edges,
    /// Area, either: for surfaces found to lie over themselves. Takes time with the group's size squared.
    Areas,
}

/// Groups all facets; in the order of their first facets.
pub(super) fn group(facets: &Facets, apart: Apart) -> Vec<Group> {
    let mut seeds: Vec<usize> = (0..facets.facets.len()).collect();
    seeds.sort_by(|&a, &b| facets.facets[b].area.total_cmp(&facets.facets[a].area).then(a.cmp(&b)));
    let mut growth = Growth::new(facets, apart);
    let mut groups: Vec<Group> = Vec::new();
    for seed in seeds {
        if growth.group_of[seed].is_none() {
            groups.push(growth.grow(seed, groups.len()));
        }
    }
    groups.sort_by_key(|g| g.first().copied());
    groups
}

/// A directed edge of a facet.
#[derive(Clone, Copy)]
struct HalfEdge {
    from: u32,
    to: u32,
    facet: usize,
}

struct Growth<'a> {
    facets: &'a Facets,
    apart: Apart,
    /// All half-edges in order of their ends: those from one vertex to another lie together.
    half_edges: Vec<HalfEdge>,
    /// The group that last used the half-edges starting here (at the first of equal ones).
    used_by: Vec<Option<usize>>,
    group_of: Vec<Option<usize>>,
}

impl<'a> Growth<'a> {
    fn new(facets: &'a Facets, apart: Apart) -> Self {
        let mut half_edges = Vec::new();
        for (facet, f) in facets.facets.iter().enumerate() {
            for (&from, &to) in f.ring.iter().zip(f.ring.iter().cycle().skip(1)) {
                half_edges.push(HalfEdge { from, to, facet });
            }
        }
        half_edges.sort_by_key(|e| (e.from, e.to, e.facet));
        let used_by = vec![None; half_edges.len()];
        Self { facets, apart, half_edges, used_by, group_of: vec![None; facets.facets.len()] }
    }

    /// Where the half-edges from one vertex to another begin, if there are any.
    fn first(&self, from: u32, to: u32) -> Option<usize> {
        let at = self.half_edges.partition_point(|e| (e.from, e.to) < (from, to));
        self.half_edges.get(at).filter(|e| (e.from, e.to) == (from, to)).map(|_| at)
    }

    fn edges(ring: &[u32]) -> impl Iterator<Item = (u32, u32)> + '_ {
        ring.iter().copied().zip(ring.iter().copied().cycle().skip(1))
    }

    fn grow(&mut self, seed: usize, group: usize) -> Group {
        let facets = self.facets;
        let mut plane = Plane::of(&facets.facets[seed], facets.noise);
        let mut members = Vec::new();
        let mut queue = VecDeque::new();
        let mut covered = Covered::by(&facets.facets[seed], facets.noise);
        let layout = FacetLayout::of(&facets.facets[seed]);
        self.add(seed, group);
        queue.push_back(seed);
        while let Some(current) = queue.pop_front() {
            members.push(current);
            for (from, to) in Self::edges(&facets.facets[current].ring) {
                // Across an edge, a facet of the same side runs the other way.
                let Some(start) = self.first(to, from) else { continue };
                let mut at = start;
                while let Some(&edge) = self.half_edges.get(at).filter(|e| (e.from, e.to) == (to, from)) {
                    at += 1;
                    if self.group_of[edge.facet].is_none()
                        && plane.holds(&facets.facets[edge.facet])
                        && layout.as_ref().is_none_or(|layout| layout.goes_on(&facets.facets[edge.facet]))
                        && self.is_free(edge.facet, group)
                        && (self.apart == Apart::Edges || covered.add(&facets.facets[edge.facet]))
                    {
                        self.add(edge.facet, group);
                        plane.add(&facets.facets[edge.facet]);
                        queue.push_back(edge.facet);
                    }
                }
            }
        }
        members.sort_unstable();
        members
    }

    /// Whether the group has none of the facet's half-edges yet. A second facet on one side of an edge
    /// is a duplicate and would count twice.
    fn is_free(&self, facet: usize, group: usize) -> bool {
        Self::edges(&self.facets.facets[facet].ring)
            .all(|(from, to)| self.first(from, to).is_none_or(|at| self.used_by[at] != Some(group)))
    }

    fn add(&mut self, facet: usize, group: usize) {
        self.group_of[facet] = Some(group);
        let facets = self.facets;
        for (from, to) in Self::edges(&facets.facets[facet].ring) {
            if let Some(at) = self.first(from, to) {
                self.used_by[at] = Some(group);
            }
        }
    }
}

/// The places that a group covers, in the frame of its first facet.
struct Covered {
    frame: Frame,
    noise: f64,
    triangles: Vec<[DVec2; 3]>,
}

impl Covered {
    fn by(first: &Facet, noise: f64) -> Self {
        let frame = Frame::new(first.points[0], first.normal, first.points[1] - first.points[0]);
        Self { frame, noise, triangles: vec![first.points.map(|p| frame.project(p))] }
    }

    /// Adds a facet, unless it lies over another by more than noise.
    fn add(&mut self, facet: &Facet) -> bool {
        let triangle = facet.points.map(|p| self.frame.project(p));
        let free = self
            .triangles
            .iter()
            .all(|&other| separated(triangle, other, self.noise) || separated(other, triangle, self.noise));
        if free {
            self.triangles.push(triangle);
        }
        free
    }
}

/// Whether one of the counter-clockwise `triangle`'s sides has all of `other` outside, up to `slack` metres.
fn separated(triangle: [DVec2; 3], other: [DVec2; 3], slack: f64) -> bool {
    (0..3).any(|k| {
        let (a, b) = (triangle[k], triangle[(k + 1) % 3]);
        let side = a.distance(b);
        other.iter().all(|&p| polygon::orient(a, b, p) <= slack * side)
    })
}

/// The plane through the facets that a group has so far.
struct Plane<'a> {
    first: &'a Facet,
    noise: f64,
    /// The sum of the facets' normals times their areas. It depends on the group's boundary only, so
    /// it grows more exact with the group, however noisy its thin facets are.
    normals: DVec3,
    /// The sum of the facets' centres, from the first one's first corner, times their areas.
    centres: DVec3,
    area: f64,
}

impl<'a> Plane<'a> {
    fn of(first: &'a Facet, noise: f64) -> Self {
        let mut plane = Self { first, noise, normals: DVec3::ZERO, centres: DVec3::ZERO, area: 0.0 };
        plane.add(first);
        plane
    }

    fn add(&mut self, facet: &Facet) {
        let anchor = self.first.points[0];
        self.normals += facet.normal * facet.area;
        self.centres += facet.points.iter().map(|&p| p - anchor).sum::<DVec3>() * (facet.area / 3.0);
        self.area += facet.area;
    }

    fn holds(&self, facet: &Facet) -> bool {
        let Some(normal) = (self.normals / self.area).try_normalize() else { return false };
        let centre = self.first.points[0] + self.centres / self.area;
        let agrees = |other: &Facet| {
            normal.dot(other.normal) > 0.0 && normal.cross(other.normal).length() <= self.tilt(other)
        };
        agrees(facet)
            && agrees(self.first)
            && facet.points.iter().all(|&p| {
                let d = p - centre;
                d.dot(normal).abs() <= 2.0 * self.noise + SLOPE * d.length()
            })
    }

    /// By how much a facet may be turned against the plane that it lies in, radians.
    fn tilt(&self, facet: &Facet) -> f64 {
        ANGLE.max((4.0 * self.noise / facet.height).min(MOST_TILT))
    }
}
