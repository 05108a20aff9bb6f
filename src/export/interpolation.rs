//! Carrying the source's texture coordinates, colours and tangents over to other triangles of the same
//! surface.
//!
//! A corner of a new triangle takes its values from the source triangle that holds the corner,
//! moved a little towards the new triangle's middle: where texture coordinates jump along an edge of
//! the source, each side gets its own values. The weights are those of the corner itself, so that
//! values that are affine over the surface come out exactly.

use glam::{DVec2, DVec3, Vec3};

use super::document::{Object, index_of};
use super::{ExportError, accessor};
use crate::geom::polygon::orient;
use crate::scene::SourceDocument;

/// The most grid cells along a side: bounds the memory that slivers can take.
const SIDE_LIMIT: usize = 32;

/// The attribute that must stay a direction in the surface, with a sign.
const TANGENT: &str = "TANGENT";

/// How far towards its triangle's middle a corner is moved to choose a source triangle.
const NUDGE: f64 = 1e-3;

/// The interpolated attributes of a source primitive, one row of `width` numbers a vertex.
#[derive(Clone, Debug, Default)]
pub(super) struct Rows {
    /// Attribute names and their numbers of components, in the order of a row.
    pub(super) columns: Vec<(String, usize)>,
    /// Numbers of a row.
    pub(super) width: usize,
    values: Vec<f32>,
}

impl Rows {
    /// Reads `TEXCOORD_n`, `COLOR_n` and `TANGENT` of a primitive with `count` vertices.
    ///
    /// The lightmap's own set must be gone from `attributes`.
    pub(super) fn read(
        source: &SourceDocument,
        attributes: Option<&Object>,
        count: usize,
    ) -> Result<Self, ExportError> {
        let mut sets = Vec::new();
        for (name, value) in attributes.into_iter().flatten() {
            let (true, Some(accessor)) = (is_interpolated(name), index_of(Some(value))) else { continue };
            let elements = accessor::read(source, accessor, count)?;
            if (2..=4).contains(&elements.components) {
                sets.push((name.clone(), elements.components, elements.floats()));
            }
        }
        let width = sets.iter().map(|(_, components, _)| components).sum();
        let mut values = Vec::with_capacity(width * count);
        for vertex in 0..count {
            for (_, components, floats) in &sets {
                let start = vertex * components;
                values.extend(floats.get(start..start + components).into_iter().flatten());
            }
        }
        let columns = sets.into_iter().map(|(name, components, _)| (name, components)).collect();
        Ok(Self { columns, width, values })
    }

    /// Makes a row's tangent a unit vector at right angles to the unit `normal`, its fourth number 1 or −1.
    pub(super) fn settle_tangent(&self, row: &mut [f32], normal: Vec3) {
        let mut start = 0;
        for (name, components) in &self.columns {
            if let (TANGENT, Some([x, y, z, sign])) = (name.as_str(), row.get_mut(start..start + components))
            {
                let tangent = Vec3::new(*x, *y, *z).reject_from_normalized(normal);
                let tangent = tangent.try_normalize().unwrap_or_else(|| normal.any_orthonormal_vector());
                [*x, *y, *z] = tangent.to_array();
                *sign = if *sign < 0.0 { -1.0 } else { 1.0 };
            }
            start += components;
        }
    }

    /// One vertex's row.
    fn row(&self, vertex: u32) -> &[f32] {
        let start = (vertex as usize).saturating_mul(self.width);
        self.values.get(start..start.saturating_add(self.width)).unwrap_or_default()
    }
}

fn is_interpolated(name: &str) -> bool {
    name == TANGENT || name.starts_with("TEXCOORD_") || name.starts_with("COLOR_")
}

/// A source triangle in its surface's plane.
#[derive(Clone, Copy, Debug)]
pub(super) struct PlaneTriangle {
    /// Plane coordinates, metres.
    pub(super) corners: [DVec2; 3],
    /// The corners as source vertices.
    pub(super) vertices: [u32; 3],
}

impl PlaneTriangle {
    /// Barycentric weights of `p`; negative outside. `None` for a triangle without area.
    fn weights(&self, p: DVec2) -> Option<DVec3> {
        let [a, b, c] = self.corners;
        let weights = DVec3::new(orient(b, c, p), orient(c, a, p), orient(a, b, p)) / orient(a, b, c);
        weights.is_finite().then_some(weights)
    }
}

/// Finds the source triangle at a point of a surface: a grid of triangle lists.
#[derive(Debug)]
pub(super) struct Locator {
    triangles: Vec<PlaneTriangle>,
    cells: Vec<Vec<u32>>,
    low: DVec2,
    cell: DVec2,
    side: usize,
}

impl Locator {
    /// Sorts the triangles of one surface into a grid.
    pub(super) fn new(triangles: Vec<PlaneTriangle>) -> Self {
        let corners = triangles.iter().flat_map(|t| t.corners);
        let (low, high) =
            corners.fold((DVec2::INFINITY, DVec2::NEG_INFINITY), |(low, high), p| (low.min(p), high.max(p)));
        let side = ((triangles.len() as f64).sqrt() as usize).clamp(1, SIDE_LIMIT);
        let cell = (high - low) / side as f64;
        let mut locator = Self { cells: vec![Vec::new(); side * side], triangles, low, cell, side };
        for (index, triangle) in locator.triangles.iter().enumerate() {
            let cells = triangle.corners.map(|p| locator.cell_of(p));
            let least = cells.iter().fold((side, side), |m, c| (m.0.min(c.0), m.1.min(c.1)));
            let most = cells.iter().fold((0, 0), |m, c| (m.0.max(c.0), m.1.max(c.1)));
            for y in least.1..=most.1 {
                for x in least.0..=most.0 {
                    if let Some(list) = locator.cells.get_mut(y * side + x) {
                        list.push(index as u32);
                    }
                }
            }
        }
        locator
    }

    fn cell_of(&self, p: DVec2) -> (usize, usize) {
        let at = (p - self.low) / self.cell; // a cell without extent gives NaN, which casts to 0
        let clamp = |c: f64| (c as usize).min(self.side - 1);
        (clamp(at.x), clamp(at.y))
    }

    /// The triangle that holds `p`, or the one that it misses by the least share.
    fn find(&self, p: DVec2) -> Option<&PlaneTriangle> {
        let (x, y) = self.cell_of(p);
        let near = self.cells.get(y * self.side + x).into_iter().flatten();
        let near = near.filter_map(|&index| self.triangles.get(index as usize));
        best(near, p).or_else(|| best(self.triangles.iter(), p))
    }

    /// The row at `corner` of a triangle whose middle is `centre`; zeros where there is no source.
    pub(super) fn interpolate(&self, rows: &Rows, corner: DVec2, centre: DVec2) -> Vec<f32> {
        let found = self.find(corner.lerp(centre, NUDGE));
        let Some((triangle, weights)) = found.and_then(|t| Some((t, t.weights(corner)?))) else {
            return vec![0.0; rows.width];
        };
        let [a, b, c] = triangle.vertices.map(|vertex| rows.row(vertex));
        let mix = |((&a, &b), &c): ((&f32, &f32), &f32)| {
            DVec3::new(f64::from(a), f64::from(b), f64::from(c)).dot(weights) as f32
        };
        a.iter().zip(b).zip(c).map(mix).collect()
    }
}

/// The candidate whose least weight at `p` is greatest; the first one among equals.
fn best<'t>(candidates: impl Iterator<Item = &'t PlaneTriangle>, p: DVec2) -> Option<&'t PlaneTriangle> {
    let mut best: Option<(f64, &PlaneTriangle)> = None;
    for triangle in candidates {
        let Some(weights) = triangle.weights(p) else { continue };
        let least = weights.min_element();
        if best.is_none_or(|(known, _)| least > known) {
            best = Some((least, triangle));
        }
    }
    best.map(|(_, triangle)| triangle)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rounding of single-precision values of order 10.
    const ROUNDING: f32 = 1e-5;

    /// A strip of `n × n` squares over `[0, 10]²` whose first coordinate is `2 x + y`, and whose second
    /// jumps at x = 5: each side has vertices of its own.
    fn fixture(n: usize) -> (Locator, Rows) {
        let mut triangles = Vec::new();
        let mut values = Vec::new();
        let step = 10.0 / n as f64;
        for cell in 0..n * n {
            let low = DVec2::new((cell % n) as f64, (cell / n) as f64) * step;
            let corners = [low, low + DVec2::X * step, low + DVec2::splat(step), low + DVec2::Y * step];
            let first = (4 * cell) as u32;
            for p in corners {
                values.extend([(2.0 * p.x + p.y) as f32, if low.x < 5.0 { 0.0 } else { 1.0 }]);
            }
            for [a, b, c] in [[0, 1, 2], [0, 2, 3]] {
                let vertices = [a, b, c].map(|i| first + i as u32);
                triangles.push(PlaneTriangle { corners: [corners[a], corners[b], corners[c]], vertices });
            }
        }
        (Locator::new(triangles), Rows { columns: vec![("TEXCOORD_0".into(), 2)], width: 2, values })
    }

    /// An affine map comes out exactly wherever the corner lies, on a jump on the side of the triangle.
    #[test]
    fn affine_values_are_reproduced_and_jumps_kept() {
        for n in [1, 2, 10, 40] {
            let (locator, rows) = fixture(n);
            for (corner, centre) in
                [((5.0, 5.0), (4.0, 5.1)), ((5.0, 5.0), (6.0, 5.1)), ((0.0, 10.0), (0.1, 9.0))]
            {
                let (corner, centre) = (DVec2::from(corner), DVec2::from(centre));
                let row = locator.interpolate(&rows, corner, centre);
                assert!((row[0] - (2.0 * corner.x + corner.y) as f32).abs() < ROUNDING, "{n}: {row:?}");
                let side = if n > 1 && centre.x > 5.0 { 1.0 } else { 0.0 };
                assert_eq!(row[1], side, "{n} cells, {corner} seen from {centre}");
            }
        }
    }

    #[test]
    fn tangents_lie_in_the_surface() {
        let columns = vec![("COLOR_0".into(), 3), (TANGENT.into(), 4)];
        let rows = Rows { columns, width: 7, values: Vec::new() };
        for (tangent, expected) in [([0.6, 0.3, 0.0], [1.0, 0.0, 0.0]), ([0.0, -2.0, 1.0], [0.0, 0.0, 1.0])] {
            let mut row = vec![9.0, 8.0, 7.0, tangent[0], tangent[1], tangent[2], -0.3];
            rows.settle_tangent(&mut row, Vec3::Y);
            assert_eq!(row, [9.0, 8.0, 7.0, expected[0], expected[1], expected[2], -1.0]);
        }
        let mut along = vec![0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0];
        rows.settle_tangent(&mut along, Vec3::Y);
        assert!(Vec3::new(along[3], along[4], along[5]).is_normalized() && along[4] == 0.0);
    }

    #[test]
    fn nothing_to_find_gives_zeros() {
        let (_, rows) = fixture(1);
        assert_eq!(Locator::new(Vec::new()).interpolate(&rows, DVec2::ZERO, DVec2::ONE), [0.0; 2]);
        let flat = PlaneTriangle { corners: [DVec2::ONE; 3], vertices: [0; 3] };
        assert_eq!(Locator::new(vec![flat]).interpolate(&rows, DVec2::ZERO, DVec2::ONE), [0.0; 2]);
    }
}
