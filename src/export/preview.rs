//! The picture of the light for viewers that know no lightmaps, and the materials that show it.
//!
//! Core glTF cannot multiply two colour maps, so what the surfaces send out, `L + ρ E / π`, is one map on the
//! lightmap's page. It is shown as the colour of unlit materials, tone-mapped, or as the emission of black
//! ones times `KHR_materials_emissive_strength`. Both texture slots are sRGB.

use glam::{DVec3, Vec3};
use serde_json::{Value, json};

use super::document::Object;
use super::exr::check_texels;
use super::materials::LIGHTMAP_SET;
use super::png::{rgb8, scale};
use super::{ExportError, Png};
use crate::options::Preview;
use crate::picture::{ToneMap, srgb_byte};
use crate::raster::Lightmap;
use crate::unwrap::PageArea;

/// Encodes what surfaces send out as an sRGB PNG; its scale is what 255 stands for, 1 where it is tone-mapped.
///
/// The same map gives the same bytes. The scale follows the rule of [`encode_png`](super::encode_png).
///
/// # Errors
/// [`ExportError::PageSize`] or [`ExportError::NotFinite`] for a map that is not whole.
pub fn encode_preview(sent_out: &Lightmap, form: Preview) -> Result<Png, ExportError> {
    let whole = PageArea { row: 0, width: sent_out.width, height: sent_out.height };
    encode_previews(sent_out, &[whole], form).map(|mut pages| pages.swap_remove(0))
}

/// Encodes each of a sheet's pages as [`encode_preview`] does, all tone-mapped alike.
///
/// # Errors
/// As [`encode_preview`].
pub fn encode_previews(sheet: &Lightmap, pages: &[PageArea], form: Preview) -> Result<Vec<Png>, ExportError> {
    check_texels(sheet)?;
    let tone = ToneMap::for_values(sheet.texels.iter().map(value));
    pages.iter().map(|area| encode_page(&sheet.page(*area), form, &tone)).collect()
}

fn value(texel: &[f32; 3]) -> DVec3 {
    Vec3::from_array(*texel).as_dvec3()
}

fn encode_page(sent_out: &Lightmap, form: Preview, tone: &ToneMap) -> Result<Png, ExportError> {
    let (samples, scale): (Vec<u8>, f32) = match form {
        Preview::Unlit => (sent_out.texels.iter().flat_map(|texel| tone.colour(value(texel))).collect(), 1.0),
        Preview::Emissive => {
            let scale = scale(sent_out);
            let byte = |&channel: &f32| srgb_byte(f64::from(channel) / f64::from(scale));
            (sent_out.texels.iter().flatten().map(byte).collect(), scale)
        }
    };
    Ok(Png { bytes: rgb8(&samples, (sent_out.width, sent_out.height))?, scale })
}

/// The material that shows the texture `picture` in place of `original`, of which name, sides, extras and
/// transparency stay. An emissive one keeps its base texture, for its alpha; the names of the extensions are
/// returned too.
pub(super) fn material(original: &Object, form: Preview, picture: (usize, f64)) -> (Object, &'static str) {
    let mut made = Object::new();
    for kept in ["name", "extras", "alphaMode", "alphaCutoff", "doubleSided"] {
        if let Some(value) = original.get(kept) {
            made.insert(kept.into(), value.clone());
        }
    }
    let (texture, strength) = picture;
    let info = json!({"index": texture, "texCoord": LIGHTMAP_SET});
    let core = original.get("pbrMetallicRoughness");
    let alpha = core.and_then(|core| core.get("baseColorFactor")?.get(3)?.as_f64()).unwrap_or(1.0);
    match form {
        Preview::Unlit => {
            made.insert(
                "pbrMetallicRoughness".into(),
                json!({"baseColorFactor": [1.0, 1.0, 1.0, alpha], "baseColorTexture": info,
                       "metallicFactor": 0.0, "roughnessFactor": 1.0}),
            );
            made.insert("extensions".into(), json!({UNLIT: {}}));
            (made, UNLIT)
        }
        Preview::Emissive => {
            // A black metal reflects less than a black dielectric: nothing, but at grazing angles.
            let mut black = json!({"baseColorFactor": [0.0, 0.0, 0.0, alpha], "metallicFactor": 1.0,
                                   "roughnessFactor": 1.0});
            let opaque = original.get("alphaMode").is_none_or(|mode| mode == "OPAQUE");
            let with_alpha = core.and_then(|core| core.get("baseColorTexture")).filter(|_| !opaque);
            if let Some(texture) = with_alpha {
                black["baseColorTexture"] = texture.clone();
            }
            made.insert("pbrMetallicRoughness".into(), black);
            made.insert("emissiveFactor".into(), json!([1.0, 1.0, 1.0]));
            made.insert("emissiveTexture".into(), info);
            let strength: Value = json!({STRENGTH: {"emissiveStrength": strength}});
            made.insert("extensions".into(), strength);
            (made, STRENGTH)
        }
    }
}

const UNLIT: &str = "KHR_materials_unlit";
const STRENGTH: &str = "KHR_materials_emissive_strength";

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_tells_materials_apart_stays() {
        let original = json!({"name": "leaf", "alphaMode": "MASK", "alphaCutoff": 0.4, "doubleSided": true,
            "extras": {"a": 1}, "normalTexture": {"index": 3}, "emissiveFactor": [1, 0, 0],
            "pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.5, 0.5, 0.75], "baseColorTexture": {"index": 1}}});
        let original = original.as_object().unwrap();
        for form in [Preview::Unlit, Preview::Emissive] {
            let (made, _) = material(original, form, (7, 4.0));
            for kept in ["name", "alphaMode", "alphaCutoff", "doubleSided", "extras"] {
                assert_eq!(made[kept], original[kept], "{kept}");
            }
            assert!(!made.contains_key("normalTexture"));
            assert_eq!(made["pbrMetallicRoughness"]["baseColorFactor"][3], 0.75);
        }
        let (emissive, _) = material(original, Preview::Emissive, (7, 4.0));
        assert_eq!(emissive["pbrMetallicRoughness"]["baseColorTexture"]["index"], 1);
        assert_eq!(emissive["emissiveTexture"], json!({"index": 7, "texCoord": 1}));
        assert_eq!(emissive["extensions"][STRENGTH]["emissiveStrength"], 4.0);
    }

    #[test]
    fn black_is_black_and_more_than_the_scale_saturates() {
        let mut texels = vec![[0.25, 0.5, 1.0]; 4096];
        texels[0] = [0.0; 3];
        texels[1] = [1e4; 3];
        let map = Lightmap { width: 64, height: 64, texels };
        let png = encode_preview(&map, Preview::Emissive).unwrap();
        let samples = image::load_from_memory(&png.bytes).unwrap().into_rgb8().into_raw();
        assert_eq!(png.scale, 1.0);
        assert_eq!(samples[..9], [0, 0, 0, 255, 255, 255, 137, 188, 255]);
    }
}
