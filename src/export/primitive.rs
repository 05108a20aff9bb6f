//! What every lit primitive goes through, whatever its geometry: room for `TEXCOORD_1`, and its materials.

use serde_json::Value;

use super::ExportError;
use super::document::{Document, Object, edit_object, index_of};
use super::layout::drop_extensions;
use super::materials::{LIGHTMAP_SET, Materials, Need, uses_lightmap_set};
use super::plan::primitive_materials;

/// Geometry compression: its data are of the old geometry.
pub(super) const DRACO: &str = "KHR_draco_mesh_compression";

/// What becomes of a primitive's texture coordinate set 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum OldSet {
    /// It makes room for the lightmap's: one that a material reads moves to the next free set; one that nobody reads
    /// goes.
    Yields,
    /// It is the lightmap's.
    Stays,
}

/// Gives a primitive of `mesh` materials that carry the lightmap's `page`, and its set 1 its place.
pub(super) fn prepare(
    document: &mut Document,
    materials: &mut Materials,
    primitive: &mut Object,
    (mesh, page, old_set): (usize, usize, OldSet),
) -> Result<(), ExportError> {
    if drop_extensions(primitive, &[DRACO]) && !has_data(document, primitive) {
        return Err(ExportError::Compressed { list: "mesh", index: mesh, extension: DRACO });
    }
    let list = document.source.json.get("materials");
    let read = primitive_materials(primitive)
        .into_iter()
        .filter_map(|index| list.and_then(|list| list.get(index)))
        .any(uses_lightmap_set);
    let yields = old_set == OldSet::Yields;
    let moved = free_set(primitive).filter(|_| read && yields);
    let maps = if yields { attribute_maps(primitive) } else { Vec::new() };
    for (attributes, _) in maps {
        let old = attributes.shift_remove(&set_name(LIGHTMAP_SET));
        match (old, moved) {
            (Some(accessor), Some(set)) => {
                attributes.insert(set_name(set), accessor);
            }
            // An earlier bake's filler, see `insert_coordinates`.
            (Some(accessor), None) if attributes.get(&set_name(0)) == Some(&accessor) => {
                attributes.shift_remove(&set_name(0));
            }
            _ => {}
        }
    }
    // Unlit viewers multiply by vertex colours, which the preview's texels already hold.
    if materials.are_unlit_previews() {
        attribute_maps(primitive).into_iter().for_each(|(attributes, _)| {
            attributes.shift_remove("COLOR_0");
        });
    }
    let need = Need { page, moved };
    let material = index_of(primitive.get("material"));
    if let Some(variant) = materials.variant(document, material, need) {
        primitive.insert("material".into(), variant.into());
    }
    let mappings = primitive
        .get_mut("extensions")
        .and_then(|extensions| extensions.get_mut("KHR_materials_variants")?.get_mut("mappings"))
        .and_then(Value::as_array_mut);
    for mapping in mappings.into_iter().flatten().filter_map(Value::as_object_mut) {
        let variant = materials.variant(document, index_of(mapping.get("material")), need);
        if let Some(variant) = variant {
            mapping.insert("material".into(), variant.into());
        }
    }
    Ok(())
}

/// Puts the lightmap's coordinates on a primitive.
///
/// glTF demands that sets count from 0 without gaps. Where there is no set 0, nothing reads it
/// either, so the same accessor stands in for it and costs no bytes.
pub(super) fn insert_coordinates(primitive: &mut Object, accessor: usize) {
    edit_object(primitive, "attributes", |attributes| {
        if !attributes.contains_key(&set_name(0)) {
            attributes.insert(set_name(0), accessor.into());
        }
        attributes.insert(set_name(LIGHTMAP_SET), accessor.into());
    });
}

/// The attribute of a texture coordinate set.
pub(super) fn set_name(set: usize) -> String {
    format!("TEXCOORD_{set}")
}

/// The primitive's attributes and those of its morph targets, the latter marked.
pub(super) fn attribute_maps(primitive: &mut Object) -> Vec<(&mut Object, bool)> {
    let mut maps = Vec::new();
    for (key, value) in primitive {
        match (key.as_str(), value) {
            ("attributes", Value::Object(attributes)) => maps.push((attributes, false)),
            ("targets", Value::Array(targets)) => {
                let targets = targets.iter_mut().filter_map(Value::as_object_mut);
                maps.extend(targets.map(|target| (target, true)));
            }
            _ => {}
        }
    }
    maps
}

/// The first set beyond the lightmap's that the primitive does not have.
fn free_set(primitive: &Object) -> Option<usize> {
    let attributes = primitive.get("attributes")?.as_object()?;
    (LIGHTMAP_SET + 1..).take(attributes.len() + 1).find(|&set| !attributes.contains_key(&set_name(set)))
}

/// Whether the positions can be read without a decoder.
fn has_data(document: &Document, primitive: &Object) -> bool {
    let position = index_of(primitive.get("attributes").and_then(|attributes| attributes.get("POSITION")));
    let accessor = position.and_then(|position| document.list("accessors").get(position));
    accessor.is_some_and(|accessor| accessor.get("bufferView").is_some() || accessor.get("sparse").is_some())
}
