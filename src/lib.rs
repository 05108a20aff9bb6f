//! cobake bakes lightmaps: glTF in, glTF with EXR lightmaps out.
pub mod authored;
mod bake;
pub mod cob;
pub mod compare;
pub mod density;
pub mod element;
pub mod error;
pub mod export;
pub mod geom;
pub mod inspect;
pub mod light;
pub mod options;
pub mod picture;
pub mod progress;
pub mod raster;
pub mod report;
pub mod retriangulate;
pub mod scene;
pub mod solve;
pub mod surface;
pub mod trace;
pub mod unwrap;
pub mod view;

pub use bake::{BakeResult, bake, bake_scene};

/// Holds the README's Rust to what the library offers.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
