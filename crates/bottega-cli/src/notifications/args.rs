//! Options of notifications.

use std::{env, fs, path::PathBuf, time::Duration};

use clap::{Args, ValueHint};

use super::{post::Secret, target::EventSubscription};
use crate::{error::CliError, option_value::parse_duration};

/// The environment variable that holds the secret.
pub(super) const SECRET_VARIABLE: &str = "BOTTEGA_ON_SECRET";
/// The allowed length of a secret, in bytes.
const SECRET_BYTES: std::ops::RangeInclusive<usize> = 8..=4096;
/// The default time without a finished zone after which a job counts as stalled.
const STALLED_AFTER: Duration = Duration::from_secs(600);

/// Options of notifications, which are not part of the request.
#[derive(Clone, Debug, Default, Args)]
#[command(next_help_heading = "Notifications")]
pub(crate) struct NotificationArgs {
    /// Report some of the events done, failed and stalled to a URL (POST of JSON), a command (JSON on its standard input) or
    /// the `desktop`. May be given several times. docs/farm.md has the fields.
    #[arg(long = "on", value_name = "EVENTS=URL|COMMAND|desktop")]
    on: Vec<EventSubscription>,
    /// File with the secret that signs what is sent to URLs: header `Bottega-Signature` (HMAC-SHA256 of the body). Or the
    /// variable BOTTEGA_ON_SECRET.
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath, requires = "on")]
    on_secret_file: Option<PathBuf>,
    /// Time without a finished zone after which an active job is stalled. [default: 10m]
    #[arg(long, value_name = "TIME", value_parser = parse_duration, requires = "on")]
    stalled_after: Option<Duration>,
}

impl NotificationArgs {
    /// Returns true if there are no subscriptions.
    pub(crate) fn is_empty(&self) -> bool {
        self.on.is_empty()
    }

    pub(super) fn subscriptions(&self) -> Vec<EventSubscription> {
        self.on.clone()
    }

    pub(super) fn stalled_after(&self) -> Duration {
        self.stalled_after.unwrap_or(STALLED_AFTER)
    }

    /// Returns the secret, if there is one.
    ///
    /// # Errors
    /// The secret cannot be read, or is too short or too long.
    pub(super) fn secret(&self) -> Result<Option<Secret>, CliError> {
        let (origin, text) = match &self.on_secret_file {
            Some(path) => {
                let text = fs::read(path).map_err(|source| CliError::read(path.clone(), source))?;
                (format!("`{}`", path.display()), text)
            }
            None => match env::var(SECRET_VARIABLE) {
                Ok(text) if !text.is_empty() => (SECRET_VARIABLE.to_owned(), text.into_bytes()),
                _ => return Ok(None),
            },
        };
        let text = text.trim_ascii_end();
        if !SECRET_BYTES.contains(&text.len()) {
            let problem = format!("the secret of {origin} has {} bytes", text.len());
            let remedy = format!(
                "from {} to {} are allowed, such as `openssl rand -hex 32` makes",
                SECRET_BYTES.start(),
                SECRET_BYTES.end()
            );
            return Err(CliError::usage(problem, remedy));
        }
        Ok(Some(Secret::new(text)))
    }
}
