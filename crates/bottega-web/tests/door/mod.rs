//! A door, by what it answers over a socket: a farm that is none stands behind it.

mod api;
mod fake;
mod hostile;
mod tls;
