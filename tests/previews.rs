//! What viewers that know no lightmaps are shown.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test may fail")]

use std::f64::consts::PI;
use std::path::{Path, PathBuf};

use cobake::BakeResult;
use cobake::options::{BakeOptions, DensityPolicy, Preview, Quantity, Resolution};
use cobake::progress::Silent;
use serde_json::Value;

/// Half a step of eight bits, and rounding.
const HALF_STEP: f64 = 0.501 / 255.0;

fn cornell() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures/cornell/scene.glb")
}

fn bake(change: impl FnOnce(&mut BakeOptions)) -> BakeResult {
    let mut options = BakeOptions::default();
    options.resolution = Resolution::Size(64);
    options.density = DensityPolicy::Uniform;
    change(&mut options);
    cobake::bake(&cornell(), &options, &mut Silent).unwrap()
}

/// The document of a GLB and its picture of that name.
fn picture(glb: &[u8], name: &str) -> (Value, Option<image::RgbImage>) {
    let parts = gltf::Glb::from_slice(glb).unwrap();
    let json: Value = serde_json::from_slice(&parts.json).unwrap();
    let binary = parts.bin.unwrap();
    let found = json["images"].as_array().and_then(|list| list.iter().find(|image| image["name"] == name));
    let picture = found.map(|image| {
        let view = &json["bufferViews"][image["bufferView"].as_u64().unwrap() as usize];
        let start = view["byteOffset"].as_u64().unwrap_or(0) as usize;
        let bytes = &binary[start..start + view["byteLength"].as_u64().unwrap() as usize];
        image::load_from_memory(bytes).unwrap().into_rgb8()
    });
    (json, picture)
}

fn srgb(linear: f64) -> f64 {
    if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

/// An emissive preview is the radiosity over π in every texel, those around the charts included, and its
/// EXR stays what it is without.
#[test]
fn an_emissive_preview_is_what_the_surfaces_send_out() {
    let preview = bake(|o| o.preview = Some(Preview::Emissive));
    let radiosity = bake(|o| o.quantity = Quantity::Radiosity).lightmap;
    assert_eq!(preview.lightmap, bake(|_| ()).lightmap);
    let (json, picture) = picture(&preview.glb, "preview0");
    let picture = picture.unwrap();
    let materials = json["materials"].as_array().unwrap();
    let strength =
        materials[0]["extensions"]["KHR_materials_emissive_strength"]["emissiveStrength"].as_f64().unwrap();
    let mut brightest = 0.0_f64;
    for (texel, value) in picture.pixels().zip(&radiosity.texels) {
        for (&byte, &value) in texel.0.iter().zip(value) {
            let meant = srgb((f64::from(value) / PI / strength).clamp(0.0, 1.0));
            assert!((f64::from(byte) / 255.0 - meant).abs() <= HALF_STEP, "{byte} for {value}");
            brightest = brightest.max(f64::from(byte) / 255.0 * strength);
        }
    }
    assert!(brightest > 1.0, "the lamp is brighter than white: {brightest}");
}

/// All lit materials, each still its own, show the picture by the lightmap's coordinates, and no lightmap.
#[test]
fn every_material_shows_the_picture() {
    for (form, slot) in
        [(Preview::Unlit, "/pbrMetallicRoughness/baseColorTexture"), (Preview::Emissive, "/emissiveTexture")]
    {
        let (json, picture) = picture(&bake(|o| o.preview = Some(form)).glb, "preview0");
        assert!(picture.is_some_and(|picture| picture.pixels().any(|p| p.0[0] > 100)));
        let source = gltf::Gltf::open(cornell()).unwrap();
        let names: Vec<_> = source.materials().filter_map(|m| m.name().map(str::to_owned)).collect();
        let materials = json["materials"].as_array().unwrap();
        let kept: Vec<_> = materials.iter().filter_map(|m| m["name"].as_str()).collect();
        assert_eq!(kept, names);
        for material in materials {
            let info = material.pointer(slot).unwrap();
            assert_eq!(info["texCoord"], 1, "{material}");
            assert_eq!(json["textures"][info["index"].as_u64().unwrap() as usize]["source"], 0);
            assert!(material["extensions"].get("MOZ_lightmap").is_none());
        }
    }
}

/// The light that stands in a budget is the preview's where there is one.
#[test]
fn a_budget_counts_the_preview() {
    let result = bake(|o| {
        o.resolution = Resolution::Bytes(20_000);
        o.preview = Some(Preview::Unlit);
    });
    let report = &result.report.lightmap;
    assert!(report.png_bytes > 0 && report.bytes + report.png_bytes <= 20_000, "{report:?}");
}
