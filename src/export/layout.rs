//! Laying the wanted parts of all buffers out in one.
//!
//! Parts are copied view by view, so bytes that nobody refers to stay behind; views that overlap
//! (interleaved attributes with a view each) are copied together, once.

use std::collections::BTreeMap;

use serde_json::{Value, json};

use super::ExportError;
use super::document::{Object, index_of};

/// The compression of single bufferViews; its data cannot be kept beside ours without a decoder.
const MESHOPT: [&str; 2] = ["EXT_meshopt_compression", "KHR_meshopt_compression"];

/// glTF aligns accessors to their component's size, at most 4 bytes.
const ALIGNMENT: usize = 4;

/// A run of a source buffer and where it went.
struct Run {
    start: usize,
    end: usize,
    place: usize,
}

/// Builds the one buffer, points every bufferView into it and replaces the list of buffers.
///
/// `added` holds the bytes of bufferViews that are not in `buffers`.
pub(super) fn pack(
    root: &mut Object,
    buffers: &[Vec<u8>],
    added: &BTreeMap<usize, Vec<u8>>,
) -> Result<Vec<u8>, ExportError> {
    let mut views = match root.shift_remove("bufferViews") {
        Some(Value::Array(views)) => views,
        _ => Vec::new(),
    };
    let mut binary = Vec::new();
    let runs = copy_runs(&views, buffers, added, &mut binary)?;
    let mut decompressed = false;
    for (index, view) in views.iter_mut().enumerate() {
        let Some(view) = view.as_object_mut() else { continue };
        let (place, length) = match added.get(&index) {
            Some(bytes) => {
                binary.resize(binary.len().next_multiple_of(ALIGNMENT), 0);
                let place = binary.len();
                binary.extend_from_slice(bytes);
                (place, bytes.len())
            }
            None => {
                let (buffer, start, end) = span(view, index, buffers)?;
                let run = runs.get(&buffer).and_then(|runs| {
                    runs.get(runs.partition_point(|run| run.start <= start).checked_sub(1)?)
                });
                (run.map_or(0, |run| run.place + (start - run.start)), end - start)
            }
        };
        view.insert("buffer".into(), 0.into());
        view.insert("byteOffset".into(), place.into());
        view.insert("byteLength".into(), length.into());
        decompressed |= drop_extensions(view, &MESHOPT);
    }
    if decompressed {
        forget_extensions(root, &MESHOPT);
    }
    let mut buffer = match root.get("buffers").and_then(|list| list.get(0)) {
        Some(Value::Object(first)) => first.clone(),
        _ => Object::new(),
    };
    buffer.shift_remove("uri");
    buffer.insert("byteLength".into(), binary.len().into());
    root.insert("buffers".into(), json!([buffer]));
    root.insert("bufferViews".into(), views.into());
    Ok(binary)
}

/// Copies what the views cover, each byte once, keeping its alignment.
fn copy_runs(
    views: &[Value],
    buffers: &[Vec<u8>],
    added: &BTreeMap<usize, Vec<u8>>,
    binary: &mut Vec<u8>,
) -> Result<BTreeMap<usize, Vec<Run>>, ExportError> {
    let mut spans = Vec::new();
    for (index, view) in views.iter().enumerate() {
        if let (Some(view), false) = (view.as_object(), added.contains_key(&index)) {
            spans.push(span(view, index, buffers)?);
        }
    }
    spans.sort_unstable();
    let mut runs: BTreeMap<usize, Vec<Run>> = BTreeMap::new();
    for (buffer, start, end) in spans {
        let list = runs.entry(buffer).or_default();
        match list.last_mut() {
            Some(run) if start < run.end => run.end = run.end.max(end),
            _ => list.push(Run { start, end, place: 0 }),
        }
    }
    for (buffer, list) in &mut runs {
        for run in list {
            while binary.len() % ALIGNMENT != run.start % ALIGNMENT {
                binary.push(0);
            }
            run.place = binary.len();
            let bytes = buffers.get(*buffer).and_then(|bytes| bytes.get(run.start..run.end));
            binary.extend_from_slice(bytes.unwrap_or_default());
        }
    }
    Ok(runs)
}

/// Buffer, first byte and end of a source view, all inside the buffer.
pub(super) fn span(
    view: &Object,
    index: usize,
    buffers: &[Vec<u8>],
) -> Result<(usize, usize, usize), ExportError> {
    let problem = |problem| ExportError::Malformed { list: "bufferView", index, problem };
    let buffer = index_of(view.get("buffer")).ok_or(problem("names no buffer"))?;
    let length = index_of(view.get("byteLength")).ok_or(problem("has no length"))?;
    let start = index_of(view.get("byteOffset")).unwrap_or(0);
    let end = start.checked_add(length).ok_or(problem("is longer than memory"))?;
    let held = buffers.get(buffer).ok_or(problem("names a buffer that is not there"))?.len();
    if end <= held {
        return Ok((buffer, start, end));
    }
    let extensions = view.get("extensions").and_then(Value::as_object);
    match MESHOPT.iter().find(|name| extensions.is_some_and(|e| e.contains_key(**name))) {
        Some(extension) => Err(ExportError::Compressed { list: "bufferView", index, extension }),
        None => Err(problem("reaches beyond its buffer")),
    }
}

/// Removes the named extensions from an object; says whether there were any.
pub(super) fn drop_extensions(object: &mut Object, names: &[&str]) -> bool {
    let Some(extensions) = object.get_mut("extensions").and_then(Value::as_object_mut) else { return false };
    let before = extensions.len();
    extensions.retain(|name, _| !names.contains(&name.as_str()));
    let (after, empty) = (extensions.len(), extensions.is_empty());
    if empty {
        object.shift_remove("extensions");
    }
    after < before
}

/// Takes extensions that are gone from the document out of its lists of extensions.
pub(super) fn forget_extensions(root: &mut Object, names: &[&str]) {
    for list in ["extensionsUsed", "extensionsRequired"] {
        let Some(Value::Array(used)) = root.get_mut(list) else { continue };
        used.retain(|name| name.as_str().is_none_or(|name| !names.contains(&name)));
        if used.is_empty() {
            root.shift_remove(list); // glTF allows no empty list
        }
    }
    for buffer in root.get_mut("buffers").and_then(Value::as_array_mut).into_iter().flatten() {
        if let Some(buffer) = buffer.as_object_mut() {
            drop_extensions(buffer, names);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn packed(views: &Value, buffers: &[Vec<u8>]) -> (Object, Vec<u8>) {
        let mut root = json!({"bufferViews": views, "buffers": [{"byteLength": 1, "uri": "x", "name": "n"}]})
            .as_object()
            .unwrap()
            .clone();
        let binary = pack(&mut root, buffers, &BTreeMap::from([(3, vec![9; 5])])).unwrap();
        (root, binary)
    }

    /// Every view reads the same bytes as before, overlaps are stored once, gaps not at all.
    #[test]
    fn views_keep_their_bytes() {
        let buffers = [(0..64).collect::<Vec<u8>>(), (100..120).collect()];
        let views = json!([
            {"buffer": 0, "byteOffset": 40, "byteLength": 16, "byteStride": 8},
            {"buffer": 1, "byteLength": 7},
            {"buffer": 0, "byteOffset": 44, "byteLength": 20},
            {"buffer": 0},
            {"buffer": 1, "byteOffset": 8, "byteLength": 4},
        ]);
        let (root, binary) = packed(&views, &buffers);
        let bytes = |view: usize| {
            let view = root["bufferViews"][view].as_object().unwrap();
            assert_eq!(view["buffer"], 0);
            let start = index_of(view.get("byteOffset")).unwrap();
            assert_eq!(start % 4, 0);
            &binary[start..start + index_of(view.get("byteLength")).unwrap()]
        };
        assert_eq!(bytes(0), &buffers[0][40..56]);
        assert_eq!(bytes(1), &buffers[1][..7]);
        assert_eq!(bytes(2), &buffers[0][44..64]);
        assert_eq!(bytes(3), [9; 5]);
        assert_eq!(bytes(4), &buffers[1][8..12]);
        assert_eq!(root["buffers"], json!([{"byteLength": binary.len(), "name": "n"}]));
        assert!(binary.len() <= 24 + 8 + 4 + 5, "{}", binary.len());
    }

    #[test]
    fn views_outside_their_buffer_are_refused() {
        for view in [
            json!({"buffer": 0, "byteOffset": 1, "byteLength": 4}),
            json!({"buffer": 1, "byteLength": 1}),
            json!({"buffer": 0, "byteOffset": u64::MAX, "byteLength": 2}),
            json!({}),
        ] {
            assert!(span(view.as_object().unwrap(), 0, &[vec![0; 4]]).is_err(), "{view}");
        }
    }
}
