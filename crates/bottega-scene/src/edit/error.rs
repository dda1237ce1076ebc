//! Errors of edits.

use std::fmt;

use serde::Serialize;

/// The most keys that an error lists.
const KEYS_MAX: usize = 8;

/// The kinds of entry of a [`SceneEditor`](crate::SceneEditor). Each kind has keys of its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum EntryKind {
    /// A picture for textures.
    Image,
    /// A participating medium.
    Medium,
    /// A material.
    Material,
    /// A mesh, in object space.
    Mesh,
    /// A mesh placed in the world, once or many times.
    Object,
    /// A sphere that is not triangulated.
    Sphere,
    /// A light that is not an emissive surface; it may have an extent.
    Light,
    /// A camera.
    Camera,
}

impl fmt::Display for EntryKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Image => "image",
            Self::Medium => "medium",
            Self::Material => "material",
            Self::Mesh => "mesh",
            Self::Object => "object",
            Self::Sphere => "sphere",
            Self::Light => "light",
            Self::Camera => "camera",
        })
    }
}

/// The reason why an edit was refused. The scene is as it was before.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum EditError {
    /// There is no entry with this key.
    #[error("there is no {kind} `{key}`; {}", listed(*kind, known))]
    Unknown {
        /// The kind of the entry.
        kind: EntryKind,
        /// The unknown key.
        key: String,
        /// The keys that exist, for display; may be empty although there are some.
        known: Vec<String>,
    },
    /// The key is used already.
    #[error("the {kind} `{key}` exists already; choose another key, or replace it by assignment")]
    Taken {
        /// The kind of the entry.
        kind: EntryKind,
        /// The key that exists already.
        key: String,
    },
    /// The key is empty.
    #[error("the {kind} has an empty key; choose a name")]
    NoKey {
        /// The kind of the entry.
        kind: EntryKind,
    },
    /// Another entry refers to the one to be removed or changed.
    #[error("the {kind} `{key}` is used by the {user}; remove or change that first")]
    InUse {
        /// The kind of the entry.
        kind: EntryKind,
        /// The key of the entry that is in use.
        key: String,
        /// The entry that refers to it, for display.
        user: String,
    },
    /// An argument has a wrong value.
    #[error("`{argument}`{}: {problem}; {remedy}", row.map(|row| format!(", row {row}")).unwrap_or_default())]
    Argument {
        /// The name of the argument.
        argument: &'static str,
        /// The first wrong row of an array; `None`: the argument as a whole.
        row: Option<usize>,
        /// The problem, for display.
        problem: String,
        /// The remedy, for display.
        remedy: String,
    },
    /// A value cannot be rendered.
    #[error("the {kind} `{key}`: {problem}")]
    Value {
        /// The kind of the entry.
        kind: EntryKind,
        /// The key of the entry.
        key: String,
        /// The problem, for display.
        problem: String,
    },
    /// The environment cannot be rendered.
    #[error("the environment: {problem}")]
    Environment {
        /// The problem, for display.
        problem: String,
    },
}

impl EditError {
    /// Makes the error of an argument as a whole.
    pub(crate) fn argument(argument: &'static str, problem: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self::Argument { argument, row: None, problem: problem.into(), remedy: remedy.into() }
    }

    /// Makes the error of a row of an array.
    pub(crate) fn row(
        argument: &'static str,
        row: usize,
        problem: impl Into<String>,
        remedy: impl Into<String>,
    ) -> Self {
        Self::Argument { argument, row: Some(row), problem: problem.into(), remedy: remedy.into() }
    }

    /// Makes the error of a value that cannot be rendered.
    pub(crate) fn value(kind: EntryKind, key: &str, problem: &dyn std::fmt::Display) -> Self {
        Self::Value { kind, key: key.to_owned(), problem: problem.to_string() }
    }
}

/// Lists the keys that exist, the first of them if there are many.
fn listed(kind: EntryKind, known: &[String]) -> String {
    let first: Vec<String> = known.iter().take(KEYS_MAX).map(|key| format!("`{key}`")).collect();
    match known.len() {
        0 => format!("the scene has no {kind} yet"),
        count if count > KEYS_MAX => format!("the scene has {count}, such as {}", first.join(", ")),
        _ => format!("the scene has {}", first.join(", ")),
    }
}
