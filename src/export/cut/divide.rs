//! One triangle, cut.

use glam::DVec2;

use super::edges::{Edges, edges_of};
use super::{Corner, Piece, Sheet, chart_index};
use crate::geom::Ring;
use crate::geom::polygon::{nearest_on_segment, orient};
use crate::retriangulate::{PlaneInput, arrange, subdivide};
use crate::unwrap::Atlas;

/// What a vertex may be off an edge and still be on it, against the snap: what rounding leaves.
const ON_EDGE: f64 = 1e-3;

/// The share of its area that a triangle may lose or gain by being cut.
const AREA: f64 = 1e-6;

/// What became of a triangle.
#[derive(Clone, Debug, Default)]
pub(super) struct Division {
    /// Its parts.
    pub(super) pieces: Vec<Piece>,
    /// How many vertices its boundary had.
    boundary: usize,
    /// Further cuts of its edges: the edge's number and the share of the triangle's way along it.
    further: Vec<(usize, f64)>,
}

impl Division {
    /// Whether the triangle's edges were cut anew since.
    pub(super) fn outdated(&self, triangle: &[Corner; 3], edges: &Edges) -> bool {
        self.boundary != 3 + edges_of(triangle).iter().map(|edge| edges.count(edge)).sum::<usize>()
    }

    /// Tells the edges of further cuts; says whether there were any.
    pub(super) fn report(&self, triangle: &[Corner; 3], snap: f64, edges: &mut Edges) -> bool {
        let own = edges_of(triangle);
        let mut new = false;
        for &(edge, share) in &self.further {
            if let Some(edge) = own.get(edge) {
                new |= edges.insert(edge, edge.own_share(share), ON_EDGE * snap);
            }
        }
        new
    }
}

/// A vertex of a triangle's boundary.
#[derive(Clone, Copy, Debug)]
struct Spot {
    weights: [f64; 3],
    point: DVec2,
}

/// Cuts `triangle` along the sheet's borders and at its edges' cuts.
pub(super) fn divide(atlas: &Atlas, sheet: &Sheet, triangle: &[Corner; 3], edges: &Edges) -> Division {
    let spots = boundary(triangle, edges);
    let corners = triangle.map(|corner| corner.point);
    let lines = lines(sheet, corners, &spots);
    let whole = Piece::whole(chart_index(atlas, sheet.surface, centre(corners)));
    let boundary = spots.len();
    if spots.len() == 3 && lines.is_empty() {
        return Division { pieces: vec![whole], boundary, further: Vec::new() };
    }
    let (pieces, further) = parts(atlas, sheet, corners, &spots, &lines);
    let area: f64 = pieces.iter().map(|piece| share_of_area(piece.corners)).sum();
    // Not of a triangle that has next to no area; there nobody sees how it is cut.
    let kept = (area - 1.0).abs() <= AREA;
    if !kept {
        return Division { pieces: vec![whole], boundary, further: Vec::new() };
    }
    Division { pieces, boundary, further }
}

/// The corners and the edges' cuts, in the triangle's order.
fn boundary(triangle: &[Corner; 3], edges: &Edges) -> Vec<Spot> {
    let mut spots = Vec::with_capacity(3);
    for (k, (corner, edge)) in triangle.iter().zip(edges_of(triangle)).enumerate() {
        let weights = |from: f64, to: f64| {
            let mut weights = [0.0; 3];
            weights[k] = from;
            weights[(k + 1) % 3] = to;
            weights
        };
        spots.push(Spot { weights: weights(1.0, 0.0), point: corner.point });
        for cut in edges.along(&edge) {
            spots.push(Spot { weights: weights(cut.weights[0], cut.weights[1]), point: cut.point });
        }
    }
    spots
}

/// The parts of the borders inside a triangle; they end inside of it or in its `spots`.
fn lines(sheet: &Sheet, corners: [DVec2; 3], spots: &[Spot]) -> Vec<[DVec2; 2]> {
    let snap = sheet.borders.snap;
    let end = |p: DVec2| {
        let near =
            (0..3).any(|k| nearest_on_segment(corners[k], corners[(k + 1) % 3], p).distance(p) <= snap);
        let nearest =
            spots.iter().min_by(|a, b| a.point.distance_squared(p).total_cmp(&b.point.distance_squared(p)));
        let reach = 2.0 * snap;
        nearest.filter(|spot| near && spot.point.distance(p) <= reach).ok_or(p)
    };
    let mut lines = Vec::new();
    for &[a, b] in &sheet.borders.segments {
        let Some([from, to]) = clip(corners, a, b) else { continue };
        match (end(from), end(to)) {
            (Ok(from), Ok(to)) => {
                // Along an edge there is nothing to cut.
                let along_edge = (0..3).any(|i| from.weights[i] == 0.0 && to.weights[i] == 0.0);
                if !along_edge && from.point != to.point {
                    lines.push([from.point, to.point]);
                }
            }
            (from, to) => {
                lines.push([from.map_or_else(|p| p, |s| s.point), to.map_or_else(|p| p, |s| s.point)]);
            }
        }
    }
    lines
}

/// What of a segment lies inside a triangle of either winding (Cyrus and Beck 1978).
fn clip(corners: [DVec2; 3], a: DVec2, b: DVec2) -> Option<[DVec2; 2]> {
    let sign = if orient(corners[0], corners[1], corners[2]) < 0.0 { -1.0 } else { 1.0 };
    let (mut enter, mut leave) = (0.0_f64, 1.0_f64);
    for k in 0..3 {
        let height = |p: DVec2| sign * orient(corners[k], corners[(k + 1) % 3], p);
        let (from, to) = (height(a), height(b));
        if from <= 0.0 && to <= 0.0 {
            return None;
        }
        if from < 0.0 {
            enter = enter.max(from / (from - to));
        }
        if to < 0.0 {
            leave = leave.min(from / (from - to));
        }
    }
    (enter < leave).then(|| [a.lerp(b, enter), if leave == 1.0 { b } else { a.lerp(b, leave) }])
}

/// The triangulated inside of `spots` with `lines` in it, and cuts of edges that are in no spot.
fn parts(
    atlas: &Atlas,
    sheet: &Sheet,
    corners: [DVec2; 3],
    spots: &[Spot],
    lines: &[[DVec2; 2]],
) -> (Vec<Piece>, Vec<(usize, f64)>) {
    let clockwise = orient(corners[0], corners[1], corners[2]) < 0.0;
    let mut ring: Ring = spots.iter().map(|spot| spot.point).collect();
    if clockwise {
        ring.reverse();
    }
    let snap = sheet.borders.snap;
    let inside = subdivide(arrange(PlaneInput { rings: &[ring], contacts: lines, points: &[], snap }));
    let mut further = Vec::new();
    let mut known: Vec<Option<[f64; 3]>> = vec![None; inside.vertices.len()];
    let mut pieces = Vec::with_capacity(inside.faces.len());
    for face in &inside.faces {
        let mut weights = face.corners.map(|corner| {
            let Some((&point, known)) =
                inside.vertices.get(corner as usize).zip(known.get_mut(corner as usize))
            else {
                return [0.0; 3];
            };
            *known.get_or_insert_with(|| {
                let spot = spots.iter().find(|spot| spot.point == point);
                spot.map_or_else(|| inner(corners, point, snap, &mut further), |spot| spot.weights)
            })
        });
        if clockwise {
            weights.swap(1, 2);
        }
        let chart = chart_index(atlas, sheet.surface, centre(inside.triangle(face)));
        pieces.push(Piece { corners: weights, chart });
    }
    (pieces, further)
}

/// The weights of a vertex that is none of the boundary's. One that lies on an edge all the same is
/// noted in `further`.
fn inner(corners: [DVec2; 3], point: DVec2, snap: f64, further: &mut Vec<(usize, f64)>) -> [f64; 3] {
    for k in 0..3 {
        let (from, to) = (corners[k], corners[(k + 1) % 3]);
        let foot = nearest_on_segment(from, to, point);
        if foot.distance(point) <= ON_EDGE * snap {
            further.push((k, foot.distance(from) / to.distance(from)));
        }
    }
    let [a, b, c] = corners;
    let parts = [orient(point, b, c), orient(a, point, c), orient(a, b, point)];
    let whole = orient(a, b, c);
    let parts = parts.map(|part| (part / whole).clamp(0.0, 1.0));
    let sum: f64 = parts.iter().sum();
    parts.map(|part| part / sum)
}

fn centre(corners: [DVec2; 3]) -> DVec2 {
    corners.iter().sum::<DVec2>() / 3.0
}

/// The area of a part as a share of the whole.
fn share_of_area([a, b, c]: [[f64; 3]; 3]) -> f64 {
    let side = |i: usize, j: usize| b[i] * c[j] - b[j] * c[i];
    a[0] * side(1, 2) + a[1] * side(2, 0) + a[2] * side(0, 1)
}
