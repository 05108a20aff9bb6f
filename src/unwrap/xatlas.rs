//! Packing by xatlas (J. Young, 2018, after the packer of thekla_atlas).
//!
//! xatlas only packs here. All charts go in as one UV mesh, in texels, one material per chart: a
//! UV mesh is split into charts by material and shared corners, and a mesh per chart would be
//! compared with all meshes before it. A chart's extents are whole texels already, so that
//! xatlas's own stretch to whole texels is the identity, and what it does to a chart is a shift by
//! whole texels, after a swap of the axes or not.
//!
//! That is read off the image in which xatlas notes every texel's chart. Its output vertices would
//! say the same, but xatlas leaves the type of a UV mesh's charts uninitialized, and `xatlas_rs`
//! panics on types that it does not know before it hands the vertices out.
//!
//! A rectangle goes in as two triangles. Other surfaces go in as their triangles, so that they can
//! nest, but only where these hold together by shared corners and none is a sliver (xatlas ignores
//! those); failing that, as their convex hull or their bounding rectangle.

use std::collections::BTreeMap;

use glam::DVec2;
use xatlas_rs::{ChartOptions, IndexData, MeshData, PackOptions, UvMeshDecl};

use super::footprint::{Span, spans};
use super::pack::{Packer, Page, Place, SizedShape, Turn};
use super::shape::Shape;
use crate::geom::disjoint::root;
use crate::geom::polygon::orient;

/// A chart that fills more of its bounding rectangle goes in as that rectangle.
const RECTANGLE_SHARE: f64 = 0.9;

/// Triangles below twice this area are slivers, texels²; xatlas ignores them from 1.2e-7 downward.
const SLIVER: f64 = 1e-4;

/// A texel of xatlas's image: the chart's index,
const CHART_MASK: u32 = 0x1fff_ffff;
/// and what it is to the chart; only this bit set where the chart's triangles meet the texel's square,
const IS_CHART: u32 = 0x8000_0000;
/// others where it is there for bilinear lookups or for padding.
const KIND_MASK: u32 = 0xe000_0000;

/// What one pack may cost, charts × texels: xatlas tries every position for every chart, about
/// 0.3 s for this many.
const MOST_WORK: u64 = 120_000_000;

/// Nesting is tried where the bounding rectangles waste more than this share of their area. Below
/// it xatlas, which looks at the page's extent alone, packs no denser than rectangles lie.
const LEAST_WASTE: f64 = 0.03;

/// The packer that lets charts nest.
#[derive(Clone, Copy, Debug)]
pub(super) struct Nesting(());

impl Nesting {
    /// The packer, where there is room for nesting and the search ends in reasonable time.
    pub(super) fn worthwhile(shapes: &[Shape], page: Page) -> Option<Self> {
        let texels = u64::from(page.width) * u64::from(page.height);
        let work = (shapes.len() as u64).saturating_mul(texels);
        let area: f64 = shapes.iter().map(Shape::weighed_area).sum();
        let bounds: f64 = shapes.iter().map(|s| (s.extent * s.weight).element_product()).sum();
        // xatlas knows no cells.
        let is_free = page.gutter.align == 1;
        (is_free && area < (1.0 - LEAST_WASTE) * bounds && work <= MOST_WORK).then_some(Self(()))
    }
}

/// The charts as xatlas takes them.
#[derive(Debug, Default)]
struct Input {
    /// `(x, y)` pairs of f32 in texels, native byte order.
    bytes: Vec<u8>,
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
        if page.width != page.height {
            return None; // xatlas knows square pages only
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
            // On either side.
            padding: page.gutter.gap.div_ceil(2),
            texels_per_unit: 1.0,
            resolution: page.width,
            bilinear: true,
            block_align: false,
            brute_force: true,
            create_image: true,
            rotate_charts_to_axis: false,
            rotate_charts: true,
            max_chart_size: 0,
        });
        if xatlas.atlas_count() != 1 || xatlas.chart_count() as usize != charts.len() {
            return None;
        }
        let image = Image { texels: xatlas.image()?, width: xatlas.width() as usize };
        let corners = image.corners(charts.len());
        let placed = outlines.iter().zip(charts).zip(corners).enumerate();
        placed
            .map(|(index, ((outline, chart), corner))| image.place((index, chart), outline, corner?))
            .collect()
    }
}

/// Which texel belongs to which chart, by xatlas.
struct Image<'a> {
    texels: &'a [u32],
    width: usize,
}

impl Image<'_> {
    /// Each chart's least column and row.
    fn corners(&self, charts: usize) -> Vec<Option<(u32, u32)>> {
        let mut corners = vec![None; charts];
        for (y, row) in (0u32..).zip(self.texels.chunks_exact(self.width.max(1))) {
            for (x, &texel) in (0u32..).zip(row) {
                if texel & KIND_MASK != IS_CHART {
                    continue;
                }
                if let Some(corner) = corners.get_mut((texel & CHART_MASK) as usize) {
                    let (least_x, least_y) = corner.unwrap_or((x, y));
                    *corner = Some((least_x.min(x), least_y.min(y)));
                }
            }
        }
        corners
    }

    /// The place, at `corner`, of which the image shows more texels. The caller checks it.
    fn place(
        &self,
        (index, chart): (usize, &SizedShape<'_>),
        outline: &Outline,
        corner: (u32, u32),
    ) -> Option<Place> {
        let at = |turn| Place { x: corner.0, y: corner.1, turn };
        let shown = |turn| {
            let triangles = outline.placed(at(turn));
            let spans = triangles.flat_map(|t| spans(t, 0.5, (0, i64::from(super::pack::LARGEST_SIDE))));
            spans.map(|span| self.count(index, &span)).sum::<usize>()
        };
        let (upright, swapped) = (shown(Turn::Upright), shown(Turn::Swapped));
        let fits = upright.max(swapped) > chart.width.min(chart.height) as usize;
        fits.then(|| at(if upright >= swapped { Turn::Upright } else { Turn::Swapped }))
    }

    /// How many texels of the span the chart's triangles meet.
    fn count(&self, index: usize, span: &Span) -> usize {
        let row = span.y as usize * self.width;
        let columns =
            row + span.first.max(0) as usize..row + (span.last + 1).clamp(0, self.width as i64) as usize;
        let texels = self.texels.get(columns).unwrap_or_default();
        texels.iter().filter(|&&t| t & KIND_MASK == IS_CHART && (t & CHART_MASK) as usize == index).count()
    }
}

impl Outline {
    /// The triangles in the page.
    fn placed(&self, place: Place) -> impl Iterator<Item = [DVec2; 3]> + '_ {
        let shift = DVec2::new(f64::from(place.x), f64::from(place.y)) + 0.5;
        self.triangles.iter().map(move |t| {
            t.map(|k| {
                let p = self.corners.get(k as usize).copied().unwrap_or_default();
                shift + if place.turn == Turn::Swapped { DVec2::new(p.y, p.x) } else { p }
            })
        })
    }
}

impl Input {
    fn of(outlines: &[Outline]) -> Self {
        let mut input = Self::default();
        let mut start = 0;
        for (material, outline) in outlines.iter().enumerate() {
            for corner in &outline.corners {
                input.bytes.extend((corner.x as f32).to_ne_bytes());
                input.bytes.extend((corner.y as f32).to_ne_bytes());
            }
            for triangle in &outline.triangles {
                input.indices.extend(triangle.map(|k| k + start));
                input.materials.push(material as u32);
            }
            start += outline.corners.len() as u32;
        }
        input
    }
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
    let mut parts = outline.corners.len();
    for t in &outline.triangles {
        for (a, b) in [(t[0], t[1]), (t[1], t[2])] {
            let (a, b) = (root(&mut parents, a as usize), root(&mut parents, b as usize));
            if a != b {
                parents[a] = b;
                parts -= 1;
            }
        }
    }
    parts == 1
}
