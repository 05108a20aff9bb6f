//! Closing the gaps that dropped accessors leave in bufferViews which other accessors still read.
//!
//! Exporters put the attributes of many primitives into one bufferView, so that a view whose first
//! accessor is rewritten stays alive for the second. Such a view is copied without the bytes that no
//! accessor covers. Views that anything but accessors reads are left alone.

use std::collections::{BTreeMap, BTreeSet};

use serde_json::Value;

use super::accessor;
use super::document::{Object, index_of};
use super::layout::span;

/// Parts keep their offset's remainder by this, so that accessors stay aligned.
const ALIGNMENT: usize = 4;

/// A covered part of a view, and where it goes.
struct Part {
    start: usize,
    end: usize,
    place: usize,
}

/// Rewrites those of `views` that have gaps; their new bytes go into `added`.
pub(super) fn compact(
    root: &mut Object,
    views: &BTreeSet<usize>,
    buffers: &[Vec<u8>],
    added: &mut BTreeMap<usize, Vec<u8>>,
) {
    for &view in views {
        if added.contains_key(&view) {
            continue;
        }
        if let Some((parts, bytes)) = without_gaps(root, view, buffers) {
            for accessor in root.get_mut("accessors").and_then(Value::as_array_mut).into_iter().flatten() {
                let Some(accessor) = accessor.as_object_mut() else { continue };
                if index_of(accessor.get("bufferView")) == Some(view) {
                    let offset = index_of(accessor.get("byteOffset")).unwrap_or(0);
                    let before = parts.partition_point(|part| part.start <= offset).checked_sub(1);
                    if let Some(part) = before.and_then(|before| parts.get(before)) {
                        accessor.insert("byteOffset".into(), (part.place + (offset - part.start)).into());
                    }
                }
            }
            added.insert(view, bytes);
        }
    }
}

/// The covered parts of a view and its bytes without the others; `None` where nothing is to be gained
/// or something about the view is not as it should be.
fn without_gaps(root: &Object, index: usize, buffers: &[Vec<u8>]) -> Option<(Vec<Part>, Vec<u8>)> {
    let view = root.get("bufferViews")?.get(index)?.as_object()?;
    let (buffer, start, end) = span(view, index, buffers).ok()?;
    let bytes = buffers.get(buffer)?.get(start..end)?;
    let stride = index_of(view.get("byteStride"));
    let mut covered = Vec::new();
    for accessor in root.get("accessors")?.as_array()? {
        if index_of(accessor.get("bufferView")) == Some(index) {
            covered.push(accessor::extent(accessor.as_object()?, stride)?);
        }
    }
    covered.sort_unstable();
    let mut parts: Vec<Part> = Vec::new();
    for (start, end) in covered {
        match parts.last_mut() {
            Some(part) if start <= part.end => part.end = part.end.max(end),
            _ => parts.push(Part { start, end, place: 0 }),
        }
    }
    let mut packed = Vec::new();
    for part in &mut parts {
        while packed.len() % ALIGNMENT != part.start % ALIGNMENT {
            packed.push(0);
        }
        part.place = packed.len();
        packed.extend_from_slice(bytes.get(part.start..part.end)?);
    }
    (!parts.is_empty() && packed.len() < bytes.len()).then_some((parts, packed))
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn accessors_read_the_same_bytes_without_gaps() {
        let buffers = [(0..100).collect::<Vec<u8>>()];
        let value = json!({
            "bufferViews": [{"buffer": 0, "byteOffset": 4, "byteLength": 90, "byteStride": 8}],
            "accessors": [
                {"bufferView": 0, "byteOffset": 50, "componentType": 5123, "type": "SCALAR", "count": 2},
                {"bufferView": 0, "byteOffset": 8, "componentType": 5123, "type": "VEC2", "count": 3},
                {"bufferView": 0, "byteOffset": 12, "componentType": 5121, "type": "SCALAR", "count": 3},
            ],
        });
        let mut root = value.as_object().unwrap().clone();
        let mut added = BTreeMap::new();
        compact(&mut root, &BTreeSet::from([0]), &buffers, &mut added);
        let offset = |accessor: usize| index_of(root["accessors"][accessor].get("byteOffset")).unwrap();
        assert_eq!([offset(0), offset(1), offset(2)], [22, 0, 4]);
        let bytes = &added[&0];
        assert_eq!(bytes[22..32], buffers[0][54..64]);
        assert_eq!(bytes[..21], buffers[0][12..33]);
        assert_eq!(bytes.len(), 32);
    }

    #[test]
    fn views_without_gaps_or_with_nonsense_are_left_alone() {
        let accessor = json!({"bufferView": 0, "componentType": 5121, "type": "SCALAR", "count": 4});
        let mut beyond = accessor.clone();
        beyond["count"] = json!(u64::MAX);
        for accessor in [accessor, beyond] {
            let value = json!({"bufferViews": [{"buffer": 0, "byteLength": 4}], "accessors": [accessor]});
            let mut root = value.as_object().unwrap().clone();
            let mut added = BTreeMap::new();
            compact(&mut root, &BTreeSet::from([0]), &[vec![0; 8]], &mut added);
            assert!(added.is_empty() && root["accessors"][0] == accessor);
        }
    }
}
