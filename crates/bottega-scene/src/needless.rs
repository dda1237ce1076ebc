//! Parameters of scene files that have no effect here, each with a reason.
//!
//! Every parameter of a scene file is used, or reported as unsupported (an error with `--strict`), or listed in one of
//! these tables. Readers record which parameters they read and report the others, so a known parameter without effect
//! needs an entry.

/// The reason for which a parameter has no effect.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Reason {
    /// The parameter controls how the file's renderer estimates the picture: random numbers, path termination, caches.
    Estimate,
    /// The parameter controls how the file's renderer stores the picture or reads files; command options do that here.
    Storage,
    /// The parameter has no meaning with the other parameters given: the aperture of a pinhole, the time of a static scene.
    Meaningless,
    /// The parameter affects only spectral or polarized rendering.
    Spectra,
}

/// Parameters of some plugins or types that have no effect.
#[derive(Clone, Copy, Debug)]
pub(crate) struct NeedlessParameters<Kind> {
    /// Kind of the plugins, such as sensors.
    pub(crate) kind: Kind,
    /// Names of plugins or types; empty: all of the kind.
    pub(crate) of: &'static [&'static str],
    /// Names of the parameters; empty: all that are not read.
    pub(crate) names: &'static [&'static str],
    /// The reason; documented in `docs/guides/scenes.md`.
    #[cfg_attr(not(test), expect(dead_code, reason = "for readers of the table and the test of the manual"))]
    pub(crate) reason: Reason,
}

impl<Kind: PartialEq> NeedlessParameters<Kind> {
    /// Returns true if the list has the parameter of a plugin.
    pub(crate) fn covers(&self, kind: &Kind, plugin: &str, name: &str) -> bool {
        let is_of = |list: &[&str], name: &str| list.is_empty() || list.contains(&name);
        self.kind == *kind && is_of(self.of, plugin) && is_of(self.names, name)
    }
}

/// Checks that the manual's table lists all of them.
///
/// - `column`: column of the format in the table.
#[cfg(test)]
pub(crate) fn check_manual<Kind>(rows: &[NeedlessParameters<Kind>], column: usize) {
    let manual = include_str!("../../../docs/guides/scenes.md");
    let table = manual.split("## Parameters that change nothing").nth(1).expect("the manual has the table");
    let lines: Vec<&str> = table.lines().filter(|line| line.starts_with('|')).skip(2).collect();
    for row in rows {
        let cell = lines[row.reason as usize].split('|').nth(2 + column).expect("a column for each format");
        for name in row.names {
            assert!(cell.contains(&format!("`{name}`")), "{name} is not in the manual as {:?}", row.reason);
        }
        assert!(!row.names.is_empty() || cell.contains("all of samplers"), "{:?}", row.of);
    }
}
