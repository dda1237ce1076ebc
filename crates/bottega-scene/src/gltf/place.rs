//! Paths to locations in a JSON text.

use crate::text::shortened;

/// Returns the path to the value that contains byte `offset`, such as `materials[2].alphaCutoff`. Empty at the top. The
/// text must be valid JSON up to there.
pub(super) fn place(json: &[u8], offset: usize) -> String {
    enum Step {
        Member(String),
        Element(usize),
    }
    let mut steps: Vec<Step> = Vec::new();
    // True if the next string in the innermost object is a member's name.
    let mut expects_name = false;
    let mut index = 0;
    let end = offset.min(json.len());
    while index < end {
        match json[index] {
            b'{' => {
                steps.push(Step::Member(String::new()));
                expects_name = true;
            }
            b'[' => {
                steps.push(Step::Element(0));
                expects_name = false;
            }
            b'}' | b']' => {
                steps.pop();
                expects_name = false;
            }
            b',' => match steps.last_mut() {
                Some(Step::Element(element)) => *element += 1,
                _ => expects_name = true,
            },
            b'"' => {
                let start = index + 1;
                index = start;
                while index < end && json[index] != b'"' {
                    index += if json[index] == b'\\' { 2 } else { 1 };
                }
                if let Some(Step::Member(name)) = steps.last_mut()
                    && expects_name
                {
                    *name = String::from_utf8_lossy(&json[start..index.min(end)]).into_owned();
                    expects_name = false;
                }
            }
            _ => {}
        }
        index += 1;
    }
    steps.iter().fold(String::new(), |path, step| match step {
        Step::Member(name) if name.is_empty() => path,
        Step::Member(name) if path.is_empty() => shortened(name).into_owned(),
        Step::Member(name) => path + "." + &shortened(name),
        Step::Element(element) => path + &format!("[{element}]"),
    })
}

/// Returns the byte offset of a line and column, both counted from 1.
pub(super) fn offset(text: &[u8], line: usize, column: usize) -> usize {
    let lines = text.split_inclusive(|&byte| byte == b'\n');
    let before: usize = lines.take(line.saturating_sub(1)).map(<[u8]>::len).sum();
    (before + column.saturating_sub(1)).min(text.len())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_byte_is_found_in_its_value() {
        let text = r#"{"a": [1, {"b\"": "x,]", "c": {"d": true}}], "e": 7}"#;
        let at = |needle: &str| place(text.as_bytes(), text.find(needle).unwrap());
        assert_eq!(at("1,"), "a[0]");
        assert_eq!(at("true"), "a[1].c.d");
        assert_eq!(at("7"), "e");
        assert_eq!(place(text.as_bytes(), 0), "");
        assert_eq!(place(b"{\"a\": [1", 100), "a[0]");
        assert_eq!(place(b"]]}\"", 100), "");
    }

    #[test]
    fn lines_and_columns_become_bytes() {
        assert_eq!(offset(b"ab\ncd\n", 2, 2), 4);
        assert_eq!(offset(b"ab", 9, 9), 2);
    }
}
