//! The Fuzzy Control Language (IEC 61131-7) as text: lexer, parser, printer.

mod error;
mod lexer;
mod parser;
mod places;
mod print;
mod rules;

pub use error::{FclError, FclErrorKind, Position};
pub use parser::{Document, parse_document};
pub(crate) use places::Places;
