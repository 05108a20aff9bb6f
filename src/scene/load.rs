//! From a file to a scene: the stage's parts in order.

use std::path::Path;
use std::sync::Arc;

use rayon::prelude::*;

use super::accessor::Accessors;
use super::appearance::Appearance;
use super::document::Document;
use super::place::{Placed, materials_in_use};
use super::pyramid::Pyramid;
use super::texture::Request;
use super::warning::Warnings;
use super::{ImportError, Item, Material, PunctualLight, Scene, SourceDocument};
use super::{
    container, extension, hierarchy, instancing, material, place, punctual, settings, source, texture, uri,
};
use crate::options::{Dynamic, Normals};

/// What an import can be told.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ImportOptions {
    /// Which of the document's scenes to read, by index. Default: the document's own default, else its
    /// first; all root nodes where the document has no scenes.
    pub scene: Option<usize>,
    /// What becomes of meshes that move. Default: [`Dynamic::Ignore`].
    pub dynamic: Dynamic,
    /// Whether vertices' normals are read. Default: [`Normals::Geometric`], not.
    pub normals: Normals,
}

/// Reads the scene in the `.glb` or `.gltf` file at `path`.
///
/// Buffers and images beside the file are found relative to its folder. A texture that is missing or
/// cannot be decoded is a warning, as in viewers: the geometry is whole, and the material's factor
/// stands in for it.
///
/// # Errors
/// Where the file cannot be read, is not glTF 2.0, requires an extension that is not honoured, is
/// inconsistent with itself, or holds no triangles. See [`ImportError`].
pub fn load(path: &Path, options: &ImportOptions) -> Result<Scene, ImportError> {
    if path.is_dir() {
        return Err(ImportError::Directory { path: path.to_owned() });
    }
    let bytes = uri::read_file(path, u64::MAX)
        .map_err(|source| ImportError::Read { path: path.to_owned(), source })?;
    from_bytes(&bytes, path.parent(), options)
}

/// Reads the scene in the bytes of a `.glb` or `.gltf` file.
///
/// `base` is the folder for what the document refers to; without it, only embedded data is found.
///
/// # Errors
/// As [`load`].
pub fn from_bytes(bytes: &[u8], base: Option<&Path>, options: &ImportOptions) -> Result<Scene, ImportError> {
    let container = container::split(bytes)?;
    let mut json = serde_json::from_slice(container.json).map_err(|source| ImportError::Json { source })?;
    let mut document = Document::read(&json)?;
    let mut warnings = Warnings::default();
    extension::check_required(&document)?;
    #[cfg_attr(not(feature = "meshopt"), expect(unused_mut, reason = "nothing is decoded"))]
    let mut buffers = source::read_buffers(&document, container.binary, base)?;
    #[cfg(feature = "meshopt")]
    if super::meshopt::decode(&mut json, &mut buffers)? {
        document = Document::read(&json)?;
    }
    if instancing::expand(&mut json, &document, &buffers)? {
        document = Document::read(&json)?;
    }

    let nodes = hierarchy::traverse(&document, options.scene, &mut warnings)?;
    let external_images = source::read_images(&document, base, &mut warnings);
    let accessors = Accessors { document: &document, buffers: &buffers };
    let sets = |material| material::texture_coordinate_sets(&document, material);
    let settings = settings::of_nodes(&json, &document, &nodes, &mut warnings)?;
    let placed =
        place::place(accessors, &nodes, &settings, (options.dynamic, options.normals), &sets, &mut warnings)?;

    let used = materials_in_use(&document, &placed);
    let palette = material::read(&document, &used, &mut warnings)?;
    let lights = punctual::lights(&document, &nodes, &mut warnings)?;
    let source = SourceDocument { json, buffers, external_images };
    let textures = decode_all(&document, &source, &palette.requests, &mut warnings)?;
    let Placed { vertices, normals, triangles, placements, attributes } = placed;
    let appearance = Appearance { textures, materials: palette.layers, placements: attributes };
    let mut materials = material::finish(&document, &appearance);
    for (placement, attributes) in placements.iter().zip(&appearance.placements) {
        if let Some(material) = materials.get_mut(placement.material) {
            material.textured |= attributes.colours.is_some();
        }
    }
    warn_of_defaults(&used, &materials, &lights, &mut warnings);
    let warnings = warnings.into_sentences();
    Ok(Scene { vertices, normals, triangles, placements, materials, lights, appearance, source, warnings })
}

/// Decodes the requested images; one that fails becomes a warning and `None`.
fn decode_all(
    document: &Document,
    source: &SourceDocument,
    requests: &[Request],
    warnings: &mut Warnings,
) -> Result<Vec<Option<Arc<Pyramid>>>, ImportError> {
    let decode = |request: &Request| {
        let bytes = source::image_bytes(document, source, request.image)?;
        Ok(bytes.map(|bytes| texture::decode(bytes, request.encoding)))
    };
    let decoded: Vec<_> = requests.par_iter().map(decode).collect::<Result<_, ImportError>>()?;
    let mut textures = Vec::with_capacity(decoded.len());
    for (request, decoded) in requests.iter().zip(decoded) {
        let image = document.images.get(request.image);
        let item = Item::new("image", request.image, image.and_then(|image| image.name.as_deref()));
        textures.push(match decoded {
            Some(Ok(pyramid)) => Some(Arc::new(pyramid)),
            Some(Err(fault)) => {
                let text =
                    format!("cannot be decoded ({fault}); materials that use it keep their factors alone");
                warnings.general(format!("{item} {text}"));
                None
            }
            None => {
                // A URI that could not be read has had its warning.
                if image.is_some_and(|image| image.uri.is_none()) {
                    warnings
                        .about(item, "it has neither uri nor bufferView; materials keep their factors alone");
                }
                None
            }
        });
    }
    Ok(textures)
}

/// Warns of surfaces that nothing is said about, and of a scene in the dark.
fn warn_of_defaults(
    used: &[bool],
    materials: &[Material],
    lights: &[PunctualLight],
    warnings: &mut Warnings,
) {
    let default_is_used = used.last().copied().unwrap_or(false);
    if default_is_used {
        warnings.general("some primitives have no material and are baked as white diffuse surfaces");
    }
    let emits = |(material, used): (&Material, &bool)| *used && material.emission.max_element() > 0.0;
    let shines = |light: &PunctualLight| light.intensity.max_element() > 0.0;
    if !materials.iter().zip(used).any(emits) && !lights.iter().any(shines) {
        warnings.general(
            "nothing in the scene gives light, so the lightmap will be black; add an emissive material \
             or a KHR_lights_punctual light",
        );
    }
}
