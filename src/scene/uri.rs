//! What a document refers to by URI: data URIs and files beside it (RFC 3986, RFC 2397).
//!
//! Nothing is fetched from a network, and absolute paths are refused: a document that
//! names them works on one machine only.

use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};

use super::item::shown;

/// Why the bytes behind a URI could not be had. Reads on after the thing that holds the URI.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum UriError {
    /// The URI names a place outside the document's folder.
    #[error(
        "refers to \"{}\", which is not read; save that file beside the document and refer to it by a relative path",
        shown(uri)
    )]
    Absolute {
        /// The URI.
        uri: String,
    },

    /// A data URI without data, or with characters that base64 does not have.
    #[error("holds a data URI that is damaged; export the document again or as .glb")]
    Data,

    /// The document came from memory, so there is no folder to look in.
    #[error("refers to the file \"{}\", but the document was read from memory; embed the file", shown(uri))]
    NoFolder {
        /// The URI.
        uri: String,
    },

    /// The file is missing or unreadable.
    #[error("refers to {}, which cannot be read ({cause}); put it there or export as .glb", path.display())]
    Read {
        /// Where the file should be.
        path: PathBuf,
        /// What the operating system reported.
        cause: io::Error,
    },
}

/// Bytes behind a URI.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Resource {
    pub(super) bytes: Vec<u8>,
    /// The media type that a data URI declares.
    pub(super) media_type: Option<String>,
}

/// Reads what `uri` refers to, at most `limit` bytes of it, relative to the folder `base`.
pub(super) fn read(uri: &str, base: Option<&Path>, limit: u64) -> Result<Resource, UriError> {
    if uri.get(..5).is_some_and(|scheme| scheme.eq_ignore_ascii_case("data:")) {
        return decode_data(uri.get(5..).unwrap_or_default()).ok_or(UriError::Data);
    }
    let decoded = String::from_utf8(percent_decode(uri)).unwrap_or_else(|_| uri.to_owned());
    if has_scheme(uri) || decoded.starts_with(['/', '\\']) || Path::new(&decoded).is_absolute() {
        return Err(UriError::Absolute { uri: uri.to_owned() });
    }
    let base = base.ok_or_else(|| UriError::NoFolder { uri: uri.to_owned() })?;
    // Some exporters write a `%` that encodes nothing, so the literal name counts too.
    let literal = base.join(uri);
    let path = if literal.is_file() { literal } else { base.join(&decoded) };
    match read_file(&path, limit) {
        Ok(bytes) => Ok(Resource { bytes, media_type: None }),
        Err(cause) => Err(UriError::Read { path, cause }),
    }
}

/// Reads at most `limit` bytes of a regular file; devices and pipes, which may never end, are refused.
pub(super) fn read_file(path: &Path, limit: u64) -> io::Result<Vec<u8>> {
    if !path.metadata()?.is_file() {
        return Err(io::Error::new(io::ErrorKind::InvalidInput, "not a regular file"));
    }
    let mut bytes = Vec::new();
    File::open(path)?.take(limit).read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// Whether `uri` begins with a scheme such as `https:` (or a drive letter).
fn has_scheme(uri: &str) -> bool {
    uri.split_once(':').is_some_and(|(scheme, _)| {
        scheme.starts_with(|c: char| c.is_ascii_alphabetic())
            && scheme.chars().all(|c| c.is_ascii_alphanumeric() || "+-.".contains(c))
    })
}

/// Decodes what follows `data:`.
fn decode_data(rest: &str) -> Option<Resource> {
    let (header, data) = rest.split_once(',')?;
    let mut parameters = header.split(';');
    let media_type = parameters.next().filter(|media_type| !media_type.is_empty()).map(str::to_owned);
    let is_base64 = parameters.next_back().is_some_and(|last| last.trim().eq_ignore_ascii_case("base64"));
    let bytes = percent_decode(data);
    let bytes = if is_base64 { base64_decode(&bytes)? } else { bytes };
    Some(Resource { bytes, media_type })
}

/// Replaces each `%41` by its byte; a `%` that starts no such pair stays.
pub(crate) fn percent_decode(text: &str) -> Vec<u8> {
    let mut out = Vec::with_capacity(text.len());
    let mut rest = text.as_bytes();
    while let [first, tail @ ..] = rest {
        rest = tail;
        if let (b'%', [high, low, after @ ..]) = (first, tail)
            && let (Some(high), Some(low)) = (hex_digit(*high), hex_digit(*low))
        {
            out.push(high << 4 | low);
            rest = after;
        } else {
            out.push(*first);
        }
    }
    out
}

fn hex_digit(byte: u8) -> Option<u8> {
    char::from(byte).to_digit(16).and_then(|digit| u8::try_from(digit).ok())
}

/// Decodes RFC 4648 base64, padded or not. `None` on any other character or an impossible length.
fn base64_decode(text: &[u8]) -> Option<Vec<u8>> {
    let end = text.iter().rposition(|&byte| byte != b'=').map_or(0, |last| last + 1);
    let (digits, padding) = text.split_at(end);
    if padding.len() > 2 || digits.len() % 4 == 1 {
        return None;
    }
    let mut out = Vec::with_capacity(digits.len() / 4 * 3 + 2);
    let (mut bits, mut held) = (0_u32, 0_u32);
    for &byte in digits {
        bits = bits << 6 | u32::from(base64_digit(byte)?);
        held += 6;
        if held >= 8 {
            held -= 8;
            out.push((bits >> held & 0xff) as u8);
            bits &= (1 << held) - 1;
        }
    }
    Some(out)
}

fn base64_digit(byte: u8) -> Option<u8> {
    match byte {
        b'A'..=b'Z' => Some(byte - b'A'),
        b'a'..=b'z' => Some(byte - b'a' + 26),
        b'0'..=b'9' => Some(byte - b'0' + 52),
        b'+' => Some(62),
        b'/' => Some(63),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// RFC 4648, section 10.
    #[test]
    fn base64_test_vectors() {
        let vectors = [
            ("", ""),
            ("Zg==", "f"),
            ("Zm8=", "fo"),
            ("Zm9v", "foo"),
            ("Zm9vYg==", "foob"),
            ("Zm9vYmE=", "fooba"),
            ("Zm9vYmFy", "foobar"),
            ("Zm9vYmE", "fooba"),
        ];
        for (text, expected) in vectors {
            assert_eq!(base64_decode(text.as_bytes()).unwrap(), expected.as_bytes(), "{text}");
        }
        for damaged in ["Z", "Zg=a", "Zm9v!", "Zm===", "Zm 9v", "====="] {
            assert_eq!(base64_decode(damaged.as_bytes()), None, "{damaged}");
        }
    }

    #[test]
    fn data_uris_carry_their_media_type() {
        let read = |uri| read(uri, None, u64::MAX).unwrap();
        let png = read("data:image/png;base64,Zm8=");
        assert_eq!((png.bytes.as_slice(), png.media_type.as_deref()), (&b"fo"[..], Some("image/png")));
        let bare = read("data:,a%20b");
        assert_eq!((bare.bytes.as_slice(), bare.media_type), (&b"a b"[..], None));
        assert!(super::read("data:base64", None, 1).is_err());
    }

    #[test]
    fn network_and_absolute_addresses_are_refused() {
        for uri in ["https://a.b/c.bin", "file:///etc/hosts", "C:\\a.bin", "/etc/hosts", "%2Fetc/hosts"] {
            let error = read(uri, Some(Path::new(".")), 1).unwrap_err();
            assert!(matches!(error, UriError::Absolute { .. }), "{uri}: {error}");
        }
    }

    #[test]
    fn file_names_are_percent_decoded() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("a b%.bin"), b"12345").unwrap();
        for uri in ["a%20b%.bin", "a%20b%25.bin", "a b%.bin"] {
            assert_eq!(read(uri, Some(folder.path()), 3).unwrap().bytes, b"123", "{uri}");
        }
        let error = read("missing.bin", Some(folder.path()), 3).unwrap_err().to_string();
        assert!(error.contains("missing.bin"), "{error}");
    }
}
