//! Several lightmap pages: what does not fit one fits two, and every triangle finds its light on its own page.

// Clippy lets tests expect things, but not the functions that tests share.
#![allow(clippy::expect_used, clippy::unwrap_used, clippy::panic)]

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::Command;

use cobake::compare::{BakedScene, with_bake};
use cobake::error::Error;
use cobake::options::{BakeOptions, DensityPolicy, Preview, Resolution, Topology};
use cobake::progress::Silent;
use cobake::scene::{ImportOptions, Scene, from_bytes};
use cobake::unwrap::UnwrapError;
use cobake::{BakeResult, bake};
use glam::{DVec2, DVec3};
use serde_json::Value;

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures").join(name).join("scene.glb")
}

/// As little work as tells what pages do.
fn options(side: u32, pages: u32) -> BakeOptions {
    let mut options = BakeOptions::default();
    options.resolution = Resolution::Size(side);
    options.pages = pages;
    options.gather_error = Some(0.02);
    options
}

fn baked(name: &str, options: &BakeOptions) -> BakeResult {
    bake(&fixture(name), options, &mut Silent).expect("baked")
}

fn reread(glb: &[u8]) -> Scene {
    from_bytes(glb, None, &ImportOptions::default()).expect("a scene")
}

/// The page that a node names.
fn page_of(scene: &Scene, node: usize) -> Option<usize> {
    let page = &scene.source.json["nodes"][node]["extensions"]["COBAKE_lightmap"]["lightmap"];
    page.as_u64().map(|page| page as usize)
}

/// The texture of the material of a primitive, which the light is read from.
fn light_texture(scene: &Scene, mesh: usize, primitive: usize) -> Option<usize> {
    let json = &scene.source.json;
    let material = json["meshes"][mesh]["primitives"][primitive]["material"].as_u64()?;
    let material = &json["materials"][material as usize];
    let index = &material["extensions"]["MOZ_lightmap"]["index"];
    let index = index.as_u64().or(material["pbrMetallicRoughness"]["baseColorTexture"]["index"].as_u64());
    index.map(|index| index as usize)
}

fn area([a, b, c]: [DVec3; 3]) -> f64 {
    0.5 * (b - a).cross(c - a).length()
}

/// Whether some chart on `page` shows each of a triangle's corners where its coordinates are.
fn is_shown(result: &BakeResult, page: usize, corners: [DVec3; 3], coordinates: [DVec2; 3]) -> bool {
    let area = result.atlas.pages[page];
    let size = DVec2::new(area.width.into(), area.height.into());
    result.atlas.charts.iter().filter(|chart| chart.page == page).any(|chart| {
        let frame = &result.surfaces[chart.surface].frame;
        corners.iter().zip(coordinates).all(|(&corner, at)| {
            let point = frame.project(corner);
            let texel = chart.texel(point) - DVec2::new(0.0, area.row.into());
            frame.lift(point).distance(corner) < 1e-4 && texel.distance(at * size) < 0.02
        })
    })
}

/// Every lit triangle lies on a chart of the page that its node names, and its material shows that page; returns
/// the lit area.
fn check_triangles(result: &BakeResult) -> f64 {
    let scene = reread(&result.glb);
    let coordinates = scene.texture_coordinates(1).expect("coordinates");
    let mut textures = vec![BTreeSet::new(); result.atlas.pages.len()];
    let mut lit = 0.0;
    for (triangle, coordinates) in scene.triangles.iter().zip(coordinates) {
        let placement = &scene.placements[triangle.placement as usize];
        let page = page_of(&scene, placement.node).expect("all of the fixture is lit");
        let corners = triangle.vertices.map(|v| scene.vertices[v as usize]);
        let coordinates = coordinates.expect("coordinates");
        if area(corners) > 1e-9 {
            assert!(is_shown(result, page, corners, coordinates), "{corners:?} at {coordinates:?} of {page}");
            lit += area(corners);
        }
        textures[page].extend(light_texture(&scene, placement.mesh, placement.primitive));
    }
    for (page, own) in textures.iter().enumerate() {
        assert_eq!(own.len(), 1, "page {page} is one texture");
        assert!(textures[..page].iter().all(|other| other.is_disjoint(own)), "which no other page is");
    }
    lit
}

#[test]
fn what_does_not_fit_one_page_fits_two() {
    let with = |pages| {
        let mut options = options(24, pages);
        options.density = DensityPolicy::Uniform;
        bake(&fixture("desk"), &options, &mut Silent)
    };
    let refusal = with(1).expect_err("one is too few");
    assert!(matches!(refusal, Error::Unwrap(UnwrapError::TooSmall { side: 24, .. })), "{refusal}");
    assert!(refusal.to_string().contains("--pages"), "{refusal}");
    let two = with(2).expect("two are enough");
    assert_eq!(two.atlas.pages.len(), 2);
    assert!(two.atlas.pages.iter().all(|page| page.width <= 24 && page.height <= 24));
    check_triangles(&two);
}

#[test]
fn every_triangle_finds_its_light_on_its_own_page() {
    let changes: [&dyn Fn(&mut BakeOptions); 4] =
        [&|_| {}, &|o| o.topology = Topology::Adaptive, &|o| o.mips = 2, &|o| {
            o.preview = Some(Preview::Unlit);
            o.density = DensityPolicy::Uniform;
        }];
    for name in ["cornell", "desk"] {
        let whole = check_triangles(&baked(name, &options(64, 1)));
        for (index, change) in changes.iter().enumerate() {
            let mut options = options(64, 3);
            change(&mut options);
            let result = baked(name, &options);
            assert_eq!(result.atlas.pages.len(), 3, "{name}, {index}");
            let lit = check_triangles(&result);
            assert!((lit / whole - 1.0).abs() < 1e-5, "{name}, {index}: {lit} of {whole} m²");
        }
    }
}

/// A node whose triangles lie on several pages keeps all that it had; new nodes are its children and no more than
/// places for meshes.
#[test]
fn nodes_stay_what_they_were() {
    let result = baked("cornell", &options(48, 4));
    let before = std::fs::read(fixture("cornell")).expect("read");
    let before = reread(&before).source.json;
    let after = reread(&result.glb).source.json;
    let nodes = |json: &Value| json["nodes"].as_array().expect("nodes").clone();
    let (before, after) = (nodes(&before), nodes(&after));
    assert!(after.len() > before.len(), "some node lies on two pages");
    for (old, new) in before.iter().zip(&after) {
        for (key, value) in old.as_object().expect("a node") {
            assert!(
                ["mesh", "children", "extensions"].contains(&key.as_str()) || new[key] == *value,
                "{key}"
            );
        }
    }
    for (index, node) in after.iter().enumerate().skip(before.len()) {
        let keys: Vec<_> = node.as_object().expect("a node").keys().map(String::as_str).collect();
        assert_eq!(keys, ["name", "mesh", "extensions"]);
        let is_parent = |parent: &&Value| {
            parent["children"].as_array().is_some_and(|list| list.contains(&Value::from(index)))
        };
        let parents: Vec<_> = after.iter().filter(is_parent).collect();
        assert_eq!(parents.len(), 1);
        assert_eq!(parents[0]["name"], node["name"]);
        assert_ne!(parents[0]["extensions"], node["extensions"]);
    }
}

/// As many texels show the same light, on however many pages they lie.
#[test]
fn two_pages_show_what_a_larger_one_shows() {
    let folder = tempfile::tempdir().expect("a folder");
    let scene = |name: &str, options: &BakeOptions| {
        let path = folder.path().join(name);
        let result = baked("cornell", options);
        std::fs::write(&path, &result.glb).expect("written");
        (BakedScene::load(&path, None).expect("a bake"), result)
    };
    let (one, _) = scene("one.glb", &options(181, 1));
    let (two, result) = scene("two.glb", &options(128, 2));
    let figures = with_bake(&one, &two).expect("compared").figures;
    assert!(figures.rel_l2 < 0.01 && figures.bias.abs() < 0.001, "{figures:?}");
    assert_eq!(figures.unmatched, 0);

    let report = result.report.lightmap;
    assert_eq!(report.pages.len(), 2);
    assert_eq!(report.pages.iter().map(|page| page.bytes).sum::<u64>(), report.bytes);
    assert_eq!(report.pages.iter().map(|page| page.png_bytes).sum::<u64>(), report.png_bytes);
    assert!(report.pages.iter().all(|page| page.bytes > 1000 && page.png_bytes > 1000 && page.charts > 0));
    // The charts were made to agree across pages as well.
    assert!(report.seams.after < 0.5 * report.seams.before, "{:?}", report.seams);
}

#[test]
fn pages_are_the_same_at_any_thread_count_and_replace_those_of_an_earlier_bake() {
    let with = |threads| {
        let mut options = options(64, 2);
        options.threads = threads;
        baked("desk", &options).glb
    };
    let glb = with(1);
    assert!(glb == with(3));
    let scene = reread(&glb);
    for pages in [1, 3] {
        let again = cobake::bake_scene(&scene, &options(64, pages), &mut Silent).expect("baked again");
        check_triangles(&again);
        let json = reread(&again.glb).source.json;
        let lightmaps = json["extensions"]["COBAKE_lightmap"]["lightmaps"].as_array().expect("lightmaps");
        assert_eq!(lightmaps.len(), pages as usize);
    }
}

#[test]
fn files_of_their_own_are_one_a_page() {
    let folder = tempfile::tempdir().expect("a folder");
    let input = folder.path().join("in.glb");
    std::fs::copy(fixture("cornell"), &input).expect("copied");
    let run = |exr: &str| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_cobake"));
        command.current_dir(folder.path()).args(["bake", "in.glb", "-o", "out.glb", "--quiet"]);
        command.args(["--size", "32", "--pages", "2", "--gather-error", "0.05", "--exr", exr]);
        command.output().expect("it runs")
    };
    let output = run("light.exr");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    for name in ["light.exr", "light-1.exr"] {
        let bytes = std::fs::read(folder.path().join(name)).expect(name);
        let map = cobake::export::decode_exr(&bytes).expect("an EXR");
        assert!(map.width <= 32 && map.height <= 32 && map.width > 16, "{} × {}", map.width, map.height);
    }
    assert!(!folder.path().join("light-2.exr").exists());

    // The second page would take the input's name.
    std::fs::rename(&input, folder.path().join("in-1.glb")).expect("renamed");
    let mut command = Command::new(env!("CARGO_BIN_EXE_cobake"));
    command.current_dir(folder.path()).args(["bake", "in-1.glb", "-o", "o.glb", "--size", "32"]);
    let output = command.args(["--pages", "2", "--exr", "in.glb"]).output().expect("it runs");
    assert_eq!(output.status.code(), Some(2), "{}", String::from_utf8_lossy(&output.stderr));
}

#[test]
fn numbers_of_pages_out_of_range_are_refused() {
    for pages in [0, 65] {
        assert_eq!(options(64, pages).validate().expect_err("out of range").option, "pages");
    }
}
