//! The library inside the FMU: the C ABIs of FMI 2.0 (44 functions) and FMI 3.0 (75 functions) over one neutral slave.
//!
//! ```text
//! fmi2/  fmi3/     one expression per exported function, no unsafe block
//!      \  /
//!    boundary/     the only unsafe code: pointers to slices and back, callbacks, the guard around every call
//!       |
//!     slave/       safe: phase of life, call order, variable access, stepping, saved states
//!       |
//!   tiprub-core    the contact simulation
//! ```
//!
//! Invariants, written as what is absent: no unsafe code outside `boundary` (the `no_mangle` attributes of the façades
//! apart), no global mutable state (but the silent panic hook of this library's own copy of the standard library), no
//! thread, no output, no panic across the ABI, no value handed out by a call that did not succeed.
#![warn(unreachable_pub)]
#![deny(unsafe_op_in_unsafe_fn)]

mod boundary;
mod fmi2;
mod fmi3;
#[forbid(unsafe_code)]
mod location;
#[forbid(unsafe_code)]
mod slave;
