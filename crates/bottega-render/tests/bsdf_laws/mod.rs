//! The laws that every scattering function keeps: `sample` draws by `pdf`, nothing reflects more than it receives, and
//! light finds its way back. Statistical tests have fixed seeds and say at what significance they would fail by chance.

mod chi_square;
mod coats;
mod energy;
mod golden;
mod kinds;
mod limits;
mod measured;
mod support;
mod symmetry;
