//! Points on a boundary become corners of it.

use glam::DVec2;

use super::grid::{EdgeGrid, Extent};
use crate::geom::{Ring, polygon};

/// `rings` with each of `points` that lies within `snap` metres of an edge put into the nearest edge,
/// as its foot on it; points within `snap` of a corner add nothing. No area is gained or lost.
///
/// For neighbours that share an edge but cut it differently: with each other's corners put in, both
/// have the same ones. [`triangulate`](super::triangulate) does the same with the points it is given.
#[must_use]
pub fn conform(rings: &[Ring], points: &[DVec2], snap: f64) -> Vec<Ring> {
    let edges: Vec<[DVec2; 2]> = rings
        .iter()
        .flat_map(|ring| ring.iter().zip(ring.iter().cycle().skip(1)).map(|(&a, &b)| [a, b]))
        .collect();
    let bounds = edges
        .iter()
        .fold((DVec2::INFINITY, DVec2::NEG_INFINITY), |(low, high), e| (low.min(e[0]), high.max(e[0])));
    if edges.is_empty() || !(bounds.0.is_finite() && bounds.1.is_finite() && snap.is_finite()) {
        return rings.to_vec();
    }
    let snap = snap.max(0.0);
    let grid = EdgeGrid::new(Extent { low: bounds.0, high: bounds.1, margin: snap }, &edges);
    let mut inserted: Vec<Vec<(f64, DVec2)>> = vec![Vec::new(); edges.len()];
    for &p in points.iter().filter(|p| p.is_finite()) {
        let mut best: Option<(f64, u32, DVec2)> = None;
        for &e in grid.edges_near(p) {
            let [a, b] = edges[e as usize];
            let foot = polygon::nearest_on_segment(a, b, p);
            let distance = foot.distance(p);
            if distance <= snap && best.is_none_or(|b| distance < b.0) {
                best = Some((distance, e, foot));
            }
        }
        if let Some((_, e, foot)) = best {
            inserted[e as usize].push((foot.distance(edges[e as usize][0]), foot));
        }
    }
    let mut edge = 0;
    let mut out = Vec::with_capacity(rings.len());
    for ring in rings {
        let mut conformed = Ring::with_capacity(ring.len());
        for _ in ring {
            let [a, b] = edges[edge];
            let on_edge = &mut inserted[edge];
            on_edge.sort_by(|p, q| p.0.total_cmp(&q.0));
            conformed.push(a);
            let mut last = a;
            for &(_, p) in on_edge.iter() {
                if p.distance(last) > snap && p.distance(b) > snap {
                    conformed.push(p);
                    last = p;
                }
            }
            edge += 1;
        }
        out.push(conformed);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_enter_their_edge_in_order() {
        let square = vec![DVec2::ZERO, DVec2::X, DVec2::ONE, DVec2::Y];
        let points =
            [(0.7, 1e-7), (0.2, -1e-7), (0.7, 0.0), (1.0, 0.5), (0.5, 0.5), (1e-7, 1e-7), (f64::NAN, 0.0)]
                .map(DVec2::from);
        let result = conform(std::slice::from_ref(&square), &points, 1e-6);
        let expected = [(0.0, 0.0), (0.2, 0.0), (0.7, 0.0), (1.0, 0.0), (1.0, 0.5), (1.0, 1.0), (0.0, 1.0)];
        assert_eq!(result, [expected.map(DVec2::from).to_vec()]);
        assert!(conform(&[], &points, 1e-6).is_empty());
    }
}
