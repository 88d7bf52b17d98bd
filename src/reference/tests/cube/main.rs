//! Cube between two rings: scene, methods, other programs.

mod compare;
mod film_contacts;
mod methods;
mod outside;
mod scene;
