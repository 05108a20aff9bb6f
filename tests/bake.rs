//! The whole way, from a file to a lightmapped file: what must hold whatever the stages do inside.

// Clippy lets tests expect things, but not the functions that tests share.
#![allow(clippy::expect_used, clippy::unwrap_used, clippy::panic)]

#[allow(dead_code, reason = "import's tests use the rest")]
#[path = "import/draft.rs"]
mod draft;

use std::f64::consts::PI;
use std::path::{Path, PathBuf};

use cobake::export::decode_exr;
use cobake::options::{BakeOptions, Direct, Quantity, Refine, Resolution, Toggle, Topology};
use cobake::progress::Silent;
use cobake::raster::Lightmap;
use cobake::scene::{ImportOptions, Scene, from_bytes, load};
use cobake::surface::Surface;
use cobake::{BakeResult, bake, bake_scene};
use draft::{Draft, FLOAT, SHORT, floats};
use glam::{DVec2, DVec3, Vec3};
use serde_json::{Value, json};

/// A half float has 11 significant bits; the two sides of a comparison are rounded once each.
const TWO_HALF_FLOATS: f32 = 1.0 / 1024.0;

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures").join(name).join("scene.glb")
}

fn sized(side: u32) -> BakeOptions {
    let mut options = BakeOptions::default();
    options.resolution = Resolution::Size(side);
    options
}

/// The JSON of a GLB, and its binary chunk.
fn unpack(glb: &[u8]) -> (Value, &[u8]) {
    let length = |at: usize| u32::from_le_bytes(glb[at..at + 4].try_into().expect("four bytes")) as usize;
    let json = 20..20 + length(12);
    let binary = json.end + 8..json.end + 8 + length(json.end);
    (serde_json::from_slice(&glb[json]).expect("JSON"), &glb[binary])
}

/// The lightmap at full precision, as a reader of the file finds it.
fn lightmap_of(glb: &[u8]) -> Lightmap {
    let (json, binary) = unpack(glb);
    let index = |value: &Value| value.as_u64().unwrap_or(0) as usize;
    let named = index(&json["extensions"]["COBAKE_lightmap"]["lightmaps"][0]["bufferView"]);
    let view = &json["bufferViews"][named];
    let start = index(&view["byteOffset"]);
    decode_exr(&binary[start..start + index(&view["byteLength"])]).expect("an EXR")
}

/// What the lightmap holds between the texel centres around plane point `p`.
fn lookup(result: &BakeResult, surface: usize, p: DVec2) -> Vec3 {
    let Lightmap { width, height, texels } = &result.lightmap;
    let at = result.atlas.chart_at(surface, p).unwrap().texel(p) - 0.5;
    let (low, fraction) = (at.floor(), at.fract().as_vec2());
    let texel = |x: f64, y: f64| {
        let clamp = |v: f64, side: u32| v.clamp(0.0, f64::from(side - 1)) as usize;
        Vec3::from(texels[clamp(y, *height) * *width as usize + clamp(x, *width)])
    };
    let top = texel(low.x, low.y).lerp(texel(low.x + 1.0, low.y), fraction.x);
    let bottom = texel(low.x, low.y + 1.0).lerp(texel(low.x + 1.0, low.y + 1.0), fraction.x);
    top.lerp(bottom, fraction.y)
}

/// The same input gives the same file, byte by byte, however many threads share the work.
#[test]
fn threads_do_not_change_a_byte() {
    for (name, side) in [("cornell", 64), ("desk", 64)] {
        let with = |threads| {
            let mut options = sized(side);
            options.threads = threads;
            bake(&fixture(name), &options, &mut Silent).expect("baked").glb
        };
        let one = with(1);
        for threads in [2, 8] {
            assert!(one == with(threads), "{name}: {threads} threads give other bytes than one");
        }
    }
}

/// Every geometry with every quantity is a file that the `gltf` crate reads, and that requires nothing new.
#[test]
fn every_kind_of_output_can_be_read() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("out.glb");
    for (name, side) in [("cornell", 64), ("desk", 48)] {
        let source = std::fs::read(fixture(name)).expect("a fixture");
        let (before, _) = unpack(&source);
        let scene = load(&fixture(name), &ImportOptions::default()).expect("a scene");
        for topology in [Topology::Source, Topology::Adaptive] {
            for quantity in [Quantity::Irradiance, Quantity::Radiance, Quantity::Radiosity] {
                if name == "desk" && quantity != Quantity::Irradiance {
                    continue; // what differs between quantities does not depend on the scene
                }
                let mut options = sized(side);
                (options.topology, options.quantity) = (topology, quantity);
                options.unshot_fraction = 0.05;
                let result = bake_scene(&scene, &options, &mut Silent).expect("baked");
                cobake::export::write(&path, &result.glb).expect("written");
                let (document, buffers, images) = gltf::import(&path).expect("readable");
                assert!(document.meshes().count() > 0 && !buffers.is_empty());
                // Radiosity is no irradiance, so there is no image that MOZ_lightmap could name.
                assert_eq!(images.is_empty(), quantity == Quantity::Radiosity, "{topology:?} {quantity:?}");
                let (after, _) = unpack(&result.glb);
                assert_eq!(after["extensionsRequired"], before["extensionsRequired"]);
                let exr = lightmap_of(&result.glb);
                assert!(exr.width <= side && exr.height <= side && exr.width * exr.height > 200);
                assert!(exr.texels.iter().flatten().all(|v| v.is_finite() && *v >= 0.0));
            }
        }
    }
}

/// Radiance is E / π, radiosity π L + ρ E, read from the files.
#[test]
fn quantities_are_related_as_the_readme_says() {
    let scene = load(&fixture("cornell"), &ImportOptions::default()).expect("a scene");
    let of = |quantity| {
        let mut options = sized(64);
        options.quantity = quantity;
        bake_scene(&scene, &options, &mut Silent).expect("baked")
    };
    let irradiance = of(Quantity::Irradiance);
    let [e, l, b] = [&irradiance, &of(Quantity::Radiance), &of(Quantity::Radiosity)]
        .map(|result| lightmap_of(&result.glb).texels);

    let brightest = e.iter().flatten().copied().fold(0.0, f32::max);
    assert!(brightest > 0.1);
    for (e, l) in e.iter().flatten().zip(l.iter().flatten()) {
        let slack = TWO_HALF_FLOATS * e + 1e-6 * brightest;
        assert!((l * std::f32::consts::PI - e).abs() <= slack, "E {e}, L {l}");
    }

    let mut compared = 0;
    for (number, surface) in irradiance.surfaces.iter().enumerate() {
        let Some(material) = scene.materials.get(surface.material).filter(|m| !m.textured) else { continue };
        for region in &surface.regions {
            for [a, b_, c] in &region.triangles {
                let middle = (a + b_ + c) / 3.0;
                let at = irradiance.atlas.chart_at(number, middle).unwrap().texel(middle).floor();
                let index = at.y as usize * irradiance.lightmap.width as usize + at.x as usize;
                let reflected = material.reflectance.min(DVec3::splat(0.95)).as_vec3() * Vec3::from(e[index]);
                let expected = (PI * material.emission).as_vec3() + reflected;
                let difference = (Vec3::from(b[index]) - expected).abs();
                let slack = TWO_HALF_FLOATS * expected + 1e-6 * brightest;
                assert!(
                    difference.cmple(slack).all(),
                    "{}: {} not {expected}",
                    material.name,
                    Vec3::from(b[index])
                );
                compared += 1;
            }
        }
    }
    assert!(compared >= irradiance.surfaces.len());
}

/// A wall of 2 × 2 m in `columns × rows × 2` triangles, a lamp a metre before it, a sheet between.
fn wall(columns: u32, rows: u32) -> Scene {
    let mut draft = Draft::square();
    draft.set(
        "/materials",
        json!([
            {"name": "Paint", "pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.5, 0.5, 1], "metallicFactor": 0}},
            {"name": "Glow", "emissiveFactor": [1, 1, 1]},
            {"name": "Sheet", "doubleSided": true,
                "pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.5, 0.5, 1], "metallicFactor": 0}},
        ]),
    );
    draft.set("/meshes/0/primitives", json!([]));
    let corner = |x: u32, y: u32| [2.0 * x as f32 / columns as f32, 2.0 * y as f32 / rows as f32, 0.0];
    let across = columns + 1;
    let positions: Vec<f32> = (0..=rows).flat_map(|y| (0..across).flat_map(move |x| corner(x, y))).collect();
    let cells = (0..rows).flat_map(|y| (0..columns).map(move |x| y * across + x));
    let indices: Vec<u32> =
        cells.flat_map(|i| [i, i + 1, i + across + 1, i, i + across + 1, i + across]).collect();
    add(&mut draft, 0, &positions, &indices);
    let lamp = [0.75, 0.75, 1.0, 0.75, 1.25, 1.0, 1.25, 1.25, 1.0, 1.25, 0.75, 1.0];
    add(&mut draft, 1, &lamp, &[0, 1, 2, 0, 2, 3]);
    let sheet = [0.5, 0.5, 0.0625, 1.5, 0.5, 0.0625, 1.5, 1.0, 0.0625, 0.5, 1.0, 0.0625];
    add(&mut draft, 2, &sheet, &[0, 1, 2, 0, 2, 3]);
    from_bytes(&draft.glb(), None, &ImportOptions::default()).expect("a scene")
}

fn add(draft: &mut Draft, material: usize, positions: &[f32], indices: &[u32]) {
    let position = draft.accessor("VEC3", FLOAT, &floats(positions));
    let indices: Vec<u8> = indices.iter().flat_map(|&i| (i as u16).to_le_bytes()).collect();
    let indices = draft.accessor("SCALAR", SHORT, &indices);
    draft.set(
        "/meshes/0/primitives/-",
        json!({"attributes": {"POSITION": position}, "indices": indices, "material": material}),
    );
}

/// How finely a wall is triangulated tells nothing about its light: not the elements, not the texels.
#[test]
fn triangulation_of_a_wall_does_not_matter() {
    const ELEMENTS_WITHIN: f64 = 0.1;
    const LIGHT_WITHIN: f32 = 1e-3;
    let of = |columns, rows| {
        let result = bake_scene(&wall(columns, rows), &sized(64), &mut Silent).expect("baked");
        assert_eq!(result.report.scene.triangles, u64::from(2 * columns * rows + 4));
        assert_eq!(result.report.scene.surfaces, 3);
        result
    };
    let coarse = of(1, 1);
    // The middle of the wall lies in the sheet's shadow, its corner does not.
    let light = |result: &BakeResult, x: f64, y: f64| {
        let wall: &Surface = &result.surfaces[0];
        lookup(result, 0, wall.frame.project(DVec3::new(x, y, 0.0)))
    };
    let brightest = coarse.lightmap.texels.iter().flatten().copied().fold(0.0, f32::max);
    assert!(light(&coarse, 1.0, 0.8).x < 0.5 * light(&coarse, 1.0, 1.3).x);

    for (columns, rows) in [(10, 10), (40, 25)] {
        let fine = of(columns, rows);
        let ratio = fine.report.elements.at_end as f64 / coarse.report.elements.at_end as f64;
        assert!((ratio - 1.0).abs() < ELEMENTS_WITHIN, "{columns} × {rows}: {ratio} times the elements");
        for step in 0..40 * 40 {
            let (x, y) = (0.025 + 0.05 * f64::from(step % 40), 0.025 + 0.05 * f64::from(step / 40));
            let difference = (light(&fine, x, y) - light(&coarse, x, y)).abs().max_element();
            assert!(difference <= LIGHT_WITHIN * brightest, "{columns} × {rows} at {x}, {y}: {difference}");
        }
    }
}

/// The paper's own figures, and what asking about the shaft first is good for.
#[test]
fn close_objects_buffers_cost_little_and_ask_about_the_shaft() {
    const PAPER_BYTES: f64 = 5.0;
    const PAPER_TIME: f64 = 0.02;
    let with = |shaft_test| {
        let mut options = sized(128);
        // Elements a few centimetres wide, so that the sheets of paper lie close above them.
        options.subdivision_threshold = Some(0.05);
        (options.refine, options.direct, options.shaft_test) = (Refine::Cob, Direct::Mesh, shaft_test);
        bake(&fixture("desk"), &options, &mut Silent).expect("baked").report
    };
    let report = with(Toggle::On);
    assert!(report.cob.bytes_per_empty <= PAPER_BYTES);
    assert!(report.cob.empty > 0 && report.cob.not_empty > 0);
    assert!(report.cob.splits > 0 && report.cob.splits == report.elements.splits.cob);
    assert!(report.cob.splits_saved_by_shaft > 0);
    if let Some(all) = report.time.total.cpu_seconds {
        assert!(report.cob.seconds <= PAPER_TIME * all, "{} of {all} s", report.cob.seconds);
    }
    let heedless = with(Toggle::Off);
    assert_eq!(heedless.cob.splits_saved_by_shaft, 0);
    assert!(heedless.cob.splits > report.cob.splits);
}

/// Each instance shares all but its place in the lightmap, and gets light of its own.
#[test]
fn instances_get_light_of_their_own() {
    let mut draft = Draft::square();
    let places = draft.accessor("VEC3", FLOAT, &floats(&[0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 3.0, 0.0]));
    let instancing = json!({"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": places}}});
    draft.set("/nodes/1/extensions", instancing);
    draft.set("/extensionsUsed", json!(["EXT_mesh_gpu_instancing"]));
    let result = bake_scene(&draft.scene(), &sized(64), &mut Silent).expect("baked");
    let (json, _) = unpack(&result.glb);
    assert!(!json.to_string().contains("EXT_mesh_gpu_instancing"));
    let attributes: Vec<&Value> = (2..5)
        .map(|node| {
            assert!(json["nodes"][node]["extensions"]["COBAKE_lightmap"].is_object());
            let mesh = json["nodes"][node]["mesh"].as_u64().expect("a mesh") as usize;
            &json["meshes"][mesh]["primitives"][0]["attributes"]
        })
        .collect();
    for (a, b) in [(0, 1), (0, 2), (1, 2)] {
        assert_eq!(attributes[a]["POSITION"], attributes[b]["POSITION"]);
        assert_ne!(attributes[a]["TEXCOORD_1"], attributes[b]["TEXCOORD_1"]);
    }
}

/// A floor under a sun, and a card over half of its width whose `material` and coordinates count; what the floor's
/// texels show beneath the card's middle and beside the card, as a fraction of the sun.
fn under_a_card(material: &Value, side: u32) -> (f64, f64) {
    let result = bake_under_a_card(material, &json!({}), side);
    shadow_of_the_card(&result)
}

/// The card's node has these `extras`.
fn bake_under_a_card(material: &Value, extras: &Value, side: u32) -> BakeResult {
    let mut draft = Draft::square();
    let mut texels = Vec::new();
    for k in 0..64 {
        texels.push([0, 0, 0, if (k / 8 + k % 8) % 2 == 0 { 255 } else { 0 }]);
    }
    draft.texture_with_alpha(8, &texels);
    draft.set("/materials/0", material.clone());
    draft.set("/materials/-", json!({"pbrMetallicRoughness": {"baseColorFactor": [0, 0, 0, 1]}}));
    let floor = [[-2.0, -2.0, -1.0], [3.0, -2.0, -1.0], [3.0, 3.0, -1.0], [-2.0, 3.0, -1.0]].concat();
    let positions = draft.accessor("VEC3", FLOAT, &floats(&floor));
    let indices = draft.json["meshes"][0]["primitives"][0]["indices"].clone();
    draft.set(
        "/meshes/-",
        json!({"primitives": [{"attributes": {"POSITION": positions}, "indices": indices, "material": 1}]}),
    );
    draft.set("/nodes/-", json!({"mesh": 1}));
    draft.set("/nodes/-", json!({"extensions": {"KHR_lights_punctual": {"light": 0}}}));
    draft.set("/scenes/0/nodes", json!([0, 2, 3]));
    draft.set(
        "/extensions",
        json!({"KHR_lights_punctual": {"lights": [{"type": "directional", "intensity": 10}]}}),
    );
    let mut options = sized(side);
    // What the outermost texels reach of the light depends on how texels lie.
    options.density = cobake::options::DensityPolicy::Uniform;
    options.padding = Some(1);
    draft.set("/nodes/1/extras", json!({"cobake": extras}));
    bake_scene(&draft.scene(), &options, &mut Silent).expect("baked")
}

fn shadow_of_the_card(result: &BakeResult) -> (f64, f64) {
    let surface = result.surfaces.iter().position(|s| s.area > 20.0).expect("a floor");
    let at = |x: f64, y: f64| {
        f64::from(lookup(result, surface, result.surfaces[surface].frame.project(DVec3::new(x, y, -1.0))).x)
            / 10.0
    };
    let points = (0..64 * 64).map(|k| at((f64::from(k % 64) + 0.5) / 64.0, (f64::from(k / 64) + 0.5) / 64.0));
    (points.sum::<f64>() / 4096.0, at(2.0, 2.0))
}

/// Half of a card's texels are clear in a checker, so that half of the sun passes; a blended card stops its alpha;
/// an opaque one's alpha says nothing.
#[test]
fn cards_throw_the_shadows_of_their_alpha() {
    let texture = json!({"index": 0});
    let checker = json!({"alphaMode": "MASK", "pbrMetallicRoughness": {"baseColorTexture": texture}});
    let (mean, beside) = under_a_card(&checker, 256);
    assert!((beside - 1.0).abs() < 0.002, "{beside} of the sun beside the card");
    assert!((mean - 0.5).abs() < 0.02, "{mean} of the sun through a checker");

    let veil = json!({"alphaMode": "BLEND", "pbrMetallicRoughness": {"baseColorFactor": [0, 0, 0, 0.25]}});
    let (mean, beside) = under_a_card(&veil, 64);
    // The outermost texels reach into the light.
    assert!((beside - 1.0).abs() < 0.002 && (mean - 0.75).abs() < 0.03, "{mean} beneath, {beside} beside");

    let solid = json!({"pbrMetallicRoughness": {"baseColorFactor": [0, 0, 0, 0.25]}});
    assert!(under_a_card(&solid, 64).0 < 0.05);
}

/// A card without a lightmap still throws a shadow, and one that does not cast still has a lightmap.
#[test]
fn nodes_have_their_say() {
    let solid = json!({"pbrMetallicRoughness": {"baseColorFactor": [0, 0, 0, 1]}});
    let parts = |result: &BakeResult| {
        let (json, _) = unpack(&result.glb);
        let lit = |node: usize| json["nodes"][node]["extensions"]["COBAKE_lightmap"].is_object();
        (lit(1), lit(2), shadow_of_the_card(result).0)
    };
    let unlit = bake_under_a_card(&solid, &json!({"bake": false}), 64);
    let (card, floor, light) = parts(&unlit);
    assert!(!card && floor && light < 0.05, "{card} {floor} {light}");
    let (json, _) = unpack(&unlit.glb);
    assert!(json["meshes"][0]["primitives"][0]["attributes"].get("TEXCOORD_1").is_none());
    let (card, floor, light) = parts(&bake_under_a_card(&solid, &json!({"cast": false}), 64));
    assert!(card && floor && (light - 1.0).abs() < 0.002, "{card} {floor} {light}");

    let density = |extras: Value| {
        let result = bake_under_a_card(&solid, &extras, 64);
        let card = result.surfaces.iter().position(|s| s.area < 2.0).expect("a card");
        let of = |surface: usize| {
            result.atlas.charts_of(surface)[0].texel_from_plane.matrix2.determinant().abs().sqrt()
        };
        of(card) / of(1 - card)
    };
    let ratio = density(json!({"density": 4})) / density(json!({}));
    assert!((ratio / 4.0 - 1.0).abs() < 0.15, "{ratio} times as dense");
}
