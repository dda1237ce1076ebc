//! Parameters that a file may give and that change no picture of ours, each with its reason.
//!
//! A parameter of a scene file is followed, or named in a warning that `--strict` refuses, or stands in a table of these: readers keep
//! account of what they asked for, and tell of the rest. So one that is known and does nothing has a reason, or is told.

/// Why a parameter changes nothing here.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Reason {
    /// It says how the renderer of the file estimates the picture: which numbers it draws, when paths end, what it keeps.
    Estimate,
    /// It says how the renderer of the file stores the picture, or what it reads; that is asked of the command.
    Storage,
    /// It has no meaning beside the others that are given: the aperture of a pinhole, the time of a scene that stands still.
    Meaningless,
    /// It tells of what only spectra or polarized light show.
    Spectra,
}

/// Parameters of some plugins or types that change nothing.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Needless<Kind> {
    /// What the plugins are for.
    pub(crate) kind: Kind,
    /// Names of plugins or types; none: all of the kind.
    pub(crate) of: &'static [&'static str],
    /// Names of the parameters; none: all that are not asked for.
    pub(crate) names: &'static [&'static str],
    /// Why. Told by the manual, see `docs/guides/scenes.md`.
    #[cfg_attr(not(test), expect(dead_code, reason = "it is for who reads the table, and for the test of the manual"))]
    pub(crate) reason: Reason,
}

impl<Kind: PartialEq> Needless<Kind> {
    /// Whether a parameter of a plugin is one of them.
    pub(crate) fn covers(&self, kind: &Kind, plugin: &str, name: &str) -> bool {
        let is_of = |list: &[&str], name: &str| list.is_empty() || list.contains(&name);
        self.kind == *kind && is_of(self.of, plugin) && is_of(self.names, name)
    }
}

/// Checks that the manual's table has all of them.
///
/// - `column`: that of the format.
#[cfg(test)]
pub(crate) fn check_manual<Kind>(rows: &[Needless<Kind>], column: usize) {
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
