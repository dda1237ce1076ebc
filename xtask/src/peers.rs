//! Converts the scenes on which renderers are compared (one JSON file a scene, PLY meshes of flat triangles) to glTF,
//! so that Bottega paints the very same triangles.

use std::{fs, path::Path};

use anyhow::{Context, Result, bail, ensure};
use serde_json::{Value, json};

/// Converts every `.json` scene of a folder.
pub(crate) fn convert_all(from: &Path, to: &Path) -> Result<()> {
    fs::create_dir_all(to)?;
    let mut converted = 0;
    for entry in fs::read_dir(from).with_context(|| format!("cannot read the folder {}", from.display()))? {
        let path = entry?.path();
        if path.extension().is_some_and(|extension| extension == "json") {
            let target = to.join(path.file_stem().unwrap_or_default()).with_extension("glb");
            convert(&path, &target).with_context(|| format!("cannot convert {}", path.display()))?;
            converted += 1;
        }
    }
    ensure!(converted > 0, "no .json scene in {}", from.display());
    Ok(())
}

fn convert(path: &Path, target: &Path) -> Result<()> {
    let scene: Value = serde_json::from_slice(&fs::read(path)?)?;
    let folder = path.parent().unwrap_or(Path::new("."));
    let mut glb = Glb::default();
    for mesh in array(&scene, "meshes")? {
        let (positions, triangles) = read_ply(&folder.join(text(mesh, "ply")?))?;
        let material = glb.material(&scene["materials"][text(mesh, "material")?], mesh.get("emission"))?;
        glb.mesh(text(mesh, "name")?, &positions, &triangles, material);
    }
    glb.camera(&scene["camera"])?;
    fs::write(target, glb.finish()?)?;
    // glTF has no constant environment: it is an option of the command line.
    let size = format!("{}x{}", scene["width"], scene["height"]);
    let env = scene.get("env").and_then(|env| numbers(env).ok()).unwrap_or_default().map(|value| value.to_string());
    println!(
        "bottega render {} --size {size} --env {} --filter box --max-depth {}",
        target.display(),
        env.join(","),
        scene["max_bounces"].as_u64().context("no max_bounces")? + 1,
    );
    Ok(())
}

#[derive(Default)]
struct Glb {
    bin: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
    materials: Vec<Value>,
    meshes: Vec<Value>,
    nodes: Vec<Value>,
    cameras: Vec<Value>,
}

impl Glb {
    /// A material that scatters exactly as the peers' does: `specular` 0 leaves a pure Lambert lobe.
    fn material(&mut self, material: &Value, emission: Option<&Value>) -> Result<usize> {
        let color = |key: &str| -> Result<Value> {
            let rgb = numbers(&material[key])?;
            Ok(json!([rgb[0], rgb[1], rgb[2], 1.0]))
        };
        let mut out = match text(material, "type")? {
            "diffuse" => json!({
                "pbrMetallicRoughness": {"baseColorFactor": color("reflectance")?, "metallicFactor": 0, "roughnessFactor": 1},
                "extensions": {"KHR_materials_specular": {"specularFactor": 0}},
                "doubleSided": emission.is_none(),
            }),
            "mirror" => json!({
                "pbrMetallicRoughness": {"baseColorFactor": color("reflectance")?, "metallicFactor": 1, "roughnessFactor": 0},
                "doubleSided": true,
            }),
            "dielectric" => json!({
                "pbrMetallicRoughness": {"metallicFactor": 0, "roughnessFactor": 0},
                "extensions": {
                    "KHR_materials_transmission": {"transmissionFactor": 1},
                    "KHR_materials_volume": {"thicknessFactor": 1},
                    "KHR_materials_ior": {"ior": material["ior"]},
                },
            }),
            other => bail!("material type `{other}` is not known"),
        };
        if let Some(radiance) = emission {
            let rgb = numbers(radiance)?;
            let strength = rgb.iter().copied().fold(0.0, f64::max).max(1e-9);
            out["emissiveFactor"] = json!(rgb.iter().map(|value| value / strength).collect::<Vec<_>>());
            out["extensions"]["KHR_materials_emissive_strength"] = json!({"emissiveStrength": strength});
        }
        self.materials.push(out);
        Ok(self.materials.len() - 1)
    }

    fn mesh(&mut self, name: &str, positions: &[[f32; 3]], triangles: &[[u32; 3]], material: usize) {
        let mut low = [f32::INFINITY; 3];
        let mut high = [f32::NEG_INFINITY; 3];
        for position in positions {
            for axis in 0..3 {
                low[axis] = low[axis].min(position[axis]);
                high[axis] = high[axis].max(position[axis]);
            }
        }
        let points = self.view(positions.as_flattened().iter().flat_map(|value| value.to_le_bytes()));
        let indices = self.view(triangles.as_flattened().iter().flat_map(|value| value.to_le_bytes()));
        let first = self.accessors.len();
        self.accessors.push(json!({
            "bufferView": points, "componentType": 5126, "count": positions.len(), "type": "VEC3", "min": low, "max": high,
        }));
        self.accessors.push(json!({
            "bufferView": indices, "componentType": 5125, "count": triangles.len() * 3, "type": "SCALAR",
        }));
        let primitive = json!({"attributes": {"POSITION": first}, "indices": first + 1, "material": material});
        self.meshes.push(json!({"name": name, "primitives": [primitive]}));
        self.nodes.push(json!({"name": name, "mesh": self.meshes.len() - 1}));
    }

    fn view(&mut self, bytes: impl Iterator<Item = u8>) -> usize {
        let offset = self.bin.len();
        self.bin.extend(bytes);
        let length = self.bin.len() - offset;
        self.bin.resize(self.bin.len().next_multiple_of(4), 0);
        self.views.push(json!({"buffer": 0, "byteOffset": offset, "byteLength": length}));
        self.views.len() - 1
    }

    /// The peers look from `origin` to `target`; their angle is that between the left and the right edge, and their
    /// pictures are square.
    fn camera(&mut self, camera: &Value) -> Result<()> {
        let [origin, target, up] = ["origin", "target", "up"].map(|key| numbers(&camera[key]));
        let (origin, target, up) = (origin?, target?, up?);
        let back = normalized([0, 1, 2].map(|axis| origin[axis] - target[axis]));
        let right = normalized(cross([up[0], up[1], up[2]], back));
        let above = cross(back, right);
        let angle = camera["fov"].as_f64().context("camera without fov")?.to_radians();
        self.cameras
            .push(json!({"type": "perspective", "perspective": {"yfov": angle, "znear": 0.01, "aspectRatio": 1}}));
        self.nodes.push(json!({"name": "camera", "camera": 0, "matrix": [
            right[0], right[1], right[2], 0.0, above[0], above[1], above[2], 0.0,
            back[0], back[1], back[2], 0.0, origin[0], origin[1], origin[2], 1.0,
        ]}));
        Ok(())
    }

    fn finish(self) -> Result<Vec<u8>> {
        let children: Vec<usize> = (0..self.nodes.len()).collect();
        let mut nodes = self.nodes;
        // The peers' scenes have z up, glTF has y up.
        let half = std::f64::consts::FRAC_1_SQRT_2;
        nodes.push(json!({"name": "z up", "rotation": [-half, 0.0, 0.0, half], "children": children}));
        let document = json!({
            "asset": {"version": "2.0", "generator": "bottega xtask peers"},
            "extensionsUsed": ["KHR_materials_specular", "KHR_materials_transmission", "KHR_materials_volume",
                               "KHR_materials_ior", "KHR_materials_emissive_strength"],
            "scene": 0, "scenes": [{"nodes": [nodes.len() - 1]}], "nodes": nodes, "cameras": self.cameras,
            "meshes": self.meshes, "materials": self.materials, "accessors": self.accessors,
            "bufferViews": self.views, "buffers": [{"byteLength": self.bin.len()}],
        });
        let mut text = serde_json::to_vec(&document)?;
        text.resize(text.len().next_multiple_of(4), b' ');
        let total = u32::try_from(12 + 8 + text.len() + 8 + self.bin.len())?;
        let mut out = Vec::with_capacity(total as usize);
        out.extend(b"glTF");
        out.extend(2u32.to_le_bytes());
        out.extend(total.to_le_bytes());
        for (kind, chunk) in [(b"JSON", &text), (b"BIN\0", &self.bin)] {
            out.extend(u32::try_from(chunk.len())?.to_le_bytes());
            out.extend(kind);
            out.extend(chunk);
        }
        Ok(out)
    }
}

/// Positions and triangles of the one form of PLY that the peers' scenes have.
type Triangles = (Vec<[f32; 3]>, Vec<[u32; 3]>);

fn read_ply(path: &Path) -> Result<Triangles> {
    const END: &[u8] = b"end_header\n";
    let bytes = fs::read(path).with_context(|| format!("cannot read {}", path.display()))?;
    let start = bytes.windows(END.len()).position(|window| window == END).context("no end_header")? + END.len();
    let header = std::str::from_utf8(&bytes[..start])?;
    ensure!(header.contains("binary_little_endian"), "{}: only little-endian PLY", path.display());
    let count = |element: &str| -> Result<usize> {
        let line = header.lines().find_map(|line| line.strip_prefix(element)).context("element is missing")?;
        Ok(line.trim().parse()?)
    };
    let (vertices, faces) = (count("element vertex")?, count("element face")?);
    let body = &bytes[start..];
    ensure!(body.len() == vertices * 12 + faces * 13, "{}: not x y z and triangles alone", path.display());
    let word = |at: usize| -> [u8; 4] { [body[at], body[at + 1], body[at + 2], body[at + 3]] };
    let positions = (0..vertices).map(|v| [0, 1, 2].map(|axis| f32::from_le_bytes(word(v * 12 + axis * 4)))).collect();
    let triangles =
        (0..faces).map(|f| [0, 1, 2].map(|k| u32::from_le_bytes(word(vertices * 12 + f * 13 + 1 + k * 4)))).collect();
    Ok((positions, triangles))
}

fn array<'a>(value: &'a Value, key: &str) -> Result<&'a Vec<Value>> {
    value[key].as_array().with_context(|| format!("no array `{key}`"))
}

fn text<'a>(value: &'a Value, key: &str) -> Result<&'a str> {
    value[key].as_str().with_context(|| format!("no text `{key}`"))
}

fn numbers(value: &Value) -> Result<[f64; 3]> {
    let parts = value.as_array().with_context(|| format!("{value} is no triple"))?;
    ensure!(parts.len() == 3, "{value} is no triple");
    let number = |index: usize| parts[index].as_f64().with_context(|| format!("{value} is no triple of numbers"));
    Ok([number(0)?, number(1)?, number(2)?])
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn normalized(v: [f64; 3]) -> [f64; 3] {
    let length = v.iter().map(|x| x * x).sum::<f64>().sqrt();
    v.map(|x| x / length)
}
