//! The pictures that a soak asks for: small ones, of each kind of work that machines share out before the first zone.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use serde_json::{Value, json};

/// A kind of picture, and what it is when one machine paints it alone.
pub(super) struct PictureKind {
    pub(super) scene: PathBuf,
    words: Vec<&'static str>,
    /// The same for Python.
    pub(super) python: Value,
    /// The same as JSON.
    pub(super) request: Value,
    pub(super) bits: Vec<[u32; 3]>,
}

/// What all of them have in common.
const COMMON: [&str; 3] = ["--size=64x48", "--seed=5", "--zones=16"];

impl PictureKind {
    /// Paints each kind once.
    ///
    /// - `run`: runs the program, and returns what it prints.
    pub(super) fn all(run: &dyn Fn(&[&str]) -> Result<String>, scene: &Path, folder: &Path) -> Result<Vec<Self>> {
        let kinds: [(&[&'static str], Value); 3] = [
            (&["--spp=48"], json!({ "spp": 48 })),
            (
                &["--spp=6", "--integrator=photon", "--photons=400000"],
                json!({ "spp": 6, "integrator": "photon", "photons": 400_000 }),
            ),
            (
                &["--spp=6", "--integrator=ala", "--lighting-agents=30000"],
                json!({ "spp": 6, "integrator": "ala", "lighting_agents": 30_000 }),
            ),
        ];
        let paint = |(number, (words, python)): (usize, (&[&'static str], Value))| {
            let mut python = python;
            for (name, value) in [("size", json!([64, 48])), ("seed", json!(5)), ("zones", json!(16))] {
                python[name] = value;
            }
            let path = folder.join(format!("alone-{number}.exr"));
            let words = words.to_vec();
            let kind = Self { scene: scene.to_owned(), words, python, request: Value::Null, bits: Vec::new() };
            let file = path.display().to_string();
            let asked: Vec<String> =
                kind.render_words().into_iter().chain(["-o".to_owned(), file.clone(), "--quiet".to_owned()]).collect();
            run(&asked.iter().map(String::as_str).collect::<Vec<_>>())?;
            let request: Value = serde_json::from_str(&run(&["request", "show", &file])?)?;
            Ok(Self { request, bits: bits(&path)?, ..kind })
        };
        kinds.into_iter().enumerate().map(paint).collect()
    }

    /// The words that ask the program for it, but for its file.
    pub(super) fn render_words(&self) -> Vec<String> {
        let common = COMMON.iter().copied();
        let words = ["render".to_owned(), self.scene.display().to_string()].into_iter();
        words.chain(common.chain(self.words.iter().copied()).map(str::to_owned)).collect()
    }

    pub(super) fn scene_name(&self) -> String {
        self.scene.file_name().unwrap_or_default().to_string_lossy().into_owned()
    }
}

/// The bits of a picture.
pub(super) fn bits(path: &Path) -> Result<Vec<[u32; 3]>> {
    let picture = bottega_image::read_picture(path).with_context(|| format!("{} is no picture", path.display()))?;
    Ok(picture.data.iter().map(|pixel| pixel.map(f32::to_bits)).collect())
}
