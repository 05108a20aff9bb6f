//! Triangles of surfaces with several charts are cut along the charts' borders.
//!
//! Each triangle is cut on its own, so that triangles over each other or out of plane by a hair do no
//! harm; what must agree between neighbours is settled first. A place where a border meets an edge is a
//! number along that edge ([`edges::Edges`]), the same for all triangles that have the edge, and both
//! sides put a vertex there. Inside a triangle its edges (hard) and the borders (they bend by a hair to
//! meet vertices, so that no slivers are left) are arranged and triangulated like any other region of
//! the plane. No new vertex has a position of its own: all are weights of their triangle's corners.

mod borders;
mod divide;
mod edges;
mod mesh;
mod scene;

use glam::DVec2;

pub(super) use borders::Borders;
pub(super) use edges::Edges;
pub(super) use mesh::ChartedMesh;
pub(super) use scene::Cuts;

use self::divide::{Division, divide};
use crate::unwrap::Atlas;

/// What tells whether two corners are one: the bits of the position.
pub(super) type Place = [u64; 3];

/// A corner of a triangle that may be cut.
#[derive(Clone, Copy, Debug)]
pub(super) struct Corner {
    /// Corners with the same place bound the same edges.
    pub(super) place: Place,
    /// Plane coordinates in the surface's frame.
    pub(super) point: DVec2,
}

/// Triangles of one surface.
#[derive(Debug)]
pub(super) struct Sheet {
    /// Index into the surfaces.
    pub(super) surface: usize,
    /// Where one chart ends and another begins.
    pub(super) borders: Borders,
    /// The triangles.
    pub(super) triangles: Vec<[Corner; 3]>,
}

/// A triangle, or a part of one, that lies in one chart.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Piece {
    /// Its corners as weights of the triangle's corners, in the triangle's winding.
    pub(super) corners: [[f64; 3]; 3],
    /// The chart's index among those of the surface.
    pub(super) chart: usize,
}

impl Piece {
    /// All of a triangle.
    pub(super) const fn whole(chart: usize) -> Self {
        Self { corners: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], chart }
    }
}

/// After so many rounds edges are cut where a triangle says so, heard by the neighbour or not.
const MOST_ROUNDS: usize = 4;

/// The pieces of each triangle of each sheet, at least one; `edges` are cut further as need be.
pub(super) fn cut(atlas: &Atlas, sheets: &[Sheet], edges: &mut Edges) -> Vec<Vec<Vec<Piece>>> {
    for sheet in sheets {
        for triangle in &sheet.triangles {
            sheet.borders.meet(triangle, edges);
        }
    }
    let mut divisions: Vec<Vec<Division>> =
        sheets.iter().map(|sheet| vec![Division::default(); sheet.triangles.len()]).collect();
    for _ in 0..MOST_ROUNDS {
        let mut settled = true;
        for (sheet, divisions) in sheets.iter().zip(&mut divisions) {
            for (triangle, division) in sheet.triangles.iter().zip(divisions) {
                if division.outdated(triangle, edges) {
                    *division = divide(atlas, sheet, triangle, edges);
                    settled &= !division.report(triangle, sheet.borders.snap, edges);
                }
            }
        }
        if settled {
            break;
        }
    }
    divisions.into_iter().map(|list| list.into_iter().map(|division| division.pieces).collect()).collect()
}

/// The index, among the charts of `surface`, of the one that shows `point`.
pub(super) fn chart_index(atlas: &Atlas, surface: usize, point: DVec2) -> usize {
    let charts = atlas.charts_of(surface);
    match charts {
        [] | [_] => 0,
        _ => atlas
            .chart_at(surface, point)
            .and_then(|found| charts.iter().position(|chart| std::ptr::eq(chart, found)))
            .unwrap_or(0),
    }
}
