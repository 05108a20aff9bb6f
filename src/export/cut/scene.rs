//! The cuts of a scene's own triangles.

use std::collections::BTreeMap;

use super::super::Baked;
use super::{Borders, Corner, Edges, Piece, Place, Sheet, cut};
use crate::surface::Surface;

/// The pieces of the scene's triangles.
#[derive(Debug, Default)]
pub(in super::super) struct Cuts {
    /// Of the triangles that may have more than one.
    pieces: BTreeMap<usize, Vec<Piece>>,
}

const WHOLE: &[Piece] = &[Piece::whole(0)];

impl Cuts {
    /// Cuts the triangles of all surfaces that have several charts, and then those of other surfaces that
    /// share a cut edge with them: a vertex on one side only would show as a crack of single pixels.
    pub(in super::super) fn of(baked: &Baked) -> Self {
        let (mut cuts, mut edges) = (Self::default(), Edges::default());
        cuts.add(baked, &mut edges, true);
        if !cuts.pieces.is_empty() {
            cuts.add(baked, &mut edges, false);
        }
        cuts
    }

    /// Cuts triangles of the surfaces with several charts, or those of the others that `edges` touch.
    fn add(&mut self, baked: &Baked, edges: &mut Edges, several: bool) {
        let (mut sheets, mut indices) = (Vec::new(), Vec::new());
        for (surface, of) in baked.surfaces.iter().enumerate() {
            let charts = baked.atlas.charts_of(surface);
            if (charts.len() > 1) == several {
                let (own, triangles) = triangles(baked, of, |places| several || edges.touch(places));
                if !triangles.is_empty() {
                    indices.extend(own);
                    sheets.push(Sheet { surface, borders: Borders::of(of, charts), triangles });
                }
            }
        }
        let pieces = cut(baked.atlas, &sheets, edges).into_iter().flatten();
        self.pieces.extend(indices.into_iter().zip(pieces));
    }

    /// The pieces of a triangle; at least one.
    pub(in super::super) fn pieces(&self, triangle: usize) -> &[Piece] {
        self.pieces.get(&triangle).map_or(WHOLE, Vec::as_slice)
    }
}

/// A surface's triangles that are `wanted`, and their indices; those that are not there are left out.
fn triangles(
    baked: &Baked,
    surface: &Surface,
    wanted: impl Fn([Place; 3]) -> bool,
) -> (Vec<usize>, Vec<[Corner; 3]>) {
    let found = surface.source_triangles.iter().filter_map(|&index| {
        let vertices = baked.scene.triangles.get(index)?.vertices;
        let [a, b, c] = vertices.map(|vertex| baked.scene.vertices.get(vertex as usize));
        let corners = [*a?, *b?, *c?];
        // −0 is 0.
        let places = corners.map(|corner| (corner + 0.0).to_array().map(f64::to_bits));
        let corner = |i: usize| Corner { place: places[i], point: surface.frame.project(corners[i]) };
        wanted(places).then(|| (index, [corner(0), corner(1), corner(2)]))
    });
    found.unzip()
}
