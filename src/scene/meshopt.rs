//! `EXT_meshopt_compression` and `KHR_meshopt_compression`: compressed bufferViews become plain ones.
//!
//! Done once, right after the buffers are read: what is decoded goes into a buffer of its own at the end
//! of the list, and the document no longer names the extension, so that nothing later knows of it.

use serde_json::{Map, Value, json};

use super::{ImportError, Item};

/// Both hold the same payload.
pub(super) const NAMES: [&str; 2] = ["EXT_meshopt_compression", "KHR_meshopt_compression"];

/// No codec makes more bytes than this of one; a count that claims more is a lie, and nothing is allocated by it.
const MOST_EXPANSION: u128 = 2048;

/// Vertices of more bytes are not decoded.
const LONGEST_STRIDE: usize = 128;

/// What a compressed view says of itself.
struct Packed<'a> {
    bytes: &'a [u8],
    count: usize,
    stride: usize,
    mode: &'a str,
    filter: &'a str,
}

/// Decodes every compressed bufferView of `json` into a new buffer. Returns whether there were any.
///
/// # Errors
/// Names a bufferView whose data are damaged or of a kind that the extension does not define.
pub(super) fn decode(json: &mut Value, buffers: &mut Vec<Vec<u8>>) -> Result<bool, ImportError> {
    let target = buffers.len();
    let mut decoded: Vec<u8> = Vec::new();
    let views = json.get_mut("bufferViews").and_then(Value::as_array_mut);
    for (index, view) in views.into_iter().flatten().enumerate() {
        let Some(view) = view.as_object_mut() else { continue };
        let name = view.get("name").and_then(Value::as_str).map(str::to_owned);
        let refuse =
            |fault| ImportError::Meshopt { view: Item::new("bufferView", index, name.as_deref()), fault };
        let Some(extension) = take(view) else { continue };
        let packed = Packed::of(&extension, buffers).map_err(refuse)?;
        let bytes = packed.unpack().map_err(refuse)?;
        let offset = decoded.len().next_multiple_of(4);
        decoded.resize(offset, 0);
        view.insert("buffer".into(), target.into());
        view.insert("byteOffset".into(), offset.into());
        view.insert("byteLength".into(), bytes.len().into());
        decoded.extend_from_slice(&bytes);
    }
    let any = !decoded.is_empty();
    if any {
        if let Some(Value::Array(list)) = json.get_mut("buffers") {
            for buffer in list.iter_mut().filter_map(Value::as_object_mut) {
                take(buffer);
            }
            list.push(json!({"byteLength": decoded.len()}));
        }
        buffers.push(decoded);
    }
    super::extension::forget(json, &NAMES);
    Ok(any)
}

/// Takes the extension off an object, and the object of extensions where nothing else is in it.
fn take(object: &mut Map<String, Value>) -> Option<Value> {
    let extensions = object.get_mut("extensions")?.as_object_mut()?;
    let taken = NAMES.iter().find_map(|name| extensions.shift_remove(*name));
    if extensions.is_empty() {
        object.shift_remove("extensions");
    }
    taken
}

impl<'a> Packed<'a> {
    fn of(extension: &'a Value, buffers: &'a [Vec<u8>]) -> Result<Self, &'static str> {
        let number = |key| extension.get(key).and_then(Value::as_u64).and_then(|n| usize::try_from(n).ok());
        let text = |key| extension.get(key).and_then(Value::as_str);
        let lacks = "lacks buffer, byteLength, byteStride or count";
        let (buffer, length) = number("buffer").zip(number("byteLength")).ok_or(lacks)?;
        let (stride, count) = number("byteStride").zip(number("count")).ok_or(lacks)?;
        let start = number("byteOffset").unwrap_or(0);
        let end = start.checked_add(length).ok_or("reaches beyond its buffer")?;
        let bytes = buffers.get(buffer).and_then(|b| b.get(start..end)).ok_or("reaches beyond its buffer")?;
        if count as u128 * stride as u128 > MOST_EXPANSION * (length as u128 + 1) {
            return Err("claims more elements than its bytes can hold");
        }
        let mode = text("mode").ok_or("has no mode")?;
        Ok(Self { bytes, count, stride, mode, filter: text("filter").unwrap_or("NONE") })
    }

    fn unpack(&self) -> Result<Vec<u8>, &'static str> {
        match (self.mode, self.stride) {
            ("ATTRIBUTES", stride) if stride > 0 && stride.is_multiple_of(4) && stride <= LONGEST_STRIDE => {
                self.attributes()
            }
            ("ATTRIBUTES", _) => Err("has a byteStride that is no multiple of 4 up to 128"),
            ("TRIANGLES", _) if !self.count.is_multiple_of(3) => {
                Err("has a count that makes no whole triangles")
            }
            ("TRIANGLES", 2) => {
                whole(meshopt::decode_index_buffer::<u16>(self.bytes, self.count), u16::to_le_bytes)
            }
            ("TRIANGLES", 4) => {
                whole(meshopt::decode_index_buffer::<u32>(self.bytes, self.count), u32::to_le_bytes)
            }
            ("INDICES", 2) => {
                whole(meshopt::decode_index_sequence::<u16>(self.bytes, self.count), u16::to_le_bytes)
            }
            ("INDICES", 4) => {
                whole(meshopt::decode_index_sequence::<u32>(self.bytes, self.count), u32::to_le_bytes)
            }
            ("TRIANGLES" | "INDICES", _) => Err("has a byteStride other than 2 or 4 for indices"),
            _ => Err("has a mode that the extension does not define"),
        }
    }

    fn attributes(&self) -> Result<Vec<u8>, &'static str> {
        match (self.filter, self.stride) {
            ("NONE", _) => self.words(|_| {}),
            ("EXPONENTIAL", _) => {
                self.words(|words| meshopt::decode_filter_exp(words.as_chunks_mut::<1>().0))
            }
            ("OCTAHEDRAL", 4) => self.filtered(meshopt::decode_filter_oct, i8::to_le_bytes),
            ("OCTAHEDRAL", 8) => self.filtered(meshopt::decode_filter_oct, i16::to_le_bytes),
            ("QUATERNION", 8) => self.filtered(meshopt::decode_filter_quat, i16::to_le_bytes),
            ("COLOR", 4) => self.filtered(meshopt::decode_filter_color, i8::to_le_bytes),
            ("COLOR", 8) => self.filtered(meshopt::decode_filter_color, i16::to_le_bytes),
            _ => Err("has a filter that the extension does not define for its byteStride"),
        }
    }

    /// Vertices of four components, changed by `filter`.
    fn filtered<C: Clone + Default, const N: usize>(
        &self,
        filter: impl Fn(&mut [[C; 4]]),
        bytes: impl Fn(C) -> [u8; N],
    ) -> Result<Vec<u8>, &'static str> {
        let mut data = self.vertices::<[C; 4]>()?;
        filter(&mut data);
        Ok(data.into_iter().flatten().flat_map(bytes).collect())
    }

    fn vertices<T: Clone + Default>(&self) -> Result<Vec<T>, &'static str> {
        meshopt::decode_vertex_buffer(self.bytes, self.count).map_err(|_| DAMAGED)
    }

    /// Vertices of any length, changed by `filter` word by word.
    fn words(&self, filter: impl Fn(&mut [u32])) -> Result<Vec<u8>, &'static str> {
        macro_rules! by_length {
            ($($words:literal)*) => {
                match self.stride / 4 {
                    $($words => self.vertices::<[u32; $words]>()?.into_flattened(),)*
                    _ => return Err(DAMAGED),
                }
            };
        }
        let mut words = by_length!(1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17 18 19 20 21 22 23 24 25 26 27 28 29 30 31 32);
        filter(&mut words);
        Ok(words.into_iter().flat_map(u32::to_le_bytes).collect())
    }
}

const DAMAGED: &str = "is damaged";

fn whole<T, const N: usize>(
    decoded: Result<Vec<T>, meshopt::Error>,
    bytes: impl Fn(T) -> [u8; N],
) -> Result<Vec<u8>, &'static str> {
    decoded.map(|values| values.into_iter().flat_map(bytes).collect()).map_err(|_| DAMAGED)
}
