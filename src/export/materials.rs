//! Materials that carry the lightmap.
//!
//! `MOZ_lightmap` sits on materials, and moving a texture coordinate set changes a material too.
//! Both may concern only some of a material's users, so a user asks for the *variant* it needs:
//! the first variant takes the material's own place, unless someone who is not lit uses it as well;
//! further ones are added at the end.

use std::collections::{BTreeMap, BTreeSet};

use serde_json::{Value, json};

use super::document::{Document, Object, edit_object, index_of};
use super::preview;
use crate::options::Preview;

/// The deployed extension that puts a lightmap on a material.
const MOZ_LIGHTMAP: &str = "MOZ_lightmap";

/// The set that lightmap coordinates live in: loaders have it hard-coded.
pub(crate) const LIGHTMAP_SET: usize = 1;

/// What lit materials will refer to.
#[derive(Clone, Debug)]
pub(super) struct LightmapImage {
    /// The PNG file.
    pub(super) png: Vec<u8>,
    /// What a stored 255 stands for: irradiance, or in a preview radiance.
    pub(super) intensity: f64,
    /// Whether it is a preview that takes the material's place, or else what `MOZ_lightmap` refers to.
    pub(super) preview: Option<Preview>,
}

/// What a lit primitive's material must do.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Need {
    /// The page that lights it.
    pub(super) page: usize,
    /// The set that the primitive's texture coordinate set 1 moved to.
    pub(super) moved: Option<usize>,
}

/// The variants made so far.
#[derive(Debug)]
pub(super) struct Materials {
    /// The image of each page; none where the quantity is not one that `MOZ_lightmap` can hold.
    images: Vec<LightmapImage>,
    /// The textures of the images that a material needed, by page.
    textures: BTreeMap<usize, usize>,
    /// Materials whose place is not free.
    occupied: BTreeSet<usize>,
    /// By material (`None` the default one) and what its user needs.
    variants: BTreeMap<(Option<usize>, Need), Option<usize>>,
}

impl Materials {
    /// No variants yet. `unlit` are the materials that someone without a lightmap uses.
    pub(super) fn new(images: Vec<LightmapImage>, unlit: BTreeSet<usize>) -> Self {
        Self { images, textures: BTreeMap::new(), occupied: unlit, variants: BTreeMap::new() }
    }

    /// The material to use in place of `material` (`None`: the default one) by a lit primitive.
    pub(super) fn variant(
        &mut self,
        document: &mut Document,
        material: Option<usize>,
        need: Need,
    ) -> Option<usize> {
        if let Some(&made) = self.variants.get(&(material, need)) {
            return made;
        }
        let original = material.and_then(|index| document.source.json.get("materials")?.get(index));
        let original = original.and_then(Value::as_object).cloned().unwrap_or_default();
        let mut changed = original.clone();
        if let Some(set) = need.moved {
            move_set(&mut changed, set);
        }
        self.carry_lightmap(document, &mut changed, need.page);
        // What another page's variant has taken the place of is no longer the original.
        let is_there = match material {
            Some(index) => document.list("materials").get(index).and_then(Value::as_object) == Some(&changed),
            None => changed == original,
        };
        let made = if is_there {
            self.occupied.extend(material);
            material
        } else {
            match material.filter(|&index| self.occupied.insert(index)) {
                Some(index) => {
                    if let Some(slot) = document.entry("materials", index) {
                        *slot = changed;
                    }
                    Some(index)
                }
                None => Some(document.push("materials", changed.into())),
            }
        };
        self.variants.insert((material, need), made);
        made
    }

    /// Whether lit primitives show the light as the colour of unlit materials.
    pub(super) fn are_unlit_previews(&self) -> bool {
        self.images.first().is_some_and(|image| image.preview == Some(Preview::Unlit))
    }

    /// Puts the lightmap on a material in place of the one it may have; unlit ones show no light.
    fn carry_lightmap(&mut self, document: &mut Document, material: &mut Object, page: usize) {
        super::layout::drop_extensions(material, &[MOZ_LIGHTMAP]);
        let unlit = material.get("extensions").is_some_and(|e| e.get("KHR_materials_unlit").is_some());
        let Some(image) = self.images.get(page).filter(|_| !unlit) else { return };
        let texture = match self.textures.get(&page) {
            Some(&texture) => texture,
            None => place_texture(document, (page, image), &self.occupied, &self.textures),
        };
        self.textures.insert(page, texture);
        if let Some(form) = image.preview {
            let (made, extension) = preview::material(material, form, (texture, image.intensity));
            *material = made;
            return document.use_extension(extension);
        }
        let info = json!({"index": texture, "texCoord": LIGHTMAP_SET, "intensity": image.intensity});
        edit_object(material, "extensions", |extensions| {
            extensions.insert(MOZ_LIGHTMAP.into(), info);
        });
        document.use_extension(MOZ_LIGHTMAP);
    }
}

/// Adds a page's image, sampler and texture. A file that is baked again gets its new image in
/// the old one's place, if nobody else uses that, nor another page by now.
fn place_texture(
    document: &mut Document,
    (page, image): (usize, &LightmapImage),
    unlit: &BTreeSet<usize>,
    placed: &BTreeMap<usize, usize>,
) -> usize {
    let view = document.add_view(image.png.clone());
    let name = format!("{}{page}", if image.preview.is_some() { "preview" } else { "lightmap" });
    let image = json!({"bufferView": view, "mimeType": "image/png", "name": name});
    let sampler = json!({"magFilter": 9729, "minFilter": 9729, "wrapS": 33071, "wrapT": 33071});
    let sampler = match document.list("samplers").iter().position(|known| *known == sampler) {
        Some(known) => known,
        None => document.push("samplers", sampler),
    };
    let old = replaceable_textures(document, unlit).into_iter().find(|old| placed.values().all(|p| p != old));
    let old_image = old.and_then(|texture| index_of(document.list("textures").get(texture)?.get("source")));
    let users = document.list("textures").iter().filter(|t| index_of(t.get("source")) == old_image).count();
    let image = match old_image.filter(|_| users == 1).and_then(|old| document.entry("images", old)) {
        Some(slot) => {
            *slot = image.as_object().cloned().unwrap_or_default();
            old_image
        }
        None => Some(document.push("images", image)),
    };
    let texture = json!({"source": image, "sampler": sampler});
    match old.and_then(|old| document.entry("textures", old)) {
        Some(slot) => {
            *slot = texture.as_object().cloned().unwrap_or_default();
            old.unwrap_or_default()
        }
        None => document.push("textures", texture),
    }
}

/// Textures that only lightmaps of lit materials use: those that this bake replaces.
fn replaceable_textures(document: &Document, unlit: &BTreeSet<usize>) -> Vec<usize> {
    let (mut lightmaps, mut others) = (BTreeSet::new(), BTreeSet::new());
    let materials = document.source.json.get("materials").and_then(Value::as_array);
    for (index, material) in materials.into_iter().flatten().enumerate() {
        let Some(mut material) = material.as_object().cloned() else { continue };
        let lightmap = material.get("extensions").and_then(|e| e.get(MOZ_LIGHTMAP)?.get("index"));
        let lightmap = index_of(lightmap);
        if unlit.contains(&index) {
            others.extend(lightmap);
        } else {
            lightmaps.extend(lightmap);
        }
        super::layout::drop_extensions(&mut material, &[MOZ_LIGHTMAP]);
        visit_textures(&mut material, &mut |info| others.extend(index_of(info.get("index"))));
    }
    lightmaps.difference(&others).copied().collect()
}

/// Whether a material reads texture coordinate set 1 for anything but an old lightmap.
pub(super) fn uses_lightmap_set(material: &Value) -> bool {
    let Some(mut material) = material.as_object().cloned() else { return false };
    super::layout::drop_extensions(&mut material, &[MOZ_LIGHTMAP]);
    let mut uses = false;
    visit_textures(&mut material, &mut |info| {
        let transformed =
            info.get("extensions").and_then(|e| e.get("KHR_texture_transform")?.get("texCoord"));
        uses |=
            [info.get("texCoord"), transformed].into_iter().any(|set| index_of(set) == Some(LIGHTMAP_SET));
    });
    uses
}

/// Makes everything that reads set 1 read `set`.
fn move_set(material: &mut Object, set: usize) {
    visit_textures(material, &mut |info| {
        rename_set(info, set);
        let transform = info.get_mut("extensions").and_then(|e| e.get_mut("KHR_texture_transform"));
        if let Some(transform) = transform.and_then(Value::as_object_mut) {
            rename_set(transform, set);
        }
    });
}

fn rename_set(object: &mut Object, set: usize) {
    if index_of(object.get("texCoord")) == Some(LIGHTMAP_SET) {
        object.insert("texCoord".into(), set.into());
    }
}

/// Calls `visit` with every texture reference in a material: the objects that have an `index`,
/// in the material itself or in an extension, whoever defined it. Extras are not looked into.
fn visit_textures(object: &mut Object, visit: &mut impl FnMut(&mut Object)) {
    for (key, value) in object {
        let Value::Object(inner) = value else { continue };
        if key == "extras" {
            continue;
        }
        if inner.contains_key("index") {
            visit(inner);
        }
        visit_textures(inner, visit);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::SourceDocument;

    fn source() -> SourceDocument {
        let json = json!({
            "materials": [
                {"name": "both", "pbrMetallicRoughness": {"baseColorTexture": {"index": 0, "texCoord": 1}},
                 "normalTexture": {"index": 1, "texCoord": 0, "extensions":
                    {"KHR_texture_transform": {"texCoord": 1, "scale": [2, 2]}}},
                 "extras": {"thing": {"index": 0, "texCoord": 1}}},
                {"name": "flat", "extensions": {"KHR_materials_unlit": {}}},
                {"name": "plain"}
            ],
            "textures": [{"source": 0}, {"source": 1}]
        });
        SourceDocument { json, buffers: Vec::new(), external_images: Vec::new() }
    }

    fn materials(unlit: &[usize]) -> Materials {
        let image = LightmapImage { png: vec![1, 2, 3], intensity: 4.0, preview: None };
        Materials::new(vec![image], unlit.iter().copied().collect())
    }

    #[test]
    fn sets_are_seen_and_moved() {
        let source = source();
        let mut document = Document::open(&source);
        assert!(uses_lightmap_set(&source.json["materials"][0]));
        assert!(!uses_lightmap_set(&source.json["materials"][2]));
        let made = materials(&[]).variant(&mut document, Some(0), Need { page: 0, moved: Some(2) });
        assert_eq!(made, Some(0));
        let material = &document.list("materials")[0];
        assert_eq!(material["pbrMetallicRoughness"]["baseColorTexture"]["texCoord"], 2);
        let normal = &material["normalTexture"];
        assert_eq!(normal["texCoord"], 0);
        assert_eq!(normal["extensions"]["KHR_texture_transform"]["texCoord"], 2);
        assert_eq!(material["extras"], source.json["materials"][0]["extras"]);
        assert_eq!(
            material["extensions"]["MOZ_lightmap"],
            json!({"index": 2, "texCoord": 1, "intensity": 4.0})
        );
    }

    /// Who is not lit keeps the material as it was.
    #[test]
    fn unlit_users_keep_their_material() {
        let source = source();
        let mut document = Document::open(&source);
        let mut materials = materials(&[2]);
        assert_eq!(materials.variant(&mut document, Some(2), Need::default()), Some(3));
        assert_eq!(materials.variant(&mut document, Some(2), Need::default()), Some(3));
        assert_eq!(document.list("materials")[2], source.json["materials"][2]);
        assert_eq!(document.list("textures").len(), 3);
    }

    #[test]
    fn unlit_materials_carry_no_lightmap_and_default_ones_do() {
        let source = source();
        let mut document = Document::open(&source);
        let mut materials = materials(&[]);
        assert_eq!(materials.variant(&mut document, Some(1), Need::default()), Some(1));
        assert!(document.list("extensionsUsed").is_empty());
        let made = materials.variant(&mut document, None, Need::default()).unwrap();
        assert!(document.list("materials")[made]["extensions"]["MOZ_lightmap"].is_object());
        assert_eq!(document.list("extensionsUsed"), ["MOZ_lightmap"]);
    }

    /// Baking a baked file replaces its lightmap's texture instead of adding one.
    #[test]
    fn an_old_lightmap_is_replaced() {
        let mut source = source();
        source.json["materials"][2]["extensions"] = json!({"MOZ_lightmap": {"index": 1, "texCoord": 1}});
        source.json["materials"][0] = json!({});
        source.json["images"] = json!([{"uri": "a"}, {"uri": "b"}]);
        let mut document = Document::open(&source);
        materials(&[]).variant(&mut document, Some(2), Need::default());
        assert_eq!(document.list("textures").len(), 2);
        assert_eq!(document.list("images").len(), 2);
        assert_eq!(document.list("images")[1]["name"], "lightmap0");
    }
}
