//! Rings, contact segments and points become vertices and edges that meet only at vertices.
//!
//! spade takes constraints that do not cross and vertices that are not too close to each other's
//! edges, so everything that could upset it is settled here, in rounds: a vertex near an edge becomes
//! a vertex of that edge, two edges that cross get a vertex where they do, until nothing changes.
//! Ring edges are hard: they are cut but never moved, so that no area is lost. Contact edges are soft:
//! they bend by up to `snap` to meet vertices and rings (snap rounding, after Hobby 1999, without its
//! fixed pixels).

use glam::DVec2;

use super::grid::{EdgeGrid, Extent, VertexGrid};
use crate::geom::{Ring, polygon};

/// What to arrange.
#[derive(Clone, Copy)]
pub(crate) struct PlaneInput<'a> {
    /// Outer rings and holes.
    pub(crate) rings: &'a [Ring],
    /// Lines that divide the region.
    pub(crate) contacts: &'a [[DVec2; 2]],
    /// Further vertices.
    pub(crate) points: &'a [DVec2],
    /// What is closer together than this is one, metres.
    pub(crate) snap: f64,
}

/// An edge between two vertices.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Edge {
    /// Index of the first vertex.
    pub(crate) from: u32,
    /// Index of the second vertex.
    pub(crate) to: u32,
    /// How much higher the rings' winding number is on the left; 0 for an edge of no ring.
    pub(crate) winding: i32,
    /// Whether a contact segment runs along it.
    pub(crate) contact: bool,
}

/// Vertices and edges that meet only at vertices, up to what rounding leaves.
#[derive(Clone, Debug, Default)]
pub(crate) struct Arrangement {
    /// Plane coordinates, metres; no two alike.
    pub(crate) vertices: Vec<DVec2>,
    /// Each pair of vertices at most once.
    pub(crate) edges: Vec<Edge>,
    /// Rings, segments and points left out because they were not finite or not a shape.
    pub(crate) dropped: usize,
}

/// After so many rounds the few crossings that snapping keeps making are left to spade to refuse.
const MOST_ROUNDS: usize = 8;

/// Two vertices or a vertex and a ring edge closer than this, against the extent, are one: what
/// projecting and crossing lose to rounding, with room to spare.
const ROUNDING: f64 = 1e-13;

/// Arranges `input`.
pub(crate) fn arrange(input: PlaneInput) -> Arrangement {
    let Some(mut builder) = Builder::with_rings(input) else {
        let dropped = input.rings.len() + input.contacts.len() + input.points.len();
        return Arrangement { dropped, ..Arrangement::default() };
    };
    for &segment in input.contacts {
        builder.add_contact(segment);
    }
    for &point in input.points {
        builder.add_point(point);
    }
    for _ in 0..MOST_ROUNDS {
        if !builder.cut() {
            break;
        }
    }
    Arrangement { vertices: builder.vertices, edges: builder.edges, dropped: builder.dropped }
}

struct Builder {
    vertices: Vec<DVec2>,
    edges: Vec<Edge>,
    known: VertexGrid,
    /// The rings as they came, for finding the ring edge near a point.
    ring_edges: Vec<[DVec2; 2]>,
    ring_grid: EdgeGrid,
    low: DVec2,
    high: DVec2,
    snap: f64,
    rounding: f64,
    dropped: usize,
}

/// Which vertices lie on one edge, with their place along it.
type Cuts = Vec<(f64, u32)>;

impl Builder {
    /// `None` where no ring has an extent that could be worked with.
    fn with_rings(input: PlaneInput) -> Option<Self> {
        let usable = |ring: &&Ring| ring.len() >= 3 && ring.iter().all(|p| p.is_finite());
        let rings: Vec<&Ring> = input.rings.iter().filter(usable).collect();
        let corners = || rings.iter().flat_map(|r| r.iter().copied());
        let (low, high) = corners()
            .fold((DVec2::INFINITY, DVec2::NEG_INFINITY), |(low, high), p| (low.min(p), high.max(p)));
        // spade takes coordinates between 2^-142 and 2^201 metres.
        let extent = (high - low).length();
        if !(extent > 1e-36 && low.abs().max(high.abs()).max_element() < 1e36) {
            return None;
        }
        let rounding = ROUNDING * low.abs().max(high.abs()).max_element().max(extent);
        let snap = if input.snap.is_finite() { input.snap.max(rounding) } else { rounding };
        let mut ring_edges = Vec::new();
        for ring in &rings {
            ring_edges.extend(ring.iter().zip(ring.iter().cycle().skip(1)).map(|(&a, &b)| [a, b]));
        }
        let ring_grid = EdgeGrid::new(Extent { low, high, margin: snap }, &ring_edges);
        let mut builder = Self {
            vertices: Vec::new(),
            edges: Vec::new(),
            known: VertexGrid::new(low, snap),
            ring_edges,
            ring_grid,
            low,
            high,
            snap,
            rounding,
            dropped: input.rings.len() - rings.len(),
        };
        for i in 0..builder.ring_edges.len() {
            let [a, b] = builder.ring_edges[i];
            let (from, to) = (builder.weld(a, rounding), builder.weld(b, rounding));
            builder.edges.push(Edge { from, to, winding: 1, contact: false });
        }
        builder.edges = merged(std::mem::take(&mut builder.edges));
        Some(builder)
    }

    /// The vertex within `radius` of `p`, or a new one.
    fn weld(&mut self, p: DVec2, radius: f64) -> u32 {
        if let Some(id) = self.known.nearest(&self.vertices, p, radius) {
            return id;
        }
        let id = self.vertices.len() as u32;
        self.vertices.push(p);
        self.known.insert(id, p);
        id
    }

    /// The vertex for a point that may move by `snap`: one that is there, or on a ring edge, or new.
    fn place(&mut self, p: DVec2) -> u32 {
        if let Some(id) = self.known.nearest(&self.vertices, p, self.snap) {
            return id;
        }
        let mut best = (self.snap, p);
        for &e in self.ring_grid.edges_near(p) {
            let [a, b] = self.ring_edges[e as usize];
            let foot = polygon::nearest_on_segment(a, b, p);
            if foot.distance(p) < best.0 {
                best = (foot.distance(p), foot);
            }
        }
        // Closer to the ring is also closer to the vertices on it.
        self.weld(best.1, if best.1 == p { self.rounding } else { self.snap })
    }

    fn add_point(&mut self, p: DVec2) {
        if !p.is_finite() {
            self.dropped += 1;
        } else if p.cmpge(self.low - self.snap).all() && p.cmple(self.high + self.snap).all() {
            self.place(p);
        }
    }

    fn add_contact(&mut self, [a, b]: [DVec2; 2]) {
        if !(a.is_finite() && b.is_finite()) {
            self.dropped += 1;
            return;
        }
        let Some([a, b]) = polygon::clip_segment(a, b, self.low, self.high) else { return };
        if self.runs_along_ring(a, b) {
            return;
        }
        let (from, to) = (self.place(a), self.place(b));
        if from != to {
            self.edges.push(Edge { from, to, winding: 0, contact: true });
        }
    }

    /// Whether both ends lie on one ring edge, so that the segment divides nothing.
    fn runs_along_ring(&self, a: DVec2, b: DVec2) -> bool {
        self.ring_grid.edges_near(a).iter().any(|&e| {
            let [c, d] = self.ring_edges[e as usize];
            [a, b].iter().all(|&p| polygon::nearest_on_segment(c, d, p).distance(p) <= self.snap)
        })
    }

    /// One round: finds all vertices on edges and all crossings, and cuts. `false` when there were none.
    fn cut(&mut self) -> bool {
        let segments: Vec<[DVec2; 2]> = self
            .edges
            .iter()
            .map(|e| [self.vertices[e.from as usize], self.vertices[e.to as usize]])
            .collect();
        let grid = EdgeGrid::new(Extent { low: self.low, high: self.high, margin: self.snap }, &segments);
        let mut cuts: Vec<Cuts> = vec![Vec::new(); self.edges.len()];
        self.find_vertices_on_edges(&segments, &grid, &mut cuts);
        self.find_crossings(&segments, &grid, &mut cuts);
        if cuts.iter().all(Vec::is_empty) {
            return false;
        }
        let mut pieces = Vec::with_capacity(self.edges.len() + cuts.len());
        for (edge, mut cuts) in self.edges.drain(..).zip(cuts) {
            cuts.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            let mut from = edge.from;
            for to in cuts.into_iter().map(|c| c.1).chain([edge.to]) {
                if from != to {
                    pieces.push(Edge { from, to, ..edge });
                    from = to;
                }
            }
        }
        self.edges = merged(pieces);
        true
    }

    fn tolerance(&self, edge: Edge) -> f64 {
        if edge.winding == 0 { self.snap } else { self.rounding }
    }

    fn find_vertices_on_edges(&self, segments: &[[DVec2; 2]], grid: &EdgeGrid, cuts: &mut [Cuts]) {
        for (id, &p) in self.vertices.iter().enumerate() {
            for &e in grid.edges_near(p) {
                let edge = self.edges[e as usize];
                let [a, b] = segments[e as usize];
                let tolerance = self.tolerance(edge);
                // What is that near an end of a contact edge is no more on it than the end is, and bending
                // there and back would go on for ever.
                let near_end = edge.winding == 0 && a.distance(p).min(b.distance(p)) <= tolerance;
                if !near_end && polygon::nearest_on_segment(a, b, p).distance(p) <= tolerance {
                    record(&mut cuts[e as usize], edge, segments[e as usize], (id as u32, p));
                }
            }
        }
    }

    fn find_crossings(&mut self, segments: &[[DVec2; 2]], grid: &EdgeGrid, cuts: &mut [Cuts]) {
        for cell in 0..grid.cell_count() {
            let here = grid.edges_in(cell);
            for (i, &e) in here.iter().enumerate() {
                for &f in &here[i + 1..] {
                    let Some(x) = crossing(segments[e as usize], segments[f as usize]) else { continue };
                    // Edges that share several cells are cut in the one where they cross.
                    if grid.cell_of(x) == cell {
                        self.cut_crossing([e, f], segments, cuts, x);
                    }
                }
            }
        }
    }

    fn cut_crossing(&mut self, pair: [u32; 2], segments: &[[DVec2; 2]], cuts: &mut [Cuts], x: DVec2) {
        let edges = pair.map(|e| self.edges[e as usize]);
        if [edges[0].from, edges[0].to].iter().any(|&v| v == edges[1].from || v == edges[1].to) {
            return;
        }
        let hard = (0..2).find(|&i| edges[i].winding != 0);
        let vertex = match hard {
            None => self.place(x),
            // A ring edge must not bend, so only vertices on it will do.
            Some(i) => {
                let on_ring = cuts[pair[i] as usize].iter().map(|c| c.1).chain([edges[i].from, edges[i].to]);
                let radius = self.tolerance(edges[1 - i]);
                let near = |v: &u32| self.vertices[*v as usize].distance(x) <= radius;
                on_ring.into_iter().find(near).unwrap_or_else(|| self.weld(x, self.rounding))
            }
        };
        let p = self.vertices[vertex as usize];
        for i in 0..2 {
            record(&mut cuts[pair[i] as usize], edges[i], segments[pair[i] as usize], (vertex, p));
        }
    }
}

/// Notes that `vertex` lies on `edge`, unless it is one of its ends.
fn record(cuts: &mut Cuts, edge: Edge, [a, b]: [DVec2; 2], (vertex, p): (u32, DVec2)) {
    if vertex != edge.from && vertex != edge.to && !cuts.iter().rev().take(4).any(|c| c.1 == vertex) {
        cuts.push(((p - a).dot(b - a) / (b - a).length_squared(), vertex));
    }
}

/// Where the insides of two segments cross.
fn crossing([a, b]: [DVec2; 2], [c, d]: [DVec2; 2]) -> Option<DVec2> {
    let (ca, cb) = (polygon::orient(c, d, a), polygon::orient(c, d, b));
    let (ac, ad) = (polygon::orient(a, b, c), polygon::orient(a, b, d));
    if ca * cb >= 0.0 || ac * ad >= 0.0 {
        return None;
    }
    Some(a.lerp(b, ca / (ca - cb)))
}

/// Each pair of vertices once; windings add up, and what bounds nothing goes.
fn merged(mut edges: Vec<Edge>) -> Vec<Edge> {
    edges.retain(|e| e.from != e.to);
    for e in &mut edges {
        if e.from > e.to {
            *e = Edge { from: e.to, to: e.from, winding: -e.winding, contact: e.contact };
        }
    }
    edges.sort_by_key(|e| (e.from, e.to));
    edges.dedup_by(|next, kept| {
        let same = (next.from, next.to) == (kept.from, kept.to);
        if same {
            kept.winding = kept.winding.saturating_add(next.winding);
            kept.contact |= next.contact;
        }
        same
    });
    edges.retain(|e| e.winding != 0 || e.contact);
    edges
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square(side: f64) -> Ring {
        vec![DVec2::ZERO, DVec2::new(side, 0.0), DVec2::new(side, side), DVec2::new(0.0, side)]
    }

    fn arranged(rings: &[Ring], contacts: &[[DVec2; 2]]) -> Arrangement {
        arrange(PlaneInput { rings, contacts, points: &[], snap: 1e-6 })
    }

    #[test]
    fn crossing_contacts_get_a_vertex() {
        let contacts =
            [[DVec2::new(0.25, 0.5), DVec2::new(0.75, 0.5)], [DVec2::new(0.5, 0.25), DVec2::new(0.5, 0.75)]];
        let result = arranged(&[square(1.0)], &contacts);
        assert_eq!(result.vertices.len(), 4 + 5);
        assert_eq!(result.edges.iter().filter(|e| e.contact).count(), 4);
    }

    /// A wall's foot, a hair inside or outside of the outline, divides nothing.
    #[test]
    fn contacts_along_the_ring_go() {
        for offset in [-5e-7, 0.0, 5e-7] {
            let contact = [DVec2::new(-0.5, offset), DVec2::new(0.6, offset)];
            let result = arranged(&[square(1.0)], &[contact]);
            assert_eq!((result.vertices.len(), result.edges.len()), (4, 4), "offset {offset}");
        }
    }

    #[test]
    fn a_contact_that_almost_reaches_the_ring_reaches_it() {
        let result = arranged(&[square(1.0)], &[[DVec2::new(0.5, 4e-7), DVec2::new(0.5, 1.0 - 4e-7)]]);
        assert_eq!(result.vertices.len(), 6);
        assert_eq!(result.edges.len(), 7);
        let area: f64 = result
            .edges
            .iter()
            .map(|e| {
                let (a, b) = (result.vertices[e.from as usize], result.vertices[e.to as usize]);
                f64::from(e.winding) * a.perp_dot(b) / 2.0
            })
            .sum();
        assert!((area - 1.0).abs() < 1e-14, "the ring was not moved");
    }

    #[test]
    fn rings_that_share_an_edge_in_both_directions_lose_it() {
        let (a, b, c, d) = (DVec2::ZERO, DVec2::X, DVec2::ONE, DVec2::Y);
        let result = arranged(&[vec![a, b, c], vec![a, c, d]], &[]);
        assert_eq!((result.vertices.len(), result.edges.len()), (4, 4));
    }

    #[test]
    fn what_is_not_finite_is_counted() {
        let rings = [square(1.0), vec![DVec2::NAN; 3]];
        let contacts = [[DVec2::new(f64::INFINITY, 0.0), DVec2::ONE]];
        let result =
            arrange(PlaneInput { rings: &rings, contacts: &contacts, points: &[DVec2::NAN], snap: 0.0 });
        assert_eq!((result.dropped, result.edges.len()), (3, 4));
        let nothing =
            arrange(PlaneInput { rings: &[], contacts: &[], points: &[DVec2::ONE], snap: f64::NAN });
        assert_eq!((nothing.dropped, nothing.vertices.len()), (1, 0));
    }
}
