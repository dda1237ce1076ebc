//! Links of Markdown pages.

use std::{
    fs,
    path::{Component, Path, PathBuf},
};

/// A link to a place of this repository.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct PageLink {
    /// The link as written between the parentheses.
    pub(crate) text: String,
    /// The file, relative to the page's folder; empty: the page itself.
    pub(crate) file: String,
    /// The heading, without `#`; empty: the top.
    pub(crate) heading: String,
}

/// Returns the links of a page that lead to files or headings, except those in code.
pub(crate) fn links(page: &str) -> Vec<PageLink> {
    let prose = without_code(page);
    let places = prose.match_indices("](").filter_map(|(at, _)| prose[at + 2..].split(')').next());
    let is_here = |text: &&str| !text.contains("://") && !text.starts_with("mailto:") && !text.is_empty();
    places
        .filter(is_here)
        .map(|text| {
            let (file, heading) = text.split_once('#').unwrap_or((text, ""));
            PageLink { text: text.to_owned(), file: file.to_owned(), heading: heading.to_owned() }
        })
        .collect()
}

/// Returns a page without code blocks and inline code.
fn without_code(page: &str) -> String {
    let mut is_code = false;
    let mut prose = String::new();
    for line in page.lines() {
        if line.trim_start().starts_with("```") {
            is_code = !is_code;
        } else if !is_code {
            prose.extend(line.split('`').step_by(2));
            prose.push('\n');
        }
    }
    prose
}

/// Returns the anchors of a page's headings, as GitHub and mdBook generate them.
#[cfg(test)]
pub(crate) fn headings(page: &str) -> Vec<String> {
    let mut is_code = false;
    let mut names: Vec<String> = Vec::new();
    for line in page.lines() {
        is_code ^= line.starts_with("```");
        let text = line.trim_start_matches('#');
        if is_code || text.len() == line.len() || !text.starts_with(' ') {
            continue;
        }
        let kept = text.trim().to_lowercase();
        let kept = kept.chars().filter(|c| c.is_alphanumeric() || [' ', '-', '_'].contains(c));
        let name: String = kept.map(|c| if c == ' ' { '-' } else { c }).collect();
        // Repeated names get a number.
        let same = names.iter().filter(|known| **known == name).count();
        names.push(if same == 0 { name } else { format!("{name}-{same}") });
    }
    names
}

/// Resolves `.` and `..` in a path.
pub(crate) fn plain(path: &Path) -> PathBuf {
    path.components().fold(PathBuf::new(), |mut whole, part| {
        match part {
            Component::CurDir => {}
            Component::ParentDir if whole.file_name().is_some() => _ = whole.pop(),
            _ => whole.push(part),
        }
        whole
    })
}

/// Returns all Markdown pages below a folder.
pub(crate) fn pages(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path());
    let mut all: Vec<PathBuf> = entries
        .flat_map(|path| match path.extension() {
            _ if path.is_dir() => pages(&path),
            Some(extension) if extension == "md" => vec![path],
            _ => Vec::new(),
        })
        .collect();
    all.sort();
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bars::root;

    /// Returns the broken links of a page.
    fn broken(page: &Path) -> Vec<String> {
        let text = fs::read_to_string(page).expect("a page");
        let folder = page.parent().expect("a folder");
        let is_broken = |link: &PageLink| {
            let target = if link.file.is_empty() { page.to_owned() } else { folder.join(&link.file) };
            let has_heading = || {
                let text = fs::read_to_string(&target).unwrap_or_default();
                headings(&text).contains(&link.heading)
            };
            !target.exists() || (!link.heading.is_empty() && !has_heading())
        };
        links(&text)
            .iter()
            .filter(|link| is_broken(link))
            .map(|link| format!("{}: {}", page.display(), link.text))
            .collect()
    }

    #[test]
    fn every_link_leads_somewhere() {
        let root = root();
        let folders = ["docs", "bench", "scenes", "packaging"];
        let mut all: Vec<PathBuf> = folders.iter().flat_map(|folder| pages(&root.join(folder))).collect();
        all.extend(["README.md", "ARCHITECTURE.md", "CHANGELOG.md"].map(|name| root.join(name)));
        assert!(all.len() > 30, "{all:?}");
        let count: usize = all.iter().map(|page| links(&fs::read_to_string(page).expect("a page")).len()).sum();
        assert!(count > 150, "{count} links");
        let broken: Vec<String> = all.iter().flat_map(|page| broken(page)).collect();
        assert!(broken.is_empty(), "\n{}", broken.join("\n"));
    }

    #[test]
    fn every_page_of_the_manual_stands_in_its_contents_once() {
        let docs = root().join("docs");
        let contents = fs::read_to_string(docs.join("SUMMARY.md")).expect("contents");
        let listed: Vec<String> = links(&contents).into_iter().map(|link| link.file).collect();
        for page in pages(&docs) {
            let name = page.strip_prefix(&docs).expect("below docs").to_string_lossy().into_owned();
            let count = listed.iter().filter(|listed| **listed == name).count();
            assert_eq!(count, usize::from(name != "SUMMARY.md"), "docs/SUMMARY.md: {name}");
        }
    }

    #[test]
    fn links_and_headings_are_read_as_github_reads_them() {
        let page = "# A `b` (c)\n[x](y.md#z), `[no](none.md)`\n```\n[no](no.md)\n# no\n```\n## A b c\n[w](https://w) [t](#a)\n";
        let found = links(page);
        let texts: Vec<&str> = found.iter().map(|link| link.text.as_str()).collect();
        assert_eq!(texts, ["y.md#z", "#a"]);
        assert_eq!((found[0].file.as_str(), found[0].heading.as_str()), ("y.md", "z"));
        assert_eq!(headings(page), ["a-b-c", "a-b-c-1"]);
        assert_eq!(plain(Path::new("a/./b/../../c")), Path::new("c"));
    }
}
