//! Small glTF files, made in memory.

use std::path::{Path, PathBuf};

use bottega_scene::{LoadOptions, Loaded, SceneError, load};
use serde_json::{Value, json};

/// An unfinished document, and its only buffer.
pub(crate) struct File {
    pub(crate) json: Value,
    pub(crate) bin: Vec<u8>,
}

pub(crate) const U8: u32 = 5121;
pub(crate) const U16: u32 = 5123;
pub(crate) const U32: u32 = 5125;
pub(crate) const F32: u32 = 5126;

impl File {
    /// A document with one node that shows a mesh without primitives.
    pub(crate) fn new() -> Self {
        let json = json!({
            "asset": {"version": "2.0"},
            "scene": 0,
            "scenes": [{"nodes": [0]}],
            "nodes": [{"mesh": 0}],
            "meshes": [{"primitives": []}],
            "accessors": [],
            "bufferViews": [],
            "materials": [],
        });
        Self { json, bin: Vec::new() }
    }

    /// A document with one triangle in the plane z = 0, front towards +z, with the default material.
    pub(crate) fn triangle() -> Self {
        let mut file = Self::new();
        let positions = file.floats("VEC3", &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
        file.primitive(json!({"attributes": {"POSITION": positions}}));
        file
    }

    /// The same triangle with texture coordinates and one material.
    pub(crate) fn textured(material: &Value) -> Self {
        let mut file = Self::triangle();
        let uvs = file.floats("VEC2", &[0.0, 0.0, 1.0, 0.0, 0.0, 1.0]);
        let primitive = &mut file.json["meshes"][0]["primitives"][0];
        primitive["attributes"]["TEXCOORD_0"] = json!(uvs);
        primitive["attributes"]["TEXCOORD_1"] = json!(uvs);
        primitive["material"] = json!(0);
        file.json["materials"] = json!([material]);
        file
    }

    pub(crate) fn view(&mut self, bytes: &[u8]) -> usize {
        while !self.bin.len().is_multiple_of(4) {
            self.bin.push(0);
        }
        let view = json!({"buffer": 0, "byteOffset": self.bin.len(), "byteLength": bytes.len()});
        self.bin.extend(bytes);
        self.push("bufferViews", view)
    }

    pub(crate) fn accessor(&mut self, kind: &str, component: u32, count: usize, bytes: &[u8]) -> usize {
        let view = self.view(bytes);
        self.push("accessors", json!({"bufferView": view, "componentType": component, "type": kind, "count": count}))
    }

    pub(crate) fn floats(&mut self, kind: &str, values: &[f32]) -> usize {
        let width = match kind {
            "SCALAR" => 1,
            "VEC2" => 2,
            "VEC3" => 3,
            "VEC4" => 4,
            _ => 16,
        };
        let bytes: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
        self.accessor(kind, F32, values.len() / width, &bytes)
    }

    pub(crate) fn primitive(&mut self, primitive: Value) {
        self.json["meshes"][0]["primitives"].as_array_mut().unwrap().push(primitive);
    }

    /// Adds an element to a top-level array; returns its index.
    pub(crate) fn push(&mut self, list: &str, value: Value) -> usize {
        if self.json.get(list).is_none() {
            self.json[list] = json!([]);
        }
        let list = self.json[list].as_array_mut().unwrap();
        list.push(value);
        list.len() - 1
    }

    /// Adds an image and a texture of it; returns the texture.
    pub(crate) fn texture(&mut self, picture: &[u8]) -> usize {
        let view = self.view(picture);
        let image = self.push("images", json!({"bufferView": view, "mimeType": "image/png"}));
        self.push("textures", json!({"source": image}))
    }

    pub(crate) fn glb(&self) -> Vec<u8> {
        let mut document = self.json.clone();
        if document.get("buffers").is_none() {
            document["buffers"] = json!([{"byteLength": self.bin.len()}]);
        }
        let mut text = document.to_string().into_bytes();
        text.resize(text.len().next_multiple_of(4), b' ');
        let mut bin = self.bin.clone();
        bin.resize(bin.len().next_multiple_of(4), 0);
        let mut file = b"glTF".to_vec();
        for number in [2, 12 + 8 + text.len() + 8 + bin.len(), text.len()] {
            file.extend((number as u32).to_le_bytes());
        }
        file.extend(b"JSON");
        file.extend(text);
        file.extend((bin.len() as u32).to_le_bytes());
        file.extend(b"BIN\0");
        file.extend(bin);
        file
    }

    pub(crate) fn try_load(&self) -> Result<Loaded, SceneError> {
        load_bytes("scene.glb", &self.glb())
    }

    pub(crate) fn load(&self) -> Loaded {
        self.try_load().unwrap_or_else(|error| panic!("{error}"))
    }

    /// The message of the error.
    pub(crate) fn error(&self) -> String {
        self.try_load().expect_err("the file is bad").to_string()
    }
}

pub(crate) fn load_bytes(name: &str, bytes: &[u8]) -> Result<Loaded, SceneError> {
    let folder = tempfile::tempdir().unwrap();
    load(&write(folder.path(), name, bytes), &LoadOptions::default())
}

pub(crate) fn write(folder: &Path, name: &str, bytes: &[u8]) -> PathBuf {
    let path = folder.join(name);
    std::fs::write(&path, bytes).unwrap();
    path
}

/// A PNG file of 8-bit RGBA.
pub(crate) fn png(width: u32, height: u32, texels: &[[u8; 4]]) -> Vec<u8> {
    let mut file = std::io::Cursor::new(Vec::new());
    let bytes: Vec<u8> = texels.iter().flatten().copied().collect();
    let buffer = image::RgbaImage::from_raw(width, height, bytes).unwrap();
    buffer.write_to(&mut file, image::ImageFormat::Png).unwrap();
    file.into_inner()
}

/// Returns true if some warning contains all of these words.
pub(crate) fn warns(loaded: &Loaded, words: &[&str]) -> bool {
    loaded.warnings.iter().any(|warning| words.iter().all(|word| warning.to_string().contains(word)))
}
