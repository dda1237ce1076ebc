//! A door in front of a fake farm, by its answers over a socket.

mod api;
mod fake;
mod hostile;
mod tls;
