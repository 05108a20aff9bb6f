//! Where the triangles' edges are cut, for all triangles that share an edge alike.

use std::collections::HashMap;

use glam::DVec2;

use super::{Corner, Place};

/// Cuts by edge, each as its share of the way from the edge's lesser place to the greater.
#[derive(Debug, Default)]
pub(in super::super) struct Edges {
    /// Only looked up, never walked, so the hash's order has no say. The shares ascend.
    cuts: HashMap<[Place; 2], Vec<f64>>,
}

/// An edge in its one direction: from the lesser place to the greater.
#[derive(Clone, Copy, Debug)]
pub(super) struct Edge {
    key: [Place; 2],
    /// Plane coordinates of the ends.
    pub(super) ends: [DVec2; 2],
    /// Whether the triangle runs along it the other way.
    turned: bool,
}

impl Edge {
    /// The edge from one corner of a triangle to another.
    pub(super) fn new(from: &Corner, to: &Corner) -> Self {
        let turned = from.place > to.place;
        let (low, high) = if turned { (to, from) } else { (from, to) };
        Self { key: [low.place, high.place], ends: [low.point, high.point], turned }
    }

    /// A share of the triangle's way along it as a share of the edge's own.
    pub(super) fn own_share(&self, share: f64) -> f64 {
        if self.turned { 1.0 - share } else { share }
    }

    /// The point at a share of the way: the same bits for both neighbours in a surface.
    fn at(&self, share: f64) -> DVec2 {
        self.ends[0] * (1.0 - share) + self.ends[1] * share
    }
}

/// A cut as a triangle that runs along the edge sees it.
#[derive(Clone, Copy, Debug)]
pub(super) struct EdgeCut {
    /// The weights of the corner where the triangle's edge begins and of the one where it ends.
    pub(super) weights: [f64; 2],
    /// Plane coordinates.
    pub(super) point: DVec2,
}

impl Edges {
    /// Cuts an edge, unless `radius` metres around the place there is an end of it or another cut.
    pub(super) fn insert(&mut self, edge: &Edge, share: f64, radius: f64) -> bool {
        let length = edge.ends[0].distance(edge.ends[1]);
        let inside = share * length > radius && (1.0 - share) * length > radius;
        if !(inside && length.is_finite()) {
            return false;
        }
        let cuts = self.cuts.entry(edge.key).or_default();
        let near = cuts.iter().any(|cut| (cut - share).abs() * length <= radius);
        if !near {
            cuts.insert(cuts.partition_point(|&cut| cut < share), share);
        }
        !near
    }

    /// Whether an edge of a triangle with corners at `places` is cut.
    pub(super) fn touch(&self, places: [Place; 3]) -> bool {
        let [a, b, c] = places;
        let cut = |a: Place, b: Place| self.cuts.contains_key(&[a.min(b), a.max(b)]);
        !self.cuts.is_empty() && (cut(a, b) || cut(b, c) || cut(c, a))
    }

    /// The number of cuts of an edge.
    pub(super) fn count(&self, edge: &Edge) -> usize {
        self.cuts.get(&edge.key).map_or(0, Vec::len)
    }

    /// The cuts of an edge in the order in which the triangle meets them.
    pub(super) fn along(&self, edge: &Edge) -> Vec<EdgeCut> {
        let cuts = self.cuts.get(&edge.key).map_or(&[][..], Vec::as_slice).iter();
        let mut cuts: Vec<EdgeCut> = cuts
            .map(|&share| {
                let (low, high) = (1.0 - share, share);
                let weights = if edge.turned { [high, low] } else { [low, high] };
                EdgeCut { weights, point: edge.at(share) }
            })
            .collect();
        if edge.turned {
            cuts.reverse();
        }
        cuts
    }
}

/// A triangle's edges, the `k`-th from corner `k` to the next.
pub(super) fn edges_of([a, b, c]: &[Corner; 3]) -> [Edge; 3] {
    [Edge::new(a, b), Edge::new(b, c), Edge::new(c, a)]
}
