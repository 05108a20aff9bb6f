//! Who refers to which accessor and bufferView, and dropping those that our changes left unread.
//!
//! An accessor or bufferView goes only if the source referred to it and the output does not:
//! what was unread before is none of our business. Dropping renumbers the others, which is safe
//! only where every place that may hold such an index is known; a document with an extension
//! that is not on the list keeps everything.

use std::collections::{BTreeMap, BTreeSet};

use serde_json::Value;

use super::compact::compact;
use super::document::{Object, index_of};

/// Extensions whose references to accessors and bufferViews are known: none, or visited below.
const KNOWN: [&str; 20] = [
    "CESIUM_RTC",
    "COBAKE_lightmap",
    "EXT_lights_ies",
    "EXT_mesh_gpu_instancing",
    "EXT_meshopt_compression",
    "EXT_texture_avif",
    "EXT_texture_webp",
    "KHR_animation_pointer",
    "KHR_draco_mesh_compression",
    "KHR_lights_punctual",
    "KHR_mesh_quantization",
    "KHR_meshopt_compression",
    "KHR_node_visibility",
    "KHR_texture_basisu",
    "KHR_texture_transform",
    "KHR_xmp",
    "KHR_xmp_json_ld",
    "MOZ_lightmap",
    "MSFT_lod",
    "MSFT_texture_dds",
];

/// Every extension of materials describes materials: factors and textures.
const KNOWN_PREFIX: &str = "KHR_materials_";

/// The accessors and bufferViews that a document refers to.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct References {
    accessors: BTreeSet<usize>,
    views: BTreeSet<usize>,
}

impl References {
    /// Collects a document's references. `root` is left as it was.
    pub(super) fn of(root: &mut Object) -> Self {
        let mut found = Self::default();
        visit_accessors(root, &mut |value| found.accessors.extend(index_of(Some(value))));
        visit_views(root, &mut |value| found.views.extend(index_of(Some(value))));
        found
    }

    /// Drops from `root` what these references had and `root` no longer refers to, and the gaps that
    /// this leaves in views of `buffers`.
    pub(super) fn drop_orphans(
        &self,
        root: &mut Object,
        buffers: &[Vec<u8>],
        added: &mut BTreeMap<usize, Vec<u8>>,
    ) {
        let used = root.get("extensionsUsed").and_then(Value::as_array);
        let known = |name: &Value| {
            name.as_str().is_some_and(|name| KNOWN.contains(&name) || name.starts_with(KNOWN_PREFIX))
        };
        if used.is_some_and(|used| !used.iter().all(known)) {
            return;
        }
        let now = Self::of(root);
        let orphans: BTreeSet<usize> = self.accessors.difference(&now.accessors).copied().collect();
        let accessors = root.get("accessors").and_then(Value::as_array);
        let gone = orphans.iter().filter_map(|&orphan| accessors?.get(orphan));
        let mut touched: BTreeSet<usize> = gone.filter_map(|gone| index_of(gone.get("bufferView"))).collect();
        remove(root, "accessors", &orphans);
        visit_accessors(root, &mut |value| renumber(value, &orphans));
        visit_other_views(root, &mut |value| {
            index_of(Some(value)).map(|view| touched.remove(&view));
        });
        compact(root, &touched, buffers, added);

        // Only now, since the accessors that went took references to views with them.
        let now = Self::of(root);
        let orphans: BTreeSet<usize> = self.views.difference(&now.views).copied().collect();
        remove(root, "bufferViews", &orphans);
        visit_views(root, &mut |value| renumber(value, &orphans));
        *added = std::mem::take(added)
            .into_iter()
            .filter(|(view, _)| !orphans.contains(view))
            .map(|(view, bytes)| (view - orphans.range(..view).count(), bytes))
            .collect();
    }
}

/// Takes the entries at `orphans` out of a top-level list.
fn remove(root: &mut Object, name: &str, orphans: &BTreeSet<usize>) {
    let Some(Value::Array(list)) = root.get_mut(name) else { return };
    let mut index = 0;
    list.retain(|_| {
        index += 1;
        !orphans.contains(&(index - 1))
    });
    if list.is_empty() {
        root.shift_remove(name); // glTF allows no empty list
    }
}

fn renumber(value: &mut Value, orphans: &BTreeSet<usize>) {
    if let Some(index) = index_of(Some(value)) {
        *value = (index - orphans.range(..index).count()).into();
    }
}

fn entries<'o>(object: &'o mut Object, name: &str) -> impl Iterator<Item = &'o mut Object> {
    object.get_mut(name).and_then(Value::as_array_mut).into_iter().flatten().filter_map(Value::as_object_mut)
}

fn child<'o>(object: &'o mut Object, path: &[&str]) -> Option<&'o mut Object> {
    path.iter().try_fold(object, |object, key| object.get_mut(*key)?.as_object_mut())
}

/// Calls `visit` with every index of an accessor.
fn visit_accessors(root: &mut Object, visit: &mut impl FnMut(&mut Value)) {
    for mesh in entries(root, "meshes") {
        for primitive in entries(mesh, "primitives") {
            primitive.get_mut("indices").into_iter().for_each(&mut *visit);
            let attributes = primitive.get_mut("attributes").and_then(Value::as_object_mut);
            attributes.into_iter().flat_map(Object::values_mut).for_each(&mut *visit);
            entries(primitive, "targets").flat_map(Object::values_mut).for_each(&mut *visit);
        }
    }
    for skin in entries(root, "skins") {
        skin.get_mut("inverseBindMatrices").into_iter().for_each(&mut *visit);
    }
    for animation in entries(root, "animations") {
        for sampler in entries(animation, "samplers") {
            sampler.get_mut("input").into_iter().for_each(&mut *visit);
            sampler.get_mut("output").into_iter().for_each(&mut *visit);
        }
    }
    for node in entries(root, "nodes") {
        let attributes = child(node, &["extensions", "EXT_mesh_gpu_instancing", "attributes"]);
        attributes.into_iter().flat_map(Object::values_mut).for_each(&mut *visit);
    }
}

/// Calls `visit` with every index of a bufferView.
fn visit_views(root: &mut Object, visit: &mut impl FnMut(&mut Value)) {
    for accessor in entries(root, "accessors") {
        accessor.get_mut("bufferView").into_iter().for_each(&mut *visit);
    }
    visit_other_views(root, visit);
}

/// Calls `visit` with every index of a bufferView that is not an accessor's own.
fn visit_other_views(root: &mut Object, visit: &mut impl FnMut(&mut Value)) {
    for accessor in entries(root, "accessors") {
        for part in ["indices", "values"] {
            let view = child(accessor, &["sparse", part]).and_then(|part| part.get_mut("bufferView"));
            view.into_iter().for_each(&mut *visit);
        }
    }
    for image in entries(root, "images") {
        image.get_mut("bufferView").into_iter().for_each(&mut *visit);
    }
    for mesh in entries(root, "meshes") {
        for primitive in entries(mesh, "primitives") {
            let draco = child(primitive, &["extensions", "KHR_draco_mesh_compression"]);
            draco.and_then(|draco| draco.get_mut("bufferView")).into_iter().for_each(&mut *visit);
        }
    }
    for extension in ["EXT_lights_ies", "COBAKE_lightmap"] {
        let Some(object) = child(root, &["extensions", extension]) else { continue };
        for list in ["lights", "lightmaps"] {
            for item in entries(object, list) {
                item.get_mut("bufferView").into_iter().for_each(&mut *visit);
            }
        }
    }
    for part in ["positions", "corners", "states"] {
        let part = child(root, &["extensions", "COBAKE_lightmap", "elements", part]);
        part.and_then(|part| part.get_mut("bufferView")).into_iter().for_each(&mut *visit);
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn document(extension: &str) -> Object {
        let value = json!({
            "extensionsUsed": [extension],
            "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "NORMAL": 2}, "indices": 3}]}],
            "accessors": [
                {"bufferView": 0}, {"bufferView": 1}, {"bufferView": 2},
                {"bufferView": 3, "sparse": {"indices": {"bufferView": 3}, "values": {"bufferView": 4}}}
            ],
            "images": [{"bufferView": 5}],
            "bufferViews": ["a", "b", "c", "d", "e", "f", "g"],
        });
        value.as_object().unwrap().clone()
    }

    /// The normal's data go, what was unread before stays, and the others are found again.
    #[test]
    fn orphans_go_and_the_rest_is_renumbered() {
        let mut root = document("KHR_lights_punctual");
        let before = References::of(&mut root);
        root["meshes"][0]["primitives"][0]["attributes"].as_object_mut().unwrap().shift_remove("NORMAL");
        let mut added = BTreeMap::from([(6, vec![1])]);
        before.drop_orphans(&mut root, &[], &mut added);
        assert_eq!(root["bufferViews"], json!(["a", "b", "d", "e", "f", "g"]));
        assert_eq!(root["accessors"].as_array().unwrap().len(), 3);
        assert_eq!(root["meshes"][0]["primitives"][0]["indices"], 2);
        assert_eq!(root["accessors"][2]["sparse"]["values"]["bufferView"], 3);
        assert_eq!(root["images"][0]["bufferView"], 4);
        assert_eq!(added, BTreeMap::from([(5, vec![1])]));
    }

    /// A file baked with its elements loses them, and nothing else, when it is baked again.
    #[test]
    fn elements_are_known() {
        let mut root = document("COBAKE_lightmap");
        root["images"] = json!([{"bufferView": 6}]);
        let elements = json!({"count": 1, "positions": {"bufferView": 5}, "corners": {"bufferView": 5},
                              "states": {"bufferView": 5}});
        root.insert("extensions".into(), json!({"COBAKE_lightmap": {"elements": elements}}));
        let before = References::of(&mut root);
        before.drop_orphans(&mut root, &[], &mut BTreeMap::new());
        assert_eq!(root["bufferViews"].as_array().unwrap().len(), 7, "they are read");
        root.shift_remove("extensions");
        before.drop_orphans(&mut root, &[], &mut BTreeMap::new());
        assert_eq!(root["bufferViews"], json!(["a", "b", "c", "d", "e", "g"]));
        assert_eq!(root["images"][0]["bufferView"], 5);
    }

    #[test]
    fn an_unknown_extension_keeps_everything() {
        let mut root = document("VENDOR_structural_metadata");
        let before = References::of(&mut root);
        root.shift_remove("meshes");
        let expected = root.clone();
        before.drop_orphans(&mut root, &[], &mut BTreeMap::new());
        assert_eq!(root, expected);
    }
}
