//! The parser of rule blocks.

use super::{
    error::{FclError, FclErrorKind, Position},
    lexer::Token,
    parser::{Draft, Parser, Result, once, unknown},
};
use crate::{
    block::{Conclusion, Condition, Rule, RuleBlock, Term},
    limits::Limits,
    operators::{Accumulation, Activation, And, Or},
};

fn term_index(terms: &[Term], variable: &str, name: &str, at: Position) -> Result<usize> {
    let found = terms.iter().position(|term| term.name.eq_ignore_ascii_case(name));
    found.ok_or_else(|| {
        let names = terms.iter().map(|term| term.name.as_str());
        FclError { at, kind: unknown(format!("term of `{variable}` called"), name, names) }
    })
}

impl Parser<'_> {
    pub(super) fn rule_block(&mut self, draft: &mut Draft, at: Position) -> Result<()> {
        let name = self.name("the name of the rule block")?.to_owned();
        let (mut and, mut or, mut activation, mut accumulation) = (None, None, None, None);
        let mut rules: Vec<Rule> = Vec::new();
        while !self.eat_word("END_RULEBLOCK") {
            let at = self.at();
            if self.eat_word("AND") {
                once(and.replace(self.choice(And::ALL, And::word)?).is_none(), "AND", &name, at)?;
            } else if self.eat_word("OR") {
                once(or.replace(self.choice(Or::ALL, Or::word)?).is_none(), "OR", &name, at)?;
            } else if self.eat_word("ACT") {
                once(activation.replace(self.choice(Activation::ALL, Activation::word)?).is_none(), "ACT", &name, at)?;
            } else if self.eat_word("ACCU") {
                let chosen = self.choice(Accumulation::ALL, Accumulation::word)?;
                once(accumulation.replace(chosen).is_none(), "ACCU", &name, at)?;
            } else if self.eat_word("RULE") {
                let before = || draft.rule_blocks.iter().flat_map(|block| &block.rules).chain(&rules);
                self.check_count(before().count(), Limits::RULES_MAX, "rules")?;
                let rule = self.rule(draft)?;
                let conclusions = before().chain([&rule]).map(|rule| rule.conclusions.len()).sum::<usize>();
                self.check_count(conclusions, Limits::CONCLUSIONS_MAX + 1, "conclusions")?;
                rules.push(rule);
                draft.rule_places.push(at);
            } else {
                let words = &["AND", "OR", "ACT", "ACCU", "RULE", "END_RULEBLOCK"];
                return Err(self.unexpected("`AND`, `OR`, `ACT`, `ACCU`, `RULE` or `END_RULEBLOCK`", words));
            }
        }
        let (and, or) = match (and, or) {
            (None, None) => (And::default(), Or::default()),
            (Some(and), None) => (and, and.dual()),
            (None, Some(or)) => (or.dual(), or),
            (Some(and), Some(or)) if and.dual() == or => (and, or),
            (Some(and), Some(or)) => {
                let kind = FclErrorKind::NotDual { and: and.word(), or: or.word(), dual: and.dual().word() };
                return Err(FclError { at, kind });
            }
        };
        let (activation, accumulation) = (activation.unwrap_or_default(), accumulation.unwrap_or_default());
        draft.rule_blocks.push(RuleBlock { name, and, or, activation, accumulation, rules });
        Ok(())
    }

    /// Parses a rule, after its first keyword.
    fn rule(&mut self, draft: &Draft) -> Result<Rule> {
        let label = match *self.peek() {
            Token::Number(_, written) => {
                self.advance();
                written.to_owned()
            }
            _ => self.name("the number or name of the rule")?.to_owned(),
        };
        self.mark(':')?;
        self.keyword("IF")?;
        let condition = self.condition(draft, 0)?;
        self.keyword("THEN")?;
        let mut conclusions = vec![self.conclusion(draft)?];
        while self.eat_mark(',') || self.eat_word("AND") {
            self.check_count(conclusions.len(), Limits::VARIABLES_MAX, "conclusions")?;
            conclusions.push(self.conclusion(draft)?);
        }
        let weight = if self.eat_word("WITH") { self.unit("the weight")? } else { 1.0 };
        if !self.eat_mark(';') {
            return Err(self.unexpected("`;`, `,` or `WITH`", &["WITH", "AND"]));
        }
        Ok(Rule { label, condition, conclusions, weight })
    }

    fn condition(&mut self, draft: &Draft, depth: usize) -> Result<Condition> {
        let mut parts = vec![self.conjunction(draft, depth)?];
        while self.eat_word("OR") {
            parts.push(self.conjunction(draft, depth)?);
        }
        Ok(if parts.len() == 1 { parts.remove(0) } else { Condition::Or(parts) })
    }

    fn conjunction(&mut self, draft: &Draft, depth: usize) -> Result<Condition> {
        let mut parts = vec![self.single(draft, depth)?];
        while self.eat_word("AND") {
            parts.push(self.single(draft, depth)?);
        }
        Ok(if parts.len() == 1 { parts.remove(0) } else { Condition::And(parts) })
    }

    fn single(&mut self, draft: &Draft, depth: usize) -> Result<Condition> {
        self.check_count(depth, Limits::DEPTH_MAX, "brackets within brackets")?;
        if self.eat_word("NOT") {
            return Ok(Condition::Not(Box::new(self.single(draft, depth + 1)?)));
        }
        if self.eat_mark('(') {
            let inner = self.condition(draft, depth + 1)?;
            self.mark(')')?;
            return Ok(inner);
        }
        let at = self.at();
        let name = self.name("an input, `NOT` or `(`")?;
        let Some(input) = draft.input(name) else {
            let kind = unknown("input", name, draft.inputs.iter().map(|input| input.name.as_str()));
            return Err(FclError { at, kind });
        };
        if !self.eat_word("IS") {
            return Err(self.unexpected("`IS`", &["IS"]));
        }
        let negated = self.eat_word("NOT");
        let term_at = self.at();
        let term = self.name("the name of a term")?;
        let terms = draft.inputs[input].terms.as_deref().ok_or_else(|| FclError {
            at,
            kind: FclErrorKind::Incomplete {
                what: "the input",
                name: name.to_owned(),
                lacks: "is used in a rule before it is fuzzified",
            },
        })?;
        let term = term_index(terms, name, term, term_at)?;
        Ok(if negated { Condition::IsNot { input, term } } else { Condition::Is { input, term } })
    }

    fn conclusion(&mut self, draft: &Draft) -> Result<Conclusion> {
        let at = self.at();
        let name = self.name("an output")?;
        let Some(output) = draft.output(name) else {
            let kind = unknown("output", name, draft.outputs.iter().map(|output| output.name.as_str()));
            return Err(FclError { at, kind });
        };
        self.keyword("IS")?;
        let term_at = self.at();
        let term = self.name("the name of a term")?;
        if !draft.outputs[output].defuzzified {
            let lacks = "is used in a rule before it is defuzzified";
            let kind = FclErrorKind::Incomplete { what: "the output", name: name.to_owned(), lacks };
            return Err(FclError { at, kind });
        }
        let term = term_index(&draft.outputs[output].terms, name, term, term_at)?;
        Ok(Conclusion { output, term })
    }
}
