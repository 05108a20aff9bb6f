//! Which glTF extensions a bake honours, refuses or passes over.
//!
//! `extensionsRequired` names what a reader must understand to show the scene at all: what is not
//! honoured there is refused by name. What is merely used is passed over, with a warning where that
//! changes the light.

use serde_json::Value;

use super::ImportError;
use super::document::Document;

/// Honoured, or without effect on diffuse light.
const HONOURED: [&str; 7] = [
    "EXT_mesh_gpu_instancing",
    "KHR_animation_pointer",
    "KHR_lights_punctual",
    "KHR_mesh_quantization",
    "KHR_texture_transform",
    "KHR_xmp_json_ld",
    "MOZ_lightmap",
];

/// Every material extension of this family keeps the core material readable.
const HONOURED_FAMILY: &str = "KHR_materials_";

/// Extensions that are refused where they are required, and what to do.
const REMEDIES: [(&str, &str); 7] = [
    ("EXT_meshopt_compression", DECOMPRESS),
    ("KHR_meshopt_compression", DECOMPRESS),
    ("KHR_draco_mesh_compression", DECOMPRESS),
    ("KHR_texture_basisu", "decode its textures first: npx @gltf-transform/cli ktxdecompress in.glb out.glb"),
    ("EXT_texture_webp", "store its textures as PNG first: npx @gltf-transform/cli png in.glb out.glb"),
    ("EXT_texture_avif", "store its textures as PNG first: npx @gltf-transform/cli png in.glb out.glb"),
    ("KHR_node_visibility", "export the scene without it, hidden nodes left out"),
];

const DECOMPRESS: &str = "decode its meshes first: npx @gltf-transform/cli copy in.glb out.glb";
const UNKNOWN: &str = "export the scene without it";

/// Refuses the document if it requires something that is not honoured.
pub(super) fn check_required(document: &Document) -> Result<(), ImportError> {
    let refused = document.extensions_required.iter().find(|name| !is_honoured(name));
    refused.map_or(Ok(()), |name| Err(refusal(name)))
}

/// The error that refuses the extension `name`.
pub(super) fn refusal(name: &str) -> ImportError {
    let remedy = REMEDIES.iter().find(|(known, _)| *known == name).map_or(UNKNOWN, |(_, remedy)| remedy);
    ImportError::RequiredExtension { name: name.to_owned(), remedy }
}

/// Takes `names` out of the document's lists of extensions.
pub(super) fn forget(json: &mut Value, names: &[&str]) {
    let Some(root) = json.as_object_mut() else { return };
    for key in ["extensionsUsed", "extensionsRequired"] {
        let Some(list) = root.get_mut(key).and_then(Value::as_array_mut) else { continue };
        list.retain(|entry| !names.iter().any(|name| entry == name));
        if list.is_empty() {
            root.shift_remove(key); // glTF allows no empty list
        }
    }
}

fn is_honoured(name: &str) -> bool {
    #[cfg(feature = "meshopt")]
    if super::meshopt::NAMES.contains(&name) {
        return true;
    }
    name.starts_with(HONOURED_FAMILY) || HONOURED.contains(&name)
}
