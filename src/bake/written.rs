//! How many bytes the lightmaps take in the output.

use serde_json::Value;

use crate::error::Error;
use crate::export::{COBAKE_LIGHTMAP, encode_exr, encode_png, encode_previews};
use crate::options::{BakeOptions, Quantity};
use crate::unwrap::PageArea;

use super::page::Page;

/// Every image begins at a multiple of this in the output.
const ALIGNMENT: u64 = 4;

/// Bytes of a bake's lightmaps, page by page.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Written {
    pub(super) pages: Vec<PageBytes>,
}

/// Bytes of one lightmap.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct PageBytes {
    /// The map at full precision.
    pub(super) exr: u64,
    /// The map of eight bits a channel, or the preview in its place; 0 where there is none.
    pub(super) png: u64,
}

impl Written {
    /// What a page, or a sheet of several, will take. A PNG is counted even if no material turns out to name it.
    pub(super) fn of(page: &Page, options: &BakeOptions) -> Result<Self, Error> {
        let areas = &page.atlas.pages;
        let previews = options.preview.zip(page.preview.as_ref());
        let pngs = || -> Result<Vec<u64>, Error> {
            let length = |bytes: Vec<u8>| bytes.len() as u64;
            Ok(match (previews, options.quantity) {
                (Some((form, sheet)), _) => {
                    let previews = encode_previews(sheet, areas, form)?;
                    previews.into_iter().map(|png| length(png.bytes)).collect()
                }
                (None, Quantity::Radiosity) => vec![0; areas.len()],
                (None, Quantity::Irradiance | Quantity::Radiance) => {
                    let png = |area: &PageArea| encode_png(&page.lightmap.page(*area));
                    areas.iter().map(|area| Ok(length(png(area)?.bytes))).collect::<Result<_, Error>>()?
                }
            })
        };
        let exr = |area: &PageArea| -> Result<u64, Error> {
            Ok(encode_exr(&page.lightmap.page(*area))?.len() as u64)
        };
        let exrs = || areas.iter().map(exr).collect::<Result<Vec<_>, Error>>();
        let (exrs, pngs) = rayon::join(exrs, pngs);
        let pages = exrs?.into_iter().zip(pngs?).map(|(exr, png)| PageBytes { exr, png }).collect();
        Ok(Self { pages })
    }

    /// What a baked document holds.
    pub(super) fn in_document(glb: &[u8]) -> Self {
        let json = gltf::Glb::from_slice(glb).ok().and_then(|glb| serde_json::from_slice(&glb.json).ok());
        let json: Value = json.unwrap_or_default();
        let maps = json.get("extensions").and_then(|e| e.get(COBAKE_LIGHTMAP)?.get("lightmaps")?.as_array());
        let page = |(index, map): (usize, &Value)| PageBytes {
            exr: view_bytes(&json, map).unwrap_or(0),
            png: png_bytes(&json, index).unwrap_or(0),
        };
        Self { pages: maps.into_iter().flatten().enumerate().map(page).collect() }
    }

    /// The EXRs of all pages.
    pub(super) fn exr(&self) -> u64 {
        self.pages.iter().map(|page| page.exr).sum()
    }

    /// The PNGs of all pages.
    pub(super) fn png(&self) -> u64 {
        self.pages.iter().map(|page| page.png).sum()
    }

    /// All, with what aligning them may add.
    pub(super) fn sum(&self) -> u64 {
        let aligned =
            |page: &PageBytes| page.exr.next_multiple_of(ALIGNMENT) + page.png.next_multiple_of(ALIGNMENT);
        self.pages.iter().map(aligned).sum()
    }
}

/// The size of the image that our writer gives to a page.
fn png_bytes(json: &Value, page: usize) -> Option<u64> {
    let names = [format!("lightmap{page}"), format!("preview{page}")];
    let mut images = json.get("images")?.as_array()?.iter().rev();
    let ours = images.find(|image| image.get("name").is_some_and(|name| names.iter().any(|n| name == n)))?;
    view_bytes(json, ours)
}

/// The size of the bufferView that an object names.
fn view_bytes(json: &Value, object: &Value) -> Option<u64> {
    let view = usize::try_from(object.get("bufferView")?.as_u64()?).ok()?;
    json.get("bufferViews")?.get(view)?.get("byteLength")?.as_u64()
}
