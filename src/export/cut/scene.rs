//! The cuts of a scene's own triangles.

use std::collections::BTreeMap;

use super::super::Baked;
use super::{Borders, Corner, Piece, Sheet, cut};
use crate::surface::Surface;

/// The pieces of the scene's triangles.
#[derive(Debug, Default)]
pub(in super::super) struct Cuts {
    /// Of the triangles of surfaces with several charts.
    pieces: BTreeMap<usize, Vec<Piece>>,
}

impl Cuts {
    /// Cuts the triangles of all surfaces that have several charts.
    pub(in super::super) fn of(baked: &Baked) -> Self {
        let mut sheets = Vec::new();
        let mut indices = Vec::new();
        for (index, surface) in baked.surfaces.iter().enumerate() {
            let charts = baked.atlas.charts_of(index);
            if charts.len() > 1 {
                let (own, triangles) = triangles(baked, surface);
                indices.extend(own);
                sheets.push(Sheet { surface: index, borders: Borders::of(surface, charts), triangles });
            }
        }
        let pieces = cut(baked.atlas, &sheets).into_iter().flatten();
        Self { pieces: indices.into_iter().zip(pieces).collect() }
    }

    /// The pieces of a triangle of `surface`; at least one.
    pub(in super::super) fn pieces(&self, triangle: usize) -> &[Piece] {
        self.pieces.get(&triangle).map_or(WHOLE, Vec::as_slice)
    }
}

const WHOLE: &[Piece] = &[Piece::whole(0)];

/// A surface's triangles and their indices; those that are not there are left out.
fn triangles(baked: &Baked, surface: &Surface) -> (Vec<usize>, Vec<[Corner; 3]>) {
    let corner = |vertex: u32| {
        let world = baked.scene.vertices.get(vertex as usize)?;
        // −0 is 0.
        let place = (*world + 0.0).to_array().map(f64::to_bits);
        Some(Corner { place, point: surface.frame.project(*world) })
    };
    let found = surface.source_triangles.iter().filter_map(|&index| {
        let [a, b, c] = baked.scene.triangles.get(index)?.vertices.map(corner);
        Some((index, [a?, b?, c?]))
    });
    found.unzip()
}
