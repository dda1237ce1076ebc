//! Bounds on what a text may ask for.

/// Bounds on what a text may ask for.
#[derive(Clone, Copy, Debug)]
pub struct Limits;

impl Limits {
    /// Bytes of a text.
    pub const TEXT_BYTES_MAX: usize = 1 << 20;
    /// Characters of a name, a label or a number.
    pub const WORD_MAX: usize = 128;
    /// Variables of a kind in a block.
    pub const VARIABLES_MAX: usize = 64;
    /// Terms of a variable.
    pub const TERMS_MAX: usize = 64;
    /// Points of a term.
    pub const POINTS_MAX: usize = 32;
    /// Rules of a block. With the number of points it bounds what an evaluation costs at worst.
    pub const RULES_MAX: usize = 1024;
    /// Conclusions of all rules of a block.
    pub const CONCLUSIONS_MAX: usize = 1024;
    /// Brackets within brackets of a condition.
    pub const DEPTH_MAX: usize = 64;
}
