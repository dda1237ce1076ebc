//! The content language SL (FIPA00008): expressions of words, strings, numbers and brackets.
//!
//! The parser accepts the syntax of all of SL, so that content in `fipa-sl1` and beyond can be read; ontologies
//! interpret expressions (see [`crate::platform`]). A word and a string with the same characters are the same constant.
//! Depth and size are bounded.

use crate::wire::{TextReader, WireError, is_word, push_text};

/// Maximum nesting of brackets.
pub const DEPTH_MAX: usize = 64;
/// Maximum number of terms in a content.
pub const TERMS_MAX: usize = 1 << 16;

/// The supported content languages: SL0 and its supersets.
pub const LANGUAGES: [&str; 4] = ["fipa-sl0", "fipa-sl1", "fipa-sl2", "fipa-sl"];

/// Returns true if the content language is supported; compared without case.
pub fn is_known(language: &str) -> bool {
    LANGUAGES.iter().any(|known| known.eq_ignore_ascii_case(language))
}

/// A term or a proposition of SL.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Term {
    /// A word or a string.
    Text(String),
    /// A number, a date-time, a variable (`?x`), a key (`:x`), `true` or `false`: as written, without quotes.
    Bare(String),
    /// A list of terms in brackets.
    List(Vec<Term>),
}

impl Term {
    /// Makes the term of a word or a string.
    pub fn text(text: impl Into<String>) -> Self {
        Self::Text(text.into())
    }

    /// Makes the term `(head argument …)`.
    pub fn call(head: &str, arguments: impl IntoIterator<Item = Term>) -> Self {
        Self::List(std::iter::once(Self::text(head)).chain(arguments).collect())
    }

    /// Makes the term of an integer.
    pub fn integer(number: i64) -> Self {
        Self::Bare(number.to_string())
    }

    /// Returns the text of a word, a string or a bare term, such as a number or a date-time; `None` for a list.
    pub fn as_str(&self) -> Option<&str> {
        match self {
            Self::Text(text) | Self::Bare(text) => Some(text),
            Self::List(_) => None,
        }
    }

    /// Returns head and arguments of `(head argument …)`; `None` for other terms.
    pub fn as_call(&self) -> Option<(&str, &[Term])> {
        match self {
            Self::List(terms) => match terms.split_first() {
                Some((Self::Text(head), arguments)) => Some((head, arguments)),
                _ => None,
            },
            _ => None,
        }
    }

    /// Returns the arguments of `(head argument …)`, with the head compared without case; `None` for other terms.
    pub fn arguments_of(&self, head: &str) -> Option<&[Term]> {
        self.as_call().filter(|(found, _)| found.eq_ignore_ascii_case(head)).map(|(_, arguments)| arguments)
    }

    /// Returns the elements of a set or a sequence; `None` for other terms. Platforms confuse the two.
    pub fn elements(&self) -> Option<&[Term]> {
        self.arguments_of("set").or_else(|| self.arguments_of("sequence"))
    }
}

/// Parses a content: a tuple of expressions. A single expression without the tuple's brackets is read as a tuple of
/// one, as some platforms write it.
///
/// # Errors
/// The text is empty, a bracket or a string is not closed, something follows the content, or a limit is exceeded:
/// [`DEPTH_MAX`], [`TERMS_MAX`], or [`TEXT_BYTES_MAX`](crate::wire::TEXT_BYTES_MAX).
pub fn parse(text: &str) -> Result<Vec<Term>, WireError> {
    let term = parse_term(text)?;
    match term {
        Term::List(terms) if matches!(terms.first(), None | Some(Term::List(_))) => Ok(terms),
        // `((done …))` starts with a bracket; a list that starts with a word is not a tuple
        Term::List(terms) => Ok(vec![Term::List(terms)]),
        word => Ok(vec![Term::List(vec![word])]),
    }
}

/// Parses a text that consists of one term.
///
/// # Errors
/// As for [`parse`].
pub fn parse_term(text: &str) -> Result<Term, WireError> {
    let mut reader = TextReader::new(text)?;
    let term = read(&mut reader)?;
    reader.end()?;
    Ok(term)
}

fn read(reader: &mut TextReader<'_>) -> Result<Term, WireError> {
    // The open lists, the outermost first
    let mut open: Vec<Vec<Term>> = Vec::new();
    let mut count = 0;
    loop {
        let done = match reader.peek() {
            Some(b'(') => {
                reader.open()?;
                if open.len() == DEPTH_MAX {
                    return Err(WireError::TooMany { what: "brackets within brackets", max: DEPTH_MAX });
                }
                open.push(Vec::new());
                continue;
            }
            Some(b')') => {
                let Some(list) = open.pop() else { return Err(reader.expected("a term")) };
                reader.eat_close();
                Term::List(list)
            }
            Some(b'"' | b'#') => Term::Text(reader.text("a string")?),
            Some(_) => bare(reader.word()),
            None => return Err(reader.expected("a term, or `)`")),
        };
        count += 1;
        if count > TERMS_MAX {
            return Err(WireError::TooMany { what: "terms", max: TERMS_MAX });
        }
        match open.last_mut() {
            Some(list) => list.push(done),
            None => return Ok(done),
        }
    }
}

/// Classifies a token without quotes.
fn bare(token: &str) -> Term {
    if is_special(token) { Term::Bare(token.to_owned()) } else { Term::Text(token.to_owned()) }
}

/// Returns true if a token cannot be a plain word: it starts like a number, a variable, a key or similar, or is a
/// truth value.
fn is_special(token: &str) -> bool {
    token.starts_with(|first: char| first.is_ascii_digit() || matches!(first, '+' | '-' | '.' | '?' | ':' | '@'))
        || ["true", "false"].iter().any(|word| word.eq_ignore_ascii_case(token))
}

/// Returns true if a text may be written without quotes; fewer characters are excluded than from words of a message.
fn is_word_of_sl(text: &str) -> bool {
    !is_special(text)
        && !text.starts_with('#')
        && !text.is_empty()
        && text.bytes().all(|byte| byte > b' ' && !matches!(byte, b'(' | b')' | b'"'))
}

/// Returns a content as text. It parses to the same terms if the first one is a list, as expressions are.
pub fn print(terms: &[Term]) -> String {
    let mut out = "(".to_owned();
    for (index, term) in terms.iter().enumerate() {
        if index > 0 {
            out.push(' ');
        }
        push(&mut out, term);
    }
    out.push(')');
    out
}

/// Returns one term as text, which parses to the same term if its bare terms are as [`Term::Bare`] describes them.
pub fn print_term(term: &Term) -> String {
    let mut out = String::new();
    push(&mut out, term);
    out
}

fn push(out: &mut String, term: &Term) {
    match term {
        // A word of messages, but not of SL
        Term::Text(text) if is_special(text) && is_word(text) => {
            out.push('"');
            out.push_str(text);
            out.push('"');
        }
        // JADE reads a length-prefixed text as bytes
        Term::Text(text) if text.ends_with('\\') && is_word_of_sl(text) => out.push_str(text),
        Term::Text(text) => push_text(out, text),
        Term::Bare(text) => out.push_str(text),
        Term::List(terms) => {
            out.push('(');
            for (index, term) in terms.iter().enumerate() {
                if index > 0 {
                    out.push(' ');
                }
                push(out, term);
            }
            out.push(')');
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_and_strings_are_one_and_what_only_looks_like_a_number_is_quoted() {
        let terms = parse(r#"((p word "word" "1.5" 1.5 "true" true ?x "?x" :k 20261121T022548103Z #3"a\"))"#).unwrap();
        let text = |text: &str| Term::text(text);
        let bare = |text: &str| Term::Bare(text.to_owned());
        let (head, arguments) = terms[0].as_call().unwrap();
        assert_eq!(head, "p");
        assert_eq!(arguments[..6], [text("word"), text("word"), text("1.5"), bare("1.5"), text("true"), bare("true")]);
        assert_eq!(arguments[6..9], [bare("?x"), text("?x"), bare(":k")]);
        assert_eq!(arguments[10], text("a\\\""));
        assert_eq!(print(&terms), r#"((p word word "1.5" 1.5 "true" true ?x "?x" :k 20261121T022548103Z "a\\""))"#);
    }

    #[test]
    fn texts_with_backslashes_and_quotes_are_written_as_others_read_them() {
        for (text, written) in [
            (r#""“🎨”\"中"#, r#""\"“🎨”\\"中""#),
            (r"C:\中\", r"C:\中\"),
            (r"\", r"\"),
            // No word, and no string in quotes.
            (r"a b\", r#"#4"a b\"#),
            (r"中 b\", r#"#4"中 b\"#),
            (r"?\", r#"#2"?\"#),
        ] {
            let term = Term::text(text);
            assert_eq!(print_term(&term), written);
            let content = print(&[Term::call("p", [term.clone(), Term::text("\"")])]);
            assert_eq!(parse(&content).unwrap(), [Term::call("p", [term, Term::text("\"")])], "{content}");
        }
    }

    #[test]
    fn a_tuple_may_lack_its_brackets_and_nothing_may_be_too_deep() {
        assert_eq!(parse("(unrecognised-value content)").unwrap(), parse("((unrecognised-value content))").unwrap());
        let deep = |depth: usize| format!("{}{}", "(".repeat(depth), ")".repeat(depth));
        assert!(parse(&deep(DEPTH_MAX)).is_ok());
        assert!(matches!(parse(&deep(DEPTH_MAX + 1)), Err(WireError::TooMany { .. })));
        assert!(matches!(parse(&format!("({})", "a ".repeat(TERMS_MAX + 1))), Err(WireError::TooMany { .. })));
        for bad in ["", "(", ")", "(a", "(a))", "\"", "(#9\"a)", "(\"a)"] {
            assert!(parse(bad).is_err(), "{bad}");
        }
    }
}
