//! The containers: binary glTF and glTF text with its buffer inside.

use serde_json::Value;

use super::ExportError;

const MAGIC: &[u8; 4] = b"glTF";
const JSON_CHUNK: &[u8; 4] = b"JSON";
const BINARY_CHUNK: &[u8; 4] = b"BIN\0";

/// Puts JSON and its one buffer into a GLB container; chunks are padded to 4 bytes.
pub(super) fn pack(json: &Value, binary: &[u8]) -> Result<Vec<u8>, ExportError> {
    let mut text = serde_json::to_vec(json).map_err(|source| ExportError::Json { source })?;
    text.resize(text.len().next_multiple_of(4), b' ');
    let padded = binary.len().next_multiple_of(4);
    let total = 12 + 8 + text.len() + 8 + padded;
    let length = |bytes: usize| u32::try_from(bytes).map_err(|_| ExportError::TooLarge { bytes: total });

    let mut glb = Vec::with_capacity(total);
    glb.extend_from_slice(MAGIC);
    glb.extend_from_slice(&2_u32.to_le_bytes());
    glb.extend_from_slice(&length(total)?.to_le_bytes());
    glb.extend_from_slice(&length(text.len())?.to_le_bytes());
    glb.extend_from_slice(JSON_CHUNK);
    glb.extend_from_slice(&text);
    glb.extend_from_slice(&length(padded)?.to_le_bytes());
    glb.extend_from_slice(BINARY_CHUNK);
    glb.extend_from_slice(binary);
    glb.resize(total, 0);
    Ok(glb)
}

/// Takes a GLB container apart into its JSON and its buffer (empty where it has none).
pub(super) fn unpack(glb: &[u8]) -> Result<(Value, &[u8]), ExportError> {
    let damaged = |problem| ExportError::NotBaked { problem };
    let mut rest = glb
        .strip_prefix(MAGIC.as_slice())
        .and_then(|rest| rest.get(8..))
        .ok_or(damaged("it is not a GLB container"))?;
    let (mut json, mut binary) = (None, [].as_slice());
    while let Some((header, after)) = rest.split_at_checked(8) {
        let (length, kind) = header.split_at(4);
        let length = length.iter().rev().fold(0_usize, |n, &b| (n << 8) | usize::from(b));
        let (chunk, after) = after.split_at_checked(length).ok_or(damaged("a chunk of it is cut off"))?;
        if kind == JSON_CHUNK {
            json = Some(serde_json::from_slice(chunk).map_err(|source| ExportError::Json { source })?);
        } else if kind == BINARY_CHUNK {
            binary = chunk;
        }
        rest = after;
    }
    Ok((json.ok_or(damaged("it holds no JSON"))?, binary))
}

/// The same document as glTF text, its buffer as a data URI.
pub(super) fn as_text(glb: &[u8]) -> Result<Vec<u8>, ExportError> {
    let (mut json, binary) = unpack(glb)?;
    if let Some(buffer) = json.pointer_mut("/buffers/0").and_then(Value::as_object_mut) {
        let length = buffer.get("byteLength").and_then(Value::as_u64).unwrap_or_default();
        let length = usize::try_from(length).unwrap_or(usize::MAX).min(binary.len());
        let bytes = binary.get(..length).unwrap_or_default();
        buffer.insert("uri".into(), format!("data:application/octet-stream;base64,{}", base64(bytes)).into());
    }
    serde_json::to_vec(&json).map_err(|source| ExportError::Json { source })
}

/// Base 64 with padding (RFC 4648).
pub(crate) fn base64(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for group in bytes.chunks(3) {
        let byte = |i: usize| u32::from(group.get(i).copied().unwrap_or(0));
        let bits = (byte(0) << 16) | (byte(1) << 8) | byte(2);
        for digit in 0..4 {
            let value = (bits >> (18 - 6 * digit)) & 63;
            text.push(if digit <= group.len() { char::from(DIGITS[value as usize]) } else { '=' });
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn containers_round_trip() {
        let json = serde_json::json!({"asset": {"version": "2.0"}, "buffers": [{"byteLength": 5}]});
        let glb = pack(&json, &[1, 2, 3, 4, 5]).unwrap();
        assert_eq!(glb.len() % 4, 0);
        let (back, binary) = unpack(&glb).unwrap();
        assert_eq!((back, binary), (json, [1, 2, 3, 4, 5, 0, 0, 0].as_slice()));
        assert!(gltf::Glb::from_slice(&glb).is_ok(), "another reader must agree");
    }

    /// Numbers that a careless reader changes in the last digit (all from real scenes).
    #[test]
    fn numbers_stay_to_the_last_digit() {
        let text = "[-185.00001525878906,0.9537169507482269,-0.10452846326765347,0.9126079678535461,1.0,7]";
        let json: Value = serde_json::from_str(text).unwrap();
        let glb = pack(&json, &[]).unwrap();
        let kept = glb.windows(text.len()).any(|window| window == text.as_bytes());
        assert!(kept, "{json}");
    }

    #[test]
    fn damaged_containers_are_refused() {
        let glb = pack(&serde_json::json!({}), &[0; 64]).unwrap();
        for length in [0, 3, 11, 19, 21, glb.len() - 1] {
            assert!(unpack(&glb[..length]).is_err(), "cut to {length} bytes");
        }
    }

    /// The examples of RFC 4648, section 10.
    #[test]
    fn base64_matches_its_specification() {
        for (bytes, text) in [("", ""), ("f", "Zg=="), ("fo", "Zm8="), ("foo", "Zm9v"), ("fooba", "Zm9vYmE=")]
        {
            assert_eq!(base64(bytes.as_bytes()), text);
        }
    }
}
