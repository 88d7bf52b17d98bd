//! The cube between two rings: scene, methods, codes of others.

mod compare;
mod film_contacts;
mod methods;
mod outside;
mod scene;
