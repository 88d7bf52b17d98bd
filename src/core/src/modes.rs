//! Modal equations of motion and their time stepping.

pub mod bank;
pub mod coordinates;
pub mod cyclic;
pub mod excitation;
pub mod modal;
pub mod rigid;
pub mod schemes;
