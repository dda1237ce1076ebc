//! Errors and warnings of loading a scene.

use std::borrow::Cow;
use std::fmt;
use std::path::PathBuf;

use bottega_image::{printable, printable_path};

/// An error of loading a scene. `place` is a location within the file: a path through its JSON such as
/// `meshes[3].primitives[0].attributes.POSITION`, or empty.
#[derive(Debug, thiserror::Error)]
pub enum SceneError {
    /// The operating system cannot read a file.
    #[error("cannot read `{}`{}: check that the file exists and may be read", printable_path(path), requested_by(by))]
    Read {
        /// The file that cannot be read.
        path: PathBuf,
        /// The file and location that refers to it; empty if the user named it.
        by: String,
        /// The error of the operating system.
        source: std::io::Error,
    },
    /// The path leads to a folder, device or pipe.
    #[error("`{}`{} is {found}, not a file: name the file itself", printable_path(path), requested_by(by))]
    NotAFile {
        /// The path that is not a file.
        path: PathBuf,
        /// The file and location that refers to it; empty if the user named it.
        by: String,
        /// The kind of thing found, such as "a folder".
        found: &'static str,
    },
    /// An entry of [`LoadOptions::asset_roots`](crate::LoadOptions::asset_roots) is not a folder.
    #[error("`{}` is not a folder that can be read: name one with `--asset-root`", printable_path(path))]
    NotAFolder {
        /// The path that is not a folder.
        path: PathBuf,
    },
    /// Neither the extension nor the first bytes match a supported format.
    #[error(
        "`{}` is {found}: give a scene in a format that can be read (.gltf, .glb, .usd, .usda, .usdc, .usdz, .xml, .pbrt, .obj, .ply, .serialized, .vdb, .nvdb, .bottega)",
        printable_path(path)
    )]
    UnknownFormat {
        /// The file of unknown format.
        path: PathBuf,
        /// Guess from the first bytes, such as "a Blender file".
        found: String,
    },
    /// The file contradicts its format or its own header, for example because it was cut off or overwritten.
    #[error("`{}` is damaged: {problem}; copy or export it again", printable_path(path))]
    Damaged {
        /// The damaged file.
        path: PathBuf,
        /// The contradiction, and where it is.
        problem: String,
    },
    /// A scene file that Bottega wrote has another version of the format.
    #[error(
        "`{}` has version {found} of the format, and this Bottega reads version {known}: use the Bottega that wrote it, or \
         write the scene again",
        printable_path(path)
    )]
    OtherVersion {
        /// The scene file.
        path: PathBuf,
        /// The version of the file.
        found: u32,
        /// The version that can be read.
        known: u32,
    },
    /// The JSON text cannot be read as a glTF document.
    #[error("`{}`, line {line}, column {column}{}: {problem}; export the file again", printable_path(path), at(place))]
    Json {
        /// The file with the JSON text.
        path: PathBuf,
        /// Line, counted from 1.
        line: usize,
        /// Column, counted from 1.
        column: usize,
        /// Location in the document; empty at the top.
        place: String,
        /// Message of the parser.
        problem: String,
    },
    /// A text scene file is invalid.
    #[error("`{}`, line {line}, column {column}: {problem}", printable_path(path))]
    Text {
        /// The invalid text file.
        path: PathBuf,
        /// Line, counted from 1.
        line: usize,
        /// Column, counted from 1.
        column: usize,
        /// The error, and in some cases the remedy.
        problem: String,
    },
    /// The scene uses unsupported features and [`LoadOptions::strict`](crate::LoadOptions::strict) is set.
    #[error(
        "`{}` has unsupported features; remove them, or do without `--strict`:{}",
        printable_path(path),
        places.iter().map(|warning| format!("\n  {warning}")).collect::<String>()
    )]
    Unsupported {
        /// The scene file.
        path: PathBuf,
        /// The unsupported features and their locations.
        places: Vec<Warning>,
    },
    /// The file requires an unsupported extension.
    #[error("`{}`{} needs the extension {name}, which is not supported; {remedy}", printable_path(path), at(place))]
    UnsupportedExtension {
        /// The glTF file.
        path: PathBuf,
        /// Location that needs it; empty if the file lists it as required.
        place: String,
        /// Name of the extension.
        name: String,
        /// Advice to the user.
        remedy: &'static str,
    },
    /// The document is inconsistent or has an invalid value.
    #[error("`{}`{}: {problem}; export the file again, or repair it there", printable_path(path), at(place))]
    Invalid {
        /// The invalid file.
        path: PathBuf,
        /// Location in the document.
        place: String,
        /// The inconsistency or invalid value.
        problem: String,
    },
    /// The scene exceeds a limit of [`LoadOptions`](crate::LoadOptions) or of its importer.
    #[error("`{}`{}: {problem}; {remedy}", printable_path(path), at(place))]
    Limit {
        /// The scene file.
        path: PathBuf,
        /// Location in the document; may be empty.
        place: String,
        /// The excess, and the limit.
        problem: String,
        /// Advice to the user.
        remedy: &'static str,
    },
    /// A reference to a file that the scene may not read.
    #[error("`{}`{}: refuses to read `{uri}`: {reason}", printable_path(path), at(place))]
    ForbiddenReference {
        /// The file with the reference.
        path: PathBuf,
        /// Location of the reference.
        place: String,
        /// The reference, shortened.
        uri: String,
        /// The reason, and the remedy.
        reason: &'static str,
    },
    /// The options select a part that the file does not have.
    #[error("`{}` has no {what} `{}`; what it has: {}", printable_path(path), printable(wanted), printable(known))]
    NoSuch {
        /// The scene file.
        path: PathBuf,
        /// Kind of part, such as "animation".
        what: &'static str,
        /// The name or number selected.
        wanted: String,
        /// Numbers and names of the parts that exist.
        known: String,
    },
    /// A picture that is required, such as the environment, cannot be decoded.
    #[error("cannot decode the picture `{}`: {problem}", printable_path(path))]
    Picture {
        /// The picture file.
        path: PathBuf,
        /// The error of the decoder.
        problem: String,
    },
    /// A scene violates an invariant of the model; see [`Scene::validate`](crate::Scene::validate).
    #[error("{place}: {problem}")]
    Inconsistent {
        /// Part of the scene, such as `meshes[3]`.
        place: String,
        /// The invariant, and how it is violated.
        problem: String,
    },
}

fn requested_by(by: &str) -> String {
    if by.is_empty() { String::new() } else { format!(" (requested by {})", printable(by)) }
}

impl SceneError {
    /// Adds the referring file and location to an error of a file that is missing or too large.
    pub(crate) fn requested_by(self, requester: &str) -> Self {
        match self {
            Self::Read { path, by, source } if by.is_empty() => Self::Read { path, by: requester.into(), source },
            Self::NotAFile { path, by, found } if by.is_empty() => Self::NotAFile { path, by: requester.into(), found },
            Self::Limit { path, place, problem, remedy } if place.is_empty() => {
                Self::Limit { path, place: format!("requested by {requester}"), problem, remedy }
            }
            other => other,
        }
    }

    /// Adds the path of the scene file to an error that lacks it.
    pub(crate) fn in_file(self, path: &std::path::Path) -> Self {
        match self {
            Self::Inconsistent { place, problem } => Self::Invalid { path: path.into(), place, problem },
            other => other,
        }
    }
}

fn at(place: &str) -> String {
    if place.is_empty() { String::new() } else { format!(", {}", printable(place)) }
}

/// An invariant of the scene that is violated, as a clause about the part.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub(crate) struct Violation(pub(crate) Cow<'static, str>);

/// A finding about a scene that could still be read: a guess, an omission or a replacement. Text from the file is
/// escaped for terminals.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Warning {
    /// Location in the file; may be empty.
    pub place: String,
    /// The finding, and what was done about it.
    pub message: String,
    /// `true`: a feature of the file is left out or replaced.
    pub is_unsupported: bool,
}

impl Warning {
    fn new(place: impl Into<String>, message: impl Into<String>) -> Self {
        let fit = |text: String| printable(&text).into_owned();
        Self { place: fit(place.into()), message: fit(message.into()), is_unsupported: false }
    }
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.place.is_empty() { f.write_str(&self.message) } else { write!(f, "{}: {}", self.place, self.message) }
    }
}

/// Collects warnings, at most [`LIMIT`](Self::LIMIT): a damaged file of a million nodes must not make a million of
/// them.
#[derive(Debug, Default)]
pub(crate) struct Warnings {
    list: Vec<Warning>,
    left_out: usize,
    /// The warnings that report an unsupported feature.
    unsupported: Vec<Warning>,
}

impl Warnings {
    const LIMIT: usize = 200;

    /// Adds a warning, or counts it if there are too many.
    pub(crate) fn add(&mut self, place: impl Into<String>, message: impl Into<String>) {
        self.push(Warning::new(place, message));
    }

    fn push(&mut self, warning: Warning) {
        if self.list.len() < Self::LIMIT {
            self.list.push(warning);
        } else {
            self.left_out += 1;
        }
    }

    /// Reports a feature of the file that is left out or replaced: an error in strict mode.
    pub(crate) fn unsupported(&mut self, place: impl Into<String>, message: impl Into<String>) {
        let warning = Warning { is_unsupported: true, ..Warning::new(place, message) };
        if self.unsupported.len() < Self::LIMIT {
            self.unsupported.push(warning.clone());
        }
        self.push(warning);
    }

    /// Reports an unsupported feature in strict mode only; another warning already mentions it otherwise.
    pub(crate) fn unsupported_silently(&mut self, place: impl Into<String>, message: impl Into<String>) {
        if self.unsupported.len() < Self::LIMIT {
            self.unsupported.push(Warning::new(place, message));
        }
    }

    /// Takes the warnings of [`unsupported`](Self::unsupported).
    pub(crate) fn take_unsupported(&mut self) -> Vec<Warning> {
        std::mem::take(&mut self.unsupported)
    }

    /// Appends the warnings of another collector.
    pub(crate) fn append(&mut self, other: Self) {
        self.left_out += other.left_out;
        self.unsupported.extend(other.unsupported);
        other.list.into_iter().for_each(|warning| self.push(warning));
    }

    /// Returns the warnings, with a last one that counts those left out.
    pub(crate) fn finish(mut self) -> Vec<Warning> {
        if self.left_out > 0 {
            let message = format!("and {} more warnings like these", self.left_out);
            self.list.push(Warning::new("", message));
        }
        self.list
    }
}
