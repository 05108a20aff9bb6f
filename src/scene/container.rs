//! The file's outer form: binary glTF (header, JSON chunk, binary chunk) or bare JSON.
//!
//! Reference: glTF 2.0 specification, section 4 "GLB File Format Specification".

use super::ImportError;

const MAGIC: &[u8] = b"glTF";
const JSON_CHUNK: u32 = 0x4E4F_534A;
const BINARY_CHUNK: u32 = 0x004E_4942;
/// Bytes of the header: magic, version, length.
const HEADER: usize = 12;
/// Bytes before a chunk's data: length, type.
const CHUNK_HEADER: usize = 8;

/// A file's two parts.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Container<'a> {
    /// The JSON text.
    pub(super) json: &'a [u8],
    /// The binary chunk: the data of buffer 0 where that has no `uri`.
    pub(super) binary: Option<&'a [u8]>,
}

/// Splits `bytes` into its parts.
pub(super) fn split(bytes: &[u8]) -> Result<Container<'_>, ImportError> {
    if bytes.starts_with(MAGIC) {
        return split_binary(bytes);
    }
    let text = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    match text.iter().find(|byte| !byte.is_ascii_whitespace()) {
        None => Err(ImportError::Empty),
        Some(b'{') => Ok(Container { json: text, binary: None }),
        Some(_) => Err(ImportError::NotGltf),
    }
}

fn split_binary(bytes: &[u8]) -> Result<Container<'_>, ImportError> {
    let truncated = |needed: u64| ImportError::Truncated { needed, length: bytes.len() as u64 };
    let (Some(version), Some(length)) = (word(bytes, 4), word(bytes, 8)) else {
        return Err(truncated(HEADER as u64));
    };
    if version != 2 {
        return Err(ImportError::Version { version: version.to_string() });
    }
    // The header's length ends the file: what some tools append after it is not glTF.
    let file = bytes.get(..length as usize).ok_or_else(|| truncated(u64::from(length)))?;

    let mut json = None;
    let mut binary = None;
    let mut offset = HEADER;
    while offset < file.len() {
        let (Some(length), Some(kind)) = (word(file, offset), word(file, offset + 4)) else {
            return Err(ImportError::Chunk {
                offset,
                end: (offset + CHUNK_HEADER) as u64,
                length: file.len(),
            });
        };
        let start = offset + CHUNK_HEADER;
        let end = start as u64 + u64::from(length);
        let data = usize::try_from(end)
            .ok()
            .and_then(|end| file.get(start..end))
            .ok_or(ImportError::Chunk { offset, end, length: file.len() })?;
        match kind {
            JSON_CHUNK if json.is_none() => json = Some(data),
            BINARY_CHUNK if binary.is_none() => binary = Some(data),
            _ => {} // the specification reserves other types and has readers skip them
        }
        // Chunks start at multiples of four; not every exporter counts the padding in.
        offset = start.saturating_add(data.len()).next_multiple_of(4);
    }
    let json = json.ok_or(ImportError::NoJsonChunk)?;
    // Some exporters pad the JSON with zeros instead of blanks.
    let used = json.iter().rposition(|&byte| byte != 0).map_or(0, |last| last + 1);
    Ok(Container { json: json.get(..used).unwrap_or(json), binary })
}

/// The little-endian word at `offset`.
fn word(bytes: &[u8], offset: usize) -> Option<u32> {
    bytes.get(offset..)?.first_chunk().copied().map(u32::from_le_bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn glb(chunks: &[(u32, &[u8])]) -> Vec<u8> {
        let mut out = [MAGIC, &2_u32.to_le_bytes(), &[0; 4]].concat();
        for (kind, data) in chunks {
            out.extend((data.len() as u32).to_le_bytes());
            out.extend(kind.to_le_bytes());
            out.extend(*data);
        }
        let length = out.len() as u32;
        out[8..12].copy_from_slice(&length.to_le_bytes());
        out
    }

    #[test]
    fn both_chunks_are_found_and_unknown_ones_skipped() {
        let file = glb(&[(JSON_CHUNK, b"{} \0"), (7, b"????"), (BINARY_CHUNK, b"1234")]);
        let container = split(&file).unwrap();
        assert_eq!(container, Container { json: b"{} ", binary: Some(b"1234") });
    }

    #[test]
    fn bytes_after_the_declared_length_are_ignored() {
        let mut file = glb(&[(JSON_CHUNK, b"{}  ")]);
        file.extend(b"appended");
        assert_eq!(split(&file).unwrap().json, b"{}  ");
    }

    #[test]
    fn every_truncation_is_refused() {
        let file = glb(&[(JSON_CHUNK, b"{}  "), (BINARY_CHUNK, b"1234")]);
        for length in 4..file.len() {
            assert!(matches!(split(&file[..length]), Err(ImportError::Truncated { .. })), "{length}");
        }
    }

    #[test]
    fn a_chunk_beyond_the_file_is_refused() {
        let mut file = glb(&[(JSON_CHUNK, b"{}  ")]);
        file[12] = 5;
        assert!(matches!(split(&file), Err(ImportError::Chunk { offset: 12, end: 25, length: 24 })));
        assert!(matches!(split(&glb(&[(BINARY_CHUNK, b"1234")])), Err(ImportError::NoJsonChunk)));
    }

    #[test]
    fn text_needs_a_brace() {
        assert_eq!(split(b"\xef\xbb\xbf\n {}").unwrap().json, b"\n {}");
        assert!(matches!(split(b"solid cube"), Err(ImportError::NotGltf)));
        assert!(matches!(split(b" \n"), Err(ImportError::Empty)));
    }
}
