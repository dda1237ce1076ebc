//! The value of `--on`: events, and the target of their notifications.

use std::str::FromStr;

use hyper::Uri;

use crate::option_value::InvalidValue;

/// An event that can be reported.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum WorkEvent {
    /// The image is finished.
    Done,
    /// The render failed.
    Failed,
    /// No zone was finished for a while.
    Stalled,
}

impl WorkEvent {
    /// Returns the word used in options and messages.
    pub(super) fn word(self) -> &'static str {
        match self {
            Self::Done => "done",
            Self::Failed => "failed",
            Self::Stalled => "stalled",
        }
    }
}

/// The target of notifications.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum NotificationTarget {
    /// An HTTP server.
    Url(Uri),
    /// A command line for the shell.
    Command(String),
    /// The desktop of the user.
    Desktop,
}

impl NotificationTarget {
    /// Returns the target's name for messages, without the path of a URL, which may hold a secret.
    pub(super) fn label(&self) -> String {
        match self {
            Self::Url(url) => {
                format!(
                    "{}://{}",
                    url.scheme_str().unwrap_or_default(),
                    url.authority().map_or("", |authority| authority.as_str())
                )
            }
            Self::Command(line) => format!("`{line}`"),
            Self::Desktop => "the desktop".to_owned(),
        }
    }
}

/// One `--on`: events, and the target of their notifications.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct EventSubscription {
    pub(super) events: Vec<WorkEvent>,
    pub(super) target: NotificationTarget,
}

impl FromStr for EventSubscription {
    type Err = InvalidValue;

    fn from_str(text: &str) -> Result<Self, InvalidValue> {
        let form = "write events, `=` and a target, such as done,failed=https://example.org/hook, done=desktop or \
                    failed='mail -s failed me'";
        let (events, target) = text.split_once('=').ok_or(form)?;
        let events: Vec<WorkEvent> = events.split(',').map(|word| event(word.trim())).collect::<Result<_, _>>()?;
        Ok(Self { events, target: parse_target(target.trim())? })
    }
}

fn event(word: &str) -> Result<WorkEvent, InvalidValue> {
    let events = [WorkEvent::Done, WorkEvent::Failed, WorkEvent::Stalled];
    events
        .into_iter()
        .find(|event| event.word() == word)
        .ok_or_else(|| format!("there is no event `{word}`: use done, failed or stalled, with commas between").into())
}

fn parse_target(text: &str) -> Result<NotificationTarget, InvalidValue> {
    if text.is_empty() {
        return Err("there is no target after `=`: write a URL, a command or `desktop`".into());
    }
    if text == "desktop" {
        return Ok(NotificationTarget::Desktop);
    }
    let scheme = text.split_once("://").map(|(scheme, _)| scheme);
    let is_scheme =
        |word: &str| !word.is_empty() && word.chars().all(|c| c.is_ascii_alphanumeric() || "+-.".contains(c));
    match scheme.filter(|scheme| is_scheme(scheme)) {
        None => Ok(NotificationTarget::Command(text.to_owned())),
        Some(scheme) if !matches!(scheme.to_ascii_lowercase().as_str(), "http" | "https") => {
            Err(format!("`{scheme}://` is unsupported: use http:// or https://").into())
        }
        Some(_) => {
            let url: Uri = text.parse().map_err(|error| format!("`{text}` is not a URL: {error}"))?;
            let authority = url.authority().ok_or_else(|| format!("`{text}` names no host"))?;
            if authority.as_str().contains('@') {
                return Err(
                    "a URL with a name and a password is unsupported: use a secret in the path, or --on-secret-file"
                        .into(),
                );
            }
            if authority.host().is_empty() {
                return Err(format!("`{text}` names no host").into());
            }
            Ok(NotificationTarget::Url(url))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<EventSubscription, InvalidValue> {
        text.parse()
    }

    #[test]
    fn urls_commands_and_the_desktop_are_distinguished() {
        let both = parse("done,failed=https://example.org:8443/hook?key=a=b").expect("a URL");
        assert_eq!(both.events, [WorkEvent::Done, WorkEvent::Failed]);
        assert!(matches!(&both.target, NotificationTarget::Url(url) if url.port_u16() == Some(8443)));
        assert_eq!(both.target.label(), "https://example.org:8443", "a path may be a secret");
        assert_eq!(parse("stalled=desktop").expect("the desktop").target, NotificationTarget::Desktop);
        let command = parse("done=notify --url=http://x").expect("a command");
        assert_eq!(command.target, NotificationTarget::Command("notify --url=http://x".to_owned()));
    }

    #[test]
    fn errors_name_the_remedy() {
        for (text, expected) in [
            ("done", "write events"),
            ("", "write events"),
            ("=http://x", "done, failed or stalled"),
            ("finished=http://x", "no event `finished`: use done, failed or stalled"),
            ("done,=http://x", "no event ``"),
            ("done=", "there is no target"),
            ("done=ftp://host/x", "use http:// or https://"),
            ("done=http://", "is not a URL"),
            ("done=http:///x", "is not a URL"),
            ("done=http://me:word@host/", "--on-secret-file"),
        ] {
            let error = parse(text).expect_err(text).to_string();
            assert!(error.contains(expected), "{text}: {error}");
        }
    }
}
