//! Maximal connected coplanar groups of facets.
//!
//! A group grows from its largest facet across shared edges. Each further facet is measured against
//! that first one's plane, never against its neighbour's, so a finely tessellated cylinder, whose
//! neighbours differ by less than any tolerance, still falls apart. The tolerances follow what the
//! positions are exact to: a facet far from the first may stand off its plane by more, and a thin
//! facet's normal says less than a wide one's.

use std::collections::VecDeque;

use super::facet::{Facet, Facets};

/// Facets whose normals differ by more than this are not coplanar, radians; what noise adds comes on top.
const ANGLE: f64 = 1e-4;

/// How far off the first facet's plane a vertex may lie, per metre of distance from that facet's centre.
const SLOPE: f64 = 2e-5;

/// However thin it is, a facet turned by more than this belongs to another plane, radians.
const MOST_TILT: f64 = 0.5;

/// A set of facets, as ascending indices into [`Facets::facets`].
pub(super) type Group = Vec<usize>;

/// Groups all facets; in the order of their first facets.
pub(super) fn group(facets: &Facets) -> Vec<Group> {
    let mut seeds: Vec<usize> = (0..facets.facets.len()).collect();
    seeds.sort_by(|&a, &b| facets.facets[b].area.total_cmp(&facets.facets[a].area).then(a.cmp(&b)));
    let mut growth = Growth::new(facets);
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
    /// All half-edges in order of their ends: those from one vertex to another lie together.
    half_edges: Vec<HalfEdge>,
    /// The group that last used the half-edges starting here (at the first of equal ones).
    used_by: Vec<Option<usize>>,
    group_of: Vec<Option<usize>>,
}

impl<'a> Growth<'a> {
    fn new(facets: &'a Facets) -> Self {
        let mut half_edges = Vec::new();
        for (facet, f) in facets.facets.iter().enumerate() {
            for (&from, &to) in f.ring.iter().zip(f.ring.iter().cycle().skip(1)) {
                half_edges.push(HalfEdge { from, to, facet });
            }
        }
        half_edges.sort_by_key(|e| (e.from, e.to, e.facet));
        let used_by = vec![None; half_edges.len()];
        Self { facets, half_edges, used_by, group_of: vec![None; facets.facets.len()] }
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
        let plane = Plane::of(&facets.facets[seed], facets.noise);
        let mut members = Vec::new();
        let mut queue = VecDeque::new();
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
                        && self.is_free(edge.facet, group)
                    {
                        self.add(edge.facet, group);
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

/// The plane of a group's first facet.
struct Plane<'a> {
    first: &'a Facet,
    centre: glam::DVec3,
    slope: f64,
    noise: f64,
}

impl<'a> Plane<'a> {
    fn of(first: &'a Facet, noise: f64) -> Self {
        let [a, b, c] = first.points;
        let slope = SLOPE + (2.0 * noise / first.height).min(ANGLE);
        Self { first, centre: (a + b + c) / 3.0, slope, noise }
    }

    fn holds(&self, facet: &Facet) -> bool {
        let tilt = ANGLE.max((4.0 * self.noise / facet.height).min(MOST_TILT));
        let normal = self.first.normal;
        normal.dot(facet.normal) > 0.0
            && normal.cross(facet.normal).length() <= tilt
            && facet.points.iter().all(|&p| {
                let d = p - self.centre;
                d.dot(normal).abs() <= 2.0 * self.noise + self.slope * d.length()
            })
    }
}
