//! The library inside the thermal FMU: [`tiprub_thermal::ThermalSimulation`] behind the C ABIs of `tiprub-fmi-facade`.
#![warn(unreachable_pub)]

mod conduction;

tiprub_fmi_facade::library!(conduction::load);
