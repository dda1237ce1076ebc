//! The manual: its generated pages, and the book.

mod models;

use std::{
    fs,
    path::{Path, PathBuf},
    process::Command,
};

use anyhow::{Context, Result, ensure};

use crate::{
    bars::root,
    cargo,
    links::{links, pages, plain},
    python,
};

/// Options of `cargo xtask manual`.
#[derive(clap::Args)]
pub(crate) struct ManualArgs {
    /// Make the book, too: `target/manual/index.html`. mdBook is installed into `target/python` if it is missing.
    #[arg(long)]
    book: bool,
    /// Render the pictures of surfaces, lights, media and integrators again, too. Some minutes.
    #[arg(long)]
    pictures: bool,
}

/// Regenerates the pages that come from the program.
///
/// # Errors
/// The program does not compile, a page cannot be written, or mdBook is missing for the book.
pub(crate) fn manual(args: &ManualArgs) -> Result<()> {
    // Use the features of the whole workspace, so that little is compiled twice.
    let mut build = cargo::command();
    build.args(["build", "--workspace", "--bin", "bottega"]).current_dir(root());
    ensure!(build.status().context("cannot start cargo")?.success(), "the program does not compile");
    for (part, page) in [("commands", "docs/reference/commands.md"), ("request", "docs/reference/request.md")] {
        let mut program = Command::new(root().join("target/debug/bottega"));
        let output = program.args(["manual", part]).output().context("cannot start the program")?;
        ensure!(output.status.success(), "`bottega manual {part}`: {}", String::from_utf8_lossy(&output.stderr));
        fs::write(root().join(page), output.stdout).with_context(|| format!("cannot write {page}"))?;
        println!("{page}");
    }
    fs::write(root().join(models::PAGE), models::page()?).with_context(|| format!("cannot write {}", models::PAGE))?;
    println!("{}", models::PAGE);
    if args.pictures {
        models::render_pictures(&root().join("target/debug/bottega"))?;
    }
    if !args.book {
        return Ok(());
    }
    ensure!(mdbook().is_some() || python::TESTS.install(), "mdbook cannot be installed into target/python");
    book()
}

/// Returns the program mdBook: that of this machine, or that of the tests' Python environment.
fn mdbook() -> Option<PathBuf> {
    [PathBuf::from("mdbook"), python::program("mdbook")].into_iter().find(|program| python::works(program))
}

/// Builds the book from a copy of `docs/`, to which the files of the repository that pages link to are added.
fn book() -> Result<()> {
    let mdbook = mdbook().context("there is no mdbook: `cargo xtask test` installs it")?;
    let place = root().join("target/manual-source");
    if place.exists() {
        fs::remove_dir_all(&place)?;
    }
    copy(&root().join("docs"), &place)?;
    for page in pages(&place) {
        let inner = page.strip_prefix(&place)?;
        let text = fs::read_to_string(&page)?;
        fs::write(&page, with_outer_files(&text, inner, &place)?)?;
    }
    let target = root().join("target/manual");
    let mut mdbook = Command::new(mdbook);
    mdbook.arg("build").arg("--dest-dir").arg(&target).arg(&place);
    ensure!(mdbook.status()?.success(), "mdbook failed");
    println!("{}", target.join("index.html").display());
    Ok(())
}

/// Returns the text of a page with links out of `docs/` replaced by links to copies that a browser shows as text.
///
/// - `page`: relative to `docs/`.
/// - `place`: the folder for the copies, below `repository/`.
fn with_outer_files(text: &str, page: &Path, place: &Path) -> Result<String> {
    let folder = Path::new("docs").join(page.parent().context("a page has a folder")?);
    let mut text = text.to_owned();
    for link in links(&text.clone()) {
        let file = plain(&folder.join(&link.file));
        if link.file.is_empty() || file.starts_with("docs") {
            continue;
        }
        let source = root().join(&file);
        let source = if source.is_dir() { source.join("README.md") } else { source };
        if !source.is_file() {
            continue;
        }
        let name = PathBuf::from("repository").join(format!("{}.txt", source.strip_prefix(root())?.display()));
        let target = place.join(&name);
        fs::create_dir_all(target.parent().context("a copy has a folder")?)?;
        fs::copy(&source, &target)?;
        let up = "../".repeat(page.components().count() - 1);
        text = text.replace(&format!("]({})", link.text), &format!("]({up}{})", name.display()));
    }
    Ok(text)
}

fn copy(from: &Path, to: &Path) -> Result<()> {
    fs::create_dir_all(to)?;
    for entry in fs::read_dir(from)? {
        let entry = entry?;
        let target = to.join(entry.file_name());
        if entry.path().is_dir() {
            copy(&entry.path(), &target)?;
        } else {
            fs::copy(entry.path(), target)?;
        }
    }
    Ok(())
}

#[cfg(test)]
#[allow(clippy::print_stdout, reason = "what was skipped, and why, is read from what tests print")]
mod tests {
    use super::*;

    #[test]
    fn the_book_can_be_made() {
        if mdbook().is_none() {
            println!("skipped: there is no mdbook; contents and links of the manual are checked without it");
            return;
        }
        book().expect("a book");
        assert!(root().join("target/manual/tutorials/first-picture.html").is_file());
    }

    #[test]
    fn links_out_of_the_book_lead_to_copies_in_it() {
        let place = tempfile::tempdir().expect("a folder");
        let page = "[a](../../README.md#install) [b](../render.md) [c](../../bench)";
        let text = with_outer_files(page, Path::new("guides/scenes.md"), place.path()).expect("a page");
        assert_eq!(text, "[a](../repository/README.md.txt) [b](../render.md) [c](../repository/bench/README.md.txt)");
        assert!(place.path().join("repository/bench/README.md.txt").is_file());
    }
}
