//! Materials: what a surface does with diffuse light.
//!
//! - reflectance = `baseColorFactor × baseColorTexture × (1 − metallicFactor × metallic texture)`,
//!   times `COLOR_0`; glTF's metallic factor is 1 where it is absent, so that such a material is black.
//!   `KHR_materials_pbrSpecularGlossiness`: `diffuse × (1 − largest channel of specular)`.
//! - emission = `emissiveFactor × emissiveTexture × emissiveStrength`.
//! - `KHR_materials_unlit` surfaces neither receive light nor send any out; they only block it.
//! - a primitive without material is a white diffuse one: nothing was said about it, and the metal
//!   that glTF's defaults make of it would bake black.
//! - `alphaMode` makes surfaces stop less light, see `coverage`; an unlit one's too. Transmission is left out.

use glam::DVec3;

use super::appearance::{Alpha, Appearance, Channel, Layers};
use super::document::{Document, MaterialEntry, SpecularGlossiness, TextureInfo};
use super::texture::{Binding, Encoding, Request, bind};
use super::warning::Warnings;
use super::{ImportError, Item, Material};

/// The layers of every material, then of the default one, with the images that they need.
#[derive(Debug, Default)]
pub(super) struct Palette {
    pub(super) layers: Vec<Layers>,
    pub(super) requests: Vec<Request>,
}

/// Reads the document's materials. Those not `used` get no textures and no warnings.
pub(super) fn read(
    document: &Document,
    used: &[bool],
    warnings: &mut Warnings,
) -> Result<Palette, ImportError> {
    let mut palette = Palette::default();
    for (index, entry) in document.materials.iter().enumerate() {
        let used = used.get(index).copied().unwrap_or(false);
        let mut unheard = Warnings::default();
        let warnings = if used { &mut *warnings } else { &mut unheard };
        let mut reader = Reader { document, index, warnings, requests: &mut palette.requests };
        let mut layers = reader.layers(entry)?;
        if used {
            reader.textures(entry, &mut layers)?;
            reader.warn(entry, &layers);
        }
        palette.layers.push(layers);
    }
    palette.layers.push(Layers { base: DVec3::ONE, ..Layers::default() });
    Ok(palette)
}

/// The texture coordinate sets that material `index` may need.
pub(super) fn texture_coordinate_sets(document: &Document, index: usize) -> Vec<u32> {
    let Some(entry) = document.materials.get(index) else { return Vec::new() };
    let set = |info: &TextureInfo| {
        info.extensions.transform.as_ref().and_then(|transform| transform.tex_coord).unwrap_or(info.tex_coord)
    };
    let alpha = base_texture(entry).filter(|_| is_see_through(entry));
    let mut sets: Vec<u32> = textures(entry).into_iter().chain([alpha]).flatten().map(set).collect();
    sets.sort_unstable();
    sets.dedup();
    sets
}

/// The materials as later stages see them; `appearance` has the textures decoded.
pub(super) fn finish(document: &Document, appearance: &Appearance) -> Vec<Material> {
    let describe = |(index, layers): (usize, &Layers)| {
        let entry = document.materials.get(index);
        let name = match entry {
            Some(entry) => entry.name.clone().unwrap_or_else(|| format!("material {index}")),
            None => "default material".to_owned(),
        };
        let varies = |binding| appearance.texture(binding).is_some_and(|texture| !texture.is_uniform());
        let mean = |binding: &Binding| appearance.mean(binding);
        Material {
            index: entry.map(|_| index),
            name,
            reflectance: layers.reflectance(mean).clamp(DVec3::ZERO, DVec3::ONE),
            emission: layers.emission(mean),
            double_sided: entry.is_some_and(|entry| entry.double_sided),
            textured: layers.bindings().any(varies),
        }
    };
    appearance.materials.iter().enumerate().map(describe).collect()
}

/// Base, specular and emission texture of a material.
fn textures(entry: &MaterialEntry) -> [Option<&TextureInfo>; 3] {
    if entry.extensions.unlit.is_some() {
        return [None; 3];
    }
    let emission = entry.emissive_texture.as_ref();
    match &entry.extensions.specular_glossiness {
        Some(old) => [old.diffuse_texture.as_ref(), old.specular_glossiness_texture.as_ref(), emission],
        None => {
            let core = &entry.pbr_metallic_roughness;
            [core.base_color_texture.as_ref(), core.metallic_roughness_texture.as_ref(), emission]
        }
    }
}

/// The texture of the base colour, whose alpha counts on unlit materials too.
fn base_texture(entry: &MaterialEntry) -> Option<&TextureInfo> {
    match &entry.extensions.specular_glossiness {
        Some(old) => old.diffuse_texture.as_ref(),
        None => entry.pbr_metallic_roughness.base_color_texture.as_ref(),
    }
}

fn is_see_through(entry: &MaterialEntry) -> bool {
    matches!(entry.alpha_mode.as_deref(), Some("MASK" | "BLEND"))
}

struct Reader<'a> {
    document: &'a Document,
    index: usize,
    warnings: &'a mut Warnings,
    requests: &'a mut Vec<Request>,
}

impl Reader<'_> {
    fn item(&self) -> Item {
        self.document.material_item(self.index)
    }

    /// The factors.
    fn layers(&mut self, entry: &MaterialEntry) -> Result<Layers, ImportError> {
        if entry.extensions.unlit.is_some() {
            return Ok(Layers::default());
        }
        let strength = entry.extensions.strength.as_ref().and_then(|strength| strength.emissive_strength);
        let emission = DVec3::from_array(entry.emissive_factor.unwrap_or([0.0; 3])) * strength.unwrap_or(1.0);
        let (base, specular) = match &entry.extensions.specular_glossiness {
            Some(old) => specular_glossiness(old),
            None => {
                let core = &entry.pbr_metallic_roughness;
                let base = core.base_color_factor.unwrap_or([1.0; 4]);
                (DVec3::new(base[0], base[1], base[2]), core.metallic_factor.unwrap_or(1.0))
            }
        };
        let clamped_base = base.clamp(DVec3::ZERO, DVec3::ONE);
        let clamped_specular = specular.clamp(0.0, 1.0);
        if clamped_base != base || clamped_specular.to_bits() != specular.to_bits() {
            self.warnings
                .about(self.item(), "its colour or metallic factor is outside 0 to 1 and is clamped");
        }
        let mut clamped_emission = emission.max(DVec3::ZERO);
        if !clamped_emission.is_finite() {
            clamped_emission = DVec3::ZERO;
        }
        if clamped_emission != emission {
            self.warnings.about(self.item(), "its emission is negative or not finite and counts as 0");
        }
        Ok(Layers {
            base: clamped_base,
            specular: clamped_specular,
            emission: clamped_emission,
            ..Layers::default()
        })
    }

    /// The textures, where the factors leave something for them to modulate.
    fn textures(&mut self, entry: &MaterialEntry, layers: &mut Layers) -> Result<(), ImportError> {
        let [base, specular, emission] = textures(entry);
        let channel = match entry.extensions.specular_glossiness {
            Some(_) => (Encoding::Srgb, Channel::Largest),
            None => (Encoding::Linear, Channel::Blue),
        };
        layers.base_texture = self.bind(base.filter(|_| layers.base != DVec3::ZERO), Encoding::Srgb)?;
        let specular = self.bind(specular.filter(|_| layers.specular > 0.0), channel.0)?;
        layers.specular_texture = specular.map(|binding| (binding, channel.1));
        layers.emission_texture =
            self.bind(emission.filter(|_| layers.emission != DVec3::ZERO), Encoding::Srgb)?;
        if is_see_through(entry) {
            let factor = match &entry.extensions.specular_glossiness {
                Some(old) => old.diffuse_factor,
                None => entry.pbr_metallic_roughness.base_color_factor,
            };
            let texture = self.bind(base_texture(entry), Encoding::Alpha)?;
            let cutoff = entry.alpha_cutoff.unwrap_or(0.5);
            let cutoff = (entry.alpha_mode.as_deref() == Some("MASK")).then_some(cutoff);
            layers.alpha =
                Some(Alpha { factor: factor.map_or(1.0, |[_, _, _, alpha]| alpha), texture, cutoff });
        }
        Ok(())
    }

    fn bind(
        &mut self,
        info: Option<&TextureInfo>,
        encoding: Encoding,
    ) -> Result<Option<Binding>, ImportError> {
        let Some(info) = info else { return Ok(None) };
        let (document, index) = (self.document, self.index);
        let item = || document.material_item(index);
        bind(document, info, encoding, (&item, self.requests, self.warnings))
    }

    /// What a bake makes of a material otherwise than a viewer would.
    fn warn(&mut self, entry: &MaterialEntry, layers: &Layers) {
        let item = self.item();
        if entry.extensions.unlit.is_some() {
            let text = "KHR_materials_unlit, so it blocks light and neither reflects nor emits any";
            return self.warnings.about(item, text);
        }
        if entry.extensions.transmission.is_some() || entry.extensions.diffuse_transmission.is_some() {
            self.warnings.about(&item, "its light transmission is not baked; the surface is opaque");
        }
        // Exactly 1 is the factor's default and its largest value.
        if layers.specular >= 1.0 && layers.specular_texture.is_none() && layers.base != DVec3::ZERO {
            self.warnings.about(
                &item,
                "fully metallic or specular (the factor is 1 where it is absent), so it reflects no diffuse light",
            );
        }
    }
}

/// Diffuse colour and specular share of `KHR_materials_pbrSpecularGlossiness`.
fn specular_glossiness(old: &SpecularGlossiness) -> (DVec3, f64) {
    let diffuse = old.diffuse_factor.unwrap_or([1.0; 4]);
    let specular = DVec3::from_array(old.specular_factor.unwrap_or([1.0; 3]));
    (DVec3::new(diffuse[0], diffuse[1], diffuse[2]), specular.max_element())
}
