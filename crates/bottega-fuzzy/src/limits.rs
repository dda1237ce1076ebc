//! Limits on FCL texts.

/// Limits on FCL texts; the parser rejects a text that exceeds one.
#[derive(Clone, Copy, Debug)]
pub struct Limits;

impl Limits {
    /// Maximum length of a text, in bytes.
    pub const TEXT_BYTES_MAX: usize = 1 << 20;
    /// Maximum length of a name, a label or a number, in characters.
    pub const WORD_MAX: usize = 128;
    /// Maximum number of variables of one kind in a block, and of conclusions of one rule.
    pub const VARIABLES_MAX: usize = 64;
    /// Maximum number of terms of a variable.
    pub const TERMS_MAX: usize = 64;
    /// Maximum number of points of a term.
    pub const POINTS_MAX: usize = 32;
    /// Maximum number of rules of a block. With the number of points it bounds the cost of an evaluation.
    pub const RULES_MAX: usize = 1024;
    /// Maximum number of conclusions of all rules of a block.
    pub const CONCLUSIONS_MAX: usize = 1024;
    /// Maximum nesting of brackets and `NOT` in a condition.
    pub const DEPTH_MAX: usize = 64;
}
