//! The identity of this build. Pictures are bit-identical only for the same sources compiled in the same way, so a version
//! number is not enough.
//!
//! An identity is `NUMBER+SOURCES.SETTINGS`: version number, digest of the sources, and digest of the build settings that can
//! change a bit. The optimization level and the kind of processor cannot.

use std::sync::LazyLock;

/// Number of hexadecimal digits of the settings' digest.
const SETTINGS_DIGITS: usize = 8;

/// The provenance of a build, from [`bottega_build::provenance`]: commit, true if the sources differ from it, digest of the
/// sources, compiler.
pub type Provenance = (&'static str, bool, &'static str, &'static str);

/// The listed crates depend on this one and cannot change a picture, so they are not part of its identity.
const PROVENANCE: Provenance =
    bottega_build::provenance!("bottega-cluster", "bottega-web", "bottega-python", "bottega-bench", "bottega-cli");

static BUILD: LazyLock<Build> = LazyLock::new(|| Build::new(PROVENANCE));

/// A build of a crate with all its dependencies.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Build {
    identity: String,
    commit: String,
    description: String,
}

impl Build {
    /// Makes a build from its provenance.
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

    /// Returns the identity: builds with the same identity give the same bits.
    pub fn identity(&self) -> &str {
        &self.identity
    }

    /// Returns the commit of the sources, with a note if they differ from it; empty: unknown.
    pub fn commit(&self) -> &str {
        &self.commit
    }

    /// Returns the identity with the commit, as readable text.
    pub fn description(&self) -> &str {
        &self.description
    }
}

/// Returns the identity of this library: builds with the same identity give the same bits.
pub fn identity() -> &'static str {
    BUILD.identity()
}

/// Returns an identity with its commit as readable text.
///
/// - `commit`: the commit; empty: unknown, and left out.
pub fn with_commit(identity: &str, commit: &str) -> String {
    if commit.is_empty() { identity.to_owned() } else { format!("{identity} (commit {commit})") }
}

/// Returns the difference of two builds with different identities as a clause of a message, such as "their version numbers
/// differ".
pub fn difference(one: &str, other: &str) -> &'static str {
    let parts = |identity: &str| {
        let (number, build) = identity.split_once('+').unwrap_or((identity, ""));
        let (sources, settings) = build.split_once('.').unwrap_or((build, ""));
        [number, sources, settings].map(str::to_owned)
    };
    match (parts(one), parts(other)) {
        ([one, ..], [other, ..]) if one != other => "their version numbers differ",
        ([_, one, _], [_, other, _]) if one != other => {
            "they have the same version number, but were built from different sources"
        }
        _ => "they were built from the same sources, by another compiler or for other instructions",
    }
}

/// Returns the digest of the build settings that can change a bit: compiler and SIMD features.
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
