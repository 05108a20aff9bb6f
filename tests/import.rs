//! Reading glTF: every way to store a mesh gives the same triangles, and what is wrong is named.

#![allow(clippy::unwrap_used, clippy::panic)] // a test's helpers fail as the test does

use std::path::{Path, PathBuf};

use cobake::scene::{ImportError, ImportOptions, PunctualKind, Scene, from_bytes, load};
use glam::DVec3;
use serde_json::json;

#[path = "import/draft.rs"]
mod draft;

use draft::{BYTE, Draft, FLOAT, INT, SHORT, SQUARE, floats, pack, refusal};

/// Single-precision textures and positions bound the agreement.
const SINGLE: f64 = 1e-6;

/// The triangles in an order that depends neither on their own nor on the first corner's choice.
fn triangles(scene: &Scene) -> Vec<[[i64; 3]; 3]> {
    let corner = |v: u32| scene.vertices[v as usize].to_array().map(|x| (x * 1e5).round() as i64);
    let turned = |t: [[i64; 3]; 3]| [t, [t[1], t[2], t[0]], [t[2], t[0], t[1]]].into_iter().min().unwrap();
    let mut all: Vec<_> = scene.triangles.iter().map(|t| turned(t.vertices.map(corner))).collect();
    all.sort_unstable();
    all
}

fn fixtures(folder: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures").join(folder)
}

#[test]
fn a_square_is_read_as_it_stands() {
    let scene = Draft::square().scene();
    assert_eq!((scene.triangles.len(), scene.vertices.len(), scene.placements.len()), (2, 4, 1));
    assert_eq!(scene.triangles[1].vertices, [0, 2, 3]);
    assert_eq!(scene.materials[0].reflectance, DVec3::new(0.8, 0.6, 0.4));
    assert_eq!((scene.materials.len(), scene.materials[1].index), (2, None));
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
    assert_eq!(scene.reflectance_at(1, [1.0, 0.0, 0.0], 0.1), scene.materials[0].reflectance);
    assert_eq!(scene.source.buffers.len(), 1);
}

#[test]
fn every_storage_gives_the_same_triangles() {
    let plain = Draft::square();
    let expected = triangles(&plain.scene());
    let agree = |name: &str, draft: &Draft| assert_eq!(triangles(&draft.scene()), expected, "{name}");

    let scene = from_bytes(&plain.gltf(), None, &ImportOptions::default()).unwrap();
    assert_eq!(triangles(&scene), expected, "data URI");

    for (name, component) in [("u8", BYTE), ("u32", INT)] {
        let mut draft = plain.clone();
        draft.indices(component, &[0, 1, 2, 0, 2, 3]);
        agree(name, &draft);
    }
    let mut strip = plain.clone();
    strip.indices(BYTE, &[1, 2, 0, 3]);
    strip.set("/meshes/0/primitives/0/mode", json!(5));
    agree("strip", &strip);

    let mut fan = plain.clone();
    fan.set("/meshes/0/primitives/0/mode", json!(6));
    fan.json["meshes"][0]["primitives"][0].as_object_mut().unwrap().remove("indices");
    agree("fan without indices", &fan);

    let mut interleaved = plain.clone();
    let padded: Vec<f32> = SQUARE.iter().flat_map(|p| [f32::NAN, p[0], p[1], p[2], f32::NAN]).collect();
    interleaved.attribute("POSITION", "VEC3", FLOAT, &floats(&padded));
    interleaved.set("/bufferViews/2/byteStride", json!(20));
    interleaved.set("/accessors/2/byteOffset", json!(4)).set("/accessors/2/count", json!(4));
    agree("interleaved", &interleaved);

    let mut quantized = plain.clone();
    let bytes: Vec<u8> = SQUARE.iter().flatten().map(|x| (x * 255.0) as u8).collect();
    quantized.attribute("POSITION", "VEC3", BYTE, &bytes);
    quantized.set("/accessors/2/normalized", json!(true));
    agree("normalized bytes", &quantized);
    quantized.set("/accessors/2/normalized", json!(false));
    quantized.set("/nodes/1/scale", json!([1.0 / 255.0, 1.0 / 255.0, 1.0 / 255.0]));
    agree("bytes and a scale", &quantized);
}

#[test]
fn sparse_accessors_overwrite_with_and_without_a_base() {
    let mut draft = Draft::square();
    let expected = triangles(&draft.scene());
    let moved = draft.view(&floats(&SQUARE[1..].concat()));
    let places = draft.view(&[1, 2, 3]);
    let sparse = json!({"count": 3, "indices": {"bufferView": places, "componentType": BYTE},
        "values": {"bufferView": moved}});
    let zeros = json!({"componentType": FLOAT, "type": "VEC3", "count": 4, "sparse": sparse});
    let accessor = draft.push_accessor(zeros);
    draft.set("/meshes/0/primitives/0/attributes/POSITION", json!(accessor));
    assert_eq!(triangles(&draft.scene()), expected);

    let base = draft.view(&floats(&[7.0; 12]));
    draft.set(&format!("/accessors/{accessor}/bufferView"), json!(base));
    assert_eq!(draft.scene().vertices[0], DVec3::splat(7.0));
    assert_eq!(draft.scene().vertices[3], DVec3::Y);

    draft.set(&format!("/accessors/{accessor}/count"), json!(3));
    assert!(draft.refusal().contains(&format!("accessor {accessor} has a sparse value for element 3 of 3")));
}

/// The gltf crate's own reader as a second opinion.
#[test]
fn positions_agree_with_the_gltf_crate() {
    let mut draft = Draft::square();
    draft.set("/nodes/0/rotation", json!([0.5, 0.5, 0.5, 0.5])).set("/nodes/1/translation", json!([1, 2, 3]));
    draft.set("/nodes/1/scale", json!([2, 3, -4]));
    let scene = draft.scene();
    let (document, buffers, _) = gltf::import_slice(draft.glb()).unwrap();
    let node = |k| glam::Mat4::from_cols_array_2d(&document.nodes().nth(k).unwrap().transform().matrix());
    let primitive = document.meshes().next().unwrap().primitives().next().unwrap();
    let reader = primitive.reader(|buffer| Some(&buffers[buffer.index()]));
    for (k, position) in reader.read_positions().unwrap().enumerate() {
        let expected = (node(0) * node(1)).transform_point3(position.into()).as_dvec3();
        assert!((scene.vertices[k] - expected).length() < 10.0 * SINGLE, "{k}");
    }
    assert!(scene.placements[0].mirrored);
}

#[test]
fn mirroring_swaps_two_corners_so_that_fronts_stay_fronts() {
    let plain = Draft::square().scene();
    let mut draft = Draft::square();
    draft.set("/nodes/0/scale", json!([-1, 1, 1]));
    let scene = draft.scene();
    let normal = |scene: &Scene| {
        let [a, b, c] = scene.triangles[0].vertices.map(|v| scene.vertices[v as usize]);
        (b - a).cross(c - a)
    };
    assert_eq!((normal(&plain), normal(&scene)), (DVec3::Z, DVec3::Z));
    assert!(scene.placements[0].mirrored && scene.triangles[0].source_vertices == [0, 2, 1]);
    draft.set("/nodes/1/scale", json!([1, -1, 1]));
    assert!(!draft.scene().placements[0].mirrored, "two mirrors make none");
}

#[test]
fn points_and_lines_and_zero_area_are_warnings() {
    let mut draft = Draft::square();
    let line = json!({"attributes": {"POSITION": 0}, "mode": 1});
    draft.set("/meshes/0/primitives/-", line);
    draft.indices(BYTE, &[0, 1, 2, 0, 0, 1, 0, 2, 3]);
    let scene = draft.scene();
    assert_eq!((scene.triangles.len(), scene.placements.len()), (3, 1));
    let warnings = scene.warnings.join("\n");
    assert!(warnings.contains("mesh 0 (\"Square\"), primitive 1: points and lines"), "{warnings}");
    assert!(warnings.contains("primitive 0 (1 of 3): triangles without area"), "{warnings}");
}

#[test]
fn scenes_are_chosen_by_index() {
    let mut draft = Draft::square();
    draft.set("/scenes", json!([{"nodes": []}, {"nodes": [0]}, {"nodes": [1]}]));
    assert!(draft.refusal().contains("no triangles"));
    let with = |scene| {
        from_bytes(&draft.glb(), None, &ImportOptions { scene: Some(scene), ..ImportOptions::default() })
    };
    assert_eq!(with(2).unwrap().placements[0].node, 1);
    let message = with(3).unwrap_err().to_string();
    assert_eq!(message, "there is no scene 3: the file holds 3, 0 to 2");

    // Without scenes, every root is shown; without a default, the first scene.
    let mut draft = Draft::square();
    for key in ["scenes", "scene"] {
        draft.json.as_object_mut().unwrap().remove(key);
    }
    assert_eq!(draft.scene().triangles.len(), 2);
    draft.set("/scenes", json!([{"nodes": [0]}, {"nodes": []}]));
    assert_eq!(draft.scene().triangles.len(), 2);
}

#[test]
fn a_texture_is_averaged_over_the_footprint() {
    let mut draft = Draft::square();
    let [red, green, blue, grey] = [[255, 0, 0], [0, 255, 0], [0, 0, 255], [188, 188, 188]];
    draft.texture(2, &[red, green, blue, grey]);
    let scene = draft.scene();
    assert!(scene.materials[0].textured);
    // Triangle 0 is (0,0), (1,0), (1,1); triangle 1 is (0,0), (1,1), (0,1).
    let lower_right = scene.reflectance_at(0, [0.25, 0.5, 0.25], 0.2);
    let upper_left = scene.reflectance_at(1, [0.25, 0.25, 0.5], 0.2);
    assert!((upper_left - DVec3::X).length() < SINGLE, "{upper_left}");
    let linear = ((188.0 / 255.0 + 0.055) / 1.055_f64).powf(2.4);
    assert!((lower_right - linear).length() < SINGLE, "{lower_right} is not linear {linear}");
    let mean = (DVec3::ONE + linear) / 4.0;
    let whole = scene.reflectance_at(0, [0.5, 0.0, 0.5], 1.0);
    assert!((whole - mean).length() < SINGLE && (scene.materials[0].reflectance - mean).length() < SINGLE);

    // Half a turn more in texture space, one to the left: the same texel at the opposite corner.
    let transform = json!({"KHR_texture_transform": {"rotation": std::f64::consts::PI, "offset": [1, 1]}});
    draft.set("/materials/0/pbrMetallicRoughness/baseColorTexture/extensions", transform);
    let turned = draft.scene().reflectance_at(0, [0.25, 0.5, 0.25], 0.2);
    assert!((turned - DVec3::X).length() < SINGLE, "{turned}");

    // A quarter turn of the image clockwise brings the lower left texel to the upper left.
    let quarter = json!({"rotation": std::f64::consts::FRAC_PI_2, "offset": [0, 1]});
    draft.set("/materials/0/pbrMetallicRoughness/baseColorTexture/extensions/KHR_texture_transform", quarter);
    let turned = draft.scene().reflectance_at(1, [0.25, 0.25, 0.5], 0.2);
    assert!((turned - DVec3::Z).length() < SINGLE, "{turned}");
}

#[test]
fn factors_textures_and_vertex_colours_multiply() {
    let mut draft = Draft::square();
    draft.texture(1, &[[255, 255, 128]]);
    let pbr = json!({"baseColorFactor": [0.5, 0.5, 0.5, 1], "metallicRoughnessTexture": {"index": 0}});
    draft.set("/materials/0/pbrMetallicRoughness", pbr);
    draft.set("/materials/0/emissiveTexture", json!({"index": 0}));
    draft
        .set("/materials/0/extensions", json!({"KHR_materials_emissive_strength": {"emissiveStrength": 20}}));
    draft.attribute("COLOR_0", "VEC3", FLOAT, &floats(&[0.5; 12]));
    let scene = draft.scene();
    // The metallic factor is absent and so 1; its texture's blue is 128 / 255, not sRGB.
    let base = 0.5 * (1.0 - 128.0 / 255.0);
    assert!((scene.materials[0].reflectance - base).length() < SINGLE, "{:?}", scene.materials[0]);
    let here = scene.reflectance_at(0, [0.2, 0.3, 0.5], 0.1);
    assert!((here - 0.5 * base).length() < SINGLE, "{here}");
    let emission = scene.emission_at(0, [0.2, 0.3, 0.5], 0.1);
    let blue = ((128.0 / 255.0 + 0.055) / 1.055_f64).powf(2.4);
    assert!((emission - 20.0 * DVec3::new(1.0, 1.0, blue)).length() < 20.0 * SINGLE, "{emission}");
}

#[test]
fn odd_materials_are_warned_of() {
    let mut draft = Draft::square();
    draft.set("/materials/0/extensions", json!({"KHR_materials_unlit": {}}));
    let scene = draft.scene();
    assert_eq!((scene.materials[0].reflectance, scene.materials[0].emission), (DVec3::ZERO, DVec3::ZERO));
    let warnings = scene.warnings.join("\n");
    assert!(warnings.contains("material 0 (\"Glow\"): KHR_materials_unlit"), "{warnings}");
    assert!(warnings.contains("the lightmap will be black"), "{warnings}");

    let mut draft = Draft::square();
    draft.set("/materials/0", json!({"emissiveFactor": [1, 1, 1], "alphaMode": "MASK"}));
    let warnings = draft.scene().warnings.join("\n");
    assert!(warnings.contains("material 0: fully metallic"), "{warnings}");

    let mut draft = Draft::square();
    draft.texture(1, &[[9, 9, 9]]);
    draft.set("/images/0", json!({"uri": "data:image/png;base64,iVBORw0KGgo="}));
    let scene = draft.scene();
    assert!(scene.warnings.join("\n").contains("image 0 cannot be decoded"), "{:?}", scene.warnings);
    assert_eq!((scene.materials[0].reflectance, scene.materials[0].textured), (DVec3::ONE, false));
    assert_eq!(scene.source.external_images[0].as_ref().unwrap().1, "image/png");
}

/// Alpha is the factor's times the texture's times the vertices', against the cutoff or as it is.
#[test]
fn coverage_follows_alpha() {
    let mut draft = Draft::square();
    draft.set("/materials/0/alphaMode", json!("BLEND"));
    assert!(draft.scene().coverage(0).is_none(), "all of it is there");
    draft.set("/materials/0/pbrMetallicRoughness/baseColorFactor", json!([1, 1, 1, 0.5]));
    let colours = [1.0, 1.0, 1.0, 1.0].repeat(2).into_iter().chain([1.0, 1.0, 1.0, 0.5].repeat(2));
    draft.attribute("COLOR_0", "VEC4", FLOAT, &floats(&colours.collect::<Vec<f32>>()));
    let at = |draft: &Draft, barycentric: [f64; 3]| {
        draft.scene().coverage(0).unwrap().at(DVec3::from_array(barycentric))
    };
    assert!((at(&draft, [1.0, 0.0, 0.0]) - 0.5).abs() < SINGLE);
    assert!((at(&draft, [0.0, 0.0, 1.0]) - 0.25).abs() < SINGLE);
    assert!((at(&draft, [0.5, 0.0, 0.5]) - 0.375).abs() < SINGLE);
    draft.set("/materials/0/alphaMode", json!("MASK")).set("/materials/0/alphaCutoff", json!(0.4));
    assert_eq!([at(&draft, [1.0, 0.0, 0.0]), at(&draft, [0.0, 0.0, 1.0])], [1.0, 0.0]);

    // The upper left of two by two texels is clear; it lies in triangle 1, at the corner (0, 1).
    let mut draft = Draft::square();
    draft.texture_with_alpha(2, &[[0, 0, 0, 0], [0, 0, 0, 255], [0, 0, 0, 255], [0, 0, 0, 255]]);
    draft.set("/materials/0/alphaMode", json!("MASK"));
    draft.set("/materials/0/extensions", json!({"KHR_materials_unlit": {}}));
    let scene = draft.scene();
    let coverage = |triangle, barycentric: [f64; 3]| {
        scene.coverage(triangle).unwrap().at(DVec3::from_array(barycentric))
    };
    assert_eq!(coverage(1, [0.1, 0.1, 0.8]), 0.0);
    assert_eq!([coverage(1, [0.8, 0.1, 0.1]), coverage(0, [0.2, 0.6, 0.2])], [1.0, 1.0]);
}

#[test]
fn lights_stand_where_their_nodes_stand() {
    let mut draft = Draft::square();
    let lights = json!([{"type": "point", "intensity": 40, "color": [1, 0.5, 0.25], "range": 3},
        {"type": "directional"}]);
    draft.set("/extensions", json!({"KHR_lights_punctual": {"lights": lights}}));
    draft.set("/nodes/0/translation", json!([1, 2, 3])).set("/nodes/0/scale", json!([-2, 2, 2]));
    draft.set("/nodes/0/extensions", json!({"KHR_lights_punctual": {"light": 0}}));
    draft.set("/nodes/1/rotation", json!([0, 1, 0, 1]));
    draft.set("/nodes/1/extensions", json!({"KHR_lights_punctual": {"light": 1}}));
    let scene = draft.scene();
    let point = PunctualKind::Point { position: DVec3::new(1.0, 2.0, 3.0), range: 3.0 };
    assert_eq!((scene.lights[0].kind, scene.lights[0].node), (point, 0));
    assert_eq!(scene.lights[0].intensity, DVec3::new(40.0, 20.0, 10.0));
    let PunctualKind::Directional { direction } = scene.lights[1].kind else { panic!("not directional") };
    // The rotation is normalized; -z turned about y points along -x, and the parent's mirror turns that round.
    assert!((direction - DVec3::X).length() < SINGLE, "{direction}");
}

#[test]
fn skins_and_morphs_are_baked_at_rest() {
    let mut draft = Draft::square();
    draft.attribute("JOINTS_0", "VEC4", BYTE, &[0; 16]);
    draft.attribute("WEIGHTS_0", "VEC4", FLOAT, &floats(&[1.0, 0.0, 0.0, 0.0].repeat(4)));
    draft.set("/nodes/-", json!({"name": "Joint", "translation": [0, 0, 5]}));
    draft.set("/scenes/0/nodes", json!([0, 2])).set("/skins", json!([{"joints": [2]}]));
    draft.set("/nodes/1/skin", json!(0)).set("/nodes/1/translation", json!([9, 9, 9]));
    let shift = draft.accessor("VEC3", FLOAT, &floats(&[0.0, 1.0, 0.0].repeat(4)));
    draft.set("/meshes/0/primitives/0/targets", json!([{"POSITION": shift}]));
    draft.set("/meshes/0/weights", json!([0.5]));
    let refused = draft.refusal();
    assert!(refused.contains("no mesh of the scene can hold a lightmap"), "{refused}");
    draft.set("/nodes/-", json!({"name": "Still", "mesh": 1})).set("/scenes/0/nodes", json!([0, 2, 3]));
    let mut still = draft.json["meshes"][0].clone();
    still["primitives"][0].as_object_mut().unwrap().remove("targets");
    draft.set("/meshes/-", still);
    let scene = draft.scene();
    assert_eq!(scene.placements.iter().map(|p| p.node).collect::<Vec<_>>(), [3]);
    assert!(scene.warnings.join("\n").contains("node 1 (\"Wall\"): it moves"), "{:?}", scene.warnings);

    let cast = ImportOptions { dynamic: cobake::options::Dynamic::Cast, ..ImportOptions::default() };
    let scene = from_bytes(&draft.glb(), None, &cast).unwrap();
    assert_eq!(scene.vertices[1], DVec3::new(1.0, 0.5, 5.0), "the node's own transform has no say");
    assert!(!scene.placements[0].settings.bake && scene.placements[1].settings.bake);
    assert!(scene.warnings.join("\n").contains("its rest pose throws shadows"), "{:?}", scene.warnings);
}

/// What an animation moves is dynamic, and so is all below it; weights change a mesh alone.
#[test]
fn animated_nodes_and_those_below_are_dynamic() {
    let mut draft = Draft::square();
    draft.set("/nodes/-", json!({"name": "Still", "mesh": 0})).set("/scenes/0/nodes", json!([0, 2]));
    let target = |path: &str| json!([{"channels": [{"sampler": 0, "target": {"node": 0, "path": path}}]}]);
    let placed = |draft: &Draft| draft.scene().placements.iter().map(|p| p.node).collect::<Vec<_>>();
    draft.set("/animations", target("rotation"));
    assert_eq!(placed(&draft), [2]);
    draft.set("/animations", target("weights"));
    assert_eq!(placed(&draft), [1, 2]);
    let pointer = json!({"KHR_animation_pointer": {"pointer": "/nodes/1/translation"}});
    draft.set("/animations", json!([{"channels": [{"target": {"path": "pointer", "extensions": pointer}}]}]));
    assert_eq!(placed(&draft), [2]);
}

/// Settings hold for a node and all below it; what cannot be followed is refused by name.
#[test]
fn nodes_say_how_they_are_baked() {
    let mut draft = Draft::square();
    draft.set("/nodes/0/extras", json!({"cobake": {"density": 2, "cast": false}}));
    draft.set("/nodes/1/extras", json!({"cobake": {"cast": true, "shine": 1}, "mine": 7}));
    let scene = draft.scene();
    let settings = scene.placements[0].settings;
    assert_eq!((settings.bake, settings.density, settings.cast), (true, 2.0, true));
    assert!(scene.warnings.join("\n").contains("no setting \"shine\""), "{:?}", scene.warnings);
    for (extras, expected) in [
        (json!({"density": 0}), "node 1 (\"Wall\") has extras.cobake.density = 0, which must be a number"),
        (json!({"bake": "no"}), "extras.cobake.bake = \"no\", which must be true or false"),
        (json!(false), "extras.cobake = false, which must be an object"),
        (json!({"bake": false}), "no mesh of the scene can hold a lightmap"),
    ] {
        draft.set("/nodes/1/extras", json!({"cobake": extras}));
        let message = draft.refusal().replace("\\\"", "\"");
        assert!(message.contains(expected), "{message}");
    }
}

/// One property changed for the worse, and what the message must say of it.
#[test]
fn what_is_wrong_is_named() {
    let huge = 2_147_483_648_u64;
    let cases = [
        ("/asset", json!({}), "no asset.version"),
        ("/asset/version", json!("1.0"), "version 1.0"),
        ("/nodes", json!(7), "property nodes is not an array"),
        ("/nodes/1", json!({"mesh": -1}), "node 1 is not valid glTF"),
        ("/nodes/1/children", json!([9]), "node 1 (\"Wall\") refers to node 9, but the last one is node 1"),
        ("/nodes/1/children", json!([0]), "node 0 (\"Root\") is its own ancestor"),
        ("/nodes/0/children", json!([1, 1]), "node 1 (\"Wall\") is reached twice"),
        ("/scenes/0/nodes", json!([0, 1]), "node 1 (\"Wall\") is reached twice"),
        ("/scenes/0/nodes", json!([8]), "scene 0 refers to node 8"),
        ("/scene", json!(4), "there is no scene 4: the file holds one"),
        ("/nodes/0/scale", json!([1, 0, 1]), "node 1 (\"Wall\") is not invertible"),
        ("/nodes/0/rotation", json!([0, 0, 0, 0]), "node 0 (\"Root\") is not invertible"),
        ("/nodes/0/scale", json!([1e300, 1, 1]), "node 1 (\"Wall\")"),
        ("/nodes/0/translation", json!([0, 1e12, 0]), "node 1 (\"Wall\") places vertices more than 1e9 m"),
        ("/nodes/1/mesh", json!(3), "node 1 (\"Wall\") refers to mesh 3"),
        (
            "/meshes/0/primitives/0/material",
            json!(5),
            "mesh 0 (\"Square\"), primitive 0 refers to material 5",
        ),
        ("/meshes/0/primitives/0/mode", json!(7), "primitive 0 has mode 7"),
        ("/meshes/0/primitives/0/indices", json!(6), "primitive 0 refers to accessor 6"),
        ("/meshes/0/primitives/0/indices", json!(0), "accessor 0 is VEC3, and vertex indices must be SCALAR"),
        ("/meshes/0/primitives/0/attributes/COLOR_0", json!(1), "accessor 1 is SCALAR, and COLOR_0"),
        ("/accessors/0/componentType", json!(5125), "accessor 0 has component type 5125, which POSITION"),
        (
            "/accessors/0/count",
            json!(huge),
            "accessor 0 ends at byte 25769803776 of bufferView 0, which has 48",
        ),
        ("/accessors/0/count", json!(u64::MAX), "accessor 0 ends at byte"),
        ("/accessors/0/byteOffset", json!(u64::MAX), "accessor 0 ends at byte"),
        ("/accessors/0/count", json!(2), "vertex index 2 at position 2, but 2 vertices"),
        ("/accessors/0", json!({"componentType": FLOAT, "type": "VEC3", "count": huge}), "no bufferView"),
        ("/bufferViews/0/byteLength", json!(huge), "bufferView 0 ends at byte 2147483648 of buffer 0"),
        ("/bufferViews/0/byteOffset", json!(u64::MAX), "bufferView 0 ends at byte"),
        ("/bufferViews/0/buffer", json!(1), "bufferView 0 refers to buffer 1"),
        ("/bufferViews/0/byteStride", json!(4), "accessor 0 has elements of 12 bytes at a stride of 4"),
        ("/materials/0/emissiveTexture", json!({"index": 2}), "material 0 (\"Glow\") refers to texture 2"),
        ("/extensionsRequired", json!(["KHR_draco_mesh_compression"]), "gltf-transform/cli copy"),
        ("/extensionsRequired", json!(["KHR_texture_basisu"]), "ktxdecompress"),
        ("/extensionsRequired", json!(["ACME_light"]), "requires the extension ACME_light"),
    ];
    for (pointer, value, expected) in cases {
        let mut draft = Draft::square();
        let text = format!("{pointer} = {value}");
        draft.set(pointer, value);
        let message = draft.refusal();
        assert!(message.contains(expected), "{text}: {message}");
    }
}

#[test]
fn buffers_and_positions_that_fail_are_named() {
    for bad in [f32::NAN, f32::INFINITY] {
        let mut draft = Draft::square();
        draft.binary[16..20].copy_from_slice(&bad.to_le_bytes());
        assert!(draft.refusal().contains("mesh 0 (\"Square\"), primitive 0 has a position"), "{bad}");
    }
    let cases = [
        (json!({"byteLength": 500}), "buffer 0 should have 500 bytes and its data has 60"),
        (json!({"byteLength": 60, "uri": "https://a.b/c.bin"}), "buffer 0 refers to \"https://a.b/c.bin\""),
        (json!({"byteLength": 60, "uri": "data:;base64,!!!"}), "buffer 0 holds a data URI that is damaged"),
        (json!({"byteLength": 60, "uri": "square.bin"}), "buffer 0 refers to the file \"square.bin\""),
    ];
    for (buffer, expected) in cases {
        let mut draft = Draft::square();
        draft.set("/buffers", json!([buffer]));
        let message = refusal(&pack(draft.json.to_string().as_bytes(), &draft.binary));
        assert!(message.contains(expected), "{message}");
    }
    let mut draft = Draft::square();
    draft.set("/buffers", json!([{"byteLength": 60}]));
    assert!(refusal(draft.json.to_string().as_bytes()).contains("buffer 0 has no uri"));
}

/// What meshopt compressed is the same square, and the document no longer says that it was.
#[cfg(feature = "meshopt")]
#[test]
fn meshopt_views_are_decoded() {
    let expected = triangles(&Draft::square().scene());
    for name in ["EXT_meshopt_compression", "KHR_meshopt_compression"] {
        let mut draft = Draft::square();
        let vertices = draft.view(&meshopt::encode_vertex_buffer(&SQUARE).unwrap());
        let indices = draft.view(&meshopt::encode_index_buffer(&[0, 1, 2, 0, 2, 3], 4).unwrap());
        for (view, packed, stride, count, mode, length) in
            [(0, vertices, 12, 4, "ATTRIBUTES", 48), (1, indices, 2, 6, "TRIANGLES", 12)]
        {
            let mut extension = draft.json["bufferViews"][packed].clone();
            extension["byteStride"] = json!(stride);
            extension["count"] = json!(count);
            extension["mode"] = json!(mode);
            let extensions = json!({name: extension});
            let packed = json!({"buffer": 0, "byteLength": length, "extensions": extensions});
            draft.set(&format!("/bufferViews/{view}"), packed);
        }
        draft.set("/extensionsUsed", json!([name])).set("/extensionsRequired", json!([name]));
        draft.binary[..60].fill(0x55); // the plain data are not what is read
        let scene = draft.scene();
        assert_eq!(triangles(&scene), expected, "{name}");
        assert!(!scene.source.json.to_string().contains("meshopt"), "{}", scene.source.json);

        let greedy = format!("/bufferViews/0/extensions/{name}/count");
        assert!(draft.set(&greedy, json!(1_u64 << 40)).refusal().contains("claims more elements"));
        draft.set(&greedy, json!(4)).set(&format!("/bufferViews/0/extensions/{name}/byteStride"), json!(10));
        assert!(
            draft.refusal().contains("bufferView 0, compressed by EXT_meshopt_compression, has a byteStride")
        );
    }
}

#[test]
fn instances_become_nodes() {
    let mut draft = Draft::square();
    let places = draft.accessor("VEC3", FLOAT, &floats(&[0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 3.0, 0.0]));
    let turns = draft.accessor("VEC4", FLOAT, &floats(&[0.0, 0.0, 0.0, 1.0].repeat(3)));
    let attributes = json!({"TRANSLATION": places, "ROTATION": turns});
    draft.set("/nodes/1/extensions", json!({"EXT_mesh_gpu_instancing": {"attributes": attributes}}));
    draft.set("/nodes/1/translation", json!([10, 0, 0]));
    let name = json!(["EXT_mesh_gpu_instancing"]);
    draft.set("/extensionsUsed", name.clone()).set("/extensionsRequired", name);
    let scene = draft.scene();
    let corners: Vec<DVec3> = scene.placements.iter().map(|p| scene.vertices[p.vertices.start]).collect();
    assert_eq!(corners, [DVec3::X * 10.0, DVec3::X * 12.0, DVec3::new(10.0, 3.0, 0.0)]);
    let json = &scene.source.json;
    assert_eq!(json["nodes"][1]["children"], json!([2, 3, 4]));
    assert_eq!((&json["nodes"][3]["name"], &json["nodes"][3]["mesh"]), (&json!("Wall.1"), &json!(0)));
    assert!(!json.to_string().contains("EXT_mesh_gpu_instancing"), "{json}");

    draft.set(&format!("/accessors/{turns}/count"), json!(2));
    let message = draft.refusal();
    assert!(message.contains("node 1 (\"Wall\") has 2 values of ROTATION for 3 instances"), "{message}");
}

/// Each folder of `fixtures/bad` says in its README how it is refused.
#[test]
fn bad_fixtures_are_refused_as_they_say() {
    let mut folders: Vec<_> =
        fixtures("bad").read_dir().unwrap().map(|entry| entry.unwrap().path()).collect();
    folders.retain(|path| path.is_dir());
    folders.sort();
    assert!(folders.len() >= 8);
    for folder in folders {
        let readme = std::fs::read_to_string(folder.join("README.md")).unwrap();
        let (file, expected) =
            readme.lines().find_map(|line| line.strip_prefix("Refused: ")?.split_once(": ")).unwrap();
        let message = load(&folder.join(file), &ImportOptions::default()).unwrap_err().to_string();
        assert!(message.contains(expected), "{}: {message}", folder.display());
    }
}

#[test]
fn files_beside_the_document_are_found() {
    let folder = fixtures("import/external-files");
    let scene = load(&folder.join("scene.gltf"), &ImportOptions::default()).unwrap();
    assert_eq!((scene.triangles.len(), scene.warnings.len()), (2, 1), "{:?}", scene.warnings);
    assert!(scene.warnings[0].contains("image 1 refers to") && scene.warnings[0].contains("missing.png"));
    let (bytes, media_type) = scene.source.external_images[0].as_ref().unwrap();
    assert_eq!((&bytes[1..4], media_type.as_str()), (&b"PNG"[..], "image/png"));
    assert!(scene.source.external_images[1].is_none() && scene.materials[0].textured);

    let folder_itself = load(&folder, &ImportOptions::default()).unwrap_err();
    assert!(matches!(folder_itself, ImportError::Directory { .. }));
    let missing = load(&folder.join("no.glb"), &ImportOptions::default()).unwrap_err();
    assert!(matches!(missing, ImportError::Read { .. }) && missing.to_string().contains("no.glb"));
}

/// Marsaglia's xorshift: the same damage on every run.
struct Damage(u64);

impl Damage {
    fn below(&mut self, bound: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 % bound as u64) as usize
    }
}

/// Whatever happens to a file, it is read or refused, and what is read can be sampled.
#[test]
fn damaged_files_never_panic() {
    let mut draft = Draft::square();
    draft.texture(2, &[[255, 0, 0], [0, 255, 0], [0, 0, 255], [99, 99, 99]]);
    let sparse = json!({"count": 1, "indices": {"bufferView": 1, "componentType": SHORT}, "values": {"bufferView": 0}});
    draft.set("/accessors/0/sparse", sparse);
    let whole = draft.glb();
    let json_end = 20 + u32::from_le_bytes(whole[12..16].try_into().unwrap()) as usize;
    let mut damage = Damage(0x9E37_79B9_7F4A_7C15);
    let (mut read, mut refused) = (0, 0);
    for round in 0..1500 {
        let mut bytes = whole.clone();
        match round % 5 {
            0 => bytes.truncate(damage.below(whole.len())),
            1 => {
                let at = damage.below(bytes.len());
                bytes[at] ^= 1 << damage.below(8);
            }
            2 => {
                let at = json_end + damage.below(bytes.len() - json_end);
                bytes[at] = damage.below(256) as u8;
            }
            _ => {
                // Digits for digits keep the JSON well-formed and get further in.
                let digits: Vec<_> = (20..json_end).filter(|&at| bytes[at].is_ascii_digit()).collect();
                for _ in 0..1 + damage.below(3) {
                    bytes[digits[damage.below(digits.len())]] = b"0123456789-e."[damage.below(13)];
                }
            }
        }
        match from_bytes(&bytes, None, &ImportOptions::default()) {
            Ok(scene) => {
                read += 1;
                for triangle in 0..scene.triangles.len() {
                    let reflectance = scene.reflectance_at(triangle, [0.2, 0.3, 0.5], 0.1);
                    assert!(reflectance.cmpge(DVec3::ZERO).all() && reflectance.cmple(DVec3::ONE).all());
                    assert!(scene.emission_at(triangle, [0.2, 0.3, 0.5], 0.1).is_finite());
                }
            }
            Err(_) => refused += 1,
        }
    }
    assert!(
        read > 100 && refused > 100,
        "{read} read and {refused} refused: the damage is too mild or too wild"
    );
}
