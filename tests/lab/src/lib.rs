//! The laboratory: evidence for the product, one command per study. Nothing of it ships.
//!
//! - `error`: error against run time of built-in scenes and standard problems, beside methods that share no code with the product;
//! - `stability`: stiff and extreme cases, each in a process of its own, judged;
//! - `random`: random valid scenes, small and violent, with what must hold of each;
//! - `cube`, `stage`, `convergence`, `modes`: what the paper's figures show of the models that ship;
//! - `beside`: any scene of blades beside an independent stepper;
//! - `witness`: reduced blades against full finite elements; `bases`: what a blade is reduced to;
//! - `scatter`: adaptive steps on random rubs and sectors;
//! - `conjugacy`: forces, moments and work on both sides of contacts; `inputs`: what the communication step does;
//! - `coupling`: a rub and a shaft stepped by turns, with and without derivatives over the step;
//! - `wear`: one blade in a coating, lobes of the wear beside its vibrations.

#![warn(unreachable_pub)]
mod bases;
mod beside;
pub mod cli;
mod conjugacy;
mod convergence;
mod coupling;
mod cube;
mod error;
mod estimates;
mod inputs;
mod modes;
mod random;
mod refinement;
mod scatter;
mod stability;
mod stage;
mod wear;
mod witness;
