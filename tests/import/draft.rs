//! Builds small glTF documents to read, and to damage.

use cobake::scene::{ImportOptions, Scene, from_bytes};
use serde_json::{Value, json};

pub(crate) const FLOAT: u32 = 5126;
pub(crate) const BYTE: u32 = 5121;
pub(crate) const SHORT: u32 = 5123;
pub(crate) const INT: u32 = 5125;

/// A document under construction with one buffer.
#[derive(Clone)]
pub(crate) struct Draft {
    pub(crate) json: Value,
    pub(crate) binary: Vec<u8>,
}

impl Draft {
    /// A unit square facing +z as two triangles, emissive, on `Wall`, the child of `Root`.
    pub(crate) fn square() -> Self {
        let json = json!({
            "asset": {"version": "2.0"},
            "scene": 0,
            "scenes": [{"nodes": [0]}],
            "nodes": [{"name": "Root", "children": [1]}, {"name": "Wall", "mesh": 0}],
            "meshes": [{"name": "Square", "primitives": [{"attributes": {}, "material": 0}]}],
            "materials": [{"name": "Glow", "emissiveFactor": [1, 1, 1], "pbrMetallicRoughness":
                {"baseColorFactor": [0.8, 0.6, 0.4, 1], "metallicFactor": 0}}],
            "accessors": [], "bufferViews": [], "buffers": []
        });
        let mut draft = Self { json, binary: Vec::new() };
        draft.attribute("POSITION", "VEC3", FLOAT, &floats(&SQUARE.concat()));
        draft.set("/accessors/0/min", json!([0, 0, 0])).set("/accessors/0/max", json!([1, 1, 0]));
        draft.indices(SHORT, &[0, 1, 2, 0, 2, 3]);
        draft
    }

    pub(crate) fn set(&mut self, pointer: &str, value: Value) -> &mut Self {
        let (parent, key) = pointer.rsplit_once('/').unwrap();
        match self.json.pointer_mut(parent).unwrap_or_else(|| panic!("no {parent}")) {
            Value::Object(object) => _ = object.insert(key.to_owned(), value),
            Value::Array(array) if key == "-" => array.push(value),
            Value::Array(array) => array[key.parse::<usize>().unwrap()] = value,
            _ => panic!("{parent} has no entries"),
        }
        self
    }

    /// Adds a buffer view and gives its index.
    pub(crate) fn view(&mut self, bytes: &[u8]) -> usize {
        self.binary.resize(self.binary.len().next_multiple_of(4), 0);
        let view = json!({"buffer": 0, "byteOffset": self.binary.len(), "byteLength": bytes.len()});
        self.set("/bufferViews/-", view);
        self.binary.extend(bytes);
        self.json["bufferViews"].as_array().unwrap().len() - 1
    }

    /// Adds an accessor over a view of its own and gives its index.
    pub(crate) fn accessor(&mut self, shape: &str, component: u32, bytes: &[u8]) -> usize {
        let view = self.view(bytes);
        let width = match shape {
            "SCALAR" => 1,
            _ => shape[3..].parse::<usize>().unwrap(),
        };
        let size = width
            * match component {
                FLOAT | INT => 4,
                SHORT | 5122 => 2,
                _ => 1,
            };
        self.push_accessor(json!({"bufferView": view, "componentType": component, "type": shape,
            "count": bytes.len() / size}))
    }

    pub(crate) fn push_accessor(&mut self, accessor: Value) -> usize {
        self.set("/accessors/-", accessor);
        self.json["accessors"].as_array().unwrap().len() - 1
    }

    pub(crate) fn attribute(&mut self, name: &str, shape: &str, component: u32, bytes: &[u8]) {
        let accessor = self.accessor(shape, component, bytes);
        self.set(&format!("/meshes/0/primitives/0/attributes/{name}"), json!(accessor));
    }

    pub(crate) fn indices(&mut self, component: u32, indices: &[u32]) {
        let size = match component {
            BYTE => 1,
            SHORT => 2,
            _ => 4,
        };
        let bytes: Vec<u8> = indices.iter().flat_map(|i| i.to_le_bytes()[..size].to_vec()).collect();
        let accessor = self.accessor("SCALAR", component, &bytes);
        self.set("/meshes/0/primitives/0/indices", json!(accessor));
    }

    /// Adds a PNG of single-coloured texels as the base colour texture, with coordinates over the square.
    pub(crate) fn texture(&mut self, width: u32, texels: &[[u8; 3]]) {
        let texels: Vec<[u8; 4]> = texels.iter().map(|&[r, g, b]| [r, g, b, 255]).collect();
        self.texture_with_alpha(width, &texels);
    }

    /// The same of texels that have alpha.
    pub(crate) fn texture_with_alpha(&mut self, width: u32, texels: &[[u8; 4]]) {
        let height = texels.len() as u32 / width;
        let mut png = std::io::Cursor::new(Vec::new());
        let pixels = image::RgbaImage::from_raw(width, height, texels.concat()).unwrap();
        pixels.write_to(&mut png, image::ImageFormat::Png).unwrap();
        let view = self.view(&png.into_inner());
        self.set("/images", json!([{"bufferView": view, "mimeType": "image/png"}]));
        self.set("/samplers", json!([{"magFilter": 9728}]));
        self.set("/textures", json!([{"source": 0, "sampler": 0}]));
        self.set(
            "/materials/0/pbrMetallicRoughness",
            json!({"metallicFactor": 0, "baseColorTexture": {"index": 0}}),
        );
        // The upper left texel lies at the square's corner (0, 1).
        self.attribute("TEXCOORD_0", "VEC2", FLOAT, &floats(&[0.0, 1.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0]));
    }

    pub(crate) fn glb(&self) -> Vec<u8> {
        let mut this = self.clone();
        this.set("/buffers", json!([{"byteLength": self.binary.len()}]));
        pack(this.json.to_string().as_bytes(), &self.binary)
    }

    /// As JSON text whose buffer is a data URI.
    pub(crate) fn gltf(&self) -> Vec<u8> {
        let mut this = self.clone();
        let uri: String = self.binary.iter().map(|byte| format!("%{byte:02x}")).collect();
        let uri = format!("data:application/octet-stream,{uri}");
        this.set("/buffers", json!([{"byteLength": self.binary.len(), "uri": uri}]));
        this.json.to_string().into_bytes()
    }

    pub(crate) fn scene(&self) -> Scene {
        from_bytes(&self.glb(), None, &ImportOptions::default()).unwrap()
    }

    pub(crate) fn refusal(&self) -> String {
        refusal(&self.glb())
    }
}

pub(crate) const SQUARE: [[f32; 3]; 4] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];

pub(crate) fn floats(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|value| value.to_le_bytes()).collect()
}

pub(crate) fn pack(json: &[u8], binary: &[u8]) -> Vec<u8> {
    let mut out = [&b"glTF"[..], &[2, 0, 0, 0, 0, 0, 0, 0]].concat();
    for (kind, data, fill) in [(b"JSON", json, b' '), (b"BIN\0", binary, 0)] {
        let mut data = data.to_vec();
        data.resize(data.len().next_multiple_of(4), fill);
        out.extend((data.len() as u32).to_le_bytes());
        out.extend(kind);
        out.extend(data);
    }
    let length = out.len() as u32;
    out[8..12].copy_from_slice(&length.to_le_bytes());
    out
}

pub(crate) fn refusal(bytes: &[u8]) -> String {
    from_bytes(bytes, None, &ImportOptions::default()).unwrap_err().to_string()
}
