//! A macro that expands to the identity of the sources of a program.
//!
//! It is a macro instead of a build script, so that it causes no rebuilds: the crate that expands it is compiled anyway when a
//! source of the program changes, and no other crate depends on it. A commit that changes no source rebuilds nothing; the program
//! then shows the commit at which it was compiled.
//!
//! # Modules
//!
//! | subject | files |
//! |---|---|
//! | the macro | `src/lib.rs` |
//! | the digest of the sources | `src/sources.rs` |
//! | the commit | `src/git.rs` |

mod git;
mod sources;

use std::{env, path::Path};

use proc_macro::TokenStream;

/// Expands to `(commit, is_changed, sources, compiler)`: the commit of the sources (empty without git), `true` if they differ
/// from it, their digest, and the version of the compiler. All are string literals, except for the `bool`. If a source cannot be
/// read, compilation fails with a message.
///
/// The crates named in the arguments are left out of the digest: those that depend on the expanding crate. It is not recompiled
/// when one of them changes.
#[proc_macro]
pub fn provenance(without: TokenStream) -> TokenStream {
    let without = without.to_string();
    let without: Vec<&str> = without.split(',').map(|name| name.trim().trim_matches('"')).collect();
    let source = tell(&without).unwrap_or_else(|problem| format!("compile_error!({problem:?})"));
    source.parse().expect("literals are tokens")
}

fn tell(without: &[&str]) -> Result<String, String> {
    let folder = env::var("CARGO_MANIFEST_DIR").map_err(|_| "this is compiled by cargo alone".to_owned())?;
    let root = Path::new(&folder).ancestors().nth(2).ok_or("the sources are in no workspace")?;
    let sources = sources::digest(root, without)?;
    let (commit, is_changed) = git::commit(root, &sources::PLACES).unwrap_or_default();
    let [manifest, lock] = ["Cargo.toml", "Cargo.lock"].map(|name| root.join(name).display().to_string());
    Ok(format!(
        "{{ const _: [&[u8]; 2] = [include_bytes!({manifest:?}), include_bytes!({lock:?})]; \
         ({commit:?}, {is_changed}, {sources:?}, {:?}) }}",
        env!("BOTTEGA_COMPILER")
    ))
}
