//! The images that a soak test requests: small ones, one of each kind of work that machines share before the first zone.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use serde_json::Value;

/// A kind of image, and its reference rendered by one machine alone.
pub(super) struct PictureKind {
    pub(super) scene: PathBuf,
    words: Vec<&'static str>,
    /// The request as JSON.
    pub(super) request: Value,
    pub(super) bits: Vec<[u32; 3]>,
}

/// The options that all kinds share.
const COMMON: [&str; 3] = ["--size=64x48", "--seed=5", "--set=work.zones=16"];

impl PictureKind {
    /// Renders each kind once.
    ///
    /// - `run`: runs the program, and returns its output.
    pub(super) fn all(run: &dyn Fn(&[&str]) -> Result<String>, scene: &Path, folder: &Path) -> Result<Vec<Self>> {
        const KINDS: [&[&str]; 3] = [
            &["--spp=48"],
            &["--spp=6", "--integrator=photon", "--set=photons.count=60000"],
            &["--spp=6", "--integrator=ala", "--set=lighting_agents.cast=6000"],
        ];
        let paint = |(number, words): (usize, &[&'static str])| {
            let path = folder.join(format!("alone-{number}.exr"));
            let kind = Self { scene: scene.to_owned(), words: words.to_vec(), request: Value::Null, bits: Vec::new() };
            let file = path.display().to_string();
            let words: Vec<String> =
                kind.render_words().into_iter().chain(["-o".to_owned(), file.clone(), "--quiet".to_owned()]).collect();
            run(&words.iter().map(String::as_str).collect::<Vec<_>>())?;
            let request: Value = serde_json::from_str(&run(&["request", "show", &file])?)?;
            Ok(Self { request, bits: bits(&path)?, ..kind })
        };
        KINDS.into_iter().enumerate().map(paint).collect()
    }

    /// Returns the arguments that render it, without the output file.
    pub(super) fn render_words(&self) -> Vec<String> {
        let common = COMMON.iter().copied();
        let words = ["render".to_owned(), self.scene.display().to_string()].into_iter();
        words.chain(common.chain(self.words.iter().copied()).map(str::to_owned)).collect()
    }

    pub(super) fn scene_name(&self) -> String {
        self.scene.file_name().unwrap_or_default().to_string_lossy().into_owned()
    }
}

/// Returns the bits of an image.
pub(super) fn bits(path: &Path) -> Result<Vec<[u32; 3]>> {
    let picture = bottega_image::read_picture(path).with_context(|| format!("{} is not a picture", path.display()))?;
    Ok(picture.data.iter().map(|pixel| pixel.map(f32::to_bits)).collect())
}
