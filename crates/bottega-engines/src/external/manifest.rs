//! Engine manifests: what Bottega knows of a renderer that it did not write, as text that a user can write too.
//!
//! A manifest is TOML; `docs/engines.md` lists its keys. Everything that can be wrong with one is found out here, with
//! line and column, before any engine is started.

mod number;
mod pattern;
mod template;

use std::{collections::BTreeMap, path::PathBuf, time::Duration};

use bottega_scene::objects_only::ObjectsOnly;
use serde::Deserialize;

pub use self::{
    number::{Range, Version, Versions},
    pattern::Pattern,
    template::{Argument, Missing, Template, Values},
};

/// Version of the format that is read.
const FORMAT: u32 = 1;
/// The largest manifest that is read.
const BYTES_MAX: usize = 1 << 20;
/// The longest name of an engine.
const NAME_MAX: usize = 40;

/// The way an engine is driven.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum EngineKind {
    /// One process that keeps the scene and paints window after window, told by lines of JSON.
    Worker,
    /// One process a window, told by its command line.
    Command,
}

/// The degree to which the pixels of a window are those of the whole frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Determinism {
    /// A window has the bits that the whole frame has there, with the same seed and number of samples.
    Frame,
    /// The same window with the same seed has the same bits.
    Window,
    /// Only means and variances are the same.
    Statistics,
}

/// The source of the list of files that a scene refers to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Refers {
    /// The worker is asked.
    Worker,
    /// They are found by patterns in the text of the scene.
    Scan,
    /// A scene is one file.
    #[default]
    None,
}

/// The maker of the survey of a scene.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Importance {
    /// The engine paints a tiny picture.
    #[default]
    Engine,
    /// The built-in Analyst where it reads the file, else the engine.
    Builtin,
}

/// One way to find the engine on a machine.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SearchStep {
    /// Environment variable that names the program.
    pub variable: Option<String>,
    /// Programs to look for, in this order.
    pub programs: Vec<String>,
    /// Prints the version, and fails where the engine is not.
    pub check: Vec<Argument>,
    /// Finds the version in what `check` prints: group 1.
    pub version: Pattern,
    /// Starts the worker.
    #[serde(default)]
    pub command: Vec<Argument>,
    /// Set in the child.
    #[serde(default)]
    pub environment: BTreeMap<String, String>,
    /// Passed on to the child where the user has set them.
    #[serde(default)]
    pub inherit: Vec<String>,
    /// Variables of the user that name files and folders which it may write beside its scratch folder.
    #[serde(default)]
    pub writes: Vec<String>,
}

/// The scene files that the engine takes.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SceneFiles {
    /// Extensions, lower case, without the dot.
    pub extensions: Vec<String>,
    /// Who tells what a scene refers to.
    #[serde(default)]
    pub refers: Refers,
    /// Patterns whose group 1 is a path.
    #[serde(default)]
    pub scan: Vec<Pattern>,
    /// Extensions of files that are scanned too.
    #[serde(default)]
    pub scan_in: Vec<String>,
    /// Who makes the survey.
    #[serde(default)]
    pub importance: Importance,
}

/// The settings of the farm that the engine has. What is missing it has not.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TunableRanges {
    /// Samples a pixel.
    pub samples: Option<Range>,
    /// Bounces after the first surface's direct light.
    pub max_depth: Option<Range>,
    /// Light samples a path vertex.
    pub light_samples: Option<Range>,
    /// Seconds a window.
    pub time: Option<Range>,
}

/// Colour space of the pixels that come out.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
pub enum ColorSpace {
    /// Linear light, primaries of Rec. 709.
    #[serde(rename = "linear-rec709")]
    LinearRec709,
    /// Encoded by the sRGB curve, as 8- and 16-bit files are.
    #[serde(rename = "srgb")]
    Srgb,
}

/// The part of the frame that a picture of the engine shows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum FramePart {
    /// All of it; the window is cut out.
    #[default]
    Frame,
    /// The window alone.
    Window,
}

/// The place of the first row of a picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum FirstRow {
    /// At the top.
    #[default]
    Top,
    /// At the bottom.
    Bottom,
}

/// The form of pixels in a picture of the engine.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Pixels {
    /// Their colour space.
    pub color_space: ColorSpace,
    /// What part of the frame they are (`kind = "command"`; workers say so themselves).
    #[serde(default)]
    pub window: FramePart,
    /// Where their first row is.
    #[serde(default)]
    pub first_row: FirstRow,
    /// Which pixel filter it uses, in words.
    pub filter: Option<String>,
}

/// The cost of painting beside the samples: zones are made large enough by it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Cost {
    /// Start and opening of a small scene, in seconds.
    pub start_seconds: f64,
    /// A window beside its samples, in seconds.
    pub window_seconds: f64,
    /// Whether several processes of one thread each do more than one of all threads.
    pub parallel: bool,
}

/// Limits of the engine's processes. 0: no limit.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Limits {
    /// Seconds until it is ready.
    pub start_seconds: f64,
    /// Seconds until the scene is open.
    pub open_seconds: f64,
    /// Seconds in which it says nothing while it paints.
    pub silence_seconds: f64,
    /// Seconds of one window.
    pub zone_seconds: f64,
    /// Memory of all its processes, in MiB.
    pub memory_mib: u64,
    /// What it may write to its log, in KiB.
    pub log_kib: u64,
    /// The largest file that it may write, in MiB.
    pub output_mib: u64,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            start_seconds: 60.0,
            open_seconds: 600.0,
            silence_seconds: 300.0,
            zone_seconds: 86_400.0,
            memory_mib: 0,
            log_kib: 4096,
            output_mib: 4096,
        }
    }
}

/// A limit in seconds as a duration; 0 and what is no number mean: none.
pub fn limit(seconds: f64) -> Option<Duration> {
    Duration::try_from_secs_f64(seconds).ok().filter(|time| !time.is_zero())
}

/// The command line of an engine of one process a window.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Invocation {
    /// Program and arguments.
    pub run: Vec<Argument>,
    /// Name of the picture in the scratch folder.
    pub output: String,
    /// Prints width and height of the scene.
    #[serde(default)]
    pub size: Vec<Argument>,
}

/// The form of progress in the engine's log.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ProgressText {
    /// Group 1: per cent; with two groups: done, of.
    pub pattern: Pattern,
}

/// The form of errors in the engine's log.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ErrorText {
    /// Lines that say what is wrong; group 1 where there is one.
    #[serde(default)]
    pub patterns: Vec<Pattern>,
}

/// The engine's use of time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Animation {
    /// Whether it takes the number of a frame.
    pub frames: bool,
}

/// The manifest of an engine: all that is known of it.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Manifest {
    /// Version of the format.
    pub manifest: u32,
    /// What it is called in options.
    pub name: String,
    /// What people call it.
    pub title: String,
    /// How it is driven.
    pub kind: EngineKind,
    /// A line about it.
    pub about: Option<String>,
    /// Scripts that belong to it, beside the manifest.
    #[serde(default)]
    pub files: Vec<String>,
    /// Rules by which its settings are chosen where a picture is optimized: a file beside the manifest; `None`: those of our
    /// own path tracer.
    pub rules: Option<String>,
    /// How far windows are the frame.
    pub determinism: Determinism,
    /// Whether another seed gives other noise, so that passes add up.
    pub seeds: bool,
    /// Ways to find it.
    pub find: Vec<SearchStep>,
    /// Versions that are known to work.
    #[serde(default)]
    pub versions: Versions,
    /// How it is installed, by system.
    pub install: BTreeMap<String, String>,
    /// Which files it takes.
    pub scene: SceneFiles,
    /// Which tunables it has.
    #[serde(default)]
    pub tunables: TunableRanges,
    /// How pixels come out.
    pub pixels: Pixels,
    /// What windows cost.
    #[serde(default)]
    pub cost: Cost,
    /// What it may take.
    #[serde(default)]
    pub limits: Limits,
    /// How it tells its progress.
    pub progress: Option<ProgressText>,
    /// How it tells errors.
    #[serde(default)]
    pub errors: ErrorText,
    /// How it is started for a window.
    pub command: Option<Invocation>,
    /// What it knows of time.
    #[serde(default)]
    pub animation: Animation,
    /// Passed to a worker as they are.
    #[serde(default)]
    pub parameters: BTreeMap<String, serde_json::Value>,
}

/// Why a manifest is none.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{problem} ({}:{line}:{column})", .path.display())]
pub struct ManifestError {
    /// The file.
    pub path: PathBuf,
    /// What is wrong.
    pub problem: String,
    /// Line, from 1.
    pub line: usize,
    /// Column, from 1, in characters.
    pub column: usize,
    /// The bytes of the text that are meant.
    pub span: std::ops::Range<usize>,
    /// The whole text.
    pub text: String,
}

impl Manifest {
    /// Reads a manifest.
    ///
    /// - `path`: stands in errors; its file stem must be the engine's name.
    ///
    /// # Errors
    /// With line and column, whatever is wrong with the text.
    pub fn parse(path: &std::path::Path, text: &str) -> Result<Self, ManifestError> {
        let wrong = |span: std::ops::Range<usize>, problem: String| {
            let before = text.get(..span.start).unwrap_or(text);
            let line = before.matches('\n').count() + 1;
            let column = before.rsplit('\n').next().unwrap_or_default().chars().count() + 1;
            ManifestError { path: path.to_owned(), problem, line, column, span, text: text.to_owned() }
        };
        if text.len() > BYTES_MAX {
            return Err(ManifestError { text: String::new(), ..wrong(0..0, "it is larger than 1 MiB".to_owned()) });
        }
        let manifest: Self = toml::Deserializer::parse(text)
            .and_then(|parsed| Self::deserialize(ObjectsOnly(parsed)))
            .map_err(|error| wrong(error.span().unwrap_or(0..0), error.message().trim_end().to_owned()))?;
        manifest.check(path).map_err(|(key, problem)| wrong(place_of(text, key), problem))?;
        Ok(manifest)
    }

    /// What the types do not say. The key that is meant, and what is wrong with it.
    fn check(&self, path: &std::path::Path) -> Result<(), (&'static str, String)> {
        if self.manifest != FORMAT {
            let problem = format!("format {} is not read, only {FORMAT}: it may need a newer bottega", self.manifest);
            return Err(("manifest", problem));
        }
        let is_plain = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-';
        let is_name = !self.name.is_empty() && self.name.len() <= NAME_MAX && self.name.chars().all(is_plain);
        if !is_name || self.name == crate::builtin::NAME {
            return Err((
                "name",
                format!("`{}` cannot be: a-z, 0-9 and - are allowed, and `builtin` is taken", self.name),
            ));
        }
        if path.file_stem().is_some_and(|stem| stem.to_string_lossy() != *self.name) {
            return Err(("name", format!("the file must be called `{}.toml`", self.name)));
        }
        if self.find.is_empty() {
            return Err(("find", "there must be a [[find]]: how else is the engine found?".to_owned()));
        }
        if self.find.iter().any(|way| way.check.is_empty()) {
            return Err(("check", "it must be a program and its arguments".to_owned()));
        }
        if self.find.iter().any(|way| !way.version.has_group()) {
            return Err(("version", "the pattern must have a group: the version".to_owned()));
        }
        if !self.install.contains_key("any") {
            return Err(("install", "it needs the key `any`: how the engine is installed anywhere".to_owned()));
        }
        if self.scene.extensions.is_empty() {
            return Err(("extensions", "at least one is needed".to_owned()));
        }
        if self.scene.scan.iter().any(|pattern| !pattern.has_group()) {
            return Err(("scan", "each pattern must have a group: the path".to_owned()));
        }
        let is_beside = |name: &String| std::path::Path::new(name).components().count() == 1 && !name.starts_with('.');
        if let Some(name) = self.files.iter().find(|name| !is_beside(name)) {
            return Err(("files", format!("`{name}` must lie beside the manifest")));
        }
        if let Some(name) = self.rules.as_ref().filter(|name| !is_beside(name)) {
            return Err(("rules", format!("`{name}` must lie beside the manifest")));
        }
        let limits = [self.limits.start_seconds, self.limits.open_seconds, self.limits.silence_seconds];
        if limits.iter().chain([&self.limits.zone_seconds]).any(|seconds| !(0.0..=1e9).contains(seconds)) {
            return Err(("limits", "seconds must be from 0 to 1e9".to_owned()));
        }
        if ![self.cost.start_seconds, self.cost.window_seconds].iter().all(|seconds| (0.0..=1e6).contains(seconds)) {
            return Err(("cost", "seconds must be from 0 to 1e6".to_owned()));
        }
        match (self.kind, &self.command) {
            (EngineKind::Worker, Some(_)) => Err(("command", "a worker has none: it stands in [[find]]".to_owned())),
            (EngineKind::Worker, None) if self.find.iter().any(|way| way.command.is_empty()) => {
                Err(("find", "each needs `command`: how the worker is started".to_owned()))
            }
            (EngineKind::Worker, None) => Ok(()),
            (EngineKind::Command, None) => Err(("kind", "`command` needs the table [command]".to_owned())),
            (EngineKind::Command, Some(_)) if self.scene.refers == Refers::Worker => {
                Err(("refers", "there is no worker to ask: `scan` or `none`".to_owned()))
            }
            (EngineKind::Command, Some(command)) => command.check(),
        }
    }

    /// Whether it takes a file with this name.
    pub fn takes(&self, scene: &std::path::Path) -> bool {
        let extension = scene.extension().map(|it| it.to_string_lossy().to_lowercase()).unwrap_or_default();
        self.scene.extensions.contains(&extension)
    }

    /// Whether passes with other seeds add up to one picture.
    pub fn adds_up(&self) -> bool {
        self.seeds && self.determinism != Determinism::Frame
    }
}

impl Invocation {
    fn check(&self) -> Result<(), (&'static str, String)> {
        let path = std::path::Path::new(&self.output);
        if path.components().count() != 1 || path.extension().is_none() {
            return Err(("output", "it must be a plain file name such as out.exr".to_owned()));
        }
        if self.run.is_empty() {
            return Err(("run", "it must be a program and its arguments".to_owned()));
        }
        if !self.run.iter().any(|argument| argument.uses("output") || argument.uses("scratch")) {
            return Err(("run", "nothing tells the engine where to write: {output} is missing".to_owned()));
        }
        Ok(())
    }
}

/// Where a key stands in the text: the first line that begins with it, or its table.
fn place_of(text: &str, key: &str) -> std::ops::Range<usize> {
    let mut start = 0;
    for line in text.split_inclusive('\n') {
        let bare = line.trim_start();
        let inner = bare.trim_start_matches('[');
        let follows = inner.strip_prefix(key).map(str::trim_start);
        if follows.is_some_and(|rest| rest.starts_with('=') || rest.starts_with(']')) {
            let at = start + line.len() - bare.len();
            return at..at + bare.trim_end().len();
        }
        start += line.len();
    }
    0..0
}

#[cfg(test)]
mod tests;
