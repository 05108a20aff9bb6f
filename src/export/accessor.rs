//! Reading accessors: strides, sparse ones and ones without data become packed elements.

use serde_json::Value;

use super::ExportError;
use super::document::{Object, index_of};
use super::layout::span;
use crate::scene::SourceDocument;

/// An accessor's elements, one after the other.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Elements {
    /// `count × size` bytes, as in the file: little endian.
    pub(super) bytes: Vec<u8>,
    /// Bytes of an element.
    pub(super) size: usize,
    /// glTF's number of the component type.
    pub(super) component: Component,
    /// Components of an element; 0 for matrices, whose columns are padded.
    pub(super) components: usize,
    /// Whether integers stand for fractions.
    pub(super) normalized: bool,
}

/// A component type.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Component {
    /// 5120
    I8,
    /// 5121
    U8,
    /// 5122
    I16,
    /// 5123
    U16,
    /// 5125
    U32,
    /// 5126
    F32,
}

impl Component {
    /// glTF's number of 32-bit floats.
    pub(super) const FLOAT: usize = 5126;

    fn from_number(number: usize) -> Option<Self> {
        Some(match number {
            5120 => Self::I8,
            5121 => Self::U8,
            5122 => Self::I16,
            5123 => Self::U16,
            5125 => Self::U32,
            Self::FLOAT => Self::F32,
            _ => return None,
        })
    }

    fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::U32 | Self::F32 => 4,
        }
    }

    /// The value of one component's bytes; exact, since all types fit a 64-bit float.
    fn value(self, bytes: &[u8]) -> f64 {
        let byte = |i: usize| bytes.get(i).copied().unwrap_or(0);
        match self {
            Self::I8 => f64::from(byte(0) as i8),
            Self::U8 => f64::from(byte(0)),
            Self::I16 => f64::from(i16::from_le_bytes([byte(0), byte(1)])),
            Self::U16 => f64::from(u16::from_le_bytes([byte(0), byte(1)])),
            Self::U32 => f64::from(u32::from_le_bytes([byte(0), byte(1), byte(2), byte(3)])),
            Self::F32 => f64::from(f32::from_le_bytes([byte(0), byte(1), byte(2), byte(3)])),
        }
    }

    /// Appends the value of this type nearest to `value`.
    pub(super) fn write(self, value: f64, bytes: &mut Vec<u8>) {
        let whole = value.round();
        match self {
            Self::I8 => bytes.extend((whole as i8).to_le_bytes()),
            Self::U8 => bytes.extend((whole as u8).to_le_bytes()),
            Self::I16 => bytes.extend((whole as i16).to_le_bytes()),
            Self::U16 => bytes.extend((whole as u16).to_le_bytes()),
            Self::U32 => bytes.extend((whole as u32).to_le_bytes()),
            Self::F32 => bytes.extend((value as f32).to_le_bytes()),
        }
    }

    /// What a stored integer is divided by where it stands for a fraction.
    pub(super) fn fraction_of(self) -> f64 {
        match self {
            Self::I8 => 127.0,
            Self::U8 => 255.0,
            Self::I16 => 32767.0,
            Self::U16 => 65535.0,
            Self::U32 => f64::from(u32::MAX),
            Self::F32 => 1.0,
        }
    }
}

impl Elements {
    /// The components as 32-bit floats, fractions decoded; nothing for matrices.
    pub(super) fn floats(&self) -> Vec<f32> {
        if self.components == 0 {
            return Vec::new();
        }
        let divisor = if self.normalized { self.component.fraction_of() } else { 1.0 };
        let values = self.bytes.chunks_exact(self.component.size());
        values.map(|bytes| (self.component.value(bytes) / divisor).max(least(divisor)) as f32).collect()
    }

    /// The same values in 32-bit floats. Not for matrices.
    pub(super) fn widened(&self) -> Self {
        let bytes = self.floats().into_iter().flat_map(f32::to_le_bytes).collect();
        let (component, components) = (Component::F32, self.components);
        Self { bytes, size: 4 * components, component, components, normalized: false }
    }

    /// One element's numbers as they are stored; none where there is no such element.
    pub(super) fn numbers(&self, index: u32) -> impl Iterator<Item = f64> + '_ {
        let bytes = self.element(index).unwrap_or_default().chunks_exact(self.component.size());
        bytes.map(|bytes| self.component.value(bytes))
    }

    /// Least and greatest value of each component over `picked` elements, as glTF's `min` and `max`.
    pub(super) fn extremes(&self, picked: impl IntoIterator<Item = u32>) -> Option<(Vec<Value>, Vec<Value>)> {
        let mut range = vec![(f64::INFINITY, f64::NEG_INFINITY); self.components];
        for element in picked {
            self.element(element)?;
            for ((low, high), value) in range.iter_mut().zip(self.numbers(element)) {
                (*low, *high) = (low.min(value), high.max(value));
            }
        }
        let number = |value: f64| match self.component {
            Component::F32 => serde_json::Number::from_f64(value).map(Value::Number),
            _ => Some(Value::from(value as i64)),
        };
        let low: Option<Vec<Value>> = range.iter().map(|r| number(r.0)).collect();
        let high: Option<Vec<Value>> = range.iter().map(|r| number(r.1)).collect();
        low.zip(high).filter(|(low, _)| !low.is_empty())
    }

    /// One element's bytes.
    pub(super) fn element(&self, index: u32) -> Option<&[u8]> {
        let start = (index as usize).checked_mul(self.size)?;
        self.bytes.get(start..start.checked_add(self.size)?)
    }
}

/// The most negative integer of a type is one step below −1, and glTF clamps it.
fn least(divisor: f64) -> f64 {
    if divisor == 1.0 { f64::NEG_INFINITY } else { -1.0 }
}

/// Reads accessor `index`, which must have `count` elements.
///
/// The caller knows the count from data it already holds, so a number in the file cannot ask for
/// memory that the file does not fill.
pub(super) fn read(source: &SourceDocument, index: usize, count: usize) -> Result<Elements, ExportError> {
    let problem = |problem| ExportError::Malformed { list: "accessor", index, problem };
    let accessor =
        list(source, "accessors").get(index).and_then(Value::as_object).ok_or(problem("is not there"))?;
    if index_of(accessor.get("count")) != Some(count) {
        return Err(problem("has another count than its primitive's positions"));
    }
    let component = index_of(accessor.get("componentType"))
        .and_then(Component::from_number)
        .ok_or(problem("has an unknown component type"))?;
    let kind = accessor.get("type").and_then(Value::as_str).unwrap_or_default();
    let (components, size) = shape(kind, component.size()).ok_or(problem("has an unknown type"))?;
    let bytes = match index_of(accessor.get("bufferView")) {
        Some(view) => {
            let offset = index_of(accessor.get("byteOffset")).unwrap_or(0);
            gather(source, view, Run { offset, count, size })?
        }
        None => vec![0; count.checked_mul(size).ok_or(problem("is larger than memory"))?],
    };
    let normalized = accessor.get("normalized").and_then(Value::as_bool).unwrap_or(false);
    let mut elements = Elements { bytes, size, component, components, normalized };
    if let Some(sparse) = accessor.get("sparse").and_then(Value::as_object) {
        overwrite(source, sparse, &mut elements).map_err(|error| match error {
            SparseError::Export(error) => error,
            SparseError::Shape => problem("has a sparse part that does not fit it"),
        })?;
    }
    Ok(elements)
}

/// The bytes that an accessor covers of its bufferView: first and end. `stride` is the view's.
pub(super) fn extent(accessor: &Object, stride: Option<usize>) -> Option<(usize, usize)> {
    let component = index_of(accessor.get("componentType")).and_then(Component::from_number)?;
    let (_, size) = shape(accessor.get("type")?.as_str()?, component.size())?;
    let offset = index_of(accessor.get("byteOffset")).unwrap_or(0);
    let run = Run { offset, count: index_of(accessor.get("count"))?, size };
    Some((offset, run.end(stride.unwrap_or(size))?))
}

/// Components and bytes of a type; matrices start each column at a multiple of 4 bytes.
fn shape(kind: &str, component: usize) -> Option<(usize, usize)> {
    let vector = |n: usize| (n, n * component);
    let matrix = |n: usize| (0, n * (n * component).next_multiple_of(4));
    Some(match kind {
        "SCALAR" => vector(1),
        "VEC2" => vector(2),
        "VEC3" => vector(3),
        "VEC4" => vector(4),
        "MAT2" => matrix(2),
        "MAT3" => matrix(3),
        "MAT4" => matrix(4),
        _ => return None,
    })
}

/// Where an accessor's elements lie in a view.
#[derive(Clone, Copy)]
struct Run {
    offset: usize,
    count: usize,
    size: usize,
}

impl Run {
    /// The end of the last element; `None` where that is beyond all memory.
    fn end(self, stride: usize) -> Option<usize> {
        match self.count.checked_sub(1) {
            Some(last) => last.checked_mul(stride)?.checked_add(self.offset)?.checked_add(self.size),
            None => Some(self.offset),
        }
    }
}

/// Copies elements out of a view, closing the gaps of its stride.
fn gather(source: &SourceDocument, index: usize, run: Run) -> Result<Vec<u8>, ExportError> {
    let problem = |problem| ExportError::Malformed { list: "bufferView", index, problem };
    let view =
        list(source, "bufferViews").get(index).and_then(Value::as_object).ok_or(problem("is not there"))?;
    let (buffer, start, end) = span(view, index, &source.buffers)?;
    let bytes = source.buffers.get(buffer).and_then(|bytes| bytes.get(start..end)).unwrap_or_default();
    let stride = index_of(view.get("byteStride")).filter(|&stride| stride > 0).unwrap_or(run.size);
    if run.end(stride).is_none_or(|end| end > bytes.len()) {
        return Err(problem("is shorter than an accessor that reads it"));
    }
    let mut packed = Vec::with_capacity(run.count * run.size);
    for element in 0..run.count {
        let at = run.offset + element * stride;
        packed.extend_from_slice(bytes.get(at..at + run.size).unwrap_or_default());
    }
    Ok(packed)
}

enum SparseError {
    Export(ExportError),
    Shape,
}

/// Puts a sparse accessor's own values over its base.
fn overwrite(source: &SourceDocument, sparse: &Object, elements: &mut Elements) -> Result<(), SparseError> {
    let count = index_of(sparse.get("count")).ok_or(SparseError::Shape)?;
    let part = |name: &str, size: usize| {
        let part = sparse.get(name).and_then(Value::as_object).ok_or(SparseError::Shape)?;
        let view = index_of(part.get("bufferView")).ok_or(SparseError::Shape)?;
        let offset = index_of(part.get("byteOffset")).unwrap_or(0);
        gather(source, view, Run { offset, count, size }).map_err(SparseError::Export)
    };
    let kind = sparse.get("indices").and_then(|part| index_of(part.get("componentType")));
    let kind = kind.and_then(Component::from_number).ok_or(SparseError::Shape)?;
    let (indices, values) = (part("indices", kind.size())?, part("values", elements.size)?);
    for (index, value) in indices.chunks_exact(kind.size()).zip(values.chunks_exact(elements.size)) {
        let start = (kind.value(index) as usize).checked_mul(elements.size).ok_or(SparseError::Shape)?;
        let end = start.checked_add(elements.size).ok_or(SparseError::Shape)?;
        elements.bytes.get_mut(start..end).ok_or(SparseError::Shape)?.copy_from_slice(value);
    }
    Ok(())
}

fn list<'s>(source: &'s SourceDocument, name: &str) -> &'s [Value] {
    source.json.get(name).and_then(Value::as_array).map_or(&[], Vec::as_slice)
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn source(json: Value, buffer: Vec<u8>) -> SourceDocument {
        SourceDocument { json, buffers: vec![buffer], external_images: Vec::new() }
    }

    #[test]
    fn strides_are_closed() {
        let source = source(
            json!({
                "bufferViews": [{"buffer": 0, "byteOffset": 1, "byteLength": 20, "byteStride": 8}],
                "accessors": [{"bufferView": 0, "byteOffset": 2, "componentType": 5121, "type": "VEC2",
                               "count": 3, "normalized": true}]
            }),
            (0..32).collect(),
        );
        let elements = read(&source, 0, 3).unwrap();
        assert_eq!(elements.bytes, [3, 4, 11, 12, 19, 20]);
        assert_eq!(elements.floats()[1], 4.0 / 255.0);
        let (low, high) = elements.extremes([1, 0]).unwrap();
        assert_eq!((low, high), (vec![json!(3), json!(4)], vec![json!(11), json!(12)]));
        assert!(read(&source, 0, 4).is_err(), "another count than the caller expects");
    }

    #[test]
    fn sparse_values_lie_over_the_base() {
        let source = source(
            json!({
                "bufferViews": [{"buffer": 0, "byteLength": 2}, {"buffer": 0, "byteOffset": 4, "byteLength": 8}],
                "accessors": [
                    {"componentType": 5126, "type": "SCALAR", "count": 4, "sparse": {"count": 2,
                     "indices": {"bufferView": 0, "componentType": 5121}, "values": {"bufferView": 1}}},
                    {"componentType": 5126, "type": "SCALAR", "count": 2, "sparse": {"count": 2,
                     "indices": {"bufferView": 0, "componentType": 5121}, "values": {"bufferView": 1}}},
                ]
            }),
            [vec![1, 3, 0, 0], 1.5_f32.to_le_bytes().to_vec(), (-2.0_f32).to_le_bytes().to_vec()].concat(),
        );
        assert_eq!(read(&source, 0, 4).unwrap().floats(), [0.0, 1.5, 0.0, -2.0]);
        assert!(read(&source, 1, 2).is_err(), "an index outside the base");
    }

    #[test]
    fn accessors_beyond_their_view_are_refused() {
        let view = json!([{"buffer": 0, "byteLength": 8}]);
        for accessor in [
            json!({"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 1}),
            json!({"bufferView": 0, "byteOffset": u64::MAX, "componentType": 5121, "type": "SCALAR", "count": 1}),
            json!({"bufferView": 7, "componentType": 5121, "type": "SCALAR", "count": 1}),
            json!({"bufferView": 0, "componentType": 5124, "type": "SCALAR", "count": 1}),
            json!({"bufferView": 0, "componentType": 5121, "type": "VEC5", "count": 1}),
        ] {
            let source = source(json!({"bufferViews": view, "accessors": [accessor]}), vec![0; 8]);
            assert!(read(&source, 0, 1).is_err(), "{accessor}");
        }
    }
}
