//! Packing by xatlas (J. Young, 2018, after the packer of thekla_atlas).
//!
//! xatlas only packs here. All charts go in as one UV mesh, in texels, one material per chart: a
//! UV mesh is split into charts by material and shared corners, and a mesh per chart would be
//! compared with all meshes before it. A chart's extents are whole texels already, so that
//! xatlas's own stretch to whole texels is the identity, and what it does to a chart is a shift by
//! whole texels, after a swap of the axes or not. That is read off the corners and checked.
//!
//! A rectangle goes in as two triangles. Other surfaces go in as their triangles, so that they can
//! nest, but only where these hold together by shared corners and none is a sliver (xatlas ignores
//! those); failing that, as their convex hull or their bounding rectangle.

use std::collections::BTreeMap;

use glam::DVec2;
use xatlas_rs::{ChartOptions, IndexData, MeshData, PackOptions, UvMeshDecl, Vertex};

use super::pack::{Packer, Page, Place, SizedShape, Turn};
use super::shape::Shape;
use crate::geom::polygon::orient;

/// A chart that fills more of its bounding rectangle goes in as that rectangle.
const RECTANGLE_SHARE: f64 = 0.9;

/// Triangles below twice this area are slivers, texels²; xatlas ignores them from 1.2e-7 downward.
const SLIVER: f64 = 1e-4;

/// Corners are known to xatlas as f32 within a page of up to 2^14 texels: half a unit is 2^-11.
const TOLERANCE: f64 = 4e-3;

/// What one pack may cost, charts × texels: xatlas tries every position for every chart, about
/// 0.3 s for this many.
const MOST_WORK: u64 = 120_000_000;

/// Nesting is tried where the bounding rectangles waste more than this share of their area. Below
/// it xatlas, which looks at the page's extent alone, packs no denser than the skyline does.
const LEAST_WASTE: f64 = 0.03;

/// The packer that lets charts nest.
#[derive(Clone, Copy, Debug)]
pub(super) struct Nesting(());

impl Nesting {
    /// The packer, where there is room for nesting and the search ends in reasonable time.
    pub(super) fn worthwhile(shapes: &[Shape], side: u32) -> Option<Self> {
        let work = (shapes.len() as u64).saturating_mul(u64::from(side) * u64::from(side));
        let area: f64 = shapes.iter().map(|s| s.area).sum();
        let bounds: f64 = shapes.iter().map(|s| s.extent.x * s.extent.y).sum();
        (area < (1.0 - LEAST_WASTE) * bounds && work <= MOST_WORK).then_some(Self(()))
    }
}

/// The charts as xatlas takes them.
#[derive(Debug, Default)]
struct Input {
    /// `(x, y)` pairs of f32 in texels, native byte order.
    bytes: Vec<u8>,
    /// Where each chart's corners begin, and the end.
    starts: Vec<usize>,
    indices: Vec<u32>,
    materials: Vec<u32>,
}

/// A chart's triangles, texels from the corner of its bounding rectangle.
struct Outline {
    corners: Vec<DVec2>,
    triangles: Vec<[u32; 3]>,
}

impl Packer for Nesting {
    fn pack(&self, charts: &[SizedShape<'_>], page: Page) -> Option<Vec<Place>> {
        if charts.is_empty() {
            return Some(Vec::new()); // xatlas's own empty lists are null
        }
        let outlines: Vec<_> = charts.iter().map(outline).collect();
        let input = Input::of(&outlines);
        let decl = UvMeshDecl {
            // Contiguous data of two floats would be counted as if it had three.
            vertex_uv_data: Some(MeshData::WithStride { data: &input.bytes, stride: 8 }),
            face_material_data: Some(&input.materials),
            index_data: Some(IndexData::U32(&input.indices)),
        };
        let mut xatlas = xatlas_rs::Xatlas::new();
        xatlas.add_uv_mesh(&decl).ok()?;
        xatlas.compute_charts(&ChartOptions::default());
        xatlas.pack_charts(&PackOptions {
            padding: page.padding,
            texels_per_unit: 1.0,
            resolution: page.side,
            bilinear: true,
            block_align: false,
            brute_force: true,
            create_image: false,
            rotate_charts_to_axis: false,
            rotate_charts: true,
            max_chart_size: 0,
        });
        if xatlas.atlas_count() != 1 || xatlas.chart_count() as usize != charts.len() {
            return None;
        }
        let meshes = xatlas.meshes();
        let vertices = &meshes.first()?.vertex_array;
        outlines
            .iter()
            .zip(input.starts.windows(2))
            .map(|(outline, range)| place(&outline.corners, vertices.get(range[0]..range[1])?))
            .collect()
    }
}

impl Input {
    fn of(outlines: &[Outline]) -> Self {
        let mut input = Self { starts: vec![0], ..Self::default() };
        for (material, outline) in outlines.iter().enumerate() {
            let start = input.starts.last().copied().unwrap_or(0);
            for corner in &outline.corners {
                input.bytes.extend((corner.x as f32).to_ne_bytes());
                input.bytes.extend((corner.y as f32).to_ne_bytes());
            }
            for triangle in &outline.triangles {
                input.indices.extend(triangle.map(|k| k + start as u32));
                input.materials.push(material as u32);
            }
            input.starts.push(start + outline.corners.len());
        }
        input
    }
}

/// What xatlas did to a chart: finds the shift and the turn, and checks every corner.
fn place(corners: &[DVec2], vertices: &[Vertex]) -> Option<Place> {
    let packed: Vec<DVec2> =
        vertices.iter().map(|v| DVec2::new(f64::from(v.uv[0]), f64::from(v.uv[1]))).collect();
    [Turn::Upright, Turn::Swapped].into_iter().find_map(|turn| {
        let turned = |p: DVec2| if turn == Turn::Swapped { DVec2::new(p.y, p.x) } else { p };
        let shift = (*packed.first()? - turned(*corners.first()?) - 0.5).round();
        let matches = packed.len() == corners.len()
            && shift.cmpge(DVec2::ZERO).all()
            && corners
                .iter()
                .zip(&packed)
                .all(|(&p, &q)| (turned(p) + shift + 0.5 - q).abs().max_element() < TOLERANCE);
        matches.then_some(Place { x: shift.x as u32, y: shift.y as u32, turn })
    })
}

/// The triangles by which a chart goes in: they cover it, hold together, and reach its extents.
fn outline(chart: &SizedShape<'_>) -> Outline {
    let (shape, scale) = (chart.shape, chart.scale());
    let size = DVec2::new(f64::from(chart.width), f64::from(chart.height));
    let to_texels = |p: DVec2| ((p - shape.corner) * scale).clamp(DVec2::ZERO, size) + 0.0; // no negative zeros
    let share = shape.area * scale.x * scale.y / (size.x * size.y);
    let bounds = [DVec2::ZERO, DVec2::new(size.x, 0.0), size, DVec2::new(0.0, size.y)];
    if share > RECTANGLE_SHARE {
        return fan(&bounds);
    }
    let triangles: Vec<_> = shape.triangles.iter().map(|t| t.map(to_texels)).collect();
    let candidates = [conforming(&triangles), hull(shape.convex_hull().into_iter().map(to_texels))];
    candidates.into_iter().flatten().find(|o| reaches(o, size)).unwrap_or_else(|| fan(&bounds))
}

/// Whether the corners span the chart's extents; xatlas would stretch the chart otherwise.
fn reaches(outline: &Outline, size: DVec2) -> bool {
    let low = outline.corners.iter().copied().fold(DVec2::INFINITY, DVec2::min);
    let high = outline.corners.iter().copied().fold(DVec2::NEG_INFINITY, DVec2::max);
    low == DVec2::ZERO && (high - size).abs().max_element() < 1e-6
}

fn fan(corners: &[DVec2]) -> Outline {
    let count = corners.len() as u32;
    Outline { corners: corners.to_vec(), triangles: (2..count).map(|k| [0, k - 1, k]).collect() }
}

fn hull(corners: impl Iterator<Item = DVec2>) -> Option<Outline> {
    let outline = fan(&corners.collect::<Vec<_>>());
    is_sound(&outline).then_some(outline)
}

/// Whether no triangle is a sliver.
fn is_sound(outline: &Outline) -> bool {
    let corner = |k: u32| outline.corners.get(k as usize).copied().unwrap_or_default();
    !outline.triangles.is_empty()
        && outline.triangles.iter().all(|t| orient(corner(t[0]), corner(t[1]), corner(t[2])).abs() > SLIVER)
}

/// The triangles with shared corners, if these join all of them into one and none is a sliver.
fn conforming(triangles: &[[DVec2; 3]]) -> Option<Outline> {
    let mut known = BTreeMap::new();
    let mut outline = Outline { corners: Vec::new(), triangles: Vec::new() };
    for triangle in triangles {
        let corners = triangle.map(|p| {
            *known.entry(((p.x as f32).to_bits(), (p.y as f32).to_bits())).or_insert_with(|| {
                outline.corners.push(p);
                outline.corners.len() as u32 - 1
            })
        });
        outline.triangles.push(corners);
    }
    (is_sound(&outline) && is_connected(&outline)).then_some(outline)
}

/// Whether one can walk from every triangle to every other over shared corners.
fn is_connected(outline: &Outline) -> bool {
    let mut parents: Vec<usize> = (0..outline.corners.len()).collect();
    let find = |parents: &mut Vec<usize>, mut k: usize| {
        while parents[k] != k {
            parents[k] = parents[parents[k]];
            k = parents[k];
        }
        k
    };
    let mut parts = outline.corners.len();
    for t in &outline.triangles {
        for (a, b) in [(t[0], t[1]), (t[1], t[2])] {
            let (a, b) = (find(&mut parents, a as usize), find(&mut parents, b as usize));
            if a != b {
                parents[a] = b;
                parts -= 1;
            }
        }
    }
    parts == 1
}
