//! The bytes behind a document: buffers and the images that are not in them.

use std::path::Path;

use super::document::{Document, follow};
use super::warning::Warnings;
use super::{ImportError, Item, SourceDocument, extension, uri};

/// Encoded images beyond this are not read.
const LARGEST_IMAGE_FILE: u64 = 1 << 30;

/// Reads every buffer, each cut to its declared length. `binary` is the GLB's second chunk.
pub(super) fn read_buffers(
    document: &Document,
    binary: Option<&[u8]>,
    base: Option<&Path>,
) -> Result<Vec<Vec<u8>>, ImportError> {
    let read = |(index, buffer): (usize, &super::document::Buffer)| {
        let item = || Item::new("buffer", index, buffer.name.as_deref());
        let mut bytes = match (&buffer.uri, binary) {
            (Some(uri), _) => {
                uri::read(uri, base, buffer.byte_length)
                    .map_err(|fault| ImportError::Buffer { buffer: item(), fault })?
                    .bytes
            }
            // Such a buffer stands for what its compressed views decode to; nothing lies in it.
            (None, _) if buffer.extensions.meshopt.is_some() => {
                if cfg!(feature = "meshopt") {
                    return Ok(Vec::new());
                }
                return Err(extension::refusal("EXT_meshopt_compression"));
            }
            (None, Some(binary)) if index == 0 => binary.to_vec(),
            (None, _) => return Err(ImportError::NoBufferData { buffer: item() }),
        };
        let length = bytes.len() as u64;
        if length < buffer.byte_length {
            return Err(ImportError::BufferTooShort { buffer: item(), needed: buffer.byte_length, length });
        }
        // The binary chunk is padded to a multiple of four.
        bytes.truncate(usize::try_from(buffer.byte_length).unwrap_or(usize::MAX));
        Ok(bytes)
    };
    document.buffers.iter().enumerate().map(read).collect()
}

/// The bytes of buffer view `index`, checked against its buffer. `from` refers to it.
pub(super) fn view_bytes<'a>(
    document: &Document,
    buffers: &'a [Vec<u8>],
    index: usize,
    from: impl FnOnce() -> Item,
) -> Result<&'a [u8], ImportError> {
    let view = follow(&document.views, index, "bufferView", from)?;
    let item = || Item::new("bufferView", index, view.name.as_deref());
    let buffer = follow(buffers, view.buffer, "buffer", item)?;
    let end = u128::from(view.byte_offset) + u128::from(view.byte_length);
    usize::try_from(view.byte_offset)
        .ok()
        .zip(usize::try_from(end).ok())
        .and_then(|(start, end)| buffer.get(start..end))
        .ok_or_else(|| ImportError::View { view: item(), end, buffer: view.buffer, length: buffer.len() })
}

/// Reads every image that has a URI; one that cannot be read becomes a warning and `None`.
pub(super) fn read_images(
    document: &Document,
    base: Option<&Path>,
    warnings: &mut Warnings,
) -> Vec<Option<(Vec<u8>, String)>> {
    let mut read = |(index, image): (usize, &super::document::Image)| {
        let address = image.uri.as_deref()?;
        match uri::read(address, base, LARGEST_IMAGE_FILE) {
            Ok(resource) => {
                let media_type = sniff(&resource.bytes)
                    .map(str::to_owned)
                    .or(resource.media_type)
                    .or_else(|| image.mime_type.clone())
                    .unwrap_or_else(|| "application/octet-stream".to_owned());
                Some((resource.bytes, media_type))
            }
            Err(fault) => {
                let item = Item::new("image", index, image.name.as_deref());
                warnings.general(format!("{item} {fault}; materials that use it keep their factors alone"));
                None
            }
        }
    };
    document.images.iter().enumerate().map(&mut read).collect()
}

/// The encoded bytes of image `index`, wherever they lie. `Ok(None)` where they are missing.
pub(super) fn image_bytes<'a>(
    document: &Document,
    source: &'a SourceDocument,
    index: usize,
) -> Result<Option<&'a [u8]>, ImportError> {
    if let Some(Some((bytes, _))) = source.external_images.get(index) {
        return Ok(Some(bytes));
    }
    let Some(image) = document.images.get(index) else { return Ok(None) };
    let item = || Item::new("image", index, image.name.as_deref());
    image.buffer_view.map(|view| view_bytes(document, &source.buffers, view, item)).transpose()
}

/// The media type that an image's first bytes tell.
fn sniff(bytes: &[u8]) -> Option<&'static str> {
    match bytes {
        [0x89, b'P', b'N', b'G', ..] => Some("image/png"),
        [0xff, 0xd8, 0xff, ..] => Some("image/jpeg"),
        [b'R', b'I', b'F', b'F', _, _, _, _, b'W', b'E', b'B', b'P', ..] => Some("image/webp"),
        [0xab, b'K', b'T', b'X', b' ', b'2', b'0', ..] => Some("image/ktx2"),
        _ => None,
    }
}
