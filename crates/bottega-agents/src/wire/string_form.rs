//! Messages in the string representation (FIPA00070).

use std::{collections::BTreeMap, fmt::Write};

use super::{
    ADDRESSES_MAX, AGENTS_MAX, DateTime, TEXT_BYTES_MAX, USER_PARAMETERS_MAX, WireError, WireMessage, bad_value,
    bounded, identifier, set_once,
};
use crate::{AgentId, Performative};

/// Parses a message in the string representation.
///
/// Unknown parameters and resolvers of identifiers are ignored; each other parameter may occur only once.
///
/// # Errors
/// A syntax error, an unknown performative, an invalid value, an agent identifier without a name, a parameter given
/// twice, or a limit exceeded.
pub fn parse_string(text: &str) -> Result<WireMessage, WireError> {
    let mut reader = TextReader::new(text)?;
    reader.open()?;
    let act = reader.text("a performative")?;
    let performative = Performative::from_word(&act).ok_or_else(|| bad_value("performative", &act))?;
    let mut message = WireMessage::new(performative);
    let (mut receivers, mut reply_to) = (None, None);
    while let Some(name) = reader.parameter()? {
        let lower = name.to_ascii_lowercase();
        match lower.as_str() {
            "sender" => set_once(&mut message.sender, reader.agent()?, &lower)?,
            "receiver" => set_once(&mut receivers, reader.agents()?, &lower)?,
            "reply-to" => set_once(&mut reply_to, reader.agents()?, &lower)?,
            "content" => set_once(&mut message.content, reader.text("the content")?, &lower)?,
            "language" => set_once(&mut message.language, reader.text("a language")?, &lower)?,
            "encoding" => set_once(&mut message.encoding, reader.text("an encoding")?, &lower)?,
            "ontology" => set_once(&mut message.ontology, reader.text("an ontology")?, &lower)?,
            "protocol" => set_once(&mut message.protocol, reader.text("a protocol")?, &lower)?,
            "conversation-id" => set_once(&mut message.conversation_id, reader.text("an identifier")?, &lower)?,
            "reply-with" => set_once(&mut message.reply_with, reader.text("an expression")?, &lower)?,
            "in-reply-to" => set_once(&mut message.in_reply_to, reader.text("an expression")?, &lower)?,
            "reply-by" => set_once(&mut message.reply_by, DateTime::parse(&reader.text("a date-time")?)?, &lower)?,
            _ if is_user_name(name) => reader.user_parameter(name, &mut message.user)?,
            _ => reader.skip()?,
        }
    }
    message.receivers = receivers.unwrap_or_default();
    message.reply_to = reply_to.unwrap_or_default();
    reader.end()?;
    Ok(message)
}

/// The lexer of brackets, words and strings, also used for content languages.
pub(crate) struct TextReader<'a> {
    text: &'a str,
    at: usize,
}

/// Returns true for bytes that end a word.
fn ends_word(byte: u8) -> bool {
    byte <= b' ' || matches!(byte, b'(' | b')' | b'"')
}

impl<'a> TextReader<'a> {
    /// Starts at the beginning of a text; fails if it is longer than [`TEXT_BYTES_MAX`] bytes.
    pub(crate) fn new(text: &'a str) -> Result<Self, WireError> {
        if text.len() > TEXT_BYTES_MAX {
            return Err(WireError::TooMany { what: "bytes", max: TEXT_BYTES_MAX });
        }
        Ok(Self { text, at: 0 })
    }

    pub(crate) fn expected(&self, expected: &'static str) -> WireError {
        WireError::Syntax { at: self.at, expected }
    }

    pub(crate) fn peek(&mut self) -> Option<u8> {
        let blank = self.text.as_bytes()[self.at..].iter().take_while(|byte| **byte <= b' ').count();
        self.at += blank;
        self.text.as_bytes().get(self.at).copied()
    }

    pub(crate) fn open(&mut self) -> Result<(), WireError> {
        if self.peek() != Some(b'(') {
            return Err(self.expected("`(`"));
        }
        self.at += 1;
        Ok(())
    }

    pub(crate) fn eat_close(&mut self) -> bool {
        let close = self.peek() == Some(b')');
        self.at += usize::from(close);
        close
    }

    pub(crate) fn end(&mut self) -> Result<(), WireError> {
        if self.peek().is_some() { Err(self.expected("the end of the message")) } else { Ok(()) }
    }

    /// Returns the name of the next parameter; `None` after the closing bracket.
    fn parameter(&mut self) -> Result<Option<&'a str>, WireError> {
        if self.eat_close() {
            return Ok(None);
        }
        if self.peek() != Some(b':') {
            return Err(self.expected("`:` and a parameter, or `)`"));
        }
        self.at += 1;
        let name = self.word();
        if name.is_empty() { Err(self.expected("the name of a parameter")) } else { Ok(Some(name)) }
    }

    pub(crate) fn word(&mut self) -> &'a str {
        let start = self.at;
        let length = self.text.as_bytes()[start..].iter().take_while(|byte| !ends_word(**byte)).count();
        self.at += length;
        // Only ASCII bytes end a word, so this is a character boundary
        &self.text[start..self.at]
    }

    /// Returns a word, a number, a date-time or a string of either kind.
    pub(crate) fn text(&mut self, expected: &'static str) -> Result<String, WireError> {
        match self.peek() {
            Some(b'"') => self.quoted(),
            Some(b'#') => self.counted(),
            Some(byte) if !ends_word(byte) => Ok(self.word().to_owned()),
            _ => Err(self.expected(expected)),
        }
    }

    /// Reads `"…"`, in which `\"` is a quote and any other backslash is literal.
    fn quoted(&mut self) -> Result<String, WireError> {
        let mut string = String::new();
        let mut rest = &self.text[self.at + 1..];
        loop {
            let Some(quote) = rest.find('"') else { return Err(self.expected("a string that ends")) };
            match rest[..quote].strip_suffix('\\') {
                Some(before) => {
                    string.push_str(before);
                    string.push('"');
                    rest = &rest[quote + 1..];
                }
                None => {
                    string.push_str(&rest[..quote]);
                    self.at = self.text.len() - (rest.len() - quote - 1);
                    return Ok(string);
                }
            }
        }
    }

    /// Reads `#n"` and n bytes. Some platforms count UTF-16 units, of which there are fewer: a text is read that way if
    /// it then ends in a backslash (the only text that must be written so) and n bytes do not.
    fn counted(&mut self) -> Result<String, WireError> {
        let rest = &self.text[self.at + 1..];
        let digits = rest.bytes().take_while(u8::is_ascii_digit).count();
        let count = rest[..digits].parse::<usize>().ok().filter(|count| *count <= TEXT_BYTES_MAX);
        let (Some(count), Some(string)) = (count, rest[digits..].strip_prefix('"')) else {
            return Err(self.expected("a byte count and `\"`"));
        };
        let Some(string) = counted_bytes(string, count).or_else(|| counted_units(string, count)) else {
            return Err(self.expected("as many bytes as were counted"));
        };
        self.at += 1 + digits + 1 + string.len();
        Ok(string.to_owned())
    }

    /// Reads `(set AID AID …)`, or a single identifier.
    fn agents(&mut self) -> Result<Vec<AgentId>, WireError> {
        let start = self.at;
        self.open()?;
        let kind = self.text("`set`")?;
        if kind.eq_ignore_ascii_case("agent-identifier") {
            self.at = start;
            return Ok(vec![self.agent()?]);
        }
        if !kind.eq_ignore_ascii_case("set") && !kind.eq_ignore_ascii_case("sequence") {
            return Err(bad_value("set of agent identifiers", &kind));
        }
        let mut agents = Vec::new();
        while !self.eat_close() {
            bounded(agents.len(), AGENTS_MAX, "agents")?;
            agents.push(self.agent()?);
        }
        Ok(agents)
    }

    fn agent(&mut self) -> Result<AgentId, WireError> {
        self.open()?;
        let kind = self.text("`agent-identifier`")?;
        if !kind.eq_ignore_ascii_case("agent-identifier") {
            return Err(bad_value("agent identifier", &kind));
        }
        let (mut name, mut addresses) = (None, None);
        while let Some(parameter) = self.parameter()? {
            if parameter.eq_ignore_ascii_case("name") {
                set_once(&mut name, self.text("a name")?, parameter)?;
            } else if parameter.eq_ignore_ascii_case("addresses") {
                set_once(&mut addresses, self.addresses()?, parameter)?;
            } else {
                self.skip()?;
            }
        }
        let name = name.ok_or(WireError::Missing { object: "agent-identifier", part: "name" })?;
        Ok(identifier(name, addresses.unwrap_or_default()))
    }

    fn addresses(&mut self) -> Result<Vec<String>, WireError> {
        self.open()?;
        let kind = self.text("`sequence`")?;
        if !kind.eq_ignore_ascii_case("sequence") && !kind.eq_ignore_ascii_case("set") {
            return Err(bad_value("sequence of addresses", &kind));
        }
        let mut addresses = Vec::new();
        while !self.eat_close() {
            bounded(addresses.len(), ADDRESSES_MAX, "addresses")?;
            addresses.push(self.text("an address")?);
        }
        Ok(addresses)
    }

    fn user_parameter(&mut self, name: &str, user: &mut BTreeMap<String, String>) -> Result<(), WireError> {
        // Content that is not text cannot be from this program
        if self.peek() == Some(b'(') {
            return self.skip();
        }
        let value = self.text("a value")?;
        bounded(user.len(), USER_PARAMETERS_MAX, "user-defined parameters")?;
        match user.insert(name.to_owned(), value) {
            Some(_) => Err(WireError::Twice(name.to_owned())),
            None => Ok(()),
        }
    }

    /// Skips one expression, of any depth.
    fn skip(&mut self) -> Result<(), WireError> {
        let mut depth = 0_usize;
        loop {
            match self.peek() {
                Some(b'(') => {
                    self.at += 1;
                    depth += 1;
                }
                Some(b')') if depth > 0 => {
                    self.at += 1;
                    depth -= 1;
                }
                _ => drop(self.text("an expression")?),
            }
            if depth == 0 {
                return Ok(());
            }
        }
    }
}

/// Returns a message in the string representation, which parses to the same message.
///
/// # Errors
/// The name of a user-defined parameter is not a word that begins with `X-`.
pub fn print_string(message: &WireMessage) -> Result<String, WireError> {
    let mut out = format!("({}", message.performative.word());
    if let Some(sender) = &message.sender {
        out.push_str(" :sender ");
        push_agent(&mut out, sender);
    }
    for (name, agents) in [("receiver", &message.receivers), ("reply-to", &message.reply_to)] {
        if !agents.is_empty() {
            _ = write!(out, " :{name} (set");
            for agent in agents {
                out.push(' ');
                push_agent(&mut out, agent);
            }
            out.push(')');
        }
    }
    for (name, value) in texts(message) {
        if let Some(value) = value {
            _ = write!(out, " :{name} ");
            push_text(&mut out, value);
        }
    }
    if let Some(by) = &message.reply_by {
        _ = write!(out, " :reply-by {by}");
    }
    for (name, value) in &message.user {
        if !is_user_name(name) {
            return Err(WireError::Unprintable("the name of a user-defined parameter"));
        }
        _ = write!(out, " :{name} ");
        push_text(&mut out, value);
    }
    out.push(')');
    Ok(out)
}

/// Returns the text parameters, by name.
pub(super) fn texts(message: &WireMessage) -> [(&'static str, Option<&str>); 8] {
    [
        ("content", message.content.as_deref()),
        ("language", message.language.as_deref()),
        ("encoding", message.encoding.as_deref()),
        ("ontology", message.ontology.as_deref()),
        ("protocol", message.protocol.as_deref()),
        ("conversation-id", message.conversation_id.as_deref()),
        ("reply-with", message.reply_with.as_deref()),
        ("in-reply-to", message.in_reply_to.as_deref()),
    ]
}

fn push_agent(out: &mut String, agent: &AgentId) {
    out.push_str("(agent-identifier :name ");
    push_text(out, &agent.name);
    if !agent.addresses.is_empty() {
        out.push_str(" :addresses (sequence");
        for address in agent.addresses.iter() {
            out.push(' ');
            push_text(out, address);
        }
        out.push(')');
    }
    out.push(')');
}

/// Appends a text so that all known parsers read it.
pub(crate) fn push_text(out: &mut String, text: &str) {
    if is_word(text) {
        out.push_str(text);
    } else if text.ends_with('\\') {
        // The escape does not work here: before the closing quote a backslash reads as an escaped quote
        push_counted(out, text);
    } else {
        _ = write!(out, "\"{}\"", text.replace('"', "\\\""));
    }
}

/// Appends a text that ends in a backslash with its length. The standard counts bytes. JADE counts UTF-16 units, and
/// reads beyond the end of the text if bytes are counted: so units are counted wherever [`TextReader`] does not take
/// them for bytes.
fn push_counted(out: &mut String, text: &str) {
    let units = text.encode_utf16().count();
    let count = if counted_bytes(text, units).is_none_or(|read| read == text) { units } else { text.len() };
    _ = write!(out, "#{count}\"{text}");
}

/// Returns the text of this many bytes; `None` if [`counted_units`] applies instead.
fn counted_bytes(text: &str, count: usize) -> Option<&str> {
    let read = text.get(..count)?;
    (read.ends_with('\\') || counted_units(text, count).is_none()).then_some(read)
}

/// Returns the text of this many UTF-16 units, if it ends in a backslash.
fn counted_units(text: &str, count: usize) -> Option<&str> {
    let mut left = count;
    let end = text.char_indices().find_map(|(at, character)| {
        if left == 0 {
            return Some(at);
        }
        left = left.saturating_sub(character.len_utf16());
        None
    });
    let read = if left == 0 { &text[..end.unwrap_or(text.len())] } else { return None };
    (read.ends_with('\\') && read.encode_utf16().count() == count).then_some(read)
}

/// Returns true if all known parsers read the text without quotes.
pub(crate) fn is_word(text: &str) -> bool {
    let Some(first) = text.bytes().next() else { return false };
    !matches!(first, b'#' | b'0'..=b'9' | b'-' | b'@' | b':' | b'+')
        && text.bytes().all(|byte| byte.is_ascii_graphic() && !ends_word(byte) && byte != b'\\')
}

/// Returns true for valid names of user-defined parameters. Others are ignored.
fn is_user_name(name: &str) -> bool {
    let prefix = name.get(..2).is_some_and(|prefix| prefix.eq_ignore_ascii_case("x-"));
    prefix && name.len() > 2 && is_word(name)
}
