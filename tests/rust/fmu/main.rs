//! The FMU library through its C ABIs: exports, call order, steps, saved states, and hosts that break the rules.

mod call_order;
mod exports;
mod features;
mod host;
mod hostile;
mod panics;
mod states;
mod stepping;
mod thermal;
mod threads;
