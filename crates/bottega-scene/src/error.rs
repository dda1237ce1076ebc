//! The errors between a path and a scene, and warnings that are worth telling.

use std::fmt;
use std::path::PathBuf;

use bottega_image::{printable, printable_path};

/// Why there is no scene. `place` is where in the file: a path through its JSON such as
/// `meshes[3].primitives[0].attributes.POSITION`.
#[derive(Debug, thiserror::Error)]
pub enum SceneError {
    /// The operating system would not give us the file.
    #[error("cannot read `{}`{}: check that the file exists and may be read", printable_path(path), asked_by(by))]
    Read {
        /// The file.
        path: PathBuf,
        /// The file and the place in it that refers to this one; empty where the user named it.
        by: String,
        /// Why not.
        source: std::io::Error,
    },
    /// The path leads to something that is no file.
    #[error("`{}`{} is {found}, not a file: name the file itself", printable_path(path), asked_by(by))]
    NotAFile {
        /// The path.
        path: PathBuf,
        /// The file and the place in it that refers to this one; empty where the user named it.
        by: String,
        /// What it is.
        found: &'static str,
    },
    /// A folder of [`LoadOptions::asset_roots`](crate::LoadOptions::asset_roots) is none.
    #[error("`{}` is no folder that can be read: name one with `--asset-root`", printable_path(path))]
    NotAFolder {
        /// The path.
        path: PathBuf,
    },
    /// Neither the name nor the first bytes are those of a format that we read.
    #[error(
        "`{}` is {found}: give a scene in a format that can be read (.gltf, .glb, .xml, .pbrt, .obj, .ply, .serialized)",
        printable_path(path)
    )]
    UnknownFormat {
        /// The file.
        path: PathBuf,
        /// What it seems to be.
        found: String,
    },
    /// The file contradicts its own header; it was cut off or overwritten.
    #[error("`{}` is damaged: {problem}; copy or export it again", printable_path(path))]
    Damaged {
        /// The file.
        path: PathBuf,
        /// What does not fit.
        problem: String,
    },
    /// The JSON text cannot be read as a glTF document.
    #[error("`{}`, line {line}, column {column}{}: {problem}; export the file again", printable_path(path), at(place))]
    Json {
        /// The file.
        path: PathBuf,
        /// Counted from 1.
        line: usize,
        /// Counted from 1.
        column: usize,
        /// Where in the document; empty at the top.
        place: String,
        /// What the parser says.
        problem: String,
    },
    /// A scene file that is text says something that cannot be.
    #[error("`{}`, line {line}, column {column}: {problem}", printable_path(path))]
    Text {
        /// The file.
        path: PathBuf,
        /// Counted from 1.
        line: usize,
        /// Counted from 1.
        column: usize,
        /// What is wrong, and where it helps what to do.
        problem: String,
    },
    /// The scene asks for what is not supported, and [`LoadOptions::strict`](crate::LoadOptions::strict) is set.
    #[error(
        "`{}` asks for what is not supported; remove it, or do without `--strict`:{}",
        printable_path(path),
        places.iter().map(|warning| format!("\n  {warning}")).collect::<String>()
    )]
    Unsupported {
        /// The file.
        path: PathBuf,
        /// Where, and what.
        places: Vec<Warning>,
    },
    /// The file cannot be understood without an extension that we do not have.
    #[error("`{}`{} needs the extension {name}, which is not supported; {remedy}", printable_path(path), at(place))]
    UnsupportedExtension {
        /// The file.
        path: PathBuf,
        /// Where it is needed; empty: the file says that it is required.
        place: String,
        /// The name of the extension.
        name: String,
        /// What to do.
        remedy: &'static str,
    },
    /// The document says something that cannot be.
    #[error("`{}`{}: {problem}; export the file again, or repair it there", printable_path(path), at(place))]
    Invalid {
        /// The file.
        path: PathBuf,
        /// Where.
        place: String,
        /// What.
        problem: String,
    },
    /// More than the limits of [`LoadOptions`](crate::LoadOptions) allow.
    #[error("`{}`{}: {problem}; {remedy}", printable_path(path), at(place))]
    Limit {
        /// The file.
        path: PathBuf,
        /// Where.
        place: String,
        /// What is too large, and the limit.
        problem: String,
        /// What to do.
        remedy: &'static str,
    },
    /// A reference to a file that the scene may not read.
    #[error("`{}`{}: refuses to read `{uri}`: {reason}", printable_path(path), at(place))]
    ForbiddenReference {
        /// The file.
        path: PathBuf,
        /// Where.
        place: String,
        /// The reference, shortened.
        uri: String,
        /// Why, and what to do.
        reason: &'static str,
    },
    /// The options ask for a part that the file does not have.
    #[error("`{}` has no {what} `{}`; what it has: {}", printable_path(path), printable(wanted), printable(known))]
    NoSuch {
        /// The file.
        path: PathBuf,
        /// Which kind of part.
        what: &'static str,
        /// What was asked for.
        wanted: String,
        /// Numbers and names of what there is.
        known: String,
    },
    /// A picture that cannot be done without, such as the environment.
    #[error("cannot decode the picture `{}`: {problem}", printable_path(path))]
    Picture {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        problem: String,
    },
    /// A scene breaks a promise of the model: see [`Scene::validate`](crate::Scene::validate).
    #[error("{place}: {problem}")]
    Inconsistent {
        /// Which part of the scene.
        place: String,
        /// Which promise, and how it is broken.
        problem: String,
    },
}

fn asked_by(by: &str) -> String {
    if by.is_empty() { String::new() } else { format!(" (asked for by {})", printable(by)) }
}

impl SceneError {
    /// Adds to what is said of a file that is not there or too large, which file and place asks for it.
    pub(crate) fn asked_by(self, asking: &str) -> Self {
        match self {
            Self::Read { path, by, source } if by.is_empty() => Self::Read { path, by: asking.into(), source },
            Self::NotAFile { path, by, found } if by.is_empty() => Self::NotAFile { path, by: asking.into(), found },
            Self::Limit { path, place, problem, remedy } if place.is_empty() => {
                Self::Limit { path, place: format!("asked for by {asking}"), problem, remedy }
            }
            other => other,
        }
    }

    /// The same error, with the file that the scene is of where it does not know it.
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

/// Something that the user should know though the scene was read. Names that the file chose are made fit for a terminal in it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Warning {
    /// Where in the file; may be empty.
    pub place: String,
    /// What was found, and what was done about it.
    pub message: String,
}

impl Warning {
    fn new(place: impl Into<String>, message: impl Into<String>) -> Self {
        let fit = |text: String| printable(&text).into_owned();
        Self { place: fit(place.into()), message: fit(message.into()) }
    }
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.place.is_empty() { f.write_str(&self.message) } else { write!(f, "{}: {}", self.place, self.message) }
    }
}

/// Warnings as they come in; a damaged file of a million nodes shall not make a million of them.
#[derive(Debug, Default)]
pub(crate) struct Warnings {
    list: Vec<Warning>,
    left_out: usize,
    /// Those of the list that tell of something which is not supported.
    unsupported: Vec<Warning>,
}

impl Warnings {
    const LIMIT: usize = 200;

    pub(crate) fn add(&mut self, place: impl Into<String>, message: impl Into<String>) {
        if self.list.len() < Self::LIMIT {
            self.list.push(Warning::new(place, message));
        } else {
            self.left_out += 1;
        }
    }

    /// Tells of something that the file asks for and that is left out or replaced: an error where the user is strict.
    pub(crate) fn unsupported(&mut self, place: impl Into<String>, message: impl Into<String>) {
        let warning = Warning::new(place, message);
        if self.unsupported.len() < Self::LIMIT {
            self.unsupported.push(warning.clone());
        }
        self.add(warning.place, warning.message);
    }

    /// Tells those who are strict alone: others are told in other words.
    pub(crate) fn unsupported_silently(&mut self, place: impl Into<String>, message: impl Into<String>) {
        if self.unsupported.len() < Self::LIMIT {
            self.unsupported.push(Warning::new(place, message));
        }
    }

    /// What [`unsupported`](Self::unsupported) was told.
    pub(crate) fn take_unsupported(&mut self) -> Vec<Warning> {
        std::mem::take(&mut self.unsupported)
    }

    pub(crate) fn append(&mut self, other: Self) {
        self.left_out += other.left_out;
        self.unsupported.extend(other.unsupported);
        other.list.into_iter().for_each(|warning| self.add(warning.place, warning.message));
    }

    pub(crate) fn finish(mut self) -> Vec<Warning> {
        if self.left_out > 0 {
            let message = format!("and {} more warnings like these", self.left_out);
            self.list.push(Warning { place: String::new(), message });
        }
        self.list
    }
}
