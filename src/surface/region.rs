//! Contact edges cut a surface into regions.

use glam::DVec2;

use super::Region;
use super::boundary::trace_rings;
use super::dangling::extensions;
use crate::geom::{Ring, polygon};
use crate::retriangulate::{Arrangement, Face, PlaneInput, Subdivision, arrange, subdivide};

/// A surface to be cut.
pub(super) struct Cutting<'a> {
    /// Outline and holes.
    pub(super) rings: &'a [Ring],
    /// What they enclose, square metres.
    pub(super) area: f64,
    /// Contact segments.
    pub(super) contacts: &'a [[DVec2; 2]],
    /// What is closer together than this is one, metres.
    pub(super) snap: f64,
}

/// The parts of a surface.
pub(super) struct Parts {
    /// None where the rings overlap.
    pub(super) regions: Vec<Region>,
    /// Contact edges that were left out.
    pub(super) dropped: usize,
}

/// Triangles may differ from the rings by this share of the area.
const AREA_CHANGE: f64 = 1e-6;

/// A region below this share of its surface is part of a neighbour.
const LEAST_SHARE: f64 = 1e-9;

impl Cutting<'_> {
    /// The regions. Where cutting does not keep the area, the surface stays whole; where the rings
    /// themselves do not (they overlap each other), there are none.
    pub(super) fn cut(&self) -> Parts {
        if self.contacts.is_empty() {
            return Parts { regions: self.whole(), dropped: 0 };
        }
        let arrangement = self.arrange_with_extensions();
        if !arrangement.edges.iter().any(|e| e.contact) {
            return Parts { regions: self.whole(), dropped: arrangement.dropped };
        }
        let inside = subdivide(arrangement);
        let regions = self.components(&inside);
        let total: f64 = regions.iter().map(|r| r.area).sum();
        if (total - self.area).abs() <= AREA_CHANGE * self.area && !regions.is_empty() {
            Parts { regions, dropped: inside.dropped }
        } else {
            Parts { regions: self.whole(), dropped: self.contacts.len() }
        }
    }

    fn arrange_with_extensions(&self) -> Arrangement {
        let input = PlaneInput { rings: self.rings, contacts: self.contacts, points: &[], snap: self.snap };
        let arrangement = arrange(input);
        let further = extensions(&arrangement, self.rings, self.snap);
        if further.is_empty() {
            return arrangement;
        }
        let contacts: Vec<[DVec2; 2]> = self.contacts.iter().copied().chain(further).collect();
        arrange(PlaneInput { contacts: &contacts, ..input })
    }

    /// What the rings cover, each place once: rings that no longer overlap, and their area.
    pub(super) fn union(&self) -> (Vec<Ring>, f64) {
        let input = PlaneInput { rings: self.rings, contacts: &[], points: &[], snap: self.snap };
        let regions = self.components(&subdivide(arrange(input)));
        let area = regions.iter().map(|r| r.area).sum();
        (regions.into_iter().flat_map(|r| r.rings).collect(), area)
    }

    fn whole(&self) -> Vec<Region> {
        let triangles = match self.rings {
            [ring] if ring.len() == 3 => vec![[ring[0], ring[1], ring[2]]],
            _ => triangles_of(self.rings, self.snap),
        };
        if (area_of(&triangles) - self.area).abs() <= AREA_CHANGE * self.area {
            vec![Region { rings: self.rings.to_vec(), triangles, area: self.area }]
        } else {
            Vec::new()
        }
    }

    fn components(&self, inside: &Subdivision) -> Vec<Region> {
        let (component, count) = flood(&inside.faces);
        let component = self.without_tiny(inside, component, count);
        let mut edges: Vec<Vec<(u32, u32)>> = vec![Vec::new(); count];
        let mut triangles: Vec<Vec<[DVec2; 3]>> = vec![Vec::new(); count];
        for (face, &own) in inside.faces.iter().zip(&component) {
            triangles[own].extend(with_area(inside.triangle(face)));
            for k in 0..3 {
                if face.neighbours[k].is_none_or(|n| component[n as usize] != own) {
                    edges[own].push((face.corners[k], face.corners[(k + 1) % 3]));
                }
            }
        }
        edges.into_iter().zip(triangles).filter_map(|(e, t)| self.region(inside, e, t)).collect()
    }

    /// One component's region, with as few corners and triangles as will do.
    fn region(
        &self,
        inside: &Subdivision,
        edges: Vec<(u32, u32)>,
        triangles: Vec<[DVec2; 3]>,
    ) -> Option<Region> {
        let mut rings = Vec::new();
        let mut removed = false;
        for ring in trace_rings(&inside.vertices, edges) {
            let all: Ring = ring.iter().map(|&v| inside.vertices[v as usize]).collect();
            let kept = polygon::simplified_corners_keeping_area(&all, 0.25 * self.snap, 0.1 * AREA_CHANGE);
            removed |= kept.len() < all.len();
            rings.push(kept.into_iter().map(|i| all[i]).collect::<Ring>());
        }
        let area = polygon::area(&rings);
        if area <= 0.0 || area.is_nan() {
            return None;
        }
        if removed {
            let fewer = triangles_of(&rings, self.snap);
            if fewer.len() < triangles.len() && (area_of(&fewer) - area).abs() <= AREA_CHANGE * area {
                return Some(Region { rings, triangles: fewer, area });
            }
        }
        Some(Region { rings, triangles, area })
    }

    /// Gives the faces of components too small or too thin to matter to their largest neighbour.
    fn without_tiny(&self, inside: &Subdivision, mut component: Vec<usize>, count: usize) -> Vec<usize> {
        let mut area = vec![0.0; count];
        let mut perimeter = vec![0.0; count];
        let mut borders: Vec<(usize, usize)> = Vec::new();
        for (face, &own) in inside.faces.iter().zip(&component) {
            let corners = inside.triangle(face);
            area[own] += polygon::orient(corners[0], corners[1], corners[2]) / 2.0;
            for k in 0..3 {
                let other = face.neighbours[k].map(|n| component[n as usize]);
                if other != Some(own) {
                    perimeter[own] += corners[k].distance(corners[(k + 1) % 3]);
                    borders.extend(other.map(|o| (own, o)));
                }
            }
        }
        let least = |c: usize| (LEAST_SHARE * self.area).max(self.snap * perimeter[c]);
        let mut tiny: Vec<usize> = (0..count).filter(|&c| area[c] < least(c)).collect();
        if tiny.is_empty() {
            return component;
        }
        tiny.sort_by(|&a, &b| area[a].total_cmp(&area[b]).then(a.cmp(&b)));
        borders.sort_unstable();
        borders.dedup();
        let mut owner: Vec<usize> = (0..count).collect();
        for c in tiny {
            let first = borders.partition_point(|b| b.0 < c);
            let around = borders[first..].iter().take_while(|b| b.0 == c).map(|b| root(&owner, b.1));
            let own = root(&owner, c);
            let largest =
                around.filter(|&o| o != own).max_by(|&a, &b| area[a].total_cmp(&area[b]).then(b.cmp(&a)));
            if let Some(largest) = largest {
                area[largest] += area[own];
                owner[own] = largest;
            }
        }
        for c in &mut component {
            *c = root(&owner, *c);
        }
        component
    }
}

fn root(owner: &[usize], mut c: usize) -> usize {
    while owner[c] != c {
        c = owner[c];
    }
    c
}

/// The component of each face, in the order of their first faces, and how many there are.
fn flood(faces: &[Face]) -> (Vec<usize>, usize) {
    let mut component = vec![usize::MAX; faces.len()];
    let mut count = 0;
    let mut stack = Vec::new();
    for start in 0..faces.len() {
        if component[start] != usize::MAX {
            continue;
        }
        component[start] = count;
        stack.push(start);
        while let Some(at) = stack.pop() {
            for k in 0..3 {
                let Some(next) = faces[at].neighbours[k] else { continue };
                if !faces[at].contacts[k] && component[next as usize] == usize::MAX {
                    component[next as usize] = count;
                    stack.push(next as usize);
                }
            }
        }
        count += 1;
    }
    (component, count)
}

fn triangles_of(rings: &[Ring], snap: f64) -> Vec<[DVec2; 3]> {
    let inside = subdivide(arrange(PlaneInput { rings, contacts: &[], points: &[], snap }));
    inside.faces.iter().filter_map(|f| with_area(inside.triangle(f))).collect()
}

/// Leaves out what rounding makes of collinear vertices: a triangle without height.
fn with_area(triangle: [DVec2; 3]) -> Option<[DVec2; 3]> {
    const THINNEST: f64 = 1e-13;
    let [a, b, c] = triangle;
    let longest = (b - a).length_squared().max((c - b).length_squared()).max((a - c).length_squared());
    (polygon::orient(a, b, c) > THINNEST * longest).then_some(triangle)
}

fn area_of(triangles: &[[DVec2; 3]]) -> f64 {
    triangles.iter().map(|&[a, b, c]| polygon::orient(a, b, c) / 2.0).sum()
}
