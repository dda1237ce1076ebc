//! A test that the names in docs/symbols.md exist in the code.

#[cfg(test)]
mod tests {
    use std::{fs, path::Path};

    /// Returns the names in backticks in the last column of the table, with their lines.
    fn names(table: &str) -> Vec<(&str, &str)> {
        let rows = table.lines().filter(|line| line.starts_with('|')).skip(2);
        let of_row = |line| {
            let column: &str = str::rsplit(line, '|').nth(1).unwrap_or_default();
            column.split('`').skip(1).step_by(2).map(move |name| (name, line))
        };
        rows.flat_map(of_row).collect()
    }

    /// Collects the text of all sources below a folder, without comments.
    fn sources(folder: &Path, all: &mut Vec<String>) {
        for entry in fs::read_dir(folder).expect("a folder of the repository").flatten() {
            let path = entry.path();
            let is_source = path.extension().is_some_and(|extension| extension == "rs" || extension == "fcl");
            if path.is_dir() && !path.ends_with("tests") {
                sources(&path, all);
            } else if is_source {
                let text = fs::read_to_string(&path).expect("a source in UTF-8");
                let code = text.lines().filter(|line| !line.trim_start().starts_with("//"));
                all.push(code.collect::<Vec<_>>().join("\n"));
            }
        }
    }

    /// True if a text defines a name: an item, a field, a variable of rules, or a variant.
    fn defines(text: &str, name: &str) -> bool {
        let is_word = |character: char| character.is_alphanumeric() || character == '_';
        text.match_indices(name).any(|(at, _)| {
            let (before, after) = (&text[..at], &text[at + name.len()..]);
            if before.ends_with(is_word) || after.starts_with(is_word) {
                return false;
            }
            let word_before = before.trim_end().rsplit(|character| !is_word(character)).next().unwrap_or_default();
            let is_item = ["struct", "enum", "type", "trait", "const", "static", "fn", "mod"].contains(&word_before);
            let starts_line = before.trim_end_matches(' ').ends_with('\n');
            let is_field = after.trim_start().starts_with(':') && !after.trim_start().starts_with("::");
            let is_variant = starts_line && after.starts_with([',', '(', ' ']) && name.starts_with(char::is_uppercase);
            is_item || is_field || is_variant
        })
    }

    #[test]
    fn every_name_in_the_table_of_symbols_is_defined() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
        let table = fs::read_to_string(root.join("docs/symbols.md")).expect("the table");
        let mut all = Vec::new();
        sources(&root.join("crates"), &mut all);
        sources(&root.join("rules"), &mut all);
        let names = names(&table);
        assert!(names.len() > 20, "{names:?}");
        for (name, line) in names {
            let parts: Vec<&str> = name.split("::").collect();
            let found = all.iter().any(|text| parts.iter().all(|part| defines(text, part)));
            assert!(found, "docs/symbols.md names `{name}`, which nothing defines: {line}");
        }
    }

    #[test]
    fn a_name_that_is_only_used_is_not_defined() {
        assert!(defines("pub const PAPER_K: f64 = 0.1;", "PAPER_K") && defines("    gamma: f32,", "gamma"));
        assert!(!defines("let x = ADAPTATION_RATE * 2;", "ADAPTATION_RATE"));
        assert!(!defines("const PAPER_KEY: u8 = 0;", "PAPER_K") && !defines("Kind::Other", "Other"));
        assert!(defines("enum Kind {\n    Irradiance,\n}", "Irradiance"));
    }
}
