//! The document being written: the source's JSON, changed in place, and the binary data added to it.
//!
//! bufferViews keep pointing into the source's buffers until [`Document::finish`] packs what is
//! still wanted, and what was added, into the one buffer of a GLB.

use std::collections::BTreeMap;

use serde_json::{Value, json};

use super::layout;
use super::references::References;
use super::{ExportError, glb};
use crate::scene::SourceDocument;

/// A JSON object.
pub(super) type Object = serde_json::Map<String, Value>;

/// Reads an index (or any other whole number of at least 0).
pub(super) fn index_of(value: Option<&Value>) -> Option<usize> {
    value.and_then(Value::as_u64).and_then(|n| usize::try_from(n).ok())
}

/// Edits the object under `key`, an empty one where it is missing or something else.
pub(super) fn edit_object(object: &mut Object, key: &str, edit: impl FnOnce(&mut Object)) {
    let mut inner =
        object.get_mut(key).and_then(Value::as_object_mut).map(std::mem::take).unwrap_or_default();
    edit(&mut inner);
    object.insert(key.into(), inner.into());
}

/// What an added accessor's data are for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Target {
    /// Vertex attributes, this many bytes a vertex (a multiple of 4).
    Vertices(usize),
    /// Indices, this many bytes each.
    Indices(usize),
}

/// A document under construction.
#[derive(Debug)]
pub(super) struct Document<'a> {
    /// The document as it was read.
    pub(super) source: &'a SourceDocument,
    /// The JSON as it will be written.
    pub(super) root: Object,
    /// The bytes of the bufferViews that were added, by index.
    added: BTreeMap<usize, Vec<u8>>,
    /// bufferViews that several added accessors share.
    shared: BTreeMap<Target, usize>,
    /// What the source referred to.
    before: References,
}

impl<'a> Document<'a> {
    /// Opens a copy of `source`, its external images moved into bufferViews.
    pub(super) fn open(source: &'a SourceDocument) -> Self {
        let mut root = source.json.as_object().cloned().unwrap_or_default();
        let before = References::of(&mut root);
        let mut document = Self { source, root, added: BTreeMap::new(), shared: BTreeMap::new(), before };
        for (index, image) in source.external_images.iter().enumerate() {
            if let Some((bytes, mime)) = image {
                document.embed_image(index, bytes, mime);
            }
        }
        document
    }

    fn embed_image(&mut self, index: usize, bytes: &[u8], mime: &str) {
        if self.entry("images", index).is_none_or(|image| image.contains_key("bufferView")) {
            return;
        }
        let view = self.add_view(bytes.to_vec());
        if let Some(image) = self.entry("images", index) {
            image.shift_remove("uri");
            image.insert("bufferView".into(), view.into());
            image.insert("mimeType".into(), mime.into());
        }
    }

    /// One of the document's top-level lists; empty where there is none.
    pub(super) fn list(&self, name: &str) -> &[Value] {
        self.root.get(name).and_then(Value::as_array).map_or(&[], Vec::as_slice)
    }

    /// An object of a top-level list.
    pub(super) fn entry(&mut self, name: &str, index: usize) -> Option<&mut Object> {
        self.root.get_mut(name)?.get_mut(index)?.as_object_mut()
    }

    /// Appends to a top-level list and returns the new index.
    pub(super) fn push(&mut self, name: &str, value: Value) -> usize {
        let slot = self.root.entry(name).or_insert(Value::Null);
        match slot {
            Value::Array(list) => {
                list.push(value);
                list.len() - 1
            }
            _ => {
                *slot = Value::Array(vec![value]);
                0
            }
        }
    }

    /// Adds a bufferView of its own for `bytes` and returns its index.
    pub(super) fn add_view(&mut self, bytes: Vec<u8>) -> usize {
        let view = self.push("bufferViews", json!({"buffer": 0}));
        self.added.insert(view, bytes);
        view
    }

    /// Adds an accessor over `bytes` and returns its index.
    ///
    /// `accessor` holds all members but `bufferView` and `byteOffset`. Accessors of one target share
    /// a bufferView, so a scene of many small meshes does not become a list of many small views.
    pub(super) fn add_accessor(&mut self, mut accessor: Object, target: Target, bytes: &[u8]) -> usize {
        let view = match self.shared.get(&target) {
            Some(&view) => view,
            None => {
                let view = self.push(
                    "bufferViews",
                    match target {
                        Target::Vertices(stride) => {
                            json!({"buffer": 0, "byteStride": stride, "target": 34962})
                        }
                        Target::Indices(_) => json!({"buffer": 0, "target": 34963}),
                    },
                );
                self.shared.insert(target, view);
                view
            }
        };
        let data = self.added.entry(view).or_default();
        let offset = data.len();
        data.extend_from_slice(bytes);
        accessor.insert("bufferView".into(), view.into());
        match offset {
            0 => accessor.shift_remove("byteOffset"),
            _ => accessor.insert("byteOffset".into(), offset.into()),
        };
        self.push("accessors", Value::Object(accessor))
    }

    /// Adds vertex data of 32-bit floats, `components` a vertex, and returns the accessor's index.
    pub(super) fn add_floats(&mut self, values: &[f32], components: usize) -> usize {
        let kind = match components {
            1 => "SCALAR",
            2 => "VEC2",
            3 => "VEC3",
            _ => "VEC4",
        };
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        let mut accessor = Object::new();
        accessor.insert("componentType".into(), 5126.into());
        accessor.insert("count".into(), (values.len() / components.max(1)).into());
        accessor.insert("type".into(), kind.into());
        self.add_accessor(accessor, Target::Vertices(4 * components), &bytes)
    }

    /// Adds triangle corners for a primitive of `vertices` vertices, in the smallest index type that
    /// holds them (65535 is reserved), and returns the accessor's index.
    pub(super) fn add_triangles(&mut self, corners: &[[u32; 3]], vertices: usize) -> usize {
        let mut accessor = Object::new();
        let indices = corners.iter().flatten();
        let (kind, size, bytes): (u32, usize, Vec<u8>) = if vertices <= usize::from(u16::MAX) {
            (5123, 2, indices.flat_map(|&i| u16::try_from(i).unwrap_or_default().to_le_bytes()).collect())
        } else {
            (5125, 4, indices.flat_map(|i| i.to_le_bytes()).collect())
        };
        accessor.insert("componentType".into(), kind.into());
        accessor.insert("count".into(), (3 * corners.len()).into());
        accessor.insert("type".into(), "SCALAR".into());
        self.add_accessor(accessor, Target::Indices(size), &bytes)
    }

    /// Names an extension as used; never as required, since strict loaders would refuse the file.
    pub(super) fn use_extension(&mut self, name: &str) {
        let known = self.list("extensionsUsed").iter().any(|used| used == name);
        if !known {
            self.push("extensionsUsed", name.into());
        }
    }

    /// Packs the document into a GLB: data that the changes left without a reader are dropped,
    /// all others end up in one buffer.
    pub(super) fn finish(mut self) -> Result<Vec<u8>, ExportError> {
        self.before.drop_orphans(&mut self.root, &self.source.buffers, &mut self.added);
        let binary = layout::pack(&mut self.root, &self.source.buffers, &self.added)?;
        glb::pack(&Value::Object(self.root), &binary)
    }
}
