//! How many bytes the lightmaps take in the output.

use serde_json::Value;

use crate::error::Error;
use crate::export::{encode_exr, encode_png, encode_preview, lightmap_bytes};
use crate::options::{BakeOptions, Quantity};

use super::page::Page;

/// Every image begins at a multiple of this in the output.
const ALIGNMENT: u64 = 4;

/// Bytes of a bake's lightmaps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Written {
    /// The map at full precision.
    pub(super) exr: u64,
    /// The map of eight bits a channel, or the preview in its place; 0 where there is none.
    pub(super) png: u64,
}

impl Written {
    /// What a page will take. A PNG is counted even if no material turns out to name it.
    pub(super) fn of(page: &Page, options: &BakeOptions) -> Result<Self, Error> {
        let png = || match (options.preview.zip(page.preview.as_ref()), options.quantity) {
            (Some((form, preview)), _) => encode_preview(preview, form).map(|png| png.bytes.len() as u64),
            (None, Quantity::Radiosity) => Ok(0),
            (None, Quantity::Irradiance | Quantity::Radiance) => {
                encode_png(&page.lightmap).map(|png| png.bytes.len() as u64)
            }
        };
        let (exr, png) = rayon::join(|| encode_exr(&page.lightmap).map(|bytes| bytes.len() as u64), png);
        Ok(Self { exr: exr?, png: png? })
    }

    /// What a baked document holds.
    pub(super) fn in_document(glb: &[u8]) -> Self {
        let json = gltf::Glb::from_slice(glb).ok().and_then(|glb| serde_json::from_slice(&glb.json).ok());
        Self { exr: lightmap_bytes(glb), png: json.as_ref().and_then(png_bytes).unwrap_or(0) }
    }

    /// Both, with what aligning them may add.
    pub(super) fn sum(self) -> u64 {
        self.exr.next_multiple_of(ALIGNMENT) + self.png.next_multiple_of(ALIGNMENT)
    }
}

/// The size of the image that our writer names so.
fn png_bytes(json: &Value) -> Option<u64> {
    let mut images = json.get("images")?.as_array()?.iter().rev();
    let ours = images
        .find(|image| image.get("name").is_some_and(|name| name == "lightmap0" || name == "preview0"))?;
    let view = usize::try_from(ours.get("bufferView")?.as_u64()?).ok()?;
    json.get("bufferViews")?.get(view)?.get("byteLength")?.as_u64()
}
