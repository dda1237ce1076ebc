//! Names of prims, properties and variants. The USD library does not check them, and follows paths with wrong ones without end.

/// Characters that part the elements of a path.
const PARTING: &str = "/{}<>[]()=,;@\"'\\";

/// Returns true for a name of a prim.
pub(super) fn is_prim(name: &str) -> bool {
    is_property(name) && !name.contains(['.', ':'])
}

/// Returns true for a name of a property, with its namespaces.
pub(super) fn is_property(name: &str) -> bool {
    let is_part = |letter: char| !letter.is_whitespace() && !letter.is_control() && !PARTING.contains(letter);
    !name.is_empty() && !name.starts_with('.') && !name.ends_with('.') && name.chars().all(is_part)
}

/// Returns true for a name of a variant, which may be empty.
pub(super) fn is_variant(name: &str) -> bool {
    name.chars().all(|letter| !letter.is_control() && !PARTING.contains(letter))
}

/// Returns true for an element of a path that selects a variant, as `{set=name}`.
pub(super) fn is_selection(element: &str) -> bool {
    let inner = element.strip_prefix('{').and_then(|rest| rest.strip_suffix('}'));
    inner.and_then(|inner| inner.split_once('=')).is_some_and(|(set, name)| is_prim(set) && is_variant(name))
}

/// Returns true for a path in which each brace that closes a selection has opened one.
pub(super) fn has_sound_braces(path: &str) -> bool {
    let mut open = None;
    for (at, letter) in path.char_indices() {
        match (letter, open) {
            ('{', None) => open = Some(at),
            ('}', Some(start)) if is_selection(&path[start..=at]) => open = None,
            ('{' | '}', _) => return false,
            _ => {}
        }
    }
    open.is_none()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_have_no_parting_characters() {
        assert!(is_prim("größe_2") && is_property("primvars:st:indices") && is_variant("2.5-low") && is_variant(""));
        for name in ["", ".", "..", "a}b", "a/b", "a b", "a\n", "a.b", "a=b"] {
            assert!(!is_prim(name), "{name:?}");
        }
        assert!(is_selection("{size=large}") && !is_selection("{size}") && !is_selection("{a=b}c}"));
        assert!(has_sound_braces("/A{size=large}B.c") && has_sound_braces("/A"));
        assert!(!has_sound_braces("/A}B") && !has_sound_braces("/A{b") && !has_sound_braces("/A{{a=b}}"));
    }
}
