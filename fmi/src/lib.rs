//! The library inside the FMU of a scene: [`tiprub_core::Simulation`] behind the C ABIs of `tiprub-fmi-facade`.
#![warn(unreachable_pub)]

mod rub;

tiprub_fmi_facade::library!(rub::load);
