//! Options of a scene beyond its file.

use std::path::PathBuf;

/// The options of loading a scene beyond its file, and the limits of what it may take.
#[derive(Clone, Debug, PartialEq)]
pub struct LoadOptions {
    /// A latitude-longitude picture (HDR, EXR, PFM, PNG, JPEG and others) that becomes the environment, whatever the file says.
    pub environment: Option<PathBuf>,
    /// Turns that picture about the y axis, counter-clockwise seen from above, in radians.
    pub environment_rotation: f32,
    /// Multiplies that picture.
    pub environment_intensity: f32,
    /// The time, in seconds, at which animations are shown. `None`: the scene stands as its file describes it, unless
    /// an animation is named, which then stands at its beginning.
    pub at: Option<f32>,
    /// The one animation that is shown, by its name or else by its number. `None`: all; where several move the same
    /// thing, the first one.
    pub animation: Option<String>,
    /// Which of the variants of materials that a file offers is shown, by its name or else by its number.
    pub variant: Option<String>,
    /// Whether a scene without any light gets a neutral sky.
    pub add_sky: bool,
    /// Whether the scene may refer to files outside of the folder of its own file.
    pub allow_outside: bool,
    /// Further folders whose files the scene may refer to, whether by `..`, by an absolute path, or by a symbolic link.
    pub asset_roots: Vec<PathBuf>,
    /// Whether the camera sees through the backs of glTF's materials that are not `doubleSided`, as its specification has it
    /// (2.0, section 3.9.6). Else it sees all surfaces from both sides, as light does in either case.
    pub cull_backfaces: bool,
    /// Refuse scenes that ask for something which is not supported, instead of replacing it and warning.
    pub strict: bool,
    /// Name and value of parameters of the scene, instead of the values that its file gives them (Mitsuba's `$name`).
    pub defines: Vec<(String, String)>,
    /// Refuse pictures with more pixels than this. They are refused by their header, before they are decoded.
    pub max_image_pixels: u64,
    /// Refuse scenes whose meshes, instances and pictures together would take more bytes than this.
    pub max_memory_bytes: usize,
}

impl Default for LoadOptions {
    fn default() -> Self {
        Self {
            environment: None,
            environment_rotation: 0.0,
            environment_intensity: 1.0,
            at: None,
            animation: None,
            variant: None,
            add_sky: true,
            allow_outside: false,
            asset_roots: Vec::new(),
            cull_backfaces: false,
            strict: false,
            defines: Vec::new(),
            max_image_pixels: 1 << 28,
            max_memory_bytes: 16 << 30,
        }
    }
}

impl LoadOptions {
    /// One file makes several scenes, and their digests differ.
    pub(crate) fn add_choices(&self, digest: &mut blake3::Hasher) {
        if let Some(at) = self.at {
            digest.update(b"at").update(&at.to_le_bytes());
        }
        for (what, choice) in [("animation", &self.animation), ("variant", &self.variant)] {
            if let Some(choice) = choice {
                digest.update(what.as_bytes()).update(&(choice.len() as u64).to_le_bytes()).update(choice.as_bytes());
            }
        }
        if self.cull_backfaces {
            digest.update(b"cull backfaces");
        }
        for text in self.defines.iter().flat_map(|(name, value)| [name, value]) {
            digest.update(b"define").update(&(text.len() as u64).to_le_bytes()).update(text.as_bytes());
        }
    }
}
