//! A document with one of everything, and results of a bake on it that no solver had to make.

use std::collections::BTreeMap;

use cobake::authored::Authored;
use cobake::export::{Baked, encode_png};
use cobake::geom::Frame;
use cobake::geom::polygon::rectangle;
use cobake::options::BakeOptions;
use cobake::raster::Lightmap;
use cobake::retriangulate::{MeshVertex, RadiosityMesh, SurfaceMesh};
use cobake::scene::{Placement, Scene, SourceDocument, Triangle};
use cobake::surface::Surface;
use cobake::unwrap::{Atlas, Chart, PageArea};
use glam::{DAffine2, DMat2, DMat4, DQuat, DVec2, DVec3};
use serde_json::{Value, json};

/// Collects a buffer, bufferViews and accessors.
#[derive(Default)]
pub(crate) struct Maker {
    pub(crate) buffer: Vec<u8>,
    pub(crate) views: Vec<Value>,
    pub(crate) accessors: Vec<Value>,
}

impl Maker {
    pub(crate) fn view(&mut self, bytes: &[u8], stride: Option<usize>) -> usize {
        self.buffer.resize(self.buffer.len().next_multiple_of(4), 0);
        let mut view = json!({"buffer": 0, "byteOffset": self.buffer.len(), "byteLength": bytes.len()});
        if let Some(stride) = stride {
            view["byteStride"] = stride.into();
        }
        self.buffer.extend_from_slice(bytes);
        self.views.push(view);
        self.views.len() - 1
    }

    pub(crate) fn floats<const N: usize>(&mut self, rows: &[[f32; N]]) -> usize {
        let bytes: Vec<u8> = rows.iter().flatten().flat_map(|v| v.to_le_bytes()).collect();
        let view = self.view(&bytes, None);
        let kind = ["SCALAR", "VEC2", "VEC3", "VEC4"][N - 1];
        let mut accessor =
            json!({"bufferView": view, "componentType": 5126, "count": rows.len(), "type": kind});
        if N == 3 {
            let bound = |pick: fn(f32, f32) -> f32| -> Vec<f32> {
                (0..N).map(|c| rows.iter().map(|r| r[c]).reduce(pick).unwrap()).collect()
            };
            accessor["min"] = json!(bound(f32::min));
            accessor["max"] = json!(bound(f32::max));
        }
        self.accessor(accessor)
    }

    pub(crate) fn indices(&mut self, indices: &[u16]) -> usize {
        let bytes: Vec<u8> = indices.iter().flat_map(|v| v.to_le_bytes()).collect();
        let view = self.view(&bytes, None);
        let count = indices.len();
        self.accessor(json!({"bufferView": view, "componentType": 5123, "count": count, "type": "SCALAR"}))
    }

    pub(crate) fn accessor(&mut self, accessor: Value) -> usize {
        self.accessors.push(accessor);
        self.accessors.len() - 1
    }
}

/// A cube whose corners are shared by three faces each, and everything that a vertex can have.
fn cube(maker: &mut Maker) -> Value {
    let corner = |i: usize| [0, 1, 2].map(|axis| if i >> axis & 1 == 1 { 0.5_f32 } else { -0.5 });
    let corners: Vec<[f32; 3]> = (0..8).map(corner).collect();
    let faces: [[u16; 4]; 6] =
        [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    let indices: Vec<u16> = faces.iter().flat_map(|&[a, b, c, d]| [a, b, c, a, c, d]).collect();
    let third = 1.0 / 3.0_f32.sqrt();
    let normals: Vec<[f32; 3]> = corners.iter().map(|c| c.map(|x| 2.0 * x * third)).collect();
    let sets: Vec<[f32; 2]> = corners.iter().map(|c| [c[0] + 0.5, c[1] + 0.25 * c[2]]).collect();
    // Colours of 3 bytes with a stride of 4, and an application's own number with a stride of 8.
    let colours: Vec<u8> = (0..8).flat_map(|i| [10 * i, 20, 30 + i, 99]).collect();
    let colours = maker.view(&colours, Some(4));
    let own: Vec<u8> = (0..8).flat_map(|i| [i, 0, 7, 7, 7, 7, 7, 7]).collect();
    let own = maker.view(&own, Some(8));
    let (changed, change) = (maker.view(&[2, 5], None), maker.view(&[0_u8; 24], None));
    json!({
        "attributes": {
            "POSITION": maker.floats(&corners),
            "NORMAL": maker.floats(&normals),
            "TEXCOORD_0": maker.floats(&sets),
            "COLOR_0": maker.accessor(json!({"bufferView": colours, "componentType": 5121, "count": 8,
                "type": "VEC3", "normalized": true})),
            "_OWN": maker.accessor(json!({"bufferView": own, "componentType": 5123, "count": 8, "type": "SCALAR"})),
        },
        "targets": [{"POSITION": maker.accessor(json!({"componentType": 5126, "count": 8, "type": "VEC3",
            "min": [0.0, 0.0, 0.0], "max": [0.0, 0.0, 0.0],
            "sparse": {"count": 2, "indices": {"bufferView": changed, "componentType": 5121},
                       "values": {"bufferView": change}}}))}],
        "indices": maker.indices(&indices),
        "material": 0,
        "extras": {"of": "a primitive"},
    })
}

/// The document: lit cubes (a pair of instances, one mirrored), a floor with a triangle without area, a
/// folded strip, a wall that uses its second set; and in another scene, unlit, a floor and a wall.
pub(crate) fn document() -> SourceDocument {
    let mut maker = Maker::default();
    let cube = cube(&mut maker);
    let square = [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [4.0, 0.0, -4.0], [0.0, 0.0, -4.0]];
    let sets: [[f32; 2]; 4] = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    let floor = json!({"attributes": {"POSITION": maker.floats(&square), "TEXCOORD_0": maker.floats(&sets)},
        "indices": maker.indices(&[0, 1, 2, 0, 2, 3, 1, 1, 2])});
    let fold = [
        [0.0, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [1.0, 1.0, 0.0],
        [0.0, 1.0, -1.0],
        [1.0, 1.0, -1.0],
    ];
    let strip = json!({"attributes": {"POSITION": maker.floats(&fold)}, "mode": 5, "material": 2});
    let wall = json!({"attributes": {"POSITION": maker.floats(&square), "TEXCOORD_0": maker.floats(&sets),
        "TEXCOORD_1": maker.floats(&sets)}, "indices": maker.indices(&[0, 1, 2, 0, 2, 3]), "material": 1});
    let times = maker.floats(&[[0.0], [1.0]]);
    let moves = maker.floats(&[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]);
    let picture = maker.view(&picture(), None);
    let json = json!({
        "asset": {"version": "2.0", "generator": "a test", "extras": {"year": 1998}},
        "extensionsUsed": ["KHR_lights_punctual"],
        "scene": 0,
        "scenes": [{"name": "lit", "nodes": [0, 1, 2, 3, 4, 5]}, {"name": "unlit", "nodes": [6, 7]}],
        "nodes": [
            {"name": "cube", "mesh": 0, "translation": [1.0, 0.5, -1.0], "extras": {"tag": [1, 2]}},
            {"name": "mirrored cube", "mesh": 0, "translation": [3.0, 0.5, -1.0], "scale": [-1.0, 1.0, 1.0]},
            {"name": "floor", "mesh": 1},
            {"name": "strip", "mesh": 2, "translation": [0.0, 1.0, 0.0]},
            {"name": "wall", "mesh": 3, "rotation": [0.5_f64.sqrt(), 0.0, 0.0, 0.5_f64.sqrt()]},
            {"name": "lamp", "camera": 0, "extensions": {"KHR_lights_punctual": {"light": 0}}},
            {"name": "unlit floor", "mesh": 1},
            {"name": "unlit wall", "mesh": 3}
        ],
        "meshes": [
            {"name": "Cube", "primitives": [cube], "weights": [0.0], "extras": {"of": "a mesh"}},
            {"name": "Floor", "primitives": [floor]},
            {"name": "Strip", "primitives": [strip]},
            {"name": "Wall", "primitives": [wall]}
        ],
        "materials": [
            {"name": "paint"},
            {"name": "second set", "pbrMetallicRoughness": {"baseColorTexture": {"index": 0, "texCoord": 1}}},
            {"name": "shadeless", "extensions": {"KHR_materials_unlit": {}}}
        ],
        "textures": [{"source": 0}],
        "images": [{"bufferView": picture, "mimeType": "image/png", "name": "picture"}],
        "cameras": [{"type": "perspective", "perspective": {"yfov": 0.7, "znear": 0.1}, "name": "eye"}],
        "animations": [{"name": "slide", "channels": [{"sampler": 0, "target": {"node": 0, "path": "translation"}}],
            "samplers": [{"input": times, "output": moves}]}],
        "extensions": {"KHR_lights_punctual": {"lights": [{"type": "point", "intensity": 40.0}]}},
        "buffers": [{"byteLength": maker.buffer.len(), "name": "all"}],
        "bufferViews": maker.views,
        "accessors": maker.accessors,
        "extras": {"of": "the document"},
    });
    let mut json = json;
    json["accessors"][times]["min"] = json!([0.0]);
    json["accessors"][times]["max"] = json!([1.0]);
    json["extensionsUsed"].as_array_mut().unwrap().push("KHR_materials_unlit".into());
    SourceDocument { json, buffers: vec![maker.buffer], external_images: vec![None] }
}

/// A picture of one texel.
pub(crate) fn picture() -> Vec<u8> {
    encode_png(&Lightmap { width: 1, height: 1, texels: vec![[1.0; 3]] }).unwrap().bytes
}

/// Everything that [`Baked`] borrows.
pub(crate) struct Results {
    pub(crate) scene: Scene,
    pub(crate) surfaces: Vec<Surface>,
    pub(crate) atlas: Atlas,
    pub(crate) lightmap: Lightmap,
    pub(crate) mesh: RadiosityMesh,
    pub(crate) authored: Authored,
    pub(crate) options: BakeOptions,
}

impl Results {
    /// Places the document's scene 0, takes each plane of a placement for a surface, lays the surfaces
    /// out in a grid and lights them with a ramp.
    pub(crate) fn of(source: SourceDocument) -> Self {
        let scene = place(source);
        let surfaces = surfaces(&scene);
        let (side, columns) = (64_u32, (surfaces.len() as f64).sqrt().ceil().max(1.0));
        let cell = f64::from(side) / columns;
        let charts = surfaces.iter().enumerate().map(|(index, surface)| {
            let (low, high) = surface.extent();
            let scale = (cell - 2.0) / (high - low).max_element();
            let origin = DVec2::new(index as f64 % columns, (index as f64 / columns).floor()) * cell + 1.0;
            Chart {
                surface: index,
                outline: rectangle(low, high).to_vec(),
                page: 0,
                texel_from_plane: DAffine2::from_mat2_translation(
                    DMat2::IDENTITY * scale,
                    origin - low * scale,
                ),
            }
        });
        let pages = vec![PageArea { row: 0, width: side, height: side }];
        let atlas = Atlas {
            width: side,
            height: side,
            pages,
            texels_per_metre: 8.0,
            gutter: 2,
            charts: charts.collect(),
            blocks: Vec::new(),
        };
        let texel = |i: u32| [(i % side) as f32 / 16.0, (i / side) as f32 / 64.0, 0.5];
        let lightmap = Lightmap { width: side, height: side, texels: (0..side * side).map(texel).collect() };
        let mesh = RadiosityMesh { surfaces: surfaces.iter().map(fan).collect() };
        Self {
            scene,
            surfaces,
            atlas,
            lightmap,
            mesh,
            authored: Authored::default(),
            options: BakeOptions::default(),
        }
    }

    pub(crate) fn baked(&self) -> Baked<'_> {
        Baked {
            scene: &self.scene,
            surfaces: &self.surfaces,
            atlas: &self.atlas,
            lightmap: &self.lightmap,
            preview: None,
            mesh: &self.mesh,
            facets: &[],
            authored: &self.authored,
            options: &self.options,
        }
    }
}

/// A surface's outline as a fan around its middle; the irradiance is the place.
fn fan(surface: &Surface) -> SurfaceMesh {
    let ring = &surface.rings[0];
    let middle = ring.iter().sum::<DVec2>() / ring.len() as f64;
    let vertex = |position: DVec2| MeshVertex {
        position,
        direct: surface.frame.lift(position).abs(),
        indirect: DVec3::ONE,
    };
    let count = ring.len() as u32;
    SurfaceMesh {
        vertices: ring.iter().copied().chain([middle]).map(vertex).collect(),
        triangles: (0..count).map(|i| [i, (i + 1) % count, count]).collect(),
        regions: vec![0; ring.len()],
    }
}

/// Reads 32-bit floats; for positions of this file's documents.
pub(crate) fn vectors(source: &SourceDocument, accessor: usize) -> Vec<[f32; 3]> {
    let accessor = &source.json["accessors"][accessor];
    let view = &source.json["bufferViews"][accessor["bufferView"].as_u64().unwrap() as usize];
    let start = view["byteOffset"].as_u64().unwrap() as usize;
    let count = accessor["count"].as_u64().unwrap() as usize;
    let floats: Vec<f32> = source.buffers[0][start..start + 12 * count]
        .chunks_exact(4)
        .map(|bytes| f32::from_le_bytes(bytes.try_into().unwrap()))
        .collect();
    floats.chunks_exact(3).map(|row| row.try_into().unwrap()).collect()
}

fn corners(source: &SourceDocument, primitive: &Value, count: u32) -> Vec<[u32; 3]> {
    if primitive["mode"] == 5 {
        return (0..count - 2).map(|i| [i, i + 1 + i % 2, i + 2 - i % 2]).collect();
    }
    let accessor = &source.json["accessors"][primitive["indices"].as_u64().unwrap() as usize];
    let view = &source.json["bufferViews"][accessor["bufferView"].as_u64().unwrap() as usize];
    let start = view["byteOffset"].as_u64().unwrap() as usize;
    let length = view["byteLength"].as_u64().unwrap() as usize;
    let index = |bytes: &[u8]| u32::from(u16::from_le_bytes(bytes.try_into().unwrap()));
    let list: Vec<u32> = source.buffers[0][start..start + length].chunks_exact(2).map(index).collect();
    list.chunks_exact(3).map(|row| row.try_into().unwrap()).collect()
}

fn numbers<const N: usize>(value: &Value, default: [f64; N]) -> [f64; N] {
    value.as_array().map_or(default, |list| std::array::from_fn(|i| list[i].as_f64().unwrap()))
}

/// A loader that knows as much of glTF as the document above uses.
pub(crate) fn place(source: SourceDocument) -> Scene {
    let (mut vertices, mut triangles, mut placements) = (Vec::new(), Vec::new(), Vec::new());
    let json = &source.json;
    for node_index in json["scenes"][0]["nodes"].as_array().unwrap() {
        let node_index = node_index.as_u64().unwrap() as usize;
        let node = &json["nodes"][node_index];
        let Some(mesh) = node["mesh"].as_u64() else { continue };
        let world = DMat4::from_scale_rotation_translation(
            numbers(&node["scale"], [1.0; 3]).into(),
            DQuat::from_array(numbers(&node["rotation"], [0.0, 0.0, 0.0, 1.0])),
            numbers(&node["translation"], [0.0; 3]).into(),
        );
        let mirrored = world.determinant() < 0.0;
        let primitives = json["meshes"][mesh as usize]["primitives"].as_array().unwrap();
        for (primitive_index, primitive) in primitives.iter().enumerate() {
            let positions = vectors(&source, primitive["attributes"]["POSITION"].as_u64().unwrap() as usize);
            let (first, start) = (vertices.len(), triangles.len());
            let lifted = positions.iter().map(|p| world.transform_point3(DVec3::from(p.map(f64::from))));
            vertices.extend(lifted);
            for [a, b, c] in corners(&source, primitive, positions.len() as u32) {
                let source_vertices = if mirrored { [a, c, b] } else { [a, b, c] };
                triangles.push(Triangle {
                    vertices: source_vertices.map(|v| v + first as u32),
                    source_vertices,
                    placement: placements.len() as u32,
                });
            }
            placements.push(Placement {
                node: node_index,
                mesh: mesh as usize,
                primitive: primitive_index,
                material: primitive["material"].as_u64().unwrap_or(3) as usize,
                triangles: start..triangles.len(),
                vertices: first..vertices.len(),
                mirrored,
                settings: cobake::scene::NodeSettings::default(),
            });
        }
    }
    let (materials, lights, warnings) = (Vec::new(), Vec::new(), Vec::new());
    let appearance = Default::default();
    Scene {
        vertices,
        normals: Vec::new(),
        triangles,
        placements,
        materials,
        lights,
        source,
        warnings,
        appearance,
    }
}

/// The planes of each placement; their outlines are taken to be the hulls' bounding boxes.
fn surfaces(scene: &Scene) -> Vec<Surface> {
    let mut planes: BTreeMap<(u32, [i64; 4]), Vec<usize>> = BTreeMap::new();
    for (index, triangle) in scene.triangles.iter().enumerate() {
        let [a, b, c] = triangle.vertices.map(|v| scene.vertices[v as usize]);
        let Some(normal) = (b - a).cross(c - a).try_normalize() else { continue };
        let key = [normal.x, normal.y, normal.z, normal.dot(a)].map(|x| (x * 1e4).round() as i64);
        planes.entry((triangle.placement, key)).or_default().push(index);
    }
    let mut surfaces: Vec<Surface> = planes
        .into_iter()
        .map(|((placement, _), source_triangles)| {
            let [a, b, c] = scene.triangles[source_triangles[0]].vertices.map(|v| scene.vertices[v as usize]);
            let frame = Frame::new(a, (b - a).cross(c - a).normalize(), b - a);
            let points = source_triangles.iter().flat_map(|&t| scene.triangles[t].vertices);
            let points = points.map(|v| frame.project(scene.vertices[v as usize]));
            let (low, high) = points
                .fold((DVec2::INFINITY, DVec2::NEG_INFINITY), |(low, high), p| (low.min(p), high.max(p)));
            let ring = vec![low, DVec2::new(high.x, low.y), high, DVec2::new(low.x, high.y)];
            let material = scene.placements[placement as usize].material;
            Surface {
                placement: placement as usize,
                material,
                frame,
                rings: vec![ring],
                source_triangles,
                regions: Vec::new(),
                area: (high - low).element_product(),
                smooth: None,
                double_sided: false,
            }
        })
        .collect();
    surfaces.sort_by_key(|surface| surface.source_triangles[0]);
    surfaces
}
