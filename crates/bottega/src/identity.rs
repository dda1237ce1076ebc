//! The identity of this build. Pictures are the same bits for the same sources, compiled in the same way, alone: a
//! version's number says too little.
//!
//! What is compared is `NUMBER+SOURCES.SETTINGS`: the digest of the sources, and that of what of the settings of a build may change
//! a bit. How much a compiler optimizes does not, nor does the kind of processor.

use std::sync::LazyLock;

/// Hexadecimal digits of the digest of settings.
const SETTINGS_DIGITS: usize = 8;

/// From which sources something is built, as [`bottega_build::provenance`] tells it: commit, whether they differ from it, their
/// digest, and the compiler.
pub type Provenance = (&'static str, bool, &'static str, &'static str);

/// The crates that know this one change no picture; they are no part of its identity.
const PROVENANCE: Provenance =
    bottega_build::provenance!("bottega-cluster", "bottega-web", "bottega-python", "bottega-bench", "bottega-cli");

static BUILD: LazyLock<Build> = LazyLock::new(|| Build::new(PROVENANCE));

/// A build of a crate with all that it is made of.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Build {
    identity: String,
    commit: String,
    description: String,
}

impl Build {
    /// The build of these sources.
    pub fn new((commit, is_changed, sources, compiler): Provenance) -> Self {
        let (number, settings) = (env!("CARGO_PKG_VERSION"), settings(compiler));
        let commit = match (commit, is_changed) {
            ("", _) => String::new(),
            (commit, false) => commit.to_owned(),
            (commit, true) => format!("{commit} with changes"),
        };
        let identity = format!("{number}+{sources}.{settings}");
        let description = with_commit(&identity, &commit);
        Self { identity, commit, description }
    }

    /// Its identity: two that have the same give the same bits.
    pub fn identity(&self) -> &str {
        &self.identity
    }

    /// The commit of the sources; empty where it is not known.
    pub fn commit(&self) -> &str {
        &self.commit
    }

    /// The identity, and for people where the sources come from.
    pub fn description(&self) -> &str {
        &self.description
    }
}

/// The identity of this library: two that have the same give the same bits.
pub fn identity() -> &'static str {
    BUILD.identity()
}

/// An identity and a commit, as people are told of a build.
pub fn with_commit(identity: &str, commit: &str) -> String {
    if commit.is_empty() { identity.to_owned() } else { format!("{identity} (commit {commit})") }
}

/// In what two builds differ that are not the same.
pub fn difference(one: &str, other: &str) -> &'static str {
    let parts = |identity: &str| {
        let (number, build) = identity.split_once('+').unwrap_or((identity, ""));
        let (sources, settings) = build.split_once('.').unwrap_or((build, ""));
        [number, sources, settings].map(str::to_owned)
    };
    match (parts(one), parts(other)) {
        ([one, ..], [other, ..]) if one != other => "they are of different numbers",
        ([_, one, _], [_, other, _]) if one != other => "they are of one number, and built from different sources",
        _ => "they are built from the same sources, by another compiler or for other instructions",
    }
}

/// The digest of what of the build's settings may change a bit.
fn settings(compiler: &str) -> String {
    let wide = [
        ("fma", cfg!(target_feature = "fma")),
        ("avx2", cfg!(target_feature = "avx2")),
        ("avx512f", cfg!(target_feature = "avx512f")),
    ];
    let hash = blake3::hash(format!("{compiler}; {wide:?}").as_bytes());
    hash.to_hex()[..SETTINGS_DIGITS].to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_build_has_an_identity_of_number_sources_and_settings() {
        let (number, build) = identity().split_once('+').unwrap();
        let (sources, settings) = build.split_once('.').unwrap();
        assert_eq!(number, env!("CARGO_PKG_VERSION"));
        for (digest, digits) in [(sources, 12), (settings, SETTINGS_DIGITS)] {
            assert!(digest.len() == digits && digest.bytes().all(|byte| byte.is_ascii_hexdigit()), "{digest}");
        }
        assert_ne!(self::settings("rustc 1"), self::settings("rustc 2"));
    }

    #[test]
    fn what_differs_is_said() {
        for (one, other, words) in [
            ("0.1.0+a.b", "0.2.0+a.b", "numbers"),
            ("0.1.0+a.b", "0.1.0+c.b", "sources"),
            ("0.1.0", "0.1.0+c.b", "sources"),
            ("0.1.0+a.b", "0.1.0+a.c", "compiler"),
        ] {
            assert!(difference(one, other).contains(words), "{one} {other}");
        }
    }
}
