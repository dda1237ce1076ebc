//! Protocols, stores and drivers without a network.

mod contract_net;
mod file_store;
mod hostile;
mod local;
mod replicas;
mod simulator;
