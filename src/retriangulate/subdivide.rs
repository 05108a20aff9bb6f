//! Constrained Delaunay triangulation of an arrangement: the one file that calls spade.
//!
//! Faces are told inside from outside by their winding number, carried from the outer face across
//! edges by a flood fill in index order; spade's own `excluded_faces` comes out in hash order.
//! L. P. Chew, "Constrained Delaunay Triangulations", Algorithmica 4, 1989.

use std::panic::{AssertUnwindSafe, catch_unwind};

use glam::DVec2;
use spade::handles::FixedVertexHandle;
use spade::{ConstrainedDelaunayTriangulation, HasPosition, Point2, Triangulation as _};

use super::arrange::{Arrangement, Edge};
use crate::geom::polygon;

/// A triangle inside the rings.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Face {
    /// Counter-clockwise indices into the vertices, the least first.
    pub(crate) corners: [u32; 3],
    /// The face across the edge from corner `k` to the next; `None` beyond the outline.
    pub(crate) neighbours: [Option<u32>; 3],
    /// Whether that edge is a contact edge.
    pub(crate) contacts: [bool; 3],
}

/// The inside of an arrangement as triangles.
#[derive(Clone, Debug, Default)]
pub(crate) struct Subdivision {
    /// Plane coordinates, metres.
    pub(crate) vertices: Vec<DVec2>,
    /// In ascending order of their corners.
    pub(crate) faces: Vec<Face>,
    /// What was left out: of the arrangement, and what spade refused.
    pub(crate) dropped: usize,
}

impl Subdivision {
    /// A face's corners.
    pub(crate) fn triangle(&self, face: &Face) -> [DVec2; 3] {
        face.corners.map(|c| self.vertices[c as usize])
    }
}

/// A vertex that knows its index in the arrangement.
struct Site {
    position: Point2<f64>,
    index: u32,
}

impl HasPosition for Site {
    type Scalar = f64;
    fn position(&self) -> Point2<f64> {
        self.position
    }
}

type Plane = ConstrainedDelaunayTriangulation<Site>;

/// What an edge of the triangulation is, seen along spade's own direction of it.
#[derive(Clone, Copy, Default)]
struct Mark {
    winding: i32,
    contact: bool,
}

/// Triangulates the inside of `arrangement`.
pub(crate) fn subdivide(arrangement: Arrangement) -> Subdivision {
    let Arrangement { vertices, edges, dropped } = arrangement;
    // spade asserts what it believes of its own state. A belief that fails must not end the bake.
    let attempt = catch_unwind(AssertUnwindSafe(|| inside_faces(&vertices, &edges)));
    match attempt {
        Ok((faces, refused)) => Subdivision { vertices, faces, dropped: dropped + refused },
        Err(_) => Subdivision { dropped: dropped + edges.len(), vertices, faces: Vec::new() },
    }
}

fn inside_faces(vertices: &[DVec2], edges: &[Edge]) -> (Vec<Face>, usize) {
    let sites = vertices
        .iter()
        .zip(0..)
        .map(|(p, index)| Site { position: spade::mitigate_underflow(Point2::new(p.x, p.y)), index })
        .collect();
    let Ok(mut plane) = Plane::bulk_load(sites) else { return (Vec::new(), edges.len()) };
    let (marks, refused) = constrain(&mut plane, vertices, edges);
    let windings =
        face_windings(&plane, &marks).unwrap_or_else(|| face_windings_by_point(&plane, vertices, edges));
    (collect_faces(&plane, &marks, &windings), refused)
}

/// Adds `edges`; gives the mark of each undirected edge and how many were refused.
fn constrain(plane: &mut Plane, vertices: &[DVec2], edges: &[Edge]) -> (Vec<Mark>, usize) {
    let mut handles: Vec<Option<FixedVertexHandle>> = vec![None; vertices.len()];
    for v in plane.vertices() {
        handles[v.data().index as usize] = Some(v.fix());
    }
    let mut marks = vec![Mark::default(); plane.num_undirected_edges()];
    let mut refused = 0;
    // Rings first: what they cross later is refused, not they.
    let (rings, contacts): (Vec<&Edge>, Vec<&Edge>) = edges.iter().partition(|e| e.winding != 0);
    for edge in rings.into_iter().chain(contacts) {
        let ends = (handles[edge.from as usize], handles[edge.to as usize]);
        let (Some(from), Some(to)) = ends else {
            refused += 1;
            continue;
        };
        let along = vertices[edge.to as usize] - vertices[edge.from as usize];
        let pieces = plane.try_add_constraint(from, to);
        if pieces.is_empty() {
            refused += 1;
        }
        for piece in pieces {
            let undirected = piece.as_undirected();
            let [a, b] = plane.directed_edge(undirected.as_directed()).positions();
            let forward = DVec2::new(b.x - a.x, b.y - a.y).dot(along) > 0.0;
            if let Some(mark) = marks.get_mut(undirected.index()) {
                mark.winding += if forward { edge.winding } else { -edge.winding };
                mark.contact |= edge.contact;
            }
        }
    }
    (marks, refused)
}

/// The winding number of each face by index (the outer face is 0 and has 0), or `None` where a lost
/// constraint makes the two ways round to a face disagree.
fn face_windings(plane: &Plane, marks: &[Mark]) -> Option<Vec<i32>> {
    let mut windings: Vec<Option<i32>> = vec![None; plane.num_all_faces()];
    windings[plane.outer_face().index()] = Some(0);
    let mut queue: Vec<_> = plane.convex_hull().map(|e| e.rev().fix()).collect();
    for edge in plane.convex_hull() {
        queue.push(edge.fix());
    }
    let mut next = 0;
    while next < queue.len() {
        // From the face on the right, known, to the face on the left.
        let edge = plane.directed_edge(queue[next]);
        next += 1;
        let (left, right) = (edge.face(), edge.rev().face());
        let Some(known) = windings[right.index()] else { continue };
        let undirected = edge.as_undirected().fix();
        let mark = marks[undirected.index()];
        let rise = if undirected.as_directed() == edge.fix() { mark.winding } else { -mark.winding };
        match windings[left.index()] {
            Some(winding) if winding == known + rise => {}
            Some(_) => return None,
            None => {
                windings[left.index()] = Some(known + rise);
                if let Some(face) = left.as_inner() {
                    queue.extend(face.adjacent_edges().map(|e| e.rev().fix()));
                }
            }
        }
    }
    Some(windings.into_iter().map(|w| w.unwrap_or(0)).collect())
}

/// As [`face_windings`] from each face's centre alone: slow, and indifferent to what was refused.
fn face_windings_by_point(plane: &Plane, vertices: &[DVec2], edges: &[Edge]) -> Vec<i32> {
    let mut windings = vec![0; plane.num_all_faces()];
    for face in plane.inner_faces() {
        let centre = face.center();
        let p = DVec2::new(centre.x, centre.y);
        for edge in edges.iter().filter(|e| e.winding != 0) {
            let (a, b) = (vertices[edge.from as usize], vertices[edge.to as usize]);
            // Upward edges to the right of the point count up, downward ones down.
            if (a.y > p.y) != (b.y > p.y) {
                let side = polygon::orient(a, b, p);
                if b.y > a.y && side > 0.0 {
                    windings[face.index()] += edge.winding;
                } else if b.y < a.y && side < 0.0 {
                    windings[face.index()] -= edge.winding;
                }
            }
        }
    }
    windings
}

fn collect_faces(plane: &Plane, marks: &[Mark], windings: &[i32]) -> Vec<Face> {
    let inside = |index: usize| windings.get(index).is_some_and(|&w| w > 0);
    let mut found: Vec<(Face, usize)> = Vec::new();
    for face in plane.inner_faces().filter(|f| inside(f.index())) {
        let edges = face.adjacent_edges();
        let ids = edges.map(|e| e.from().data().index);
        let first = (0..3).min_by_key(|&i| ids[i]).unwrap_or(0);
        let turned = [edges[first], edges[(first + 1) % 3], edges[(first + 2) % 3]];
        let beyond = turned.map(|e| e.rev().face().index());
        found.push((
            Face {
                corners: turned.map(|e| e.from().data().index),
                // spade's own index for now.
                neighbours: beyond.map(|i| inside(i).then_some(i as u32)),
                contacts: turned.map(|e| marks[e.as_undirected().fix().index()].contact),
            },
            face.index(),
        ));
    }
    found.sort_by_key(|(face, _)| face.corners);
    let mut renumbered = vec![None; windings.len()];
    for (new, (_, old)) in (0..).zip(&found) {
        renumbered[*old] = Some(new);
    }
    let renumber = |old: Option<u32>| old.and_then(|i| renumbered.get(i as usize).copied().flatten());
    found.into_iter().map(|(face, _)| Face { neighbours: face.neighbours.map(renumber), ..face }).collect()
}
