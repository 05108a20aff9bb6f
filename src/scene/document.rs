//! The parts of the glTF JSON that a bake needs, typed and not yet checked against each other.
//!
//! Read entry by entry, so that a malformed one is named by its index, and in `f64`,
//! so that a factor of 0.8 stays 0.8. The `gltf` crate's types keep `f32` and its
//! readers trust counts and offsets; the tests compare with it as a second opinion.

use serde::Deserialize;
use serde::de::{DeserializeOwned, IgnoredAny};
use serde_json::Value;

use super::{ImportError, Item};

/// Everything that the scene stage looks at.
#[derive(Debug, Default)]
pub(super) struct Document {
    pub(super) scene: Option<usize>,
    pub(super) scenes: Vec<SceneEntry>,
    pub(super) nodes: Vec<Node>,
    pub(super) meshes: Vec<Mesh>,
    pub(super) skins: Vec<Skin>,
    pub(super) accessors: Vec<Accessor>,
    pub(super) views: Vec<BufferView>,
    pub(super) buffers: Vec<Buffer>,
    pub(super) materials: Vec<MaterialEntry>,
    pub(super) textures: Vec<Texture>,
    pub(super) samplers: Vec<Sampler>,
    pub(super) images: Vec<Image>,
    pub(super) lights: Vec<Light>,
    pub(super) extensions_required: Vec<String>,
}

/// One of the document's `scenes`.
#[derive(Debug, Default, Deserialize)]
pub(super) struct SceneEntry {
    #[serde(default)]
    pub(super) nodes: Vec<usize>,
}

/// One of the document's `nodes`.
#[derive(Debug, Default, Deserialize)]
pub(super) struct Node {
    pub(super) name: Option<String>,
    #[serde(default)]
    pub(super) children: Vec<usize>,
    pub(super) matrix: Option<[f64; 16]>,
    pub(super) translation: Option<[f64; 3]>,
    pub(super) rotation: Option<[f64; 4]>,
    pub(super) scale: Option<[f64; 3]>,
    pub(super) mesh: Option<usize>,
    pub(super) skin: Option<usize>,
    pub(super) weights: Option<Vec<f64>>,
    #[serde(default)]
    pub(super) extensions: NodeExtensions,
}

#[derive(Debug, Default, Deserialize)]
pub(super) struct NodeExtensions {
    #[serde(rename = "KHR_lights_punctual")]
    pub(super) light: Option<LightReference>,
    #[serde(rename = "EXT_mesh_gpu_instancing")]
    pub(super) instancing: Option<Instancing>,
}

/// A node's instances: accessors by attribute.
#[derive(Debug, Deserialize)]
pub(super) struct Instancing {
    #[serde(default)]
    pub(super) attributes: std::collections::BTreeMap<String, usize>,
}

#[derive(Debug, Deserialize)]
pub(super) struct LightReference {
    pub(super) light: usize,
}

/// One of the document's `meshes`.
#[derive(Debug, Default, Deserialize)]
pub(super) struct Mesh {
    pub(super) name: Option<String>,
    pub(super) primitives: Vec<Primitive>,
    pub(super) weights: Option<Vec<f64>>,
}

/// One of a mesh's `primitives`.
#[derive(Debug, Default, Deserialize)]
pub(super) struct Primitive {
    /// Read in key order; only looked up by name.
    pub(super) attributes: std::collections::BTreeMap<String, usize>,
    pub(super) indices: Option<usize>,
    pub(super) material: Option<usize>,
    pub(super) mode: Option<u64>,
    #[serde(default)]
    pub(super) targets: Vec<std::collections::BTreeMap<String, usize>>,
    #[serde(default)]
    pub(super) extensions: PrimitiveExtensions,
}

#[derive(Debug, Default, Deserialize)]
pub(super) struct PrimitiveExtensions {
    #[serde(rename = "KHR_draco_mesh_compression")]
    pub(super) draco: Option<IgnoredAny>,
}

/// One of the document's `skins`.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Skin {
    pub(super) name: Option<String>,
    pub(super) joints: Vec<usize>,
    pub(super) inverse_bind_matrices: Option<usize>,
}

/// One of the document's `accessors`.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Accessor {
    pub(super) name: Option<String>,
    pub(super) buffer_view: Option<usize>,
    #[serde(default)]
    pub(super) byte_offset: u64,
    pub(super) component_type: u64,
    #[serde(default)]
    pub(super) normalized: bool,
    pub(super) count: u64,
    #[serde(rename = "type")]
    pub(super) shape: String,
    pub(super) sparse: Option<Sparse>,
}

#[derive(Debug, Deserialize)]
pub(super) struct Sparse {
    pub(super) count: u64,
    pub(super) indices: SparseIndices,
    pub(super) values: SparseValues,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct SparseIndices {
    pub(super) buffer_view: usize,
    #[serde(default)]
    pub(super) byte_offset: u64,
    pub(super) component_type: u64,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct SparseValues {
    pub(super) buffer_view: usize,
    #[serde(default)]
    pub(super) byte_offset: u64,
}

/// One of the document's `bufferViews`.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct BufferView {
    pub(super) name: Option<String>,
    pub(super) buffer: usize,
    #[serde(default)]
    pub(super) byte_offset: u64,
    pub(super) byte_length: u64,
    pub(super) byte_stride: Option<u64>,
}

/// One of the document's `buffers`.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Buffer {
    pub(super) name: Option<String>,
    pub(super) uri: Option<String>,
    pub(super) byte_length: u64,
    #[serde(default)]
    pub(super) extensions: BufferExtensions,
}

#[derive(Debug, Default, Deserialize)]
pub(super) struct BufferExtensions {
    #[serde(rename = "EXT_meshopt_compression", alias = "KHR_meshopt_compression")]
    pub(super) meshopt: Option<IgnoredAny>,
}

/// One of the document's `materials`.
#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct MaterialEntry {
    pub(super) name: Option<String>,
    #[serde(default)]
    pub(super) pbr_metallic_roughness: MetallicRoughness,
    pub(super) emissive_factor: Option<[f64; 3]>,
    pub(super) emissive_texture: Option<TextureInfo>,
    pub(super) alpha_mode: Option<String>,
    pub(super) alpha_cutoff: Option<f64>,
    #[serde(default)]
    pub(super) double_sided: bool,
    #[serde(default)]
    pub(super) extensions: MaterialExtensions,
}

#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct MetallicRoughness {
    pub(super) base_color_factor: Option<[f64; 4]>,
    pub(super) base_color_texture: Option<TextureInfo>,
    pub(super) metallic_factor: Option<f64>,
    pub(super) metallic_roughness_texture: Option<TextureInfo>,
}

#[derive(Debug, Default, Deserialize)]
pub(super) struct MaterialExtensions {
    #[serde(rename = "KHR_materials_emissive_strength")]
    pub(super) strength: Option<EmissiveStrength>,
    #[serde(rename = "KHR_materials_unlit")]
    pub(super) unlit: Option<IgnoredAny>,
    #[serde(rename = "KHR_materials_pbrSpecularGlossiness")]
    pub(super) specular_glossiness: Option<SpecularGlossiness>,
    #[serde(rename = "KHR_materials_transmission")]
    pub(super) transmission: Option<IgnoredAny>,
    #[serde(rename = "KHR_materials_diffuse_transmission")]
    pub(super) diffuse_transmission: Option<IgnoredAny>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct EmissiveStrength {
    pub(super) emissive_strength: Option<f64>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct SpecularGlossiness {
    pub(super) diffuse_factor: Option<[f64; 4]>,
    pub(super) diffuse_texture: Option<TextureInfo>,
    pub(super) specular_factor: Option<[f64; 3]>,
    pub(super) specular_glossiness_texture: Option<TextureInfo>,
}

/// Where a material refers to a texture.
#[derive(Clone, Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct TextureInfo {
    pub(super) index: usize,
    #[serde(default)]
    pub(super) tex_coord: u32,
    #[serde(default)]
    pub(super) extensions: TextureInfoExtensions,
}

#[derive(Clone, Debug, Default, Deserialize)]
pub(super) struct TextureInfoExtensions {
    #[serde(rename = "KHR_texture_transform")]
    pub(super) transform: Option<TextureTransform>,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct TextureTransform {
    pub(super) offset: Option<[f64; 2]>,
    pub(super) rotation: Option<f64>,
    pub(super) scale: Option<[f64; 2]>,
    pub(super) tex_coord: Option<u32>,
}

/// One of the document's `textures`.
#[derive(Debug, Deserialize)]
pub(super) struct Texture {
    pub(super) name: Option<String>,
    pub(super) sampler: Option<usize>,
    pub(super) source: Option<usize>,
}

/// One of the document's `samplers`.
#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Sampler {
    pub(super) mag_filter: Option<u64>,
    pub(super) wrap_s: Option<u64>,
    pub(super) wrap_t: Option<u64>,
}

/// One of the document's `images`.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Image {
    pub(super) name: Option<String>,
    pub(super) uri: Option<String>,
    pub(super) mime_type: Option<String>,
    pub(super) buffer_view: Option<usize>,
}

/// One of the `lights` of `KHR_lights_punctual`.
#[derive(Debug, Deserialize)]
pub(super) struct Light {
    pub(super) name: Option<String>,
    #[serde(rename = "type")]
    pub(super) kind: String,
    pub(super) color: Option<[f64; 3]>,
    pub(super) intensity: Option<f64>,
    pub(super) range: Option<f64>,
    pub(super) spot: Option<Spot>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Spot {
    pub(super) inner_cone_angle: Option<f64>,
    pub(super) outer_cone_angle: Option<f64>,
}

impl Document {
    /// Types the JSON. Indices are checked later, where they are followed.
    pub(super) fn read(json: &Value) -> Result<Self, ImportError> {
        check_version(json)?;
        let lights = json.pointer("/extensions/KHR_lights_punctual").unwrap_or(&Value::Null);
        Ok(Self {
            scene: match json.get("scene") {
                None | Some(Value::Null) => None,
                Some(index) => Some(index.as_u64().map_or(usize::MAX, |index| index as usize)),
            },
            scenes: list(json, "scenes", "scene")?,
            nodes: list(json, "nodes", "node")?,
            meshes: list(json, "meshes", "mesh")?,
            skins: list(json, "skins", "skin")?,
            accessors: list(json, "accessors", "accessor")?,
            views: list(json, "bufferViews", "bufferView")?,
            buffers: list(json, "buffers", "buffer")?,
            materials: list(json, "materials", "material")?,
            textures: list(json, "textures", "texture")?,
            samplers: list(json, "samplers", "sampler")?,
            images: list(json, "images", "image")?,
            lights: list(lights, "lights", "light")?,
            extensions_required: list(json, "extensionsRequired", "extensionsRequired entry")?,
        })
    }

    /// The node, as messages name it.
    pub(super) fn node_item(&self, index: usize) -> Item {
        Item::new("node", index, self.nodes.get(index).and_then(|node| node.name.as_deref()))
    }

    /// A mesh's primitive, as messages name it.
    pub(super) fn primitive_item(&self, mesh: usize, primitive: usize) -> Item {
        let name = self.meshes.get(mesh).and_then(|mesh| mesh.name.as_deref());
        Item::new("mesh", mesh, name).part("primitive", primitive)
    }

    /// The material, as messages name it.
    pub(super) fn material_item(&self, index: usize) -> Item {
        Item::new("material", index, self.materials.get(index).and_then(|m| m.name.as_deref()))
    }
}

/// Follows an index that `from` holds into `list`, whose entries are called `kind`.
pub(super) fn follow<'a, T>(
    list: &'a [T],
    index: usize,
    kind: &'static str,
    from: impl FnOnce() -> Item,
) -> Result<&'a T, ImportError> {
    list.get(index).ok_or_else(|| ImportError::Reference { from: from(), kind, index, count: list.len() })
}

fn check_version(json: &Value) -> Result<(), ImportError> {
    let asset = |key| json.pointer(key).and_then(Value::as_str);
    let version = asset("/asset/version").ok_or(ImportError::NoVersion)?;
    let minimum = asset("/asset/minVersion").unwrap_or("2.0");
    // A minor version only adds; a document that cannot do without says so in minVersion.
    if !version.starts_with("2.") || minimum != "2.0" {
        let version = if minimum == "2.0" { version } else { minimum };
        return Err(ImportError::Version { version: super::item::shown(version) });
    }
    Ok(())
}

fn list<T: DeserializeOwned>(
    root: &Value,
    key: &'static str,
    kind: &'static str,
) -> Result<Vec<T>, ImportError> {
    let entries = match root.get(key) {
        None | Some(Value::Null) => return Ok(Vec::new()),
        Some(Value::Array(entries)) => entries,
        Some(_) => return Err(ImportError::NotAList { key }),
    };
    let read = |(index, entry): (usize, &Value)| {
        let name = entry.get("name").and_then(Value::as_str);
        T::deserialize(entry)
            .map_err(|source| ImportError::Schema { item: Item::new(kind, index, name), source })
    };
    entries.iter().enumerate().map(read).collect()
}
