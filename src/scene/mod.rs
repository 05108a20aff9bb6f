//! Stage 1: glTF becomes world-space triangles, materials and lights.
//!
//! Everything that is hard about glTF ends here. Later stages see arrays of
//! triangles; the only glTF they keep is [`SourceDocument`], which the export
//! stage alone opens again.
//!
//! The order of work: `container` splits the file, `document` types its JSON, `extension` refuses
//! what cannot be honoured, `source` reads buffers and images, `meshopt` decodes and `instancing` expands
//! what the document holds in short, `hierarchy` finds the nodes' places,
//! `place` puts `primitive`s there (through `accessor`s), `material` and `punctual` read what
//! shines and reflects, and `appearance` and `coverage` answer what a point looks like and how much of it is there (`texture`, `pyramid`).
//!
//! Every index, offset and length is checked where it is followed; nothing is allocated by a count
//! alone. What is wrong is an [`ImportError`]; what is merely odd is a warning.

mod accessor;
mod appearance;
mod container;
mod coordinates;
mod coverage;
mod document;
mod error;
mod extension;
mod hierarchy;
mod instancing;
mod item;
mod load;
mod material;
#[cfg(feature = "meshopt")]
mod meshopt;
mod place;
mod primitive;
mod punctual;
mod pyramid;
mod settings;
mod source;
mod texture;
mod uri;
mod warning;

pub use accessor::AccessorFault;
pub use appearance::Appearance;
pub use coverage::Coverage;
pub use error::ImportError;
pub use item::Item;
pub use load::{ImportOptions, from_bytes, load};
pub use settings::NodeSettings;
pub use uri::UriError;
pub(crate) use uri::percent_decode;
pub(crate) use warning::Warnings;

use std::ops::Range;

use glam::DVec3;

/// The most vertices, and the most triangles, that a scene may place.
const MAX_COUNT: usize = 1 << 26;

/// The farthest from the origin that a vertex may lie, metres: beyond it products of four coordinates,
/// which ray tracing in single precision forms, overflow.
const MAX_COORDINATE: f64 = 1e9;

/// A scene ready to be baked.
#[derive(Debug)]
pub struct Scene {
    /// World-space positions, metres. Shared by a placement's triangles, not between placements.
    pub vertices: Vec<DVec3>,
    /// World-space unit normals that the vertices are drawn with, zero where there are none; empty where they were not
    /// [asked for](ImportOptions::normals).
    pub normals: Vec<DVec3>,
    /// All triangles of all placements, in placement order and within it in source order.
    /// Zero-area triangles are kept (the output must hold them again).
    pub triangles: Vec<Triangle>,
    /// One entry per primitive of each node's mesh, in scene traversal order (depth first).
    /// Primitives that hold no triangle have none.
    pub placements: Vec<Placement>,
    /// The document's materials in order, then the default material (always last).
    pub materials: Vec<Material>,
    /// Punctual lights in traversal order, in world space.
    pub lights: Vec<PunctualLight>,
    /// Textures and what else varies over surfaces; `Appearance::default()` has none.
    pub appearance: Appearance,
    /// The file as it was read, for writing it again.
    pub source: SourceDocument,
    /// What the user should know, one sentence each.
    pub warnings: Vec<String>,
}

impl Scene {
    /// A triangle's corners, metres; the origin for those that are not there.
    #[must_use]
    pub fn corners(&self, triangle: &Triangle) -> [DVec3; 3] {
        triangle.vertices.map(|v| self.vertices.get(v as usize).copied().unwrap_or_default())
    }

    /// How messages name the `index`-th entry of one of the document's lists, whose singular is `kind`.
    pub(crate) fn item(&self, kind: &'static str, index: usize) -> Item {
        let list = match kind {
            "mesh" => "meshes".to_owned(),
            _ => format!("{kind}s"),
        };
        let name = self.source.json.get(list).and_then(|list| list.get(index)?.get("name")?.as_str());
        Item::new(kind, index, name)
    }
}

/// One placed triangle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Triangle {
    /// Indices into [`Scene::vertices`], counter-clockwise seen from the front
    /// (already corrected for mirroring transforms).
    pub vertices: [u32; 3],
    /// The same corners as indices into the source primitive's attribute arrays.
    pub source_vertices: [u32; 3],
    /// Index into [`Scene::placements`].
    pub placement: u32,
}

/// A primitive as a node places it.
#[derive(Clone, Debug, PartialEq)]
pub struct Placement {
    /// Index into the document's `nodes`.
    pub node: usize,
    /// Index into the document's `meshes`.
    pub mesh: usize,
    /// Index into that mesh's `primitives`.
    pub primitive: usize,
    /// Index into [`Scene::materials`].
    pub material: usize,
    /// Its triangles in [`Scene::triangles`].
    pub triangles: Range<usize>,
    /// Its vertices in [`Scene::vertices`]: attribute `k` of the primitive is vertex `start + k`.
    pub vertices: Range<usize>,
    /// Whether the node's transform mirrors, so that corners 1 and 2 of each triangle are swapped
    /// against the source's order.
    pub mirrored: bool,
    /// How it takes part in the bake. What moves has `bake` off.
    pub settings: NodeSettings,
}

/// What a surface does with light. Textures are reached through [`Scene::reflectance_at`]
/// and [`Scene::emission_at`].
#[derive(Clone, Debug)]
pub struct Material {
    /// Index into the document's `materials`; `None` for the default material.
    pub index: Option<usize>,
    /// The material's name, or a made-up one, for messages.
    pub name: String,
    /// Mean diffuse reflectance, `baseColorFactor × (1 − metallic)`, times the texture's mean
    /// where there is one; not yet clamped to `max_reflectance`. In `[0, 1]`.
    pub reflectance: DVec3,
    /// Mean emitted radiance `L`, nits, the texture's mean included.
    pub emission: DVec3,
    /// Whether both sides reflect and emit.
    pub double_sided: bool,
    /// Whether reflectance or emission varies over the surface, so that the `_at` functions matter.
    pub textured: bool,
}

/// A light without extent (`KHR_lights_punctual`), in world space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PunctualLight {
    /// Shape and place.
    pub kind: PunctualKind,
    /// Candela for point and spot lights, lux for directional ones; colour times intensity.
    pub intensity: DVec3,
    /// Index into the document's `nodes`.
    pub node: usize,
}

/// The shape of a punctual light.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum PunctualKind {
    /// Shines from a point into all directions.
    Point {
        /// Metres.
        position: DVec3,
        /// Metres; beyond it there is no light. Infinite where the file gives none.
        range: f64,
    },
    /// Shines from a point into a cone.
    Spot {
        /// Metres.
        position: DVec3,
        /// Unit vector along which the light shines.
        direction: DVec3,
        /// Metres, or infinity.
        range: f64,
        /// Half angle at which the fall-off begins, radians.
        inner_cone: f64,
        /// Half angle at which no light is left, radians, above `inner_cone`.
        outer_cone: f64,
    },
    /// Shines from infinitely far away.
    Directional {
        /// Unit vector along which the light shines.
        direction: DVec3,
    },
}

/// The document as read: JSON, buffers and images, untouched.
#[derive(Debug)]
pub struct SourceDocument {
    /// The whole glTF JSON.
    pub json: serde_json::Value,
    /// Each buffer's bytes, as many as its `byteLength` says.
    pub buffers: Vec<Vec<u8>>,
    /// Each image that is a file beside the document or a data URI: its encoded bytes and MIME
    /// type, so that the output can embed it. `None` where the image lies in a bufferView, or where
    /// it could not be read (a warning says so, and the URI is left as it is).
    pub external_images: Vec<Option<(Vec<u8>, String)>>,
}
