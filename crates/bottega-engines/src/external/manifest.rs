//! Engine manifests: descriptions of external renderers, in a text format that users can write, too.
//!
//! A manifest is TOML; `docs/engines.md` lists its keys. All errors in one are reported here, with line and column, before
//! any engine is started.

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

/// The supported version of the format.
const FORMAT: u32 = 1;
/// The largest manifest that is read, in bytes.
const BYTES_MAX: usize = 1 << 20;
/// The longest name of an engine.
const NAME_MAX: usize = 40;

/// The way an engine is driven.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum EngineKind {
    /// A single process that keeps the scene open and renders window after window, controlled by lines of JSON.
    Worker,
    /// A process per window, controlled by its command line.
    Command,
}

/// The degree to which the pixels of a window are those of the whole frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Determinism {
    /// A window is bit-identical to that part of the whole frame, with the same seed and number of samples.
    Frame,
    /// The same window with the same seed is bit-identical.
    Window,
    /// Means and variances are reproducible, but not single values.
    Statistics,
}

/// The source of the list of files that a scene refers to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Refers {
    /// The worker lists them.
    Worker,
    /// Patterns in the text of the scene find them.
    Scan,
    /// None: a scene is a single file.
    #[default]
    None,
}

/// The source of the survey of a scene.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Importance {
    /// The engine renders a small picture.
    #[default]
    Engine,
    /// The built-in engine if it can read the file, or else the external engine.
    Builtin,
}

/// A step of the search for the engine on a machine.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SearchStep {
    /// The environment variable with the path of the program, which is tried first; `None`: there is none.
    pub variable: Option<String>,
    /// Programs to look for in `PATH`, or their absolute paths, in this order.
    pub programs: Vec<String>,
    /// The command that prints the version, and fails if the engine is not installed.
    pub check: Vec<Argument>,
    /// The pattern for the version in the output of `check`: group 1.
    pub version: Pattern,
    /// The command that starts the worker (`kind = "worker"`).
    #[serde(default)]
    pub command: Vec<Argument>,
    /// The values of environment variables to set in the child, by their names.
    #[serde(default)]
    pub environment: BTreeMap<String, String>,
    /// Names of further environment variables that the child inherits, where set.
    #[serde(default)]
    pub inherit: Vec<String>,
    /// Names of environment variables that list files and folders which the child may write in addition to its scratch folder.
    #[serde(default)]
    pub writes: Vec<String>,
}

/// The scene files that the engine supports.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SceneFiles {
    /// File extensions, in lower case, without the period.
    pub extensions: Vec<String>,
    /// The source of the list of files that a scene refers to.
    #[serde(default)]
    pub refers: Refers,
    /// Patterns for references; group 1 is a path.
    #[serde(default)]
    pub scan: Vec<Pattern>,
    /// Extensions of referenced files that are searched for further references.
    #[serde(default)]
    pub scan_in: Vec<String>,
    /// The source of the survey.
    #[serde(default)]
    pub importance: Importance,
}

/// The ranges of the farm's settings that the engine supports. `None`: unsupported.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TunableRanges {
    /// Samples per pixel.
    pub samples: Option<Range>,
    /// The most bounces after the direct light at the first surface.
    pub max_depth: Option<Range>,
    /// Light samples per path vertex.
    pub light_samples: Option<Range>,
    /// Seconds per window.
    pub time: Option<Range>,
}

/// The color space of the output.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
pub enum ColorSpace {
    /// Linear light, with the primaries of Rec. 709.
    #[serde(rename = "linear-rec709")]
    LinearRec709,
    /// Encoded with the sRGB curve, as 8- and 16-bit files are.
    #[serde(rename = "srgb")]
    Srgb,
}

/// The part of the frame that an output file shows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum FramePart {
    /// The whole frame; the window is cropped from it.
    #[default]
    Frame,
    /// The window alone.
    Window,
}

/// The position of the first row of an output file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum FirstRow {
    /// At the top.
    #[default]
    Top,
    /// At the bottom.
    Bottom,
}

/// The form of the engine's output.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Pixels {
    /// The color space.
    pub color_space: ColorSpace,
    /// The part of the frame (`kind = "command"`; workers report it).
    #[serde(default)]
    pub window: FramePart,
    /// The position of the first row.
    #[serde(default)]
    pub first_row: FirstRow,
    /// The pixel filter that the engine uses, for display.
    pub filter: Option<String>,
}

/// The overhead of rendering, apart from samples. Zones of engines with expensive windows are not profiled.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Cost {
    /// Seconds to start and to open a small scene.
    pub start_seconds: f64,
    /// Seconds per window, without its samples.
    pub window_seconds: f64,
    /// True if several processes of one thread each are faster than one of all threads.
    pub parallel: bool,
}

/// Limits of the engine's processes. 0: no limit.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Limits {
    /// Seconds until the worker is ready.
    pub start_seconds: f64,
    /// Seconds until the scene is open.
    pub open_seconds: f64,
    /// Seconds without output while the engine renders.
    pub silence_seconds: f64,
    /// Seconds per window.
    pub zone_seconds: f64,
    /// Memory of all processes of the engine, in MiB.
    pub memory_mib: u64,
    /// Size of the engine's log, in KiB.
    pub log_kib: u64,
    /// Size of a file that the engine writes, in MiB.
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

/// Returns a limit in seconds as a duration; `None` for 0 and invalid values: no limit.
pub fn limit(seconds: f64) -> Option<Duration> {
    Duration::try_from_secs_f64(seconds).ok().filter(|time| !time.is_zero())
}

/// The command line of an engine with one process per window.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Invocation {
    /// The program and its arguments.
    pub run: Vec<Argument>,
    /// The name of the output file in the scratch folder.
    pub output: String,
    /// The command that prints width and height of the scene; empty: there is none, and 1280 × 720 pixels are assumed.
    #[serde(default)]
    pub size: Vec<Argument>,
}

/// The form of progress messages in the engine's log.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ProgressText {
    /// The pattern of a progress message. With one group: per cent; with two groups: done, total.
    pub pattern: Pattern,
}

/// The form of error messages in the engine's log.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ErrorText {
    /// Patterns of lines that explain a failure; group 1 is shown if there is one.
    #[serde(default)]
    pub patterns: Vec<Pattern>,
}

/// The animation features of the engine.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Animation {
    /// True if the engine accepts a frame number.
    pub frames: bool,
}

/// The manifest of an engine.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Manifest {
    /// The version of the format.
    pub manifest: u32,
    /// The name of the engine in options.
    pub name: String,
    /// The display name of the engine.
    pub title: String,
    /// The way in which the engine is driven.
    pub kind: EngineKind,
    /// A one-line description.
    pub about: Option<String>,
    /// Scripts of the engine, beside the manifest.
    #[serde(default)]
    pub files: Vec<String>,
    /// The file, beside the manifest, with the rules that choose its settings when a picture is optimized; `None`: those of
    /// the built-in path tracer.
    pub rules: Option<String>,
    /// The degree to which windows equal the frame.
    pub determinism: Determinism,
    /// True if another seed gives other noise, so that passes can be added up.
    pub seeds: bool,
    /// The steps to find the engine.
    pub find: Vec<SearchStep>,
    /// The supported versions.
    #[serde(default)]
    pub versions: Versions,
    /// Install instructions, by operating system or Linux distribution (its `ID`); `any` is required.
    pub install: BTreeMap<String, String>,
    /// The supported scene files.
    pub scene: SceneFiles,
    /// The supported tunables.
    #[serde(default)]
    pub tunables: TunableRanges,
    /// The form of the engine's output.
    pub pixels: Pixels,
    /// The overhead of windows.
    #[serde(default)]
    pub cost: Cost,
    /// The limits of the engine's processes.
    #[serde(default)]
    pub limits: Limits,
    /// The form of the engine's progress messages.
    pub progress: Option<ProgressText>,
    /// The form of the engine's error messages.
    #[serde(default)]
    pub errors: ErrorText,
    /// The command line (`kind = "command"`).
    pub command: Option<Invocation>,
    /// The animation features of the engine.
    #[serde(default)]
    pub animation: Animation,
    /// Parameters passed to a worker, by their names; the user may change their values.
    #[serde(default)]
    pub parameters: BTreeMap<String, serde_json::Value>,
}

/// An error in a manifest, with its position.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{problem} ({}:{line}:{column})", .path.display())]
pub struct ManifestError {
    /// The path of the file.
    pub path: PathBuf,
    /// The problem, for display.
    pub problem: String,
    /// The line, from 1.
    pub line: usize,
    /// The column, from 1, in characters.
    pub column: usize,
    /// The byte range of the text that is wrong.
    pub span: std::ops::Range<usize>,
    /// The whole text of the manifest; empty if it is too large or cannot be read.
    pub text: String,
}

impl Manifest {
    /// Parses a manifest and checks it.
    ///
    /// - `path`: the path for errors; its file stem must be the name of the engine.
    ///
    /// # Errors
    /// The text is larger than 1 MiB, or invalid: with line and column.
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

    /// Checks what the types cannot express. Returns the wrong key and the problem.
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
            return Err(("find", "a table [[find]] is needed, which says how the engine is found".to_owned()));
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
                Err(("refers", "there is no worker that lists files: use `scan` or `none`".to_owned()))
            }
            (EngineKind::Command, Some(command)) => command.check(),
        }
    }

    /// Returns true if the engine supports scenes with the file extension of `scene`, in upper or lower case.
    pub fn takes(&self, scene: &std::path::Path) -> bool {
        let extension = scene.extension().map(|it| it.to_string_lossy().to_lowercase()).unwrap_or_default();
        self.scene.extensions.contains(&extension)
    }

    /// Returns true if passes with different seeds add up to one picture.
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
            return Err(("run", "the engine does not know where to write: {output} is missing".to_owned()));
        }
        Ok(())
    }
}

/// Returns the byte range of a key in the text: the first line that begins with it, or with its table.
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
