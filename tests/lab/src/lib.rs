//! The laboratory: evidence for the product, one command per study. It is not part of a release.
//!
//! - `error`: error against run time of built-in scenes and standard problems, compared with methods that share no code
//!   with the product;
//! - `stability`: stiff and extreme cases, each in a separate process, with a verdict;
//! - `random`: random valid scenes, small and violent, with the properties that each must have;
//! - `cube`, `stage`, `convergence`, `modes`: comparison of the built-in models with the paper's figures;
//! - `bench`: time and error of rubs, with baselines; `scaling`: growth of the time with the size of a rub;
//! - `beside`: any scene of blades compared with an independent stepper;
//! - `witness`: reduced blades against full finite elements; `bases`: reduction bases of a blade;
//! - `scatter`: adaptive steps on random rubs and sectors;
//! - `conjugacy`: forces, moments and work on both sides of contacts; `inputs`: effect of the communication step;
//! - `coupling`: a rub and a shaft stepped alternately, with and without derivatives over the step;
//! - `penetration`: gaps of adaptive steps, sampled between their points;
//! - `wear`: one blade in a coating, wear lobes compared with its vibrations.

#![warn(unreachable_pub)]
mod bases;
mod bench;
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
mod penetration;
mod random;
mod refinement;
mod scaling;
mod scatter;
mod stability;
mod stage;
mod wear;
mod witness;
