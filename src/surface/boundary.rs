//! From directed edges to rings.

use glam::DVec2;

/// Joins directed edges into closed rings of vertices.
///
/// `points` are the vertices' plane coordinates; each edge has the inside on its left, and as many
/// edges leave each vertex as arrive there. Where several do, the ring goes on along the edge that
/// bounds the same wedge of inside, so parts that touch in a vertex come out as rings of their own.
/// The rings' signed areas add up to the area inside. Begins at the least edge.
pub(super) fn trace_rings(points: &[DVec2], mut edges: Vec<(u32, u32)>) -> Vec<Vec<u32>> {
    edges.sort_unstable();
    let successor = successors(points, &edges);
    let mut done = vec![false; edges.len()];
    let mut rings = Vec::new();
    for start in 0..edges.len() {
        let mut ring = Vec::new();
        let mut at = start;
        while !done[at] {
            done[at] = true;
            ring.push(edges[at].0);
            let Some(next) = successor[at] else {
                ring.clear(); // an open chain bounds nothing
                break;
            };
            at = next;
        }
        if !ring.is_empty() {
            rings.push(ring);
        }
    }
    rings
}

/// For each edge the one that follows it; no edge follows two.
fn successors(points: &[DVec2], edges: &[(u32, u32)]) -> Vec<Option<usize>> {
    let mut taken = vec![false; edges.len()];
    let position = |v: u32| points.get(v as usize).copied().unwrap_or_default();
    edges
        .iter()
        .map(|&(from, at)| {
            let first = edges.partition_point(|e| e.0 < at);
            let leaving = (first..edges.len()).take_while(|&i| edges[i].0 == at);
            let back = position(from) - position(at);
            // Looking back along the edge, the inside begins clockwise of it.
            let turn = |i: usize| {
                let angle = -back.angle_to(position(edges[i].1) - position(at));
                if angle > 0.0 { angle } else { angle + std::f64::consts::TAU }
            };
            let next = leaving.filter(|&i| !taken[i]).min_by(|&i, &j| turn(i).total_cmp(&turn(j)))?;
            taken[next] = true;
            Some(next)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::polygon;

    fn rings_of(points: &[DVec2], triangles: &[[u32; 3]]) -> Vec<Vec<u32>> {
        let all: Vec<(u32, u32)> =
            triangles.iter().flat_map(|t| [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])]).collect();
        let open = all.iter().copied().filter(|&(a, b)| !all.contains(&(b, a))).collect();
        trace_rings(points, open)
    }

    #[test]
    fn triangles_that_touch_in_a_vertex_are_two_rings() {
        let points = [(0.0, 0.0), (-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(DVec2::from);
        let rings = rings_of(&points, &[[0, 1, 2], [0, 3, 4]]);
        assert_eq!(rings, [vec![0, 1, 2], vec![0, 3, 4]]);
    }

    /// Three of the four triangles around a square's centre, and the fourth, which closes it.
    #[test]
    fn a_fan_is_one_ring() {
        let points = [(0.0, 0.0), (-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(DVec2::from);
        let fan = [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 1]];
        assert_eq!(rings_of(&points, &fan[..3]).len(), 1);
        let closed = rings_of(&points, &fan);
        assert_eq!(closed, [vec![1, 2, 3, 4]]);
        let ring: Vec<DVec2> = closed[0].iter().map(|&v| points[v as usize]).collect();
        assert!((polygon::signed_area(&ring) - 4.0).abs() < 1e-15);
    }

    #[test]
    fn an_open_chain_is_no_ring() {
        let points = [DVec2::ZERO, DVec2::X, DVec2::Y];
        assert!(trace_rings(&points, vec![(0, 1), (1, 2)]).is_empty());
    }
}
