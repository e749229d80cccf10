//! Pictures of scenes: a software renderer without window, GPU or system fonts.
//!
//! [`render()`] turns a [`Scene`] seen by a [`Camera`] into an [`Image`], the same bytes for the same
//! input. Opaque surfaces are seen from both sides; translucent ones (opacity below 1) from their
//! outside only, blended back to front at every sample, so that the inside of a translucent skin
//! stays visible. Two by two samples per pixel smooth the edges. What cannot be drawn (vertices
//! that are not finite, indices out of range, anything behind the camera) is left out.
#![cfg_attr(any(doc, doctest), doc = include_str!("../README.md"))]

mod camera;
mod color;
mod floor;
mod geometry;
mod image;
mod label;
mod lamps;
mod normals;
mod raster;
mod render;
mod scene;
mod sheet;
#[cfg(test)]
mod tests;
mod text;

pub use camera::{Camera, Projection};
pub use image::{Image, PictureError};
pub use render::{Stage, render};
pub use scene::{Anchor, Floor, Label, Line3, Scene, SurfaceInstance};
pub use sheet::tile;
pub use text::{TextSize, signed};
