//! The written document: what it must keep, what it must add, and that it arrives whole or not at all.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a test may fail; clippy sees tests but not what they call"
)]

#[path = "export/cuts.rs"]
mod cuts;
#[path = "export/files.rs"]
mod files;
#[path = "export/fixture.rs"]
mod fixture;
#[path = "export/pieces.rs"]
mod pieces;

use cobake::export::{decode_exr, encode, encode_png, verify};
use cobake::options::{Quantity, Topology};
use cobake::raster::Lightmap;
use cobake::scene::SourceDocument;
use cobake::unwrap::PageArea;
use fixture::{Maker, Results, document, vectors};
use glam::{DVec2, DVec3};
use serde_json::{Value, json};

/// Texture coordinates are 32-bit floats of at most 1, over a page of 64 texels.
const TEXELS: f64 = 1e-4;

/// 32-bit positions of order 1.
const METRES: f64 = 1e-6;

/// A GLB taken apart by another reader than the exporter's own.
struct Output {
    json: Value,
    binary: Vec<u8>,
}

impl Output {
    fn of(results: &Results) -> Self {
        let glb = encode(&results.baked()).unwrap();
        verify(&glb).unwrap();
        gltf::import_slice(&glb).unwrap();
        let parts = gltf::Glb::from_slice(&glb).unwrap();
        Self { json: serde_json::from_slice(&parts.json).unwrap(), binary: parts.bin.unwrap().into_owned() }
    }

    fn view(&self, view: &Value) -> &[u8] {
        let view = &self.json["bufferViews"][number(view)];
        assert_eq!(view["buffer"], 0);
        let start = number(&view["byteOffset"]);
        &self.binary[start..start + number(&view["byteLength"])]
    }

    /// An accessor's elements with their gaps closed.
    fn elements(&self, accessor: &Value) -> Vec<Vec<u8>> {
        let accessor = &self.json["accessors"][number(accessor)];
        let component = match accessor["componentType"].as_u64() {
            Some(5121) => 1,
            Some(5123) => 2,
            _ => 4,
        };
        let components = match accessor["type"].as_str().unwrap() {
            "SCALAR" => 1,
            "VEC2" => 2,
            "VEC3" => 3,
            _ => 4,
        };
        let size = component * components;
        let view = &self.json["bufferViews"][number(&accessor["bufferView"])];
        let stride = view["byteStride"].as_u64().map_or(size, |stride| stride as usize);
        let bytes = self.view(&accessor["bufferView"]);
        let first = accessor["byteOffset"].as_u64().unwrap_or(0) as usize;
        (0..number(&accessor["count"])).map(|i| bytes[first + i * stride..][..size].to_vec()).collect()
    }

    fn floats(&self, accessor: &Value) -> Vec<Vec<f64>> {
        let float = |bytes: &[u8]| f64::from(f32::from_le_bytes(bytes.try_into().unwrap()));
        self.elements(accessor).iter().map(|row| row.chunks_exact(4).map(float).collect()).collect()
    }

    fn indices(&self, primitive: &Value) -> Vec<usize> {
        let index = |bytes: &Vec<u8>| bytes.iter().rev().fold(0, |n, &b| n << 8 | usize::from(b));
        self.elements(&primitive["indices"]).iter().map(index).collect()
    }

    fn node(&self, name: &str) -> &Value {
        self.json["nodes"].as_array().unwrap().iter().find(|node| node["name"] == name).unwrap()
    }

    fn primitive(&self, node: &str) -> &Value {
        &self.json["meshes"][number(&self.node(node)["mesh"])]["primitives"][0]
    }

    fn exr(&self) -> cobake::raster::Lightmap {
        let entry = &self.json["extensions"]["COBAKE_lightmap"]["lightmaps"][0];
        decode_exr(self.view(&entry["bufferView"])).unwrap()
    }
}

fn number(value: &Value) -> usize {
    value.as_u64().unwrap_or_else(|| panic!("{value} is no index")) as usize
}

fn results() -> Results {
    Results::of(document())
}

const LIT: [&str; 5] = ["cube", "mirrored cube", "floor", "strip", "wall"];

/// Every lit triangle is there, in order, with the same winding, and lies where its chart does.
#[test]
fn source_triangles_stay_and_lie_in_their_charts() {
    let results = results();
    let output = Output::of(&results);
    let scene = &results.scene;
    for (placement, node) in scene.placements.iter().zip(LIT) {
        let primitive = output.primitive(node);
        let positions = output.floats(&primitive["attributes"]["POSITION"]);
        let coordinates = output.floats(&primitive["attributes"]["TEXCOORD_1"]);
        let source = &scene.source.json["meshes"][placement.mesh]["primitives"][placement.primitive];
        let original = vectors(&scene.source, number(&source["attributes"]["POSITION"]));
        let indices = output.indices(primitive);
        assert_eq!(indices.len(), 3 * placement.triangles.len(), "{node}");
        for (corners, index) in indices.chunks(3).zip(placement.triangles.clone()) {
            let triangle = scene.triangles[index];
            let order = if placement.mirrored { [0, 2, 1] } else { [0, 1, 2] };
            let surface = results.surfaces.iter().position(|s| s.source_triangles.contains(&index));
            for (&vertex, corner) in corners.iter().zip(order) {
                let expected = original[triangle.source_vertices[corner] as usize].map(f64::from);
                assert_eq!(positions[vertex], expected, "{node}, triangle {index}");
                let Some(surface) = surface else { continue };
                let world = scene.vertices[triangle.vertices[corner] as usize];
                let texel =
                    results.atlas.charts_of(surface)[0].texel(results.surfaces[surface].frame.project(world));
                let written = 64.0 * DVec2::new(coordinates[vertex][0], coordinates[vertex][1]);
                assert!((written - texel).length() < TEXELS, "{node}: {written} is not {texel}");
            }
        }
    }
}

/// A cube's corner lies in three charts; each copy has all that the corner had, byte for byte.
#[test]
fn split_vertices_are_whole_copies() {
    let results = results();
    let output = Output::of(&results);
    for node in ["cube", "mirrored cube"] {
        let primitive = output.primitive(node);
        let attributes = primitive["attributes"].as_object().unwrap();
        let positions = output.elements(&attributes["POSITION"]);
        assert_eq!(positions.len(), 24);
        let texels = output.elements(&attributes["TEXCOORD_1"]);
        let distinct: std::collections::BTreeSet<_> = positions.iter().zip(&texels).collect();
        assert_eq!(distinct.len(), 24, "every copy has its own place in the lightmap");
        for name in ["NORMAL", "TEXCOORD_0", "COLOR_0", "_OWN"] {
            let elements = output.elements(&attributes[name]);
            assert_eq!(elements.len(), 24, "{name}");
            for (i, element) in elements.iter().enumerate() {
                let first = positions.iter().position(|p| *p == positions[i]).unwrap();
                assert_eq!(*element, elements[first], "{name} of vertex {i}");
            }
        }
        let colours = output.elements(&attributes["COLOR_0"]);
        assert!((0..8).all(|i| colours[i] == [10 * i as u8, 20, 30 + i as u8]));
        assert_eq!(output.elements(&primitive["targets"][0]["POSITION"]).len(), 24);
        let colour = &output.json["accessors"][number(&attributes["COLOR_0"])];
        assert_eq!((&colour["normalized"], &colour["componentType"]), (&json!(true), &json!(5121)));
        assert_eq!(primitive["extras"], json!({"of": "a primitive"}));
    }
}

/// Instances have a mesh each, and share all but their place in the lightmap (and, mirrored or not,
/// the order in which the faces were met does not matter).
#[test]
fn instances_share_what_they_can() {
    let output = Output::of(&results());
    let (a, b) = (output.primitive("cube"), output.primitive("mirrored cube"));
    assert_ne!(output.node("cube")["mesh"], output.node("mirrored cube")["mesh"]);
    assert_ne!(a["attributes"]["TEXCOORD_1"], b["attributes"]["TEXCOORD_1"]);
    for name in ["POSITION", "NORMAL", "TEXCOORD_0", "COLOR_0", "_OWN"] {
        assert_eq!(a["attributes"][name], b["attributes"][name], "{name}");
    }
    assert_eq!((&a["indices"], &a["targets"]), (&b["indices"], &b["targets"]));
}

/// The floor needs no split: its accessors are the unlit floor's own.
#[test]
fn unsplit_primitives_share_the_source() {
    let output = Output::of(&results());
    let (lit, unlit) = (output.primitive("floor"), output.primitive("unlit floor"));
    assert_eq!(lit["indices"], unlit["indices"]);
    assert_eq!(lit["attributes"]["POSITION"], unlit["attributes"]["POSITION"]);
    assert_eq!(lit["attributes"]["TEXCOORD_0"], unlit["attributes"]["TEXCOORD_0"]);
    assert!(unlit["attributes"].get("TEXCOORD_1").is_none() && unlit.get("material").is_none());
}

/// Two primitives that draw from one pool still do after a split; what neither uses is left out of it.
#[test]
fn primitives_keep_sharing_a_pool() {
    let mut maker = Maker::default();
    let pool: [[f32; 3]; 7] = [
        [0.0, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [90.0, 80.0, 70.0],
        [0.0, 1.0, 0.0],
        [1.0, 1.0, 0.0],
        [0.0, 1.0, -1.0],
        [1.0, 1.0, -1.0],
    ];
    let position = maker.floats(&pool);
    let mut quad =
        |indices: &[u16]| json!({"attributes": {"POSITION": position}, "indices": maker.indices(indices)});
    let (front, top) = (quad(&[0, 1, 4, 0, 4, 3]), quad(&[3, 4, 6, 3, 6, 5]));
    let output = Output::of(&Results::of(SourceDocument {
        json: json!({
            "asset": {"version": "2.0"}, "scenes": [{"nodes": [0]}], "nodes": [{"name": "fold", "mesh": 0}],
            "meshes": [{"primitives": [front, top]}],
            "buffers": [{"byteLength": maker.buffer.len()}], "bufferViews": maker.views, "accessors": maker.accessors,
        }),
        buffers: vec![maker.buffer],
        external_images: Vec::new(),
    }));
    let mesh = &output.json["meshes"][0]["primitives"];
    assert_eq!(mesh[0]["attributes"], mesh[1]["attributes"]);
    let accessor = &output.json["accessors"][number(&mesh[0]["attributes"]["POSITION"])];
    assert_eq!((&accessor["min"], &accessor["max"]), (&json!([0.0, 0.0, -1.0]), &json!([1.0, 1.0, 0.0])));
    let positions = output.floats(&mesh[0]["attributes"]["POSITION"]);
    assert_eq!(positions.len(), 8, "six vertices, two of them twice");
    for (primitive, indices) in [(0, [0, 1, 4, 0, 4, 3]), (1, [3, 4, 6, 3, 6, 5])] {
        for (vertex, source) in output.indices(&mesh[primitive]).into_iter().zip(indices) {
            assert_eq!(positions[vertex], pool[source].map(f64::from));
        }
    }
}

/// Nothing but meshes, materials and the lists of data differs; names are those of before.
#[test]
fn the_rest_of_the_document_stays() {
    let results = results();
    let mut output = Output::of(&results).json;
    let source = &results.scene.source.json;
    for key in ["asset", "scene", "scenes", "cameras", "extras"] {
        assert_eq!(output[key], source[key], "{key}");
    }
    assert_eq!(output["extensions"]["KHR_lights_punctual"], source["extensions"]["KHR_lights_punctual"]);
    assert_eq!(
        output["extensionsUsed"],
        json!(["KHR_lights_punctual", "KHR_materials_unlit", "MOZ_lightmap", "COBAKE_lightmap"])
    );
    assert!(output.get("extensionsRequired").is_none());
    assert_eq!(output["images"][0]["name"], "picture");
    let before = source["nodes"].as_array().unwrap();
    for (index, before) in before.iter().enumerate() {
        let node = output["nodes"][index].as_object_mut().unwrap();
        if LIT.iter().any(|name| before["name"] == *name) {
            let extensions = node.shift_remove("extensions").unwrap();
            assert_eq!(extensions, json!({"COBAKE_lightmap": {"lightmap": 0, "texCoord": 1}}));
        }
        if let Some(mesh) = node.get_mut("mesh") {
            *mesh = before["mesh"].clone();
        }
        assert_eq!(output["nodes"][index], *before);
    }
}

#[test]
fn animations_and_pictures_read_the_same_data() {
    let results = results();
    let output = Output::of(&results);
    let source = &results.scene.source;
    let (old, new) = (&source.json["animations"][0], &output.json["animations"][0]);
    assert_eq!((&old["name"], &old["channels"]), (&new["name"], &new["channels"]));
    let moves = vectors(source, number(&old["samplers"][0]["output"]));
    let moves: Vec<Vec<f64>> = moves.iter().map(|row| row.map(f64::from).to_vec()).collect();
    assert_eq!(output.floats(&new["samplers"][0]["output"]), moves);
    assert_eq!(output.view(&output.json["images"][0]["bufferView"])[..4], *b"\x89PNG");
}

/// A set 1 that is in use moves; who is not lit keeps both set and material.
#[test]
fn a_used_second_set_moves() {
    let output = Output::of(&results());
    let (lit, unlit) = (output.primitive("wall"), output.primitive("unlit wall"));
    assert_eq!(lit["attributes"]["TEXCOORD_2"], unlit["attributes"]["TEXCOORD_1"]);
    let set = |primitive: &Value| {
        let material = &output.json["materials"][number(&primitive["material"])];
        material["pbrMetallicRoughness"]["baseColorTexture"]["texCoord"].clone()
    };
    assert_eq!((set(lit), set(unlit)), (json!(2), json!(1)));
    assert_eq!(output.json["materials"][1], document().json["materials"][1]);
}

/// The carrier is on lit materials only, default ones included, and says what GLTF.md says.
#[test]
fn lit_materials_carry_the_lightmap() {
    let results = results();
    let output = Output::of(&results);
    let scale = encode_png(&results.lightmap).unwrap().scale;
    let lightmap = |node: &str| {
        let primitive = output.primitive(node);
        let material = &output.json["materials"][number(&primitive["material"])];
        material["extensions"]["MOZ_lightmap"].clone()
    };
    for node in ["cube", "floor", "wall"] {
        let info = lightmap(node);
        assert_eq!((&info["texCoord"], &info["intensity"]), (&json!(1), &json!(scale)), "{node}");
        let texture = &output.json["textures"][number(&info["index"])];
        let sampler = &output.json["samplers"][number(&texture["sampler"])];
        assert_eq!(*sampler, json!({"magFilter": 9729, "minFilter": 9729, "wrapS": 33071, "wrapT": 33071}));
        let image = &output.json["images"][number(&texture["source"])];
        let picture = image::load_from_memory(output.view(&image["bufferView"])).unwrap().into_rgb8();
        for (texel, value) in picture.pixels().zip(&results.lightmap.texels) {
            for (byte, value) in texel.0.iter().zip(value) {
                let step = scale / 255.0;
                assert!((f32::from(*byte) * step - value).abs() <= 0.5001 * step);
            }
        }
    }
    assert_eq!(lightmap("strip"), Value::Null, "the material is unlit");
    let strip = &output.primitive("strip")["attributes"];
    assert_eq!(strip["TEXCOORD_0"], strip["TEXCOORD_1"], "sets count from 0");
}

/// The EXR holds the lightmap upright; these values are all exact in half precision.
#[test]
fn the_exr_holds_the_lightmap() {
    let results = results();
    let output = Output::of(&results);
    assert_eq!(output.exr(), results.lightmap);
    let entry = &output.json["extensions"]["COBAKE_lightmap"]["lightmaps"][0];
    assert_eq!(entry["quantity"], "irradiance");
    assert_eq!((&entry["width"], &entry["mimeType"]), (&json!(64), &json!("image/x-exr")));
}

/// `MOZ_lightmap` is irradiance: radiance is scaled by π, radiosity has no image at all.
#[test]
fn other_quantities_never_pose_as_irradiance() {
    let mut results = results();
    let intensity =
        |output: &Output| output.json["materials"][0]["extensions"]["MOZ_lightmap"]["intensity"].clone();
    let irradiance = intensity(&Output::of(&results)).as_f64().unwrap();
    results.options.quantity = Quantity::Radiance;
    let radiance = intensity(&Output::of(&results)).as_f64().unwrap();
    assert_eq!(radiance, irradiance * std::f64::consts::PI);
    results.options.quantity = Quantity::Radiosity;
    let output = Output::of(&results);
    assert_eq!(intensity(&output), Value::Null);
    assert_eq!(output.json["images"].as_array().unwrap().len(), 1);
    let materials = output.json["materials"].as_array().unwrap();
    assert_eq!(materials[..3], results.scene.source.json["materials"].as_array().unwrap()[..]);
    assert_eq!(output.exr(), results.lightmap);
}

#[test]
fn bytes_repeat() {
    for topology in [Topology::Source, Topology::Adaptive] {
        let mut results = results();
        results.options.topology = topology;
        let first = encode(&results.baked()).unwrap();
        results.options.threads = 7;
        assert!((0..3).all(|_| encode(&results.baked()).unwrap() == first));
    }
}

/// Baking a baked file gives a file of the same make and size: nothing piles up.
///
/// The lit floor is not split, so its mesh is the same the second time.
#[test]
fn baking_again_adds_nothing() {
    let mut source = document();
    source.json["nodes"] = json!([{"name": "floor", "mesh": 1}]);
    source.json["scenes"] = json!([{"nodes": [0]}]);
    source.json.as_object_mut().unwrap().shift_remove("animations");
    let once = Output::of(&Results::of(source));
    let before = (once.binary.len(), counts(&once.json));
    let images = once.json["images"].as_array().unwrap().len();
    let twice = Output::of(&Results::of(SourceDocument {
        json: once.json,
        buffers: vec![once.binary],
        external_images: vec![None; images],
    }));
    assert_eq!((twice.binary.len(), counts(&twice.json)), before);
}

fn counts(json: &Value) -> Vec<usize> {
    let lists = [
        "accessors",
        "bufferViews",
        "images",
        "textures",
        "samplers",
        "materials",
        "meshes",
        "extensionsUsed",
    ];
    lists.iter().map(|list| json[list].as_array().map_or(0, Vec::len)).collect()
}

/// Back in the world the triangles lie on their surfaces, face the same way, and carry the solution.
#[test]
fn the_adaptive_mesh_is_placed_where_it_was_solved() {
    let mut results = results();
    results.options.topology = Topology::Adaptive;
    let output = Output::of(&results);
    let glb = encode(&results.baked()).unwrap();
    let (document, buffers, _) = gltf::import_slice(&glb).unwrap();
    for (placement, name) in [(2, "floor"), (3, "strip"), (4, "wall")] {
        let node = document.nodes().find(|node| node.name() == Some(name)).unwrap();
        let world = glam::Mat4::from_cols_array_2d(&node.transform().matrix()).as_dmat4();
        let primitive = node.mesh().unwrap().primitives().next().unwrap();
        let reader = primitive.reader(|buffer| Some(&buffers[buffer.index()]));
        let place = |p: [f32; 3]| world.transform_point3(DVec3::from(p.map(f64::from)));
        let positions: Vec<DVec3> = reader.read_positions().unwrap().map(place).collect();
        let indices: Vec<u32> = reader.read_indices().unwrap().into_u32().collect();
        let normals: Vec<DVec3> = reader
            .read_normals()
            .unwrap()
            .map(|n| world.transform_vector3(n.map(f64::from).into()))
            .collect();
        let irradiance = output.floats(&output.primitive(name)["attributes"]["_IRRADIANCE"]);
        let surfaces = results.surfaces.iter().filter(|surface| surface.placement == placement);
        let area: f64 = surfaces.clone().map(|surface| surface.area).sum();
        let mut written = 0.0;
        for corners in indices.chunks(3) {
            let [a, b, c] = [0, 1, 2].map(|i| positions[corners[i] as usize]);
            let twice = (b - a).cross(c - a);
            written += twice.length() / 2.0;
            let normal = normals[corners[0] as usize];
            assert!(normal.dot(twice.normalize()) > 1.0 - METRES, "{name} faces the wrong way");
            assert!(
                surfaces
                    .clone()
                    .any(|s| s.frame.height(a).abs() < METRES && s.frame.normal.dot(normal) > 0.9)
            );
            let light = DVec3::from_slice(&irradiance[corners[0] as usize]);
            assert!((light - (a.abs() + 1.0)).length() < METRES, "{name}: {light} at {a}");
        }
        assert!((written - area).abs() < METRES, "{name}: {written} of {area} m²");
    }
    // The floor's set 0 is affine: (x / 4, −z / 4).
    let floor = output.primitive("floor");
    let sets = output.floats(&floor["attributes"]["TEXCOORD_0"]);
    for (set, position) in sets.iter().zip(output.floats(&floor["attributes"]["POSITION"])) {
        assert!((set[0] - position[0] / 4.0).abs() < METRES && (set[1] + position[2] / 4.0).abs() < METRES);
    }
    // A cube with morph targets keeps its own triangles.
    assert!(output.primitive("cube")["attributes"].get("_IRRADIANCE").is_none());
    assert!(output.primitive("cube")["targets"].is_array());
}

/// A mirrored node turns its triangles round; the front stays the front.
#[test]
fn mirrored_adaptive_triangles_keep_their_front() {
    let mut source = document();
    source.json["meshes"][0]["primitives"][0].as_object_mut().unwrap().shift_remove("targets");
    source.json["meshes"][0].as_object_mut().unwrap().shift_remove("weights");
    let mut results = Results::of(source);
    results.options.topology = Topology::Adaptive;
    let output = Output::of(&results);
    for node in ["cube", "mirrored cube"] {
        let primitive = output.primitive(node);
        let positions = output.floats(&primitive["attributes"]["POSITION"]);
        for corners in output.indices(primitive).chunks(3) {
            let [a, b, c] = [0, 1, 2].map(|i| DVec3::from_slice(&positions[corners[i]]));
            // The cube is centred in its node, so outward is away from the origin, in node space too.
            assert!((b - a).cross(c - a).dot(a) > 0.0, "{node}");
        }
    }
}

#[test]
fn an_unlit_document_is_still_written() {
    let mut source = document();
    source.json["scenes"][0]["nodes"] = json!([5]);
    let output = Output::of(&Results::of(source));
    assert_eq!(output.json["images"].as_array().unwrap().len(), 1);
    assert!(output.json["extensions"]["COBAKE_lightmap"].is_object());
}

#[test]
fn images_beside_the_document_move_inside() {
    let mut source = document();
    let bytes = encode_png(&results().lightmap).unwrap().bytes;
    source.json["images"][0] = json!({"uri": "beside.png", "name": "picture"});
    source.external_images = vec![Some((bytes.clone(), "image/png".into()))];
    let output = Output::of(&Results::of(source));
    let image = &output.json["images"][0];
    assert_eq!(output.view(&image["bufferView"]), bytes);
    assert!(image.get("uri").is_none() && image["mimeType"] == "image/png");
}

/// Results of different scenes are told, not mixed or panicked over.
#[test]
fn results_that_do_not_belong_together_are_refused() {
    let refused = |change: fn(&mut Results)| {
        let mut results = results();
        results.options.topology = Topology::Adaptive;
        change(&mut results);
        encode(&results.baked()).unwrap_err().to_string()
    };
    for message in [
        refused(|r| r.atlas.charts.truncate(1)),
        refused(|r| r.mesh.surfaces.truncate(1)),
        refused(|r| r.surfaces[0].source_triangles.push(1_000_000)),
        refused(|r| r.scene.vertices.truncate(9)),
        refused(|r| r.scene.placements[1].node = 0),
        refused(|r| r.mesh.surfaces.iter_mut().for_each(|m| m.vertices.truncate(1))),
        refused(|r| r.lightmap.texels[5][1] = f32::NAN),
        refused(|r| r.scene.source.buffers[0].truncate(40)),
    ] {
        assert!(message.len() > 20, "{message}");
    }
}

/// Replaces the `pick`-th number of a document; says whether there are as many.
fn damage(value: &mut Value, pick: &mut usize, by: &Value) -> bool {
    match value {
        Value::Array(list) => list.iter_mut().any(|value| damage(value, pick, by)),
        Value::Object(map) => map.values_mut().any(|value| damage(value, pick, by)),
        Value::Number(_) if *pick == 0 => {
            *value = by.clone();
            true
        }
        Value::Number(_) => {
            *pick -= 1;
            false
        }
        _ => false,
    }
}

/// Any one number of the document may be nonsense: the result is a file or an error.
#[test]
fn damaged_documents_never_panic() {
    let mut results = results();
    results.lightmap = Lightmap { width: 1, height: 1, texels: vec![[1.0; 3]] };
    results.atlas.pages = vec![PageArea { row: 0, width: 1, height: 1 }];
    let whole = results.scene.source.json.clone();
    let (mut written, mut refused) = (0, 0);
    for by in [json!(0), json!(3), json!(-1), json!(1_000_000), json!(0.5)] {
        for number in 0.. {
            results.scene.source.json = whole.clone();
            if !damage(&mut results.scene.source.json, &mut { number }, &by) {
                break;
            }
            let adaptive = number % 2 == 1; // each topology meets half of the faults
            results.options.topology = if adaptive { Topology::Adaptive } else { Topology::Source };
            match encode(&results.baked()) {
                Ok(_) => written += 1,
                Err(_) => refused += 1,
            }
        }
    }
    assert!(written > 100 && refused > 100, "{written} written, {refused} refused");
}
