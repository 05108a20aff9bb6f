//! Why a scene could not be read.

use std::io;
use std::path::PathBuf;

use super::accessor::AccessorFault;
use super::uri::UriError;
use super::{Item, MAX_COORDINATE};

/// Why a scene could not be read.
///
/// Each message names the thing at fault by its glTF index (and its name, where it has one) and
/// says what to do; the cause, where there is one, is reached through
/// [`source`](std::error::Error::source) and not repeated.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ImportError {
    /// The file could not be read.
    #[error("cannot read {}", path.display())]
    Read {
        /// The file asked for.
        path: PathBuf,
        /// What the operating system reported.
        source: io::Error,
    },

    /// A folder was given where a file is needed.
    #[error("{} is a folder; name the .glb or .gltf file in it", path.display())]
    Directory {
        /// The path asked for.
        path: PathBuf,
    },

    /// There is nothing in the file.
    #[error("the file is empty; export the scene again")]
    Empty,

    /// Neither the GLB magic nor JSON.
    #[error("the file is neither binary glTF (.glb) nor glTF JSON (.gltf); export the scene as glTF 2.0")]
    NotGltf,

    /// JSON, but without the one property that every glTF has.
    #[error("the JSON has no asset.version, so it is not glTF 2.0; export the scene as glTF 2.0")]
    NoVersion,

    /// Another version than glTF 2.0.
    #[error("the file needs glTF version {version}, and only 2.0 is read; export it as glTF 2.0")]
    Version {
        /// The version found.
        version: String,
    },

    /// The GLB ends before its declared length.
    #[error("the file is truncated: it should have {needed} bytes and has {length}; copy or export it again")]
    Truncated {
        /// Bytes that the header declares, or that a header needs.
        needed: u64,
        /// Bytes there are.
        length: u64,
    },

    /// A GLB chunk reaches beyond the file.
    #[error(
        "the GLB chunk at byte {offset} ends at byte {end}, beyond the file's {length} bytes; export it again"
    )]
    Chunk {
        /// Where the chunk starts.
        offset: usize,
        /// Where it would end.
        end: u64,
        /// The file's length.
        length: usize,
    },

    /// A GLB that holds no JSON.
    #[error("the GLB has no JSON chunk; export it again")]
    NoJsonChunk,

    /// The JSON does not parse.
    #[error("the glTF JSON is malformed; export the file again")]
    Json {
        /// Where and why.
        source: serde_json::Error,
    },

    /// A top-level property that must be an array is something else.
    #[error("the glTF property {key} is not an array; export the file again")]
    NotAList {
        /// The property.
        key: &'static str,
    },

    /// An entry lacks a property or has one of the wrong type.
    #[error("{item} is not valid glTF; correct it or export the file again")]
    Schema {
        /// The entry.
        item: Item,
        /// What is wrong with it.
        source: serde_json::Error,
    },

    /// The document cannot be understood without an extension that cobake does not have.
    #[error("the file requires the extension {}, which is not supported; {remedy}", super::item::shown(name))]
    RequiredExtension {
        /// The extension's name.
        name: String,
        /// What to do about it.
        remedy: &'static str,
    },

    /// The scene asked for does not exist.
    #[error("there is no scene {asked}: {}", scenes_there_are(*count))]
    NoSuchScene {
        /// The index asked for.
        asked: usize,
        /// How many the document holds.
        count: usize,
    },

    /// An index leads nowhere.
    #[error(
        "{from} refers to {kind} {index}, but {}; correct the index or export the file again",
        last_one(*count, kind)
    )]
    Reference {
        /// What holds the index.
        from: Item,
        /// What it should lead to.
        kind: &'static str,
        /// The index.
        index: usize,
        /// How many there are.
        count: usize,
    },

    /// A buffer's data could not be had.
    #[error("{buffer} {fault}")]
    Buffer {
        /// The buffer.
        buffer: Item,
        /// Why.
        fault: UriError,
    },

    /// A buffer without a URI, and no binary chunk to take its place.
    #[error("{buffer} has no uri and the file has no binary chunk for it; export the file again")]
    NoBufferData {
        /// The buffer.
        buffer: Item,
    },

    /// A buffer's data is shorter than the buffer.
    #[error(
        "{buffer} should have {needed} bytes and its data has {length}; the file is incomplete, export it again"
    )]
    BufferTooShort {
        /// The buffer.
        buffer: Item,
        /// Its `byteLength`.
        needed: u64,
        /// Bytes there are.
        length: u64,
    },

    /// A buffer view reaches beyond its buffer.
    #[error("{view} ends at byte {end} of buffer {buffer}, which has {length} bytes; export the file again")]
    View {
        /// The buffer view.
        view: Item,
        /// Where it would end.
        end: u128,
        /// The buffer.
        buffer: usize,
        /// The buffer's length.
        length: usize,
    },

    /// A compressed buffer view cannot be decoded.
    #[error(
        "{view}, compressed by EXT_meshopt_compression, {fault}; compress the file again from its source"
    )]
    Meshopt {
        /// The buffer view.
        view: Item,
        /// Why.
        fault: &'static str,
    },

    /// Attributes of one node's instances that differ in length.
    #[error("{node} has {count} values of {attribute} for {instances} instances; export the file again")]
    InstanceLength {
        /// The node.
        node: Item,
        /// The attribute.
        attribute: String,
        /// Its length.
        count: usize,
        /// The number of instances.
        instances: usize,
    },

    /// An accessor cannot be read.
    #[error("{accessor} {fault}")]
    Accessor {
        /// The accessor.
        accessor: Item,
        /// Why.
        fault: AccessorFault,
    },

    /// An index beyond the primitive's vertices.
    #[error(
        "{primitive} has vertex index {index} at position {position}, but {count} vertices; export the mesh again"
    )]
    VertexIndex {
        /// The primitive.
        primitive: Item,
        /// Where in the index list.
        position: usize,
        /// The index.
        index: u32,
        /// How many vertices there are.
        count: usize,
    },

    /// Attributes of one primitive that differ in length.
    #[error("{primitive} has {count} values of {attribute} for {vertices} vertices; export the mesh again")]
    AttributeLength {
        /// The primitive.
        primitive: Item,
        /// The attribute.
        attribute: String,
        /// Its length.
        count: usize,
        /// The number of vertices.
        vertices: usize,
    },

    /// A primitive mode that glTF does not have.
    #[error("{primitive} has mode {mode}, which glTF does not define (0 to 6); export the mesh as triangles")]
    Mode {
        /// The primitive.
        primitive: Item,
        /// The mode.
        mode: u64,
    },

    /// NaN or infinity as a position.
    #[error("{primitive} has a position that is not a finite number at vertex {vertex}; repair the mesh")]
    Position {
        /// The primitive.
        primitive: Item,
        /// Index into its attributes.
        vertex: usize,
    },

    /// A vertex so far away that single precision fails.
    #[error(
        "{node} places vertices more than {MAX_COORDINATE:e} m from the origin; check its scale and translation"
    )]
    TooFar {
        /// The node.
        node: Item,
    },

    /// A transform that flattens or is not a number.
    #[error(
        "the transform of {node} is not invertible or not finite, so its mesh has no area or no place; \
         give it a scale other than zero"
    )]
    Transform {
        /// The node.
        node: Item,
    },

    /// A node is its own ancestor.
    #[error("{node} is its own ancestor; remove it from its descendants' children")]
    Cycle {
        /// A node of the cycle.
        node: Item,
    },

    /// A node that hangs in two places.
    #[error(
        "{node} is reached twice, once below {other}; a node may have one parent only, so copy it instead"
    )]
    TwoParents {
        /// The node.
        node: Item,
        /// One of its parents, or the scene.
        other: Item,
    },

    /// More than can be baked.
    #[error("the scene has more than {limit} {what}; split it or reduce its meshes")]
    TooLarge {
        /// Vertices or triangles.
        what: &'static str,
        /// The most there may be.
        limit: usize,
    },

    /// A node's `extras.cobake` that cannot be followed.
    #[error(
        "{node} has extras.cobake{} = {value}, which must be {expected}; correct it or take it out",
        dotted(key)
    )]
    Setting {
        /// The node.
        node: Item,
        /// The setting; empty for all of them.
        key: String,
        /// What was found.
        value: String,
        /// What it may be.
        expected: &'static str,
    },

    /// Triangles, but none that can hold a lightmap.
    #[error(
        "no mesh of the scene can hold a lightmap: all move (animation, skin or morph targets) or say \
         extras.cobake.bake = false; add one that stands still"
    )]
    NothingToLight,

    /// Nothing to bake.
    #[error("the scene holds no triangles; export its meshes, or choose another of the file's scenes")]
    NoTriangles,
}

fn dotted(key: &str) -> String {
    if key.is_empty() { String::new() } else { format!(".{key}") }
}

fn scenes_there_are(count: usize) -> String {
    match count {
        0 => "the file holds none; leave the choice out".to_owned(),
        1 => "the file holds one, scene 0".to_owned(),
        _ => format!("the file holds {count}, 0 to {}", count - 1),
    }
}

fn last_one(count: usize, kind: &str) -> String {
    match count.checked_sub(1) {
        None => "the file has none".to_owned(),
        Some(last) => format!("the last one is {kind} {last}"),
    }
}
