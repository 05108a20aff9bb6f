//! Byte budgets, gutters for mip maps, and texels by node: what is asked for holds in the file.

// Clippy lets tests expect things, but not the functions that tests share.
#![allow(clippy::expect_used, clippy::unwrap_used, clippy::panic)]

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use cobake::compare::{BakedScene, ReferencePoints, with_reference};
use cobake::error::Error;
use cobake::options::{BakeOptions, DensityPolicy, Quantity, Resolution, Topology};
use cobake::progress::Silent;
use cobake::raster::sites;
use cobake::scene::{ImportOptions, load};
use cobake::{BakeResult, bake, bake_scene};
use serde_json::Value;

fn fixture(name: &str, file: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures").join(name).join(file)
}

/// As little work as tells what a budget does.
fn options(resolution: Resolution) -> BakeOptions {
    let mut options = BakeOptions::default();
    options.resolution = resolution;
    options.gather_error = Some(0.02);
    options
}

fn baked(name: &str, options: &BakeOptions) -> BakeResult {
    bake(&fixture(name, "scene.glb"), options, &mut Silent).expect("baked")
}

/// The bytes of the lightmaps in the file: the EXR's and the PNG's views, each with what aligns the next one.
fn bytes_in_file(glb: &[u8]) -> u64 {
    let length = u32::from_le_bytes(glb[12..16].try_into().expect("four bytes")) as usize;
    let json: Value = serde_json::from_slice(&glb[20..20 + length]).expect("JSON");
    let view = |index: &Value| {
        let view = &json["bufferViews"][index.as_u64().expect("a view") as usize];
        view["byteLength"].as_u64().expect("a length").next_multiple_of(4)
    };
    let exr = view(&json["extensions"]["COBAKE_lightmap"]["lightmaps"][0]["bufferView"]);
    let images = json["images"].as_array().into_iter().flatten();
    exr + images.filter(|i| i["name"] == "lightmap0").map(|i| view(&i["bufferView"])).sum::<u64>()
}

/// Root mean square error at the fixture's reference points, all sets together.
fn error(name: &str, glb: &[u8]) -> f64 {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("out.glb");
    std::fs::write(&path, glb).expect("written");
    let scene = BakedScene::load(&path, None).expect("a bake");
    let points = ReferencePoints::load(&fixture(name, "reference.npz")).expect("points");
    let figures = with_reference(&scene, &points).expect("compared");
    let (sum, count) = figures.sets().fold((0.0, 0.0), |(sum, count), (_, set)| {
        let n = set.n as f64;
        (sum + n * set.rrmse.powi(2), count + n)
    });
    (sum / count).sqrt()
}

/// Never a byte over, hardly a tenth under; more bytes are more texels and less error.
#[test]
fn budgets_hold_and_are_used() {
    for name in ["cornell", "desk"] {
        let mut errors: Vec<f64> = Vec::new();
        let mut last = 0;
        for kib in [16, 48, 128, 400, 1000] {
            let budget = kib * 1024;
            let result = baked(name, &options(Resolution::Bytes(budget)));
            let report = result.report.lightmap;
            let written = bytes_in_file(&result.glb);
            assert!(written <= budget, "{name}: {written} bytes of {budget}");
            assert!(written as f64 > 0.88 * budget as f64, "{name}: {written} bytes of {budget}");
            let told = report.bytes.next_multiple_of(4) + report.png_bytes.next_multiple_of(4);
            assert_eq!(told, written);
            assert_eq!((result.atlas.width % 4, result.atlas.height % 4), (0, 0));
            let texels = result.report.texels.covered;
            assert!(texels > last, "{name} at {kib} KiB: {texels} texels after {last}");
            last = texels;
            errors.push(error(name, &result.glb));
        }
        // What the solver leaves does not get less with more texels, and single points decide on much of the rest.
        assert!(errors.windows(2).all(|e| e[1] < 1.25 * e[0]), "{name}: {errors:?}");
        assert!(errors[4] < 0.7 * errors[0], "{name}: {errors:?}");
    }
}

#[test]
fn budgets_hold_for_every_kind_of_output() {
    let scene = load(&fixture("cornell", "scene.glb"), &ImportOptions::default()).expect("a scene");
    let budget = 60_000;
    let with = |change: &dyn Fn(&mut BakeOptions)| {
        let mut options = options(Resolution::Bytes(budget));
        change(&mut options);
        let result = bake_scene(&scene, &options, &mut Silent).expect("baked");
        let written = bytes_in_file(&result.glb);
        assert!(written <= budget && written as f64 > 0.88 * budget as f64, "{written}, {options:?}");
        result
    };
    with(&|o| o.density = DensityPolicy::Uniform);
    with(&|o| o.topology = Topology::Adaptive);
    let radiosity = with(&|o| o.quantity = Quantity::Radiosity);
    assert_eq!(radiosity.report.lightmap.png_bytes, 0, "radiosity has no PNG that could take bytes");
    let mips = with(&|o| o.mips = 2);
    assert_eq!((mips.atlas.width % 4, mips.atlas.height % 4, mips.atlas.gutter), (0, 0, 4));
}

/// What cannot be done is refused with the least figure that can, which then works.
#[test]
fn a_budget_below_the_least_is_refused() {
    for name in ["cornell", "desk"] {
        let path = fixture(name, "scene.glb");
        let refusal = bake(&path, &options(Resolution::Bytes(100)), &mut Silent).expect_err("too small");
        let Error::Budget { budget: 100, least } = refusal else { panic!("{refusal}") };
        let text = refusal.to_string();
        assert!(text.contains(&least.to_string()), "{text}");
        let kib: u64 = text
            .split_once("--budget ")
            .and_then(|(_, rest)| rest.split_once("KiB"))
            .and_then(|(figure, _)| figure.parse().ok())
            .expect("a figure");
        let result = baked(name, &options(Resolution::Bytes(kib * 1024)));
        assert!(bytes_in_file(&result.glb) <= kib * 1024, "{name}: {kib} KiB");
    }
    let zero = options(Resolution::Bytes(0)).validate().expect_err("nothing");
    assert_eq!(zero.option, "budget");
    assert!(options(Resolution::Bytes(1 << 32)).validate().is_err());
}

#[test]
fn budgets_give_the_same_bytes_at_any_thread_count() {
    let with = |threads| {
        let mut options = options(Resolution::Bytes(80_000));
        options.threads = threads;
        baked("desk", &options).glb
    };
    let one = with(1);
    assert!(one == with(2) && one == with(7));
}

/// In every mip level lookups inside a chart touch texels that are means of its own cell's only.
#[test]
fn mip_levels_show_each_chart_alone() {
    let levels = 3;
    let mut options = options(Resolution::Size(256));
    options.mips = levels;
    let result = baked("cornell", &options);
    let (atlas, page) = (&result.atlas, &result.lightmap);
    assert_eq!((atlas.width % 8, atlas.height % 8, atlas.gutter), (0, 0, 8));
    let sites = sites(&result.surfaces, atlas, &|_, _| true);
    assert!(sites.len() > 10_000);
    for level in 1..=levels {
        let side = f64::from(1 << level);
        // Whose texels each texel of the level is made of.
        let mut owners: BTreeMap<(i64, i64), u32> = BTreeMap::new();
        for site in &sites {
            let block = (i64::from(site.x >> level), i64::from(site.y >> level));
            let owner = *owners.entry(block).or_insert(site.chart);
            assert_eq!(owner, site.chart, "level {level}, {block:?} shows two charts");
        }
        for site in &sites {
            let p = atlas.charts[site.chart as usize].texel(site.point) / side - 0.5;
            let taps =
                [p.x.floor(), p.x.ceil()].into_iter().flat_map(|x| [(x, p.y.floor()), (x, p.y.ceil())]);
            for block in taps.map(|(x, y)| (x as i64, y as i64)) {
                assert!(block.0 >= 0 && block.1 >= 0, "level {level}: a lookup at {p} leaves the page");
                let owner = owners.get(&block).unwrap_or(&site.chart);
                assert_eq!(*owner, site.chart, "level {level}: a lookup at {p} touches {block:?}");
            }
        }
    }
    // Nothing beside a chart that is lit all over is left dark.
    let texel = |x: u32, y: u32| page.texels[y as usize * page.width as usize + x as usize][0];
    let mut looked_at = 0;
    for chart in sites.chunk_by(|a, b| a.chart == b.chart) {
        if chart.iter().any(|s| texel(s.x, s.y) <= 0.0) {
            continue;
        }
        for site in chart {
            let block = (0..64).map(|k| (site.x / 8 * 8 + k % 8, site.y / 8 * 8 + k / 8));
            assert!(block.into_iter().all(|(x, y)| texel(x, y) > 0.0), "beside {}, {}", site.x, site.y);
            looked_at += 1;
        }
    }
    assert!(looked_at > 5_000, "{looked_at}");
    options.mips = 5;
    assert_eq!(options.validate().expect_err("too many").option, "mips");
}

/// Texels a metre on what a node's mesh shows, root mean square by area.
fn density_of(result: &BakeResult, scene: &cobake::scene::Scene, node: usize) -> f64 {
    let (mut texels, mut area) = (0.0, 0.0);
    for (index, surface) in result.surfaces.iter().enumerate() {
        if scene.placements[surface.placement].node == node {
            for chart in result.atlas.charts_of(index) {
                // The parts are rectangles of which nearly all is the surface's.
                let ring = &chart.outline;
                let part: f64 =
                    (2..ring.len()).map(|k| (ring[k - 1] - ring[0]).perp_dot(ring[k] - ring[0]) / 2.0).sum();
                texels += part * chart.texel_from_plane.matrix2.determinant().abs();
                area += part;
            }
        }
    }
    (texels / area).sqrt()
}

/// A node of factor 2 gets about twice the texels a metre, others keep about theirs.
#[test]
fn nodes_get_the_density_that_they_are_given() {
    let scene = load(&fixture("desk", "scene.glb"), &ImportOptions::default()).expect("a scene");
    let area = |node: usize, result: &BakeResult| {
        let own = result.surfaces.iter().filter(|s| scene.placements[s.placement].node == node);
        own.map(|s| s.area).sum::<f64>()
    };
    for (policy, tolerance) in [(DensityPolicy::Uniform, 0.1), (DensityPolicy::Light, 0.3)] {
        let mut options = options(Resolution::Size(256));
        options.density = policy;
        let plain = bake_scene(&scene, &options, &mut Silent).expect("baked");
        let nodes: std::collections::BTreeSet<usize> = scene.placements.iter().map(|p| p.node).collect();
        // Not the largest, which all others would have to give way to.
        let mut nodes: Vec<usize> = nodes.into_iter().collect();
        nodes.sort_by(|a, b| area(*b, &plain).total_cmp(&area(*a, &plain)));
        let (chosen, other) = (nodes[1], nodes[0]);
        for factor in [2.0, 0.5] {
            options.node_density = BTreeMap::from([(chosen, factor)]);
            let weighed = bake_scene(&scene, &options, &mut Silent).expect("baked");
            let ratio = |node| density_of(&weighed, &scene, node) / density_of(&plain, &scene, node);
            // Against the other node, since the page is as large as before.
            let relative = ratio(chosen) / ratio(other);
            assert!(
                (relative / factor).ln().abs() < tolerance,
                "{policy:?}: {relative} for {factor}, the others {}",
                ratio(other)
            );
        }
    }
    let mut options = options(Resolution::Size(64));
    for factor in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        options.node_density = BTreeMap::from([(0, factor)]);
        assert_eq!(options.validate().expect_err("no factor").option, "node-density");
    }
    options.node_density = BTreeMap::from([(100_000, 1.0)]);
    let refusal = bake_scene(&scene, &options, &mut Silent).expect_err("no such node");
    assert!(matches!(refusal, Error::Options(_)) && refusal.to_string().contains("100000"), "{refusal}");
}

/// A lit page of a scene of few texels' worth of detail is no larger than its charts.
#[test]
fn a_page_has_no_empty_rows() {
    let result = baked("cornell", &options(Resolution::Size(128)));
    let (width, height) = (result.atlas.width, result.atlas.height);
    assert!(width <= 128 && height <= 128);
    let sites = sites(&result.surfaces, &result.atlas, &|_, _| true);
    let last = sites.iter().fold((0, 0), |last, s| (last.0.max(s.x), last.1.max(s.y)));
    assert!(width - last.0 <= 4 && height - last.1 <= 4, "{last:?} in {width} × {height}");
}
