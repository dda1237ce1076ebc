//! Spans of activity of one resource, in bounded memory.

use std::time::Duration;

use super::time::Time;
use crate::Activity;

/// A span of time with one activity of a resource.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Span {
    /// The activity during the span.
    pub activity: Activity,
    /// The start of the span.
    pub from: Time,
    /// The end of the span.
    pub to: Time,
}

/// Spans in order of time. If there are too many, idle gaps shorter than a limit count as work, and the limit doubles
/// until there is room: a drawing cannot show that many spans anyway.
pub(crate) struct Spans {
    kept: Vec<Span>,
    max: usize,
    /// Idle spans shorter than this are merged with the work around them.
    grain: Duration,
}

impl Spans {
    pub(crate) fn new(max: usize) -> Self {
        Self { kept: Vec::new(), max, grain: Duration::ZERO }
    }

    pub(crate) fn push(&mut self, span: Span) {
        if self.max == 0 || span.to <= span.from {
            return;
        }
        self.append(span);
        while self.kept.len() > self.max {
            self.grain = (2 * self.grain).max(Duration::from_micros(1));
            for span in std::mem::take(&mut self.kept) {
                self.append(span);
            }
            if self.grain > Duration::from_secs(1 << 32) {
                self.kept.remove(0); // Nothing that may be joined is left.
            }
        }
    }

    fn append(&mut self, span: Span) {
        let short = |span: &Span| span.activity == Activity::Idle && span.to.since(span.from) < self.grain;
        match self.kept.last_mut() {
            // Merge spans too short to show with the one before, and two of one activity
            Some(last) if last.activity == span.activity || (short(&span) && last.activity == Activity::Working) => {
                last.to = span.to;
            }
            Some(last) if short(last) && span.activity == Activity::Working => {
                (last.activity, last.to) = (span.activity, span.to);
            }
            _ => self.kept.push(span),
        }
    }

    /// Returns all spans, followed by `last`.
    pub(crate) fn with(&self, last: Span) -> Vec<Span> {
        let mut spans = self.kept.clone();
        if self.max > 0 && last.to > last.from {
            spans.push(last);
        }
        spans
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn many_spans_are_kept_in_bounded_memory_without_holes() {
        let mut spans = Spans::new(50);
        let mut now = Time::ZERO;
        for step in 0..10_000_u64 {
            let activity = if step % 2 == 0 { Activity::Working } else { Activity::Idle };
            let to = now.after(Duration::from_micros(1 + step % 97));
            spans.push(Span { activity, from: now, to });
            now = to;
        }
        let all = spans.with(Span { activity: Activity::Idle, from: now, to: now });
        assert!(all.len() <= 50 && !all.is_empty());
        assert!(all.windows(2).all(|pair| pair[0].to == pair[1].from));
        assert_eq!((all[0].from, all[all.len() - 1].to), (Time::ZERO, now));
    }
}
