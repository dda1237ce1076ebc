//! Options of a scene beyond its file.

use std::path::PathBuf;

use crate::motion::Shutter;

/// The maximum of [`LoadOptions::subdivision`].
pub const SUBDIVISION_MAX: u8 = 6;

/// The maximum of [`LoadOptions::displacement`].
pub const DISPLACEMENT_MAX: u8 = 12;

/// The options for loading a scene, and the limits on its size.
#[derive(Clone, Debug, PartialEq)]
pub struct LoadOptions {
    /// A latitude-longitude picture (HDR, EXR, PFM, PNG, JPEG and others) that replaces the file's environment; `None`:
    /// that of the file stays.
    pub environment: Option<PathBuf>,
    /// Rotation of the `environment` picture about the y axis, counter-clockwise seen from above, in radians.
    pub environment_rotation: f32,
    /// Factor of the radiance of the `environment` picture.
    pub environment_intensity: f32,
    /// Time at which animations are evaluated, in seconds. `None`: the scene as the file describes it (USD: at the
    /// earliest time), or time 0 if glTF's [`animation`](Self::animation) or a [`shutter`](Self::shutter) is chosen.
    pub at: Option<f32>,
    /// The span of time that the picture shows, relative to [`at`](Self::at); `None`: that of the file, which for glTF
    /// and USD is one moment.
    pub shutter: Option<Shutter>,
    /// Name or number of the only animation to use. `None`: all; if several move the same thing, the first one.
    pub animation: Option<String>,
    /// The variant to use: for glTF the name or number of a variant of materials, for USD a choice such as
    /// `/Car{color=red}`. `None`: that of the file.
    pub variant: Option<String>,
    /// Number of refinements of USD's subdivision surfaces, from 0 (their polygons) to [`SUBDIVISION_MAX`]; `None`: 2
    /// for meshes that name their scheme, and 0 for others. Those of pbrt have a number of their own.
    pub subdivision: Option<u8>,
    /// Number of times that the longest edge of a displaced mesh is halved, from 0 to [`DISPLACEMENT_MAX`]; `None`: edges
    /// are as long as a texel of the texture. Part of the scene's digest; meshes are displaced when it is prepared.
    pub displacement: Option<u8>,
    /// `true`: a scene without any light gets a neutral sky.
    pub add_sky: bool,
    /// `true`: the scene may refer to files outside of its own folder.
    pub allow_outside: bool,
    /// Further folders whose files the scene may refer to, whether by `..`, by an absolute path, or by a symbolic link.
    pub asset_roots: Vec<PathBuf>,
    /// `true`: the camera sees through back faces of glTF materials that are not `doubleSided`, as in the specification
    /// (2.0, section 3.9.6). `false`: it sees all surfaces from both sides. Light hits both sides in either case.
    pub cull_backfaces: bool,
    /// `true`: a scene with unsupported features is an error. `false`: they are replaced, with a warning.
    pub strict: bool,
    /// Names and values of scene parameters that override those of the file (Mitsuba's `$name`).
    pub defines: Vec<(String, String)>,
    /// Maximal number of pixels of a picture. Checked by its header, before it is decoded.
    pub max_image_pixels: u64,
    /// Maximal memory of the scene's files, meshes, instances, pictures and grids together, in bytes.
    pub max_memory_bytes: usize,
}

impl Default for LoadOptions {
    fn default() -> Self {
        Self {
            environment: None,
            environment_rotation: 0.0,
            environment_intensity: 1.0,
            at: None,
            shutter: None,
            animation: None,
            variant: None,
            subdivision: None,
            displacement: None,
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
    /// Returns the chosen shutter in the time of the file; `None`: that of the file.
    pub(crate) fn open_shutter(&self) -> Option<Shutter> {
        let at = f64::from(self.at.unwrap_or(0.0));
        self.shutter.map(|shutter| Shutter { open: at + shutter.open, close: at + shutter.close, ..shutter })
    }

    /// Adds the options that change the scene to its digest.
    pub(crate) fn add_choices(&self, digest: &mut blake3::Hasher) {
        if let Some(at) = self.at {
            digest.update(b"at").update(&at.to_le_bytes());
        }
        if let Some(Shutter { open, close, ramp }) = self.shutter {
            digest.update(b"shutter");
            [open, close, ramp].iter().for_each(|number| _ = digest.update(&number.to_le_bytes()));
        }
        for (what, choice) in [("animation", &self.animation), ("variant", &self.variant)] {
            if let Some(choice) = choice {
                digest.update(what.as_bytes()).update(&(choice.len() as u64).to_le_bytes()).update(choice.as_bytes());
            }
        }
        if let Some(level) = self.subdivision {
            digest.update(b"subdivision").update(&[level]);
        }
        if let Some(level) = self.displacement {
            digest.update(b"displacement").update(&[level]);
        }
        if self.cull_backfaces {
            digest.update(b"cull backfaces");
        }
        for text in self.defines.iter().flat_map(|(name, value)| [name, value]) {
            digest.update(b"define").update(&(text.len() as u64).to_le_bytes()).update(text.as_bytes());
        }
    }
}
