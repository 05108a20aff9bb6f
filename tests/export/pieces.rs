//! Atlases whose surfaces have several charts each, and a document to try them on.

use cobake::geom::Ring;
use cobake::geom::polygon::{clip_half_plane, rectangle};
use cobake::scene::SourceDocument;
use cobake::surface::Surface;
use cobake::unwrap::{Atlas, Chart};
use glam::{DAffine2, DMat2, DVec2};
use serde_json::json;

use crate::fixture::{Maker, Results};

/// Numbers in `[0, 1)` that repeat from run to run.
pub(crate) struct Numbers(u64);

impl Numbers {
    pub(crate) fn new(seed: u64) -> Self {
        Self(seed)
    }

    pub(crate) fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) as f64 / (1_u64 << 31) as f64
    }
}

/// How surfaces are cut into charts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Cut {
    /// Along the frame's axes, anywhere.
    Straight,
    /// Any way at all.
    Slanted,
    /// Along the axes at eighths of the extent, where edges and vertices of the source may lie as well.
    Eighths,
}

impl Results {
    /// The same results with `2^depth` charts a surface, as a tree of cuts has them.
    pub(crate) fn cut_up(self, cut: Cut, depth: u32, seed: u64) -> Self {
        self.cut_up_some(cut, depth, seed, |_| true)
    }

    /// As [`Results::cut_up`], with one chart for each surface that is not among `some`.
    pub(crate) fn cut_up_some(
        mut self,
        cut: Cut,
        depth: u32,
        seed: u64,
        some: impl Fn(usize) -> bool,
    ) -> Self {
        let mut numbers = Numbers::new(seed);
        let mut parts = Vec::new();
        for (index, surface) in self.surfaces.iter().enumerate() {
            let depth = if some(index) { depth } else { 0 };
            for outline in outlines(surface, cut, depth, &mut numbers) {
                parts.push((index, outline));
            }
        }
        let columns = (parts.len() as f64).sqrt().ceil();
        let (width, height) = (self.atlas.width, self.atlas.height);
        let cell = f64::from(width) / columns;
        let charts = parts.into_iter().enumerate().map(|(index, (surface, outline))| {
            let (low, high) = bounds(&outline);
            let scale = (0.5 + 0.5 * numbers.next()) * cell / (high - low).max_element();
            let turn = if index % 3 == 1 { DMat2::from_cols(DVec2::Y, DVec2::X) } else { DMat2::IDENTITY };
            let origin = DVec2::new(index as f64 % columns, (index as f64 / columns).floor()) * cell;
            let matrix = turn * scale;
            let texel_from_plane = DAffine2::from_mat2_translation(matrix, origin - matrix * low);
            Chart { surface, outline, page: 0, texel_from_plane }
        });
        self.atlas = Atlas { width, height, charts: charts.collect(), ..self.atlas };
        self
    }
}

fn outlines(surface: &Surface, cut: Cut, depth: u32, numbers: &mut Numbers) -> Vec<Ring> {
    let (low, high) = surface.extent();
    let mut rings = vec![rectangle(low, high).to_vec()];
    for level in 0..depth {
        rings = rings.iter().flat_map(|ring| halves(ring, (low, high), cut, level, numbers)).collect();
    }
    rings
}

fn halves(
    ring: &Ring,
    (low, high): (DVec2, DVec2),
    cut: Cut,
    level: u32,
    numbers: &mut Numbers,
) -> Vec<Ring> {
    let axis = if level.is_multiple_of(2) { DVec2::X } else { DVec2::Y };
    let (from, to) = bounds(ring);
    let at = from.lerp(to, 0.3 + 0.4 * numbers.next());
    let (normal, point) = match cut {
        Cut::Straight => (axis, at),
        Cut::Slanted => (DVec2::from_angle(std::f64::consts::TAU * numbers.next()), at),
        Cut::Eighths => {
            let eighth = (high - low) / 8.0;
            (axis, low + ((at - low) / eighth).round() * eighth)
        }
    };
    let offset = normal.dot(point);
    let pieces = [clip_half_plane(ring, normal, offset), clip_half_plane(ring, -normal, -offset)];
    pieces.into_iter().filter(|ring| cobake::geom::polygon::signed_area(ring) > 1e-9).collect()
}

fn bounds(ring: &Ring) -> (DVec2, DVec2) {
    ring.iter().fold((DVec2::INFINITY, DVec2::NEG_INFINITY), |(low, high), &p| (low.min(p), high.max(p)))
}

/// Quads along a side of [`quilt`].
const SIDE: usize = 6;

/// A square metre of uneven triangles in one plane, with all kinds of attributes, and at one of its sides a
/// second primitive, a single quad for each of its own; the node turns and moves both.
pub(crate) fn quilt(even: bool) -> SourceDocument {
    let mut numbers = Numbers::new(3);
    let mut maker = Maker::default();
    let at = |i: usize| i as f32 / SIDE as f32;
    let mut points = Vec::new();
    for y in 0..=SIDE {
        for x in 0..=SIDE {
            let mut shift = |i: usize| {
                let free = !even && i > 0 && i < SIDE;
                if free { 0.6 * (numbers.next() as f32 - 0.5) / SIDE as f32 } else { 0.0 }
            };
            points.push([at(x) + shift(x), at(y) + shift(y), 0.0]);
        }
    }
    let mut indices = Vec::new();
    for y in 0..SIDE {
        for x in 0..SIDE {
            let [a, b] = [y * (SIDE + 1) + x, (y + 1) * (SIDE + 1) + x].map(|i| i as u16);
            indices.extend(if (x + y) % 3 == 0 {
                [a, a + 1, b + 1, a, b + 1, b]
            } else {
                [a, a + 1, b, a + 1, b + 1, b]
            });
        }
    }
    let unit = |x: f32, y: f32, z: f32| {
        let length = (x * x + y * y + z * z).sqrt();
        [x / length, y / length, z / length]
    };
    let normals: Vec<[f32; 3]> = points.iter().map(|p| unit(p[0] - 0.5, p[1] - 0.5, 2.0)).collect();
    let tangents: Vec<[f32; 4]> = points
        .iter()
        .map(|p| {
            let [x, y, z] = unit(1.0, p[0] - 0.5, 0.0);
            [x, y, z, -1.0]
        })
        .collect();
    let own: Vec<[f32; 1]> = points.iter().map(|p| [3.0 * p[0] - 7.0 * p[1]]).collect();
    let change: Vec<[f32; 3]> = points.iter().map(|p| [p[1], p[0], 1.0]).collect();
    let sets: Vec<u8> = points
        .iter()
        .flat_map(|p| [p[0], 1.0 - p[1]])
        .flat_map(|c| ((c * 65535.0).round() as u16).to_le_bytes())
        .collect();
    let colours: Vec<u8> = points
        .iter()
        .flat_map(|p| [p[0], p[1], 1.0 - p[0], 1.0])
        .map(|c| (c * 255.0).round() as u8)
        .collect();
    let count = points.len();
    let sets = maker.view(&sets, Some(4));
    let colours = maker.view(&colours, Some(4));
    let row = points[..=SIDE].iter();
    let foot: Vec<[f32; 3]> = row.flat_map(|p| [[p[0], 0.0, 0.0], [p[0], 0.0, 1.0]]).collect();
    let below: Vec<u16> =
        (0..SIDE as u16).flat_map(|i| [2 * i, 2 * i + 1, 2 * i + 3, 2 * i, 2 * i + 3, 2 * i + 2]).collect();
    let quilt = json!({
        "attributes": {
            "POSITION": maker.floats(&points),
            "NORMAL": maker.floats(&normals),
            "TANGENT": maker.floats(&tangents),
            "TEXCOORD_0": maker.accessor(json!({"bufferView": sets, "componentType": 5123, "count": count,
                "type": "VEC2", "normalized": true, "min": [0, 0], "max": [65535, 65535]})),
            "COLOR_0": maker.accessor(json!({"bufferView": colours, "componentType": 5121, "count": count,
                "type": "VEC4", "normalized": true})),
            "_OWN": maker.floats(&own),
        },
        "targets": [{"POSITION": maker.floats(&change)}],
        "indices": maker.indices(&indices),
    });
    let wall = json!({"attributes": {"POSITION": maker.floats(&foot)}, "targets": [{}],
        "indices": maker.indices(&below)});
    let json = json!({
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}],
        "nodes": [{"name": "quilt", "mesh": 0, "translation": [0.3, -2.0, 1.0], "rotation": [0.6, 0.0, 0.0, 0.8]}],
        "meshes": [{"primitives": [quilt, wall], "weights": [0.0]}],
        "buffers": [{"byteLength": maker.buffer.len()}], "bufferViews": maker.views, "accessors": maker.accessors,
    });
    SourceDocument { json, buffers: vec![maker.buffer], external_images: Vec::new() }
}
