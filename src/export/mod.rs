//! Stage 8: EXR, PNG and glTF; written under a temporary name, read back, then renamed.
//!
//! The output is the input document with lightmaps in it. Each lit node's mesh has `TEXCOORD_1`;
//! lit materials carry `MOZ_lightmap` with an 8-bit PNG that any loader reads; and the map at full
//! precision is an EXR in a bufferView that only our own extension `COBAKE_lightmap` names, since
//! an EXR among the document's images makes loaders fail. Neither extension is ever required.
//!
//! `MOZ_lightmap` is irradiance by definition. With [`Quantity::Radiance`] its intensity is scaled by
//! π, so that it still shows the irradiance; with [`Quantity::Radiosity`] there is no such factor and
//! the file holds the EXR alone.
//!
//! Beside the output the lightmap may lie in files of its own ([`SidecarForm`]).
//!
//! With a [`Preview`] lit materials are pictures of the light instead, for viewers that know no lightmaps; the
//! EXR stays.
//!
//! [`Preview`]: crate::options::Preview
//!
//! With [`BakeOptions::elements`] the elements and the states of their Close Objects Buffers are there to look at.
//!
//! Where a node's own layout is kept, `TEXCOORD_1` is that, moved and scaled with the block that it lies in, or the very
//! accessor where the page is that block.
//!
//! What is not lit stays as it was: nodes, names, animations, skins, cameras, lights, extras, and
//! extensions that nobody here knows. With [`Topology::Source`] the triangles stay as well.
//!
//! [`Quantity::Radiance`]: crate::options::Quantity::Radiance
//! [`Quantity::Radiosity`]: crate::options::Quantity::Radiosity
//! [`Topology::Source`]: crate::options::Topology::Source

mod accessor;
mod adaptive;
mod blend;
mod compact;
mod cut;
mod document;
mod elements;
mod error;
mod exr;
mod glb;
mod interpolation;
mod ktx2;
mod layout;
mod materials;
mod plan;
mod png;
mod pool;
mod preview;
mod primitive;
mod references;
mod rgbm;
mod separate;
mod sidecar;
mod source;
mod transform;
mod verify;
mod write;
mod writer;

pub use error::ExportError;
pub use exr::{decode_exr, encode_exr};
pub(crate) use glb::base64;
pub(crate) use materials::LIGHTMAP_SET;
pub use png::{Png, encode_png};
pub use preview::{encode_preview, encode_previews};
pub use separate::{buffer_beside, referenced_files, separate};
pub use sidecar::{SidecarForm, encode_sidecar};
pub use verify::verify;
pub use write::{WrittenFile, file_of, write, write_all, write_whole};
pub(crate) use writer::COBAKE_LIGHTMAP;

use crate::authored::Authored;
use crate::element::Facet;
use crate::options::BakeOptions;
use crate::raster::Lightmap;
use crate::retriangulate::RadiosityMesh;
use crate::scene::{Scene, SourceDocument};
use crate::surface::Surface;
use crate::unwrap::Atlas;

/// The results of a bake, all of one scene.
#[derive(Clone, Copy, Debug)]
pub struct Baked<'a> {
    /// The scene, with the document to write again.
    pub scene: &'a Scene,
    /// Its planar surfaces.
    pub surfaces: &'a [Surface],
    /// Where each surface lies in the lightmap.
    pub atlas: &'a Atlas,
    /// The texels of all pages, the sheet that the atlas is of.
    pub lightmap: &'a Lightmap,
    /// What the surfaces send out, nits, on the same sheet; needed where the options ask for a preview.
    pub preview: Option<&'a Lightmap>,
    /// The solution on its own triangles; written with [`Topology::Adaptive`](crate::options::Topology).
    pub mesh: &'a RadiosityMesh,
    /// The elements that the solution was made on; written with [`elements`](BakeOptions::elements).
    pub facets: &'a [Facet],
    /// Whose layout was kept, and so lies in one of the atlas's blocks.
    pub authored: &'a Authored,
    /// What the bake was told; says what the texels hold and which geometry to write.
    pub options: &'a BakeOptions,
}

/// Encodes the baked document as GLB. The same results give the same bytes.
///
/// # Errors
/// Names what in the document or in the results cannot be written. A document that the `gltf` crate
/// accepts gives output that it accepts, or [`ExportError::NotReadable`].
pub fn encode(baked: &Baked) -> Result<Vec<u8>, ExportError> {
    let glb = writer::write_document(baked)?;
    verify::still_accepted(&baked.scene.source.json, &glb)?;
    Ok(glb)
}

/// A document as a GLB that needs no other file. What it holds stays as it is.
pub(crate) fn self_contained(source: &SourceDocument) -> Result<Vec<u8>, ExportError> {
    document::Document::open(source).finish()
}
