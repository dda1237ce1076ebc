//! The program as users run it: alone, in farms of real processes, in the browser, with other engines.

mod desktop;
mod engines;
mod farm;
mod manual;
mod notifications;
mod page;
mod program;
mod support;
