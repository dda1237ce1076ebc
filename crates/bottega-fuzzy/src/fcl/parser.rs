//! The parser: turns tokens into function blocks by recursive descent, and validates them.

use super::{
    error::{FclError, FclErrorKind, Position, nearest},
    lexer::{Token, tokens},
    places::{Places, VariablePlaces},
};
use crate::{
    block::{FunctionBlock, InputVariable, OutputVariable, RuleBlock, Term},
    limits::Limits,
    membership::Membership,
    operators::{Accumulation, Method},
};

/// A parsed FCL text: its function blocks, and the positions of their parts.
#[derive(Clone, Debug, PartialEq)]
pub struct Document {
    /// The function blocks, in the order of the text.
    pub blocks: Vec<FunctionBlock>,
    /// The positions of each block's parts.
    pub(crate) places: Vec<Places>,
}

impl Document {
    /// Returns the position of an input's declaration. `None`: there is no such block or input.
    ///
    /// - `block`: the index of the block in `blocks`.
    /// - `name`: the name of the input, without case.
    pub fn input_position(&self, block: usize, name: &str) -> Option<Position> {
        let index = self.blocks.get(block)?.input_index(name)?;
        Some(self.places[block].inputs[index].at)
    }
}

/// Parses an FCL text with any number of function blocks.
///
/// # Errors
/// The first error, with line and column: the syntax is wrong, a name is undeclared or declared twice, a declaration is
/// incomplete or invalid, or one of the [`Limits`] is exceeded.
pub fn parse_document(text: &str) -> Result<Document> {
    if text.len() > Limits::TEXT_BYTES_MAX {
        let at = Position { line: 1, column: 1 };
        return Err(FclError { at, kind: FclErrorKind::TooMany { what: "bytes", max: Limits::TEXT_BYTES_MAX } });
    }
    let tokens = tokens(text)?;
    let mut parser = Parser { tokens: &tokens, next: 0 };
    let mut document = Document { blocks: Vec::new(), places: Vec::new() };
    while !parser.at_end() {
        let at = parser.at();
        parser.keyword("FUNCTION_BLOCK")?;
        let (block, places) = parser.block()?;
        document.blocks.push(block);
        document.places.push(Places { block: Some(at), ..places });
    }
    Ok(document)
}

impl FunctionBlock {
    /// Parses an FCL text with exactly one function block. For several, or for warnings, see [`crate::parse_document`].
    ///
    /// # Errors
    /// As for [`crate::parse_document`], or the text has no or several function blocks.
    pub fn parse(text: &str) -> Result<Self> {
        let mut blocks = parse_document(text)?.blocks;
        match (blocks.pop(), blocks.len()) {
            (Some(block), 0) => Ok(block),
            (_, others) => {
                let kind = FclErrorKind::BlockCount(if others == 0 { 0 } else { others + 1 });
                Err(FclError { at: Position { line: 1, column: 1 }, kind })
            }
        }
    }
}

/// Reserved keywords, which cannot be names.
const RESERVED: &[&str] = &[
    "FUNCTION_BLOCK",
    "END_FUNCTION_BLOCK",
    "VAR_INPUT",
    "VAR_OUTPUT",
    "VAR",
    "END_VAR",
    "FUZZIFY",
    "END_FUZZIFY",
    "DEFUZZIFY",
    "END_DEFUZZIFY",
    "RULEBLOCK",
    "END_RULEBLOCK",
    "TERM",
    "RANGE",
    "METHOD",
    "DEFAULT",
    "ACCU",
    "ACT",
    "AND",
    "OR",
    "NOT",
    "RULE",
    "IF",
    "IS",
    "THEN",
    "WITH",
];

pub(super) type Result<T> = std::result::Result<T, FclError>;

pub(super) struct Parser<'a> {
    tokens: &'a [(Token<'a>, Position)],
    next: usize,
}

/// An input while it is parsed.
pub(super) struct InputDraft {
    pub(super) name: String,
    pub(super) at: Position,
    pub(super) terms: Option<Vec<Term>>,
    pub(super) term_places: Vec<Position>,
    pub(super) range: Option<(f64, f64)>,
}

/// An output while it is parsed.
pub(super) struct OutputDraft {
    pub(super) name: String,
    pub(super) at: Position,
    pub(super) defuzzified: bool,
    pub(super) terms: Vec<Term>,
    pub(super) term_places: Vec<Position>,
    pub(super) range: Option<(f64, f64)>,
    pub(super) method: Option<(Method, Position)>,
    pub(super) accumulation: Option<Accumulation>,
    /// `Some(None)`: NC, no change.
    pub(super) default: Option<Option<f64>>,
}

#[derive(Default)]
pub(super) struct Draft {
    pub(super) inputs: Vec<InputDraft>,
    pub(super) outputs: Vec<OutputDraft>,
    pub(super) locals: Vec<String>,
    pub(super) rule_blocks: Vec<RuleBlock>,
    pub(super) rule_places: Vec<Position>,
}

impl Draft {
    pub(super) fn input(&self, name: &str) -> Option<usize> {
        self.inputs.iter().position(|input| input.name.eq_ignore_ascii_case(name))
    }

    pub(super) fn output(&self, name: &str) -> Option<usize> {
        self.outputs.iter().position(|output| output.name.eq_ignore_ascii_case(name))
    }

    fn knows(&self, name: &str) -> bool {
        self.input(name).is_some()
            || self.output(name).is_some()
            || self.locals.iter().any(|local| local.eq_ignore_ascii_case(name))
    }
}

pub(super) fn unknown<'n>(
    what: impl Into<String>,
    name: &str,
    declared: impl IntoIterator<Item = &'n str>,
) -> FclErrorKind {
    FclErrorKind::Unknown { what: what.into(), name: name.to_owned(), suggestion: nearest(name, declared) }
}

// Reading of single tokens.
impl<'a> Parser<'a> {
    pub(super) fn peek(&self) -> &Token<'a> {
        &self.tokens[self.next].0
    }

    pub(super) fn at(&self) -> Position {
        self.tokens[self.next].1
    }

    fn at_end(&self) -> bool {
        *self.peek() == Token::End
    }

    pub(super) fn advance(&mut self) {
        // The last token is the end and is never passed
        self.next = (self.next + 1).min(self.tokens.len() - 1);
    }

    fn is_word(&self, word: &str) -> bool {
        matches!(self.peek(), Token::Word(found) if found.eq_ignore_ascii_case(word))
    }

    pub(super) fn eat_word(&mut self, word: &str) -> bool {
        let found = self.is_word(word);
        if found {
            self.advance();
        }
        found
    }

    pub(super) fn eat_mark(&mut self, mark: char) -> bool {
        let found = *self.peek() == Token::Mark(mark);
        if found {
            self.advance();
        }
        found
    }

    pub(super) fn unexpected(&self, expected: &str, words: &[&str]) -> FclError {
        let suggestion = match self.peek() {
            Token::Word(found) => nearest(found, words.iter().copied()),
            _ => None,
        };
        let kind =
            FclErrorKind::Unexpected { expected: expected.to_owned(), found: self.peek().describe(), suggestion };
        FclError { at: self.at(), kind }
    }

    pub(super) fn keyword(&mut self, word: &str) -> Result<()> {
        if self.eat_word(word) { Ok(()) } else { Err(self.unexpected(&format!("`{word}`"), &[word])) }
    }

    pub(super) fn mark(&mut self, mark: char) -> Result<()> {
        if self.eat_mark(mark) { Ok(()) } else { Err(self.unexpected(&format!("`{mark}`"), &[])) }
    }

    fn assign(&mut self) -> Result<()> {
        if *self.peek() == Token::Assign {
            self.advance();
            return Ok(());
        }
        Err(self.unexpected("`:=`", &[]))
    }

    pub(super) fn name(&mut self, what: &str) -> Result<&'a str> {
        match *self.peek() {
            Token::Word(word) if !RESERVED.iter().any(|reserved| reserved.eq_ignore_ascii_case(word)) => {
                self.advance();
                Ok(word)
            }
            _ => Err(self.unexpected(what, &[])),
        }
    }

    fn number(&mut self) -> Result<f64> {
        let negative = if self.eat_mark('-') {
            true
        } else {
            self.eat_mark('+');
            false
        };
        let Token::Number(number, _) = *self.peek() else { return Err(self.unexpected("a number", &[])) };
        self.advance();
        Ok(if negative { -number } else { number })
    }

    pub(super) fn unit(&mut self, what: &'static str) -> Result<f64> {
        let at = self.at();
        let value = self.number()?;
        if (0.0..=1.0).contains(&value) {
            return Ok(value);
        }
        Err(FclError { at, kind: FclErrorKind::OutsideUnit { what, value } })
    }

    /// Parses `: WORD ;` with one of a closed set of words.
    pub(super) fn choice<T: Copy>(&mut self, all: &[T], word: impl Fn(T) -> &'static str) -> Result<T> {
        self.mark(':')?;
        let words: Vec<&str> = all.iter().map(|one| word(*one)).collect();
        let Some(found) = all.iter().find(|one| self.is_word(word(**one))) else {
            return Err(self.unexpected(&format!("one of {}", words.join(", ")), &words));
        };
        self.advance();
        self.mark(';')?;
        Ok(*found)
    }

    pub(super) fn check_count(&self, count: usize, max: usize, what: &'static str) -> Result<()> {
        if count < max {
            return Ok(());
        }
        Err(FclError { at: self.at(), kind: FclErrorKind::TooMany { what, max } })
    }
}

// Reading of declarations.
impl Parser<'_> {
    /// Parses a block, after its first keyword.
    fn block(&mut self) -> Result<(FunctionBlock, Places)> {
        const SECTIONS: &[&str] =
            &["VAR_INPUT", "VAR_OUTPUT", "VAR", "FUZZIFY", "DEFUZZIFY", "RULEBLOCK", "END_FUNCTION_BLOCK"];
        // The name is optional; a section's keyword is not a name
        let name = self.name("").map_or_else(|_| String::new(), str::to_owned);
        let mut draft = Draft::default();
        loop {
            let at = self.at();
            if self.eat_word("VAR_INPUT") {
                self.variables(&mut draft, VariableKind::Input)?;
            } else if self.eat_word("VAR_OUTPUT") {
                self.variables(&mut draft, VariableKind::Output)?;
            } else if self.eat_word("VAR") {
                self.variables(&mut draft, VariableKind::Local)?;
            } else if self.eat_word("FUZZIFY") {
                self.fuzzify(&mut draft)?;
            } else if self.eat_word("DEFUZZIFY") {
                self.defuzzify(&mut draft)?;
            } else if self.eat_word("RULEBLOCK") {
                self.rule_block(&mut draft, at)?;
            } else if self.eat_word("END_FUNCTION_BLOCK") {
                return finish(name, draft);
            } else {
                return Err(self.unexpected("a section of the function block, or `END_FUNCTION_BLOCK`", SECTIONS));
            }
        }
    }

    fn variables(&mut self, draft: &mut Draft, kind: VariableKind) -> Result<()> {
        while !self.eat_word("END_VAR") {
            let at = self.at();
            let Ok(name) = self.name("") else {
                return Err(self.unexpected("the name of a variable, or `END_VAR`", &["END_VAR"]));
            };
            if draft.knows(name) {
                return Err(FclError { at, kind: FclErrorKind::Twice { what: "the variable", name: name.to_owned() } });
            }
            self.mark(':')?;
            self.keyword("REAL")?;
            self.mark(';')?;
            let name = name.to_owned();
            match kind {
                VariableKind::Input => {
                    draft.inputs.push(InputDraft { name, at, terms: None, term_places: Vec::new(), range: None });
                }
                VariableKind::Output => draft.outputs.push(OutputDraft {
                    name,
                    at,
                    defuzzified: false,
                    terms: Vec::new(),
                    term_places: Vec::new(),
                    range: None,
                    method: None,
                    accumulation: None,
                    default: None,
                }),
                VariableKind::Local => draft.locals.push(name),
            }
            let most = draft.inputs.len().max(draft.outputs.len()).max(draft.locals.len());
            self.check_count(most, Limits::VARIABLES_MAX + 1, "variables")?;
        }
        Ok(())
    }

    fn fuzzify(&mut self, draft: &mut Draft) -> Result<()> {
        let at = self.at();
        let name = self.name("the name of an input")?;
        let Some(index) = draft.input(name) else {
            let kind = unknown("input", name, draft.inputs.iter().map(|input| input.name.as_str()));
            return Err(FclError { at, kind });
        };
        let input = &mut draft.inputs[index];
        if input.terms.is_some() {
            return Err(FclError { at, kind: FclErrorKind::Twice { what: "FUZZIFY", name: name.to_owned() } });
        }
        let mut terms = Vec::new();
        while !self.eat_word("END_FUZZIFY") {
            if self.is_word("TERM") {
                self.term(&mut terms, &mut input.term_places)?;
            } else if self.is_word("RANGE") {
                let at = self.at();
                let before = input.range.replace(self.range()?);
                once(before.is_none(), "RANGE", &input.name, at)?;
            } else {
                let words = &["TERM", "RANGE", "END_FUZZIFY"];
                return Err(self.unexpected("`TERM`, `RANGE` or `END_FUZZIFY`", words));
            }
        }
        has_terms(&terms, "the input", name, at)?;
        input.terms = Some(terms);
        Ok(())
    }

    fn defuzzify(&mut self, draft: &mut Draft) -> Result<()> {
        let at = self.at();
        let name = self.name("the name of an output")?;
        let Some(index) = draft.output(name) else {
            let kind = unknown("output", name, draft.outputs.iter().map(|output| output.name.as_str()));
            return Err(FclError { at, kind });
        };
        let output = &mut draft.outputs[index];
        if output.defuzzified {
            return Err(FclError { at, kind: FclErrorKind::Twice { what: "DEFUZZIFY", name: name.to_owned() } });
        }
        output.defuzzified = true;
        while !self.eat_word("END_DEFUZZIFY") {
            self.defuzzify_clause(output)?;
        }
        has_terms(&output.terms, "the output", name, at)?;
        let Some((method, method_at)) = output.method else {
            let kind = FclErrorKind::Incomplete { what: "the output", name: name.to_owned(), lacks: "has no METHOD" };
            return Err(FclError { at, kind });
        };
        let method_fits = fits(method, &output.terms, output.range);
        method_fits.map_err(|reason| FclError {
            at: method_at,
            kind: FclErrorKind::MethodDoesNotFit { method: method.word(), reason },
        })
    }

    fn defuzzify_clause(&mut self, output: &mut OutputDraft) -> Result<()> {
        let at = self.at();
        if self.is_word("TERM") {
            return self.term(&mut output.terms, &mut output.term_places);
        }
        if self.is_word("RANGE") {
            let before = output.range.replace(self.range()?);
            return once(before.is_none(), "RANGE", &output.name, at);
        }
        if self.eat_word("METHOD") {
            let before = output.method.replace((self.method()?, at));
            return once(before.is_none(), "METHOD", &output.name, at);
        }
        if self.eat_word("ACCU") {
            let before = output.accumulation.replace(self.choice(Accumulation::ALL, Accumulation::word)?);
            return once(before.is_none(), "ACCU", &output.name, at);
        }
        if self.eat_word("DEFAULT") {
            self.assign()?;
            let value = if self.eat_word("NC") { None } else { Some(self.number()?) };
            self.mark(';')?;
            return once(output.default.replace(value).is_none(), "DEFAULT", &output.name, at);
        }
        let words = &["TERM", "METHOD", "ACCU", "DEFAULT", "RANGE", "END_DEFUZZIFY"];
        Err(self.unexpected("`TERM`, `METHOD`, `ACCU`, `DEFAULT`, `RANGE` or `END_DEFUZZIFY`", words))
    }

    /// Parses `: WORD ;` of a method. MM is called MOM elsewhere.
    fn method(&mut self) -> Result<Method> {
        let next = self.tokens.get(self.next + 1).map(|(token, _)| token);
        if *self.peek() == Token::Mark(':')
            && matches!(next, Some(Token::Word(word)) if word.eq_ignore_ascii_case("MOM"))
        {
            self.advance();
            self.advance();
            self.mark(';')?;
            return Ok(Method::Mm);
        }
        self.choice(Method::ALL, Method::word)
    }

    fn range(&mut self) -> Result<(f64, f64)> {
        self.advance();
        self.assign()?;
        self.mark('(')?;
        let at = self.at();
        let low = self.number()?;
        if *self.peek() != Token::Dots {
            return Err(self.unexpected("`..`", &[]));
        }
        self.advance();
        let high = self.number()?;
        self.mark(')')?;
        self.mark(';')?;
        // The width must not overflow
        if low < high && (high - low).is_finite() {
            return Ok((low, high));
        }
        Err(FclError { at, kind: FclErrorKind::EmptyRange(low, high) })
    }

    fn term(&mut self, terms: &mut Vec<Term>, places: &mut Vec<Position>) -> Result<()> {
        self.check_count(terms.len(), Limits::TERMS_MAX, "terms")?;
        self.advance();
        let at = self.at();
        let name = self.name("the name of a term")?;
        if terms.iter().any(|term| term.name.eq_ignore_ascii_case(name)) {
            return Err(FclError { at, kind: FclErrorKind::Twice { what: "the term", name: name.to_owned() } });
        }
        self.assign()?;
        let membership = if *self.peek() == Token::Mark('(') {
            self.points()?
        } else if matches!(self.peek(), Token::Number(..) | Token::Mark('-' | '+')) {
            Membership::Singleton(self.number()?)
        } else {
            return Err(self.unexpected("a number or a point `(x, y)`", &[]));
        };
        self.mark(';')?;
        terms.push(Term { name: name.to_owned(), membership });
        places.push(at);
        Ok(())
    }

    fn points(&mut self) -> Result<Membership> {
        let mut points: Vec<(f64, f64)> = Vec::new();
        while self.eat_mark('(') {
            self.check_count(points.len(), Limits::POINTS_MAX, "points")?;
            let at = self.at();
            let x = self.number()?;
            self.mark(',')?;
            let y = self.unit("the degree")?;
            self.mark(')')?;
            if let Some(&(before, _)) = points.last()
                && !(before <= x && (x - before).is_finite())
            {
                return Err(FclError { at, kind: FclErrorKind::PointsOutOfOrder(before, x) });
            }
            points.push((x, y));
        }
        Ok(Membership::Linear(points))
    }
}

#[derive(Clone, Copy)]
enum VariableKind {
    Input,
    Output,
    Local,
}

pub(super) fn once(first: bool, what: &'static str, name: &str, at: Position) -> Result<()> {
    if first { Ok(()) } else { Err(FclError { at, kind: FclErrorKind::Twice { what, name: name.to_owned() } }) }
}

fn has_terms(terms: &[Term], what: &'static str, name: &str, at: Position) -> Result<()> {
    if !terms.is_empty() {
        return Ok(());
    }
    Err(FclError { at, kind: FclErrorKind::Incomplete { what, name: name.to_owned(), lacks: "has no TERM" } })
}

/// Checks that a method fits these terms; the error is the reason.
fn fits(method: Method, terms: &[Term], range: Option<(f64, f64)>) -> std::result::Result<(), &'static str> {
    let singletons = terms.iter().filter(|term| matches!(term.membership, Membership::Singleton(_))).count();
    let extent = terms
        .iter()
        .map(|term| term.membership.extent())
        .fold((f64::INFINITY, f64::NEG_INFINITY), |a, b| (a.0.min(b.0), a.1.max(b.1)));
    if singletons != 0 && singletons != terms.len() {
        return Err("some are singletons and some are not");
    }
    match method {
        Method::Cogs if singletons == 0 => Err("it needs singletons"),
        Method::Cog | Method::Coa if singletons != 0 => Err("singletons have no area; use COGS"),
        _ if !(extent.1 - extent.0).is_finite() => Err("they are too far apart for this method"),
        _ if singletons == 0 && range.is_none() && extent.0 >= extent.1 => Err("they span no range"),
        _ => Ok(()),
    }
}

fn finish(name: String, draft: Draft) -> Result<(FunctionBlock, Places)> {
    let incomplete = |what, name: &str, lacks, at| FclError {
        at,
        kind: FclErrorKind::Incomplete { what, name: name.to_owned(), lacks },
    };
    let mut places = Places { rules: draft.rule_places, ..Places::default() };
    let mut inputs = Vec::with_capacity(draft.inputs.len());
    for InputDraft { name, at, terms, term_places, range } in draft.inputs {
        let Some(terms) = terms else {
            return Err(incomplete("the input", &name, "is never fuzzified", at));
        };
        inputs.push(InputVariable { name, terms, range, found: None });
        places.inputs.push(VariablePlaces { at, terms: term_places });
    }
    let mut outputs = Vec::with_capacity(draft.outputs.len());
    for output in draft.outputs {
        let OutputDraft { name, at, terms, term_places, range, method, accumulation, default, .. } = output;
        let Some((method, _)) = method else {
            return Err(incomplete("the output", &name, "is never defuzzified", at));
        };
        outputs.push(OutputVariable { name, terms, range, method, accumulation, default: default.flatten() });
        places.outputs.push(VariablePlaces { at, terms: term_places });
    }
    let block = FunctionBlock { name, inputs, outputs, locals: draft.locals, rule_blocks: draft.rule_blocks };
    Ok((block, places))
}
