//! Man pages.

use std::{fs, io, path::Path};

use clap::Command;
use clap_mangen::Man;

/// Writes a man page for the program and one per command. Returns their number.
///
/// # Errors
/// The folder cannot be created, or a page cannot be written.
pub(super) fn write(program: Command, folder: &Path) -> io::Result<usize> {
    fs::create_dir_all(folder)?;
    // Only the version number: the commit and compiler of a build do not belong in a page.
    let mut program = program.version(env!("CARGO_PKG_VERSION")).disable_help_subcommand(true);
    program.build();
    write_with_inner(&program, "bottega", folder)
}

/// - `name`: the name of the page, such as `bottega-jobs-list`.
fn write_with_inner(command: &Command, name: &str, folder: &Path) -> io::Result<usize> {
    let mut text = Vec::new();
    let page = Man::new(command.clone().display_name(name)).title(name.to_ascii_uppercase()).manual("Bottega");
    page.source(concat!("bottega ", env!("CARGO_PKG_VERSION"))).render(&mut text)?;
    fs::write(folder.join(format!("{name}.1")), text)?;
    let inner = command.get_subcommands().filter(|inner| !inner.is_hide_set());
    let counts = inner.map(|inner| write_with_inner(inner, &format!("{name}-{}", inner.get_name()), folder));
    counts.sum::<io::Result<usize>>().map(|count| count + 1)
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;
    use crate::cli::Cli;

    #[test]
    fn every_command_has_a_page() {
        let folder = tempfile::tempdir().expect("a folder");
        let count = write(Cli::command(), folder.path()).expect("pages");
        assert!(count > 50, "{count}");
        for (name, words) in [
            ("bottega.1", [".TH BOTTEGA 1", "bottega\\-render"]),
            ("bottega-jobs-list.1", [".TH BOTTEGA-JOBS-LIST 1", "\\-\\-json"]),
        ] {
            let text = fs::read_to_string(folder.path().join(name)).expect("a page");
            assert!(words.iter().all(|word| text.contains(word)), "{name}: {text}");
        }
    }
}
