//! The numbers of a file of IES, with their lines.

/// An error in the text of a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct IesFault {
    /// Line, counted from 1.
    pub(super) line: usize,
    /// The error, and in some cases the remedy.
    pub(super) problem: String,
}

/// The lines of a file. Lines end in LF, CR LF or CR.
pub(super) struct IesLines<'a> {
    rest: &'a str,
    /// Number of the next line, from 1.
    number: usize,
}

impl<'a> IesLines<'a> {
    pub(super) fn new(text: &'a str) -> Self {
        Self { rest: text, number: 1 }
    }

    /// Returns the next line and its number; `None`: the file has ended.
    pub(super) fn next(&mut self) -> Option<(&'a str, usize)> {
        if self.rest.is_empty() {
            return None;
        }
        let end = self.rest.find(['\n', '\r']).unwrap_or(self.rest.len());
        let (line, after) = self.rest.split_at(end);
        let feed = if after.starts_with("\r\n") { 2 } else { after.len().min(1) };
        self.rest = &after[feed..];
        self.number += 1;
        Some((line, self.number - 1))
    }

    /// Returns the numbers that follow.
    pub(super) fn numbers(self) -> IesNumbers<'a> {
        IesNumbers { lines: self, line: "", number: 0 }
    }
}

/// Numbers that follow each other, separated by blanks, commas and ends of lines.
pub(super) struct IesNumbers<'a> {
    lines: IesLines<'a>,
    /// The rest of the line, and its number.
    line: &'a str,
    number: usize,
}

impl IesNumbers<'_> {
    /// Makes an error at the number that was read last.
    pub(super) fn fault(&self, problem: impl Into<String>) -> IesFault {
        IesFault { line: self.number.max(1), problem: problem.into() }
    }

    /// Returns the number of bytes that may hold numbers.
    pub(super) fn left(&self) -> usize {
        self.line.len() + self.lines.rest.len()
    }

    /// Reads a finite number. `what`: names it in errors.
    pub(super) fn number(&mut self, what: &str) -> Result<f64, IesFault> {
        let is_gap = |letter: char| letter.is_whitespace() || letter == ',' || letter == '\0' || letter == '\x1a';
        loop {
            self.line = self.line.trim_start_matches(is_gap);
            if !self.line.is_empty() {
                break;
            }
            let Some((line, number)) = self.lines.next() else {
                return Err(self.fault(format!("the file ends before {what}; copy or export it again")));
            };
            (self.line, self.number) = (line, number);
        }
        let end = self.line.find(is_gap).unwrap_or(self.line.len());
        let (word, rest) = self.line.split_at(end);
        self.line = rest;
        let read = word.parse::<f64>().ok().filter(|number| number.is_finite());
        read.ok_or_else(|| {
            let shown = crate::text::shortened(word);
            self.fault(format!("`{shown}` is not a number; {what} is expected here"))
        })
    }

    /// Reads a whole number within bounds, both included.
    pub(super) fn count(&mut self, what: &str, [low, high]: [usize; 2]) -> Result<usize, IesFault> {
        let number = self.number(what)?;
        if number.fract() != 0.0 || number < low as f64 || number > high as f64 {
            return Err(self.fault(format!("{what} is {number}; a whole number from {low} to {high} is needed")));
        }
        Ok(number as usize)
    }

    /// Reads several numbers.
    pub(super) fn list(&mut self, what: &str, count: usize) -> Result<Vec<f64>, IesFault> {
        // Each takes two bytes, so a file that announces too much allocates nothing
        if count > self.left().div_ceil(2) + 1 {
            return Err(self.fault(format!("{count} numbers are announced for {what}, more than the file has")));
        }
        (0..count).map(|_| self.number(what)).collect()
    }
}
