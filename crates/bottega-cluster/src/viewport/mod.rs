//! A viewport whose samples come from all free machines of a farm: the messages between its owner and the machines.

pub(crate) mod call;
pub(crate) mod calls;
pub(crate) mod frame;
