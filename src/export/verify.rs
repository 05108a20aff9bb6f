//! Reading the output back before it counts.

use std::io::Cursor;

use serde_json::Value;

use super::document::index_of;
use super::writer::COBAKE_LIGHTMAP;
use super::{ExportError, decode_exr, glb};

/// Checks that `glb` is a baked document: a GLB container whose bufferViews lie in its buffer, whose
/// accessors lie in their bufferViews, and whose lightmaps decode, at the size that the file claims.
///
/// # Errors
/// Names the first thing that is missing or wrong.
pub fn verify(glb: &[u8]) -> Result<(), ExportError> {
    let (json, binary) = glb::unpack(glb)?;
    let list = |name: &str| json.get(name).and_then(Value::as_array).map_or([].as_slice(), Vec::as_slice);
    let problem = |problem| ExportError::NotBaked { problem };
    for view in list("bufferViews") {
        bytes_of(view, binary).ok_or(problem("a bufferView reaches beyond the buffer"))?;
    }
    for accessor in list("accessors") {
        let Some(view) = index_of(accessor.get("bufferView")) else { continue };
        let length = list("bufferViews").get(view).and_then(|view| index_of(view.get("byteLength")));
        if index_of(accessor.get("byteOffset")).unwrap_or(0) >= length.unwrap_or(0) {
            return Err(problem("an accessor reaches beyond its bufferView"));
        }
    }
    let maps = json.get("extensions").and_then(|e| e.get(COBAKE_LIGHTMAP)?.get("lightmaps")?.as_array());
    let pages = 0..maps.map_or(0, Vec::len);
    let names: Vec<String> = pages.flat_map(|k| [format!("lightmap{k}"), format!("preview{k}")]).collect();
    for image in list("images") {
        let Some(view) = index_of(image.get("bufferView")) else { continue };
        let view = list("bufferViews").get(view).ok_or(problem("an image lies in no bufferView"))?;
        let ours =
            image.get("name").and_then(Value::as_str).is_some_and(|name| names.iter().any(|n| n == name));
        let bytes = bytes_of(view, binary).unwrap_or_default();
        if ours
            && image::ImageReader::with_format(Cursor::new(bytes), image::ImageFormat::Png).decode().is_err()
        {
            return Err(problem("its lightmap's PNG is damaged"));
        }
    }
    for lightmap in maps.ok_or(problem("it names no lightmap"))? {
        let view = index_of(lightmap.get("bufferView")).and_then(|view| list("bufferViews").get(view));
        let bytes = view.and_then(|view| bytes_of(view, binary)).ok_or(problem("a lightmap has no data"))?;
        let exr = decode_exr(bytes)?;
        let claimed = (index_of(lightmap.get("width")), index_of(lightmap.get("height")));
        if claimed != (Some(exr.width as usize), Some(exr.height as usize)) {
            return Err(problem("its EXR has another size than the file says"));
        }
    }
    Ok(())
}

/// Checks that the `gltf` crate accepts the output, where it accepted the source.
///
/// That crate refuses what our own reader puts up with, so a refusal only counts as ours if the
/// source passed. Required extensions are none of its business here.
pub(super) fn still_accepted(source: &Value, glb: &[u8]) -> Result<(), ExportError> {
    match accept(glb::unpack(glb)?.0) {
        Err(refusal) if accept(source.clone()).is_ok() => Err(refusal),
        _ => Ok(()),
    }
}

fn accept(mut json: Value) -> Result<(), ExportError> {
    // The crate's validation indexes the accessors with this one number unchecked.
    let accessors = json.get("accessors").and_then(Value::as_array).map_or(0, Vec::len);
    let meshes = json.get("meshes").and_then(Value::as_array).into_iter().flatten();
    let primitives = meshes.filter_map(|mesh| mesh.get("primitives")?.as_array()).flatten();
    let mut positions = primitives.filter_map(|primitive| primitive.get("attributes")?.get("POSITION"));
    if !positions.all(|index| index_of(Some(index)).is_some_and(|index| index < accessors)) {
        return Err(ExportError::NotBaked { problem: "a primitive's positions are not there" });
    }
    if let Some(root) = json.as_object_mut() {
        root.shift_remove("extensionsRequired");
    }
    gltf::json::deserialize::from_value(json)
        .map_err(gltf::Error::Deserialize)
        .and_then(gltf::Document::from_json)
        .map_err(|source| ExportError::NotReadable { source })?;
    Ok(())
}

fn bytes_of<'b>(view: &Value, binary: &'b [u8]) -> Option<&'b [u8]> {
    let start = index_of(view.get("byteOffset")).unwrap_or(0);
    let length = index_of(view.get("byteLength"))?;
    binary.get(start..start.checked_add(length)?)
}
