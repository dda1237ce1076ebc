//! Functions and objects with named parameters in FIPA SL, reading and writing; and FIPA's reasons for refusals.

use std::str::FromStr;

use bottega_agents::sl::Term;

/// The reason why a request is not carried out.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Unread {
    /// The request cannot be understood; with FIPA's reason.
    NotUnderstood(Term),
    /// The request is understood, but refused; with FIPA's reason.
    Refused(Term),
}

/// Returns the reason for a content that cannot be parsed.
pub(super) fn unrecognised_content() -> Unread {
    Unread::NotUnderstood(reason("unrecognised-value", ["content"]))
}

/// Returns a FIPA reason with text arguments.
pub(super) fn reason<const N: usize>(word: &str, arguments: [&str; N]) -> Term {
    Term::call(word, arguments.map(Term::text))
}

/// A function with named parameters.
pub(super) struct Call<'a> {
    pub(super) word: &'a str,
    arguments: &'a [Term],
}

impl<'a> Call<'a> {
    /// Reads `(word :parameter value …)`.
    pub(super) fn plain(term: &'a Term) -> Result<Self, Unread> {
        let (word, arguments) = term.as_call().ok_or_else(unrecognised_content)?;
        Ok(Self { word, arguments })
    }

    /// Reads `(action AID (word :parameter value …))`.
    pub(super) fn of(action: &'a Term) -> Result<Self, Unread> {
        let Some([_, act]) = action.arguments_of("action") else { return Err(unrecognised_content()) };
        Self::plain(act)
    }

    /// Returns true if the function has this name.
    pub(super) fn is(&self, word: &str) -> bool {
        self.word.eq_ignore_ascii_case(word)
    }

    /// Returns the reason for an unknown function.
    pub(super) fn unsupported(&self) -> Unread {
        Unread::Refused(reason("unsupported-function", [self.word]))
    }

    /// Returns the value of a parameter, if it is given.
    pub(super) fn value(&self, parameter: &str) -> Result<Option<&'a Term>, Unread> {
        let mut found = None;
        for pair in self.arguments.chunks(2) {
            let [Term::Bare(key), value] = pair else {
                return Err(Unread::Refused(reason("unexpected-argument-count", [])));
            };
            if key.strip_prefix(':').is_some_and(|key| key.eq_ignore_ascii_case(parameter)) {
                found = Some(value);
            }
        }
        Ok(found)
    }

    /// Returns the value of a required parameter.
    pub(super) fn needed(&self, parameter: &str) -> Result<&'a Term, Unread> {
        self.value(parameter)?.ok_or_else(|| Unread::Refused(reason("missing-parameter", [self.word, parameter])))
    }

    /// Returns the number in a required parameter.
    pub(super) fn number<T: FromStr>(&self, parameter: &str) -> Result<T, Unread> {
        let value = self.needed(parameter)?;
        value.as_str().and_then(|text| text.parse().ok()).ok_or_else(|| self.bad(parameter))
    }

    /// Returns a finite number of at least `least`; `None`: it is not given.
    pub(super) fn measure(&self, parameter: &str, least: f64) -> Result<Option<f64>, Unread> {
        let Some(value) = self.value(parameter)? else { return Ok(None) };
        let number = value.as_str().and_then(|text| text.parse().ok());
        let number = number.filter(|number: &f64| number.is_finite() && *number >= least);
        number.map(Some).ok_or_else(|| self.bad(parameter))
    }

    /// Returns the reason for an invalid value of a parameter.
    pub(super) fn bad(&self, parameter: &str) -> Unread {
        Unread::Refused(reason("unrecognised-parameter-value", [self.word, parameter]))
    }
}

/// An object with named parameters, under construction.
pub(super) struct Fields(Vec<Term>);

impl Fields {
    /// Starts an object of this type.
    pub(super) fn of(head: &str) -> Self {
        Self(vec![Term::text(head)])
    }

    /// Returns the finished object.
    pub(super) fn term(self) -> Term {
        Term::List(self.0)
    }

    /// Adds a parameter.
    pub(super) fn put(mut self, key: &str, value: Term) -> Self {
        self.0.extend([Term::Bare(format!(":{key}")), value]);
        self
    }

    /// Adds a text parameter.
    pub(super) fn text(self, key: &str, value: &str) -> Self {
        self.put(key, Term::text(value))
    }

    /// Adds a text parameter if there is a value.
    pub(super) fn text_if(self, key: &str, value: Option<&str>) -> Self {
        match value {
            Some(value) => self.text(key, value),
            None => self,
        }
    }

    /// Adds a number, or another value without quotes.
    pub(super) fn number(self, key: &str, value: &impl ToString) -> Self {
        self.put(key, Term::Bare(value.to_string()))
    }
}
