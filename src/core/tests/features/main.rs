//! The features of a scene in all combinations: the ledger, states, laws of mechanics, no allocation.

#[path = "../common/counting.rs"]
mod counting;

mod apart;
mod casing;
mod chatter;
mod checks;
mod coating;
mod contour;
mod cutting;
mod cyclic;
mod cyclic_features;
mod excitation;
mod feature_pairs;
mod heat;
mod initial;

mod pairs;
mod skipped;
mod stress;
mod support;
