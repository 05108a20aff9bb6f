//! `--keep-uv1`: layouts of the input that are kept, and those that cannot be.

// Clippy lets tests expect things, but not the functions that tests share.
#![allow(clippy::expect_used, clippy::unwrap_used, clippy::panic)]

use std::path::Path;

use cobake::compare::{BakedScene, with_bake};
use cobake::options::{BakeOptions, DensityPolicy, Preview, Resolution, Toggle, Topology};
use cobake::progress::Silent;
use cobake::scene::{ImportOptions, Scene, from_bytes};
use cobake::{BakeResult, bake_scene};
use glam::{DVec2, Vec2Swizzles};
use serde_json::{Value, json};

#[path = "import/draft.rs"]
#[allow(dead_code, reason = "each test binary uses a part")]
mod draft;

use draft::{Draft, FLOAT, INT, floats};

/// Two bakes of the same light, one with texels of another density and place, differ by less than this.
const SAME_LIGHT: f64 = 0.03;

/// Texture coordinates in 32 bits are exact to about this.
const EXACT: f64 = 2e-6;

/// Four corners counter-clockwise seen from the front, and their coordinates.
type Quad = ([[f32; 3]; 4], [[f32; 2]; 4]);

/// The rectangle of the layout from `low` to `high` for a quad's corners.
fn cell(low: [f32; 2], high: [f32; 2]) -> [[f32; 2]; 4] {
    [[low[0], high[1]], high, [high[0], low[1]], low]
}

/// A floor of 4 × 4 m, facing up.
fn floor(uv: [[f32; 2]; 4]) -> Vec<Quad> {
    vec![([[-2.0, -2.0, 0.0], [2.0, -2.0, 0.0], [2.0, 2.0, 0.0], [-2.0, 2.0, 0.0]], uv)]
}

/// A box of 1 m, half a metre above the floor, facing outward. Its six sides lie in two rows of three cells between
/// the layout's corners `low` and `high`, a tenth of a cell apart.
fn cube(low: [f32; 2], high: [f32; 2]) -> Vec<Quad> {
    let p = |i: usize| [[-0.5, 0.5][i & 1], [-0.5, 0.5][i >> 1 & 1], [0.5, 1.5][i >> 2 & 1]];
    let sides = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let size = [(high[0] - low[0]) / 3.0, (high[1] - low[1]) / 2.0];
    let place = |k: usize, part: [f32; 2]| {
        let at = [(k % 3) as f32, (k / 3) as f32];
        [0, 1].map(|axis| low[axis] + (at[axis] + part[axis]) * size[axis])
    };
    let quad =
        |(k, side): (usize, &[usize; 4])| (side.map(p), cell(place(k, [0.05; 2]), place(k, [0.95; 2])));
    sides.iter().enumerate().map(quad).collect()
}

/// Nodes above a lamp-lit ground.
struct Model(Draft);

impl Model {
    fn new() -> Self {
        let mut draft = Draft::square();
        let light = json!({"lights": [{"type": "point", "intensity": 100}]});
        draft.set("/extensionsUsed", json!(["KHR_lights_punctual"]));
        draft.set("/extensions", json!({"KHR_lights_punctual": light}));
        draft.set(
            "/materials",
            json!([{"name": "Grey", "pbrMetallicRoughness":
            {"baseColorFactor": [0.5, 0.5, 0.5, 1], "metallicFactor": 0}}]),
        );
        draft.set("/meshes", json!([]));
        draft.set(
            "/nodes",
            json!([{"name": "Root", "children": [1]}, {"name": "Lamp", "translation": [1, 1.2, 3],
            "extensions": {"KHR_lights_punctual": {"light": 0}}}]),
        );
        Self(draft)
    }

    /// Adds a node of one mesh; without coordinates where `has_layout` says so.
    fn node(mut self, name: &str, quads: &[Quad], layout: Layout) -> Self {
        let draft = &mut self.0;
        let points: Vec<f32> = quads.iter().flat_map(|q| q.0).flatten().collect();
        let indices = (0..quads.len() as u32).flat_map(|k| [0, 1, 2, 0, 2, 3].map(|i| 4 * k + i));
        let indices: Vec<u8> = indices.flat_map(u32::to_le_bytes).collect();
        let mut attributes = json!({"POSITION": draft.accessor("VEC3", FLOAT, &floats(&points))});
        if layout == Layout::Given {
            let uv: Vec<f32> = quads.iter().flat_map(|q| q.1).flatten().collect();
            attributes["TEXCOORD_1"] = draft.accessor("VEC2", FLOAT, &floats(&uv)).into();
        }
        let indices = draft.accessor("SCALAR", INT, &indices);
        let (mesh, node) = (count(&draft.json, "meshes"), count(&draft.json, "nodes"));
        let primitive = json!({"attributes": attributes, "indices": indices, "material": 0});
        draft.set("/meshes/-", json!({"name": format!("{name}Mesh"), "primitives": [primitive]}));
        draft.set("/nodes/-", json!({"name": name, "mesh": mesh}));
        draft.set("/nodes/0/children/-", json!(node));
        self
    }

    fn set(mut self, pointer: &str, value: Value) -> Self {
        self.0.set(pointer, value);
        self
    }

    fn scene(&self) -> Scene {
        self.0.scene()
    }

    fn bake(&self, options: &BakeOptions) -> BakeResult {
        bake_scene(&self.scene(), options, &mut Silent).expect("baked")
    }
}

#[derive(Clone, Copy, PartialEq)]
enum Layout {
    Given,
    None,
}

fn count(json: &Value, list: &str) -> usize {
    json[list].as_array().map_or(0, Vec::len)
}

/// The same in two halves that lie apart in the layout, one of them turned.
fn halved_floor() -> Vec<Quad> {
    let (low, high) = ([0.02, 0.02], [0.3, 0.58]);
    let turned = [
        [low[0] + 0.32, low[1]],
        [low[0] + 0.32, high[1]],
        [high[0] + 0.32, high[1]],
        [high[0] + 0.32, low[1]],
    ];
    vec![
        ([[-2.0, -2.0, 0.0], [0.0, -2.0, 0.0], [0.0, 2.0, 0.0], [-2.0, 2.0, 0.0]], cell(low, high)),
        ([[0.0, 2.0, 0.0], [0.0, -2.0, 0.0], [2.0, -2.0, 0.0], [2.0, 2.0, 0.0]], turned),
    ]
}

/// A floor and a box in one layout, with room between.
fn whole() -> Model {
    let floor = halved_floor();
    Model::new().node("Floor", &floor, Layout::Given).node(
        "Box",
        &cube([0.64, 0.02], [0.98, 0.25]),
        Layout::Given,
    )
}

/// The same, each in a unit square of its own; the box is mirrored.
fn each() -> Model {
    Model::new()
        .node("Floor", &floor(cell([0.0, 0.0], [1.0, 1.0])), Layout::Given)
        .node("Box", &cube([0.0, 0.0], [1.0, 0.8]), Layout::Given)
        .set("/nodes/3/scale", json!([-1, 1, 1]))
}

fn options(keep: Toggle) -> BakeOptions {
    let mut options = BakeOptions::default();
    options.resolution = Resolution::Size(256);
    options.density = DensityPolicy::Uniform;
    options.gather_error = Some(0.01);
    options.keep_uv1 = keep;
    options
}

fn reread(result: &BakeResult) -> Scene {
    from_bytes(&result.glb, None, &ImportOptions::default()).expect("a scene")
}

/// The first primitive's set of a node's mesh.
fn accessor(scene: &Scene, node: usize, set: usize) -> Option<u64> {
    let json = &scene.source.json;
    let mesh = json["nodes"][node]["mesh"].as_u64()? as usize;
    json["meshes"][mesh]["primitives"][0]["attributes"][format!("TEXCOORD_{set}")].as_u64()
}

/// The bytes of a tightly packed accessor.
fn bytes(scene: &Scene, accessor: u64) -> Vec<u8> {
    let json = &scene.source.json;
    let accessor = &json["accessors"][accessor as usize];
    let view = &json["bufferViews"][accessor["bufferView"].as_u64().unwrap() as usize];
    let number = |of: &Value, key: &str| of[key].as_u64().unwrap_or(0) as usize;
    let start = number(view, "byteOffset") + number(accessor, "byteOffset");
    scene.source.buffers[0][start..start + 8 * number(accessor, "count")].to_vec()
}

/// How far the light of two bakes differs, looked up in their files as a renderer does.
fn difference(one: &BakeResult, other: &BakeResult) -> f64 {
    let folder = tempfile::tempdir().expect("a folder");
    let load = |name: &str, baked: &BakeResult| {
        let path = folder.path().join(name);
        std::fs::write(&path, &baked.glb).expect("written");
        BakedScene::load(Path::new(&path), None).expect("a bake")
    };
    let figures = with_bake(&load("one.glb", one), &load("other.glb", other)).expect("compared").figures;
    assert!(figures.unmatched == 0 && figures.points > 1000, "{figures:?}");
    figures.rel_l2
}

/// The coordinates of a node's triangles.
fn coordinates(scene: &Scene, node: usize) -> Vec<[DVec2; 3]> {
    let all = scene.texture_coordinates(1).expect("coordinates");
    let own = scene.placements.iter().filter(|p| p.node == node).flat_map(|p| p.triangles.clone());
    own.map(|triangle| all[triangle].expect("coordinates")).collect()
}

fn bounds(triangles: &[[DVec2; 3]]) -> (DVec2, DVec2) {
    let points = triangles.iter().flatten();
    points.fold((DVec2::INFINITY, DVec2::NEG_INFINITY), |(low, high), &p| (low.min(p), high.max(p)))
}

#[test]
fn a_layout_of_the_whole_scene_stays_to_the_byte_and_holds_the_same_light() {
    let model = whole();
    let (kept, own) = (model.bake(&options(Toggle::On)), model.bake(&options(Toggle::Off)));
    let layouts = kept.report.lightmap.layouts;
    assert_eq!(
        (layouts.kept, layouts.not_kept, layouts.shared_texels),
        (2, 0, 0),
        "{:?}",
        kept.report.warnings
    );
    assert_eq!((kept.atlas.width, kept.atlas.height), (256, 256), "the page is the layout's square");
    let (before, after) = (model.scene(), reread(&kept));
    for node in [2, 3] {
        let old = bytes(&before, accessor(&before, node, 1).unwrap());
        assert_eq!(bytes(&after, accessor(&after, node, 1).unwrap()), old);
        assert_eq!(accessor(&after, node, 2), None);
    }
    assert_eq!(kept.surfaces.len(), own.surfaces.len() + 1, "the floor ends where its layout does");
    let difference = difference(&own, &kept);
    assert!(difference < SAME_LIGHT, "{difference}");
    // Without the option all is as ever.
    assert_eq!(own.report.lightmap.layouts, Default::default());
    assert_ne!(coordinates(&reread(&own), 2), coordinates(&before, 2));
}

#[test]
fn layouts_of_a_square_each_are_moved_and_scaled_as_blocks() {
    let model = each();
    let kept = model.bake(&options(Toggle::On));
    assert_eq!(kept.report.lightmap.layouts.kept, 2, "{:?}", kept.report.warnings);
    let (before, after) = (model.scene(), reread(&kept));
    let size = DVec2::new(kept.atlas.width.into(), kept.atlas.height.into());
    let mut blocks = Vec::new();
    for node in [2, 3] {
        let (old, new) = (coordinates(&before, node), coordinates(&after, node));
        // The map by two opposite corners, at most with the axes swapped.
        let ((from, to), (low, high)) = (bounds(&old), bounds(&new));
        let scale = |old: DVec2| (high - low) * size / old;
        let (upright, turned) = (scale(to - from), scale((to - from).yx()));
        let map = |p: DVec2, is_turned: bool| {
            let part = (p - from) / (to - from);
            low + if is_turned { part.yx() } else { part } * (high - low)
        };
        let fits = |is_turned: bool| {
            let pairs = old.iter().flatten().zip(new.iter().flatten());
            pairs.map(|(&p, &q)| map(p, is_turned).distance(q)).fold(0.0, f64::max) < EXACT
        };
        let scale = if fits(false) { upright } else { turned };
        assert!(fits(false) || fits(true), "node {node}: {old:?} {new:?}");
        assert!((scale.x / scale.y - 1.0).abs() < 0.02, "as dense along both axes, to a texel: {scale}");
        assert!(low.min_element() > 0.0 && high.max_element() < 1.0);
        blocks.push((low, high));
    }
    let apart = 2.0 / size.max_element();
    let [(a_low, a_high), (b_low, b_high)] = blocks[..] else { panic!("two") };
    assert!(
        (a_low - b_high).cmpge(DVec2::splat(apart)).any()
            || (b_low - a_high).cmpge(DVec2::splat(apart)).any()
    );
    let difference = difference(&model.bake(&options(Toggle::Off)), &kept);
    assert!(difference < SAME_LIGHT, "{difference}");
}

/// Every texel is as dense as the scene's area over the layout's says, wherever the density is given.
#[test]
fn sizes_densities_budgets_and_pages_are_met() {
    for model in [whole(), each()] {
        let mut asked = options(Toggle::On);
        asked.resolution = Resolution::TexelsPerMetre(20.0);
        let density = model.bake(&asked).report.lightmap.density;
        assert!(density.median > 18.0 && density.median < 26.0, "{density:?}");
        asked.resolution = Resolution::Bytes(60_000);
        let lightmap = model.bake(&asked).report.lightmap;
        let sum = lightmap.bytes + lightmap.png_bytes;
        assert!((40_000..=60_000).contains(&sum), "{sum} bytes");
    }
    let mut asked = options(Toggle::On);
    (asked.resolution, asked.pages) = (Resolution::Size(64), 2);
    let two = each().bake(&asked);
    assert_eq!(two.atlas.pages.len(), 2);
    assert!(difference(&two, &two) < 1e-9);
}

#[test]
fn other_outputs_keep_layouts_too() {
    let usual = whole().bake(&options(Toggle::Off));
    for model in [whole(), each()] {
        let mut asked = options(Toggle::On);
        asked.topology = Topology::Adaptive;
        let adaptive = model.bake(&asked);
        assert!(difference(&adaptive, &adaptive) < 1e-9);
        let mut asked = options(Toggle::On);
        asked.preview = Some(Preview::Unlit);
        assert_eq!(model.bake(&asked).report.lightmap.layouts.kept, 2);
    }
    let mut asked = options(Toggle::On);
    asked.topology = Topology::Adaptive;
    let found = difference(&usual, &whole().bake(&asked));
    assert!(found < SAME_LIGHT, "{found}");
    asked.mips = 1;
    let refusal = bake_scene(&whole().scene(), &asked, &mut Silent).expect_err("no cells").to_string();
    assert!(refusal.contains("mips") && refusal.contains("--keep-uv1"), "{refusal}");
}

/// Where no layout can be kept, the output is what it is without the option, byte for byte, and a warning says why.
#[test]
fn what_is_no_layout_is_named_and_falls_back() {
    let far = floor(cell([0.0, 0.0], [2.5, 1.0]));
    let flat = floor(cell([0.2, 0.4], [0.8, 0.4]));
    // All sides in one place, as a texture is laid on a box.
    let cell_of_all = cell([0.0, 0.0], [1.0, 1.0]);
    let stacked: Vec<Quad> = cube([0.0; 2], [1.0; 2]).into_iter().map(|quad| (quad.0, cell_of_all)).collect();
    let bare = json!({"attributes": {"POSITION": 2}, "indices": 4, "material": 0});
    let model = Model::new()
        .node("Far", &far, Layout::Given)
        .node("Flat", &flat, Layout::Given)
        .set("/nodes/3/translation", json!([0, 0, -0.5]))
        .node("Stacked", &stacked, Layout::Given)
        .node("Bare", &cube([0.0; 2], [1.0; 2]), Layout::None)
        .set("/nodes/5/translation", json!([1.2, 0, 0]))
        .node("Half", &floor(cell([0.0; 2], [1.0; 2])), Layout::Given)
        .set("/nodes/6/translation", json!([0, 0, -1]))
        .set("/meshes/4/primitives/-", bare);
    let (kept, own) = (model.bake(&options(Toggle::On)), model.bake(&options(Toggle::Off)));
    let layouts = kept.report.lightmap.layouts;
    assert_eq!((layouts.kept, layouts.not_kept), (0, 5));
    assert!(kept.glb == own.glb, "the same output");
    let warnings = kept.report.warnings;
    let expected = [
        [
            "node 2 (\"Far\"), mesh 0 (\"FarMesh\") (from 0.000, 0.000 to 2.500, 1.000)",
            "leaves the range from 0 to 1",
        ],
        ["node 3 (\"Flat\"), mesh 1 (\"FlatMesh\") (2 of 2 triangles)", "have no area in TEXCOORD_1"],
        ["node 4 (\"Stacked\"), mesh 2 (\"StackedMesh\") (such as triangles", "overlap in TEXCOORD_1"],
        ["node 5 (\"Bare\"), mesh 3 (\"BareMesh\")", "there is no TEXCOORD_1 to keep"],
        ["node 6 (\"Half\"), mesh 4 (\"HalfMesh\") (primitive 1)", "a primitive has no TEXCOORD_1"],
    ];
    for words in expected {
        let says = |warning: &String| words.iter().all(|word| warning.contains(word));
        assert!(warnings.iter().any(says), "{words:?} in {warnings:?}");
    }
    assert_eq!(own.report.warnings.len() + 5, warnings.len());
}

#[test]
fn a_mesh_without_a_layout_gets_ours_beside_one_that_is_kept() {
    let floor = floor(cell([0.1, 0.1], [0.9, 0.9]));
    let model = Model::new().node("Floor", &floor, Layout::Given).node(
        "Box",
        &cube([0.0; 2], [1.0; 2]),
        Layout::None,
    );
    // Both by light, which the kept layout cannot be.
    let by_light = |keep| {
        let mut options = options(keep);
        options.density = DensityPolicy::Light;
        options
    };
    let (kept, own) = (model.bake(&by_light(Toggle::On)), model.bake(&by_light(Toggle::Off)));
    let layouts = kept.report.lightmap.layouts;
    assert_eq!((layouts.kept, layouts.not_kept), (1, 1));
    assert_eq!(kept.report.options.density, DensityPolicy::Uniform);
    assert_eq!(kept.report.lightmap.charts, 7);
    assert!(
        kept.report.warnings.iter().any(|w| w.contains("(\"Box\")") && w.contains("no TEXCOORD_1 to keep"))
    );
    let difference = difference(&own, &kept);
    assert!(difference < SAME_LIGHT, "{difference}");
}

/// What gets no lightmap takes no room from a layout of all that does.
#[test]
fn what_is_not_lit_leaves_the_layout_whole() {
    let model = whole().set("/nodes/3/extras", json!({"cobake": {"bake": false}}));
    let kept = model.bake(&options(Toggle::On));
    assert_eq!((kept.atlas.width, kept.atlas.charts.len()), (256, 2));
    let scene = reread(&kept);
    let old = bytes(&model.scene(), accessor(&model.scene(), 2, 1).unwrap());
    assert_eq!(bytes(&scene, accessor(&scene, 2, 1).unwrap()), old);
}

/// Textures that read set 1 go on doing so where it stays, and read set 2 where it is moved.
#[test]
fn textures_on_the_same_set_find_their_coordinates() {
    for (model, set) in [(whole(), 1), (each(), 2)] {
        let mut model = model;
        model.0.texture(1, &[[128, 128, 128]]);
        let base = json!({"metallicFactor": 0, "baseColorTexture": {"index": 0, "texCoord": 1}});
        let model = model.set("/materials/0/pbrMetallicRoughness", base);
        let old = bytes(&model.scene(), accessor(&model.scene(), 3, 1).unwrap());
        let scene = reread(&model.bake(&options(Toggle::On)));
        assert_eq!(bytes(&scene, accessor(&scene, 3, set).unwrap()), old);
        let material = &scene.source.json["materials"][0];
        assert_eq!(material["pbrMetallicRoughness"]["baseColorTexture"]["texCoord"], set);
        assert_eq!(material["extensions"]["MOZ_lightmap"]["texCoord"], 1);
    }
}

/// Nodes whose layouts meet by a hair are parts of one; by more, each is a block.
#[test]
fn layouts_that_hardly_meet_are_one() {
    let page = |from: f32| {
        let upper = floor(cell([from, 0.0], [from + 0.4, 0.4]));
        let model = Model::new()
            .node("Lower", &floor(cell([0.0, 0.0], [0.5, 0.5])), Layout::Given)
            .node("Upper", &upper, Layout::Given)
            .set("/nodes/3/translation", json!([0, 0, 0.5]));
        let kept = model.bake(&options(Toggle::On));
        assert_eq!(kept.report.lightmap.layouts.kept, 2);
        let stays = coordinates(&reread(&kept), 3) == coordinates(&model.scene(), 3);
        (stays, kept.report.lightmap.layouts.shared_texels > 0)
    };
    assert_eq!(page(0.55), (true, false));
    assert_eq!(page(0.497), (true, true));
    assert_eq!(page(0.45), (false, false));
}

/// Sides of a box that touch in the layout, but not where they do on the box, share texels; so they do not with room
/// between.
#[test]
fn light_that_bleeds_is_counted() {
    let touching: Vec<Quad> = (0..)
        .zip(cube([0.0; 2], [1.0; 2]))
        .map(|(k, quad)| {
            let low = [(k % 3) as f32 / 3.0, (k / 3) as f32 / 2.0];
            (quad.0, cell(low, [low[0] + 1.0 / 3.0, low[1] + 0.5]))
        })
        .collect();
    let bake = |cube: &[Quad]| Model::new().node("Box", cube, Layout::Given).bake(&options(Toggle::On));
    let close = bake(&touching);
    let layouts = close.report.lightmap.layouts;
    assert_eq!(layouts.kept, 1, "{:?}", close.report.warnings);
    // Two columns or rows of texels along seven sides of cells.
    assert!((800..3000).contains(&layouts.shared_texels), "{layouts:?}");
    let count = format!("{} of ", layouts.shared_texels);
    assert!(close.report.warnings.iter().any(|w| w.contains(&count) && w.contains("--keep-uv1")));
    let apart = bake(&cube([0.0; 2], [1.0; 2]));
    assert_eq!(apart.report.lightmap.layouts.shared_texels, 0, "{:?}", apart.report.warnings);
}

/// A strip that bends, laid out in one piece: what goes on in its neighbour shares texels with it, and rightly so. It
/// folds over itself a little, as automatic layouts do.
#[test]
fn curved_layouts_in_one_piece_are_kept() {
    let turn = |k: usize| {
        let (sin, cos) = (std::f32::consts::PI * k as f32 / 24.0).sin_cos();
        [cos, sin]
    };
    let quad = |k: usize, fold: f32| {
        let ([a, b], [c, d]) = (turn(k), turn(k + 1));
        let (from, to) = (0.05 + 0.9 * k as f32 / 24.0, 0.05 + 0.9 * (k as f32 + 1.0 + fold) / 24.0);
        // Facing inward, which is toward the lamp.
        (
            [[a, -1.0, b], [c, -1.0, d], [c, 1.0, d], [a, 1.0, b]],
            [[from, 0.1], [to, 0.1], [to, 0.6], [from, 0.6]],
        )
    };
    let strip =
        |fold: f32| -> Vec<Quad> { (0..24).map(|k| quad(k, if k == 9 { fold } else { 0.0 })).collect() };
    let bake = |fold: f32, keep| {
        let model = Model::new().node("Arch", &strip(fold), Layout::Given);
        let model = model.set("/nodes/1/translation", json!([0.2, 0.1, 0.1]));
        model.bake(&options(keep))
    };
    let (kept, own) = (bake(0.0, Toggle::On), bake(0.0, Toggle::Off));
    let layouts = kept.report.lightmap.layouts;
    assert_eq!((layouts.kept, layouts.shared_texels), (1, 0), "{:?}", kept.report.warnings);
    let difference = difference(&own, &kept);
    assert!(difference < SAME_LIGHT, "{difference}");
    let folded = bake(0.05, Toggle::On);
    assert_eq!(folded.report.lightmap.layouts.kept, 1);
    assert!(
        folded.report.warnings.iter().any(|w| w.contains("overlap a little")),
        "{:?}",
        folded.report.warnings
    );
    assert_eq!(bake(5.0, Toggle::On).report.lightmap.layouts.kept, 0);
}
