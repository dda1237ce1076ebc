//! Which build of the program this is. Pictures are the same bits for the same sources, compiled in the same way, alone: a
//! version's number says too little.
//!
//! What is compared is `NUMBER+SOURCES.SETTINGS`: the digest of the sources, and that of what of the settings of a build may change
//! a bit. How much a compiler optimizes does not, nor does the kind of processor.

use std::sync::LazyLock;

/// Hexadecimal digits of the digest of settings.
const SETTINGS_DIGITS: usize = 8;

const PROVENANCE: (&str, bool, &str, &str) = bottega_build::provenance!();

static IDENTITY: LazyLock<String> = LazyLock::new(|| {
    let (_, _, sources, compiler) = PROVENANCE;
    let (number, settings) = (env!("CARGO_PKG_VERSION"), settings(compiler));
    format!("{number}+{sources}.{settings}")
});

static DESCRIPTION: LazyLock<String> = LazyLock::new(|| with_commit(identity(), &commit()));

/// The identity of this build: two that have the same give the same bits.
pub(crate) fn identity() -> &'static str {
    &IDENTITY
}

/// The identity, and for people where the sources come from.
pub(crate) fn description() -> &'static str {
    &DESCRIPTION
}

/// The commit of the sources; empty where it is not known.
pub(crate) fn commit() -> String {
    match PROVENANCE {
        ("", ..) => String::new(),
        (commit, false, ..) => commit.to_owned(),
        (commit, true, ..) => format!("{commit} with changes"),
    }
}

/// An identity and a commit, as people are told of a build.
pub(crate) fn with_commit(identity: &str, commit: &str) -> String {
    if commit.is_empty() { identity.to_owned() } else { format!("{identity} (commit {commit})") }
}

/// In what two builds differ that are not the same.
pub(crate) fn difference(one: &str, other: &str) -> &'static str {
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
