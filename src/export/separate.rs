//! glTF text with its buffer and images as files beside it.
//!
//! `NAME.gltf` gets `NAME.bin` and, for each image, `NAME-image.png` or what it is. The names begin with the
//! output's, so that they do not meet those of the input; images that were files beside the input are copied.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use serde_json::Value;

use super::document::{Object, index_of};
use super::references::References;
use super::write::WrittenFile;
use super::{ExportError, glb, layout, verify};

/// No name is cut to fewer characters, and no image's has more.
const LONGEST_NAME: usize = 64;

/// The files for a GLB made by [`encode`](super::encode): the glTF text at `path`, its buffer, its images.
///
/// None of them is one of `taken`: an image gets another name. The buffer's place is [`buffer_beside`].
///
/// # Errors
/// [`ExportError::NotBaked`] and others where `glb` is not a whole baked document.
pub fn separate(path: &Path, glb: &[u8], taken: &[PathBuf]) -> Result<Vec<WrittenFile>, ExportError> {
    verify(glb)?;
    let (json, binary) = glb::unpack(glb)?;
    let Value::Object(mut root) = json else {
        return Err(ExportError::NotBaked { problem: "its JSON is no object" });
    };
    let before = References::of(&mut root);
    let buffers = [binary.to_vec()];
    let bin = buffer_beside(path);
    let mut names =
        Names { path, taken: [taken, &[path.into(), bin.clone()]].concat(), used: BTreeSet::new() };
    let mut files = Vec::new();
    for index in 0..root.get("images").and_then(Value::as_array).map_or(0, Vec::len) {
        let Some((bytes, image)) = image_of(&root, index, &buffers)? else { continue };
        let file = names.free(&image, index);
        if let Some(slot) = root.get_mut("images").and_then(|list| list.get_mut(index)?.as_object_mut()) {
            slot.shift_remove("bufferView");
            slot.insert("uri".into(), uri_of(&file).into());
        }
        files.push(WrittenFile { path: file, bytes });
    }
    let mut added = BTreeMap::new();
    before.drop_orphans(&mut root, &buffers, &mut added);
    let binary = layout::pack(&mut root, &buffers, &added)?;
    if let Some(buffer) = root.get_mut("buffers").and_then(|list| list.get_mut(0)?.as_object_mut()) {
        buffer.insert("uri".into(), uri_of(&bin).into());
    }
    files.insert(0, WrittenFile { path: bin, bytes: binary });
    let text = serde_json::to_vec(&Value::Object(root)).map_err(|source| ExportError::Json { source })?;
    files.insert(0, WrittenFile { path: path.into(), bytes: text });
    Ok(files)
}

/// Where the buffer of the glTF text at `path` goes.
#[must_use]
pub fn buffer_beside(path: &Path) -> PathBuf {
    path.with_extension("bin")
}

/// The files that the glTF or GLB file at `path` refers to, whether they are there or not; none where it cannot
/// be read.
#[must_use]
pub fn referenced_files(path: &Path) -> Vec<PathBuf> {
    let Ok(bytes) = fs::read(path) else { return Vec::new() };
    let json = match glb::unpack(&bytes) {
        Ok((json, _)) => json,
        Err(_) => serde_json::from_slice(&bytes).unwrap_or_default(),
    };
    let folder = path.parent().unwrap_or(Path::new(""));
    let lists = ["buffers", "images"].map(|list| json.get(list).and_then(Value::as_array));
    let uris = lists.into_iter().flatten().flatten().filter_map(|entry| entry.get("uri")?.as_str());
    let uris = uris.filter(|uri| !uri.get(..5).is_some_and(|start| start.eq_ignore_ascii_case("data:")));
    // As when it is read, both spellings count.
    let decoded = |uri: &str| String::from_utf8(crate::scene::percent_decode(uri)).ok();
    uris.flat_map(|uri| [Some(uri.to_owned()), decoded(uri)]).flatten().map(|uri| folder.join(uri)).collect()
}

/// An image in the buffer: its bytes and its description.
fn image_of(
    root: &Object,
    index: usize,
    buffers: &[Vec<u8>],
) -> Result<Option<(Vec<u8>, Object)>, ExportError> {
    let list = |name: &str, index: usize| root.get(name)?.get(index)?.as_object();
    let Some(image) = list("images", index) else { return Ok(None) };
    let Some(view) = index_of(image.get("bufferView")) else { return Ok(None) };
    let problem = ExportError::Malformed { list: "image", index, problem: "lies in no bufferView" };
    let (buffer, start, end) = layout::span(list("bufferViews", view).ok_or(problem)?, view, buffers)?;
    let bytes = buffers.get(buffer).and_then(|bytes| bytes.get(start..end)).unwrap_or_default();
    Ok(Some((bytes.to_vec(), image.clone())))
}

/// Names for images.
struct Names<'a> {
    path: &'a Path,
    taken: Vec<PathBuf>,
    /// In small letters: not every disk tells them apart.
    used: BTreeSet<String>,
}

impl Names<'_> {
    /// A name that nothing else has.
    fn free(&mut self, image: &Object, index: usize) -> PathBuf {
        let given = image.get("name").and_then(Value::as_str).map(clean).unwrap_or_default();
        let name = if given.is_empty() { format!("image{index}") } else { given };
        let ending = match image.get("mimeType").and_then(Value::as_str) {
            Some("image/png") => "png",
            Some("image/jpeg") => "jpg",
            Some("image/webp") => "webp",
            Some("image/ktx2") => "ktx2",
            Some("image/avif") => "avif",
            Some("image/vnd-ms.dds") => "dds",
            _ => "image",
        };
        let stem = self.path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let mut count = 1;
        loop {
            let number = if count > 1 { format!("-{count}") } else { String::new() };
            let file = self.path.with_file_name(format!("{stem}-{name}{number}.{ending}"));
            let is_taken = self.taken.iter().any(|taken| same_place(taken, &file));
            if !is_taken && self.used.insert(file.to_string_lossy().to_lowercase()) {
                return file;
            }
            count += 1;
        }
    }
}

/// Whether two paths mean one place, as far as the folders are there.
fn same_place(a: &Path, b: &Path) -> bool {
    let place = |path: &Path| {
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
        let folder = fs::canonicalize(folder.unwrap_or(Path::new("."))).ok();
        folder.zip(path.file_name().map(|name| name.to_string_lossy().to_lowercase()))
    };
    a == b || place(a).is_some_and(|place_a| Some(place_a) == place(b))
}

/// A name's letters and figures, everything else a dash; without an ending that tells of an image.
fn clean(name: &str) -> String {
    let lower = name.to_lowercase();
    let endings = [".png", ".jpg", ".jpeg", ".webp", ".ktx2"];
    let length = endings.iter().find(|ending| lower.ends_with(**ending)).map_or(0, |ending| ending.len());
    let name = name.get(..name.len() - length).unwrap_or(name);
    let mut out = String::new();
    for character in name.chars().take(LONGEST_NAME) {
        let kept = if character.is_ascii_alphanumeric() || character == '_' { character } else { '-' };
        if kept != '-' || !(out.is_empty() || out.ends_with('-')) {
            out.push(kept);
        }
    }
    out.trim_end_matches('-').to_owned()
}

/// The URI of a file from beside it: RFC 3986's unreserved characters, all others by their bytes.
fn uri_of(file: &Path) -> String {
    let name = file.file_name().unwrap_or_default().to_string_lossy();
    let encode = |&byte: &u8| match byte {
        b'A'..=b'Z' | b'a'..=b'z' | b'0'..=b'9' | b'-' | b'.' | b'_' | b'~' => char::from(byte).to_string(),
        _ => format!("%{byte:02X}"),
    };
    name.as_bytes().iter().map(encode).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_cleaned() {
        for (name, cleaned) in [
            ("wall.PNG", "wall"),
            ("../../etc/passwd", "etc-passwd"),
            ("Bild \u{fc}ber C:\\x", "Bild-ber-C-x"),
            ("///", ""),
            (".png", ""),
        ] {
            assert_eq!(clean(name), cleaned, "{name}");
        }
        assert_eq!(uri_of(Path::new("a/b c\u{e4}%.bin")), "b%20c%C3%A4%25.bin");
    }

    #[test]
    fn names_keep_apart() {
        let path = Path::new("out.gltf");
        let mut names = Names { path, taken: vec!["./out-a.png".into()], used: BTreeSet::new() };
        let image = |name: &str| {
            serde_json::json!({"name": name, "mimeType": "image/png"}).as_object().cloned().unwrap()
        };
        assert_eq!(names.free(&image("a"), 0), Path::new("out-a-2.png"));
        assert_eq!(names.free(&image("A"), 1), Path::new("out-A-3.png"));
        assert_eq!(names.free(&image(""), 2), Path::new("out-image2.png"));
    }
}
